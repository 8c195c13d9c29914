#!/usr/bin/env python3
"""Oracle: lenses against OpenCV's fisheye, standard and omnidirectional cameras. Exits 1 on failure.

Calibrations are written with OpenCV's own storage (YAML and XML) and read by ours, so that the readers are compared as well. Random
directions in the field are projected by both, pixels all over the picture are turned into directions by both, and our
derivatives are compared with OpenCV's. Pixel centers: OpenCV counts them at integers, ours at integer + 0.5.

PLUMBLINE_EXAMPLES names the folder of the built examples; without it target/release/examples, then debug.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

import cv2
import numpy as np

from _programs import program

# Largest differences allowed: px, rad, px per unit of direction. OpenCV's inverses iterate to about 1e-8.
PIXELS, ANGLES, SLOPES = 1e-6, 1e-6, 1e-5
WIDTH, HEIGHT = 1000, 750
K = np.array([[437.0, 0, 493.5], [0, 436.0, 379.25], [0, 0, 1]])


def ours(path, rays, pixels):
    """Pixels and derivatives of rays, directions of pixels, in OpenCV's pixel coordinates."""
    query = json.dumps({"rays": rays.tolist(), "pixels": (pixels + 0.5).tolist()})
    run = subprocess.run([*program("lens_points"), path], input=query, capture_output=True, text=True)
    if run.returncode:
        sys.exit(f"{path}: {run.stderr}")
    answer = json.loads(run.stdout)
    missing = lambda rows, n: np.array([[np.nan] * n if row is None else row for row in rows])
    slopes = np.array([np.full((2, 3), np.nan) if j is None else j for j in answer["jacobians"]])
    return missing(answer["pixels"], 2) - 0.5, slopes, missing(answer["rays"], 3)


def rays_within(rng, angle, count=2000):
    theta, phi = angle * np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    return np.c_[np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)] * rng.uniform(0.2, 5, (count, 1))


def grid(inset):
    x, y = np.meshgrid(np.linspace(inset, WIDTH - 1 - inset, 33), np.linspace(inset, HEIGHT - 1 - inset, 25))
    return np.c_[x.ravel(), y.ravel()]


ZERO = np.zeros(3)


class Fisheye:
    name, angle, suffix, inset = "fisheye", np.radians(89), ".yml", 0
    d = np.array([0.04, 0.038, -0.03, 0.0075])

    def keys(self):
        return {"fisheye_model": 1}

    def project(self, x):
        p, j = cv2.fisheye.projectPoints(x[:, None], ZERO, ZERO, K, self.d)
        # Columns: focal lengths, center, coefficients, rotation, translation, skew.
        return p[:, 0], j[:, 11:14]

    def directions(self, p):
        criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-12)
        q = cv2.fisheye.undistortPoints(p[:, None], K, self.d, criteria=criteria)[:, 0]
        return np.c_[q, np.ones(len(q))]


class Standard:
    angle, suffix, inset = np.radians(55), ".xml", 60

    def __init__(self, d):
        self.d, self.name = np.array(d), f"standard with {len(d)} coefficients"

    def keys(self):
        return {"distortion_model": "standard"}

    def project(self, x):
        p, j = cv2.projectPoints(x[:, None], ZERO, ZERO, K, self.d)[:2]
        # Columns: rotation, translation, focal lengths, center, coefficients.
        return p[:, 0], j[:, 3:6]

    def directions(self, p):
        criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 500, 1e-12)
        q = cv2.undistortPointsIter(p[:, None], K, self.d, None, None, criteria)[:, 0] if hasattr(
            cv2, "undistortPointsIter") else cv2.undistortPoints(p[:, None], K, self.d, criteria=criteria)[:, 0]
        return np.c_[q, np.ones(len(q))]


class Omnidirectional:
    name, angle, suffix, inset = "omnidirectional", np.radians(100), ".yml", 100
    d, xi = np.array([-0.1, 0.2, 0.001, -0.002]), 1.3

    def keys(self):
        return {"xi": self.xi}

    def project(self, x):
        p, j = cv2.omnidir.projectPoints(x[:, None], ZERO, ZERO, K, self.xi, self.d)
        # Columns: rotation, translation, then the intrinsics.
        return p.reshape(-1, 2), j[:, 3:6]

    def directions(self, p):
        return None  # it works in single precision there


def written(camera, folder):
    path = str(pathlib.Path(folder) / (camera.name.replace(" ", "-") + camera.suffix))
    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    for key, value in {"image_width": WIDTH, "image_height": HEIGHT, "camera_matrix": K, **camera.keys(),
                       "distortion_coefficients": camera.d}.items():
        storage.write(key, value)
    storage.release()
    return path


def compared(camera, folder, rng):
    rays, pixels = rays_within(rng, camera.angle), grid(camera.inset)
    seen, slopes, looked = ours(written(camera, folder), rays, pixels)
    theirs, their_slopes = camera.project(rays)
    off = np.linalg.norm(seen - theirs, axis=1).max()
    bent = np.abs(slopes - their_slopes.reshape(-1, 2, 3)).max() if their_slopes is not None else 0.0
    angle = 0.0
    if (directions := camera.directions(pixels)) is not None:
        unit = directions / np.linalg.norm(directions, axis=1)[:, None]
        angle = np.linalg.norm(np.cross(unit, looked), axis=1).max()
    print(f"{camera.name}: {off:.1e} px, slopes {bent:.1e} px, directions {angle:.1e} rad")
    return off <= PIXELS and bent <= SLOPES and angle <= ANGLES


def main():
    cameras = [
        Fisheye(),
        Standard([-0.29, 0.08, 0.0003, -0.0005]),
        Standard([-0.29, 0.08, 0.0003, -0.0005, 0.004]),
        Standard([0.35, 0.06, 0.0003, -0.0005, 0.002, 0.62, 0.18, 0.01]),
        Standard([-0.09, 0.02, 0.0003, -0.0005, 0.001, 0.02, 0.002, 0.001, 0.0009, -0.0002, -0.0006, 0.0001]),
    ]
    if hasattr(cv2, "omnidir"):
        cameras.append(Omnidirectional())
    else:
        print("omnidirectional: skipped, OpenCV has no contrib modules here")
    rng = np.random.default_rng(7)
    with tempfile.TemporaryDirectory() as folder:
        results = [compared(camera, folder, rng) for camera in cameras]
    return 0 if all(results) else 1


if __name__ == "__main__":
    sys.exit(main())
