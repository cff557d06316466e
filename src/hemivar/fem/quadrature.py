"""Quadrature rules on simplices, and values at their points."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import skfem

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.mesh.mesh import Mesh

__all__ = ["at_quadrature_points", "quadrature_rule", "region_masks"]

_REFERENCE = {1: skfem.refdom.RefLine, 2: skfem.refdom.RefTri, 3: skfem.refdom.RefTet}


def quadrature_rule(dim: int, degree: int) -> tuple[Array, Array]:
    """A quadrature rule on the simplex that is exact for polynomials of the given degree.

    Shapes: returns ``barycentric`` (q, d + 1), ``weights`` (q,). Returned: ``weights``: they sum to one.
    """
    points, weights = skfem.quadrature.get_quadrature(_REFERENCE[dim], degree)
    return np.column_stack([1.0 - points.sum(axis=0), points.T]), np.asarray(weights) * math.factorial(dim)


def region_masks(mesh: Mesh) -> dict[str, BoolArray]:
    """Which cells belong to which region, each of shape (M,)."""
    masks = {}
    for name, ids in mesh.regions.items():
        mask = np.zeros(mesh.number_of_cells, dtype=bool)
        mask[ids] = True
        masks[name] = mask
    return masks


def at_quadrature_points(
    mesh: Mesh,
    degree: int,
    values: Callable[[Array, dict[str, BoolArray]], Array],
    cells: slice | IntArray = slice(None),
    vertices: IntArray | None = None,
) -> tuple[Array, Array]:
    """Values of a function at the quadrature points of some cells, shape (k, q, ...), and weights of the rule, (q,).

    Shapes: ``vertices`` (k, d + 1).
    """
    barycentric, weights = quadrature_rule(mesh.dim, degree)
    corners = mesh.points[mesh.cells[cells] if vertices is None else vertices]
    points = np.einsum("qk,mkd->mqd", barycentric, corners)
    masks = {name: np.repeat(mask[cells], len(weights)) for name, mask in region_masks(mesh).items()}
    sampled = values(points.reshape(-1, mesh.dim), masks)
    return sampled.reshape(*points.shape[:2], *sampled.shape[1:]), weights
