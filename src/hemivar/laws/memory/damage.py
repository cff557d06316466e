"""Memories of what is broken or worn down by use: the largest opening of glue, the sum of the slip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.laws.friction import Friction
from hemivar.laws.memory.contact_memory import Energy, LocalStep, Memory, MemoryState, energy_of, kept, slide
from hemivar.laws.transformed import slipped
from hemivar.laws.transformed.exact_table import as_examined
from hemivar.laws.vector_law import VectorLaw

__all__ = ["Secant", "SlipSum"]


@dataclass(frozen=True, eq=False)
class Secant(Memory):
    """Irreversible glue: it remembers the largest opening D, and unloads along the secant to D.

    The normal law of a step is :func:`hemivar.laws.secant` of the law.  Stored is the triangle beneath the secant; what
    the law has taken up beyond it when D grows is lost.  The state is ``opening``, D, and ``stiffness``, g(D)/D.
    """

    name: ClassVar[str] = "secant"
    of_state = True

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(**law.damaged(None, r))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        return law.unloading(state)

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return kept(**law.damaged(state, r))

    def past_peak(self, law: VectorLaw, state: MemoryState) -> BoolArray:
        return law.softened(state)

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        return law.unloading_energy(state, r, energy_of(law, inner))

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """What the law takes up between the old and the new D, less what the triangle beneath the secant grows."""
        return law.spent_by(new) - law.spent_by(old)


@dataclass(frozen=True, eq=False)
class SlipSum(Memory):
    """Friction that weakens, or strengthens, with the sum s of all slips, and does not recover when slip turns round.

    The friction law is read as a law of the slip sum, h(s) = h_tau j_tau'(s): in a step its profile is
    :func:`hemivar.laws.slipped`, ``H(s_n + |d|) - H(s_n)``.  The state is ``slip``, s.
    """

    name: ClassVar[str] = "slip-sum"
    of_slip: ClassVar[bool] = True  # type: ignore[misc]

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(slip=np.zeros(len(r)))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        profile = slipped(parts.friction.profile, state["slip"])
        if profile is parts.friction.profile:
            return law
        return parts.with_parts(friction=Friction(parts.friction.bound, as_examined(profile)))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return kept(slip=state["slip"] + slide(r[:, 1:]))
