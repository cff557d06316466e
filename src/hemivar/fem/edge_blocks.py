"""Symmetric matrices of blocks that couple the nodes of common cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.kernels.mesh_sums import BlockGraph
from hemivar.mesh.keys import EDGES, distinct_pairs
from hemivar.mesh.mesh import Mesh

__all__ = ["EdgeBlocks", "NodeGraph", "node_graph"]


@dataclass(frozen=True, eq=False)
class NodeGraph:
    """Which nodes couple: any two of a cell are joined by an edge."""

    cells: IntArray  # (M, L): nodes of the cells
    edges: IntArray  # (E, 2): nodes of the edges, smaller number first, sorted
    cell_edges: IntArray  # (M, P): edges of the cells
    local: IntArray  # (2, P): places in the cell of the first and of the second node of each of these edges
    count: int  # number of nodes N
    order: int  # of the elements

    def zeros(self, components: int) -> EdgeBlocks:
        """The zero matrix of blocks of so many components."""
        shape = (components, components)
        return EdgeBlocks(np.zeros((self.count, *shape)), np.zeros((len(self.edges), *shape)), self.edges)


def node_graph(mesh: Mesh, order: int) -> NodeGraph:
    """The graph of the nodes of a mesh with elements of order 1 or 2."""
    cells, count = mesh.cell_nodes(order), mesh.number_of_nodes
    if order == 1:
        return NodeGraph(cells, mesh.edges, mesh.cell_edges, np.array(EDGES[mesh.dim]).T, count, 1)
    local = np.array(np.triu_indices(cells.shape[1], 1))
    edges, number = distinct_pairs(cells[:, local[0]].ravel(), cells[:, local[1]].ravel())
    return NodeGraph(cells, edges, number.reshape(len(cells), -1), local, count + len(mesh.edges), order)


@dataclass(frozen=True, eq=False)
class EdgeBlocks:
    """A symmetric matrix of c x c blocks that couples nodes joined by an edge, see :class:`NodeGraph`."""

    diagonal: Array  # (N, c, c): block of every node
    upper: Array  # (E, c, c): block of every edge, rows of its first node and columns of its second one
    edges: IntArray  # (E, 2): nodes of the edges, smaller number first, sorted

    def times(self, field: Array) -> Array:
        """Product with nodal vectors, shape (N, c)."""
        product: Array = np.einsum("nij,nj->ni", self.diagonal, field)
        moving = np.any(field != 0.0, axis=1)
        low, high = self.edges.T
        for rows, columns, form in ((low, high, "eij,ej->ei"), (high, low, "eji,ej->ei")):
            edge = np.flatnonzero(moving[columns])
            force = np.einsum(form, self.upper[edge], field[columns[edge]])
            for c in range(field.shape[1]):
                product[:, c] += np.bincount(rows[edge], weights=force[:, c], minlength=len(field))
        return product

    def columns(self, dofs: IntArray) -> sp.csr_array:
        """The columns of some (distinct) components ``node c + i``, shape (N c, k)."""
        count, dim = self.diagonal.shape[:2]
        number = np.full(count * dim, -1, dtype=np.int64)
        number[dofs] = np.arange(len(dofs))
        wanted = np.zeros(count, dtype=bool)
        wanted[dofs // dim] = True
        low, high = self.edges.T
        before, behind = np.flatnonzero(wanted[high]), np.flatnonzero(wanted[low])
        nodes = np.flatnonzero(wanted)
        row = np.concatenate([nodes, low[before], high[behind]])
        column = np.concatenate([nodes, high[before], low[behind]])
        blocks = np.concatenate([self.diagonal[nodes], self.upper[before], self.upper[behind].transpose(0, 2, 1)])
        axis = np.arange(dim)
        rows = np.broadcast_to(row[:, None, None] * dim + axis[:, None], blocks.shape)
        columns = number[np.broadcast_to(column[:, None, None] * dim + axis, blocks.shape)]
        keep = columns >= 0
        return sp.csr_array((blocks[keep], (rows[keep], columns[keep])), shape=(count * dim, len(dofs)))

    def turn(self, directions: Array) -> None:
        """Go over to other components at every node, in place.

        Shapes: ``directions`` (N, c, c).
        """
        other = np.any(directions != np.eye(directions.shape[1]), axis=(1, 2))
        nodes = np.flatnonzero(other)
        block = directions[nodes] @ self.diagonal[nodes] @ directions[nodes].transpose(0, 2, 1)
        self.diagonal[nodes] = 0.5 * (block + block.transpose(0, 2, 1))
        low, high = self.edges.T
        edge = np.flatnonzero(other[low])
        self.upper[edge] = directions[low[edge]] @ self.upper[edge]
        edge = np.flatnonzero(other[high])
        self.upper[edge] = self.upper[edge] @ directions[high[edge]].transpose(0, 2, 1)

    def matrix(self, free: BoolArray | None = None) -> sp.csr_array:
        """Rows and columns of the free components, in the order of nodes; indices are sorted.

        Shapes: ``free`` (N, c).
        """
        count, dim = self.diagonal.shape[:2]
        free = np.ones((count, dim), dtype=bool) if free is None else free
        compiled = BlockGraph.of(self.edges, count, dim)
        if compiled is not None:
            diagonal, upper = np.ascontiguousarray(self.diagonal), np.ascontiguousarray(self.upper)
            parts = compiled.rows(diagonal, upper, np.ascontiguousarray(free))
            matrix = sp.csr_array(parts, shape=(len(parts[2]) - 1,) * 2)
            matrix.has_canonical_format = True  # SciPy would find out by a look at all entries
            return matrix
        low, high = self.edges.T
        node, axis, free = np.arange(count), np.arange(dim), free.ravel()
        blocks = np.concatenate([self.diagonal, self.upper, self.upper.transpose(0, 2, 1)])
        rows, columns = np.concatenate([node, low, high]) * dim, np.concatenate([node, high, low]) * dim
        row = np.broadcast_to(rows[:, None, None] + axis[:, None], blocks.shape)
        column = np.broadcast_to(columns[:, None, None] + axis, blocks.shape)
        keep, number = free[row] & free[column], np.cumsum(free) - 1
        entries = number[row[keep]], number[column[keep]]
        return sp.csr_array((blocks[keep], entries), shape=(np.count_nonzero(free),) * 2)
