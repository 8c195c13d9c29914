"""What the measuring scripts share: running a command with its costs, the peers' command lines, a result cache."""

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# What is measured is computed.
os.environ["PLUMBLINE_CACHE"] = ""

# Made from other clips of the folder, so that they would count twice in a mean.
DERIVED = {"campus-vertical-rotflag", "forest-vfr-audio", "nus0-hlg10"}
VIDEO_SUFFIXES = {".mp4", ".m4v", ".avi", ".mkv", ".mov", ".webm"}
# Encoder noise counts as wobble: at crf 20, an unstabilized copy already scores a wobble ratio of 1.2.
CRF = "10"
VIDSTAB_DETECT = "vidstabdetect=shakiness=10"
VIDSTAB_TRANSFORM = "vidstabtransform=smoothing=30:interpol=bicubic"


class Failed(Exception):
    """A command ended with an error; the message holds the end of what it wrote."""


def run(command, nice=0, stdout=None, cwd=None, env=None):
    """Runs `command` to its end; wall and CPU seconds and peak memory (MB) of the whole process tree it waited for."""
    with tempfile.TemporaryFile() as err:
        began = time.perf_counter()
        process = subprocess.Popen(
            [str(c) for c in command], stdin=subprocess.DEVNULL, stdout=stdout or subprocess.DEVNULL, stderr=err,
            cwd=cwd, env=env, preexec_fn=(lambda: os.nice(nice)) if nice else None)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - began
        process.returncode = os.waitstatus_to_exitcode(status)
        if process.returncode != 0:
            err.seek(0)
            tail = err.read().decode(errors="replace")[-1500:]
            raise Failed(f"exit {process.returncode}: {' '.join(map(str, command))}\n{tail}")
    return {"wall_s": wall, "cpu_s": usage.ru_utime + usage.ru_stime, "peak_mb": usage.ru_maxrss / 1024}


def ffprobe(path):
    """Width, height, frame rate and the number of frames (counted by packets) of the first video stream."""
    out = subprocess.run(
        ["ffprobe", "-v", "error", "-select_streams", "v:0", "-count_packets", "-of", "json", "-show_entries",
         "stream=width,height,avg_frame_rate,nb_read_packets", str(path)], capture_output=True, text=True, check=True)
    s = json.loads(out.stdout)["streams"][0]
    num, den = map(int, s["avg_frame_rate"].split("/"))
    return {"width": s["width"], "height": s["height"], "fps": num / max(den, 1), "frames": int(s["nb_read_packets"])}


def real_clips(folder, least_frames=150):
    """Clips of a folder, without derived copies and without those too short to measure; sorted by name."""
    found = [p for p in sorted(Path(folder).iterdir()) if p.suffix in VIDEO_SUFFIXES]
    found = [p for p in found if p.stem not in DERIVED and not p.stem.endswith(".stable")]
    return [p for p in found if ffprobe(p)["frames"] >= least_frames]


def x264(crf=CRF, preset="veryfast", threads=2):
    """Encoder arguments, the same for everybody who is compared."""
    return ["-c:v", "libx264", "-preset", preset, "-crf", str(crf), "-threads", str(threads)]


def vidstab(source, target, crf=CRF, threads=2, nice=0):
    """vid.stab, both passes, strong settings; costs per pass."""
    with tempfile.TemporaryDirectory() as folder:
        base = ["ffmpeg", "-nostdin", "-v", "error", "-y", "-threads", threads, "-i", Path(source).resolve()]
        detect = run([*base, "-filter_threads", threads, "-vf", f"{VIDSTAB_DETECT}:result=t.trf", "-f", "null", "-"],
                     nice, cwd=folder)
        transform = run([*base, "-filter_threads", threads, "-vf", f"{VIDSTAB_TRANSFORM}:input=t.trf",
                         *x264(crf, threads=threads), "-pix_fmt", "yuv420p", "-fps_mode", "passthrough", "-an",
                         Path(target).resolve()], nice, cwd=folder)
    return {"detect": detect, "transform": transform}


def l1_reference(program, source, target, box, nice=0):
    """The plain L1-optimal similarity stabilizer, encoded as finely as everybody else."""
    text = Path(program).read_text()
    finer = text.replace("'-crf', '14'", f"'-crf', '{CRF}'")
    if finer == text:
        raise Failed(f"{program}: its encoder setting '-crf 14' was not found")
    with tempfile.TemporaryDirectory() as folder:
        script = Path(folder) / "l1_reference.py"
        script.write_text(finer)
        run([sys.executable, script, source, target, box], nice)


def digest(*parts):
    """Short hash of strings, numbers and the contents of paths: the key under which a result is kept."""
    h = hashlib.sha1()
    for part in parts:
        h.update(Path(part).read_bytes() if isinstance(part, Path) else repr(part).encode())
        h.update(b"\0")
    return h.hexdigest()[:16]


def load(path):
    """JSON of a file, `None` where there is none."""
    return json.loads(path.read_text()) if path.exists() else None


def save(path, value):
    """Writes JSON beside the target first, so that an interruption leaves no half a file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_suffix(f".{os.getpid()}.partial")
    partial.write_text(json.dumps(value, indent=1))
    partial.replace(path)
