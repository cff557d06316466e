"""Laws with piecewise linear derivative (piecewise quadratic potential): one table, everything else in closed form."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from hemivar.basics.arguments import one_line, shortened
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.minimisers import MANY
from hemivar.laws.superpotential import Interval, Superpotential, entry

__all__ = ["PiecewiseQuadratic", "TabulatedLaw"]


class TabulatedLaw(Superpotential):
    """A law whose derivative is piecewise linear: all that is asked of it is read from its table."""

    @property
    @abstractmethod
    def table(self) -> PiecewiseQuadratic:
        """The law with resolved parameters, as knots, slopes and jumps."""

    @property
    def knots(self) -> Array:
        return self.table._stated_knots

    @property
    def domain(self) -> Interval:
        return Interval(np.asarray(self.table.lower), np.asarray(self.table.upper))

    def _anchor(self, piece: IntArray) -> tuple[Array, Array]:
        """Knot to which the formula of each piece refers, and j' there on the side of the piece."""
        knots, slopes = self.table._anchors
        return entry(knots, piece), entry(slopes, piece)

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        anchor, slope, base = (entry(table, piece) for table in self.table._energies)
        s = r - anchor
        return base + slope * s + 0.5 * entry(self.table.slopes, piece) * s**2

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        t, slope = self._anchor(piece)
        return slope + entry(self.table.slopes, piece) * (r - t)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        curvature = entry(self.table.slopes, piece)
        return np.broadcast_to(curvature, np.broadcast_shapes(curvature.shape, np.shape(r)))

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        (t, slope), bend = self._anchor(piece), entry(self.table.slopes, piece)
        line = slope + bend * (r - t)
        return line, np.broadcast_to(bend, line.shape)

    def _knot_sides(self) -> tuple[Array, Array]:
        table = self.table
        lower, upper = np.asarray(table.lower)[..., None], np.asarray(table.upper)[..., None]
        left, right = np.where(table.breakpoints <= lower, -np.inf, table._left), table._right
        return left, np.where(table.breakpoints >= upper, np.inf, right)

    @property
    def straight(self) -> bool:
        return True

    @property
    def weak_convexity(self) -> Array:
        return self.table._alpha

    @property
    def growth(self) -> tuple[Array, Array]:
        table = self.table
        bounded = np.isneginf(table.lower) & np.isposinf(table.upper)
        c1 = np.maximum(np.abs(table.slopes[..., 0]), np.abs(table.slopes[..., -1]))
        largest = np.maximum(np.abs(table._left), np.abs(table._right)) - c1[..., None] * np.abs(table.breakpoints)
        at_origin = self.subdifferential(np.zeros(len(table.breakpoints)))
        c0 = np.maximum(np.max(largest, axis=-1), np.maximum(np.abs(at_origin.lower), np.abs(at_origin.upper)))
        c0 = np.maximum(c0, 0.0)
        return np.where(bounded, c0, np.inf), np.where(bounded, c1, np.inf)

    def asymptotic_curvature(self, sign: float) -> Array:
        table = self.table
        end, slope = (table.upper, table.slopes[..., -1]) if sign > 0.0 else (table.lower, table.slopes[..., 0])
        return np.where(np.isfinite(end), np.inf, slope)

    def piece_formula(self, piece: int) -> str:
        table = self.table
        t, slope = (float(x[0]) for x in self._anchor(np.array([piece])))
        k = float(table.slopes[0, piece])
        if k == 0.0:
            return f"{slope + 0.0:.6g}"
        constant = slope - k * t
        if abs(constant) <= 1e-14 * float(np.abs(table._left).max() + np.abs(table._right).max() + abs(k * t)):
            return f"{k:.6g} r"
        return f"{constant:.6g} {'+' if k > 0 else '-'} {abs(k):.6g} r"

    def recession(self, sign: Array) -> Array:
        sign, table = np.asarray(sign, dtype=float), self.table
        up = _rate(table.slopes[..., -1], table._right[..., -1], np.isfinite(table.upper))
        down = _rate(table.slopes[..., 0], -table._left[..., 0], np.isfinite(table.lower))
        with np.errstate(invalid="ignore"):
            return np.where(sign > 0, sign * up, np.where(sign < 0, -sign * down, 0.0))

    def scaled(self, factor: Array | float) -> Superpotential:
        factor, table = np.atleast_1d(real_array(factor, f"the factor of law '{self.name}'", finite=False)), self.table
        if self.searched and factor.size > 1:  # one table for all points, not one for each
            return Superpotential.scaled(table, factor)
        times, ends = factor[:, None], (table.lower, table.upper)
        sides = times * table._left, times * table._right
        made = table.with_sides(table._stated_knots, times * table.slopes, *sides, ends, self.name)
        if not np.isfinite(made.slopes).all() or not np.isfinite(made.start).all():
            raise ProblemError(
                f"law '{self.name}': with the factor {factor.max():g} a slope overflows; take other units"
            )
        return made


