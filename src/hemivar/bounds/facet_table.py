"""Facets of a mesh with the cells on their sides, and the geometry of the cells, all cells in the order of their nodes.

With the nodes of every cell and every facet sorted, vertex a of facet i (opposite to vertex i of a cell) is the a-th of
the other vertices of the cell, whatever cell one comes from.

Two bodies may touch along facets that coincide, with nodes of their own on either side.  With one number for all nodes
at a place such a facet is one, has a cell on both sides, and nodes are sorted by these numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import AnyArray, Array, BoolArray, IntArray
from hemivar.kernels.mesh_sums import mesh_facets, mesh_geometry, mesh_stars
from hemivar.mesh.keys import EDGES, facet_keys, pair_keys, sorted_keys
from hemivar.mesh.mesh import Mesh

__all__ = ["FacetTable", "facet_table", "facet_vertices"]

#: Cells that are looked at together: they fit a cache.
_CELLS = 1 << 12


def facet_vertices(dim: int, order: int = 1) -> IntArray:
    """Local vertices (d + 1, d) of the facets of a cell: facet i has all but vertex i.

    For order 2, in the plane, with their midpoints behind them, (3, 3), as the local nodes of a cell stand.
    """
    every = range(dim + 1)
    members = [[a for a in every if a != i] for i in every]
    if order == 2:
        members = [[*ends, dim + 1 + EDGES[dim].index((ends[0], ends[1]))] for ends in members]
    return np.array(members)


@dataclass(frozen=True, eq=False)
class FacetTable:
    """Facets and cells."""

    mesh: Mesh
    #: One number for all nodes at a place.
    places: IntArray  # (N,)
    #: Nodes of the cells, sorted by their places; cells keep their numbers.
    cells: IntArray  # (M, d + 1)
    #: Nodes of the facets, sorted alike: those of the first cell.
    facets: IntArray  # (F, d)
    #: The same of the second cell, which has others where two bodies touch; of the first where there is no second one.
    others: IntArray  # (F, d)
    #: Facet opposite to each vertex.
    cell_facets: IntArray  # (M, d + 1)
    #: +1 where the cell is the first of the facet, whose outward normal is that of the facet; -1 where it is the
    #: second.
    signs: Array  # (M, d + 1)
    #: The cells of each facet, the first and the second; -1 in place of a second one on the boundary.
    owners: IntArray  # (F, 2)
    #: Of the barycentric coordinates.
    gradients: Array  # (M, d + 1, d)
    #: Normals of the facets times their measures, outward from the first cell.
    area_normals: Array  # (F, d)
    #: Lengths or areas of the facets.
    measures: Array  # (F,)
    #: ``J = |det B|``.
    sizes: Array  # (M,)

    def __post_init__(self) -> None:
        for array in vars(self).values():
            if isinstance(array, np.ndarray):
                array.flags.writeable = False

    @property
    def dim(self) -> int:
        """Space dimension d."""
        return self.mesh.dim

    def on(self, mesh: Mesh) -> FacetTable:
        """The table of a mesh that has the same nodes and cells, and maybe other names."""
        if mesh is self.mesh:
            return self
        table, own = replace(self, mesh=mesh), {each.name for each in fields(self)}
        vars(table).update({name: value for name, value in vars(self).items() if name not in own})
        return table

    @property
    def volumes(self) -> Array:
        """Areas or volumes of the cells, shape (M,)."""
        return self.sizes / math.factorial(self.dim)

    @property
    def jacobian(self) -> Array:
        """B of ``x = B x^ + x_0``, shape (M, d, d)."""
        return _jacobian(self.mesh.points, self.cells)

    @property
    def inverse(self) -> Array:
        """Inverses of the Jacobians, shape (M, d, d): the gradients of all barycentric coordinates but the first."""
        return self.gradients[:, 1:]

    def normals_of(self, facets: IntArray | slice) -> Array:
        """Unit normals (k, d) of facets, outward from the first cell."""
        return np.asarray(self.area_normals[facets] / self.measures[facets, None])

    @cached_property
    def cut(self) -> BoolArray:
        """Along which facets two bodies touch, shape (F,): both sides have nodes of their own."""
        return np.asarray((self.facets != self.others).any(axis=1))

    @cached_property
    def interior(self) -> BoolArray:
        """Which facets lie inside of one body, shape (F,)."""
        return np.asarray((self.owners[:, 1] >= 0) & ~self.cut)

    @cached_property
    def outer(self) -> IntArray:
        """The other facets, shape (b,)."""
        return np.flatnonzero(~self.interior)

    @cached_property
    def outer_places(self) -> IntArray:
        """Where facets stand among those, shape (F,); 0 for facets inside."""
        places = np.zeros(len(self.facets), dtype=np.int64)
        places[self.outer] = np.arange(len(self.outer))
        return places

    def edge_numbers(self, simplices: IntArray, pairs: tuple[tuple[int, int], ...]) -> IntArray:
        """Numbers (k, e) of edges, by local ends in simplices (k, l); edges at one place have one number."""
        count = self.mesh.number_of_nodes
        known = pair_keys(self.places[np.asarray(self.mesh.edges, dtype=np.int64)], count)
        known = np.unique(known) if self.cut.any() else known
        ends = np.stack([simplices[:, pair] for pair in pairs], axis=1)
        return np.asarray(np.searchsorted(known, pair_keys(self.places[ends], count)))

    @cached_property
    def cell_edges(self) -> IntArray:
        """The edges of the cells by their numbers, in the order of ``EDGES``, shape (M, e)."""
        if not np.array_equal(self.places, np.arange(len(self.places))):
            return self.edge_numbers(self.cells, EDGES[self.dim])
        # the mesh knows them, for vertices in another order
        first, second = np.array(EDGES[self.dim]).T
        local = np.zeros((self.dim + 1, self.dim + 1), dtype=np.int64)
        local[first, second] = local[second, first] = np.arange(len(first))
        cells, known = self.mesh.cells, self.mesh.cell_edges
        out = np.empty((len(cells), len(first)), dtype=np.int64)
        for start in range(0, len(out), _CELLS):
            part = slice(start, start + _CELLS)
            rank = np.argsort(cells[part], axis=1)
            out[part] = np.take_along_axis(known[part], local[rank[:, first], rank[:, second]], axis=1)
        return out

    @cached_property
    def stars(self) -> tuple[IntArray, IntArray, AnyArray]:
        """Where the pairs of each vertex begin, (N + 1,), these pairs, and the place of each pair among those.

        A pair of a cell and a vertex of it has the number ``cell (d + 1) + vertex``.
        """
        compiled = mesh_stars(self.cells, self.mesh.number_of_nodes)
        if compiled is not None:
            return compiled
        vertex = self.cells.ravel()
        count = np.bincount(vertex, minlength=self.mesh.number_of_nodes)
        start, pairs = np.concatenate([[0], np.cumsum(count)]), np.argsort(vertex, kind="stable")
        rank = np.empty(len(pairs), dtype=np.int32)
        rank[pairs] = np.arange(len(pairs)) - np.repeat(start[:-1], count)
        return start, pairs, rank

    @cached_property
    def _keys(self) -> IntArray:
        return sorted_keys(self.places[self.facets], self.mesh.number_of_nodes)

    def numbers(self, facets: IntArray) -> IntArray:
        """Numbers (k,) of facets given by their nodes (k, d), in any order and on either side."""
        return np.asarray(np.searchsorted(self._keys, facet_keys(self.places[facets], self.mesh.number_of_nodes)))

    def of_cells(self, moments: Array, cells: slice = slice(None)) -> Array:
        """Moments on the facets of cells, outward, (M, d + 1, l, d), of those on the facets (F, l, d)."""
        out = np.take(moments, self.cell_facets[cells], axis=0)
        out *= self.signs[cells, :, None, None]
        return out


def _jacobian(points: Array, cells: IntArray) -> Array:
    """Differences (M, d, d) of the vertices of cells to the first one, in columns."""
    out = np.empty((len(cells), points.shape[1], points.shape[1]))
    for start in range(0, len(out), _CELLS):
        part = slice(start, start + _CELLS)
        corner = points[cells[part]]
        out[part] = (corner[:, 1:] - corner[:, :1]).transpose(0, 2, 1)
    return out


def _gradients(jacobian: Array) -> Array:
    """Those of the barycentric coordinates (M, d + 1, d): behind the first, the inverses of the Jacobians (M, d, d)."""
    dim = jacobian.shape[1]
    out = np.empty((len(jacobian), dim + 1, dim))
    for start in range(0, len(out), _CELLS):
        inverse, matrix = out[start : start + _CELLS, 1:], jacobian[start : start + _CELLS].transpose(1, 2, 0)
        if dim == 2:
            (a, b), (c, d) = matrix
            inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 0], inverse[:, 1, 1] = d, -b, -c, a
            inverse /= (a * d - b * c)[:, None, None]
        else:  # rows of the inverse are cross products of columns
            for i in range(3):
                p, q = matrix[:, (i + 1) % 3], matrix[:, (i + 2) % 3]
                for j in range(3):
                    inverse[:, i, j] = p[(j + 1) % 3] * q[(j + 2) % 3] - p[(j + 2) % 3] * q[(j + 1) % 3]
            inverse /= sum(matrix[j, 0] * inverse[:, 0, j] for j in range(3))[:, None, None]
        out[start : start + _CELLS, 0] = -inverse.sum(axis=1)
    return out


def facet_table(mesh: Mesh, places: IntArray | None = None, second: IntArray | None = None) -> FacetTable:
    """The facets of a mesh.

    Shapes: ``places`` (N,), ``second`` (k, d).
    """
    dim, count = mesh.dim, mesh.number_of_nodes
    cells, last = np.asarray(mesh.cells, dtype=np.int64), None
    if places is None:
        placed = cells = np.sort(cells, axis=1)
        places = np.arange(count)
    else:
        cells = np.take_along_axis(cells, np.argsort(places[cells], axis=1), axis=1)
        placed = np.asarray(places[cells], dtype=np.int64)
    if second is not None:
        last = np.isin(facet_keys(cells[:, facet_vertices(dim)].reshape(-1, dim), count), facet_keys(second, count))
        last = last.reshape(cells.shape)
    made = mesh_facets(cells, placed, count, last)
    numbers, signs, owners, facets, others = _facets(cells, places, count, last) if made is None else made
    points = np.ascontiguousarray(mesh.points)
    compiled = mesh_geometry(points, cells, numbers, signs, len(facets))
    shape = _geometry(points, cells, owners, numbers) if compiled is None else compiled[1:]
    if np.array_equal(facets, others):
        others = facets
    sizes = math.factorial(dim) * np.asarray(mesh.volumes)
    return FacetTable(mesh, places, cells, facets, others, numbers, signs, owners, *shape, sizes)


def _geometry(points: Array, cells: IntArray, owners: IntArray, numbers: IntArray) -> tuple[Array, Array, Array]:
    """Gradients of cells, normals and measures of facets, by NumPy."""
    jacobian = _jacobian(points, cells)
    gradients, dim = _gradients(jacobian), points.shape[1]
    cell = owners[:, 0]
    local = np.argmax(numbers[cell] == np.arange(len(owners))[:, None], axis=1)
    volumes = np.abs(np.linalg.det(jacobian)) / math.factorial(dim)
    normals = -dim * volumes[cell, None] * gradients[cell, local]
    return gradients, normals, np.asarray(np.linalg.norm(normals, axis=1))


def _facets(
    cells: IntArray, places: IntArray, count: int, last: BoolArray | None
) -> tuple[IntArray, Array, IntArray, IntArray, IntArray]:
    """Numbers and signs of the facets of cells, owners, and nodes of the facets in either owner, by NumPy."""
    dim = cells.shape[1] - 1
    every = cells[:, facet_vertices(dim)].reshape(-1, dim)
    keys = facet_keys(places[every], count)
    order = np.argsort(keys, kind="stable") if last is None else np.lexsort((last.ravel(), keys))
    new = np.ones(len(order), dtype=bool)
    new[1:] = keys[order[1:]] != keys[order[:-1]]
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    signs = np.empty(len(order))
    signs[order] = np.where(new, 1.0, -1.0)
    owners = np.full((int(new.sum()), 2), -1, dtype=np.int64)
    owners[number[order], np.where(new, 0, 1)] = order // (dim + 1)
    facets = every[order[new]]
    others = facets.copy()
    others[number[order[~new]]] = every[order[~new]]
    return number.reshape(cells.shape), signs.reshape(cells.shape), owners, facets, others
