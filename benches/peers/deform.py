#!/usr/bin/env python3
"""ARAP beside libigl, on one thread: precomputation, seconds per iteration, and CPU seconds to 1.01 of the converged energy.

    deform.py --programs target/release/examples/programs --media DIR [--rounds 3] [--cases NAME,NAME] [--large]
              [--resolutions] [--scale] [--minima]

Spokes and rims, the same handles, exactly held. libigl starts at rest, as its interface has it; how many of its iterations
reach 1.01 E* is read off our own local-global iterations from the same start, which are the same ones (both energies are
checked to agree). Ours is the default: coarse copies first, then accelerated; making the copies counts. Each round runs both
in turn; reported are the minima. armadillo10k is the armadillo decimated to 10 thousand vertices. --large adds the armadillo
once subdivided (173 thousand vertices).

--resolutions prints how far the same tube, bent the same way, comes to rest from where the finest of three meshes does, for
each method. --scale prints CPU seconds and peak memory of ours as the armadillo is subdivided, and of a bar of a million
vertices. --minima compares the energies that twenty bends and twists of ten models end with, by initial guess.
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
import numpy as np  # noqa: E402

import _surfaces  # noqa: E402

# Iterations that libigl is timed over where it would need more than a minute.
AT_MOST = 400


def ours(programs, folder, *options):
    command = [programs, "deform_mesh", folder / "mesh.off", folder / "pose.txt", "arap", *options]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def measure(a, name, V, F, b, T, folder):
    _surfaces.write_off(folder / "mesh.off", V, F)
    _surfaces.write_pose(folder / "pose.txt", b, T)
    small = len(V) < 20_000
    repeat = str(max(1, 40_000 // len(V)))
    best = ours(a.programs, folder, "--iterations", "4000", "--tolerance", "1e-10")["energies"][-1]
    plain = ours(a.programs, folder, "--solver", "local-global", "--start", "rest", "--iterations", "3000", "--tolerance",
                 "1e-10" if small else "1e-7")["energies"]
    best = min(best, plain[-1])
    needed = next((k for k, e in enumerate(plain) if e <= 1.01 * best), len(plain))
    U, *_ = _surfaces.libigl(V, F, b, T, "arap", min(needed, AT_MOST))
    theirs = _surfaces.energy(V, F, U, "arap")
    fast = ours(a.programs, folder, "--iterations", "4000", "--tolerance", "1e-10")["energies"]
    steps = next(k for k, e in enumerate(fast) if e <= 1.01 * best)
    rows = {"igl": [], "ours": []}
    for _ in range(a.rounds):
        _, pre, run = _surfaces.libigl(V, F, b, T, "arap", min(needed, AT_MOST))
        rows["igl"].append((pre, run / min(needed, AT_MOST), pre + run * needed / min(needed, AT_MOST)))
        per = ours(a.programs, folder, "--solver", "local-global", "--start", "rest", "--iterations", "20", "--tolerance",
                   "0", "--repeat", repeat)
        to = ours(a.programs, folder, "--iterations", str(max(steps, 1)), "--tolerance", "0", "--repeat", repeat)
        rows["ours"].append((per["bind_s"], per["deform_s"] / 20, to["bind_s"] + to["deform_s"]))
    igl, our = (tuple(map(min, zip(*rows[k]))) for k in ("igl", "ours"))
    same = abs(theirs / plain[min(needed, AT_MOST)] - 1)
    print(f"{name:14} {len(V):7} | {igl[0]:7.4f} {our[0]:7.4f} {our[0] / igl[0]:5.2f} | {igl[1]:8.5f} {our[1]:8.5f} "
          f"{our[1] / igl[1]:5.2f} | {needed:5} {steps:4} {igl[2]:8.4f} {our[2]:7.4f}  1/{igl[2] / our[2]:.0f} | {same:.0e}",
          flush=True)


def decimated(V, F, sets, faces):
    """The mesh with fewer triangles; a vertex is in the sets of the vertex nearest to it."""
    import igl
    from scipy.spatial import cKDTree

    U, G, *_ = igl.decimate(V, F, faces)
    nearest = cKDTree(V).query(U)[1]
    return U, G, [s | {"vertices": np.nonzero(np.isin(nearest, s["vertices"]))[0].tolist()} for s in sets]


def subdivided(V, F, sets):
    """Once by Loop's rule. The midpoints of edges between held vertices of one set are held with it."""
    import igl

    fine, triangles = igl.loop(V, F, 1)
    finer = []
    for s in sets:
        inside = np.zeros(len(V), bool)
        inside[s["vertices"]] = True
        whole = np.nonzero(inside[F].all(1))[0]
        corners = np.unique(np.concatenate([triangles[4 * whole + k].ravel() for k in range(4)]))
        finer.append(s | {"vertices": corners.tolist()})
    return fine, triangles, finer


