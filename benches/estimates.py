#!/usr/bin/env python3
"""How far the estimates of `plumbline plan` are from what jobs take, of clips, photos and meshes that no coefficient was measured on.

    benches/estimates.py PROGRAM --media FOLDER [--raw FILE.jsonl] [--held-out FOLDER]

Jobs on the files of --media (of this project) run first, with a cache of their own, so that the program notes what they took. Then each
job on the files of --held-out is planned twice, by the shipped model alone and fitted to these runs, and run. With --raw the work and the
seconds of each kind of stage of the first jobs are written, one job per line: coefficients follow from them by least squares.
"""
import argparse
import json
import math
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time


def clip(source, target, size, frames, *more):
    command = ["ffmpeg", "-v", "error", "-y", "-i", str(source), "-frames:v", str(frames), "-vf", f"scale={size}", *more, str(target)]
    subprocess.run(command, check=True, stdin=subprocess.DEVNULL)
    return target


def picture(source, target, width):
    command = ["ffmpeg", "-v", "error", "-y", "-i", str(source), "-vf", f"scale={width}:-2", "-q:v", "3", str(target)]
    subprocess.run(command, check=True, stdin=subprocess.DEVNULL)
    return target


def fit_jobs(media, base):
    """Jobs on files of the project, at several sizes."""
    for name in ("street-walk", "rolling-passer"):
        for size, frames in (("320:180", 150), ("640:360", 120), ("1280:720", 60)):
            small = clip(media / f"{name}.mp4", base / f"{name}-{size[:-4]}.mp4", size, frames)
            yield f"{name} {size}", ["stabilize", str(small), "-o", "OUT.mp4"]
    small = clip(media / "street-walk.mp4", base / "codec.mp4", "640:360", 60)
    for more in (["--preset", "ultrafast"], ["--preset", "veryfast"], ["--preset", "slow"], ["--codec", "hevc"], ["--codec", "av1"]):
        yield f"codec {more[-1]}", ["stabilize", str(small), "-o", "OUT.mp4", *more]
    yield "codec ffv1", ["stabilize", str(small), "-o", "OUT.mkv", "--codec", "ffv1"]
    yield "codec prores", ["stabilize", str(small), "-o", "OUT.mov", "--codec", "prores"]
    yield "fill", ["stabilize", str(small), "-o", "OUT.mp4", "--border", "fill"]
    yield "retarget clip", ["retarget", str(small), "-o", "OUT.mp4", "--size", "9:16"]
    yield "rectify clip", ["rectify", str(small), "-o", "OUT.mp4", "--lens", "equidistant", "--fov", "120"]
    yield "motion", ["motion", str(small), "-o", "OUT.json"]
    for name in ("room-kb-125", "street-people", "street-fisheye"):
        for width in (1000, 3000, 6000):
            photo = picture(media / f"{name}.jpg", base / f"{name}-{width}.jpg", width)
            yield f"rectify {name} {width}", ["rectify", str(photo), "-o", "OUT.jpg"]
            yield f"retarget {name} {width}", ["retarget", str(photo), "-o", "OUT.jpg", "--size", "1:1"]
    photo = picture(media / "street-people.jpg", base / "people.jpg", 3000)
    yield "png", ["retarget", str(photo), "-o", "OUT.png", "--size", "1:1"]
    yield "tiff", ["retarget", str(photo), "-o", "OUT.tif", "--size", "1:1"]
    for name in ("dog.ply", "giraffe.ply", "candy.ply", "humanoid.glb"):
        yield f"skeleton {name}", ["skeleton", str(media / name), "-o", "OUT.json"]
        yield f"modes {name}", ["modes", str(media / name), "-o", "OUT.npz"]
        yield f"render {name}", ["render", str(media / name), "-o", "OUT.png"]
    yield "morph", ["morph", str(media / "dog.ply"), str(media / "giraffe.ply"), "-o", "OUT.glb"]


def held_out_jobs(media):
    """Jobs on files of others."""
    for name in ("plant-short-audio.mp4", "bike-10fps.avi", "desk-roll.mp4", "hippo.mp4", "nus-regular-0.m4v", "lake-walk-audio.mp4",
                 "room-720p.mp4", "cockatoo-720p-444.mp4"):
        yield name, ["stabilize", str(media / "video" / name), "-o", "OUT.mp4"]
    for name in ("portrait/yzhq_1_97.jpg", "portrait/yzhq_11_120.jpg", "fisheye_calib/nebula_01.jpg", "retarget/rme_child.png"):
        yield f"rectify {name}", ["rectify", str(media / "photo" / name), "-o", "OUT.jpg"]
        yield f"retarget {name}", ["retarget", str(media / "photo" / name), "-o", "OUT.jpg", "--size", "1:1"]
    for name in ("common/horse.off", "common/stanford-bunny.obj", "igl/elephant.obj", "hard/homer.off"):
        yield f"skeleton {name}", ["skeleton", str(media / "mesh" / name), "-o", "OUT.json"]


