"""Triangle and tetrahedron meshes with named boundaries and regions."""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import permutations
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from hemivar._typing import Array, IntArray
from hemivar.disk import regular_file
from hemivar.errors import ProblemError

__all__ = ["Mesh", "Refinement", "box", "read_mesh", "rectangle"]

_EDGES = {2: ((0, 1), (1, 2), (0, 2)), 3: ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))}
_FACETS = {2: ((0, 1), (1, 2), (2, 0)), 3: ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))}
_FLAT = 1e-13
#: Entries or cells taken at a time.
_PORTION = 1 << 16


@dataclass(frozen=True, eq=False)
class Mesh:
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
        If a coordinate is not finite, an index is out of range, a cell is degenerate or inverted, a node
        belongs to no cell, a facet belongs to more than two cells, or a boundary is empty or holds a facet
        that is not on the outer boundary.
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
        """
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
        if not (np.isfinite(factor) and factor > 0):
            raise ProblemError(f"factor = {factor}; a mesh is scaled by a positive number")
        return self.moved(factor * np.eye(self.dim))

    def moved(self, matrix: Any, shift: Any = 0.0) -> Mesh:
        """The image of the mesh under ``x -> matrix x + shift``.

        Parameters
        ----------
        matrix : array, shape (d, d)
            With positive determinant.
        shift : array, shape (d,), or float
        """
        linear = np.asarray(matrix, dtype=float)
        if linear.shape != (self.dim, self.dim) or not np.linalg.det(linear) > 0:
            raise ProblemError(f"matrix must be {self.dim} by {self.dim} with positive determinant")
        points = self.points @ linear.T + np.asarray(shift, dtype=float)
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
        sorted_keys, first, counts = np.unique(keys, return_index=True, return_counts=True)
        if counts.max(initial=0) > 2:
            bad = facets[first[np.argmax(counts)]].tolist()
            raise ProblemError(
                f"the facet with nodes {bad} belongs to {counts.max()} cells; at most two cells may share "
                f"a facet: remove overlapping cells"
            )
        result = {}
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
        If a length or a number of cells is not positive or the pattern is unknown.
    """
    try:
        nx, ny = np.broadcast_to(np.asarray(cells), (2,)).tolist()
        width, height = (float(value) for value in size)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"size = {size!r}, cells = {cells!r}; give two lengths and one or two numbers") from error
    if not (math.isfinite(width) and math.isfinite(height) and width > 0 and height > 0):
        raise ProblemError(f"size = {tuple(size)}; width and height must be positive")
    if int(nx) != nx or int(ny) != ny or nx < 1 or ny < 1:
        raise ProblemError(f"cells = {cells}; give whole numbers of at least 1 along x and y")
    nx, ny = int(nx), int(ny)
    x = origin[0] + width * np.arange(nx + 1) / nx
    y = origin[1] + height * np.arange(ny + 1) / ny
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
    elif pattern == "left":
        triangles = [(a, b, d), (b, c, d)]
    else:
        raise ProblemError(f"pattern '{pattern}' is unknown; choose 'cross', 'right' or 'left'")
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
        origin_of_it = partial(_rectangle_parent, (width, height), (nx, ny), pattern, (origin[0], origin[1]))
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
        If a length or a number of cells is not positive.
    """
    try:
        counts = np.broadcast_to(np.asarray(cells), (3,)).tolist()
        extent, lowest = np.array(size, dtype=float), np.array(origin, dtype=float)
    except (TypeError, ValueError) as error:
        given = f"size = {size!r}, cells = {cells!r}, origin = {origin!r}"
        raise ProblemError(f"{given}; give three lengths, one or three numbers of cells, three coordinates") from error
    if extent.shape != (3,) or lowest.shape != (3,):
        raise ProblemError(f"size = {size!r}, origin = {origin!r}; give three numbers for each")
    if not (np.isfinite(extent).all() and np.isfinite(lowest).all() and (extent > 0).all()):
        raise ProblemError(f"size = {tuple(size)}, origin = {tuple(origin)}; lengths must be positive, all finite")
    if any(int(n) != n or n < 1 for n in counts):
        raise ProblemError(f"cells = {cells}; give whole numbers of at least 1 along x, y and z")
    nx, ny, nz = (int(n) for n in counts)
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
        origin_of_it = partial(_box_parent, tuple(extent), (nx, ny, nz), tuple(lowest))
    return Mesh._trusted(points.reshape(-1, 3), connectivity.reshape(-1, 4), boundaries, {}, origin_of_it)


def _split_squares(nodes: IntArray) -> IntArray:
    """The squares of a grid of nodes cut by their rising diagonal, counterclockwise if columns are the first axis."""
    a, b, c, d = (part.ravel() for part in (nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, 1:], nodes[1:, :-1]))
    return np.stack([np.column_stack([a, b, c]), np.column_stack([a, c, d])], axis=1).reshape(-1, 3)


def _box_parent(
    size: tuple[float, float, float], cells: tuple[int, int, int], origin: tuple[float, float, float]
) -> Refinement:
    nx, ny, nz = (n // 2 for n in cells)
    coarse = box(size, (nx, ny, nz), origin)
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
class Refinement:
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


_MOST_BYTES = 2**33
_CELL_DIMENSION = {"vertex": 0, "line": 1, "triangle": 2, "tetra": 3}


def read_mesh(path: str | Path) -> Mesh:
    """Read a mesh file (Gmsh 2.2 and 4.1, and whatever meshio reads).

    Physical groups of Gmsh and cell sets become boundaries (groups of facets) and regions (groups of cells).
    Nodes that no cell uses are dropped, as is the third coordinate of plane meshes; inverted cells are
    turned.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    ProblemError
        If the file is missing or cannot be read, or holds cells other than straight triangles or tetrahedra.
    """
    raw = _read_silently(Path(path))
    foreign = sorted({block.type for block in raw.cells} - set(_CELL_DIMENSION))
    if foreign:
        raise ProblemError(
            f"'{path}' holds cells of type {', '.join(foreign)}; only straight-sided triangles and "
            f"tetrahedra are supported: mesh with simplices of order 1 (no recombination)"
        )
    dims = [_CELL_DIMENSION[block.type] for block in raw.cells]
    dim = max(dims, default=0)
    if dim < 2:
        raise ProblemError(
            f"'{path}' holds no triangles or tetrahedra; if it comes from Gmsh, put the body into a physical group"
        )
    points = np.asarray(raw.points, dtype=float)
    cells = np.vstack([np.asarray(block.data) for block in raw.cells if block.type == _SIMPLEX[dim]])
    used = np.unique(cells)
    if dim == 2 and points.shape[1] == 3:
        height = points[used, 2]
        extent = np.ptp(points[used], axis=0).max()
        if np.ptp(height) > 1e-10 * max(extent, 1e-300):
            raise ProblemError(
                f"'{path}' is a surface in space (z from {height.min():g} to {height.max():g}); a plane "
                f"mesh must have constant z, a solid one needs tetrahedra"
            )
        points = points[:, :2]
    number = np.full(len(points), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    boundaries: dict[str, IntArray] = {}
    regions: dict[str, IntArray] = {}
    for (group_dim, name), members in _groups(raw, dims).items():
        if group_dim == dim - 1:
            facets = [np.asarray(raw.cells[block].data)[ids] for block, ids in members]
            facets_now = number[np.vstack(facets)]
            if np.any(facets_now < 0):
                raise ProblemError(f"'{path}': group '{name}' has facets that belong to no cell; remove them")
            boundaries[name] = facets_now
        elif group_dim == dim:
            starts = _block_starts(raw, _SIMPLEX[dim])
            regions[name] = np.unique(np.concatenate([starts[block] + ids for block, ids in members]))
    return Mesh.oriented(points[used], number[cells], boundaries, regions)


_SIMPLEX = {2: "triangle", 3: "tetra"}


def _read_silently(path: Path) -> Any:
    """The meshio mesh of a file; meshio's printing is swallowed and its failures reported in one line."""
    import meshio

    if not path.exists():
        raise ProblemError(f"mesh file '{path}' does not exist; check the path")
    regular_file(path, "mesh file", _MOST_BYTES)
    noise = io.StringIO()
    try:
        with contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        if isinstance(error, SystemExit):
            reason = " ".join(noise.getvalue().split()) or "unknown format"
        raise ProblemError(
            f"mesh file '{path}' cannot be read ({reason[:200]}); save it as Gmsh 2.2 or 4.1 or VTU"
        ) from error


