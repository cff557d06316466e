"""Delamination under dead loads, through its peak, against corrected beam theory; the J integral.

    python benchmarks/delamination.py
    python benchmarks/delamination.py --strengths 60 120 --modes 0 0.5 1 --json rows.json

``onset`` is the largest load over that at which beam theory has the crack grow; ``growth`` is the most by which loads
of longer cracks are off it, at the crack that the compliance tells.  ``j`` is the J integral of loads and slopes over
that of the glue, less one, on the average of the last ten frames.  ``seconds`` are those of the processor.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from common import show

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.verification.bent_arms import beside_theory, growing, j_integrals, marched


def row(mode: float, strength: float) -> dict[str, object]:
    """The figures of one march."""
    began = time.process_time()
    found = marched(mode, strength)
    spent = time.process_time() - began
    seen, off = beside_theory(mode, strength)
    outside, inside = (part[-10:].mean() for part in j_integrals(mode, strength))
    return {
        "mode II": mode,
        "strength": strength,
        "onset": float(found["load_factor"].max()),
        "growth": float(np.abs(off[growing(seen)]).max()),
        "j": float(outside / inside - 1.0),
        "steps": len(found.times) - 1,
        "seconds": spent,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--modes", type=float, nargs="+", default=[0.0, 0.2, 0.5, 0.8, 1.0])
    parser.add_argument("--strengths", type=float, nargs="+", default=[60.0, 120.0])
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    given = parser.parse_args()
    show([row(mode, strength) for mode in given.modes for strength in given.strengths], given.json)
