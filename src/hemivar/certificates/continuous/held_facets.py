"""Along which directions supports hold the facets of the boundary."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.certificates.continuous.facet_table import FacetTable
from hemivar.fem.supports import DEPENDENT
from hemivar.mechanics.conditions import Fixed, Roller
from hemivar.mechanics.statement import ContactProblem

__all__ = ["held_facets"]


def held_facets(problem: ContactProblem, table: FacetTable) -> Array:
    """Orthogonal projections (F, d, d) on the directions that supports hold; zero on all other facets."""
    mesh = problem.mesh
    dim = mesh.dim
    held = np.zeros((len(table.facets), dim, dim))
    for name, support in problem.supports.items():
        number = table.numbers(mesh.boundaries[name])
        if isinstance(support, Roller):
            directions = [table.normals[number]]
        else:
            axes = (support.x, support.y, support.z)[:dim] if isinstance(support, Fixed) else (0.0,) * dim
            directions = [
                np.broadcast_to(np.eye(dim)[c], (len(number), dim)) for c in range(dim) if axes[c] is not None
            ]
        for direction in directions:
            rest = direction - np.einsum("kij,kj->ki", held[number], direction)
            size = np.linalg.norm(rest, axis=1)
            new = size > DEPENDENT
            unit = rest[new] / size[new, None]
            held[number[new]] += unit[:, :, None] * unit[:, None, :]
    return held
