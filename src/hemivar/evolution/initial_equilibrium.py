"""Initial equilibrium of a quasi-static body, and the one that follows where a load jumps."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from hemivar.basics.arrays import SOLVED
from hemivar.errors import ProblemError
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData
from hemivar.evolution.initial import AT_ONCE
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.stage import stiffness_force
from hemivar.evolution.state import EnergyBalance, Kinematics, TimeState
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.laws import SlipMeasure
from hemivar.solvers import Status

__all__ = [
    "gap_jump",
    "has_instantaneous_part",
    "instantaneous_equilibrium",
    "longest_without_swing",
    "with_own_balance",
    "with_ramped_work",
]

#: What is said where friction at rest does not hold the body.
_NO_REST = (
    "friction that weakens with the slip rate may not carry the initial load at rest; start from a smaller load "
    "and increase it, or give the body mass or viscosity"
)


def has_instantaneous_part(discrete: DiscreteEvolution) -> bool:
    """Whether a part of a body has neither mass nor viscosity, so that its displacement is no initial value."""
    if discrete.mass is not None or discrete.stores:
        return False
    return discrete.viscosity is None or not discrete.viscous_everywhere


def instantaneous_equilibrium(
    stepper: TimeStepper, state: TimeState, step: float, jump: SelectionRule, start: ExternalData, now: ExternalData
) -> StepResult:
    """The equilibrium with what acts now: parts without viscosity yield at once, branches and memories with them.

    A very short step of implicit Euler, in which viscosity resists whatever moves.  Where several equilibria exist it
    goes downhill from where the body is, unless ``jump`` says otherwise.  Friction that weakens with the slip rate is
    as strong as at rest, where the body is in the end: no rate is that of so short a step.
    """
    chosen = jump if jump.follows or jump is SelectionRule.GLOBAL else SelectionRule.LOCAL
    resting = _at_rest(stepper.discrete, now)
    try:
        taken = stepper.at_once(state, AT_ONCE * step, start, resting, chosen)
    except ProblemError as error:
        if resting is now:
            raise
        raise ProblemError(f"{error}; {_NO_REST}") from error
    if resting is not now and taken.status is not Status.CONVERGED:
        taken = replace(taken, advice=f"{taken.status.remedy}; {_NO_REST}")
    body, local = taken.state.body.displacement, taken.state.local.displacement
    rest = replace(
        taken.state,
        index=state.index,
        body=Kinematics.at_rest(body),
        local=Kinematics.at_rest(local),
        history=None,
    )
    return replace(taken, state=rest)


def _at_rest(discrete: DiscreteEvolution, acting: ExternalData) -> ExternalData:
    """What acts, with friction that weakens with the slip rate as strong as it is at rest; that of the slip stays."""
    parts = [part for contact in discrete.contacts.values() for part in contact.remembers]
    of_slip = any(contact.friction.of is SlipMeasure.SLIP for contact in discrete.contacts.values())
    law = acting.law if of_slip else acting.law.at_rest()
    weakens = len(acting.offset) > 0 and law is not acting.law
    if any(part.of_slip or part.takes_friction for part in parts) or not discrete.vectors.largest(float(weakens))[0]:
        return acting
    return replace(acting, law=law)


def with_own_balance(state: TimeState) -> TimeState:
    """A state with which the balance of energy begins."""
    ledger = state.ledger
    names = ("elastic", "branches", "contact", "kinetic")
    return replace(state, ledger=EnergyBalance(start=ledger.stored, **{name: getattr(ledger, name) for name in names}))


def with_ramped_work(
    discrete: DiscreteEvolution, taken: StepResult, start: ExternalData, now: ExternalData
) -> StepResult:
    """An instantaneous equilibrium with the work of loads and supports that ramp up quickly, but not at once.

    What acts after a jump does more work on the way than what grows to it; the difference is what implicit Euler loses.
    Of loads it is half of their change on the way, as for a linear body, where supports or gaps jump as well.
    """
    before, ledger = taken.before.ledger, taken.state.ledger
    lost = ledger.numerical - before.numerical
    still = np.array_equal(start.prescribed, now.prescribed) and np.array_equal(start.offset, now.offset)
    increment = taken.state.body.displacement - taken.before.body.displacement
    half = float(discrete.vectors.total(0.5 * float((now.load - start.load) @ increment))[0])
    work = half if discrete.vectors.largest(float(not still))[0] else lost
    ledger = replace(ledger, numerical=before.numerical, work=ledger.work - work, moved=ledger.moved - (lost - work))
    return replace(taken, state=replace(taken.state, ledger=ledger))


def gap_jump(stepper: TimeStepper, taken: StepResult) -> tuple[float, float]:
    """How far gaps jump towards the body in a step under a law of impact, and how deep points then are in the obstacle.

    Such a law is one of velocities, which no jump has; a gap jumps if it changes in the step by more than three times
    as much as in the neighbouring steps, as long as this one.

    Zero where there is none.
    """
    discrete, step = stepper.discrete, taken.step
    if taken.stages[0].rule.restitution is None or not discrete.evolution.problem.time_dependent & {"gap", "supports"}:
        return 0.0, 0.0
    start, end = taken.before.time, taken.state.time
    ends = [stepper.data.at(time).offset[:, 0] for time in (max(start - step, discrete.evolution.start), start, end)]
    try:
        ends.append(stepper.data.at(end + step).offset[:, 0])
    except ProblemError:  # what depends on time makes no sense any more then
        ends.append(ends[-1])
    before, came, after = (early - late for early, late in itertools.pairwise(ends))
    depth = taken.state.local.displacement[:, 0]
    jumps = (came > 3.0 * (np.abs(before) + np.abs(after))) & (depth > SOLVED * np.abs(ends[2]).max(initial=0.0))
    jump, deepest = (float(part[jumps].max(initial=0.0)) for part in (came, depth))
    jump, deepest = discrete.vectors.largest(jump, deepest).tolist()
    return jump, deepest


def longest_without_swing(stepper: TimeStepper, taken: StepResult) -> float:
    """Length from which a step like this one, of a body without mass, ends beyond the equilibrium that it goes to.

    A scheme whose law holds in the middle of a step ends it twice as far as there.  Of the force F that is out of
    balance, the work on the way falls from F0 at the beginning to F1 in the middle, and is negative at the end where
    ``F0 > 2 F1``: with ``F0 = (1 + z/2) F1``, z the step in units of the retardation time, from z = 2 on.

    inf where nothing is out of balance, or the scheme is another.
    """
    discrete, before, stage = stepper.discrete, taken.before, taken.stages[0]
    if discrete.mass is not None or discrete.viscosity is None or stage.rule.reach <= 1.0:
        return np.inf
    n, increment = discrete.unknowns, taken.state.body.displacement - before.body.displacement
    force = stepper.data_from(before).after(before.time).load - stiffness_force(discrete, before.body)
    force[:n] -= discrete.problem.contact_force(before.multiplier)
    first, middle = discrete.vectors.total(
        float(force[:n] @ increment[:n]), 2.0 * discrete.viscosity.energy(increment) / taken.step
    ).tolist()
    return taken.step * middle / (first - middle) if first > middle > 0.0 else np.inf
