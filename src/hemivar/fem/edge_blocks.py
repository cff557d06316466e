"""Symmetric matrices of blocks that couple the nodes of common cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.kernels import BlockGraph
from hemivar.mesh.keys import EDGES, distinct_pairs
from hemivar.mesh.mesh import Mesh

__all__ = ["EdgeBlocks", "NodeGraph", "node_graph"]

#: Nodes whose rows are formed at a time.
_ROWS = 1 << 13


@dataclass(frozen=True, eq=False)
class NodeGraph:
    """Which nodes couple: any two of a cell are joined by an edge.

    Attributes
    ----------
    cells : int array, shape (M, L)
        Nodes of the cells.
    edges : int array, shape (E, 2)
        Nodes of the edges, smaller number first, sorted.
    cell_edges : int array, shape (M, P)
        Edges of the cells.
    local : int array, shape (2, P)
        Places in the cell of the first and of the second node of each of these edges.
    count : int
        Number of nodes N.
    order : int
        Of the elements.
    """

    cells: IntArray
    edges: IntArray
    cell_edges: IntArray
    local: IntArray
    count: int
    order: int

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
    """A symmetric matrix of c x c blocks that couples nodes joined by an edge, see :class:`NodeGraph`.

    Attributes
    ----------
    diagonal : array, shape (N, c, c)
        Block of every node.
    upper : array, shape (E, c, c)
        Block of every edge, rows of its first node and columns of its second one.
    edges : int array, shape (E, 2)
        Nodes of the edges, smaller number first, sorted.
    """

    diagonal: Array
    upper: Array
    edges: IntArray

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
        place = np.full(count * dim, -1, dtype=np.int64)
        place[dofs] = np.arange(len(dofs))
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
        columns = place[np.broadcast_to(column[:, None, None] * dim + axis, blocks.shape)]
        keep = columns >= 0
        return sp.csr_array((blocks[keep], (rows[keep], columns[keep])), shape=(count * dim, len(dofs)))

    def turn(self, directions: Array) -> None:
        """Go over to other components at every node, in place.

        Parameters
        ----------
        directions : array, shape (N, c, c)
            ``directions[n, i]`` is the vector of component i at node n.
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

        Parameters
        ----------
        free : bool array, shape (N, c), or None
            None takes all components.
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
        nodes = np.flatnonzero(free.any(axis=1))
        starts, columns, source = self._rows(nodes)
        free = free[nodes]
        width = free.sum(axis=1)
        lengths = np.repeat(np.add.reduceat(width[columns], starts[:-1]), width) if len(nodes) else width
        entries, unknowns = int(lengths.sum()), int(width.sum())
        index = np.int32 if max(entries, unknowns) < np.iinfo(np.int32).max else np.int64
        indptr = np.zeros(unknowns + 1, dtype=index)
        np.cumsum(lengths, out=indptr[1:])
        indices, data = np.empty(entries, dtype=index), np.empty(entries)
        every = bool(free.all())
        number: NDArray[np.integer] = np.cumsum(free.ravel(), dtype=index)
        number -= 1
        done = 0
        for first in range(0, len(nodes), _ROWS):
            last = min(first + _ROWS, len(nodes))
            part = slice(starts[first], starts[last])
            blocks = self._gather(source[part], nodes[first:last])
            rows = starts[first : last + 1] - starts[first]
            shape = ((last - first) * dim, len(nodes) * dim)
            here = sp.bsr_array((blocks, columns[part], rows.astype(np.int32)), shape=shape).tocsr()
            values, where = here.data, here.indices
            if not every:
                keep = free.ravel()[where]
                keep &= np.repeat(free[first:last].ravel(), np.diff(here.indptr))
                values, where = values[keep], number[where[keep]]
            data[done : done + len(values)], indices[done : done + len(values)] = values, where
            done += len(values)
        return sp.csr_array((data, indices, indptr), shape=(unknowns, unknowns))

    def _rows(self, nodes: IntArray) -> tuple[IntArray, NDArray[np.int32], NDArray[np.int32]]:
        """Rows of blocks between these nodes: where each starts, columns, and where blocks come from.

        A block comes from edge ``e``, transposed if its source is ``E + e``; on the diagonal the source is ``2 E``. The
        edges being sorted, the upper triangle is a csr matrix as it stands, and turning it round sorts the lower one.
        """
        count, total = len(nodes), len(self.edges)
        number = np.full(len(self.diagonal), -1, dtype=np.int32)
        number[nodes] = np.arange(count, dtype=np.int32)
        low, high = number[self.edges[:, 0]], number[self.edges[:, 1]]
        edge = np.arange(total, dtype=np.int32)
        if count < len(self.diagonal):
            inside = (low >= 0) & (high >= 0)
            low, high, edge = low[inside], high[inside], edge[inside]
        above = np.zeros(count + 1, dtype=np.int32)
        np.cumsum(np.bincount(low, minlength=count), out=above[1:])
        lower = sp.csr_array((edge, high, above), shape=(count, count)).tocsc()
        below = lower.indptr.astype(np.int32, copy=False)
        row = np.arange(count, dtype=np.int32)
        starts = above.astype(np.int64) + below + np.arange(count + 1)
        columns, source = np.empty(starts[-1], dtype=np.int32), np.empty(starts[-1], dtype=np.int32)
        middle = below[1:] + above[:-1] + row
        columns[middle], source[middle] = row, 2 * total
        place = np.arange(len(edge)) + np.repeat(above[:-1] + row, np.diff(below))
        columns[place], source[place] = lower.indices, lower.data + np.int32(total)
        place = np.arange(len(edge)) + np.repeat(below[1:] + row + 1, np.diff(above))
        columns[place], source[place] = high, edge
        return starts, columns, source

    def _gather(self, source: NDArray[np.int32], nodes: IntArray) -> Array:
        """Blocks from their sources, those on the diagonal being of these nodes."""
        total = len(self.upper)
        kind, edge = np.divmod(source, max(total, 1))
        diagonal, below = kind == 2, kind == 1
        blocks = self.upper[edge] if total else np.empty((len(source), *self.diagonal.shape[1:]))
        blocks[below] = blocks[below].transpose(0, 2, 1)
        blocks[diagonal] = self.diagonal[nodes]
        return blocks
