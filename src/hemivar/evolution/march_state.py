"""Checkpoints: a march in a file, to go on from as if it had never stopped."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from hemivar.basics import disk
from hemivar.basics.arguments import number
from hemivar.basics.packed import read_arrays, write_arrays
from hemivar.basics.stated import Form, stated
from hemivar.basics.types import Array
from hemivar.errors import FileError, ProblemError
from hemivar.evolution.digest import differences
from hemivar.evolution.energy_balance import EnergyBalance
from hemivar.evolution.heat_balance import HeatBalance, ThermalState
from hemivar.evolution.history import Frame, Row
from hemivar.evolution.state import Kinematics, LastStep, Rates, TimeState
from hemivar.evolution.steps import StepSizeState

__all__ = ["MOTION", "RATES", "Checkpoint", "MarchState"]

#: What is kept of a motion; its products with the matrices are computed again, to the last bit. And of mean rates.
MOTION = ("displacement", "velocity", "acceleration")
RATES = ("velocity", "acceleration")

_FORMAT = 7
_LARGEST = 1 << 36


@dataclass(frozen=True, eq=False)
class MarchState:
    """All that a march needs to go on.

    Attributes
    ----------
    moment : TimeState
    pace : StepSizeState
    rows : tuple of Row
    frames : tuple of Frame
    frame_place : pair of int
        Moments offered so far, and which of them are kept.
    events : tuple of (time, name)
    messages : tuple of str
    largest : float
        Largest size that errors of steps were held against.
    farthest : float
        Largest displacement since the start that they were held against.
    origin : array (n + k,)
        Where the body was at the start.
    bound : float
        Square of the bound of the error in time so far; nan where there is none.
    straight : bool
        Whether loads were straight lines in every step so far, as the bound asks.
    """

    moment: TimeState
    pace: StepSizeState
    rows: tuple[Row, ...]
    frames: tuple[Frame, ...]
    frame_place: tuple[int, int]
    events: tuple[tuple[float, str], ...]
    messages: tuple[str, ...]
    largest: float
    farthest: float
    origin: Array
    bound: float
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

    def write(self, state: MarchState, identity: str) -> None:
        """Write a march."""
        with disk.whole_file(self.file) as path, open(path, "wb") as stream:
            self.pack(stream, state, identity)

    def pack(self, stream: IO[bytes], state: MarchState, identity: str) -> None:
        """Write a march to a stream."""
        moment = state.moment
        arrays: dict[str, Array] = {
            "multiplier": moment.multiplier,
            "origin": state.origin,
            "rows": np.array([list(row.values.values()) for row in state.rows]),
            "own": np.array(
                [
                    [row.time, row.step, row.solver_steps, row.residual, row.margin, row.largest_step, row.jumped]
                    for row in state.rows
                ]
            ),
        }
        arrays |= _parts({"body": moment.body, "local": moment.local}, MOTION)
        for k, branch in enumerate(moment.branches):
            arrays[f"branch.{k}"] = branch
        last = moment.history
        if last is not None:
            arrays |= _parts({"history": last}, ("force", "multiplier"))
            arrays |= _parts({"history.body": last.body, "history.local": last.local}, RATES)
        if moment.heat is not None:
            warm = moment.heat.moment
            arrays["heat.multiplier"] = warm.multiplier
            arrays |= _parts({"heat.body": warm.body, "heat.local": warm.local}, MOTION)
        memory = []
        for number_, (boundary, states) in enumerate(moment.memory.items()):
            memory.append([boundary, list(states)])
            for name, values in states.items():
                arrays[f"memory.{number_}.{name}"] = np.asarray(values)
        for k, frame in enumerate(state.frames):
            for name in _FRAME:
                arrays[f"frame.{k}.{name}"] = getattr(frame, name)
            if frame.temperature is not None:
                arrays[f"frame.{k}.temperature"] = frame.temperature
            for name, values in frame.memory.items():
                arrays[f"frame.{k}.memory.{name}"] = values
        head = {
            "format": _FORMAT,
            "identity": identity,
            "time": float(moment.time).hex(),
            "index": moment.index,
            "ledger": _hex(moment.ledger),
            "history": None if last is None else float(last.step).hex(),
            "heat": None if moment.heat is None else _heat_head(moment.heat),
            "pace": [float(state.pace.step).hex(), state.pace.rung, state.pace.waiting],
            "columns": list(state.rows[0].values),
            "frames": [[float(frame.time).hex(), list(frame.memory)] for frame in state.frames],
            "frame_place": list(state.frame_place),
            "branches": len(moment.branches),
            "memory": memory,
            "events": [[float(time).hex(), name] for time, name in state.events],
            "messages": list(state.messages),
            "largest": float(state.largest).hex(),
            "farthest": float(state.farthest).hex(),
            "bound": float(state.bound).hex(),
            "straight": state.straight,
        }
        write_arrays(stream, {"head": np.frombuffer(json.dumps(head).encode(), dtype=np.uint8), **arrays})

    def read(self, identity: str) -> MarchState | None:
        """The march in the file; None if there is no file.

        Raises
        ------
        FileError
            The file is no checkpoint, or that of another evolution or version.
        """
        if not self.file.exists():
            return None
        return self.unpack(disk.read_bytes(self.file, "checkpoint", _LARGEST), identity)

    def unpack(self, data: bytes, identity: str) -> MarchState:
        """The march that was packed.

        Raises
        ------
        FileError
            As :meth:`read`.
        """
        shown = disk.shown(self.file)
        try:
            arrays, sound = read_arrays(data)
            head = json.loads(arrays.pop("head").tobytes().decode())
            version, owner = head["format"], head["identity"]
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise FileError(
                f"{shown}: this is not a checkpoint of a run in time ({error}); name another file"
            ) from None
        if version != _FORMAT:
            raise FileError(
                f"{shown}: the checkpoint has format {version}, this version reads {_FORMAT}; go on with the version "
                "that wrote it, or start again without resume"
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
            return _state(head, arrays)
        except (ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError) as error:
            raise self.unfit(f"{type(error).__name__} at {error}") from None

    def unfit(self, why: str) -> FileError:
        """The error of a file whose content makes no sense."""
        return FileError(f"{disk.shown(self.file)}: the checkpoint cannot be used ({why}); start again without resume")


def _parts(of: Mapping[str, object], names: tuple[str, ...]) -> dict[str, Array]:
    """Arrays by the names of what they are part of and their own, of those that are there."""
    every = ((f"{name}.{part}", getattr(one, part, None)) for name, one in of.items() for part in names)
    return {name: array for name, array in every if array is not None}


def _hex(ledger: EnergyBalance | HeatBalance) -> dict[str, str]:
    return {name: float(value).hex() for name, value in asdict(ledger).items()}


def _heat_head(heat: ThermalState) -> dict[str, object]:
    moment = heat.moment
    return {
        "time": float(moment.time).hex(),
        "index": moment.index,
        "ledger": _hex(moment.ledger),
        "book": _hex(heat.book),
        "rounds": heat.rounds,
        "contraction": float(heat.contraction).hex(),
    }


_FRAME = ("displacement", "velocity", "local", "multiplier", "rate")


def _state(head: Mapping[str, Any], arrays: Mapping[str, Array]) -> MarchState:
    def motion(name: str) -> Kinematics:
        return Kinematics(*(arrays[f"{name}.{part}"] for part in MOTION))

    def numbers(entries: Mapping[str, str]) -> dict[str, float]:
        return {name: float.fromhex(value) for name, value in entries.items()}

    def rates(name: str) -> Rates | None:
        found = (arrays.get(f"{name}.{part}") for part in RATES)
        velocity, acceleration = found
        return None if velocity is None or acceleration is None else Rates(velocity, acceleration)

    memory = {
        boundary: {name: arrays[f"memory.{k}.{name}"] for name in names}
        for k, (boundary, names) in enumerate(head["memory"])
    }
    moment = TimeState(
        float.fromhex(head["time"]),
        head["index"],
        motion("body"),
        motion("local"),
        arrays["multiplier"],
        tuple(arrays[f"branch.{k}"] for k in range(head["branches"])),
        memory,
        EnergyBalance(**numbers(head["ledger"])),
        history=None
        if head["history"] is None
        else LastStep(
            float.fromhex(head["history"]),
            arrays.get("history.force"),
            arrays["history.multiplier"],
            rates("history.body"),
            rates("history.local"),
        ),
    )
    if head["heat"] is not None:
        warm = head["heat"]
        flow = TimeState(
            float.fromhex(warm["time"]), warm["index"], motion("heat.body"), motion("heat.local"),
            arrays["heat.multiplier"], ledger=EnergyBalance(**numbers(warm["ledger"])),
        )  # fmt: skip
        book = HeatBalance(**numbers(warm["book"]))
        moment = replace(moment, heat=ThermalState(flow, book, warm["rounds"], float.fromhex(warm["contraction"])))
    rows = tuple(
        Row(
            own[0], own[1], int(own[2]), own[3], own[4], own[5],
            dict(zip(head["columns"], values, strict=True)), bool(own[6]),
        )
        for own, values in zip(arrays["own"].tolist(), arrays["rows"].tolist(), strict=True)
    )  # fmt: skip
    frames = tuple(
        Frame(
            float.fromhex(time),
            **{name: arrays[f"frame.{k}.{name}"] for name in _FRAME},
            memory={name: arrays[f"frame.{k}.memory.{name}"] for name in names},
            temperature=arrays.get(f"frame.{k}.temperature"),
        )
        for k, (time, names) in enumerate(head["frames"])
    )
    step, rung, waiting = head["pace"]
    return MarchState(
        moment,
        StepSizeState(float.fromhex(step), rung, waiting),
        rows,
        frames,
        (head["frame_place"][0], head["frame_place"][1]),
        tuple((float.fromhex(time), name) for time, name in head["events"]),
        tuple(head["messages"]),
        float.fromhex(head["largest"]),
        float.fromhex(head["farthest"]),
        arrays["origin"],
        float.fromhex(head["bound"]),
        bool(head["straight"]),
    )
