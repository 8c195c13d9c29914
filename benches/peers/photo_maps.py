"""What the photo bench measures besides maps of plumbline: peers' maps, lines and weights found by OpenCV, pictures of maps.

A map is a pair of arrays (y, x) of source positions, pixel centers at integers, as `cv2.remap` and the metrics take it.
"""

import json
from pathlib import Path

import cv2
import numpy as np


def fisheye_undistorted(camera, size, balance):
    """The map of OpenCV's fisheye undistortion; `balance` 0 cuts the black border away, 1 shows all."""
    k = np.array([[camera["fx"], 0, camera["cx"]], [0, camera["fy"], camera["cy"]], [0, 0, 1]])
    d = np.array(camera["k"][:4])
    new = cv2.fisheye.estimateNewCameraMatrixForUndistortRectify(k, d, size, np.eye(3), balance=balance)
    return cv2.fisheye.initUndistortRectifyMap(k, d, np.eye(3), new, size, cv2.CV_32FC1)


def scaled(source, target):
    """The map of a plain resize from one (width, height) to another; edges of pictures coincide."""
    x, y = (((np.arange(new) + 0.5) * old / new - 0.5) for old, new in zip(source, target))
    return tuple(m.astype(np.float32) for m in np.meshgrid(x, y))


def cropped(source, target, weight):
    """The window of the target's shape that holds most weight, scaled to the target."""
    share = min(source[0] / target[0], source[1] / target[1])
    window = [min(s, round(t * share)) for s, t in zip(source, target)]
    total = np.pad(weight, ((1, 0), (1, 0))).cumsum(0).cumsum(1)
    w, h = window
    held = total[h:, w:] - total[:-h, w:] - total[h:, :-w] + total[:-h, :-w]
    top, left = np.unravel_index(held.argmax(), held.shape)
    x, y = scaled(window, target)
    return x + np.float32(left), y + np.float32(top)


def seam_carved(picture, width, mode):
    """The map of the `seam-carving` package for a smaller width, from the seams that it removes; None if not installed."""
    try:
        from seam_carving import carve
    except ImportError:
        return None
    gray = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY).astype(np.float32)
    removed = carve._get_seams(gray, gray.shape[1] - width, mode, None)
    x = np.stack([np.flatnonzero(~row) for row in removed]).astype(np.float32)
    return x, np.repeat(np.arange(len(x), dtype=np.float32)[:, None], width, 1)


def saliency(picture):
    """Spectral residual (Hou and Zhang 2007) at 64 x 64, brought to the size of the picture; its largest value is 1."""
    small = cv2.resize(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY).astype(np.float32), (64, 64),
                       interpolation=cv2.INTER_AREA)
    spectrum = np.fft.fft2(small)
    log = np.log(np.abs(spectrum) + 1e-9).astype(np.float32)
    residual = log - cv2.blur(log, (3, 3))
    energy = np.abs(np.fft.ifft2(np.exp(residual + 1j * np.angle(spectrum)))) ** 2
    energy = cv2.resize(cv2.GaussianBlur(energy.astype(np.float32), (0, 0), 2.5), picture.shape[1::-1])
    return np.maximum(energy, 0) / max(float(energy.max()), 1e-12)


def segments(picture, count=25):
    """The longest segments that OpenCV's LSD finds, as a bare list of lines, pixel centers at integers."""
    found = cv2.createLineSegmentDetector().detect(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY))[0]
    ends = found.reshape(-1, 2, 2)
    longest = np.argsort(-np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), kind="stable")[:count]
    limit = np.array(picture.shape[1::-1]) - 1
    return [{"id": f"s{i}", "points": np.clip(ends[j], 0, limit).tolist(), "orientation": None}
            for i, j in enumerate(longest)]


def marked_lines(path):
    """The lines of a file, bare list or plumbline's own, with pixel centers at integers."""
    content = json.loads(Path(path).read_text())
    if isinstance(content, list):
        return content
    shift = content.get("pixel_center", content.get("pixel_centre", 0.5))
    return [{"id": line["name"], "points": [[x - shift, y - shift] for x, y in line["points"]],
             "orientation": {"horizontal": "h", "vertical": "v"}.get(line.get("orientation"))}
            for line in content["lines"] if not line.get("off")]


