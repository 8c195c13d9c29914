"""The warp alone against ffmpeg's `vidstabtransform` with bicubic interpolation, 1080p 4:2:0 8 bit.

The peer's time is the CPU time of `-vf vidstabtransform` on raw frames less that of the same command without the filter
(reading and discarding), per frame; ours is the fastest sample of the Criterion bench `render`, one thread. Runs
alternate; the minimum of each counts.

Usage: python benches/peers/render.py CLIP [ROUNDS]     (needs ffmpeg with libvidstab, and `cargo bench` to build)
"""

import json
import pathlib
import resource
import subprocess
import sys
import tempfile

FRAMES = 60
CASES = ["Bicubic mesh", "Lanczos3 mesh"]


def ffmpeg(*args):
    """CPU seconds of one ffmpeg run."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(["ffmpeg", "-y", "-v", "error", *map(str, args)], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def ours(case):
    """Fastest sample of the bench, ms per frame."""
    name = f"render 1080p 8 bit {case}"
    subprocess.run(
        ["cargo", "bench", "-q", "--bench", "render", "--", name, "--warm-up-time", "0.5", "--measurement-time", "3"],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )
    sample = json.loads(pathlib.Path("target/criterion", name, "new/sample.json").read_text())
    return min(t / n for t, n in zip(sample["times"], sample["iters"])) / 1e6


def main():
    clip, rounds = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 3
    with tempfile.TemporaryDirectory() as folder:
        raw, trf = pathlib.Path(folder, "in.yuv"), pathlib.Path(folder, "in.trf")
        ffmpeg("-i", clip, "-frames:v", FRAMES, "-vf", "scale=1920:1080:flags=lanczos", "-pix_fmt", "yuv420p", raw)
        source = ["-f", "rawvideo", "-pix_fmt", "yuv420p", "-s", "1920x1080", "-i", raw]
        ffmpeg(*source, "-vf", f"vidstabdetect=shakiness=10:result={trf}", "-f", "null", "-")
        peer, mine = [], {case: [] for case in CASES}
        for _ in range(rounds):
            warp = f"vidstabtransform=input={trf}:smoothing=30:interpol=bicubic"
            with_filter = ffmpeg(*source, "-vf", warp, "-f", "null", "-")
            peer.append((with_filter - ffmpeg(*source, "-f", "null", "-")) / FRAMES * 1e3)
            for case in CASES:
                mine[case].append(ours(case))
    print(f"vidstabtransform bicubic   {min(peer):6.1f} ms CPU per frame")
    for case in CASES:
        print(f"plumbline {case:16} {min(mine[case]):6.1f} ms, {min(mine[case]) / min(peer):.2f} of the peer's")


if __name__ == "__main__":
    main()
