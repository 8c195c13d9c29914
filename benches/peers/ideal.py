#!/usr/bin/env python3
"""How near to the ideal picture a clip comes when the wanted camera path is given.

    ideal.py --plumbline BIN FOLDER... [--options "..."] [--out DIR]

Each FOLDER is one of the clip generator (`make_synthetic_shake.py`). `plumbline stabilize` gets the true poses as a path file
(`--path-file truth.json --zoom none --border black`); its result is held against `stable_gt.mp4`, the same scene seen from the
wanted cameras. Baseline: per frame the best homography from the true sightings to their true targets. PSNR over the pixels
that both show, first and last five frames left out. --out keeps a strip of pictures per clip: ideal, ours, homography, and
the differences of both from the ideal.
"""

import argparse
import json
import shlex
import tempfile
from pathlib import Path

import cv2
import numpy as np

import peers

LEFT_OUT = 5


def frames_of(path):
    video = cv2.VideoCapture(str(path))
    while True:
        good, frame = video.read()
        if not good:
            return
        yield frame


def projected(pose, points, camera):
    x = points @ np.array(pose["R"]).T + np.array(pose["t"])
    xy = x[:, :2] / x[:, 2:]
    d = 1 + camera.get("k1", 0.0) * np.sum(xy**2, axis=1, keepdims=True)
    return pose["focal"] * d * xy + [camera["cx"], camera["cy"]], x[:, 2] > 0


def homographies(truth, observations):
    """Per frame the homography of least squares from the sightings to their targets; `None` where too few are seen."""
    points = np.array(truth["points"])[:, -3:]
    maps = []
    for seen, pose in zip(observations, truth["stable"]):
        ids = np.array([int(o[0]) for o in seen])
        source = np.array([o[1:3] for o in seen])
        target, front = projected(pose, points[ids], truth["camera"])
        inside = front & np.all(np.abs(target) < 1e4, axis=1)
        maps.append(cv2.findHomography(source[inside], target[inside], 0)[0] if inside.sum() >= 8 else None)
    return maps


def shown(frame):
    """Where a picture is not black border: black pixels that hang together with its edge."""
    dark = (frame.max(axis=2) <= 6).astype(np.uint8)
    _, labels = cv2.connectedComponents(dark)
    edge = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    border = np.isin(labels, edge[edge > 0]) & (dark > 0)
    return ~cv2.dilate(border.astype(np.uint8), np.ones((5, 5))).astype(bool)


def psnr(a, b, mask):
    error = np.mean((a[mask].astype(float) - b[mask]) ** 2)
    return 10 * np.log10(255**2 / max(error, 1e-9))


def compare(folder, result, out):
    truth = json.loads((folder / "truth.json").read_text())
    observations = json.loads((folder / "observations.json").read_text())["frames"]
    maps, scores = homographies(truth, observations), []
    streams = zip(frames_of(folder / "shaky.mp4"), frames_of(folder / "stable_gt.mp4"), frames_of(result), strict=True)
    for k, (shaky, ideal, ours) in enumerate(streams):
        if not LEFT_OUT <= k < truth["frames"] - LEFT_OUT or maps[k] is None:
            continue
        flat = cv2.warpPerspective(shaky, maps[k], shaky.shape[1::-1], flags=cv2.INTER_CUBIC)
        both = shown(ours) & shown(flat)
        scores.append((psnr(ours, ideal, both), psnr(flat, ideal, both), both.mean()))
        if out and k == truth["frames"] // 2:
            far = lambda p: np.clip(4 * np.abs(p.astype(int) - ideal) * both[..., None], 0, 255).astype(np.uint8)
            out.mkdir(parents=True, exist_ok=True)
            rows = [np.hstack([ideal, ours, flat]), np.hstack([np.zeros_like(ideal), far(ours), far(flat)])]
            cv2.imwrite(str(out / f"{folder.name}.png"), np.vstack(rows))
    return np.mean(scores, axis=0)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("folders", nargs="+", type=Path)
    p.add_argument("--plumbline", type=Path, required=True)
    p.add_argument("--options", default="", help="further options of `plumbline stabilize`, one string")
    p.add_argument("--out", type=Path)
    a = p.parse_args()
    print(f"{'':14}{'ours dB':>9}{'homography':>12}{'gain':>7}{'compared':>10}")
    for folder in a.folders:
        with tempfile.TemporaryDirectory() as scratch:
            result = Path(scratch) / "result.mp4"
            peers.run([a.plumbline, "stabilize", folder / "shaky.mp4", "-o", result, "--path-file", folder / "truth.json",
                       "--zoom", "none", "--border", "black", "--crf", "4", "--preset", "veryfast", "--progress", "none",
                       *shlex.split(a.options)])
            ours, flat, part = compare(folder, result, a.out)
        print(f"{folder.name:14}{ours:9.2f}{flat:12.2f}{ours - flat:+7.2f}{100 * part:9.1f}%", flush=True)


if __name__ == "__main__":
    main()
