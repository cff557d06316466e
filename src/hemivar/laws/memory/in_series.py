"""Memories in series with a law (Maxwell creep, wear): a surface that is worn, a foundation that creeps.

Both keep a depth w, and the law acts on what is left of the penetration, ``p in dj(r - w)``.  When w grows in a step by
``c p``, with the pressure p at its end, the law of the step is the Moreau envelope of j with the compliance c, at
r - w.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, Parameter
from hemivar.laws.memory.contact_memory import Energy, LocalStep, Memory, MemoryState, energy_of, kept, slide
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import parameter, positive
from hemivar.laws.transformed import affine, envelope
from hemivar.laws.vector_law import VectorLaw

__all__ = ["ViscousFoundation", "Wear"]


class _Series(Memory):
    """A depth w that grows by ``c p`` in a step; the state is ``depth``."""

    @abstractmethod
    def _compliance(self, step: LocalStep) -> Array:
        """c of the step as the last iterate has it, (m,)."""

    @abstractmethod
    def _reached(self, step: LocalStep, r: Array, lam: Array) -> Array:
        """c of the step at its end."""

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(depth=np.zeros(len(r)))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        return parts.with_parts(affine(envelope(parts.normal, self._compliance(step)), 1.0, -state["depth"]))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return kept(depth=state["depth"] + self._reached(step, r, lam) * lam[:, 0])

    def seen(self, state: MemoryState, r: Array) -> Array:
        left = np.array(r, dtype=float)
        left[:, 0] -= state["depth"]
        return left

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        bound, seen = law.penetrations, self.seen(state, r)
        seen[:, 0] = np.clip(seen[:, 0], bound.lower, bound.upper)  # a rigid law holds r - w there, up to rounding
        return energy_of(law, inner)(seen)

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        return np.asarray(lam[:, 0] * (new["depth"] - old["depth"]))


@named(
    LawKind.MEMORY,
    "wear",
    "Archard's wear: the surface recedes with pressure and slip",
    "p in dj(r - w), w' = coefficient p |slip rate|",
)
@dataclass(frozen=True, eq=False)
class Wear(_Series):
    """Archard's wear: the depth grows with pressure and slip, ``w' = coefficient p |slip rate|``.

    In a step c is the coefficient times the slip increment, which is iterated.  Only pressure wears, not tension.

    Parameters
    ----------
    coefficient : Parameter
        >= 0 (length per length of slip and force per area, 1/pressure).
    """

    coefficient: Parameter = field(metadata=parameter("wear for pressure and slip", "area/force", least=0.0))
    name: ClassVar[str] = "wear"
    iterates: ClassVar[bool] = True  # type: ignore[misc]

    def _worn(self, slid: Array, pressure: Array) -> Array:
        return np.where(pressure > 0.0, self.values()["coefficient"] * slid, 0.0)

    def _compliance(self, step: LocalStep) -> Array:
        return self._worn(step.sliding, step.pressing)

    def _reached(self, step: LocalStep, r: Array, lam: Array) -> Array:
        return self._worn(slide(r[:, 1:]), lam[:, 0])


@named(
    LawKind.MEMORY,
    "viscous-foundation",
    "a foundation that creeps: the law in series with a dashpot",
    "p in dj(r - w), w' = p/viscosity",
)
@dataclass(frozen=True, eq=False)
class ViscousFoundation(_Series):
    """A foundation that creeps: the law in series with a dashpot, ``w' = p/viscosity``.

    In a step c = tau/viscosity.

    Parameters
    ----------
    viscosity : Parameter
        > 0 (pressure per velocity).
    """

    viscosity: Parameter = field(metadata=positive("viscosity in series", "force/area/length time"))
    name: ClassVar[str] = "viscous-foundation"

    def _compliance(self, step: LocalStep) -> Array:
        return np.broadcast_to(step.tau / self.values()["viscosity"], (len(step.before),))

    def _reached(self, step: LocalStep, r: Array, lam: Array) -> Array:
        return self._compliance(step)
