"""Unknowns until the distance to the exact solution is guaranteed to be below 10, 5 and 2 per cent, in the plane.

    python benchmarks/adaptive.py [--order 2] [--rtol 0.1 0.05 0.02] [--data figure1 5.1] [--json rows.json]
    python benchmarks/adaptive.py --times [--rtol 0.05 0.01 0.002] [--most 256]

For each data set of the survey two ways with linear elements, or with ``--order 2`` quadratic ones: the mesh refined
where the bound says, and everywhere. Bounds are those of
``hemivar.bounds.exact_distance`` with trace constants from below; the rate is that of the bound in the
number of unknowns. Uniform meshes end at ``--most`` cells a side.

``--times`` compares the time until a distance is guaranteed: quadratic elements on adaptive meshes, all meshes and the
constants of the body counted, and linear ones on the first uniform mesh that is fine enough (twice as fine each), that
mesh alone and the constants counted. Beyond the finest mesh the unknowns follow the rate of the last two meshes and
the time is taken in proportion to them; such entries are marked as extrapolated.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from common import show

import hemivar as hv
from hemivar.bounds import AdaptiveSolution, exact_distance, solve_adaptive
from hemivar.bounds.trace_bounds import guaranteed_trace_bounds
from hemivar.gallery import survey
from hemivar.gallery.survey_problems import SURVEY_DATA

#: Unknowns, relative bound and seconds of a uniform mesh.
Row = tuple[int, float, float]


def uniform(data: str, most: int, order: int) -> tuple[list[Row], float]:
    """Uniform meshes, twice as fine each, and the seconds that the constants take."""
    found, n = [], 4
    began = time.perf_counter()
    constants = guaranteed_trace_bounds(hv.discretize(survey(data, 4)))
    before = time.perf_counter() - began
    while n <= most:
        problem = replace(survey(data, n), order=order)
        began = time.perf_counter()
        solution = hv.solve(problem)
        distance = exact_distance(problem, solution.displacement, constants)
        found.append((solution.problem.unknowns, distance.relative, time.perf_counter() - began))
        n *= 2
    return found, before


def unknowns(local: AdaptiveSolution, even: list[Row], data: str, rtol: float) -> dict[str, Any]:
    first = next((level for level in local.levels if level.distance.relative <= rtol), None)
    other = next((one for one in even if one[1] <= rtol), None)
    return {
        "data": data,
        "guaranteed": f"{rtol:.1%}",
        "adaptive unknowns": "-" if first is None else first.unknowns,
        "seconds, all meshes": "-" if first is None else first.seconds,
        "uniform unknowns": f"> {even[-1][0]} ({even[-1][1]:.1%})" if other is None else other[0],
        "seconds, one mesh": "-" if other is None else other[2],
        "rate": local.rate,
    }


def times(local: AdaptiveSolution, even: list[Row], before: float, data: str, rtol: float) -> dict[str, Any]:
    first = next((level for level in local.levels if level.distance.relative <= rtol), None)
    count, _, seconds = next((one for one in even if one[1] <= rtol), (0, 0.0, 0.0))
    mark = ""
    if not count:
        (n, above, _), (m, below, seconds) = even[-2:]
        rate = math.log(above / below) / math.log(m / n)
        count = round(m * (below / rtol) ** (1.0 / rate))
        seconds *= count / m
        mark = " (extrapolated)"
    return {
        "data": data,
        "guaranteed": f"{rtol:.1%}",
        "adaptive, quadratic: unknowns": "-" if first is None else first.unknowns,
        "seconds": "-" if first is None else first.seconds,
        "uniform, linear: unknowns": f"{count:.3g}{mark}" if mark else count,
        "its seconds": f"{seconds + before:.3g}{mark}",
        "ratio": "-" if first is None else (seconds + before) / first.seconds,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rtol", type=float, nargs="+", default=None)
    parser.add_argument("--data", nargs="+", default=list(SURVEY_DATA), choices=list(SURVEY_DATA))
    parser.add_argument("--order", type=int, choices=(1, 2), default=1)
    parser.add_argument("--times", action="store_true", help="quadratic and adaptive against linear and uniform")
    parser.add_argument("--most", type=int, default=None, help="cells a side of the finest uniform mesh")
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    tolerances = sorted(options.rtol or ([0.05, 0.01, 0.002] if options.times else [0.1, 0.05, 0.02]), reverse=True)
    most = options.most or (256 if options.times else 64)
    rows = []
    for data in options.data:
        problem = replace(survey(data, 4), order=2 if options.times else options.order)
        local = solve_adaptive(problem, rtol=min(tolerances))
        even, before = uniform(data, most, 1 if options.times else options.order)
        for rtol in tolerances:
            rows.append(times(local, even, before, data, rtol) if options.times else unknowns(local, even, data, rtol))
    show(rows, options.json)


if __name__ == "__main__":
    main()
