#!/usr/bin/env python3
"""A plan of forty tasks on a Dask cluster of this machine: nothing happens; a worker is killed; a worker is stopped; the scheduler
starts anew. Each time every result is the same as that of the program alone. Then a clip in parts, whose tasks wait for others, with
a worker that is killed: the motion file is that of the clip at once, the clip that of its tasks one after the other. That clip has
four seconds; with --long it is the only case, and has twelve, of four times as many pixels.

    tests/engines/dask.py PROGRAM [--long]
"""
import hashlib
import json
import os
import pathlib
import random
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zlib

TASKS = 40
PACKAGE = pathlib.Path(__file__).resolve().parents[2] / "src/python/dask"
ENVIRONMENT = dict(os.environ, PYTHONPATH=str(PACKAGE), NO_COLOR="1")


def png(path, seed):
    rng = random.Random(seed)
    rows = b"".join(b"\0" + bytes(rng.randrange(256) for _ in range(3 * 96)) for _ in range(64))
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 96, 64, 8, 2, 0, 0, 0))
                     + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def folder_with_plan(program, base, name, photos=None):
    """A folder with a plan for photos in it, or in the folder `photos`."""
    folder = base / name
    folder.mkdir(parents=True)
    photos = photos or folder / "in"
    photos.mkdir()
    for k in range(TASKS):
        png(photos / f"{k:02}.png", k)
    command = [program, "retarget", os.path.relpath(photos, folder), "--size", "64x64", "--out-dir", "out"]
    job = subprocess.run([*command, "--print-pipeline"], cwd=folder, check=True, capture_output=True, text=True)
    (folder / "job.toml").write_text(job.stdout)
    subprocess.run([program, "plan", "job.toml", "--json", "-o", "plan.json"], cwd=folder, check=True)
    return folder


def digests(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted((folder / "out").glob("*.png"))}


CLIP = pathlib.Path(__file__).resolve().parents[2] / "media/rolling-passer.mp4"


def folder_with_clip(program, base, name, clip, seconds):
    folder = base / name
    (folder / "out").mkdir(parents=True)
    (folder / "clip.mp4").write_bytes(clip.read_bytes())
    command = [program, "stabilize", "clip.mp4", "-o", "out/clip.mp4", "--preset", "veryfast", "--export-motion", "out/motion.json"]
    job = subprocess.run([*command, "--print-pipeline"], cwd=folder, check=True, capture_output=True, text=True)
    (folder / "job.toml").write_text(job.stdout.replace("cameras = true", "cameras = false"))
    subprocess.run([program, "plan", "job.toml", "--json", "--split", str(seconds), "-o", "plan.json"], cwd=folder, check=True)
    return folder


def short_clip(base):
    """The first four seconds of the clip, at half of its size."""
    short = base / "short.mp4"
    command = ["ffmpeg", "-v", "error", "-y", "-i", str(CLIP), "-t", "4", "-vf", "scale=320:180", "-crf", "18", str(short)]
    subprocess.run(command, check=True, stdin=subprocess.DEVNULL)
    return short


