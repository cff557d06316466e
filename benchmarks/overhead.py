"""What contact costs on top of the linear elastic solve of the same mesh.

    python benchmarks/overhead.py --dim 2 --sizes 128 256 512 1024
    python benchmarks/overhead.py --dim 3 --sizes 16 32 64 --law weakening --json rows.json

``linear_s`` is the same body without its foundation, by conjugate gradients around the same multigrid cycle, started
from the next coarser mesh, to a relative residual of 1e-10; ``contact_s`` all of ``hv.solve`` to the same tolerance,
recovery and residual included.  The hierarchy (``levels_s``) serves both and is in neither.  Both run in turn, and the
smallest time of each counts.  ``cpu_ratio`` is the median of the ratios of single turns, in seconds of the processor:
what else runs on the machine disturbs it less.  ``steps`` and ``cycles`` are those on the finest mesh.

``--material hencky`` takes a body whose shear softens to a fourth (L/m = 4) in the place of the linear one.
``tangent_s`` is the assembly of its tangents, on all meshes, ``ratio`` is that of the rest of ``contact_s`` to
``linear_s``, the linear body at small strain, and ``alone_cycles`` are those of the same body without its foundation,
by the same method.  Seconds are then those of the processor.

Where the kernels are compiled, ``cycle_ms`` is one multigrid cycle in single precision, and ``share`` the part of the
bandwidth of memory that it reaches, by one thread and by two: bytes that it has to read and write (each block twice,
the vectors of a level about nine times) over its time, against those of a triad in double precision (``x += a p``,
``r -= a q``) by as many threads, GB/s of which are ``triad``.  ``gain`` is what two threads gain over one.

``--others`` adds what other libraries take for the linear problem, where they are installed (see competitors.py).
"""

from __future__ import annotations

import argparse
import gc
import json
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import competitors
import numpy as np
from common import peak_mib, show

import hemivar as hv
from hemivar import gallery
from hemivar.fem.energy_integral import EnergyIntegral
from hemivar.kernels import kernels, threads
from hemivar.linear.levels import Truncated
from hemivar.systems.body_on_levels import ElasticMultigrid, levels_of

TOLERANCE = 1e-10
#: Numbers in a vector of the triad, beyond all caches, and bytes that it moves for each: four are read, two written.
TRIAD, MOVED = 8_000_000, 48
PROBLEMS = {
    (2, "survey"): lambda n: gallery.survey("5.1", n, "right"),
    (2, "weakening"): lambda n: gallery.survey_logarithmic(0.3, n, "right"),
    (3, "survey"): lambda n: gallery.survey_cube("5.1", n),
    (3, "weakening"): lambda n: gallery.survey_cube_logarithmic(0.3, n),
}


def measure(dim: int, law: str, n: int, repeats: int) -> tuple[dict[str, Any], hv.DiscreteProblem]:
    """One row of the table, and the problem."""
    began = time.perf_counter()
    statement = PROBLEMS[dim, law](n)
    problem = hv.discretize(statement)
    assembled = time.perf_counter()
    workspace = hv.systems.Workspace()
    hierarchy = levels_of(problem, workspace)
    method, controls = hv.solvers.NonsmoothMultigrid(tolerance=TOLERANCE / 2), hv.Controls(rtol=TOLERANCE)
    linear, contact, ratios = [], [], []
    for _ in range(repeats):
        gc.collect()
        start, began_cpu = time.perf_counter(), time.process_time()
        displacement, linear_cycles = hierarchy.solve(problem.load, TOLERANCE)
        middle, middle_cpu = time.perf_counter(), time.process_time()
        solution = hv.solve(problem, method, controls, workspace=workspace)
        linear.append(middle - start)
        contact.append(time.perf_counter() - middle)
        ratios.append((time.process_time() - middle_cpu) / (middle_cpu - began_cpu))
    miss = np.linalg.norm(problem.load - problem.stiffness @ displacement) / np.linalg.norm(problem.load)
    row = {
        "dim": dim,
        "law": law,
        "n": n,
        "unknowns": problem.unknowns,
        "assembly_s": assembled - began,
        "levels_s": hierarchy.seconds,
        "linear_s": min(linear),
        "contact_s": min(contact),
        "ratio": min(contact) / min(linear),
        "cpu_ratio": statistics.median(ratios),
        "steps": solution.steps,
        "cycles": solution.evaluations,
        "linear_cycles": linear_cycles,
        "status": solution.status.value,
        "residual": solution.residual.relative,
        "linear_residual": float(miss),
        "peak_mib": peak_mib(),
    }
    return row, problem


def seconds_of(work: Callable[[], object], repeats: int) -> float:
    """The least of some turns."""
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        spent.append(time.perf_counter() - start)
    return min(spent)


