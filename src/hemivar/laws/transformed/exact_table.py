"""Piecewise-quadratic laws made of others: the derivative next to every knot is handed over, not summed up again.

What is made of such laws by an affine argument, a sum, a secant or an envelope is again such a law.  Summing slopes
times widths from the first knot on, as :class:`~hemivar.laws.PiecewiseQuadratic` does, would leave a rounding error
where the law that it is made of has, far away, no force at all.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.named import NamedLaw
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.scaled import ScaledLaw
from hemivar.laws.superpotential import Superpotential

__all__ = [
    "MANY",
    "ExactTable",
    "as_examined",
    "count_knots",
    "filled",
    "merged",
    "pick",
    "separated",
    "table",
    "table_of",
]

#: The kind of number that columns hold.
Entry = TypeVar("Entry", bound=np.generic)

#: Knots from which on a table is not copied for each contact point.
MANY = 40


@dataclass(frozen=True, eq=False)
class ExactTable(PiecewiseQuadratic):
    """A piecewise-quadratic law with the derivatives next to its knots as they are told; see :func:`table`."""

    below: Array | float = 0.0
    above: Array | float = 0.0
    _told: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        rows = np.broadcast_shapes(
            *(np.shape(part)[:1] for part in (self.breakpoints, self.slopes, self.below, self.above)),
            *(np.shape(np.atleast_1d(end)) for end in (self.lower, self.upper)),
        )
        count = np.shape(self.breakpoints)[-1]
        told, below, above = (np.broadcast_to(x, (*rows, count)) for x in (self.breakpoints, self.below, self.above))
        slopes = np.broadcast_to(self.slopes, (*rows, count + 1))
        knots, used = filled(told), np.isfinite(told)
        if not used.all():  # an unused knot lies on the last piece and is none of the knots that are told
            last = np.sum(used, axis=-1, keepdims=True) - 1
            slopes = np.where(np.arange(count + 1) > last + 1, np.take_along_axis(slopes, last + 1, -1), slopes)
            rise = slopes[..., -1:] * (knots - np.take_along_axis(knots, last, -1))
            along = np.take_along_axis(above, last, -1) + rise
            below, above = np.where(used, below, along), np.where(used, above, along)
        width = np.diff(knots, axis=-1)
        parts = np.zeros((*rows, 2 * count - 1))
        parts[..., 1::2], parts[..., 2::2] = above[..., :-1] * width, 0.5 * slopes[..., 1:-1] * width**2
        lower, upper = (np.broadcast_to(np.atleast_1d(end), rows) for end in (self.lower, self.upper))
        for key, item in (
            ("breakpoints", knots),
            ("slopes", slopes),
            ("below", below),
            ("above", above),
            ("jumps", above - below),
            ("start", below[..., 0]),
            ("lower", lower),
            ("upper", upper),
            ("_told", told),
            ("_left", below),
            ("_right", above),
            ("_values", np.cumsum(parts, axis=-1)[..., 0::2].copy()),
            ("_offset", np.zeros(rows)),
        ):
            object.__setattr__(self, key, item)
        origin = np.clip(np.zeros(rows), lower, upper)
        object.__setattr__(self, "_offset", self.piece_value(self.piece_of(origin), origin))

    @property
    def knots(self) -> Array:
        return self._told

    def kinks(self) -> BoolArray:
        return super().kinks() & np.isfinite(self._told)

    def scaled(self, factor: Array | float) -> Superpotential:
        factor = np.atleast_1d(np.asarray(factor, dtype=float))
        if self.shared_knots is not None and factor.size > 1:
            return ScaledLaw(self, factor)
        times = factor[:, None]
        return self._like(self._told, times * self.slopes, times * self._left, times * self._right)

    def take(self, index: IntArray) -> ExactTable:
        if len(self.breakpoints) == 1:
            return self
        return table(
            self._told[index],
            self.slopes[index],
            self._left[index],
            self._right[index],
            (np.asarray(self.lower)[index], np.asarray(self.upper)[index]),
            self.name,
        )

    def _like(self, knots: Array, slopes: Array, below: Array, above: Array) -> ExactTable:
        return table(knots, slopes, below, above, (np.asarray(self.lower), np.asarray(self.upper)), self.name)


def table(
    knots: Array, slopes: Array, below: Array, above: Array, ends: tuple[Array | float, Array | float], name: str
) -> ExactTable:
    """The law with these knots (m, K), slopes (m, K + 1) of j', and j' just below and above every knot (m, K).

    Unused knots stand at the end and are +inf; what is told about them is not looked at.

    Parameters
    ----------
    ends : pair of arrays (m,)
        Domain; an end is infinite or one of the knots.
    """
    return ExactTable(knots, slopes, above, 0.0, *ends, name=name, below=below, above=above)


def table_of(law: Superpotential) -> PiecewiseQuadratic | None:
    """The piecewise-quadratic table that a law is, None if it is none (or one with many knots for many points)."""
    if type(law) in (PiecewiseQuadratic, ExactTable):
        assert isinstance(law, PiecewiseQuadratic)
        return law
    if isinstance(law, NamedLaw) and type(law).__module__.startswith("hemivar."):
        return law.table
    if isinstance(law, ScaledLaw) and (base := table_of(law.base)) is not None:
        if base.knots.shape[-1] > MANY and law.factor.size > 1:
            return None
        times = law.factor[:, None]
        ends = np.asarray(base.lower), np.asarray(base.upper)
        return table(base.knots, times * base.slopes, times * base._left, times * base._right, ends, law.name)
    return None


def pick(columns: NDArray[Entry], index: IntArray) -> NDArray[Entry]:
    """``columns (m or 1, K)`` at one index for each place (n,), or at several for each row (m, n)."""
    if index.ndim == 1 and columns.shape[0] == 1:
        return cast("NDArray[Entry]", columns[0].take(index))
    if index.ndim == 1 and columns.shape[0] == index.size:
        return columns[np.arange(index.size), index]
    wide = index if index.ndim == 2 else index[:, None]
    rows = np.broadcast_shapes(columns.shape[:1], wide.shape[:1])
    columns = np.broadcast_to(columns, (*rows, columns.shape[-1]))
    found = np.take_along_axis(columns, np.broadcast_to(wide, (*rows, wide.shape[-1])), axis=-1)
    return found if index.ndim == 2 else found[:, 0]


def merged(candidates: Array) -> Array:
    """Each row (m, n) in increasing order and once; what is left over, and absent (+inf), stands at the end."""
    knots = np.sort(candidates, axis=-1)
    again = np.concatenate([np.zeros((len(knots), 1), dtype=bool), knots[:, 1:] == knots[:, :-1]], axis=-1)
    if again.any():
        knots = np.sort(np.where(again, np.inf, knots), axis=-1)
    used: BoolArray = np.asarray(np.isfinite(knots).any(axis=0))
    used[0] = True
    return knots[:, used]


def filled(knots: Array) -> Array:
    """Knots (m, K) with finite places, beyond the last one, instead of the unused entries +inf."""
    absent = ~np.isfinite(knots)
    if not absent.any():
        return knots
    last = np.max(np.where(absent, -np.inf, knots), axis=-1, keepdims=True)
    step = np.where(last == 0.0, 1.0, np.abs(last))
    return np.where(absent, last + step * np.cumsum(absent, axis=-1), knots)


def separated(knots: Array) -> Array:
    """Knots that rounding has made equal, moved apart as little as can be."""
    if ((knots[:, 1:] > knots[:, :-1]) | np.isinf(knots[:, 1:])).all():
        return knots
    knots = knots.copy()
    for i in range(1, knots.shape[-1]):
        knots[:, i] = np.maximum(knots[:, i], np.nextafter(knots[:, i - 1], np.inf))
    return knots


def count_knots(knots: Array, places: Array, *, including: bool) -> IntArray:
    """How many knots (m or 1, K) lie below each place (m, n); with ``including``, or at it."""
    if knots.shape[0] == 1:
        found = np.searchsorted(knots[0], places, side="right" if including else "left")
        return np.asarray(found, dtype=np.int64)
    rows = np.broadcast_shapes(knots.shape[:1], places.shape[:1])
    count = np.zeros((*rows, places.shape[-1]), dtype=np.int64)
    for k in range(knots.shape[-1]):
        column = knots[:, k : k + 1]
        count += (column <= places) if including else (column < places)
    return count


def as_examined(law: Superpotential) -> Superpotential:
    """The law, which was made here of one that has been looked at, marked so that it is not looked at again."""
    object.__setattr__(law, "examined", True)
    return law
