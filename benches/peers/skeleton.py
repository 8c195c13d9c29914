#!/usr/bin/env python3
"""Curve skeletons beside CGAL's mean-curvature flow: quality by one judge, CPU seconds of one process each.

Ends are compared with those counted on pictures (skeleton_ends.json beside this file): the number that must be found, and how many more may.

    skeleton.py --plumbline target/release/plumbline --judge ./skeleton --media DIR [--rounds 3] [MESH...]

`skeleton` is built from skeleton.cpp beside this file, which holds CGAL's extraction and the judge. Ours is timed as the whole command
(reading, extraction, joints, writing) without the start of the program, which loads the libraries of FFmpeg; CGAL's as the extraction
alone. Minima of all rounds count. Without names all closed meshes are run. Where the vertices have a mirror plane, the ends on either side
and near it are counted.
"""
import argparse
import collections
import json
import os
import pathlib
import resource
import subprocess
import tempfile

import numpy as np
from scipy.spatial import cKDTree

# What is measured is computed.
os.environ["PLUMBLINE_CACHE"] = ""

os.environ["RAYON_NUM_THREADS"] = "1"
FOLDERS = ["common", "igl", "hard", "arapbench", "rig"]


def counted_ends(name):
    """How many ends the eye counts: those that must be found, and those that may be."""
    known = json.loads((pathlib.Path(__file__).parent / "skeleton_ends.json").read_text()).get(name)
    if known is None:
        return None
    number = lambda words: sum(int(w.split()[0]) if w.split()[0].isdigit() else 1 for w in words)
    return number(known["ends"]), number(known["may"])


def vertices_and_faces(path):
    """Positions and triangles of an OBJ, OFF or MEDIT file, unnamed vertices dropped."""
    lines = [line.split() for line in path.read_text().splitlines() if line.strip() and line[0] != "#"]
    if path.suffix == ".obj":
        V = [w[1:4] for w in lines if w[0] == "v"]
        F = [[int(c.split("/")[0]) - 1 for c in w[1:4]] for w in lines if w[0] == "f"]
    elif path.suffix == ".off":
        n, m = int(lines[1][0]), int(lines[1][1])
        V, F = [w[:3] for w in lines[2:2 + n]], [[int(c) for c in w[1:4]] for w in lines[2 + n:2 + n + m]]
    else:
        words = [w for line in lines for w in line]
        at = words.index("Vertices")
        V = [words[at + 2 + 4 * i:at + 5 + 4 * i] for i in range(int(words[at + 1]))]
        at = words.index("Triangles")
        F = [[int(c) - 1 for c in words[at + 2 + 4 * i:at + 5 + 4 * i]] for i in range(int(words[at + 1]))]
    used = sorted({v for t in F for v in t})
    number = {v: i for i, v in enumerate(used)}
    return [V[v] for v in used], [[number[v] for v in t] for t in F]


def write_off(path, V, F):
    rows = [f"OFF\n{len(V)} {len(F)} 0"] + [" ".join(p) for p in V] + ["3 " + " ".join(map(str, t)) for t in F]
    path.write_text("\n".join(rows) + "\n")


def run(*command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=600)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def is_closed(F):
    """Whether every edge has as many triangles one way as the other."""
    ways = collections.Counter((t[k], t[(k + 1) % 3]) for t in F for k in range(3))
    return all(ways[b, a] == n for (a, b), n in ways.items())


def genus(V, F):
    """Sum of the genera of all components of a closed manifold."""
    edges = len({(min(t[k], t[k - 1]), max(t[k], t[k - 1])) for t in F for k in range(3)})
    parent = list(range(len(V)))

    def root(v):
        while parent[v] != v:
            parent[v] = v = parent[parent[v]]
        return v
    for a, b, c in F:
        parent[root(a)] = parent[root(b)] = root(c)
    return sum(v == parent[v] for v in range(len(V))) - (len(V) - edges + len(F)) // 2


