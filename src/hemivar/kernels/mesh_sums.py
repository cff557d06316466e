"""Assembly by the compiled kernels: edges and facets of meshes, block matrices on nodes and edges; all is checked."""

from __future__ import annotations

import ctypes
import weakref

import numpy as np
from numpy.typing import DTypeLike

from hemivar.basics.types import AnyArray, Array, BoolArray, IntArray
from hemivar.kernels.library import Kernels, kernels

__all__ = ["BlockGraph", "alike_rows", "mesh_edges", "mesh_facets", "mesh_geometry", "mesh_stars"]

#: Most entries of a matrix with 32-bit indices.
_MOST = np.iinfo(np.int32).max


def mesh_edges(cells: IntArray, nodes: int) -> tuple[IntArray, IntArray] | None:
    """The edges of a mesh of triangles or tetrahedra; None where no kernels are compiled, or there are too many cells.

    Edges (E, 2) with the smaller number first, sorted, and those of each cell (3, M) or (6, M), in the local order 01,
    12, 02 and, in space, 03, 13, 23.
    """
    library = kernels()
    if library is None or cells.size >= _MOST:
        return None
    call, at = library.call, library.address
    corners = _corners(cells)
    _expect("cells", cells, np.int64, (len(cells), corners))
    made = ctypes.c_void_p()
    status = call.hv_edges_new(corners - 1, nodes, len(cells), at(cells), ctypes.addressof(made))
    if status == 1:
        library.check(status)
    if status:
        raise ValueError(f"nodes of cells must be distinct, and between 0 and {nodes - 1}")
    try:
        edges = np.empty((call.hv_edges_count(made), 2), dtype=np.int64)
        numbers = np.empty((3 if corners == 3 else 6, len(cells)), dtype=np.int64)
        library.check(call.hv_edges_get(made, at(edges), at(numbers)))
    finally:
        call.hv_edges_free(made)
    return edges, numbers


def mesh_facets(
    cells: IntArray, placed: IntArray, nodes: int, second: BoolArray | None = None
) -> tuple[IntArray, Array, IntArray, IntArray, IntArray] | None:
    """The facets of a mesh; None where no kernels are compiled.

    Facet i of a cell is opposite to its vertex i.  Facets are in the order of the places of their nodes: ``placed``
    (M, d + 1), rising in each cell.  ``second`` (M, d + 1) marks facets of which the cell is the second one.  What
    comes back: the numbers of the facets of the cells, +1 in the first cell of a facet and -1 in the second, (M, d + 1)
    each; the cells of each facet (F, 2), -1 for none; its nodes in the first and in the second cell, (F, d) each.
    """
    library = kernels()
    if library is None:
        return None
    call, at, dim = library.call, library.address, _corners(cells) - 1
    for name, array in (("cells", cells), ("places", placed)):
        _expect(name, array, np.int64, (len(cells), dim + 1))
    if second is not None:
        _expect("which are second", second, np.bool_, placed.shape)
    made = ctypes.c_void_p()
    last = None if second is None else at(second)
    status = call.hv_facets_new(dim, nodes, len(cells), at(placed), last, ctypes.addressof(made))
    if status == 1:
        library.check(status)
    if status:
        raise ValueError(f"places of cells must rise, from 0 to {nodes - 1}")
    try:
        count = call.hv_facets_count(made)
        numbers, signs = np.empty(cells.shape, dtype=np.int64), np.empty(cells.shape)
        owners, facets, others = (np.empty((count, width), dtype=np.int64) for width in (2, dim, dim))
        library.check(call.hv_facets_get(made, at(cells), at(numbers), at(signs), at(owners), at(facets), at(others)))
    finally:
        call.hv_facets_free(made)
    return numbers, signs, owners, facets, others


