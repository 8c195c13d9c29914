#!/usr/bin/env python3
"""Oracle: inter-frame motion against OpenCV's findHomography and estimateAffinePartial2D. Exits 1 on failure.

Random frame pairs with noise and scattered wrong matches; half of the points are given to both, the other half tells how far
each is off. Our median distance on the held-out points, over all pairs, must be <= 1.05 x OpenCV's. Pairs that move by
similarities are held against the partial affine fit, the others against the homography.
"""
import subprocess
import sys

import cv2
import numpy as np

from _programs import program

WIDTH, HEIGHT, POINTS, NOISE = 640, 360, 600, 0.15


def mapped(h, p):
    q = np.c_[p, np.ones(len(p))] @ h.T
    return q[:, :2] / q[:, 2:]


def random_motion(rng, perspective):
    angle, zoom, shift = rng.normal(0, 0.006), 1 + rng.normal(0, 0.004), rng.normal(0, 6, 2)
    c, s = zoom * np.cos(angle), zoom * np.sin(angle)
    h = np.array([[c, -s, shift[0]], [s, c, shift[1]], [0, 0, 1.0]])
    if perspective:
        h[0, 0] += rng.normal(0, 0.004)
        h[0, 1] += rng.normal(0, 0.004)
        h[2, :2] = rng.normal(0, 1.2e-5, 2)
    center = np.array([[1, 0, WIDTH / 2], [0, 1, HEIGHT / 2], [0, 0, 1.0]])
    return center @ h @ np.linalg.inv(center)


def ours(points, moved):
    """Homography of the second frame, and whether the point's similarity was kept."""
    frame = lambda p: f"F {len(p)}\n" + "".join(f"{i} {x:.6f} {y:.6f}\n" for i, (x, y) in enumerate(p))
    text = f"{WIDTH} {HEIGHT} 30 2\n" + frame(points) + frame(moved)
    run = subprocess.run(program("motion_from_tracks"), input=text, capture_output=True, text=True, check=True)
    return np.array([float(v) for v in run.stdout.splitlines()[1].split("|")[1].split()]).reshape(3, 3)


def trial(rng, perspective, wrong):
    truth = random_motion(rng, perspective)
    p = rng.uniform([5, 5], [WIDTH - 5, HEIGHT - 5], (POINTS, 2))
    q = mapped(truth, p) + rng.normal(0, NOISE, p.shape)
    given, held = slice(0, POINTS // 2), slice(POINTS // 2, POINTS)
    bad = rng.random(POINTS) < wrong
    bad[held] = False
    q[bad] += rng.uniform(-25, 25, (bad.sum(), 2))
    if perspective:
        theirs, _ = cv2.findHomography(p[given], q[given], cv2.RANSAC, 1.0, maxIters=5000, confidence=0.999)
    else:
        theirs, _ = cv2.estimateAffinePartial2D(p[given], q[given], ransacReprojThreshold=1.0, maxIters=5000, confidence=0.999)
        theirs = np.vstack([theirs, [0, 0, 1]])
    off = lambda h: np.median(np.linalg.norm(mapped(h, p[held]) - q[held], axis=1))
    return off(ours(p[given], q[given])), off(theirs)


def main():
    rng = np.random.default_rng(4)
    failed = False
    for perspective in (False, True):
        for wrong in (0.0, 0.2, 0.4):
            results = np.array([trial(rng, perspective, wrong) for _ in range(25)])
            mine, theirs = np.median(results, axis=0)
            worst = (results[:, 0] / results[:, 1]).max()
            kind = "homography" if perspective else "similarity"
            print(f"{kind}, {wrong:.0%} wrong: held-out median {mine:.4f} px, OpenCV {theirs:.4f} px, "
                  f"ratio {mine / theirs:.3f}, worst pair {worst:.3f}")
            failed |= not mine <= 1.05 * theirs
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
