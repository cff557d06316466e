"""The moment at which an evolution begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.evolution.discrete import ExternalData
from hemivar.evolution.energy_balance import EnergyBalance
from hemivar.evolution.prescribed_rates import prescribed_rates
from hemivar.evolution.schemes import ImplicitEuler
from hemivar.evolution.stage import stiffness_force
from hemivar.evolution.state import Kinematics, TimeState
from hemivar.evolution.step_end import energies
from hemivar.evolution.step_laws import StepLaw, initial_memory, stage_law
from hemivar.evolution.stepper import TimeStepper
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import lengths
from hemivar.solvers import Status

__all__ = ["accelerated", "initial_moment"]

#: Part of the first step in which nothing but rates is felt.
_AT_ONCE = 1e-8
#: Part of the velocity of the body that is slip, and not rounding; and of displacements that is a gap.
_SLIPS, _TOUCHES = 1e-6, 1e-12
#: Part of the first step that tells what holds the body at the start: short, and long enough for rounding.
_BRIEF = 1e-3


def initial_moment(advance: TimeStepper, step: float | None = None) -> TimeState:
    """Displacement and velocity as stated, the acceleration that the forces ask for, nothing remembered yet.

    Supports and gaps that move have the rates with which they set out, none where they jump.
    """
    discrete, evolution = advance.discrete, advance.discrete.evolution
    acting = advance.data.at(evolution.start)
    stated = evolution.initial("displacement")
    place = discrete.restrict(stated, acting.prescribed)
    off = np.abs(discrete.full(place) - stated).max(initial=0.0)
    size, off, far = discrete.vectors.largest(
        float(np.abs(stated).max(initial=0.0)), float(off), float(np.abs(acting.offset).max(initial=0.0))
    )
    # Heat may be held at another temperature from the start on: what is held has it at once.
    if evolution.displacement is not None and off > 1e-9 * size and not discrete.stores:
        raise ProblemError("the initial displacement contradicts the supports; make them agree")
    speed = evolution.initial("velocity")
    moving = prescribed_rates(advance, evolution.start, step)
    velocity = discrete.restrict(speed, moving[0].velocity)
    contact = discrete.problem.contact
    n = discrete.unknowns
    local = np.asarray(contact.trace @ place[:n]).reshape(acting.offset.shape) - acting.offset
    rate = np.asarray(contact.trace @ velocity[:n]).reshape(acting.offset.shape) - moving[1].velocity
    ends = acting.law.penetrations
    deep = np.maximum(np.maximum(ends.lower - local[:, 0], local[:, 0] - ends.upper), 0.0)
    (deepest,) = discrete.vectors.largest(float(deep.max(initial=0.0)))
    if deepest > 1e-12 * max(size, far):
        which = f"the contact point {int(np.argmax(deep))}" if discrete.vectors.alone else "a contact point"
        raise ProblemError(
            f"at the start {which} is {deepest:.3g} beyond what its law allows; change the initial displacement or the "
            "gap"
        )
    still = np.zeros_like(place)
    moment = TimeState(
        evolution.start,
        0,
        Kinematics(place, velocity, still),
        Kinematics(local, rate, np.zeros_like(local)),
        np.zeros(local.shape),
        tuple(np.zeros_like(place) for _ in discrete.branches),
        initial_memory(discrete, acting.law, local),
    )
    law = _law_of_rates(advance, moment, acting, _AT_ONCE * (1.0 if step is None else step))
    moment = replace(moment, multiplier=_least(law, discrete.counted(local, local)))
    if discrete.mass is not None:
        moment = accelerated(advance, moment, advance.data.after(evolution.start), moving, step)
    found = energies(discrete, moment, law)
    return advance.initialise(replace(moment, ledger=EnergyBalance(start=sum(found.values()), **found)))


def accelerated(
    advance: TimeStepper,
    moment: TimeState,
    acting: ExternalData,
    moving: tuple[Kinematics, Kinematics],
    step: float | None,
) -> TimeState:
    """A moment with the acceleration that all forces make of where the body is and of how fast."""
    contact, n, first = advance.discrete.problem.contact, advance.discrete.unknowns, 1.0 if step is None else step
    law = _law_of_rates(advance, moment, acting, _AT_ONCE * first)
    place = moment.local.displacement
    sought = replace(moment, multiplier=_least(law, advance.discrete.counted(place, place)))
    pressed = replace(sought, multiplier=_pressed(advance, sought, acting, moving, law, first))
    acceleration = _acceleration(advance, pressed, acting.load, moving[0].acceleration)
    pushed = (
        np.asarray(contact.trace @ acceleration[:n]).reshape(moment.local.displacement.shape) - moving[1].acceleration
    )
    return replace(
        moment,
        body=replace(moment.body, acceleration=acceleration),
        local=replace(moment.local, acceleration=pushed),
    )


def _law_of_rates(advance: TimeStepper, moment: TimeState, acting: ExternalData, span: float) -> StepLaw:
    """The law of a step of implicit Euler so short that it sees the velocities at the start, and what is remembered."""
    guess = _soon(advance, moment, span)
    (rule,) = ImplicitEuler().rules(span)
    return stage_law(advance.discrete, acting, moment, rule, span, guess, moment.multiplier)


def _soon(advance: TimeStepper, moment: TimeState, span: float) -> Array:
    """Penetration (m, c) at the start, and slip a short time after it, as the law of a step counts them."""
    place = moment.local.displacement
    guess = advance.discrete.counted(place, place)
    guess[:, 1:] += span * moment.local.velocity[:, 1:]
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
        lam[index] = one.frozen_at(r[index]).nearest_multiplier(r[index], lam[index])
    return lam


def _pressed(
    advance: TimeStepper,
    moment: TimeState,
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
    vectors, place, rate = advance.discrete.vectors, moment.local.displacement, moment.local.velocity
    fast, far = vectors.largest(
        max(float(np.abs(velocity).max(initial=0.0)) for velocity in (moment.body.velocity, rate)),
        max(float(np.abs(here).max(initial=0.0)) for here in (moment.body.displacement, place)),
    ).tolist()
    lam, held = _rubbed(advance, moment, law, _SLIPS * fast, _AT_ONCE * step)
    # Where a support or another boundary has the component already, nothing is held.
    held &= np.diff(advance.discrete.problem.contact.trace.indptr).reshape(held.shape) > 0
    ends, near = acting.law.penetrations, _TOUCHES * far
    down = (place[:, 0] >= ends.upper - near) & (rate[:, 0] > _SLIPS * fast)
    up = (place[:, 0] <= ends.lower + near) & (rate[:, 0] < -_SLIPS * fast)
    holds, thrown = vectors.largest(float(held.any()), float((down | up).any())).tolist()
    if not holds or thrown or not advance.scheme.uses_initial_acceleration(step):
        return lam
    span, soon = _BRIEF * step, acting
    if any(motion.velocity.any() or motion.acceleration.any() for motion in moving):
        # Where implicit Euler finds the accelerations that they have.
        there = (motion.displacement + span * (motion.velocity + span * motion.acceleration) for motion in moving)
        soon = replace(acting, prescribed=next(there), offset=next(there))
    found = advance.at_once(moment, span, acting, soon)
    return np.where(held, found.moment.multiplier, lam) if found.status is Status.CONVERGED else lam


def _rubbed(advance: TimeStepper, moment: TimeState, law: StepLaw, slow: float, span: float) -> tuple[Array, BoolArray]:
    """The multiplier (m, c) at the start, from the velocity of the body, and where the velocity leaves it open.

    Points that are no faster than ``slow`` do not slip.
    """
    lam, local = moment.multiplier.copy(), moment.local
    held = np.zeros(lam.shape, dtype=bool)
    if not lam.size:
        return lam, held
    there = advance.discrete.counted(local.displacement, local.displacement)
    for index, one in _undamped(law):
        stored = one.pressures(there[index])
        held[index] |= (stored.upper > stored.lower)[:, None]
    if law.blocks:  # a damper of the foundation acts as soon as it is reached
        there[:, 0] += span * local.velocity[:, 0]
        lam = _least(law, there)
    for block in law.blocks:
        if block.damping is not None:
            felt = block.damping.subdifferential(local.velocity[block.index, 0])
            lam[block.index, 0] += np.clip(0.0, felt.lower, felt.upper)
            held[block.index] |= (felt.upper > felt.lower)[:, None]
    if lam.shape[1] > 1:
        guess = _soon(advance, moment, span)
        rests = lengths(local.velocity[:, 1:]) <= slow
        rubs = law.law.frozen(guess, lam)
        guess[rests & ~advance.discrete.follows_slip, 1:] = 0.0
        guess = rubs.admissible(guess)
        lam[:, 1:] = rubs.nearest_multiplier(guess, np.zeros(lam.shape))[:, 1:]
        held[:, 1:] |= ~rubs.linearise(guess).smooth[:, 1:]
    return lam, held


def _acceleration(advance: TimeStepper, moment: TimeState, load: Array, held: Array) -> Array:
    """``M^-1`` of the forces that do not balance at the start, where moved supports (k,) have a given one."""
    discrete, n = advance.discrete, advance.discrete.unknowns
    assert discrete.mass is not None
    force = load - stiffness_force(discrete, moment.body)
    if discrete.viscosity is not None:
        force -= discrete.viscosity.times(moment.body.velocity)
    for h, (_, branch) in zip(moment.branches, discrete.branches, strict=True):
        force -= branch.times(h)
    force -= discrete.mass.times(np.concatenate([np.zeros(n), held]))
    right = force[:n]
    if moment.multiplier.size:
        right = right - discrete.problem.contact_force(moment.multiplier)
    found = discrete.mass.solved(right)
    if found is None:
        raise ProblemError("the mass matrix could not be solved for the initial acceleration; check the density")
    return np.concatenate([found, held])
