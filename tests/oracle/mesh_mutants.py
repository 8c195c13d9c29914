#!/usr/bin/env python3
"""Oracle: mesh readers against trimesh on mutants. Exits 1 where both accept a file and understand different meshes.

Small meshes in OBJ, PLY, STL, OFF and glTF are changed in one to three places, at random but from a fixed seed. Files that one of
both refuses are counted and not compared: refusing is never wrong here. Where both accept, the number of triangles and the positions
of their corners agree.

Differences that are accepted, each with its reason:

- trimesh keeps what it cannot mean: NaN, indices out of range (it fails later, or wraps negative ones), unknown components. We refuse.
- trimesh drops triangles with a repeated corner in some formats. We keep them; they are left out on both sides before comparing.
- trimesh reads numbers as 32-bit where the format says double, and the other way round: positions agree to 1e-4 of the extent.
- An element of a text PLY over two lines: the numbers are a sequence separated by white space, and we read all of them, as rply and
  tinyply do. trimesh reads a line per element: the face that goes on in the next line and as many lines of the last faces are lost
  without a word (144 triangles are 142).
- Files in which trimesh finds no triangle at all are not compared: it takes what is left for a cloud of points, or for a path.
- Header lines that trimesh skips by pattern (comments with keywords, repeated elements of PLY, `facet` words in STL as text): listed in
  `tolerated`, by a property of the mutant.
"""
import io
import json
import os
import pathlib
import random
import subprocess
import sys
import tempfile

SKIPPED = 77
MUTANTS = int(os.environ.get("PLUMBLINE_CASES", "60"))
WORDS = [b"0", b"-1", b"1e9", b"2", b"nan", b"3", b"\n", b" ", b"#", b"f 1 2 3\n", b"v 0 0 2\n", b"1.5", b"/", b"4 0 1 2 3\n"]


def mutated(example, rng):
    data = bytearray(example)
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(data) + 1)
        end = min(len(data), at + rng.randint(1, 12))
        kind = rng.randrange(6)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1 and at < len(data) and chr(data[at]).isdigit():
            data[at] = ord(rng.choice("0123456789"))
        elif kind == 2:
            del data[at:end]
        elif kind == 3:
            data[at:at] = data[at:end]
        elif kind == 4:
            data[at:at] = rng.choice(WORDS)
        else:
            lines = bytes(data).split(b"\n")
            i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
            lines[i], lines[j] = lines[j], lines[i]
            data = bytearray(b"\n".join(lines))
    return bytes(data)


def convert(program, folder, out, extension, inputs):
    """Converts all files in one run; returns what was reported of each."""
    pathlib.Path(out).mkdir(exist_ok=True)
    command = [program, "mesh", "convert", "--json", *inputs, "--out-dir", out, "--format", extension]
    ran = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    if ran.returncode not in (0, 3, 65):
        sys.exit(f"{command[:3]}: {ran.returncode}: {ran.stderr[-2000:]}")
    return {pathlib.Path(item["file"]).name: item for item in json.loads(ran.stdout)}


def read_ours(path):
    """Positions and triangles of a text PLY that we wrote."""
    import numpy as np
    lines = path.read_text().split("\n")
    end = lines.index("end_header")
    counts = {w[1]: int(w[2]) for w in (l.split() for l in lines[:end]) if w[:1] == ["element"]}
    rows = lines[end + 1:]
    positions = np.array([[float(x) for x in r.split()[:3]] for r in rows[:counts["vertex"]]]).reshape(-1, 3)
    triangles = []
    for row in rows[counts["vertex"]:counts["vertex"] + counts.get("face", 0)]:
        n, *corners = (int(x) for x in row.split()[:1 + int(row.split()[0])])
        triangles += [(corners[0], corners[k], corners[k + 1]) for k in range(1, n - 1)]
    return positions, np.array(triangles, dtype=int).reshape(-1, 3)


def read_theirs(data, extension):
    import numpy as np
    import trimesh
    loaded = trimesh.load(io.BytesIO(data), file_type=extension, process=False, maintain_order=True)
    if isinstance(loaded, trimesh.Scene):
        loaded = loaded.to_geometry()
    if not isinstance(loaded, trimesh.Trimesh):
        return None
    positions, triangles = np.asarray(loaded.vertices, dtype=float), np.asarray(loaded.faces, dtype=int)
    if not len(triangles) or triangles.min() < 0 or triangles.max() >= len(positions):
        return None
    return (positions, triangles) if np.isfinite(positions).all() else None


def corners(positions, triangles):
    """Positions of the corners of all triangles whose corners differ, as sets to compare; and their number."""
    import numpy as np
    p = positions[triangles]
    same = lambda i, j: (p[:, i] == p[:, j]).all(axis=1)
    kept = p[~(same(0, 1) | same(1, 2) | same(2, 0))]
    return kept, len(kept)


