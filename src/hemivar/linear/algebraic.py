"""Coarse levels where no coarser mesh is known: smoothed aggregation, from the matrix and the rigid motions."""

from __future__ import annotations

import warnings

import numpy as np
import scipy.sparse as sp

from hemivar._typing import Array, IntArray
from hemivar.linear.levels import COARSEST, Transfer
from hemivar.mechanics.discrete import DiscreteProblem
from hemivar.mechanics.hierarchy import rigid_motions

__all__ = ["algebraic_levels"]


def algebraic_levels(problem: DiscreteProblem) -> list[tuple[sp.csr_array, Transfer]]:
    """Matrices below that of the problem, each with the transfer from it to the next finer one, from coarse to fine.

    Unknowns of one node are aggregated together; directions that a support takes away from a node are filled up by
    unknowns that nothing couples to.

    Parameters
    ----------
    problem : DiscreteProblem
        Without a mesh the unknowns are taken one by one, and constants for the near null space.
    """
    import pyamg  # only here: small problems do without it

    slots, size, count = _slots(problem)
    place = sp.csr_array((np.ones(slots.size), (slots, np.arange(slots.size))), shape=(count, slots.size))
    empty = np.ones(count)
    empty[slots] = 0.0
    mean = float(problem.stiffness.diagonal().mean())
    filled = place @ problem.stiffness @ place.T + sp.diags_array(mean * empty)
    blocks = sp.bsr_matrix(sp.csr_array(filled).tobsr((size, size)))
    blocks.indices, blocks.indptr = blocks.indices.astype(np.int32), blocks.indptr.astype(np.int32)
    near = np.ones((problem.unknowns, 1)) if problem.field is None else rigid_motions(problem.field)
    candidates = np.zeros((count, near.shape[1]))
    candidates[slots] = near
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # candidates that vanish on a whole aggregate, where a support holds it
        hierarchy = pyamg.smoothed_aggregation_solver(
            blocks, B=candidates, max_coarse=COARSEST, max_levels=20, keep=False, coarse_solver=None
        )
    found: list[tuple[sp.csr_array, Transfer]] = []
    for fine, coarse in zip(hierarchy.levels[:-1], hierarchy.levels[1:], strict=True):
        prolongation = sp.csr_array(fine.P)
        if not found:
            prolongation = sp.csr_array(place.T @ prolongation)
        found.insert(0, (_regular(sp.csr_array(coarse.A)), Transfer.of(prolongation)))
    return found


def _slots(problem: DiscreteProblem) -> tuple[IntArray, int, int]:
    """Where each unknown goes in a vector with the same number of entries for every node; that number; its length."""
    if problem.field is None:
        return np.arange(problem.unknowns), 1, problem.unknowns
    basis, size = problem.field.basis.tocsc(), problem.field.dim
    node = basis.indices[basis.indptr[:-1]] // size
    first = np.concatenate([[True], np.diff(node) != 0])
    start = np.maximum.accumulate(np.where(first, np.arange(node.size), 0))
    used, number = np.unique(node, return_inverse=True)
    return number * size + np.arange(node.size) - start, size, used.size * size


def _regular(matrix: sp.csr_array) -> sp.csr_array:
    """The matrix with ones for diagonal entries that vanish, whose unknowns nothing reaches."""
    diagonal: Array = matrix.diagonal()
    gone = np.abs(diagonal) <= 1e-14 * np.abs(diagonal).max(initial=0.0)
    return sp.csr_array(matrix + sp.diags_array(gone.astype(float))) if gone.any() else matrix
