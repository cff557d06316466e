"""The schemes of the library: one-step and multistep methods of the literature, and an impact law."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import ClassVar

from hemivar.basics.arguments import expect, number
from hemivar.basics.stated import Form, stated
from hemivar.errors import ProblemError
from hemivar.evolution.schemes.scheme import RateFormula, Scheme, StageRule
from hemivar.laws.named import LawKind, named

__all__ = ["BDF2", "SDIRK2", "GeneralizedAlpha", "ImplicitEuler", "Midpoint", "MoreauJean", "Newmark"]


@named(
    LawKind.SCHEME,
    "implicit-euler",
    "everything; friction with sticking",
    "order 1: v* = (u* - u_n)/tau at the end of the step; damps vibrations",
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


@named(
    LawKind.SCHEME,
    "midpoint",
    "vibrations",
    "order 2: the balance in the middle of the step; keeps the energy of linear bodies",
)
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

    conserving: bool = field(default=False, metadata=stated(Form.FLAG, example=True))

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


@named(
    LawKind.SCHEME,
    "newmark",
    "mass on compliant foundations",
    "order 2: u* = u_n + tau v + tau^2 ((1/2 - beta) w + beta w*), v* = v + tau ((1 - gamma) w + gamma w*)",
)
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


@named(
    LawKind.SCHEME,
    "generalized-alpha",
    "mass on compliant foundations",
    "order 2: the balance between the ends of the step; damps only the unresolved high frequencies",
)
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


@named(
    LawKind.SCHEME,
    "sdirk2",
    "bodies without mass",
    "order 2: two stages of one matrix, at (1 - 1/sqrt(2)) tau and at the end; L-stable",
)
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


@named(
    LawKind.SCHEME,
    "bdf2",
    "smooth motion with or without mass",
    "order 2: the rate at the end from the last two steps",
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


@named(
    LawKind.SCHEME,
    "moreau-jean",
    "rigid obstacles",
    "order 1: an impact law, v_{n+1} <= -restitution v_n along the normal; impacts gain no energy",
)
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

    restitution: float = field(default=0.0, metadata=stated(Form.NUMBER, least=0.0, most=1.0, example=0.5))
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