@dataclass(frozen=True, eq=False)
class PiecewiseQuadratic(TabulatedLaw):
    """Superpotential whose derivative is piecewise linear, with jumps.

    The derivative equals ``start`` just left of the first knot, rises with ``slopes[i]`` on piece ``i`` and jumps
    by ``jumps[i]`` at knot ``i``; a negative jump makes the law nonmonotone.  Outside ``[lower, upper]`` j = +inf.

    Parameters
    ----------
    breakpoints : array (K,) or (m, K)
        Knots, increasing along the last axis.
    slopes : array (K + 1,) or (m, K + 1)
        Slope of j' on each piece (force per area and length).
    jumps : array (K,) or (m, K)
        Jump of j' at each knot (force per area); ignored at an end of the domain.
    start : array (), (m,)
        j' just left of the first knot.
    lower, upper : arrays (), (m,)
        Domain; an end must be infinite or a knot.
    name : str
        Used in messages.
    stated : mapping, optional
        See :attr:`Superpotential.stated`.

    Raises
    ------
    ProblemError
        Knots not increasing, wrong shapes, nan, or a domain end that is not a knot.
    """

    breakpoints: Array
    slopes: Array
    jumps: Array
    start: Array | float = 0.0
    lower: Array | float = -np.inf
    upper: Array | float = np.inf
    name: str = "piecewise"
    stated: Mapping[str, object] | None = field(default=None, repr=False, compare=False)  # type: ignore[assignment]
    _stated_knots: Array = field(init=False, repr=False)
    _left: Array = field(init=False, repr=False)
    _right: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        one_line(self.name, "the name of a law")
        knots, slopes, jumps = (
            np.atleast_2d(real_array(values, f"{what} of law '{self.name}'", finite=False))
            for what, values in (("knots", self.breakpoints), ("slopes", self.slopes), ("jumps", self.jumps))
        )
        count = knots.shape[-1]
        if count < 1 or slopes.shape[-1] != count + 1 or jumps.shape[-1] != count:
            raise ProblemError(
                f"law '{self.name}': {count} knots need {count + 1} slopes and {count} jumps, "
                f"not {slopes.shape[-1]} and {jumps.shape[-1]}; give at least one knot"
            )
        for what, values in (
            ("knot", knots),
            ("slope", slopes),
            ("jump", jumps),
            ("start", np.asarray(self.start)),
        ):
            if not np.isfinite(values).all():
                raise ProblemError(f"law '{self.name}': a {what} is not finite; give finite numbers")
        if (np.diff(knots, axis=-1) <= 0).any():
            raise ProblemError(f"law '{self.name}': the knots must increase strictly, got {shortened(knots[0])}")
        if not knots.ndim == slopes.ndim == jumps.ndim == 2:
            raise ProblemError(f"law '{self.name}': knots, slopes and jumps must have 1 or 2 axes")
        rows = np.broadcast_shapes(
            knots.shape[:1],
            slopes.shape[:1],
            jumps.shape[:1],
            *(np.atleast_1d(v).shape for v in self._scalars()),
        )
        knots = np.broadcast_to(knots, (*rows, count))
        slopes = np.broadcast_to(slopes, (*rows, count + 1))
        jumps = np.broadcast_to(jumps, (*rows, count))
        start, lower, upper = (
            np.broadcast_to(real_array(v, f"an end or the start of law '{self.name}'", finite=False), rows)
            for v in self._scalars()
        )
        for end in (lower, upper):
            if (np.isfinite(end) & ~np.any(knots == end[..., None], axis=-1)).any():
                raise ProblemError(f"law '{self.name}': a finite end of the domain must be one of the knots")
        if (lower > upper).any():
            raise ProblemError(f"law '{self.name}': the domain is empty; lower must be at most upper")
        left, right = _summed(knots, slopes, jumps, start)
        self._lay_out(knots, slopes, left, right, (lower, upper), jumps)

    @classmethod
    def with_sides(
        cls,
        knots: Array,
        slopes: Array,
        below: Array,
        above: Array,
        ends: tuple[Array | float, Array | float],
        name: str,
    ) -> Self:
        """The law with these knots (m, K), slopes (m, K + 1) of j', and j' just below and above every knot (m, K).

        The sides are not summed up again: far away, where a law has no force at all, that would leave rounding.

        Parameters
        ----------
        knots : array
            Unused ones stand at the end and are +inf; what is said about them is not looked at.
        ends : pair of arrays (m,)
            Domain; an end is infinite or one of the knots.
        """
        rows = np.broadcast_shapes(
            *(np.shape(part)[:1] for part in (knots, slopes, below, above)), *(np.shape(np.atleast_1d(e)) for e in ends)
        )
        count = knots.shape[-1]
        knots, below, above = (np.broadcast_to(part, (*rows, count)) for part in (knots, below, above))
        made = object.__new__(cls)
        object.__setattr__(made, "name", name)
        lower, upper = (np.broadcast_to(np.atleast_1d(end), rows) for end in ends)
        made._lay_out(knots, np.broadcast_to(slopes, (*rows, count + 1)), below, above, (lower, upper))
        return made

    def _lay_out(
        self,
        stated: Array,
        slopes: Array,
        left: Array,
        right: Array,
        ends: tuple[Array, Array],
        jumps: Array | None = None,
    ) -> None:
        knots, used, count = filled(stated), np.isfinite(stated), stated.shape[-1]
        if not used.all():  # an unused knot lies on the last piece and is none of the knots that are told
            last = np.sum(used, axis=-1, keepdims=True) - 1
            slopes = np.where(np.arange(count + 1) > last + 1, np.take_along_axis(slopes, last + 1, -1), slopes)
            rise = slopes[..., -1:] * (knots - np.take_along_axis(knots, last, -1))
            along = np.take_along_axis(right, last, -1) + rise
            left, right = np.where(used, left, along), np.where(used, right, along)
        for key, item in (
            ("breakpoints", knots),
            ("slopes", slopes),
            ("jumps", right - left if jumps is None else jumps),
            ("start", left[..., 0]),
            ("lower", ends[0]),
            ("upper", ends[1]),
            ("_stated_knots", stated),
            ("_left", left),
            ("_right", right),
        ):
            object.__setattr__(self, key, item)

    def _scalars(self) -> tuple[Array | float, Array | float, Array | float]:
        return self.start, self.lower, self.upper

    @property
    def table(self) -> Self:
        return self

    @cached_property
    def _anchors(self) -> tuple[Array, Array]:
        """For each piece the knot that its formula refers to, and j' there on the side of the piece; (m, K + 1)."""
        knots = self.breakpoints
        return np.concatenate([knots[:, :1], knots], axis=1), np.concatenate([self._left[:, :1], self._right], axis=1)

    @cached_property
    def _energies(self) -> tuple[Array, Array, Array]:
        """For each piece its place nearest to the origin, j' there on the side of the piece, and j; (m, K + 1).

        j is summed from the origin outwards: where it is small, no energy of far knots rounds it.
        """
        knots, bends = self.breakpoints, self.slopes
        origin = np.clip(np.zeros(len(knots)), self.lower, self.upper)[:, None]
        ends = np.concatenate([knots, knots[:, -1:]], axis=1), np.concatenate([knots[:, :1], knots], axis=1)
        first, last = np.arange(bends.shape[1]) == 0, np.arange(bends.shape[1]) == knots.shape[1]
        above, below = np.where(last, np.inf, ends[0]) <= origin, np.where(first, -np.inf, ends[1]) >= origin
        near = np.where(above, ends[0], np.where(below, ends[1], origin))
        anchors, sides = self._anchors
        slope = np.where(above, np.concatenate([self._left, sides[:, -1:]], axis=1), sides + bends * (near - anchors))
        up, down = ((slope + 0.5 * bends * (end - near)) * (end - near) for end in ends)
        rises, falls = np.cumsum(up[:, :-1], axis=1), np.cumsum(down[:, :0:-1], axis=1)[:, ::-1]
        values = rises + falls
        base = np.where(above, values[:, [*range(knots.shape[1]), -1]], values[:, [0, *range(knots.shape[1])]])
        return near, slope, np.where(above | below, base, 0.0)

    def _inside(self) -> tuple[BoolArray, BoolArray]:
        """Pieces and knots that lie inside the domain (knots: strictly)."""
        knots = self.breakpoints
        lower, upper = np.asarray(self.lower)[..., None], np.asarray(self.upper)[..., None]
        ends = np.concatenate([knots, np.full((*knots.shape[:-1], 1), np.inf)], axis=-1)
        starts = np.concatenate([np.full((*knots.shape[:-1], 1), -np.inf), knots], axis=-1)
        return (ends > lower) & (starts < upper), (knots > lower) & (knots < upper)

    @cached_property
    def _alpha(self) -> Array:
        pieces, knots = self._inside()
        softening = np.max(np.where(pieces, -self.slopes, 0.0), axis=-1)
        falls = np.any(knots & (self.jumps < 0.0), axis=-1)
        return np.where(falls, np.inf, np.maximum(softening, 0.0))

    def at(self, points: Array | None) -> PiecewiseQuadratic:
        rows = len(self.breakpoints)
        if points is not None and rows not in (1, len(points)):
            raise ProblemError(f"law '{self.name}' is a table for {rows} contact points, but there are {len(points)}")
        return self

    def take(self, index: IntArray) -> PiecewiseQuadratic:
        if len(self.breakpoints) == 1:
            return self
        ends = np.asarray(self.lower)[index], np.asarray(self.upper)[index]
        return self.with_sides(
            self._stated_knots[index], self.slopes[index], self._left[index], self._right[index], ends, self.name
        )


