"""Gather and scatter: files that rank 0 writes and reads while all ranks send and receive, and share its errors."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO

import numpy as np

from hemivar.basics.disk import whole_file
from hemivar.basics.types import Array
from hemivar.errors import FileError
from hemivar.ranks.ranks import Ranks

__all__ = ["LONGEST_LINE", "RankZeroFile", "one_writer", "read_rows", "write_rows"]

#: Bytes of the first line of a checkpoint that are read: what is no checkpoint may have no end of a line.
LONGEST_LINE = 1 << 26
#: Numbers that travel at a time, 8 MiB of them.
_ROWS = 1 << 20
#: By which messages of files are known; any number that no other message has.
_TAG = 77


class RankZeroFile:
    """Where rank 0 writes; an error is kept for the end, for the other ranks go on sending."""

    def __init__(self, stream: IO[bytes] | None) -> None:
        self._stream = stream
        self.error: OSError | None = None

    @property
    def open(self) -> bool:
        """Whether it is of use to write."""
        return self._stream is not None and self.error is None

    def write(self, data: bytes | str) -> None:
        """Write on rank 0, as long as that goes well; elsewhere nothing happens."""
        if self._stream is None or self.error is not None:
            return
        try:
            self._stream.write(data.encode() if isinstance(data, str) else data)
        except OSError as error:
            self.error = error


@contextmanager
def one_writer(ranks: Ranks, path: Path) -> Iterator[RankZeroFile]:
    """A file that rank 0 writes whole or not at all, see :func:`.whole_file`.  All ranks call this."""
    stack, file, refused = ExitStack(), RankZeroFile(None), None
    if ranks.rank == 0:
        try:
            name = stack.enter_context(whole_file(path))
            try:
                file = RankZeroFile(stack.enter_context(name.open("wb")))
            except OSError as error:
                file.error = error
        except FileError as error:
            refused = error

    def finish() -> None:
        if refused is not None:
            raise refused
        with stack:
            if file.error is not None:
                raise file.error

    try:
        yield file
    except BaseException:
        stack.__exit__(*sys.exc_info())
        raise
    ranks.agree(finish)


def write_rows(ranks: Ranks, file: RankZeroFile, values: Array) -> None:
    """Write the numbers that the ranks hold one after the other, 64 bits each, little end first."""
    counts = ranks.mpi.gather(len(values))
    if ranks.rank:
        for start in range(0, len(values), _ROWS):
            ranks.mpi.Send(np.ascontiguousarray(values[start : start + _ROWS]), dest=0, tag=_TAG)
        return
    file.write(values.astype("<f8").tobytes())
    buffer = np.empty(_ROWS)
    for rank in range(1, ranks.size):
        for start in range(0, counts[rank], _ROWS):
            part = buffer[: min(_ROWS, counts[rank] - start)]
            ranks.mpi.Recv(part, source=rank, tag=_TAG)
            file.write(part.astype("<f8").tobytes())


def read_rows(ranks: Ranks, stream: IO[bytes] | None, count: int) -> Array:
    """The contrary of :func:`write_rows`: ``count`` numbers for this rank; nan where the file ends too early."""
    counts: list[int] = ranks.mpi.gather(count)
    if ranks.rank:
        out = np.empty(count)
        for start in range(0, count, _ROWS):
            ranks.mpi.Recv(out[start : start + _ROWS], source=0, tag=_TAG)
        return out

    def numbers(size: int) -> Array:
        out = np.full(size, np.nan)
        try:
            data = b"" if stream is None else stream.read(8 * size)
        except OSError:
            data = b""
        part = np.frombuffer(data[: len(data) // 8 * 8], dtype="<f8")
        out[: len(part)] = part
        return out

    mine = numbers(count)
    for rank in range(1, ranks.size):
        for start in range(0, counts[rank], _ROWS):
            ranks.mpi.Send(numbers(min(_ROWS, counts[rank] - start)), dest=rank, tag=_TAG)
    return mine
