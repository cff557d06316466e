"""Matrices of element blocks in rotated nodal directions, some of which supports fix (Dirichlet)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.supports import DEPENDENT
from hemivar.linear.factorisation import factorise

__all__ = ["DirectedMatrix", "directed_matrix"]


@dataclass(frozen=True, eq=False)
class DirectedMatrix:
    """A symmetric matrix in the free components at nodes."""

    matrix: sp.csc_array  # (n, n)
    directions: Array  # (N, d, d): column c is the direction of component c of the node
    number: IntArray  # (N, d): of the unknown that each component is, -1 for held ones

    def factor(self) -> spla.SuperLU:
        """Its factors."""
        return spla.splu(
            self.matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True, "Equil": False},
        )

    def answers(self, rows: sp.csr_array) -> Array:
        """``R K^-1 R'`` (k, k) of rows (k, n) on few unknowns: all others are eliminated beforehand."""
        seen = np.unique(rows.indices).astype(np.int64)
        schur = factorise(sp.csr_array(self.matrix), seen).schur
        on_seen = rows[:, seen].toarray()
        try:
            half = la.solve_triangular(la.cholesky(schur, lower=True), on_seen.T, lower=True)
            return np.asarray(half.T @ half)
        except la.LinAlgError:  # rounding has left a stiffness that is not positive
            compliance = on_seen @ la.solve(schur, on_seen.T, assume_a="sym")
            return np.asarray(0.5 * (compliance + compliance.T))

    def rows(self, nodes: IntArray, weights: Array) -> sp.csr_array:
        """The matrix (rows, n) of ``sum over q and i of weights[..., q, i] u_i(nodes[..., q])``.

        Shapes: ``nodes`` (k, q), ``weights`` (k, r, q, d).
        """
        turned = np.einsum("krqi,kqij->krqj", weights, self.directions[nodes], optimize=True)
        columns = np.broadcast_to(self.number[nodes][:, None], turned.shape)
        count = turned.shape[0] * turned.shape[1]
        rows = np.broadcast_to(np.arange(count).reshape(*turned.shape[:2], 1, 1), turned.shape)
        keep = columns >= 0
        shape = (count, self.matrix.shape[0])
        return sp.csr_array(sp.coo_array((turned[keep], (rows[keep], columns[keep])), shape=shape))


def directed_matrix(blocks: Array, nodes: IntArray, fixed: Array) -> DirectedMatrix:
    """Sum up blocks.

    Shapes: ``blocks`` (M, k d, k d), ``nodes`` (M, k), ``fixed`` (N, d, d).
    """
    count, dim = fixed.shape[:2]
    touched: BoolArray = np.asarray(fixed.any(axis=(1, 2)))
    directions = np.broadcast_to(np.eye(dim), fixed.shape).copy()
    free = np.ones((count, dim), dtype=bool)
    values, directions[touched] = np.linalg.eigh(fixed[touched])
    free[touched] = values < DEPENDENT
    number = np.full((count, dim), -1, dtype=np.int64)
    number[free] = np.arange(np.count_nonzero(free))
    some = np.flatnonzero(touched[nodes].any(axis=1))
    turn = directions[nodes[some]]
    part = blocks[some].reshape(len(some), nodes.shape[1], dim, nodes.shape[1], dim)
    part = np.einsum("maibj,maip,mbjq->mapbq", part, turn, turn, optimize=True)
    blocks = blocks.copy()
    blocks[some] = part.reshape(len(some), *blocks.shape[1:])
    slots = number[nodes].reshape(len(nodes), -1)
    rows = np.broadcast_to(slots[:, :, None], blocks.shape)
    columns = np.broadcast_to(slots[:, None, :], blocks.shape)
    keep = (rows >= 0) & (columns >= 0)
    n = int(np.count_nonzero(free))
    matrix = sp.coo_array((blocks[keep], (rows[keep], columns[keep])), shape=(n, n))
    return DirectedMatrix(sp.csc_array(matrix), directions, number)
