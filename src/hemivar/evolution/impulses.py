"""A body whose supports or gaps change their speed at once goes on at the new one, with the blow that this is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.evolution.evolution_problem import Mass
from hemivar.evolution.initial import accelerated
from hemivar.evolution.prescribed_rates import Kinked, Moving, prescribed_rates, velocity_discontinuity
from hemivar.evolution.state import TimeState
from hemivar.evolution.stepper import TimeStepper
from hemivar.linear.krylov import conjugate_gradients

__all__ = ["apply_impulse"]

#: Part of the velocities that is no blow, but rounding.
_ROUNDED = 1e-9
#: Part of a blow that conjugate gradients leave, and their steps at most.
_LEFT, _STEPS = 1e-11, 500
#: Part of the velocities by which a body may miss the rate of a foundation that holds it.
_MISSED = 1e-6


def apply_impulse(advance: TimeStepper, moment: TimeState, step: float) -> TimeState:
    """The moment with the rates that supports and gaps have from then on, if the speed of one jumps there.

    Where a load jumps as well, or alone, it has the accelerations that follow, if the scheme hands them on.
    Schemes that carry velocities on would remember the old ones for ever.  Supports change the velocity of the body at
    once by the mass that nodes have in common with them, foundations that hold it both ways by the impulse p that takes
    it along: ``M dv = B'W p`` on all unknowns, which is what a step of implicit Euler tends to.  What this changes of
    ``v'M v / 2`` is their work.  At the start the same happens to a body that has another velocity than a foundation
    which holds it.
    """
    discrete = advance.discrete
    if discrete.mass is None or advance.scheme.is_displacement_based(step):
        return moment
    found = (
        _at_the_start(advance, moment, step) if not moment.index else velocity_discontinuity(advance, moment.time, step)
    )
    if found is None:
        return _pushed_anew(advance, moment, step)
    (supports, gaps), (held, opened) = found
    n, contact = discrete.unknowns, discrete.problem.contact
    acting = advance.data_from(moment).after(moment.time)
    change = np.zeros_like(moment.body.velocity)
    change[n:] = np.where(held, supports.velocity - moment.body.velocity[n:], 0.0)
    glued = _bilateral(advance) & opened
    want = np.where(glued, gaps.velocity - contact.trace_of(moment.body.velocity[:n]), 0.0)
    change[:n] = _impulse_response(advance, -discrete.mass.times(change)[:n], want, glued)
    velocity = moment.body.velocity + change
    rate = np.where(opened, contact.trace_of(velocity[:n]) - gaps.velocity, moment.local.velocity)
    missed, fast, carried = discrete.vectors.largest(
        *(float(np.abs(part).max(initial=0.0)) for part in (rate[glued], velocity, gaps.velocity))
    ).tolist()
    if missed > _MISSED * max(fast, carried):
        raise ProblemError(
            f"at t = {moment.time:.10g} the impulse of the foundation that holds the body could not be found; take "
            "implicit-euler, which needs none"
        )
    after = replace(
        moment,
        body=moment.body.at_velocity(velocity),
        local=moment.local.at_velocity(np.where(glued, 0.0, rate)),
        history=None,
    )
    after = accelerated(advance, after, acting, (supports, gaps), step)
    gained = 0.5 * float((velocity + moment.body.velocity) @ discrete.mass.times(change))
    kinetic = moment.ledger.kinetic + float(discrete.vectors.total(gained)[0])
    moved = moment.ledger.moved + (kinetic - moment.ledger.kinetic)
    return replace(after, ledger=replace(moment.ledger, kinetic=kinetic, moved=moved))


def _pushed_anew(advance: TimeStepper, moment: TimeState, step: float) -> TimeState:
    """The moment with the accelerations of the load after it, if the load jumps there; velocities stay."""
    if not (moment.index and advance.data.jumps_at(moment.time) and advance.scheme.uses_initial_acceleration(step)):
        return moment
    moving = prescribed_rates(advance, moment.time, step)
    return accelerated(advance, moment, advance.data_from(moment).after(moment.time), moving, step)


def _at_the_start(advance: TimeStepper, moment: TimeState, step: float) -> tuple[Moving, Kinked] | None:
    """What supports and gaps do from the start on, if a foundation holds the body which moves at another rate."""
    fast = max(float(np.abs(speed).max(initial=0.0)) for speed in (moment.body.velocity, moment.local.velocity))
    off = float(np.abs(moment.local.velocity[_bilateral(advance)]).max(initial=0.0))
    fast, off = advance.discrete.vectors.largest(fast, off).tolist()
    if off <= _ROUNDED * fast:
        return None
    supports, gaps = prescribed_rates(advance, moment.time, step)
    nothing = np.zeros(supports.displacement.shape, dtype=bool)  # supports have their rates already
    return (supports, gaps), (nothing, np.ones(gaps.displacement.shape, dtype=bool))


def _bilateral(advance: TimeStepper) -> BoolArray:
    """Which contact components (m, c) have a mass, a foundation that holds them both ways, and no support."""
    discrete = advance.discrete
    contact, ends = discrete.problem.contact, discrete.problem.law.penetrations
    found = np.zeros(contact.shape, dtype=bool)
    if discrete.evolution.mass is not Mass.REDISTRIBUTED and not advance.scheme.is_impact_law:
        found[:, 0] = ends.lower == ends.upper
    free: BoolArray = np.diff(contact.trace.indptr).reshape(found.shape) > 0
    return found & free


@dataclass(frozen=True, eq=False)
class _DelassusOperator:
    """Rates (m c,) that impulses (m c,) make of contact components which are glued, both with the roots of weights."""

    advance: TimeStepper
    glued: BoolArray
    roots: Array

    def __matmul__(self, impulse: Array) -> Array:
        problem = self.advance.discrete.problem
        pushed = _by_mass(self.advance, problem.contact_force(impulse.reshape(self.glued.shape) / self.roots))
        return np.asarray((np.where(self.glued, problem.contact.trace_of(pushed), 0.0) * self.roots).ravel())


def _impulse_response(advance: TimeStepper, blow: Array, want: Array, glued: BoolArray) -> Array:
    """What an impulse on the unknowns (n,) changes of their velocity, where glued contact components (m, c) change
    theirs as they want."""
    discrete = advance.discrete
    problem, vectors = discrete.problem, discrete.vectors
    found = np.zeros_like(blow)
    hit, holds = vectors.largest(float(np.abs(blow).max(initial=0.0)), float(glued.any())).tolist()
    if hit:
        found = _by_mass(advance, blow)
    if not holds:
        return found
    roots = np.sqrt(problem.contact.weights)[:, None]
    missing = (np.where(glued, want - problem.contact.trace_of(found), 0.0) * roots).ravel()
    least = _LEFT * float(vectors.norms(missing)[0])
    yielding = _DelassusOperator(advance, glued, roots)
    pushes = conjugate_gradients(yielding, np.ones_like(missing), missing, np.copy, least, _STEPS, vectors=vectors)
    return found + _by_mass(advance, problem.contact_force(pushes.solution.reshape(glued.shape) / roots))


def _by_mass(advance: TimeStepper, right: Array) -> Array:
    """``M^-1`` of impulses (n,)."""
    mass = advance.discrete.mass
    assert mass is not None
    found = mass.solved(right)
    if found is None:
        raise ProblemError("the mass matrix could not be solved where the speed of a support jumps; check the density")
    return found
