"""The oracle of `cameras.py`: pycolmap's view graph calibration and global mapper (GLOMAP) on given tracks."""

import tempfile
import time
from pathlib import Path

import numpy as np
import pycolmap

# Steps between the frames of a pair, as dense as COLMAP's sequential matching with quadratic overlap and denser.
OFFSETS = (1, 2, 3, 4, 5, 7, 10, 14, 20, 28, 40)
LEAST_SHARED = 30

pycolmap.logging.minloglevel = pycolmap.logging.ERROR.value if hasattr(pycolmap.logging, "ERROR") else 2


def reconstruct(frames, width, height, threads=2):
    """`frames`: per frame `(id, x, y)`, pixel centers at integers + 0.5. Returns the poses, the lens, where points are seen and
    foretold, and CPU seconds; without a model, no poses."""
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        started = time.process_time()
        database = fill(folder, frames, width, height)
        options = pycolmap.TwoViewGeometryOptions()
        options.compute_relative_pose = True
        pycolmap.verify_matches(database, folder / "pairs.txt", options)
        pycolmap.calibrate_view_graph(database)
        settings = pycolmap.GlobalPipelineOptions()
        settings.num_threads = threads
        settings.random_seed = 1
        (folder / "out").mkdir()
        (folder / "images").mkdir()
        models = pycolmap.global_mapping(database, folder / "images", folder / "out", settings)
        seconds = time.process_time() - started
        best = max(models.values(), key=lambda m: m.num_reg_images(), default=None)
        found = described(best, len(frames)) if best else {"poses": [None] * len(frames), "misses": []}
        return found | {"cpu": seconds}


def fill(folder, frames, width, height):
    path = folder / "tracks.db"
    size = max(width, height)
    with pycolmap.Database.open(path) as db:
        camera = pycolmap.Camera.create_from_model_name(1, "SIMPLE_RADIAL", 1.2 * size, width, height)
        camera.has_prior_focal_length = False
        camera_id = db.write_camera(camera)
        rig = pycolmap.Rig(rig_id=1)
        rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera_id))
        db.write_rig(rig, use_rig_id=True)
        for k, points in enumerate(frames):
            image = pycolmap.Image(name=f"{k:06d}.png", camera_id=camera_id, image_id=k + 1)
            db.write_image(image, use_image_id=True)
            frame = pycolmap.Frame(frame_id=k + 1, rig_id=1)
            frame.add_data_id(pycolmap.data_t(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, camera_id), k + 1))
            db.write_frame(frame, use_frame_id=True)
            db.write_keypoints(k + 1, np.array([p[1:] for p in points], np.float32).reshape(-1, 2))
        rows = [{p[0]: r for r, p in enumerate(points)} for points in frames]
        pairs = []
        for offset in OFFSETS:
            for a in range(len(frames) - offset):
                shared = [(r, rows[a + offset][i]) for i, r in rows[a].items() if i in rows[a + offset]]
                if len(shared) >= LEAST_SHARED:
                    db.write_matches(a + 1, a + offset + 1, np.array(shared, np.uint32))
                    pairs.append(f"{a:06d}.png {a + offset:06d}.png")
    (folder / "pairs.txt").write_text("\n".join(pairs))
    return path


def described(model, count):
    poses, misses = [None] * count, []
    camera = next(iter(model.cameras.values()))
    f, cx, cy, k1 = camera.params
    for image in model.images.values():
        if not image.has_pose:
            continue
        pose, frame = image.cam_from_world(), int(image.name.split(".")[0])
        x, y, z, w = pose.rotation.quat
        poses[frame] = {"q": [w, x, y, z], "t": list(pose.translation)}
        seen = [(p.xy, model.points3D[p.point3D_id].xyz) for p in image.points2D if p.has_point3D()]
        if not seen:
            continue
        pixels, places = np.array([s[0] for s in seen]), np.array([s[1] for s in seen])
        y = places @ pose.rotation.matrix().T + pose.translation
        n = y[:, :2] / y[:, 2:]
        projected = f * n * (1 + k1 * np.sum(n * n, axis=1, keepdims=True)) + [cx, cy]
        off = np.where(y[:, 2] > 0, np.linalg.norm(projected - pixels, axis=1), np.inf)
        misses += [(frame, *p, d) for p, d in zip(pixels, off)]
    return {"poses": poses, "misses": misses, "focal": f, "k1": k1}
