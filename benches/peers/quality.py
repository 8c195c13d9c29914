#!/usr/bin/env python3
"""Quality of `plumbline stabilize` and its peers on a folder of real clips.

    quality.py --eval DIR --out DIR [--media DIR] [--plumbline BIN] [--variant 1.0="--smoothness 1"]... [--peers]

Every (method, clip) is rendered at crf 10, measured with `stab_metrics.py --width 480 --samples 30` of the folder
given by --eval, and kept under OUT/results as JSON, keyed by the binary, its options and the clip: a second run
measures only what changed. Prints one table per method and the means over the clips that all methods share, writes
OUT/quality.json and OUT/frontier.png (mean shake over mean cropping, and the same clip by clip).

--media defaults to $PLUMBLINE_MEDIA/video. A clip `NAME.mp4` with a sibling `NAME.stable.mp4` (the ideal result, as
the clip generator renders it) gives a further row `truth`.
"""

import argparse
import json
import os
import shlex
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import peers

COLUMNS = {  # heading: key of the metrics program
    "crop": "cropping_ratio", "svd5": "distortion_svd_p5", "stab": "stability_avg", "shake": "shake_ratio",
    "rot": "shake_rot_ratio", "accel": "accel_ratio", "wobble": "wobble_hf_ratio", "itf": "itf_db",
    "black": "black_border_mean"}
L1_BOXES = ("0.96", "0.92", "0.80")


def methods(a):
    """Name → (what its result depends on besides the clip, how to render)."""
    table = {}
    if a.peers:
        settings = (peers.VIDSTAB_DETECT, peers.VIDSTAB_TRANSFORM, peers.CRF)
        table["vidstab-strong"] = (settings, lambda s, t: peers.vidstab(s, t, threads=1, nice=a.nice))
        program = a.eval / "l1_reference.py"
        for box in L1_BOXES:
            render = lambda s, t, box=box: peers.l1_reference(program, s, t, box, nice=a.nice)
            table[f"l1-{box}"] = ((program, box, peers.CRF), render)
    if a.plumbline:
        options = shlex.split(a.options)
        variants = {a.name: options}
        for variant in a.variant:
            label, _, more = variant.partition("=")
            variants[f"{a.name}@{label}"] = [*options, *shlex.split(more)]
        for name, extra in variants.items():
            table[name] = ((a.plumbline, extra), lambda s, t, extra=extra: plumbline(a, s, t, extra))
    return table


def plumbline(a, source, target, extra):
    command = [a.plumbline, "stabilize", source, "-o", target, "--crf", peers.CRF, "--threads", 1, "--overwrite",
               "--progress", "none", *extra]
    return peers.run(command, a.nice)


def measure(a, original, result):
    # The key of the metrics' own cache holds the original's path: one folder for all.
    out = subprocess.run(
        ["nice", "-n", str(a.nice), sys.executable, str(a.eval / "stab_metrics.py"), str(original), str(result),
         "--width", "480", "--samples", "30", "--cache", str(a.out / "originals")], capture_output=True, text=True)
    if out.returncode != 0:
        raise peers.Failed(f"stab_metrics on {result}: {out.stderr[-800:]}")
    return json.loads(out.stdout)


def one(a, name, depends, render, clip):
    """The metrics of one method on one clip, from the cache where nothing changed."""
    kept = a.out / "results" / name / f"{clip.stem}.json"
    key = peers.digest(*depends, clip)
    known = peers.load(kept)
    if known and known["key"] == key:
        return known
    target = a.out / "video" / name / f"{clip.stem}.mp4"
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        cost = render(clip, target)
        result = {"key": key, "method": name, "clip": clip.stem, "cost": cost, "metrics": measure(a, clip, target)}
    except peers.Failed as e:
        print(f"{name} on {clip.stem}: {e}", file=sys.stderr, flush=True)
        return None
    finally:
        if not a.keep:
            target.unlink(missing_ok=True)
    peers.save(kept, result)
    m = result["metrics"]
    print(f"{name} {clip.stem}: " + " ".join(f"{h} {m.get(k)}" for h, k in COLUMNS.items()), file=sys.stderr, flush=True)
    return result


def truth(a, clip):
    """The ideal result's own scores, where the clip has one beside it."""
    ideal = clip.with_name(f"{clip.stem}.stable{clip.suffix}")
    if not ideal.exists():
        return None
    kept = a.out / "results" / "truth" / f"{clip.stem}.json"
    key = peers.digest(clip, ideal)
    known = peers.load(kept)
    if not (known and known["key"] == key):
        known = {"key": key, "method": "truth", "clip": clip.stem, "cost": None, "metrics": measure(a, clip, ideal)}
        peers.save(kept, known)
    return known


def mean(rows, key):
    values = [r["metrics"][key] for r in rows if r["metrics"].get(key) is not None]
    return sum(values) / len(values) if values else float("nan")


