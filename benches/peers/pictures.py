#!/usr/bin/env python3
"""Pictures of a stabilization, to be looked at: contact sheets of frames, path plots, grids over frames.

    pictures.py ORIGINAL STEADY [--motion FILE.json] [--out DIR] [--frames 6]

    strip.png   frames of the original above the same frames of the result, and below them the mean of some
                consecutive frames of each: the steadier the clip, the sharper its mean
    grid.png    the same frames with a regular grid carried along by the motion between original and result
    fill.png    with --black (the same clip rendered with `--border black`): the frames of a result of `--border fill`,
                and beside each the same with an outline around what its own picture does not cover
    path.png    x, y and angle of the original path and of the result's, in px and degrees; with --motion (as written
                by `plumbline stabilize --export-motion`) the original's path is taken from that file
"""

import argparse
import json
from pathlib import Path

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

WIDTH = 480  # of a frame on a sheet, px
MEAN_OF = 7  # consecutive frames whose mean shows how much they move


def read(path):
    """All frames, scaled to the sheet's width."""
    capture, frames = cv2.VideoCapture(str(path)), []
    while (got := capture.read())[0]:
        h, w = got[1].shape[:2]
        frames.append(cv2.resize(got[1], (WIDTH, round(h * WIDTH / w)), interpolation=cv2.INTER_AREA))
    if not frames:
        raise SystemExit(f"{path}: no frame could be read")
    return frames


def labeled(image, text):
    out = image.copy()
    for color, thickness in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(out, text, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.5, color, thickness, cv2.LINE_AA)
    return out


def sheet(rows):
    """Rows of equally high pictures, cut to the shortest row."""
    n = min(map(len, rows))
    return np.vstack([np.hstack(row[:n]) for row in rows])


