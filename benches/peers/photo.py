#!/usr/bin/env python3
"""Photos: `plumbline rectify` and `plumbline retarget` beside OpenCV, fixed projections, plain scale and seam carving.

    photo.py --plumbline BIN --metrics DIR [--media DIR] [--marks DIR] [--out DIR] [PART...]

PART is among boards, partial, honest, unknown, portraits, retarget, shapes, speed; all of them if none is named.
--metrics is the folder of `warp_metrics.py`, which judges every map. --media (or PLUMBLINE_MEDIA) is the media folder,
whose `photo` holds `fisheye_calib`, `portrait` and `retarget`. --marks holds the lines of the portraits
(`NAME.lines.json`; by default those kept beside the tests). --out gets a contact sheet per photo, and `PART.json` with the figures.

boards     fisheye checkerboards, the lens known, lines marked; valid: share of the output that the source fills;
           source: share of the source that the output shows; qc: local stretch against the sphere, 95th percentile
           ends: how far the lines run off over a tenth of their length beyond their marked ends, px, the worst
           border: the worst of the outer edges of the border squares, alternating ones that nobody marks, px
partial    boards with marks two points short of both ends, with every fourth line marked, and with nothing given; all of their
           lines are measured
honest     boards under wrong lenses: what the summary reports against what all lines of the board say
unknown    the same with the lens unknown, and circular fisheyes
portraits  wide-angle portraits, lines and faces marked; worst stretch of a face against looking straight at it
retarget   to 60 % of the width, beside plain scale, crop, and the package `seam-carving` where it is installed
shapes     to other shapes, figures only
speed      12 megapixels, whole job with decode and encode, in turn with OpenCV's remap; minima over the rounds
"""

import argparse
import json
import os
import re
import sys
from pathlib import Path

import cv2
import numpy as np

import peers
import photo_maps
import photo_speed

PROJECTIONS = ("perspective", "stereographic", "panini", "mercator")
PICTURES = {".jpg", ".jpeg", ".png"}


def photos(folder, pattern="*"):
    """The photos of a folder; masks, which are painted for one of them, are none."""
    return [p for p in sorted(Path(folder).glob(pattern)) if p.suffix.lower() in PICTURES and "mask" not in p.stem]


def mapped(a, command, source, name, *options):
    """Runs plumbline on one photo; its map, mesh, report and costs, or None and the end of what it said."""
    prefix = a.out / "maps" / name
    prefix.parent.mkdir(parents=True, exist_ok=True)
    job = [a.plumbline, command, source, "-o", f"{prefix}.jpg", "--overwrite", "--progress", "none", "--export-map",
           prefix, "--report", f"{prefix}.json", *options]
    try:
        costs = peers.run(job)
    except peers.Failed as e:
        print(f"  {name}: {str(e).splitlines()[-1]}")
        return None
    x, y, mesh = (np.load(f"{prefix}_{part}.npy") for part in ("x", "y", "mesh"))
    return {"map": (x, y), "mesh": mesh, "report": json.loads(Path(f"{prefix}.json").read_text()), **costs}


def judged(a, result, size, lines=None, faces=None, camera=None, weight=None):
    """The figures of one map, a flat table."""
    wm, (x, y) = a.warp_metrics, result["map"]
    r = wm.evaluate(x, y, *size, lines, faces, camera, result.get("mesh"), weight is not None, weight)
    line, mesh, face = r.get("lines", {}).get("summary", {}), r.get("mesh", {}), r.get("boxes", {}).get("summary", {})
    grid = np.stack(np.meshgrid(*((np.arange(80) + 0.5) * n / 80 - 0.5 for n in size)), -1).reshape(-1, 2)
    warp, board = wm.Warp(x, y, *size), lines and camera and any(l["id"] == "row1" for l in lines)
    ends = photo_maps.beyond_ends(wm, warp, lines, camera) if lines and camera else None
    border = photo_maps.border_lines(wm, lines, camera) if board else None
    border = border and wm.evaluate(x, y, *size, border, None, camera)["lines"]["summary"]["max_px"]
    return {
        "worst px": line.get("max_px"), "ends": ends, "border": border, "max/len": line.get("max_rel_mean"), "lines shown": line.get("shown_mean"),
        "qc p95": (r["shape"]["qc_ratio"] or {}).get("p95"), "qc max": (r["shape"]["qc_ratio"] or {}).get("max"),
        "face": face.get("anisotropy_max"), "faces shown": f"{face['n_measured']}/{face['n']}" if face else None,
        "folds": r["folds"].get("folded_cells"), "mesh folds": mesh.get("not_convex"),
        "ARS": r.get("ars"), "boundary": r.get("boundary", {}).get("max_px"),
        "valid": r["shape"]["valid_fraction"],
        "source": float(np.isfinite(warp.forward(grid)[:, 0]).mean()),
        "out": "{}x{}".format(*r["output"]), "s": result.get("wall_s"), "cpu s": result.get("cpu_s"),
    }


