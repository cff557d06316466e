"""Sums and splices of laws as data: knots, pieces that act between them, one-sided derivatives at knots.

Sums of laws and laws spliced at places are such laws; of tables they are tables again.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.minimisers import MANY
from hemivar.laws.parameters import common_rows
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.proof import Constant, Proof, worst
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.transformed_law import count_knots, falls_between, lines, merged, pick, table_of
from hemivar.laws.transformed.turns import steepest_fall

#: What j' is below and above knots (m, K), given these and what rounding makes of it.
Mended = Callable[[Array, Array, Array], tuple[Array, Array]]

__all__ = ["LawGraph", "Region", "Term", "between", "law_graph", "spliced"]


@dataclass(frozen=True, eq=False)
class Term:
    """What one law adds to the pieces of another one."""

    law: Superpotential
    piece: IntArray  # of it that acts on each piece, (m or 1, K + 1), -1 where none does
    shift: Array | None = None  # (m, K + 1); its argument is r + shift

    @cached_property
    def everywhere(self) -> bool:
        """Whether it acts on every piece."""
        return bool((self.piece >= 0).all())

    def on(self, piece: IntArray, r: Array) -> tuple[IntArray, Array]:
        """Its own pieces (-1: none) and arguments."""
        own, piece = pick(self.piece, np.asarray(piece)), np.asarray(piece)
        return own, r if self.shift is None else r + pick(self.shift, piece)

    def acting(self, own: IntArray, values: Array) -> Array:
        """The values where it acts, else zero."""
        return values if self.everywhere else np.where(own >= 0, values, 0.0)

    def ask(self, question: str, piece: IntArray, r: Array) -> Array:
        """What ``piece_value``, ``piece_derivative`` or ``piece_curvature`` says of its pieces."""
        own, at = self.on(piece, r)
        return self.acting(own, getattr(self.law, question)(np.maximum(own, 0), at))

    def line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        own, at = self.on(piece, r)
        slope, bend = self.law.piece_line(np.maximum(own, 0), at)
        return self.acting(own, slope), self.acting(own, bend)

    def falls(self, i: int, low: Array, high: Array) -> Array:
        """A bound of what -j'' gains by it on part of piece i, where ``low < high``."""
        own = np.broadcast_to(self.piece[:, i], low.shape)
        if self.law.convex:
            return np.zeros(low.shape)
        ends = (low, high) if self.shift is None else (low + self.shift[:, i], high + self.shift[:, i])
        return np.where(own >= 0, falls_between(self.law, np.maximum(own, 0), *ends), 0.0)


@dataclass(frozen=True, eq=False)
class Region:
    """What acts on a stretch of the line: a law at ``r + shift``, or a spring; shift and spring (m,)."""

    law: Superpotential | None = None
    shift: Array = field(default_factory=lambda: np.zeros(1))
    spring: Array = field(default_factory=lambda: np.zeros(1))

    @cached_property
    def knots(self) -> Array:
        """Where the knots of the law come to lie, (m or 1, K)."""
        if self.law is None:
            return np.full((1, 1), np.inf)
        return self.law.knots - self.shift[:, None] if self.shift.any() else self.law.knots

    def passed(self, knots: Array) -> tuple[IntArray, IntArray]:
        """How many knots of the law lie below each of the knots (m, K), and how many up to it."""
        return count_knots(self.knots, knots, including=False), count_knots(self.knots, knots, including=True)

    def sides(self, knots: Array, before: IntArray, after: IntArray) -> tuple[Array, Array]:
        """j' below and above the knots; what the law tells of a knot of its own."""
        places = np.where(np.isfinite(knots), knots, 0.0)
        if self.law is None:
            return (self.spring[:, None] * places,) * 2
        here, last, places = after > before, self.law.knots.shape[-1] - 1, places + self.shift[:, None]
        if isinstance(self.law, PiecewiseQuadratic):
            left, right = self.law._left, self.law._right
            smooth, _ = lines(self.law, before, places)
        else:
            left, right = self.law.knot_slopes()
            columns = zip(np.broadcast_to(before, places.shape).T, places.T, strict=True)
            smooth = np.stack([self.law.piece_derivative(piece, at) for piece, at in columns], axis=-1)
        below = np.where(here, pick(left, np.minimum(before, last)), smooth)
        return below, np.where(here, pick(right, np.maximum(after - 1, 0)), smooth)


def between(before: IntArray, after: IntArray) -> IntArray:
    """Which piece of a law, of whose knots so many are passed, every piece between knots is a part of, (m, K + 1)."""
    return np.concatenate([before[:, :1], after], axis=-1)


