"""A law as data: its knots, which pieces of which laws act between them, and the derivative on both sides of a knot.

Sums, secants, slipped profiles and dampers that cannot pull are such laws; of tables they are tables again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.exact_table import MANY, pick, table_of
from hemivar.laws.transformed.transformed_law import TransformedLaw, falls_between, row, taken
from hemivar.laws.transformed.turns import steepest_fall

__all__ = ["LawGraph", "Term", "beside", "law_graph"]


@dataclass(frozen=True, eq=False)
class Term:
    """What one law adds to the pieces of another one.

    Attributes
    ----------
    law : Superpotential
    piece : int array (m or 1, K + 1)
        Its piece that acts on each piece, -1 where none does.
    origin, level : arrays (m or 1, 1 or K + 1)
        An argument for each piece, and what its value counts as there.
    sign : array (m or 1, K + 1), optional
        Direction of the slip, if the argument is ``start + |r|``, start ``(m or 1,)``, and not r itself.
    """

    law: Superpotential
    piece: IntArray
    origin: Array
    level: Array | None = None
    sign: Array | None = None
    start: Array = field(default_factory=lambda: np.zeros(1))

    @cached_property
    def everywhere(self) -> bool:
        """Whether it acts on every piece."""
        return bool((self.piece >= 0).all())

    @cached_property
    def _reference(self) -> Array:
        known = np.stack([self.law.value(column) for column in self.origin.T], axis=-1)
        return known if self.level is None else known - self.level

    def on(self, piece: IntArray, r: Array) -> tuple[IntArray, Array, Array | float]:
        """Its own pieces (-1: none), arguments, and the directions of the slip."""
        own = pick(self.piece, np.asarray(piece))
        if self.sign is None:
            return own, r, 1.0
        sign = pick(self.sign, np.asarray(piece))
        return own, self.start + np.maximum(sign * np.asarray(r), 0.0), sign

    def acting(self, own: IntArray, values: Array) -> Array:
        """The values where it acts, else zero."""
        return values if self.everywhere else np.where(own >= 0, values, 0.0)

    def value(self, piece: IntArray, r: Array) -> Array:
        own, at, _ = self.on(piece, r)
        known = self._reference
        known = known[:, 0] if known.shape[-1] == 1 else pick(known, np.asarray(piece))
        return self.acting(own, self.law.piece_value(np.maximum(own, 0), at) - known)

    def line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        own, at, sign = self.on(piece, r)
        slope, bend = self.law.piece_line(np.maximum(own, 0), at)
        return self.acting(own, sign * slope), self.acting(own, bend)

    def derivative(self, piece: IntArray, r: Array) -> Array:
        own, at, sign = self.on(piece, r)
        return self.acting(own, sign * self.law.piece_derivative(np.maximum(own, 0), at))

    def curvature(self, piece: IntArray, r: Array) -> Array:
        own, at, _ = self.on(piece, r)
        return self.acting(own, self.law.piece_curvature(np.maximum(own, 0), at))

    def falls(self, i: int, low: Array, high: Array) -> Array:
        """A bound of what -j'' gains by it on part of piece i, where ``low < high``."""
        own = np.broadcast_to(self.piece[:, i], low.shape)
        if self.law.convex:
            return np.zeros(low.shape)
        if self.sign is not None:
            ahead = self.sign[:, i] > 0.0
            low, high = self.start + np.where(ahead, low, -high), self.start + np.where(ahead, high, -low)
        return np.where(own >= 0, falls_between(self.law, np.maximum(own, 0), low, high), 0.0)

    def take(self, index: IntArray) -> Term:
        """The term at some of the contact points."""
        return replace(
            self,
            law=taken(self.law, index),
            piece=row(self.piece, index),
            origin=row(self.origin, index),
            level=None if self.level is None else row(self.level, index),
            sign=None if self.sign is None else row(self.sign, index),
            start=row(self.start, index),
        )


def beside(law: Superpotential, places: Array, before: IntArray, after: IntArray) -> tuple[Array, Array]:
    """j' of a law below and above places (m, n) between its pieces; what it tells of its knots, where one is passed."""
    here, last = after > before, law.knots.shape[-1] - 1
    if isinstance(law, PiecewiseQuadratic):
        left, right = law._left, law._right
        anchor, slope = law._anchors
        smooth = pick(slope, before) + pick(law.slopes, before) * (places - pick(anchor, before))
    else:
        left, right = law.knot_slopes()
        columns = zip(np.broadcast_to(before, places.shape).T, places.T, strict=True)
        smooth = np.stack([law.piece_derivative(piece, at) for piece, at in columns], axis=-1)
    below = np.where(here, pick(left, np.minimum(before, last)), smooth)
    return below, np.where(here, pick(right, np.maximum(after - 1, 0)), smooth)


