"""A problem made of arrays: an elastic bar that meets a foundation at its end.

``-EA u'' = b`` on (0, L), ``u(0) = 0``, contact at x = L. Linear elements are exact at the nodes, and the end
displacement r solves the scalar inclusion ``kappa (r0 - r) in dj(r)`` with ``kappa = EA/L``, ``r0 = b L^2/(2 EA)``.

A bar has no tangential direction, so there is one row of the trace for its one contact point: d = 1.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.sparse as sp

import hemivar as hv

ELEMENTS, RIGIDITY, LENGTH, LOAD, GAP = 8, 2.0, 0.5, 6.0, 0.01


def bar(law: hv.Superpotential) -> hv.DiscreteProblem:
    """Stiffness, load and trace by hand; the node at x = 0 is left out because it does not move."""
    h = LENGTH / ELEMENTS
    stiffness = RIGIDITY / h * sp.diags_array([-1.0, 2.0, -1.0], offsets=(-1, 0, 1), shape=(ELEMENTS, ELEMENTS)).tolil()
    stiffness[-1, -1] = RIGIDITY / h
    load = np.full(ELEMENTS, LOAD * h)
    load[-1] = 0.5 * LOAD * h
    trace = sp.csr_array(([1.0], ([0], [ELEMENTS - 1])), shape=(1, ELEMENTS))  # penetration = u at x = L, less the gap
    return hv.DiscreteProblem.of_arrays(
        stiffness=stiffness,
        load=load,
        trace=trace,
        weights=np.ones(1),  # the multiplier is then a force
        gap=np.array([GAP]),
        law=hv.ContactLaw(law).at(None),
    )


def main(out: Path | None = None) -> dict[str, tuple[float, float]]:
    """Solve for three laws; compare with the solution by hand."""
    kappa = RIGIDITY / LENGTH
    r0 = LOAD * LENGTH**2 / (2.0 * RIGIDITY) - GAP
    q, p, k = 0.3, 2.0, 5.0
    cases = {
        "survey": (hv.SurveyLaw(q, p), max(kappa * r0 - q, 0.0) / (kappa + p)),
        "compliance": (hv.Compliance(k), kappa * r0 / (kappa + k)),
        "signorini": (hv.Signorini(), 0.0),
    }
    found: dict[str, tuple[float, float]] = {}
    print(f"{'law':<12}{'penetration':>14}{'by hand':>14}{'reaction':>14}{'by hand':>14}")
    for name, (law, exact) in cases.items():
        solution = hv.solve(bar(law)).raise_for_status()
        r, force = float(solution.penetration[0]), float(solution.pressure[0])
        print(f"{name:<12}{r:>14.10f}{exact:>14.10f}{force:>14.10f}{kappa * (r0 - exact):>14.10f}")
        found[name] = (r, force)
    if out is not None:
        np.savetxt(out / "bar.csv", [[*v] for v in found.values()], delimiter=",", header="penetration,reaction")
    return found


if __name__ == "__main__":
    from _command import run

    run(main)
