"""Edges and facets of meshes, and matrices of blocks on nodes and edges, by the compiled kernels; all is checked."""

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

    Parameters
    ----------
    cells : int array, shape (M, 3) or (M, 4)
    nodes : int
        How many nodes there are.

    Returns
    -------
    edges : int array, shape (E, 2)
        Smaller number first, sorted.
    cell_edges : int array, shape (3, M) or (6, M)
        Local order 01, 12, 02 and, in space, 03, 13, 23.

    Raises
    ------
    ValueError
        An array is not what it should be.
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

    Facet i of a cell is opposite to its vertex i.  Facets are in the order of the places of their nodes.

    Parameters
    ----------
    cells : int array, shape (M, d + 1)
        Nodes.
    placed : int array, shape (M, d + 1)
        Places of these nodes, rising in each cell.
    nodes : int
        How many places there are.
    second : bool array, shape (M, d + 1), optional
        Facets of which the cell is the second one.

    Returns
    -------
    numbers : int array, shape (M, d + 1)
        Of the facets of the cells.
    signs : array, shape (M, d + 1)
        +1 in the first cell of a facet, -1 in the second one.
    owners : int array, shape (F, 2)
        The cells of each facet; -1 for none.
    facets, others : int arrays, shape (F, d)
        Nodes in the first and in the second cell; the same where there is none.

    Raises
    ------
    ValueError
        An array is not what it should be.
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

    Parameters
    ----------
    points : array, shape (N, d)
    cells : int array, shape (M, d + 1)
    numbers : int array, shape (M, d + 1)
        Of the facets of the cells, as :func:`mesh_facets` gives them.
    signs : array, shape (M, d + 1)
    facets : int
        How many facets there are.

    Returns
    -------
    jacobian : array, shape (M, d, d)
        B of ``x = B x^ + x_0``.
    gradients : array, shape (M, d + 1, d)
        Of the barycentric coordinates.
    normals : array, shape (F, d)
        Times the measures, outward from the first cell; of facets without a cell there is none.
    measures : array, shape (F,)

    Raises
    ------
    ValueError
        An array is not what it should be.
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

    Parameters
    ----------
    cells : int array, shape (M, d + 1)
    nodes : int

    Returns
    -------
    start : int array, shape (nodes + 1,)
        Where the pairs of each node begin.
    pairs : int array, shape (M (d + 1),)
        ``cell (d + 1) + vertex``, node after node.
    place : int32 array, shape (M (d + 1),)
        Of each pair among those of its node.

    Raises
    ------
    ValueError
        An array is not what it should be.
    """
    library = kernels()
    if library is None:
        return None
    corners, at = _corners(cells), library.address
    _expect("cells", cells, np.int64, (len(cells), corners))
    if nodes < 0:
        raise ValueError(f"there cannot be {nodes} nodes")
    start, pairs = np.empty(nodes + 1, dtype=np.int64), np.empty(cells.size, dtype=np.int64)
    corner = np.empty(cells.size, dtype=np.int32)
    status = library.call.hv_stars(corners, nodes, len(cells), at(cells), at(start), at(pairs), at(corner))
    if status == 2:
        raise ValueError(f"nodes of cells must be between 0 and {nodes - 1}")
    library.check(status)
    return start, pairs, corner


def alike_rows(values: Array, others: Array | None, tolerance: float) -> IntArray | None:
    """Numbers (n,) of rows: the same where two are, but for a part of the largest entry; None without kernels.

    Parameters
    ----------
    values : array, shape (n, q)
    others : array, shape (n, p), optional
        What has to be alike, too, over the largest entry of its own.
    tolerance : float
        This part.

    Raises
    ------
    ValueError
        An array is not what it should be.
    """
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
    """Nodes and edges that carry the blocks of a symmetric matrix.

    Parameters
    ----------
    library : Kernels
    edges : int array, shape (E, 2)
        Smaller number first, sorted.
    nodes : int

    Raises
    ------
    ValueError
        An array is not what it should be; of each method, too.
    """

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
        """Add ``int strain(v) : C strain(u)`` of linear elements to the blocks of the edges.

        Parameters
        ----------
        points : array, shape (N, d)
        cells : int array, shape (M, d + 1)
        part : slice
            k cells that are added.
        volumes : array, shape (k,)
            Of these.
        strains : int array, shape (c, d)
            The strain to which derivative k of component i belongs; c is 1 or d.
        matrices : array, shape (k or 1, v, v)
            C of these cells, symmetric; one for all of them.
        upper : array, shape (E, c, c)
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
        """Numbers, columns and starts of the rows of the free components, in the order of nodes.

        Parameters
        ----------
        diagonal : array, shape (N, c, c)
        upper : array, shape (E, c, c)
        free : bool array, shape (N, c)
        """
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
