"""Contact forces at the end of a step whose laws hold within it, where the laws are functions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData
from hemivar.evolution.state import ContactForce, TimeState
from hemivar.evolution.step_laws import places
from hemivar.laws import ContactLaw, Superpotential, separable
from hemivar.laws.neighbourhood import polar

__all__ = ["shown_force"]

#: Part of a force that it may jump by and count as continuous: rounding.
_ROUNDED = 1e-12


def shown_force(discrete: DiscreteEvolution, end: ExternalData, moment: TimeState, stage: float) -> ContactForce:
    """Contact forces that are told of the end of a step: those at the end where all laws are functions.

    The law of a rigid obstacle, of friction that sticks and of glue that breaks at once has a whole interval of forces
    at a displacement and its rate.  A force at the end is then known to nobody, and neither is one that depends on what
    points remember.

    Parameters
    ----------
    discrete : DiscreteEvolution
    end : ExternalData
        What acts at the end.
    moment : TimeState
        The end of the step; its multiplier is the force at the stage.
    stage : float
        Time of the stage.
    """
    law = separable(end.law, "a march in time")
    many = float(bool(len(moment.multiplier)) and not _is_function(discrete, law, end))
    if discrete.vectors.largest(many)[0]:
        return ContactForce(stage, moment.multiplier)
    return ContactForce(moment.time, _at_end(discrete, law, end, moment))


def _is_function(discrete: DiscreteEvolution, law: ContactLaw, end: ExternalData) -> bool:
    """Whether displacements and their rates tell the force at all contact points."""
    if any(discrete.contacts[name].memory for name, _ in discrete.blocks) or law.friction.state_dependent:
        return False
    parts = [*law.scalar_laws(discrete.problem.contact.components), *(part for _, part in _dampings(discrete, end))]
    return all(_continuous(part) for part in parts)


def _dampings(discrete: DiscreteEvolution, end: ExternalData) -> Iterator[tuple[IntArray, Superpotential]]:
    """Contact points of each boundary with a law of the normal rate, and the law."""
    for name, index in discrete.blocks:
        if name in end.damping and index.size:
            yield index, end.damping[name].at(places(discrete, index))


def _continuous(law: Superpotential) -> bool:
    """Whether the derivative of a superpotential is defined everywhere and jumps nowhere."""
    ends, (left, right) = law.domain, law.knot_slopes()
    if np.isfinite(ends.lower).any() or np.isfinite(ends.upper).any():
        return False
    return not (np.abs(right - left) > _ROUNDED * np.maximum(np.abs(left), np.abs(right))).any()


def _at_end(discrete: DiscreteEvolution, law: ContactLaw, end: ExternalData, moment: TimeState) -> Array:
    """Forces (m, c) of laws that are functions, at a moment."""
    place, rate = moment.local.displacement, moment.local.velocity
    force = np.empty(place.shape)
    force[:, 0] = law.normal.derivative(place[:, 0])
    for index, damping in _dampings(discrete, end):
        force[index, 0] += damping.derivative(rate[index, 0])
    if place.shape[1] > 1:
        size, direction = polar(np.where(discrete.follows_slip[:, None], place[:, 1:], rate[:, 1:]))
        force[:, 1:] = law.tangential.derivative(size)[:, None] * direction
    return force
