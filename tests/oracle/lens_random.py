#!/usr/bin/env python3
"""Oracle: lens formulas against OpenCV on random parameters, near and beyond where they are valid. Exits 1 on failure.

For every lens and every ray one of these holds:

- both project it, and to the same pixel;
- ours refuses it, and the formula is not one-to-one up to that ray (its radius stops growing, or a denominator vanishes), or the ray
  points backward. OpenCV evaluates the formula there all the same: that difference is accepted, since a pixel would have two rays.

Coefficients are drawn small (a lens that is sold), large (near the limit) and absurd.
"""
import json
import subprocess
import sys
import tempfile

import cv2
import numpy as np

from _programs import program
from lens import HEIGHT, K, WIDTH, ZERO, rays_within, written

LENSES = 24
# px relative to the distance from the center; OpenCV computes in double precision.
TOLERANCE = 1e-6


class Camera:
    suffix = ".yml"

    def __init__(self, kind, d, xi, number):
        self.kind, self.d, self.xi = kind, np.array(d), xi
        self.name = f"{kind}-{number}"

    def keys(self):
        return {"fisheye": {"fisheye_model": 1}, "standard": {"distortion_model": "standard"}, "omnidirectional": {"xi": self.xi}}[self.kind]

    def project(self, rays):
        if self.kind == "fisheye":
            return cv2.fisheye.projectPoints(rays[:, None], ZERO, ZERO, K, self.d)[0][:, 0]
        if self.kind == "standard":
            return cv2.projectPoints(rays[:, None], ZERO, ZERO, K, self.d)[0][:, 0]
        return cv2.omnidir.projectPoints(rays[:, None], ZERO, ZERO, K, self.xi, self.d)[0].reshape(-1, 2)

    def radius(self, t):
        """Distorted radius over the undistorted one, by the radial part of the formula."""
        if self.kind == "fisheye":
            return t * (1 + sum(k * t ** (2 * i + 2) for i, k in enumerate(self.d)))
        k = np.zeros(8)
        k[:min(8, len(self.d))] = self.d[:8]
        above = 1 + k[0] * t**2 + k[1] * t**4 + k[4] * t**6 * (self.kind == "standard")
        below = 1 + k[5] * t**2 + k[6] * t**4 + k[7] * t**6 if self.kind == "standard" else 1
        return t * above / below

    def reach(self, rays):
        """The argument of `radius` of each ray."""
        x, y, z = rays.T
        if self.kind == "fisheye":
            return np.arctan2(np.hypot(x, y), z)
        if self.kind == "standard":
            return np.hypot(x, y) / np.maximum(z, 1e-300)
        return np.hypot(x, y) / (z + self.xi * np.linalg.norm(rays, axis=1))

    def valid_up_to(self, most):
        """Largest argument up to which the radius grows clearly."""
        t = np.linspace(0, most, 4001)
        slope = np.gradient(self.radius(t), t)
        bad = np.flatnonzero(~(slope > 0.05) | ~np.isfinite(slope))
        return t[bad[0]] * 0.97 if len(bad) else most


def cameras(rng):
    for number in range(LENSES):
        scale = (0.02, 0.15, 1.5)[number % 3]
        yield Camera("fisheye", rng.normal(0, scale / 4, 4), None, number)
        count = (4, 5, 8, 12)[number % 4]
        tangential = rng.normal(0, scale / 300, 2)
        d = np.r_[rng.normal(0, scale, 2), tangential, rng.normal(0, scale / 4, max(0, count - 4))]
        d[8:] *= 0.01
        yield Camera("standard", d, None, number)
        if hasattr(cv2, "omnidir"):
            yield Camera("omnidirectional", np.r_[rng.normal(0, scale, 2), tangential], rng.uniform(0.2, 2.0), number)


def compared(camera, folder, rng):
    """Counts of rays: both agree, ours refuses with a reason; and what is wrong."""
    angle = {"fisheye": 1.5, "standard": 1.2, "omnidirectional": 1.6}[camera.kind]
    rays = rays_within(rng, angle, 400)
    query = json.dumps({"rays": rays.tolist(), "pixels": [[500.0, 375.0]]})
    ran = subprocess.run([*program("lens_points"), written(camera, folder)], input=query, capture_output=True, text=True)
    if ran.returncode:
        return (0, len(rays)), None if "panicked" not in ran.stderr else ran.stderr
    seen = json.loads(ran.stdout)["pixels"]
    theirs = camera.project(rays)
    reach = camera.reach(rays)
    limit = camera.valid_up_to(max(reach.max(), 1e-3))
    tangential = np.abs(camera.d[2:4]).sum() if camera.kind != "fisheye" else 0.0
    agree = refused = 0
    for ray, pixel, other, t in zip(rays, seen, theirs, reach):
        if pixel is None:
            refused += 1
            if 0 <= t < limit and tangential < 1e-3 and ray[2] > 0 and len(camera.d) < 12:
                return None, f"ray {ray} is refused at {t:.3f}, though the lens is one-to-one up to {limit:.3f}"
            continue
        agree += 1
        off = np.linalg.norm(np.array(pixel) - 0.5 - other)
        if not off <= TOLERANCE * max(1.0, np.linalg.norm(other - [WIDTH / 2, HEIGHT / 2])):
            return None, f"ray {ray} is seen at {np.array(pixel) - 0.5}, by OpenCV at {other}"
    return (agree, refused), None


def main():
    rng = np.random.default_rng(11)
    sums, faults = {}, 0
    with tempfile.TemporaryDirectory() as folder:
        for camera in cameras(rng):
            counts, fault = compared(camera, folder, rng)
            if fault:
                faults += 1
                print(f"{camera.name} {camera.d.tolist()} {camera.xi}: {fault}")
            elif counts:
                total = sums.setdefault(camera.kind, [0, 0])
                total[0], total[1] = total[0] + counts[0], total[1] + counts[1]
    for kind, (agree, refused) in sums.items():
        print(f"{kind}: {agree} rays agree, {refused} are refused where OpenCV evaluates on")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
