#!/usr/bin/env python3
"""Faces found in portraits and groups, and in pictures without faces, against marks by hand.

    faces.py --programs target/release/examples/programs --media DIR [--more DIR] [--out DIR] [--min-size FRACTION]

`faces.json` lists the pictures and their faces: boxes from the middle of the forehead to the chin and from ear to ear, px of a picture
of the stated width; a face has an eye in sight and is a fortieth of the longer side high. --media is the media folder, whose
`photo` holds `portrait`, `retarget`, `misc` and `fisheye`. --more holds pictures of Python packages, each in a folder of its package's
name: `data/images/t1.jpg` of insightface 2.1, `data/astronaut.png` of scikit-image as skimage/data, and tests/test_images/* of the
source of face_recognition 1.3.0. Pictures that are not there are named and left out.

A face is found if the center of a box lies in its mark and their areas are within a factor of 3; a box that finds no face is false.
With --min-size a smaller face counts neither as one to be found nor, where it is found, as false.
--out gets each picture with the marks (yellow) and the boxes (green, with their scores).
"""

import argparse
import json
import subprocess
from pathlib import Path

import cv2

MARKS = Path(__file__).with_suffix(".json")
SHOWN = 1200  # width of a picture in --out, px


def finds(box, mark):
    (x, y, w, h, _), (mx, my, mw, mh) = box, mark
    inside = mx <= x + w / 2 <= mx + mw and my <= y + h / 2 <= my + mh
    return inside and 1 / 3 <= w * h / (mw * mh) <= 3


def draw(picture, boxes, marks, path):
    s = SHOWN / picture.shape[1]
    small = cv2.resize(picture, None, fx=s, fy=s, interpolation=cv2.INTER_AREA if s < 1 else cv2.INTER_LINEAR)
    for row, color in [(m, (0, 255, 255)) for m in marks] + [(b, (0, 255, 0)) for b in boxes]:
        x, y, w, h = (round(s * c) for c in row[:4])
        cv2.rectangle(small, (x, y), (x + w, y + h), color, 2)
    for x, y, _, _, score in boxes:
        cv2.putText(small, f"{score:.2f}", (round(s * x), round(s * y) - 4), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0, 255, 0), 2)
    cv2.imwrite(str(path), small)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--programs", type=Path, required=True)
    parser.add_argument("--media", type=Path, required=True)
    parser.add_argument("--more", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--min-size", type=float, default=1 / 40, help="smallest face looked for, as a fraction of the longer side")
    a = parser.parse_args()
    folders = [a.media / "photo", *([a.more] if a.more else [])]
    total = {"faces": 0, "found": 0, "false": 0, "pictures": 0, "seconds": 0.0}
    print(f"{'picture':42} faces found false  seconds")
    for name, entry in json.loads(MARKS.read_text()).items():
        path = next((f / name for f in folders if (f / name).exists()), None)
        if path is None:
            print(f"{name:42} is not there")
            continue
        answer = subprocess.run([a.programs, "faces_of_image", str(a.min_size), path], check=True, capture_output=True, text=True).stdout
        answer = json.loads(answer)
        picture = cv2.imread(str(path))
        scale = picture.shape[1] / entry["width"] if entry["faces"] else 1.0
        marks = [[scale * c for c in mark] for mark in entry["faces"]]
        # Each box finds one face at most: surest boxes first.
        is_small = lambda mark: mark[3] < a.min_size * max(picture.shape[:2])
        small, left, false = [m for m in marks if is_small(m)], [m for m in marks if not is_small(m)], 0
        for box in answer["faces"]:
            mark = next((m for m in left if finds(box, m)), None)
            false += mark is None and not any(finds(box, m) for m in small)
            if mark is not None:
                left.remove(mark)
        row = {"faces": len(marks) - len(small), "found": len(marks) - len(small) - len(left), "false": false,
               "pictures": 1, "seconds": answer["seconds"]}
        total = {key: total[key] + row[key] for key in total}
        print(f"{name:42} {row['faces']:5} {row['found']:5} {row['false']:5} {row['seconds']:8.3f}")
        if a.out:
            a.out.mkdir(parents=True, exist_ok=True)
            draw(picture, answer["faces"], marks, a.out / f"{path.stem}.png")
    print(f"{total['pictures']} pictures: {total['found']} of {total['faces']} faces, {total['false']} false, {total['seconds']:.2f} s")


if __name__ == "__main__":
    main()