def mesh_geometry(
    points: Array, cells: IntArray, numbers: IntArray, signs: Array, facets: int
) -> tuple[Array, Array, Array, Array] | None:
    """Derivatives of cells, and normals of facets; None where no kernels are compiled.

    B of ``x = B x^ + x_0`` (M, d, d), gradients of the barycentric coordinates (M, d + 1, d), normals (F, d) times the
    measures (F,), outward from the first cell; ``numbers`` and ``signs`` are those of :func:`mesh_facets`.
    """
    library = kernels()
    if library is None:
        return None
    call, at, dim = library.call, library.address, _corners(cells) - 1
    _expect("points", points, np.float64, (len(points), dim))
    for name, array, end in (("nodes of cells", cells, len(points)), ("numbers of facets", numbers, facets)):
        _expect(name, array, np.int64, cells.shape)
        if array.size and not (array.min() >= 0 and array.max() < end):
            raise ValueError(f"{name} must be between 0 and {end - 1}")
    _expect("signs", signs, np.float64, cells.shape)
    jacobian, gradients = np.empty((len(cells), dim, dim)), np.empty((*cells.shape, dim))
    normals, measures = np.zeros((facets, dim)), np.zeros(facets)
    given, made = (points, cells, numbers, signs), (jacobian, gradients, normals, measures)
    library.check(call.hv_measure_simplices(dim, len(cells), *map(at, given), *map(at, made)))
    return made


def mesh_stars(cells: IntArray, nodes: int) -> tuple[IntArray, IntArray, AnyArray] | None:
    """The cells around each node of a mesh; None where no kernels are compiled.

    Where the pairs of each node begin (nodes + 1,), the pairs ``cell (d + 1) + vertex``, node after node, and the rank
    of each pair of a cell and a vertex among those of its node, (M (d + 1),) both.
    """
    library = kernels()
    if library is None:
        return None
    corners, at = _corners(cells), library.address
    _expect("cells", cells, np.int64, (len(cells), corners))
    if nodes < 0:
        raise ValueError(f"there cannot be {nodes} nodes")
    start, pairs = np.empty(nodes + 1, dtype=np.int64), np.empty(cells.size, dtype=np.int64)
    rank = np.empty(cells.size, dtype=np.int32)
    status = library.call.hv_stars(corners, nodes, len(cells), at(cells), at(start), at(pairs), at(rank))
    if status == 2:
        raise ValueError(f"nodes of cells must be between 0 and {nodes - 1}")
    library.check(status)
    return start, pairs, rank


def alike_rows(values: Array, others: Array | None, tolerance: float) -> IntArray | None:
    """Numbers (n,) of rows: the same where two are, but for a part of the largest entry; None without kernels."""
    library = kernels()
    if library is None:
        return None
    blocks = [values] if others is None else [values, others]
    for name, block in zip(("rows", "other rows"), blocks, strict=False):
        if block.ndim != 2:
            raise ValueError(f"{name} must have two dimensions, not {block.ndim}")
        _expect(name, block, np.float64, (len(values), block.shape[1]))
    if not tolerance > 0.0:
        raise ValueError(f"the tolerance must be positive, not {tolerance}")
    out, at = np.empty(len(values), dtype=np.int64), library.address
    more = (0, None) if others is None else (others.shape[1], at(others))
    call = library.call.hv_number_alike
    library.check(call(len(values), values.shape[1], at(values), *more, tolerance, at(out)))
    return out


