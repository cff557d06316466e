"""What others printed, recomputed: a table of all cases of this folder.

    python examples/literature/table.py            # coarse meshes, as the tests
    python examples/literature/table.py --fine
    python examples/literature/table.py --fine --worst  # one line for each case: the quantity that is farthest off

Each case is a script with its statement, ``SOURCE``, ``PRINTED`` values, the ``REASON`` of the deviation, the part
``WITHIN`` which a coarse mesh comes, and ``computed(fine)``, which returns values by the same names.
"""

import argparse
import contextlib
import io
import runpy
from pathlib import Path
from typing import Any

import matplotlib

HERE = Path(__file__).parent
NAMES = sorted(path.stem for path in HERE.glob("*.py") if path.stem != "table")


def case(name: str) -> dict[str, Any]:
    """What a script defines."""
    return runpy.run_path(str(HERE / f"{name}.py"))


def deviations(one: dict[str, Any], fine: bool = False) -> dict[str, tuple[float, float, float]]:
    """By quantity: printed, found, and how far off, relative to what is printed."""
    with contextlib.redirect_stdout(io.StringIO()):
        found = one["computed"](fine)
    return {name: (value, found[name], found[name] / value - 1.0) for name, value in one["PRINTED"].items()}


def off_by(part: float) -> str:
    """A deviation in per cent; rounding is nothing."""
    return "0" if abs(part) < 1e-9 else f"{100.0 * part:+.2g} %"


def lines(fine: bool = False, worst: bool = False) -> list[str]:
    """The rows of the table."""
    rows = ["| case | source | quantity | printed | found | off | why |", "|---|---|---|---:|---:|---:|---|"]
    for name in NAMES:
        one = case(name)
        off = deviations(one, fine)
        kept = [max(off, key=lambda quantity: abs(off[quantity][2]))] if worst else list(off)
        for quantity in kept:
            printed, found, part = off[quantity]
            words = f"{one['SOURCE']} | {quantity} | {printed:.6g} | {found:.6g} | {off_by(part)} | {one['REASON']}"
            rows.append(f"| [{name}](../examples/literature/{name}.py) | {words} |")
    return rows


if __name__ == "__main__":
    matplotlib.use("Agg")
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--fine", action="store_true", help="finer meshes and shorter steps")
    parser.add_argument("--worst", action="store_true", help="one line for each case")
    given = parser.parse_args()
    print("\n".join(lines(given.fine, given.worst)))
