"""The incremental law of a time step: several memories at the same points, with rates and with damping."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from hemivar.basics.arguments import described, expect
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.memory.contact_memory import Energy, LocalStep, Memory, MemoryState, energy_of, kept
from hemivar.laws.normal_and_friction import damped
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed import affine
from hemivar.laws.vector_law import VectorLaw

__all__ = ["MemoryChain", "law_of_step"]


@dataclass(frozen=True, eq=False)
class MemoryChain(Memory):
    """Several memories, one after the other: the first is given the law, every other one the law of the one before.

    A chain of none is no memory.  The entries of its state are those of its parts, with the number of the part in
    front: ``0.opening``.

    Parameters
    ----------
    parts : tuple of Memory
        Memories, each with those before it.
    """

    parts: tuple[Memory, ...]
    name: ClassVar[str] = "chain"

    def __post_init__(self) -> None:
        parts = tuple(expect(self.parts, tuple | list, "the parts of a chain", "give a tuple of memories"))
        for part in parts:
            if not isinstance(part, Memory):
                raise ProblemError(f"a memory of contact points is one such as Secant(), not {described(part)}")
        for what in ("of_slip", "takes_friction"):
            names = [part.name for part in parts if getattr(part, what, False)]
            if len(names) > 1:
                raise ProblemError(f"the memories {' and '.join(names)} both define the friction law; leave one out")
        for part in parts[:-1]:
            if part.couples:
                raise ProblemError(
                    f"the memory '{part.name}' couples opening and slip, and others follow it; put it last"
                )
        object.__setattr__(self, "parts", parts)

    @property
    def iterates(self) -> bool:  # type: ignore[override]
        """Whether the law of the step of any part depends on the solution of the step."""
        return any(part.iterates for part in self.parts)

    @property
    def of_state(self) -> bool:  # type: ignore[override]
        """Whether the laws of the step of all parts depend on their states and the length of the step alone."""
        return all(part.of_state for part in self.parts)

    @property
    def of_slip(self) -> bool:  # type: ignore[override]
        """Whether a part is given the friction law as stated, and not as one of the slip rate."""
        return any(part.of_slip for part in self.parts)

    @property
    def couples(self) -> bool:  # type: ignore[override]
        """Whether the last part makes opening and slip act together."""
        return any(part.couples for part in self.parts)

    def at(self, points: Array | None) -> Self:
        return replace(self, parts=tuple(part.at(points) for part in self.parts))

    def take(self, index: IntArray) -> Self:
        return replace(self, parts=tuple(part.take(index) for part in self.parts))

    def _own(self, state: MemoryState, number: int) -> MemoryState:
        start = f"{number}."
        return {key.removeprefix(start): values for key, values in state.items() if key.startswith(start)}

    def _joined(self, states: list[MemoryState]) -> MemoryState:
        return kept(**{f"{i}.{key}": values for i, state in enumerate(states) for key, values in state.items()})

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return self._joined([part.start(law, r) for part in self.parts])

    def _steps(self, state: MemoryState, step: LocalStep) -> list[LocalStep]:
        """The step as each part sees it, through those after it."""
        steps = [step] * len(self.parts)
        for i in range(len(self.parts) - 1, 0, -1):
            before = self.parts[i].seen(self._own(state, i), steps[i].before)
            steps[i - 1] = replace(steps[i], before=before)
        return steps

    def _given(self, law: VectorLaw, state: MemoryState, steps: list[LocalStep]) -> list[VectorLaw]:
        """The law that each part is given."""
        laws = [law]
        for i, part in enumerate(self.parts[:-1]):
            laws.append(part.law(laws[-1], self._own(state, i), steps[i]))
        return laws

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        if not self.parts:
            return law
        steps, last = self._steps(state, step), len(self.parts) - 1
        return self.parts[-1].law(self._given(law, state, steps)[-1], self._own(state, last), steps[-1])

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        steps = self._steps(state, step)
        laws, states = self._given(law, state, steps), [self._own(state, i) for i in range(len(self.parts))]
        for i in range(len(self.parts) - 1, -1, -1):
            states[i] = self.parts[i].advance(laws[i], states[i], steps[i], r, lam)
            r = self.parts[i].seen(states[i], r)
        return self._joined(states)

    def seen(self, state: MemoryState, r: Array) -> Array:
        for i in range(len(self.parts) - 1, -1, -1):
            r = self.parts[i].seen(self._own(state, i), r)
        return r

    def past_peak(self, law: VectorLaw, state: MemoryState) -> BoolArray:
        own = [part.past_peak(law, self._own(state, i)) for i, part in enumerate(self.parts)]
        return np.asarray(np.logical_or.reduce(np.broadcast_arrays(np.zeros(1, dtype=bool), *own)))

    def damage(self, law: VectorLaw, state: MemoryState) -> Array | None:
        damages = (part.damage(law, self._own(state, i)) for i, part in enumerate(self.parts))
        return next((lost for lost in damages if lost is not None), None)

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        energy = energy_of(law, inner)
        for i, part in enumerate(self.parts):
            energy = _stored_in(part, law, self._own(state, i), energy)
        return energy(r)

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        steps, total = self._steps(old, step), np.zeros(len(r))
        laws = self._given(law, old, steps)
        for i in range(len(self.parts) - 1, -1, -1):
            part, states = self.parts[i], (self._own(old, i), self._own(new, i))
            total = total + part.dissipated(laws[i], *states, steps[i], r, lam)
            r = part.seen(states[1], r)
        return total


def _stored_in(part: Memory, law: VectorLaw, state: MemoryState, inner: Energy) -> Energy:
    return lambda r: part.stored(law, state, r, inner)


def law_of_step(
    law: VectorLaw, memory: Memory, state: MemoryState, step: LocalStep, damping: Superpotential | None = None
) -> VectorLaw:
    """The law of a time step: friction of the slip rate in increments, the memory, and damping of the normal rate.

    Parameters
    ----------
    law : VectorLaw
        As stated, with resolved parameters.
    memory : Memory
        ``Chain(())`` for none.
    state : mapping
        Of the memory.
    step : LocalStep
        Step and state from which it starts.
    damping : Superpotential, optional
        A law psi of the rate of the penetration; it adds ``psi'(v)`` to the pressure, in contact or not.

    Returns
    -------
    VectorLaw
        Of the penetration and the slip increment.
    """
    expect(law, VectorLaw, "law", "give a VectorLaw, such as ContactLaw(...).at(points)")
    expect(memory, Memory, "memory", "give a memory, MemoryChain(()) for none")
    expect(step, LocalStep, "step", "give a LocalStep(...)")
    given = law if memory.of_slip else law.in_increments(step.rate)
    made = memory.law(given, state, step)
    if damping is None:
        return made
    return damped(made, affine(damping, step.rate, step.shift))