def spliced(
    regions: Sequence[Region], cuts: Sequence[Array], ends: Interval, name: str, mended: Mended | None = None
) -> Superpotential:
    """The law of regions one after the other, which end at ``cuts``, places (m,) that do not decrease."""
    rows = common_rows(f"law '{name}'", *(len(region.knots) for region in regions), *(cut.size for cut in cuts))
    cuts = [np.broadcast_to(cut, (rows,))[:, None] for cut in cuts]
    stretches: Iterable[tuple[Array | float, Array | float]] = itertools.pairwise([-np.inf, *cuts, np.inf])
    inner = [
        np.where((region.knots > low) & (region.knots < high), region.knots, np.inf)
        for region, (low, high) in zip(regions, stretches, strict=True)
    ]
    knots = merged(np.concatenate([*(np.broadcast_to(x, (rows, x.shape[-1])) for x in inner), *cuts], axis=-1))
    number = sum(knots >= cut for cut in cuts)
    number = np.concatenate([np.zeros((rows, 1), dtype=np.int64), number], axis=-1)
    springs, shape = np.zeros(number.shape), number.shape
    (below, above), terms = np.zeros((2, *knots.shape)), dict[int, tuple[Superpotential, IntArray, Array]]()
    once = {id(region): region for region in regions}
    passed = {key: region.passed(knots) for key, region in once.items()}
    known = {key: region.sides(knots, *passed[key]) for key, region in once.items()}
    for i, region in enumerate(regions):
        here, sides = number == i, known[id(region)]
        below, above = np.where(here[:, :-1], sides[0], below), np.where(here[:, 1:], sides[1], above)
        if region.law is None:
            springs = np.where(here, region.spring[:, None], springs)
            continue
        law, piece, shift = terms.get(id(region.law), (region.law, np.full(shape, -1), np.zeros(shape)))
        shift = np.where(here, region.shift[:, None], shift) if region.shift.any() else shift
        terms[id(law)] = law, np.where(here, between(*passed[id(region)]), piece), shift
    parts = [Term(law, piece, shift if shift.any() else None) for law, piece, shift in terms.values()]
    sides = (below, above) if mended is None else mended(knots, below, above)
    return law_graph(knots, parts, sides, ends, name, springs, np.concatenate(cuts, axis=-1))


def law_graph(
    knots: Array,
    terms: Sequence[Term],
    sides: tuple[Array, Array],
    ends: Interval,
    name: str,
    springs: Array | None = None,
    cuts: Array | None = None,
) -> Superpotential:
    """The law of these terms; see :class:`LawGraph`.

    It is a table where all its laws are, if none with many knots would have to be copied for every point.
    """
    tables = [table for term in terms if (table := table_of(term.law)) is not None]
    copied = any(len(table.knots) < len(knots) and table.knots.shape[-1] > MANY for table in tables)
    if len(tables) < len(terms) or copied:
        return LawGraph(knots, tuple(terms), *sides, ends, name, springs, np.zeros((1, 0)) if cuts is None else cuts)
    slopes = np.zeros((len(knots), knots.shape[-1] + 1)) if springs is None else springs
    for term, table in zip(terms, tables, strict=True):
        slopes = slopes + term.acting(term.piece, pick(table.slopes, np.maximum(term.piece, 0)))
    return PiecewiseQuadratic.with_sides(knots, slopes, *sides, (ends.lower, ends.upper), name)


