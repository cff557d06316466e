"""What laws made of other laws have in common, and the checks of what they are given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from typing import Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.minimisers import FAR
from hemivar.laws.rescaled import RescaledLaw
from hemivar.laws.stacked import StackedLaw
from hemivar.laws.superpotential import Superpotential

__all__ = ["LawOfOne", "TransformedLaw", "by_parts", "falls_between", "numbers", "row", "taken"]

Entry = TypeVar("Entry", bound=np.generic)


class TransformedLaw(Superpotential):
    """A dataclass of laws whose parameters are known, and of numbers (m,) for each contact point or for all."""

    def at(self, points: Array | None) -> Self:
        if points is not None and self.rows not in (1, len(points)):
            raise ProblemError(f"law '{self.name}' is made for {self.rows} contact points, but there are {len(points)}")
        return self

    def scaled(self, factor: Array | float) -> Superpotential:
        return RescaledLaw(self, np.asarray(factor))

    def take(self, index: IntArray) -> Self:
        values = {one.name: getattr(self, one.name) for one in fields(self)}  # type: ignore[arg-type]
        laws = {key: taken(value, index) for key, value in values.items() if isinstance(value, Superpotential)}
        numbers = {key: row(value, index) for key, value in values.items() if isinstance(value, np.ndarray)}
        return replace(self, **laws, **numbers)  # type: ignore[type-var]


class LawOfOne(TransformedLaw):
    """A law made of one other, ``base``, whose name it bears."""

    base: Superpotential

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the law that it is made of."""
        return self.base.name

    @property
    def made_of(self) -> tuple[Superpotential, ...]:
        return (self.base,)


def check_law(law: object) -> None:
    """Refuse what is no law of one variable."""
    expect(law, Superpotential, "the law", "pass a law such as ThresholdCompliance(...) or FormulaLaw(...)")  # type: ignore[type-abstract]


def numbers(value: Array | float, what: str, *, above: float = -np.inf, least: float = -np.inf) -> Array:
    """Finite numbers for each contact point, shape (1,) or (m,), > ``above`` and >= ``least``."""
    found = np.atleast_1d(real_array(value, what))
    if found.ndim != 1:
        raise ProblemError(f"{what} has shape {found.shape}; give a number, or one for each contact point")
    if not (found > above).all():
        raise ProblemError(
            f"{what} is {found.min():g}; it must be {'positive' if above == 0.0 else f'above {above:g}'}"
        )
    if not (found >= least).all():
        raise ProblemError(f"{what} is {found.min():g}; it must be at least {least:g}")
    return found


def row(values: NDArray[Entry], index: IntArray) -> NDArray[Entry]:
    """The numbers (1, ...) or (m, ...) at some of the contact points."""
    return values if len(values) == 1 else values[index]


def taken(law: Superpotential, index: IntArray) -> Superpotential:
    """The law at some of the contact points, or the one law of all of them."""
    return law.take(index) if law.rows > 1 else law


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
