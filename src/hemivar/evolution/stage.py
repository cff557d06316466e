"""A stage of a step: its static problem over a predictor, and the residual and state of a solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import blas

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array
from hemivar.discrete.operator_family import Composition
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData, StepMatrices
from hemivar.evolution.schemes import StageRule
from hemivar.evolution.state import Kinematics, Rates, TimeState
from hemivar.evolution.step_laws import StepLaw
from hemivar.evolution.step_operator import StepOperator
from hemivar.fem.lift import linear_response
from hemivar.laws.vector_law import softens
from hemivar.solvers import Solution
from hemivar.solvers.newton_on_graph import ForceResidual

__all__ = [
    "Force",
    "Stage",
    "StageState",
    "allowed",
    "discrete_stage",
    "extrapolated_multiplier",
    "momentum",
    "out_of_balance_force",
    "rounding_size",
    "stage_state",
    "stiffness_force",
]

#: Part of forces that cancel which counts as nothing.
_NOTHING = 16.0 * float(np.finfo(float).eps)
#: How much longer than the last one a step may be whose prediction takes over what the last one did to forces: their
#: rounding grows with it.
_LONGER = 2.0


@dataclass(frozen=True, eq=False)
class Stage:
    """One stage, posed: its unknowns are the distance of the displacement from ``prediction``."""

    operator: StepOperator
    problem: DiscreteProblem
    #: The state that the stage starts from; its velocity is that of the stage before, if there is one.
    before: TimeState
    #: Prediction of the displacement, with the prescribed displacements as they are.
    prediction: Array  # (n + k,)
    #: Of the contact points at the stage.
    offset: Array  # (m, c)
    #: What the law of the stage counts from: slip from which the increment that friction sees is counted, and the
    #: penetration that an impact allows.
    origin: Array  # (m, c)
    law: StepLaw
    #: Forces at the stage.
    load: Array  # (n + k,)
    #: Whether gaps do not change in the step.
    still: bool = False
    #: Whether no support moves, on any process.
    fixed_supports: bool = False

    @property
    def rule(self) -> StageRule:
        """What the scheme says of it."""
        return self.operator.rule

    @property
    def start(self) -> Array:
        """Local displacements (m, c) from which the way of the body leads: those it had, under gaps that move."""
        if self.operator.predictor.of_difference:
            return self.before.local.displacement - self.origin
        return -self.problem.offset

    @property
    def step(self) -> float:
        """Length of the whole step."""
        return self.operator.step

    def displacement(self, unknowns: Array) -> Array:
        """``x*`` (n + k,) of unknowns (n,)."""
        if unknowns.size == self.prediction.size:
            return self.prediction + unknowns
        displacement = self.prediction.copy()
        displacement[: unknowns.size] += unknowns
        return displacement

    def local(self, solution: Solution) -> Array:
        """Penetration and slip relative to the foundation (m, c); the slip is the whole one."""
        return solution.local + self.origin

    def local_motion(self, local: Array) -> Kinematics:
        """Penetration and slip at the stage with their rates."""
        before = self.before
        return Kinematics(local, *self._rates(local - before.local.displacement, before.local, before.rates[1]))

    def body_rates(self, increment: Array) -> tuple[Array, Array]:
        """Velocity and acceleration (n + k,) at the stage where the displacement changed by ``increment``."""
        return self._rates(increment, self.before.body, self.before.rates[0])

    def _rates(self, increment: Array, motion: Kinematics, last: Rates | None) -> tuple[Array, Array]:
        rule = self.operator.rule
        velocity, ratio = rule.rate.of(increment, motion, last), rule.backward
        if ratio is None:
            return velocity, rule.acceleration.of(increment, motion, last)
        acceleration = velocity - motion.velocity
        acceleration *= ratio
        return velocity, acceleration


@dataclass(frozen=True, eq=False)
class Force:
    """A force of the body: a multiple of a vector, which others may share."""

    vector: Array  # (n + k,)
    factor: float = 1.0


@dataclass(frozen=True, eq=False)
class StageState:
    """Where unknowns (n,) of a stage lead."""

    unknowns: Array  # (n,)
    #: ``u* - u_n``.
    increment: Array  # (n + k,)
    #: ``u*``, ``v*`` and ``w*``, with the products that its forces took.
    body: Kinematics
    #: ``internal``, ``viscous``, ``inertial`` and ``relaxing`` ones.
    forces: dict[str, Force]


def stiffness_force(discrete: DiscreteEvolution, body: Kinematics) -> Array:
    """The elastic forces ``K u`` (n + k,)."""
    known = body.stiffness_force
    return discrete.elastic_force(body.displacement) if known is None else known


def viscous_force(discrete: DiscreteEvolution, body: Kinematics) -> Array:
    """``C v`` (n + k,); there is a viscosity."""
    assert discrete.viscosity is not None
    return discrete.viscosity.times(body.velocity) if body.viscous_force is None else body.viscous_force


def momentum(discrete: DiscreteEvolution, body: Kinematics) -> Array:
    """``M v`` (n + k,); there is a mass."""
    assert discrete.mass is not None
    return discrete.mass.times(body.velocity) if body.momentum is None else body.momentum


def discrete_stage(
    discrete: DiscreteEvolution,
    bodies: StepMatrices,
    before: TimeState,
    operator: StepOperator,
    at: ExternalData,
    end: ExternalData,
    start: ExternalData,
    step_law: StepLaw,
) -> Stage:
    """The static problem of a stage."""
    n, body, rule, predictor = discrete.unknowns, before.body, operator.rule, operator.predictor
    rates = before.rates
    prediction = body.displacement
    if not predictor.of_difference:
        moved = predictor.carried(body, rates[0])
        moved += prediction
        prediction = moved
    elif prediction.size > n:
        prediction = prediction.copy()
    # Prescribed displacements and offsets go straight from where they are to where they will be.
    offset = start.offset
    if prediction.size > n:
        held_at = body.displacement[n:]
        change = (end.prescribed - held_at) / rule.reach
        prediction[n:] = held_at + change
        if not (discrete.linear or softens(step_law.law)) and change.any():
            prediction[:n] += _following(discrete, operator, change)
    if end.offset is not offset:
        offset = offset + (end.offset - offset) / rule.reach
    fixed_supports = not discrete.vectors.largest(float(prediction.size - n))[0]  # what supports move may be pushed
    if fixed_supports:
        force = _left_of(at.load, discrete, before, operator, prediction)
        if discrete.branches:
            force -= _relaxing(discrete, before, prediction - body.displacement, operator)
    else:
        force = at.load - sum(_forces(discrete, operator, before, prediction).values())
    origin = before.local.displacement.copy()
    if not rule.rate.of_difference:
        origin -= rule.rate.carried(before.local, rates[1]) / rule.rate.difference
    origin[:, 0] = 0.0
    origin[discrete.follows_slip] = 0.0
    if rule.restitution is not None:
        origin[:, 0] = allowed(before.local, rule, operator.step)
    contact = operator.base.contact
    from_place = offset + origin
    if contact.count:
        from_place -= contact.trace_of(prediction[:n])
    force = force[:n] if force.size > n else force
    alone = discrete.vectors.alone and not before.multiplier.any()
    if alone and _only_rounding(discrete, force, at.load[:n], prediction[:n], body.velocity[:n]):
        force = np.zeros(n)  # nothing is left that a residual could be held against
    problem = bodies.stage_problem(operator.base, force, from_place, step_law.law, prediction)
    still = end.offset is start.offset
    return Stage(operator, problem, before, prediction, offset, origin, step_law, at.load, still, fixed_supports)


def _following(discrete: DiscreteEvolution, operator: StepOperator, change: Array) -> Array:
    """How the unknowns (n,) of a linear body follow supports (k,) in a step.

    Supports that move alone strain the cells beside them, the more the finer the mesh is.  Where a law softens they do
    move alone: which of several solutions a step takes depends on where the body was.
    """
    parts = operator.base.model.parts
    assert isinstance(parts, Composition)
    return linear_response(discrete.field, parts.matrix(), -parts.pulled(change))


def _only_rounding(discrete: DiscreteEvolution, force: Array, load: Array, u: Array, velocity: Array) -> bool:
    """Whether forces (n,) are no more than the rounding of what was added up in them."""
    size = norm(load) + norm(discrete.stiffness.row_sums * u)
    if discrete.viscosity is not None:
        size += norm(discrete.viscosity.row_sums * velocity)
    return norm(force) <= _NOTHING * size


def _left_of(
    load: Array, discrete: DiscreteEvolution, before: TimeState, operator: StepOperator, prediction: Array
) -> Array:
    """What elastic and viscous forces of a prediction leave of a load, without products where the last step tells
    ``K v``."""
    last, body, predictor, rate = before.history, before.body, operator.predictor, operator.predictor_rate
    viscous = discrete.viscosity is not None and not rate.of_difference
    goes_on = rate.velocity == 1.0 and rate.of_velocity
    stretched = None if last is None or not predictor.of_velocity else last.force
    if last is None or stretched is None or not 0.0 < predictor.velocity <= _LONGER * last.step:
        stays = prediction is body.displacement
        force = load - (stiffness_force(discrete, body) if stays else discrete.elastic_force(prediction))
    else:
        time = predictor.velocity
        if viscous and goes_on and discrete.damping_time is not None:
            time, viscous = time + discrete.damping_time, False
        force = blas.daxpy(stretched, load - stiffness_force(discrete, body), a=-time / last.step)
    if viscous and goes_on:
        force -= viscous_force(discrete, body)
    elif viscous:
        assert discrete.viscosity is not None
        force -= discrete.viscosity.times(rate.carried(body, before.rates[0]))
    return force


def extrapolated_multiplier(before: TimeState, span: float) -> Array:
    """The multiplier (m, c) a while after a state, if it goes on to change as it did."""
    known = before.history
    if known is None or span > _LONGER * known.step:
        return before.multiplier
    return before.multiplier + (span / known.step) * known.multiplier


def out_of_balance_force(
    discrete: DiscreteEvolution, stage: Stage, reached: StageState, enough: float
) -> ForceResidual:
    """What the forces of a displacement that was reached leave of the load, at a stage at which no support moves."""
    rest = stage.load - reached.forces["internal"].vector
    for name, force in reached.forces.items():
        if name != "internal":
            rest = blas.daxpy(force.vector, rest, a=-force.factor)
    return ForceResidual(rest, norm(stage.load) + rounding_size(discrete, stage, reached.body, enough))


def rounding_size(discrete: DiscreteEvolution, stage: Stage, reached: Kinematics, enough: float) -> float:
    """How far rounding may take the forces of a displacement: sum of the norms of what they are added up from.

    Displacements are known up to their rounding, and so are differences of them that a scheme divides by its step.
    More than that, and quicker, if this is not above ``enough``: the largest sums of rows times norms.
    """
    parts = _summed(discrete, stage, reached)
    more = sum(factor * float(sums.max(initial=0.0)) * norm(x) for factor, sums, x in parts)
    return more if more <= enough else sum(factor * norm(sums * x) for factor, sums, x in parts)


def _summed(discrete: DiscreteEvolution, stage: Stage, reached: Kinematics) -> Sequence[tuple[float, Array, Array]]:
    """What forces of a displacement are added up from: factors, sums of rows of matrices, and vectors (n,)."""
    before, rule, n = stage.before.body, stage.operator.rule, stage.problem.load.size
    last = stage.before.rates[0]
    sums = stage.problem.bulk.row_sums
    parts = [(1.0, sums, reached.displacement), (1.0, sums, before.displacement)]
    formulas = [(discrete.mass, rule.acceleration), (discrete.viscosity, rule.rate)]
    for operator, formula in formulas:
        if operator is not None:
            if formula.velocity or operator is discrete.mass:
                parts.append((abs(formula.velocity), operator.row_sums, before.velocity))
            if formula.acceleration and operator is discrete.mass:
                parts.append((abs(formula.acceleration), operator.row_sums, before.acceleration))
            if last is not None:
                parts.append((abs(formula.mean_velocity), operator.row_sums, last.velocity))
                parts.append((abs(formula.mean_acceleration), operator.row_sums, last.acceleration))
    branches = zip(stage.before.branches, discrete.branches, strict=True)
    parts += [(1.0, part.row_sums, h) for h, (_, part) in branches]
    return [(factor, sums, x if x.size == n else x[:n]) for factor, sums, x in parts]


def allowed(local: Kinematics, rule: StageRule, step: float) -> Array:
    """Penetration (m,) at the stage with which the velocity at the end is the one that the law of impact allows."""
    assert rule.restitution is not None
    theta = rule.at
    return np.asarray(
        local.displacement[:, 0] + theta * step * (1.0 - theta * (1.0 + rule.restitution)) * local.velocity[:, 0]
    )


def _forces(discrete: DiscreteEvolution, operator: StepOperator, before: TimeState, u: Array) -> dict[str, Array]:
    """Forces (n + k,) of a displacement at a stage: ``internal``, ``viscous``, ``inertial`` and ``relaxing`` ones."""
    difference, rule = u - before.body.displacement, operator.rule
    last = before.rates[0]
    forces = {"internal": discrete.elastic_force(u)}
    if discrete.viscosity is not None:
        forces["viscous"] = discrete.viscosity.times(rule.rate.of(difference, before.body, last))
    if discrete.mass is not None:
        forces["inertial"] = discrete.mass.times(rule.acceleration.of(difference, before.body, last))
    if discrete.branches:
        forces["relaxing"] = _relaxing(discrete, before, difference, operator)
    return forces


def stage_state(discrete: DiscreteEvolution, stage: Stage, unknowns: Array) -> StageState:
    """Kinematics and forces of unknowns (n,) of a stage."""
    before, rule = stage.before.body, stage.operator.rule
    displacement = stage.displacement(unknowns)
    increment = displacement - before.displacement
    velocity, acceleration = stage.body_rates(increment)
    internal = discrete.elastic_force(displacement)
    forces, viscous, pushed = {"internal": Force(internal)}, None, None
    time, ratio = discrete.damping_time, rule.backward
    if time is not None and stage.fixed_supports and rule.rate.of_difference:
        forces["viscous"] = Force(internal - stiffness_force(discrete, before), time * rule.rate.difference)
    elif discrete.viscosity is not None:
        viscous = discrete.viscosity.times(velocity)
        forces["viscous"] = Force(viscous)
    if discrete.mass is not None and ratio is not None:  # products that the kinetic energy needs as well
        pushed = discrete.mass.times(velocity)
        forces["inertial"] = Force(pushed - momentum(discrete, before), ratio)
    elif discrete.mass is not None:
        forces["inertial"] = Force(discrete.mass.times(acceleration))
    if discrete.branches:
        forces["relaxing"] = Force(_relaxing(discrete, stage.before, increment, stage.operator))
    body = Kinematics(
        displacement, velocity, acceleration, stiffness_force=internal, viscous_force=viscous, momentum=pushed
    )
    return StageState(unknowns, increment, body, forces)


def _relaxing(discrete: DiscreteEvolution, before: TimeState, difference: Array, operator: StepOperator) -> Array:
    """Force of the branches (n + k,) at a stage."""
    parts = zip(operator.decays, operator.gains, before.branches, discrete.branches, strict=True)
    return np.asarray(sum(branch.times(e * h + g * difference) for e, g, h, (_, branch) in parts))
