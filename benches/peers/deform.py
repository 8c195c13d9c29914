#!/usr/bin/env python3
"""ARAP beside libigl, on one thread: precomputation, seconds per iteration, and CPU seconds to 1.01 of the converged energy.

    deform.py --example target/release/examples/deform_mesh --media DIR [--rounds 3] [--large]

Spokes and rims, the same handles, exactly held. libigl starts at rest, as its interface has it; how many of its iterations
reach 1.01 E* is read off our own local-global iterations from the same start, which are the same ones (both energies are
checked to agree). Ours is the default: rotations spread from the handles, then accelerated. Each round runs both in turn;
reported are the minima. --large adds the armadillo once subdivided (173 thousand vertices).
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

for threads in ["OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"]:
    os.environ[threads] = "1"
sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests/oracle"))
import _surfaces  # noqa: E402

# Iterations that libigl is timed over where it would need more than a minute.
AT_MOST = 400


def ours(example, folder, *options):
    command = [example, folder / "mesh.off", folder / "pose.txt", "arap", *options]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def measure(a, name, V, F, b, T, folder):
    _surfaces.write_off(folder / "mesh.off", V, F)
    _surfaces.write_pose(folder / "pose.txt", b, T)
    small = len(V) < 20_000
    repeat = str(max(1, 40_000 // len(V)))
    best = ours(a.example, folder, "--iterations", "4000", "--tolerance", "1e-10")["energies"][-1]
    plain = ours(a.example, folder, "--solver", "local-global", "--start", "rest", "--iterations", "3000", "--tolerance",
                 "1e-10" if small else "1e-7")["energies"]
    best = min(best, plain[-1])
    needed = next((k for k, e in enumerate(plain) if e <= 1.01 * best), len(plain))
    U, *_ = _surfaces.libigl(V, F, b, T, "arap", min(needed, AT_MOST))
    theirs = _surfaces.energy(V, F, U, "arap")
    fast = ours(a.example, folder, "--iterations", "4000", "--tolerance", "1e-10")["energies"]
    steps = next(k for k, e in enumerate(fast) if e <= 1.01 * best)
    rows = {"igl": [], "ours": []}
    for _ in range(a.rounds):
        _, pre, run = _surfaces.libigl(V, F, b, T, "arap", min(needed, AT_MOST))
        rows["igl"].append((pre, run / min(needed, AT_MOST), pre + run * needed / min(needed, AT_MOST)))
        per = ours(a.example, folder, "--solver", "local-global", "--start", "rest", "--iterations", "20", "--tolerance",
                   "0", "--repeat", repeat)
        to = ours(a.example, folder, "--iterations", str(max(steps, 1)), "--tolerance", "0", "--repeat", repeat)
        rows["ours"].append((per["bind_s"], per["deform_s"] / 20, to["bind_s"] + to["deform_s"]))
    igl, our = (tuple(map(min, zip(*rows[k]))) for k in ("igl", "ours"))
    same = abs(theirs / plain[min(needed, AT_MOST)] - 1)
    print(f"{name:14} {len(V):7} | {igl[0]:7.4f} {our[0]:7.4f} {our[0] / igl[0]:5.2f} | {igl[1]:8.5f} {our[1]:8.5f} "
          f"{our[1] / igl[1]:5.2f} | {needed:5} {steps:4} {igl[2]:8.4f} {our[2]:7.4f}  1/{igl[2] / our[2]:.0f} | {same:.0e}",
          flush=True)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--example", required=True)
    p.add_argument("--media", required=True, type=pathlib.Path)
    p.add_argument("--rounds", type=int, default=3)
    p.add_argument("--large", action="store_true")
    a = p.parse_args()
    print("                       | precomputation, s     | per iteration, s        | to 1.01 E*: iterations and s")
    print("case           vertices | libigl    ours ratio | libigl     ours   ratio | libigl ours libigl    ours      | same")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for case in ["bar_twist", "cylinder_bend", "cactus_bend", "spikes_lift", "knight", "armadillo"]:
            measure(a, case, *_surfaces.load(case, a.media), folder)
        if a.large:
            import igl

            V, F, b, T = _surfaces.load("armadillo", a.media)
            case = json.loads((_surfaces.CASES / "armadillo.json").read_text())
            fine, triangles = igl.loop(V, F, 1)
            # The midpoints of edges between held vertices of one set are held with it.
            sets = []
            for s in case["sets"]:
                inside = set(s["vertices"])
                whole = [t for t in range(len(F)) if all(int(v) in inside for v in F[t])]
                vertices = sorted({int(v) for t in whole for v in triangles[4 * t:4 * t + 4].ravel()})
                sets.append(s | {"vertices": vertices})
            measure(a, "armadillo fine", fine, triangles, *_surfaces.targets(fine, sets), folder)


if __name__ == "__main__":
    main()
