"""Meshless coarsening (moving least squares): some of the nodes, and what interpolates between them.

A maximal independent set of the nodes is kept, those of contact boundaries and of edges and corners first.  What lies
between them follows by moving least squares, which reproduce linear displacements; on a contact boundary by the nodes
kept on it alone.  So the coarse problem has contact points of its own, at some of the finer ones, with their laws and
gaps, and every coarse unknown is one of the finer ones: it serves nested iteration and a geometric cycle as one on a
coarser mesh does (compare Adams, Demmel 1999).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.contact import ContactPoints, selects
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field, Space
from hemivar.fem.hierarchy import Coarser
from hemivar.linear.algebraic import independent_nodes

__all__ = ["LevelNodes", "coarser_by_nodes"]

#: Nodes that one between them follows at most, in the plane and in space.
_NEAR = {2: 5, 3: 8}
#: What is added to squared distances and moments, relative to their means: first, and where weights come out too large.
_SOFT, _RIDGES = 0.1, (1e-2, 0.1)
#: Sum of the sizes of weights that is too large.
_LARGE = 2.5
#: Part of the unknowns that a coarser problem may have.
_MOST = 0.6
#: Boundaries that a label tells apart.
_LABELS = 62
#: How many bodies may follow one another.
_CHAIN = 3
#: Rounding in a chosen unknown, which follows itself alone.
_SAME = 1e-10


@dataclass(frozen=True, eq=False)
class LevelNodes:
    """Nodes of a level, and which of them are neighbours.

    ``node (N,)``: their numbers in the field; ``points (N, d)``; ``near (N, N)``: ones between neighbours; ``label
    (N,)``: a bit for each contact boundary that a node has contact points on; ``rank (N,)``: those with a low one are
    kept first; ``whole (nodes, N)``: how all nodes of the field follow these.
    """

    node: IntArray
    points: Array
    near: sp.csr_array
    label: IntArray
    rank: Array
    whole: sp.csr_array

    @staticmethod
    def of(problem: DiscreteProblem) -> LevelNodes | None:
        """That of the mesh of a problem; None where its unknowns are not values at nodes, or contact points not at
        them."""
        field, contact = problem.field, problem.contact
        known = field is not None and not field.partial and selects(contact.trace) and contact.vectors.alone
        if field is None or not known or (contact.count and contact.node.min() < 0) or len(contact.names) > _LABELS:
            return None
        cells = field.mesh.cell_nodes(field.order)
        count, many = field.number_of_nodes, cells.shape[1]
        member = sp.csr_array((np.ones(cells.size), cells.ravel(), np.arange(0, cells.size + 1, many)))
        member.resize((len(cells), count))
        near = sp.csr_array(member.T @ member)
        label = np.zeros(count, dtype=np.int64)
        np.bitwise_or.at(label, contact.node, 1 << np.maximum(contact.boundary, 0))
        # A node at a corner or an edge has few cells.
        rank = np.bincount(cells.ravel(), minlength=count).astype(float)
        rank[label == 0] += many * count
        return LevelNodes(np.arange(count), field.nodes, near, label, rank, sp.eye_array(count, format="csr"))

    def kept(self) -> BoolArray:
        """A maximal independent set of the nodes."""
        return independent_nodes(self.near, np.argsort(self.rank, kind="stable"))

    def weights(self, kept: BoolArray) -> tuple[BoolArray, sp.csr_array]:
        """How all nodes follow those that are kept, (N, kept); nodes that no other leads are kept besides."""
        here = sp.csr_array(self.near[~kept])
        there = sp.csr_array(self.near[:, kept])
        pairs = sp.csr_array(here @ there).tocoo()
        row, column = np.flatnonzero(~kept)[pairs.row], np.flatnonzero(kept)[pairs.col]
        allowed = (self.label[row] & ~self.label[column]) == 0
        row, column = row[allowed], column[allowed]
        lonely = ~kept
        lonely[row] = False
        kept = kept | lonely
        offset = self.points[column] - self.points[row]
        square = np.einsum("ij,ij->i", offset, offset)
        order = np.lexsort((square, row))
        first = np.flatnonzero(np.diff(row[order], prepend=-1))
        rank = np.arange(order.size) - np.repeat(first, np.diff(first, append=order.size))
        near = rank < _NEAR[self.points.shape[1]]
        chosen, rank = order[near], rank[near]
        row, column, offset, square = row[chosen], column[chosen], offset[chosen], square[chosen]
        own, slot = np.unique(row, return_inverse=True)
        shape = (own.size, _NEAR[self.points.shape[1]])
        offsets, squares, there_ = np.zeros((*shape, offset.shape[1])), np.zeros(shape), np.zeros(shape, dtype=bool)
        offsets[slot, rank], squares[slot, rank], there_[slot, rank] = offset, square, True
        fitted = _least_squares(offsets, squares, there_)[slot, rank]
        same = np.flatnonzero(kept)
        number = np.cumsum(kept) - 1
        entries = np.concatenate([fitted, np.ones(same.size)])
        places = np.concatenate([row, same]), number[np.concatenate([column, same])]
        return kept, sp.csr_array((entries, places), shape=(kept.size, same.size))

    def below(self, kept: BoolArray, weights: sp.csr_array) -> LevelNodes:
        """Those that are kept; neighbours are those to which neighbours are nearest."""
        entries = weights.tocoo()
        order = np.lexsort((entries.data, entries.row))
        last = order[np.flatnonzero(np.diff(entries.row[order], append=-1))]
        nearest = sp.csr_array((np.ones(last.size), (entries.row[last], entries.col[last])), shape=weights.shape)
        near = sp.csr_array(nearest.T @ self.near @ nearest)
        near.data[:] = 1.0
        whole = sp.csr_array(self.whole @ weights)
        return LevelNodes(self.node[kept], self.points[kept], near, self.label[kept], self.rank[kept], whole)


def _least_squares(offset: Array, square: Array, there: BoolArray) -> Array:
    """Weights (k, q) of neighbours that lie ``offset (k, q, d)`` from a node, which reproduce linear functions."""
    count = there.sum(axis=1)
    mean = square.sum(axis=1) / count
    close = there / (square / mean[:, None] + _SOFT)
    moments = np.concatenate([there[:, :, None], offset / np.sqrt(mean)[:, None, None]], axis=2)
    matrix = np.einsum("kqi,kq,kqj->kij", moments, close, moments)
    size = close.sum(axis=1)
    fitted = np.zeros(there.shape)
    wanted = np.ones(len(offset), dtype=bool)
    for ridge in _RIDGES:
        soft = matrix[wanted] + ridge * size[wanted, None, None] * np.diag([0.0] + [1.0] * offset.shape[2])
        unit = np.zeros((len(soft), soft.shape[1], 1))
        unit[:, 0] = 1.0
        factor = np.linalg.solve(soft, unit)[..., 0]
        weights = close[wanted] * np.einsum("kqi,ki->kq", moments[wanted], factor)
        fitted[wanted] = weights / weights.sum(axis=1, keepdims=True)
        wanted = np.abs(fitted).sum(axis=1) > _LARGE
    return fitted


def coarser_by_nodes(problem: DiscreteProblem, graph: LevelNodes) -> tuple[Coarser, LevelNodes] | None:
    """The same contact problem on some of the nodes, and these.

    None where they are hardly fewer, or where a jump comes in the place of an unknown of another node.  The field of
    the coarser problem is one on the same mesh, of fewer unknowns.
    """
    field = problem.field
    assert field is not None
    kept, weights = graph.weights(graph.kept())
    own = field.own
    first = own.indptr[:-1]
    number = np.full(field.number_of_nodes, -1)
    number[graph.node] = np.arange(graph.node.size)
    of_unknown = number[own.indices[first] // field.components]
    chosen = kept[of_unknown]
    if chosen.sum() > _MOST * chosen.size or not chosen.any():
        return None
    prolongation = _prolongation(field, graph, kept, weights, chosen)
    if abs(prolongation[chosen] - sp.eye_array(prolongation.shape[1])).max() > _SAME:
        return None
    taken = np.flatnonzero(kept[number[problem.contact.node]]) if problem.contact.count else np.zeros(0, dtype=np.int64)
    contact = _contact(problem.contact, taken, number, weights, kept, chosen)
    if np.diff(contact.trace.indptr).sum() != np.diff(problem.contact.take(taken).trace.indptr).sum():
        return None
    select = sp.csr_array(sp.eye_array(chosen.size, format="csr")[chosen])
    left = graph.below(kept, weights)
    basis, lift = sp.csr_array(field.basis @ prolongation), sp.csr_array(select @ field.lift)
    below, shift = replace(field, basis=basis, lift=lift), None
    if field.prescribed.any():
        carried = np.asarray(left.whole @ field.prescribed.reshape(-1, field.components)[left.node]).ravel()
        shift = np.asarray(field.lift @ (carried - field.prescribed))
        below = replace(below, prescribed=field.prescribed + field.basis @ shift)
    stiffness = sp.csr_array(prolongation.T @ problem.stiffness @ prolongation)
    stiffness.sort_indices()
    model = Model(Quadratic(stiffness, assembled=True), contact, Space((below,)), None, problem.model.resisted)
    loading = Loading(prolongation.T @ problem.load, problem.offset[taken], problem.law.take(taken), 0.0)
    coarse = DiscreteProblem(model, loading, (), None, True)
    return Coarser(coarse, prolongation, field, taken, {}, shift), left


def _prolongation(
    field: Field, graph: LevelNodes, kept: BoolArray, weights: sp.csr_array, chosen: BoolArray
) -> sp.csr_array:
    """From the chosen unknowns to all of a field: displacements follow displacements, jumps of a slave jumps."""
    own, d = field.own, field.components
    rows = (graph.node[:, None] * d + np.arange(d)).ravel()
    kept_rows = (graph.node[kept][:, None] * d + np.arange(d)).ravel()
    turned = sp.csr_array(own.T)[:, rows]
    nodal = sp.csr_array(turned @ sp.kron(weights, sp.eye_array(d), format="csr"))
    jumps = np.diff(field.lift.tocsr().indptr) > np.diff(own.indptr)
    alone = sp.csr_array(nodal @ sp.csr_array(own.tocsr()[kept_rows])[:, chosen])
    if not jumps.any():
        return _cleaned(alone)
    prolongation, basis = alone, sp.csr_array(field.basis)[kept_rows]
    other = sp.diags_array((~jumps).astype(float))
    of_jumps = sp.csr_array(sp.diags_array(jumps.astype(float)) @ alone @ sp.diags_array(jumps[chosen].astype(float)))
    for _ in range(_CHAIN):
        prolongation = _cleaned(sp.csr_array(other @ (nodal @ (basis @ prolongation)) + of_jumps))
    return prolongation


def _cleaned(matrix: sp.csr_array) -> sp.csr_array:
    """Without entries that are rounding."""
    matrix.data[np.abs(matrix.data) < ROUNDED] = 0.0
    matrix.eliminate_zeros()
    return matrix


def _contact(
    contact: ContactPoints,
    taken: IntArray,
    position: IntArray,
    weights: sp.csr_array,
    kept: BoolArray,
    chosen: BoolArray,
) -> ContactPoints:
    """The contact points that are kept, each with its part of the area of the others."""
    number = np.cumsum(kept) - 1
    size = abs(weights)
    share = sp.csr_array(sp.diags_array(1.0 / size.sum(axis=1)) @ size)
    area = np.zeros(taken.size)
    for boundary in np.unique(contact.boundary):
        on, here = contact.boundary == boundary, contact.boundary[taken] == boundary
        whole = share[position[contact.node[on]]].T @ contact.weights[on]
        area[here] = whole[number[position[contact.node[taken[here]]]]]
    points = contact.take(taken)
    return replace(points, trace=sp.csr_array(points.trace[:, chosen]), weights=area, mean=None)
