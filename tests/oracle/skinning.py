#!/usr/bin/env python3
"""Skinning against libigl (linear) and NumPy (dual quaternions) on made data, and against positions of glTF characters computed apart (in NumPy): in double precision
to 1e-9 of the diagonal beside the digits that the references have, in single precision to 2e-6."""
import os
import pathlib
import sys
import tempfile

import numpy as np

import _skins
from _programs import program


def half_digits(x):
    """Half a unit of the ninth digit: the references of glTF characters are text, and no finer."""
    return 0.5 * 10 ** (np.floor(np.log10(np.maximum(np.abs(x), 1e-300))) - 8)


def main():
    command, failures = program("skin_points"), 0
    try:
        import igl  # noqa: F401
    except ImportError as e:
        print(f"skipped: {e}")
        return 77

    def check(what, a, b, V, allowed, rounding=0):
        """At most `allowed` of the diagonal beside `rounding`."""
        nonlocal failures
        diagonal = np.linalg.norm(V.max(0) - V.min(0))
        error = np.linalg.norm(np.maximum(np.abs(a - b) - rounding, 0), axis=1).max() / diagonal
        bad = not error <= allowed
        failures += bad
        print(f"{'FAIL' if bad else 'ok  '} {what:44} {error:.1e} (at most {allowed:.0e})")

    with tempfile.TemporaryDirectory() as folder:
        for name, vertices, joints, influences in [("four of twenty", 4000, 20, 4), ("all of three", 500, 3, 3),
                                                   ("one joint", 100, 1, 1), ("four of three hundred", 3000, 300, 4)]:
            V, W, M = _skins.made(vertices, joints, influences, seed=joints)
            for method in ("lbs", "dqs"):
                expected = _skins.reference(V, W, M, method)
                double, _ = _skins.ours(command, folder, V, W, M, method)
                single, _ = _skins.ours(command, folder, V, W, M, method, "--single")
                check(f"{method} {name}", double, expected, expected, 1e-9)
                check(f"{method} {name}, single", single, expected, expected, 2e-6)
        media = os.environ.get("PLUMBLINE_MEDIA")
        files = sorted((pathlib.Path(media) / "mesh/gltf").glob("*.joint_matrices.txt")) if media else []
        if not files:
            print("glTF characters left out: PLUMBLINE_MEDIA names no folder with mesh/gltf")
        for file in files:
            stem = file.name.removesuffix(".joint_matrices.txt")
            V, W = _skins.read_glb(file.parent / f"{stem.split('.')[0]}.glb")
            M = np.loadtxt(file).reshape(-1, 4, 4)
            for method in ("lbs", "dqs"):
                # Weights as they are stored, which sum to one up to 1e-7; and the rigid part of matrices that do so up to 1e-6.
                expected = np.loadtxt(file.parent / f"{stem}.{method}.txt")
                double, _ = _skins.ours(command, folder, V, W, M, method)
                single, _ = _skins.ours(command, folder, V, W, M, method, "--single")
                check(f"{method} {stem}", double, expected, expected, 1e-9, half_digits(expected))
                check(f"{method} {stem}, single", single, expected, expected, 2e-6)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
