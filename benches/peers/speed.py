#!/usr/bin/env python3
"""Speed and memory of `plumbline stabilize` beside plain FFmpeg and vid.stab, on 1080p, two threads, the same encoder.

    speed.py --plumbline BIN --clip NAME.m4v [--render BIN] [--rounds 3] [--out DIR] [--long]

The clip's first 300 frames are scaled to 1920x1080 (Lanczos, H.264 crf 12); --render gives the built `render_clip`
example, which makes a second 1080p clip. Each round runs every method once, in turn, so that a busy machine hurts all
alike; reported are the minima over the rounds and the ratios to plain FFmpeg and to vid.stab. --long repeats the
clip ten times and compares the peak memory.

Peers work in the picture, and so does what is held against them: `--mode mesh`; the row `auto` recovers cameras in space too.

The physical limit of the whole job is two decodes and one encode: the plain transcode is one decode and one encode,
and `decode alone` says what the second decode adds.
"""

import argparse
import os
import subprocess
import time
from pathlib import Path

import peers

FRAMES = 300


def prepare(a):
    """The 1080p inputs, made once."""
    a.out.mkdir(parents=True, exist_ok=True)
    made = []
    if a.clip:
        target = a.out / f"{a.clip.stem}-1080p.mp4"
        if not target.exists():
            peers.run(["ffmpeg", "-nostdin", "-v", "error", "-y", "-i", a.clip, "-frames:v", FRAMES, "-an", "-vf",
                       "scale=1920:1080:flags=lanczos", *peers.x264(12), "-pix_fmt", "yuv420p", target])
        made.append(target)
    if a.render:
        target = a.out / "street-1080p.mp4"
        if not target.exists():
            peers.run([a.render, "--size", "1920x1080", "--frames", FRAMES, "--crf", 12, "--out", a.out,
                       "--name", target.stem])
        made.append(target)
    return made


def methods(a, clip, scratch):
    """Label → a run that returns its costs. All encoders: x264 veryfast, the same crf, the same threads."""
    encode = [*peers.x264(a.crf, a.preset, a.threads), "-pix_fmt", "yuv420p"]
    ffmpeg = ["ffmpeg", "-nostdin", "-v", "error", "-y", "-threads", a.threads, "-i", clip, "-map", "0:v:0",
              "-filter_threads", a.threads]
    target, trf = scratch / "result.mp4", "speed.trf"
    detect = f"{peers.VIDSTAB_DETECT}:result={trf}"
    transform = f"{peers.VIDSTAB_TRANSFORM}:input={trf}"
    plain = lambda *rest: lambda: peers.run([*ffmpeg, *rest], cwd=scratch)
    table = {
        "decode alone": plain("-f", "null", "-"),
        "ffmpeg transcode": plain(*encode, target),
        "vidstabdetect alone": plain("-vf", detect, "-f", "null", "-"),
        "vidstabtransform alone": plain("-vf", transform, "-f", "null", "-"),
        "vid.stab, pass 2 + encode": plain("-vf", transform, *encode, target),
    }
    if a.plumbline:
        job = [a.plumbline, "stabilize", clip, "-o", target, "--codec", "h264", "--crf", a.crf, "--preset", a.preset,
               "--threads", a.threads, "--overwrite", "--mode", "mesh", "--progress", "none"]
        table["plumbline, whole job"] = lambda: peers.run(job)
        table["plumbline auto, whole job"] = lambda: peers.run(["auto" if word == "mesh" else word for word in job])
        table["plumbline, analysis alone"] = lambda: analysis([*job[:-1], "json"])
    return table


def analysis(job):
    """Costs of a job up to its first report from the second pass, where it is ended."""
    began = time.perf_counter()
    process = subprocess.Popen([str(c) for c in job], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True)
    for line in process.stdout:
        if '"pass":2' in line:
            wall = time.perf_counter() - began
            fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
            cpu = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
            process.terminate()
            process.stdout.read()
            _, _, usage = os.wait4(process.pid, 0)
            process.returncode = 0
            return {"wall_s": wall, "cpu_s": cpu, "peak_mb": usage.ru_maxrss / 1024}
    raise peers.Failed(f"no report from a second pass: {' '.join(map(str, job))}")


def measure(a, clip):
    """Minimum wall and CPU time and maximum memory of every method over the rounds."""
    scratch = a.out / "scratch"
    scratch.mkdir(exist_ok=True)
    best = {}
    for round_ in range(a.rounds):
        for label, run in methods(a, clip, scratch).items():
            try:
                cost = run()
            except peers.Failed as e:
                if round_ == 0:
                    print(f"{label}: left out: {str(e).splitlines()[0]}")
                continue
            old = best.get(label, cost)
            best[label] = {"wall_s": min(old["wall_s"], cost["wall_s"]), "cpu_s": min(old["cpu_s"], cost["cpu_s"]),
                           "peak_mb": max(old["peak_mb"], cost["peak_mb"])}
    if {"vidstabdetect alone", "vid.stab, pass 2 + encode"} <= best.keys():
        first, second = best["vidstabdetect alone"], best["vid.stab, pass 2 + encode"]
        best["vid.stab, whole job"] = {k: first[k] + second[k] for k in ("wall_s", "cpu_s")} | {
            "peak_mb": max(first["peak_mb"], second["peak_mb"])}
    add_warp(best)
    return best


