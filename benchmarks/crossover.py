"""NonsmoothNewton and NonsmoothMultigrid side by side, and what the default choice makes of them.

    OMP_NUM_THREADS=1 python benchmarks/crossover.py
    OMP_NUM_THREADS=1 python benchmarks/crossover.py --dim 3 --kinds survey pair --sizes 4 8 12 --json rows.json

``newton_s`` and ``multigrid_s`` are all of ``hv.solve``, set-up included, in seconds of the processor, the least of
some turns.  ``ratio`` is that of the method chosen to the better of both, and ``difference`` that of both solutions in
the energy norm.  ``survey`` is the survey's first law, ``coulomb`` Coulomb's on springs, ``arrays`` the survey's on a
mesh that no coarser one is known of, ``pair`` two blocks that rub on one another.  A method that takes longer than
``--limit`` seconds is left out on larger meshes.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from common import show

import hemivar as hv
from hemivar import gallery
from hemivar.solvers.choice import choose, predicted_seconds
from hemivar.solvers.solve import suited

#: The most that the default may cost beside the better method.
MARK = 1.3
SIZES = {2: (8, 16, 32, 48, 64, 96, 128, 192), 3: (3, 4, 6, 8, 10, 12, 16, 20)}
METHODS = {"newton": hv.solvers.NonsmoothNewton(), "multigrid": hv.solvers.NonsmoothMultigrid()}


def survey(dim: int, n: int) -> hv.ContactProblem:
    return gallery.survey("5.1", n, "right") if dim == 2 else gallery.survey_cube("5.1", n)


def coulomb(dim: int, n: int) -> hv.ContactProblem:
    stated = survey(dim, n)
    rubs = hv.Contact(hv.Compliance(50.0), hv.Coulomb(0.3))
    return replace(stated, contact=dict.fromkeys(stated.contact, rubs))


def arrays(dim: int, n: int) -> hv.ContactProblem:
    stated = survey(dim, n)
    mesh = stated.mesh
    own = hv.Mesh(mesh.points, mesh.cells, boundaries=dict(mesh.boundaries))
    return replace(stated, mesh=own)


def pair(dim: int, n: int) -> hv.ContactProblem:
    if dim == 2:
        blocks = {"u": hv.rectangle(cells=n), "l": hv.rectangle(cells=n, origin=(0.0, -1.0))}
    else:
        blocks = {"u": hv.box(cells=n), "l": hv.box(cells=n, origin=(0.0, 0.0, -1.0))}
    mesh = hv.Mesh.assembled(blocks)
    push = (0.01,) + (0.0,) * (dim - 2) + (-0.05,)
    return hv.ContactProblem(
        mesh,
        hv.Material.lame(4.0, 4.0),
        {"u:bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1), against="l:top")},
        {"u:top": hv.Prescribed(push), "l:bottom": hv.Clamped()},
    )


KINDS: dict[str, Callable[[int, int], hv.ContactProblem]] = {
    "survey": survey,
    "coulomb": coulomb,
    "arrays": arrays,
    "pair": pair,
}


def timed(kind: str, dim: int, n: int, name: str, repeats: int) -> tuple[float, hv.Solution]:
    """The least seconds of some turns, each on a mesh of its own, which remembers what was asked of it."""
    spent = []
    for _ in range(repeats):
        problem = hv.discretize(KINDS[kind](dim, n))
        began = time.process_time()
        found = hv.solve(problem, suited(METHODS[name], problem), rtol=1e-9)
        spent.append(time.process_time() - began)
    return min(spent), found


def compared(kind: str, dim: int, n: int, names: list[str], repeats: int) -> dict[str, Any]:
    """One row of the table."""
    found, seconds = {}, {}
    for name in names:
        seconds[name], found[name] = timed(kind, dim, n, name, repeats)
    problem = found[names[0]].problem
    expected, chosen = predicted_seconds(problem), choose(problem)[0].name
    row = {"kind": kind, "dim": dim, "n": n, "unknowns": problem.unknowns, "contact": problem.contact.trace.nnz}
    for name, prediction in zip(METHODS, expected, strict=True):
        row |= {f"{name}_s": seconds.get(name, ""), f"predicted_{name}_s": prediction}
    row |= {"chosen": chosen, "ratio": seconds[chosen] / min(seconds.values()) if chosen in seconds else ""}
    row["difference"] = ""
    if len(found) > 1:
        K, (one, other) = problem.stiffness, (solution.unknowns for solution in found.values())
        row["difference"] = float(np.sqrt(((one - other) @ (K @ (one - other))) / (one @ (K @ one))))
    row["statuses"] = ", ".join(solution.status.value for solution in found.values())
    print(json.dumps(row), file=sys.stderr)
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dim", type=int, choices=(2, 3), nargs="+", default=(2, 3))
    parser.add_argument("--kinds", nargs="+", choices=list(KINDS), default=list(KINDS))
    parser.add_argument("--sizes", type=int, nargs="+", default=None, help="cells along a side, 1/h")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--limit", type=float, default=4.0, help="seconds from which a method is left out")
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    rows = []
    for dim, kind in itertools.product(options.dim, options.kinds):
        names = list(METHODS)
        for n in options.sizes or SIZES[dim]:
            rows.append(compared(kind, dim, n, names, options.repeats))
            names = [name for name in names if rows[-1][f"{name}_s"] < options.limit] or names
    show(rows, options.json)
    ratios = [row["ratio"] for row in rows if row["ratio"] != ""]
    print(f"the default costs at most {max(ratios):.2f} times the better method; the mark is {MARK}")


if __name__ == "__main__":
    main()
