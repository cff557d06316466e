"""The end of a step: the state that its stages lead to, and its energy balance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from operator import add

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.relaxation import squares_of_relaxation
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.operators import Operator
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData
from hemivar.evolution.jumps import DissipatedJump
from hemivar.evolution.schemes.scheme import StageRule
from hemivar.evolution.stage import Stage, StageState, momentum, stiffness_force
from hemivar.evolution.state import ContactForce, EnergyBalance, Kinematics, LastStep, Rates, TimeState
from hemivar.evolution.step_laws import BoundaryLaw, StepLaw, places
from hemivar.evolution.step_operator import branch_gain, decay
from hemivar.laws import Superpotential
from hemivar.laws.memory import LocalStep
from hemivar.laws.scalar_graph import is_continuous
from hemivar.linear.vectors import Vectors
from hemivar.solvers import Solution

__all__ = ["SolvedStage", "end_of_step", "energies", "shown_force", "with_products"]


def shown_force(discrete: DiscreteEvolution, end: ExternalData, state: TimeState, stage: float) -> ContactForce:
    """Contact forces that are reported for the end of a step: those at the end where all laws are functions.

    The law of a rigid obstacle, of friction that sticks and of glue that breaks at once has a whole interval of forces
    at a displacement and its rate.  A force at the end is then known to nobody, and neither is one that depends on what
    points remember.
    """
    many = float(bool(len(state.multiplier)) and not _is_function(discrete, end))
    if discrete.vectors.largest(many)[0]:
        return ContactForce(stage, state.multiplier)
    return ContactForce(state.time, _at_end(discrete, end, state))


def _is_function(discrete: DiscreteEvolution, end: ExternalData) -> bool:
    """Whether displacements and their rates tell the force at all contact points."""
    if any(discrete.contacts[name].remembers for name, _ in discrete.blocks):
        return False
    damped = all(is_continuous(part) for _, part in _dampings(discrete, end))
    return damped and end.law.is_function(discrete.problem.contact.components)


def _dampings(discrete: DiscreteEvolution, end: ExternalData) -> Iterator[tuple[IntArray, Superpotential]]:
    """Contact points of each boundary with a law of the normal rate, and the law."""
    for name, index in discrete.blocks:
        if name in end.damping and index.size:
            yield index, end.damping[name].at(places(discrete, index))


def _at_end(discrete: DiscreteEvolution, end: ExternalData, state: TimeState) -> Array:
    """Forces (m, c) of laws that are functions, in a state."""
    r, rate = state.local.displacement.copy(), state.local.velocity
    r[:, 1:] = np.where(discrete.follows_slip[:, None], r[:, 1:], rate[:, 1:])
    force = end.law.nearest_multiplier(r, np.zeros(r.shape))
    for index, damping in _dampings(discrete, end):
        force[index, 0] += damping.derivative(rate[index, 0])
    return force


@dataclass(frozen=True, eq=False)
class SolvedStage:
    """A stage with its solution."""

    stage: Stage
    solution: Solution
    reached: StageState
    #: Penetration and slip at the stage, the slip whole.
    local: Kinematics
    #: The multiplier without the laws of the rate of the penetration.
    own: Array  # (m, c)
    #: Against which it was found, in units of the stiffness.
    resistance: float = 0.0
    #: Jumps on the way, where the path of equilibria was followed.
    jumps: tuple[DissipatedJump, ...] = ()

    @property
    def body(self) -> Kinematics:
        """Displacement, velocity and acceleration at the stage."""
        return self.reached.body


@dataclass(frozen=True)
class _StepWork:
    """Work and losses of a stage or a step: of loads, moved supports, forces of the body, and the foundation."""

    work: float = 0.0
    moved: float = 0.0
    internal: float = 0.0
    viscous: float = 0.0
    inertial: float = 0.0
    relaxing: float = 0.0
    normal: float = 0.0
    friction: float = 0.0
    damping: float = 0.0
    jumps: float = 0.0
    branch_loss: float = 0.0
    memory: float = 0.0

    def __add__(self, other: _StepWork) -> _StepWork:
        return _StepWork(*map(add, vars(self).values(), vars(other).values()))

    def total(self, vectors: Vectors) -> _StepWork:
        """That of all processes."""
        if vectors.alone:
            return self
        return _StepWork(*vectors.total(*vars(self).values()).tolist())


def with_products(discrete: DiscreteEvolution, state: TimeState) -> TimeState:
    """A state whose body knows ``K u``, and ``M v`` where there is a mass."""
    known = _known(discrete, state.body)
    return state if known is state.body else replace(state, body=known)


def _known(discrete: DiscreteEvolution, body: Kinematics) -> Kinematics:
    """Kinematics of the body with these products."""
    if body.stiffness_force is not None and (body.momentum is not None or discrete.mass is None):
        return body
    pushed = None if discrete.mass is None else momentum(discrete, body)
    return replace(body, stiffness_force=stiffness_force(discrete, body), momentum=pushed)


def end_of_step(
    discrete: DiscreteEvolution, before: TimeState, solved: list[SolvedStage], step: float, time: float,
    end: ExternalData, multistep: bool,
) -> TimeState:  # fmt: skip
    """The state at the end of a step, with its balance of energy."""
    last = solved[-1]
    stage, rule, n = last.stage, last.stage.rule, discrete.unknowns
    ends = rule.ends and stage.before is before and stage.fixed_supports  # the stage is the end
    if ends:
        body, local, difference = last.body, last.local, last.reached.increment
    else:
        difference = rule.reach * (last.body.displacement - before.body.displacement)
        displacement = last.body.displacement.copy() if rule.reach == 1.0 else before.body.displacement + difference
        displacement[n:] = end.prescribed
        slid = rule.reach * (last.local.displacement - before.local.displacement)
        rates = before.rates
        body, local = (
            Kinematics(
                there, rule.new_velocity.of(increment, motion, rate), rule.new_acceleration.of(increment, motion, rate)
            )
            for there, increment, motion, rate in (
                (displacement, difference, stage.before.body, rates[0]),
                (before.local.displacement + slid, slid, stage.before.local, rates[1]),
            )
        )  # fmt: skip
    body = _known(discrete, body)
    branches = tuple(
        decay(period, step) * h + branch_gain(period, step, 1.0 / step) * difference
        for h, (period, _) in zip(before.branches, discrete.branches, strict=True)
    )
    memory = dict(before.memory)
    for block in stage.law.blocks:
        if block.name in memory:
            since = discrete.counted(local.displacement, before.local.displacement, block.index)
            own = last.own[block.index]
            memory[block.name] = block.memory.advance(
                block.given, before.memory[block.name], _whole(block, rule, step), since, own
            )
    increment = difference if ends else body.displacement - before.body.displacement
    multiplier = last.solution.multiplier
    state = TimeState(time, before.index + 1, body, local, multiplier, branches, memory, before.ledger, before.heat)
    history = _last_step(discrete, before, state, solved, step, increment, ends, multistep)
    ledger = _balance(discrete, before, state, solved, step, increment)
    shown = None if rule.at == 1.0 else shown_force(discrete, end, state, before.time + rule.at * step)
    return replace(state, ledger=ledger, history=history, shown=shown)


def _last_step(
    discrete: DiscreteEvolution, before: TimeState, state: TimeState, solved: list[SolvedStage], step: float,
    increment: Array, ends: bool, multistep: bool,
) -> LastStep | None:  # fmt: skip
    """What the next step goes on from, if it is known."""
    rate, force = solved[-1].stage.rule.rate, None
    change = state.multiplier - before.multiplier if ends else np.zeros_like(state.multiplier)
    mean = rate.of_difference and abs(rate.difference * step - 1.0) <= ROUNDED
    if ends and mean and discrete.mass is not None and discrete.vectors.alone and discrete.linear:
        force = stiffness_force(discrete, state.body) - stiffness_force(discrete, before.body)
    if not multistep:
        return None if force is None else LastStep(step, force, change)
    slid = state.local.displacement - before.local.displacement
    # Of a body without mass nobody states the velocity at which it begins.
    known = discrete.mass is not None or before.history is not None
    body, local = (
        Rates(one / step, (new.velocity - old.velocity) / step if known else new.acceleration)
        for one, new, old in ((increment, state.body, before.body), (slid, state.local, before.local))
    )
    return LastStep(step, force, change, body, local)


def energies(discrete: DiscreteEvolution, state: TimeState, law: StepLaw) -> dict[str, float]:
    """Energies of a state by name."""
    x, v = state.body.displacement, state.body.velocity
    weights = discrete.problem.contact.weights
    contact = 0.0
    if weights.size:
        local = state.local.displacement
        if law.blocks:
            for block in law.blocks:
                w, r = weights[block.index], local[block.index]
                ends, remembered = block.base.penetrations, state.memory.get(block.name, {})
                seen = block.memory.seen(remembered, r)[:, 0]
                beyond = seen - np.clip(seen, ends.lower, ends.upper)
                r = np.column_stack([r[:, 0] - beyond, r[:, 1:]])
                contact += float(w @ block.memory.stored(block.base, remembered, r))
        else:
            ends, inside = law.stored.penetrations, local.copy()
            inside[:, 0] = np.minimum(np.maximum(local[:, 0], ends.lower), ends.upper)
            contact = float(weights @ law.stored.stored_energy(inside))
    own = {
        "elastic": discrete.elastic_energy(x, stiffness_force(discrete, state.body)),
        "kinetic": 0.0 if discrete.mass is None else 0.5 * float(v @ momentum(discrete, state.body)),
        "branches": sum(part.energy(h) for h, (_, part) in zip(state.branches, discrete.branches, strict=True)),
        "contact": contact,
    }
    return dict(zip(own, discrete.vectors.total(*own.values()).tolist(), strict=True))


def _balance(
    discrete: DiscreteEvolution, before: TimeState, state: TimeState, solved: list[SolvedStage], step: float, du: Array
) -> EnergyBalance:
    """The balance of energy at the end of a step that moves the body by ``du`` (n + k,)."""
    old, stage, law = before.ledger, solved[-1].stage, solved[-1].stage.law
    slid = state.local.displacement - before.local.displacement
    increments = [(du, slid)]
    if len(solved) > 1:
        parts = [one.stage.rule.share * step for one in solved]
        increments = [(a * one.body.velocity, a * one.local.velocity) for a, one in zip(parts, solved, strict=True)]
    branch_loss = sum(
        _branch_loss(branch, h, du / step, period, step)
        for h, (period, branch) in zip(before.branches, discrete.branches, strict=True)
    )
    memory = sum(
        _memory_loss(discrete, before, state, block, solved[-1].own, stage.rule, step)
        for block in law.blocks
        if block.name in before.memory
    )
    done = _work_of(discrete, solved[0], *increments[0], branch_loss, memory)
    for one, increment in zip(solved[1:], increments[1:], strict=True):
        done += _work_of(discrete, one, *increment)
    done, now = done.total(discrete.vectors), energies(discrete, state, law)
    body = done.internal - (now["elastic"] - old.elastic) + done.inertial - (now["kinetic"] - old.kinetic)
    relaxing = done.relaxing - (now["branches"] - old.branches) - done.branch_loss
    foundation = done.normal - (now["contact"] - old.contact) - done.damping - done.memory
    at_once = sum(jump.lost for one in solved for jump in one.jumps)
    return EnergyBalance(
        start=old.start,
        thermal=old.thermal,
        work=old.work + done.work,
        moved=old.moved + done.moved,
        viscous=old.viscous + done.viscous,
        branch_loss=old.branch_loss + done.branch_loss,
        friction=old.friction + done.friction,
        damping=old.damping + done.damping,
        memory=old.memory + done.memory,
        numerical=old.numerical + (body + relaxing + foundation) - at_once,
        jumps=old.jumps + done.jumps + at_once,
        **now,
    ).closed()


def _work_of(
    discrete: DiscreteEvolution, one: SolvedStage, du: Array, dr: Array, branch_loss: float = 0.0, memory: float = 0.0
) -> _StepWork:
    """Work and losses of a stage on a way (n + k,) of the body and one (m, c) of the contact points."""
    stage, n, lam = one.stage, discrete.unknowns, one.solution.multiplier
    weights = discrete.problem.contact.weights[:, None]
    forces, pressed = one.reached.forces, weights * lam
    done = {name: force.factor * float(force.vector @ du) for name, force in forces.items()}
    moved = jumps = damping = 0.0
    if one.resistance:  # the force that resisted
        jumps = one.resistance * float(du[:n] @ _resisting(stage.problem).gradient(one.solution.unknowns))
    if du.size > n:
        moved = sum(force.factor * float(force.vector[n:] @ du[n:]) for force in forces.values())
        moved -= float(stage.load[n:] @ du[n:])
    if lam.size and not stage.still:
        moved -= float((pressed * (discrete.problem.contact.trace_of(du[:n]) - dr)).sum())
    if one.own is not lam:
        damping = float(weights[:, 0] @ ((lam - one.own) * dr)[:, 0])
    slid = (pressed * dr)[:, 1:].sum(axis=1)
    return _StepWork(
        work=float(stage.load @ du),
        moved=moved,
        **done,
        normal=float(pressed[:, 0] @ dr[:, 0]) + float(slid[discrete.stores_slip].sum()),
        friction=float(slid[~discrete.stores_slip].sum()),
        damping=damping,
        jumps=jumps,
        branch_loss=branch_loss,
        memory=memory,
    )


def _resisting(problem: DiscreteProblem) -> Quadratic:
    """In units of whose stiffness a step is resisted."""
    bulk = problem.bulk
    assert isinstance(bulk, Quadratic | Potential)
    return bulk.resisting()


def _memory_loss(
    discrete: DiscreteEvolution, before: TimeState, state: TimeState, block: BoundaryLaw, own: Array, rule: StageRule,
    step: float,
) -> float:  # fmt: skip
    """What the memory of a boundary dissipates in a step."""
    lost = block.memory.dissipated(
        block.given,
        before.memory[block.name],
        state.memory[block.name],
        _whole(block, rule, step),
        discrete.counted(state.local.displacement, before.local.displacement, block.index),
        own[block.index],
    )
    return float(discrete.problem.contact.weights[block.index] @ lost)


def _whole(block: BoundaryLaw, rule: StageRule, step: float) -> LocalStep:
    """The whole step as contact points see it whose law holds at a stage within it, along a straight line."""
    if rule.at == 1.0:
        return block.local
    return LocalStep(step, 1.0 / step, block.local.before, at=1.0 / rule.reach)


def _branch_loss(branch: Operator, h: Array, rate: Array, period: float, step: float) -> float:
    """``int h'Kh / T`` over a step in which the displacement changes at a constant rate, exactly."""
    kept, mixed, gone = squares_of_relaxation(step / period)
    pull, push = branch.times(h), branch.times(rate)
    return float(
        kept * float(h @ pull) + 2.0 * mixed * period * float(h @ push) + gone * period**2 * float(rate @ push)
    )
