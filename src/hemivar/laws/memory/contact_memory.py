"""Internal variables of contact points: what a law keeps from one time step to the next, and the law of a step.

A :class:`Memory` answers for a contact law with a state, arrays with one row for each contact point.  In a step it
makes of the law it is given the law of the step; when the step has been solved, it makes of the state the next one.
Nothing is changed in place: a step that is rejected is forgotten.

In the laws of a step column 0 is the penetration r_nu itself, and the slip is the slip *increment* of the step.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Self

import numpy as np

from hemivar.basics.arguments import number
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.normal_and_friction import NormalAndFriction, with_friction
from hemivar.laws.parameters import field_values
from hemivar.laws.vector_law import VectorLaw

__all__ = ["Energy", "LocalStep", "Memory", "MemoryState", "energy_of", "kept", "slide"]

#: What a contact point remembers: arrays (m, ...) by name, read-only.
MemoryState = Mapping[str, Array]

#: Energy that is stored at a local displacement, (m, c) -> (m,).
Energy = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class LocalStep(PickleMixin):
    """A time step, or the stage of one, as the contact points see it.

    In the step the rate is ``v = rate (r - before) + drift``; of the slip, whose increment is d, ``rate d + drift``.

    Attributes
    ----------
    tau : float
        Length of the step, > 0.
    rate : float
        The factor a of the displacement in the rate: 1/tau for implicit Euler, 2/tau for the midpoint rule.
    before : array (m, c)
        Local displacement r_n at the beginning of the step; its first column, the penetration, is what counts.
    guess : array (m, c), optional
        Local displacement of the last iterate: penetration and slip increment. The beginning of the step by default.
    guess_multiplier : array (m, c), optional
        Multiplier of the last iterate; zero by default.
    drift : array (m, c), optional
        The part of the rate that does not depend on the unknown displacement; zero by default.
    at : float
        Where the law holds, as a part of the way from the beginning to the end of the step; 1, its end, by default.
    """

    tau: float
    rate: float
    before: Array
    guess: Array | None = None
    guess_multiplier: Array | None = None
    drift: Array | None = None
    at: float = 1.0

    def __post_init__(self) -> None:
        number(self.tau, "the time step", "it must be a positive time")
        number(self.rate, "the factor of the displacement in the rate", "it must be positive")
        if not (np.isfinite(self.tau) and self.tau > 0.0):
            raise ProblemError(f"the time step is {self.tau}; it must be a positive time")
        if not (np.isfinite(self.rate) and self.rate > 0.0):
            raise ProblemError(f"the factor of the displacement in the rate is {self.rate}; it must be positive")

    @property
    def shift(self) -> Array:
        """The rate of the penetration at r_nu = 0, (m,): it is ``rate r_nu + shift``."""
        drift = 0.0 if self.drift is None else self.drift[:, 0]
        return np.asarray(drift - self.rate * self.before[:, 0])

    @property
    def sliding(self) -> Array:
        """Size of the slip increment of the last iterate, (m,)."""
        return slide(self.before[:, 1:] * 0.0 if self.guess is None else self.guess[:, 1:])

    @property
    def pressing(self) -> Array:
        """Pressure of the last iterate, (m,)."""
        known = self.guess_multiplier is not None
        return np.asarray(self.guess_multiplier[:, 0]) if known else np.zeros(len(self.before))  # type: ignore[index]


class Memory(PickleMixin, ABC):
    """What contact points remember; a frozen object whose dataclass fields are parameters.

    A parameter is a number, one for each contact point, or a function of x, which :meth:`at` evaluates.  Its field may
    say its limits, as those of laws do: ``field(metadata=parameter(...))`` of :mod:`hemivar.laws.parameters`.
    """

    #: Short name used in messages, files and tables.
    name: ClassVar[str] = "memory"

    #: Whether the law of the step depends on the solution of the step, so that it is made anew until it stands.
    iterates: bool = False

    #: Whether the law of the step depends on the law it is given, the state and the length of the step, and on no more.
    of_state: bool = False

    #: Whether the friction law that it is given is the one stated, of the slip, and not one of the slip rate.
    of_slip: bool = False

    #: Whether it makes the friction law of the step.
    takes_friction: bool = False

    #: Whether the law of the step couples opening and slip, and is one of the whole slip.
    couples: bool = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if vars(cls).keys() & {"minimum", "positive"}:
            raise ProblemError(
                f"memory '{cls.name}' has limits in minimum or positive, which are not read; give each field its own, "
                "field(metadata=parameter(..., least=0.0)) of hemivar.laws.parameters"
            )

    def values(self, points: Array | None = None) -> dict[str, Array]:
        """The parameters at the contact points, checked, each of shape (1,) or (m,)."""
        return self._resolved if points is None else self._evaluated(points)

    @cached_property
    def _resolved(self) -> dict[str, Array]:
        return self._evaluated(None)

    def _evaluated(self, points: Array | None) -> dict[str, Array]:
        return field_values(self, points, f"memory '{self.name}'")  # type: ignore[arg-type]

    def at(self, points: Array | None) -> Self:
        """The memory with every parameter evaluated at ``points (m, d)``."""
        return replace(self, **self.values(points))  # type: ignore[type-var]

    def take(self, index: IntArray) -> Self:
        """The memory, with resolved parameters, at some of the contact points."""
        return replace(self, **{k: v if v.size == 1 else v[index] for k, v in self.values().items()})  # type: ignore[type-var]

    @abstractmethod
    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        """The state at the beginning, in the local displacement ``r (m, c)``."""

    @abstractmethod
    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        """The law of the step, made of the law without this memory."""

    @abstractmethod
    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        """The state at the end of the step, where the local displacement is ``r`` (with the slip increment).

        Parameters
        ----------
        law : VectorLaw
            The law without this memory, as in :meth:`law`.
        r, lam : arrays (m, c)
            Local displacement, of which the slip is the increment of the step, and multiplier, without what a damping
            beside the memory exerts.
        """

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        """Energy that law and memory store, (m,); friction of the slip rate stores none.

        ``r`` is the whole local displacement; ``inner`` is the energy of the law without this memory,
        ``law.stored_energy`` by default.
        """
        return energy_of(law, inner)(r)

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """Energy that is lost in the step by the change of the state, (m,); that of friction is not counted."""
        return np.zeros(len(r))

    def past_peak(self, law: VectorLaw, state: MemoryState) -> BoolArray:
        """Where the memory alone says that the pull of the foundation is past its peak, (m or 1,)."""
        return np.zeros(1, dtype=bool)

    def damage(self, law: VectorLaw, state: MemoryState) -> Array | None:
        """Share (m,) of its first stiffness that glue has lost, 0 intact and 1 broken; None where it is not known."""
        return None

    def seen(self, state: MemoryState, r: Array) -> Array:
        """Local displacement (m, c) that the law without this memory sees in a state: of a worn surface, less wear."""
        return r

    def parts_of(self, law: VectorLaw) -> NormalAndFriction:
        """The law, which must be a normal law with friction."""
        return with_friction(law, f"the memory '{self.name}'")


def energy_of(law: VectorLaw, inner: Energy | None) -> Energy:
    """The energy of the law without a memory: what is handed on, or its own value."""
    return law.stored_energy if inner is None else inner


def slide(slip: Array) -> Array:
    """Length of each slip vector (m, t); zero where there are no tangents."""
    if slip.shape[1] == 0:
        return np.zeros(len(slip))
    return np.abs(slip[:, 0]) if slip.shape[1] == 1 else np.asarray(np.hypot.reduce(slip, axis=1))


def kept(**arrays: Array) -> MemoryState:
    """A state of these arrays, which nobody can change."""
    own = {}
    for key, values in arrays.items():
        own[key] = np.array(values, dtype=float)
        own[key].flags.writeable = False
    return MappingProxyType(own)
