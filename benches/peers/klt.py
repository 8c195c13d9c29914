#!/usr/bin/env python3
"""KLT against OpenCV's calcOpticalFlowPyrLK, alternated in one run: CPU time and error, forward and backward.

The frames are homography warps of a synthetic texture, so the truth is exact. Corners (goodFeaturesToTrack), window
(21x21), levels (maxLevel 3), iterations (30) and check (< 0.5 px) are the same on both sides, and both run on one thread.

Accounting: a streaming tracker builds one pyramid per frame and calcOpticalFlowPyrLK builds its own in every call (two in
each of two calls). `ratio` = (one pyramid + track) of ours / (forward + backward) of OpenCV. `shared` takes three of
OpenCV's four pyramids off its time, as a caller in C++ can by building one per frame and handing it to both calls.

  python benches/peers/klt.py [--rounds 5] [--frames 7] [--sizes 640x360,...] [--points 500,1000,2000] [--check]

--check exits 1 where the bar is missed on accuracy (median <= 1.1 x, rms <= 1.2 x, kept >= 99 %).
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import cv2
import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tests" / "oracle"))
from _programs import program  # noqa: E402
from klt import GFTT, LK, errors, make_frames, write_clip  # noqa: E402


def opencv_pass(frames, points):
    """CPU ms per pair: (forward and backward, one pyramid without gradients)."""
    t = time.process_time()
    for i, p in enumerate(points):
        q = cv2.calcOpticalFlowPyrLK(frames[i], frames[i + 1], p, None, **LK)[0]
        cv2.calcOpticalFlowPyrLK(frames[i + 1], frames[i], q, None, **LK)
    done = time.process_time()
    for f in frames[1:]:
        cv2.buildOpticalFlowPyramid(f, LK["winSize"], LK["maxLevel"], withDerivatives=False)
    return np.array([done - t, time.process_time() - done]) * 1e3 / len(points)


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("--rounds", type=int, default=5)
    ap.add_argument("--frames", type=int, default=7)
    ap.add_argument("--sizes", default="640x360,1280x720,1920x1080")
    ap.add_argument("--points", default="500,1000,2000")
    ap.add_argument("--check", action="store_true")
    a = ap.parse_args()
    cv2.setNumThreads(1)
    command, failed = program("klt_frames"), False
    print(f"OpenCV {cv2.__version__}, load {os.getloadavg()[0]:.1f}, best of {a.rounds} alternated rounds, CPU ms per pair of frames")
    print("size       points | opencv  shared |  pyramid   track | ratio  shared | median x   rms x  kept %")
    for size in a.sizes.split(","):
        w, h = map(int, size.split("x"))
        frames, truth = make_frames(w, h, a.frames)
        for n in map(int, a.points.split(",")):
            points = [cv2.goodFeaturesToTrack(f, n, **GFTT) for f in frames[:-1]]
            with tempfile.TemporaryDirectory() as d:
                write_clip(d, frames, points)
                cv, sh, ours = [], [], []
                for _ in range(a.rounds):
                    both, pyramid = opencv_pass(frames, points)
                    cv.append(both)
                    sh.append(both - 3 * pyramid)
                    ours.append(json.loads(subprocess.check_output([*command, d, "3"])))
                e = errors(d, frames, points, truth)
            cv, sh = min(cv), min(sh)
            pyr, trk = min(o["pyramid_ms"] for o in ours), min(o["track_ms"] for o in ours)
            med, rms, kept = (e["ours"][k] / e["opencv"][k] for k in ("median", "rms", "kept"))
            failed |= med > 1.1 or rms > 1.2 or kept < 0.99
            print(f"{size:>9} {n:>7} | {cv:6.2f}  {sh:6.2f} | {pyr:8.3f} {trk:7.3f} | {(pyr + trk) / cv:5.3f}  {(pyr + trk) / sh:6.3f} "
                  f"| {med:8.3f} {rms:7.3f} {100 * kept:7.2f}", flush=True)
    sys.exit(1 if a.check and failed else 0)


if __name__ == "__main__":
    main()
