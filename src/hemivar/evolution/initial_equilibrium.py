"""Initial equilibrium of a quasi-static body, and the one that follows where a load jumps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.basics.arrays import COUNTS
from hemivar.basics.deadline import OutOfTime
from hemivar.errors import ProblemError
from hemivar.evolution import findings
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData
from hemivar.evolution.findings import Finding
from hemivar.evolution.initial import AT_ONCE
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.margin import Margins, with_jump_loss
from hemivar.evolution.plan import March
from hemivar.evolution.state import EnergyBalance, Kinematics, TimeState
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.laws import SlipMeasure
from hemivar.solvers import Status

__all__ = ["has_instantaneous_part", "settled"]

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


def settled(
    stepper: TimeStepper, plan: March, margins: Margins, state: TimeState, step: float, initial: bool
) -> tuple[TimeState, StepResult | None, list[Finding | str]]:
    """The state with a body without mass in equilibrium with what acts, the step to it if one was taken, and findings.

    The initial state, with which the balance of energy begins, or that after a jump of what acts.
    """
    data, time, rule = stepper.data_from(state), state.time, SelectionRule(plan.jump)
    if not (initial or data.jumps_at(time)):
        return state, None, []
    start, now = (data.at(time),) * 2 if initial else (data.before(time), data.after(time))
    try:
        taken = _instantaneous(stepper, state, step, rule, start, now)
    except OutOfTime:
        if initial:  # the march ends at its first step
            return state, None, []
        raise
    said = list[Finding | str]()
    if taken.status is not Status.CONVERGED:
        if taken.status is not Status.INTERRUPTED:
            said.append(
                f"the equilibrium at t = {time:.10g}, in which a body without mass starts or continues, could not be "
                f"computed: {taken.remedy}"
            )
        return state, taken, said
    taken, jumped = with_jump_loss(stepper, taken, rule)
    if jumped:
        said += findings.jump(plan, taken, margins.margin(taken))
    if taken.jumps or taken.state.ledger.jumps == state.ledger.jumps:
        taken = _with_ramped_work(stepper.discrete, taken, start, now)
    if not initial:
        return taken.state, taken, said
    stated, displacement = state.body.displacement, taken.state.body.displacement
    off, far = stepper.discrete.vectors.largest(
        float(np.abs(displacement - stated).max(initial=0.0)), float(np.abs(displacement).max(initial=0.0))
    ).tolist()
    if stepper.discrete.evolution.displacement is not None and off > COUNTS * far:
        said.append(
            "the initial displacement is not in equilibrium where the body has no mass; the run starts from the "
            f"nearest equilibrium, {off:.3g} away: leave it out, or give mass or viscosity"
        )
    return _with_own_balance(taken.state), taken, said


def _instantaneous(
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


def _with_own_balance(state: TimeState) -> TimeState:
    """A state with which the balance of energy begins."""
    ledger = state.ledger
    names = ("elastic", "branches", "contact", "kinetic")
    return replace(state, ledger=EnergyBalance(start=ledger.stored, **{name: getattr(ledger, name) for name in names}))


def _with_ramped_work(
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