def table(title, rows):
    """One line per (label, result rows): mean of every column, and the clips whose frame count differs."""
    print(f"\n{title}\n{'':24}" + "".join(f"{h:>8}" for h in COLUMNS) + "  frames off")
    for label, group in rows:
        off = [r["clip"] for r in group if not r["metrics"]["frames_equal"]]
        print(f"{label:24}" + "".join(f"{mean(group, k):8.3f}" for k in COLUMNS.values()) + f"  {', '.join(off) or '-'}")


def report(results):
    by_method = {}
    for r in results:
        by_method.setdefault(r["method"], []).append(r)
    for name, rows in by_method.items():
        table(name, [(r["clip"], [r]) for r in rows])
    common = set.intersection(*({r["clip"] for r in rows} for name, rows in by_method.items() if name != "truth"))
    shared = {n: [r for r in rows if r["clip"] in common] for n, rows in by_method.items()}
    table(f"mean over {len(common)} clips", [(n, rows) for n, rows in shared.items() if rows])
    worse = [f"{r['clip']} ({r['method']}, {r['metrics']['shake_ratio']})" for r in results
             if (r["metrics"].get("shake_ratio") or 0) > 1]
    print("\nshakier than the input:", ", ".join(worse) or "none")
    return {n: rows for n, rows in shared.items() if n != "truth"}


def frontier(shared, path):
    """Mean shake over mean cropping for every method, and one small panel per clip."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    families = {}
    for name, rows in shared.items():
        families.setdefault(name.split("@")[0].split("-0.")[0], []).extend(rows)
    clips = sorted({r["clip"] for rows in shared.values() for r in rows})
    n = len(clips)
    figure, axes = plt.subplots(2 + (n + 3) // 4, 4, figsize=(16, 7 + 2.6 * ((n + 3) // 4)), squeeze=False)
    grid = axes[0, 0].get_gridspec()
    for axis in axes[:2].flat:
        axis.remove()
    panels = [(figure.add_subplot(grid[:2, :]), f"mean over {n} clips", None)]
    panels += [(axes[2 + i // 4, i % 4], clip, clip) for i, clip in enumerate(clips)]
    for axis in axes[2:].flat[n:]:
        axis.remove()
    for axis, title, clip in panels:
        for family in families:
            names = [m for m in shared if m.split("@")[0].split("-0.")[0] == family]
            groups = [[r for r in shared[m] if clip in (None, r["clip"])] for m in names]
            xy = sorted((mean(g, "cropping_ratio"), mean(g, "shake_ratio")) for g in groups if g)
            axis.plot(*zip(*xy), "o-", label=family, markersize=4)
        axis.set(title=title, xlabel="cropping (1 = nothing lost)", ylabel="shake, result / input")
        axis.grid(alpha=0.3)
        axis.set_ylim(bottom=0)
    panels[0][0].legend()
    figure.tight_layout()
    figure.savefig(path, dpi=90)


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    media = os.environ.get("PLUMBLINE_MEDIA")
    p.add_argument("--media", type=Path, default=Path(media) / "video" if media else None, help="folder of clips")
    p.add_argument("--eval", type=Path, required=True, help="folder of stab_metrics.py and l1_reference.py")
    p.add_argument("--out", type=Path, default=Path("out/quality"), help="results and plot (default: %(default)s)")
    p.add_argument("--plumbline", type=Path, help="the binary to measure")
    p.add_argument("--name", default="plumbline", help="name of this variant in tables and cache")
    p.add_argument("--options", default="", help="further options of `plumbline stabilize`, one string")
    p.add_argument("--variant", action="append", default=[], metavar="LABEL=OPTIONS",
                   help="a further run with more options; all of them make the frontier")
    p.add_argument("--peers", action="store_true", help="vid.stab strong and the L1 reference too")
    p.add_argument("--clips", default="", help="only clips whose name contains one of these (comma-separated)")
    p.add_argument("--keep", action="store_true", help="keep the rendered videos under OUT/video")
    p.add_argument("--jobs", type=int, default=2)
    p.add_argument("--nice", type=int, default=0)
    a = p.parse_args()
    if a.media is None:
        p.error("give --media DIR or set PLUMBLINE_MEDIA")
    for field in ("media", "eval", "out", "plumbline"):
        if getattr(a, field):
            setattr(a, field, getattr(a, field).resolve())
    wanted = [w for w in a.clips.split(",") if w]
    clips = [c for c in peers.real_clips(a.media) if not wanted or any(w in c.stem for w in wanted)]
    jobs = [(name, *how, clip) for name, how in methods(a).items() for clip in clips]
    if not jobs:
        p.error("nothing to measure: give --plumbline BIN, --peers, or both, and a folder with clips")
    with ThreadPoolExecutor(a.jobs) as pool:
        results = [r for r in pool.map(lambda job: one(a, *job), jobs) if r]
        results += [r for r in pool.map(lambda clip: truth(a, clip), clips) if r]
    if not results:
        sys.exit("no result")
    shared = report(results)
    peers.save(a.out / "quality.json", results)
    frontier(shared, a.out / "frontier.png")
    print(f"\n{a.out / 'quality.json'}\n{a.out / 'frontier.png'}")


if __name__ == "__main__":
    main()
