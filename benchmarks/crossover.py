"""NonsmoothNewton and NonsmoothMultigrid side by side, and what the default choice expects of them.

    python benchmarks/crossover.py --dim 2 --sizes 16 32 64 128 256
    python benchmarks/crossover.py --dim 3 --sizes 4 8 12 16 20

``newton_s`` and ``multigrid_s`` are all of ``hv.solve``, set-up included, on the survey's data (5.1); ``difference`` is
that of both solutions in the energy norm.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
from common import show

import hemivar as hv
from hemivar import gallery
from hemivar.solvers.choice import choose, predicted_seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dim", type=int, choices=(2, 3), default=2)
    parser.add_argument("--sizes", type=int, nargs="+", default=None, help="cells along a side, 1/h")
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    rows = []
    tight = hv.Controls(rtol=1e-10)
    for n in options.sizes or ((16, 32, 64, 128, 256) if options.dim == 2 else (4, 8, 12, 16)):
        problem = hv.discretize(
            gallery.survey("5.1", n, "right") if options.dim == 2 else gallery.survey_cube("5.1", n)
        )
        start = time.perf_counter()
        newton = hv.solve(problem, hv.solvers.NonsmoothNewton(), tight)
        middle = time.perf_counter()
        multigrid = hv.solve(problem, hv.solvers.NonsmoothMultigrid(), tight)
        end = time.perf_counter()
        gap, K = multigrid.unknowns - newton.unknowns, problem.stiffness
        expected = predicted_seconds(problem)
        rows.append(
            {
                "dim": options.dim,
                "n": n,
                "unknowns": problem.unknowns,
                "newton_s": middle - start,
                "multigrid_s": end - middle,
                "predicted_newton_s": expected[0],
                "predicted_multigrid_s": expected[1],
                "chosen": choose(problem)[0].name,
                "difference": float(np.sqrt((gap @ (K @ gap)) / (newton.unknowns @ (K @ newton.unknowns)))),
            }
        )
    show(rows, options.json)


if __name__ == "__main__":
    main()
