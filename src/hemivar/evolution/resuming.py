"""Whether what a checkpoint holds is a state of the evolution that is to go on from it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from hemivar.basics.types import Array
from hemivar.evolution.history import Frame, Row
from hemivar.evolution.march_state import MOTION, RATES, MarchState
from hemivar.evolution.state import Kinematics, LastStep, TimeState
from hemivar.evolution.step_laws import initial_memory
from hemivar.evolution.stepper import TimeStepper
from hemivar.evolution.steps import StepSizeController

__all__ = ["misfit"]

_AT_CONTACT = ("local", "multiplier", "rate")


def misfit(state: MarchState, advance: TimeStepper, stepping: StepSizeController, columns: Sequence[str]) -> str:
    """What is wrong with a state that was read: shapes, numbers that are not finite, times and counters.

    Empty if nothing is.
    """
    return next(_wrong(state, advance, stepping, columns), "")


def _wrong(
    state: MarchState, advance: TimeStepper, stepping: StepSizeController, columns: Sequence[str]
) -> Iterator[str]:
    yield from _moment(state.moment, advance, "")
    moment = state.moment
    if moment.heat is not None and advance.beside is not None:
        yield from _moment(moment.heat.moment, advance.beside, "heat.")
        if not (_count(moment.heat.rounds) and math.isfinite(moment.heat.contraction)):
            yield "the rounds of its heat are no numbers"
    if (moment.heat is None) != (advance.beside is None):
        yield "it has heat where the evolution has none, or none where it has"
    if moment.shown is not None:
        yield from _array("shown.multiplier", moment.shown.multiplier, moment.multiplier.shape)
        if not math.isfinite(moment.shown.time):
            yield f"its forces belong to the time {moment.shown.time:g}"
    if moment.history is not None:
        yield from _history(moment.history, moment, advance)
    yield from _array("origin", state.origin, moment.body.displacement.shape)
    if not (stepping.knows(state.pace) and moment.time + state.pace.step > moment.time):
        yield f"its step, {state.pace.step:g}, is none of this control of steps"
    for name in ("largest", "farthest"):
        if not 0.0 <= getattr(state, name) < math.inf:
            yield f"{name} is {getattr(state, name):g}"
    if not (math.isnan(state.bound) or state.bound >= 0.0):
        yield f"its bound of the error in time is {state.bound:g}"
    offered, stride = state.frame_place
    if not (_count(offered) and _count(stride) and stride):
        yield "its counters of frames are no whole numbers"
    if not all(isinstance(name, str) and math.isfinite(time) for time, name in state.events):
        yield "its events are no times and names"
    if not all(isinstance(message, str) for message in state.messages):
        yield "its messages are no texts"
    yield from _rows(state.rows, advance, moment, columns)
    yield from _frames(state.frames, {row.time for row in state.rows}, advance, moment)


def _moment(moment: TimeState, advance: TimeStepper, where: str) -> Iterator[str]:
    """What is wrong with the state of a body, or of its heat."""
    discrete, evolution = advance.discrete, advance.discrete.evolution
    acting = advance.data.at(evolution.start)
    whole, local = (discrete.unknowns + len(discrete.moved),), acting.offset.shape
    yield from _motion(f"{where}body", moment.body, whole)
    yield from _motion(f"{where}local", moment.local, local)
    yield from _array(f"{where}multiplier", moment.multiplier, local)
    if not (math.isfinite(moment.time) and moment.time >= evolution.start):
        yield f"its time is {moment.time:g}"
    if not _count(moment.index):
        yield f"it has {moment.index!r} steps"
    if len(moment.branches) != len(discrete.branches):
        yield f"it has {len(moment.branches)} branches of the material, not {len(discrete.branches)}"
    for number, branch in enumerate(moment.branches):
        yield from _array(f"{where}branch.{number}", branch, whole)
    yield from _memory(moment.memory, initial_memory(discrete, acting.law, np.zeros(local)))


def _history(last: LastStep, moment: TimeState, advance: TimeStepper) -> Iterator[str]:
    """What is wrong with what is known of the last step."""
    if last.force is not None:
        yield from _array("history.force", last.force, (advance.discrete.unknowns,))
    yield from _array("history.multiplier", last.multiplier, moment.multiplier.shape)
    if not 0.0 < last.step < math.inf:
        yield f"the step before it is {last.step:g}"
    for name, rates, shape in (
        ("body", last.body, moment.body.velocity.shape), ("local", last.local, moment.multiplier.shape)
    ):  # fmt: skip
        if (rates is None) == advance.scheme.multistep:
            yield "it lacks the rates of the last step, or has them where the scheme asks for none"
        for part in () if rates is None else RATES:
            yield from _array(f"history.{name}.{part}", getattr(rates, part), shape)


def _memory(found: Mapping[str, Mapping[str, Array]], first: Mapping[str, Mapping[str, Array]]) -> Iterator[str]:
    if {name: set(states) for name, states in found.items()} != {name: set(states) for name, states in first.items()}:
        yield "its contact points remember other quantities"
        return
    for boundary, states in first.items():
        for name, values in states.items():
            yield from _array(f"{name} of {boundary}", found[boundary][name], np.shape(values))


def _rows(rows: Sequence[Row], advance: TimeStepper, moment: TimeState, columns: Sequence[str]) -> Iterator[str]:
    times = [row.time for row in rows]
    if not rows or times[0] != advance.discrete.evolution.start or times[-1] != moment.time:
        yield "its table does not begin and end with the evolution"
    if not all(first < second for first, second in itertools.pairwise(times)):
        yield "the times of its table do not increase"
    if any(tuple(row.values) != tuple(columns) for row in rows):
        yield "its table has other columns"


def _frames(frames: Sequence[Frame], times: set[float], advance: TimeStepper, moment: TimeState) -> Iterator[str]:
    if not frames:
        yield "it has no frames"
    nodes, local = advance.discrete.full(moment.body.displacement).shape, moment.local.displacement.shape
    before, remembered = -math.inf, {name for states in moment.memory.values() for name in states}
    for frame in frames:
        if frame.time not in times or frame.time <= before:
            yield "the times of its frames are none of its table, or do not increase"
        before = frame.time
        yield from _array("displacement of a frame", frame.displacement, nodes)
        yield from _array("velocity of a frame", frame.velocity, nodes)
        if not math.isfinite(frame.force_time):
            yield f"the forces of a frame belong to the time {frame.force_time:g}"
        for name in _AT_CONTACT:
            yield from _array(f"{name} of a frame", getattr(frame, name), local)
        if set(frame.memory) != remembered or any(values.shape[:1] != local[:1] for values in frame.memory.values()):
            yield "the contact points of a frame remember other quantities"
        if (frame.temperature is None) != (moment.heat is None):
            yield "a frame has a temperature where the evolution has none, or none where it has"
        if frame.temperature is not None:
            yield from _array("temperature of a frame", frame.temperature, nodes[:1])


def _motion(name: str, motion: Kinematics, shape: tuple[int, ...]) -> Iterator[str]:
    for part in MOTION:
        yield from _array(f"{name}.{part}", getattr(motion, part), shape)


def _array(name: str, array: Array, shape: tuple[int, ...]) -> Iterator[str]:
    if array.shape != shape:
        yield f"{name} has shape {array.shape}, not {shape}"
    elif not np.isfinite(array).all():
        yield f"{name} has entries that are not finite"


def _count(value: object) -> bool:
    """Whether a value is a whole number of at least 0."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0
