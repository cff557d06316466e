"""Algebraic multigrid by smoothed aggregation: coarse levels from a matrix and its near-nullspace (rigid motions)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.linear.compiled import NodeSlots
from hemivar.linear.levels import COARSEST, Transfer
from hemivar.linear.truncated_level import narrow

__all__ = ["NodeSlots", "algebraic_levels", "independent_nodes", "near_each_other"]

#: Sweeps that smooth the near null space of the finest level, on which supports bend it.
_SWEEPS = 4
#: Nodes are coupled strongly from this part of the root of the product of their own blocks on: in the given matrix, and
#: in coarser ones, whose rows are longer.
_STRONG = (0.04, 0.08)
#: Jacobi step that smooths the prolongation, relative to the largest eigenvalue.
_DAMPING = 1.6
#: Diagonal entries below this part of the largest belong to unknowns that nothing reaches.
_GONE = 1e-14
#: Nodes of a block of the smoother at least: fewer stand in one block in any order.
_FEW_NODES = 512
#: Mean distance of neighbours, as a part of the nodes, from which on they are scattered. Nodes by lines and planes stay
#: below a tenth; mesh generators, which begin with the boundary, and refinement lie at a fifth.
_SCATTERED = 0.1


def algebraic_levels(
    matrix: sp.csr_array, near: Array | None = None, slots: NodeSlots | None = None
) -> list[tuple[sp.csr_array, Transfer]]:
    """Matrices below a given one, each with the transfer from it to the next finer one, from coarse to fine.

    Unknowns of one node are aggregated together; directions that a support takes away from a node are filled up by
    unknowns that nothing couples to.

    ``matrix (n, n)``: symmetric positive definite, or with a kernel that other terms remove; ``near (n, q)``: what it
    hardly resists; constants by default; ``slots``: by default each unknown is a node of its own.
    """
    n = matrix.shape[0]
    slots = NodeSlots.single(n) if slots is None else slots
    count, size = slots.nodes * slots.size, slots.size
    embedding = sp.csr_array((np.ones(n), (slots.places, np.arange(n))), shape=(count, n))
    empty = np.ones(count)
    empty[slots.places] = 0.0
    mean = float(matrix.diagonal().mean())
    filled = embedding @ matrix @ embedding.T + sp.diags_array(mean * empty)
    blocks = sp.csr_array(filled).tobsr((size, size))
    near = np.ones((n, 1)) if near is None else near
    candidates = np.zeros((count, near.shape[1]))
    candidates[slots.places] = near
    group = np.zeros(slots.nodes, dtype=np.int64)
    if slots.group is not None:
        np.maximum.at(group, slots.places // size, slots.group)
    levels: list[tuple[sp.csr_array, Transfer]] = []
    while len(levels) < 20 and blocks.shape[0] > COARSEST:
        blocks, prolongation, candidates, group = _coarsened(blocks, candidates, group, finest=not levels)
        if not levels:
            prolongation = sp.csr_array(embedding.T @ prolongation)
        levels.insert(0, (_regular(sp.csr_array(blocks)), Transfer.of(prolongation)))
    return levels


def _coarsened(
    matrix: sp.bsr_array, candidates: Array, group: IntArray, finest: bool
) -> tuple[sp.bsr_array, sp.csr_array, Array, IntArray]:
    """The next coarser matrix, the prolongation to it and near null space and groups on it, by smoothed aggregation.

    Jumps of two bodies have aggregates of their own: where they are free, each body moves alone; where they are held,
    nothing else is lost.

    After Vanek, Mandel and Brezina (Computing 56, 1996), of parts of PyAMG. Its own set-up starts an eigenvalue
    iteration from numpy's global random numbers, so that no two of its hierarchies are alike.
    """
    with IMPORTS:
        from pyamg.aggregation import fit_candidates  # only here: small problems do without it
        from pyamg.relaxation.relaxation import block_gauss_seidel

    matrix.indices, matrix.indptr = matrix.indices.astype(np.int32), matrix.indptr.astype(np.int32)
    size = matrix.blocksize[0]
    if finest:
        jumps = np.repeat(group % 2 == 1, size)
        columns = [np.where(jumps, 0.0, column) for column in candidates.T]  # the bodies move as one
        for column in columns:
            block_gauss_seidel(matrix, column, np.zeros(column.size), _SWEEPS, "symmetric", size)
        candidates = np.where(jumps[:, None], candidates, np.stack(columns, axis=1))
    members = _aggregates(matrix, group, _STRONG[0] if finest else _STRONG[1])
    tentative, coarse = fit_candidates(members, candidates)
    below_group = np.zeros(members.shape[1], dtype=np.int64)
    below_group[members.indices] = np.repeat(group, np.diff(members.indptr))
    diagonal = np.abs(matrix.diagonal())
    there = diagonal > _GONE * diagonal.max(initial=0.0)
    inverse = np.divide(1.0, diagonal, out=np.zeros(diagonal.size), where=there)
    weight = _DAMPING / _largest_eigenvalue(matrix, np.sqrt(inverse))
    prolongation = tentative - (sp.diags_array(weight * inverse) @ (matrix @ tentative)).tobsr(tentative.blocksize)
    below = (prolongation.T @ matrix @ prolongation).tobsr((candidates.shape[1],) * 2)
    return below, sp.csr_array(prolongation), coarse, below_group


def _aggregates(matrix: sp.bsr_array, group: IntArray, least: float) -> sp.csr_array:
    """Which aggregate of its group each node belongs to, as a matrix (nodes, aggregates) of ones.

    Nodes that are strongly coupled to no other go with the aggregate that they are coupled to most: left out, they
    would be corrected by no coarser level.
    """
    with IMPORTS:
        from pyamg.aggregation import standard_aggregation

    coupling = _couplings(matrix)
    coupling.data[np.repeat(group, np.diff(coupling.indptr)) != group[coupling.indices]] = 0.0
    strong = coupling.copy()
    strong.data[strong.data < least] = 0.0
    strong.eliminate_zeros()
    members = sp.csr_array(standard_aggregation(narrow(strong))[0])
    alone = np.diff(members.indptr) == 0
    if not alone.any():
        return members
    coupling.data[alone[coupling.indices]] = 0.0
    nearest, strength = _largest_of_rows(coupling)
    of_node = np.zeros(alone.size, dtype=np.int32)
    of_node[~alone] = members.indices
    of_node[alone] = of_node[nearest[alone]]
    member = np.flatnonzero(~alone | (strength > 0.0))
    return narrow(sp.csr_array((np.ones(member.size), (member, of_node[member])), shape=members.shape))


def independent_nodes(near: sp.csr_array, order: IntArray) -> BoolArray:
    """A maximal set of nodes (N,) of which no two are neighbours, found in an order; ``near (N, N)``: ones between
    neighbours."""
    with IMPORTS:
        from pyamg import amg_core

    turned = sp.csr_array(near[order][:, order])
    turned.setdiag(0.0)
    turned.eliminate_zeros()
    turned, marks = narrow(turned), np.full(order.size, -1, dtype=np.int32)
    amg_core.maximal_independent_set_serial(order.size, turned.indptr, turned.indices, -1, 1, 0, marks)
    out = np.zeros(order.size, dtype=bool)
    out[order] = marks == 1
    return out


def _couplings(matrix: sp.bsr_array) -> sp.csr_array:
    """Sizes of the blocks between nodes over the roots of those of their own, (nodes, nodes)."""
    nodes = matrix.indptr.size - 1
    sizes = np.sqrt(np.einsum("eij,eij->e", matrix.data, matrix.data))
    rows = np.repeat(np.arange(nodes), np.diff(matrix.indptr))
    own = np.zeros(nodes)
    own[rows[rows == matrix.indices]] = sizes[rows == matrix.indices]
    root = np.sqrt(np.where(own > 0.0, own, 1.0))
    return sp.csr_array(
        (sizes / (root[rows] * root[matrix.indices]), matrix.indices, matrix.indptr), shape=(nodes,) * 2
    )


def _largest_of_rows(matrix: sp.csr_array) -> tuple[IntArray, Array]:
    """The column of the largest entry of each row, and that entry; zeros for rows without any."""
    rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    order = np.lexsort((matrix.data, rows))
    last = order[matrix.indptr[1:] - 1]
    there = np.diff(matrix.indptr) > 0
    return np.where(there, matrix.indices[last], 0), np.where(there, matrix.data[last], 0.0)


def _largest_eigenvalue(matrix: sp.bsr_array, scale: Array) -> float:
    """The largest eigenvalue of ``diag(scale) A diag(scale)`` to about 1 %, from below, by Lanczos' method."""
    v = scale * np.random.default_rng(3).standard_normal(scale.size)
    v /= np.linalg.norm(v)
    before, beta, top = np.zeros_like(v), 0.0, 1.0
    along: list[float] = []
    beside: list[float] = []
    for _ in range(60):
        w = scale * (matrix @ (scale * v)) - beta * before
        along.append(float(v @ w))
        w -= along[-1] * v
        beta = float(np.linalg.norm(w))
        values, vectors = la.eigh_tridiagonal(along, beside)
        top = float(values[-1])
        if beta * abs(vectors[-1, -1]) <= 0.01 * top:
            break
        beside.append(beta)
        before, v = v, w / beta
    return top