def differ(ours, theirs):
    import numpy as np
    (a, n), (b, m) = corners(*ours), corners(*theirs)
    if n != m:
        return f"{n} triangles, and {m} of trimesh"
    if n == 0:
        return None
    scale = max(np.abs(a).max(), np.abs(b).max(), 1e-30)
    for name, x, y in (("corner", a.reshape(-1, 3), b.reshape(-1, 3)),):
        for mine, other, who in ((x, y, "ours"), (y, x, "theirs")):
            far = np.abs(mine[:, None] - other[None]).max(axis=2).min(axis=1) if len(mine) * len(other) < 4e6 else [0]
            if np.max(far) > 1e-4 * scale:
                return f"a {name} of {who} at {mine[int(np.argmax(far))]} is not among the others"
    return None


def tolerated(data, extension, reason):
    """Why a difference in a mutant is accepted; None if it is not."""
    if extension == "obj":
        for line in data.split(b"\n"):
            words = line.split()
            # An index relative to the end means the vertices before its line; trimesh counts from the end of the file.
            if words[:1] == [b"f"] and any(w.startswith(b"-") for w in words[1:]):
                return "relative indices of OBJ"
            if words[:1] in ([b"f"], [b"fo"]) and len(words) < 4:
                return "faces of OBJ with fewer than three corners"
            # trimesh splits lines at other characters than line feeds, and takes `v` and `f` only at the start of a line.
            if line[:1] in (b" ", b"\t", b"\r") or b"\x0b" in line or b"\x0c" in line or b"\\" in line or b"#" in line:
                return "white space, continued lines and comments of OBJ"
    if extension == "ply" and b"format ascii" in data and splits_elements(data):
        return "elements of PLY over several lines"
    return None


def splits_elements(data):
    """Whether a text PLY has another number of lines than of elements."""
    head, _, body = data.partition(b"end_header")
    counts = [int(w[2]) for w in (l.split() for l in head.split(b"\n")) if w[:1] == [b"element"] and w[2:3] and w[2].isdigit()]
    return sum(1 for line in body.split(b"\n") if line.strip()) != sum(counts)


def examples(program, folder):
    """Small meshes in every format."""
    root = pathlib.Path(__file__).resolve().parents[2] / "media"
    meshes = [root / name for name in ("mesh-polygons.obj", "mesh-moebius.off", "mesh-one-triangle.obj") if (root / name).exists()]
    found = {}
    for extension in ("obj", "ply", "stl", "off", "glb", "gltf"):
        out = pathlib.Path(folder, f"examples-{extension}")
        convert(program, folder, str(out), extension, [str(m) for m in meshes])
        found[extension] = [p.read_bytes() for p in sorted(out.iterdir())]
        if extension in ("ply", "stl"):
            text = pathlib.Path(folder, f"text-{extension}")
            text.mkdir()
            command = [program, "mesh", "convert", *map(str, meshes), "--out-dir", str(text), "--format", extension, "--ascii"]
            subprocess.run(command, cwd=folder, check=True, capture_output=True)
            found[extension] += [p.read_bytes() for p in sorted(text.iterdir())]
    return found


def main():
    try:
        import numpy  # noqa: F401
        import trimesh  # noqa: F401
    except ImportError as error:
        print(f"skipped: {error}")
        return SKIPPED
    program = str(pathlib.Path(os.environ.get("PLUMBLINE_BIN", "target/debug/plumbline")).resolve())
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        for extension, wholes in examples(program, folder).items():
            rng = random.Random(f"mutants of {extension}")
            mutants = {f"m{k:05}.{extension}": mutated(rng.choice(wholes), rng) for k in range(MUTANTS)}
            mutants |= {f"whole{k}.{extension}": whole for k, whole in enumerate(wholes)}
            place, out = pathlib.Path(folder, f"in-{extension}"), pathlib.Path(folder, f"out-{extension}")
            place.mkdir()
            out.mkdir()
            for name, data in mutants.items():
                (place / name).write_bytes(data)
            report = {}
            command = [program, "mesh", "convert", "--json", str(place), "--out-dir", str(out), "--format", "ply", "--ascii"]
            ran = subprocess.run(command, capture_output=True, text=True)
            report = {pathlib.Path(item["file"]).name: item for item in json.loads(ran.stdout)} if ran.stdout else {}
            counts = dict.fromkeys(("both", "ours only", "trimesh only", "none", "tolerated"), 0)
            for name, data in mutants.items():
                accepted = "error" not in report.get(name, {"error": ""})
                try:
                    theirs = read_theirs(data, extension)
                except Exception:
                    theirs = None
                if not accepted or theirs is None:
                    counts["ours only" if accepted else "trimesh only" if theirs is not None else "none"] += 1
                    continue
                reason = differ(read_ours(out / name.replace(f".{extension}", ".ply")), theirs)
                if reason is None:
                    counts["both"] += 1
                elif tolerated(data, extension, reason):
                    counts["tolerated"] += 1
                else:
                    faults += 1
                    print(f"    {name}: {reason}")
                    if keep := os.environ.get("PLUMBLINE_KEEP"):
                        pathlib.Path(keep).mkdir(exist_ok=True)
                        pathlib.Path(keep, name).write_bytes(data)
            print(f"{extension}: " + ", ".join(f"{n} {what}" for what, n in counts.items()))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
