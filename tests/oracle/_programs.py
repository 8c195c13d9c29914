"""Where the oracle tests find the programs of benches/peers/programs."""
import os
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def program(name):
    """The start of a command that runs one of the programs, which all are in one file.

    It is in the folder PLUMBLINE_EXAMPLES, without it in target/release/examples, then in debug.
    """
    named = os.environ.get("PLUMBLINE_EXAMPLES")
    folders = [pathlib.Path(named)] if named else [ROOT / f"target/{profile}/examples" for profile in ("release", "debug")]
    for folder in folders:
        if (found := folder / "programs").exists():
            return [str(found), name]
    sys.exit(f"programs not found in {', '.join(map(str, folders))}: run `cargo build --example programs`")
