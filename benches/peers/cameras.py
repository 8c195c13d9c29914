#!/usr/bin/env python3
"""Cameras recovered from synthetic clips, held against the true ones.

    cameras.py FOLDER... --tool BIN [--noise PX] [--outliers SHARE] [--global-shutter] [--out DIR]
    cameras.py FOLDER... --plumbline BIN [--global-shutter] [--out DIR]
    cameras.py FOLDER... --oracle BIN [--out DIR]

Each FOLDER is one of the clip generator (`make_synthetic_shake.py`): `truth.json`, `observations.json`, `shaky.mp4`.
--tool is the built example `programs`, which gets the exact tracks, with Gaussian noise and gross outliers where
asked. --plumbline is the program itself: it tracks the pictures (`plumbline motion`), and the blocks of its motion file
are judged; its seconds are those of the whole run, decoding and tracking included. --oracle is the same
program: the tracks of the pictures (`tracks_of_clip`) are given to `cameras_from_tracks` and to pycolmap 4 (view graph
calibration and global mapper, `colmap.py`), a line each; a FOLDER may then be a clip without truth.

Printed per clip: the verdict; frames with a camera; ATE, the RMS distance of camera centers after the best similarity,
in mm and in percent of the true path's length; RMS of the rotations after the best common rotation, degrees; the same
between consecutive frames (rpe); the error of the focal length; mean reprojection error, px, of the sightings within 3 px (at
640 px across), their number, and the cells of the picture (8 x 6 per frame) that hold one; seconds per frame, CPU seconds
where two are compared. --out saves a picture of both paths per clip.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

# What is measured is computed.
os.environ["PLUMBLINE_CACHE"] = ""


def disturbed(frames, truth, noise, outliers, seed=7):
    rng = np.random.default_rng(seed)
    limits = truth["width"], truth["height"]

    def moved(x, y):
        if rng.random() < outliers:
            return rng.uniform(0, limits[0]), rng.uniform(0, limits[1])
        return x + noise * rng.standard_normal(), y + noise * rng.standard_normal()

    return [[(i, *moved(x, y)) for i, x, y in f] for f in frames]


def as_text(truth, frames):
    lines = [f"{truth['width']} {truth['height']} {truth['fps']} {len(frames)}"]
    for f in frames:
        lines.append(f"F {len(f)}")
        lines += [f"{i} {x:.6f} {y:.6f}" for i, x, y in sorted(f)]
    return "\n".join(lines)


def from_tracks(a, folder, truth):
    """What the example makes of the exact tracks."""
    frames = [[(int(i), x + 0.5, y + 0.5) for i, x, y in f]
              for f in json.loads((folder / "observations.json").read_text())["frames"]]
    text = as_text(truth, disturbed(frames, truth, a.noise, a.outliers))
    return json.loads(output([a.tool, "cameras_from_tracks", *(["--global"] if a.global_shutter else [])], text))


def from_pictures(a, folder):
    """What the program makes of the pictures, in the shape of the example's answer."""
    with tempfile.TemporaryDirectory() as scratch:
        target = Path(scratch) / "motion.json"
        started = time.perf_counter()
        rolling = "off" if a.global_shutter else "auto"
        output([a.plumbline, "motion", folder / "shaky.mp4", "-o", target, "--rolling-shutter", rolling])
        seconds = time.perf_counter() - started
        motion = json.loads(target.read_text())
    shots = motion["reconstruction"]
    if len(shots) != 1:
        print(f"{folder.name}: cut into {len(shots)} shots, the longest is judged", file=sys.stderr)
    shot = max(shots, key=lambda s: s["frames"][1] - s["frames"][0])
    first, end = shot["frames"]
    inside = [c if first <= k < end else None for k, c in enumerate(motion["cameras"])]
    lens = next((c for c in inside if c), {"focal": float("nan"), "k1": float("nan")})
    return {"verdict": shot["verdict"], "reason": shot["reason"], "figures": shot["figures"], "seconds": seconds,
            "focal": lens["focal"], "k1": lens["k1"], "readout": float("nan"), "poses": inside}


