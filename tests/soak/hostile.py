#!/usr/bin/env python3
"""Hostile meshes: time and memory stay in proportion to the file, or the program refuses and says what to do.

    tests/soak/hostile.py PROGRAM [--triangles 40000] [--only NAME]

Prints a table and fails where a bound is broken: exit status 0 or 65, at most 60 s of CPU time per MB of input (of a MB, where
it has less), and of memory no more than a gigabyte. Standard library only.
"""
import argparse
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile

CPU_PER_MB = 60
MEMORY_MB = 1000
RNG = random.Random(19)


def soup(triangles):
    """Triangles between any of half as many points in a cube."""
    points = [[RNG.random() for _ in range(3)] for _ in range(triangles // 2)]
    return points, [RNG.sample(range(len(points)), 3) for _ in range(triangles)]


def crowd(triangles):
    """The same of a tenth as many points: thirty triangles meet at each."""
    points = [[RNG.random() for _ in range(3)] for _ in range(triangles // 10)]
    return points, [RNG.sample(range(len(points)), 3) for _ in range(triangles)]


def needles(triangles):
    """Triangles of their own, as long as the cube and thin as a hair."""
    points = []
    for _ in range(triangles):
        a, b = ([RNG.random() for _ in range(3)] for _ in range(2))
        points += [a, b, [x + 1e-4 * RNG.random() for x in b]]
    return points, [[3 * t, 3 * t + 1, 3 * t + 2] for t in range(triangles)]


def joined_needles(triangles):
    """Needles between points that others end at too."""
    points = [[RNG.random() for _ in range(3)] for _ in range(triangles // 4)]
    points += [[x + 1e-4 * RNG.random() for x in p] for p in points]
    half = len(points) // 2
    pick = [RNG.sample(range(half), 2) for _ in range(triangles)]
    return points, [[a, b, b + half] for a, b in pick]


def hub(triangles):
    """A cone of triangles that meet at one vertex."""
    n = triangles // 2
    rim = [[math.cos(2 * math.pi * k / n), math.sin(2 * math.pi * k / n), 0.0] for k in range(n)]
    return [[0.0, 0.0, 1.0], *rim], [[0, 1 + k, 1 + (k + 1) % n] for k in range(n)]


def sheets(triangles):
    """Two hundred sheets that meet at one line."""
    parts, segments = 200, triangles // 400
    points = [[0.0, 0.0, k / segments] for k in range(segments + 1)]
    faces = []
    for s in range(parts):
        x, y, first = math.cos(2 * math.pi * s / parts), math.sin(2 * math.pi * s / parts), len(points)
        points += [[x, y, k / segments] for k in range(segments + 1)]
        for k in range(segments):
            faces += [[k, first + k, first + k + 1], [k, first + k + 1, k + 1]]
    return points, faces


MESHES = [soup, crowd, needles, joined_needles, hub, sheets]


def write(path, points, faces):
    lines = [f"OFF\n{len(points)} {len(faces)} 0", *("%.9g %.9g %.9g" % tuple(p) for p in points), *("3 %d %d %d" % tuple(f) for f in faces)]
    path.write_text("\n".join(lines) + "\n")


def commands(folder, points, faces):
    """What is run on a mesh, by name; what else that reads lies beside it."""
    last = len(points) - 1
    held = {"vertices": {"indices": [1, 2, 3]}}
    moved = {"vertices": {"indices": [last - 1, last]}, "rigid": {"translation": [0.3, 0.2, 0.1]}}
    handles = {"format": "plumbline.handles", "version": 1, "handles": [held, moved]}
    (folder / "handles.json").write_text(json.dumps(handles))
    (folder / "bones.tgf").write_text("1 0.5 0.5 0\n2 0.5 0.5 0.5\n3 0.5 0.5 1\n#\n1 2\n2 3\n")
    write(folder / "moved.off", [[y, x + 0.2 * math.sin(3 * z), z] for x, y, z in points], faces)
    pairs = [[k * last // 5, k * last // 5] for k in range(6)]
    (folder / "pairs.json").write_text(json.dumps({"format": "plumbline.landmarks", "version": 1, "pairs": pairs}))
    deform = ["deform", "mesh.off", "--handles", "handles.json", "-o", "out.off"]
    weights = ["skin", "weights", "mesh.off", "--skeleton", "bones.tgf", "-o", "out.json"]
    morph = ["morph", "mesh.off", "moved.off", "--frames", "3"]
    return {
        "render": ["render", "mesh.off", "-o", "out.png"],
        "render translucent": ["render", "mesh.off", "-o", "out.png", "--opacity", "0.5"],
        "modes": ["modes", "mesh.off", "-k", "4", "-o", "out.npz"],
        "deform arap": [*deform, "--method", "arap"],
        "deform laplacian": [*deform, "--method", "laplacian"],
        "weights heat": [*weights, "--method", "heat"],
        "weights biharmonic": [*weights, "--method", "biharmonic"],
        "skeleton": ["skeleton", "mesh.off", "-o", "out.json"],
        "morph poses": [*morph, "-o", "poses"],
        "morph landmarks": [*morph, "--landmarks", "pairs.json", "-o", "shapes"],
    }


def run(command, folder):
    """Exit status, CPU seconds, largest memory in MB, and the last line said."""
    with open(folder / "said", "w+") as said:
        child = subprocess.Popen([*command, "-y"], cwd=folder, stdout=subprocess.DEVNULL, stderr=said, env=dict(os.environ, NO_COLOR="1"))
        _, status, used = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        lines = [line.strip() for line in said if line.strip()]
    return child.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, lines[-1] if lines else ""


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--triangles", type=int, default=40_000)
    parser.add_argument("--only", help="part of the name of a mesh or a command")
    args = parser.parse_args()
    program, broken = os.path.abspath(args.program), 0
    for mesh in MESHES:
        with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
            folder = pathlib.Path(folder)
            points, faces = mesh(args.triangles)
            write(folder / "mesh.off", points, faces)
            size = (folder / "mesh.off").stat().st_size / 1e6
            for name, command in commands(folder, points, faces).items():
                if args.only and args.only not in f"{mesh.__name__} {name}":
                    continue
                status, cpu, memory, last = run([program, *command], folder)
                holds = status in (0, 65) and cpu <= CPU_PER_MB * max(size, 1) and memory <= MEMORY_MB
                broken += not holds
                print(f"{'ok  ' if holds else 'FAIL'} {mesh.__name__:14} {name:18} exit {status:3} {cpu / size:7.2f} s/MB {memory:6.0f} MB"
                      f"{'' if status == 0 else '  ' + last[:300]}", flush=True)
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
