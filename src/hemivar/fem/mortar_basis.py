"""Change of basis of mortar contact: jumps between bodies in the place of displacements of slave nodes.

A contact point of two bodies sees a node of the slave and nodes of the master.  Counted from where the master takes it,
the displacement of the slave's node is the jump itself: with these unknowns each contact point sees one, as on a
foundation, and multigrid interpolates what the two bodies do together and the jump apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray

__all__ = ["OWN", "JumpUnknowns", "jump_unknowns"]

#: Share of a node of the slave in the jump there from which the jump comes in its place.
OWN = 1e-2
#: Bodies in a chain, each the slave of the next one, up to which jumps are followed.
_CHAIN = 64
#: How often jumps look for an unknown that no other jump has taken in the meantime.
_TRIES = 8


@dataclass(frozen=True, eq=False)
class JumpUnknowns(PickleMixin):
    """The change of basis from nodal unknowns u (n,) to unknowns v (n,) of which some are jumps."""

    change: sp.csr_array  # (n, n): T in ``u = T v``
    back: sp.csr_array  # (n, n): its inverse
    vanish: IntArray  # (k,): those of v that are zero, as what they are jumps between is linked; -1 where none is

    @cached_property
    def kept(self) -> IntArray:
        """The unknowns of v that do not vanish."""
        return np.setdiff1d(np.arange(self.change.shape[0]), self.vanish)

    @cached_property
    def _added(self) -> tuple[IntArray, sp.csr_array]:
        """The unknowns (k,) of u that are none of v, and their rows (k, n) of ``T - 1``."""
        added = sp.csr_array(self.change - sp.eye_array(self.change.shape[0]))
        rows = np.flatnonzero(np.diff(added.indptr)).astype(np.int64)
        return rows, sp.csr_array(added[rows])

    def of(self, matrix: sp.csr_array) -> sp.csr_array:
        """``T'A T`` of a symmetric matrix (n, n) with sorted indices, on a sparsity that follows from that of A.

        Rows and columns of what vanishes are left out.
        """
        whole = self._of_all(matrix)
        return whole if self.kept.size == whole.shape[0] else sp.csr_array(whole[self.kept][:, self.kept])

    def _of_all(self, matrix: sp.csr_array) -> sp.csr_array:
        rows, added = self._added
        near = sp.csr_array(matrix[rows])
        values = _correction(near, added, rows)
        places = _correction(_ones(near), _ones(added), rows)
        touched = np.flatnonzero(np.diff(places.indptr))
        parts = [sp.csr_array(one[touched]).tocoo() for one in (matrix, places, values)]
        data = np.concatenate([parts[0].data, np.zeros(parts[1].nnz), parts[2].data])
        at = tuple(np.concatenate([part.coords[axis] for part in parts]) for axis in (0, 1))
        changed = sp.csr_array(sp.coo_array((data, at), shape=(touched.size, matrix.shape[1])))
        return _with_rows(matrix, touched, changed)


def _correction(near: sp.csr_array, added: sp.csr_array, rows: IntArray) -> sp.csr_array:
    """``G'A + A G + G'A G`` of the rows ``near (k, n)`` of A and ``added (k, n)`` of G, which has no others."""
    half = sp.csr_array(added.T @ near)
    return sp.csr_array(half + half.T + added.T @ (near[:, rows] @ added))


def _ones(matrix: sp.csr_array) -> sp.csr_array:
    return sp.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)


def _with_rows(matrix: sp.csr_array, rows: IntArray, changed: sp.csr_array) -> sp.csr_array:
    """A matrix with others in the place of some of its rows (k,), which rise, zeros among their entries."""
    if not rows.size:
        return matrix
    counts = np.diff(matrix.indptr)
    counts[rows] = np.diff(changed.indptr)
    indptr = np.concatenate([[0], np.cumsum(counts, dtype=np.int64)])
    first = np.flatnonzero(np.diff(rows, prepend=-2) > 1)  # of rows that follow one another
    last = np.append(first[1:], rows.size) - 1
    ends = np.stack([matrix.indptr[rows[first]], matrix.indptr[rows[last] + 1]], axis=1).ravel()

    def joined(old: Array, new: Array) -> Array:
        parts = np.split(old, ends)
        parts[1::2] = np.split(new, changed.indptr[first[1:]])
        return np.concatenate(parts)

    indices = joined(matrix.indices, changed.indices.astype(matrix.indices.dtype))
    parts = joined(matrix.data, changed.data), indices, indptr.astype(matrix.indptr.dtype)
    whole = sp.csr_array(parts, shape=matrix.shape)
    whole.has_canonical_format = True
    return whole


# ---- the change of basis -------------------------------------------------------------------------------------------


def jump_unknowns(trace: sp.csr_array, own: IntArray, node: IntArray, linked: int = 0) -> JumpUnknowns | None:
    """Unknowns of which some are the jumps of a trace; the first ones are of what is ``linked``, and vanish.

    Each comes in the place of an unknown of its own node, or of one of the master where another jump has taken that.

    Where jumps of the latter kind see one another in a circle they stay means of several unknowns.

    Shapes: ``trace`` (k, n), ``own`` (k,), ``node`` (n,). Returned: none if bodies are slaves of one another in a
    circle.
    """
    at_own, local = _own_pivots(trace, own, node)
    changed = _changed(trace, _elsewhere(at_own, trace, ~local, node), node, linked)
    return _changed(trace, at_own, node, linked) if changed is None else changed


def _changed(trace: sp.csr_array, pivot: IntArray, node: IntArray, linked: int) -> JumpUnknowns | None:
    """The change to jumps in the place of unknowns (k,), -1 for none; none where they see one another in a circle."""
    vanish, rows = pivot[:linked], np.flatnonzero(pivot >= 0)
    rows = rows[np.argsort(pivot[rows])]
    jumps, n = pivot[rows], trace.shape[1]
    trace = sp.csr_array(trace[rows])
    inverse = _inverse(sp.csr_array(trace[:, jumps]), node[jumps])
    if inverse is None:
        return None
    others = np.ones(n)
    others[jumps] = 0.0
    among = sp.csr_array((np.ones(jumps.size), (jumps, np.arange(jumps.size))), shape=(n, jumps.size))
    plain = sp.diags_array(others)
    change = plain + among @ inverse @ (among.T - trace @ plain)
    return JumpUnknowns(_cleaned(change), _cleaned(plain + among @ trace), vanish)


def _cleaned(matrix: sp.csr_array) -> sp.csr_array:
    matrix = sp.csr_array(matrix)
    matrix.data[np.abs(matrix.data) < ROUNDED] = 0.0
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix


def _slots(node: IntArray) -> tuple[IntArray, IntArray]:
    """Of things at nodes (k,): the number of the node among these, and which of its things each is."""
    _, block = np.unique(node, return_inverse=True)
    order = np.argsort(block, kind="stable")
    slot = np.empty(node.size, dtype=np.int64)
    slot[order] = np.arange(node.size) - np.searchsorted(block[order], block[order])
    return block, slot


def _own_pivots(trace: sp.csr_array, own: IntArray, node: IntArray) -> tuple[IntArray, BoolArray]:
    """The unknown (k,) of its own node in whose place each jump comes, -1 for those that find none; its entries."""
    block, slot = _slots(own)
    first, entries = np.searchsorted(node, own), trace.tocoo()
    local = node[entries.col] == own[entries.row]
    row, column = entries.row[local], entries.col[local]
    blocks = np.zeros((int(block.max(initial=-1)) + 1, int(slot.max(initial=-1)) + 1, 3))
    blocks[block[row], slot[row], column - first[row]] = entries.data[local]
    picked = _picked(blocks)[block, slot]
    return np.where(picked < 0, -1, first + picked), local


def _elsewhere(pivot: IntArray, trace: sp.csr_array, elsewhere: BoolArray, node: IntArray) -> IntArray:
    """Pivots with the largest of the entries ``elsewhere``, shape (nnz,), that is left for rows that have none.

    Two rows may see a node along one direction: then different unknowns of it are no pivots of both.
    """
    entries, out = trace.tocoo(), pivot.copy()
    left = elsewhere & (np.abs(entries.data) > OWN)
    for _ in range(_TRIES):
        left &= (out[entries.row] < 0) & ~np.isin(entries.col, out)
        entry = np.flatnonzero(left)
        if not entry.size:
            break
        order = entry[np.lexsort((-np.abs(entries.data[entry]), entries.row[entry]))]
        entry = order[np.unique(entries.row[order], return_index=True)[1]]
        entry = entry[np.unique(node[entries.col[entry]], return_index=True)[1]]
        row, column, tried = entries.row[entry], entries.col[entry], out.copy()
        tried[row] = column
        fine = np.isin(node[column], _independent(trace, tried, node))
        out[row[fine]], left[entry[~fine]] = column[fine], False
    return out


def _independent(trace: sp.csr_array, pivot: IntArray, node: IntArray) -> IntArray:
    """The nodes whose unknowns are pivots (k,) of rows that see them along different directions."""
    rows = np.flatnonzero(pivot >= 0)
    at = node[pivot[rows]]
    blocks, block, _ = _blocks(sp.csr_array(trace[rows][:, pivot[rows]]), at)
    return np.asarray(at[np.linalg.svd(blocks, compute_uv=False)[block, -1] > OWN**2])


def _picked(rest: Array) -> IntArray:
    """Columns (p, r) of the pivots of the rows of blocks (p, r, c), row after row; -1 where a row has none."""
    every, picked = np.arange(len(rest)), np.full(rest.shape[:2], -1)
    for r in range(rest.shape[1]):
        row = rest[:, r]
        pick = np.argmax(np.abs(row), axis=1)
        value = row[every, pick]
        good = np.abs(value) > OWN
        picked[good, r] = pick[good]
        factor = rest[every, :, pick] * (good / np.where(good, value, 1.0))[:, None]
        rest = rest - factor[:, :, None] * row[:, None, :]
    return picked


def _inverse(matrix: sp.csr_array, node: IntArray) -> sp.csr_array | None:
    """The inverse of how jumps (k, k) depend on the unknowns in whose place they come: blocks of nodes, and chains."""
    own = _of_blocks(matrix, node)
    entries = matrix.tocoo()
    away = node[entries.row] != node[entries.col]
    across = sp.csr_array((entries.data[away], (entries.row[away], entries.col[away])), shape=matrix.shape)
    step, inverse, part = sp.csr_array(-own @ across), own, own
    for _ in range(_CHAIN):
        part = sp.csr_array(step @ part)
        if not part.nnz:
            return inverse
        inverse = sp.csr_array(inverse + part)
    return None


def _of_blocks(matrix: sp.csr_array, node: IntArray) -> sp.csr_array:
    """The inverse of the blocks of nodes on the diagonal of a matrix (k, k)."""
    blocks, block, slot = _blocks(matrix, node)
    number = np.full(blocks.shape[:2], -1)
    number[block, slot] = np.arange(node.size)
    rows, columns = (np.broadcast_to(one, blocks.shape) for one in (number[:, :, None], number[:, None, :]))
    real = (rows >= 0) & (columns >= 0)
    return sp.csr_array((np.linalg.inv(blocks)[real], (rows[real], columns[real])), shape=matrix.shape)


def _blocks(matrix: sp.csr_array, node: IntArray) -> tuple[Array, IntArray, IntArray]:
    """The blocks (p, 3, 3) of nodes on the diagonal of a matrix (k, k); block and row in it of each of its rows."""
    block, slot = _slots(node)
    entries = matrix.tocoo()
    within = node[entries.row] == node[entries.col]
    row, column = entries.row[within], entries.col[within]
    blocks = np.tile(np.eye(3), (int(block.max(initial=-1)) + 1, 1, 1))
    blocks[block, slot, slot] = 0.0
    blocks[block[row], slot[row], slot[column]] = entries.data[within]
    return blocks, block, slot