def both(a, folder):
    """The example and the oracle on the same tracks: `(name, found)` each."""
    clip = folder / "shaky.mp4" if folder.is_dir() else folder
    text = output([a.oracle, "tracks_of_clip", clip])
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ours = json.loads(output([a.oracle, "cameras_from_tracks"], text))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    ours["seconds"] = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    yield "ours", ours
    import colmap
    width, height, frames = parsed(text)
    theirs = colmap.reconstruct(frames, width, height)
    yield "oracle", as_ours(theirs, width, height)


def parsed(text):
    lines = iter(text.splitlines())
    width, height = (int(v) for v in next(lines).split()[:2])
    frames = []
    for head in lines:
        rows = (next(lines).split() for _ in range(int(head[2:])))
        frames.append([(int(i), float(x), float(y)) for i, x, y in rows])
    return width, height, frames


def as_ours(found, width, height):
    """The oracle's result in the shape of the example's answer, measured alike."""
    limit = 3 * max(width, height) / 640
    near = [m for m in found["misses"] if m[3] <= limit]
    cells = {(f, min(int(x / width * 8), 7), min(int(y / height * 6), 5)) for f, x, y, _ in near}
    registered = sum(p is not None for p in found["poses"])
    figures = {"registered": registered, "frames": len(found["poses"]), "observations": len(near),
               "reprojection_px": sum(m[3] for m in near) / max(len(near), 1),
               "coverage": len(cells) / 48 / max(registered, 1)}
    return {"verdict": "-", "reason": "", "figures": figures, "seconds": found["cpu"], "poses": found["poses"],
            "focal": found.get("focal", float("nan")), "k1": found.get("k1", float("nan")), "readout": float("nan")}


def output(command, text=None):
    run = subprocess.run([str(c) for c in command], input=text, capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"{command[0]} failed:\n{run.stderr[-1500:]}")
    return run.stdout


def matrix(q):
    w, x, y, z = q
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def angle_deg(r):
    # Accurate for small angles, where the arc cosine is not.
    axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
    return np.degrees(np.arctan2(np.linalg.norm(axis), np.trace(r) - 1))


def aligned(source, target):
    """`source` moved onto `target` by the similarity of least squares (Umeyama 1991)."""
    a, b = source.mean(0), target.mean(0)
    u, d, vt = np.linalg.svd((target - b).T @ (source - a))
    s = np.diag([1, 1, np.sign(np.linalg.det(u @ vt))])
    r = u @ s @ vt
    spread = np.sum((source - a) ** 2)
    scale = np.trace(np.diag(d) @ s) / spread if spread > 1e-20 else 0.0
    return (scale * (r @ (source - a).T)).T + b


def errors(truth, found):
    known = [k for k, p in enumerate(found["poses"]) if p]
    true_r = [np.array(truth["shaky"][k]["R"]) for k in known]
    true_c = np.array([-r.T @ np.array(truth["shaky"][k]["t"]) for k, r in zip(known, true_r)])
    our_r = [matrix(found["poses"][k]["q"]) for k in known]
    our_c = np.array([-r.T @ np.array(found["poses"][k]["t"]) for k, r in zip(known, our_r)])
    moved = aligned(our_c, true_c)
    ate = np.sqrt(np.mean(np.sum((moved - true_c) ** 2, axis=1)))
    every = np.array([-np.array(p["R"]).T @ np.array(p["t"]) for p in truth["shaky"]])
    path = np.sum(np.linalg.norm(np.diff(every, axis=0), axis=1))
    u, _, vt = np.linalg.svd(sum(t.T @ o for t, o in zip(true_r, our_r)))
    common = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt  # true world from ours
    rot = [angle_deg(t @ common @ o.T) for t, o in zip(true_r, our_r)]
    steps = [i for i in range(len(known) - 1) if known[i + 1] == known[i] + 1]
    rpe = [angle_deg((true_r[i + 1] @ true_r[i].T) @ (our_r[i + 1] @ our_r[i].T).T) for i in steps]
    rms = lambda v: float(np.sqrt(np.mean(np.square(v)))) if len(v) else float("nan")
    focal = found["focal"] / truth["camera"]["focal"] - 1
    return {"ate_mm": 1000 * ate, "ate_percent": 100 * ate / max(path, 1e-9), "rot_deg": rms(rot), "rpe_deg": rms(rpe),
            "focal_percent": 100 * focal}, (true_c, moved)


