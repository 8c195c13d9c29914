#!/usr/bin/env python3
"""Bone heat beside Blender: CPU seconds of one process each, and how far the weights are apart.

    bone_heat.py --plumbline target/release/plumbline MESH.off SKELETON.skel [--subdivide] [--rounds 3]

Needs the PyPI package `bpy` (Blender as a module). Blender is timed from its `parent_set(type='ARMATURE_AUTO')` alone; ours as the
whole command (reading, weights, writing). Both get the same bones, from each joint to each of its children; rounds run both in turn,
minima count. --subdivide splits every triangle into four first.
"""
import argparse
import json
import os
import pathlib
import resource
import subprocess
import tempfile
import time

os.environ["OMP_NUM_THREADS"] = "1"
import bpy  # noqa: E402
import numpy as np  # noqa: E402

# What is measured is computed.
os.environ["PLUMBLINE_CACHE"] = ""


def read_off(path):
    words = path.read_text().split()
    n, m = int(words[1]), int(words[2])
    V = np.array(words[4:4 + 3 * n], float).reshape(n, 3)
    F = np.array(words[4 + 3 * n:4 + 3 * n + 4 * m], int).reshape(m, 4)[:, 1:]
    return V, F


def subdivided(V, F):
    edges, number = np.unique(np.sort(F[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), 1), axis=0, return_inverse=True)
    a, b, c = F.T
    ab, bc, ca = len(V) + number.reshape(-1, 3).T
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.vstack([V, V[edges].mean(1)]), np.concatenate([np.stack(p, 1) for p in parts])


def read_skeleton(path):
    """Names, places and parents (-1: none)."""
    rows = [line.split() for line in path.read_text().splitlines()[1:] if line.strip()]
    names = [r[3] for r in rows]
    return names, np.array([r[:3] for r in rows], float), [names.index(r[4]) if r[4] in names else -1 for r in rows]


def blender(V, F, names, at, parents):
    """CPU seconds, and weights per vertex and joint: those of all bones that leave a joint together."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(V.tolist(), [], F.tolist())
    body = bpy.data.objects.new("body", mesh)
    rig = bpy.data.objects.new("rig", bpy.data.armatures.new("rig"))
    for thing in (body, rig):
        bpy.context.collection.objects.link(thing)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for child, parent in enumerate(parents):
        if parent >= 0:
            bone = rig.data.edit_bones.new(f"{parent} {child}")
            bone.head, bone.tail = at[parent], at[child]
    bpy.ops.object.mode_set(mode="OBJECT")
    body.select_set(True)
    rig.select_set(True)
    began = time.process_time()
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    seconds = time.process_time() - began
    W = np.zeros((len(V), len(names)))
    joint = {g.index: int(g.name.split()[0]) for g in body.vertex_groups}
    for v in mesh.vertices:
        for g in v.groups:
            W[v.index, joint[g.group]] += g.weight
    return seconds, W


def ours(program, folder, names):
    began = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [program, "skin", "weights", folder / "mesh.off", "--skeleton", folder / "bones.skel", "-o", folder / "w.json",
               "--influences", "64", "--overwrite", "--threads", "1", "--progress", "none"]
    subprocess.run(command, check=True, capture_output=True)
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = json.loads((folder / "w.json").read_text())
    W = np.zeros((len(told["rows"]), len(names)))
    column = [names.index(name) for name in told["joints"]]
    for v, row in enumerate(told["rows"]):
        for j, w in zip(row[::2], row[1::2]):
            W[v, column[j]] = w
    return ended.ru_utime + ended.ru_stime - began.ru_utime - began.ru_stime, W


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--plumbline", required=True)
    p.add_argument("--subdivide", action="store_true")
    p.add_argument("--rounds", type=int, default=3)
    p.add_argument("mesh", type=pathlib.Path)
    p.add_argument("skeleton", type=pathlib.Path)
    a = p.parse_args()
    V, F = read_off(a.mesh)
    if a.subdivide:
        V, F = subdivided(V, F)
    names, at, parents = read_skeleton(a.skeleton)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        rows = ["%.9g %.9g %.9g\n" % tuple(v) for v in V] + ["3 %d %d %d\n" % tuple(f) for f in F]
        (folder / "mesh.off").write_text(f"OFF\n{len(V)} {len(F)} 0\n" + "".join(rows))
        (folder / "bones.skel").write_text(a.skeleton.read_text())
        least = [np.inf, np.inf]
        for _ in range(a.rounds):
            theirs, B = blender(V, F, names, at, parents)
            own, W = ours(a.plumbline, folder, names)
            least = [min(least[0], theirs), min(least[1], own)]
    bones = sum(q >= 0 for q in parents)
    apart = np.abs(W - B / np.maximum(B.sum(1, keepdims=True), 1e-12)).sum(1) / 2
    print(f"{len(V)} vertices, {bones} bones: Blender {least[0]:.3f} s, ours {least[1]:.3f} s, ratio {least[1] / least[0]:.2f}; "
          f"weights apart by {np.median(apart):.3f} at half of the vertices, {np.quantile(apart, 0.95):.3f} at 95 %; "
          f"without a weight: {(B.sum(1) == 0).sum()} and {(W.sum(1) == 0).sum()}")


if __name__ == "__main__":
    main()