@dataclass(frozen=True, eq=False)
class LawGraph(Superpotential):
    """A law whose derivative on every piece is the sum of derivatives of other laws."""

    places: Array  # knots (m, K), +inf where unused
    terms: tuple[Term, ...]
    below: Array  # j' below and above the knots, inside the domain
    above: Array
    ends: Interval  # the domain
    name: str = "law"
    springs: Array | None = None  # stiffness beside the terms on each piece, (m, K + 1)
    cuts: Array = field(default_factory=lambda: np.zeros((1, 0)))  # where other laws begin to act

    @property
    def made_of(self) -> tuple[Superpotential, ...]:
        """The laws of its terms."""
        return tuple(term.law for term in self.terms)

    @property
    def plain(self) -> bool:
        """Whether it is a sum: every law acts everywhere, at r itself."""
        return all(term.everywhere and term.shift is None for term in self.terms)

    @property
    def knots(self) -> Array:
        return self.places

    @property
    def domain(self) -> Interval:
        return self.ends

    def _sum(self, question: str, piece: IntArray, r: Array) -> Array | float:
        check_time()  # its laws may be sums of others, many deep
        return sum(term.ask(question, piece, r) for term in self.terms)

    def _raw(self, piece: IntArray, r: Array) -> Array:
        return self._sprung(self._sum("piece_value", piece, r), piece, 0.5 * np.square(r))

    @cached_property
    def _level(self) -> Array:
        """What is added to the value on each piece (m, K + 1), so that j is continuous, and zero at zero."""
        rows = len(self.places)
        totals, last = [np.zeros(rows)], np.full(rows, -np.inf)
        for cut in np.broadcast_to(self.cuts, (rows, self.cuts.shape[-1])).T:
            joined = np.isfinite(cut) & (cut > last)
            at, last = np.where(joined, cut, 0.0), cut
            left, right = (count_knots(self.places, at[:, None], including=side)[:, 0] for side in (False, True))
            totals.append(totals[-1] + np.where(joined, self._raw(left, at) - self._raw(right, at), 0.0))
        start = np.concatenate([np.full((rows, 1), -np.inf), self.places], axis=-1)
        level = pick(np.stack(totals, axis=-1), np.sum(start[:, :, None] >= self.cuts[:, None, :], axis=-1))
        origin = np.clip(np.zeros(rows), self.ends.lower, self.ends.upper)
        piece = self.piece_of(origin)
        return np.asarray(level - (self._raw(piece, origin) + pick(level, piece))[:, None])

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return np.asarray(self._raw(piece, r) + pick(self._level, np.asarray(piece)))

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._sprung(self._sum("piece_derivative", piece, r), piece, r)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._sprung(self._sum("piece_curvature", piece, r), piece, np.ones(1))

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        slope, bend = (sum(parts) for parts in zip(*(term.line(piece, r) for term in self.terms), strict=True))
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
            texts.append(text if term.shift is None else f"({text}) at r {float(term.shift[0, piece]):+.6g}")
        if self.springs is not None and self.springs[0, piece]:
            texts.append(f"{float(self.springs[0, piece]):.6g} r")
        if len(texts) == 1:
            return texts[0]
        return " + ".join(f"({text})" for text in texts if text != "0") or "0"

    def proof(self, constant: Constant) -> Proof:
        known = worst(law.proof(constant) for law in self.made_of)
        known = known if self.plain else known.whole()
        return replace(known, values=(self._alpha_within,)) if constant == "alpha" else known

    @cached_property
    def weak_convexity(self) -> Array:  # type: ignore[override]
        """alpha, see there."""
        return self._alpha_up_to(self._alpha_reach or np.inf)

    @property
    def _alpha_reach(self) -> float:
        return self.proof("alpha").reach[0]

    def _alpha_within(self, reach: float) -> Array:
        if reach == np.inf:
            return self.weak_convexity
        return self._alpha_up_to(reach) if reach <= self._alpha_reach else np.full(1, np.inf)

    def _alpha_up_to(self, reach: float) -> Array:
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
        constants = np.zeros((2, len(self.places), self.places.shape[-1] + 1))
        for term in self.terms:
            c0, c1 = (constant[:, None] for constant in term.law.growth)
            if term.shift is not None:
                with np.errstate(invalid="ignore"):
                    c0 = np.where(np.isfinite(c1), c0 + c1 * np.abs(term.shift), np.inf)
            constants += [np.where(term.piece >= 0, constant, 0.0) for constant in (c0, c1)]
        c0, c1 = constants.max(axis=-1)
        return c0, c1

    def _outer(self, sign: float) -> list[tuple[Superpotential, BoolArray]]:
        """The laws, and where they act (m,) on the last piece in a direction."""
        last = np.isfinite(self.places).sum(axis=-1) if sign > 0.0 else np.zeros(len(self.places), dtype=np.int64)
        return [(term.law, pick(term.piece, last) >= 0) for term in self.terms]

    def _rate(self, sign: float) -> Array:
        direction = np.full(len(self.places), sign)
        with np.errstate(invalid="ignore"):
            total = np.asarray(sum(np.where(acts, law.recession(direction), 0.0) for law, acts in self._outer(sign)))
            return np.where(np.isnan(total), np.copysign(np.inf, self.asymptotic_curvature(sign)), total)

    def recession(self, sign: Array) -> Array:
        size = np.abs(np.asarray(sign, dtype=float))
        with np.errstate(invalid="ignore"):
            rate = size * np.where(np.asarray(sign) > 0.0, self._rate(1.0), self._rate(-1.0))
        return np.where(size > 0.0, rate, 0.0)

    def asymptotic_curvature(self, sign: float) -> Array:
        total: Array | float = 0.0
        with np.errstate(invalid="ignore"):
            for law, acts in self._outer(sign):
                total = total + np.where(acts, law.asymptotic_curvature(sign), 0.0)
        ended = np.isfinite(self.ends.upper if sign > 0.0 else self.ends.lower)
        return np.where(ended | np.isnan(total), np.inf, total)