def draw(paths, target):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    true, ours = paths
    figure, axes = plt.subplots(1, 2, figsize=(11, 5))
    for axis, (i, j) in zip(axes, ((0, 2), (0, 1))):
        axis.plot(true[:, i], true[:, j], "k-", label="true")
        axis.plot(ours[:, i], ours[:, j], "r.", markersize=3, label="recovered")
        axis.set(xlabel="xyz"[i] + " (m)", ylabel="xyz"[j] + " (m)")
        axis.axis("equal")
    axes[0].legend()
    figure.tight_layout()
    figure.savefig(target, dpi=80)
    plt.close(figure)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("folders", nargs="+", type=Path)
    source = p.add_mutually_exclusive_group(required=True)
    source.add_argument("--tool", type=Path, help="the built example `programs`: exact tracks")
    source.add_argument("--plumbline", type=Path, help="the program: its own tracks of shaky.mp4")
    source.add_argument("--oracle", type=Path, help="the built example `programs`: ours and pycolmap on the same tracks")
    p.add_argument("--noise", type=float, default=0.0, help="standard deviation per coordinate, px")
    p.add_argument("--outliers", type=float, default=0.0, help="share of sightings that are nowhere near")
    p.add_argument("--global-shutter", action="store_true", help="look for no readout time")
    p.add_argument("--out", type=Path)
    a = p.parse_args()
    print(f"{'':21}{'verdict':>14}{'frames':>9}{'ATE mm':>9}{'ATE %':>9}{'rot':>8}{'rpe':>9}{'f %':>8}{'k1':>8}"
          f"{'readout':>8}{'px':>7}{'seen':>8}{'cells':>7}{'s/frame':>9}  reason")
    for folder in a.folders:
        truth_file = folder / "truth.json"
        truth = json.loads(truth_file.read_text()) if truth_file.exists() else None
        if a.oracle:
            results = both(a, folder)
        else:
            results = [("", from_tracks(a, folder, truth) if a.tool else from_pictures(a, folder))]
        for name, found in results:
            print(line(a, f"{folder.stem} {name}".strip(), truth, found), flush=True)


def line(a, name, truth, found):
    """One row of the table; a picture beside it where one is asked for."""
    f = found["figures"]
    text = f"{name:21}{found['verdict']:>14}{f['registered']:>5}/{f['frames']:<3}"
    moving = f["registered"] > 1 and truth
    if moving:
        e, paths = errors(truth, found)
        text += (f"{e['ate_mm']:9.2f}{e['ate_percent']:9.4f}{e['rot_deg']:8.4f}{e['rpe_deg']:9.5f}"
                 f"{e['focal_percent']:8.3f}{found['k1']:8.4f}{found['readout']:8.3f}")
        if a.out:
            a.out.mkdir(parents=True, exist_ok=True)
            draw(paths, a.out / f"{name.replace(' ', '-')}.png")
    else:
        text += " " * 59
    cells = round(48 * f["coverage"] * f["registered"])
    return (f"{text}{f['reprojection_px']:7.3f}{f['observations']:8}{cells:7}"
            f"{found['seconds'] / max(f['frames'], 1):9.4f}  {found['reason']}")


if __name__ == "__main__":
    main()
