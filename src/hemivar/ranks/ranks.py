"""The ranks of a run (MPI communicator): counted exchanges and reductions, and errors that all ranks share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from hemivar.basics.arrays import PLAIN_SQUARES
from hemivar.basics.disk import shown
from hemivar.basics.types import Array, IntArray
from hemivar.errors import HemivarError, ProblemError

if TYPE_CHECKING:
    from mpi4py import MPI
    from petsc4py import PETSc

__all__ = ["NO_MEMORY", "Ranks", "shared", "world"]

T = TypeVar("T")

#: Rows of numbers of one type.
Rows = TypeVar("Rows", Array, IntArray)

#: What is said where the memory does not suffice.
NO_MEMORY = "not enough memory for this problem; take more ranks on more machines, or fewer cells"


@dataclass(frozen=True, eq=False)
class Ranks:
    """All ranks that work on a problem, with a count of what they tell each other outside PETSc.

    Attributes
    ----------
    comm : petsc4py communicator
    mpi : mpi4py communicator
        Of the same ranks.
    counts : dict
        ``reductions`` (of a few numbers), ``exchanges`` (each rank with its neighbours) and ``bytes`` sent in these.
    """

    comm: PETSc.Comm
    mpi: MPI.Comm
    counts: dict[str, int] = field(default_factory=lambda: {"reductions": 0, "exchanges": 0, "bytes": 0})

    @property
    def rank(self) -> int:
        """Number of this rank."""
        return int(self.mpi.rank)

    @property
    def size(self) -> int:
        """Number of ranks."""
        return int(self.mpi.size)

    @property
    def alone(self) -> bool:
        """Whether there is no other rank."""
        return self.size == 1

    def total(self, *values: float | np.integer) -> Array:
        """Sums over the ranks, all in one reduction."""
        from mpi4py import MPI

        return self._reduce(values, MPI.SUM)

    def largest(self, *values: float) -> Array:
        """Maxima over the ranks, all in one reduction; nan counts as infinity, for comparisons would lose it."""
        from mpi4py import MPI

        return self._reduce([np.inf if np.isnan(value) else value for value in values], MPI.MAX)

    def norms(self, *vectors: Array) -> Array:
        """Euclidean norms of arrays of which each rank has a part, without overflow or underflow on the way.

        They are not finite only where an entry is not, or the norm itself is too large for a number.
        """
        vectors = tuple(v.ravel() for v in vectors)
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            squares = self.total(*(float(v @ v) for v in vectors))
            if ((squares > PLAIN_SQUARES[0]) & (squares < PLAIN_SQUARES[1])).all():
                return np.asarray(np.sqrt(squares))
            # all ranks have the same sums, and so come here together
            sizes = self.largest(*(float(np.abs(v).max(initial=0.0)) for v in vectors))
            scales = np.where((sizes > 0.0) & (sizes < np.inf), np.ldexp(1.0, np.frexp(sizes)[1] - 1), 1.0)
            scaled = [v / scale for v, scale in zip(vectors, scales, strict=True)]
            norms = scales * np.sqrt(self.total(*(float(v @ v) for v in scaled)))
        return np.asarray(np.where(sizes < np.inf, norms, np.inf))

    def lowest(self, value: float) -> tuple[float, bool]:
        """The lowest number of all ranks, and whether it is that of this one; of equals the first."""
        number, who = min(self.mpi.allgather((value, self.rank)))
        return float(number), bool(who == self.rank)

    def named(self, names: Iterable[str]) -> tuple[str, ...]:
        """The names that any rank knows, in alphabetical order."""
        return tuple(sorted({name for known in self.mpi.allgather(tuple(names)) for name in known}))

    def before(self, count: int) -> int:
        """How many of something the ranks before this one have."""
        return self.offset(count)[0]

    def _reduce(self, values: Sequence[float | np.integer] | Array, operation: MPI.Op) -> Array:
        self.counts["reductions"] += 1
        mine: Array = np.asarray(values, dtype=float)
        out: Array = np.empty(len(values))
        self.mpi.Allreduce(mine, out, op=operation)
        return out

    def neighbours(self) -> int:
        """How many ranks run on the machine of this one, itself included."""
        from mpi4py import MPI

        here = self.mpi.Split_type(MPI.COMM_TYPE_SHARED)
        count = int(here.size)
        here.Free()
        return count

    def offset(self, count: int) -> tuple[int, int]:
        """How many of something the ranks before this one have, and all together."""
        counts = np.array(self.mpi.allgather(count), dtype=np.int64)
        return int(counts[: self.rank].sum()), int(counts.sum())

    def exchange(self, destination: IntArray, rows: Rows) -> tuple[Rows, IntArray, Exchange]:
        """Send each row to a rank: the rows received, ordered by rank, where they came from, and the way back.

        Parameters
        ----------
        destination : int array (k,)
        rows : array (k, c)
            Of one type on all ranks.
        """
        packed = np.ascontiguousarray(rows)
        order = np.argsort(destination, kind="stable")
        sent = np.bincount(destination, minlength=self.size).astype(np.int64)
        received = np.empty_like(sent)
        self.mpi.Alltoall(sent, received)
        back = Exchange(self, order, sent, received)
        out = self._transfer(packed[order], sent, received)
        return out, np.repeat(np.arange(self.size), received), back

    def _transfer(self, rows: Rows, sent: IntArray, received: IntArray) -> Rows:
        width = int(np.prod(rows.shape[1:], dtype=np.int64)) * rows.itemsize
        out = np.empty((int(received.sum()), *rows.shape[1:]), dtype=rows.dtype)
        elsewhere = int(sent.sum() - sent[self.rank])
        self.counts["exchanges"] += 1
        self.counts["bytes"] += elsewhere * width
        kind = _row_type(width)
        self.mpi.Alltoallv([rows, (sent, _starts(sent)), kind], [out, (received, _starts(received)), kind])
        if width:
            kind.Free()
        return out

    def agree(self, work: Callable[[], T]) -> T:
        """What ``work``, which must not communicate, returns; if it is refused on one rank, the same error on all.

        Raises
        ------
        HemivarError
            The error of the lowest rank that has one.
        """
        result: T | None = None
        complaint: tuple[type[HemivarError], str] | None = None
        try:
            result = work()
        except HemivarError as error:
            complaint = type(error), str(error)
        except OSError as error:
            named = f"{shown(error.filename)}: " if error.filename else ""
            complaint = ProblemError, f"{named}{error.strerror or error}; check path and disk"
        except MemoryError:
            complaint = ProblemError, NO_MEMORY
        first = next((entry for entry in self.mpi.allgather(complaint) if entry is not None), None)
        if first is not None:
            raise shared(first[0](first[1]))
        return result  # type: ignore[return-value]


@dataclass(frozen=True, eq=False)
class Exchange:
    """The way back of an exchange."""

    ranks: Ranks
    order: IntArray
    sent: IntArray
    received: IntArray

    def answer(self, rows: Rows) -> Rows:
        """Send one row back for each row received; returns the answers in the order of the rows that were sent."""
        back = self.ranks._transfer(np.ascontiguousarray(rows), self.received, self.sent)
        out = np.empty_like(back)
        out[self.order] = back
        return out


def _starts(counts: IntArray) -> IntArray:
    return np.concatenate([[0], np.cumsum(counts)[:-1]])


def _row_type(width: int) -> MPI.Datatype:
    from mpi4py import MPI

    return MPI.BYTE.Create_contiguous(width).Commit() if width else MPI.BYTE


def shared(error: HemivarError) -> HemivarError:
    """The error, marked as one that all ranks have."""
    error.shared = True  # type: ignore[attr-defined]
    return error


def world() -> Ranks:
    """All ranks of this run.

    Raises
    ------
    ProblemError
        petsc4py or mpi4py is not installed.
    """
    try:
        from mpi4py import MPI
        from petsc4py import PETSc
    except ImportError as error:
        raise ProblemError(
            f"the engine 'petsc' needs petsc4py and mpi4py ({error}); see docs/distributed.md for how to install them"
        ) from None
    if np.issubdtype(PETSc.ScalarType, np.complexfloating):
        raise ProblemError("this PETSc computes with complex numbers; take a build with real ones (PETSC_DIR)")
    return Ranks(PETSc.COMM_WORLD, MPI.COMM_WORLD)
