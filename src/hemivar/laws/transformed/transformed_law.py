"""Base of laws made of other laws: checks of what they are given, their tables, and columns of knots."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.minimisers import MANY
from hemivar.laws.parametrised import NamedLaw
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.piecewise_law import PiecewiseLaw, pick, stacked
from hemivar.laws.proof import Constant, Proof, of_alpha
from hemivar.laws.superpotential import Superpotential

__all__ = [
    "LawOfOne",
    "as_examined",
    "by_parts",
    "check_law",
    "lines",
    "merged",
    "numbers",
    "table_of",
]


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
    if not isinstance(law, PiecewiseLaw) or not law.apart:
        return None
    return stacked([(make(part, index), index) for part, index in law.parts], law.name)


def table_of(law: Superpotential) -> PiecewiseQuadratic | None:
    """The piecewise-quadratic table that a law is, None if it is none (or one with many knots for many points)."""
    if isinstance(law, PiecewiseQuadratic):
        return law
    if isinstance(law, NamedLaw) and type(law).__module__.startswith("hemivar."):
        return law.table
    term = law.single if isinstance(law, PiecewiseLaw) else None
    base = None if term is None or term.moves else table_of(term.law)
    if term is None or base is None or (base.knots.shape[-1] > MANY and len(term.weight) > 1):
        return None
    table = base.scaled(term.weight[:, 0])
    return table if isinstance(table, PiecewiseQuadratic) else None


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


def as_examined(law: Superpotential) -> Superpotential:
    """The law, which was made here of one that has been looked at, marked so that it is not looked at again."""
    object.__setattr__(law, "examined", True)
    return law
