"""Checkpoints: an iterate in files, to go on from on the same or another number of ranks.

A checkpoint is a text file with numbers, and beside it a file of vectors in the binary format of PETSc, written by all
ranks together, in the order of the nodes of the whole mesh.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from hemivar._typing import Array, IntArray
from hemivar.distributed.assembly import BodyOnRanks
from hemivar.distributed.newton import Iterate
from hemivar.distributed.solve import Saved
from hemivar.errors import ProblemError
from hemivar.solvers import Progress

__all__ = ["read_checkpoint", "write_checkpoint"]

_FORMAT = 1


def write_checkpoint(path: str | Path, body: BodyOnRanks, saved: Saved) -> None:
    """Write an iterate; what stood there before stays until all of it is written. All ranks call this."""
    from petsc4py import PETSc

    path, ranks = Path(path), body.ranks
    fresh = path.with_name(path.name + ".new")
    vectors = [saved.iterate.x]
    if saved.iterate.built_at is not None:
        vectors.append(saved.iterate.built_at)
    if saved.state is not None:
        vectors += [saved.state[0], *_as_vectors(body, saved.state[1])]
    viewer = PETSc.Viewer().createBinary(str(_vectors(fresh)), "w", comm=ranks.comm)
    for vector in vectors:
        natural = _natural(body)
        _scatter(body, vector, natural).scatter(vector, natural)
        natural.view(viewer)
        natural.destroy()
    viewer.destroy()

    def finish() -> None:
        if ranks.rank == 0:
            record = {
                "format": _FORMAT,
                "nodes": body.piece.total,
                "dim": body.dim,
                "unknowns": body.unknowns,
                "load": body.load_scale,
                "step": saved.iterate.step,
                "energy": saved.iterate.energy,
                "stiffening": saved.iterate.stiffening,
                "built": saved.iterate.built_at is not None,
                "state": saved.state is not None,
                "outer": saved.outer,
                "changes": list(saved.changes),
                "history": [asdict(line) for line in saved.history],
            }
            fresh.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
            _vectors(fresh).replace(_vectors(path))
            fresh.replace(path)

    ranks.agree(finish)


def read_checkpoint(path: str | Path, body: BodyOnRanks) -> Saved:
    """Read an iterate of the same problem, written on any number of ranks. All ranks call this.

    Raises
    ------
    ProblemError
        The files are missing or damaged, or belong to another problem.
    """
    from petsc4py import PETSc

    path, ranks = Path(path), body.ranks

    def head() -> dict[str, Any] | None:
        return _head(path, body) if ranks.rank == 0 else None

    record = ranks.mpi.bcast(ranks.agree(head))
    viewer = PETSc.Viewer().createBinary(str(_vectors(path)), "r", comm=ranks.comm)

    def next_vector() -> Any:
        natural, vector = _natural(body), body.f.duplicate()
        natural.load(viewer)
        _scatter(body, vector, natural).scatter(natural, vector, mode=PETSc.ScatterMode.REVERSE)
        natural.destroy()
        return vector

    x = next_vector()
    built_at = next_vector() if record["built"] else None
    state = None
    if record["state"]:
        place = next_vector()
        state = (place, _from_vectors(body, [next_vector() for _ in range(body.dim)]))
    viewer.destroy()
    force = body.f.duplicate()
    body.K.mult(x, force)
    force.aypx(-1.0, body.f)
    iterate = Iterate(x, force, record["energy"], record["stiffening"], built_at, record["step"])
    history = tuple(Progress(**line) for line in record["history"])
    return Saved(iterate, history, state, record["outer"], tuple(record["changes"]))


def _vectors(path: Path) -> Path:
    return path.with_name(path.name + ".vectors")


def _head(path: Path, body: BodyOnRanks) -> dict[str, Any]:
    try:
        record: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        wrong = record["format"] != _FORMAT
        count = 1 + record["built"] + (1 + body.dim) * record["state"]
        size = _vectors(path).stat().st_size
    except OSError as error:
        raise ProblemError(f"checkpoint '{path}' cannot be read ({error.strerror}: {error.filename})") from None
    except (ValueError, KeyError, TypeError) as error:
        raise ProblemError(f"'{path}' is no checkpoint ({error}); give the file named by --checkpoint") from None
    if wrong:
        raise ProblemError(f"checkpoint '{path}' is of another version; solve from the beginning")
    for key, mine, what in (
        ("nodes", body.piece.total, "nodes"),
        ("dim", body.dim, "dimensions"),
        ("unknowns", body.unknowns, "unknowns"),
    ):
        if record[key] != mine:
            raise ProblemError(
                f"checkpoint '{path}' belongs to another problem: it has {record[key]} {what}, this one {mine}"
            )
    if abs(record["load"] - body.load_scale) > 1e-6 * body.load_scale:
        raise ProblemError(
            f"checkpoint '{path}' belongs to another problem: its load is {record['load']:.6g}, this one's "
            f"{body.load_scale:.6g}"
        )
    if size < count * (8 + 8 * body.dim * body.piece.total):
        raise ProblemError(f"checkpoint '{path}' is damaged: the file of vectors beside it is too short")
    return record


def _natural(body: BodyOnRanks) -> Any:
    """A vector in the order of the nodes of the whole mesh."""
    from petsc4py import PETSc

    return PETSc.Vec().createMPI(body.piece.total * body.dim, bsize=body.dim, comm=body.ranks.comm)


def _scatter(body: BodyOnRanks, vector: Any, natural: Any) -> Any:
    from petsc4py import PETSc

    numbers = body.piece.numbers[body.owned].astype(PETSc.IntType)
    chosen = PETSc.IS().createBlock(body.dim, numbers, comm=body.ranks.comm)
    return PETSc.Scatter().create(vector, None, natural, chosen)


def _slots(body: BodyOnRanks) -> IntArray:
    """Place in a vector for each contact point: its node, and a component of its own where several share the node."""
    position = np.cumsum(body.owned) - 1
    node = position[body.contact_nodes]
    order = np.lexsort((body.contact_boundaries, node))
    first = np.searchsorted(node[order], node[order])
    slot = np.empty(len(node), dtype=np.int64)
    slot[order] = np.arange(len(node)) - first
    return np.asarray(node * body.dim + slot)


def _as_vectors(body: BodyOnRanks, values: Array) -> list[Any]:
    """Values (m, d) of the contact points as d vectors."""
    out = []
    for column in values.T:
        vector = body.f.duplicate()
        vector.array_w[:] = 0.0
        vector.array_w[_slots(body)] = column
        out.append(vector)
    return out


def _from_vectors(body: BodyOnRanks, vectors: list[Any]) -> Array:
    return np.stack([vector.array_r[_slots(body)] for vector in vectors], axis=1)
