#!/usr/bin/env python3
"""Oracle: the page of `--report` in a real browser, with the network off. Exits 1 on failure, 77 where there is no browser.

A clip with a cut and a name full of markup is stabilized with `--report`. Python's XML parser reads the page; Chromium then
opens it at the width of a phone, a tablet and a desk, in light and in dark: nothing is asked of any host, nothing is complained
of, every picture is there, every plot has room and its labels lie inside the page, nothing reaches over the edge, and texts
stand out from what is behind them. Colors of the pictures are held against FFmpeg's conversion of the same frames.

PLUMBLINE_BIN names the command. `tests/oracle/report.py SCREENSHOTS FILE.html...` looks at pages that are there and leaves
screenshots in a folder.
"""
import base64
import os
import re
import shutil
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import cv2
import numpy as np

SKIPPED = 77
BROWSERS = ["chromium-headless-shell", "chromium", "chromium-browser", "google-chrome"]
WIDTHS = [390, 800, 1280]
NAME = "<b>&\" it's.mp4"

# Contrast of text as WCAG 2.2 asks of it (1.4.3).
CONTRAST = 4.5

# What a page must hold, in a browser: run inside it, gives back what is wrong.
LOOK = """() => {
  const wrong = [], room = document.documentElement.clientWidth;
  if (document.documentElement.scrollWidth > room)
    wrong.push(`the page is ${document.documentElement.scrollWidth} px wide, the window ${room}`);
  for (const image of document.images)
    if (!image.complete || !image.naturalWidth || !image.alt) wrong.push(`a picture is not there: ${image.alt}`);
  for (const svg of document.querySelectorAll('figure > svg')) {
    const box = svg.getBoundingClientRect();
    if (!(box.width > 0 && box.height > 0)) wrong.push('a plot without room');
  }
  for (const text of document.querySelectorAll('svg text, td, th, dd, li, h1, h2, h3, p, figcaption')) {
    const box = text.getBoundingClientRect();
    if (text.textContent && (box.left < -0.5 || box.right > room + 0.5))
      wrong.push(`reaches over the edge: ${text.textContent.slice(0, 60)} (${box.left} to ${box.right} of ${room})`);
  }
  for (const plot of document.querySelectorAll('figure.plot > svg')) {
    const labels = [...plot.querySelectorAll('text.x')].map(t => t.getBoundingClientRect());
    for (let i = 1; i < labels.length; i++)
      if (labels[i].left < labels[i - 1].right) wrong.push('labels of a plot overlap');
  }
  if (!document.querySelector('figure > svg path')?.getTotalLength()) wrong.push('the first plot has no curve');
  const luminance = rgb => rgb.map(v => v / 255).map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4)
    .reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);
  const numbers = color => color.match(/[0-9.]+/g).map(Number);
  const behind = element => {
    for (let e = element; e; e = e.parentElement) {
      const color = numbers(getComputedStyle(e).backgroundColor);
      if (color.length < 4 || color[3] > 0) return color.slice(0, 3);
    }
    return [255, 255, 255];
  };
  const contrast = (a, b) => {
    const [x, y] = [luminance(a), luminance(b)].sort((p, q) => q - p);
    return (x + 0.05) / (y + 0.05);
  };
  const texts = 'p, dt, dd, th, td, li, h1, h2, h3, h3 span, figcaption, caption, svg text';
  for (const element of document.querySelectorAll(texts)) {
    const style = getComputedStyle(element), on = element.closest('svg.mode');
    const back = on ? numbers(getComputedStyle(on.querySelector('rect')).fill) : behind(element);
    const front = numbers(element instanceof SVGElement ? style.fill : style.color).slice(0, 3);
    if (element.textContent && contrast(front, back) < %s)
      wrong.push(`${element.textContent.slice(0, 40)}: contrast ${contrast(front, back).toFixed(2)}`);
  }
  return wrong;
}""" % CONTRAST


def browser():
    return next(filter(None, map(shutil.which, BROWSERS)), None)


def ffmpeg(*args):
    return subprocess.run(["ffmpeg", "-v", "error", "-y", *map(str, args)], check=True, capture_output=True).stdout


def shaky_clip(path):
    """Two shots of 30 shaky frames, 10 bit, shown turned by a quarter. Colors tell the matrix; RGB holds all of them."""
    texture = ("nullsrc=s=460x320:r=25:d=0.04,format=yuv420p,"
               "geq=lum='random(1)*255':cb='128+35*sin(X/{0})':cr='128+35*cos(Y/{1})',gblur=sigma=3,"
               "lutyuv=y='clip((val-128)*8+128,70,190)',loop=loop=-1:size=1,setpts=N/25/TB,"
               "crop=w=320:h=180:x='70+n*0.6+6*sin(n*1.9)+5*sin(n*0.77)':y='70+5*sin(n*2.3)+6*cos(n*0.61)':exact=1,"
               "trim=end_frame=30")
    join = f"{texture.format(40, 30)}[a];{texture.format(17, 55)}[b];[a][b]concat=n=2:v=1,format=yuv420p10le"
    plain = path.with_name("plain.mp4")
    ffmpeg("-filter_complex", join, "-c:v", "libx264", "-crf", 10, "-preset", "ultrafast", "-colorspace", "bt709", plain)
    try:
        ffmpeg("-display_rotation", 90, "-i", plain, "-c", "copy", path)
    except subprocess.CalledProcessError:  # before FFmpeg 6
        ffmpeg("-i", plain, "-c", "copy", "-metadata:s:v:0", "rotate=90", path)


