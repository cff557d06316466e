"""The bound of the distance to the exact solution: does it hold, how sharp is it, what does it cost.

    python benchmarks/bounds.py claims [--runs 320] [--seed 1] [--rows claims.jsonl] [--stored]
    python benchmarks/bounds.py effectivity [--sizes 8 16] [--space 2 4]
    python benchmarks/bounds.py cost [--sizes 64 128] [--space 8 16 24 32] [--data 5.1] [--methods newton multigrid]
    python benchmarks/bounds.py memory [--sizes 128] [--space 12 32]
    python benchmarks/bounds.py flat

``claims`` judges every problem of the gallery that has a bound, and statements at random (``random_statements.py``),
and prints for each the bound over the error, and whether it holds.  With ``--rows`` each run is kept as soon as it is
done, and a command that is repeated goes on where it ended.  It exits with 1 if a bound is below its error.  With
``--stored`` the random bodies are of a material that is not linear, and errors are measured by its lower tensor.

The error m is the distance to a reference u_2 on a mesh in which the judged one is nested: quadratic elements in the
plane, refined towards all corners and ends of conditions, and once more everywhere; linear ones in space, refined twice
everywhere.  The reference has an error of its own, which makes m too small (by Galerkin's orthogonality ``|u - u_h|^2 =
m^2 + |u - u_2|^2``, but for the nonsmooth part), and a claim too easy.  Its size is told by u_1, the reference on the
mesh before: ``|u_2 - u_1|^2 = |u - u_1|^2 - |u - u_2|^2 >= |u - u_2|^2`` if the last refinement at least halves the
square of the error.  A bound must not be below ``e = sqrt(m^2 + |u_2 - u_1|^2)``.  A solution known in closed form is
the reference.  Effectivities are taken with m, so that they come out too large rather than too small.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from common import peak_mib, show
from random_statements import Array, Body, random_body, random_statement, softened

import hemivar as hv
from hemivar import gallery
from hemivar.bounds import ExactDistance, exact_distance
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.trace_bounds import TraceBounds, discrete_trace_bounds, guaranteed_trace_bounds
from hemivar.fem import interpolate
from hemivar.fem.assembly import stiffness_matrix
from hemivar.gallery.known import KnownProblem, weighted_block
from hemivar.gallery.survey_problems import SURVEY_DATA
from hemivar.mechanics.composed_material import lower_elasticity
from hemivar.mesh import Mesh

#: Statements on one body.
PER_BODY = 10
#: Part of ``|u_h|_a`` below which errors are rounding.
ROUNDING = 1e-8
#: Refinements of the reference towards corners, in the plane.
TOWARDS_CORNERS = 4

F, V, E = PatchKind.FACET, PatchKind.VERTEX, PatchKind.EDGE


# ---- references ----------------------------------------------------------------------------------------------------


def energy_norm(problem: hv.ContactProblem, v: Array) -> float:
    """``|v|_a`` of nodal values, by C_low where the material is not linear."""
    stiffness = stiffness_matrix(problem.mesh, lower_elasticity(problem.material), problem.order)
    return float(np.sqrt(max(v.ravel() @ (stiffness @ v.ravel()), 0)))


def special_nodes(problem: hv.ContactProblem) -> Array:
    """Nodes where boundaries or materials meet, and corners."""
    mesh = problem.mesh
    outer = mesh.boundary_facets
    normals, _ = mesh.facet_normals(outer)
    nodes, place = np.unique(outer, return_inverse=True)
    place = place.reshape(outer.shape)
    mean = np.zeros((len(nodes), mesh.dim))
    for corner in place.T:
        np.add.at(mean, corner, normals)
    bent = nodes[np.linalg.norm(mean, axis=1) < 2.0 - 1e-6]
    names = np.zeros(mesh.number_of_nodes, dtype=np.int64)
    for facets in mesh.boundaries.values():
        names[np.unique(facets)] += 1
    layers = np.zeros(mesh.number_of_nodes, dtype=np.int64)
    for cells in mesh.regions.values():
        layers[np.unique(mesh.cells[cells])] += 1
    ends = np.intersect1d(np.flatnonzero(layers > 1), nodes) if len(mesh.regions) > 1 else nodes[:0]
    return np.unique(np.concatenate([bent, np.flatnonzero(names > 1), ends]))


@dataclass(frozen=True)
class Error:
    """m and e as the module says, and whether the reference was solved."""

    measured: float
    whole: float
    solved: bool


def references(problem: hv.ContactProblem) -> list[hv.ContactProblem]:
    """The problem on two nested meshes, in which its own is nested too."""
    mesh = problem.mesh
    bare = replace(problem, mesh=Mesh(mesh.points, mesh.cells, dict(mesh.boundaries), dict(mesh.regions)))
    if mesh.dim == 3:
        return [replace(bare, mesh=bare.mesh.refined(times)) for times in (1, 2)]
    finer = bare.mesh.refined()
    special = special_nodes(problem)  # nodes keep their numbers
    for _ in range(TOWARDS_CORNERS):
        finer = finer.refined_where(np.isin(finer.cells, special).any(axis=1))
    return [replace(bare, mesh=each, order=2) for each in (finer, finer.refined())]


def error_of(problem: hv.ContactProblem, u: Array) -> Error:
    """The error of a displacement."""
    first, second = references(problem)
    one, two = hv.solve(first), hv.solve(second)
    fields = two.problem.field
    assert fields is not None
    exact = two.displacement
    measured = energy_norm(second, exact - interpolate(problem.mesh, u, fields))
    apart = energy_norm(second, exact - interpolate(one.problem.field, one.displacement, fields))
    solved = one.status is hv.Status.CONVERGED and two.status is hv.Status.CONVERGED
    return Error(measured, float(np.hypot(measured, apart)), solved)


def error_of_known(known: KnownProblem, u: Array) -> Error:
    """The error against a solution in closed form, interpolated by quadratic elements."""
    mesh = known.problem.mesh.refined(2)
    fine = replace(known.problem, mesh=mesh, order=2)
    nodes = mesh.nodes(2)
    measured = energy_norm(fine, known.displacement(nodes) - interpolate(known.problem.mesh, u, nodes))
    return Error(measured, measured, True)


# ---- claims --------------------------------------------------------------------------------------------------------


def constants_of(problem: hv.DiscreteProblem) -> TraceBounds:
    """Those from below, where there are such."""
    known = discrete_trace_bounds(problem)
    origin = problem.origin
    if isinstance(origin, hv.ContactProblem) and not origin.contact:
        return replace(known, guaranteed=True)
    try:
        return guaranteed_trace_bounds(problem)
    except hv.errors.ProblemError as error:
        return replace(known, source=f"{known.source} ({error})")


def _body(seed: int, stored: bool) -> Body:
    body = random_body(seed)
    return softened(body, seed) if stored else body


@cache
def _constants_of_body(seed: int, stored: bool) -> TraceBounds:
    return constants_of(hv.discretize(_body(seed, stored).problem, check_coercivity=False))


def gallery_problems() -> Iterator[tuple[str, Callable[[], hv.ContactProblem | KnownProblem]]]:
    """Every problem at rest with linear elements, on one mesh or two."""
    for data in SURVEY_DATA:
        for n, pattern in ((4, "cross"), (6, "right"), (8, "left")):
            yield f"survey {data}, 1/{n}, {pattern}", lambda d=data, n=n, p=pattern: gallery.survey(d, n, p)
        yield f"survey cube {data}, 1/3", lambda d=data: gallery.survey_cube(d, 3)
    for bound in (0.1, 0.3, 0.5):
        yield f"survey logarithmic {bound}", lambda b=bound: gallery.survey_logarithmic(b, 6)
    yield "survey cube logarithmic", lambda: gallery.survey_cube_logarithmic(0.3, 3)
    yield "broken foundation", lambda: gallery.broken_foundation(6)
    yield "delamination", lambda: gallery.delamination(2)
    yield "cantilever", gallery.beam
    for n in (2, 4, 8):
        yield f"block under its weight, 1/{n}", lambda n=n: weighted_block(n=n)
        yield f"manufactured, springs, 1/{n}", lambda n=n: gallery.manufactured_spring(n)
        yield f"manufactured, softening, 1/{n}", lambda n=n: gallery.manufactured_softening(n)
    yield "block pressed down", lambda: weighted_block(n=4, top_displacement=0.2)
    for softening in (2.0, 6.0, 20.0):
        yield f"softening block {softening}", lambda s=softening: gallery.softening_block(softening=s, n=4)
    for bound in (0.3, 0.5, 1.0):
        yield f"sheared block {bound}", lambda b=bound: gallery.shear_block(b, 4, order=1)


def judged(name: str, made: hv.ContactProblem | KnownProblem, constants: TraceBounds | None) -> dict[str, Any]:
    """One run: the bound and the error."""
    began = time.perf_counter()
    known = made if isinstance(made, KnownProblem) else None
    problem = made.problem if isinstance(made, KnownProblem) else made
    row: dict[str, Any] = {"name": name}
    discrete = hv.discretize(problem)
    solution = hv.solve(discrete)
    found = exact_distance(problem, solution.displacement, constants_of(discrete) if constants is None else constants)
    row |= {"outcome": "bound" if found.guaranteed else "estimate", "c": found.constant, "theorem": found.theorem}
    row["reasons"] = list(found.reasons)
    if not np.isfinite(found.distance):
        return row | {"outcome": "none", "seconds": time.perf_counter() - began}
    error = error_of(problem, solution.displacement) if known is None else error_of_known(known, solution.displacement)
    rounding = ROUNDING * found.energy_norm
    row |= {"bound": found.distance, "norm": found.energy_norm, "measured": error.measured, "error": error.whole}
    row |= {"holds": bool(found.distance >= error.whole - rounding), "seconds": time.perf_counter() - began}
    if solution.status is not hv.Status.CONVERGED or not error.solved:
        row["outcome"] = "unsolved"
    return row


def _line(row: dict[str, Any]) -> str:
    if "bound" not in row:
        return f"{row['outcome']:9} {'':23} {row['name']}: {' '.join(row['reasons'])[:90]}"
    ratio = row["bound"] / row["error"] if row["error"] > 0.0 else np.inf
    holds = "holds" if row["holds"] else "BELOW THE ERROR"
    return f"{row['outcome']:9} {ratio:7.3f} {row['c']:5.2f} {holds:9} {row['name']}"


def claims(options: argparse.Namespace) -> int:
    """Every run; the exit code."""
    kept = {}
    if options.rows is not None and options.rows.exists():
        kept = {row["name"]: row for row in map(json.loads, options.rows.read_text().splitlines())}
    rows: list[dict[str, Any]] = []

    def judge(name: str, make: Callable[[], tuple[Any, TraceBounds | None]]) -> None:
        row = kept.get(name)
        if row is None:
            try:
                made, constants = make()
                row = judged(name, made, constants)
            except hv.HemivarError as error:
                row = {"name": name, "outcome": "refused", "reasons": [str(error)], "seconds": 0.0}
            if options.rows is not None:
                with options.rows.open("a") as file:
                    file.write(json.dumps(row) + "\n")
        rows.append(row)
        if not options.quiet or not row.get("holds", True):
            print(_line(row), flush=True)

    print("outcome   bound/e     c")
    if not options.only and not options.stored:
        for name, make in gallery_problems():
            judge(name, lambda make=make: (make(), None))
    numbers = options.only or range(options.runs)
    for number in numbers:
        number_of_body = 10_000 * options.seed + number // PER_BODY
        body = _body(number_of_body, options.stored)

        def make(body: Any = body, number: int = number, of: int = number_of_body) -> tuple[Any, TraceBounds]:
            constants = _constants_of_body(of, options.stored)
            problem, _ = random_statement(body, 10_000 * options.seed + number, constants.both)
            return problem, constants

        scale = body.modulus / body.length
        words = random_statement(body, 10_000 * options.seed + number, scale)[1]
        judge(f"{options.seed}:{number} {body.words}; {words}", make)
    return _summary(rows)


def _summary(rows: list[dict[str, Any]]) -> int:
    table = []
    for outcome in ("bound", "estimate", "none", "refused", "unsolved"):
        of = [row for row in rows if row["outcome"] == outcome]
        judged_ = [row for row in of if row.get("error", 0.0) > ROUNDING * row.get("norm", 1.0)]
        ratios = [row["bound"] / row["error"] for row in judged_]
        sharp = [row["bound"] * (1.0 - row["c"]) / row["measured"] for row in judged_]
        table.append(
            {
                "outcome": outcome,
                "runs": len(of),
                "below the error": sum(not row.get("holds", True) for row in of),
                "least bound/e": min(ratios, default=np.nan),
                "median": float(np.median(ratios)) if ratios else np.nan,
                "largest": max(ratios, default=np.nan),
                "median of bound (1 - c)/m": float(np.median(sharp)) if sharp else np.nan,
                "seconds": sum(row["seconds"] for row in of),
            }
        )
    show(table, None)
    for reason, count in Counter(row["reasons"][0] for row in rows if row["reasons"]).most_common(12):
        print(f"{count:5}  {reason[:140]}")
    return int(any(not row.get("holds", True) for row in rows if row["outcome"] != "unsolved"))


# ---- effectivity ---------------------------------------------------------------------------------------------------


def effectivity(options: argparse.Namespace) -> int:
    """bound (1 - c) / m on the survey's data, by sweeps."""
    rows = []
    plane = {"none": (), "2 facets": (F, F), "1 vertices": (V,), "2 vertices": (V, V)}
    space = {"none": (), "1 facets": (F,), "1 edges": (E,), "1 vertices": (V,)}
    for data in SURVEY_DATA:
        for dim, n in [(2, n) for n in options.sizes] + [(3, n) for n in options.space]:
            problem = gallery.survey(data, n) if dim == 2 else gallery.survey_cube(data, n)
            solution = hv.solve(problem)
            constants = guaranteed_trace_bounds(solution.problem)
            error = error_of(problem, solution.displacement)
            row: dict[str, Any] = {
                "data": data,
                "dim": dim,
                "1/h": n,
                "m": error.measured,
                "e/m": error.whole / error.measured,
            }
            for name, sweeps in (plane if dim == 2 else space).items():
                found = exact_distance(problem, solution.displacement, constants, sweeps=sweeps)
                row[f"sweeps: {name}"] = found.distance * (1.0 - found.constant) / error.measured
            rows.append(row)
            print(row, flush=True)
    for dim in (2, 3):
        if of := [row for row in rows if row["dim"] == dim]:
            show(of, None)
    return 0


