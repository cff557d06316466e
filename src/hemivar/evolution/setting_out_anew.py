"""A body whose supports or gaps change their speed at once goes on at the new one, with the blow that this is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.errors import ProblemError
from hemivar.evolution.advance import Advance
from hemivar.evolution.initial import accelerated
from hemivar.evolution.moment import Moment
from hemivar.evolution.setting_out import speeds_jump

__all__ = ["set_out_anew"]


def set_out_anew(advance: Advance, moment: Moment, step: float) -> Moment:
    """The moment with the rates that supports and gaps have from then on, if the speed of one jumps there.

    Schemes that carry velocities on would remember the old ones for ever.  Supports change the velocity of the body at
    once by the mass that nodes have in common with them, ``M dv = 0`` on all unknowns, which is what a step of implicit
    Euler tends to.  They do the work ``v'M v / 2`` that this changes.  A foundation that holds the body both ways keeps
    the rate that the scheme gives it.

    Parameters
    ----------
    advance : Advance
    moment : Moment
        At a kink of what acts, or a stop.
    step : float
        Length of the next step.

    Raises
    ------
    ProblemError
        The mass matrix cannot be solved.
    """
    discrete = advance.discrete
    if discrete.mass is None or advance.scheme.forgets(step):
        return moment
    found = speeds_jump(advance, moment.time, step)
    if found is None:
        return moment
    (supports, gaps), (held, open_) = found
    n, contact = discrete.unknowns, discrete.problem.contact
    acting = advance.acting_on(moment)
    change = np.zeros_like(moment.body.velocity)
    change[n:] = np.where(held, supports.velocity - moment.body.velocity[n:], 0.0)
    blow = -discrete.mass.times(change)[:n]
    if discrete.vectors.largest(float(np.abs(blow).max(initial=0.0)))[0]:
        pushed = discrete.mass.solved(blow)
        if pushed is None:
            raise ProblemError(
                "the mass matrix could not be solved where the speed of a support jumps; check the density"
            )
        change[:n] = pushed
    velocity = moment.body.velocity + change
    traced = np.asarray(contact.trace @ velocity[:n]).reshape(moment.local.place.shape)
    ends = acting.law.normal.domain
    open_[:, 0] &= np.broadcast_to(ends.lower < ends.upper, open_[:, 0].shape)
    rate = np.where(open_, traced - gaps.velocity, moment.local.velocity)
    after = replace(
        moment,
        body=replace(moment.body, velocity=velocity),
        local=replace(moment.local, velocity=rate),
        stretching=None,
    )
    after = accelerated(advance, after, acting, (supports, gaps), step)
    gained = 0.5 * float((velocity + moment.body.velocity) @ discrete.mass.times(change))
    kinetic = moment.ledger.kinetic + float(discrete.vectors.total(gained)[0])
    moved = moment.ledger.moved + (kinetic - moment.ledger.kinetic)
    return replace(after, ledger=replace(moment.ledger, kinetic=kinetic, moved=moved))
