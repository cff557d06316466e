"""The field of a basis of scikit-fem, over a mesh of simplices between its nodes: for pictures, files and time.

Elements of order 1 and 2 on triangles and tetrahedra keep their order.  Quadrilaterals and hexahedra are split between
their nodes into simplices of order 1, alike on both sides of a face: values at nodes are exact.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem
from numpy.lib.stride_tricks import sliding_window_view

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.space import Field
from hemivar.mesh.kinds import SHAPES
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.simplices import cones, cut_at_least

__all__ = ["form_field", "nearest_nodes", "rows_of"]

#: Corners of a cube as mesh files number them, of a square the first four, of numbers that count in binary.
_CUBE = np.array([0, 1, 3, 2, 4, 5, 7, 6])
#: Elements with one value at each node, and their orders.
_SIMPLEX = {"ElementTriP1": 1, "ElementTriP2": 2, "ElementTetP1": 1, "ElementTetP2": 2}
_LATTICE = ("ElementQuad1", "ElementQuad2", "ElementHex1", "ElementHex2")
#: Part of the size of a mesh within which places are one.
_SAME = 1e-9

#: Bases, forms, meshes and elements of scikit-fem, which states no types.
ScikitFem = Any


def form_field(basis: ScikitFem, free: IntArray, values: Array) -> Field | None:
    """The displacement, or the values at vertices of Morley's plate; None for other elements.

    Shapes: ``free`` (n,), ``values`` (N,).
    """
    elem, mesh = basis.elem, basis.mesh
    if isinstance(elem, skfem.ElementTriMorley):
        own = _simplices(mesh)
        return _partial(own, np.asarray(basis.nodal_dofs[0]), free, values)
    numbers = _components(basis)
    if numbers is None:
        return None
    known = _nodes(basis, numbers[:, 0])
    if known is None:
        return None
    own, order, node = known
    size, row = numbers.shape[1], _rows(numbers, node)
    chosen = sp.csr_array((np.ones(free.size), (row[free], np.arange(free.size))), shape=(row.size, free.size))
    prescribed = np.empty(row.size)
    prescribed[row] = values
    return Field(own, order, chosen, prescribed, size, "displacement" if size > 1 else "u", rigid=False)


def rows_of(basis: ScikitFem, field: Field) -> IntArray:
    """The row of the field that each unknown of the basis is, (N,); of a Lagrange element."""
    numbers = _components(basis)
    assert numbers is not None
    return _rows(numbers, nearest_nodes(field, basis.doflocs[:, numbers[:, 0]].T))


def _rows(numbers: IntArray, node: IntArray) -> IntArray:
    """Of unknowns (nodes, c) at nodes that have these numbers."""
    row = np.empty(numbers.size, dtype=np.int64)
    row[numbers] = node[:, None] * numbers.shape[1] + np.arange(numbers.shape[1])
    return row


def _components(basis: ScikitFem) -> IntArray | None:
    """Unknowns (nodes, c) of the components at each node of a Lagrange element; None for others."""
    elem = basis.elem
    inner = elem.elem if isinstance(elem, skfem.ElementVector) else elem
    if type(inner).__name__ not in (*_SIMPLEX, *_LATTICE):
        return None
    size = len(basis.element_dofs) // len(inner.doflocs)
    table = np.asarray(basis.element_dofs, dtype=np.int64).reshape(len(inner.doflocs), size, -1)
    _, first = np.unique(table[:, 0], return_index=True)
    return table.transpose(0, 2, 1).reshape(-1, size)[first]


def nearest_nodes(field: Field, points: Array) -> IntArray:
    """The node at each place (m, d), -1 where there is none."""
    with IMPORTS:
        from scipy.spatial import cKDTree

    off, node = cKDTree(field.nodes).query(points)
    return np.where(off <= _SAME * float(np.ptp(field.nodes, axis=0).max()), node, -1).astype(np.int64)


def _partial(mesh: Mesh, dofs: IntArray, free: IntArray, values: Array) -> Field:
    """The deflection at vertices, which does not say all of a plate."""
    column = np.full(values.size, -1, dtype=np.int64)
    column[free] = np.arange(free.size)
    seen = np.flatnonzero(column[dofs] >= 0)
    basis = sp.csr_array((np.ones(seen.size), (seen, column[dofs[seen]])), shape=(dofs.size, free.size))
    return Field(mesh, 1, basis, values[dofs], 1, "deflection", rigid=False, partial=True)


def _nodes(basis: ScikitFem, first: IntArray) -> tuple[Mesh, int, IntArray] | None:
    """A mesh, the order on it, and which of its nodes each node of the basis is; ``first`` numbers one component."""
    elem, mesh = basis.elem, basis.mesh
    inner = elem.elem if isinstance(elem, skfem.ElementVector) else elem
    points = np.asarray(basis.doflocs[:, first].T)
    if (order := _SIMPLEX.get(type(inner).__name__)) is not None:
        if not isinstance(mesh, skfem.MeshTri1 | skfem.MeshTet1):
            return None
        own = _simplices(mesh)
        field = Field(own, order, *_nothing(own.nodes(order).shape))
        numbers = nearest_nodes(field, points)
        return None if (numbers < 0).any() or numbers.size != field.number_of_nodes else (own, order, numbers)
    size = len(basis.element_dofs) // len(inner.doflocs)
    node = np.full(int(basis.N), -1, dtype=np.int64)
    node[first] = np.arange(first.size)
    table = node[np.asarray(basis.element_dofs)[::size]].T  # (cells, L)
    return _split(mesh, points, table, np.asarray(inner.doflocs)), 1, np.arange(first.size)


def _nothing(shape: tuple[int, ...]) -> tuple[sp.csr_array, Array]:
    """The basis of no unknowns, and zeros."""
    return sp.csr_array((shape[0] * shape[1], 0)), np.zeros(shape[0] * shape[1])


def _simplices(mesh: ScikitFem) -> Mesh:
    boundaries = {name: mesh.facets[:, facets].T for name, facets in _outer(mesh).items()}
    return Mesh.oriented(mesh.p.T[: mesh.nvertices], mesh.t.T, boundaries, _regions(mesh, 1))


def _outer(mesh: ScikitFem) -> Mapping[str, IntArray]:
    """Facets of the named boundaries, without those between two cells, which scikit-fem may name too."""
    named = {name: np.asarray(facets, dtype=np.int64) for name, facets in (mesh.boundaries or {}).items()}
    outer = {name: facets[np.asarray(mesh.f2t)[1, facets] < 0] for name, facets in named.items()}
    return {name: facets for name, facets in outer.items() if facets.size}


def _regions(mesh: ScikitFem, parts: int) -> Mapping[str, IntArray]:
    """Cells of the regions, where each was split into parts that follow one another."""
    return {
        name: (np.asarray(cells, dtype=np.int64)[:, None] * parts + np.arange(parts)).ravel()
        for name, cells in (mesh.subdomains or {}).items()
    }


def _split(mesh: ScikitFem, points: Array, table: IntArray, places: Array) -> Mesh:
    """Quadrilaterals or hexahedra between nodes ``table (cells, L)`` at places (L, d) of the reference cell."""
    dim = places.shape[1]
    along = round(len(places) ** (1.0 / dim))
    grid = np.lexsort(places.T).reshape((along,) * dim)  # the last coordinate counts slowest
    pieces = table[:, _windows(grid)].reshape(-1, 2**dim)  # (cells S, 2^d)
    if dim == 2:
        parts = cut_at_least(pieces)
    else:
        tetrahedra, real = cones(SHAPES["hexahedron"], pieces, pieces.min(axis=1))
        parts = tetrahedra[real]
    boundaries = {}
    for name, facets in _outer(mesh).items():
        cell = np.asarray(mesh.f2t)[0, facets]
        local = np.argmax(np.asarray(mesh.t2f)[:, cell] == np.asarray(facets), axis=0)
        sides = [_side(grid, places, corners) for corners in mesh.refdom.facets]
        pieces = np.concatenate(
            [table[cell[local == k]][:, side].reshape(-1, side.shape[-1]) for k, side in enumerate(sides)]
        )
        boundaries[name] = pieces if dim == 2 else cut_at_least(pieces).reshape(-1, 3)
    return Mesh.oriented(
        points, parts.reshape(-1, dim + 1), boundaries, _regions(mesh, parts.size // (len(table) * (dim + 1)))
    )


def _windows(grid: IntArray) -> IntArray:
    """The corners of the pieces between neighbours of a grid, (pieces, 2^d)."""
    return np.asarray(sliding_window_view(grid, (2,) * grid.ndim)).reshape(-1, 2**grid.ndim)[:, _CUBE[: 2**grid.ndim]]


def _side(grid: IntArray, places: Array, corners: IntArray) -> IntArray:
    """Pieces of the side of a grid of nodes on which the corners of a facet lie."""
    at = places[np.asarray(corners)]
    axis = int(np.argmin(np.ptp(at, axis=0)))
    end = 0 if at[0, axis] == 0.0 else -1
    return _windows(np.take(grid, end, axis=grid.ndim - 1 - axis))
