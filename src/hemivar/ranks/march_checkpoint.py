"""Checkpoints of a march over ranks: one file with the part of every rank, for the same number of ranks."""

from __future__ import annotations

import io
import json
from contextlib import ExitStack
from dataclasses import dataclass
from typing import IO

import numpy as np

from hemivar.basics.disk import shown
from hemivar.basics.types import Record
from hemivar.errors import FileError
from hemivar.evolution import Checkpoint
from hemivar.evolution.march_state import MarchState
from hemivar.ranks.files import LONGEST_LINE, one_writer, read_rows, write_rows
from hemivar.ranks.ranks import Ranks

__all__ = ["CheckpointOnRanks"]

_KIND, _FORMAT = "hemivar march over ranks", 1


@dataclass(frozen=True)
class CheckpointOnRanks(Checkpoint):
    """A file that a march over ranks is kept in: a line of JSON, then what a serial checkpoint has, for every rank."""

    ranks: Ranks = None  # type: ignore[assignment]

    def write(self, state: MarchState, identity: str) -> None:
        """Write a march; all ranks call this."""
        stream = io.BytesIO()
        self.pack(stream, state, identity)
        data = stream.getvalue()
        sizes = self.ranks.mpi.gather(len(data))
        head = {"kind": _KIND, "format": _FORMAT, "ranks": self.ranks.size, "bytes": sizes}
        with one_writer(self.ranks, self.file) as file:
            file.write(json.dumps(head) + "\n")
            write_rows(self.ranks, file, np.frombuffer(data + bytes(-len(data) % 8), dtype="<f8"))

    def read(self, identity: str) -> MarchState | None:
        """The march in the file, None if there is no file; all ranks call this."""
        ranks = self.ranks
        with ExitStack() as stack:
            opened = ranks.agree(lambda: self._opened(stack) if ranks.rank == 0 else None)
            sizes = ranks.mpi.bcast(None if opened is None else opened[1])
            if sizes is None:
                return None
            size = sizes[ranks.rank]
            numbers = read_rows(ranks, None if opened is None else opened[0], -(-size // 8))
        return ranks.agree(lambda: self.unpack(numbers.astype("<f8").tobytes()[:size], identity))

    def _opened(self, stack: ExitStack) -> tuple[IO[bytes], list[int]] | None:
        """The file behind its first line, and the bytes of every rank."""
        if not self.file.exists():
            return None
        name = shown(self.file)
        try:
            stream = stack.enter_context(self.file.open("rb"))
            head: Record = json.loads(stream.readline(LONGEST_LINE))
            kind, version, count, sizes = (head[key] for key in ("kind", "format", "ranks", "bytes"))
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise FileError(f"{name}: this is not a checkpoint of a run over ranks ({error}); name another") from None
        if kind != _KIND or version != _FORMAT:
            raise FileError(f"{name}: this is not a checkpoint of a run over ranks of this version; name another file")
        if count != self.ranks.size:
            raise FileError(
                f"{name}: the checkpoint was written on {count} ranks, these are {self.ranks.size}; continue with "
                f"mpirun -n {count}, or start again without resume"
            )
        if not (isinstance(sizes, list) and len(sizes) == count and all(type(size) is int for size in sizes)):
            raise FileError(f"{name}: the first line of the checkpoint is damaged; start again without resume")
        return stream, sizes
