"""Matrices of a body over ranks as PETSc has them: stiffness, prolongation, and the motions that deform nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.engines.petsc.pieces import Piece
from hemivar.engines.petsc.ranks import Ranks
from hemivar.fem.edge_blocks import EdgeBlocks
from hemivar.mesh.mesh import Mesh

if TYPE_CHECKING:
    from petsc4py import PETSc

    from hemivar.engines.petsc.assembly import BodyOnRanks

__all__ = ["near_null_space", "places_of", "prolongation", "stiffness_and_load"]


def places_of(ranks: Ranks, piece: Piece) -> IntArray:
    """Global number of each node: those a rank owns one after the other, in the order of the piece."""
    owned = piece.owned(ranks)
    start, _ = ranks.offset(int(owned.sum()))
    places = np.full(len(owned), -1, dtype=np.int64)
    places[owned] = start + np.arange(int(owned.sum()))
    ghost = np.flatnonzero(~owned)
    asked, _, post = ranks.exchange(piece.owner[ghost], piece.numbers[ghost, None])
    order = np.argsort(piece.numbers)
    known = order[np.searchsorted(piece.numbers, asked[:, 0], sorter=order)] if len(asked) else asked[:, 0]
    places[ghost] = post.answer(places[known][:, None])[:, 0]
    return places


def stiffness_and_load(
    ranks: Ranks, blocks: EdgeBlocks | None, load: Array, directions: Array, free: BoolArray, places: IntArray,
    owned: BoolArray,
) -> tuple[PETSc.Mat, PETSc.Vec, PETSc.Vec, float]:  # fmt: skip
    """Matrix, load, sums of rows and mean diagonal, in terms of the unknowns along the directions of the nodes."""
    from petsc4py import PETSc

    nodes, dim = free.shape
    own = sp.csr_array((0, 0))
    if blocks is not None:
        blocks.turn(np.where(free[:, :, None], directions, 0.0))
        own = blocks.matrix()
    mapping = PETSc.LGMap().create(places.astype(PETSc.IntType), bsize=dim, comm=ranks.comm)
    size = (int(owned.sum()) * dim, None)
    parts = PETSc.Mat().create(ranks.comm)
    parts.setType("is")
    parts.setSizes((size, size), bsize=dim)
    parts.setLGMap(mapping, mapping)
    index = PETSc.IntType
    local = PETSc.Mat().createAIJ(
        own.shape, csr=(own.indptr.astype(index), own.indices.astype(index), own.data), comm=PETSc.COMM_SELF
    )
    parts.setISLocalMat(local)
    parts.assemble()
    K = parts.convert("aij", PETSc.Mat())
    parts.destroy()
    local.destroy()
    K.setBlockSize(dim)
    f = K.createVecLeft()
    row_sums = f.duplicate()
    force = np.einsum("ncd,nd->nc", directions, load.reshape(nodes, dim))
    for vector, values in ((f, force), (row_sums, np.asarray(abs(own).sum(axis=1)))):
        vector.setValuesBlocked(places.astype(index), values.ravel(), addv=PETSc.InsertMode.ADD_VALUES)
        vector.assemble()
    loose = K.getDiagonal().array_r[free[owned].ravel()]
    total, count = ranks.total(float(loose.sum()), loose.size)
    mean = float(total / max(count, 1.0))
    held = np.flatnonzero(~free[owned].ravel())
    K.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
    K.zeroRowsColumns((K.getOwnershipRange()[0] + held).astype(index), diag=mean)
    for vector in (f, row_sums):
        vector.array_w[held] = 0.0
    K.setOption(PETSc.Mat.Option.SPD, True)
    return K, f, row_sums, mean


def near_null_space(mesh: Mesh, directions: Array, owned: BoolArray, f: PETSc.Vec) -> PETSc.NullSpace:
    """Translations and rotations in terms of the unknowns."""
    from petsc4py import PETSc

    dim = mesh.dim
    points = mesh.points[owned]
    motions = [np.broadcast_to(axis, points.shape) for axis in np.eye(dim)]
    for i in range(dim):
        for j in range(i + 1, dim):
            turn = np.zeros(points.shape)
            turn[:, i], turn[:, j] = -points[:, j], points[:, i]
            motions.append(turn)
    basis = []
    for motion in motions:
        vector = f.duplicate()
        vector.array_w[:] = np.einsum("ncd,nd->nc", directions[owned], motion).ravel()
        basis.append(vector)
    independent: list[PETSc.Vec] = []
    for vector in basis:  # Gram-Schmidt twice
        for _ in range(2):
            for other in independent:
                vector.axpy(-vector.dot(other), other)
        vector.normalize()
        independent.append(vector)
    return PETSc.NullSpace().create(constant=False, vectors=independent, comm=f.getComm())


def prolongation(coarse: BodyOnRanks, fine: BodyOnRanks) -> PETSc.Mat:
    """Unknowns of the finer mesh from those of the coarser one, as a petsc4py Mat; supports observed."""
    from petsc4py import PETSc

    dim = fine.dim
    assert fine.piece.ends is not None
    ends = fine.piece.ends[fine.owned]
    count = len(ends)
    rows, columns, data = [], [], []
    for side in range(2):
        end = ends[:, side]
        turned = np.einsum("ncd,ned->nce", fine.directions[fine.owned], coarse.directions[end])
        allowed = fine.free[fine.owned][:, :, None] & coarse.free[end][:, None, :]
        entry = np.where(allowed & (np.abs(turned) > 1e-14), 0.5 * turned, 0.0)
        # nodes of the coarser mesh keep a place for each unknown, be it held
        keep = (entry != 0.0) | ((ends[:, :1] == ends[:, 1:])[:, :, None] & np.eye(dim, dtype=bool))
        node, here, there = np.nonzero(keep)
        rows.append(node * dim + here)
        columns.append(coarse.places[end[node]] * dim + there)
        data.append(entry[keep])
    shape = (count * dim, coarse.K.getSize()[0])
    index = (np.concatenate(rows), np.concatenate(columns))
    local = sp.coo_array((np.concatenate(data), index), shape=shape).tocsr()
    matrix = PETSc.Mat().createAIJ(
        ((count * dim, None), (coarse.load.size, None)),
        csr=(local.indptr.astype(PETSc.IntType), local.indices.astype(PETSc.IntType), local.data),
        comm=fine.ranks.comm,
    )
    matrix.assemble()
    return matrix