def shown(value):
    if isinstance(value, float):
        return f"{value:.4f}" if abs(value) < 0.1 else f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}"
    return "-" if value is None else str(value)


def table(rows, columns):
    """Rows of (photo, method, figures) as a Markdown table."""
    print("| photo | method | " + " | ".join(columns) + " |")
    print("|" + "---|" * (len(columns) + 2))
    for photo, method, figures in rows:
        print(f"| {photo} | {method} | " + " | ".join(shown(figures.get(c)) for c in columns) + " |")


def summary(rows, columns):
    """A row per method: the mean over the photos, and the worst, of every figure."""
    made = []
    for method in dict.fromkeys(m for _, m, _ in rows):
        figures = [f for _, m, f in rows if m == method]
        for how, pick in (("mean", np.mean), ("least", min), ("largest", max)):
            values = {c: [f[c] for f in figures if isinstance(f.get(c), (int, float))] for c in columns}
            made.append((f"{how} of {len(figures)}", method, {c: float(pick(v)) for c, v in values.items() if v}))
    return made


def compared(a, source, camera, lines, faces, ours, rows, fixed=PROJECTIONS, others=()):
    """Measures and draws one photo: ours, our fixed projections, maps of others. `ours` are the command's options."""
    picture = cv2.imread(str(source))
    size = picture.shape[1::-1]
    pictures = [("source", picture)]
    found = [(name, {"map": m}) for name, m in others]
    found += [(f"--to {to}", mapped(a, "rectify", source, f"{source.stem}-{to}", *ours, "--to", to)) for to in fixed]
    found.append(("plumbline", mapped(a, "rectify", source, source.stem, *ours)))
    for method, result in found:
        if result is None:
            rows.append((source.stem, f"{method} (failed)", {}))
            continue
        rows.append((source.stem, method, judged(a, result, size, lines, faces, camera)))
        pictures.append((method, cv2.remap(picture, *result["map"], cv2.INTER_CUBIC)))
    cv2.imwrite(str(a.out / f"sheet-{source.stem}-{a.part}.png"), photo_maps.sheet(pictures))
    return found[-1][1]


def boards(a):
    folder, rows = a.media / "fisheye_calib", []
    camera = json.loads((folder / "gopro_kb.json").read_text())
    size = (camera["width"], camera["height"])
    others = [(f"OpenCV fisheye, balance {b}", photo_maps.fisheye_undistorted(camera, size, b)) for b in (0, 1)]
    for source in photos(folder, "gopro*"):
        marks = source.with_name(source.stem + "_lines.json")
        options = ["--lens", folder / "gopro_kb.json", "--lines", marks, "--faces", "off"]
        compared(a, source, camera, photo_maps.marked_lines(marks), None, options, rows, others=others)
    columns = ["worst px", "max/len", "ends", "border", "lines shown", "qc p95", "qc max", "folds", "mesh folds", "valid", "source", "out"]
    table([r for r in rows if r[1] == "plumbline"] + summary(rows, columns[:-1]), columns)
    return rows


