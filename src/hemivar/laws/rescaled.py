"""Affine rescaling of laws: a law times a factor, of an argument that is scaled and shifted; parameters are known."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.compiled_law import LaidOut, lay_out
from hemivar.laws.parameters import common_rows
from hemivar.laws.proof import Constant, Proof
from hemivar.laws.superpotential import Interval, Superpotential

__all__ = ["RescaledLaw", "moved_ends", "separated"]


@dataclass(frozen=True, eq=False)
class RescaledLaw(Superpotential):
    """The law ``factor j(theta r + c)/theta``, whose derivative is ``factor j'(theta r + c)``, j that of ``base``.

    Many knots are not copied for each point: they are searched where the base has them.
    """

    base: Superpotential
    factor: Array  # (m,) or (1,), at least 0
    theta: Array = field(default_factory=lambda: np.ones(1))  # (m,) or (1,), > 0
    c: Array = field(default_factory=lambda: np.zeros(1))

    def __post_init__(self) -> None:
        factor = np.atleast_1d(real_array(self.factor, f"the factor of law '{self.base.name}'", finite=False))
        if not np.all(factor >= 0.0):
            raise ProblemError(f"law '{self.base.name}' is scaled by {factor.min():g}; a factor must be at least 0")
        object.__setattr__(self, "factor", factor)

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the law that is scaled."""
        return self.base.name

    @cached_property
    def moved(self) -> bool:
        """Whether the argument is another one."""
        return bool((self.theta != 1.0).any() or self.c.any())

    @cached_property
    def _least(self) -> float:
        """The least factor."""
        return float(self.factor.min(initial=np.inf))

    def _times(self, values: Array) -> Array:
        """Values times the factor, where 0 times infinity is 0."""
        if self._least > 0.0:
            return values if self._least == 1.0 and self.factor.size == 1 else np.asarray(self.factor * values)
        with np.errstate(invalid="ignore"):
            return np.where(self.factor > 0.0, self.factor * values, 0.0)

    def _argument(self, r: Array) -> Array:
        return np.asarray(self.theta * r + self.c) if self.moved else r

    # ---- where the knots lie -----------------------------------------------------------------------------

    @cached_property
    def rows(self) -> int:  # type: ignore[override]
        """Number of contact points, 1 if all are alike."""
        return common_rows(f"law '{self.name}'", self.factor.size, self.theta.size, self.c.size, self.base.rows)

    @property
    def searched(self) -> int:
        return self.base.searched

    def place_of(self, knot: IntArray) -> Array:
        if not self.searched:
            return super().place_of(knot)
        r = self.base.place_of(knot)
        return np.asarray((r - self.c) / self.theta) if self.moved else r

    def piece_of(self, r: Array) -> IntArray:
        if not self.searched:
            return super().piece_of(r)
        near = self.base.piece_of(self._argument(np.asarray(r, dtype=float)))
        if self.moved:  # the knot is where it is said to be, whatever rounding makes of its argument
            near = near + ((near < self.searched) & (self.place_of(np.minimum(near, self.searched - 1)) < r))
            near = near - ((near > 0) & (self.place_of(np.maximum(near - 1, 0)) >= r))
        return near

    @cached_property
    def knots(self) -> Array:  # type: ignore[override]
        """Those of the base, where they come to lie."""
        knots = self.base.knots
        if self.moved:
            knots = (knots - self.c[:, None]) / self.theta[:, None]
            knots = knots if self.searched else separated(knots)
        return np.broadcast_to(knots, (self.rows, knots.shape[-1]))

    @cached_property
    def domain(self) -> Interval:  # type: ignore[override]
        """Where j is finite, see there."""
        ends = self.base.domain
        if self.moved and self.searched:
            return Interval((ends.lower - self.c) / self.theta, (ends.upper - self.c) / self.theta)
        return moved_ends(self.base, self.knots) if self.moved else ends

    # ---- on the pieces -----------------------------------------------------------------------------------

    @property
    def straight(self) -> bool:
        return self.base.straight

    @cached_property
    def laid_out(self) -> LaidOut | None:  # type: ignore[override]
        """As the compiled kernels read it, see there."""
        if self.moved:
            return lay_out(self)
        base = self.base.laid_out
        return None if base is None else base.times(self.factor)

    @cached_property
    def _at_zero(self) -> Array:
        ends = self.base.domain
        return self.base.value(np.clip(np.broadcast_to(self.c, (self.rows,)), ends.lower, ends.upper))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        value = self.base.piece_value(piece, self._argument(r))
        return self._times((value - self._at_zero) / self.theta if self.moved else value)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._times(self.base.piece_derivative(piece, self._argument(r)))

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._times(self.theta * self.base.piece_curvature(piece, self._argument(r)))

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        slope, bend = self.base.piece_line(piece, self._argument(r))
        return self._times(slope), self._times(self.theta * bend if self.moved else bend)

    def slopes_at(self, knot: IntArray) -> tuple[Array, Array]:
        left, right = self.base.slopes_at(knot)
        return _sides(self.factor, left), _sides(self.factor, right)

    def _knot_sides(self) -> tuple[Array, Array]:
        left, right = (_sides(self.factor[:, None], side) for side in self.base.knot_slopes())
        return np.broadcast_to(left, (self.rows, left.shape[-1])), np.broadcast_to(right, (self.rows, right.shape[-1]))

    def piece_formula(self, piece: int) -> str:
        text, factor = self.base.piece_formula(piece), float(self.factor[0])
        if text and self.moved:
            text = f"({text}) at {float(self.theta[0]):.6g} r {float(self.c[0]):+.6g}"
        return text if factor == 1.0 or not text else f"{factor:.6g} ({text})"

    # ---- constants ---------------------------------------------------------------------------------------

    @cached_property
    def weak_convexity(self) -> Array:  # type: ignore[override]
        """alpha, see there."""
        return self._times(self.theta * self.base.weak_convexity)

    def proof(self, constant: Constant) -> Proof:
        known = self.base.proof(constant)
        (reach,) = known.reach
        if self.moved:
            reach = max(float(((reach - np.abs(self.c)) / self.theta).min(initial=np.inf)), 0.0)
        return replace(known, reach=(reach,), values=(self._alpha_within,) if constant == "alpha" else ())

    def _alpha_within(self, reach: float) -> Array:
        inner = reach if np.isinf(reach) else float((self.theta * reach + np.abs(self.c)).max(initial=0.0))
        return self._times(self.theta * self.base.proof("alpha").value(inner)[0])

    @property
    def growth(self) -> tuple[Array, Array]:
        c0, c1 = self.base.growth
        ends = np.isinf(c0) & (np.isfinite(self.domain.lower) | np.isfinite(self.domain.upper))
        with np.errstate(invalid="ignore"):
            c0 = np.where(np.isfinite(c1), c0 + c1 * np.abs(self.c), np.inf) if self.moved else c0
        return np.where(ends, np.inf, self._times(c0)), np.where(ends, np.inf, self._times(self.theta * c1))

    def recession(self, sign: Array) -> Array:
        return self._times(self.base.recession(sign) + np.zeros(self.theta.shape))

    def asymptotic_curvature(self, sign: float) -> Array:
        return self._times(self.theta * self.base.asymptotic_curvature(sign))

    def at(self, points: Array | None) -> RescaledLaw:
        return RescaledLaw(self.base.at(points), self.factor, self.theta, self.c)

    def scaled(self, factor: Array | float) -> RescaledLaw:
        return RescaledLaw(self.base, self.factor * np.atleast_1d(factor), self.theta, self.c)


def _sides(factor: Array, slopes: Array) -> Array:
    """Derivatives at knots times a factor, infinite at the ends of the domain whatever it is."""
    if factor.size == 1 and factor.flat[0] == 1.0:
        return slopes
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(slopes), slopes, factor * slopes)


def separated(knots: Array) -> Array:
    """Knots that rounding has made equal, moved apart as little as can be."""
    if ((knots[:, 1:] > knots[:, :-1]) | np.isinf(knots[:, 1:])).all():
        return knots
    knots = knots.copy()
    for i in range(1, knots.shape[-1]):
        knots[:, i] = np.maximum(knots[:, i], np.nextafter(knots[:, i - 1], np.inf))
    return knots


def moved_ends(law: Superpotential, places: Array) -> Interval:
    """The domain of a law whose knots have come to other places (m, K): its ends are the same knots."""
    knots, ends = law.knots, law.domain
    lower = np.where(knots == ends.lower[:, None], places, -np.inf).max(axis=-1)
    return Interval(lower, np.where(knots == ends.upper[:, None], places, np.inf).min(axis=-1))
