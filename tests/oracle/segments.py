#!/usr/bin/env python3
"""Oracle: straight edges against OpenCV's line segment detector. Exits 1 on failure, 77 without OpenCV's detector.

Counted is the share of OpenCV's long segments, by length, that lies within 1 px of one of ours whose direction differs by
less than 1 degree, and the reverse: a share of length, since where a long edge is cut into pieces is chance in both. Even
which edges are found is, on photos: OpenCV agrees with itself on a picture that lacks its first rows and columns to 65 %
in the worst case. Both shares must reach nine tenths of what OpenCV reaches with itself there.

Pictures: a made-up one of tilted bars with noise, and photos of PLUMBLINE_MEDIA where it is set.

PLUMBLINE_EXAMPLES names the folder of the built examples; without it target/release/examples, then debug.
"""
import json
import os
import subprocess
import sys
import tempfile

import cv2
import numpy as np

from _programs import program

LONG = 0.06      # of the longer side
WITHIN_PX, WITHIN_DEG, SHARE = 1.0, 1.0, 0.9
CUT = np.array([3, 2, 3, 2])   # columns and rows that the second picture lacks
PHOTOS = ["retarget/rme_getty.png", "retarget/rme_bells.png", "retarget/liplus_castle.jpg", "portrait/yzhq_3_104.jpg",
          "fisheye_calib/gopro_3D_L0478.JPG"]


def bars():
    rng = np.random.default_rng(1)
    picture = np.full((480 * 4, 640 * 4), 90, np.uint8)
    for _ in range(14):
        a = rng.uniform([0, 0], [640, 480]) * 4
        t = rng.uniform(0, np.pi)
        b = a + rng.uniform(120, 400) * 4 * np.array([np.cos(t), np.sin(t)])
        cv2.line(picture, tuple(int(v) for v in a), tuple(int(v) for v in b), int(rng.integers(0, 255)),
                 int(rng.integers(16, 60)))
    small = cv2.resize(picture, (640, 480), interpolation=cv2.INTER_AREA).astype(float)
    return np.clip(small + rng.normal(0, 4, small.shape), 0, 255).astype(np.uint8)


def pictures():
    yield "bars", bars()
    media = os.environ.get("PLUMBLINE_MEDIA")
    for name in PHOTOS if media else []:
        picture = cv2.imread(os.path.join(media, "photo", name), cv2.IMREAD_GRAYSCALE)
        if picture is not None:
            scale = min(1.0, 1600 / max(picture.shape))
            yield name, cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def covered(segments, others):
    """Share of the length of `segments` that lies along `others`."""
    a, b = others[:, :2], others[:, 2:4]
    along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    hit = total = 0
    for s in segments:
        d = s[2:4] - s[:2]
        length = np.hypot(*d)
        turn = np.degrees(np.arcsin(np.clip(np.abs(along[:, 0] * d[1] - along[:, 1] * d[0]) / length, 0, 1)))
        near = turn < WITHIN_DEG
        for p in s[:2] + np.linspace(0, 1, max(int(length), 2))[:, None] * d:
            q = p - a[near]
            t, off = (q * along[near]).sum(1), np.abs(q[:, 0] * along[near, 1] - q[:, 1] * along[near, 0])
            inside = (t > -1.5) & (t < np.linalg.norm(b - a, axis=1)[near] + 1.5)
            hit += bool((inside & (off < WITHIN_PX)).any())
            total += 1
    return hit / max(total, 1)


def main():
    try:
        detector = cv2.createLineSegmentDetector(cv2.LSD_REFINE_ADV)
    except (AttributeError, cv2.error):
        print("skipped: this OpenCV has no line segment detector")
        return 77
    failed = False
    for name, picture in pictures():
        detect = lambda p: detector.detect(np.ascontiguousarray(p))[0].reshape(-1, 4) + 0.5
        theirs, again = detect(picture), detect(picture[CUT[1]:, CUT[0]:]) + CUT
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "picture.png")
            cv2.imwrite(path, picture)
            run = subprocess.run([*program("segments_of_image"), path], capture_output=True, text=True, check=True)
        ours = json.loads(run.stdout)
        mine, least = np.array(ours["segments"]), LONG * max(picture.shape)
        long = lambda s: s[np.hypot(s[:, 2] - s[:, 0], s[:, 3] - s[:, 1]) > least]
        found, backed = covered(long(theirs), mine), covered(long(mine), theirs)
        itself = min(covered(long(theirs), again), covered(long(again), theirs))
        print(f"{name}: {len(mine)} segments, OpenCV {len(theirs)}; long {len(long(mine))} and {len(long(theirs))}; "
              f"of OpenCV's length found {found:.3f}, of ours backed {backed:.3f}, itself {itself:.3f}; "
              f"{ours['seconds_per_megapixel']:.3f} s/MP")
        failed |= not min(found, backed) >= SHARE * itself
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
