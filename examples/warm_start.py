"""Nested meshes: warm start from mesh to mesh, and observed orders of convergence.

A mesh is refined again and again, and the solution on each mesh is the first guess on the next, as in the survey.
How fast the differences between successive meshes shrink, in the norm of V, ``|v|_V = sqrt(int eps(v):eps(v))``, shows
the order: below 1 for the survey's data (5.1), whose solution has corner singularities. For comparison, the error of a
smooth solution that is known exactly, where the order of linear elements is 1.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar import gallery
from hemivar.fem import interpolate, v_norm


def orders(errors: list[float]) -> list[float]:
    """log2 of the ratio of the errors on two successive meshes."""
    return [float(np.log2(coarse / fine)) for coarse, fine in itertools.pairwise(errors)]


def main(out: Path | None = None) -> dict[str, list[float]]:
    """Warm start, then orders."""
    problem = gallery.survey("5.1", 2)
    meshes = [problem.mesh]
    for _ in range(5):
        meshes.append(meshes[-1].refined())  # h = 1/2, 1/4, ... 1/64
    levels = [hv.discretize(problem.on(mesh)) for mesh in meshes]
    workspace = hv.Workspace()
    for level in levels:
        workspace.condensed(level)
    sizes = [2 * 2**k for k in range(len(levels))]

    method = hv.PrimalDualActiveSet(sets_from_guess=True)
    warm = hv.solve_nested(levels, method, workspace=workspace)
    cold = [hv.solve(level, method, workspace=workspace) for level in levels]
    print("steps of the active set method")
    for n, w, c in zip(sizes, warm, cold, strict=True):
        print(f"  1/h = {n:>3}: warm {w.steps:>3}, cold {c.steps:>3}")

    differences = []
    for coarse, fine in itertools.pairwise(warm):
        here, there = coarse.problem.field, fine.problem.field
        assert here is not None
        assert there is not None
        differences.append(v_norm(there, interpolate(here, coarse.displacement, there) - fine.displacement))
    found = orders(differences)
    print("V-norm of the difference from the next mesh, and its order, survey's data (5.1)")
    for n, difference, order in zip(sizes, differences, [float("nan"), *found], strict=False):
        print(f"  1/h = {n:>3}: {difference:.4e}  {order:5.2f}")

    smooth = []
    for n in (4, 8, 16, 32):
        known = gallery.manufactured_spring(n)
        solution = hv.solve(hv.discretize(known.problem)).raise_for_status()
        finer = known.problem.mesh.refined(2)
        lifted = interpolate(known.problem.mesh, solution.displacement, finer)
        smooth.append(v_norm(finer, lifted - known.displacement(finer.points)))
    print("orders for a smooth solution known exactly:", " ".join(f"{order:.3f}" for order in orders(smooth)))
    if out is not None:
        np.savetxt(out / "orders.csv", np.c_[sizes[:-1], differences], delimiter=",", header="n,difference")
    return {
        "orders": found,
        "smooth_orders": orders(smooth),
        "warm_steps": [float(s.steps) for s in warm],
        "cold_steps": [float(s.steps) for s in cold],
        "same": [float(np.abs(w.unknowns - c.unknowns).max()) for w, c in zip(warm, cold, strict=True)],
    }


if __name__ == "__main__":
    from _command import run

    run(main)