def pixels(data):
    """Red, green and blue of a picture, as OpenCV decodes it."""
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1].astype(float)


def check_colors(page, clip):
    """The originals on the page are the frames of the clip, turned, in the colors of FFmpeg."""
    faults = []
    original = r'alt="Frame (\d+) of the original" width="(\d+)" height="(\d+)" src="data:image/jpeg;base64,([^"]+)"'
    found = re.findall(original, page)
    for frame, width, height, data in found:
        size = int(width), int(height)
        # FFmpeg turns the frames by itself.
        scale = f"select=eq(n\\,{frame}),scale={width}:{height}:flags=area+accurate_rnd+full_chroma_int:in_color_matrix=bt709"
        raw = ffmpeg("-i", clip, "-vf", scale, "-frames:v", 1, "-f", "rawvideo", "-pix_fmt", "rgb24", "-")
        wanted = np.frombuffer(raw, np.uint8).reshape(size[1], size[0], 3).astype(float)
        drawn = pixels(base64.b64decode(data))
        off, bias = np.abs(drawn - wanted).mean(), np.abs((drawn - wanted).mean(axis=(0, 1))).max()
        # JPEG with halved chroma costs a few code values of noise, and no color of the whole.
        if not (off < 8 and bias < 1):
            faults.append(f"frame {frame}: {off:.2f} off, {bias:.2f} in the mean")
    return faults if found else ["no pictures"]


def check_text(page):
    """What can be told without a browser."""
    body = ElementTree.fromstring(page.replace("<!DOCTYPE html>\n", "", 1))
    faults = [f"{e.tag} leads out" for e in body.iter() for k in ("src", "href") if not e.get(k, "data:").startswith("data:")]
    faults += [f"<{tag}> is not there" for tag in ("title", "h1", "main", "table", "caption", "figure", "figcaption")
               if body.find(f".//{tag}") is None]
    if "://" in page or list(body.iter("script")):
        faults.append("the page names a host or has a script")
    return faults


def look(playwright, html, shots):
    """Opens a page at every width in both schemes; what is wrong with it."""
    faults = []
    engine = playwright.chromium.launch(executable_path=browser(), args=["--no-sandbox"])
    for width in WIDTHS:
        for scheme in ("light", "dark"):
            context = engine.new_context(viewport={"width": width, "height": 844}, color_scheme=scheme, offline=True)
            page = context.new_page()
            page.on("console", lambda m: faults.append(f"console: {m.text}"))
            page.on("pageerror", lambda e: faults.append(f"error: {e}"))
            page.on("request", lambda r: r.url.startswith(("file:", "data:")) or faults.append(f"asks for {r.url}"))
            page.goto(html.as_uri())
            faults += [f"{width} px, {scheme}: {fault}" for fault in page.evaluate(LOOK)]
            if shots:
                page.screenshot(path=shots / f"{html.stem}-{width}-{scheme}.png", full_page=True)
            context.close()
    engine.close()
    return faults


def made(folder):
    """A page made here, with a clip of a terrible name."""
    clip, page = folder / NAME, folder / "page.html"
    shaky_clip(clip)
    command = os.environ.get("PLUMBLINE_BIN", "target/release/plumbline")
    subprocess.run([command, "stabilize", clip, "-o", folder / "out.mp4", "--report", page, "--progress", "none"], check=True)
    return clip, page


def main():
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        sync_playwright = None
    if not (sync_playwright and browser()):
        print(f"skipped: no browser ({', '.join(BROWSERS)}) or no Playwright")
        return SKIPPED
    faults, shots = [], None
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        if len(sys.argv) > 2:
            shots, pages = Path(sys.argv[1]), [Path(p).resolve() for p in sys.argv[2:]]
        else:
            clip, page = made(Path(folder))
            pages = [page]
            faults += check_colors(page.read_text(), clip)
        for page in pages:
            text = page.read_text()
            faults += [f"{page.name}: {fault}" for fault in check_text(text) + look(playwright, page, shots)]
            print(f"{page.name}: {len(text) / 1e3:.0f} kB, {text.count('<img ')} pictures, {text.count('<svg class=')} plots")
    for fault in faults:
        print(fault)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