def mirror_plane(V):
    """Axis of the coordinates and offset of a plane that maps the vertices to themselves within .4 % of the diagonal, or None."""
    points = np.array(V, float)
    low, high = points.min(0), points.max(0)
    tree, middle = cKDTree(points), 0.5 * (low + high)
    some = points[::max(1, len(points) // 3000)]
    def off(axis):
        copy = some.copy()
        copy[:, axis] = 2 * middle[axis] - copy[:, axis]
        return tree.query(copy)[0].mean() / np.linalg.norm(high - low)
    best = min(range(3), key=off)
    return (best, middle[best], 0.02 * np.linalg.norm(high - low)) if off(best) < 0.004 else None


def ends_per_side(curve, plane):
    """Number of ends on either side of a plane, and near it."""
    nodes, edges = curve
    degree = collections.Counter(v for e in edges for v in e)
    off = [nodes[v][plane[0]] - plane[1] for v, d in degree.items() if d == 1]
    return f"{sum(x < -plane[2] for x in off)}|{sum(abs(x) <= plane[2] for x in off)}|{sum(x > plane[2] for x in off)}"


def read_curve(path):
    rows = [line.split() for line in path.read_text().splitlines()]
    return [[float(x) for x in r[1:]] for r in rows if r[0] == "v"], [[int(x) for x in r[1:]] for r in rows if r[0] == "e"]


def ours(a, mesh, start, folder):
    """Our curve of a mesh in the judge's format, and the least CPU seconds without the start of the program; None where it fails."""
    curve, best = folder / "curve.json", float("inf")
    for _ in range(a.rounds):
        done, cpu = run(a.plumbline, "skeleton", mesh, "-o", curve, "--overwrite", "--threads", "1")
        if done.returncode:
            return None, done.stderr.strip().splitlines()[-1:]
        best = min(best, cpu - start)
    found = json.loads(curve.read_text())["curve"]
    rows = ["v {} {} {}".format(*p) for p in found["nodes"]] + ["e {} {}".format(*e) for e in found["edges"]]
    (folder / "ours.txt").write_text("\n".join(rows) + "\n")
    return folder / "ours.txt", best


def theirs(a, mesh, name, folder):
    """CGAL's curve and CPU seconds; None where it refuses. With `--kept` as kept there from an earlier run."""
    at = a.kept / (name.replace("/", "_") + ".txt") if a.kept else folder / "theirs.txt"
    seconds = at.with_suffix(".json")
    if not (a.kept and seconds.exists()):
        at.write_text("")
        found = [run(a.judge, "cgal", mesh, at)[0].stdout for _ in range(1 if a.kept else a.rounds)]
        cpu = [json.loads(f).get("cpu", 1e9) if f else 1e9 for f in found]
        seconds.write_text(json.dumps({"cpu": min(cpu)}))
    cpu = json.loads(seconds.read_text())["cpu"]
    return (at, cpu) if at.read_text() and cpu < 1e9 else (None, cpu)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--plumbline", required=True, type=pathlib.Path)
    p.add_argument("--judge", required=True, type=pathlib.Path)
    p.add_argument("--media", required=True, type=pathlib.Path)
    p.add_argument("--rounds", type=int, default=3)
    p.add_argument("--kept", type=pathlib.Path, help="folder that keeps CGAL's curves between runs")
    p.add_argument("--curves", type=pathlib.Path, help="folder for our curves")
    p.add_argument("meshes", nargs="*")
    a = p.parse_args()
    # Loading the libraries of a program that does more than skeletons is no part of extraction; CGAL's figure is extraction alone.
    start = min(run(a.plumbline, "--version")[1] for _ in range(a.rounds))
    print(f"the program starts in {start:.3f} s of CPU, which is left out")
    print("ours/CGAL          cpu s        ratio  turning      ratio  inside       central mean, tenth    visible    ends  counted  "
          "left|middle|right  loops genus  far")
    names = a.meshes or sorted(str(f.relative_to(a.media)) for d in FOLDERS for f in (a.media / d).iterdir()
                               if f.suffix in (".obj", ".off", ".mesh"))
    logs = collections.defaultdict(list)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        mesh = folder / "mesh.off"
        for name in names:
            V, F = vertices_and_faces(a.media / name)
            if not a.meshes and not is_closed(F):
                continue
            write_off(mesh, V, F)
            (u_file, u_cpu), (c_file, c_cpu) = ours(a, mesh, start, folder), theirs(a, mesh, name, folder)
            if u_file is None:
                print(f"{pathlib.Path(name).stem:18} fails: {u_cpu}", flush=True)
                continue
            if a.curves:
                (a.curves / (name.replace("/", "_") + ".txt")).write_text(u_file.read_text())
            judged = lambda f, *other: json.loads(run(a.judge, "judge", mesh, f, *other)[0].stdout)
            u = judged(u_file, *[c_file] if c_file else [])
            c = judged(c_file) if c_file else collections.defaultdict(lambda: float("nan"))
            pair = lambda key, form: f"{u[key]:{form}}/{c[key]:{form}}"
            counted, plane = counted_ends(name), mirror_plane(V)
            eye = "?" if counted is None else f"{counted[0]}+{counted[1]}" if counted[1] else f"{counted[0]}"
            sides = "-" if plane is None else "/".join(ends_per_side(read_curve(f), plane) for f in (u_file, c_file) if f)
            if c_file:
                for key, over in [("turning", u["turning"] / max(c["turning"], 0.1)), ("cpu", u_cpu / c_cpu)]:
                    logs[key].append(over)
                for key in ["inside", "central", "p10", "visible"]:
                    logs[key].append(u[key] - c[key])
            print(f"{pathlib.Path(name).stem:18} {u_cpu:5.2f}/{c_cpu:5.2f}  {u_cpu / c_cpu:5.2f}  {pair('turning', '5.1f')}  "
                  f"{u['turning'] / max(c['turning'], 0.1):5.2f}  {pair('inside', '.3f')}  {pair('central', '.3f')} {pair('p10', '.2f')}  "
                  f"{pair('visible', '.4f')}  {pair('ends', '2.0f')}  {eye:>6}  {sides:>14}  {pair('loops', '.0f')} {genus(V, F)}  {u['far']:.3f}", flush=True)
    for key, all_of in logs.items():
        bad = sum(x > 1 for x in all_of) if key in ("turning", "cpu") else sum(x < -5e-5 for x in all_of)
        print(f"{key:8} mean {np.mean(all_of):+.4f}  worst {max(all_of) if key in ('turning', 'cpu') else min(all_of):+.4f}  "
              f"behind CGAL on {bad} of {len(all_of)}")


if __name__ == "__main__":
    main()
