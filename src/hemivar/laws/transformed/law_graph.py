"""Sums and splices of laws as data: knots, pieces that act between them, one-sided derivatives at knots.

Sums of laws and laws spliced at places are such laws; of tables they are tables again.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.laws.minimisers import MANY
from hemivar.laws.parameters import common_rows
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.piecewise_law import PiecewiseLaw, Seams, Term, count_knots, pick
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.transformed_law import lines, merged, table_of

#: What j' is below and above knots (m, K), given these and what rounding makes of it.
Mended = Callable[[Array, Array, Array], tuple[Array, Array]]

__all__ = ["Region", "between", "law_graph", "spliced"]


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
    parts = [Term(law, piece, shift=shift if shift.any() else np.zeros((1, 1))) for law, piece, shift in terms.values()]
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
    """The law of these terms, which act at r itself or next to it.

    It is a table where all its laws are, if none with many knots would have to be copied for every point.
    """
    tables = [table for term in terms if (table := table_of(term.law)) is not None]
    copied = any(len(table.knots) < len(knots) and table.knots.shape[-1] > MANY for table in tables)
    if len(tables) < len(terms) or copied:
        cuts = np.zeros((1, 0)) if cuts is None else cuts
        return PiecewiseLaw(tuple(terms), name, Seams(knots, *sides, ends, springs, cuts))
    slopes = np.zeros((len(knots), knots.shape[-1] + 1)) if springs is None else springs
    for term, table in zip(terms, tables, strict=True):
        assert term.piece is not None
        slopes = slopes + np.where(term.piece >= 0, pick(table.slopes, np.maximum(term.piece, 0)), 0.0)
    return PiecewiseQuadratic.with_sides(knots, slopes, *sides, (ends.lower, ends.upper), name)
