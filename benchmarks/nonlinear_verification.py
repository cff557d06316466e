"""Nonlinear bodies on foundations against numbers that one equation gives: errors and observed orders.

    python benchmarks/nonlinear_verification.py --cells 4 8 16

The block and the rings are those of ``hemivar.gallery.hencky_block`` and ``hencky_ring``; the locking block stiffens
where its deviator is larger than 0.03.  A penetration of a ring is the mean over its contact nodes.  The three
solutions of one ring are solved for from the displacements of the known ones; the middle one is a saddle.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np
import scipy.sparse as sp
from common import show
from scipy.optimize import brentq
from scipy.sparse.linalg import spsolve

import hemivar as hv
from hemivar.gallery import hencky_block, hencky_ring
from hemivar.gallery.known import KnownProblem

TIGHT = hv.Controls(rtol=1e-12)
FOUNDATIONS: dict[str, tuple[Any, float]] = {
    "ring": (hv.Compliance(2.0), 0.1),
    "ring that softens": (hv.Softening(40.0, 0.02, 25.0), 0.055),
}


def depth(known: KnownProblem) -> float:
    """The penetration of the known solution at the inner side of a ring."""
    return -float(known.displacement(np.array([[1.0, 0.0]])).sum())


def block_rows() -> list[dict[str, Any]]:
    """Homogeneous strains: exact on any mesh."""
    rows = []
    for law, words in ((hv.Compliance(20.0), "20 s"), (hv.laws.ThresholdCompliance(0.3, 2.0), "0.3 + 2 s")):
        known = hencky_block(law, n=4)
        expected = -float(known.displacement(np.zeros((1, 2))).sum())
        rows.append(_row(f"block, law {words}", expected, hv.solve(known, controls=TIGHT)))
    rows.append(locking_row())
    return rows


def locking_row() -> dict[str, Any]:
    """Solved by ``(lam + 2 mu + 2/3 beta (1 - min(1, limit/|dev|))) e = 20 s``, e = D - s."""
    lam, mu, beta, limit, pushed = 4.0, 4.0, 6.0, 0.03, 0.1

    def rest(s: float) -> float:
        e = pushed - s
        deviator = np.sqrt(2.0 / 3.0) * e
        more = beta * 2.0 / 3.0 * e * (1.0 - min(1.0, limit / deviator))
        return float((lam + 2.0 * mu) * e + more - 20.0 * s)

    material = hv.Material.locking(lam + 2.0 * mu / 3.0, mu, beta, limit)
    stated = replace(hencky_block(n=4).problem, material=material)
    return _row("locking block, law 20 s", brentq(rest, 0.0, 0.09, xtol=1e-16), hv.solve(stated, controls=TIGHT))


def _row(case: str, expected: float, solution: hv.Solution) -> dict[str, Any]:
    found = float(solution.raise_for_status().penetration.mean())
    return {"case": case, "known": f"{expected:.12f}", "found": f"{found:.12f}", "error": abs(found / expected - 1.0)}


def stationary(problem: hv.DiscreteProblem, u: np.ndarray) -> np.ndarray:
    """Unknowns of the stationary point near others, be it a saddle: Newton's method, not downhill as solvers go."""
    weights = problem.contact.weights[:, None]
    for _ in range(30):
        line = problem.law.linearise(problem.local(u))
        rest = problem.out_of_balance(u) - problem.contact_force(line.gradient)
        bent = sp.block_diag(list(weights[:, :, None] * line.hessian), format="csr")
        step = spsolve(
            sp.csc_array(problem.bulk.hessian(u) + problem.contact.trace.T @ bent @ problem.contact.trace), rest
        )
        u = u + step
        if np.abs(step).max() <= 1e-13 * np.abs(u).max():
            return u
    raise RuntimeError("Newton's method did not converge")


def ring_rows(case: str, cells: list[int]) -> list[dict[str, Any]]:
    """One row for each solution: the penetration of the finest mesh, and the order between the two finest."""
    law, pushed = FOUNDATIONS[case]
    found: list[list[float]] = []
    for n in cells:
        stated = hencky_ring(law, n=n, pushed=pushed)
        discrete = hv.discretize(stated.problem)
        row = []
        for one in stated.solutions:
            start = discrete.field.restrict(one.displacement(discrete.field.nodes))
            row.append(float(discrete.local(stationary(discrete, start))[:, 0].mean()) / depth(one) - 1.0)
        found.append(row)
    off = np.abs(np.array(found))
    return [
        {
            "case": f"{case}, solution {k + 1}",
            "known": f"{depth(one):.12f}",
            "found": f"{depth(one) * (1.0 + found[-1][k]):.9f}",
            "error": off[-1, k],
            "order": float(np.log2(off[-2, k] / off[-1, k]) / np.log2(cells[-1] / cells[-2])),
        }
        for k, one in enumerate(stated.solutions)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    cells = "cells along the radius of a ring, two numbers or more"
    parser.add_argument("--cells", type=int, nargs="+", default=[8, 16, 32], help=cells)
    options = parser.parse_args()
    show(block_rows(), None)
    for case in FOUNDATIONS:
        print()
        show(ring_rows(case, options.cells), None)


if __name__ == "__main__":
    main()
