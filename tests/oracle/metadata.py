#!/usr/bin/env python3
"""Pictures that this project writes, read by Pillow: XMP, IPTC, EXIF, color profiles, gain maps; CMYK against LittleCMS."""
import io
import os
import pathlib
import re
import struct
import subprocess
import sys
import tempfile

import numpy as np
from PIL import Image, ImageCms, IptcImagePlugin

PROGRAM = os.path.abspath(os.environ.get("PLUMBLINE_BIN", "target/debug/plumbline"))
CAPTION = b"A caption, \xc3\xa4"
XMP = b"""<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description xmlns:tiff="http://ns.adobe.com/tiff/1.0/" xmlns:exif="http://ns.adobe.com/exif/1.0/"
 xmlns:xmp="http://ns.adobe.com/xap/1.0/" xmp:Rating="4" tiff:Orientation="6" exif:PixelXDimension="96"
 exif:PixelYDimension="64"/></rdf:RDF></x:xmpmeta>"""
HDRGM = b"""<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0" hdrgm:GainMapMax="2.5"/>
</rdf:RDF></x:xmpmeta>"""


def resized(source, out, size):
    """Reads, resizes and writes with the program; what it said."""
    text = f"""version = 1
[stage.load]
use = "image.load"
path = "{source}"
[stage.render]
use = "image.render"
inputs = ["load"]
size = "{size[0]}x{size[1]}"
[stage.save]
use = "image.save"
inputs = ["render"]
path = "{out}"
"""
    file = pathlib.Path(out).with_suffix(".toml")
    file.write_text(text)
    ran = subprocess.run([PROGRAM, "run", str(file), "--overwrite"], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return ran.stderr


def gradient(width, height):
    y, x = np.mgrid[:height, :width]
    return Image.fromarray(np.dstack([x * 255 // width, y * 255 // height, 0 * x + 90]).astype(np.uint8))


def photograph(path):
    """A JPEG file with everything, stored on its side."""
    exif = Image.Exif()
    exif[0x0112], exif[0x010F] = 6, "Maker"
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    out = io.BytesIO()
    gradient(96, 64).save(out, "JPEG", quality=95, exif=exif, icc_profile=profile, xmp=XMP)
    iim = b"\x1c\x02\x78" + struct.pack(">H", len(CAPTION)) + CAPTION
    resource = b"Photoshop 3.0\0" + b"8BIM\x04\x04\0\0" + struct.pack(">I", len(iim)) + iim + b"\0" * (len(iim) % 2)
    segment = b"\xff\xed" + struct.pack(">H", len(resource) + 2) + resource
    path.write_bytes(out.getvalue()[:2] + segment + out.getvalue()[2:])
    return profile


def check_metadata(folder):
    source = folder / "source.jpg"
    profile = photograph(source)
    for extension in ["jpg", "png", "tif", "webp"]:
        out = folder / f"out.{extension}"
        said = resized(source, out, (32, 48))
        image = Image.open(out)
        image.load()
        assert image.size == (32, 48), image.size
        assert image.info["icc_profile"] == profile, "the profile is kept to the byte"
        assert image.getexif().get(0x0112) == 1 and image.getexif().get(0x010F) == "Maker"
        packet = image.info.get("xmp") or image.info["XML:com.adobe.xmp"].encode()
        found = {name: re.search(name + rb'="(\d+)"', packet)[1] for name in
                 [b"Orientation", b"PixelXDimension", b"PixelYDimension", b"Rating"]}
        assert list(found.values()) == [b"1", b"32", b"48", b"4"], found
        if extension in ["jpg", "tif"]:
            assert IptcImagePlugin.getiptcinfo(image)[(2, 120)] == CAPTION
        elif extension == "png":
            name, length, digits = image.text["Raw profile type iptc"].strip().split("\n", 2)
            raw = bytes.fromhex(digits.replace("\n", ""))
            assert name == "iptc" and int(length) == len(raw) and raw.startswith(b"8BIM\x04\x04") and CAPTION in raw
        else:
            assert "IPTC" in said, said
        print(f"metadata in {extension}: as written")


def check_gain_map(folder):
    source, out = folder / "hdr.jpg", folder / "hdr-out.jpg"
    gain = gradient(24, 16).convert("L")
    gain.encoderinfo = {"xmp": HDRGM}
    gradient(96, 64).save(source, "MPO", save_all=True, append_images=[gain], quality=95)
    if b"hdr-gain-map" not in source.read_bytes():
        print("gain map: this Pillow writes no XMP into a second picture; not checked")
        return
    said = resized(source, out, (48, 32))
    assert "gain map" not in said, said
    image = Image.open(out)
    # Pillow opens Ultra HDR as its first picture alone; the list of pictures is read by it.
    pictures = image._getmp()
    assert pictures[0xB001] == 2 and [p["DataOffset"] == 0 for p in pictures[0xB002]] == [True, False], pictures
    assert b"Container:Directory" in image.info["xmp"]
    second = pictures[0xB002][1]
    at = image.info["mpoffset"] + second["DataOffset"]
    whole = out.read_bytes()
    assert at + second["Size"] == len(whole) and at == pictures[0xB002][0]["Size"], pictures
    image = Image.open(io.BytesIO(whole[at:]))
    assert image.size == (12, 8) and b"GainMapMax" in image.info["xmp"], image.size
    off = np.abs(np.asarray(image.convert("L"), float) - np.asarray(gain.resize((12, 8), Image.Resampling.BOX), float))
    assert off.max() <= 4, off.max()
    print(f"gain map: at its place, off by at most {off.max():.1f} gray levels")


def profile_of_inks(points=9):
    """A smooth profile of the output class from CMYK to Lab."""
    c, m, y, k = np.meshgrid(*4 * [np.linspace(0, 1, points)], indexing="ij")
    light = (1 - 0.45 * c) * (1 - 0.5 * m) * (1 - 0.1 * y) * (1 - k)
    lab = np.stack([255 * light, 128 + (60 * m - 25 * c) * (1 - k), 128 + (70 * y - 45 * c) * (1 - k)], -1)
    table = np.clip(np.round(lab), 0, 255).astype(np.uint8).tobytes()
    identity = struct.pack(">9i", *[65536 * (i % 4 == 0) for i in range(9)])
    lut = b"mft1\0\0\0\0" + bytes([4, 3, points, 0]) + identity + 4 * bytes(range(256)) + table + 3 * bytes(range(256))
    white = struct.pack(">3i", 63190, 65536, 54061)
    tags = [(b"desc", b"desc\0\0\0\0" + struct.pack(">I", 5) + b"test\0" + bytes(78)), (b"wtpt", b"XYZ \0\0\0\0" + white),
            (b"cprt", b"text\0\0\0\0free\0"), (b"A2B0", lut)]
    index, body = struct.pack(">I", len(tags)), b""
    for name, content in tags:
        content += bytes(-len(content) % 4)
        index += name + struct.pack(">II", 132 + 12 * len(tags) + len(body), len(content))
        body += content
    head = struct.pack(">I", 128 + len(index) + len(body)) + bytes(4) + b"\x02\x40\0\0prtrCMYKLab "
    head = head.ljust(36, b"\0") + b"acsp"
    return (head.ljust(68, b"\0") + white).ljust(128, b"\0") + index + body


def check_inks(folder):
    source, out = folder / "inks.jpg", folder / "inks-out.png"
    profile = profile_of_inks()
    y, x = np.mgrid[:64, :96]
    inks = np.dstack([x * 2.5, y * 3, (x + y) * 1.2, 60 + 60 * np.sin(x / 20)]).astype(np.uint8)
    Image.fromarray(inks, "CMYK").save(source, "JPEG", quality=100, subsampling=0, icc_profile=profile)
    said = resized(source, out, (96, 64))
    assert "color management" not in said, said
    transform = ImageCms.buildTransform(ImageCms.ImageCmsProfile(io.BytesIO(profile)), ImageCms.createProfile("sRGB"),
                                        "CMYK", "RGB", renderingIntent=ImageCms.Intent.PERCEPTUAL)
    wanted = ImageCms.applyTransform(Image.open(source), transform)
    off = np.abs(np.asarray(Image.open(out), float) - np.asarray(wanted, float))
    print(f"CMYK: off LittleCMS by {off.mean():.2f} in the mean, {off.max():.0f} at most")
    assert off.mean() <= 1.0 and off.max() <= 8, (off.mean(), off.max())


def check_floats(folder):
    source, out = folder / "float.tif", folder / "float-out.png"
    values = np.linspace(-0.1, 1.2, 96 * 64, dtype=np.float32).reshape(64, 96)
    Image.fromarray(values, "F").save(source)
    said = resized(source, out, (96, 64))
    found = np.asarray(Image.open(out), float) / 65535
    off = np.abs(found - np.clip(values, 0, 1)).max()
    assert off < 1e-5 and "brighter than white" in said, (off, said)
    print(f"float TIFF: off by {off:.1e} at most")


def main():
    with tempfile.TemporaryDirectory() as folder:
        for check in [check_metadata, check_gain_map, check_inks, check_floats]:
            check(pathlib.Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