def _regular(matrix: sp.csr_array) -> sp.csr_array:
    """The matrix with ones for diagonal entries that vanish, whose unknowns nothing reaches."""
    diagonal: Array = matrix.diagonal()
    gone = np.abs(diagonal) <= _GONE * np.abs(diagonal).max(initial=0.0)
    return sp.csr_array(matrix + sp.diags_array(gone.astype(float))) if gone.any() else matrix


def near_each_other(slots: NodeSlots, matrix: sp.csr_array) -> NodeSlots:
    """The same slots with the nodes in another order, by Cuthill and McKee, where the matrix couples distant ones.

    ``matrix (n, n)``: its pattern is symmetric.
    """
    node = slots.places // slots.size
    if slots.nodes <= _FEW_NODES or _mean_distance(node, matrix) <= _SCATTERED * slots.nodes:
        return slots
    with IMPORTS:
        from scipy.sparse.csgraph import reverse_cuthill_mckee

    member = sp.csr_array((np.ones(node.size), (node, np.arange(node.size))), shape=(slots.nodes, node.size))
    graph = sp.csr_array(member @ sp.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr)) @ member.T)
    number = np.empty(slots.nodes, dtype=np.int64)
    number[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(slots.nodes)
    return replace(slots, places=number[node] * slots.size + slots.places % slots.size)


def _mean_distance(node: IntArray, matrix: sp.csr_array) -> float:
    """How far apart coupled nodes are in their order, on the average, seen from some of the rows."""
    step = max(1, matrix.shape[0] // 1000)  # a thousand rows tell it
    rows = sp.csr_array(matrix[::step])
    own = np.repeat(node[::step], np.diff(rows.indptr))
    return float(np.abs(node[rows.indices] - own).mean()) if rows.nnz else 0.0
