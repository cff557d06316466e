"""Checkpoints: a march in a file, to go on from as if it had never stopped."""

from __future__ import annotations

import json
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
from hemivar.evolution.heat_balance import ThermalState
from hemivar.evolution.history import Frame, Row
from hemivar.evolution.state import TimeState
from hemivar.evolution.steps import StepSizeState

__all__ = ["MOTION", "RATES", "Checkpoint", "MarchState"]

#: What is kept of a motion; its products with the matrices are computed again, to the last bit. And of mean rates.
MOTION = ("displacement", "velocity", "acceleration")
RATES = ("velocity", "acceleration")

_FORMAT = 9
_LARGEST = 1 << 36
_ARRAY = "array "
#: Numbers of a row beside the values of the columns, in their order; and a name that annotations have.
_OF_ROWS = ("time", "step", "solver_steps", "residual", "margin", "largest_step", "jumped")
_NAMES = {"ThermalState": ThermalState}


@dataclass(frozen=True, eq=False)
class MarchState:
    """All that a march needs to go on."""

    moment: TimeState
    pace: StepSizeState
    rows: tuple[Row, ...]
    frames: tuple[Frame, ...]
    #: Moments offered so far, and which of them are kept.
    frame_place: tuple[int, int]
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

    def write(self, state: MarchState, identity: str) -> None:
        """Write a march."""
        with disk.whole_file(self.file) as path, open(path, "wb") as stream:
            self.pack(stream, state, identity)

    def pack(self, stream: IO[bytes], state: MarchState, identity: str) -> None:
        """Write a march to a stream."""
        arrays: list[AnyArray] = []
        head = {"format": _FORMAT, "identity": identity, "state": encoded(_Kept.of(state), arrays)}
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
            found, sound = read_arrays(data)
            head = json.loads(found.pop("head").tobytes().decode())
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
            arrays = [found[f"{_ARRAY}{number_}"] for number_ in range(len(found))]
            return decoded(_Kept, head["state"], arrays, _NAMES).whole()
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
