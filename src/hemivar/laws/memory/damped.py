"""Damping that acts in contact only and cannot pull."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.memory.contact_memory import LocalStep, Memory, MemoryState, kept
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed import affine, pushing
from hemivar.laws.vector_law import VectorLaw

__all__ = ["DampedContact"]


@dataclass(frozen=True, eq=False)
class DampedContact(Memory):
    """A damper of the foundation that cannot pull: pressure ``max(0, j'(r) + psi'(r'))`` while r > 0, none beside.

    Damping stated as such acts on every rate, in contact or not, and holds a body back that leaves; this one lets it go
    when springs and dashpot together would pull.  There is no state.

    Parameters
    ----------
    damping : Superpotential
        psi, a monotone law of the rate of the penetration; ``table_law`` or ``PiecewiseQuadratic`` for a dashpot that
        resists in both directions.
    """

    damping: Superpotential
    name: ClassVar[str] = "damped-contact"

    def __post_init__(self) -> None:
        if not isinstance(self.damping, Superpotential):
            raise ProblemError(f"the damping must be a superpotential of the rate, not {described(self.damping)}")

    def at(self, points: Array | None) -> DampedContact:
        return DampedContact(self.damping.at(points))

    def take(self, index: IntArray) -> DampedContact:
        return DampedContact(self.damping.take(index))

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept()

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        return parts.with_parts(pushing(parts.normal, affine(self.damping, step.rate, step.shift)))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return state

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """The work of what the law does not give; when the damper is cut off, springs that relax by themselves lose."""
        way, there = r[:, 0] - step.before[:, 0], r.copy()
        there[:, 0] = step.before[:, 0] + step.at * way
        bound = law.pressures(there)
        return np.asarray((lam[:, 0] - np.clip(lam[:, 0], bound.lower, bound.upper)) * way)
