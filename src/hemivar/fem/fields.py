"""Post-processing of displacement fields: strains, stresses, nodal averages and norms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.elements import barycentric_gradients, scaled_gradients, shape_derivatives
from hemivar.fem.initial_load import initial_stress
from hemivar.fem.quadrature import quadrature_rule, region_masks
from hemivar.fem.rings import hoop_strain
from hemivar.mechanics.statement import ContactProblem, expect_body
from hemivar.mesh.mesh import Mesh

__all__ = ["FieldSource", "gradient", "nodal_average", "out_of_plane_stress", "strain", "stress", "v_norm", "von_mises"]


class FieldSource(Protocol):
    """What says where a field lives: a ContactProblem."""

    @property
    def mesh(self) -> Mesh:
        """The mesh."""

    @property
    def order(self) -> int:
        """Polynomial degree."""


def _refuse_placeless(source: object) -> None:
    if not isinstance(source, Mesh) and not isinstance(getattr(source, "mesh", None), Mesh):
        raise ProblemError(f"source is {described(source)}; give a mesh, a problem or a field")


def strain(source: FieldSource | Mesh, displacement: Array) -> Array:
    """Linearised strain of each cell (at the centroid for order 2).

    Parameters
    ----------
    source : Field, ContactProblem or Mesh
    displacement : array, shape (nodes, d)

    Returns
    -------
    array, shape (M, d, d)
    """
    field = real_array(displacement, "the displacement", finite=False)
    mesh, order = _mesh_and_order(source, field)
    centroid = np.full(mesh.dim + 1, 1.0 / (mesh.dim + 1))
    return _strain_at(mesh, order, field, centroid)


def stress(source: ContactProblem, displacement: Array) -> Array:
    """Stress in the plane (2D) or in space of each cell (at the centroid for order 2).

    ``C eps(u)`` where the material is linear, beside the stress that the body has at the start.

    Parameters
    ----------
    source : ContactProblem
    displacement : array, shape (nodes, d)

    Returns
    -------
    array, shape (M, d, d)
    """
    expect_body(source, "what the stress is taken of", "it needs the material: pass the ContactProblem")
    rows = _stress_rows(source, displacement)
    return np.asarray(rows[:, source.kinematics.rows])


def _stress_rows(source: ContactProblem, displacement: Array) -> Array:
    """The same in the order of the elasticity matrix, shape (M, v)."""
    points, masks = _centroids(source.mesh), region_masks(source.mesh)
    rows = source.material.stress(points, source.kinematics.strain(strain(source, displacement)), masks)
    if source.initially_stressed:
        rows = rows + initial_stress(source, points, masks)[0]
    if not source.kinematics.ring:
        return rows
    around = hoop_strain(source.mesh, source.order, displacement)
    return np.asarray(rows + source.material.hoop_row(points, masks)[:, :3] * around[:, None])


def out_of_plane_stress(source: ContactProblem, displacement: Array) -> Array:
    """The stress across the plane in the middle of each cell, of axial symmetry that around the axis; shape (M,)."""
    points, masks = _centroids(source.mesh), region_masks(source.mesh)
    across = source.material.out_of_plane_stress(points, strain(source, displacement), masks)
    if source.initially_stressed:
        across = across + initial_stress(source, points, masks)[1]
    if not source.kinematics.ring:
        return across
    return across + source.material.hoop_row(points, masks)[:, 3] * hoop_strain(source.mesh, source.order, displacement)


def von_mises(source: ContactProblem, displacement: Array) -> Array:
    """Von Mises stress of each cell, the out-of-plane stress of plane models included.

    ``sigma_zz`` is ``lam (eps_xx + eps_yy)`` in plane strain, 0 in plane stress; for a general tensor see
    :meth:`Material.tensor`.

    Parameters
    ----------
    source : ContactProblem
    displacement : array, shape (nodes, d)

    Returns
    -------
    array, shape (M,)
    """
    expect_body(source, "what the stress is taken of", "it needs the material: pass the ContactProblem")
    dim, rows = source.mesh.dim, _stress_rows(source, displacement).T
    across = [out_of_plane_stress(source, displacement)] if dim == 2 else []
    diagonal = [*rows[:dim], *across]
    mean = sum(diagonal) / 3.0  # taken off before anything is squared
    square = sum((part - mean) ** 2 for part in diagonal) + 2.0 * sum(shear**2 for shear in rows[dim:])
    return np.asarray(np.sqrt(1.5 * square))


def gradient(problem: ContactProblem, values: Array) -> tuple[Array, Array]:
    """Gradient of nodal values (nodes, 1) in the middle of each cell, and the flux there, each (M, d).

    Parameters
    ----------
    problem : ContactProblem
        Of one component.
    values : array
        Shape (nodes, 1).

    Returns
    -------
    tuple of two arrays
    """
    mesh, order = problem.mesh, problem.order
    middle = np.full(mesh.dim + 1, 1.0 / (mesh.dim + 1))
    shapes = np.einsum("la,kad->kld", shape_derivatives(order, middle), barycentric_gradients(mesh))
    slope = np.einsum("kld,kl->kd", shapes, values.ravel()[mesh.cell_nodes(order)])
    return slope, problem.material.stress(_centroids(mesh), slope, region_masks(mesh))


def nodal_average(source: FieldSource | Mesh, values: Array, summed: Callable[[Array], Array] | None = None) -> Array:
    """Averages at the nodes of values on the cells, weighted by the cell volumes.

    Parameters
    ----------
    source : Field, ContactProblem or Mesh
        A mesh means its vertices.
    values : array, shape (M, ...)
    summed : function, optional
        Adds what other processes have of sums (nodes, k) at the nodes of a part of a mesh.

    Returns
    -------
    array, shape (nodes, ...)

    Raises
    ------
    ProblemError
        There is not one entry for each cell.
    """
    _refuse_placeless(source)
    mesh = source if isinstance(source, Mesh) else source.mesh
    order = 1 if isinstance(source, Mesh) else source.order
    values = real_array(values, "values", finite=False)
    if values.shape[:1] != (mesh.number_of_cells,):
        raise ProblemError(f"values has shape {values.shape}; it needs one entry per cell, {mesh.number_of_cells}")
    cells = mesh.cell_nodes(order)
    count = len(mesh.nodes(order))
    repeated = cells.ravel()
    volume = np.repeat(mesh.volumes, cells.shape[1])
    flat = values.reshape(len(values), int(np.prod(values.shape[1:])))  # a rank may have no cells
    sums = np.empty((count, 1 + flat.shape[1]))
    sums[:, 0] = np.bincount(repeated, weights=volume, minlength=count)
    for k, column in enumerate(flat.T, start=1):
        sums[:, k] = np.bincount(repeated, weights=volume * np.repeat(column, cells.shape[1]), minlength=count)
    if summed is not None:
        sums = summed(sums)
    result = sums[:, 1:] / sums[:, :1]
    return result.reshape(count, *values.shape[1:])


def v_norm(source: FieldSource | Mesh, displacement: Array) -> float:
    """The survey's norm of V: ``|u|_V = sqrt(int eps(u) : eps(u))``, exact for the element.

    Parameters
    ----------
    source : Field, ContactProblem or Mesh
        For a mesh the order follows from the number of rows of ``displacement``.
    displacement : array, shape (nodes, d)

    Returns
    -------
    float
    """
    _refuse_placeless(source)
    field = real_array(displacement, "the displacement", finite=False)
    mesh, order = _mesh_and_order(source, field)
    barycentric, weights = quadrature_rule(mesh.dim, 2 * (order - 1) or 1)
    if order == 1:
        barycentric, weights = barycentric[:1], np.ones(1)
    square = 0.0
    for point, weight in zip(barycentric, weights, strict=True):
        eps = _strain_at(mesh, order, field, point)
        square += float(weight) * float(np.einsum("m,mij,mij->", mesh.volumes, eps, eps))
    return float(np.sqrt(square))


def _strain_at(mesh: Mesh, order: int, displacement: Array, barycentric: Array) -> Array:
    """Strain at the same barycentric point of every cell, shape (M, d, d)."""
    slopes = scaled_gradients(mesh, slice(None), mesh.volumes)
    gradient = gradients_at(slopes, mesh.cell_nodes(order), displacement, order, barycentric)
    return np.asarray(0.5 * (gradient + gradient.transpose(1, 0, 2))).transpose(2, 0, 1)


def gradients_at(slopes: Array, nodes: IntArray, displacement: Array, order: int, barycentric: Array) -> Array:
    """Gradients of a displacement at the same barycentric point of some cells, shape (d, d, k).

    Shapes: ``slopes`` of the barycentric coordinates (d + 1, d, k), ``nodes`` of the cells (k, L).
    """
    shapes = slopes if order == 1 else np.tensordot(shape_derivatives(order, barycentric), slopes, axes=1)
    return gradients_by(shapes, nodes, displacement)


def gradients_by(shapes: Array, nodes: IntArray, displacement: Array) -> Array:
    """The same by the gradients of the shape functions (L, d, k)."""
    gradient = np.zeros((displacement.shape[1], *shapes.shape[1:]))
    for number, shape in zip(nodes.T, shapes, strict=True):
        for component, moved in zip(gradient, displacement.T, strict=True):
            component += moved[number] * shape
    return gradient


def _mesh_and_order(source: FieldSource | Mesh, displacement: Array) -> tuple[Mesh, int]:
    mesh = source if isinstance(source, Mesh) else source.mesh
    shape = np.shape(displacement)
    fits = 1 if shape[:1] == (mesh.number_of_nodes,) else 2
    order = fits if isinstance(source, Mesh) else source.order
    expected = (mesh.number_of_nodes if order == 1 else mesh.number_of_nodes + len(mesh.edges), mesh.dim)
    if shape != expected:
        raise ProblemError(
            f"the displacement has shape {shape}; a field of order {order} on this mesh has shape {expected}"
        )
    return mesh, order


def _centroids(mesh: Mesh) -> Array:
    return np.asarray(sum(mesh.points[corner] for corner in mesh.cells.T) / (mesh.dim + 1))
