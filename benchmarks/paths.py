"""What a load path costs in space, in linear solves a point, and what a search for solutions costs.

    OMP_NUM_THREADS=1 python benchmarks/paths.py
    OMP_NUM_THREADS=1 python benchmarks/paths.py --sizes 8 16 --points 40 --json rows.json
    OMP_NUM_THREADS=1 python benchmarks/paths.py --search

The survey's cube, its load growing from zero.  ``linear_s`` is the body without its contact, levels ready, to 1e-8;
``point_ms`` is the path by the number of its points; ``solves`` is the second over the first.  The body is condensed
before.  ``--search`` is ``find_solutions`` on a square with five contact points and laws of friction that depend on the
solution or couple.  Seconds are those of the processor.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from common import show

import hemivar as hv
from hemivar import gallery
from hemivar.systems.body_on_levels import levels_of

STATEMENTS = {
    "survey": lambda n: gallery.survey_cube("5.1", n),
    "weakening": lambda n: gallery.survey_cube_logarithmic(0.3, n),
}
SOFTENING = hv.Softening(60.0, 0.02, 16.0)
FOAM = hv.FormulaLaw("piecewise((0, r < 0), (0.05*(1 - (1 + r/0.02)*exp(-r/0.02)), True))")
SEARCHED = {
    "softening, friction by a formula": (SOFTENING, hv.laws.Friction(0.02, hv.FormulaLaw("r/(1 + 40*r)", even=True))),
    "softening, Coulomb": (SOFTENING, hv.Coulomb(0.3)),
    "foam, Coulomb": (FOAM, hv.Coulomb(0.3)),
}


def measure(law: str, n: int, points: int) -> dict[str, Any]:
    """One row of the table."""
    problem, workspace = hv.discretize(STATEMENTS[law](n)), hv.systems.Workspace()
    levels = levels_of(problem, workspace)
    levels.solve(problem.load, 1e-8)
    linear = []
    for _ in range(5):
        began = time.process_time()
        levels.solve(problem.load, 1e-8)
        linear.append(time.process_time() - began)
    hv.solve(problem, "newton", workspace=workspace)
    began = time.process_time()
    path = hv.follow_path(problem, (0.0, 1.0), max_points=points, workspace=workspace)
    spent = (time.process_time() - began) / len(path)
    return {
        "law": law,
        "n": n,
        "contact points": problem.contact_points,
        "points": len(path),
        "load": float(path.load_factor[-1]),
        "linear_s": min(linear),
        "point_ms": 1e3 * spent,
        "solves": spent / min(linear),
    }


def searched(name: str) -> dict[str, Any]:
    """The search on five contact points."""
    normal, friction = SEARCHED[name]
    problem = hv.discretize(
        hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 4),
            material=hv.Material.lame(4.0, 4.0),
            supports={"top": hv.Fixed(y=-0.07), "right": hv.Roller()},
            contact={"bottom": hv.Contact(normal, friction)},
            body_force=(0.5, -1.0),
        )
    )
    began = time.process_time()
    found = hv.find_solutions(problem)
    return {"law": name, "solutions": len(found), "starts": found.starts, "seconds": time.process_time() - began}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[8], help="cells along a side")
    parser.add_argument("--points", type=int, default=1000, help="points of a path at most")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    parser.add_argument("--search", action="store_true", help="the search for solutions instead")
    options = parser.parse_args()
    paths = [] if options.search else [measure(law, n, options.points) for n in options.sizes for law in STATEMENTS]
    show(paths or [searched(name) for name in SEARCHED], options.json)


if __name__ == "__main__":
    main()
