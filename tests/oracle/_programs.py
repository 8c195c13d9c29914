"""Where the oracle tests find the example programs."""
import os
import pathlib
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def example(name):
    """Path of a built example: in the folder PLUMBLINE_EXAMPLES, without it in target/release/examples, then in debug."""
    named = os.environ.get("PLUMBLINE_EXAMPLES")
    folders = [pathlib.Path(named)] if named else [ROOT / f"target/{profile}/examples" for profile in ("release", "debug")]
    for folder in folders:
        if (found := folder / name).exists():
            return str(found)
    sys.exit(f"{name} not found in {', '.join(map(str, folders))}: run `cargo build --examples`")
