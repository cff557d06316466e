"""Triangle and tetrahedron meshes with named boundaries and regions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import permutations
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import real_array
from hemivar.basics.memory import mesh_bytes, refined_cells, require
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh._checks import (
    _check_cells,
    _check_coordinates,
    _check_cuts,
    _check_grid,
    _check_sides,
    _checked_arrays,
    _checked_regions,
    _counts,
    _index_array,
    _is_whole,
    _lengths,
    _place,
)
from hemivar.mesh._keys import (
    _EDGES,
    _FACETS,
    _distinct_pairs,
    _facet_keys,
    _frozen,
    _pair_keys,
    _refined_tetrahedra,
    _signed_volumes,
)

__all__ = ["Mesh", "Refinement", "box", "read_mesh", "rectangle"]


@dataclass(frozen=True, eq=False)
class Mesh(Portable):
    """A conforming mesh of triangles (2D) or tetrahedra (3D).

    Attributes
    ----------
    points : array, shape (N, d)
        Coordinates of the nodes, d = 2 or 3, any consistent unit of length.
    cells : int array, shape (M, d + 1)
        Nodes of the cells, positively oriented (counterclockwise in 2D). See :meth:`oriented`.
    boundaries : mapping of name to int array, shape (k, d)
        Nodes of the facets (edges in 2D, triangles in 3D) of each named part of the outer boundary. They are
        stored outward oriented.
    regions : mapping of name to int array, shape (k,)
        Numbers of the cells of each named part of the body.

    Raises
    ------
    ProblemError
        If a coordinate is not finite, or so large that rounding spoils the cells; if an index is out of range, a cell
        is degenerate or inverted, a node belongs to no cell, a facet belongs to more than two cells or to two on the
        same side; if a boundary is empty or holds a facet that is not on the outer boundary, or facets lie at one
        place with nodes of their own and without a name (parts that were not joined).
    """

    points: Array
    cells: IntArray
    boundaries: Mapping[str, IntArray] = field(default_factory=dict)
    regions: Mapping[str, IntArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        points, cells = _checked_arrays(self.points, self.cells)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "cells", cells)
        _check_cells(points, cells)
        object.__setattr__(self, "boundaries", MappingProxyType(self._match_boundaries(self.boundaries)))
        object.__setattr__(self, "regions", MappingProxyType(_checked_regions(self.regions, len(cells))))

    @classmethod
    def oriented(
        cls,
        points: Any,
        cells: Any,
        boundaries: Mapping[str, Any] | None = None,
        regions: Mapping[str, Any] | None = None,
    ) -> Mesh:
        """A mesh from cells of any orientation: inverted cells are turned round.

        Parameters are those of :class:`Mesh`.
        """
        nodes, connectivity = _checked_arrays(points, cells)
        negative = _signed_volumes(nodes, connectivity) < 0
        if negative.any():
            connectivity = connectivity.copy()
            connectivity[negative, :2] = connectivity[negative, 1::-1]
        return cls(nodes, connectivity, dict(boundaries or {}), dict(regions or {}))

    @classmethod
    def _trusted(
        cls,
        points: Array,
        cells: IntArray,
        boundaries: Mapping[str, IntArray],
        regions: Mapping[str, IntArray],
        origin: Callable[[], Refinement | None] | None = None,
    ) -> Mesh:
        """A mesh from arrays known to be valid, without checking them; ``origin`` makes its :attr:`parent`."""
        mesh = object.__new__(cls)
        object.__setattr__(mesh, "points", _frozen(points))
        object.__setattr__(mesh, "cells", _frozen(cells))
        object.__setattr__(mesh, "boundaries", MappingProxyType({k: _frozen(v) for k, v in boundaries.items()}))
        object.__setattr__(mesh, "regions", MappingProxyType({k: _frozen(v) for k, v in regions.items()}))
        object.__setattr__(mesh, "_origin", origin)
        return mesh

    def __repr__(self) -> str:
        cells = f"{len(self.cells)} {'triangles' if self.dim == 2 else 'tetrahedra'}"
        named = [
            f"{what} {', '.join(of)}" for what, of in (("boundaries", self.boundaries), ("regions", self.regions)) if of
        ]
        return f"Mesh({'; '.join([f'{len(self.points)} nodes, {cells}', *named])})"

    @cached_property
    def parent(self) -> Refinement | None:
        """The mesh that this one is the uniform refinement of, if it is known to be one.

        Known are refined meshes, and built-in ones with even numbers of cells.
        """
        origin: Callable[[], Refinement | None] | None = getattr(self, "_origin", None)
        return None if origin is None else origin()

    @property
    def dim(self) -> int:
        """Space dimension d, 2 or 3."""
        return int(self.points.shape[1])

    @property
    def number_of_nodes(self) -> int:
        """Number of vertices N."""
        return len(self.points)

    @property
    def number_of_cells(self) -> int:
        """Number of cells M."""
        return len(self.cells)

    @cached_property
    def size(self) -> float:
        """The mesh size h: length of the longest edge."""
        start, end = self.points[self.edges[:, 0]], self.points[self.edges[:, 1]]
        return float(np.sqrt(np.max(np.sum((end - start) ** 2, axis=1))))

    @cached_property
    def volumes(self) -> Array:
        """Areas (2D) or volumes (3D) of the cells, shape (M,)."""
        volumes: Array = _frozen(_signed_volumes(self.points, self.cells))
        return volumes

    @cached_property
    def _edge_data(self) -> tuple[IntArray, IntArray]:
        index = np.int32 if self.number_of_nodes < np.iinfo(np.int32).max else np.int64
        first, second = (
            np.concatenate([self.cells[:, a] for a in ends], dtype=index)
            for ends in zip(*_EDGES[self.dim], strict=True)
        )
        edges, number = _distinct_pairs(first, second)
        return _frozen(edges), _frozen(number.reshape(-1, len(self.cells)).T)

    @property
    def edges(self) -> IntArray:
        """Nodes of the edges, shape (E, 2), smaller number first, sorted."""
        return self._edge_data[0]

    @property
    def cell_edges(self) -> IntArray:
        """Edges of the cells, shape (M, 3) or (M, 6).

        Local order 01, 12, 02 and, in 3D, 03, 13, 23.
        """
        return self._edge_data[1]

    @cached_property
    def boundary_facets(self) -> IntArray:
        """All facets of the outer boundary, outward oriented, shape (k, d)."""
        facets, keys, _ = self._facets()
        _, first, counts = np.unique(keys, return_index=True, return_counts=True)
        outer: IntArray = _frozen(facets[np.sort(first[counts == 1])])
        return outer

    def nodes(self, order: int = 1) -> Array:
        """Displacement nodes: the vertices and, for order 2, the edge midpoints after them.

        Parameters
        ----------
        order : int
            1 or 2.

        Returns
        -------
        array, shape (N, d) or (N + E, d)
        """
        if order == 1:
            return self.points
        middle = 0.5 * (self.points[self.edges[:, 0]] + self.points[self.edges[:, 1]])
        return np.vstack([self.points, middle])

    def cell_nodes(self, order: int = 1) -> IntArray:
        """Displacement nodes of the cells, shape (M, d + 1) or, for order 2, (M, 6) in 2D and (M, 10) in 3D."""
        if order == 1:
            return self.cells
        return np.hstack([self.cells, self.number_of_nodes + self.cell_edges])

    def facet_nodes(self, facets: IntArray, order: int = 1) -> IntArray:
        """Displacement nodes of facets: vertices first, then midpoints.

        Parameters
        ----------
        facets : int array, shape (k, d)
        order : int
            1 or 2.

        Returns
        -------
        int array, shape (k, d) or, for order 2, (k, 3) in 2D and (k, 6) in 3D
        """
        if order == 1:
            return facets
        local = ((0, 1),) if self.dim == 2 else ((0, 1), (1, 2), (0, 2))
        pairs = np.stack([facets[:, pair] for pair in local], axis=1)
        count = self.number_of_nodes
        known = self.edges[:, 0] * count + self.edges[:, 1]
        return np.hstack([facets, count + np.searchsorted(known, _pair_keys(pairs, count))])

    def facet_normals(self, facets: IntArray) -> tuple[Array, Array]:
        """Unit normals, shape (k, d), and lengths or areas, shape (k,), of oriented facets, shape (k, d)."""
        corner = self.points[facets]
        first = corner[:, 1] - corner[:, 0]
        if self.dim == 2:
            vector = np.column_stack([first[:, 1], -first[:, 0]])
            measure = np.linalg.norm(vector, axis=1)
            return vector / measure[:, None], measure
        vector = np.cross(first, corner[:, 2] - corner[:, 0])
        norm = np.linalg.norm(vector, axis=1)
        return vector / norm[:, None], 0.5 * norm

    def refined(self, times: int = 1) -> Mesh:
        """Uniform refinement: each triangle is cut into four, each tetrahedron into eight.

        The nodes of the mesh keep their numbers; the midpoint of edge e becomes node ``N + e``. Boundaries
        and regions are carried over. The cells stemming from cell c are ``c + k M``. The octahedron inside a
        tetrahedron is cut along its shortest diagonal; children are numbered as in Bey (Tetrahedral grid refinement,
        Computing 55, 1995), so that shapes do not degrade and a :func:`box` gives boxes of the same kind.

        Parameters
        ----------
        times : int
            How often to refine, at least 0.

        Raises
        ------
        ProblemError
            If ``times`` is no such number, or the refined mesh does not fit into memory.
        """
        if not _is_whole(times, 0):
            raise ProblemError(f"times = {times!r}; give a whole number of at least 0")
        times = int(times)
        cells = refined_cells(self.dim, self.number_of_cells, times)
        if times:
            require(mesh_bytes(self.dim, cells), f"a mesh of {cells:.3g} cells", "refine less often")
        mesh = self
        for _ in range(times):
            mesh = mesh._refined_once()
        return mesh

    def _refined_once(self) -> Mesh:
        count = self.number_of_nodes
        points = self.nodes(2)
        v, e = self.cells.T, (count + self.cell_edges).T
        if self.dim == 2:
            groups = [(v[0], e[0], e[2]), (e[0], v[1], e[1]), (e[2], e[1], v[2]), (e[0], e[1], e[2])]
            cells = np.vstack([np.column_stack(group) for group in groups])
        else:
            cells = _refined_tetrahedra(points, self.cells, count + self.cell_edges)
        boundaries = {}
        for name, facets in self.boundaries.items():
            f = self.facet_nodes(facets, 2).T
            if self.dim == 2:
                parts = [(f[0], f[2]), (f[2], f[1])]
                children = np.stack([np.column_stack(part) for part in parts], axis=1).reshape(-1, 2)
            else:
                corners = [(f[0], f[3], f[5]), (f[3], f[1], f[4]), (f[5], f[4], f[2]), (f[3], f[4], f[5])]
                children = np.stack([np.column_stack(part) for part in corners], axis=1).reshape(-1, 3)
            boundaries[name] = children
        offsets = self.number_of_cells * np.arange(2**self.dim)
        regions = {name: (offsets[:, None] + ids).ravel() for name, ids in self.regions.items()}
        own = np.repeat(np.arange(count)[:, None], 2, axis=1)
        refinement = Refinement(self, np.vstack([own, self.edges]))
        return Mesh._trusted(points, cells, boundaries, regions, partial(_itself, refinement))

    def rotated(self, angle: float) -> Mesh:
        """The mesh turned counterclockwise by ``angle`` (radians) about the origin; 2D only."""
        if self.dim != 2:
            raise ProblemError("rotated(angle) turns plane meshes only; use moved(matrix) in 3D")
        c, s = math.cos(angle), math.sin(angle)
        return self.moved(np.array([[c, -s], [s, c]]))

    def scaled(self, factor: float) -> Mesh:
        """The mesh with all coordinates multiplied by ``factor > 0``."""
        if isinstance(factor, complex) or not (np.isfinite(factor) and factor > 0):
            raise ProblemError(f"factor = {factor}; a mesh is scaled by a positive number")
        return self.moved(factor * np.eye(self.dim))

    def moved(self, matrix: Any, shift: Any = 0.0) -> Mesh:
        """The image of the mesh under ``x -> matrix x + shift``.

        Parameters
        ----------
        matrix : array, shape (d, d)
            With positive determinant.
        shift : array, shape (d,), or float

        Raises
        ------
        ProblemError
            If these are not finite, or coordinates become so large that rounding spoils the cells.
        """
        linear, by = real_array(matrix, "matrix"), real_array(shift, "shift")
        with np.errstate(all="ignore"):
            if linear.shape != (self.dim, self.dim) or not np.linalg.slogdet(linear)[0] > 0:
                raise ProblemError(f"matrix must be {self.dim} by {self.dim} with positive determinant")
            if by.shape not in ((), (self.dim,)):
                raise ProblemError(f"shift has shape {by.shape}; give {self.dim} numbers, or one for all axes")
            points = self.points @ linear.T + by
            _check_coordinates(points, self.cells)
        origin = partial(_moved_parent, self, linear, shift)
        return Mesh._trusted(points, self.cells, self.boundaries, self.regions, origin)

    def with_boundaries(self, boundaries: Mapping[str, Any]) -> Mesh:
        """The mesh with these named boundaries in place of its own.

        Parameters
        ----------
        boundaries : mapping of name to int array (k, d), or to a callable
            A callable gets the midpoints of all outer facets, shape (k, d), and returns a mask, shape (k,).
        """
        outer = self.boundary_facets
        chosen = {}
        for name, value in boundaries.items():
            if callable(value):
                mask = np.asarray(value(self.points[outer].mean(axis=1)))
                if mask.shape != (len(outer),) or mask.dtype != bool:
                    raise ProblemError(
                        f"boundary '{name}': the callable returned shape {mask.shape} of {mask.dtype}; it "
                        f"must return a bool mask of shape ({len(outer)},)"
                    )
                chosen[name] = outer[mask]
            else:
                chosen[name] = value
        matched = self._match_boundaries(chosen)
        return Mesh._trusted(self.points, self.cells, matched, self.regions, partial(_parent_bounded, self, matched))

    def _facets(self) -> tuple[IntArray, IntArray, IntArray]:
        """All facets of all cells, their keys, and the cells they belong to."""
        d = self.dim
        facets = np.stack([self.cells[:, local] for local in _FACETS[d]], axis=1).reshape(-1, d)
        cell = np.repeat(np.arange(len(self.cells)), d + 1)
        return facets, _facet_keys(facets, self.number_of_nodes), cell

    def _match_boundaries(self, boundaries: Mapping[str, Any]) -> dict[str, IntArray]:
        """Check named facets and orient them outward."""
        facets, keys, _ = self._facets()
        order = np.argsort(keys, kind="stable")
        ordered = keys[order]
        start = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
        counts = np.diff(start, append=len(ordered))
        sorted_keys, first = ordered[start], order[start]
        _check_sides(self.points, facets, order, start, counts)
        result, named = {}, []
        for name, value in boundaries.items():
            given = _index_array(value, f"boundary '{name}'", self.number_of_nodes)
            if given.size == 0:
                raise ProblemError(f"boundary '{name}' holds no facets; remove it or fill it")
            if given.ndim != 2 or given.shape[1] != self.dim:
                raise ProblemError(
                    f"boundary '{name}' has shape {given.shape}; it must list {self.dim} nodes per facet, "
                    f"shape (k, {self.dim})"
                )
            wanted = _facet_keys(given, self.number_of_nodes)
            place = np.minimum(np.searchsorted(sorted_keys, wanted), len(sorted_keys) - 1)
            known = sorted_keys[place] == wanted
            outer = known & (counts[place] == 1)
            if not outer.all():
                bad = int(np.flatnonzero(~outer)[0])
                what = "lies between two cells" if known[bad] else "is not a facet of any cell"
                raise ProblemError(
                    f"boundary '{name}': the facet with nodes {given[bad].tolist()} {what} "
                    f"({np.count_nonzero(~outer)} such facets); list facets of the outer boundary only"
                )
            _, unique = np.unique(wanted, return_index=True)
            result[str(name)] = _frozen(facets[first[place[np.sort(unique)]]])
            named.append(first[place])
        if named:
            alone = np.sort(first[counts == 1])
            _check_cuts(self.points, facets[alone], np.searchsorted(alone, np.concatenate(named)))
        return result


def rectangle(
    size: tuple[float, float] = (1.0, 1.0),
    cells: int | tuple[int, int] = 8,
    pattern: Literal["cross", "right", "left"] = "right",
    origin: tuple[float, float] = (0.0, 0.0),
) -> Mesh:
    """A rectangle cut into triangles, with boundaries ``left``, ``right``, ``bottom`` and ``top``.

    Parameters
    ----------
    size : pair of floats
        Width and height.
    cells : int or pair of ints
        Number of small rectangles along x and y; one number serves for both.
    pattern : str
        ``"right"`` cuts each small rectangle by its rising diagonal, ``"left"`` by its falling one,
        ``"cross"`` into four triangles by its centre.
    origin : pair of floats
        The lower left corner.

    Raises
    ------
    ProblemError
        If a length or a number of cells is not positive, the pattern is unknown, the mesh does not fit into memory, or
        the origin is so far away that rounding spoils the cells.
    """
    if pattern not in ("cross", "right", "left"):
        raise ProblemError(f"pattern '{pattern}' is unknown; choose 'cross', 'right' or 'left'")
    width, height = _lengths(size, 2, "size")
    nx, ny = _counts(cells, 2)
    x0, y0 = _place(origin, 2, "origin")
    _check_grid((width, height), (nx, ny), (x0, y0), 4 if pattern == "cross" else 2)
    x = x0 + width * np.arange(nx + 1) / nx
    y = y0 + height * np.arange(ny + 1) / ny
    points = np.column_stack([np.tile(x, ny + 1), np.repeat(y, nx + 1)])
    corner = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
    a, b, c, d = corner, corner + 1, corner + nx + 2, corner + nx + 1
    if pattern == "cross":
        centre = len(points) + np.arange(nx * ny)
        middle = np.column_stack([np.tile(0.5 * (x[1:] + x[:-1]), ny), np.repeat(0.5 * (y[1:] + y[:-1]), nx)])
        points = np.vstack([points, middle])
        triangles = [(a, b, centre), (b, c, centre), (c, d, centre), (d, a, centre)]
    elif pattern == "right":
        triangles = [(a, b, c), (a, c, d)]
    else:
        triangles = [(a, b, d), (b, c, d)]
    connectivity = np.stack([np.column_stack(t) for t in triangles], axis=1).reshape(-1, 3)
    bottom = np.arange(nx + 1)
    top = bottom + ny * (nx + 1)
    left = np.arange(ny + 1) * (nx + 1)
    right = left + nx
    boundaries = {
        "left": np.column_stack([left[1:], left[:-1]]),
        "right": np.column_stack([right[:-1], right[1:]]),
        "bottom": np.column_stack([bottom[:-1], bottom[1:]]),
        "top": np.column_stack([top[1:], top[:-1]]),
    }
    origin_of_it = None
    if nx % 2 == 0 and ny % 2 == 0:
        origin_of_it = partial(_rectangle_parent, (width, height), (nx, ny), pattern, (x0, y0))
    return Mesh._trusted(points, connectivity, boundaries, {}, origin_of_it)


def box(
    size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    cells: int | tuple[int, int, int] = 8,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Mesh:
    """A box cut into tetrahedra.

    Boundaries: ``left`` and ``right`` (x), ``front`` and ``back`` (y), ``bottom`` and ``top`` (z). Each small box is
    cut into six tetrahedra around its diagonal from the lowest to the highest corner (Kuhn, Freudenthal); a box
    refined uniformly is a box of twice as many cells.

    Parameters
    ----------
    size : three floats
        Extent along x, y and z.
    cells : int or three ints
        Number of small boxes along x, y and z; one number serves for all.
    origin : three floats
        The corner of lowest coordinates.

    Raises
    ------
    ProblemError
        If a length or a number of cells is not positive, the mesh does not fit into memory, or the origin is so far
        away that rounding spoils the cells.
    """
    extent, lowest = _lengths(size, 3, "size"), _place(origin, 3, "origin")
    nx, ny, nz = _counts(cells, 3)
    _check_grid(extent, (nx, ny, nz), lowest, 6)
    x, y, z = (lowest[k] + extent[k] * np.arange(n + 1) / n for k, n in enumerate((nx, ny, nz)))
    nodes = np.arange((nx + 1) * (ny + 1) * (nz + 1)).reshape(nz + 1, ny + 1, nx + 1)
    points = np.empty((*nodes.shape, 3))
    points[..., 0], points[..., 1], points[..., 2] = x, y[:, None], z[:, None, None]
    step = (1, nx + 1, (nx + 1) * (ny + 1))
    corner = nodes[:-1, :-1, :-1].ravel()
    connectivity = np.empty((len(corner), 6, 4), dtype=np.int64)
    for number, way in enumerate(permutations(range(3))):
        path = np.cumsum([0] + [step[axis] for axis in way])
        if way not in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            path = np.roll(path, -1)  # turns an inverted tetrahedron and keeps the diagonal that refinement takes
        connectivity[:, number] = corner[:, None] + path
    boundaries = {
        "left": _split_squares(nodes[:, :, 0])[:, ::-1],
        "right": _split_squares(nodes[:, :, -1]),
        "front": _split_squares(nodes[:, 0, :]),
        "back": _split_squares(nodes[:, -1, :])[:, ::-1],
        "bottom": _split_squares(nodes[0])[:, ::-1],
        "top": _split_squares(nodes[-1]),
    }
    origin_of_it = None
    if nx % 2 == 0 and ny % 2 == 0 and nz % 2 == 0:
        origin_of_it = partial(_box_parent, extent, (nx, ny, nz), lowest)
    return Mesh._trusted(points.reshape(-1, 3), connectivity.reshape(-1, 4), boundaries, {}, origin_of_it)


def _split_squares(nodes: IntArray) -> IntArray:
    """The squares of a grid of nodes cut by their rising diagonal, counterclockwise if columns are the first axis."""
    a, b, c, d = (part.ravel() for part in (nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, 1:], nodes[1:, :-1]))
    return np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1).reshape(-1, 3)


def _box_parent(size: tuple[float, ...], cells: tuple[int, ...], origin: tuple[float, ...]) -> Refinement:
    nx, ny, nz = (n // 2 for n in cells)
    coarse = box((size[0], size[1], size[2]), (nx, ny, nz), (origin[0], origin[1], origin[2]))
    ends = []
    for extra in (0, 1):
        i, j, k = ((np.arange(n + 1) + extra) // 2 for n in cells)
        ends.append((i + (nx + 1) * (j[:, None] + (ny + 1) * k[:, None, None])).ravel())
    return Refinement(coarse, np.column_stack(ends))


def _rectangle_parent(
    size: tuple[float, float],
    cells: tuple[int, int],
    pattern: Literal["cross", "right", "left"],
    origin: tuple[float, float],
) -> Refinement | None:
    nx, ny = cells
    coarse = rectangle(size, (nx // 2, ny // 2), pattern, origin)
    j, i = (a.ravel() for a in np.indices((ny + 1, nx + 1)))
    width = nx // 2 + 1
    low, high = (i // 2, (i + 1) // 2), (j // 2, (j + 1) // 2)
    if pattern == "left":
        ends = np.column_stack([high[0] * width + low[1], high[1] * width + low[0]])
    else:
        ends = np.column_stack([high[0] * width + low[0], high[1] * width + low[1]])
    if pattern == "cross":
        centre = (nx // 2 + 1) * (ny // 2 + 1) + (j // 2) * (nx // 2) + i // 2
        odd = (i % 2 == 1) & (j % 2 == 1)
        ends[odd] = centre[odd, None]
        j, i = (a.ravel() for a in np.indices((ny, nx)))
        middle = (nx // 2 + 1) * (ny // 2 + 1) + (j // 2) * (nx // 2) + i // 2
        corner = (j // 2 + j % 2) * width + i // 2 + i % 2
        ends = np.vstack([ends, np.column_stack([middle, corner])])
    return Refinement(coarse, ends)


@dataclass(frozen=True, eq=False)
class Refinement(Portable):
    """How a mesh stems from a coarser one.

    Attributes
    ----------
    mesh : Mesh
        The coarser mesh.
    ends : int array, shape (N, 2)
        Each node of the finer mesh is the midpoint of these two nodes of the coarser one (twice the same where it is
        a node of it).
    """

    mesh: Mesh
    ends: IntArray

    @cached_property
    def interpolation(self) -> sp.csr_array:
        """Nodal values on the finer mesh from those on the coarser one, shape (N, N_coarse)."""
        count = len(self.ends)
        rows = np.repeat(np.arange(count), 2)
        shape = (count, self.mesh.number_of_nodes)
        return sp.csr_array((np.full(2 * count, 0.5), (rows, self.ends.ravel())), shape=shape)


def _itself(refinement: Refinement) -> Refinement:
    return refinement


def _moved_parent(mesh: Mesh, matrix: Array, shift: Any) -> Refinement | None:
    parent = mesh.parent
    return None if parent is None else Refinement(parent.mesh.moved(matrix, shift), parent.ends)


def _parent_bounded(mesh: Mesh, boundaries: Mapping[str, IntArray]) -> Refinement | None:
    """The parent, with the facets that these facets are parts of as boundaries."""
    parent = mesh.parent
    if parent is None:
        return None
    coarse = {}
    for name, facets in boundaries.items():
        corners = np.sort(parent.ends[facets].reshape(len(facets), -1), axis=1)
        first = np.diff(corners, axis=1, prepend=-1) > 0
        whole = first.sum(axis=1) == mesh.dim
        coarse[name] = np.unique(corners[whole][first[whole]].reshape(-1, mesh.dim), axis=0)
    return Refinement(parent.mesh.with_boundaries(coarse), parent.ends)


def read_mesh(path: str | Path) -> Mesh:
    """Read a mesh file: Gmsh (.msh), or a format that meshio reads.

    Physical groups of Gmsh and cell sets become boundaries (groups of facets) and regions (groups of cells).
    Nodes that no cell uses are dropped, as is the third coordinate of plane meshes; inverted cells are
    turned.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    ProblemError
        If the file is missing or cannot be read, does not fit into memory, or holds cells other than straight
        triangles or tetrahedra.
    """
    from hemivar.mesh.read import mesh_from_file

    return mesh_from_file(path)
