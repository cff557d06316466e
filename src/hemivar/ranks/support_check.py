"""Coercivity over ranks: whether the supports and the foundation hold a body that lies over ranks."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.free_motion import describe, refuse, refuse_free_motion
from hemivar.discrete.held_at_rest import IDLE, geometric_slack
from hemivar.discrete.problem import DiscreteProblem, pushes
from hemivar.discrete.recession import Coercivity, RecessionFunction, decide, growth_along, rests
from hemivar.discrete.rigid_modes import admitted, rigid_basis
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.fem.unknowns import NodalConditions
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh
from hemivar.ranks.pieces import Piece
from hemivar.ranks.ranks import Ranks, shared

if TYPE_CHECKING:
    from hemivar.ranks.body_on_ranks import BodyOnRanks

__all__ = ["admissible_motions", "check_parts", "check_supported", "supported"]


def _unrefined(mesh: Mesh, state: Callable[[Mesh], ContactProblem], evolving: bool = False) -> DiscreteProblem:
    """The serial problem on the unrefined mesh, where parts of a body are told from one another."""
    return discretize(state(mesh), check_coercivity=False, evolving=evolving)


def supported(
    ranks: Ranks,
    piece: Piece,
    state: Callable[[Mesh], ContactProblem],
    coarser: BodyOnRanks | None,
    evolving: bool = False,
) -> bool:
    """Whether the supports hold every part of a body of several parts; they are the same on every mesh."""
    if coarser is not None:
        return coarser.supported

    def look() -> bool | None:
        if piece.whole is None:
            return None
        model = _unrefined(piece.whole, state, evolving).model
        return model.field is not None and model.free_motions.count == 0

    return bool(ranks.mpi.bcast(ranks.agree(look)))


def admissible_motions(
    ranks: Ranks, nodal: NodalConditions, skin: Mesh, piece: Piece, owned: BoolArray
) -> tuple[Array, Array]:
    """Rigid motions that the supports admit, and all of them as displacements (N, d, motions)."""
    points = piece.mesh.points
    far = np.concatenate([points.max(axis=0, initial=-np.inf), -points.min(axis=0, initial=np.inf)])
    far = ranks.largest(*far)
    dim = piece.mesh.dim
    motions, _ = rigid_basis(points, (-far[dim:], far[:dim]))
    count = nodal.supports.count[: len(points)]
    node, slot = np.nonzero((np.arange(dim) < count[:, None]) & owned[:, None])
    moves = motions.reshape(len(points), dim, motions.shape[1])
    stopped = np.einsum("kd,kdr->kr", nodal.supports.directions[node, slot], moves[node])
    triangle = np.linalg.qr(stopped, mode="r") if len(stopped) else stopped
    every = np.concatenate(ranks.mpi.allgather(triangle))
    return admitted(every), moves


def check_supported(body: BodyOnRanks, admissible: Array, moves: Array) -> tuple[str, ...]:
    """Refuse a body that is free to move, as the serial :func:`hemivar.discretize` does; the first rank decides.

    Returned: what must be said of a body that is let pass.
    """
    if not admissible.shape[1]:
        return ()
    ranks = body.ranks
    rigid = moves @ admissible
    vectors = []
    for k in range(admissible.shape[1]):
        vectors.append(body.restrict(rigid[:, :, k] + body.prescribed))
    columns = np.stack(vectors, axis=1)
    load = body.load
    local = np.stack([body.spread(column[body.unknown]) for column in columns.T], axis=2)
    assert body.contact.points is not None
    places = (np.abs(each).max(initial=0.0) for each in (body.offset, body.contact.points))
    pushed = pushes(body.law, body.offset, float(ranks.largest(*places).max()))
    size = float(np.abs(load) @ np.abs(columns).max(axis=1, initial=0.0))
    *work, size, touched = ranks.total(*(columns.T @ load), size, float(pushed))
    own = growth_along(body.law, local, body.weights, np.array(work), float(size))
    slack = geometric_slack(body.contact.points, body.contact.weights)
    everywhere = ranks.mpi.gather((own.rows, own.up, own.down, own.cones, own.rates, slack), root=0)
    hold, idle = None, None
    if ranks.rank == 0:
        parts = list(zip(*everywhere, strict=True))
        rows, up, down, cones, rates = (np.concatenate(part) for part in parts[:5])
        whole = RecessionFunction(own.work, own.load, rows, up, down, cones, rates, max(parts[5]))
        hold = decide(whole)
        idle = IDLE if hold.verdict is not Coercivity.HELD and not touched and rests(whole) else None
    hold, idle = ranks.mpi.bcast((hold, idle), root=0)
    if idle is not None:
        return (idle,)
    motion = "" if hold.direction is None else describe(admissible @ hold.direction)
    try:
        refuse(hold, motion)
    except ProblemError as error:
        raise shared(error) from None
    return ()


def check_parts(ranks: Ranks, piece: Piece, state: Callable[[Mesh], ContactProblem], evolving: bool) -> tuple[str, ...]:
    """As :func:`check_supported`, of a body of several parts: on the unrefined mesh, where they are distinct."""

    def look() -> tuple[str, ...]:
        if piece.whole is None:
            return ()
        motion = refuse_free_motion(_unrefined(piece.whole, state, evolving))
        return tuple(remark for remark in (motion.limit, motion.idle) if remark is not None)

    warnings: tuple[str, ...] = ranks.mpi.bcast(ranks.agree(look))
    return warnings