def tube(rings, around):
    """A tube along x of radius 0.2 and length 2, whose rings those of twice as many pass through."""
    r, k = np.divmod(np.arange(rings * around), around)
    angle = 2 * np.pi * k / around
    V = np.stack([2 * r / (rings - 1), 0.2 * np.cos(angle), 0.2 * np.sin(angle)], 1)
    r, k = np.divmod(np.arange((rings - 1) * around), around)
    at = lambda r, k: r * around + k % around  # noqa: E731
    a, b, c, d = at(r, k), at(r, k + 1), at(r + 1, k + 1), at(r + 1, k)
    return V, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


METHODS = {
    "arap": ("arap", lambda h: []),
    "arap, bending as on the finest": ("arap", lambda h: ["--bending", str(1 / h ** 2)]),
    "arap, smooth 0.001": ("arap", lambda h: ["--smoothness", "0.001"]),
    "arap-spokes": ("arap-spokes", lambda h: []),
    "arap-elements": ("arap-elements", lambda h: []),
    "primo, as thick as on the finest": ("primo", lambda h: ["--thickness", str(6 / h)]),
    "laplacian": ("laplacian", lambda h: []),
    "laplacian, alternating": ("laplacian", lambda h: ["--alternating"]),
    "poisson": ("poisson", lambda h: []),
}