def add_warp(best):
    """CPU time of the warp alone: what is left of a job without its decodes, its analysis and its encode."""
    parts = {
        "vid.stab, warp alone": ("vidstabtransform alone", ["decode alone"]),
        "plumbline, warp alone": ("plumbline, whole job", ["plumbline, analysis alone", "ffmpeg transcode"])}
    for label, (whole, others) in parts.items():
        if {whole, *others} <= best.keys():
            cpu = best[whole]["cpu_s"] - sum(best[o]["cpu_s"] for o in others)
            best[label] = {"wall_s": float("nan"), "cpu_s": cpu, "peak_mb": float("nan")}


RATIOS = (  # ours, theirs, the bar for wall time (None: nothing asked)
    ("plumbline, whole job", "vid.stab, whole job", 0.45),
    ("plumbline, whole job", "ffmpeg transcode", 1.8),
    ("plumbline auto, whole job", "plumbline, whole job", 2.0),
    ("plumbline, analysis alone", "vidstabdetect alone", 0.4),
    ("plumbline, warp alone", "vid.stab, warp alone", 0.5))


def show(clip, best):
    print(f"\n{clip.name}\n{'':28}{'wall s':>9}{'CPU s':>9}{'peak MB':>9}{'x plain':>9}{'x vid.stab':>11}")
    reference = lambda label: best.get(label, {}).get("wall_s", float("nan"))
    for label, c in best.items():
        ratios = c["wall_s"] / reference("ffmpeg transcode"), c["wall_s"] / reference("vid.stab, whole job")
        print(f"{label:28}{c['wall_s']:9.2f}{c['cpu_s']:9.2f}{c['peak_mb']:9.0f}{ratios[0]:9.2f}{ratios[1]:11.2f}")
    for ours, theirs, bar in RATIOS:
        if ours in best and theirs in best:
            wall, cpu = (best[ours][k] / best[theirs][k] for k in ("wall_s", "cpu_s"))
            print(f"{ours} / {theirs}: wall {wall:.2f}, CPU {cpu:.2f} (bar: {bar})")
    if {"plumbline, whole job", "ffmpeg transcode"} <= best.keys():
        extra = best["plumbline, whole job"]["peak_mb"] - best["ffmpeg transcode"]["peak_mb"]
        print(f"memory above the plain transcode: {extra:+.0f} MB (bar: 120)")


def long_clip(a, clip):
    """Peak memory on the clip and on ten copies of it end to end."""
    longer = clip.with_name(f"{clip.stem}-x10.mp4")
    if not longer.exists():
        peers.run(["ffmpeg", "-nostdin", "-v", "error", "-y", "-stream_loop", 9, "-i", clip, "-c", "copy", longer])
    scratch = a.out / "scratch"
    peak = {c.name: methods(a, c, scratch)["plumbline, whole job"]()["peak_mb"] for c in (clip, longer)}
    short, long = peak[clip.name], peak[longer.name]
    print(f"\nmemory: {short:.0f} MB for {clip.name}, {long:.0f} MB for ten times that ({long / short:.2f} x; bar: 1.1)")
    return peak


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--plumbline", type=Path, help="the binary to measure")
    p.add_argument("--clip", type=Path, help="a real clip to scale to 1080p (the reference: nus-regular-1.m4v)")
    p.add_argument("--render", type=Path, help="the built render_clip example, for a clip of our own")
    p.add_argument("--out", type=Path, default=Path("out/speed"))
    p.add_argument("--rounds", type=int, default=3)
    p.add_argument("--threads", type=int, default=2)
    p.add_argument("--crf", default="20")
    p.add_argument("--preset", default="veryfast")
    p.add_argument("--long", action="store_true", help="also the memory of a clip ten times as long")
    a = p.parse_args()
    for field in ("plumbline", "clip", "render", "out"):
        if getattr(a, field):
            setattr(a, field, getattr(a, field).resolve())
    clips = prepare(a)
    if not clips:
        p.error("give --clip FILE, --render BIN, or both")
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} CPUs; the least of {a.rounds} rounds, {a.threads} threads")
    results = {}
    for clip in clips:
        results[clip.name] = measure(a, clip)
        show(clip, results[clip.name])
    if a.long and a.plumbline:
        results["long"] = long_clip(a, clips[0])
    peers.save(a.out / "speed.json", results)


if __name__ == "__main__":
    main()