def pinhole(size, fov_deg):
    """The camera of a rectilinear picture with this diagonal field of view."""
    f = np.hypot(*size) / 2 / np.tan(np.radians(fov_deg) / 2)
    return {"model": "pinhole", "fx": f, "fy": f, "cx": size[0] / 2 - 0.5, "cy": size[1] / 2 - 0.5}


def projected(camera, rays):
    """Pixels of rays, for the two models of the bench: `pinhole` and `kb`."""
    off = np.hypot(rays[:, 0], rays[:, 1])
    theta, turn = np.arctan2(off, rays[:, 2]), np.arctan2(rays[:, 1], rays[:, 0])
    k = [1.0, *camera.get("k", [])]
    radius = np.tan(theta) if camera["model"] == "pinhole" else sum(c * theta ** (2 * i + 1) for i, c in enumerate(k))
    return np.stack([camera["cx"] + camera["fx"] * radius * np.cos(turn),
                     camera["cy"] + camera["fy"] * radius * np.sin(turn)], 1)


def beyond_ends(metrics, warp, lines, camera, share=0.1):
    """How far scene lines leave their fitted straight line beyond the marked ends, over `share` of their length: the worst."""
    worst = 0.0
    for line in lines:
        points = np.asarray(line["points"], float)
        shown = warp.forward(points)
        if not np.isfinite(shown).all():
            continue
        rays = metrics.pixel_to_ray(camera, points[:, 0], points[:, 1])
        normal = np.linalg.svd(rays)[2][2] if len(rays) > 2 else np.cross(rays[0], rays[-1])
        normal /= np.linalg.norm(normal)
        east = rays[0] - normal * (normal @ rays[0])
        east /= np.linalg.norm(east)
        north = np.cross(normal, east)
        angles = np.arctan2(rays @ north, rays @ east)
        low, high = angles.min(), angles.max()
        reach = share * (high - low) * np.linspace(0.1, 1, 10)
        angles = np.concatenate([low - reach, high + reach])[:, None]
        beyond = warp.forward(projected(camera, np.cos(angles) * east + np.sin(angles) * north))
        center, along, _, _ = metrics.fit_line(shown)
        off = np.abs((beyond - center) @ [-along[1], along[0]])
        worst = max(worst, float(np.nanmax(off, initial=0.0)))
    return worst


def border_lines(metrics, lines, camera):
    """The outer edges of a board's border squares, whose corners nobody marks: the plane through its rows and columns, one
    square on at each side."""
    corners = {(r, c): p for r, row in enumerate(l for l in lines if l["id"].startswith("row"))
               for c, p in enumerate(row["points"])}
    index = np.array(list(corners), float)
    pixels = np.array(list(corners.values()), float)
    rays = metrics.pixel_to_ray(camera, pixels[:, 0], pixels[:, 1])
    plane = cv2.findHomography(index[:, ::-1], rays[:, :2] / rays[:, 2:])[0]
    rows, columns = index.max(0).astype(int)
    sides = {"above": [(x, -1) for x in range(-1, columns + 2)], "below": [(x, rows + 1) for x in range(-1, columns + 2)],
             "before": [(-1, y) for y in range(-1, rows + 2)], "behind": [(columns + 1, y) for y in range(-1, rows + 2)]}
    on = lambda side: projected(camera, np.column_stack([np.array(side, float), np.ones(len(side))]) @ plane.T)
    return [{"id": name, "points": on(side).tolist(), "orientation": None} for name, side in sides.items()]


def sheet(pictures, height=420, per_row=4):
    """Pictures with their labels at one height, in rows."""
    panes = []
    for label, picture in pictures:
        width = max(1, round(picture.shape[1] * height / picture.shape[0]))
        pane = cv2.copyMakeBorder(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), 26, 0, 0, 6,
                                  cv2.BORDER_CONSTANT)
        cv2.putText(pane, label, (4, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (255, 255, 255), 1, cv2.LINE_AA)
        panes.append(pane)
    rows = [np.hstack(panes[i:i + per_row]) for i in range(0, len(panes), per_row)]
    width = max(row.shape[1] for row in rows)
    return np.vstack([np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0))) for row in rows])
