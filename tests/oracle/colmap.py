#!/usr/bin/env python3
"""COLMAP models written by `plumbline motion`, read by pycolmap; and models written by pycolmap, read by us.

Text and binary must hold the same model; pycolmap's own projection of every point must fall where the track was seen, and as far
from it as we say; poses must be those of the motion file. Written again by pycolmap, in either form, the model must come back with
the same cameras.
"""
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

try:
    import pycolmap
except ImportError as missing:
    print(f"cannot run here: {missing}")
    sys.exit(77)

CLIP = str(Path("media/street-walk.mp4").resolve())
SPAN = ["--end", "2"]


def plumbline(*args):
    done = subprocess.run([os.environ["PLUMBLINE_BIN"], *args], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"plumbline {' '.join(args)}: {done.stderr}")


def read(folder, form):
    """The model in a folder, from its files of one form alone."""
    with tempfile.TemporaryDirectory() as alone:
        for file in Path(folder).glob(f"*.{form}"):
            (Path(alone) / file.name).write_bytes(file.read_bytes())
        return pycolmap.Reconstruction(alone)


def frame_of(image):
    return int(image.name.removeprefix("frame_").removesuffix(".png"))


def misses(model):
    """Distances, px, of all sightings from where pycolmap sees their points, and by point the mean of them."""
    by_point = {}
    for image in model.images.values():
        for p2d in image.points2D:
            if p2d.has_point3D():
                seen = image.project_point(model.points3D[p2d.point3D_id].xyz)
                by_point.setdefault(p2d.point3D_id, []).append(float(np.linalg.norm(seen - p2d.xy)))
    return np.concatenate(list(map(np.array, by_point.values()))), {k: np.mean(v) for k, v in by_point.items()}


def check(what, good, told):
    print(f"{'ok  ' if good else 'FAIL'} {what}: {told}")
    return not good


def poses(motion):
    return {k: np.array(c["q"] + c["t"]) for k, c in enumerate(motion["cameras"]) if c}


def compare_poses(model, motion):
    """Largest difference of quaternions and translations."""
    off = 0.0
    known = poses(motion)
    for image in model.images.values():
        pose = image.cam_from_world()
        x, y, z, w = pose.rotation.quat
        q, t = np.array([w, x, y, z]), pose.translation
        expected = known.pop(frame_of(image))
        off = max(off, np.abs(q - np.sign(q @ expected[:4]) * expected[:4]).max(), np.abs(t - expected[4:]).max())
    return off if not known else float("inf")


def main():
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        f = Path(folder)
        plumbline("motion", CLIP, "-o", str(f / "m.json"), "--colmap", str(f / "ours"), *SPAN)
        motion = json.loads((f / "m.json").read_text())
        models = {form: read(f / "ours", form) for form in ("txt", "bin")}
        for form, model in models.items():
            camera = next(iter(model.cameras.values()))
            lens = next(c for c in motion["cameras"] if c)
            expected = [lens["focal"], *lens["center"], lens["k1"]]
            failed += check(f"{form}: lens", camera.model.name == "SIMPLE_RADIAL" and np.allclose(camera.params, expected, rtol=1e-12, atol=1e-12),
                            f"{camera.model.name} {camera.params}")
            failed += check(f"{form}: poses", compare_poses(model, motion) < 1e-9, f"{compare_poses(model, motion):.1e} apart")
            distances, by_point = misses(model)
            told = max(abs(model.points3D[k].error - mean) for k, mean in by_point.items())
            limit = 3.0 * motion["source"]["width"] / 640.0
            failed += check(f"{form}: sightings", distances.max() <= limit and distances.mean() < 0.6 and told < 1e-6,
                            f"{len(distances)}, {distances.mean():.3f} px off, {distances.max():.2f} at most; the files say so to {told:.1e} px")
            tracks = sum(p.track.length() for p in model.points3D.values())
            failed += check(f"{form}: tracks", tracks == len(distances), f"{tracks} sightings in {len(model.points3D)} points")
        same = all(
            models["txt"].points3D[k].xyz.tolist() == p.xyz.tolist() for k, p in models["bin"].points3D.items()
        ) and len(models["txt"].points3D) == len(models["bin"].points3D)
        failed += check("both forms", same, "the same points to the bit")
        for form, write in (("txt", models["bin"].write_text), ("bin", models["bin"].write_binary)):
            theirs = f / f"theirs-{form}"
            theirs.mkdir()
            write(str(theirs))
            again = f / f"{form}.json"
            plumbline("motion", CLIP, "--motion", str(theirs), "-o", str(again), *SPAN)
            back = poses(json.loads(again.read_text()))
            first = poses(motion)
            off = max(np.abs(back[k] - first[k]).max() for k in first) if back.keys() == first.keys() else float("inf")
            failed += check(f"written by pycolmap as {form}", off < 1e-9, f"{len(back)} cameras, {off:.1e} apart")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
