"""Skins for the oracle tests and benchmarks: made data, glTF files, references, and our program."""
import json
import os
import struct
import subprocess

import numpy as np


def write(folder, V, W, M):
    """The files that `skin_points` reads. W dense, #V x #J; M one 4 x 4 matrix per joint."""
    for name, array in (("rest", V), ("weights", W), ("matrices", M)):
        np.ascontiguousarray(array, dtype="<f8").tofile(os.path.join(folder, name))


def ours(program, folder, V, W, M, method, *options):
    """Positions and what `skin_points` tells."""
    write(folder, V, W, M)
    command = [*program, *(os.path.join(folder, n) for n in ("rest", "weights", "matrices")), method, "-o",
               os.path.join(folder, "out"), *options]
    told = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return np.fromfile(os.path.join(folder, "out"), "<f8").reshape(-1, 3), told


def reference(V, W, M, method):
    """Positions by libigl (linear), and by the formulas of Kavan et al. 2008 in NumPy with signs turned toward the running sum,
    as in libigl (dual): the same where joints differ by less than half a turn."""
    if method == "lbs":
        import igl
        return igl.lbs_matrix(V, W) @ np.concatenate([m[:3, :].T for m in M])
    from scipy.spatial.transform import Rotation
    q = np.array([Rotation.from_matrix(m[:3, :3]).as_quat() for m in M])
    t = M[:, :3, 3]
    dual = 0.5 * np.concatenate([q[:, 3:] * t + np.cross(t, q[:, :3]), -np.sum(t * q[:, :3], axis=1, keepdims=True)], axis=1)
    b, e = np.zeros((len(V), 4)), np.zeros((len(V), 4))
    for j in range(len(M)):
        sign = np.where(b @ q[j] < 0, -1, 1)
        b += (sign * W[:, j])[:, None] * q[j]
        e += (sign * W[:, j])[:, None] * dual[j]
    length = np.linalg.norm(b, axis=1, keepdims=True)
    b, e = b / length, e / length
    u, a, f, g = b[:, :3], b[:, 3:], e[:, :3], e[:, 3:]
    return V + 2 * np.cross(u, np.cross(u, V) + a * V) + 2 * (a * f - g * u + np.cross(u, f))


def made(vertices, joints, influences, seed, most_degrees=170):
    """Random points, weights of a few joints each, and rigid matrices that differ by less than half a turn in all."""
    from scipy.spatial.transform import Rotation
    random = np.random.default_rng(seed)
    V = random.normal(size=(vertices, 3))
    W = np.zeros((vertices, joints))
    chosen = random.integers(joints, size=(vertices, influences))
    np.put_along_axis(W, chosen, random.uniform(0.05, 1, size=chosen.shape), axis=1)
    W /= W.sum(axis=1, keepdims=True)
    axes = random.normal(size=(joints, 3))
    angles = np.radians(random.uniform(0, most_degrees / 2, size=(joints, 1)))
    turns = Rotation.from_rotvec(axes / np.linalg.norm(axes, axis=1, keepdims=True) * angles)
    M = np.tile(np.eye(4), (joints, 1, 1))
    M[:, :3, :3] = (Rotation.from_rotvec([0.4, -1.0, 0.7]) * turns).as_matrix()
    M[:, :3, 3] = random.normal(size=(joints, 3))
    return V, W, M


COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def read_glb(path):
    """Vertices and dense weights (#V x #J) of the first skinned mesh of a .glb, all its primitives one after the other."""
    data = path.read_bytes()
    size, = struct.unpack_from("<I", data, 12)
    g, binary = json.loads(data[20:20 + size]), data[28 + size:]

    def array(index):
        a = g["accessors"][index]
        view = g["bufferViews"][a["bufferView"]]
        kind, width = np.dtype(COMPONENTS[a["componentType"]]), WIDTHS[a["type"]]
        start, step = view.get("byteOffset", 0) + a.get("byteOffset", 0), view.get("byteStride", kind.itemsize * width)
        rows = [np.frombuffer(binary, kind, width, start + i * step) for i in range(a["count"])]
        values = np.array(rows)
        return values / np.iinfo(kind).max if a.get("normalized") else values

    node = next(n for n in g["nodes"] if "skin" in n and "mesh" in n)
    joints = len(g["skins"][node["skin"]]["joints"])
    V, W = [], []
    for primitive in g["meshes"][node["mesh"]]["primitives"]:
        p, j, w = (array(primitive["attributes"][k]) for k in ("POSITION", "JOINTS_0", "WEIGHTS_0"))
        dense = np.zeros((len(p), joints))
        for k in range(4):
            np.add.at(dense, (np.arange(len(p)), j[:, k].astype(int)), w[:, k].astype(float))
        V.append(p.astype(float))
        W.append(dense)
    return np.concatenate(V), np.concatenate(W)