def _block_starts(raw: Any, kind: str) -> dict[int, int]:
    """Number of the first cell of each block of one kind, counting only that kind."""
    starts, total = {}, 0
    for number, block in enumerate(raw.cells):
        if block.type == kind:
            starts[number] = total
            total += len(block.data)
    return starts


def _groups(raw: Any, dims: Iterable[int]) -> dict[tuple[int, str], list[tuple[int, IntArray]]]:
    """Named groups of a meshio mesh: (dimension, name) to a list of (block, cells of the block)."""
    block_dims = list(dims)
    found: dict[tuple[int, str], list[tuple[int, IntArray]]] = {}
    for name, blocks in raw.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        for number, ids in enumerate(blocks):
            if ids is not None and len(ids) > 0:
                index = np.asarray(ids, dtype=np.int64)
                found.setdefault((block_dims[number], name), []).append((number, index))
    names = {(int(value[1]), int(value[0])): str(key) for key, value in raw.field_data.items() if len(value) == 2}
    tagged: dict[tuple[int, str], list[tuple[int, IntArray]]] = {}
    for number, tags in enumerate(raw.cell_data.get("gmsh:physical", [])):
        for tag in np.unique(tags):
            if tag == 0:
                continue
            key = (block_dims[number], names.get((block_dims[number], int(tag)), str(int(tag))))
            if key not in found:
                tagged.setdefault(key, []).append((number, np.flatnonzero(np.asarray(tags) == tag)))
    return found | tagged


