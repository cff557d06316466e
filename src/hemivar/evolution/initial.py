"""The moment at which an evolution begins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution.advance import Advance
from hemivar.evolution.discrete import Acting
from hemivar.evolution.ledger import Ledger
from hemivar.evolution.moment import Moment, Motion
from hemivar.evolution.schemes import ImplicitEuler
from hemivar.evolution.step_laws import StepLaw, initial_memory, stage_law
from hemivar.laws.neighbourhood import polar

__all__ = ["initial_moment"]

#: Part of the first step over which supports and gaps are looked at for the rates with which they begin.
_NEAR = 1e-2
#: A difference quotient that grows by more than this while its span is halved is that of a jump, which has no rate.
_JUMPS = 1.2
#: Part of the velocity of the body that is slip, and not rounding.
_SLIPS = 1e-6


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
    lam = np.zeros(local.shape)
    if local.size:
        inside = local.copy()
        inside[:, 0] = np.clip(inside[:, 0], ends.lower, ends.upper)
        interval = acting.law.normal.subdifferential(inside[:, 0])
        lam[:, 0] = np.clip(0.0, interval.lower, interval.upper)
    still = np.zeros_like(place)
    moment = Moment(
        evolution.start,
        0,
        Motion(place, velocity, still),
        Motion(local, rate, np.zeros_like(local)),
        lam,
        tuple(np.zeros_like(place) for _ in discrete.branches),
        initial_memory(discrete, acting.law, local),
    )
    if discrete.mass is not None:
        rubbed = replace(moment, multiplier=_rubbed(advance, moment, acting, step))
        acceleration = _acceleration(advance, rubbed, acting.load, moving[0].acceleration)
        pushed = np.asarray(contact.trace @ acceleration[:n]).reshape(local.shape) - moving[1].acceleration
        moment = replace(
            moment,
            body=replace(moment.body, acceleration=acceleration),
            local=replace(moment.local, acceleration=pushed),
        )
    energies = advance.energies(moment, StepLaw(acting.law))
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
    smooth = np.abs((4.0 * half - one) / span) <= _JUMPS * np.abs(velocity)
    return Motion(place, np.where(smooth, velocity, 0.0), np.where(smooth, (two - 2.0 * one) / span**2, 0.0))


def _rubbed(advance: Advance, moment: Moment, acting: Acting, step: float | None) -> Array:
    """Pressure and friction (m, c) at the start with those of the velocity that it has; without it, none of the two.

    Schemes that hand accelerations on are of second order only if the first one is right.
    """
    lam, local = moment.multiplier.copy(), moment.local
    fast = advance.discrete.vectors.largest(
        float(np.abs(moment.body.velocity).max(initial=0.0)), float(np.abs(local.velocity).max(initial=0.0))
    ).max()
    if not (lam.size and local.velocity.any()):
        return lam
    span = _NEAR * _NEAR * (1.0 if step is None else step)
    guess = span * local.velocity
    guess[:, 0] = local.place[:, 0]
    (rule,) = ImplicitEuler().rules(span)
    law = stage_law(advance.discrete, acting, moment, rule, span, guess, lam)
    for block in law.blocks:
        if block.damping is not None:
            felt = block.damping.subdifferential(local.velocity[block.index, 0])
            lam[block.index, 0] += np.clip(0.0, felt.lower, felt.upper)
    if lam.shape[1] > 1:
        size, direction = polar(guess[:, 1:])
        pull = law.law.frozen(guess, lam).tangential.subdifferential(size)
        slips = size > _SLIPS * span * fast
        lam[:, 1:] = np.where(slips, np.clip(0.0, pull.lower, pull.upper), 0.0)[:, None] * direction
    return lam


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
