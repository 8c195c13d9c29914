#!/usr/bin/env python3
"""Sharpness of a result, since blur flatters every measure of steadiness.

    sharpness.py CLIP... [--plumbline BIN] [--seconds 4]

Gradient energy is the mean of the squared differences of neighboring luma samples. Two ratios per clip:

    valid    of the default rendering to the same maps (`--export-stmap`) sampled with Lanczos-3 in floating point, over
             all of the cropped picture, on every tenth frame
    filled   of what `--border fill` adds to the same places of the steady picture in the nearest frame (at most two
             seconds away) that covers them itself, sampled with Lanczos-3: filled areas show what stands there, so a
             ratio below 1 is what alignment, blending and tone took away

Renderings are lossless (FFV1).

A clip that was moved so far that nothing near in time covers a place has no reference there; `seen` is the share of the
filled samples that have one. Needs ffmpeg, OpenCV, OpenEXR and NumPy.
"""

import argparse
import os
import subprocess
import tempfile
from pathlib import Path

import cv2
import numpy as np
import OpenEXR

# What is measured is computed.
os.environ["PLUMBLINE_CACHE"] = ""

BLACK = 18  # luma up to which an area that touches the edge counts as not covered; black is 16
RIM_PX = 8  # beside it kernels and feathers mix in the border
REACH_S = 2
EVERY = 10


def render(a, clip, target, *options):
    """Luma of all frames, one array per frame."""
    command = [a.plumbline, "stabilize", clip, "-o", target, "--codec", "ffv1", "--end", str(a.seconds), "--overwrite",
               "--progress", "none", *options]
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return luma(target)


def luma(target):
    """Luma of all frames of a file, one array per frame, and its frame rate."""
    probe = ["ffprobe", "-v", "error", "-select_streams", "v:0", "-show_entries", "stream=width,height,avg_frame_rate",
             "-of", "csv=p=0", target]
    width, height, rate = subprocess.run(list(map(str, probe)), check=True, capture_output=True, text=True).stdout.split(",")
    raw = subprocess.run(["ffmpeg", "-v", "error", "-i", target, "-vf", "extractplanes=y", "-f", "rawvideo", "-"],
                         check=True, capture_output=True).stdout
    over, under = map(int, rate.strip().split("/"))
    return np.frombuffer(raw, np.uint8).reshape(-1, int(height), int(width)), over / under


def energy(frame):
    """Squared gradient, one row and column smaller than the frame."""
    f = frame.astype(np.float32)
    return (f[:-1, 1:] - f[:-1, :-1]) ** 2 + (f[1:, :-1] - f[:-1, :-1]) ** 2


def lanczos3(frame, x, y):
    """The frame at the places `x, y` (pixel centers at integers), 36 taps, weights that sum to one."""
    def taps(at):
        first = np.floor(at).astype(int) - 2
        offset = at[..., None] - (first[..., None] + np.arange(6))
        weights = np.sinc(offset) * np.sinc(offset / 3)
        return first, weights / weights.sum(-1, keepdims=True)
    (x0, wx), (y0, wy) = taps(x), taps(y)
    height, width = frame.shape
    total = np.zeros(x.shape)
    for j in range(6):
        row = np.clip(y0 + j, 0, height - 1)
        for i in range(6):
            total += wy[..., j] * wx[..., i] * frame[row, np.clip(x0 + i, 0, width - 1)]
    return np.clip(np.rint(total), 0, 255)


def valid_ratio(plain, source, maps):
    """Energy of the rendering over that of the source's frames sampled through its maps."""
    ours, theirs = 0.0, 0.0
    for t in range(0, len(plain), EVERY):
        channels = OpenEXR.File(str(maps / f"frame_{t:06}.exr")).channels()
        red, green = (channels[name].pixels.astype(float) for name in "RG")
        height, width = plain[t].shape
        sampled = lanczos3(source[t].astype(float), red * width - 0.5, (1 - green) * height - 0.5)
        ours, theirs = ours + energy(plain[t]).sum(dtype=float), theirs + energy(sampled).sum(dtype=float)
    return ours / theirs


def uncovered(frame):
    """Black that touches the edge."""
    count, labels = cv2.connectedComponents((frame <= BLACK).astype(np.uint8), connectivity=4)
    edge = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    mask = np.zeros(count, np.uint8)
    mask[edge] = 1
    mask[labels[frame > BLACK]] = 0
    return mask[labels]


def filled_ratio(filled, reference, rate):
    open_at = [uncovered(f) for f in reference]
    rim = np.ones((2 * RIM_PX + 1, 2 * RIM_PX + 1))
    own = [cv2.dilate(m, rim)[:-1, :-1].ravel() == 0 for m in open_at]
    energies = [energy(f).ravel() for f in reference]
    ours, theirs, seen, total = 0.0, 0.0, 0, 0
    for t, frame in enumerate(filled):
        # Both samples of a difference lie in the filled area; specks are dark scenery at the edge.
        area = cv2.morphologyEx(open_at[t], cv2.MORPH_OPEN, np.ones((5, 5)))
        places = np.flatnonzero(cv2.erode(area, np.ones((3, 3)))[:-1, :-1])
        mine, total = energy(frame).ravel(), total + len(places)
        for away in range(1, round(REACH_S * rate)):
            for n in (t - away, t + away):
                if 0 <= n < len(filled) and len(places):
                    there = own[n][places]
                    found, places = places[there], places[~there]
                    ours, theirs = ours + mine[found].sum(dtype=float), theirs + energies[n][found].sum(dtype=float)
                    seen += len(found)
    return (ours / theirs, seen / total, total / filled.size) if theirs > 0 else (np.nan, 0.0, 0.0)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("clips", nargs="+", type=Path)
    p.add_argument("--plumbline", default="target/release/plumbline")
    p.add_argument("--seconds", type=float, default=4)
    a = p.parse_args()
    print(f"{'clip':24} valid  filled  (seen, share of the picture)")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "out.mkv")
        for clip in a.clips:
            maps = Path(folder, "maps")
            plain, rate = render(a, clip, target, "--export-stmap", maps)
            valid = valid_ratio(plain, luma(clip)[0], maps)
            filled, _ = render(a, clip, target, "--border", "fill")
            black, _ = render(a, clip, target, "--border", "black", "--interpolation", "lanczos3")
            ratio, seen, share = filled_ratio(filled, black, rate)
            print(f"{clip.stem:24} {valid:5.3f}  {ratio:6.3f}  ({seen:.2f}, {share:.3f})", flush=True)


if __name__ == "__main__":
    main()