def _refined_tetrahedra(points: Array, cells: IntArray, middles: IntArray) -> IntArray:
    """Eight children of each tetrahedron, positively oriented.

    The octahedron inside is cut along the diagonal between the midpoints of 02 and 13, for which tetrahedra are turned
    if another diagonal is shorter.
    """
    ends = ((2, 4), (1, 3), (0, 5))
    lengths = [np.sum((points[middles[:, a]] - points[middles[:, b]]) ** 2, axis=1) for a, b in ends]
    shortest = np.argmin([lengths[0] * (1.0 - 1e-9), *lengths[1:]], axis=0)
    v, e = cells.copy(), middles.copy()
    for way, corners, edges in ((1, (0, 2, 3, 1), (2, 5, 3, 0, 1, 4)), (2, (0, 3, 1, 2), (3, 4, 0, 2, 5, 1))):
        turned = np.flatnonzero(shortest == way)
        v[turned] = cells[turned][:, corners]
        e[turned] = middles[turned][:, edges]
    (v0, v1, v2, v3), (e01, e12, e02, e03, e13, e23) = v.T, e.T
    children = [
        (v0, e01, e02, e03), (e01, v1, e12, e13), (e02, e12, v2, e23), (e03, e13, e23, v3),
        (e01, e02, e03, e13), (e02, e12, e13, e01), (e02, e03, e13, e23), (e12, e13, e23, e02),
    ]  # fmt: skip
    return np.vstack([np.column_stack(child) for child in children])


def _frozen(array: Any) -> Any:
    view = np.asarray(array).view()
    view.flags.writeable = False
    return view


def _pair_keys(pairs: IntArray, count: int) -> IntArray:
    """One number per pair of node numbers (last axis), whatever the order in the pair."""
    return np.asarray(np.minimum(pairs[..., 0], pairs[..., 1]) * count + np.maximum(pairs[..., 0], pairs[..., 1]))


def _distinct_pairs(first: NDArray[Any], second: NDArray[Any]) -> tuple[IntArray, IntArray]:
    """Distinct unordered pairs (E, 2), smaller number first, sorted; and the number of the pair of each entry.

    Pair and place of each entry are sorted together as one integer where they fit into 64 bits, which is several times
    faster than sorting an index.  The rest goes by portions: most of its time would go into fresh memory.
    """
    portions = [slice(start, min(start + _PORTION, len(first))) for start in range(0, len(first), _PORTION)]
    lows = (np.minimum(first[part], second[part]).astype(np.int64) for part in portions)
    spans = (np.abs(first[part] - second[part]).astype(np.int64) for part in portions)
    tops = [max(int(values.max()) for values in lows), max(int(values.max()) for values in spans), len(first)]
    _, width, shift = (top.bit_length() for top in tops)
    number = np.empty(len(first), dtype=np.int64)
    if sum(top.bit_length() for top in tops) > 64:
        keys = (np.minimum(first, second).astype(np.int64) << width) | np.abs(first - second)
        distinct, number[:] = np.unique(keys, return_inverse=True)
    else:
        packed = np.empty(len(first), dtype=np.uint64)
        for part in portions:
            key = (np.minimum(first[part], second[part]).astype(np.uint64) << np.uint64(width)) | np.abs(
                first[part] - second[part]
            ).astype(np.uint64)
            packed[part] = (key << np.uint64(shift)) | np.arange(part.start, part.stop, dtype=np.uint64)
        packed.sort()
        found, seen, before = [], -1, np.uint64(0)
        for part in portions:
            key = packed[part] >> np.uint64(shift)
            new = np.concatenate([[seen < 0 or key[0] != before], key[1:] != key[:-1]])
            place = packed[part] & np.uint64((1 << shift) - 1)
            number[place.astype(np.int64)] = seen + np.cumsum(new)
            found.append(key[new])
            seen, before = seen + int(np.count_nonzero(new)), key[-1]
        distinct = np.concatenate(found).astype(np.int64)
    start = distinct >> width
    return np.column_stack([start, start + (distinct & ((1 << width) - 1))]), number


