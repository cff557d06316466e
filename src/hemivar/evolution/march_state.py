"""Checkpoints: a march in a file, to go on from as if it had never stopped."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO

import numpy as np

from hemivar.basics import disk
from hemivar.basics.arguments import number
from hemivar.basics.codec import decoded, encoded
from hemivar.basics.packed import read_arrays, write_arrays
from hemivar.basics.stated import Form, stated
from hemivar.basics.types import AnyArray, Array
from hemivar.errors import FileError, ProblemError
from hemivar.evolution.digest import differences
from hemivar.evolution.history import Frame, Row
from hemivar.evolution.state import Kinematics, LastStep, TimeState
from hemivar.evolution.step_laws import initial_memory
from hemivar.evolution.stepper import TimeStepper
from hemivar.evolution.steps import StepSizeController, StepSizeState

__all__ = ["MOTION", "RATES", "Checkpoint", "MarchState", "misfit"]

_AT_CONTACT = ("local", "multiplier", "rate")
#: What is kept of a motion; its products with the matrices are computed again, to the last bit. And of mean rates.
MOTION = ("displacement", "velocity", "acceleration")
RATES = ("velocity", "acceleration")
#: Number of the format of checkpoints: raised where their keys, the names of fields, change.
_FORMAT = 10
_ARRAY = "array "
#: Numbers of a row beside the values of the columns, in their order.
_OF_ROWS = ("time", "step", "solver_steps", "residual", "margin", "largest_step", "jumped")


@dataclass(frozen=True, eq=False)
class MarchState:
    """All that a march needs to go on."""

    state: TimeState
    pace: StepSizeState
    rows: tuple[Row, ...]
    frames: tuple[Frame, ...]
    #: States offered so far, and which of them are kept.
    frame_counters: tuple[int, int]
    events: tuple[tuple[float, str], ...]  # (time, name)
    messages: tuple[str, ...]
    #: Largest size that errors of steps were held against.
    largest: float
    #: Largest displacement since the start that they were held against.
    farthest: float
    #: Where the body was at the start.
    origin: Array  # (n + k,)
    #: Square of the bound of the error in time so far; nan where there is none.
    bound: float
    #: Whether loads were straight lines in every step so far, as the bound asks.
    straight: bool


@dataclass(frozen=True)
class Checkpoint:
    """A file that a march is kept in.

    It carries a digest of its content, against damage. The digest does not protect against forgery.

    Parameters
    ----------
    file : Path
        Written beside its place and then renamed: it is always whole.
    minutes : float
        Least time between two writings; 0 writes after every step. It is written at the end as well.
    """

    file: Path = field(metadata=stated(Form.FILE))
    minutes: float = field(default=10.0, metadata=stated(Form.NUMBER, least=0.0))

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", disk.path_of(self.file))
        if not number(self.minutes, "minutes of Checkpoint", "give a time >= 0") >= 0.0:
            raise ProblemError(f"Checkpoint(minutes={self.minutes:g}): give a time >= 0")

    def write(self, march: MarchState, identity: str) -> None:
        """Write a march."""
        with disk.whole_file(self.file) as path, open(path, "wb") as stream:
            self.pack(stream, march, identity)

    def pack(self, stream: IO[bytes], march: MarchState, identity: str) -> None:
        """Write a march to a stream."""
        arrays: list[AnyArray] = []
        head = {"format": _FORMAT, "identity": identity, "state": encoded(_Kept.of(march), arrays)}
        written = {f"{_ARRAY}{number_}": array for number_, array in enumerate(arrays)}
        write_arrays(stream, {"head": np.frombuffer(json.dumps(head).encode(), dtype=np.uint8), **written})

    def read(self, identity: str) -> MarchState | None:
        """The march in the file; None if there is no file.

        Raises
        ------
        FileError
            The file is no checkpoint, or that of another evolution or version.
        """
        if not self.file.exists():
            return None
        return self.unpack(disk.read_bytes(self.file, "checkpoint", 64 * 2**30), identity)

    def unpack(self, data: bytes, identity: str) -> MarchState:
        """The march that was packed.

        Raises
        ------
        FileError
            As :meth:`read`.
        """
        shown = disk.shown(self.file)
        try:
            entries, sound = read_arrays(data)
            head = json.loads(entries.pop("head").tobytes().decode())
            version, owner = head["format"], head["identity"]
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise FileError(
                f"{shown}: this is not a checkpoint of a run in time ({error}); name another file"
            ) from None
        if version != _FORMAT:
            raise FileError(
                f"{shown}: the checkpoint has format {version}, this version reads {_FORMAT}; continue with the "
                f"version that wrote it, or start again without resume"
            )
        if not sound:
            raise FileError(
                f"{shown}: the checkpoint is damaged, its content does not match its digest; take a copy of it, or "
                "start again without resume"
            )
        if owner != identity:
            raise FileError(
                f"{shown}: the checkpoint belongs to another {differences(owner, identity)}; name its own file, or "
                "start again without resume"
            )
        try:
            arrays = [entries[f"{_ARRAY}{number_}"] for number_ in range(len(entries))]
            return decoded(_Kept, head["state"], arrays).whole()
        except (ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError) as error:
            raise self.unfit(f"{type(error).__name__} at {error}") from None

    def unfit(self, why: str) -> FileError:
        """The error of a file whose content makes no sense."""
        return FileError(f"{disk.shown(self.file)}: the checkpoint cannot be used ({why}); start again without resume")


@dataclass(frozen=True, eq=False)
class _Kept:
    """A march as a file has it: the rows of its table stand in two arrays."""

    march: MarchState  # without rows
    columns: tuple[str, ...]
    values: Array  # (rows, columns)
    own: Array  # (rows, 7)

    @staticmethod
    def of(march: MarchState) -> _Kept:
        own = np.array([[getattr(row, name) for name in _OF_ROWS] for row in march.rows], dtype=float)
        values = np.array([list(row.values.values()) for row in march.rows], dtype=float)
        return _Kept(replace(march, rows=()), tuple(march.rows[0].values), values, own)

    def whole(self) -> MarchState:
        """The march with its rows."""
        rows = []
        for own, values in zip(self.own.tolist(), self.values.tolist(), strict=True):
            time, step, solver_steps, residual, margin, largest, jumped = own
            named = dict(zip(self.columns, values, strict=True))
            rows.append(Row(time, step, int(solver_steps), residual, margin, largest, named, bool(jumped)))
        return replace(self.march, rows=tuple(rows))


def misfit(march: MarchState, stepper: TimeStepper, stepping: StepSizeController, columns: Sequence[str]) -> str:
    """What is wrong with a state that was read: shapes, numbers that are not finite, times and counters.

    Empty if nothing is.
    """
    return next(_wrong(march, stepper, stepping, columns), "")


def _wrong(
    march: MarchState, stepper: TimeStepper, stepping: StepSizeController, columns: Sequence[str]
) -> Iterator[str]:
    yield from _state(march.state, stepper, "")
    state = march.state
    if state.heat is not None and stepper.beside is not None:
        yield from _state(state.heat.state, stepper.beside, "heat.")
        if not (_count(state.heat.rounds) and math.isfinite(state.heat.contraction)):
            yield "the iterations of its heat are not numbers"
    if (state.heat is None) != (stepper.beside is None):
        yield "it has heat where the evolution has none, or none where it has"
    if state.shown is not None:
        yield from _array("shown.multiplier", state.shown.multiplier, state.multiplier.shape)
        if not math.isfinite(state.shown.time):
            yield f"its forces belong to the time {state.shown.time:g}"
    if state.history is not None:
        yield from _history(state.history, state, stepper)
    yield from _array("origin", march.origin, state.body.displacement.shape)
    if not (stepping.knows(march.pace) and state.time + march.pace.step > state.time):
        yield f"its step, {march.pace.step:g}, does not belong to this step control"
    for name in ("largest", "farthest"):
        if not 0.0 <= getattr(march, name) < math.inf:
            yield f"{name} is {getattr(march, name):g}"
    if not (math.isnan(march.bound) or march.bound >= 0.0):
        yield f"its bound of the error in time is {march.bound:g}"
    offered, stride = march.frame_counters
    if not (_count(offered) and _count(stride) and stride):
        yield "its frame counters are not whole numbers"
    if not all(isinstance(name, str) and math.isfinite(time) for time, name in march.events):
        yield "its events are not times and names"
    if not all(isinstance(message, str) for message in march.messages):
        yield "its messages are not texts"
    yield from _rows(march.rows, stepper, state, columns)
    yield from _frames(march.frames, {row.time for row in march.rows}, stepper, state)


def _state(state: TimeState, stepper: TimeStepper, where: str) -> Iterator[str]:
    """What is wrong with the state of a body, or of its heat."""
    discrete, evolution = stepper.discrete, stepper.discrete.evolution
    acting = stepper.data.at(evolution.start)
    whole, local = (discrete.unknowns + len(discrete.moved),), acting.offset.shape
    yield from _motion(f"{where}body", state.body, whole)
    yield from _motion(f"{where}local", state.local, local)
    yield from _array(f"{where}multiplier", state.multiplier, local)
    if not (math.isfinite(state.time) and state.time >= evolution.start):
        yield f"its time is {state.time:g}"
    if not _count(state.index):
        yield f"it has {state.index!r} steps"
    if len(state.branches) != len(discrete.branches):
        yield f"it has {len(state.branches)} branches of the material, not {len(discrete.branches)}"
    for k, branch in enumerate(state.branches):
        yield from _array(f"{where}branch.{k}", branch, whole)
    for name, value in vars(state.control).items() if state.control is not None else ():
        if isinstance(value, np.ndarray):
            yield from _array(f"{where}control.{name}", value, local)
        elif not math.isfinite(value) or (name == "step" and value < 0.0):
            yield f"{where}control.{name} is {value:g}"
    yield from _memory(state.memory, initial_memory(discrete, acting.law, np.zeros(local)))


def _history(last: LastStep, state: TimeState, stepper: TimeStepper) -> Iterator[str]:
    """What is wrong with what is known of the last step."""
    if last.force is not None:
        yield from _array("history.force", last.force, (stepper.discrete.unknowns,))
    yield from _array("history.multiplier", last.multiplier, state.multiplier.shape)
    if not 0.0 < last.step < math.inf:
        yield f"the step before it is {last.step:g}"
    for name, rates, shape in (
        ("body", last.body, state.body.velocity.shape), ("local", last.local, state.multiplier.shape)
    ):  # fmt: skip
        if (rates is None) == stepper.scheme.multistep:
            yield "it lacks the rates of the last step, or has them where the scheme asks for none"
        for part in () if rates is None else RATES:
            yield from _array(f"history.{name}.{part}", getattr(rates, part), shape)


def _memory(memory: Mapping[str, Mapping[str, Array]], first: Mapping[str, Mapping[str, Array]]) -> Iterator[str]:
    if {name: set(states) for name, states in memory.items()} != {name: set(states) for name, states in first.items()}:
        yield "its contact points remember other quantities"
        return
    for boundary, states in first.items():
        for name, values in states.items():
            yield from _array(f"{name} of {boundary}", memory[boundary][name], np.shape(values))


def _rows(rows: Sequence[Row], stepper: TimeStepper, state: TimeState, columns: Sequence[str]) -> Iterator[str]:
    times = [row.time for row in rows]
    if not rows or times[0] != stepper.discrete.evolution.start or times[-1] != state.time:
        yield "its table does not begin and end with the evolution"
    if not all(first < second for first, second in itertools.pairwise(times)):
        yield "the times of its table do not increase"
    if any(tuple(row.values) != tuple(columns) for row in rows):
        yield "its table has other columns"


def _frames(frames: Sequence[Frame], times: set[float], stepper: TimeStepper, state: TimeState) -> Iterator[str]:
    if not frames:
        yield "it has no frames"
    nodes, local = stepper.discrete.full(state.body.displacement).shape, state.local.displacement.shape
    before, remembered = -math.inf, {name for states in state.memory.values() for name in states}
    for frame in frames:
        if frame.time not in times or frame.time <= before:
            yield "the times of its frames are not in its table, or do not increase"
        before = frame.time
        yield from _array("displacement of a frame", frame.displacement, nodes)
        yield from _array("velocity of a frame", frame.velocity, nodes)
        if not math.isfinite(frame.force_time):
            yield f"the forces of a frame belong to the time {frame.force_time:g}"
        for name in _AT_CONTACT:
            yield from _array(f"{name} of a frame", getattr(frame, name), local)
        if set(frame.memory) != remembered or any(values.shape[:1] != local[:1] for values in frame.memory.values()):
            yield "the contact points of a frame remember other quantities"
        if (frame.temperature is None) != (state.heat is None):
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