# ---- cost and memory -----------------------------------------------------------------------------------------------


def _problem(dim: int, n: int, data: str = "5.1", order: int = 1) -> hv.ContactProblem:
    return replace(gallery.survey(data, n) if dim == 2 else gallery.survey_cube(data, n), order=order)


def _cases(options: argparse.Namespace) -> list[tuple[int, int]]:
    return [(2, n) for n in options.sizes] + [(3, n) for n in options.space]


def cost(options: argparse.Namespace) -> int:
    """Seconds of the bound over those of the solve; the least of some repetitions of either."""
    rows, clock = [], time.process_time if options.processor else time.perf_counter
    solvers = {"chosen": None, "newton": hv.solvers.NonsmoothNewton(), "multigrid": hv.solvers.NonsmoothMultigrid()}
    for (dim, n), data, method in itertools.product(_cases(options), options.data, options.methods):
        problem = _problem(dim, n, data, options.order)
        constants = guaranteed_trace_bounds(hv.discretize(_problem(dim, 2 if dim == 3 else 4)))
        times: dict[str, list[float]] = {"solve": [], "bound": []}
        for _ in range(options.repeat):
            began = clock()
            solution = hv.solve(_problem(dim, n, data, options.order), solvers[method])
            times["solve"].append(clock() - began)
            began = clock()
            exact_distance(problem, solution.displacement, constants)
            times["bound"].append(clock() - began)
        began = clock()
        guaranteed_trace_bounds(hv.discretize(_problem(dim, 2 if dim == 3 else 4)))
        rows.append(
            {
                "dim": dim, "1/h": n, "data": data, "solver": solution.method,
                "unknowns": solution.problem.unknowns, "solve, s": min(times["solve"]),
                "bound, s": min(times["bound"]), "bound/solve": min(times["bound"]) / min(times["solve"]),
                "constants of the body, once, s": clock() - began,
            }
        )  # fmt: skip
    show(rows, None)
    return 0


