"""Assembled matrices of a body over ranks, in PETSc, and the near-nullspace (motions that deform nothing)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array
from hemivar.fem.edge_blocks import EdgeBlocks
from hemivar.ranks.nodes import NodesOnRanks

if TYPE_CHECKING:
    from petsc4py import PETSc

__all__ = ["assembled", "combined", "hold", "near_null_space", "row_sums"]


def assembled(nodes: NodesOnRanks, blocks: EdgeBlocks | None) -> PETSc.Mat:
    """The matrix of the blocks of all ranks, which are used up, along the directions of the nodes; nothing is held.

    Matrices of the same nodes stand on one sparsity, for entries that are zero are stored as well.
    """
    from petsc4py import PETSc

    own, dim, index = sp.csr_array((0, 0)), nodes.dim, PETSc.IntType
    if blocks is not None:
        blocks.turn(nodes.directions)
        own = blocks.matrix()
    mapping = PETSc.LGMap().create(nodes.places.astype(index), bsize=dim, comm=nodes.ranks.comm)
    size = (nodes.fixed.size, None)
    parts = PETSc.Mat().create(nodes.ranks.comm)
    parts.setType("is")
    parts.setSizes((size, size), bsize=dim)
    parts.setLGMap(mapping, mapping)
    local = PETSc.Mat().createAIJ(
        own.shape, csr=(own.indptr.astype(index), own.indices.astype(index), own.data), comm=PETSc.COMM_SELF
    )
    parts.setISLocalMat(local)
    parts.assemble()
    matrix = parts.convert("aij", PETSc.Mat())
    parts.destroy()
    local.destroy()
    matrix.setBlockSize(dim)
    return matrix


def combined(matrix: PETSc.Mat, parts: Sequence[tuple[float, PETSc.Mat]]) -> PETSc.Mat:
    """A matrix and multiples of others on its sparsity, added up in a new one."""
    from petsc4py import PETSc

    total = matrix.duplicate(copy=True)
    for factor, part in parts:
        total.axpy(factor, part, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
    return total


def hold(matrix: PETSc.Mat, nodes: NodesOnRanks) -> float:
    """Make the rows and columns of held unknowns those of a multiple of the identity, which is returned."""
    from petsc4py import PETSc

    loose = matrix.getDiagonal().array_r[~nodes.fixed]
    total, count = nodes.ranks.total(float(loose.sum()), loose.size)
    mean = float(total / max(count, 1.0))
    matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
    rows = matrix.getOwnershipRange()[0] + np.flatnonzero(nodes.fixed)
    matrix.zeroRowsColumns(rows.astype(PETSc.IntType), diag=mean)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    return mean


def row_sums(matrix: PETSc.Mat, nodes: NodesOnRanks) -> Array:
    """Sums (n,) of the absolute entries of the rows of this rank; zero where supports hold."""
    first, _, entries = matrix.getValuesCSR()
    count = first.size - 1
    sums = np.bincount(np.repeat(np.arange(count), np.diff(first)), np.abs(entries), minlength=count)
    return np.where(nodes.fixed, 0.0, sums)


def near_null_space(nodes: NodesOnRanks) -> PETSc.NullSpace:
    """Translations and rotations in terms of the unknowns."""
    from petsc4py import PETSc

    dim = nodes.dim
    points = nodes.piece.mesh.points
    motions = [np.broadcast_to(axis, points.shape) for axis in np.eye(dim)]
    for i in range(dim):
        for j in range(i + 1, dim):
            turn = np.zeros(points.shape)
            turn[:, i], turn[:, j] = -points[:, j], points[:, i]
            motions.append(turn)
    independent: list[PETSc.Vec] = []
    for motion in motions:  # Gram-Schmidt twice
        vector = nodes.vector(nodes.along(motion)[nodes.owned].ravel())
        for _ in range(2):
            for other in independent:
                vector.axpy(-vector.dot(other), other)
        vector.normalize()
        independent.append(vector)
    return PETSc.NullSpace().create(constant=False, vectors=independent, comm=nodes.ranks.comm)
