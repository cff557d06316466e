"""Unloading along the secant: glue that has been opened once is softer from then on, and does not heal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.exact_table import MANY, count_knots, filled, merged, pick, table, table_of
from hemivar.laws.transformed.transformed_law import LawOfOne, by_parts, check_law, falls_between, numbers, row

__all__ = ["SecantLaw", "secant", "secant_stiffness"]


def secant(law: Superpotential, opening: Array | float) -> Superpotential:
    """The law after the opening w = -r has once been as large as ``opening``, D.

    Up to D the tension is ``g(D)/D w``, g(w) = -j'(-w) the tension of the law; beyond D, and in penetration, it is
    that of the law.  Where g jumps at D, it is taken from the side of the smaller openings: a point that has come as
    far as its strength, and not farther, holds.  Alpha is at most that of the law: the secant does not fall.

    Parameters
    ----------
    law : Superpotential
        With resolved parameters; zero must be in its domain.
    opening : number or array (m,)
        D >= 0; more than the law allows counts as the end of its domain.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        A negative opening, or a law that pushes at D.
    """
    check_law(law)
    known = numbers(opening, f"the largest opening of law '{law.name}'", least=0.0)
    stacked = by_parts(law, lambda part, index: secant(part, row(known, index)))
    if stacked is not None:
        return stacked
    if (known == 0.0).all():
        return law
    opening = np.minimum(known, -law.domain.lower)
    stiffness = secant_stiffness(law, opening)
    base = table_of(law)
    if base is None or (base.knots.shape[-1] > MANY and opening.size > 1):
        return SecantLaw(law, opening, stiffness)
    return _secant_table(base, opening, stiffness, law.name)


def secant_stiffness(law: Superpotential, opening: Array) -> Array:
    """g(D)/D at every contact point, 0 where D = 0; see :func:`secant`."""
    bound = law.domain
    if (bound.lower > 0.0).any() or (bound.upper < 0.0).any():
        raise ProblemError(f"law '{law.name}' does not allow r = 0, where secant unloading ends; leave the memory out")
    rows = max(opening.size, law.knots.shape[0])
    wide = np.broadcast_to(opening, (rows,))
    after = count_knots(law.knots, -wide[:, None], including=True)[:, 0]
    pull = -law.piece_derivative(after, -wide)
    pushing = (wide > 0.0) & (pull < 0.0)
    if pushing.any():
        i = int(np.argmax(pushing))
        raise ProblemError(
            f"law '{law.name}' pushes with {-pull[i]:g} at the opening {wide[i]:g}; secant unloading needs a law that "
            f"pulls or is free in opening, such as Adhesive"
        )
    return np.where(wide > 0.0, pull / np.where(wide > 0.0, wide, 1.0), 0.0)


def _places(knots: Array, opening: Array) -> Array:
    """The knots of the law that the secant leaves, and its ends (m, n)."""
    rows = max(knots.shape[0], opening.size)
    knots = np.broadcast_to(knots, (rows, knots.shape[-1]))
    wide = np.broadcast_to(opening, (rows,))[:, None]
    outside = np.where((knots > -wide) & (knots < 0.0), np.inf, knots)
    return merged(np.concatenate([outside, -wide, np.zeros((rows, 1))], axis=-1))


def _secant_table(law: PiecewiseQuadratic, opening: Array, stiffness: Array, name: str) -> PiecewiseQuadratic:
    places = _places(law.knots, opening)
    knots = filled(places)
    rows = len(knots)
    start = np.concatenate([np.full((rows, 1), -np.inf), knots], axis=-1)
    wide, steep = opening[:, None], np.broadcast_to(stiffness, (rows,))[:, None]
    before, after = count_knots(law.knots, knots, including=False), count_knots(law.knots, knots, including=True)
    first = np.broadcast_to(law.slopes[:, :1], (rows, 1))
    slopes = np.concatenate([first, pick(law.slopes, after)], axis=-1)
    slopes = np.where((start >= -wide) & (start < 0.0), steep, slopes)
    below, above = _one_sided(law, knots, before, after)
    inside = (knots > -wide) & (knots < 0.0)  # at -D itself the secant ends on the law: no kink by rounding there
    above = np.where(inside, steep * knots, above)
    below = np.where((knots > -wide) & (knots <= 0.0), steep * knots, below)
    steepest = np.maximum(np.abs(law.slopes[:, :-1]), np.abs(law.slopes[:, 1:]))
    more = np.where(np.abs(law.breakpoints) <= wide, steepest * np.abs(law.breakpoints), 0.0)
    above = np.where((knots == 0.0) & _rounding(law, above - below, wide, more), below, above)
    return table(places, slopes, below, above, (np.asarray(law.lower), np.asarray(law.upper)), name)


def _rounding(law: Superpotential, jump: Array, wide: Array, more: Array) -> BoolArray:
    """Whether jumps (m, n) of j' at zero are what rounding makes of the forces of the law up to the opening ``wide``.

    ``more (m, 1 or K)`` are other forces that are rounded.
    """
    opened = (law.knots <= 0.0) & (law.knots >= -wide)
    left, right = (np.where(opened & np.isfinite(side), np.abs(side), 0.0) for side in law.knot_slopes())
    size = np.max(np.maximum(left, right), axis=-1, keepdims=True)
    size = np.maximum(size, np.max(more, axis=-1, keepdims=True))
    return np.asarray(np.abs(jump) <= 8.0 * np.finfo(float).eps * size)


def _one_sided(law: PiecewiseQuadratic, knots: Array, before: IntArray, after: IntArray) -> tuple[Array, Array]:
    """j' of the law below and above each place, exact at its own knots."""
    own = np.minimum(before, law.knots.shape[-1] - 1)
    anchor = np.maximum(before - 1, 0)
    slope = np.where(before == 0, pick(law._left, np.zeros_like(before)), pick(law._right, anchor))
    between = slope + pick(law.slopes, before) * (knots - pick(law.breakpoints, anchor))
    here = after > before
    return np.where(here, pick(law._left, own), between), np.where(here, pick(law._right, own), between)


