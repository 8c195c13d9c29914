"""Whole jobs at 12 megapixels, in turn with OpenCV's: wall clock, CPU seconds, peak memory.

OpenCV's job is measured twice. *Map and remap* alone: the picture is in memory before the clock starts, and nothing is written.
The *whole job* reads the file, makes the map, samples the picture with the kernel of as many taps as ours (cubic), and writes a
JPEG of our quality with chroma as ours. Beside `rectify` the map is that of its fisheye camera; beside `retarget`, a coarse grid
brought to the size of the output. It finds neither lines nor importance: for those OpenCV has no counterpart. Its interpreter and imports
are not counted; our process is, from its start.
"""

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


# Of what is written: that of `plumbline`, whose chroma has full resolution from 90 on.
QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 92, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]


def fisheye_map(size):
    """OpenCV's fisheye map: 125 degrees, equidistant."""
    w, h = size
    f = np.hypot(w, h) / np.radians(125)
    camera = {"fx": f, "fy": f, "cx": w / 2 - 0.5, "cy": h / 2 - 0.5, "k": [0.0] * 4}
    return photo_maps.fisheye_undistorted(camera, size, 0.0)


def grid_map(size, target):
    """The map to another shape from a grid of 40 x 40 cells, bilinear between its points."""
    steps = [np.linspace(0, n - 1, 41, dtype=np.float32) for n in size]
    return [cv2.resize(m, target, interpolation=cv2.INTER_LINEAR) for m in np.meshgrid(*steps)]


def map_and_remap(source, how):
    picture = cv2.imread(str(source))
    return lambda: measured(lambda: cv2.remap(picture, *fisheye_map(picture.shape[1::-1]), how))


def whole_job(source, target, make_map):
    def job():
        picture = cv2.imread(str(source))
        cv2.imwrite(str(target), cv2.remap(picture, *make_map(picture.shape[1::-1]), cv2.INTER_CUBIC), QUALITY)
    return lambda: measured(job)


def rounds(a, source, marks):
    """Every method once per round; the least of each figure but the memory, of which it is the largest."""
    target, shape = a.out / "speed.jpg", (3000, 3000)
    ours = lambda command, *rest: lambda: run(
        [a.plumbline, command, source, "-o", target, "--overwrite", "--progress", "none", "--faces", "off", *rest])
    lens = ["--lens", "rectilinear", "--fov", 103, "--fov-axis", "d"]
    size = ["--size", "{}x{}".format(*shape)]
    methods = {
        "OpenCV map + remap, linear": map_and_remap(source, cv2.INTER_LINEAR),
        "OpenCV map + remap, cubic": map_and_remap(source, cv2.INTER_CUBIC),
        "OpenCV fisheye, whole job": whole_job(source, a.out / "speed-cv.jpg", fisheye_map),
        "plumbline rectify, marked lines": ours("rectify", "--lines", marks, *lens),
        "plumbline rectify, lines found": ours("rectify", "--lines", "auto", *lens),
        "OpenCV grid to 3000x3000, whole job": whole_job(source, a.out / "speed-cv.jpg", lambda s: grid_map(s, shape)),
        "plumbline retarget 3000x3000, marked lines": ours("retarget", "--lines", marks, *size),
        "plumbline retarget 3000x3000, lines found": ours("retarget", "--lines", "auto", *size),
    }
    costs = {name: [] for name in methods}
    for _ in range(a.rounds):
        for name, method in methods.items():
            costs[name].append(method())
    return [(source.stem, name, {"wall s": min(c["wall_s"] for c in of), "cpu s": min(c["cpu_s"] for c in of),
                                 "peak MB": max(c["peak_mb"] for c in of)}) for name, of in costs.items()]