def strip(original, steady, chosen):
    around = lambda frames, i: np.mean(frames[max(0, i - MEAN_OF // 2):i + MEAN_OF // 2 + 1], axis=0).astype(np.uint8)
    rows = []
    for name, frames in (("original", original), ("steady", steady)):
        rows.append([labeled(frames[i], f"{name} {i}") for i in chosen])
    for name, frames in (("original", original), ("steady", steady)):
        rows.append([labeled(around(frames, i), f"{name}, mean of {MEAN_OF}") for i in chosen])
    return sheet(rows)


def filled(steady, black, chosen):
    """Each frame beside itself with what `black` leaves open outlined."""
    rows = []
    for i in chosen:
        _, areas = cv2.connectedComponents((black[i].max(2) < 22).astype(np.uint8))
        edge = np.unique(np.concatenate([areas[0], areas[-1], areas[:, 0], areas[:, -1]]))
        open_ = (np.isin(areas, edge[edge > 0])).astype(np.uint8)
        around, _ = cv2.findContours(open_, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        outlined = cv2.drawContours(steady[i].copy(), around, -1, (0, 0, 255), 1)
        rows.append([labeled(steady[i], f"steady {i}"), labeled(outlined, "outlined: filled")])
    return sheet(rows)


def tracked(a, b):
    """Corners of `a` and where they are in `b`."""
    gray = [cv2.cvtColor(f, cv2.COLOR_BGR2GRAY) for f in (a, b)]
    corners = cv2.goodFeaturesToTrack(gray[0], 400, 0.005, 8)
    if corners is None:
        return np.zeros((0, 2)), np.zeros((0, 2))
    there, ok, _ = cv2.calcOpticalFlowPyrLK(*gray, corners, None, winSize=(21, 21), maxLevel=4)
    back, ok2, _ = cv2.calcOpticalFlowPyrLK(gray[1], gray[0], there, None, winSize=(21, 21), maxLevel=4)
    keep = (ok.ravel() > 0) & (ok2.ravel() > 0) & (np.linalg.norm(back - corners, axis=2).ravel() < 0.5)
    return corners[keep, 0], there[keep, 0]


def grids(original, steady, chosen, cells=(16, 9)):
    """A regular grid over each original, and over its result the same grid moved as the picture was moved: locally,
    by the mean displacement of near corners beyond the best homography."""
    above, below = [], []
    for i in chosen:
        h, w = original[i].shape[:2]
        grid = np.stack(np.meshgrid(np.linspace(0, w, cells[0] + 1), np.linspace(0, h, cells[1] + 1)), -1)
        p, q = tracked(original[i], steady[i])
        plain, moved = original[i].copy(), steady[i].copy()
        draw(plain, grid)
        H = cv2.findHomography(p, q, cv2.RANSAC, 3.0)[0] if len(p) >= 8 else None
        if H is not None:
            project = lambda x: cv2.perspectiveTransform(x.reshape(-1, 1, 2).astype(np.float64), H).reshape(x.shape)
            rest = q - project(p)
            near = np.exp(-((grid[:, :, None] - p[None, None]) ** 2).sum(-1) / (2 * (w / 16) ** 2))
            near *= (np.linalg.norm(rest, axis=1) < 4)[None, None]
            local = (near[..., None] * rest).sum(2) / (near.sum(2) + 1.0)[..., None]
            draw(moved, project(grid) + local)
        above.append(labeled(plain, f"original {i}"))
        below.append(labeled(moved, f"steady {i}: {len(p)} points"))
    return sheet([above, below])


def draw(image, grid):
    for lines in (grid, grid.transpose(1, 0, 2)):
        for line in lines:
            cv2.polylines(image, [np.round(line * 16).astype(np.int32)], False, (80, 255, 255), 1, cv2.LINE_AA, 4)


def measured_path(frames):
    """Cumulative x, y (px of the sheet's width) and angle (degrees) of the camera, from similarities between frames."""
    steps = [(0.0, 0.0, 0.0)]
    center = np.array([frames[0].shape[1] / 2, frames[0].shape[0] / 2])
    for a, b in zip(frames, frames[1:]):
        p, q = tracked(a, b)
        m = cv2.estimateAffinePartial2D(p - center, q - center)[0] if len(p) >= 6 else None
        steps.append((0, 0, 0) if m is None else (m[0, 2], m[1, 2], np.degrees(np.arctan2(m[1, 0], m[0, 0]))))
    return np.cumsum(steps, axis=0)


def result_path(path, original, steady):
    """The result's path: the original's, moved by the similarity between each frame and its own result. Summing up
    motion between frames of the result instead drifts: what is left of it is as small as the error of each step."""
    center = np.array([original[0].shape[1] / 2, original[0].shape[0] / 2])
    moved = []
    for i, (a, b) in enumerate(zip(original, steady)):
        p, q = tracked(a, b)
        m = cv2.estimateAffinePartial2D(p - center, q - center)[0] if len(p) >= 6 else None
        x, y, angle = path[min(i, len(path) - 1)]
        if m is None:
            moved.append((np.nan,) * 3)
            continue
        # What was at the middle of the first frame is (x, y) off it now: where is that in the result, its zoom aside?
        x, y = (m[:, :2] @ (x, y) + m[:, 2]) / np.hypot(m[0, 0], m[1, 0])
        moved.append((x, y, angle + np.degrees(np.arctan2(m[1, 0], m[0, 0]))))
    return np.array(moved)


def exported_path(path):
    """The same from a motion file: its block `planar` holds `next_from_this` per frame, 3x3."""
    document = json.loads(Path(path).read_text())
    width, height = document["source"]["width"], document["source"]["height"]
    center = np.array([width / 2, height / 2, 1.0])
    steps = []
    for planar in document["planar"]:
        m = np.eye(3) if planar is None else np.array(planar, float)
        at = m @ center
        x, y = (at[:2] / at[2] - center[:2]) * WIDTH / width
        steps.append((x, y, np.degrees(np.arctan2(m[1, 0], m[0, 0]))))
    steps = [(0.0, 0.0, 0.0), *steps[:-1]]
    return np.cumsum(steps, axis=0)


def plot(original, steady, target):
    figure, axes = plt.subplots(3, 1, figsize=(12, 9), sharex=True)
    for axis, label, k in zip(axes, (f"x, px of {WIDTH}", f"y, px of {WIDTH}", "angle, degrees"), range(3)):
        axis.plot(original[:, k], label="original", linewidth=0.9)
        axis.plot(steady[:, k], label="steady", linewidth=1.4)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[0].legend()
    axes[2].set_xlabel("frame")
    figure.tight_layout()
    figure.savefig(target, dpi=80)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("original", type=Path)
    p.add_argument("steady", type=Path)
    p.add_argument("--motion", type=Path)
    p.add_argument("--black", type=Path)
    p.add_argument("--out", type=Path, default=Path("out/pictures"))
    p.add_argument("--frames", type=int, default=6)
    a = p.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    original, steady = read(a.original), read(a.steady)
    n = min(len(original), len(steady))
    chosen = np.linspace(n // 12, n - 1 - n // 12, a.frames).astype(int)
    cv2.imwrite(str(a.out / "strip.png"), strip(original, steady, chosen))
    cv2.imwrite(str(a.out / "grid.png"), grids(original, steady, chosen))
    path = exported_path(a.motion) if a.motion else measured_path(original)
    plot(path, result_path(path, original, steady), a.out / "path.png")
    names = ["strip", "grid", "path"]
    if a.black:
        cv2.imwrite(str(a.out / "fill.png"), filled(steady, read(a.black), chosen))
        names.append("fill")
    for name in names:
        print(a.out / f"{name}.png")


if __name__ == "__main__":
    main()
