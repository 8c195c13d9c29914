"""Whole jobs at 12 megapixels, in turn with OpenCV's fisheye map and remap alone: wall clock, CPU seconds, peak memory."""

import json
import os
import resource
import subprocess
import sys
import time

import cv2
import numpy as np

import peers
import photo_maps

# A child's peak memory counts what its parent held when it was started; so a small interpreter starts the command.
STARTER = """
import json, resource, subprocess, sys, time
began = time.perf_counter()
ended = subprocess.run(sys.argv[1:], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
wall, u = time.perf_counter() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps({"wall_s": wall, "cpu_s": u.ru_utime + u.ru_stime, "peak_mb": u.ru_maxrss / 1024}))
sys.stderr.buffer.write(ended.stderr[-1500:])
sys.exit(ended.returncode)
"""


def run(command):
    """Costs of a command that runs to its end."""
    ended = subprocess.run([sys.executable, "-S", "-c", STARTER, *map(str, command)], capture_output=True, text=True)
    if ended.returncode != 0:
        raise peers.Failed(f"exit {ended.returncode}: {' '.join(map(str, command))}\n{ended.stderr}")
    return json.loads(ended.stdout)


def measured(work):
    """Costs of `work` in a child process of its own, so that its peak memory is its own too."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        began = time.perf_counter()
        before = resource.getrusage(resource.RUSAGE_SELF)
        work()
        usage = resource.getrusage(resource.RUSAGE_SELF)
        cpu = usage.ru_utime + usage.ru_stime - before.ru_utime - before.ru_stime
        os.write(write, f"{time.perf_counter() - began} {cpu} {usage.ru_maxrss / 1024}".encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        wall, cpu, peak = map(float, pipe.read().split())
    os.waitpid(child, 0)
    return {"wall_s": wall, "cpu_s": cpu, "peak_mb": peak}


def opencv(source, how):
    """OpenCV's fisheye map (125 degrees, equidistant) and its remap; the picture is decoded before the clock starts."""
    picture = cv2.imread(str(source))
    h, w = picture.shape[:2]
    f = np.hypot(w, h) / np.radians(125)
    camera = {"fx": f, "fy": f, "cx": w / 2 - 0.5, "cy": h / 2 - 0.5, "k": [0.0] * 4}
    return lambda: measured(lambda: cv2.remap(picture, *photo_maps.fisheye_undistorted(camera, (w, h), 0.0), how))


def rounds(a, source, marks):
    """Every method once per round; the least of each figure but the memory, of which it is the largest."""
    target = a.out / "speed.jpg"
    ours = lambda command, *rest: lambda: run(
        [a.plumbline, command, source, "-o", target, "--overwrite", "--progress", "none", "--faces", "off", *rest])
    lens = ["--lens", "rectilinear", "--fov", 103, "--fov-axis", "d"]
    methods = {
        "OpenCV map + remap, linear": opencv(source, cv2.INTER_LINEAR),
        "OpenCV map + remap, cubic": opencv(source, cv2.INTER_CUBIC),
        "plumbline rectify, whole job": ours("rectify", "--lines", marks, *lens),
        "plumbline rectify, lines found": ours("rectify", "--lines", "auto", *lens),
        "plumbline retarget 3000x3000, whole job": ours("retarget", "--lines", marks, "--size", "3000x3000"),
    }
    costs = {name: [] for name in methods}
    for _ in range(a.rounds):
        for name, method in methods.items():
            costs[name].append(method())
    return [(source.stem, name, {"wall s": min(c["wall_s"] for c in of), "cpu s": min(c["cpu_s"] for c in of),
                                 "peak MB": max(c["peak_mb"] for c in of)}) for name, of in costs.items()]