def clip_in_parts(program, base, clip, seconds):
    """Whether a clip in parts of so many seconds is the same on a cluster that loses a worker."""
    def digest(folder, name):
        return hashlib.sha256((folder / "out" / name).read_bytes()).hexdigest()

    start = time.monotonic()
    whole, alone, folder = (folder_with_clip(program, base, f"clip-{name}", clip, seconds) for name in ("whole", "alone", "dask"))
    quiet = {"check": True, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run([program, "run", "job.toml", "--no-cache", "-q"], cwd=whole, **quiet)
    tasks = [task["id"] for task in json.loads((alone / "plan.json").read_text())["tasks"]]
    for task in tasks:
        subprocess.run([program, "task", "run", "--plan", "plan.json", "--task", task], cwd=alone, **quiet)
    with Cluster() as cluster:
        status, events = driven(program, folder, cluster, lambda: cluster.workers[1].kill())
    ended = [e["done"] for e in events if e["ev"] == "run.end"]
    same = status == 0 and digest(folder, "motion.json") == digest(whole, "motion.json")
    same = same and digest(folder, "clip.mp4") == digest(alone, "clip.mp4")
    left = (folder / "out/.plumbline/parts").exists()
    good = same and ended == [len(tasks)] and len(tasks) > 5 and not left
    print(f"{'ok  ' if good else 'FAIL'} a clip in {len(tasks)} tasks, a worker is killed: exit {status}, "
          f"{'the same' if same else 'OTHERS'}, {time.monotonic() - start:.1f} s", flush=True)
    return good


class Cluster:
    def __init__(self):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.scheduler = self.start_scheduler()
        self.workers = [self.start_worker() for _ in range(2)]

    @staticmethod
    def start(module, *args):
        command = [sys.executable, "-m", module, *args, "--dashboard-address", "127.0.0.1:0"]
        return subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def start_scheduler(self):
        return self.start("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(self.port))

    def start_worker(self):
        return self.start("distributed.cli.dask_worker", self.address, "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.send_signal(signal.SIGCONT)
            process.wait()


def driven(program, folder, cluster, at_start=None, more=()):
    """Runs the plan; `at_start` is called once, at the event of the third task that is done."""
    command = [sys.executable, "-m", "plumbline_dask", "plan.json", "--scheduler", cluster.address, "--root", str(folder),
               "--remote-plan", str(folder / "plan.json"), "--program", program, "--progress", "json", "--wait", *more]
    child = subprocess.Popen(command, cwd=folder, env=ENVIRONMENT, stderr=subprocess.PIPE, text=True)
    watchdog = threading.Timer(150, child.kill)
    watchdog.start()
    events = []
    for line in child.stderr:
        if line.startswith("{"):
            events.append(json.loads(line))
            if at_start and sum(e["ev"] == "task.done" for e in events) == 3:
                at_start()
                at_start = None
        else:
            print(line, end="")
    watchdog.cancel()
    return child.wait(), events


def main():
    program = os.path.abspath(sys.argv[1])
    faults = 0
    with tempfile.TemporaryDirectory() as base:
        base = pathlib.Path(base)
        if "--long" in sys.argv[2:]:
            sys.exit(not clip_in_parts(program, base, CLIP, 2))
        alone = folder_with_plan(program, base, "alone")
        subprocess.run([program, "run", "job.toml", "--progress", "none", "-q"], cwd=alone, check=True, stdout=subprocess.DEVNULL)
        wanted = digests(alone)
        assert len(wanted) == TASKS and len(set(wanted.values())) == TASKS

        def restart(cluster):
            cluster.scheduler.kill()
            cluster.scheduler.wait()
            # Workers end without their scheduler, or come back to the new one: both happen.
            cluster.scheduler = cluster.start_scheduler()
            cluster.workers += [cluster.start_worker()]

        cases = {
            "nothing happens": lambda cluster: None,
            "a worker is killed": lambda cluster: cluster.workers[1].kill(),
            "a worker is stopped": lambda cluster: cluster.workers[1].send_signal(signal.SIGSTOP),
            "the scheduler starts anew": restart,
        }
        for name, disturb in cases.items():
            start = time.monotonic()
            with Cluster() as cluster:
                # The photos of one case are outside the root, and elsewhere on the workers.
                planned, mounted = (base / "planned", base / "mounted") if name == "nothing happens" else (None, None)
                folder = folder_with_plan(program, base, name.replace(" ", "-"), planned)
                if planned:
                    planned.rename(mounted)
                more = ["--path-map", f"{planned}={mounted}"] if planned else []
                status, events = driven(program, folder, cluster, lambda: disturb(cluster), more)
            same = digests(folder) == wanted
            ended = [e for e in events if e["ev"] == "run.end"]
            good = status == 0 and same and ended and ended[0]["done"] == TASKS
            faults += not good
            given = sum(e["ev"] == "task.start" for e in events)
            print(f"{'ok  ' if good else 'FAIL'} {name}: exit {status}, {len(digests(folder))} results, "
                  f"{'the same' if same else 'OTHERS'}, {given} given out, {time.monotonic() - start:.1f} s", flush=True)
        faults += not clip_in_parts(program, base, short_clip(base), 1)
        # A scheduler that is not there, or that anyone may use.
        for address, expected in (("tcp://127.0.0.1:1", 75), ("tcp://192.0.2.1:8786", 2), ("head:8786", 2)):
            command = [sys.executable, "-m", "plumbline_dask", "plan.json", "--root", ".", "--scheduler", address]
            done = subprocess.run(command, cwd=alone, env=ENVIRONMENT, capture_output=True, text=True)
            good = done.returncode == expected and address in done.stderr and "Traceback" not in done.stderr
            faults += not good
            print(f"{'ok  ' if good else 'FAIL'} {address}: exit {done.returncode} {done.stderr.strip()[:100]}")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