def seconds_of(text):
    """The time on one worker, as the table has it."""
    found = re.search(r"expected: (?:(\d+) h )?(?:(\d+) min ?)?(?:([\d.]+) s )?on 1 worker", text)
    hours, minutes, seconds = (float(part or 0) for part in found.groups())
    return 3600 * hours + 60 * minutes + seconds


class Program:
    def __init__(self, path, base):
        self.path, self.base, self.number = path, base, 0

    def call(self, args, cache):
        environment = dict(os.environ, PLUMBLINE_CACHE=str(cache), NO_COLOR="1")
        return subprocess.run([self.path, *args], env=environment, cwd=self.base, capture_output=True, text=True, stdin=subprocess.DEVNULL)

    def args(self, args):
        self.number += 1
        return [arg.replace("OUT", str(self.base / f"out-{self.number}")) for arg in args]

    def run(self, args, cache):
        """The summary of a job, with the seconds around it."""
        start = time.monotonic()
        done = self.call([*self.args(args), "--progress", "json"], cache)
        wall = time.monotonic() - start
        events = [json.loads(line) for line in done.stderr.splitlines() if line.startswith("{")]
        summaries = [event["summary"] for event in events if event["ev"] == "task.done"]
        if not summaries:
            print(f"failed: {' '.join(args)}: {done.stderr[-300:]}", file=sys.stderr)
            return None
        return {"wall": wall, **{key: summaries[0][key] for key in ("work", "stage_seconds", "seconds")}}

    def planned(self, args, cache):
        """What the plan says that it takes."""
        job = self.base / "job.toml"
        job.write_text(self.call([*self.args(args), "--print-pipeline"], cache).stdout)
        done = self.call(["plan", str(job), "--workers", "1"], cache)
        return seconds_of(done.stdout)


def report(name, pairs):
    off = [abs(math.log(estimate / taken)) for estimate, taken in pairs]
    within = lambda factor: sum(o <= math.log(factor) for o in off)
    total = sum(e for e, _ in pairs) / sum(t for _, t in pairs)
    print(f"{name}: half of {len(pairs)} jobs within a factor of {math.exp(statistics.median(off)):.2f}, "
          f"{within(1.5)} within 1.5, {within(2)} within 2, all within {math.exp(max(off)):.2f}; all together {total:.2f} of what they took")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--media", type=pathlib.Path, required=True, help="the folder media/ of the project")
    parser.add_argument("--held-out", type=pathlib.Path, help="a folder of other media, as PLUMBLINE_MEDIA names it")
    parser.add_argument("--raw", help="a file for the seconds of each stage")
    parser.add_argument("--threads", type=int, nargs="*", default=[2], help="threads of the first jobs")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as base:
        base = pathlib.Path(base)
        program = Program(os.path.abspath(args.program), base)
        cache, none = base / "cache", base / "none"
        raw = open(args.raw, "w", encoding="utf-8") if args.raw else None
        for name, job in fit_jobs(args.media.resolve(), base):
            for threads in args.threads:
                done = program.run([*job, "--threads", str(threads), "--force", "tracks", "--force", "cameras"], cache)
                if done and raw:
                    raw.write(json.dumps({"job": name, "threads": threads, **done}) + "\n")
                    raw.flush()
        if not args.held_out:
            return
        shipped, fitted = [], []
        for name, job in held_out_jobs(args.held_out.resolve()):
            before, after = program.planned(job, none), program.planned(job, cache)
            # With a cache that is empty: what others took is not part of the fit.
            done = program.run([*job, "--threads", "2" if job[0] == "stabilize" else "1"], base / f"own-{program.number}")
            if done:
                shipped.append((before, done["wall"]))
                fitted.append((after, done["wall"]))
                print(f"{name:<40} {done['wall']:7.2f} s, shipped {before:7.2f}, fitted {after:7.2f}", flush=True)
        report("shipped model", shipped)
        report("fitted", fitted)


if __name__ == "__main__":
    main()
