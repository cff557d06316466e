"""Schemes: how a step of time becomes one static problem, or two.

A stage has the displacement ``u*`` for its unknown.  Rate and acceleration there are linear in it,

    v* = a (u* - u_n) + p,      w* = b (u* - u_n) + q,

with p and q made of the velocity v and the acceleration w at the beginning of the step; all a scheme says are numbers.
The same numbers serve the local displacements of contact points and the displacements of moved supports.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from hemivar.basics.arguments import expect, number
from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.stated import Form, stated
from hemivar.basics.types import Array
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.evolution.state import Kinematics, Rates

__all__ = [
    "BDF2",
    "SCHEMES",
    "SDIRK2",
    "GeneralizedAlpha",
    "ImplicitEuler",
    "Midpoint",
    "MoreauJean",
    "Newmark",
    "RateFormula",
    "Scheme",
    "StageRule",
]


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


@dataclass(frozen=True)
class ImplicitEuler(Scheme):
    """Implicit Euler: the scheme of the literature on hemivariational inequalities; order 1, and it dissipates.

    Examples
    --------
    >>> import hemivar as hv
    >>> hv.evolution.ImplicitEuler().order
    1
    """

    name: ClassVar[str] = "implicit-euler"
    order: ClassVar[int] = 1
    ends_at_equilibrium: ClassVar[bool] = True
    supports_time_bound: ClassVar[bool] = True

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        rate = RateFormula(1.0 / step)
        acceleration = RateFormula(1.0 / step**2, -1.0 / step)
        return (StageRule(1.0, rate, acceleration, 1.0, rate, acceleration),)


@dataclass(frozen=True)
class Midpoint(Scheme):
    """The midpoint rule: order 2; keeps the energy of a linear body.  Contact laws hold at the midpoint.

    Parameters
    ----------
    conserving : bool
        Whether the foundation pushes with ``(j(r) - j(r_n))/(r - r_n)``, the mean of its law over the step, so that
        energy is kept on foundations that are not linear as well; for piecewise quadratic laws without an end, without
        memory and damping.
    """

    name: ClassVar[str] = "midpoint"
    rings_on_rigid_obstacles: ClassVar[bool] = True

    conserving: bool = field(default=False, metadata=stated(Form.FLAG))

    def __post_init__(self) -> None:
        expect(self.conserving, bool, "conserving of Midpoint", "write True or False")

    @property
    def averages_laws(self) -> bool:
        return self.conserving

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        rate = RateFormula(2.0 / step)
        acceleration = RateFormula(4.0 / step**2, -2.0 / step)
        velocity = RateFormula(2.0 / step, -1.0)
        end = RateFormula(2.0 / step**2, -2.0 / step)
        return (StageRule(0.5, rate, acceleration, 2.0, velocity, end, conserving=self.conserving),)

    def massless_rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        # 2 (u_{n+1} - u_n)/tau - v would hand on for ever what v is off, as it is at the start, where nobody states it.
        # Extrapolated from the middle instead, by the mean of the slope since the beginning and of the last one, it is
        # exact where the velocity is a straight line, and what v and w are off is forgotten in two steps.
        (rule,) = self.rules(step)
        velocity = RateFormula(1.5 / step, -0.5, 0.25 * step)
        return (replace(rule, new_velocity=velocity, new_acceleration=RateFormula(1.0 / step**2, -1.0 / step, 0.5)),)


@dataclass(frozen=True)
class Newmark(Scheme):
    """Newmark's scheme, the contact laws at the end of the step.

    Where a rigid obstacle is hit it oscillates and may gain energy: take a compliant foundation, :class:`MoreauJean`,
    or ``Evolution(mass="redistributed")``.

    Parameters
    ----------
    beta, gamma : float
        ``beta > 0`` and ``gamma >= 1/2``; by default the trapezoidal rule, without dissipation.
    """

    name: ClassVar[str] = "newmark"
    needs_mass: ClassVar[bool] = True
    rings_on_rigid_obstacles: ClassVar[bool] = True

    beta: float = field(default=0.25, metadata=stated(Form.NUMBER, least=0.0, most=0.5))
    gamma: float = field(default=0.5, metadata=stated(Form.NUMBER, least=0.5, most=1.0))

    def __post_init__(self) -> None:
        beta, gamma = number(self.beta, "beta of Newmark"), number(self.gamma, "gamma of Newmark")
        if not (0.5 <= gamma < math.inf and gamma / 2.0 <= beta < math.inf):
            raise ProblemError(
                f"Newmark(beta={beta:g}, gamma={gamma:g}) is not stable; take gamma >= 1/2 and beta >= gamma/2"
            )

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        velocity, acceleration = _newmark(self.beta, self.gamma, step)
        return (StageRule(1.0, velocity, acceleration, 1.0, velocity, acceleration),)


@dataclass(frozen=True)
class GeneralizedAlpha(Scheme):
    """The generalised-alpha scheme of Chung and Hulbert (10.1115/1.2900803), contact laws at its own place in the step.

    Parameters
    ----------
    rho : float
        Spectral radius at infinite frequency, in [0, 1]: 1 keeps the energy of a linear body, 0 removes in one step
        what the step cannot resolve.
    """

    name: ClassVar[str] = "generalized-alpha"
    needs_mass: ClassVar[bool] = True
    rings_on_rigid_obstacles: ClassVar[bool] = True

    rho: float = field(default=0.8, metadata=stated(Form.NUMBER, least=0.0, most=1.0))

    def __post_init__(self) -> None:
        if not 0.0 <= number(self.rho, "rho of GeneralizedAlpha") <= 1.0:
            raise ProblemError(f"GeneralizedAlpha(rho={self.rho:g}): rho must lie in [0, 1]")

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        rho = self.rho
        am, af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        gamma = 0.5 - am + af
        v, w = _newmark(0.25 * (1.0 - am + af) ** 2, gamma, step)
        # u_{n+1} - u_n = (u* - u_n)/(1 - af), so that the difference keeps its factor in v*.
        rate = RateFormula(v.difference, (1.0 - af) * v.velocity + af, (1.0 - af) * v.acceleration)
        whole = (1.0 - am) / (1.0 - af)
        acceleration = RateFormula(whole * w.difference, (1.0 - am) * w.velocity, (1.0 - am) * w.acceleration + am)
        return (StageRule(1.0 - af, rate, acceleration, 1.0 / (1.0 - af), v, w),)


@dataclass(frozen=True)
class SDIRK2(Scheme):
    """The L-stable diagonally implicit Runge-Kutta method of order 2 with one matrix for both stages; without mass."""

    name: ClassVar[str] = "sdirk2"
    takes_mass: ClassVar[bool] = False

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        gamma = 1.0 - 1.0 / math.sqrt(2.0)
        nothing = RateFormula(0.0)
        first = RateFormula(1.0 / (gamma * step))
        # The velocity that the second stage finds is that of the first.
        second = RateFormula(1.0 / (gamma * step), -(1.0 - gamma) / gamma)
        span = (1.0 - gamma) * step  # from one stage to the other
        slope = RateFormula(second.difference / span, (second.velocity - 1.0) / span)
        return (
            StageRule(gamma, first, nothing, 1.0 / gamma, first, nothing, 1.0 - gamma),
            StageRule(1.0, second, nothing, 1.0, second, slope, gamma),
        )


@dataclass(frozen=True)
class BDF2(Scheme):
    """The backward differentiation formula of order 2, for steps of any length; it damps what a step cannot resolve.

    With ``w = step/last`` the rate at the end of a step is ``((1 + 2 w) (u_{n+1} - u_n) / step - w (u_n - u_{n-1}) /
    last) / (1 + w)``, and so is the acceleration of velocities.  The first step, the first one after a stop or a kink
    of what acts, and one that is more than ``1 + sqrt(2)`` times as long as the last, beyond which the formula is not
    stable, are steps of implicit Euler: a single one keeps the order.
    """

    name: ClassVar[str] = "bdf2"
    multistep: ClassVar[bool] = True

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        if last is None or step > (1.0 + math.sqrt(2.0)) * last:
            return ImplicitEuler().rules(step)
        ratio = step / last
        a, kept = (1.0 + 2.0 * ratio) / ((1.0 + ratio) * step), -ratio / (1.0 + ratio)
        rate = RateFormula(a, mean_velocity=kept)
        acceleration = RateFormula(a**2, -a, mean_velocity=a * kept, mean_acceleration=kept)
        return (StageRule(1.0, rate, acceleration, 1.0, rate, acceleration),)


@dataclass(frozen=True)
class MoreauJean(Scheme):
    """The scheme of Moreau and Jean: impacts with restitution on rigid obstacles (Acary, arXiv:1410.2499).

    With ``v* = theta v_{n+1} + (1 - theta) v_n`` and ``u* = u_n + theta step v*`` the balance holds at the stage, and
    where the predicted gap ``r_n + step v_n / 2`` is closed, Newton's law of impact at the end,
    ``v_{n+1} <= -restitution v_n`` along the normal.

    Parameters
    ----------
    restitution : float
        In [0, 1]: part of its velocity with which a contact node leaves the obstacle that it hits.
    theta : float
        At least 1/2, which keeps the energy of a linear body; at most 1/(1 + restitution), for impacts to give none. A
        point that leaves the obstacle while it overlaps, and is pressed back, may give some unless it is just this.
    """

    name: ClassVar[str] = "moreau-jean"
    order: ClassVar[int] = 1
    needs_mass: ClassVar[bool] = True
    is_impact_law: ClassVar[bool] = True

    restitution: float = field(default=0.0, metadata=stated(Form.NUMBER, least=0.0, most=1.0))
    theta: float = field(default=0.5, metadata=stated(Form.NUMBER, least=0.5, most=1.0))

    def __post_init__(self) -> None:
        restitution, theta = number(self.restitution, "restitution"), number(self.theta, "theta of MoreauJean")
        if not 0.0 <= restitution <= 1.0:
            raise ProblemError(f"MoreauJean(restitution={restitution:g}): it must lie in [0, 1]")
        if not 0.5 <= theta <= 1.0 / (1.0 + restitution) + 1e-12:
            raise ProblemError(
                f"MoreauJean(restitution={restitution:g}, theta={theta:g}) may gain energy in impacts; take "
                f"1/2 <= theta <= 1/(1 + restitution) = {1.0 / (1.0 + restitution):.3g}"
            )

    def rules(self, step: float, last: float | None = None) -> tuple[StageRule, ...]:
        span = self.theta * step
        return (
            StageRule(
                self.theta,
                RateFormula(1.0 / span),
                RateFormula(1.0 / span**2, -1.0 / span),
                1.0 / self.theta,
                RateFormula(1.0 / span, 1.0 - 1.0 / self.theta),
                RateFormula(1.0 / (span * step), -1.0 / span),
                restitution=self.restitution,
            ),
        )


def _newmark(beta: float, gamma: float, step: float) -> tuple[RateFormula, RateFormula]:
    """Velocity and acceleration at the end of a step."""
    return (
        RateFormula(gamma / (beta * step), 1.0 - gamma / beta, step * (1.0 - gamma / (2.0 * beta))),
        RateFormula(1.0 / (beta * step**2), -1.0 / (beta * step), 1.0 - 1.0 / (2.0 * beta)),
    )


#: Schemes with their standard options, by name.
SCHEMES: dict[str, Scheme] = {
    scheme.name: scheme
    for scheme in (ImplicitEuler(), Midpoint(), Newmark(), GeneralizedAlpha(), SDIRK2(), BDF2(), MoreauJean())
}
