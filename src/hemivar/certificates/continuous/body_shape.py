"""What the geometry of a body is taken for: straight sides, and the angles at which they follow each other."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.mesh.mesh import Mesh

__all__ = ["STRAIGHT", "body_shape", "facet_angles"]

#: Angle that is rounding, in radians.
STRAIGHT = 1e-6


def facet_angles(mesh: Mesh, facets: IntArray) -> tuple[IntArray, Array]:
    """Pairs (p, 2) of facets (k, d) that have a side in common, by their places in the list, and their angles (p,)."""
    normals, _ = mesh.facet_normals(facets)
    dim = mesh.dim
    owner = np.repeat(np.arange(len(facets)), dim)
    sides = np.stack([np.delete(facets, i, axis=1) for i in range(dim)], axis=1).reshape(-1, dim - 1)
    sides = np.sort(sides, axis=1)
    order = np.lexsort(sides.T)
    sides, owner = sides[order], owner[order]
    same = np.flatnonzero((sides[1:] == sides[:-1]).all(axis=1))
    pairs = np.column_stack([owner[same], owner[same + 1]])
    apart = np.linalg.norm(normals[pairs[:, 0]] - normals[pairs[:, 1]], axis=1)
    return pairs, 2.0 * np.arcsin(np.clip(0.5 * apart, 0.0, 1.0))


def body_shape(mesh: Mesh) -> str:
    """The body of a mesh in words, such as ``"a polygon with 11 straight sides"``: what a bound is one for."""
    facets = mesh.boundary_facets
    pairs, angles = facet_angles(mesh, facets)
    flat = pairs[angles <= STRAIGHT]
    graph = sp.coo_array((np.ones(len(flat)), flat.T), shape=2 * (len(facets),))
    count = sp.csgraph.connected_components(graph, directed=False)[0]
    return f"a polygon with {count} straight sides" if mesh.dim == 2 else f"a polyhedron with {count} plane faces"
