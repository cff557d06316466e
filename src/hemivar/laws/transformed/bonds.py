"""A bond that fades: a bonding (damage) field in [0, 1] that falls where glue is stretched more than it can bear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.arguments import number
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.parameters import common_rows
from hemivar.laws.piecewise_law import pick
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed.algebra import plus
from hemivar.laws.transformed.transformed_law import check_law, numbers

__all__ = ["BondLaw", "bonded"]


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
    made = BondLaw(
        numbers(stiffness, f"the stiffness {what}", least=0.0),
        numbers(energy, f"the energy {what}", least=0.0),
        numbers(viscosity, f"the viscosity {what}", above=0.0),
        beta,
        number(tau, f"the time step {what}", "give a positive number"),
    )
    if not 0.0 < made.tau < np.inf:
        raise ProblemError(f"the time step {what} is {made.tau:g}; it must be positive")
    sizes = (made.stiffness.size, made.energy.size, made.viscosity.size, beta.size)
    common_rows(f"the bond of law '{law.name}'", law.rows, *sizes)
    return plus(law, made) if ((made.stiffness > 0.0) & (beta > 0.0)).any() else law


@dataclass(frozen=True, eq=False)
class BondLaw(Superpotential):
    """The bond alone; see :func:`bonded`. Pieces are of three kinds: sliding (0), intact (1), closed (2)."""

    stiffness: Array
    energy: Array
    viscosity: Array
    field: Array
    tau: float
    name: str = "bond"

    @cached_property
    def _numbers(self) -> tuple[Array, Array, Array, Array, Array]:
        """stiffness, beta_n, B, y at which beta starts to fall, and y per w^2, each (m,)."""
        gamma, w0, eta, beta = np.broadcast_arrays(self.stiffness, self.energy, self.viscosity, self.field)
        most = beta + self.tau * w0 / eta
        with np.errstate(divide="ignore", invalid="ignore"):
            first = np.where(beta > 0.0, self.tau * w0 / (eta * np.where(beta > 0.0, beta, 1.0)), np.inf)
        return gamma, beta, most, first, self.tau * gamma / eta

    @cached_property
    def _table(self) -> tuple[Array, IntArray]:
        _, _, _, first, scale = self._numbers
        with np.errstate(divide="ignore"):
            unit = 1.0 / np.sqrt(scale)
            broken, turn = -unit * np.sqrt(first), -unit
        broken = np.where(np.isfinite(broken), broken, np.nan)
        turns = (first < 1.0) & np.isfinite(broken)
        zero = np.zeros_like(broken)
        starts = first == 0.0  # the bond falls from w = 0 on
        whole = np.isnan(broken)
        columns = np.stack([np.where(turns, turn, np.inf), np.where(whole | starts, np.inf, broken), zero], axis=-1)
        knots = np.sort(columns, axis=-1)
        count = np.sum(np.isfinite(knots), axis=-1)[:, None]
        number = np.arange(4)[None, :]
        kinds = np.where(number >= count, 2, np.where((number == count - 1) & ~starts[:, None], 1, 0))
        return knots, kinds.astype(np.int64)

    @property
    def knots(self) -> Array:
        return self._table[0]

    def _at(self, piece: IntArray, r: Array) -> tuple[IntArray, Array]:
        kind = pick(self._table[1], np.asarray(piece))
        return kind, np.where(kind == 2, 0.0, np.asarray(r, dtype=float))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        kind, r = self._at(piece, r)
        gamma, beta, most, first, scale = self._numbers
        sliding = kind == 0
        y, start = np.where(sliding, scale * r**2, 0.0), np.where(sliding & np.isfinite(first), first, 0.0)
        unit = np.where(scale > 0.0, gamma / np.where(scale > 0.0, scale, 1.0), 0.0)
        broken = 0.5 * unit * (beta**2 * start + most**2 * (y - start) / ((1.0 + start) * (1.0 + y)))
        return np.where(sliding, broken, 0.5 * gamma * beta**2 * r**2)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        kind, r = self._at(piece, r)
        gamma, beta, most, _, scale = self._numbers
        return np.where(kind == 0, gamma * (most / (1.0 + scale * r**2)) ** 2, gamma * beta**2) * r

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        kind, r = self._at(piece, r)
        gamma, beta, most, _, scale = self._numbers
        y = scale * r**2
        bent = np.where(kind == 0, gamma * most**2 * (1.0 - 3.0 * y) / (1.0 + y) ** 3, gamma * beta**2)
        return np.where(kind == 2, 0.0, bent)

    def _knot_sides(self) -> tuple[Array, Array]:
        left, _ = super()._knot_sides()
        return left, left  # there are no kinks

    def piece_formula(self, piece: int) -> str:
        kind = int(self._table[1][0, piece])
        gamma, beta, most, _, scale = (float(x[0]) for x in self._numbers)
        if kind == 2:
            return "0"
        return f"{gamma * beta**2:.6g} r" if kind else f"{gamma * most**2:.6g} r/(1 + {scale:.6g} r^2)^2"

    @property
    def weak_convexity(self) -> Array:
        gamma, beta, most, first, _ = self._numbers
        late = np.where(np.isfinite(first), np.maximum(first, 1.0), 1.0)
        with np.errstate(invalid="ignore"):
            alpha = gamma * most**2 * (3.0 * late - 1.0) / (1.0 + late) ** 3
        return np.where(beta > 0.0, alpha, 0.0)

    @property
    def growth(self) -> tuple[Array, Array]:
        gamma, beta, most, first, scale = self._numbers
        y = np.maximum(np.where(np.isfinite(first), first, 0.0), 1.0 / 3.0)
        at = np.sqrt(y / np.where(scale > 0.0, scale, 1.0))
        largest = np.where((beta > 0.0) & (scale > 0.0), gamma * (most / (1.0 + y)) ** 2 * at, 0.0)
        return largest, np.zeros_like(largest)

    def recession(self, sign: Array) -> Array:
        return np.zeros(np.broadcast_shapes(np.shape(sign), self._numbers[0].shape))
