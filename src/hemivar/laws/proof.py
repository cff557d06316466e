"""How a constant of a law is known (alpha, growth, Lipschitz constant): value, reach in which it holds, evidence."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

import numpy as np

from hemivar.basics.types import Array

__all__ = [
    "SAMPLED",
    "Constant",
    "Evidence",
    "Proof",
    "Within",
    "beside",
    "gathered",
    "in_class_of",
    "of_alpha",
    "worst",
]

#: What may be known: the weak convexity alpha, c0 and c1 of the growth, the Lipschitz constant of a friction bound.
Constant = Literal["alpha", "growth", "lipschitz"]
#: A constant as a function of the size of the displacements up to which it is to hold, (m or 1,).
Within = Callable[[float], Array]


class Evidence(IntEnum):
    """How a constant is known, the surest first."""

    SHOWN = 0
    BY_INTERVALS = 1
    STATED = 2  # by the user, in a class of a law
    SAMPLED = 3


@dataclass(frozen=True, eq=False)
class Proof:
    """How a constant of a law is known, and up to which displacements; part by part where the law has several.

    A constant from samples has the reach 0: it may be too small anywhere.
    """

    evidence: Evidence = Evidence.SHOWN
    reach: tuple[float, ...] = (np.inf,)  # |r|, or penetration and slip, up to which it holds
    values: tuple[Within, ...] = ()  # of alpha, for each part

    @property
    def sure(self) -> bool:
        """Whether the constant holds for every displacement."""
        return min(self.reach) == np.inf

    @property
    def doubt(self) -> str:
        """Why it does not hold for every displacement, in words; empty if it does."""
        if self.sure:
            return ""
        reach = min(self.reach)
        return "known from samples only" if reach == 0.0 else f"proved within the reach {reach:g} only"

    def value(self, *reach: float) -> tuple[Array, ...]:
        """alpha of each part, as is proved up to a reach, inf where nothing is; that of all displacements as known."""
        return tuple(value(part) for value, part in zip(self.values, reach, strict=True))

    def whole(self) -> Proof:
        """Of a law that shifts displacements: what holds up to a reach only is not known there."""
        return self if self.sure else replace(self, evidence=Evidence.SAMPLED, reach=(0.0,) * len(self.reach))


#: Known from samples only.
SAMPLED = Proof(Evidence.SAMPLED, (0.0,))


def in_class_of(law: object) -> Proof:
    """Of a constant that a class of a law states for all displacements: shown by the library, stated by a user."""
    return Proof(Evidence.SHOWN if type(law).__module__.startswith("hemivar.") else Evidence.STATED)


def of_alpha(proof: Proof, alpha: Callable[[int], Array]) -> Proof:
    """The same with the alpha of each part, which holds within the whole reach."""

    def of_part(part: int, limit: float) -> Within:
        return lambda reach: alpha(part) if reach <= limit or reach == np.inf else np.full(1, np.inf)

    return replace(proof, values=tuple(of_part(*part) for part in enumerate(proof.reach)))


def worst(proofs: Iterable[Proof]) -> Proof:
    """What is known where each of several constants is needed."""
    known = list(proofs)
    reach = tuple(min(parts) for parts in zip(*(proof.reach for proof in known), strict=True))
    return Proof(max(proof.evidence for proof in known), reach)


def beside(normal: Proof, slip: Proof) -> Proof:
    """A constant of the penetration and one of the slip."""
    return Proof(max(normal.evidence, slip.evidence), normal.reach + slip.reach, normal.values + slip.values)


def gathered(proofs: Sequence[Proof], gather: Callable[[list[Array]], Array]) -> Proof:
    """A constant of laws at different contact points, whose values are gathered."""

    def of_part(values: tuple[Within, ...]) -> Within:
        return lambda reach: gather([value(reach) for value in values])

    return replace(worst(proofs), values=tuple(map(of_part, zip(*(proof.values for proof in proofs), strict=True))))
