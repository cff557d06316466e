"""A stage of a step: the static problem it is, and what its solution makes of the moment."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution.discrete import Acting, Bodies, DiscreteEvolution
from hemivar.evolution.moment import Moment, Motion
from hemivar.evolution.schemes import Linear, Rule
from hemivar.evolution.step_laws import StepLaw
from hemivar.solvers import Solution

__all__ = ["Stage", "allowed", "apply", "decay", "gain", "posed_stage"]


@dataclass(frozen=True, eq=False)
class Stage:
    """One stage, posed: its unknowns are the distance of the displacement from ``place``, a prediction.

    Attributes
    ----------
    problem : DiscreteProblem
    rule : Rule
    step : float
        Length of the whole step.
    before : Moment
        The moment that the stage starts from; its velocity is that of the stage before, if there is one.
    place : array (n + k,)
        Prediction of the displacement, with the prescribed displacements as they are.
    offset : array (m, c)
        Of the contact points at the stage.
    origin : array (m, c)
        What the law of the stage counts from: slip from which the increment that friction sees is counted, and the
        penetration that an impact allows.
    law : StepLaw
    load : array (n + k,)
        Forces at the stage.
    decays : tuple of float
        What is left at the stage of what each branch remembered.
    gains : tuple of float
        What each branch takes up of the difference ``u* - u_n``.
    """

    problem: DiscreteProblem
    rule: Rule
    step: float
    before: Moment
    place: Array
    offset: Array
    origin: Array
    law: StepLaw
    load: Array
    decays: tuple[float, ...]
    gains: tuple[float, ...]

    def displacement(self, solution: Solution) -> Array:
        """``x*`` (n + k,)."""
        place = self.place.copy()
        place[: solution.unknowns.size] += solution.unknowns
        return place

    def local(self, solution: Solution) -> Array:
        """Penetration and slip relative to the foundation (m, c); the slip is the whole one."""
        return self.problem.contact.local(solution.unknowns) + self.origin

    def rate(self, difference: Array, motion: Motion) -> Array:
        """v* of a difference ``x* - x_n``."""
        return apply(self.rule.rate, difference, motion)


def apply(rule: Linear, difference: Array, motion: Motion) -> Array:
    """A rate or an acceleration of a difference."""
    out = rule.difference * difference
    if rule.velocity:
        out += rule.velocity * motion.velocity
    if rule.acceleration:
        out += rule.acceleration * motion.acceleration
    return out


def decay(time: float, span: float) -> float:
    """Part of what a branch remembered that is left after a span of time."""
    return float(np.exp(-span / time))


def gain(time: float, span: float, rate: float) -> float:
    """What a branch takes up over a span in which the displacement changes at ``rate`` times a difference."""
    return float(-np.expm1(-span / time)) * time * rate


def body_factors(discrete: DiscreteEvolution, rule: Rule, step: float) -> tuple[float, ...]:
    """What viscosity, mass and every branch are multiplied with in the stiffness of a stage."""
    gains = (gain(time, rule.at * step, rule.reach / step) for time, _ in discrete.branches)
    return rule.rate.difference, rule.acceleration.difference, *gains


def posed_stage(
    discrete: DiscreteEvolution,
    bodies: Bodies,
    before: Moment,
    rule: Rule,
    step: float,
    at: Acting,
    end: Acting,
    start: Acting,
    step_law: StepLaw,
) -> Stage:
    """The static problem of a stage.

    Parameters
    ----------
    discrete : DiscreteEvolution
    bodies : Bodies
    before : Moment
    rule : Rule
    step : float
    at, end, start : Acting
        What acts at the time of the stage, at the end of the step and at its beginning.
    step_law : StepLaw
        The law of the step.
    """
    n, body = discrete.unknowns, before.body
    span = rule.at * step
    decays = tuple(decay(time, span) for time, _ in discrete.branches)
    factors = body_factors(discrete, rule, step)
    _, inert, *gains = factors
    base = bodies.body(*factors)
    place = body.place.copy()
    if discrete.mass is not None:  # where the body would be without acceleration
        coast = apply(replace(rule.acceleration, difference=0.0), np.zeros_like(place), body)
        place -= coast / inert
    # Prescribed displacements and offsets go straight from where they are to where they will be.
    moved = before.body.place[n:]
    place[n:] = moved + (end.prescribed - moved) / rule.reach
    offset = start.offset + (end.offset - start.offset) / rule.reach
    held = not discrete.vectors.largest(float(place.size - n))[0]  # what supports move may be pushed
    coasting = discrete.mass is not None and held
    force = at.load - sum(forces(discrete, rule, before, place, decays, tuple(gains), coasting).values())
    a = rule.rate.difference
    drift = apply(replace(rule.rate, difference=0.0), np.zeros_like(before.local.place), before.local)
    origin = before.local.place - drift / a
    origin[:, 0] = 0.0
    if rule.restitution is not None:
        origin[:, 0] = allowed(before.local, rule, step)
    contact = base.contact
    from_place = offset + origin
    if contact.count:
        from_place -= np.asarray(contact.trace @ place[:n]).reshape(offset.shape)
    problem = bodies.posed(base, force[:n], from_place, step_law.law)
    return Stage(problem, rule, step, before, place, offset, origin, step_law, at.load, decays, tuple(gains))


def allowed(local: Motion, rule: Rule, step: float) -> Array:
    """Penetration (m,) at the stage with which the velocity at the end is the one that the law of impact allows."""
    assert rule.restitution is not None
    theta = rule.at
    return np.asarray(
        local.place[:, 0] + theta * step * (1.0 - theta * (1.0 + rule.restitution)) * local.velocity[:, 0]
    )


def forces(
    discrete: DiscreteEvolution,
    rule: Rule,
    before: Moment,
    place: Array,
    decays: tuple[float, ...],
    gains: tuple[float, ...],
    coasting: bool = False,
) -> dict[str, Array]:
    """Forces (n + k,) of a displacement at a stage: ``internal``, ``viscous``, ``inertial`` and ``relaxing`` ones.

    ``coasting`` if the body is where it would be without acceleration: then none are inertial.
    """
    difference = place - before.body.place
    found = {"internal": discrete.stiffness.times(place)}
    if discrete.viscosity is not None:
        found["viscous"] = discrete.viscosity.times(apply(rule.rate, difference, before.body))
    if discrete.mass is not None and not coasting:
        found["inertial"] = discrete.mass.times(apply(rule.acceleration, difference, before.body))
    for e, g, h, (_, branch) in zip(decays, gains, before.branches, discrete.branches, strict=True):
        pull = branch.times(e * h + g * difference)
        found["relaxing"] = found["relaxing"] + pull if "relaxing" in found else pull
    return found
