"""Contact forces at the end of a step whose laws hold within it, where the laws are functions."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData
from hemivar.evolution.state import ContactForce, TimeState
from hemivar.evolution.step_laws import places
from hemivar.laws import Superpotential
from hemivar.laws.scalar_graph import is_continuous

__all__ = ["shown_force"]


def shown_force(discrete: DiscreteEvolution, end: ExternalData, moment: TimeState, stage: float) -> ContactForce:
    """Contact forces that are told of the end of a step: those at the end where all laws are functions.

    The law of a rigid obstacle, of friction that sticks and of glue that breaks at once has a whole interval of forces
    at a displacement and its rate.  A force at the end is then known to nobody, and neither is one that depends on what
    points remember.
    """
    many = float(bool(len(moment.multiplier)) and not _is_function(discrete, end))
    if discrete.vectors.largest(many)[0]:
        return ContactForce(stage, moment.multiplier)
    return ContactForce(moment.time, _at_end(discrete, end, moment))


def _is_function(discrete: DiscreteEvolution, end: ExternalData) -> bool:
    """Whether displacements and their rates tell the force at all contact points."""
    if any(discrete.contacts[name].remembers for name, _ in discrete.blocks):
        return False
    damped = all(is_continuous(part) for _, part in _dampings(discrete, end))
    return damped and end.law.is_function(discrete.problem.contact.components)


def _dampings(discrete: DiscreteEvolution, end: ExternalData) -> Iterator[tuple[IntArray, Superpotential]]:
    """Contact points of each boundary with a law of the normal rate, and the law."""
    for name, index in discrete.blocks:
        if name in end.damping and index.size:
            yield index, end.damping[name].at(places(discrete, index))


def _at_end(discrete: DiscreteEvolution, end: ExternalData, moment: TimeState) -> Array:
    """Forces (m, c) of laws that are functions, at a moment."""
    place, rate = moment.local.displacement.copy(), moment.local.velocity
    place[:, 1:] = np.where(discrete.follows_slip[:, None], place[:, 1:], rate[:, 1:])
    force = end.law.nearest_multiplier(place, np.zeros(place.shape))
    for index, damping in _dampings(discrete, end):
        force[index, 0] += damping.derivative(rate[index, 0])
    return force
