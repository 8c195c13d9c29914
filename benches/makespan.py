#!/usr/bin/env python3
"""How long 10,000 photos and a clip of two hours take on 1 to 1,000 workers, from measured task times, and what bounds it.

    benches/makespan.py [--photo-s 1.06] [--track-s .016] [--cameras-s .017] [--plan-s .006] [--render-s .095] [--bandwidth-mb 1100]

A worker does one task at a time on one thread; each task goes to the worker that is free first, in the order of the plan, behind the
tasks that it waits for. Reading and writing share one storage: no run is shorter than its bytes over the bandwidth. The defaults were
measured on one core of this project's test machine (see docs/CLUSTER.md); give those of your own.
"""
import argparse
import heapq

WORKERS = (1, 3, 10, 30, 100, 300, 1000)


def makespan(stages, workers):
    """Seconds for stages of (number of tasks, seconds of each), each behind the one before."""
    free, start = [0.0] * workers, 0.0
    for count, seconds in stages:
        for _ in range(count):
            heapq.heappush(free, max(heapq.heappop(free), start) + seconds)
        # The next stage waits for the last task of this one.
        start = max(free)
    return start


def bound(stages, workers, stored):
    """The makespan, and what decides it: the work, one task after the other, or the storage."""
    time = makespan(stages, workers)
    chain = sum(seconds for _, seconds in stages)
    work = sum(count * seconds for count, seconds in stages) / workers
    if stored > time:
        return stored, "storage"
    return time, "work" if work > chain else "longest chain"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    option = lambda name, default, text: parser.add_argument(name, type=float, default=default, help=f"{text} (default {default})")
    option("--photo-s", 1.06, "seconds of a photo of 10 megapixels given a new shape")
    option("--photo-mb", 5.0, "megabytes of a photo, read and written")
    option("--track-s", 0.016, "seconds per frame for its tracks")
    option("--motion-s", 0.003, "seconds per frame for the motion in the picture, which is one task")
    option("--leading-s", 6.6, "seconds for the first window of a shot, which shows the focal length to the others; 0 without cameras")
    option("--cameras-s", 0.017, "seconds per frame for cameras in space; 0 without them")
    option("--plan-s", 0.006, "seconds per frame in the plan, which is one task")
    option("--render-s", 0.095, "seconds per frame to render and encode")
    option("--task-s", 0.2, "seconds of a task before its first frame")
    option("--frames", 2 * 3600 * 30, "frames of the clip")
    option("--chunk-frames", 1800, "frames of a chunk, a minute at 30 frames/s")
    option("--clip-mb-s", 2.5, "megabytes per second of the clip, read twice and written twice")
    option("--bandwidth-mb", 1100, "megabytes per second of the storage, 10 Gbit/s")
    args = parser.parse_args()
    chunks = round(args.frames / args.chunk_frames)
    frames = args.frames / chunks
    cameras = [(1, args.task_s + args.leading_s), (chunks, args.task_s + frames * args.cameras_s)] if args.cameras_s else []
    clip = [(chunks, args.task_s + frames * args.track_s), (1, args.frames * args.motion_s), *cameras,
            (1, args.frames * args.plan_s), (chunks, args.task_s + frames * args.render_s), (1, args.frames * 25e-6)]
    photos = [(10_000, args.photo_s)]
    stored = {"photos": 2 * 10_000 * args.photo_mb / args.bandwidth_mb,
              "clip": 4 * args.frames / 30 * args.clip_mb_s / args.bandwidth_mb}
    print("| workers | 10,000 photos, s | bound by | clip of 2 hours, s | bound by |\n| ---: | ---: | --- | ---: | --- |")
    for workers in WORKERS:
        cells = [bound(photos, workers, stored["photos"]), bound(clip, workers, stored["clip"])]
        print(f"| {workers:,} | " + " | ".join(f"{seconds:,.0f} | {by}" for seconds, by in cells) + " |")


if __name__ == "__main__":
    main()
