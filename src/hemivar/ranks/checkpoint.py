"""Checkpoints: an iterate in a file, to go on from on the same or another number of ranks.

A checkpoint is one file: a line of JSON with numbers, then the vectors in the order of the nodes of the whole mesh, 64
bits a number, little end first.  Rank 0 writes and reads it; it is replaced as a whole.
"""

from __future__ import annotations

import json
import math
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from hemivar.basics.codec import decoded, encoded
from hemivar.basics.disk import regular_file, shown
from hemivar.basics.types import Array, IntArray, Record
from hemivar.errors import ProblemError
from hemivar.ranks.body_on_ranks import BodyOnRanks
from hemivar.ranks.files import LONGEST_LINE, one_writer, read_rows, write_rows
from hemivar.ranks.preconditioner import Multigrid
from hemivar.ranks.ranks import Ranks, shared
from hemivar.ranks.solve import Saved, depends_on_ranks
from hemivar.solvers import Progress
from hemivar.solvers.base import State
from hemivar.solvers.fixed_point import Outer
from hemivar.solvers.proximal_newton import ProximalMemory
from hemivar.solvers.truncated_newton import NewtonMemory
from hemivar.systems.krylov_newton import KrylovNewton

if TYPE_CHECKING:
    from petsc4py import PETSc

__all__ = ["read_checkpoint", "write_checkpoint"]

#: Version of what stands in a checkpoint; others are refused.
_FORMAT = 4
_LEAST = 1e-300  # of a residual
_LENGTHS = 10.0 ** np.arange(-6, 1)  # of displacements at which laws are compared, in terms of the size of the body

_KNOWN: WeakKeyDictionary[BodyOnRanks, list[float]] = WeakKeyDictionary()


@dataclass(frozen=True)
class _Head:
    """What stands before the vectors."""

    nodes: int
    dim: int
    unknowns: int
    load: float
    marks: tuple[float, ...]
    energy: float
    stiffening: float
    built: bool
    dependent: bool  # whether a bound depends on the solution
    changes: tuple[float, ...]
    history: tuple[Progress, ...]
    sums: tuple[str, ...]

    @property
    def wrong(self) -> str | None:
        """The first entry that cannot be, by name."""
        good = {
            **{name: getattr(self, name) >= 0 for name in ("nodes", "dim", "unknowns")},
            **{name: math.isfinite(getattr(self, name)) for name in ("load", "energy")},
            "stiffening": 0.0 < self.stiffening < math.inf,
            **{name: all(map(math.isfinite, getattr(self, name))) for name in ("marks", "changes")},
            "history": bool(self.history),
        }
        return next((name for name, fits in good.items() if not fits), None)


def write_checkpoint(path: str | Path, body: BodyOnRanks, saved: Saved) -> bool:
    """Write a state; what stood there before stays until all of it is written. All ranks call this.

    Returns
    -------
    bool
        False if the state is not finite; then nothing is written.

    Raises
    ------
    ProblemError
        On all ranks: the file cannot be written.
    """
    path, ranks, state = Path(path), body.ranks, saved.state
    memory: NewtonMemory | ProximalMemory | Outer = state.memory
    factor, energy, built, changes = 1.0, 0.0, False, []
    if isinstance(memory, Outer):
        arrays = [memory.r, *_as_vectors(body, memory.lam)]
        changes = [memory.change, *memory.ratios] if np.isfinite(memory.change) else []
    elif isinstance(memory, ProximalMemory):  # the residual of the first step is what steps are as accurate as
        arrays, factor, energy = [state.r], max(memory.first, _LEAST), float(state.energy or 0.0)
    else:
        assert isinstance(memory.equation, KrylovNewton)
        assert isinstance(memory.equation.matrix, Multigrid)
        linearised_at = memory.equation.matrix.built_at
        factor, energy, built = memory.factor, float(state.energy or 0.0), linearised_at is not None
        arrays = [state.r, memory.force, *([] if linearised_at is None else [linearised_at])]
    naturals = []
    for array in arrays:
        vector, natural = body.vector(array), _natural(body)
        _scatter(body, vector, natural).scatter(vector, natural)
        naturals.append(natural)
    wrong = [float(not np.isfinite(natural.array_r).all()) for natural in naturals]
    if ranks.largest(*wrong, float(not np.isfinite([energy, factor, *changes]).all())).any():
        return False
    head = _Head(
        body.piece.total, body.dim, body.unknowns, body.load_scale.load, tuple(_marks(body)), energy, factor, built,
        isinstance(memory, Outer), tuple(map(float, changes)), saved.history, tuple(_sums(ranks, naturals)),
    )  # fmt: skip
    record = {"format": _FORMAT, "head": encoded(head, [])}
    with one_writer(ranks, path) as file:
        file.write(json.dumps(record, allow_nan=False) + "\n")
        for natural in naturals:
            write_rows(ranks, file, natural.array_r)
            natural.destroy()
    return True