def partial(a):
    folder, rows = a.media / "fisheye_calib", []
    shorter = {"cut short": lambda marks: [dict(m, points=m["points"][2:-2]) for m in marks if len(m["points"]) >= 7],
               "a quarter": lambda marks: marks[::4], "nothing": lambda marks: None}
    for source in photos(folder, "gopro*"):
        whole = source.with_name(source.stem + "_lines.json")
        size, lines = cv2.imread(str(source)).shape[1::-1], photo_maps.marked_lines(whole)
        for label, shorten in shorter.items():
            marks, options = shorten(json.loads(whole.read_text())), ["--faces", "off"]
            if marks is not None:
                path = a.out / "maps" / f"{source.stem}.{label.replace(' ', '-')}.json"
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(json.dumps(marks))
                options += ["--lines", path, "--lens", folder / "gopro_kb.json"]
            made = mapped(a, "rectify", source, f"{source.stem}-{label.replace(' ', '-')}", *options)
            figures = judged(a, made, size, lines, None, json.loads((folder / "gopro_kb.json").read_text())) if made else {}
            if made:
                figures["reported"] = made["report"]["worst_line_px"]
                figures["lens"] = made["report"]["lens"]["found"]
            rows.append((source.stem, label, figures))
    columns = ["worst px", "reported", "border", "max/len", "lines shown", "qc p95", "mesh folds", "source"]
    table(rows + summary(rows, columns), columns)
    return rows


def honest(a):
    folder, rows = a.media / "fisheye_calib", []
    for source in photos(folder, "gopro*"):
        whole = source.with_name(source.stem + "_lines.json")
        size, lines = cv2.imread(str(source)).shape[1::-1], photo_maps.marked_lines(whole)
        for lens, fov in (("equidistant", 150), ("equidistant", 100), ("rectilinear", 100), ("equisolid", 140)):
            options = ["--faces", "off", "--lens", lens, "--fov", fov]
            made = mapped(a, "rectify", source, f"{source.stem}-{lens}-{fov}", *options)
            figures = judged(a, made, size, lines) if made else {}
            if made:
                figures["reported"] = made["report"]["worst_line_px"]
                figures["ratio"] = figures["reported"] / figures["worst px"]
            rows.append((source.stem, f"{lens} {fov}", figures))
    columns = ["worst px", "reported", "ratio"]
    table(rows + summary(rows, columns), columns)
    return rows


def unknown(a):
    folder, rows = a.media / "fisheye_calib", []
    camera = json.loads((folder / "gopro_kb.json").read_text())
    for source in photos(folder, "gopro*") + photos(folder, "nebula*"):
        marks = source.with_name(source.stem + "_lines.json")
        known = camera if source.stem.startswith("gopro") else None
        lines = photo_maps.marked_lines(marks)
        best = compared(a, source, known, lines, None, ["--lens", "auto", "--lines", marks, "--faces", "off"], rows, ())
        if best:
            rows[-1][2]["lens"] = "{projection}, f {focal_px[0]:.1f}".format(**best["report"]["lens"])
            rows[-1][2]["off lens px"] = max(line["off_lens_px"] or 0.0 for line in best["report"]["lines"])
    table(rows, ["worst px", "max/len", "lines shown", "qc p95", "folds", "mesh folds", "valid", "source", "out",
                 "off lens px", "lens"])
    return rows


def portraits(a):
    rows = []
    for source in photos(a.media / "portrait", "yzhq*"):
        faces = source.with_name(source.stem + "_faces.json")
        marks = a.marks / f"{source.stem}.lines.json"
        fov = int(source.stem.rpartition("_")[2])
        size = cv2.imread(str(source)).shape[1::-1]
        # Of the group photos faces are not marked: they are found.
        options = ["--lens", "rectilinear", "--fov", fov, "--fov-axis", "d", "--faces", faces if faces.exists() else "auto",
                   "--lines", marks if marks.exists() else "off"]
        lines = photo_maps.marked_lines(marks) if marks.exists() else None
        marked = json.loads(faces.read_text()) if faces.exists() else None
        compared(a, source, photo_maps.pinhole(size, fov), lines, marked, options, rows, PROJECTIONS[:3])
    table(rows, ["worst px", "max/len", "ends", "lines shown", "face", "faces shown", "qc p95", "folds", "mesh folds", "valid",
                 "source", "out"])
    return rows


