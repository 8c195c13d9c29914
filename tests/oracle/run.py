#!/usr/bin/env python3
"""Runs every oracle test of this folder: `tests/oracle/run.py [WORD...]` (only those whose name contains a word).

An oracle test is a program `tests/oracle/NAME.py` that compares results of this project with an independent reference
(OpenCV, SciPy, FFmpeg). It ends with 0 where they agree and with 77 where it cannot run here, saying why; any other
end is a failure, and so is 77 where CI and PLUMBLINE_MEDIA are set: there everything is at hand. Names with a leading underscore are shared code. It finds, built and ready,

    PLUMBLINE_BIN        the command
    PLUMBLINE_EXAMPLES   the folder of the built examples
    PLUMBLINE_MEDIA      the folder of real media; unset on most machines: skip what needs it

and the project's root as its working directory.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

SKIPPED = 77
HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
TIMEOUT_S = 900


def build():
    """Builds the command and the programs in the profile of the unit tests; returns the folder they are in."""
    subprocess.run(["cargo", "build", "--workspace", "--locked", "--bins", "--example", "programs"], cwd=ROOT, check=True)
    metadata = ["cargo", "metadata", "--locked", "--no-deps", "--format-version", "1"]
    out = subprocess.run(metadata, cwd=ROOT, check=True, capture_output=True, text=True)
    return Path(json.loads(out.stdout)["target_directory"]) / "debug"


def run(test, environment):
    """One test in a process of its own: `passed`, `skipped` or `failed`."""
    began = time.monotonic()
    try:
        code = subprocess.run([sys.executable, test], cwd=ROOT, env=environment, stdin=subprocess.DEVNULL,
                              timeout=TIMEOUT_S).returncode
    except subprocess.TimeoutExpired:
        print(f"{test.name}: not done after {TIMEOUT_S} s")
        code = None
    complete = "CI" in os.environ and "PLUMBLINE_MEDIA" in os.environ
    outcome = {0: "passed", SKIPPED: "failed" if complete else "skipped"}.get(code, "failed")
    print(f"oracle {test.stem}: {outcome} ({time.monotonic() - began:.1f} s)", flush=True)
    return outcome


def main():
    tests = [t for t in sorted(HERE.glob("*.py")) if t.name != "run.py" and not t.name.startswith("_")]
    tests = [t for t in tests if len(sys.argv) == 1 or any(word in t.stem for word in sys.argv[1:])]
    folder = build()
    environment = os.environ | {"PLUMBLINE_BIN": str(folder / "plumbline"), "PLUMBLINE_EXAMPLES": str(folder / "examples")}
    outcomes = [run(t, environment) for t in tests]
    print(f"oracles: {outcomes.count('passed')} passed, {outcomes.count('failed')} failed, "
          f"{outcomes.count('skipped')} skipped")
    return 1 if "failed" in outcomes else 0


if __name__ == "__main__":
    sys.exit(main())
