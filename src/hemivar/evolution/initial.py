"""Consistent initial values: displacement, velocity, the acceleration of all forces, impulses of supports."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arrays import COUNTS, ROUNDED, SOLVED
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.evolution.discrete import ExternalData
from hemivar.evolution.evolution_problem import Mass
from hemivar.evolution.schemes import ImplicitEuler
from hemivar.evolution.stage import stiffness_force
from hemivar.evolution.state import EnergyBalance, Kinematics, TimeState
from hemivar.evolution.step_end import energies
from hemivar.evolution.step_laws import StepLaw, initial_memory, stage_law
from hemivar.evolution.stepper import TimeStepper
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import frozen_at, lengths
from hemivar.linear.krylov import conjugate_gradients
from hemivar.solvers import Status

__all__ = [
    "AT_ONCE",
    "Kinked",
    "accelerated",
    "apply_impulse",
    "initial_state",
    "prescribed_rates",
    "velocity_discontinuity",
]

#: Part of a blow that conjugate gradients leave, and their steps at most.
_LEFT, _BLOW_STEPS = 1e-11, 500
#: Part of the next step over which paths are looked at.
_NEAR = 1e-2
#: A difference quotient that grows by more than this while its span is halved is that of a jump, which has no rate.
_JUMPS = 1.2
#: Part of what an acceleration makes of a rate in a span that is no jump of it.
_BENDS = 0.05
#: Part of a rate by which it differs at both sides of a time at which a path has a kink.
_KINK = 1e-3
#: Rounding of difference quotients, in units of that of places over their span.
_ROUNDED = 64.0 * float(np.finfo(float).eps)
#: Motions of prescribed displacements (k,) and of offsets of the contact points (m, c).
Moving = tuple[Kinematics, Kinematics]
#: Which of them go on, at another speed or not; the others jump.
Kinked = tuple[BoolArray, BoolArray]
#: Part of a step in which a body yields at once: what is viscous does this part of what it does in the step.
AT_ONCE = 1e-8
#: Part of the first step that tells what holds the body at the start: short, and long enough for rounding.
_BRIEF = 1e-3


def prescribed_rates(stepper: TimeStepper, time: float, step: float | None) -> Moving:
    """Motion of the prescribed displacements (k,) and of the offsets of the contact points (m, c) from a time on.

    Rates are none where a path jumps, and of a body without mass, which needs none.
    """
    if step is None or not _moves(stepper):
        now = stepper.data.at(time)
        return Kinematics.at_rest(now.prescribed), Kinematics.at_rest(now.offset)
    prescribed, offset = (path.rates()[0] for path in _paths(stepper, time, _NEAR * step))
    return prescribed, offset


def velocity_discontinuity(stepper: TimeStepper, time: float, step: float) -> tuple[Moving, Kinked] | None:
    """Motion of supports and gaps after a time at which the speed of one jumps, and which of them have a rate at both
    sides; None if none jumps.
    """
    if not _moves(stepper):
        return None
    span, jumps = _NEAR * step, False
    motions: list[Kinematics] = []
    smooth: list[BoolArray] = []
    for ahead, behind in zip(_paths(stepper, time, span), _paths(stepper, time, -span), strict=True):
        (after, goes_on), (before, came) = ahead.rates(), behind.rates()
        both = goes_on & came
        fast = np.maximum(np.abs(after.velocity), np.abs(before.velocity))
        bend = np.maximum(np.abs(after.acceleration), np.abs(before.acceleration))
        least = _KINK * fast + _BENDS * span * bend + _ROUNDED * ahead.farthest / span
        jumps |= bool((both & (np.abs(after.velocity - before.velocity) > least)).any())
        motions.append(after)
        smooth.append(both)
    if not stepper.discrete.vectors.largest(float(jumps))[0]:
        return None
    return (motions[0], motions[1]), (smooth[0], smooth[1])


def _moves(stepper: TimeStepper) -> bool:
    """Whether rates of supports and gaps matter, and there are some."""
    discrete = stepper.discrete
    return discrete.mass is not None and bool(discrete.evolution.problem.time_dependent & {"supports", "gap"})


@dataclass(frozen=True, eq=False)
class _Path:
    """Where something is now, and where after half a span, one and two of them, which may be negative."""

    now: Array
    soon: tuple[Array, ...]
    span: float

    @property
    def farthest(self) -> float:
        """The largest of all these places."""
        return max(float(np.abs(position).max(initial=0.0)) for position in (self.now, *self.soon))

    def rates(self) -> tuple[Kinematics, BoolArray]:
        """Its motion now, and where it has one: a place that jumps has no rate."""
        half, one, two = (there - self.now for there in self.soon)
        velocity = (4.0 * one - two) / (2.0 * self.span)
        acceleration = (8.0 * (one - 2.0 * half) - (two - 2.0 * one)) / self.span**2
        # A path may set out at rest, so that its rate is nothing but rounding.
        bends = _BENDS * abs(self.span) * np.abs(acceleration)
        smooth = np.abs((4.0 * half - one) / self.span) <= _JUMPS * np.abs(velocity) + bends
        return Kinematics(self.now, np.where(smooth, velocity, 0.0), np.where(smooth, acceleration, 0.0)), smooth


def _paths(stepper: TimeStepper, time: float, span: float) -> tuple[_Path, _Path]:
    """Those of prescribed displacements and of offsets."""
    now = stepper.data.at(time)
    soon = [stepper.data.at(time + part * span) for part in (0.5, 1.0, 2.0)]
    return (
        _Path(now.prescribed, tuple(acting.prescribed for acting in soon), span),
        _Path(now.offset, tuple(acting.offset for acting in soon), span),
    )


def initial_state(stepper: TimeStepper, step: float | None = None) -> TimeState:
    """Displacement and velocity as stated, the acceleration that the forces ask for, nothing remembered yet.

    Supports and gaps that move have the rates with which they set out, none where they jump.
    """
    discrete, evolution = stepper.discrete, stepper.discrete.evolution
    acting = stepper.data.at(evolution.start)
    stated = evolution.initial("displacement")
    displacement = discrete.restrict(stated, acting.prescribed)
    off = np.abs(discrete.full(displacement) - stated).max(initial=0.0)
    size, off, far = discrete.vectors.largest(
        float(np.abs(stated).max(initial=0.0)), float(off), float(np.abs(acting.offset).max(initial=0.0))
    )
    # Heat may be held at another temperature from the start on: what is held has it at once.
    if evolution.displacement is not None and off > 1e-9 * size and not discrete.stores:
        raise ProblemError("the initial displacement contradicts the supports; make them agree")
    speed = evolution.initial("velocity")
    moving = prescribed_rates(stepper, evolution.start, step)
    velocity = discrete.restrict(speed, moving[0].velocity)
    contact = discrete.problem.contact
    n = discrete.unknowns
    local = np.asarray(contact.trace @ displacement[:n]).reshape(acting.offset.shape) - acting.offset
    rate = np.asarray(contact.trace @ velocity[:n]).reshape(acting.offset.shape) - moving[1].velocity
    ends = acting.law.penetrations
    deep = np.maximum(np.maximum(ends.lower - local[:, 0], local[:, 0] - ends.upper), 0.0)
    (deepest,) = discrete.vectors.largest(float(deep.max(initial=0.0)))
    yields = evolution.displacement is None and not evolution.resists  # to the equilibrium that it begins with
    if deepest > 1e-12 * max(size, far) and not yields:
        which = f"the contact point {int(np.argmax(deep))}" if discrete.vectors.alone else "a contact point"
        raise ProblemError(
            f"at the start {which} is {deepest:.3g} beyond what its law allows; change the initial displacement or the "
            "gap"
        )
    still = np.zeros_like(displacement)
    state = TimeState(
        evolution.start,
        0,
        Kinematics(displacement, velocity, still),
        Kinematics(local, rate, np.zeros_like(local)),
        np.zeros(local.shape),
        tuple(np.zeros_like(displacement) for _ in discrete.branches),
        initial_memory(discrete, acting.law, local),
    )
    law = _law_of_rates(stepper, state, acting, AT_ONCE * (1.0 if step is None else step))
    state = replace(state, multiplier=_least(law, discrete.counted(local, local)))
    if discrete.mass is not None:
        state = accelerated(stepper, state, stepper.data.after(evolution.start), moving, step)
    stored = energies(discrete, state, law)
    return stepper.initialise(replace(state, ledger=EnergyBalance(start=sum(stored.values()), **stored)))


def accelerated(
    stepper: TimeStepper,
    state: TimeState,
    acting: ExternalData,
    moving: tuple[Kinematics, Kinematics],
    step: float | None,
) -> TimeState:
    """A state with the acceleration that all forces make of where the body is and of how fast."""
    contact, n, first = stepper.discrete.problem.contact, stepper.discrete.unknowns, 1.0 if step is None else step
    law = _law_of_rates(stepper, state, acting, AT_ONCE * first)
    r = state.local.displacement
    sought = replace(state, multiplier=_least(law, stepper.discrete.counted(r, r)))
    pressed = replace(sought, multiplier=_pressed(stepper, sought, acting, moving, law, first))
    acceleration = _acceleration(stepper, pressed, acting.load, moving[0].acceleration)
    pushed = (
        np.asarray(contact.trace @ acceleration[:n]).reshape(state.local.displacement.shape) - moving[1].acceleration
    )
    return replace(
        state,
        body=replace(state.body, acceleration=acceleration),
        local=replace(state.local, acceleration=pushed),
    )


def _law_of_rates(stepper: TimeStepper, state: TimeState, acting: ExternalData, span: float) -> StepLaw:
    """The law of a step of implicit Euler so short that it sees the velocities at the start, and what is remembered."""
    guess = _soon(stepper, state, span)
    (rule,) = ImplicitEuler().rules(span)
    return stage_law(stepper.discrete, acting, state, rule, span, guess, state.multiplier)


def _soon(stepper: TimeStepper, state: TimeState, span: float) -> Array:
    """Penetration (m, c) at the start, and slip a short time after it, as the law of a step counts them."""
    r = state.local.displacement
    guess = stepper.discrete.counted(r, r)
    guess[:, 1:] += span * state.local.velocity[:, 1:]
    return guess


def _undamped(law: StepLaw) -> list[tuple[IntArray | slice, VectorLaw]]:
    """Laws and memories, without damping, and their contact points."""
    blocks: list[tuple[IntArray | slice, VectorLaw]] = [(b.index, b.undamped) for b in law.blocks if b.index.size]
    return blocks or [(slice(None), law.stored)]


def _least(law: StepLaw, r: Array) -> Array:
    """The least multiplier (m, c) of laws and memories at local displacements ``r (m, c)`` of a step."""
    lam = np.zeros(r.shape)
    if not lam.size:
        return lam
    for index, one in _undamped(law):
        lam[index] = frozen_at(one, r[index]).nearest_multiplier(r[index], lam[index])
    return lam


def _pressed(
    stepper: TimeStepper,
    state: TimeState,
    acting: ExternalData,
    moving: tuple[Kinematics, Kinematics],
    law: StepLaw,
    step: float,
) -> Array:
    """The multiplier (m, c) at the start; schemes that hand accelerations on need the first one to be right.

    It is that of the velocity that the body has.  Where law and velocity leave it open, as where a point sticks or
    rests on something rigid, it is that of a very short step of implicit Euler, unless the body is thrown
    against an obstacle, which answers by an impulse.
    """
    vectors, r, rate = stepper.discrete.vectors, state.local.displacement, state.local.velocity
    fast, far = vectors.largest(
        max(float(np.abs(velocity).max(initial=0.0)) for velocity in (state.body.velocity, rate)),
        max(float(np.abs(here).max(initial=0.0)) for here in (state.body.displacement, r)),
    ).tolist()
    lam, undetermined = _rubbed(stepper, state, law, COUNTS * fast, AT_ONCE * step)
    # Where a support or another boundary has the component already, nothing is held.
    undetermined &= np.diff(stepper.discrete.problem.contact.trace.indptr).reshape(undetermined.shape) > 0
    ends, near = acting.law.penetrations, ROUNDED * far
    down = (r[:, 0] >= ends.upper - near) & (rate[:, 0] > COUNTS * fast)
    up = (r[:, 0] <= ends.lower + near) & (rate[:, 0] < -COUNTS * fast)
    holds, thrown = vectors.largest(float(undetermined.any()), float((down | up).any())).tolist()
    if not holds or thrown or not stepper.scheme.uses_initial_acceleration(step):
        return lam
    span, soon = _BRIEF * step, acting
    if any(motion.velocity.any() or motion.acceleration.any() for motion in moving):
        # Where implicit Euler finds the accelerations that they have.
        there = (motion.displacement + span * (motion.velocity + span * motion.acceleration) for motion in moving)
        soon = replace(acting, prescribed=next(there), offset=next(there))
    taken = stepper.at_once(state, span, acting, soon)
    return np.where(undetermined, taken.state.multiplier, lam) if taken.status is Status.CONVERGED else lam


def _rubbed(stepper: TimeStepper, state: TimeState, law: StepLaw, slow: float, span: float) -> tuple[Array, BoolArray]:
    """The multiplier (m, c) at the start, from the velocity of the body, and where the velocity leaves it open.

    Points that are no faster than ``slow`` do not slip.
    """
    lam, local = state.multiplier.copy(), state.local
    undetermined = np.zeros(lam.shape, dtype=bool)
    if not lam.size:
        return lam, undetermined
    there = stepper.discrete.counted(local.displacement, local.displacement)
    for index, one in _undamped(law):
        stored = one.pressures(there[index])
        undetermined[index] |= (stored.upper > stored.lower)[:, None]
    if law.blocks:  # a damper of the foundation acts as soon as it is reached
        there[:, 0] += span * local.velocity[:, 0]
        lam = _least(law, there)
    for block in law.blocks:
        if block.damping is not None:
            felt = block.damping.subdifferential(local.velocity[block.index, 0])
            lam[block.index, 0] += np.clip(0.0, felt.lower, felt.upper)
            undetermined[block.index] |= (felt.upper > felt.lower)[:, None]
    if lam.shape[1] > 1:
        guess = _soon(stepper, state, span)
        rests = lengths(local.velocity[:, 1:]) <= slow
        rubs = law.law.frozen(guess, lam)
        guess[rests & ~stepper.discrete.follows_slip, 1:] = 0.0
        guess = rubs.admissible(guess)
        lam[:, 1:] = rubs.nearest_multiplier(guess, np.zeros(lam.shape))[:, 1:]
        undetermined[:, 1:] |= ~rubs.linearise(guess).smooth[:, 1:]
    return lam, undetermined


def _acceleration(stepper: TimeStepper, state: TimeState, load: Array, prescribed: Array) -> Array:
    """``M^-1`` of the forces that do not balance at the start, where moved supports (k,) have a given one."""
    discrete, n = stepper.discrete, stepper.discrete.unknowns
    assert discrete.mass is not None
    force = load - stiffness_force(discrete, state.body)
    if discrete.viscosity is not None:
        force -= discrete.viscosity.times(state.body.velocity)
    for h, (_, branch) in zip(state.branches, discrete.branches, strict=True):
        force -= branch.times(h)
    force -= discrete.mass.times(np.concatenate([np.zeros(n), prescribed]))
    right = force[:n]
    if state.multiplier.size:
        right = right - discrete.problem.contact_force(state.multiplier)
    acceleration = discrete.mass.solved(right)
    if acceleration is None:
        raise ProblemError("the mass matrix could not be solved for the initial acceleration; check the density")
    return np.concatenate([acceleration, prescribed])


def apply_impulse(stepper: TimeStepper, state: TimeState, step: float) -> TimeState:
    """The state with the rates that supports and gaps have from then on, if the speed of one jumps there.

    Where a load jumps as well, or alone, it has the accelerations that follow, if the scheme hands them on.
    Schemes that carry velocities on would remember the old ones for ever.  Supports change the velocity of the body at
    once by the mass that nodes have in common with them, foundations that hold it both ways by the impulse p that takes
    it along: ``M dv = B'W p`` on all unknowns, which is what a step of implicit Euler tends to.  What this changes of
    ``v'M v / 2`` is their work.  At the start the same happens to a body that has another velocity than a foundation
    which holds it.
    """
    discrete = stepper.discrete
    if discrete.mass is None or stepper.scheme.is_displacement_based(step):
        return state
    kinked = (
        _at_the_start(stepper, state, step) if not state.index else velocity_discontinuity(stepper, state.time, step)
    )
    if kinked is None:
        return _pushed_anew(stepper, state, step)
    (supports, gaps), (smooth_supports, smooth_gaps) = kinked
    n, contact = discrete.unknowns, discrete.problem.contact
    acting = stepper.data_from(state).after(state.time)
    change = np.zeros_like(state.body.velocity)
    change[n:] = np.where(smooth_supports, supports.velocity - state.body.velocity[n:], 0.0)
    glued = _bilateral(stepper) & smooth_gaps
    want = np.where(glued, gaps.velocity - contact.trace_of(state.body.velocity[:n]), 0.0)
    change[:n] = _impulse_response(stepper, -discrete.mass.times(change)[:n], want, glued)
    velocity = state.body.velocity + change
    rate = np.where(smooth_gaps, contact.trace_of(velocity[:n]) - gaps.velocity, state.local.velocity)
    missed, fast, carried = discrete.vectors.largest(
        *(float(np.abs(part).max(initial=0.0)) for part in (rate[glued], velocity, gaps.velocity))
    ).tolist()
    if missed > COUNTS * max(fast, carried):
        raise ProblemError(
            f"at t = {state.time:.10g} the impulse of the foundation that constrains the body could not be "
            f"computed; use implicit-euler, which needs none"
        )
    after = replace(
        state,
        body=state.body.at_velocity(velocity),
        local=state.local.at_velocity(np.where(glued, 0.0, rate)),
        history=None,
    )
    after = accelerated(stepper, after, acting, (supports, gaps), step)
    gained = 0.5 * float((velocity + state.body.velocity) @ discrete.mass.times(change))
    kinetic = state.ledger.kinetic + float(discrete.vectors.total(gained)[0])
    moved = state.ledger.moved + (kinetic - state.ledger.kinetic)
    return replace(after, ledger=replace(state.ledger, kinetic=kinetic, moved=moved))


def _pushed_anew(stepper: TimeStepper, state: TimeState, step: float) -> TimeState:
    """The state with the accelerations of the load after it, if the load jumps there; velocities stay."""
    if not (state.index and stepper.data.jumps_at(state.time) and stepper.scheme.uses_initial_acceleration(step)):
        return state
    moving = prescribed_rates(stepper, state.time, step)
    return accelerated(stepper, state, stepper.data_from(state).after(state.time), moving, step)


def _at_the_start(stepper: TimeStepper, state: TimeState, step: float) -> tuple[Moving, Kinked] | None:
    """What supports and gaps do from the start on, if a foundation holds the body which moves at another rate."""
    fast = max(float(np.abs(speed).max(initial=0.0)) for speed in (state.body.velocity, state.local.velocity))
    off = float(np.abs(state.local.velocity[_bilateral(stepper)]).max(initial=0.0))
    fast, off = stepper.discrete.vectors.largest(fast, off).tolist()
    if off <= SOLVED * fast:
        return None
    supports, gaps = prescribed_rates(stepper, state.time, step)
    nothing = np.zeros(supports.displacement.shape, dtype=bool)  # supports have their rates already
    return (supports, gaps), (nothing, np.ones(gaps.displacement.shape, dtype=bool))


def _bilateral(stepper: TimeStepper) -> BoolArray:
    """Which contact components (m, c) have a mass, a foundation that holds them both ways, and no support."""
    discrete = stepper.discrete
    contact, ends = discrete.problem.contact, discrete.problem.law.penetrations
    bilateral = np.zeros(contact.shape, dtype=bool)
    if discrete.evolution.mass is not Mass.REDISTRIBUTED and not stepper.scheme.is_impact_law:
        bilateral[:, 0] = ends.lower == ends.upper
    free: BoolArray = np.diff(contact.trace.indptr).reshape(bilateral.shape) > 0
    return bilateral & free


@dataclass(frozen=True, eq=False)
class _DelassusOperator:
    """Rates (m c,) that impulses (m c,) make of contact components which are glued, both with the roots of weights."""

    stepper: TimeStepper
    glued: BoolArray
    roots: Array

    def __matmul__(self, impulse: Array) -> Array:
        problem = self.stepper.discrete.problem
        pushed = _by_mass(self.stepper, problem.contact_force(impulse.reshape(self.glued.shape) / self.roots))
        return np.asarray((np.where(self.glued, problem.contact.trace_of(pushed), 0.0) * self.roots).ravel())


def _impulse_response(stepper: TimeStepper, blow: Array, want: Array, glued: BoolArray) -> Array:
    """What an impulse on the unknowns (n,) changes of their velocity, where glued contact components (m, c) change
    theirs as they want."""
    discrete = stepper.discrete
    problem, vectors = discrete.problem, discrete.vectors
    change = np.zeros_like(blow)
    hit, holds = vectors.largest(float(np.abs(blow).max(initial=0.0)), float(glued.any())).tolist()
    if hit:
        change = _by_mass(stepper, blow)
    if not holds:
        return change
    roots = np.sqrt(problem.contact.weights)[:, None]
    missing = (np.where(glued, want - problem.contact.trace_of(change), 0.0) * roots).ravel()
    least = _LEFT * float(vectors.norms(missing)[0])
    yielding = _DelassusOperator(stepper, glued, roots)
    pushes = conjugate_gradients(yielding, np.ones_like(missing), missing, np.copy, least, _BLOW_STEPS, vectors=vectors)
    return change + _by_mass(stepper, problem.contact_force(pushes.solution.reshape(glued.shape) / roots))


def _by_mass(stepper: TimeStepper, right: Array) -> Array:
    """``M^-1`` of impulses (n,)."""
    mass = stepper.discrete.mass
    assert mass is not None
    change = mass.solved(right)
    if change is None:
        raise ProblemError("the mass matrix could not be solved where the speed of a support jumps; check the density")
    return change
