"""What of the loads no linear field sees: on cells and on facets, where a stress with linear tractions misses it.

``f0 + div s`` is orthogonal to the linear fields of a cell and ``f_N - s nu`` to those of a facet, so that their work
against v is at most their size times ``kappa |v|_a`` of the cell.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.adapt.admissible_stress import AdmissibleStress
from hemivar.basics.types import Array
from hemivar.certify.local_constants import local_constants
from hemivar.fem.assembly import quadrature_rule
from hemivar.fem.elements import shape_derivatives, shape_values
from hemivar.fem.split_element import facet_mass, pairs_of
from hemivar.mechanics.conditions import Pressure, evaluate_scalar, evaluate_vector

__all__ = ["Oscillation", "oscillation"]


@dataclass(frozen=True, eq=False)
class Oscillation:
    """What each cell has to add to its ``eta_T``.

    Attributes
    ----------
    cells : array, shape (M,)
    present : bool
        Whether loads vary at all.
    """

    cells: Array
    present: bool


def oscillation(stress: AdmissibleStress) -> Oscillation:
    """The oscillation of the loads of a stress; zero where they are constant."""
    data = stress.data
    problem, table = data.problem, data.table
    tractions = {name: value for name, value in problem.tractions.items() if _varies(value)}
    added = np.zeros(len(table.cells))
    if not (callable(problem.body_force) or tractions):
        return Oscillation(added, False)
    constants = local_constants(table, _stiffness(stress))
    if callable(problem.body_force):
        added += constants.cell * np.sqrt(_body(stress))
    dim = table.dim
    point, weight = quadrature_rule(dim - 1, 5)
    shapes, inverse = shape_values(data.order, point), np.linalg.inv(facet_mass(dim, data.order))
    for name, traction in tractions.items():
        facets = np.unique(table.numbers(problem.mesh.boundaries[name]))
        places = np.einsum("qa,fai->fqi", point, table.mesh.points[table.facets[facets]])
        flat, what = places.reshape(-1, dim), f"tractions['{name}']"
        if isinstance(traction, Pressure):
            normals = np.repeat(table.normals[facets], len(weight), axis=0)
            values = -evaluate_scalar(traction.value, flat, what)[:, None] * normals
        else:
            values = evaluate_vector(traction, flat, what)
        values = values.reshape(places.shape)
        moments = np.einsum("q,qa,fqi->fai", weight, shapes, values)
        seen = np.einsum("qa,ab,fbi->fqi", shapes, inverse, moments)
        square = table.measures[facets] * np.einsum("q,fqi->f", weight, (values - seen) ** 2)
        cell = table.owners[facets, 0]
        local = np.argmax(table.cell_facets[cell] == facets[:, None], axis=1)
        np.add.at(added, cell, constants.facet[cell, local] * np.sqrt(square))
    return Oscillation(added, True)


def _varies(traction: object) -> bool:
    return callable(traction.value) if isinstance(traction, Pressure) else callable(traction)


def _stiffness(stress: AdmissibleStress) -> Array:
    """The elasticity matrix of each cell; the weakest at the points of the rule where it varies within cells."""
    data = stress.data
    scale = np.where(np.arange(data.tensors.shape[-1]) < data.table.dim, 1.0, np.sqrt(2.0))
    least = np.linalg.eigvalsh(data.tensors * np.outer(scale, scale))[..., 0]
    chosen = np.argmin(least, axis=1)
    return np.asarray(data.tensors[np.arange(len(chosen)), chosen])


def _body(stress: AdmissibleStress) -> Array:
    """Integrals (M,) of ``|f0 + g + div s|^2``, g the linear load of the defect."""
    data, table = stress.data, stress.data.table
    dim, mesh = table.dim, table.mesh
    corners = mesh.points[table.cells]
    centroid = corners.mean(axis=1)
    barycentric, weights = quadrature_rule(dim, 4)
    square = np.zeros(len(corners))
    for piece in range(dim + 1):
        own = corners.copy()
        own[:, piece] = centroid
        inverse = np.linalg.inv((own[:, 1:] - own[:, :1]).transpose(0, 2, 1))
        gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        divergence = np.zeros((len(own), len(weights), dim))
        for q, point in enumerate(barycentric):
            slopes = np.einsum("ab,mbd->mad", shape_derivatives(data.order, point), gradients)
            for component, (i, j) in enumerate(pairs_of(dim)):
                slope = np.einsum("ma,mad->md", stress.stresses[:, piece, :, component], slopes)
                divergence[:, q, i] += slope[:, j]
                if i != j:
                    divergence[:, q, j] += slope[:, i]
        places = np.einsum("qa,mai->mqi", barycentric, own)
        force = evaluate_vector(data.problem.body_force, places.reshape(-1, dim), "body_force").reshape(places.shape)
        size = np.einsum("q,mqi->m", weights, (force + divergence) ** 2)
        square += table.volumes / (dim + 1) * size
    return square
