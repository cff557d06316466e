"""Constants of cells and of their facets for loads that are orthogonal to linear fields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.certificates.continuous.facet_table import FacetTable

__all__ = ["LocalConstants", "local_constants"]

#: sup |v - P v| / |eps(v)| on the regular simplex of edge 1, P the projection on linear fields, over the simplex and
#: on one facet: proved by :func:`hemivar.certificates.continuous.simplex_constants.simplex_constants`, rounded up.
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


def local_constants(table: FacetTable, stiffness: Array) -> LocalConstants:
    """Constants from those of the regular simplex.

    With B the map from the regular simplex of edge 1 and ``v^ = B'v`` strains are related by ``eps^ = B' eps B``, so
    the constants grow by ``s_max(B)^2 / s_min(B)``, on facets times ``sqrt(|F| / |F^|) sqrt(|T^| / |T|)``.

    ``stiffness`` is (M or 1, v, v).
    """
    dim = table.dim
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    if dim == 3:
        corners = np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0], [0.5, np.sqrt(1 / 12), np.sqrt(2 / 3)]])
    regular = (corners[1:] - corners[0]).T
    stretch = np.linalg.svd(table.jacobian @ np.linalg.inv(regular), compute_uv=False)
    scale = np.where(np.arange(stiffness.shape[-1]) < dim, 1.0, np.sqrt(2.0))
    least = np.linalg.eigvalsh(stiffness * np.outer(scale, scale))[:, 0]
    factor = stretch[:, 0] ** 2 / stretch[:, -1] / np.sqrt(least)
    measure = 1.0 if dim == 2 else np.sqrt(3.0) / 4.0
    volume = np.prod(stretch, axis=1)
    on_facets = factor[:, None] * np.sqrt(table.measures[table.cell_facets] / measure / volume[:, None])
    # the trace of a linear function: T. Warburton and J. S. Hesthaven, Comput. Methods Appl. Mech. Eng. 192 (2003)
    spread = np.sqrt(2.0 * (dim + 1) / dim * table.measures[table.cell_facets] / table.volumes[:, None])
    return LocalConstants(_CELL[dim] * factor, _FACET[dim] * on_facets, _SHIFT[dim] * on_facets, spread)
