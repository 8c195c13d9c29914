#!/usr/bin/env python3
"""Long runs: memory stays flat, temporary space and CPU time are linear, nothing is lost.

    tests/soak/run.py PROGRAM [--minutes 20] [--photos 1000] [--meshes 300] [--only clips|photos|meshes]

Prints a table and fails where a bound is broken. Standard library, ffmpeg and ffprobe only.
"""
import argparse
import json
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time

# What is measured is computed.
os.environ["PLUMBLINE_CACHE"] = ""

MEDIA = pathlib.Path(__file__).resolve().parents[2] / "media"
# A texture that moves as a hand would move it (see `shaky` in tests/it/support/clips.rs).
TEXTURE = ("nullsrc=s=440x300:r=25:d=0.04,geq=lum='random(1)*255':cb='128+60*sin(X/40)':cr='128+60*cos(Y/30)',"
           "gblur=sigma=3,lutyuv=y='clip((val-128)*8+128,16,235)',loop=loop=-1:size=1,setpts=N/25/TB,"
           "crop=w=320:h=180:x='60+40*sin(n/200)+6*sin(n*1.9)+5*sin(n*0.77)':y='60+5*sin(n*2.3)+6*cos(n*0.61)':exact=1")
# CPU time per frame may differ by so much between the halves of a pass: what else the machine runs shares its caches.
LINEAR = 0.25
TICKS = os.sysconf("SC_CLK_TCK")
FAULTS = []


def check(holds, what):
    print(f"{'ok  ' if holds else 'FAIL'} {what}", flush=True)
    if not holds:
        FAULTS.append(what)


def family(pid):
    """The process and all that it started."""
    found, queue = [], [pid]
    while queue:
        p = queue.pop()
        found.append(p)
        try:
            for task in os.listdir(f"/proc/{p}/task"):
                queue += map(int, pathlib.Path(f"/proc/{p}/task/{task}/children").read_text().split())
        except OSError:
            pass
    return found


def cpu(pid):
    """Seconds of processor time of a process, with the children that it has waited for."""
    # The name of the program, in parentheses, may hold spaces: the fields after it count.
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / TICKS


def usage(pid, folder):
    """Resident memory, MB, bytes of temporary files, and seconds of processor time of a process and its children."""
    memory, space, seconds = 0, 0, 0
    for p in family(pid):
        try:
            seconds += cpu(p)
            text = pathlib.Path(f"/proc/{p}/status").read_text()
            memory += next((int(line.split()[1]) for line in text.splitlines() if line.startswith("VmRSS")), 0)
            for fd in os.scandir(f"/proc/{p}/fd"):
                target = os.readlink(fd.path)
                if target.startswith(folder):
                    space += os.stat(fd.path).st_size
        except OSError:
            pass
    return memory / 1024, space, seconds


def watched(command, folder, temporary):
    """Runs it; a sample of (seconds, pass, frames, items, MB, temporary bytes, CPU seconds) five times a second, exit status and messages."""
    env = dict(os.environ, TMPDIR=temporary, NO_COLOR="1")
    child = subprocess.Popen([*command, "--progress", "json"], cwd=folder, env=env, stdout=subprocess.DEVNULL,
                             stderr=subprocess.PIPE, text=True)
    state, lines, samples = {"pass": 0, "done": 0, "items": 0}, [], []

    def listen():
        for line in child.stderr:
            lines.append(line)
            try:
                event = json.loads(line)
            except ValueError:
                continue
            if event.get("ev") == "task.progress":
                state.update({"pass": event["pass"], "done": event["done"]})
            elif event.get("ev") in ("task.done", "task.fail"):
                state["items"] += 1

    thread = threading.Thread(target=listen)
    thread.start()
    start = time.monotonic()
    while child.poll() is None:
        measured = usage(child.pid, temporary)
        samples.append((time.monotonic() - start, state["pass"], state["done"], state["items"], *measured))
        time.sleep(0.2)
    thread.join()
    return samples, child.returncode, lines


def flat(samples, name):
    """Memory of the second half within a tenth of the first, each by its largest sample."""
    if len(samples) < 8:
        check(False, f"{name}: too few samples ({len(samples)})")
        return
    half = len(samples) // 2
    first, second = (max(s[4] for s in part) for part in (samples[:half], samples[half:]))
    check(second <= 1.1 * first, f"{name}: memory {first:.0f} MB, then {second:.0f} MB")


def linear(samples, name):
    """CPU time per frame of the second half as of the first: wall time would judge what else the machine does."""
    middle = min(samples, key=lambda s: abs(s[2] - (samples[0][2] + samples[-1][2]) / 2))
    halves = [(samples[0], middle), (middle, samples[-1])]
    if any(a[2] >= b[2] for a, b in halves):
        check(False, f"{name}: too few frames between {len(samples)} samples")
        return
    first, second = (1000 * (b[6] - a[6]) / (b[2] - a[2]) for a, b in halves)
    check(abs(second - first) <= LINEAR * first, f"{name}: {first:.2f}, then {second:.2f} ms of CPU time per frame")


def times(path):
    entries = ["-select_streams", "v:0", "-show_entries", "packet=pts_time", "-of", "csv=p=0"]
    text = subprocess.run(["ffprobe", "-v", "error", *entries, path], check=True, capture_output=True, text=True).stdout
    return sorted(float(line.strip(",")) for line in text.split())


