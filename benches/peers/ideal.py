#!/usr/bin/env python3
"""How near to the ideal picture a clip comes when the wanted camera path is given.

    ideal.py --plumbline BIN FOLDER... [--options "..."] [--every N] [--out DIR]

Each FOLDER is one of the clip generator (`make_synthetic_shake.py`). `plumbline stabilize` gets the true poses as a path file
(`--path-file truth.json --zoom none --border black`); its result is held against `stable_gt.mp4`, the same scene seen from the
wanted cameras. Baselines, from the true sightings to their true targets: per frame the best homography, and per frame the best
mesh (`best_mesh.py`; of its weights and the bare homography the one whose picture is nearest to the ideal), both sampled
bicubically. PSNR of the luma over the pixels that all three show, first and last five frames left out; luma alone, since what a
decoder makes of subsampled chroma on the way to RGB would weigh more than where a pixel is taken from. --out keeps a strip of
pictures per clip: ideal, ours, homography, mesh, and the differences of the three from the ideal.
"""

import argparse
import json
import shlex
import subprocess
import tempfile
from pathlib import Path

import cv2
import numpy as np

import best_mesh
import peers

LEFT_OUT = 5
LEAST_PAIRS = 8


def frames_of(path, width, height):
    """The luma planes of a clip, black 0 and white 255."""
    command = ["ffmpeg", "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "gray", "-"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as decoder:
        while len(plane := decoder.stdout.read(width * height)) == width * height:
            yield np.frombuffer(plane, np.uint8).reshape(height, width)


def projected(pose, points, camera):
    x = points @ np.array(pose["R"]).T + np.array(pose["t"])
    xy = x[:, :2] / x[:, 2:]
    d = 1 + camera.get("k1", 0.0) * np.sum(xy**2, axis=1, keepdims=True)
    return pose["focal"] * d * xy + [camera["cx"], camera["cy"]], x[:, 2] > 0


def sightings(truth, observations):
    """Per frame where the points are seen and where the wanted camera would see them."""
    points = np.array(truth["points"])[:, -3:]
    pairs = []
    for seen, pose in zip(observations, truth["stable"]):
        ids = np.array([int(o[0]) for o in seen], int)
        source = np.array([o[1:3] for o in seen], float).reshape(-1, 2)
        target, front = projected(pose, points[ids], truth["camera"])
        inside = front & np.all(np.abs(target) < 1e4, axis=1)
        pairs.append((source[inside], target[inside]))
    return pairs


def shown(frame):
    """Where a picture is not black border: black pixels that hang together with its edge."""
    dark = (frame <= 6).astype(np.uint8)
    _, labels = cv2.connectedComponents(dark)
    edge = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    border = np.isin(labels, edge[edge > 0]) & (dark > 0)
    return ~cv2.dilate(border.astype(np.uint8), np.ones((5, 5))).astype(bool)


def psnr(a, b, mask):
    error = np.mean((a[mask].astype(float) - b[mask]) ** 2)
    return 10 * np.log10(255**2 / max(error, 1e-9))


def best_mesh_of(shaky, pairs, homography, ideal, flat, others):
    """Of the meshes, and the homography `flat` itself, the picture nearest to the ideal one, and its weight."""
    score = lambda picture: psnr(picture, ideal, others & shown(picture))
    choice = [(float("inf"), flat), *best_mesh.candidates(shaky, *pairs, homography)]
    return max(choice, key=lambda c: score(c[1]))


def compare(folder, result, every, out):
    """Mean PSNR of ours, homography and mesh, and the mean part of the frame that was compared; the weights chosen."""
    truth = json.loads((folder / "truth.json").read_text())
    observations = json.loads((folder / "observations.json").read_text())["frames"]
    scores, weights = [], []
    size = truth["width"], truth["height"]
    streams = zip(frames_of(folder / "shaky.mp4", *size), frames_of(folder / "stable_gt.mp4", *size),
                  frames_of(result, *size), sightings(truth, observations), strict=True)
    for k, (shaky, ideal, ours, pairs) in enumerate(streams):
        if k % every or not LEFT_OUT <= k < truth["frames"] - LEFT_OUT or len(pairs[0]) < LEAST_PAIRS:
            continue
        homography = cv2.findHomography(*pairs, 0)[0]
        flat = cv2.warpPerspective(shaky, homography, shaky.shape[1::-1], flags=cv2.INTER_CUBIC)
        weight, mesh = best_mesh_of(shaky, pairs, homography, ideal, flat, shown(ours) & shown(flat))
        seen = shown(ours) & shown(flat) & shown(mesh)
        scores.append([psnr(p, ideal, seen) for p in (ours, flat, mesh)] + [seen.mean()])
        weights.append(weight)
        if out and k == truth["frames"] // 2 // every * every:
            save_strip(out / f"{folder.name}.png", ideal, (ours, flat, mesh), seen)
    return np.mean(scores, axis=0), weights


def save_strip(path, ideal, pictures, mask):
    far = [np.clip(4 * np.abs(p.astype(int) - ideal) * mask, 0, 255).astype(np.uint8) for p in pictures]
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.vstack([np.hstack([ideal, *pictures]), np.hstack([np.zeros_like(ideal), *far])]))


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("folders", nargs="+", type=Path)
    p.add_argument("--plumbline", type=Path, required=True)
    p.add_argument("--options", default="", help="further options of `plumbline stabilize`, one string")
    p.add_argument("--every", type=int, default=1, help="compare every so many frames")
    p.add_argument("--out", type=Path)
    a = p.parse_args()
    print(f"{'':14}{'ours dB':>9}{'homography':>12}{'mesh':>8}{'gain':>8}{'mesh gain':>11}{'compared':>10}{'weights':>18}")
    for folder in a.folders:
        with tempfile.TemporaryDirectory() as scratch:
            result = Path(scratch) / "result.mp4"
            peers.run([a.plumbline, "stabilize", folder / "shaky.mp4", "-o", result, "--path-file", folder / "truth.json",
                       "--zoom", "none", "--border", "black", "--crf", "0", "--preset", "veryfast", "--progress", "none",
                       *shlex.split(a.options)])
            (ours, flat, mesh, part), weights = compare(folder, result, a.every, a.out)
        low, high = np.quantile(weights, [0.1, 0.9], method="nearest")
        print(f"{folder.name:14}{ours:9.2f}{flat:12.2f}{mesh:8.2f}{ours - flat:+8.2f}{ours - mesh:+11.2f}{100 * part:9.1f}%"
              f"{low:9.2g} .. {high:.2g}", flush=True)


if __name__ == "__main__":
    main()
