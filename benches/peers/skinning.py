#!/usr/bin/env python3
"""Skinning beside libigl, on one thread: vertices per second of linear blend and dual quaternion skinning.

    skinning.py --programs target/release/examples/programs --libigl DQS [--rounds 5]

DQS is `dqs.cpp` of this folder, built with libigl's headers: its Python binding has no dual quaternions. libigl takes dense
weights: its linear blend is a product of a matrix made once (`lbs_matrix`) with those of the pose; its dual quaternions run over
all joints. Ours has four joints per vertex in compressed rows (double) or packed (single). Each round runs
all in turn; reported are the best. Both give the same positions, which is checked.

    skinning.py --weights --plumbline target/release/plumbline --media DIR

prints CPU seconds of automatic weights of rigged and extracted skeletons (the whole command), and how far they jump: the greatest
change of a row along an edge (half the sum of absolute differences), that of the edge in a thousand, and the greatest difference of a
weight from the mean of its neighbors.
"""
import argparse
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

for threads in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"]:
    os.environ[threads] = "1"
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests/oracle"))
import numpy as np  # noqa: E402

import _skins  # noqa: E402

# What is measured is computed.
os.environ["PLUMBLINE_CACHE"] = ""


def linear(V, W, M):
    """Positions by libigl's linear blend, and CPU seconds of one pose, the matrix of the weights being ready."""
    import igl
    L, T = igl.lbs_matrix(V, W), np.concatenate([m[:3, :].T for m in M])
    best = np.inf
    for _ in range(5):
        began = time.process_time()
        x = L @ T
        best = min(best, time.process_time() - began)
    return x, best


def dual(program, folder):
    """The same by its dual quaternions, from the files that our program was given last."""
    files = [os.path.join(folder, name) for name in ("rest", "weights", "matrices", "theirs")]
    seconds = float(subprocess.run([program, *files], check=True, capture_output=True, text=True).stdout)
    return np.fromfile(files[-1], "<f8").reshape(-1, 3), seconds


RIGS = [("rig/male_LR20.off", "rig/male.skel"), ("rig/armadillo_LR3.off", "rig/armadillo.skel"), ("hard/homer.off", None),
        ("hard/cheburashka.off", None), ("igl/elephant.obj", None), ("common/horse.off", None)]


def jumps(F, W):
    """Greatest change along an edge, that of the edge in a thousand, greatest difference from the mean of the neighbors."""
    E = np.unique(np.sort(np.concatenate([F[:, [0, 1]], F[:, [1, 2]], F[:, [2, 0]]]), 1), axis=0)
    steps = np.sort(np.abs(W[E[:, 0]] - W[E[:, 1]]).sum(1) / 2)
    sums, degree = np.zeros_like(W), np.bincount(E.ravel(), minlength=len(W))
    for i, j in [(0, 1), (1, 0)]:
        np.add.at(sums, E[:, i], W[E[:, j]])
    return steps[-1], steps[-1 - len(steps) // 1000], np.abs(W - sums / np.maximum(degree, 1)[:, None]).max()


def automatic(plumbline, media, folder):
    import _surfaces
    cpu = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])  # noqa: E731
    run = lambda *arguments: subprocess.run([plumbline, *map(str, arguments), "-y"], check=True, capture_output=True)  # noqa: E731
    print("mesh                  vertices joints method     |  CPU s   greatest step   in 1000   from the mean")
    for mesh, rig in RIGS:
        mesh, rig = media / "mesh" / mesh, media / "mesh" / rig if rig else folder / "skeleton.json"
        if not rig.exists() or rig.parent == folder:
            run("skeleton", mesh, "-o", rig)
        V, F = _surfaces.read_mesh(mesh)
        for method in ("heat", "biharmonic"):
            began = cpu()
            run("skin", "weights", mesh, "--skeleton", rig, "--method", method, "-o", folder / "weights.json")
            seconds = cpu() - began
            told = json.loads((folder / "weights.json").read_text())
            W = np.zeros((len(told["rows"]), len(told["joints"])))
            for row, entries in zip(W, told["rows"]):
                row[np.array(entries[::2], int)] = entries[1::2]
            step, most, spike = jumps(F, W)
            print(f"{mesh.stem:22} {len(V):7} {W.shape[1]:6} {method:10} | {seconds:6.2f} {step:15.3f} {most:9.3f} {spike:15.3f}", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--programs")
    parser.add_argument("--libigl")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--weights", action="store_true")
    parser.add_argument("--plumbline")
    parser.add_argument("--media", type=pathlib.Path)
    a = parser.parse_args()
    if a.weights:
        with tempfile.TemporaryDirectory() as folder:
            return automatic(a.plumbline, a.media, pathlib.Path(folder))
    print("vertices joints method |  libigl   double  ratio   single  ratio   (million vertices per CPU second)")
    with tempfile.TemporaryDirectory() as folder:
        for vertices, joints in [(43_243, 20), (172_966, 20), (172_966, 40), (1_000_000, 20)]:
            V, W, M = _skins.made(vertices, joints, 4, seed=1)
            for method in ("lbs", "dqs"):
                best = {"libigl": np.inf, "double": np.inf, "single": np.inf}
                repeat = ["--repeat", str(max(3, 2_000_000 // vertices))]
                for _ in range(a.rounds):
                    _skins.write(folder, V, W, M)
                    expected, seconds = linear(V, W, M) if method == "lbs" else dual(a.libigl, folder)
                    best["libigl"] = min(best["libigl"], seconds)
                    for name, allowed in (("double", 1e-9), ("single", 2e-6)):
                        x, told = _skins.ours([a.programs, "skin_points"], folder, V, W, M, method, *repeat,
                                              *(["--single"] if name == "single" else []))
                        best[name] = min(best[name], told["seconds"])
                        diagonal = np.linalg.norm(expected.max(0) - expected.min(0))
                        assert np.abs(x - expected).max() < allowed * diagonal, (method, name)
                rate = {k: vertices / s / 1e6 for k, s in best.items()}
                print(f"{vertices:8} {joints:6} {method:6} | {rate['libigl']:7.1f}  {rate['double']:7.1f} "
                      f"{rate['double'] / rate['libigl']:6.1f}  {rate['single']:7.1f} "
                      f"{rate['single'] / rate['libigl']:6.1f}", flush=True)


if __name__ == "__main__":
    main()