def _summed(knots: Array, slopes: Array, jumps: Array, start: Array) -> tuple[Array, Array]:
    """j' to the left and to the right of each knot, (m, K) each."""
    width, count = np.diff(knots, axis=-1), knots.shape[-1]
    if count > MANY:  # sums in the order of the knots: jump, rise, jump, rise, ...
        steps = np.empty((*knots.shape[:-1], 2 * count))
        steps[..., 0], steps[..., 1::2], steps[..., 2::2] = start, jumps, slopes[..., 1:-1] * width
        reached = np.cumsum(steps, axis=-1)
        tiny = 4.0 * np.finfo(float).eps * np.abs(reached).max(axis=-1, keepdims=True)
        reached = np.where(np.abs(reached) <= tiny, 0.0, reached)
        return reached[..., 0::2].copy(), reached[..., 1::2].copy()
    left, right = np.empty(knots.shape), np.empty(knots.shape)
    left[..., 0], right[..., 0] = start, _added(start, jumps[..., 0])
    for i in range(1, count):
        left[..., i] = _added(right[..., i - 1], slopes[..., i] * width[..., i - 1])
        right[..., i] = _added(left[..., i], jumps[..., i])
    return left, right


def filled(knots: Array) -> Array:
    """Knots (m, K) with finite places, beyond the last one, instead of the unused entries +inf."""
    absent = ~np.isfinite(knots)
    if not absent.any():
        return knots
    last = np.max(np.where(absent, -np.inf, knots), axis=-1, keepdims=True)
    step = np.where(last == 0.0, 1.0, np.abs(last))
    return np.where(absent, last + step * np.cumsum(absent, axis=-1), knots)


def _added(x: Array, y: Array) -> Array:
    """x + y, and zero where they cancel up to rounding: what should vanish must not be the only force there is."""
    total = x + y
    return np.where(np.abs(total) <= 4.0 * np.finfo(float).eps * np.maximum(np.abs(x), np.abs(y)), 0.0, total)


def _rate(slope: Array, derivative: Array, limited: BoolArray) -> Array:
    """Limit of j(t)/t along a ray on which j' tends to ``derivative`` and has the given slope."""
    return np.where(limited | (slope > 0.0), np.inf, np.where(slope < 0.0, -np.inf, derivative))
