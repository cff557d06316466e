"""Closure of a rock joint: springs that stiffen without bound towards the largest closure (normal law)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray, Parameter
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import LENGTH, RATE, positive
from hemivar.laws.parametrised import ParameterLaw, columns
from hemivar.laws.superpotential import Interval

__all__ = ["BartonBandis"]

#: Part of the largest closure from which on the joint is rigid: there the pressure is 1e3 times stiffness x closure.
_FULL = 1.0 - 1e-3


@named(
    LawKind.NORMAL,
    "barton-bandis",
    "closure of a rock joint: pressure stiffness r / (1 - r/closure), without bound towards the largest closure",
    "j(r) = -stiffness closure^2 (t + ln(1 - t)) for 0 < t = r/closure < 1, 0 for r <= 0, +inf beyond",
)
@dataclass(frozen=True, eq=False)
class BartonBandis(ParameterLaw):
    """Barton and Bandis: a joint closes under pressure and stiffens, and never closes by more than ``closure``.

    The pressure is ``stiffness r / (1 - r/closure)`` for a closure r > 0, and none where the joint is open. From a
    thousand times ``stiffness closure`` on the joint is rigid
    (S. C. Bandis, A. C. Lumsden, N. R. Barton, Fundamentals of rock joint deformation, 1983).

    Parameters
    ----------
    stiffness : Parameter
        Initial normal stiffness, > 0 (force per area and length).
    closure : Parameter
        Largest closure, > 0.

    Examples
    --------
    >>> import hemivar as hv
    >>> joint = hv.laws.BartonBandis(stiffness=10.0, closure=0.2)
    >>> joint.derivative([-0.1, 0.1, 0.18])
    array([ 0.,  2., 18.])
    """

    stiffness: Parameter = field(metadata=positive("at first touch", RATE, 2.0))
    closure: Parameter = field(metadata=positive("largest closure", LENGTH, 0.2))
    name: ClassVar[str] = "barton-bandis"  # type: ignore[misc]

    @cached_property
    def _resolved(self) -> tuple[Array, Array]:
        values = self._values(None)
        stiffness, closure = np.broadcast_arrays(values["stiffness"], values["closure"])
        return stiffness, closure

    @property
    def knots(self) -> Array:
        return columns(0.0, _FULL * self._resolved[1])

    @property
    def domain(self) -> Interval:
        return Interval(np.array([-np.inf]), _FULL * self._resolved[1])

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        stiffness, closure = self._resolved
        return np.where(piece > 0, -stiffness * closure**2 * _sum_with_log(self._part(r)), 0.0)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        stiffness, closure = self._resolved
        part = self._part(r)
        return np.where(piece > 0, stiffness * closure * part / (1.0 - part), 0.0)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return np.where(piece > 0, self._resolved[0] / (1.0 - self._part(r)) ** 2, 0.0)

    def _part(self, r: Array) -> Array:
        """Which part of the largest closure is used up."""
        return np.clip(r / self._resolved[1], 0.0, _FULL)

    def stationary_point(
        self, piece: IntArray, a: Array, b: Array, low: Array, high: Array, admissible: BoolArray
    ) -> tuple[Array, BoolArray]:
        """On the stiffening piece by the quadratic equation of ``(b - a r)(1 - r/closure) = stiffness r``."""
        root, exists = super().stationary_point(piece, a, b, low, high, admissible & (piece == 0))
        stiffness, closure = self._resolved
        loaded = admissible & (piece > 0)
        half = 0.5 * (a + stiffness + b / closure)
        closed = b / (half + np.sqrt(np.maximum(half**2 - a * b / closure, 0.0)))
        return np.where(loaded, np.minimum(closed, high), root), exists | loaded

    @property
    def weak_convexity(self) -> Array:
        return np.zeros(self._resolved[0].shape)

    def recession(self, sign: Array) -> Array:
        return np.where(np.asarray(sign) > 0.0, np.inf, 0.0)

    def asymptotic_curvature(self, sign: float) -> Array:
        return np.full(self._resolved[0].shape, np.inf if sign > 0.0 else 0.0)

    def piece_formula(self, piece: int) -> str:
        stiffness, closure = (float(x[0]) for x in self._resolved)
        return f"{stiffness:.6g} r / (1 - r/{closure:.6g})" if piece == 1 else "0"

    def scaled(self, factor: Array | float) -> BartonBandis:
        stiffness, closure = self._resolved
        return BartonBandis(np.atleast_1d(factor) * stiffness, closure)


def _sum_with_log(part: Array) -> Array:
    """t + ln(1 - t), to rounding where t is small: there by its series."""
    small = part < 1e-3
    series = -(part**2) * (1 / 2 + part * (1 / 3 + part * (1 / 4 + part * (1 / 5 + part * (1 / 6 + part / 7)))))
    return np.where(small, series, part + np.log1p(-np.where(small, 0.0, part)))
