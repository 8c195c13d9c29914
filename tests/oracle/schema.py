#!/usr/bin/env python3
"""Shipped pipeline files, and faulty variants of them, against the exported JSON schema.

An independent validator (the package `jsonschema`) must accept every file, and refuse each variant that `plumbline check` refuses.
"""
import copy
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import jsonschema


def variants(document):
    """(what is wrong, document) for faults that a schema can see."""
    def changed(change):
        copied = copy.deepcopy(document)
        change(copied)
        return copied

    some = next(iter(document["stage"]))
    yield "unknown top-level key", changed(lambda d: d.update(stages={}))
    yield "unknown version", changed(lambda d: d.update(version=99))
    yield "no version", changed(lambda d: d.pop("version"))
    yield "unknown kind", changed(lambda d: d["stage"][some].update(use="video.nothing"))
    yield "unknown setting", changed(lambda d: d["stage"][some].update(nonsense=1))
    yield "bad stage name", changed(lambda d: d["stage"].update({"Bad Name": d["stage"][some]}))
    for name, stage in document["stage"].items():
        if stage["use"] == "video.smooth":
            yield "crop out of range", changed(lambda d: d["stage"][name].update(keep=1.5))
            yield "crop of wrong type", changed(lambda d: d["stage"][name].update(keep="wide"))
            yield "unknown method", changed(lambda d: d["stage"][name].update(method="gausian"))
        if stage["use"] == "video.encode":
            yield "no path", changed(lambda d: d["stage"][name].pop("path"))
            yield "unknown port", changed(lambda d: d["stage"][name].update(inputs={"sound": "a"}))


def main():
    files = sorted(Path("pipeline").glob("*.toml"))
    exported = subprocess.run([os.environ["PLUMBLINE_BIN"], "schema"], check=True, capture_output=True, text=True)
    schema = json.loads(exported.stdout)
    jsonschema.Draft7Validator.check_schema(schema)
    validator = jsonschema.Draft7Validator(schema)
    wrong = 0
    for file in files:
        with open(file, "rb") as f:
            document = tomllib.load(f)
        for error in validator.iter_errors(document):
            wrong += 1
            print(f"{file}: {'/'.join(map(str, error.absolute_path))}: {error.message}")
        for what, variant in variants(document):
            if validator.is_valid(variant):
                wrong += 1
                print(f"{file}: the schema accepts a file with a fault: {what}")
    print(f"{len(files)} files, {wrong} disagreements")
    return 1 if wrong or not files else 0


if __name__ == "__main__":
    sys.exit(main())
