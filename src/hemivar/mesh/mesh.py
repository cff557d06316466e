"""Triangle and tetrahedron meshes with named boundaries and regions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arguments import described, expect, number
from hemivar.basics.arrays import real_array, unmasked
from hemivar.basics.first_use import cached_property
from hemivar.basics.memory import mesh_bytes, refined_cells, require
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.kernels import mesh_edges
from hemivar.mesh.checks import (
    check_cells,
    check_coordinates,
    checked_arrays,
    checked_boundaries,
    checked_regions,
    is_whole,
)
from hemivar.mesh.keys import EDGES, cell_facets, distinct_pairs, frozen, pair_keys, signed_volumes
from hemivar.mesh.local_refinement import refined_where
from hemivar.mesh.parts import Parts, parts_of
from hemivar.mesh.recipe import MeshRecipe
from hemivar.mesh.refine import Refinement, check_refines, halved

__all__ = ["Mesh"]


@dataclass(frozen=True, eq=False)
class Mesh(PickleMixin):
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
    parent : Refinement, optional
        What this mesh is known to be the refinement of: refined meshes, and built-in ones with even numbers of cells,
        know.  The names of boundaries and regions are handed down to the coarser meshes.
    recipe : MeshRecipe or None
        How the mesh was made, where a problem file can say it: built-in or from a file, then scaled and refined. A mesh
        changed otherwise has none.

    Raises
    ------
    ProblemError
        If a coordinate is not finite, or so large that rounding spoils the cells; if an index is out of range, a cell
        is degenerate or inverted, a node belongs to no cell, a facet belongs to more than two cells or to two on the
        same side; if a boundary is empty or holds a facet that is not on the outer boundary, or facets lie at one
        place with nodes of their own and without a name (parts that were not joined); if the parent does not lead to
        these nodes, cells and names.
    """

    points: Array
    cells: IntArray
    boundaries: Mapping[str, IntArray] = field(default_factory=dict)
    regions: Mapping[str, IntArray] = field(default_factory=dict)
    parent: Refinement | None = None
    recipe: MeshRecipe | None = None

    def __post_init__(self) -> None:
        points, cells = checked_arrays(self.points, self.cells)
        check_cells(points, cells)
        boundaries = checked_boundaries(points, cells, self.boundaries)
        regions = checked_regions(self.regions, len(cells))
        parent = self.parent
        if parent is not None:
            expect(parent, Refinement, "parent", "give the Refinement that made this mesh, or None")
            check_refines(points, cells, parent)
            parent = parent.named(boundaries, regions)
            if parent is None:
                raise ProblemError(
                    "parent: the coarser mesh cannot bear these boundaries and regions, which cut through facets or "
                    "cells of it; give parent = None"
                )
        self._set(points, cells, boundaries, regions, parent, self.recipe)

    def _set(
        self,
        points: Array,
        cells: IntArray,
        boundaries: Mapping[str, IntArray],
        regions: Mapping[str, IntArray],
        parent: Refinement | None,
        recipe: MeshRecipe | None = None,
    ) -> None:
        put = object.__setattr__
        put(self, "points", frozen(points))
        put(self, "cells", frozen(cells))
        put(self, "boundaries", MappingProxyType({name: frozen(facets) for name, facets in boundaries.items()}))
        put(self, "regions", MappingProxyType({name: frozen(ids) for name, ids in regions.items()}))
        put(self, "parent", parent)
        put(self, "recipe", recipe)

    @classmethod
    def oriented(
        cls,
        points: ArrayLike,
        cells: object,
        boundaries: Mapping[str, object] | None = None,
        regions: Mapping[str, object] | None = None,
    ) -> Mesh:
        """A mesh from cells of any orientation: inverted cells are turned round.

        Parameters are those of :class:`Mesh`.
        """
        nodes, connectivity = checked_arrays(points, cells)
        negative = signed_volumes(nodes, connectivity) < 0
        if negative.any():
            connectivity = connectivity.copy()
            connectivity[negative, :2] = connectivity[negative, 1::-1]
        return cls(nodes, connectivity, {} if boundaries is None else boundaries, {} if regions is None else regions)  # type: ignore[arg-type]

    @classmethod
    def trusted(
        cls,
        points: Array,
        cells: IntArray,
        boundaries: Mapping[str, IntArray],
        regions: Mapping[str, IntArray],
        parent: Refinement | None = None,
        recipe: MeshRecipe | None = None,
    ) -> Mesh:
        """A mesh from arrays known to be valid, which are neither checked nor copied.

        Parameters are those of :class:`Mesh`, the facets being outward oriented and each there once.
        """
        mesh = object.__new__(cls)
        mesh._set(points, cells, boundaries, regions, parent, recipe)
        return mesh

    def __repr__(self) -> str:
        cells = f"{len(self.cells)} {'triangles' if self.dim == 2 else 'tetrahedra'}"
        named = [
            f"{what} {', '.join(of)}" for what, of in (("boundaries", self.boundaries), ("regions", self.regions)) if of
        ]
        return f"Mesh({'; '.join([f'{len(self.points)} nodes, {cells}', *named])})"

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
        return frozen(signed_volumes(self.points, self.cells))

    @cached_property
    def _edge_data(self) -> tuple[IntArray, IntArray]:
        compiled = mesh_edges(np.ascontiguousarray(self.cells, dtype=np.int64), self.number_of_nodes)
        if compiled is not None:
            return frozen(compiled[0]), frozen(compiled[1].T)
        index = np.int32 if self.number_of_nodes < np.iinfo(np.int32).max else np.int64
        first, second = (
            np.concatenate([self.cells[:, a] for a in ends], dtype=index) for ends in zip(*EDGES[self.dim], strict=True)
        )
        edges, number = distinct_pairs(first, second)
        return frozen(edges), frozen(number.reshape(-1, len(self.cells)).T)

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
        facets, keys, _ = cell_facets(self.cells, self.number_of_nodes)
        _, first, counts = np.unique(keys, return_index=True, return_counts=True)
        return frozen(facets[np.sort(first[counts == 1])])

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
        if order not in (1, 2):
            raise ProblemError(f"the order of the nodes is {described(order)}; give 1 or 2")
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
        return np.hstack([facets, count + np.searchsorted(known, pair_keys(pairs, count))])

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
        if not is_whole(times, 0):
            raise ProblemError(f"times = {times!r}; give a whole number of at least 0")
        times = int(times)
        cells = refined_cells(self.dim, self.number_of_cells, times)
        if times:
            require(mesh_bytes(self.dim, cells), f"a mesh of {cells:.3g} cells", "refine less often")
        mesh = self
        for _ in range(times):
            mesh = halved(mesh)
        return mesh

    def refined_where(self, cells: object) -> Mesh:
        """Local refinement: these cells are cut at the midpoints of all their edges, and neighbours as far as needed.

        Nodes keep their numbers; boundaries and regions are carried over.  Shapes do not degrade however often it is
        done (red refinement with green closures, see :mod:`hemivar.mesh.local_refinement`), and each mesh knows the
        coarser one of a generation before, so that solvers by multigrid go on with it.

        Parameters
        ----------
        cells : bool array (M,), or int array (k,)
            Which cells.

        Raises
        ------
        ProblemError
            There are no such cells, or the refined mesh does not fit into memory.
        """
        return refined_where(self, cells)

    def rotated(self, angle: float) -> Mesh:
        """The mesh turned counterclockwise by ``angle`` (radians) about the origin; 2D only."""
        if self.dim != 2:
            raise ProblemError("rotated(angle) turns plane meshes only; use moved(matrix) in 3D")
        turn = number(angle, "the angle")
        c, s = math.cos(turn), math.sin(turn)
        return self.moved(np.array([[c, -s], [s, c]]))

    def scaled(self, factor: float) -> Mesh:
        """The mesh with all coordinates multiplied by ``factor > 0``."""
        if not 0.0 < number(factor, "the factor", "a mesh is scaled by a positive number") < math.inf:
            raise ProblemError(f"factor = {factor}; a mesh is scaled by a positive number")
        mesh = self.moved(factor * np.eye(self.dim))
        return mesh if self.recipe is None else mesh.made_by(self.recipe.scaled(factor))

    def made_by(self, recipe: MeshRecipe | None) -> Mesh:
        """The mesh with another word on how it was made, which is not checked."""
        return Mesh.trusted(self.points, self.cells, self.boundaries, self.regions, self.parent, recipe)

    def moved(self, matrix: ArrayLike, shift: ArrayLike = 0.0) -> Mesh:
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
            check_coordinates(points, self.cells)
        parent = self.parent and replace(self.parent, mesh=self.parent.mesh.moved(linear, by))
        return Mesh.trusted(points, self.cells, self.boundaries, self.regions, parent)

    def with_boundaries(self, boundaries: Mapping[str, object]) -> Mesh:
        """The mesh with these named boundaries in place of its own.

        Parameters
        ----------
        boundaries : mapping of name to int array (k, d), or to a callable
            A callable gets the midpoints of all outer facets, shape (k, d), and returns a mask, shape (k,).
        """
        outer = self.boundary_facets
        chosen = {}
        expect(boundaries, Mapping, "boundaries", "give a dict of choices by names")  # type: ignore[type-abstract]
        for name, value in boundaries.items():
            if callable(value):
                mask = np.asarray(unmasked(value(self.points[outer].mean(axis=1)), f"boundary '{name}'"))
                if mask.shape != (len(outer),) or mask.dtype != bool:
                    raise ProblemError(
                        f"boundary '{name}': the callable returned shape {mask.shape} of {mask.dtype}; it "
                        f"must return a bool mask of shape ({len(outer)},)"
                    )
                chosen[name] = outer[mask]
            else:
                chosen[name] = value
        return self.named(chosen, self.regions)

    def named(self, boundaries: Mapping[str, object], regions: Mapping[str, object]) -> Mesh:
        """The mesh with these named boundaries and regions in place of its own.

        It stays the refinement of its parent where boundaries and regions are made of whole facets and cells of that.
        """
        found = checked_boundaries(self.points, self.cells, boundaries)
        areas = checked_regions(regions, self.number_of_cells)
        return Mesh.trusted(self.points, self.cells, found, areas, self.parent and self.parent.named(found, areas))

    @cached_property
    def parts(self) -> Parts:
        """The parts that it consists of: cells joined through facets."""
        return parts_of(self)
