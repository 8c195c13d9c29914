#!/usr/bin/env python3
"""Morphs of ten pairs of unlike closed models by 5 to 12 landmarks (morph_pairs.json beside this file), and poses of one polygon mesh.

    morph_pairs.py --plumbline target/release/plumbline --media DIR [--work DIR] [--pictures] [NAME ...] [-- OPTION ...]

NAME is a part of the names of a pair; options after `--` go to `plumbline morph`. Each pair is morphed in five shapes. Printed are

    method    the correspondence that was taken
    folds     largest fraction of triangles at times .25, .5 and .75 whose normal opposes the mean normal of the triangles around
              them, which it does not in the first mesh; `end` is the same at time 1
    facing    fraction of triangles at time 1 that oppose the surface of the second mesh below them, or collapse, as reported
    outside   largest distance of a shape outside the bounding box of both meshes, over its diagonal; the bar is .2
    stretch   L2 stretch of the map
    marks     largest distance of a landmark from its target, in diagonals of the second mesh
    missed    largest distance of a vertex of the second mesh from the mapped one, in its diagonals

and the costs of the command. A pair passes that is morphed with folds of at most .1 % inside the grown box, or refused by a named check.
With `--pictures`, WORK/PAIR.png shows the five shapes. `--poses` morphs every two poses of the cats instead: same faces, no landmarks.
"""
import argparse
import itertools
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

from peers import Failed, run

# The bars.
MAX_FOLDS, MAX_OUTSIDE = 1e-3, 0.2


def surface(path):
    """Positions and triangles of an OFF or OBJ file of triangles, as `plumbline morph` writes them."""
    words = [line.split() for line in path.read_text().splitlines() if line.strip() and line[0] != "#"]
    if path.suffix == ".off":
        n, m = int(words[1][0]), int(words[1][1])
        vertices, faces = words[2:2 + n], [w[1:4] for w in words[2 + n:2 + n + m]]
    else:
        vertices = [w[1:4] for w in words if w[0] == "v"]
        faces = [[int(c.split("/")[0]) - 1 for c in w[1:4]] for w in words if w[0] == "f"]
    return np.array([w[:3] for w in vertices], float), np.array(faces, int)


def folded(V, F):
    """Triangles whose normal opposes the area-weighted mean normal of the other triangles at their corners."""
    normal = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    of_vertex = np.zeros_like(V)
    for k in range(3):
        np.add.at(of_vertex, F[:, k], normal)
    around = of_vertex[F].sum(axis=1) - 3 * normal
    return np.einsum("ij,ij->i", normal, around) < 0


def outside(shape, ends):
    """Distance outside the bounding box of both ends, over its diagonal."""
    low, high = np.min([e.min(axis=0) for e in ends], axis=0), np.max([e.max(axis=0) for e in ends], axis=0)
    return max((low - shape).max(), (shape - high).max(), 0.0) / np.linalg.norm(high - low)


def morphed(program, media, pair, models, folder, options):
    """The row of a pair."""
    folder.mkdir(parents=True, exist_ok=True)
    marks = [[models[pair[end]][f] for end in ("first", "second")] for f in pair["features"]]
    document = {"format": "plumbline.landmarks", "version": 1, "pairs": marks}
    (folder / "landmarks.json").write_text(json.dumps(document))
    for old in folder.glob("morph_*"):
        old.unlink()
    report = folder / "report.json"
    command = [program, "morph", media / pair["first"], media / pair["second"], "--landmarks", folder / "landmarks.json",
               "--frames", 5, "--report", report, "-o", f"{folder}/", "--overwrite", *options]
    costs = run(command)
    shapes = [surface(p) for p in sorted(folder.glob("morph_*"))]
    known = folded(*shapes[0])
    bad = [float((folded(*s) & ~known).mean()) for s in shapes]
    ends = shapes[0][0], surface(media / pair["second"])[0]
    row = json.loads(report.read_text())["correspondence"]
    return row | costs | {
        "method": row.get("method", "-"), "folds": max(bad[1:4]), "end": bad[4],
        "facing": (row["flipped"] + row["collapsed"]) / len(shapes[0][1]),
        "outside": max(outside(s[0], ends) for s in shapes)}


