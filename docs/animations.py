"""Make the films of docs/evolution.md anew: ``python docs/animations.py [NAME ...]``.

Each is one command, ``hemivar animate examples/problems/NAME.toml -o docs/images/NAME.gif`` with the options below.
"""

from __future__ import annotations

import sys
from pathlib import Path

from hemivar.cli import main

ROOT = Path(__file__).resolve().parents[1]
#: Problem files with the options of their films.
FILMS: dict[str, tuple[str, ...]] = {
    "relaxation": ("--units", "s", "--frames", "30"),
    "bounce": ("--frames", "31"),
    "delayed_failure": ("--units", "s,mm", "--frames", "40"),
    "stick_slip": ("--frames", "40"),
    "bar_impact": ("--colour", "speed", "--frames", "40"),
    "wear": ("--units", "s,mm", "--frames", "30"),
}


def make(name: str, folder: Path) -> int:
    """March an example and write its film into a folder; returns the exit code of the command."""
    problem = ROOT / "examples" / "problems" / f"{name}.toml"
    arguments = ["animate", str(problem), "-o", str(folder / f"{name}.gif"), "--dpi", "100", "--quiet"]
    return main([*arguments, *FILMS[name]])


if __name__ == "__main__":
    unknown = set(sys.argv[1:]) - FILMS.keys()
    if unknown:
        sys.exit(f"there is no film '{sorted(unknown)[0]}'; choose from {', '.join(FILMS)}")
    sys.exit(max(make(name, ROOT / "docs" / "images") for name in sys.argv[1:] or FILMS))
