"""Memories of what is broken or worn down by use: the largest opening of glue, the sum of the slip."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.friction import Friction
from hemivar.laws.memory.contact_memory import Energy, LocalStep, Memory, MemoryState, energy_of, kept, slide
from hemivar.laws.transformed import secant, slipped
from hemivar.laws.transformed.exact_table import as_examined
from hemivar.laws.transformed.secants import secant_stiffness

__all__ = ["Secant", "SlipSum"]


@dataclass(frozen=True, eq=False)
class Secant(Memory):
    """Irreversible glue: it remembers the largest opening D, and unloads along the secant to D.

    The normal law of a step is :func:`hemivar.laws.secant` of the law.  Stored is the triangle beneath the secant; what
    the law has taken up beyond it when D grows is lost.  The state is ``opening``, D, and ``stiffness``, g(D)/D.
    """

    name: ClassVar[str] = "secant"

    def start(self, law: ContactLaw, r: Array) -> MemoryState:
        return self._opened(law, np.zeros(len(r)), r)

    @staticmethod
    def _opened(law: ContactLaw, opening: Array, r: Array) -> MemoryState:
        opening = np.minimum(np.maximum(opening, -r[:, 0]), -law.normal.domain.lower)
        return kept(opening=opening, stiffness=secant_stiffness(law.normal, opening))

    def law(self, law: ContactLaw, state: MemoryState, step: LocalStep) -> ContactLaw:
        return ContactLaw(secant(law.normal, state["opening"]), law.friction)

    def advance(self, law: ContactLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return self._opened(law, state["opening"], r)

    def past_peak(self, law: ContactLaw, state: MemoryState) -> BoolArray:
        return law.normal.past_peak(-state["opening"])

    def stored(self, law: ContactLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        of_law = energy_of(law, inner)
        along = of_law(np.zeros(len(r))) + 0.5 * state["stiffness"] * r[:, 0] ** 2
        return np.where((r[:, 0] < 0.0) & (r[:, 0] >= -state["opening"]), along, of_law(r[:, 0]))

    def dissipated(
        self, law: ContactLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """What the law takes up between the old and the new D, less what the triangle beneath the secant grows."""
        beneath = [0.5 * state["stiffness"] * state["opening"] ** 2 for state in (old, new)]
        taken = law.normal.value(-new["opening"]) - law.normal.value(-old["opening"])
        return np.where(new["opening"] > old["opening"], taken - (beneath[1] - beneath[0]), 0.0)


@dataclass(frozen=True, eq=False)
class SlipSum(Memory):
    """Friction that weakens, or strengthens, with the sum s of all slips, and does not recover when slip turns round.

    The friction law is read as a law of the slip sum, h(s) = h_tau j_tau'(s): in a step its profile is
    :func:`hemivar.laws.slipped`, ``H(s_n + |d|) - H(s_n)``.  The state is ``slip``, s.
    """

    name: ClassVar[str] = "slip-sum"
    of_slip: ClassVar[bool] = True  # type: ignore[misc]

    def start(self, law: ContactLaw, r: Array) -> MemoryState:
        return kept(slip=np.zeros(len(r)))

    def law(self, law: ContactLaw, state: MemoryState, step: LocalStep) -> ContactLaw:
        profile = slipped(law.friction.profile, state["slip"])
        if profile is law.friction.profile:
            return law
        return ContactLaw(law.normal, Friction(law.friction.bound, as_examined(profile)))

    def advance(self, law: ContactLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return kept(slip=state["slip"] + slide(r[:, 1:]))
