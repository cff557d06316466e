"""Unknowns until the distance to the exact solution is guaranteed to be below 10, 5 and 2 per cent, in the plane.

    python benchmarks/adaptive.py [--rtol 0.1 0.05 0.02] [--data figure1 5.1] [--json rows.json]

For each data set of the survey two ways with linear elements: the mesh refined where the bound says, and everywhere.
Bounds are those of ``hemivar.adapt.exact_distance`` with trace constants from below; the rate is that of the bound in
the number of unknowns.  Uniform meshes end at ``--most`` cells a side.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from common import show

import hemivar as hv
from hemivar.adapt import exact_distance, solve_adaptive
from hemivar.adapt.trace_bounds import guaranteed_trace_bounds
from hemivar.gallery import SURVEY_DATA, survey


def uniform(data: str, most: int) -> list[tuple[int, float, float]]:
    """Unknowns, relative bound and seconds on uniform meshes, twice as fine each."""
    found, n = [], 4
    constants = guaranteed_trace_bounds(hv.discretize(survey(data, 4)))
    while n <= most:
        began = time.perf_counter()
        solution = hv.solve(survey(data, n))
        distance = exact_distance(survey(data, n), solution.displacement, constants)
        found.append((solution.problem.unknowns, distance.relative, time.perf_counter() - began))
        n *= 2
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rtol", type=float, nargs="+", default=[0.1, 0.05, 0.02])
    parser.add_argument("--data", nargs="+", default=list(SURVEY_DATA), choices=list(SURVEY_DATA))
    parser.add_argument("--most", type=int, default=64, help="cells a side of the finest uniform mesh")
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    rows = []
    for data in options.data:
        local = solve_adaptive(survey(data, 4), rtol=min(options.rtol))
        even = uniform(data, options.most)
        for rtol in sorted(options.rtol, reverse=True):
            first = next((level for level in local.levels if level.distance.relative <= rtol), None)
            other = next((one for one in even if one[1] <= rtol), None)
            rows.append(
                {
                    "data": data,
                    "guaranteed": f"{rtol:.1%}",
                    "adaptive unknowns": "-" if first is None else first.unknowns,
                    "seconds, all meshes": "-" if first is None else first.seconds,
                    "uniform unknowns": f"> {even[-1][0]} ({even[-1][1]:.1%})" if other is None else other[0],
                    "seconds, one mesh": "-" if other is None else other[2],
                    "rate": local.rate,
                }
            )
    show(rows, options.json)


if __name__ == "__main__":
    main()
