"""A law times one factor for each contact point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.superpotential import Interval, Superpotential

__all__ = ["ScaledLaw"]


@dataclass(frozen=True, eq=False)
class ScaledLaw(Superpotential):
    """The law ``factor * base``.

    Parameters
    ----------
    base : Superpotential
    factor : array (m,) or (1,)
        At least 0.
    """

    base: Superpotential
    factor: Array

    def __post_init__(self) -> None:
        factor = np.atleast_1d(real_array(self.factor, f"the factor of law '{self.base.name}'", finite=False))
        if not np.all(factor >= 0.0):
            raise ProblemError(f"law '{self.base.name}' is scaled by {factor.min():g}; a factor must be at least 0")
        object.__setattr__(self, "factor", factor)

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the law that is scaled."""
        return self.base.name

    @property
    def made_of(self) -> tuple[Superpotential, ...]:
        return (self.base,)

    def _times(self, values: Array) -> Array:
        """Values times the factor, where 0 times infinity is 0."""
        if self._positive:
            return np.asarray(self.factor * values)
        with np.errstate(invalid="ignore"):
            return np.where(self.factor > 0.0, self.factor * values, 0.0)

    @cached_property
    def _positive(self) -> bool:
        return bool((self.factor > 0.0).all())

    @property
    def _rows(self) -> int:
        return int(max(self.factor.size, self.base.knots.shape[0]))

    @property
    def knots(self) -> Array:
        return self._knots

    @cached_property
    def _knots(self) -> Array:
        knots = self.base.knots
        return np.broadcast_to(knots, (self._rows, knots.shape[-1]))

    @property
    def shared_knots(self) -> Array | None:
        return self.base.shared_knots

    def slopes_at(self, knot: IntArray) -> tuple[Array, Array]:
        with np.errstate(invalid="ignore"):
            left, right = (np.where(np.isinf(s), s, self.factor * s) for s in self.base.slopes_at(knot))
        return left, right

    @property
    def straight(self) -> bool:
        return self.base.straight

    @property
    def domain(self) -> Interval:
        return self.base.domain

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return self._times(self.base.piece_value(piece, r))

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._times(self.base.piece_derivative(piece, r))

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._times(self.base.piece_curvature(piece, r))

    @property
    def derivative_accuracy(self) -> float:
        return float(self.factor.max()) * self.base.derivative_accuracy

    def derivative_error(self, r: Array) -> Array:
        return self._times(self.base.derivative_error(r))

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        slope, bend = self.base.piece_line(piece, r)
        return self._times(slope), self._times(bend)

    def knot_slopes(self) -> tuple[Array, Array]:
        return self._slopes

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        factor = self.factor[:, None]
        with np.errstate(invalid="ignore"):
            left, right = (np.where(np.isinf(s), s, factor * s) for s in self.base.knot_slopes())
        return left, right

    def kinks(self) -> BoolArray:
        return self._kinks

    @cached_property
    def _kinks(self) -> BoolArray:
        left, right = self.knot_slopes()
        return np.asarray((left != right) & np.isfinite(self.knots))

    def piece_formula(self, piece: int) -> str:
        text = self.base.piece_formula(piece)
        factor = float(self.factor[0])
        return text if factor == 1.0 or not text else f"{factor:.6g} ({text})"

    @property
    def weak_convexity(self) -> Array:
        return self._alpha

    @cached_property
    def _alpha(self) -> Array:
        return self._times(self.base.weak_convexity)

    @property
    def alpha_reach(self) -> float:
        return self.base.alpha_reach

    def weak_convexity_within(self, reach: float) -> Array:
        return self._times(self.base.weak_convexity_within(reach))

    @property
    def growth(self) -> tuple[Array, Array]:
        c0, c1 = self.base.growth
        ends = np.isinf(c0) & (np.isfinite(self.domain.lower) | np.isfinite(self.domain.upper))
        return np.where(ends, np.inf, self._times(c0)), np.where(ends, np.inf, self._times(c1))

    def recession(self, sign: Array) -> Array:
        return self._times(self.base.recession(sign))

    def asymptotic_curvature(self, sign: float) -> Array:
        return self._times(self.base.asymptotic_curvature(sign))

    def at(self, points: Array | None) -> ScaledLaw:
        return ScaledLaw(self.base.at(points), self.factor)

    def scaled(self, factor: Array | float) -> ScaledLaw:
        return ScaledLaw(self.base, self.factor * np.atleast_1d(factor))

    def take(self, index: IntArray) -> ScaledLaw:
        factor = self.factor if self.factor.size == 1 else self.factor[index]
        return ScaledLaw(self.base.take(index) if self.base.knots.shape[0] > 1 else self.base, factor)
