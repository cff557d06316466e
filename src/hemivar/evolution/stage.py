"""A stage of a step: the static problem it is, and what its solution makes of the moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import blas

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution.discrete import Acting, Bodies, DiscreteEvolution
from hemivar.evolution.moment import Moment, Motion, Stretching
from hemivar.evolution.products import Products
from hemivar.evolution.schemes import Linear, Rule
from hemivar.evolution.step_laws import StepLaw
from hemivar.solvers import Solution
from hemivar.solvers.nearby import OutOfBalance

__all__ = [
    "Force",
    "Ground",
    "Stage",
    "allowed",
    "apply",
    "decay",
    "expected_multiplier",
    "gain",
    "ground_of",
    "left_over",
    "posed_stage",
    "reached_forces",
    "stretching",
]

#: Rounding of factors of a scheme.
_ROUNDED = 1e-14
#: Part of forces that cancel which counts as nothing.
_NOTHING = 16.0 * float(np.finfo(float).eps)
#: How much longer than the last one a step may be whose prediction takes over what the last one did to forces: their
#: rounding grows with it.
_LONGER = 2.0


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
    still : bool
        Whether gaps do not change in the step.
    held : bool
        Whether no support moves, on any process.
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
    still: bool = False
    held: bool = False

    def displacement(self, found: Array) -> Array:
        """``x*`` (n + k,) of unknowns (n,)."""
        if found.size == self.place.size:
            return self.place + found
        place = self.place.copy()
        place[: found.size] += found
        return place

    def local(self, solution: Solution) -> Array:
        """Penetration and slip relative to the foundation (m, c); the slip is the whole one."""
        return solution.local + self.origin

    def motion(self, place: Array, motion: Motion) -> Motion:
        """Place, velocity and acceleration at the stage of something that was in ``motion`` before."""
        return self.moved(place, place - motion.place, motion)

    def moved(self, place: Array, difference: Array, motion: Motion) -> Motion:
        """The same, where the difference is known."""
        velocity, ratio = apply(self.rule.rate, difference, motion), self.rule.backward
        if ratio is None:
            return Motion(place, velocity, apply(self.rule.acceleration, difference, motion))
        acceleration = velocity - motion.velocity
        acceleration *= ratio
        return Motion(place, velocity, acceleration)


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


@dataclass(frozen=True, eq=False)
class Force:
    """A force of the body: a multiple of a vector, which others may share.

    Attributes
    ----------
    vector : array (n + k,)
    factor : float
    """

    vector: Array
    factor: float = 1.0

    def on(self, way: Array) -> float:
        """Its work on a way (n + k,)."""
        return self.factor * float(self.vector @ way)


@dataclass(frozen=True, eq=False)
class Ground:
    """What a stage takes from the rule and the length of its step alone, whatever the moment.

    Attributes
    ----------
    rule : Rule
    step : float
    base : DiscreteProblem
        The body, without load.
    inertia : float
        What the mass is multiplied with in its stiffness.
    decays, gains : tuple of float
        As in :class:`Stage`.
    coast : Linear
        Where the body would be without acceleration, from where it is; the velocity there is ``speed``.
    speed : Linear
    """

    rule: Rule
    step: float
    base: DiscreteProblem
    inertia: float
    decays: tuple[float, ...]
    gains: tuple[float, ...]
    coast: Linear
    speed: Linear


def ground_of(discrete: DiscreteEvolution, bodies: Bodies, rule: Rule, step: float) -> Ground:
    """What the stages of all steps of one length share."""
    factors = body_factors(discrete, rule, step)
    _, inert, *gains = factors
    decays = tuple(decay(time, rule.at * step) for time, _ in discrete.branches)
    coast, a = Linear(0.0), rule.rate
    if discrete.mass is not None:
        coast = Linear(0.0, -rule.acceleration.velocity / inert, -rule.acceleration.acceleration / inert)
    velocity = a.difference * coast.velocity + a.velocity
    kept = 1.0 if abs(velocity - 1.0) <= _ROUNDED else velocity
    speed = Linear(0.0, kept, a.difference * coast.acceleration + a.acceleration)
    return Ground(rule, step, bodies.body(*factors), inert, decays, tuple(gains), coast, speed)


def posed_stage(
    discrete: DiscreteEvolution,
    bodies: Bodies,
    before: Moment,
    ground: Ground,
    at: Acting,
    end: Acting,
    start: Acting,
    step_law: StepLaw,
    products: Products,
) -> Stage:
    """The static problem of a stage.

    Parameters
    ----------
    discrete : DiscreteEvolution
    bodies : Bodies
    before : Moment
    ground : Ground
        Of its rule and the length of its step.
    at, end, start : Acting
        What acts at the time of the stage, at the end of the step and at its beginning.
    step_law : StepLaw
        The law of the step.
    products : Products
    """
    n, body, rule = discrete.unknowns, before.body, ground.rule
    place = body.place
    if ground.coast.velocity or ground.coast.acceleration:
        moved = _combined(ground.coast, body)
        moved += place
        place = moved
    elif place.size > n:
        place = place.copy()
    # Prescribed displacements and offsets go straight from where they are to where they will be.
    offset = start.offset
    if place.size > n:
        held_at = before.body.place[n:]
        place[n:] = held_at + (end.prescribed - held_at) / rule.reach
    if end.offset is not offset:
        offset = offset + (end.offset - offset) / rule.reach
    held = not discrete.vectors.largest(float(place.size - n))[0]  # what supports move may be pushed
    if held:
        force = _left_of(at.load, discrete, before, ground, place, products)
        if discrete.branches:
            force -= _relaxing(discrete, before, place - body.place, ground.decays, ground.gains)
    else:
        force = at.load - sum(forces(discrete, rule, before, place, ground.decays, ground.gains).values())
    a = rule.rate
    origin = before.local.place.copy()
    if a.velocity or a.acceleration:
        origin -= apply(replace(a, difference=0.0), np.zeros_like(origin), before.local) / a.difference
    origin[:, 0] = 0.0
    if rule.restitution is not None:
        origin[:, 0] = allowed(before.local, rule, ground.step)
    contact = ground.base.contact
    from_place = offset + origin
    if contact.count:
        from_place -= contact.traced(place[:n])
    force = force[:n] if force.size > n else force
    alone = discrete.vectors.alone and not before.multiplier.any()
    if alone and _only_rounding(discrete, force, at.load[:n], place[:n], body.velocity[:n]):
        force = np.zeros(n)  # nothing is left that a residual could be held against
    problem = bodies.posed(ground.base, force, from_place, step_law.law)
    return Stage(
        problem, rule, ground.step, before, place, offset, origin, step_law, at.load, ground.decays, ground.gains,
        still=end.offset is start.offset, held=held,
    )  # fmt: skip


def _only_rounding(discrete: DiscreteEvolution, force: Array, load: Array, place: Array, velocity: Array) -> bool:
    """Whether forces (n,) are no more than the rounding of what was added up in them."""
    size = norm(load) + norm(discrete.stiffness.row_sums * place)
    if discrete.viscosity is not None:
        size += norm(discrete.viscosity.row_sums * velocity)
    return norm(force) <= _NOTHING * size


def _left_of(
    load: Array, discrete: DiscreteEvolution, before: Moment, ground: Ground, place: Array, products: Products
) -> Array:
    """What elastic and viscous forces of a prediction leave of a load, without products where the last step tells
    ``K v``."""
    known, coast, speed = before.stretching, ground.coast, ground.speed
    viscous = discrete.viscosity is not None and bool(speed.velocity or speed.acceleration)
    goes_on = speed.velocity == 1.0 and not speed.acceleration
    if known is None or coast.acceleration or not 0.0 < coast.velocity <= _LONGER * known.step:
        force = load - products.stiffness(place)
    else:
        time = coast.velocity
        if viscous and goes_on and discrete.damping_time is not None:
            time, viscous = time + discrete.damping_time, False
        force = blas.daxpy(known.force, load - products.stiffness(before.body.place), a=-time / known.step)
    if viscous:
        force -= products.viscosity(before.body.velocity if goes_on else _combined(speed, before.body))
    return force


def expected_multiplier(before: Moment, span: float) -> Array:
    """The multiplier (m, c) a while after a moment, if it goes on to change as it did."""
    known = before.stretching
    if known is None or span > _LONGER * known.step:
        return before.multiplier
    return before.multiplier + (span / known.step) * known.multiplier


def stretching(stage: Stage, reached: Motion, multiplier: Array, products: Products) -> Stretching | None:
    """How forces have changed in a step that a stage ends, if the velocity is the mean one of the step."""
    rate = stage.rule.rate
    if rate.velocity or rate.acceleration or not stage.held or abs(rate.difference * stage.step - 1.0) > _ROUNDED:
        return None
    pulled = products.pull(reached.place, stage.before.body.place)
    return Stretching(stage.step, pulled, multiplier - stage.before.multiplier)


def left_over(
    discrete: DiscreteEvolution,
    stage: Stage,
    reached: Motion,
    acts: Mapping[str, Force],
    products: Products,
    enough: float,
) -> OutOfBalance:
    """What the forces of a displacement that was reached leave of the load, at a stage at which no support moves.

    Parameters
    ----------
    discrete : DiscreteEvolution
    stage : Stage
    reached : Motion
    acts : mapping of name to Force
        Its :func:`reached_forces`.
    products : Products
    enough : float
        Up to which the size may be estimated from above.
    """
    rest = stage.load - acts["internal"].vector
    for name, force in acts.items():
        if name != "internal":
            rest = blas.daxpy(force.vector, rest, a=-force.factor)
    size = products.norm(stage.load)
    return OutOfBalance(rest, size + products.size(sizes_of(discrete, stage, reached), enough))


def sizes_of(discrete: DiscreteEvolution, stage: Stage, reached: Motion) -> list[tuple[float, Array, Array]]:
    """What forces of a displacement that was reached are added up from: factors, sums of rows and vectors (n + k,).

    Displacements are known up to their rounding, and so are differences of them that a scheme divides by its step.
    """
    before, rule, n = stage.before.body, stage.rule, discrete.unknowns

    def inner(x: Array) -> Array:
        return x if x.size == n else x[:n]

    sums = stage.problem.linear.row_sums
    parts = [(1.0, sums, inner(reached.place)), (1.0, sums, inner(before.place))]
    if discrete.mass is not None:
        push = discrete.mass.row_sums
        parts.append((abs(rule.acceleration.velocity), push, inner(before.velocity)))
        if rule.acceleration.acceleration:
            parts.append((abs(rule.acceleration.acceleration), push, inner(before.acceleration)))
    if discrete.viscosity is not None and rule.rate.velocity:
        parts.append((abs(rule.rate.velocity), discrete.viscosity.row_sums, inner(before.velocity)))
    branches = zip(stage.before.branches, discrete.branches, strict=True)
    return parts + [(1.0, part.row_sums, inner(h)) for h, (_, part) in branches]


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
    if discrete.branches:
        found["relaxing"] = _relaxing(discrete, before, difference, decays, gains)
    return found


def reached_forces(discrete: DiscreteEvolution, stage: Stage, reached: Motion, products: Products) -> dict[str, Force]:
    """:func:`forces` of the displacement x* (n + k,) that was reached, with its velocity and acceleration."""
    before, rule = stage.before.body, stage.rule
    found = {"internal": Force(products.stiffness(reached.place))}
    time, ratio = discrete.damping_time, rule.backward
    if time is not None and stage.held and not (rule.rate.velocity or rule.rate.acceleration):
        found["viscous"] = Force(products.pull(reached.place, before.place), time * rule.rate.difference)
    elif discrete.viscosity is not None:
        found["viscous"] = Force(products.viscosity(reached.velocity))
    if discrete.mass is not None and ratio is not None:  # products that the kinetic energy needs as well
        found["inertial"] = Force(products.mass(reached.velocity) - products.mass(before.velocity), ratio)
    elif discrete.mass is not None:
        found["inertial"] = Force(products.mass(reached.acceleration))
    if discrete.branches:
        way = reached.place - before.place
        found["relaxing"] = Force(_relaxing(discrete, stage.before, way, stage.decays, stage.gains))
    return found


def _relaxing(
    discrete: DiscreteEvolution, before: Moment, difference: Array, decays: tuple[float, ...], gains: tuple[float, ...]
) -> Array:
    """Force of the branches (n + k,) at a stage."""
    parts = zip(decays, gains, before.branches, discrete.branches, strict=True)
    return np.asarray(sum(branch.times(e * h + g * difference) for e, g, h, (_, branch) in parts))


def _combined(rule: Linear, motion: Motion) -> Array:
    """A multiple of the velocity and one of the acceleration."""
    out = rule.velocity * motion.velocity
    if rule.acceleration:
        out += rule.acceleration * motion.acceleration
    return out