def memory(options: argparse.Namespace) -> int:
    """Peak memory above that of the library at rest: of the solve alone, and of the bound, each in a process."""
    rows = []
    for dim, n in _cases(options):
        peaks = {}
        for what in ("solve", "bound"):
            command = [sys.executable, __file__, "peak", "--what", what, "--dim", str(dim), "--cells", str(n)]
            told = subprocess.run(command, check=True, capture_output=True, text=True, env=os.environ)
            peaks[what] = float(told.stdout)
        rows.append({"dim": dim, "1/h": n, "solve, MiB": peaks["solve"], "with bound, MiB": peaks["bound"],
                     "ratio": peaks["bound"] / peaks["solve"]})  # fmt: skip
    show(rows, None)
    return 0


#: Dimension, height over length, cells of a plate.
PLATES = [
    *((2, ratio, cells) for ratio in (100, 300) for cells in ((8, 1), (8, 2), (8, 4))),
    *((3, ratio, (4, 4, 2)) for ratio in (30, 100, 300)),
]


def plate(dim: int, ratio: int, cells: tuple[int, ...], held: str) -> hv.ContactProblem:
    """A plate of length one on a foundation, pulled at its end: held on its top, or at its other end."""
    size = (*((1.0,) * (dim - 1)), 1.0 / ratio)
    mesh = hv.rectangle(size, cells, pattern="cross") if dim == 2 else hv.box(size, cells)
    between = (0.0,) * (dim - 2)
    return hv.ContactProblem(
        mesh, hv.Material.young(10.0, 0.3), {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.05))},
        {held: hv.Clamped()}, body_force=(0.1, *between, -0.4), tractions={"right": (0.05, *between, -0.2)},
    )  # fmt: skip