def clips(program, folder, minutes):
    frames = int(minutes * 60 * 25)
    clip = folder / "long.mp4"
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-f", "lavfi", "-i", TEXTURE, "-frames:v", str(frames), "-c:v", "libx264",
                    "-preset", "ultrafast", "-pix_fmt", "yuv420p", clip], check=True)
    for mode in ("mesh", "auto"):
        temporary = tempfile.mkdtemp(dir=folder)
        command = [program, "stabilize", "long.mp4", "-o", f"{mode}.mp4", "--mode", mode, "--preset", "ultrafast"]
        samples, status, lines = watched(command, folder, temporary)
        check(status == 0, f"{mode}: exit status {status} {''.join(lines[-3:]) if status else ''}")
        for number in sorted({s[1] for s in samples if s[1]}):
            # While frames stream: what is solved at the end of a pass has its own line.
            part = [s for s in samples if s[1] == number and min(3 * 60 * 25, frames // 3) < s[2] < 0.99 * frames]
            if len(part) >= 8:
                flat(part, f"{mode}, pass {number}")
                linear(part, f"{mode}, pass {number}")
                print(f"     {len(part)} samples, {part[0][4]:.0f} MB at frame {part[0][2]}, {part[-1][4]:.0f} MB at {part[-1][2]}")
        analysis = [s for s in samples if s[1] == 1 and s[2] > frames // 10]
        if analysis:
            middle = min(analysis, key=lambda s: abs(s[2] - analysis[-1][2] / 2))
            per = [s[5] / max(s[2], 1) * 25 / 1000 for s in (middle, analysis[-1])]
            check(abs(per[1] - per[0]) <= 0.15 * max(per[0], 1e-9), f"{mode}: temporary space {per[0]:.1f}, then {per[1]:.1f} kB/s")
        print(f"     {mode}: at most {max(s[4] for s in samples):.0f} MB")
        before, after = times(clip), times(folder / f"{mode}.mp4")
        check(len(before) == len(after) == frames, f"{mode}: {len(after)} of {frames} frames")
        worst = max((abs(a - b) for a, b in zip(before, after)), default=9e9)
        check(worst < 1e-4, f"{mode}: times off by {worst:.6f} s at most")
        check(not os.listdir(temporary), f"{mode}: temporary folder empty at the end")


def broken(data, suffix, rng):
    how = rng.randrange(3)
    # The beginning of an OBJ file can be a mesh.
    if how == 0 and suffix != ".obj":
        return data[: rng.randrange(1, max(2, len(data) // 4))]
    return b"" if how < 2 else bytes(rng.randrange(256) for _ in range(2000))


def batch(name, program, folder, sources, count, command):
    """`count` files, one of twenty broken: each broken one reported, the others done, memory flat."""
    rng = random.Random(7)
    inputs = folder / "in"
    inputs.mkdir()
    bad = set()
    for i in range(count):
        data = sources[i % len(sources)].read_bytes()
        target = f"{i:04}{sources[i % len(sources)].suffix}"
        if i % 20 == 7:
            bad.add(target)
            data = broken(data, sources[i % len(sources)].suffix, rng)
        (inputs / target).write_bytes(data)
    samples, status, lines = watched([program, *command], folder, str(folder))
    failed = {os.path.basename(e["task"]) for e in map(json.loads, (l for l in lines if l.startswith("{"))) if e["ev"] == "task.fail"}
    done = sum(not path.name.startswith(".") for path in (folder / "out").iterdir())
    check(status == 3, f"{name}: exit status {status} {''.join(lines[-2:]) if status != 3 else ''}")
    check(failed == bad, f"{name}: {len(failed)} of {len(bad)} broken files reported; {sorted(failed ^ bad)[:5]}")
    check(done == count - len(bad), f"{name}: {done} of {count - len(bad)} results")
    flat([s for s in samples if s[3] > count // 10], name)


def photos(program, folder, count):
    sources = []
    for i, photo in enumerate(sorted(MEDIA.glob("*.jpg"))):
        small = folder / f"source{i}.jpg"
        subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", photo, "-vf", "scale=480:-2", small], check=True)
        sources.append(small)
    batch("photos", program, folder, sources, count, ["retarget", "in", "--size", "1:1", "--out-dir", "out"])


def meshes(program, folder, count):
    sources = [MEDIA / name for name in ("mesh-bar.ply", "mesh-hourglass.stl", "mesh-polygons.obj")]
    batch("meshes", program, folder, sources, count, ["render", "in", "--out-dir", "out", "--size", "200x200"])


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--minutes", type=float, default=20)
    parser.add_argument("--photos", type=int, default=1000)
    parser.add_argument("--meshes", type=int, default=300)
    parser.add_argument("--only", choices=["clips", "photos", "meshes"])
    args = parser.parse_args()
    program = os.path.abspath(args.program)
    jobs = {"clips": (clips, args.minutes), "photos": (photos, args.photos), "meshes": (meshes, args.meshes)}
    for name, (job, amount) in jobs.items():
        if args.only in (None, name):
            folder = pathlib.Path(tempfile.mkdtemp(prefix=f"soak-{name}-"))
            job(program, folder, amount)
            shutil.rmtree(folder)
    sys.exit(bool(FAULTS))


if __name__ == "__main__":
    main()
