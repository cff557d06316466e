"""Schemes: how a step of time becomes one static problem, or two.

A stage has the displacement ``u*`` for its unknown.  Rate and acceleration there are linear in it,

    v* = a (u* - u_n) + p,      w* = b (u* - u_n) + q,

with p and q made of the velocity v and the acceleration w at the beginning of the step; all a scheme says are numbers.
The same numbers serve the local displacements of contact points and the displacements of moved supports.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array

if TYPE_CHECKING:
    from hemivar.evolution.state import Kinematics, Rates

__all__ = ["RateFormula", "Scheme", "StageRule"]


@dataclass(frozen=True)
class RateFormula:
    """``difference * (u - u_n) + velocity * v + acceleration * w + mean_velocity * dv + mean_acceleration * dw``.

    v and w are velocity and acceleration at the beginning of the step, dv and dw the mean rates of displacement and
    velocity over the step before it.
    """

    difference: float
    velocity: float = 0.0
    acceleration: float = 0.0
    mean_velocity: float = 0.0
    mean_acceleration: float = 0.0

    @cached_property
    def of_difference(self) -> bool:
        """Whether it is a multiple of the difference alone."""
        return not any((self.velocity, self.acceleration, self.mean_velocity, self.mean_acceleration))

    @cached_property
    def of_velocity(self) -> bool:
        """Whether all that it takes over from the beginning of the step is a multiple of the velocity, or nothing."""
        return not any((self.acceleration, self.mean_velocity, self.mean_acceleration))

    def of(self, difference: Array, motion: Kinematics, last: Rates | None) -> Array:
        """What it makes of a difference, of what was at the beginning of the step, and of the rates before it."""
        out = self.difference * difference
        for factor, rate in self._terms(motion, last):
            out += factor * rate
        return out

    def carried(self, motion: Kinematics, last: Rates | None) -> Array:
        """The part that does not depend on the difference."""
        out: Array | None = None
        for factor, rate in self._terms(motion, last):
            out = factor * rate if out is None else out + factor * rate
        return np.zeros_like(motion.displacement) if out is None else out

    def _terms(self, motion: Kinematics, last: Rates | None) -> Iterator[tuple[float, Array]]:
        if self.velocity:
            yield self.velocity, motion.velocity
        if self.acceleration:
            yield self.acceleration, motion.acceleration
        if self.mean_velocity:
            assert last is not None
            yield self.mean_velocity, last.velocity
        if self.mean_acceleration:
            assert last is not None
            yield self.mean_acceleration, last.acceleration


@dataclass(frozen=True)
class StageRule:
    """One stage of a step."""

    #: Time of the stage as a part of the step: loads and laws hold there.
    at: float
    #: v* and w* of the unknown u* of the stage.
    rate: RateFormula
    acceleration: RateFormula
    #: ``u_{n+1} - u_n = reach (u* - u_n)``, along a straight line in time.
    reach: float
    #: v and w at the end, of the difference ``u_{n+1} - u_n``.
    new_velocity: RateFormula
    new_acceleration: RateFormula
    #: Part of the step that this stage answers for: it adds ``share * step * v*`` where stages are several; 1 where
    #: there is one.
    share: float = 1.0
    #: If given, obstacles are rigid, and contact is a law of the velocity at the end: Newton's law of impact.
    restitution: float | None = None
    #: Whether the foundation pushes with the mean of its law over the step, which takes and gives no energy.
    conserving: bool = False

    @cached_property
    def ends(self) -> bool:
        """Whether the end of the step is the stage, with its velocity and acceleration."""
        same = self.new_velocity == self.rate and self.new_acceleration == self.acceleration
        return self.reach == 1.0 and same

    @cached_property
    def backward(self) -> float | None:
        """The number c with ``v* = a (u* - u_n)`` and ``w* = c (v* - v)``; None where the scheme is another."""
        a, b = self.rate, self.acceleration
        if not (a.of_difference and b.of_velocity and a.difference and b.difference):
            return None
        ratio = b.difference / a.difference
        return ratio if abs(b.velocity + ratio) <= ROUNDED * ratio else None


@dataclass(frozen=True)
class Scheme(ABC):
    """A scheme: a frozen dataclass of options."""

    #: Name in problem files and tables.
    name: ClassVar[str]
    #: Order in the step for smooth solutions.
    order: ClassVar[int] = 2
    #: Whether it needs a mass, and whether it can have one.
    needs_mass: ClassVar[bool] = False
    takes_mass: ClassVar[bool] = True
    #: Whether a step goes on from the rates of the step before it.
    multistep: ClassVar[bool] = False
    #: Whether contact is a law of impact, one of velocities.
    is_impact_law: ClassVar[bool] = False
    #: Whether a step of an elastic body is one equilibrium, at its end, which the one before leads to.
    ends_at_equilibrium: ClassVar[bool] = False
    #: Whether a theorem bounds its error in time.
    supports_time_bound: ClassVar[bool] = False
    #: Whether velocities swing where a body touches a rigid obstacle.
    rings_on_rigid_obstacles: ClassVar[bool] = False

    @property
    def averages_laws(self) -> bool:
        """Whether the foundation pushes with the mean of its law over a step."""
        return False

    @abstractmethod
    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        """The stages of a step of a given length, in their order.

        Parameters
        ----------
        step : float
        last : float or None
            Length of the step before it; None if it begins again. Schemes of one step do not ask.
        """

    def massless_rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        """The same of a body without mass, whose velocity at the end of a step no step needs: it is only reported."""
        return self.rules(step, last)

    def uses_initial_acceleration(self, step: float) -> bool:
        """Whether a step needs the acceleration of its beginning."""
        return any(rule.rate.acceleration or rule.acceleration.acceleration for rule in self.rules(step))

    def is_displacement_based(self, step: float) -> bool:
        """Whether velocities at the end of a step are those of its displacements alone."""
        return not any(
            rule.velocity or rule.acceleration
            for one in self.rules(step)
            for rule in (one.rate, one.new_velocity, replace(one.acceleration, velocity=0.0))
        )
