#!/usr/bin/env python3
"""Sparse Cholesky beside CHOLMOD: `benches/peers/cholesky.py [FOLDER OF MESHES]`.

Laplacians of jittered triangulated grids with shuffled numbers, 10 thousand to 1 million unknowns, and of meshes (OBJ, OFF)
where a folder is given. Each is handed as one binary file to both programs, which run by turns, one thread each:

    u64 n, u64 m, then m rows (u32), m columns (u32), m entries (f64) of the lower triangle

Needs a C compiler and CHOLMOD (Debian: libsuitesparse-dev) and `cargo build --release --example programs`.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
OURS = [ROOT / "target/release/examples/programs", "cholesky_times"]
TURNS = 3


def laplacian(faces, n, path, positions):
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    edges = np.unique(np.sort(edges, 1), axis=0)
    degree = np.bincount(edges.ravel(), minlength=n) + 1e-3
    rows = np.r_[edges[:, 1], np.arange(n)].astype(np.uint32)
    columns = np.r_[edges[:, 0], np.arange(n)].astype(np.uint32)
    values = np.r_[-np.ones(len(edges)), degree]
    with open(path, "wb") as file:
        file.write(np.array([n, len(rows)], np.uint64).tobytes())
        for part in (rows, columns, values, np.asarray(positions, float)):
            file.write(part.tobytes())


def jittered(n, path):
    rng = np.random.default_rng(1)
    side = round(n**0.5)
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    points = np.c_[x.ravel(), y.ravel(), 0 * x.ravel()] + rng.uniform(-0.35, 0.35, (side * side, 3)) * [1, 1, 0]
    i = np.arange((side - 1) * side).reshape(side - 1, side)[:, :-1].ravel()
    flip = rng.random(len(i)) < 0.5
    a, b, c, d = i, i + 1, i + side + 1, i + side
    faces = np.vstack([np.c_[a, b, c][flip], np.c_[a, c, d][flip], np.c_[a, b, d][~flip], np.c_[b, c, d][~flip]])
    number = rng.permutation(side * side)
    moved = np.empty_like(points)
    moved[number] = points
    laplacian(number[faces], side * side, path, moved)


def of_mesh(mesh, path):
    points, faces = [], []
    for line in mesh.read_text().splitlines():
        words = line.split()
        if mesh.suffix == ".obj" and words[:1] == ["v"]:
            points.append([float(w) for w in words[1:4]])
        elif mesh.suffix == ".obj" and words[:1] == ["f"]:
            corners = [int(w.split("/")[0]) - 1 for w in words[1:]]
            faces += [[corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1)]
    laplacian(np.array(faces), len(points), path, points)


def run(command):
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout)


def compare(name, path, cholmod):
    least = {}
    for _ in range(TURNS):
        for order in ("amd", "metis"):
            peer = run([cholmod, order, path])
            for kind in ("simplicial", "supernodal"):
                for what, seconds in zip(("factor", "solve"), peer[kind]):
                    least[f"peer {what}"] = min(seconds, least.get(f"peer {what}", 1e9))
            ours = run([*OURS, {"amd": "amd", "metis": "nd"}[order], path])
            for what in ("factor", "solve"):
                key = f"{order} {what}"
                least[key] = min(ours[what], least.get(key, 1e9))
            least[f"{order} nnz"] = (ours["nnz"], peer["nnz"])
    for what in ("factor", "solve"):
        mine = min(least[f"amd {what}"], least[f"metis {what}"])
        print(f"{name:12} {what:7} ours {1e3 * mine:9.2f} ms   CHOLMOD's best {1e3 * least[f'peer {what}']:9.2f} ms   "
              f"ratio {mine / least[f'peer {what}']:.2f}", flush=True)
    print(f"{name:12} nnz(L) AMD {least['amd nnz']}, dissection {least['metis nnz']}", flush=True)


def main():
    with tempfile.TemporaryDirectory() as folder:
        cholmod = Path(folder) / "cholmod"
        subprocess.run(["cc", "-O2", "-o", cholmod, HERE / "cholmod.c", "-I/usr/include/suitesparse", "-lcholmod", "-lm"],
                       check=True)
        path = Path(folder) / "a.bin"
        for mesh in sorted(Path(sys.argv[1]).glob("*.obj")) if len(sys.argv) > 1 else []:
            of_mesh(mesh, path)
            compare(mesh.stem, path, cholmod)
        for n in (10_000, 50_000, 200_000, 1_000_000):
            jittered(n, path)
            compare(f"grid {n // 1000}k", path, cholmod)


if __name__ == "__main__":
    main()
