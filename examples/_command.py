"""Command line of the examples: ``python examples/NAME.py [--out DIR]``."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any


def run(main: Callable[[Path | None], dict[str, Any]]) -> None:
    """Call ``main`` with the folder for figures and files, or None."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for figures and files")
    out = parser.parse_args().out
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    main(out)
