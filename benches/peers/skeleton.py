#!/usr/bin/env python3
"""Curve skeletons beside CGAL's mean-curvature flow: quality by one judge, CPU seconds of one process each.

Ends are compared with those counted on pictures (skeleton_ends.json beside this file): the number that must be found, and how many more may.

    skeleton.py --plumbline target/release/plumbline --judge ./skeleton --media DIR [--rounds 3] [MESH...]

`skeleton` is built from skeleton.cpp beside this file, which holds CGAL's extraction and the judge. Ours is timed as the whole command
(reading, extraction, joints, writing), once with and once without the start of the program, which loads the libraries of FFmpeg; CGAL's
as the extraction alone. Each round runs both in turn, minima count.
"""
import argparse
import json
import os
import pathlib
import resource
import subprocess
import tempfile

os.environ["RAYON_NUM_THREADS"] = "1"
MESHES = ["igl/hand.mesh", "rig/armadillo_LR3.off", "igl/elephant.obj", "igl/3holes.off", "rig/male_LR20.off", "igl/arm.obj",
          "arapbench/cactus_jacobson.obj", "common/spot.obj", "igl/cow.off", "igl/armadillo.obj", "common/horse.off"]


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


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--plumbline", required=True, type=pathlib.Path)
    p.add_argument("--judge", required=True, type=pathlib.Path)
    p.add_argument("--media", required=True, type=pathlib.Path)
    p.add_argument("--rounds", type=int, default=3)
    p.add_argument("meshes", nargs="*")
    a = p.parse_args()
    # Loading the libraries of a program that does more than skeletons is no part of extraction; CGAL's figure is extraction alone.
    start = min(run(a.plumbline, "--version")[1] for _ in range(a.rounds))
    print(f"the program starts in {start:.3f} s of CPU; ratios with and without")
    print("mesh, ours / CGAL      cpu s        ratio        ends   (counted)  loops  inside        centredness   visible")
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        mesh, ours, theirs, curve = (folder / n for n in ["mesh.off", "ours.txt", "theirs.txt", "curve.json"])
        for name in a.meshes or MESHES:
            write_off(mesh, *vertices_and_faces(a.media / name))
            seconds = [[], []]
            for _ in range(a.rounds):
                done, cpu = run(a.plumbline, "skeleton", mesh, "-o", curve, "--overwrite", "--threads", "1")
                if done.returncode:
                    raise SystemExit(done.stderr)
                seconds[0].append(cpu)
                seconds[1].append(json.loads(run(a.judge, "cgal", mesh, theirs)[0].stdout).get("cpu", float("nan")))
            found = json.loads(curve.read_text())["curve"]
            rows = ["v {} {} {}".format(*p) for p in found["nodes"]] + ["e {} {}".format(*e) for e in found["edges"]]
            ours.write_text("\n".join(rows) + "\n")
            u, c = (json.loads(run(a.judge, "judge", mesh, f)[0].stdout) for f in (ours, theirs))
            su, sc = map(min, seconds)
            pair = lambda key, form: f"{u[key]:{form}}/{c[key]:{form}}"
            counted = counted_ends(name)
            eye = "?" if counted is None else f"{counted[0]}+{counted[1]}" if counted[1] else f"{counted[0]}"
            print(f"{pathlib.Path(name).stem:18} {su:6.2f}/{sc:6.2f}  {su / sc:5.2f} {(su - start) / sc:5.2f}  {pair('ends', '2d')}  {eye:>6}  {pair('loops', 'd')}  "
                  f"{pair('inside', '.3f')}  {pair('central', '.3f')}  {pair('visible', '.4f')}", flush=True)


if __name__ == "__main__":
    main()
