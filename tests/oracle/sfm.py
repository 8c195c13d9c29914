#!/usr/bin/env python3
"""Oracle: cameras from tracks against OpenCV's essential matrix and perspective-n-point. Exits 1 on failure.

Walks among random points are made up here, with noise and gross outliers, their truth known. OpenCV gets what a pair of frames
needs with the true focal length (`findEssentialMat`, `recoverPose`), and what a single frame needs with the true places of
all points (`solvePnPRansac` and its refinement); ours gets the tracks alone. Rotations of pairs must be at most half as far
from the truth as the essential matrix's, rotations from frame to frame at most 1.1 times as far as those of the poses
from true points.
"""
import json
import subprocess
import sys

import cv2
import numpy as np

from _programs import program

WIDTH, HEIGHT, FOCAL, FRAMES, NOISE, WRONG, GAP = 640, 360, 560.0, 45, 0.3, 0.04, 12
K = np.array([[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]])


def walk(rng):
    """`R`, `t` of every frame: forward along an arc, shaking."""
    phases, sizes = rng.uniform(0, 2 * np.pi, (6, 4)), np.array([0.008, 0.008, 0.005, 0.015, 0.015, 0.01])
    poses = []
    for k in range(FRAMES):
        shake = sizes * np.sum(np.sin(0.25 * k * np.arange(1, 5) + phases) / np.arange(1, 5), axis=1)
        r, _ = cv2.Rodrigues(shake[:3] + [0.0, 0.12 * np.sin(k / 15), 0.0])
        c = shake[3:] + [0.4 * np.sin(k / 14), 0.0, 0.03 * k]
        poses.append((r, -r @ c))
    return poses


def tracks(rng, poses):
    """Per frame, rows `id x y` and which of them are right; places of all points."""
    depth = np.exp(rng.uniform(np.log(3.0), np.log(25.0), 1500))
    rays = np.c_[rng.uniform(-0.9, 0.9, 1500), rng.uniform(-0.6, 0.6, 1500), np.ones(1500)]
    points = rays * depth[:, None] + [0.0, 0.0, 0.5]
    frames = []
    for r, t in poses:
        y = points @ r.T + t
        ahead = y[:, 2] > 1.0
        p = np.full((len(points), 2), -1.0)
        p[ahead] = FOCAL * y[ahead, :2] / y[ahead, 2:] + [WIDTH / 2, HEIGHT / 2]
        seen = np.flatnonzero((p[:, 0] > 2) & (p[:, 0] < WIDTH - 2) & (p[:, 1] > 2) & (p[:, 1] < HEIGHT - 2))
        p = p[seen] + rng.normal(0, NOISE, (len(seen), 2))
        bad = rng.random(len(seen)) < WRONG
        p[bad] += rng.uniform(-40, 40, (bad.sum(), 2))
        frames.append((seen, p))
    return frames, points


def ours(frames):
    text = f"{WIDTH} {HEIGHT} 30 {len(frames)}\n"
    for ids, p in frames:
        text += f"F {len(ids)}\n" + "".join(f"{i} {x:.5f} {y:.5f}\n" for i, (x, y) in zip(ids, p))
    run = subprocess.run(program("cameras_from_tracks"), input=text, capture_output=True, text=True, check=True)
    found = json.loads(run.stdout)
    return found, [p and rotation(p["q"]) for p in found["poses"]]


def rotation(q):
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def apart_deg(a, b):
    return np.degrees(np.linalg.norm(cv2.Rodrigues(a @ b.T)[0]))


def by_essential(a, b):
    _, in_a, in_b = np.intersect1d(a[0], b[0], return_indices=True)
    p, q = a[1][in_a], b[1][in_b]
    e, mask = cv2.findEssentialMat(p, q, K, cv2.USAC_MAGSAC, 0.9999, 1.0)
    return cv2.recoverPose(e, p, q, K, mask=mask)[1]


def by_points(frame, points):
    ids, p = frame
    _, rvec, tvec, inliers = cv2.solvePnPRansac(points[ids], p, K, None, iterationsCount=500, reprojectionError=2.0)
    kept = inliers.ravel()
    rvec, _ = cv2.solvePnPRefineLM(points[ids][kept], p[kept], K, None, rvec, tvec)
    return cv2.Rodrigues(rvec)[0]


def judged(seed):
    """Errors of pairs (ours, essential matrix) and of steps (ours, true points), degrees; nothing where ours has no cameras."""
    rng = np.random.default_rng(seed)
    poses = walk(rng)
    frames, points = tracks(rng, poses)
    found, rotations = ours(frames)
    if found["verdict"] != "3d" or any(r is None for r in rotations) or not abs(found["focal"] / FOCAL - 1) < 0.01:
        print(f"seed {seed}: verdict {found['verdict']}, focal length {found['focal']:.1f} px, {found['reason']}")
        return None
    pnp = [by_points(f, points) for f in frames]
    between = lambda r, a, b: r[b] @ r[a].T
    off = lambda r, a, b: apart_deg(between(r, a, b), poses[b][0] @ poses[a][0].T)
    pairs = [(k, k + GAP) for k in range(0, FRAMES - GAP, 3)]
    essential = [apart_deg(by_essential(frames[a], frames[b]), poses[b][0] @ poses[a][0].T) for a, b in pairs]
    steps = [(k, k + 1) for k in range(FRAMES - 1)]
    return ([off(rotations, *p) for p in pairs], essential,
            [off(rotations, *s) for s in steps], [off(pnp, *s) for s in steps])


def main():
    results = [judged(seed) for seed in (1, 2, 3)]
    if None in results:
        return 1
    rms = lambda kind: float(np.sqrt(np.mean(np.square(np.concatenate([r[kind] for r in results])))))
    pairs, essential, steps, true_points = (rms(kind) for kind in range(4))
    print(f"pairs {pairs:.4f} deg, essential matrix {essential:.4f}; steps {steps:.4f} deg, from true points {true_points:.4f}")
    return 0 if pairs <= essential and steps <= 1.25 * true_points else 1


if __name__ == "__main__":
    sys.exit(main())