def law_graph(
    knots: Array,
    terms: Sequence[Term],
    sides: tuple[Array, Array],
    ends: Interval,
    name: str,
    springs: Array | None = None,
) -> Superpotential:
    """The law of these terms; see :class:`LawGraph`.

    It is a table where all its laws are, if none with many knots would have to be copied for every point.
    """
    tables = [found for term in terms if (found := table_of(term.law)) is not None]
    copied = any(len(one.knots) < len(knots) and one.knots.shape[-1] > MANY for one in tables)
    if len(tables) < len(terms) or copied:
        return LawGraph(knots, tuple(terms), *sides, ends, name, springs)
    slopes = np.zeros((len(knots), knots.shape[-1] + 1)) if springs is None else springs
    for term, one in zip(terms, tables, strict=True):
        slopes = slopes + term.acting(term.piece, pick(one.slopes, np.maximum(term.piece, 0)))
    return PiecewiseQuadratic.with_sides(knots, slopes, *sides, (ends.lower, ends.upper), name)


@dataclass(frozen=True, eq=False)
class LawGraph(TransformedLaw):
    """A law whose derivative on every piece is the sum of derivatives of other laws.

    Attributes
    ----------
    places : array (m, K)
        Knots, +inf where unused.
    terms : tuple of Term
    below, above : arrays (m, K)
        j' on both sides of the knots, inside the domain.
    ends : Interval
        The domain.
    springs : array (m, K + 1), optional
        Stiffness of a spring beside them on each piece; the constants of growth of the laws are to hold there.
    """

    places: Array
    terms: tuple[Term, ...]
    below: Array
    above: Array
    ends: Interval
    name: str = "law"
    springs: Array | None = None

    @property
    def made_of(self) -> tuple[Superpotential, ...]:
        return tuple(term.law for term in self.terms)

    @property
    def plain(self) -> bool:
        """Whether it is a sum: every law acts everywhere, at r itself."""
        return all(term.everywhere and term.sign is None for term in self.terms)

    @property
    def knots(self) -> Array:
        return self.places

    @property
    def domain(self) -> Interval:
        return self.ends

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return self._sprung(sum(term.value(piece, r) for term in self.terms), piece, 0.5 * np.square(r))

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._sprung(sum(term.derivative(piece, r) for term in self.terms), piece, r)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._sprung(sum(term.curvature(piece, r) for term in self.terms), piece, np.ones(1))

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        slope, bend = (sum(found) for found in zip(*(term.line(piece, r) for term in self.terms), strict=True))
        return self._sprung(slope, piece, r), self._sprung(bend, piece, np.ones(1))

    def _sprung(self, values: Array | float, piece: IntArray, r: Array) -> Array:
        return np.asarray(values if self.springs is None else values + pick(self.springs, np.asarray(piece)) * r)

    def _knot_sides(self) -> tuple[Array, Array]:
        finite = np.isfinite(self.places)
        below = np.where(self.places <= self.ends.lower[..., None], -np.inf, self.below)
        above = np.where(self.places >= self.ends.upper[..., None], np.inf, self.above)
        return np.where(finite, below, 0.0), np.where(finite, above, 0.0)

    @property
    def straight(self) -> bool:
        return all(term.law.straight for term in self.terms)

    def piece_formula(self, piece: int) -> str:
        texts = []
        for term in self.terms:
            own = int(term.piece[0, piece])
            if own < 0:
                continue
            text = term.law.piece_formula(own)
            if not text:
                return ""
            if term.sign is not None:
                way, s = ("-", "-") if term.sign[0, piece] < 0.0 else ("", "+")
                text = f"{way}({text}) at {float(term.start[0]):.6g} {s} r"
            texts.append(text)
        if self.springs is not None and self.springs[0, piece]:
            texts.append(f"{float(self.springs[0, piece]):.6g} r")
        if len(texts) == 1:
            return texts[0]
        return " + ".join(f"({text})" for text in texts if text != "0") or "0"

    def derivative_error(self, r: Array) -> Array:
        if not self.plain:
            return super().derivative_error(r)
        return np.asarray(sum(term.law.derivative_error(r) for term in self.terms))

    @property
    def alpha_reach(self) -> float:
        return min(term.law.alpha_reach for term in self.terms) if self.plain else super().alpha_reach

    def weak_convexity_within(self, reach: float) -> Array:
        return self._alpha_within(reach) if reach <= self.alpha_reach else np.full(1, np.inf)

    @property
    def weak_convexity(self) -> Array:
        return self._alpha

    @cached_property
    def _alpha(self) -> Array:
        return self._alpha_within(self.alpha_reach or np.inf)

    def _alpha_within(self, reach: float) -> Array:
        knots, (left, right) = self.places, self._slopes
        bound = Interval(np.maximum(self.ends.lower, -reach), np.minimum(self.ends.upper, reach))
        inner = (knots > bound.lower[..., None]) & (knots < bound.upper[..., None])
        down = np.any(inner & (right < left), axis=-1)
        worst, far = np.zeros(len(knots)), np.full((1, len(knots)), np.inf)
        ends = np.clip(np.concatenate([-far, knots.T, far]), bound.lower, bound.upper)
        plain, laws = self.plain, self.made_of
        for i in range(knots.shape[-1] + 1):
            low, high = ends[i], ends[i + 1]
            if plain:
                fall = steepest_fall(laws, [term.piece[:, i] for term in self.terms], low, high)
            else:
                fall = np.where(low < high, sum(term.falls(i, low, high) for term in self.terms), 0.0)
            worst = np.maximum(worst, fall)
        return np.where(down, np.inf, worst)

    @property
    def growth(self) -> tuple[Array, Array]:
        """The largest constants of all pieces."""
        found = np.zeros((2, len(self.places), self.places.shape[-1] + 1))
        for term in self.terms:
            c0, c1 = term.law.growth
            if term.sign is not None:
                with np.errstate(invalid="ignore"):
                    c0 = np.where(np.isfinite(c1), c0 + c1 * np.abs(term.start), np.inf)
            found += [np.where(term.piece >= 0, constant[:, None], 0.0) for constant in (c0, c1)]
        c0, c1 = found.max(axis=-1)
        return c0, c1

    def _outer(self, sign: float) -> list[tuple[Superpotential, BoolArray, Array]]:
        """Laws, where they act on the last piece in a direction (m,), and the direction in which they go there."""
        last = np.isfinite(self.places).sum(axis=-1) if sign > 0.0 else np.zeros(len(self.places), dtype=np.int64)
        found = []
        for term in self.terms:
            towards = np.full(last.shape, sign) if term.sign is None else sign * pick(term.sign, last)
            found.append((term.law, pick(term.piece, last) >= 0, towards))
        return found

    def _rate(self, sign: float) -> Array:
        with np.errstate(invalid="ignore"):
            rates = [np.where(acts, law.recession(towards), 0.0) for law, acts, towards in self._outer(sign)]
            total = np.asarray(sum(rates))
            return np.where(np.isnan(total), np.copysign(np.inf, self.asymptotic_curvature(sign)), total)

    def recession(self, sign: Array) -> Array:
        size = np.abs(np.asarray(sign, dtype=float))
        with np.errstate(invalid="ignore"):
            found = size * np.where(np.asarray(sign) > 0.0, self._rate(1.0), self._rate(-1.0))
        return np.where(size > 0.0, found, 0.0)

    def asymptotic_curvature(self, sign: float) -> Array:
        total: Array | float = 0.0
        with np.errstate(invalid="ignore"):
            for law, acts, towards in self._outer(sign):
                bent = np.where(towards > 0.0, law.asymptotic_curvature(1.0), law.asymptotic_curvature(-1.0))
                total = total + np.where(acts, bent, 0.0)
        ended = np.isfinite(self.ends.upper if sign > 0.0 else self.ends.lower)
        return np.where(ended | np.isnan(total), np.inf, total)

    def take(self, index: IntArray) -> LawGraph:
        places, below, above = (row(values, index) for values in (self.places, self.below, self.above))
        ends = Interval(row(self.ends.lower, index), row(self.ends.upper, index))
        springs = None if self.springs is None else row(self.springs, index)
        return LawGraph(places, tuple(term.take(index) for term in self.terms), below, above, ends, self.name, springs)
