"""Findings of a march: what its numbers do not show by themselves, each a condition and its sentence.

A finding is how its sentence begins, by which it is said once in a march, and how it goes on.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from hemivar.basics.arrays import SOLVED
from hemivar.errors import ProblemError
from hemivar.evolution.descent import regularising_viscosity
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.evolution_problem import Mass
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.plan import March
from hemivar.evolution.save import healing
from hemivar.evolution.schemes import Scheme
from hemivar.evolution.stage import stiffness_force
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.solvers import Status

__all__ = [
    "Finding",
    "doubts_of_scheme",
    "energy_made",
    "errors_added",
    "jump",
    "of_step",
    "tolerance_missed",
    "unsolved",
]

#: How a sentence begins, and how it goes on.
Finding = tuple[str, str]

#: Part of the length of others below which a step that fails is too short.
_SHORT = 1e-4
#: Steps, and the part of the whole time, up to which a lag is no more than a jump in a picture of the whole march.
_FEW, _LATE = 5.0, 0.01


def of_step(
    stepper: TimeStepper, plan: March, taken: StepResult, margin: float, jumped: bool, begins_at_stop: bool
) -> Iterator[Finding]:
    """Findings of a step that was accepted."""
    time, end, scheme = taken.before.time, taken.state.time, plan.scheme.name
    if jumped:
        yield from jump(plan, taken, margin)
    if plan.jump is SelectionRule.VISCOUS and not stepper.stages.resists:
        # The body is resisted as many steps long as the resistance says.
        convexity_defect = max(stepper.stages.convexity_defect(stage) for stage in taken.stages)
        steps = regularising_viscosity(convexity_defect) if convexity_defect >= 0.0 else 0.0
        lag = steps * taken.step
        if steps > _FEW and lag > _LATE * (plan.until - stepper.discrete.evolution.start):
            yield (
                "the body lags behind",
                f" what acts on it by up to {lag:.3g}, {steps:.3g} steps, from t = {time:g} on. "
                f"The artificial viscosity makes the step unique; its dissipation is reported under 'jumps'; "
                f"take shorter steps, or jump = 'arc-length'",
            )
    if begins_at_stop and (longest := _longest_without_swing(stepper, taken)) < taken.step:
        yield (
            f"from t = {time:g} on displacements oscillate about the equilibrium",
            f", and so does the damage, because the viscosity relaxes within a step; take steps below {longest:.3g}, "
            "or implicit-euler",
        )
    size, depth = _gap_jump(stepper, taken)
    if size:
        yield (
            "an obstacle jumps into the body",
            f" by {size:.3g} in the step to t = {end:g} and penetrates up to {depth:.3g}, "
            f"because {scheme} acts on velocities; move the gap over some steps, or take implicit-euler",
        )
    if healed := healing(stepper.discrete, taken.before, taken.state):
        yield (
            "the glue heals",
            f" on contact '{healed}' from t = {time:g} on: beyond its strength it closes "
            f"along its opening curve; leave memory = () out",
        )


def jump(plan: March, taken: StepResult, margin: float) -> Iterator[Finding]:
    """That the body jumped from one equilibrium to another."""
    when = taken.state.time if not taken.jumps else taken.before.time + taken.jumps[0].part * taken.step
    yield (
        "the body jumped",
        f" at t = {when:.8g}: a step may have several solutions there (margin {margin:.3g}), "
        f"and no viscosity selects one; jump = '{plan.jump}' did",
    )
    if taken.stages[-1].rule.reach != 1.0:
        yield (
            f"the scheme {plan.scheme.name} ends a step as far beyond the equilibrium that it finds as it was before",
            " it: displacements oscillate after a jump; use implicit-euler or sdirk2",
        )


def tolerance_missed(time: float, error: float, shortest: float) -> Finding:
    """That a step is not as exact as was asked for; ``shortest`` is that of those tried that cannot be solved, or 0."""
    why, remedy = "which cannot be shorter", "allow shorter steps or take"
    if shortest:
        why, remedy = f"and those tried that are shorter, down to {shortest:.3g}, cannot be solved", "take"
    return (
        "the tolerance of steps was missed",
        f" first in the step to t = {time:g}, {why}: its error is about {error:.2g} "
        f"of the whole; {remedy} a larger rtol. Where a load or a support jumps, name its time as a stop, and take "
        "implicit-euler",
    )


def unsolved(taken: StepResult, start: float, length: float, end: float, usual: float) -> Iterator[Finding]:
    """That a step of this length could not be solved, and why; nothing if it was interrupted and may be resumed."""
    remedy = taken.remedy
    if length < _SHORT * usual:
        remedy = (
            f"a step of {length:.3g} among others of {usual:.3g} is too short for the displacements to "
            f"determine the forces; move the stop or the kink of a load that causes it"
        )
    if taken.status is Status.NOT_CARRIED:
        yield (
            f"broken at t = {end:.10g}: no equilibrium is found from the one at t = {start:.10g} on",
            ". The load may exceed what the foundation can carry; for a closer time take shorter steps",
        )
    elif taken.status is not Status.INTERRUPTED:
        yield f"the step from t = {start:.10g} to {end:.10g} could not be solved", f": {remedy}"


def energy_made(scheme: Scheme, rows: Sequence[Mapping[str, float]], start: float, inert: bool) -> str:
    """That the scheme made more than half of the energy that was given, if so; ``start`` was stored at first."""
    made = -min(row["numerical"] + row["jumps"] for row in rows)
    given = abs(start) + max(abs(row["work"]) + abs(row["moved"]) + abs(row.get("thermal", 0.0)) for row in rows)
    if made <= 0.5 * given:
        return ""
    if not inert and scheme.ends_at_equilibrium:
        return (
            f"the balance of energy misses {made:.3g}, where loads, supports and the initial state gave "
            f"{given:.3g}: a step that crosses the softening of a law knows its work at its end alone. The states "
            "are equilibria; take shorter steps for the work"
        )
    others = "on a rigid obstacle moreau-jean or mass = 'redistributed'" if inert else "sdirk2"
    return (
        f"the scheme {scheme.name} made energy, {made:.3g} where loads, supports and the initial state "
        f"gave {given:.3g}: the motion is not physical. Take shorter steps or implicit-euler, or {others}"
    )


def errors_added(summed: Sequence[float]) -> str:
    """That the tolerance of adaptive steps does not bound the error at the end, and what it may be."""
    energy, contact = (f"{100.0 * part:.2g} %" for part in summed)
    return (
        f"rtol bounds the error of one step; those of all steps add up to about {energy} in the energy norm and "
        f"{contact} of the displacements of contact points: halve rtol and compare, if this is too much"
    )


def doubts_of_scheme(discrete: DiscreteEvolution, scheme: Scheme) -> tuple[str, ...]:
    """That a scheme which is made for springs has a body hit something rigid, or nodes without mass swing, if so."""
    if not scheme.rings_on_rigid_obstacles:
        return ()
    ends, points = discrete.problem.law.penetrations, discrete.problem.contact_points > 0
    if discrete.mass is not None and discrete.evolution.mass is Mass.REDISTRIBUTED:
        (rule,) = scheme.rules(1.0)
        swing = (
            "contact nodes without mass are in equilibrium within a step; at its end they oscillate about it, also "
            "into an obstacle, in each step"
            f" {rule.reach - 1.0:.3g} times as far; take newmark or "
            "implicit-euler"
        )
        return (swing,) if points and rule.reach > 1.0 else ()
    rigid = points and bool((np.isfinite(ends.upper) & (ends.lower < ends.upper)).any())
    if not discrete.vectors.largest(float(rigid))[0]:
        return ()
    if discrete.mass is None:
        return (
            f"an obstacle is rigid: once the body touches it velocities of the scheme {scheme.name} oscillate, and "
            f"so does the dissipation; use sdirk2 or implicit-euler, or a compliant foundation",
        )
    return (
        f"an obstacle is rigid: where the body hits it the scheme {scheme.name} oscillates and may gain energy; "
        f"use moreau-jean or implicit-euler, mass = 'redistributed', or a compliant foundation",
    )


def _gap_jump(stepper: TimeStepper, taken: StepResult) -> tuple[float, float]:
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


def _longest_without_swing(stepper: TimeStepper, taken: StepResult) -> float:
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
