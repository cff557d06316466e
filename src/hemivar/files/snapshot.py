"""A snapshot (state) of an evolution, as files and figures take it: what a solution is in statics."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution.history import damage_of, law_at, remembered
from hemivar.fem.contact_basis import nodal_depths
from hemivar.fem.thermal_stress import cell_thermal_stress
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers.boundary_result import ContactValues
from hemivar.solvers.contact_states import ContactStates, contact_states

if TYPE_CHECKING:
    from hemivar.evolution.discrete import DiscreteEvolution
    from hemivar.evolution.history import Frame

__all__ = ["Snapshot", "moving_states", "snapshot"]

#: A point slips where its rate exceeds this part of the largest speed of the body, ...
_SLOW = 1e-6
#: ... and this part of the largest displacement in the time that has passed: what a solver leaves of a body at rest.
_NOISE = 1e-9


@dataclass(frozen=True, eq=False)
class Snapshot(ContactValues):
    """A frame with the problem that it belongs to."""

    problem: DiscreteProblem  # with the gaps of its time
    time: float
    displacement: Array  # (nodes, d)
    velocity: Array  # (nodes, d)
    local: Array  # (m, c)
    multiplier: Array  # (m, c)
    rate: Array  # (m, c)
    states: ContactStates  # what each contact point does
    memory: Mapping[str, Array] = field(default_factory=dict)  # (m, ...)
    temperature: Array | None = None  # (nodes,): of a body with heat
    thermal_stress: Array | None = None  # (M, d, d)
    force_time: float = math.nan  # the time that the multiplier belongs to
    debonding: Mapping[str, Array] = field(default_factory=dict)  # the ``damage`` (m,) of glue

    @property
    def contact(self) -> ContactPoints:  # type: ignore[override]
        """The contact points."""
        return self.problem.contact

    @property
    def gap(self) -> Array:  # type: ignore[override]
        """Distance between body and foundation along the normal, (m,)."""
        return nodal_depths(self.problem, self.problem.gap)

    @property
    def penetration(self) -> Array:  # type: ignore[override]
        """What the body is beyond its foundation, (m,)."""
        return nodal_depths(self.problem, self.local[:, 0])


def snapshot(discrete: DiscreteEvolution, frame: Frame) -> Snapshot:
    """A frame with the problem that it belongs to."""
    problem = discrete.problem
    if discrete.evolution.problem.time_dependent & {"gap", "supports"}:
        offset = discrete.data_at(frame.load_factor).offset
        problem = problem.with_(offset=offset)
    problem = _stressed(discrete, problem, frame.load_factor)
    states, damage = moving_states(discrete, frame), damage_of(discrete, frame)
    debonding = {} if np.isnan(damage).all() else {"damage": damage}
    return Snapshot(
        problem, frame.time, frame.displacement, frame.velocity, frame.local, frame.multiplier, frame.rate, states,
        frame.memory, frame.temperature, _thermal_stress(discrete, frame), frame.force_time,
        debonding,
    )  # fmt: skip


def _stressed(discrete: DiscreteEvolution, problem: DiscreteProblem, time: float) -> DiscreteProblem:
    """The problem with the initial stress of a time, of which stresses are made."""
    stated = discrete.evolution.problem
    if problem.origin is None or not isinstance(stated, ContactProblem) or "load" not in stated.time_dependent:
        return problem
    now = stated.at_time(time)
    if not (now.initially_stressed or problem.origin.initially_stressed):
        return problem
    return problem.fitted(replace(problem.model, origin=now))


def _thermal_stress(discrete: DiscreteEvolution, frame: Frame) -> Array | None:
    if discrete.heat is None or frame.temperature is None or not discrete.heat.heat.stresses:
        return None
    return cell_thermal_stress(discrete.evolution.body, discrete.heat.heat, frame.temperature)


def moving_states(discrete: DiscreteEvolution, frame: Frame) -> ContactStates:
    """The states of the contact points: friction acts on the rate of the slip, and glue on the largest opening.

    Along the normal they are those of the law at this time, of what it sees where a surface has worn or crept, and of
    what the points remember.
    """
    parts = (frame.local, frame.multiplier, frame.velocity, frame.displacement)
    sizes = (float(np.abs(part).max(initial=0.0)) for part in parts)
    moved, pressed, fast, far = discrete.vectors.largest(*sizes).tolist()
    passed = frame.time - discrete.evolution.start
    slow = _SLOW * fast
    if passed > 0.0:
        slow = max(slow, _NOISE * far / passed)
    moves = np.linalg.norm(frame.rate[:, 1:], axis=1) > slow
    law, contact = law_at(discrete, frame.time), discrete.problem.contact
    seen, past_peak = frame.local.copy(), np.zeros(len(frame.local), dtype=bool)
    for index, memory, state in remembered(discrete, frame):
        seen[index] = memory.seen(state, seen[index])
        past_peak[index] = memory.past_peak(law.take(index), state)
    past_peak |= law.past_peak(seen)
    return contact_states(
        law, seen, frame.multiplier, (moved, pressed), moves=moves, past_peak=past_peak,
        without_friction=contact.without_friction,
    )  # fmt: skip
