"""Thermal stress: what temperatures do to the stress of a body, and the coupling matrix."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.fem.elements import barycentric_gradients, shape_derivatives, shape_values
from hemivar.fem.initial_load import stress_across
from hemivar.fem.quadrature import quadrature_rule, region_masks
from hemivar.mechanics.kinematics import voigt_index
from hemivar.mechanics.per_volume import at_place
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import Heat

__all__ = ["cell_thermal_stress", "stress_per_degree", "thermal_matrix"]


def stress_per_degree(problem: ContactProblem, heat: Heat, points: Array, regions: dict[str, BoolArray]) -> Array:
    """beta at points (k, d), shape (k, d, d): what a degree takes from the stress.

    Of an expansion a in all directions ``beta = C : a 1``; in plane strain the third direction cannot expand, in plane
    stress it does.
    """
    dim = points.shape[1]
    if heat.thermal_stress is not None:
        return at_place(heat.thermal_stress, "thermal_stress", points, regions)[:, None, None] * np.eye(dim)
    if heat.expansion is None:
        return np.zeros((len(points), dim, dim))
    expansion = at_place(heat.expansion, "expansion", points, regions)
    stress = problem.material.stiffness_tensor(points, regions)[:, :, :dim].sum(axis=2)
    if dim == 2:
        stress = stress + stress_across(problem.material, points, regions)
    return np.asarray(expansion[:, None, None] * stress[:, voigt_index(dim)])


def thermal_matrix(problem: ContactProblem, heat: Heat) -> sp.csr_array:
    """The matrix G with ``v'G th = int th beta : eps(v)``, shape (nodes * d, nodes)."""
    mesh, order, dim = problem.mesh, problem.order, problem.mesh.dim
    nodes = mesh.cell_nodes(order)
    count, size = len(mesh.nodes(order)), nodes.shape[1]
    if not heat.stresses:
        return sp.csr_array((count * dim, count))
    barycentric, weights = quadrature_rule(dim, 2 * order + 1)
    gradients, masks = barycentric_gradients(mesh), region_masks(mesh)
    values = shape_values(order, barycentric)
    blocks = np.zeros((len(nodes), size, dim, size))
    for q, point in enumerate(barycentric):
        points = np.einsum("k,mkd->md", point, mesh.points[mesh.cells])
        beta = stress_per_degree(problem, heat, points, masks)
        if not np.isfinite(beta).all():
            raise ProblemError("the thermal stress per degree is not finite somewhere; check expansion and elasticity")
        slopes = np.einsum("la,mad->mld", shape_derivatives(order, point), gradients)
        pull = np.einsum("mce,mke->mkc", beta, slopes) * (weights[q] * mesh.volumes)[:, None, None]
        blocks += pull[:, :, :, None] * values[q]
    rows = np.broadcast_to((nodes[:, :, None] * dim + np.arange(dim))[:, :, :, None], blocks.shape)
    columns = np.broadcast_to(nodes[:, None, None, :], blocks.shape)
    return sp.csr_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(count * dim, count))


def cell_thermal_stress(problem: ContactProblem, heat: Heat, temperature: Array) -> Array:
    """``beta (th - stress_free)`` in the middle of each cell, shape (M, d, d), of temperatures (nodes,)."""
    mesh, order = problem.mesh, problem.order
    middle = np.full(mesh.dim + 1, 1.0 / (mesh.dim + 1))
    here = temperature[mesh.cell_nodes(order)] @ shape_values(order, middle[None])[0] - heat.stress_free
    points = mesh.points[mesh.cells].mean(axis=1)
    return np.asarray(stress_per_degree(problem, heat, points, region_masks(mesh)) * here[:, None, None])