def _facet_keys(facets: IntArray, count: int) -> IntArray:
    """One number per facet, whatever the order of its nodes."""
    if facets.shape[1] == 2:
        return _pair_keys(facets, count)
    if count > 2_000_000:
        raise ProblemError(f"the mesh has {count} nodes; its boundaries can be found on up to two million")
    low, middle, high = np.sort(facets, axis=1).T
    return np.asarray((low * count + middle) * count + high)


def _signed_volumes(points: Array, cells: IntArray) -> Array:
    volumes = np.empty(len(cells))
    for start in range(0, len(cells), _PORTION):
        part = slice(start, start + _PORTION)
        first, *others = cells[part].T
        side = [[x[other] - x[first] for x in points.T] for other in others]
        if len(side) == 2:
            volumes[part] = 0.5 * (side[0][0] * side[1][1] - side[0][1] * side[1][0])
        else:
            (a, b, c), (d, e, f), (g, h, i) = side
            volumes[part] = (a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)) / 6.0
    return volumes


def _index_array(value: Any, name: str, count: int) -> IntArray:
    array = np.asarray(value)
    if array.size == 0:
        return np.zeros((0, 0), dtype=np.int64)
    if array.dtype.kind not in "iu":
        raise ProblemError(f"{name} must hold whole numbers, not {array.dtype}")
    array = array.astype(np.int64)
    if array.min() < 0 or array.max() >= count:
        bad = int(array.min() if array.min() < 0 else array.max())
        raise ProblemError(f"{name} refers to number {bad}; valid numbers are 0 to {count - 1}")
    return array


def _checked_arrays(points: Any, cells: Any) -> tuple[Array, IntArray]:
    try:
        nodes = np.array(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"points is not an array of real numbers ({error})") from error
    if nodes.ndim != 2 or nodes.shape[1] not in (2, 3) or len(nodes) == 0:
        raise ProblemError(f"points has shape {nodes.shape}; it must be (N, 2) or (N, 3)")
    finite = np.isfinite(nodes).all(axis=1)
    if not finite.all():
        bad = int(np.flatnonzero(~finite)[0])
        raise ProblemError(f"point {bad} = {nodes[bad].tolist()}; every coordinate must be finite")
    connectivity = _index_array(cells, "cells", len(nodes))
    dim = nodes.shape[1]
    if connectivity.ndim != 2 or connectivity.shape[1] != dim + 1 or len(connectivity) == 0:
        kind = "triangles" if dim == 2 else "tetrahedra"
        raise ProblemError(f"cells has shape {connectivity.shape}; {kind} need shape (M, {dim + 1})")
    return _frozen(nodes), _frozen(connectivity)


def _check_cells(points: Array, cells: IntArray) -> None:
    volume = _signed_volumes(points, cells)
    longest = np.zeros(len(cells))
    for a, b in _EDGES[points.shape[1]]:
        np.maximum(longest, np.sum((points[cells[:, a]] - points[cells[:, b]]) ** 2, axis=1), out=longest)
    flat = np.abs(volume) <= _FLAT * np.sqrt(longest) ** points.shape[1]
    if flat.any():
        raise ProblemError(
            f"{np.count_nonzero(flat)} cells are degenerate (no volume): cells {_some(flat)}; remove them or "
            f"separate their nodes"
        )
    if np.any(volume < 0):
        raise ProblemError(
            f"{np.count_nonzero(volume < 0)} cells are inverted: cells {_some(volume < 0)}; swap two of "
            f"their nodes or build the mesh with Mesh.oriented(...)"
        )
    lonely = np.bincount(cells.ravel(), minlength=len(points)) == 0
    if lonely.any():
        raise ProblemError(
            f"{np.count_nonzero(lonely)} nodes belong to no cell: nodes {_some(lonely)}; remove them from points"
        )


def _checked_regions(regions: Mapping[str, Any], count: int) -> dict[str, IntArray]:
    result = {}
    for name, value in regions.items():
        ids = _index_array(value, f"region '{name}'", count)
        if ids.size == 0:
            raise ProblemError(f"region '{name}' holds no cells; remove it or fill it")
        if ids.ndim != 1:
            raise ProblemError(f"region '{name}' has shape {ids.shape}; it must list cell numbers, shape (k,)")
        result[str(name)] = _frozen(np.unique(ids))
    return result


def _some(mask: Any, limit: int = 5) -> str:
    """The first few numbers where ``mask`` holds, for messages."""
    numbers = np.flatnonzero(mask)
    return ", ".join(str(int(i)) for i in numbers[:limit]) + (", ..." if len(numbers) > limit else "")
