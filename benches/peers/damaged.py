#!/usr/bin/env python3
"""Curve skeletons of damaged copies of closed meshes: how many have a curve, and what they cost beside the clean mesh.

    damaged.py --plumbline target/release/plumbline --maker make_messy_meshes.py --media DIR [MESH...] [--seeds 1 2 3]

--maker is the program that writes the copies: `make_messy_meshes.py MESH.off DIR --seed N`, one file per kind of damage. --media holds
the meshes; without names ten closed ones are damaged. CPU seconds and the peak of memory are those of the whole command, on one thread.
A curve of more than five times the nodes of the clean mesh's is none: it is a crowd of pieces. Every copy without a curve, above five
times the clean mesh's CPU seconds or above 500 MB is listed, then a row per mesh and per kind; "off" is the mean distance of the nodes
of either curve to the nearest of the other, % of the diagonal of the clean mesh, its median over the copies of the kind, where the
copy has the clean mesh's coordinates.
"""
import argparse
import collections
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
from scipy.spatial import cKDTree

from skeleton import vertices_and_faces, write_off

MESHES = ["common/horse.off", "igl/cow.off", "igl/3holes.off", "igl/bumpy.off", "hard/homer.off", "hard/cheburashka.off",
          "hard/rocker-arm.off", "arapbench/armadillo_1k.off", "arapbench/cactus_small.off", "rig/male_LR20.off"]
TIMES_CLEAN, TIMES_NODES, MOST_MB, LIMIT_S = 5.0, 5, 500.0, 600
MOVED = {"scale_1e-12", "scale_1e12", "offset_1e7", "flat"}


def skeleton(plumbline, mesh, out):
    """Exit status, CPU seconds, peak MB and the last line of what was said."""
    command = [str(c) for c in (plumbline, "skeleton", mesh, "-o", out, "--overwrite", "--threads", "1")]
    env = dict(os.environ, PLUMBLINE_CACHE="", RAYON_NUM_THREADS="1")
    child = subprocess.Popen(["timeout", str(LIMIT_S), *command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=env)
    said = child.stderr.read()
    _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    return child.returncode, used.ru_utime + used.ru_stime, used.ru_maxrss / 1e3, (said.strip().splitlines() or [""])[-1]


def nodes_of(path):
    return np.array(json.loads(path.read_text())["curve"]["nodes"])


def mean_distance(a, b):
    return (cKDTree(a).query(b)[0].mean() + cKDTree(b).query(a)[0].mean()) / 2


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plumbline", type=pathlib.Path, required=True)
    parser.add_argument("--maker", type=pathlib.Path, required=True)
    parser.add_argument("--media", type=pathlib.Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("meshes", nargs="*", default=MESHES)
    a = parser.parse_args()
    kinds, total, off = collections.defaultdict(collections.Counter), collections.Counter(), collections.defaultdict(list)
    for name in a.meshes:
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            clean = folder / (pathlib.Path(name).stem + ".off")
            V, F = vertices_and_faces(a.media / name)
            write_off(clean, [[str(x) for x in p] for p in V], F)
            code, clean_cpu, clean_mb, said = skeleton(a.plumbline, clean, folder / "curve.json")
            if code:
                sys.exit(f"{name}: {said}")
            whole, diagonal = nodes_of(folder / "curve.json"), np.linalg.norm(np.ptp(np.array(V, float), axis=0))
            row, most = collections.Counter(), (0.0, 0.0)
            for seed in a.seeds:
                copies = folder / str(seed)
                subprocess.run([sys.executable, a.maker, clean, copies, "--seed", str(seed)], check=True, stdout=subprocess.DEVNULL)
                for copy in sorted(copies.iterdir()):
                    kind = copy.name.split(".", 1)[1].removesuffix(".off")
                    code, cpu, mb, said = skeleton(a.plumbline, copy, folder / "curve.json")
                    if not code:
                        nodes = nodes_of(folder / "curve.json")
                        crowd = len(nodes) > TIMES_NODES * len(whole)
                        code, said = (code, said) if not crowd else (-1, f"{len(nodes)} nodes for {len(whole)}")
                        if kind not in MOVED:
                            off[kind].append(100 * mean_distance(nodes, whole) / diagonal)
                    found = {"copies": 1, "curves": not code, "slow": cpu > TIMES_CLEAN * clean_cpu, "large": mb > MOST_MB}
                    for counter in (row, kinds[kind], total):
                        counter.update(found)
                    most = max(most[0], cpu / clean_cpu), max(most[1], mb)
                    if code or found["slow"] or found["large"]:
                        print(f"  {name} {kind}, seed {seed}: exit {code}, {cpu / clean_cpu:.1f} × clean, {mb:.0f} MB: {said}", flush=True)
            print(f"{name:28} clean {clean_cpu:6.2f} s {clean_mb:4.0f} MB; {row['curves']} of {row['copies']} have a curve; "
                  f"at most {most[0]:.1f} × and {most[1]:.0f} MB", flush=True)
    for kind, row in sorted(kinds.items()):
        print(f"{kind:18} {row['curves']:3} of {row['copies']} have a curve, {row['slow']} above {TIMES_CLEAN:.0f} × clean, {row['large']} above {MOST_MB:.0f} MB; "
              f"off {np.median(off[kind]) if off[kind] else np.nan:.2f} %")
    print(f"all: {total['curves']} of {total['copies']} have a curve, {total['slow']} above {TIMES_CLEAN:.0f} × clean, {total['large']} above {MOST_MB:.0f} MB")


if __name__ == "__main__":
    main()
