#!/usr/bin/env python3
"""Files that this project writes against the Khronos glTF validator.

Needs node and the npm package `gltf-validator` in a folder that NODE_PATH names; `make oracle` installs it. Checked
are the character of media/, converted and posed, and with PLUMBLINE_MEDIA real ones.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

SKIPPED = 77
VALIDATE = """
const validator = require('gltf-validator'), fs = require('fs');
const path = process.argv[1];
validator.validateBytes(new Uint8Array(fs.readFileSync(path)), { uri: path, maxIssues: 20 })
  .then(report => console.log(JSON.stringify(report.issues)));
"""


def node(*arguments):
    return subprocess.run(["node", *arguments], capture_output=True, text=True)


def main():
    if shutil.which("node") is None or node("-e", "require('gltf-validator')").returncode != 0:
        print("skipped: node or its package gltf-validator is missing (`make oracle` installs it)")
        return SKIPPED
    program = os.environ.get("PLUMBLINE_BIN", "target/debug/plumbline")
    characters = [pathlib.Path("media/humanoid.glb")]
    media = os.environ.get("PLUMBLINE_MEDIA")
    if media:
        characters += sorted(pathlib.Path(media, "mesh/gltf").glob("*.gl*"))
    faults = 0
    with tempfile.TemporaryDirectory() as folder:
        for character in characters:
            for extension, command in [("glb", ["mesh", "convert"]), ("gltf", ["mesh", "convert"]),
                                       ("glb", ["pose", "--rig"]), ("glb", ["pose", "--skinning", "lbs"])]:
                out = f"{folder}/{character.stem}-{command[-1]}.{extension}"
                subprocess.run([program, *command, str(character), "-o", out, "--overwrite"], check=True, capture_output=True)
                ran = node("-e", VALIDATE, out)
                issues = json.loads(ran.stdout)
                bad = [m for m in issues["messages"] if m["severity"] == 0]
                print(f"{character.name} {' '.join(command)} .{extension}: {issues['numErrors']} errors, "
                      f"{issues['numWarnings']} warnings")
                for message in bad:
                    print(f"    {message['code']} at {message.get('pointer')}: {message['message']}")
                faults += issues["numErrors"]
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
