"""Triangle and tetrahedron meshes with named boundaries and regions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arguments import described, expect, name_of, number, quoted, suggest
from hemivar.basics.arrays import real_array, unmasked
from hemivar.basics.first_use import cached_property
from hemivar.basics.memory import mesh_bytes, refined_cells, require
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.formula.condition import Condition
from hemivar.kernels.mesh_sums import mesh_edges
from hemivar.mesh.assembled import assembled
from hemivar.mesh.checks import (
    check_cells,
    check_coordinates,
    check_order,
    checked_arrays,
    checked_boundaries,
    checked_interfaces,
    checked_regions,
    coincident,
    index_array,
    is_whole,
)
from hemivar.mesh.keys import (
    EDGES,
    cell_facets,
    distinct_pairs,
    facet_keys,
    frozen,
    pair_keys,
    shared_facets,
    signed_volumes,
)
from hemivar.mesh.local_refinement import refined_where
from hemivar.mesh.opened import opened
from hemivar.mesh.parts import Parts, parts_of
from hemivar.mesh.reading import NOT_READ, Reading
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
    interfaces : mapping of name to int array, shape (k, d)
        Nodes of the facets of each named curve or surface inside the body. :meth:`opened` makes boundaries of its two
        sides.
    parent, recipe, reading : Refinement, MeshRecipe and Reading
        Kept by the library: the coarser mesh of multigrid, how a problem file states the mesh, and what the reader of
        its file did. Ask :attr:`notes` and :attr:`suggested_order`; leave them out of your own meshes.

    Raises
    ------
    ProblemError
        If a coordinate is not finite, or so large that rounding spoils the cells; if an index is out of range, a cell
        is degenerate or inverted, a node belongs to no cell, a facet belongs to more than two cells or to two on the
        same side; if a boundary is empty or holds a facet that is not on the outer boundary, or facets lie at one
        place of one part with nodes of their own and without a name; if an interface is empty or holds a facet that is
        not between two cells; if the parent does not lead to these nodes, cells and names.

    Examples
    --------
    >>> import hemivar as hv
    >>> points, cells = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1, 2]]
    >>> mesh = hv.Mesh.oriented(points, cells).with_boundaries({"bottom": lambda x: x[:, 1] == 0.0})
    >>> mesh.refined().cells.shape
    (4, 3)
    """

    points: Array
    cells: IntArray
    boundaries: Mapping[str, IntArray] = field(default_factory=dict)
    regions: Mapping[str, IntArray] = field(default_factory=dict)
    parent: Refinement | None = None
    recipe: MeshRecipe | None = None
    interfaces: Mapping[str, IntArray] = field(default_factory=dict)
    reading: Reading = NOT_READ

    def __post_init__(self) -> None:
        points, cells = checked_arrays(self.points, self.cells)
        check_cells(points, cells)
        boundaries = checked_boundaries(points, cells, self.boundaries)
        regions = checked_regions(self.regions, len(cells))
        interfaces = checked_interfaces(points, cells, self.interfaces, boundaries)
        expect(self.reading, Reading, "reading", "leave it out")
        parent = self.parent
        if parent is not None:
            expect(parent, Refinement, "parent", "give the Refinement that made this mesh, or None")
            check_refines(points, cells, parent)
            parent = parent.named(boundaries, regions, interfaces)
            if parent is None:
                raise ProblemError(
                    "parent: the coarser mesh cannot have these boundaries and regions, which cut through its "
                    "facets or cells; give parent = None"
                )
        self._set(points, cells, boundaries, regions, parent, self.recipe, interfaces, self.reading)

    def _set(
        self,
        points: Array,
        cells: IntArray,
        boundaries: Mapping[str, IntArray],
        regions: Mapping[str, IntArray],
        parent: Refinement | None,
        recipe: MeshRecipe | None,
        interfaces: Mapping[str, IntArray],
        reading: Reading,
    ) -> None:
        put = object.__setattr__
        put(self, "points", frozen(points))
        put(self, "cells", frozen(cells))
        put(self, "boundaries", MappingProxyType({name: frozen(facets) for name, facets in boundaries.items()}))
        put(self, "regions", MappingProxyType({name: frozen(ids) for name, ids in regions.items()}))
        put(self, "parent", parent)
        put(self, "recipe", recipe)
        put(self, "interfaces", MappingProxyType({name: frozen(facets) for name, facets in interfaces.items()}))
        put(self, "reading", reading)

    @classmethod
    def oriented(
        cls,
        points: ArrayLike,
        cells: object,
        boundaries: Mapping[str, object] | None = None,
        regions: Mapping[str, object] | None = None,
        interfaces: Mapping[str, object] | None = None,
    ) -> Mesh:
        """A mesh from cells of any orientation: inverted cells are turned round.

        Parameters are those of :class:`Mesh`.
        """
        nodes, connectivity = checked_arrays(points, cells)
        negative = signed_volumes(nodes, connectivity) < 0
        if negative.any():
            connectivity = connectivity.copy()
            connectivity[negative, :2] = connectivity[negative, 1::-1]
        given = [{} if group is None else group for group in (boundaries, regions, interfaces)]
        return cls(nodes, connectivity, given[0], given[1], interfaces=given[2])  # type: ignore[arg-type]

    @classmethod
    def trusted(
        cls,
        points: Array,
        cells: IntArray,
        boundaries: Mapping[str, IntArray],
        regions: Mapping[str, IntArray],
        parent: Refinement | None = None,
        recipe: MeshRecipe | None = None,
        interfaces: Mapping[str, IntArray] | None = None,
        reading: Reading = NOT_READ,
    ) -> Mesh:
        """A mesh from arrays known to be valid, which are neither checked nor copied.

        Parameters are those of :class:`Mesh`, the facets being outward oriented and each there once.
        """
        mesh = object.__new__(cls)
        mesh._set(points, cells, boundaries, regions, parent, recipe, {} if interfaces is None else interfaces, reading)
        return mesh

    def __repr__(self) -> str:
        cells = f"{len(self.cells)} {'triangles' if self.dim == 2 else 'tetrahedra'}"
        groups = {"boundaries": self.boundaries, "regions": self.regions, "interfaces": self.interfaces,
                  "node sets": self.node_sets}  # fmt: skip
        named = [f"{what} {', '.join(of)}" for what, of in groups.items() if of]
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

    @property
    def notes(self) -> tuple[str, ...]:
        """What the reader of its file did with other cells and could not take, and what :meth:`opened` left closed."""
        return self.reading.notes

    @property
    def suggested_order(self) -> int:
        """The order of elements that is taken where none is given: 2 for some files of second order, 1 else."""
        return self.reading.order

    @property
    def node_sets(self) -> Mapping[str, IntArray]:
        """Numbers of the nodes of named sets that are no boundaries, as files have them; supports may name them."""
        return self.reading.node_sets

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

    @cached_property
    def _rules(self) -> dict[tuple[str | None, int], object]:
        """The :class:`hemivar.mesh.boundary_rule.BoundaryRule` of each boundary and order that was asked for."""
        return {}

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
        check_order(order)
        if order == 1:
            return self.points
        middle = 0.5 * (self.points[self.edges[:, 0]] + self.points[self.edges[:, 1]])
        return np.vstack([self.points, middle])

    def cell_nodes(self, order: int = 1) -> IntArray:
        """Displacement nodes of the cells, shape (M, d + 1) or, for order 2, (M, 6) in 2D and (M, 10) in 3D."""
        check_order(order)
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
        check_order(order)
        if order == 1:
            return facets
        local = ((0, 1),) if self.dim == 2 else ((0, 1), (1, 2), (0, 2))
        pairs = np.stack([facets[:, pair] for pair in local], axis=1)
        count = self.number_of_nodes
        known = self.edges[:, 0] * count + self.edges[:, 1]
        return np.hstack([facets, count + np.searchsorted(known, pair_keys(pairs, count))])

    def facet_normals(self, facets: IntArray) -> tuple[Array, Array]:
        """Unit normals, shape (k, d), and lengths or areas, shape (k,), of oriented facets, shape (k, d)."""
        if not isinstance(facets, np.ndarray):
            facets = index_array(facets, "facets", self.number_of_nodes)
        if facets.ndim != 2 or facets.shape[1] != self.dim or facets.dtype.kind not in "iu":
            raise ProblemError(f"facets has shape {facets.shape}; give numbers of nodes, shape (k, {self.dim})")
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
            raise ProblemError(f"times = {quoted(times)}; give a whole number of at least 0")
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

    def rotated(self, angle: float, axis: ArrayLike | None = None) -> Mesh:
        """The mesh turned by ``angle`` (radians) about the origin, counterclockwise; in space about an axis through it.

        Parameters
        ----------
        angle : float
        axis : array, shape (3,)
            Direction of the axis, in 3D only; seen against it the mesh turns counterclockwise.

        Raises
        ------
        ProblemError
            If the angle is not finite, or a solid has no axis, a plane mesh one.
        """
        turn = number(angle, "the angle")
        if math.isinf(turn):
            raise ProblemError(f"the angle is {turn}; give a finite number of radians")
        if (axis is None) != (self.dim == 2):
            how = "has none: leave it out" if self.dim == 2 else "needs one, such as (0, 0, 1)"
            raise ProblemError(f"a mesh in 3D is turned about an axis; this mesh is {self.dim}D and {how}")
        c, s = math.cos(turn), math.sin(turn)
        if axis is None:
            return self.moved(np.array([[c, -s], [s, c]]))
        along = real_array(axis, "axis")
        if along.shape != (3,) or not 0.0 < (size := float(np.abs(along).max())) < math.inf:
            raise ProblemError("axis must be a direction; give three numbers that are not all 0, such as (0, 0, 1)")
        k = along / size / np.linalg.norm(along / size)
        across = np.cross(np.eye(3), k)  # across @ x is k times x
        return self.moved(c * np.eye(3) + s * across + (1.0 - c) * np.outer(k, k))

    def mirrored(self, axis: str) -> Mesh:
        """The mesh with the sign of one coordinate changed: ``"x"``, ``"y"`` or ``"z"``.

        Cells stay positively oriented. Meshes that it was refined from are mirrored with it where all cells were cut.

        Raises
        ------
        ProblemError
            If the mesh has no such coordinate.
        """
        names = "xyz"[: self.dim]
        if not isinstance(axis, str) or len(axis) != 1 or axis not in names:
            raise ProblemError(f"the mesh cannot be mirrored in {quoted(axis)}; give one of {', '.join(names)}")
        points = self.points.copy()
        points[:, names.index(axis)] *= -1.0
        points += 0.0  # no zero has a sign
        turned = [1, 0, *range(2, self.dim + 1)]
        facets = [
            {name: own[:, turned[: self.dim]] for name, own in group.items()}
            for group in (self.boundaries, self.interfaces)
        ]
        parent = self.parent
        if parent is not None:
            # Children of cells that were cut one by one lie in an order that depends on that of their nodes.
            whole = (np.bincount(parent.cells, minlength=parent.mesh.number_of_cells) == 2**self.dim).all()
            parent = replace(parent, mesh=parent.mesh.mirrored(axis)) if whole else None
        return Mesh.trusted(
            points, self.cells[:, turned], facets[0], self.regions, parent, None, facets[1], self.reading
        )

    def scaled(self, factor: float) -> Mesh:
        """The mesh with all coordinates multiplied by ``factor > 0``."""
        if not 0.0 < number(factor, "the factor", "a mesh is scaled by a positive number") < math.inf:
            raise ProblemError(f"factor = {factor}; a mesh is scaled by a positive number")
        mesh = self.moved(factor * np.eye(self.dim))
        return mesh if self.recipe is None else mesh.made_by(self.recipe.scaled(factor))

    def made_by(self, recipe: MeshRecipe | None, reading: Reading | None = None) -> Mesh:
        """The mesh with another word on how it was made, and on how it was read where given."""
        history = self.reading if reading is None else expect(reading, Reading, "reading", "leave it out")
        return Mesh.trusted(
            self.points, self.cells, self.boundaries, self.regions, self.parent, recipe, self.interfaces, history
        )

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
        return Mesh.trusted(
            points, self.cells, self.boundaries, self.regions, parent, None, self.interfaces, self.reading
        )

    def with_boundaries(self, boundaries: Mapping[str, object]) -> Mesh:
        """The mesh with these named boundaries in place of its own.

        Boundaries that lie where others lie, as the sides of what was :meth:`opened`, stay under their names.  No place
        tells them from one another.

        Parameters
        ----------
        boundaries : mapping of name to int array (k, d), or to a callable
            A callable gets the midpoints of all outer facets, shape (k, d), and returns a mask, shape (k,).
        """
        chosen = self._chosen(boundaries, self.boundary_facets, "boundar", "y", "ies")
        return self.named({**self._sides, **chosen}, self.regions)

    @property
    def _sides(self) -> dict[str, IntArray]:
        """The boundaries all of whose facets lie where other outer facets lie."""
        facets = self.boundary_facets
        doubled = facet_keys(facets[coincident(self.points, facets)], self.number_of_nodes)
        return {
            name: own
            for name, own in self.boundaries.items()
            if np.isin(facet_keys(own, self.number_of_nodes), doubled).all()
        }

    def marked(self, boundaries: Mapping[str, object]) -> Mesh:
        """The mesh with more named boundaries, by formulas, functions or facets.

        Parameters
        ----------
        boundaries : mapping of name to str, callable, or int array (k, d)
            A formula is a condition such as ``"x > 39.9 and y < 2"``: it holds the outer facets at all of whose corners
            it is true. Callables and facets are those of :meth:`with_boundaries`.

        Returns
        -------
        Mesh

        Raises
        ------
        ProblemError
            If a formula is no condition, no facet fulfils it, or the mesh has a boundary of this name.
        """
        expect(boundaries, Mapping, "boundaries", "give a dict of conditions by names")  # type: ignore[type-abstract]
        for name in boundaries:
            if name in self.boundaries or name in self.interfaces:
                raise ProblemError(f"the mesh has a boundary or an interface '{name}' already; take another name")
        chosen = {
            name: self._where(name, value) if isinstance(value, str) else value for name, value in boundaries.items()
        }
        marked = self._chosen(chosen, self.boundary_facets, "boundar", "y", "ies")
        formulas = {str(name): value for name, value in boundaries.items() if isinstance(value, str)}
        plain = self.recipe if len(formulas) == len(boundaries) else None
        mesh = self.named({**self.boundaries, **marked}, self.regions)
        return mesh.made_by(plain and plain.marking(formulas))

    def _where(self, name: str, condition: str) -> IntArray:
        """Outer facets at all of whose corners a condition holds."""
        holds = Condition(condition, f"boundary '{name}'")(self.points)
        chosen = self.boundary_facets[holds[self.boundary_facets].all(axis=1)]
        if not len(chosen):
            low, high = self.points.min(axis=0), self.points.max(axis=0)
            ends = zip("xyz", low, high, strict=False)
            reach = ", ".join(f"{axis} from {a:.6g} to {b:.6g}" for axis, a, b in ends)
            raise ProblemError(
                f"boundary '{name}': {condition} holds at no facet of the outer boundary; the mesh has {reach}"
            )
        return chosen

    def with_interfaces(self, interfaces: Mapping[str, object]) -> Mesh:
        """The mesh with these named curves or surfaces inside the body in place of its own.

        Parameters
        ----------
        interfaces : mapping of name to int array (k, d), or to a callable
            A callable gets the midpoints of all facets between two cells, shape (k, d), and returns a mask, shape (k,).
        """
        chosen = self._chosen(interfaces, self.inner_facets, "interface", "", "s")
        return self.named(self.boundaries, self.regions, chosen)

    def _chosen(
        self, groups: Mapping[str, object], facets: IntArray, what: str, one: str, many: str
    ) -> dict[str, object]:
        chosen = {}
        expect(groups, Mapping, f"{what}{many}", "give a dict of choices by names")  # type: ignore[type-abstract]
        for name, value in groups.items():
            if callable(value):
                mask = np.asarray(unmasked(value(self.points[facets].mean(axis=1)), f"{what}{one} '{name}'"))
                if mask.shape != (len(facets),) or mask.dtype != bool:
                    raise ProblemError(
                        f"{what}{one} '{name}': the callable returned shape {mask.shape} of {mask.dtype}; it "
                        f"must return a bool mask of shape ({len(facets)},)"
                    )
                chosen[name] = facets[mask]
            else:
                chosen[name] = value
        return chosen

    def named(
        self,
        boundaries: Mapping[str, object],
        regions: Mapping[str, object],
        interfaces: Mapping[str, object] | None = None,
    ) -> Mesh:
        """The mesh with these named boundaries and regions in place of its own, and interfaces where they are given.

        It stays the refinement of its parent where all of them are made of whole facets and cells of that.
        """
        outer = checked_boundaries(self.points, self.cells, boundaries)
        areas = checked_regions(regions, self.number_of_cells)
        kept = self.interfaces if interfaces is None else interfaces
        inner = checked_interfaces(self.points, self.cells, kept, outer)
        parent = self.parent and self.parent.named(outer, areas, inner)
        return Mesh.trusted(self.points, self.cells, outer, areas, parent, None, inner, self.reading)

    @classmethod
    def assembled(cls, parts: Mapping[str, Mesh]) -> Mesh:
        """Several meshes as one; names of boundaries become ``part:name``.

        The boundary ``bottom`` of the part ``upper`` is ``upper:bottom``; the region ``upper`` holds all of its cells.
        Nodes of different parts stay apart, also where they lie at one place.

        Parameters
        ----------
        parts : mapping of name to Mesh
            All plane, or all in 3D.

        Returns
        -------
        Mesh

        Raises
        ------
        ProblemError
            If there is no part, a name is empty or has a colon, or the dimensions differ.
        """
        return assembled(parts)

    def opened(self, name: str, between: tuple[str, str] | None = None) -> Mesh:
        """The mesh with a curve or surface inside of it opened: its nodes are doubled, its two sides are boundaries.

        The sides are named by the regions that lie there, such as ``glue:steel`` and ``glue:rubber``; within one region
        ``glue:1`` and ``glue:2``, where 1 is the side of the cell with the smallest number.  Nodes at an end within the
        body are not doubled; where several sides meet, each has a node of its own.  A facet all of whose nodes are such
        ends stays closed, and :attr:`notes` say so.

        Parameters
        ----------
        name : str
            Name of an interface, or what the interface between two regions is to be called.
        between : pair of str, optional
            Two regions; all facets between a cell of the one and a cell of the other.

        Returns
        -------
        Mesh

        Raises
        ------
        ProblemError
            If there is no such interface, a piece of it has no node away from its ends, or a boundary with the name of
            a side is there already.
        """
        name_of(name, "the name of an interface", "give a text, such as 'glue'")
        if between is None:
            if name not in self.interfaces:
                raise ProblemError(self._no_interface(name))
            cut = opened(self, name, self.interfaces[name])
        elif name in self.interfaces:
            raise ProblemError(f"the mesh has an interface '{name}' already; leave between out, or take another name")
        else:
            named = self.with_interfaces({**self.interfaces, name: self._between(between)})
            cut = opened(named, name, named.interfaces[name])
        recipe = self.recipe and self.recipe.opening(name, None if between is None else (between[0], between[1]))
        return cut if cut.recipe is not None or recipe is None else cut.made_by(recipe)

    def _no_interface(self, name: str) -> str:
        if name in self.boundaries:
            return f"'{name}' is a boundary, which is open already; open a curve or surface inside the body"
        return f"the mesh has no interface {quoted(name)}{suggest(name, list(self.interfaces), 'interfaces')}"

    def _between(self, regions: tuple[str, str]) -> IntArray:
        """Facets between two regions, (k, d)."""
        two = isinstance(regions, tuple | list) and len(regions) == 2 and all(isinstance(one, str) for one in regions)
        if not two or regions[0] == regions[1]:
            raise ProblemError(f"between = {described(regions)}; give the names of two regions")
        for region in regions:
            if region not in self.regions:
                raise ProblemError(f"the mesh has no region '{region}'{suggest(region, list(self.regions), 'regions')}")
        facets, first, second = self._inner
        one, other = (np.isin(np.arange(self.number_of_cells), self.regions[region]) for region in regions)
        across = (one[first] & other[second]) | (one[second] & other[first])
        if not across.any():
            raise ProblemError(f"regions '{regions[0]}' and '{regions[1]}' share no facet; check their names")
        return facets[across]

    @cached_property
    def _inner(self) -> tuple[IntArray, IntArray, IntArray]:
        """Facets between two cells (k, d), and these cells (k,) and (k,)."""
        facets, keys, cell = cell_facets(self.cells, self.number_of_nodes)
        first, second = shared_facets(keys)
        return facets[first], cell[first], cell[second]

    @property
    def inner_facets(self) -> IntArray:
        """All facets between two cells, outward oriented from the cell with the smaller number, shape (k, d)."""
        return self._inner[0]

    @cached_property
    def parts(self) -> Parts:
        """The parts that it consists of: cells joined through facets."""
        return parts_of(self)
