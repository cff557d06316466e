"""What the cut through a bolt remembers: by how much it was shortened while it was tightened."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws.memory.contact_memory import Energy, LocalStep, Memory, MemoryState, energy_of, kept
from hemivar.laws.transformed import affine
from hemivar.laws.vector_law import VectorLaw

__all__ = ["Shortening"]


@dataclass(frozen=True, eq=False)
class Shortening(Memory):
    """The normal jump of a bolt, which stays once the bolt is held; the state is ``shortening``."""

    name: ClassVar[str] = "shortening"
    of_state: ClassVar[bool] = True  # type: ignore[misc]

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(shortening=np.zeros(len(r)))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        return parts.with_parts(affine(parts.normal, 1.0, -state["shortening"]))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        ends = law.penetrations
        return kept(shortening=np.where(ends.lower == ends.upper, state["shortening"], r[:, 0]))

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        there = r.copy()
        there[:, 0] = 0.0  # a tension is no spring
        return energy_of(law, inner)(there)

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """Less the work of who tightens the bolt."""
        return np.asarray(lam[:, 0] * (r[:, 0] - step.before[:, 0]))
