"""Bodies of revolution (axisymmetric): what the hoop strain around the axis is, and what it adds to the stiffness."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.elements import barycentric_gradients, shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule, region_masks
from hemivar.mesh.mesh import Mesh

__all__ = ["Hoop", "hoop_matrices", "hoop_strain"]

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
    matrices = np.zeros((len(corners), nodes, 2, nodes, 2))
    for point, weight, values in zip(barycentric, weights, shape_values(order, barycentric), strict=True):
        points = np.einsum("c,kcd->kd", point, corners)
        row = hoop(points, masks) * (weight * volumes)[:, None]
        slopes = np.einsum("la,kad->kld", shape_derivatives(order, point), gradients)
        around = values / points[:, :1]
        # C_hp e(u) of a unit component j at node l
        plane = np.einsum("kjm,klm->klj", row[:, strains], slopes)
        matrices[:, :, 0] += around[:, :, None, None] * plane[:, None]
        matrices[:, :, :, :, 0] += plane[:, :, :, None] * around[:, None, None, :]
        matrices[:, :, 0, :, 0] += row[:, -1, None, None] * around[:, :, None] * around[:, None, :]
    return matrices