class BlockGraph:
    """Nodes and edges that carry the blocks of a symmetric matrix."""

    def __init__(self, library: Kernels, edges: IntArray, nodes: int) -> None:
        _expect("edges", edges, np.int64, (len(edges), 2))
        self._library, self.nodes, self.edges = library, nodes, len(edges)
        self._pointer = library.call.hv_graph_new(nodes, len(edges), library.address(edges))
        if not self._pointer:
            raise ValueError(f"edges must be in order, and their nodes between 0 and {nodes - 1}")
        weakref.finalize(self, library.call.hv_graph_free, self._pointer)

    def __reduce__(self) -> str:
        raise TypeError("a compiled graph belongs to this process")

    @staticmethod
    def of(edges: IntArray, nodes: int, components: int) -> BlockGraph | None:
        """For blocks of so many components; None where no kernels are compiled, or know no such matrix."""
        library = kernels()
        large = components**2 * (nodes + 2 * len(edges)) >= _MOST
        return None if library is None or large or components > 3 else BlockGraph(library, edges, nodes)

    def add(
        self,
        points: Array,
        cells: IntArray,
        part: slice,
        volumes: Array,
        strains: IntArray,
        matrices: Array,
        upper: Array,
    ) -> None:
        """Add ``int strain(v) : C strain(u)`` of linear elements to the blocks of the edges, ``upper`` (E, c, c).

        Of the k cells of a part: volumes (k,), matrices C (k or 1, v, v), and in ``strains`` (c, d), c = 1 or d, the
        strain to which derivative k of component i belongs.
        """
        corners = _corners(cells)
        dim, (first, last, _) = corners - 1, part.indices(len(cells))
        count, components = last - first, len(strains)
        if components not in (1, dim):
            raise ValueError(f"components must be 1 or {dim}, not {components}")
        table = np.ascontiguousarray(strains, dtype=np.int32)
        _expect("points", points, np.float64, (self.nodes, dim))
        _expect("cells", cells, np.int64, (len(cells), corners))
        _expect("volumes", volumes, np.float64, (count,))
        _expect("strains", table, np.int32, (components, dim))
        size = matrices.shape[-1] if matrices.ndim == 3 else 0
        _expect("matrices", matrices, np.float64, (1 if len(matrices) == 1 else count, size, size))
        _expect("blocks of edges", upper, np.float64, (self.edges, components, components), changed=True)
        call, at = self._library.call, self._library.address
        failed = call.hv_graph_add(
            self._pointer, dim, self.nodes, len(cells), at(cells), at(points), at(volumes), first, last, components,
            size, len(matrices), at(table), at(matrices), at(upper),
        )  # fmt: skip
        if failed == 2:
            raise ValueError("strains must be numbered as the matrices, nodes and edges of cells be those of the graph")
        self._library.check(failed)

    def close(self, upper: Array) -> Array:
        """Blocks (N, c, c) on the diagonal that make the blocks of every row sum to zero, symmetrised."""
        components = upper.shape[-1]
        _expect("blocks of edges", upper, np.float64, (self.edges, components, components))
        diagonal, at = np.empty((self.nodes, components, components)), self._library.address
        self._library.check(self._library.call.hv_graph_close(self._pointer, components, at(upper), at(diagonal)))
        return diagonal

    def rows(self, diagonal: Array, upper: Array, free: BoolArray) -> tuple[Array, AnyArray, AnyArray]:
        """Numbers, columns and starts of the rows of the free components, in the order of nodes."""
        components = upper.shape[-1]
        _expect("blocks of edges", upper, np.float64, (self.edges, components, components))
        _expect("blocks of nodes", diagonal, np.float64, (self.nodes, components, components))
        _expect("free components", free, np.bool_, (self.nodes, components))
        call, at = self._library.call, self._library.address
        indptr = np.empty(int(np.count_nonzero(free)) + 1, dtype=np.int32)
        entries = call.hv_graph_lengths(self._pointer, components, at(free), at(indptr))
        self._library.check(max(-entries, 0))
        indices, data = np.empty(entries, dtype=np.int32), np.empty(entries)
        self._library.check(
            call.hv_graph_rows(
                self._pointer, components, at(free), at(diagonal), at(upper), at(indptr), at(indices), at(data)
            )
        )
        return data, indices, indptr


def _corners(cells: IntArray) -> int:
    if cells.ndim != 2 or cells.shape[1] not in (3, 4):
        raise ValueError(f"cells must be triangles or tetrahedra, shape (M, 3) or (M, 4), not {cells.shape}")
    return int(cells.shape[1])


def _expect(name: str, array: AnyArray, kind: DTypeLike, shape: tuple[int, ...], changed: bool = False) -> None:
    """That the kernels read what they expect, and nothing beyond its ends."""
    if array.dtype != kind or not array.flags.c_contiguous or not array.flags.aligned:
        raise ValueError(f"{name} must be a contiguous array of {np.dtype(kind).name}")
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, not {array.shape}")
    if changed and not array.flags.writeable:
        raise ValueError(f"{name} must not be read-only")