def flat(options: argparse.Namespace) -> int:
    """Bound over error on flat cells: by the cells of the mesh, and as it is; seconds of the latter."""
    rows = []
    for (dim, ratio, cells), held in itertools.product(PLATES, ("top", "left")):
        problem = plate(dim, ratio, cells, held)
        solution = hv.solve(problem)
        u, constants = solution.displacement, guaranteed_trace_bounds(solution.problem)
        own = exact_distance(problem, u, constants, sweeps=(V,) if dim == 2 else (E,))
        began = time.process_time()
        found = exact_distance(problem, u, constants)
        spent, error = time.process_time() - began, error_of(problem, u)
        rows.append(
            {
                "plate": f"1:{ratio}", "cells": " x ".join(map(str, cells)), "held": held,
                "by its cells": own.distance / error.measured, "index": found.distance / error.measured,
                "told": found.above, "holds": bool(found.distance >= error.whole), "seconds": spent,
            }
        )  # fmt: skip
        print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
    show(rows, None)
    return 0


def peak(options: argparse.Namespace) -> int:
    """Print the peak in MiB above that after a small problem of the same kind, with everything imported."""
    small = _problem(options.dim, 2)
    constants = replace(discrete_trace_bounds(hv.discretize(small)), guaranteed=True)
    distance(small, constants)
    before = peak_mib()
    problem = _problem(options.dim, options.cells)
    solution = hv.solve(problem)
    if options.what == "bound":
        exact_distance(problem, solution.displacement, constants)
    print(peak_mib() - before)
    return 0


