"""What of the loads the admissible stress does not balance, on cells and on facets.

``f0 + div s`` is orthogonal to the linear fields of a cell and ``f_N - s nu`` to those of a facet, but for what is
unknown of the moments of the loads. The orthogonal part works by at most its size times ``kappa |v|_a`` of the cell.
Linear loads that are unknown, or that the discrete problem misses, are loads of the body, ``|b| |v|``; those of a facet
are first shifted to its cell (:class:`hemivar.bounds.oscillation.LocalConstants`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.bounds.admissible_stress import AdmissibleStress
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.facet_table import FacetTable
from hemivar.bounds.load_values import LoadValues
from hemivar.bounds.split_element import facet_mass, pairs_of
from hemivar.fem.elements import shape_derivatives, shape_values

__all__ = ["LocalConstants", "Oscillation", "linear_square", "local_constants", "oscillation"]

#: sup |v - P v| / |eps(v)| on the regular simplex of edge 1, P the projection on linear fields, over the simplex and
#: on one facet: proved by ``simplex_constants`` of the tests, rounded up.
_CELL = {2: 0.419, 3: 0.747}
_FACET = {2: 1.113, 3: 3.043}
#: sup |int_F d . (v - P v)| / (|d|_F |eps(v)|) for d linear on one facet, P the projection on linear fields of the
#: simplex: a stress with the traction d answers the load of the simplex that works like d on linear fields; rounded up.
_SHIFT = {2: 2.298, 3: 4.255}


@dataclass(frozen=True, eq=False)
class LocalConstants:
    """Constants of cells and facets for loads that are orthogonal to linear fields."""

    #: ``sup |v - P v|_T / |v|_{a,T}``, P the projection on linear fields.
    cell: Array  # (M,)
    #: ``sup |v - P v|_F / |v|_{a,T}`` for each facet of the cell.
    facet: Array  # (M, d + 1)
    #: ``sup |int_F d . v - int_T b . v| / (|d|_F |v|_{a,T})``, d linear on the facet, b the linear load of the cell
    #: that works like d on linear fields.
    shift: Array  # (M, d + 1)
    #: ``sup |b|_T / |d|_F`` of these.
    spread: Array  # (M, d + 1)


def local_constants(table: FacetTable, stiffness: Array, cells: IntArray | None = None) -> LocalConstants:
    """Constants of cells (M,), by default of all, from those of the regular simplex.

    With B the map from the regular simplex of edge 1 and ``v^ = B'v`` strains are related by ``eps^ = B' eps B``, so
    the constants grow by ``s_max(B)^2 / s_min(B)``, on facets times ``sqrt(|F| / |F^|) sqrt(|T^| / |T|)``.

    ``stiffness`` is (M or 1, v, v).
    """
    dim, chosen = table.dim, slice(None) if cells is None else cells
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    if dim == 3:
        corners = np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0], [0.5, np.sqrt(1 / 12), np.sqrt(2 / 3)]])
    regular = (corners[1:] - corners[0]).T
    stretch = np.linalg.svd(table.jacobian[chosen] @ np.linalg.inv(regular), compute_uv=False)
    scale = np.where(np.arange(stiffness.shape[-1]) < dim, 1.0, np.sqrt(2.0))
    least = np.linalg.eigvalsh(stiffness * np.outer(scale, scale))[:, 0]
    factor = stretch[:, 0] ** 2 / stretch[:, -1] / np.sqrt(least)
    measure = 1.0 if dim == 2 else np.sqrt(3.0) / 4.0
    volume = np.prod(stretch, axis=1)
    sizes = table.measures[table.cell_facets[chosen]]
    on_facets = factor[:, None] * np.sqrt(sizes / measure / volume[:, None])
    # the trace of a linear function: T. Warburton and J. S. Hesthaven, Comput. Methods Appl. Mech. Eng. 192 (2003)
    spread = np.sqrt(2.0 * (dim + 1) / dim * sizes / table.volumes[chosen, None])
    return LocalConstants(_CELL[dim] * factor, _FACET[dim] * on_facets, _SHIFT[dim] * on_facets, spread)


@dataclass(frozen=True, eq=False)
class Oscillation:
    """What each cell has to add."""

    #: To its ``eta_T``.
    cells: Array  # (M,)
    #: To the square of what the whole body lacks: ``|b|_T^2 / Lambda_body`` of the loads b that are unknown or missed.
    missed: Array  # (M,)


def oscillation(stress: AdmissibleStress, body: float) -> Oscillation:
    """The oscillation of the loads of a stress; zero where they are constant."""
    data = stress.data
    table, varying = data.table, data.varying
    cells, linear = np.zeros(len(table.cells)), np.zeros(len(table.cells))
    if varying.body is None and not varying.tractions:
        return Oscillation(cells, linear)
    constants = local_constants(table, _stiffness(stress))
    if varying.body is not None:
        cells += constants.cell * np.sqrt(_body(stress, varying.body))
        linear += varying.body.linear(table.volumes)
    inverse = np.linalg.inv(facet_mass(table.dim, data.order))
    for facets, values in varying.tractions.values():
        measures = table.measures[facets]
        moments = values.moments(len(facets), data.order)
        seen = np.einsum("ab,fbi->fai", inverse, moments / measures[:, None, None])
        square = np.zeros(len(facets))
        for part in values.parts():
            owner, shapes = values.owner[part], shape_values(data.order, values.points(part))
            off = values.values[part] - np.einsum("kqa,kai->kqi", shapes, seen[owner])
            np.add.at(square, owner, values.measures[part] * np.einsum("q,kqi->k", values.rule[1], off**2))
        rest, unknown = np.sqrt(square) + np.sqrt(values.square(len(facets))), values.linear(measures)
        cell = table.owners[facets, 0]
        local = np.argmax(table.cell_facets[cell] == facets[:, None], axis=1)
        np.add.at(cells, cell, constants.facet[cell, local] * rest + constants.shift[cell, local] * unknown)
        np.add.at(linear, cell, constants.spread[cell, local] * unknown)
    missed = np.sqrt(linear_square(data, stress.tractions.missed)) + linear
    with np.errstate(divide="ignore"):
        return Oscillation(cells, np.where(missed > 0.0, missed**2 / max(body, 0.0), 0.0))


def linear_square(data: BodyData, loads: Array) -> Array:
    """``|g|_T^2`` (M,) of the linear fields g on cells with the moments of loads (M, l, d)."""
    table = data.table
    moments, corners = data.linear(loads), table.dim + 1
    whole = moments.sum(axis=1)
    square = np.einsum("mai,mai->m", moments, moments) - np.einsum("mi,mi->m", whole, whole) / (corners + 1)
    return np.asarray(np.maximum(corners * (corners + 1) / table.volumes * square, 0.0))


def _stiffness(stress: AdmissibleStress) -> Array:
    """The elasticity matrix of each cell; the weakest at the points of the rule where it varies within cells."""
    data = stress.data
    scale = np.where(np.arange(data.tensors.shape[-1]) < data.table.dim, 1.0, np.sqrt(2.0))
    least = np.linalg.eigvalsh(data.tensors * np.outer(scale, scale))[..., 0]
    chosen = np.argmin(least, axis=1)
    return np.asarray(data.tensors[np.arange(len(chosen)), chosen])


def _body(stress: AdmissibleStress, values: LoadValues) -> Array:
    """Upper bounds (M,) of ``int |f0 + div s|^2``."""
    divergence = _divergence(stress)
    count, corners = divergence.shape[0], divergence.shape[1]
    square = np.zeros(count)
    for part in values.parts():
        owner, piece, points = values.owner[part], values.piece[part], values.points(part)
        # barycentric coordinates on the piece: corner i of it is the centroid of the cell
        every = np.arange(len(owner))
        centre = points[every, :, piece]
        points = points - centre[:, :, None]
        points[every, :, piece] = corners * centre
        force = values.values[part] + np.einsum("kqa,kai->kqi", points, divergence[owner, piece])
        np.add.at(square, owner, values.measures[part] * np.einsum("q,kqi->k", values.rule[1], force**2))
    return np.asarray((np.sqrt(square) + np.sqrt(values.square(count))) ** 2)


def _divergence(stress: AdmissibleStress) -> Array:
    """``div s`` at the corners of the pieces of cells, between which it is linear, shape (M, d + 1, d + 1, d)."""
    data, table = stress.data, stress.data.table
    dim = table.dim
    corners = table.mesh.points[table.cells]
    divergence = np.zeros((len(corners), dim + 1, dim + 1, dim))
    for piece in range(dim + 1):
        own = corners.copy()
        own[:, piece] = corners.mean(axis=1)
        inverse = np.linalg.inv((own[:, 1:] - own[:, :1]).transpose(0, 2, 1))
        gradients = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
        for corner, point in enumerate(np.eye(dim + 1)):
            slopes = np.einsum("ab,mbd->mad", shape_derivatives(data.order, point), gradients)
            for component, (i, j) in enumerate(pairs_of(dim)):
                slope = np.einsum("ma,mad->md", stress.stresses[:, piece, :, component], slopes)
                divergence[:, piece, corner, i] += slope[:, j]
                if i != j:
                    divergence[:, piece, corner, j] += slope[:, i]
    return divergence