def retargeted(a, source, target, label, alone=False):
    """Rows of one photo brought to one size."""
    picture = cv2.imread(str(source))
    size, weight, lines = picture.shape[1::-1], photo_maps.saliency(picture), photo_maps.segments(picture)
    marks = a.out / "maps" / f"{source.stem}.segments.json"
    marks.parent.mkdir(parents=True, exist_ok=True)
    marks.write_text(json.dumps(lines))
    ours = mapped(a, "retarget", source, f"{source.stem}-{label}", "--size", "{}x{}".format(*target), "--lines", marks)
    found = [("scale", {"map": photo_maps.scaled(size, target)}), ("plumbline", ours)]
    if not alone:
        found.insert(1, ("crop", {"map": photo_maps.cropped(size, target, weight)}))
        carved = [(f"seam-carving {mode}", photo_maps.seam_carved(picture, target[0], mode))
                  for mode in ("backward", "forward")]
        found[2:2] = [(name, {"map": m}) for name, m in carved if m is not None]
    rows, pictures = [], [("source", picture)]
    for method, result in found:
        figures = judged(a, result, size, lines, weight=weight) if result else {}
        rows.append((source.stem, method if result else f"{method} (failed)", figures))
        if result:
            pictures.append((method, cv2.remap(picture, *result["map"], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)))
    cv2.imwrite(str(a.out / f"sheet-{source.stem}-{label}.png"), photo_maps.sheet(pictures))
    return rows


RETARGET_COLUMNS = ["ARS", "max/len", "worst px", "lines shown", "boundary", "folds", "mesh folds", "out", "s"]


def retarget(a):
    rows = []
    for source in photos(a.media / "retarget"):
        h, w = cv2.imread(str(source)).shape[:2]
        rows += retargeted(a, source, (round(w * 0.6), h), "60")
    if not any("seam" in method for _, method, _ in rows):
        print("seam-carving: not installed, left out")
    table([r for r in rows if "plumbline" in r[1]] + summary(rows, RETARGET_COLUMNS[:-2]), RETARGET_COLUMNS)
    return rows


def shapes(a):
    rows = []
    shaped = {"140 % width": lambda w, h: (round(1.4 * w), h), "60 % height": lambda w, h: (w, round(0.6 * h)),
              "9:16": lambda w, h: (round(h * 9 / 16), h), "25 % width": lambda w, h: (round(0.25 * w), h)}
    for label, shape in shaped.items():
        for source in photos(a.media / "retarget"):
            h, w = cv2.imread(str(source)).shape[:2]
            name = re.sub(r"\W+", "-", label)
            rows += [(p, f"{m}, {label}", f) for p, m, f in retargeted(a, source, shape(w, h), name, alone=True)]
    table(summary(rows, RETARGET_COLUMNS[:-2]), RETARGET_COLUMNS[:-2])
    return rows


def speed(a):
    source = a.media / "portrait" / "yzhq_5_103.jpg"
    rows = photo_speed.rounds(a, source, a.marks / f"{source.stem}.lines.json")
    table(rows, ["wall s", "cpu s", "peak MB"])
    return rows


PARTS = {f.__name__: f for f in (boards, partial, honest, unknown, portraits, retarget, shapes, speed)}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="*", choices=[[], *PARTS])
    parser.add_argument("--plumbline", type=Path, required=True)
    parser.add_argument("--metrics", type=Path, required=True)
    parser.add_argument("--media", type=Path, default=os.environ.get("PLUMBLINE_MEDIA"))
    parser.add_argument("--marks", type=Path, default=Path(__file__).parents[2] / "tests" / "data" / "photo")
    parser.add_argument("--out", type=Path, default=Path("target/photo"))
    parser.add_argument("--rounds", type=int, default=3)
    a = parser.parse_args()
    if a.media is None:
        parser.error("give --media, or set PLUMBLINE_MEDIA")
    a.media = a.media / "photo" if (a.media / "photo").is_dir() else a.media
    return a


def main():
    a = arguments()
    sys.path.insert(0, str(a.metrics))
    import warp_metrics
    a.warp_metrics = warp_metrics
    a.out.mkdir(parents=True, exist_ok=True)
    for a.part in a.part or PARTS:
        print(f"\n## {a.part}\n")
        (a.out / f"{a.part}.json").write_text(json.dumps(PARTS[a.part](a), indent=1))


if __name__ == "__main__":
    main()
