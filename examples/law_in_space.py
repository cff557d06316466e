"""Laws that vary: parameters as functions of x, and a foundation of several layers.

Three foundations under one body:

1. Threshold and stiffness vary along the foundation, ``q(x) = P - p(x) s``, so that a block pressed down by its top
   sinks in evenly by s with the pressure P although the ground is uneven: a solution known by hand.
2. A foundation of two layers: stiffness k1 down to the depth delta, k2 below. The block sinks in by
   ``s = (kappa D - (k1 - k2) delta)/(kappa + k2)`` once that is more than delta, with ``kappa = lam + 2 mu``.
3. Friction bound and threshold differ between the two halves of the survey's foundation: it slips where it is smooth.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv

LAM, MU, DOWN = 4.0, 4.0, 0.1
KAPPA = LAM + 2.0 * MU
SUNK = 0.06
SMOOTH, ROUGH = 0.02, 0.5


def pressed_block(law: hv.Superpotential) -> hv.Solution:
    """A unit block between frictionless walls, its top moved down by DOWN."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 8),
        material=hv.Material.lame(LAM, MU),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Fixed(y=-DOWN)},
        contact={"bottom": hv.Contact(law)},
        title="block on a varying foundation",
    )
    return hv.solve(hv.discretize(problem)).raise_for_status()


def stiffness(x: np.ndarray) -> np.ndarray:
    """p(x), at points of shape (m, 2)."""
    return 2.0 + 1.5 * np.sin(5.0 * x[:, 0])


def threshold(x: np.ndarray) -> np.ndarray:
    """q(x) for which the block sinks in evenly."""
    return KAPPA * (DOWN - SUNK) - stiffness(x) * SUNK


def bound(x: np.ndarray) -> np.ndarray:
    """A smooth left half and a rough right half."""
    return np.where(x[:, 0] < 0.5, SMOOTH, ROUGH)


def hardness(x: np.ndarray) -> np.ndarray:
    """A soft left half and a hard right half."""
    return np.where(x[:, 0] < 0.5, 0.1, 0.6)


def two_halves(n: int = 32) -> hv.DiscreteProblem:
    """The survey's body on a foundation whose halves differ."""
    return hv.discretize(
        hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), n, pattern="cross"),
            material=hv.Material.lame(LAM, MU),
            supports={"left": hv.Clamped()},
            contact={"bottom": hv.Contact(hv.SurveyLaw(hardness, 2.0), hv.Tresca(bound))},
            body_force=(0.8, -0.8),
            title="soft and smooth left, hard and rough right",
        )
    )


def main(out: Path | None = None) -> dict[str, float]:
    """Solve the three."""
    uneven = pressed_block(hv.SurveyLaw(threshold, stiffness))
    off = float(np.abs(uneven.penetration - SUNK).max())
    print(f"1. uneven ground: penetration {uneven.penetration.mean():.12f} (by hand {SUNK}), spread {off:.1e}")

    k1, k2, depth = 1.0, 8.0, 0.04
    layers = hv.PiecewiseQuadratic(
        breakpoints=np.array([0.0, depth]), slopes=np.array([0.0, k1, k2]), jumps=np.zeros(2), name="two layers"
    )
    layered = pressed_block(layers)
    by_hand = (KAPPA * DOWN - (k1 - k2) * depth) / (KAPPA + k2)
    print(f"2. two layers: penetration {layered.penetration.mean():.12f} (by hand {by_hand:.12f})")

    solution = hv.solve(two_halves()).raise_for_status()
    x = solution.problem.contact.points
    size = np.abs(solution.friction[:, 0])
    slipping = solution.state == hv.ContactState.SLIP
    smooth = x[:, 0] < 0.5
    slips = np.count_nonzero(slipping & smooth), np.count_nonzero(slipping & ~smooth)
    print(f"3. two halves: {slips[0]} nodes slip left, {slips[1]} right")
    print(f"   largest friction {size[smooth].max():.6f} left, {size[~smooth].max():.6f} right")
    if out is not None:
        from hemivar.report import plot_solution, save

        save(plot_solution(solution), out / "law_in_space.png")
    return {
        "uneven": float(uneven.penetration.mean()),
        "uneven_spread": off,
        "layered": float(layered.penetration.mean()),
        "layered_by_hand": by_hand,
        "energy": solution.energy,
        "friction_excess": float((size - bound(x)).max()),
        "slip_deficit": float(np.abs(size - bound(x))[slipping].max(initial=0.0)),
        "slipping_smooth": float(slips[0]),
    }


if __name__ == "__main__":
    from _command import run

    run(main)
