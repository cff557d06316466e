"""Degrees of freedom over ranks, at the nodes of a mesh: what all vectors and matrices on the mesh share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.ranks.pieces import Piece
from hemivar.ranks.ranks import Ranks

if TYPE_CHECKING:
    from petsc4py import PETSc

__all__ = ["NodesOnRanks"]


@dataclass(frozen=True, eq=False)
class NodesOnRanks:
    """The nodes of this rank's piece, with d unknowns each along its directions, be they held or not."""

    ranks: Ranks
    piece: Piece
    places: IntArray  # (N,): global number, in the order of the vectors, of each node of the piece
    directions: Array  # (N, d, d)
    free: BoolArray  # (N, d): which unknowns supports do not hold
    coarser: NodesOnRanks | None = None  # of the next coarser mesh

    @staticmethod
    def of(
        ranks: Ranks, piece: Piece, directions: Array, free: BoolArray, coarser: NodesOnRanks | None
    ) -> NodesOnRanks:
        """The nodes of a piece; all ranks call this."""
        return NodesOnRanks(ranks, piece, _places(ranks, piece), directions, free, coarser)

    @property
    def dim(self) -> int:
        """Space dimension d."""
        return self.piece.mesh.dim

    @property
    def total(self) -> int:
        """Number of unknowns of all ranks, held ones included."""
        return self.piece.total * self.dim

    @cached_property
    def owned(self) -> BoolArray:
        """Nodes that this rank owns, (N,)."""
        return self.piece.owned(self.ranks)

    @cached_property
    def fixed(self) -> BoolArray:
        """Entries of a vector that supports hold, (n,)."""
        return np.asarray(~self.free[self.owned].ravel())

    @cached_property
    def prolongation(self) -> PETSc.Mat:
        """Unknowns from those of :attr:`coarser`, a petsc4py Mat; supports observed."""
        assert self.coarser is not None
        return _prolongation(self.coarser, self)

    @cached_property
    def _scatter(self) -> tuple[PETSc.Scatter, PETSc.Vec]:
        """From a vector to the unknowns of all nodes of the piece."""
        from petsc4py import PETSc

        local = PETSc.Vec().createSeq(self.places.size * self.dim, bsize=self.dim, comm=PETSc.COMM_SELF)
        chosen = PETSc.IS().createBlock(self.dim, self.places.astype(PETSc.IntType), comm=PETSc.COMM_SELF)
        return PETSc.Scatter().create(self.vector(), chosen, local, None), local

    def vector(self, x: Array | None = None) -> PETSc.Vec:
        """A petsc4py Vec with a copy of the entries of an array (n,), or zeros."""
        from petsc4py import PETSc

        vector = PETSc.Vec().create(self.ranks.comm)
        vector.setSizes((self.fixed.size, None), bsize=self.dim)
        vector.setType("standard")
        vector.array_w[:] = 0.0 if x is None else x
        return vector

    def everywhere(self, x: Array) -> Array:
        """Values (N, d) at all nodes of the piece of a vector (n,); all ranks call this."""
        scatter, local = self._scatter
        scatter.scatter(self.vector(x), local)
        return np.array(local.array_r).reshape(self.free.shape)

    def summed(self, values: Array) -> Array:
        """Vector (n,) of the sums over the ranks of values (N, d) at the nodes of their pieces."""
        from petsc4py import PETSc

        vector, numbers = self.vector(), self.places.astype(PETSc.IntType)
        vector.setValuesBlocked(numbers, values.ravel(), addv=PETSc.InsertMode.ADD_VALUES)
        vector.assemble()
        return np.array(vector.array_r)

    def along(self, values: Array) -> Array:
        """Components along the directions of values (N, d) along the axes at the nodes of the piece."""
        return np.asarray(np.einsum("ncd,nd->nc", self.directions, values))


def _places(ranks: Ranks, piece: Piece) -> IntArray:
    """Global number of each node: those a rank owns one after the other, in the order of the piece."""
    owned = piece.owned(ranks)
    start, _ = ranks.offset(int(owned.sum()))
    places = np.full(len(owned), -1, dtype=np.int64)
    places[owned] = start + np.arange(int(owned.sum()))
    ghost = np.flatnonzero(~owned)
    asked, _, back = ranks.exchange(piece.owner[ghost], piece.numbers[ghost, None])
    order = np.argsort(piece.numbers)
    known = order[np.searchsorted(piece.numbers, asked[:, 0], sorter=order)] if len(asked) else asked[:, 0]
    places[ghost] = back.answer(places[known][:, None])[:, 0]
    return places


def _prolongation(coarse: NodesOnRanks, fine: NodesOnRanks) -> PETSc.Mat:
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
    index = (np.concatenate(rows), np.concatenate(columns))
    local = sp.coo_array((np.concatenate(data), index), shape=(count * dim, coarse.total)).tocsr()
    matrix = PETSc.Mat().createAIJ(
        ((count * dim, None), (coarse.fixed.size, None)),
        csr=(local.indptr.astype(PETSc.IntType), local.indices.astype(PETSc.IntType), local.data),
        comm=fine.ranks.comm,
    )
    matrix.assemble()
    return matrix