def pictures(program, folder, target):
    """The five shapes side by side."""
    from PIL import Image
    shapes = sorted(folder.glob("morph_*.o*"))
    command = [program, "render", *shapes, "--out-dir", folder / "png", "--size", "420x420", "--view", "30,15", "--overwrite",
               "--mark-back", *(["--up", "z"] if folder.name.startswith("male") else [])]
    subprocess.run([str(c) for c in command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    drawn = [Image.open(p).convert("RGB") for p in sorted((folder / "png").glob("*.png"))]
    sheet = Image.new("RGB", (sum(d.width for d in drawn), drawn[0].height))
    for k, d in enumerate(drawn):
        sheet.paste(d, (k * d.width, 0))
    sheet.save(target)


def name_of(pair):
    stem = lambda f: pathlib.Path(f).stem.split("_")[0].removeprefix("decimated-")
    return f"{stem(pair['first'])}-{stem(pair['second'])}"


def pairs(args, work, options):
    known = json.loads((pathlib.Path(__file__).parent / "morph_pairs.json").read_text())
    good = total = 0
    print(f"{'pair':22} {'marks':>5} {'method':13} {'folds%':>7} {'end%':>6} {'facing%':>7} {'outside':>7} {'stretch':>7} {'marks%':>6} "
          f"{'missed%':>7} {'wall s':>6} {'CPU s':>6} {'MB':>5}")
    for pair in known["pairs"]:
        name = name_of(pair)
        if args.names and not any(n in name for n in args.names):
            continue
        total += 1
        try:
            row = morphed(args.plumbline, args.media, pair, known["models"], work / name, options)
        except Failed as error:
            says = next((line for line in str(error).splitlines() if line.startswith("error")), str(error))
            print(f"{name:22} {len(pair['features']):5} {says}", flush=True)
            continue
        passes = row["folds"] <= MAX_FOLDS and row["outside"] <= MAX_OUTSIDE
        good += passes
        print(f"{name:22} {len(pair['features']):5} {row['method']:13} {100 * row['folds']:7.3f} {100 * row['end']:6.2f} "
              f"{100 * row['facing']:7.2f} {row['outside']:7.3f} {row['stretch']:7.2f} {100 * row['landmark_error']:6.2f} "
              f"{100 * row['missed_worst']:7.2f} {row['wall_s']:6.1f} {row['cpu_s']:6.1f} {row['peak_mb']:5.0f}{'' if passes else '  misses'}",
              flush=True)
        if args.pictures:
            pictures(args.plumbline, work / name, work / f"{name}.png")
    print(f"{good} of {total} pairs morph")


def poses(args, work):
    files = sorted((args.media / "seq" / "catlow").glob("cat_0*.obj"))
    good = total = 0
    for a, b in itertools.combinations(files, 2):
        total += 1
        try:
            run([args.plumbline, "morph", a, b, "--frames", 3, "-o", f"{work}/poses/", "--overwrite"])
            good += 1
        except Failed as error:
            print(a.stem, b.stem, str(error).splitlines()[1])
    print(f"{good} of {total} pairs of poses morph")


def main():
    given = sys.argv[1:]
    at = given.index("--") if "--" in given else len(given)
    given, options = given[:at], given[at + 1:]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plumbline", type=pathlib.Path, required=True)
    parser.add_argument("--media", type=pathlib.Path, required=True)
    parser.add_argument("--work", type=pathlib.Path)
    parser.add_argument("--pictures", action="store_true")
    parser.add_argument("--poses", action="store_true")
    parser.add_argument("names", nargs="*")
    args = parser.parse_args(given)
    with tempfile.TemporaryDirectory() as temporary:
        work = args.work or pathlib.Path(temporary)
        if args.poses:
            poses(args, work)
        else:
            pairs(args, work, options)


if __name__ == "__main__":
    main()
