"""Base of laws made of other laws: checks of what they are given, their tables, and columns of knots."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.minimisers import FAR, MANY
from hemivar.laws.parametrised import NamedLaw
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.proof import Constant, Proof, of_alpha
from hemivar.laws.rescaled import RescaledLaw
from hemivar.laws.stacked import StackedLaw
from hemivar.laws.superpotential import Superpotential

__all__ = [
    "LawOfOne",
    "as_examined",
    "by_parts",
    "check_law",
    "count_knots",
    "falls_between",
    "lines",
    "merged",
    "numbers",
    "pick",
    "table_of",
]

#: The kind of number that columns hold.
Entry = TypeVar("Entry", bound=np.generic)


class LawOfOne(Superpotential):
    """A law made of one other, ``base``, whose name it bears."""

    base: Superpotential

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the law that it is made of."""
        return self.base.name

    def proof(self, constant: Constant) -> Proof:
        known = self.base.proof(constant).whole()
        return of_alpha(known, lambda _: self.weak_convexity) if constant == "alpha" else known

    @abstractmethod
    def _raw(self, piece: IntArray, r: Array) -> Array:
        """:meth:`piece_value`, but for the constant with which it is zero at r = 0."""

    @cached_property
    def _at_zero(self) -> Array:
        zero = np.clip(np.zeros(len(self.knots)), self.domain.lower, self.domain.upper)
        return self._raw(self.piece_of(zero), zero)

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return self._raw(piece, r) - self._at_zero


def check_law(law: object) -> None:
    """Refuse what is no law of one variable."""
    expect(law, Superpotential, "the law", "pass a law such as ThresholdCompliance(...) or FormulaLaw(...)")  # type: ignore[type-abstract]


def numbers(
    value: Array | float, what: str, *, above: float = -np.inf, least: float = -np.inf, state: bool = False
) -> Array:
    """Finite numbers for each contact point, shape (1,) or (m,), > ``above`` and >= ``least``.

    ``state``: they are a state of the contact points, of which a rank may have none; others are never empty.
    """
    values = np.atleast_1d(real_array(value, what))
    if values.ndim != 1 or not (values.size or state):
        raise ProblemError(f"{what} has shape {values.shape}; give a number, or one for each contact point")
    if not (values > above).all():
        raise ProblemError(
            f"{what} is {values.min():g}; it must be {'positive' if above == 0.0 else f'above {above:g}'}"
        )
    if not (values >= least).all():
        raise ProblemError(f"{what} is {values.min():g}; it must be at least {least:g}")
    return values


def by_parts(
    law: Superpotential, make: Callable[[Superpotential, np.ndarray], Superpotential]
) -> Superpotential | None:
    """What ``make(part, index)`` makes of every part of a stacked law, stacked again; None if it is not stacked."""
    if not isinstance(law, StackedLaw):
        return None
    made = tuple(make(part, index) for part, index in zip(law.parts, law.indices, strict=True))
    return StackedLaw(made, law.indices, name=law.name)


def falls_between(law: Superpotential, piece: IntArray, low: Array, high: Array) -> Array:
    """A bound of -j'' on part of each piece, from its ends: j'' is monotone there; -inf where the part is empty.

    At an infinite end towards which j'' falls, the weak convexity of the law bounds it.
    """
    near = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0))
    if law.straight:
        return np.where(low < high, -law.piece_curvature(piece, near), -np.inf)
    other = np.where(np.isfinite(low) & np.isfinite(high), high, near)
    with np.errstate(all="ignore"):
        ends = [-law.piece_curvature(piece, np.broadcast_to(end, piece.shape)) for end in (near, other)]
        bound = np.maximum(*ends)
        for endless, sign in ((~np.isfinite(low), -1.0), (~np.isfinite(high), 1.0)):
            if not (endless & (low < high)).any():
                continue
            far = -law.piece_curvature(piece, near + sign * FAR * np.maximum(np.abs(near), 1.0))
            bound = np.where(endless, np.maximum(bound, far), bound)
            steeper = ~(far <= ends[0] + 1e-9 * (np.abs(far) + np.abs(ends[0])))
            bound = np.where(endless & steeper, law.weak_convexity, bound)
    return np.where(low < high, bound, -np.inf)


def table_of(law: Superpotential) -> PiecewiseQuadratic | None:
    """The piecewise-quadratic table that a law is, None if it is none (or one with many knots for many points)."""
    if isinstance(law, PiecewiseQuadratic):
        return law
    if isinstance(law, NamedLaw) and type(law).__module__.startswith("hemivar."):
        return law.table
    if isinstance(law, RescaledLaw) and not law.moved and (base := table_of(law.base)) is not None:
        if base.knots.shape[-1] > MANY and law.factor.size > 1:
            return None
        table = base.scaled(law.factor)
        return table if isinstance(table, PiecewiseQuadratic) else None
    return None


def pick(columns: NDArray[Entry], index: IntArray) -> NDArray[Entry]:
    """``columns (m or 1, K)`` at one index for each place (n,), or at several for each row (m, n)."""
    if len(columns) == 1:
        return cast("NDArray[Entry]", columns[0].take(index))
    rows = np.arange(len(columns))
    if index.ndim == 2:
        return columns[rows[:, None], index]
    return columns[rows, index]  # of one index for each row, or for all


def lines(table: PiecewiseQuadratic, piece: IntArray, r: Array) -> tuple[Array, Array]:
    """j' and j'' at places (m, n) by the formulas of pieces (m, n)."""
    (anchor, slope), bend = table._anchors, pick(table.slopes, piece)
    return pick(slope, piece) + bend * (r - pick(anchor, piece)), bend


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
        passed = np.searchsorted(knots[0], places, side="right" if including else "left")
        return np.asarray(passed, dtype=np.int64)
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