def distance(problem: hv.ContactProblem, constants: TraceBounds) -> ExactDistance:
    """Of the solution of a problem."""
    return exact_distance(problem, hv.solve(problem).displacement, constants)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=["claims", "effectivity", "cost", "memory", "flat", "peak"])
    parser.add_argument("--runs", type=int, default=320, help="statements at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, nargs="+", default=None, help="numbers of statements, these alone")
    parser.add_argument("--rows", type=Path, default=None, help="where runs are kept, one JSON a line")
    parser.add_argument("--stored", action="store_true", help="of 'claims': bodies that are not linear")
    parser.add_argument("--quiet", action="store_true", help="print bounds below the error and the summary alone")
    parser.add_argument("--sizes", type=int, nargs="*", default=None, help="1/h in the plane")
    parser.add_argument("--space", type=int, nargs="*", default=None, help="1/h in space")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument(
        "--processor", action="store_true", help="of 'cost': seconds of the processor, not of the clock"
    )
    parser.add_argument("--data", nargs="+", choices=list(SURVEY_DATA), default=["5.1"], help="of 'cost'")
    parser.add_argument("--methods", nargs="+", choices=["chosen", "newton", "multigrid"], default=["chosen"])
    parser.add_argument("--order", type=int, choices=[1, 2], default=1, help="of 'cost', in the plane")
    parser.add_argument("--what", choices=["solve", "bound"], help="of 'peak', which 'memory' runs")
    parser.add_argument("--dim", type=int)
    parser.add_argument("--cells", type=int)
    options = parser.parse_args()
    usual = {"effectivity": ([8, 16], [2, 4]), "cost": ([64, 128], [8, 16, 24, 32]), "memory": ([128], [12, 32])}
    plane, space = usual.get(options.part, ([], []))
    options.sizes = plane if options.sizes is None else options.sizes
    options.space = space if options.space is None else options.space
    parts = {"claims": claims, "effectivity": effectivity, "cost": cost, "memory": memory, "flat": flat, "peak": peak}
    return parts[options.part](options)


if __name__ == "__main__":
    sys.exit(main())
