"""Trace constants from below: how near, and at what cost; what the softest mode by itself gains near the margin.

    python benchmarks/trace_bounds.py
    python benchmarks/trace_bounds.py --study space
    python benchmarks/trace_bounds.py --study margin

``plane``: the survey's square and (0,2)x(0,1), beside conforming values and one solve of the survey's data (5.1) at
1/h = 32, seconds of processor time of the fastest of five.  ``space``: boxes of three aspect ratios and Poisson's
ratios, beside quadratic elements on the same mesh and linear ones on 8 cells a side.  ``margin``: logarithmic friction
on the survey's square with c from 0.2 to 0.9; the bound with and without the mode, over the error against quadratic
elements on a mesh finer by four.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from common import show

import hemivar as hv
from hemivar.bounds.exact_distance import exact_distance
from hemivar.bounds.lower_bounds import lower_bounds
from hemivar.bounds.trace_bounds import guaranteed_trace_bounds
from hemivar.certificates import energy_norm
from hemivar.fem.assembly import stiffness_matrix
from hemivar.gallery import survey


def _held(mesh: hv.Mesh, material: hv.Material) -> hv.ContactProblem:
    return hv.ContactProblem(
        mesh=mesh,
        material=material,
        supports={"left": hv.Clamped()},
        contact={"bottom": hv.Contact(hv.laws.NoContact())},
    )


def _fastest(run: Callable[[], Any], times: int = 5) -> tuple[Any, float]:
    found, best = None, np.inf
    for _ in range(times):
        began = time.process_time()
        found = run()
        best = min(best, time.process_time() - began)
    return found, best


def _columns(found: Any) -> dict[str, str]:
    return {
        name: f"{getattr(found, name).lower:.4f} .. {getattr(found, name).upper:.4f}"
        for name in ("both", "normal", "tangential")
    }


def plane() -> list[dict[str, object]]:
    _, solve = _fastest(lambda: hv.solve(survey("5.1", 32)))
    rows: list[dict[str, object]] = []
    for length in (1.0, 2.0):
        problem = _held(
            hv.rectangle((length, 1.0), (int(32 * length), 32), pattern="cross"), hv.Material.lame(4.0, 4.0)
        )
        for cells in (100, 320, 1000):
            found, seconds = _fastest(lambda p=problem, c=cells: lower_bounds(p, c))  # type: ignore[misc]
            rows.append(
                {"length": length, "cells": found.cells, **_columns(found), "s": seconds, "solves": seconds / solve}
            )
    return rows


def space() -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for sides in ((1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (1.0, 1.0, 0.5)):
        for ratio in (0.0, 0.25, 0.4):
            material = hv.Material.young(10.0, ratio)
            count = tuple(round(4 * side) for side in sides)
            problem = _held(hv.box(sides, count), material)
            found, seconds = _fastest(lambda p=problem: lower_bounds(p), 1)  # type: ignore[misc]
            fine = hv.discretize(_held(hv.box(sides, tuple(2 * n for n in count)), material))
            weights = np.repeat(fine.contact.weights, fine.contact.components)
            top = energy_norm(fine).largest_eigenvalue(fine.contact.trace, weights.ravel()).bound
            row: dict[str, object] = {"sides": "x".join(f"{side:g}" for side in sides), "nu": ratio}
            row |= {"cells": found.cells, **_columns(found), "linear, 1/8": f"{1.0 / top:.4f}"}
            rows.append({**row, "lower/upper": found.both.lower / found.both.upper, "s": seconds})
    return rows


def margin() -> list[dict[str, object]]:
    rows: list[dict[str, object]] = []
    for c in (0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
        problem = hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 8, pattern="cross"),
            material=hv.Material.lame(4.0, 4.0),
            supports={"left": hv.Clamped()},
            contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.laws.Logarithmic(5.2 * c))},
            body_force=(-0.8, -0.8),
        )
        solution = hv.solve(problem)
        constants = guaranteed_trace_bounds(solution.problem)
        with_mode = exact_distance(problem, solution.displacement, constants)
        without = exact_distance(problem, solution.displacement, replace(constants, weighted=None))
        error = _error(problem, solution.displacement)
        rows.append(
            {
                "c": f"{with_mode.constant:.3f}",
                "error": f"{error:.5f}",
                "bound/error, 1/(1-c)": f"{without.distance / error:.2f}",
                "with the mode": f"{with_mode.distance / error:.2f}",
                "gain": f"{without.distance / with_mode.distance:.2f}",
            }
        )
    return rows


def _error(problem: hv.ContactProblem, u: np.ndarray[Any, Any]) -> float:
    fine = replace(problem, mesh=problem.mesh.refined(2), order=2)
    mesh = problem.mesh
    for _ in range(3):
        u = np.vstack([u, 0.5 * (u[mesh.edges[:, 0]] + u[mesh.edges[:, 1]])])
        mesh = mesh.refined()
    off = (hv.solve(fine).displacement - u).ravel()
    return float(np.sqrt(off @ (stiffness_matrix(fine.mesh, fine.material, 2) @ off)))


STUDIES = {"plane": plane, "space": space, "margin": margin}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    options.add_argument("--study", choices=tuple(STUDIES), default="plane")
    chosen = options.parse_args()
    show(STUDIES[chosen.study](), chosen.json)


if __name__ == "__main__":
    main()
