#!/usr/bin/env python3
"""Shapes between two poses against an independent implementation: polar decomposition and logarithm of full 3x3 gradients by
SciPy, dense least squares over edges with cotangents by numpy; self-intersections against a search of all pairs."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import _surfaces

ROOT = pathlib.Path(__file__).resolve().parents[2]


def program():
    named = os.environ.get("PLUMBLINE_BIN")
    places = [pathlib.Path(named)] if named else [ROOT / f"target/{p}/plumbline" for p in ("release", "debug")]
    for place in places:
        if place.exists():
            return str(place)
    sys.exit("plumbline is not built")


def tube(sides=7, rows=9):
    """An open tube, and the same bent, twisted, stretched and carried away."""
    angle = 2 * np.pi * np.arange(sides) / sides
    V = np.array([[np.cos(a), np.sin(a), 0.7 * r] for r in range(rows) for a in angle + 0.1 * rows])
    F = []
    for r in range(rows - 1):
        for s in range(sides):
            a, b = r * sides + s, r * sides + (s + 1) % sides
            F += [[a, b, b + sides], [a, b + sides, a + sides]]
    z = V[:, 2] / V[:, 2].max()
    c, s = np.cos(1.3 * z), np.sin(1.3 * z)
    W = np.c_[c * V[:, 0] - s * V[:, 1], s * V[:, 0] + c * V[:, 1], V[:, 2] * 1.2]
    W[:, 0] += 1.5 * z ** 2
    Q = _surfaces.rotation([0.3, 1, -0.4], 75.0)
    return V, np.array(F), W @ Q.T + [3.0, -1.0, 2.0]


def edges(V, f):
    a, b, c = V[f]
    return np.array([c - b, a - c, b - a])


def half_cotangents(V, f):
    e = edges(V, f)
    doubled = np.linalg.norm(np.cross(e[0], e[1]))
    return np.array([-e[(k + 1) % 3] @ e[(k + 2) % 3] for k in range(3)]) / doubled / 2


def areas(V, F):
    """Of each vertex, a third of its triangles."""
    share = np.zeros(len(V))
    for f in F:
        e = edges(V, f)
        share[f] += np.linalg.norm(np.cross(e[0], e[1])) / 6
    return share


def gradient(V, W, f):
    """The 3x3 matrix that takes two edges and the unit normal of a triangle to those of the other."""
    def frame(X):
        e = edges(X, f)
        n = np.cross(e[0], e[1])
        return np.array([e[0], e[1], n / np.linalg.norm(n)]).T
    return frame(W) @ np.linalg.inv(frame(V))


def between(V, F, W, t):
    """Poisson interpolation, the motion of the whole and its change of size taken out."""
    from scipy.linalg import polar
    from scipy.spatial.transform import Rotation
    of_v, of_w = areas(V, F), areas(W, F)
    m = (of_v / of_v.sum() + of_w / of_w.sum()) / 2
    scale = np.sqrt(of_w.sum() / of_v.sum())
    cv, cw = m @ V, m @ W
    H = ((V - cv) * m[:, None]).T @ (W - cw)
    U, _, Vt = np.linalg.svd(H)
    R = Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
    B = (W - cw) @ R / scale + cv  # R^T of each
    rows, targets, weights = [], [], []
    for f in F:
        rotation, _ = polar(gradient(V, B, f))
        turn = Rotation.from_matrix(rotation).as_rotvec()
        ahead, back = (Rotation.from_rotvec(turn * s).as_matrix() for s in (t, t - 1))
        wanted = (1 - t) * edges(V, f) @ ahead.T + t * edges(B, f) @ back.T
        h = (half_cotangents(V, f) + half_cotangents(B, f)) / 2
        for k in range(3):
            rows.append((f[(k + 1) % 3], f[(k + 2) % 3]))
            targets.append(wanted[k])
            weights.append(h[k])
    n = len(V)
    L, rhs = np.zeros((n, n)), np.zeros((n, 3))
    for (i, j), d, h in zip(rows, targets, weights):
        L[i, i] += h
        L[j, j] += h
        L[i, j] -= h
        L[j, i] -= h
        rhs[j] += h * d
        rhs[i] -= h * d
    X = np.linalg.lstsq(L, rhs, rcond=1e-12)[0]
    X += m @ ((1 - t) * V + t * B) - m @ X
    # The screw motion of the whole: across its axis, chords of circles.
    turn = Rotation.from_matrix(R).as_rotvec()
    angle = np.linalg.norm(turn)
    axis, way = turn / angle, cw - cv
    along = axis * (axis @ way)
    across = Rotation.from_rotvec(turn * (t - 1) / 2).apply(way - along) * np.sin(t * angle / 2) / np.sin(angle / 2)
    size = 1 + (scale - 1) * t
    return cv + Rotation.from_rotvec(turn * t).apply(X - cv) * size + t * along + across


def main():
    try:
        import scipy  # noqa: F401
    except ImportError as e:
        print(f"skipped: {e}")
        return 77
    failures = 0
    V, F, W = tube()
    frames = 5
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name, X in [("a.off", V), ("b.off", W)]:
            _surfaces.write_off(folder / name, X, F)
        subprocess.run([program(), "morph", "a.off", "b.off", "-o", "m.off", "--frames", str(frames), "--rounds", "0",
                        "--report", "r.json", "--progress", "none"], cwd=folder, check=True, capture_output=True)
        for k in range(frames):
            ours = _surfaces.read_mesh(folder / f"m_{k:04}.off")[0]
            t = k / (frames - 1)
            error = np.abs(ours - between(V, F, W, t)).max() / np.ptp(V, axis=0).max()
            failures += not error < 1e-7
            print(f"{'ok  ' if error < 1e-7 else 'FAIL'} time {t}: {error:.2e}")
        shapes = json.loads((folder / "r.json").read_text())["shapes"]
        failures += len(shapes) != frames
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
