#!/usr/bin/env python3
"""ARAP against libigl on the five survey cases: the same minimum from the same start, the energy as numpy defines it, exact
handles; and linear methods against libigl's harmonic functions."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

import _surfaces
from _programs import program

CASES = ["bar_twist", "cylinder_bend", "cactus_bend", "spikes_lift", "knight"]
ITERATIONS = 6000


def ours(folder, V, F, b, T, method, *options):
    _surfaces.write_off(folder / "mesh.off", V, F)
    _surfaces.write_pose(folder / "pose.txt", b, T)
    out = subprocess.run([*program("deform_mesh"), folder / "mesh.off", folder / "pose.txt", method, "-o",
                          folder / "out.txt", *options], check=True, capture_output=True, text=True).stdout
    return np.loadtxt(folder / "out.txt"), json.loads(out)


def main():
    media = os.environ.get("PLUMBLINE_MEDIA")
    if not media or not (pathlib.Path(media) / "mesh").is_dir():
        print("skipped: PLUMBLINE_MEDIA names no folder with meshes")
        return 77
    try:
        import igl
    except ImportError as e:
        print(f"skipped: {e}")
        return 77
    failures = 0

    def check(what, error, allowed):
        nonlocal failures
        failures += not error <= allowed
        print(f"{'ok  ' if error <= allowed else 'FAIL'} {what}: {error:.2e} (at most {allowed:.0e})")

    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for case in CASES:
            V, F, b, T = _surfaces.load(case, media)
            for method in ["arap"] if case != "bar_twist" else ["arap", "arap-spokes"]:
                U, *_ = _surfaces.libigl(V, F, b, T, method, ITERATIONS)
                reference = _surfaces.energy(V, F, U, method)
                for solver in ["local-global", "accelerated", "gauss-newton"]:
                    X, report = ours(folder, V, F, b, T, method, "--solver", solver, "--iterations", "8000",
                                     "--tolerance", "1e-12")
                    told = report["energies"][-1]
                    # A lower minimum is none of libigl's: the energy and the handles are checked below.
                    check(f"{case} {method} {solver}: above the minimum of libigl", told / reference - 1, 1e-6)
                    check(f"{case} {method} {solver}: energy by numpy",
                          abs(told / _surfaces.energy(V, F, X, method) - 1), 1e-9)
                    check(f"{case} {method} {solver}: handles", np.abs(X[b] - T).max(), 0)
        # Translated handles: the displacement is the harmonic function of the translation.
        V, F, b, T = _surfaces.load("cylinder_bend", media)
        T = V[b] + np.where(V[b, 2:] > 0, [[0.1, 0.2, 0.3]], 0.0)
        L, M = igl.cotmatrix(V, F), igl.massmatrix(V, F, igl.MASSMATRIX_TYPE_BARYCENTRIC)
        free = np.setdiff1d(np.arange(len(V)), b)
        from scipy.sparse import diags
        from scipy.sparse.linalg import spsolve
        for method, A in [("poisson", L), ("laplacian", L @ diags(1 / M.diagonal()) @ L)]:
            A = A.tocsc()
            D = np.zeros_like(V)
            D[b] = T - V[b]
            D[free] = spsolve(A[free][:, free], -(A[free][:, b] @ D[b]))
            X, _ = ours(folder, V, F, b, T, method)
            check(f"{method}: translated handles", np.abs(X - V - D).max(), 1e-9)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
