"""Uniform (red) refinement and the parent of a mesh: where nodes and cells come from, nodal interpolation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.checks import index_array
from hemivar.mesh.keys import facet_measures, frozen, signed_volumes
from hemivar.mesh.kinds import red_tetrahedra

if TYPE_CHECKING:
    from hemivar.mesh.mesh import Mesh

__all__ = ["COVERED", "Refinement", "check_refines", "halved"]

#: Share of a facet, of a cell or of a weight, from which it counts: far above rounding, in space a thousandth of its
#: width.
COVERED = 1e-6


@dataclass(frozen=True, eq=False)
class Refinement(PickleMixin):
    """How a mesh stems from a coarser one, whose cells were cut at midpoints of edges: all of them, or some."""

    mesh: Mesh
    ends: (
        IntArray  # (N, 2), the coarser nodes whose midpoint each finer node is: twice the same where it is one of them
    )
    cells: IntArray  # (M,), the coarser cell that each finer one is a part of

    def __post_init__(self) -> None:
        ends = index_array(self.ends, "Refinement.ends", self.mesh.number_of_nodes)
        cells = index_array(self.cells, "Refinement.cells", self.mesh.number_of_cells)
        if ends.ndim != 2 or ends.shape[1] != 2 or cells.ndim != 1:
            raise ProblemError(
                f"Refinement.ends and .cells have shapes {ends.shape} and {cells.shape}; they must be (N, 2) and (M,)"
            )
        object.__setattr__(self, "ends", frozen(ends))
        object.__setattr__(self, "cells", frozen(cells))

    @cached_property
    def interpolation(self) -> sp.csr_array:
        """Nodal values on the finer mesh from those on the coarser one, shape (N, N_coarse)."""
        count = len(self.ends)
        narrow = np.int32 if 2 * count < np.iinfo(np.int32).max else np.int64
        parts = np.full(2 * count, 0.5), self.ends.ravel().astype(narrow), np.arange(0, 2 * count + 1, 2, dtype=narrow)
        matrix = sp.csr_array(parts, shape=(count, self.mesh.number_of_nodes))
        matrix.sum_duplicates()  # nodes of both meshes are ends of themselves
        return matrix

    def named(
        self,
        boundaries: Mapping[str, IntArray],
        regions: Mapping[str, IntArray],
        interfaces: Mapping[str, IntArray],
    ) -> Refinement | None:
        """The refinement, with the facets and cells that those of the finer mesh are parts of under their names.

        None if the coarser mesh cannot bear the names, as a boundary or a region holds a part of a facet or cell of it.
        """
        points, dim = self.mesh.points, self.mesh.dim
        corners: dict[str, IntArray] = {}
        inner: dict[str, IntArray] = {}
        areas = {}
        named = [(corners, *group) for group in boundaries.items()] + [(inner, *group) for group in interfaces.items()]
        for kept, name, facets in named:
            nodes = np.sort(self.ends[facets].reshape(len(facets), -1), axis=1)
            first = np.diff(nodes, axis=1, prepend=-1) > 0
            whole = first.sum(axis=1) == dim
            kept[name] = np.unique(nodes[whole][first[whole]].reshape(-1, dim), axis=0)
            covered = facet_measures(points[self.ends[facets]].mean(axis=2)).sum()
            if abs(covered - facet_measures(points[kept[name]]).sum()) > COVERED * covered:
                return None
        children = np.bincount(self.cells, minlength=self.mesh.number_of_cells)
        for name, ids in regions.items():
            inside = np.bincount(self.cells[ids], minlength=len(children))
            areas[name] = np.flatnonzero(inside)
            if (inside[areas[name]] < children[areas[name]]).any():
                return None
        return replace(self, mesh=self.mesh.named(corners, areas, inner))


def check_refines(points: Array, cells: IntArray, parent: Refinement) -> None:
    """Refuse a refinement that does not lead to these nodes (N, d) and cells (M, d + 1)."""
    coarse = parent.mesh
    if (len(parent.ends), len(parent.cells), coarse.dim) != (len(points), len(cells), points.shape[1]):
        raise ProblemError(
            f"parent makes {len(parent.ends)} nodes and {len(parent.cells)} cells in {coarse.dim} dimensions of a "
            f"coarser mesh, but this one has {len(points)} and {len(cells)} in {points.shape[1]}; give parent = None"
        )
    off = np.abs(points - coarse.points[parent.ends].mean(axis=1)).max(axis=1)
    if (off > ROUNDED * np.abs(points).max()).any():
        bad = int(np.argmax(off))
        raise ProblemError(
            f"node {bad} is not the midpoint of nodes {' and '.join(map(str, parent.ends[bad]))} of the parent mesh, "
            f"but {off[bad]:.3g} off; give parent = None, or refine the changed mesh"
        )
    within = (parent.ends[cells][..., None] == coarse.cells[parent.cells][:, None, None]).any(axis=3).all(axis=(1, 2))
    filled = np.bincount(parent.cells, signed_volumes(points, cells), len(coarse.cells))
    empty = np.abs(filled - coarse.volumes) > COVERED * coarse.volumes
    if not within.all() or empty.any():
        what = f"cell {np.argmin(within)} is not part of" if not within.all() else "its cells do not fill"
        bad = int(parent.cells[np.argmin(within)] if not within.all() else np.argmax(empty))
        raise ProblemError(f"{what} cell {bad} of the parent mesh; give parent = None, or refine the changed mesh")


def halved(mesh: Mesh) -> Mesh:
    """The mesh with all edges halved, see :meth:`Mesh.refined`."""
    count = mesh.number_of_nodes
    points = mesh.nodes(2)
    v, e = mesh.cells.T, (count + mesh.cell_edges).T
    if mesh.dim == 2:
        groups = [(v[0], e[0], e[2]), (e[0], v[1], e[1]), (e[2], e[1], v[2]), (e[0], e[1], e[2])]
        cells = np.vstack([np.column_stack(group) for group in groups])
    else:
        cells = red_tetrahedra(points, mesh.cells, count + mesh.cell_edges)
    in_space = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
    parts = ((0, 2), (2, 1)) if mesh.dim == 2 else in_space

    def cut(facets: IntArray) -> IntArray:
        f = mesh.facet_nodes(facets, 2).T
        return np.stack([f[list(part)].T for part in parts], axis=1).reshape(-1, mesh.dim)

    boundaries = {name: cut(facets) for name, facets in mesh.boundaries.items()}
    interfaces = {name: cut(facets) for name, facets in mesh.interfaces.items()}
    offsets = mesh.number_of_cells * np.arange(2**mesh.dim)
    regions = {name: (offsets[:, None] + ids).ravel() for name, ids in mesh.regions.items()}
    own = np.repeat(np.arange(count)[:, None], 2, axis=1)
    parents = np.tile(np.arange(mesh.number_of_cells), 2**mesh.dim)
    ends = frozen(np.vstack([own, mesh.edges]))
    parent = Refinement(mesh, ends, frozen(parents))
    recipe = None if mesh.recipe is None else mesh.recipe.refined()
    return mesh.trusted(points, cells, boundaries, regions, parent, recipe, interfaces, mesh.reading.onto(ends))