def read_checkpoint(path: str | Path, body: BodyOnRanks) -> Saved:
    """Read a state of the same problem, written on any number of ranks. All ranks call this.

    Raises
    ------
    ProblemError
        On all ranks: the file is missing or damaged, or belongs to another problem.
    """
    from petsc4py import PETSc

    path, ranks = Path(path), body.ranks
    marks, dependent = _marks(body), depends_on_ranks(body)
    with ExitStack() as stack:

        def head() -> tuple[IO[bytes], _Head] | None:
            if ranks.rank:
                return None
            stream = stack.enter_context(_opened(path))
            return stream, _head(path, stream, body, marks, dependent)

        opened = ranks.agree(head)
        stream = None if opened is None else opened[0]
        kept: _Head = ranks.mpi.bcast(None if opened is None else opened[1])
        naturals: list[PETSc.Vec] = []
        arrays: list[Array] = []
        for _ in kept.sums:
            natural, vector = _natural(body), body.vector()
            natural.array_w[:] = read_rows(ranks, stream, natural.getLocalSize())
            _scatter(body, vector, natural).scatter(natural, vector, mode=PETSc.ScatterMode.REVERSE)
            naturals.append(natural)
            arrays.append(vector.array_r.copy())
    sums = _sums(ranks, naturals)
    finite = float(all(np.isfinite(natural.array_r).all() for natural in naturals))
    for natural in naturals:
        natural.destroy()
    if sums != list(kept.sums) or ranks.largest(1.0 - finite)[0]:
        raise shared(ProblemError(f"checkpoint '{shown(path)}' is damaged: numbers in it have changed; start again"))
    with np.errstate(all="ignore"):
        return Saved(_state(body, kept, arrays), kept.history)


def _state(body: BodyOnRanks, head: _Head, arrays: list[Array]) -> State:
    """The state that these arrays stand for."""
    x = arrays[0]
    if head.dependent:
        lam, changes = _from_vectors(body, arrays[1:]), head.changes
        outer = Outer(x, lam, changes[0], changes[1:]) if changes else Outer(x, lam)
        return State(x, lam, memory=outer)
    if body.stored is not None:
        force = body.out_of_balance(x)
        lam = body.multiplier(x, force)
        residual = body.residual(x, lam, force)
        return State(x, lam, energy=head.energy, residual=residual, memory=ProximalMemory(force, head.stiffening))
    matrix = Multigrid(body, arrays[2] if head.built else None)
    memory = NewtonMemory(head.stiffening, arrays[1], KrylovNewton(body, matrix))
    lam = body.multiplier(x, memory.force)
    residual = body.residual(x, lam, memory.force)
    return State(x, lam, energy=head.energy, residual=residual, memory=memory)


def _sums(ranks: Ranks, naturals: list[PETSc.Vec]) -> list[str]:
    """A sum of the bits of each vector, the same on any number of ranks; every change of one number changes it."""
    from mpi4py import MPI

    own = np.zeros(len(naturals), dtype=np.uint64)
    for number, natural in enumerate(naturals):
        first, end = natural.getOwnershipRange()
        bits = np.ascontiguousarray(natural.array_r, dtype="<f8").view("<u8").astype(np.uint64)
        own[number] = (bits * (2 * np.arange(first, end, dtype=np.uint64) + np.uint64(1))).sum(dtype=np.uint64)
    total = np.zeros_like(own)
    ranks.mpi.Allreduce(own, total, op=MPI.SUM)
    return [f"{int(value):016x}" for value in total]


def _marks(body: BodyOnRanks) -> list[float]:
    """Numbers by which a problem is known again: stiffness, boundary, gaps, and the law at some displacements."""
    if body in _KNOWN:
        return _KNOWN[body]
    ranks, law, w = body.ranks, body.law, body.weights
    points = body.piece.mesh.points
    ends = ranks.largest(*points.max(axis=0, initial=-np.inf), *-points.min(axis=0, initial=np.inf))
    size = float((ends[: body.dim] + ends[body.dim :]).max())
    values = [float(w.sum()), float(w @ np.abs(body.offset).sum(axis=1))]
    if body.stored is not None:
        values += body.stored.marks()
    ones = np.ones(body.active.shape)
    for length in (*-_LENGTHS, *_LENGTHS):
        with np.errstate(all="ignore"):
            there = law.frozen(size * length * ones, ones).value(size * length * ones)
        finite = np.isfinite(there)
        values += [float(w[finite] @ np.abs(there[finite])), float(np.count_nonzero(~finite))]
    totals = ranks.total(*values)
    _KNOWN[body] = [body.typical, *map(float, np.where(np.isfinite(totals), totals, 0.0))]
    return _KNOWN[body]


