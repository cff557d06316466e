r"""
Laws that vary over the foundation
==================================

Parameters of laws may be functions of the place, and a law may have layers. Two cases have a solution by hand; in the
third the halves of a foundation differ.
"""

import numpy as np

import hemivar as hv
from hemivar.report import plot_contact

LAM, MU, DOWN = 4.0, 4.0, 0.1
KAPPA = LAM + 2.0 * MU


def pressed_block(law: hv.laws.Superpotential) -> hv.Solution:
    """A unit block between frictionless walls, its top moved down by DOWN."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 8),
        material=hv.Material.lame(LAM, MU),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Fixed(y=-DOWN)},
        contact={"bottom": hv.Contact(law)},
        title="block on a varying foundation",
    )
    return hv.solve(problem).raise_for_status()


# %%
# Uneven ground, even penetration
# -------------------------------
# Threshold and stiffness vary so that :math:`q(x) = P - p(x)\,s`: the block sinks in evenly by s with the pressure
# :math:`P = \kappa (D - s)`, although the ground is uneven.

SUNK = 0.06


def stiffness(x: np.ndarray) -> np.ndarray:
    """p(x), at points of shape (m, 2)."""
    return 2.0 + 1.5 * np.sin(5.0 * x[:, 0])


def threshold(x: np.ndarray) -> np.ndarray:
    """q(x) for which the block sinks in evenly."""
    return KAPPA * (DOWN - SUNK) - stiffness(x) * SUNK


uneven = pressed_block(hv.laws.ThresholdCompliance(threshold, stiffness))
off = float(np.abs(uneven.penetration - SUNK).max())
print(f"penetration {uneven.penetration.mean():.12f} (by hand {SUNK}), spread {off:.1e}")

# %%
# Two layers
# ----------
# Stiffness k1 down to the depth :math:`\delta`, k2 below. The block sinks in by
# :math:`s = (\kappa D - (k_1 - k_2)\delta)/(\kappa + k_2)` once that is more than :math:`\delta`.

k1, k2, depth = 1.0, 8.0, 0.04
layers = hv.laws.PiecewiseQuadratic(
    breakpoints=np.array([0.0, depth]), slopes=np.array([0.0, k1, k2]), jumps=np.zeros(2), name="two layers"
)
layered = pressed_block(layers)
layered_by_hand = (KAPPA * DOWN - (k1 - k2) * depth) / (KAPPA + k2)
print(f"penetration {layered.penetration.mean():.12f} (by hand {layered_by_hand:.12f})")

# %%
# Two halves
# ----------
# Soft and smooth on the left, hard and rough on the right: the body slips where the ground is smooth.

SMOOTH, ROUGH = 0.02, 0.5


def bound(x: np.ndarray) -> np.ndarray:
    """Friction bound."""
    return np.where(x[:, 0] < 0.5, SMOOTH, ROUGH)


def hardness(x: np.ndarray) -> np.ndarray:
    """Threshold of the pressure."""
    return np.where(x[:, 0] < 0.5, 0.1, 0.6)


halves = hv.ContactProblem(
    mesh=hv.rectangle((1.0, 1.0), 32, pattern="cross"),
    material=hv.Material.lame(LAM, MU),
    supports={"left": hv.Clamped()},
    contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(hardness, 2.0), hv.Tresca(bound))},
    body_force=(0.8, -0.8),
    title="soft and smooth left, hard and rough right",
)
solution = hv.solve(halves).raise_for_status()
points = solution.problem.contact.points
size = np.abs(solution.friction[:, 0])
slipping = solution.tangential_state == hv.solvers.TangentialState.SLIP
smooth = points[:, 0] < 0.5
print(f"{np.count_nonzero(slipping & smooth)} nodes slip left, {np.count_nonzero(slipping & ~smooth)} right")
print(f"largest friction {size[smooth].max():.6f} left, {size[~smooth].max():.6f} right")
plot_contact(solution)
