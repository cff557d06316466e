"""The moment at which an evolution begins."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.evolution.advance import Advance
from hemivar.evolution.discrete import Acting
from hemivar.evolution.ledger import Ledger
from hemivar.evolution.moment import Moment, Motion
from hemivar.evolution.schemes import ImplicitEuler
from hemivar.evolution.step_laws import StepLaw, initial_memory, stage_law
from hemivar.laws import Superpotential
from hemivar.laws.neighbourhood import polar
from hemivar.laws.superpotential import Interval

__all__ = ["initial_moment"]

#: Part of the first step over which supports and gaps are looked at for the rates with which they begin.
_NEAR = 1e-2
#: Part of the first step in which nothing but rates is felt.
_AT_ONCE = 1e-8
#: A difference quotient that grows by more than this while its span is halved is that of a jump, which has no rate.
_JUMPS = 1.2
#: Part of what an acceleration makes of a rate in a span that is no jump of it.
_BENDS = 0.05
#: Part of the velocity of the body that is slip, and not rounding; and of displacements that is a gap.
_SLIPS, _TOUCHES = 1e-6, 1e-12
#: Part of the first step that tells what holds the body at the start: short, and long enough for rounding.
_BRIEF = 1e-3


def initial_moment(advance: Advance, step: float | None = None) -> Moment:
    """Displacement and velocity as stated, the acceleration that the forces ask for, nothing remembered yet.

    Supports and gaps that move have the rates with which they set out, none where they jump.

    Parameters
    ----------
    advance : Advance
    step : float, optional
        Length of the first step; without it supports and gaps count as being at rest.

    Raises
    ------
    ProblemError
        The initial displacement contradicts supports or leaves the domain of a contact law.
    """
    discrete, evolution = advance.discrete, advance.discrete.evolution
    acting = advance.acting(evolution.start)
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
    moving = _setting_out(advance, step)
    velocity = discrete.restrict(speed, moving[0].velocity)
    contact = discrete.problem.contact
    n = discrete.unknowns
    local = np.asarray(contact.trace @ place[:n]).reshape(acting.offset.shape) - acting.offset
    rate = np.asarray(contact.trace @ velocity[:n]).reshape(acting.offset.shape) - moving[1].velocity
    ends = acting.law.normal.domain
    deep = np.maximum(np.maximum(ends.lower - local[:, 0], local[:, 0] - ends.upper), 0.0)
    (deepest,) = discrete.vectors.largest(float(deep.max(initial=0.0)))
    if deepest > 1e-12 * max(size, far):
        which = f"the contact point {int(np.argmax(deep))}" if discrete.vectors.alone else "a contact point"
        raise ProblemError(
            f"at the start {which} is {deepest:.3g} beyond what its law allows; change the initial displacement or the "
            "gap"
        )
    still = np.zeros_like(place)
    moment = Moment(
        evolution.start,
        0,
        Motion(place, velocity, still),
        Motion(local, rate, np.zeros_like(local)),
        np.zeros(local.shape),
        tuple(np.zeros_like(place) for _ in discrete.branches),
        initial_memory(discrete, acting.law, local),
    )
    first = 1.0 if step is None else step
    law = _law_of_rates(advance, moment, acting, _AT_ONCE * first)
    moment = replace(moment, multiplier=_pressure(moment, law, local[:, 0]))
    if discrete.mass is not None:
        pressed = replace(moment, multiplier=_pressed(advance, moment, acting, moving, law, first))
        acceleration = _acceleration(advance, pressed, acting.load, moving[0].acceleration)
        pushed = np.asarray(contact.trace @ acceleration[:n]).reshape(local.shape) - moving[1].acceleration
        moment = replace(
            moment,
            body=replace(moment.body, acceleration=acceleration),
            local=replace(moment.local, acceleration=pushed),
        )
    energies = advance.energies(moment, law)
    return advance.started(replace(moment, ledger=Ledger(start=sum(energies.values()), **energies)))


def _setting_out(advance: Advance, step: float | None) -> tuple[Motion, Motion]:
    """Motion of the prescribed displacements (k,) and of the offsets of the contact points (m, c) at the start."""
    discrete = advance.discrete
    start, span = discrete.evolution.start, 0.0 if step is None else _NEAR * step
    now = advance.acting(start)
    moves = discrete.mass is not None and bool(discrete.evolution.problem.time_dependent & {"supports", "gap"})
    if not (span and moves):
        still = (Motion(place, np.zeros_like(place), np.zeros_like(place)) for place in (now.prescribed, now.offset))
        return next(still), next(still)
    soon = [advance.acting(start + part * span) for part in (0.5, 1.0, 2.0)]
    return (
        _set_out(now.prescribed, [acting.prescribed for acting in soon], span),
        _set_out(now.offset, [acting.offset for acting in soon], span),
    )


def _set_out(place: Array, soon: list[Array], span: float) -> Motion:
    """Motion at the start of what is in other places after half a span, one and two of them."""
    half, one, two = (there - place for there in soon)
    velocity = (4.0 * one - two) / (2.0 * span)
    acceleration = (8.0 * (one - 2.0 * half) - (two - 2.0 * one)) / span**2
    # A path may set out at rest, so that its rate is nothing but rounding.
    smooth = np.abs((4.0 * half - one) / span) <= _JUMPS * np.abs(velocity) + _BENDS * span * np.abs(acceleration)
    return Motion(place, np.where(smooth, velocity, 0.0), np.where(smooth, acceleration, 0.0))


def _law_of_rates(advance: Advance, moment: Moment, acting: Acting, span: float) -> StepLaw:
    """The law of a step of implicit Euler so short that it sees the velocities at the start, and what is remembered."""
    guess = span * moment.local.velocity
    guess[:, 0] = moment.local.place[:, 0]
    (rule,) = ImplicitEuler().rules(span)
    return stage_law(advance.discrete, acting, moment, rule, span, guess, moment.multiplier)


def _felt(law: StepLaw, penetration: Array) -> Iterator[tuple[IntArray | slice, Interval]]:
    """Pressures of laws and memories, without damping, where the penetration (m,) is reached in the step of a law."""
    blocks: list[tuple[IntArray | slice, Superpotential]] = [(b.index, b.undamped.normal) for b in law.blocks]
    for index, normal in blocks or [(slice(None), law.stored.normal)]:
        if penetration[index].size:
            ends = normal.domain
            yield index, normal.subdifferential(np.clip(penetration[index], ends.lower, ends.upper))


def _pressure(moment: Moment, law: StepLaw, penetration: Array) -> Array:
    """The least of these pressures (m, c)."""
    lam = np.zeros(moment.local.place.shape)
    for index, felt in _felt(law, penetration):
        lam[index, 0] = np.clip(0.0, felt.lower, felt.upper)
    return lam


def _pressed(
    advance: Advance, moment: Moment, acting: Acting, moving: tuple[Motion, Motion], law: StepLaw, step: float
) -> Array:
    """Pressure and friction (m, c) at the start; schemes that hand accelerations on need the first one to be right.

    They are those of the velocity that the body has.  Where law and velocity leave them open, as where a point sticks
    or rests on something rigid, they are those of a very short step of implicit Euler, unless the body is thrown
    against an obstacle, which answers by an impulse.
    """
    vectors, place, rate = advance.discrete.vectors, moment.local.place, moment.local.velocity
    fast, far = vectors.largest(
        max(float(np.abs(velocity).max(initial=0.0)) for velocity in (moment.body.velocity, rate)),
        max(float(np.abs(here).max(initial=0.0)) for here in (moment.body.place, place)),
    ).tolist()
    lam, held = _rubbed(moment, law, _SLIPS * fast, _AT_ONCE * step)
    # Where a support or another boundary has the component already, nothing is held.
    held &= np.diff(advance.discrete.problem.contact.trace.indptr).reshape(held.shape) > 0
    ends, near = acting.law.normal.domain, _TOUCHES * far
    down = (place[:, 0] >= ends.upper - near) & (rate[:, 0] > _SLIPS * fast)
    up = (place[:, 0] <= ends.lower + near) & (rate[:, 0] < -_SLIPS * fast)
    holds, thrown = vectors.largest(float(held.any()), float((down | up).any())).tolist()
    if not holds or thrown or not advance.scheme.hands_on(step):
        return lam
    span, soon = _BRIEF * step, acting
    if any(motion.velocity.any() or motion.acceleration.any() for motion in moving):
        # Where implicit Euler finds the accelerations that they have.
        there = (motion.place + span * (motion.velocity + span * motion.acceleration) for motion in moving)
        soon = replace(acting, prescribed=next(there), offset=next(there))
    found = advance.reaction(moment, span, acting, soon)
    return lam if found is None else np.where(held, found, lam)


def _rubbed(moment: Moment, law: StepLaw, slow: float, span: float) -> tuple[Array, BoolArray]:
    """Pressure and friction (m, c) at the start with those of the velocity that it has, and which of them it leaves
    open; points that are no faster than ``slow`` do not slip."""
    lam, local = moment.multiplier.copy(), moment.local
    held = np.zeros(lam.shape, dtype=bool)
    if not lam.size:
        return lam, held
    for index, stored in _felt(law, local.place[:, 0]):
        held[index] |= (stored.upper > stored.lower)[:, None]
    guess = span * local.velocity
    if law.blocks:  # a damper of the foundation acts as soon as it is reached
        lam = _pressure(moment, law, local.place[:, 0] + guess[:, 0])
    for block in law.blocks:
        if block.damping is not None:
            felt = block.damping.subdifferential(local.velocity[block.index, 0])
            lam[block.index, 0] += np.clip(0.0, felt.lower, felt.upper)
            held[block.index] |= (felt.upper > felt.lower)[:, None]
    if lam.shape[1] > 1:
        guess[:, 0] = local.place[:, 0]
        size, direction = polar(guess[:, 1:])
        pull = law.law.frozen(guess, lam).tangential.subdifferential(size)
        slips = size > span * slow
        lam[:, 1:] = np.where(slips, np.clip(0.0, pull.lower, pull.upper), 0.0)[:, None] * direction
        held[:, 1:] |= (~slips & (pull.upper > 0.0))[:, None]
    return lam, held


def _acceleration(advance: Advance, moment: Moment, load: Array, held: Array) -> Array:
    """``M^-1`` of the forces that do not balance at the start, where moved supports (k,) have a given one."""
    discrete, n = advance.discrete, advance.discrete.unknowns
    assert discrete.mass is not None
    force = load - discrete.stiffness.times(moment.body.place)
    if discrete.viscosity is not None:
        force -= discrete.viscosity.times(moment.body.velocity)
    force -= discrete.mass.times(np.concatenate([np.zeros(n), held]))
    right = force[:n]
    if moment.multiplier.size:
        right = right - discrete.problem.contact_force(moment.multiplier)
    found = discrete.mass.solved(right)
    if found is None:
        raise ProblemError("the mass matrix could not be solved for the initial acceleration; check the density")
    return np.concatenate([found, held])
