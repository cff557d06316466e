"""Bodies of revolution: integrals over rings, and the strain around the axis; x is the radius r and y the axis."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.contact_basis import contact_shapes
from hemivar.fem.elements import barycentric_gradients, shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule, region_masks
from hemivar.mesh.mesh import Mesh

__all__ = ["Hoop", "facet_shares", "hoop_matrices", "hoop_strain", "weightless"]

#: Share of a weight in that of facets at the largest radius that is rounding.
_NONE = 1e-9

#: Stress around the axis, see :class:`hemivar.fem.constitutive.ConstitutiveLaw`.
Hoop = Callable[[Array, Mapping[str, BoolArray] | None], Array]


def hoop_strain(mesh: Mesh, order: int, displacement: Array) -> Array:
    """``u_r / r`` in the middle of each cell, shape (M,)."""
    middle = np.full(3, 1.0 / 3.0)
    inside = displacement[mesh.cell_nodes(order), 0] @ shape_values(order, middle[None])[0]
    return np.asarray(inside / (mesh.points[mesh.cells, 0] @ middle))


def hoop_matrices(mesh: Mesh, order: int, hoop: Hoop, strains: IntArray, cells: slice | IntArray) -> Array:
    """What the strain around the axis adds to the stiffness of cells, shape (k, L, 2, L, 2).

    ``int e_h(v) (C_hh e_h(u) + C_hp e(u)) + e(v) C_ph e_h(u)`` over rings, ``e_h = u_r / r``. The rule has no point on
    the axis; with it a field ``u_r = c r`` is exact.
    """
    barycentric, weights = quadrature_rule(2, 2 * order)
    corners, gradients = mesh.points[mesh.cells[cells]], barycentric_gradients(mesh, cells)
    masks, volumes = {name: mask[cells] for name, mask in region_masks(mesh).items()}, mesh.volumes[cells]
    nodes = shape_values(order, barycentric).shape[1]
    found = np.zeros((len(corners), nodes, 2, nodes, 2))
    for place, weight, values in zip(barycentric, weights, shape_values(order, barycentric), strict=True):
        points = np.einsum("c,kcd->kd", place, corners)
        row = hoop(points, masks) * (weight * volumes)[:, None]
        slopes = np.einsum("la,kad->kld", shape_derivatives(order, place), gradients)
        around = values / points[:, :1]
        # C_hp e(u) of a unit component j at node l
        plane = np.einsum("kjm,klm->klj", row[:, strains], slopes)
        found[:, :, 0] += around[:, :, None, None] * plane[:, None]
        found[:, :, :, :, 0] += plane[:, :, :, None] * around[:, None, None, :]
        found[:, :, 0, :, 0] += row[:, -1, None, None] * around[:, :, None] * around[:, None, :]
    return found


def facet_shares(mesh: Mesh, facets: IntArray, order: int, ring: bool) -> Array:
    """Integrals of the functions of contact over facets (f, d), (f, L): over whole rings of a body of revolution."""
    measures = mesh.facet_normals(facets)[1]
    barycentric, weights = quadrature_rule(mesh.dim - 1, order + ring)
    values = contact_shapes(order, barycentric)
    if not ring:
        return np.outer(measures, weights @ values)
    radius = mesh.points[facets, 0] @ barycentric.T
    return np.asarray(2.0 * np.pi * measures[:, None] * ((radius * weights) @ values))


def weightless(mesh: Mesh, facets: IntArray, order: int, ring: bool) -> BoolArray:
    """Which nodes (N,) of facets (f, d) have no weight in a body of revolution, or what rounding makes of none.

    They lie on the axis: corners of quadratic facets, and those of facets along it.
    """
    members, count = mesh.facet_nodes(facets, order), len(mesh.nodes(order))
    if not ring:
        return np.zeros(count, dtype=bool)
    own = np.bincount(members.ravel(), facet_shares(mesh, facets, order, ring).ravel(), count)
    size = np.bincount(members.ravel(), np.repeat(mesh.facet_normals(facets)[1], members.shape[1]), count)
    return np.asarray(own <= _NONE * 2.0 * np.pi * mesh.points[:, 0].max() * size)
