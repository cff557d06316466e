"""The body of an evolution at one time, as files and figures take it: what a solution is in statics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.history import Frame
from hemivar.fem.thermal_stress import cell_thermal_stress
from hemivar.linear.vectors import WHOLE, Vectors
from hemivar.solvers.boundary_result import ContactValues
from hemivar.solvers.solution import lifted_states

__all__ = ["Snapshot", "moving_state", "snapshot"]

#: A point slips where its rate exceeds this part of the largest speed of the body, ...
_SLOW = 1e-6
#: ... and this part of the largest displacement in the time that has passed: what a solver leaves of a body at rest.
_NOISE = 1e-9


@dataclass(frozen=True, eq=False)
class Snapshot(ContactValues):
    """A frame with the problem that it belongs to.

    Attributes
    ----------
    problem : DiscreteProblem
        With the gaps of its time.
    time : float
    displacement, velocity : arrays (nodes, d)
    local, multiplier, rate : arrays (m, c)
        At the contact points: penetration and slip; force per area of the body on the foundation, which is the
        pressure (column 0) and minus the friction; velocity of penetration and slip.
    state : int array (m,)
        A :class:`~hemivar.solvers.ContactState` each.
    memory : mapping of name to array (m, ...)
    temperature : array (nodes,) or None
        Of a body with heat.
    thermal_stress : array (M, d, d) or None
        In the middle of each cell what the temperature takes from the stress.
    """

    problem: DiscreteProblem
    time: float
    displacement: Array
    velocity: Array
    local: Array
    multiplier: Array
    rate: Array
    state: IntArray
    memory: Mapping[str, Array] = field(default_factory=dict)
    temperature: Array | None = None
    thermal_stress: Array | None = None

    @property
    def contact(self) -> ContactPoints:  # type: ignore[override]
        """The contact points."""
        return self.problem.contact


def snapshot(discrete: DiscreteEvolution, frame: Frame) -> Snapshot:
    """A frame with the problem that it belongs to.

    Parameters
    ----------
    discrete : DiscreteEvolution
    frame : Frame
    """
    problem = discrete.problem
    if discrete.evolution.problem.time_dependent & {"gap", "supports"}:
        offset = discrete.acting(frame.time).offset
        problem = replace(problem, contact=replace(problem.contact, offset=offset))
    state = moving_state(frame, discrete.evolution.start, discrete.vectors)
    return Snapshot(
        problem, frame.time, frame.displacement, frame.velocity, frame.local, frame.multiplier, frame.rate, state,
        frame.memory, frame.temperature, _thermal_stress(discrete, frame),
    )  # fmt: skip


def _thermal_stress(discrete: DiscreteEvolution, frame: Frame) -> Array | None:
    if discrete.heat is None or frame.temperature is None or not discrete.heat.heat.stresses:
        return None
    return cell_thermal_stress(discrete.evolution.body, discrete.heat.heat, frame.temperature)


def moving_state(frame: Frame, start: float, vectors: Vectors = WHOLE) -> IntArray:
    """A :class:`~hemivar.solvers.ContactState` for each contact point, (m,): friction acts on the rate of the slip.

    Open: lifted, no pressure; bonded: lifted, pulled back; slip: it moves along the foundation; else stick.

    Parameters
    ----------
    frame : Frame
    start : float
        Time at which the evolution began.
    vectors : Vectors
        How the parts of all processes are looked at together, if the frame is that of one.
    """
    penetration, pressure = frame.local[:, 0], frame.multiplier[:, 0]
    parts = (frame.local, frame.multiplier, frame.velocity, frame.displacement)
    moved, pressed, fast, far = vectors.largest(*(float(np.abs(part).max(initial=0.0)) for part in parts)).tolist()
    passed = frame.time - start
    slow = _SLOW * fast
    if passed > 0.0:
        slow = max(slow, _NOISE * far / passed)
    moves = np.linalg.norm(frame.rate[:, 1:], axis=1) > slow
    return lifted_states(penetration, pressure, moves, (moved, pressed))