@dataclass(frozen=True, eq=False)
class SecantLaw(LawOfOne):
    """The law with a secant up to the largest opening, of any law; see :func:`secant`."""

    base: Superpotential
    opening: Array
    stiffness: Array

    @cached_property
    def knots(self) -> Array:  # type: ignore[override]
        return _places(self.base.knots, self.opening)

    @property
    def domain(self) -> Interval:
        return self.base.domain

    @cached_property
    def _map(self) -> IntArray:
        """The piece of the law that each piece is a part of; -1 for the secant."""
        knots = self.knots
        start = np.concatenate([np.full((len(knots), 1), -np.inf), knots], axis=-1)
        count = self.base.knots.shape[-1]
        own = np.where(np.isfinite(start), count_knots(self.base.knots, start, including=True), count)
        own = np.where(np.isneginf(start), 0, own)
        return np.where((start >= -self.opening[:, None]) & (start < 0.0), -1, own)

    def _evaluate(self, piece: IntArray, base: Array, along: Array) -> Array:
        return np.where(pick(self._map, np.asarray(piece)) < 0, along, base)

    def _own(self, piece: IntArray) -> IntArray:
        return np.maximum(pick(self._map, np.asarray(piece)), 0)

    @cached_property
    def _raised(self) -> Array:
        """How much lower the value at the largest opening is than that of the law."""
        return 0.5 * self.stiffness * self.opening**2 - self.base.value(-self.opening + np.zeros(len(self.knots)))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        beyond = np.asarray(r) < 0.0
        law = self.base.piece_value(self._own(piece), r) + np.where(beyond, self._raised, 0.0)
        return self._evaluate(piece, law, 0.5 * self.stiffness * np.square(r))

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._evaluate(piece, self.base.piece_derivative(self._own(piece), r), self.stiffness * r)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        along = self.stiffness + 0.0 * np.asarray(r)
        return self._evaluate(piece, self.base.piece_curvature(self._own(piece), r), along)

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        left, right = super().knot_slopes()
        knots, own = self.knots, self._map
        base_left, base_right = self.base.knot_slopes()
        for i in range(knots.shape[-1]):  # the law's own knots as it tells them
            before, after = own[:, i], own[:, i + 1]
            at = count_knots(self.base.knots, knots[:, i : i + 1], including=False)[:, 0]
            at = np.minimum(at, self.base.knots.shape[-1] - 1)
            here = (pick(self.base.knots, at) == knots[:, i]) & np.isfinite(knots[:, i])
            left[:, i] = np.where(here & (before >= 0), pick(base_left, at), left[:, i])
            right[:, i] = np.where(here & (after >= 0), pick(base_right, at), right[:, i])
            joined = (knots[:, i] == -self.opening) & ~here  # no kink by rounding where the secant ends
            left[:, i] = np.where(joined, right[:, i], left[:, i])
            ends = (knots[:, i] == 0.0) & (before < 0)
            jump = (right[:, i] - left[:, i])[:, None]
            force = (self.stiffness * self.opening)[:, None]
            rounding = _rounding(self.base, jump, self.opening[:, None], force)[:, 0]
            right[:, i] = np.where(ends & rounding, left[:, i], right[:, i])
        return left, right

    def knot_slopes(self) -> tuple[Array, Array]:
        return self._slopes

    def piece_formula(self, piece: int) -> str:
        own = int(self._map[0, piece])
        return self.base.piece_formula(own) if own >= 0 else f"{float(self.stiffness[0]):.6g} r"

    @cached_property
    def weak_convexity(self) -> Array:  # type: ignore[override]
        left, right = self._slopes
        bound = self.domain
        inner = (self.knots > bound.lower[..., None]) & (self.knots < bound.upper[..., None])
        worst = np.zeros(len(self.knots))
        for i in range(self.knots.shape[-1] + 1):
            low, high = (np.broadcast_to(end, worst.shape) for end in self.piece_bounds(np.full(worst.shape, i)))
            falls = falls_between(self.base, np.maximum(self._map[:, i], 0), low, high)
            worst = np.maximum(worst, np.where(self._map[:, i] < 0, 0.0, falls))
        return np.where(np.any(inner & (right < left), axis=-1), np.inf, worst)

    @property
    def growth(self) -> tuple[Array, Array]:
        return self.base.growth

    def recession(self, sign: Array) -> Array:
        return self.base.recession(sign)

    def asymptotic_curvature(self, sign: float) -> Array:
        return self.base.asymptotic_curvature(sign)
