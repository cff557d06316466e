"""Events: states that are worth a stop, found by bisection of the step in which they happen."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import expect, one_of, quoted
from hemivar.errors import ProblemError
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.state import TimeState
from hemivar.evolution.step_laws import seen_displacement
from hemivar.fem.contact_basis import nodal_depths

__all__ = ["BondBroken", "Event", "MarginLost", "OnEvent", "Release", "Slip", "Touch", "When"]


class OnEvent(StrEnum):
    """What an event does to the march."""

    RECORD = "record"
    """The step ends there, and the march goes on."""
    STOP = "stop"
    """The march ends there."""


@dataclass(frozen=True)
class Event(ABC):
    """Something that happens when :meth:`level` rises through zero.

    Parameters
    ----------
    then : OnEvent
        ``"record"`` or ``"stop"``.
    boundary : str, optional
        The contact boundary that is watched; all by default.
    """

    name: ClassVar[str] = "event"

    then: OnEvent = OnEvent.RECORD
    boundary: str | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "then", one_of(self.then, f"event {self.name}: then", OnEvent))

    @abstractmethod
    def level(self, discrete: DiscreteEvolution, state: TimeState, margin: float) -> float:
        """A number that rises through zero when it happens.

        Parameters
        ----------
        discrete : DiscreteEvolution
        state : TimeState
        margin : float
            Smallness margin of the step that led to the state.
        """

    def points(self, discrete: DiscreteEvolution) -> np.ndarray:  # type: ignore[type-arg]
        """The contact points that are watched."""
        if self.boundary is None:
            return np.arange(discrete.problem.contact_points)
        return discrete.problem.contact.on(self.boundary)


@dataclass(frozen=True)
class Touch(Event):
    """The first contact point reaches the foundation.

    Parameters
    ----------
    then : OnEvent
        What happens then.
    boundary : str, optional
        The contact boundary that is looked at; all by default.
    """

    name: ClassVar[str] = "touch"

    def level(self, discrete: DiscreteEvolution, state: TimeState, margin: float) -> float:
        return _deepest(discrete, state, self.points(discrete))


@dataclass(frozen=True)
class Release(Event):
    """The last contact point leaves the foundation.

    Parameters
    ----------
    then : OnEvent
        What happens then.
    boundary : str, optional
        The contact boundary that is looked at; all by default.
    """

    name: ClassVar[str] = "release"

    def level(self, discrete: DiscreteEvolution, state: TimeState, margin: float) -> float:
        return -_deepest(discrete, state, self.points(discrete))


@dataclass(frozen=True)
class Slip(Event):
    """A contact point starts to slip: its rate of slip exceeds a small one.

    Parameters
    ----------
    rate : float
        Below it a point counts as sticking.
    then : OnEvent
        What happens then.
    boundary : str, optional
        The contact boundary that is looked at; all by default.
    """

    name: ClassVar[str] = "slip"

    rate: float = 0.0

    def level(self, discrete: DiscreteEvolution, state: TimeState, margin: float) -> float:
        speed = np.linalg.norm(state.local.velocity[self.points(discrete), 1:], axis=1)
        fastest, size = discrete.vectors.largest(
            float(speed.max(initial=0.0)), float(np.abs(state.body.velocity).max(initial=0.0))
        ).tolist()
        return float(fastest - max(self.rate, 1e-9 * size) or -np.finfo(float).tiny)


@dataclass(frozen=True)
class BondBroken(Event):
    """The first bond is broken: a memory ``bond`` of a contact point falls below a part of one.

    Parameters
    ----------
    below : float
        Bond that counts as broken.
    then : OnEvent
        What happens then.
    boundary : str, optional
        The contact boundary that is looked at; all by default.
    """

    name: ClassVar[str] = "bond broken"

    below: float = 1e-3

    def level(self, discrete: DiscreteEvolution, state: TimeState, margin: float) -> float:
        bonds = [
            values
            for boundary, states in state.memory.items()
            for name, values in states.items()
            if name.rpartition(".")[2] == "bond" and self.boundary in (None, boundary)
        ]
        least = min((float(np.min(bond, initial=np.inf)) for bond in bonds), default=np.inf)
        return self.below + float(discrete.vectors.largest(-least)[0])


@dataclass(frozen=True)
class MarginLost(Event):
    """The problem of a step may have several solutions.

    Parameters
    ----------
    then : OnEvent
        What happens then.
    boundary : str, optional
        Has no say: the margin is that of the whole body.
    """

    name: ClassVar[str] = "margin lost"

    def level(self, discrete: DiscreteEvolution, state: TimeState, margin: float) -> float:
        return -1.0 if np.isnan(margin) else -margin


@dataclass(frozen=True)
class When(Event):
    """A function of the user's rises through zero.

    Parameters
    ----------
    function : callable
        Called with the discrete evolution and the state; returns a number.
    label : str
        What it is called in the history.
    then : OnEvent
        What happens then.
    boundary : str, optional
        The contact boundary that is looked at; all by default.
    """

    name: ClassVar[str] = "when"

    function: Callable[[DiscreteEvolution, TimeState], float] | None = None
    label: str = "event"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not callable(self.function):
            raise ProblemError("the event When needs a function of (discrete, state) that returns a number")
        expect(self.label, str, "the label of an event", "give a text")

    def level(self, discrete: DiscreteEvolution, state: TimeState, margin: float) -> float:
        assert self.function is not None
        returned = self.function(discrete, state)
        try:
            value = float(returned)
        except (TypeError, ValueError):
            raise ProblemError(f"the event '{self.label}' gave {quoted(returned)}; return a number") from None
        if np.isnan(value):
            raise ProblemError(f"the event '{self.label}' is not a number at t = {state.time:g}")
        return value


def _deepest(discrete: DiscreteEvolution, state: TimeState, points: np.ndarray) -> float:  # type: ignore[type-arg]
    """Largest penetration of some contact points, into what is left of a foundation that is worn or has crept."""
    depth = nodal_depths(discrete.problem, seen_displacement(discrete, state)[:, 0])
    return float(discrete.vectors.largest(float(depth[points].max(initial=-np.inf)))[0])