def _opened(path: Path) -> IO[bytes]:
    regular_file(path, "checkpoint", 1 << 62)
    try:
        return path.open("rb")
    except OSError as error:
        raise ProblemError(f"cannot read checkpoint '{shown(path)}': {error.strerror}") from None


def _head(path: Path, stream: IO[bytes], body: BodyOnRanks, marks: list[float], dependent: bool) -> _Head:
    """The first line of a checkpoint, if that is whole and of this problem."""
    name = shown(path)
    try:
        record: Record = json.loads(stream.readline(LONGEST_LINE))
        if record["format"] != _FORMAT:
            raise ProblemError(f"checkpoint '{name}' is of another version; solve from the beginning")
        head = decoded(_Head, record["head"], [])
        if head.wrong is not None:
            raise TypeError(f"'{head.wrong}' is {str(getattr(head, head.wrong))[:40]}")
    except OSError as error:
        raise ProblemError(f"cannot read checkpoint '{name}': {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError) as error:
        if isinstance(error, ProblemError):
            raise
        reason = f"its first line lacks {error}" if isinstance(error, KeyError) else str(error)
        raise ProblemError(f"'{name}' is not a checkpoint ({reason}); give the file named by --checkpoint") from None
    other = f"checkpoint '{name}' belongs to another problem"
    for there, mine, what in (
        (head.nodes, body.piece.total, "nodes"),
        (head.dim, body.dim, "dimensions"),
        (head.unknowns, body.unknowns, "unknowns"),
    ):
        if there != mine:
            raise ProblemError(f"{other}: it has {there} {what}, this one {mine}; name another")
    if not _alike(head.load, body.load_scale.load):
        raise ProblemError(f"{other}: its load is {head.load:.6g}, this one's {body.load_scale.load:.6g}; name another")
    if len(head.marks) != len(marks) or not all(map(_alike, head.marks, marks)):
        raise ProblemError(f"{other}: body, supports or laws differ; name another")
    if head.dependent is not dependent:
        raise ProblemError(f"{other}: a bound depends on the solution in one of the two only; name another")
    count = 2 + head.built if body.stored is None else 1
    count = 1 + body.dim if head.dependent else count
    size = path.stat().st_size - stream.tell()
    if len(head.sums) != count or size != count * 8 * body.dim * body.piece.total:
        raise ProblemError(
            f"checkpoint '{name}' is damaged: it holds {size} bytes of vectors, not "
            f"{count * 8 * body.dim * body.piece.total}; solve from the beginning"
        )
    return head


def _alike(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-6 * max(abs(one), abs(other))


def _natural(body: BodyOnRanks) -> PETSc.Vec:
    """A vector in the order of the nodes of the whole mesh."""
    from petsc4py import PETSc

    return PETSc.Vec().createMPI(body.piece.total * body.dim, bsize=body.dim, comm=body.ranks.comm)


def _scatter(body: BodyOnRanks, vector: PETSc.Vec, natural: PETSc.Vec) -> PETSc.Scatter:
    from petsc4py import PETSc

    numbers = body.piece.numbers[body.owned].astype(PETSc.IntType)
    chosen = PETSc.IS().createBlock(body.dim, numbers, comm=body.ranks.comm)
    return PETSc.Scatter().create(vector, None, natural, chosen)


def _slots(body: BodyOnRanks) -> IntArray:
    """Place in a vector for each contact point: its node, and a component of its own where several share the node."""
    position = np.cumsum(body.owned) - 1
    node = position[body.contact.node]
    order = np.lexsort((body.contact.boundary, node))
    first = np.searchsorted(node[order], node[order])
    slot = np.empty(len(node), dtype=np.int64)
    slot[order] = np.arange(len(node)) - first
    return np.asarray(node * body.dim + slot)


def _as_vectors(body: BodyOnRanks, values: Array) -> list[Array]:
    """Values (m, d) of the contact points as d vectors."""
    out = []
    for column in values.T:
        vector = np.zeros(body.load.size)
        vector[_slots(body)] = column
        out.append(vector)
    return out


def _from_vectors(body: BodyOnRanks, vectors: list[Array]) -> Array:
    return np.stack([vector[_slots(body)] for vector in vectors], axis=1)
