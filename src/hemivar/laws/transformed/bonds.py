"""A bond that fades: a bonding (damage) field in [0, 1] that falls where glue is stretched more than it can bear."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arguments import number
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.parameters import common_rows
from hemivar.laws.piecewise_law import moved, scaled
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.algebra import plus
from hemivar.laws.transformed.law_graph import Region, spliced
from hemivar.laws.transformed.transformed_law import check_law, numbers

__all__ = ["bonded"]


def bonded(
    law: Superpotential,
    stiffness: Array | float,
    energy: Array | float,
    viscosity: Array | float,
    field: Array | float,
    tau: float,
) -> Superpotential:
    """The law with a bond in parallel, which acts in opening, w = -r > 0.

    A bonding field beta stores ``stiffness beta^2 w^2/2`` and falls,
    ``viscosity beta' = -(stiffness beta w^2 - energy)+`` (Fremond; Raous, Cangemi, Cocou 1999).  In a step of implicit
    Euler from beta_n it minimises
    ``stiffness beta^2 w^2/2 - energy beta + viscosity (beta - beta_n)^2/(2 tau)`` over beta <= beta_n:
    ``beta = min(beta_n, B/(1 + tau stiffness w^2/viscosity))``, B = beta_n + tau energy/viscosity, and the tension is
    ``stiffness beta^2 w``.  Its alpha is ``stiffness B^2/4`` if ``tau energy <= viscosity beta_n``, and else
    ``stiffness beta_n^2 (3 y - 1)/(1 + y)``, y = B/beta_n - 1, which is less.

    Parameters
    ----------
    law : Superpotential
        With resolved parameters.
    stiffness, energy : number or array (m,)
        >= 0 (force per area and length; energy per area, below which nothing breaks).
    viscosity : number or array (m,)
        > 0 (energy per area, times time).
    field : number or array (m,)
        beta_n, between 0 and 1.
    tau : float
        Length of the step, > 0.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        The bonding field exceeds one.
    """
    check_law(law)
    what = "of a bond"
    beta = numbers(field, f"the bonding field {what}", least=0.0, state=True)
    if (beta > 1.0).any():
        raise ProblemError(f"the bonding field {what} is {beta.max():g}; it must be at most 1")
    gamma = numbers(stiffness, f"the stiffness {what}", least=0.0)
    w0, eta = numbers(energy, f"the energy {what}", least=0.0), numbers(viscosity, f"the viscosity {what}", above=0.0)
    tau = number(tau, f"the time step {what}", "give a positive number")
    if not 0.0 < tau < np.inf:
        raise ProblemError(f"the time step {what} is {tau:g}; it must be positive")
    common_rows(f"the bond of law '{law.name}'", law.rows, gamma.size, w0.size, eta.size, beta.size)
    acts = (gamma > 0.0) & (beta > 0.0)
    return plus(law, _bond(tau, *np.broadcast_arrays(gamma, w0, eta, beta, acts))) if acts.any() else law


def _bond(tau: float, gamma: Array, w0: Array, eta: Array, beta: Array, acts: BoolArray) -> Superpotential:
    """The bond alone, numbers (m,) each: it slides where it is opened far enough, is intact before, and then closed."""
    rate = np.where(acts, np.sqrt(tau * gamma / eta), 1.0)
    first = np.where(acts, tau * w0 / (eta * np.where(acts, beta, 1.0)), 0.0)  # (rate w)^2 at which beta starts to fall
    weight = np.where(acts, gamma * (beta + tau * w0 / eta) ** 2 / rate, 0.0)
    sliding = Region(scaled(moved(_Fading(), rate, np.zeros(1)), weight))
    intact = Region(spring=np.where(acts, gamma * beta**2, 0.0))
    cuts, everywhere = [-np.sqrt(first) / rate, np.zeros(1)], Interval(np.array([-np.inf]), np.array([np.inf]))
    return spliced([sliding, intact, Region()], cuts, everywhere, "bond", lambda _, below, above: (below, below))


@dataclass(frozen=True, eq=False)
class _Fading(Superpotential):
    """``r^2/(2 (1 + r^2))``: a spring that fades; its curvature turns round at -1, 0 and 1."""

    name: str = "bond"

    @property
    def knots(self) -> Array:
        return np.array([[-1.0, 0.0, 1.0]])

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return np.asarray(0.5 * r**2 / (1.0 + r**2))

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return np.asarray(r / (1.0 + r**2) ** 2)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return np.asarray((1.0 - 3.0 * r**2) / (1.0 + r**2) ** 3)

    def piece_formula(self, piece: int) -> str:
        return "r/(1 + r^2)^2"

    @property
    def weak_convexity(self) -> Array:
        return np.full(1, 0.25)

    @property
    def growth(self) -> tuple[Array, Array]:
        return np.full(1, 0.1875 * math.sqrt(3.0)), np.zeros(1)

    def recession(self, sign: Array) -> Array:
        return np.zeros(np.shape(sign))