def resolutions(a, folder):
    finest = 128
    print(f"rms distance from the mesh of {finest // 2} x {finest + 1} vertices, over the diagonal, of meshes with 1/4, 1/2 as many rings")
    for name, (method, options) in METHODS.items():
        found = []
        for rings in [finest // 4, finest // 2, finest]:
            V, F = tube(rings + 1, rings // 2)
            ends = [np.nonzero(V[:, 0] < 0.19)[0], np.nonzero(V[:, 0] > 1.81)[0]]
            sets = [{"vertices": ends[0].tolist(), "axis": [0, 0, 1], "degrees": 0, "pivot": [0, 0, 0], "translation": [0, 0, 0]},
                    {"vertices": ends[1].tolist(), "axis": [0, 0, 1], "degrees": 60, "pivot": [1, 0, 0], "translation": [0, 0, 0]}]
            _surfaces.write_off(folder / "mesh.off", V, F)
            _surfaces.write_pose(folder / "pose.txt", *_surfaces.targets(V, sets))
            command = [a.programs, "deform_mesh", folder / "mesh.off", folder / "pose.txt", method, "--iterations", "3000", "--tolerance", "1e-9",
                       "-o", folder / "out.txt", *options(finest // rings)]
            subprocess.run(command, check=True, capture_output=True)
            found.append(np.loadtxt(folder / "out.txt").reshape(rings + 1, rings // 2, 3))
        X = found[2]
        apart = [np.sqrt(((Y - X[::by, ::by]) ** 2).sum(2).mean()) / np.linalg.norm([2, 0.4, 0.4])
                 for Y, by in [(found[0], 4), (found[1], 2)]]
        print(f"{name:34} {apart[0]:.5f} {apart[1]:.5f}", flush=True)


def bar(cells):
    """A closed bar of cells x cells x 4 cells squares, a unit wide."""
    sides = [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
    size = np.array([cells, cells, 4 * cells])
    quads = []
    for u, v, w in sides:
        i, j = (g.ravel() for g in np.meshgrid(np.arange(size[u]), np.arange(size[v]), indexing="ij"))
        for end in (0, size[w]):
            corners = []
            for du, dv in [(0, 0), (1, 0), (1, 1), (0, 1)]:
                c = np.zeros((len(i), 3), dtype=np.int64)
                c[:, u], c[:, v], c[:, w] = i + du, j + dv, end
                corners.append(c)
            quads.append(np.stack(corners if end else corners[::-1], 1))
    quads = np.concatenate(quads)
    V, index = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    q = index.reshape(-1, 4)
    return V / cells, np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])


def scale(a, folder):
    V, F, _, _ = _surfaces.load("armadillo", a.media)
    sets = json.loads((_surfaces.CASES / "armadillo.json").read_text())["sets"]
    cases = []
    for times in range(3):
        if times:
            V, F, sets = subdivided(V, F, sets)
        cases.append((f"armadillo, {times} times finer", V, F, sets))
    V, F = bar(236)
    end = lambda inside, degrees: {"vertices": np.nonzero(inside)[0].tolist(), "axis": [0, 0, 1], "degrees": degrees,  # noqa: E731
                                   "pivot": [0.5, 0.5, 0], "translation": [0, 0, 0]}
    cases.append(("bar", V, F, [end(V[:, 2] == 0, 0), end(V[:, 2] == 4, 60)]))
    print("                             vertices |  bind, s | deform, s  rounds | peak MB")
    for name, V, F, sets in cases:
        _surfaces.write_off(folder / "mesh.off", V, F)
        _surfaces.write_pose(folder / "pose.txt", *_surfaces.targets(V, sets))
        told = ours(a.programs, folder)
        print(f"{name:28} {len(V):8} | {told['bind_s']:8.2f} | {told['deform_s']:8.2f} {told['iterations']:7} | "
              f"{told['peak_mb']:7.0f}  {told['stop']}", flush=True)


# Bends and twists between the two tenths at the ends of the longest axis: file, bend, twist (degrees).
MINIMA = [
    ("hard/homer.off", 90, 110), ("hard/rocker-arm.off", 80, 150), ("hard/cheburashka.off", 60, 120), ("hard/screwdriver.off", 120, 170),
    ("igl/elephant.obj", 75, 100), ("igl/arm.obj", 110, 140), ("igl/decimated-knight.off", 60, 90), ("common/spot.obj", 70, 130),
    ("arapbench/cactus_jacobson.obj", 100, 160), ("rig/male_LR20.off", 65, 170),
]


def ends(V, kind, degrees):
    """Vertices held and their targets: one end fixed, the other rotated about the middle, across the axis (bend) or along it (twist)."""
    center = V.mean(0)
    _, _, axes = np.linalg.svd(V - center, full_matrices=False)
    along = (V - center) @ axes[0]
    low, high = along.min(), along.max()
    middle = center + 0.5 * (low + high) * axes[0]
    axis = axes[0] if kind == "twist" else axes[2]
    sets = [{"vertices": np.nonzero(along < low + 0.1 * (high - low))[0].tolist(), "degrees": 0},
            {"vertices": np.nonzero(along > high - 0.1 * (high - low))[0].tolist(), "degrees": degrees}]
    return _surfaces.targets(V, [s | {"axis": axis, "pivot": middle, "translation": [0, 0, 0]} for s in sets])


def flipped(V, F, U):
    """Folds: edges whose triangles were within a right angle of each other, and are now more than 120 degrees apart."""
    normals = [np.cross(X[F[:, 1]] - X[F[:, 0]], X[F[:, 2]] - X[F[:, 0]]) for X in (V, U)]
    edges = {}
    for f, t in enumerate(F):
        for k in range(3):
            edges.setdefault(tuple(sorted((t[k], t[(k + 1) % 3]))), []).append(f)
    pairs = np.array([p for p in edges.values() if len(p) == 2])
    unit = [n / np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None] for n in normals]
    flat = [(n[pairs[:, 0]] * n[pairs[:, 1]]).sum(1) for n in unit]
    return int(((flat[0] > 0) & (flat[1] < -0.5)).sum())


def minima(a, folder):
    """Energies of the default initial guess beside the lowest of libigl from rest and ours from each guess."""
    print("case                          vertices | lowest       libigl  default     rest   spread   coarse | folds: lowest default | CPU s: libigl default  ratio iterations")
    good, near, unfolded, fast = 0, 0, 0, 0
    for name, bend, twist in MINIMA:
        V, F = _surfaces.read_mesh(a.media / "mesh" / name)
        _surfaces.write_off(folder / "mesh.off", V, F)
        for kind, degrees in (("bend", bend), ("twist", twist)):
            b, T = ends(V, kind, degrees)
            _surfaces.write_pose(folder / "pose.txt", b, T)
            U, pre, run = _surfaces.libigl(V, F, b, T, "arap", 1000)
            energies, folds = {"libigl": _surfaces.energy(V, F, U, "arap")}, {"libigl": flipped(V, F, U)}
            for guess in ("auto", "rest", "spread", "coarse"):
                told = ours(a.programs, folder, "--start", guess, "-o", folder / "out.txt", *(["--iterations", "4000", "--tolerance", "1e-9"] if guess != "auto" else []))
                energies[guess] = told["energies"][-1]
                folds[guess] = flipped(V, F, np.loadtxt(folder / "out.txt"))
                if guess == "auto":
                    ours_s, steps = told["bind_s"] + told["deform_s"], told["iterations"]
            best = min(energies, key=energies.get)
            excess = {k: e / energies[best] - 1 for k, e in energies.items()}
            good, near = good + (excess["auto"] <= 1e-4), near + (excess["auto"] <= 1e-2)
            unfolded, fast = unfolded + (folds["auto"] <= folds[best]), fast + (ours_s <= 0.3 * (pre + run))
            print(f"{name.split('/')[1].split('.')[0] + ' ' + kind + ' ' + str(degrees):30} {len(V):7} | {energies[best]:.5e} " +
                  " ".join(f"{excess[k]:8.1e}" for k in ("libigl", "auto", "rest", "spread", "coarse")) +
                  f" | {folds[best]:4} {folds['auto']:4} | {pre + run:7.2f} {ours_s:6.3f} {ours_s / (pre + run):5.2f} {steps}", flush=True)
    print(f"within 1e-4: {good} of {2 * len(MINIMA)}; within 1 %: {near}; no more folds than the lowest: {unfolded}; at most .3 of libigl's time: {fast}")


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--programs", required=True)
    p.add_argument("--media", required=True, type=pathlib.Path)
    p.add_argument("--rounds", type=int, default=3)
    p.add_argument("--cases", default="bar_twist,cylinder_bend,cactus_bend,spikes_lift,knight,armadillo10k,armadillo,horse")
    p.add_argument("--large", action="store_true")
    p.add_argument("--resolutions", action="store_true")
    p.add_argument("--scale", action="store_true")
    p.add_argument("--minima", action="store_true")
    a = p.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        if a.resolutions:
            return resolutions(a, folder)
        if a.scale:
            return scale(a, folder)
        if a.minima:
            return minima(a, folder)
        print("                       | precomputation, s     | per iteration, s        | to 1.01 E*: iterations and s")
        print("case           vertices | libigl    ours ratio | libigl     ours   ratio | libigl ours libigl    ours      | same")
        armadillo = json.loads((_surfaces.CASES / "armadillo.json").read_text())["sets"]
        for case in filter(None, a.cases.split(",")):
            if case == "armadillo10k":
                V, F, *_ = _surfaces.load("armadillo", a.media)
                V, F, sets = decimated(V, F, armadillo, 20_000)
                measure(a, case, V, F, *_surfaces.targets(V, sets), folder)
            else:
                measure(a, case, *_surfaces.load(case, a.media), folder)
        if a.large:
            V, F, *_ = _surfaces.load("armadillo", a.media)
            V, F, sets = subdivided(V, F, armadillo)
            measure(a, "armadillo fine", V, F, *_surfaces.targets(V, sets), folder)


if __name__ == "__main__":
    main()
