"""Initial stress of a body: its part of the stress, and the load vector ``-int sigma_0 : eps(v)``."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.fem.elements import barycentric_gradients, shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule, region_masks
from hemivar.mechanics.initial_stress import is_zero, tensors_at
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import ContactProblem

__all__ = ["initial_load", "initial_stress", "stress_across"]


def stress_across(material: Material, points: Array, regions: Mapping[str, BoolArray] | None) -> Array:
    """Stress across the plane for the unit strains xx, yy, xy (doubled), at points (k, 2), shape (k, 3)."""
    columns = []
    for unit in ([[1.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]], [[0.0, 0.5], [0.5, 0.0]]):
        strain = np.broadcast_to(np.array(unit), (len(points), 2, 2))
        columns.append(material.out_of_plane_stress(points, strain, regions))
    return np.stack(columns, axis=1)


def initial_stress(problem: ContactProblem, points: Array, regions: Mapping[str, BoolArray]) -> tuple[Array, Array]:
    """The stress that is there at displacement zero, ``sigma_0 - C : eps_0``, at a point (M, d) of each cell.

    Returns that in the order of the elasticity matrix, (M, v), and that across the plane, or around the axis, (M,).
    """
    body, material, dim = problem.kinematics, problem.material, problem.mesh.dim
    stress, across = tensors_at(problem.initial_stress, "initial_stress", points, regions, body.ring)
    rows = np.zeros((len(points), dim * (dim + 1) // 2))
    rows[:, body.rows] = stress
    if is_zero(problem.initial_strain):
        return rows, across
    tensor, thick = tensors_at(problem.initial_strain, "initial_strain", points, regions, body.ring)
    strain = body.strain(tensor)
    rows -= np.einsum("kij,kj->ki", material.stiffness_tensor(points, regions), strain)
    if dim == 3:
        return rows, across
    if body.ring:
        hoop = material.hoop_row(points, regions)
        coupling, across = hoop[:, :3], across - hoop[:, 3] * thick
    else:
        coupling, stiffness = stress_across(material, points, regions), material.stiffness_across(points, regions)
        if np.isnan(stiffness[thick != 0.0]).any():
            raise ProblemError(
                "initial_strain across the plane makes a stress there that an elasticity matrix of the plane does not "
                "tell; give a tensor of the plane"
            )
        across = across - np.where(thick != 0.0, stiffness, 0.0) * thick
    return rows - coupling * thick[:, None], across - np.einsum("ki,ki->k", coupling, strain)


def initial_load(problem: ContactProblem) -> Array:
    """``-int sigma_0 : eps(v)`` over the body, shape (nodes * d,)."""
    mesh, order, body = problem.mesh, problem.order, problem.kinematics
    nodes, corners, masks = mesh.cell_nodes(order), mesh.points[mesh.cells], region_masks(mesh)
    barycentric, weights = quadrature_rule(mesh.dim, 2 * order + 1)
    gradients, forces = barycentric_gradients(mesh), np.zeros((*nodes.shape, mesh.dim))
    for point, weight, values in zip(barycentric, weights, shape_values(order, barycentric), strict=True):
        points = np.einsum("c,kcd->kd", point, corners)
        rows, around = initial_stress(problem, points, masks)
        measures = weight * mesh.volumes * body.measure(points)
        slopes = np.einsum("la,kad->kld", shape_derivatives(order, point), gradients)
        forces -= np.einsum("kij,klj,k->kli", rows[:, body.rows], slopes, measures)
        if body.ring:
            forces[:, :, 0] -= (around * measures / points[:, 0])[:, None] * values
    load, targets = np.zeros((len(mesh.nodes(order)), mesh.dim)), nodes.ravel()
    for component, part in zip(load.T, np.moveaxis(forces, 2, 0), strict=True):
        component += np.bincount(targets, weights=part.ravel(), minlength=len(load))
    return load.ravel()
