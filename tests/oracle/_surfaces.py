"""Deformed surfaces for the oracle and for the comparison with peers: survey cases, libigl, the energy by definition.

A case is a file of `tests/data/mesh/survey`: a mesh of the media folder and sets of vertices, each with the rigid motion
it is moved by (rotation by `degrees` about `axis` through `pivot`, then `translation`).
"""
import json
import pathlib

import numpy as np

CASES = pathlib.Path(__file__).resolve().parents[1] / "data/mesh/survey"
KINDS = {"arap": "SPOKES_AND_RIMS", "arap-spokes": "SPOKES", "arap-elements": "ELEMENTS"}


def read_mesh(path):
    """Vertices and triangles of an OFF or OBJ file; polygons as fans."""
    lines = (line.split("#")[0].split() for line in path.read_text().splitlines())
    lines = [line for line in lines if line]
    if path.suffix == ".off":
        n, m = (int(w) for w in lines[1][:2])
        vertices = [[float(w) for w in line[:3]] for line in lines[2:2 + n]]
        polygons = [[int(w) for w in line[1:1 + int(line[0])]] for line in lines[2 + n:2 + n + m]]
    else:
        vertices = [[float(w) for w in line[1:4]] for line in lines if line[0] == "v"]
        polygons = [[int(w.split("/")[0]) - 1 for w in line[1:]] for line in lines if line[0] == "f"]
    triangles = [[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)]
    return np.array(vertices), np.array(triangles, dtype=np.int64)


def write_off(path, V, F):
    rows = [f"OFF\n{len(V)} {len(F)} 0\n"]
    rows += ["%.17g %.17g %.17g\n" % tuple(v) for v in V] + ["3 %d %d %d\n" % tuple(f) for f in F]
    path.write_text("".join(rows))


def rotation(axis, degrees):
    a = np.array(axis, float) / np.linalg.norm(axis)
    K = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
    t = np.radians(degrees)
    return np.eye(3) + np.sin(t) * K + (1 - np.cos(t)) * K @ K


def load(name, media):
    """Vertices, triangles, held vertices (ascending) and their targets."""
    case = json.loads((CASES / f"{name}.json").read_text())
    V, F = read_mesh(pathlib.Path(media) / "mesh" / case["mesh"])
    return V, F, *targets(V, case["sets"])


def targets(V, sets):
    held = {}
    for s in sets:
        R, pivot = rotation(s["axis"], s["degrees"]), np.array(s["pivot"])
        for v in s["vertices"]:
            held[v] = R @ (V[v] - pivot) + pivot + s["translation"]
    b = np.array(sorted(held), dtype=np.int32)
    return b, np.array([held[v] for v in b])


def write_pose(path, b, T):
    path.write_text("".join("%d %.17g %.17g %.17g\n" % (v, *t) for v, t in zip(b, T)))


def libigl(V, F, b, T, method, iterations):
    """Positions after so many iterations from rest, and CPU seconds of precomputation and iterations."""
    import time

    import igl

    data = igl.ARAPData()
    data.energy = getattr(igl, f"ARAP_ENERGY_TYPE_{KINDS[method]}")
    data.max_iter = iterations
    began = time.process_time()
    igl.arap_precomputation(V, F, 3, b, data)
    ready = time.process_time()
    U = igl.arap_solve(np.ascontiguousarray(T), data, V.copy())
    return U, ready - began, time.process_time() - ready


def energy(V, F, U, method):
    """The energy of positions U by its definition, best rotations by numpy's SVD."""
    edges = [(1, 2, 0), (2, 0, 1), (0, 1, 2)]
    half = []
    for i, j, k in edges:
        a, c = V[F[:, i]] - V[F[:, k]], V[F[:, j]] - V[F[:, k]]
        half.append(0.5 * (a * c).sum(1) / np.linalg.norm(np.cross(a, c), axis=1))
    cells = len(F) if method == "arap-elements" else len(V)
    S, total = np.zeros((cells, 3, 3)), 0.0
    parts = []
    for (i, j, k), h in zip(edges, half):
        e, f = V[F[:, j]] - V[F[:, i]], U[F[:, j]] - U[F[:, i]]
        where = {"arap": [F[:, 0], F[:, 1], F[:, 2]], "arap-spokes": [F[:, i], F[:, j]],
                 "arap-elements": [np.arange(len(F))]}[method]
        w = h / 3 if method == "arap" else h
        for cell in where:
            np.add.at(S, cell, w[:, None, None] * f[:, :, None] * e[:, None, :])
            parts.append((cell, w, e, f))
    u, _, vt = np.linalg.svd(S)
    sign = np.ones((cells, 3))
    sign[:, 2] = np.sign(np.linalg.det(u @ vt))
    R = (u * sign[:, None, :]) @ vt
    for cell, w, e, f in parts:
        total += (w * ((f - np.einsum("cij,cj->ci", R[cell], e)) ** 2).sum(1)).sum()
    return total
