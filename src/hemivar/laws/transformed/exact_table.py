"""Tables that laws are, and their knots: merged, counted, kept apart."""

from __future__ import annotations

from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.parametrised import NamedLaw
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.rescaled import RescaledLaw
from hemivar.laws.superpotential import Superpotential

__all__ = [
    "MANY",
    "as_examined",
    "count_knots",
    "merged",
    "pick",
    "table_of",
]

#: The kind of number that columns hold.
Entry = TypeVar("Entry", bound=np.generic)

#: Knots from which on a table is not copied for each contact point.
MANY = 40


def table_of(law: Superpotential) -> PiecewiseQuadratic | None:
    """The piecewise-quadratic table that a law is, None if it is none (or one with many knots for many points)."""
    if isinstance(law, PiecewiseQuadratic):
        return law
    if isinstance(law, NamedLaw) and type(law).__module__.startswith("hemivar."):
        return law.table
    if isinstance(law, RescaledLaw) and not law.moved and (base := table_of(law.base)) is not None:
        if base.knots.shape[-1] > MANY and law.factor.size > 1:
            return None
        found = base.scaled(law.factor)
        return found if isinstance(found, PiecewiseQuadratic) else None
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
