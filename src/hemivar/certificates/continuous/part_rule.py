"""Rules of integration on the parts of contact facets; those with the corners of the part among their points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from hemivar.basics.types import Array
from hemivar.fem.quadrature import quadrature_rule

__all__ = ["PART_RULES", "PartRule", "cut_triangle"]


@dataclass(frozen=True, eq=False)
class PartRule:
    """A rule whose first d points are the corners; exact for the squares of what is linear on the part.

    On edges, where tractions may be quadratic, it is exact for the squares of those.
    """

    points: Array  # (n, d), barycentric
    weights: Array  # (n,), of sum 1

    @property
    def corners(self) -> int:
        """d."""
        return int(self.points.shape[1])


_INNER = 0.5 * (1.0 - 1.0 / np.sqrt(5.0))  # of the rule of Lobatto with four points
_MIDDLES = 0.5 * (1.0 - np.eye(3))

#: By dimension of the body.
PART_RULES: Mapping[int, PartRule] = MappingProxyType(
    {
        2: PartRule(
            np.array([[1.0, 0.0], [0.0, 1.0], [1.0 - _INNER, _INNER], [_INNER, 1.0 - _INNER]]),
            np.array([1.0, 1.0, 5.0, 5.0]) / 12.0,
        ),
        3: PartRule(np.vstack([np.eye(3), _MIDDLES]), np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]) / 3.0),
    }
)


def cut_triangle(parts: int, rule: PartRule | None) -> tuple[Array, Array]:
    """Barycentric coordinates (q, 3) and weights (q,) of a rule on the parts of a triangle, by default of degree 4.

    That of degree 3 has negative weights, which may make squares with kinks too small.  The corners of the triangle are
    there, too.
    """
    point, weight = quadrature_rule(2, 4) if rule is None else (rule.points, rule.weights)
    points = []
    for i in range(parts):
        for j in range(parts - i):
            corner = np.array([[i, j], [i + 1, j], [i, j + 1]], dtype=float)
            points.append(point @ corner)
            if i + j < parts - 1:
                points.append(point @ np.array([[i + 1, j + 1], [i, j + 1], [i + 1, j]], dtype=float))
    at, shares = np.concatenate(points) / parts, np.tile(weight, parts**2) / parts**2
    if rule is None:  # the corners take no part in integrals, but constants must hold there too
        at = np.vstack([at, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])
        shares = np.append(shares, np.zeros(3))
    return np.column_stack([1.0 - at.sum(axis=1), at]), shares