def bandwidth(problem: hv.DiscreteProblem, repeats: int) -> dict[str, Any]:
    """A cycle against a triad, by one thread and by two."""
    library, levels = kernels(), ElasticMultigrid.of(problem).levels
    if library is None or levels.compiled is None:
        return {}
    top, moved = len(levels.sizes) - 1, 0
    for A in levels.compiled.matrices[1:]:
        d = problem.contact.components
        moved += 2 * A.nnz // d**2 * 4 * (d**2 + 1) + 4 * A.shape[0] * (2 * d + 9)
    whole = Truncated(levels, top)
    x, r, p, q = (np.ones(TRIAD) for _ in range(4))
    row: dict[str, Any] = {}
    for count in (1, 2):
        library.call.hv_set_threads(count)
        cycle = seconds_of(lambda: whole.fast_cycle(top, problem.load), 5 * repeats)
        triad = seconds_of(lambda: library.advance(1e-9, p, q, x, r), 5 * repeats)
        speed = MOVED * TRIAD / triad
        found = {"cycle_ms": 1e3 * cycle, "triad": 1e-9 * speed, "share": moved / cycle / speed}
        row |= {f"{name}_{count}": value for name, value in found.items()}
    library.call.hv_set_threads(threads())
    return row | {"gain": row["cycle_ms_1"] / row["cycle_ms_2"], "triad_gain": row["triad_2"] / row["triad_1"]}


def hencky(dim: int, law: str, n: int, repeats: int) -> dict[str, Any]:
    """One row of the table of a body that is not linear."""
    statement = PROBLEMS[dim, law](n)
    linear = hv.discretize(statement)
    hierarchy = levels_of(linear, hv.systems.Workspace())
    lam, mu = 4.0, 4.0  # of all these problems
    material = hv.Material.hencky(lam + 2.0 * mu / 3.0, mu, 0.25, 0.02)
    problem = hv.discretize(replace(statement, material=material))
    alone = problem.with_(law=hv.laws.ContactLaw(hv.laws.NoContact()).at(problem.contact.points))
    spent, assemble = [0.0], EnergyIntegral.hessian

    def timed(self: EnergyIntegral, u: np.ndarray) -> Any:
        start = time.process_time()
        try:
            return assemble(self, u)
        finally:
            spent[0] += time.process_time() - start

    EnergyIntegral.hessian = timed  # type: ignore[method-assign]
    rows = []
    for _ in range(repeats):
        spent[0], start = 0.0, time.process_time()
        _, cycles = hierarchy.solve(linear.load, TOLERANCE)
        middle = time.process_time()
        solution = hv.solve(problem, hv.solvers.NonsmoothMultigrid(), rtol=TOLERANCE)
        rows.append((time.process_time() - middle, spent[0], middle - start))
    EnergyIntegral.hessian = assemble  # type: ignore[method-assign]
    whole, tangents, _ = min(rows)
    return {
        "dim": dim,
        "law": law,
        "n": n,
        "unknowns": problem.unknowns,
        "linear_s": min(row[2] for row in rows),
        "contact_s": whole,
        "tangent_s": tangents,
        "ratio": (whole - tangents) / min(row[2] for row in rows),
        "steps": solution.steps,
        "cycles": solution.evaluations,
        "alone_cycles": hv.solve(alone, hv.solvers.NonsmoothMultigrid(), rtol=TOLERANCE).evaluations,
        "linear_cycles": cycles,
        "status": solution.status.value,
        "residual": solution.residual.relative,
    }


def others(problem: hv.DiscreteProblem, dim: int, n: int, python: str) -> dict[str, Any]:
    """Seconds of other libraries for the linear problem, solve and set-up; missing ones say why on stderr."""
    runs: dict[str, Callable[[], competitors.Outcome]] = {
        "ngsolve1": lambda: competitors.ngsolve_multigrid(n, dim, 1),
        "ngsolve2": lambda: competitors.ngsolve_multigrid(n, dim, 2),
        "pardiso": lambda: competitors.pardiso(problem),
        "hypre": lambda: competitors.hypre(problem, python),
    }
    if dim == 3 and n > 32:
        del runs["pardiso"]  # does not fit
    row: dict[str, Any] = {}
    for name, run in runs.items():
        found = run()
        if isinstance(found, competitors.Missing):
            print(f"{name}, n = {n}: {found.reason}", file=sys.stderr)
        else:
            row |= {f"{name}_s": found["seconds_solve"], f"{name}_setup_s": found["seconds_setup"]}
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dim", type=int, choices=(2, 3), default=2)
    parser.add_argument("--sizes", type=int, nargs="+", default=None, help="cells along a side, 1/h")
    parser.add_argument("--law", choices=("survey", "weakening"), default="survey")
    parser.add_argument("--material", choices=("linear", "hencky"), default="linear")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--others", action="store_true", help="time other libraries as well")
    parser.add_argument("--petsc-python", default=sys.executable, help="a Python that has petsc4py with hypre")
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    sizes = options.sizes or ((128, 256, 512, 1024) if options.dim == 2 else (16, 32, 64))
    rows = []
    for n in sizes:
        if options.material == "hencky":
            rows.append(hencky(options.dim, options.law, n, options.repeats))
            print(json.dumps(rows[-1]), file=sys.stderr)
            continue
        row, problem = measure(options.dim, options.law, n, options.repeats)
        row |= bandwidth(problem, options.repeats)
        rows.append(row | (others(problem, options.dim, n, options.petsc_python) if options.others else {}))
        print(json.dumps(rows[-1]), file=sys.stderr)
    columns = list(dict.fromkeys(key for row in rows for key in row))
    show([{key: row.get(key, "") for key in columns} for row in rows], options.json)


if __name__ == "__main__":
    main()
