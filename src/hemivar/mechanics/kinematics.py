"""Kinematics of plane, spatial and axisymmetric bodies and of one component: strains, and the measure of integrals."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.mechanics.material import Material

__all__ = ["BodyKinematics", "voigt_index"]

_Where = TypeVar("_Where")


def voigt_index(dim: int) -> IntArray:
    """Row of the elasticity matrix that belongs to a pair of indices, shape (d, d)."""
    table = [[0, 2], [2, 1]] if dim == 2 else [[0, 5, 4], [5, 1, 3], [4, 3, 2]]
    return np.array(table)


@dataclass(frozen=True, eq=False)
class BodyKinematics:
    """Which strains a field of c components has, and by what its integrals over the mesh are those over the body.

    Strain s is the sum of the derivatives ``du_i/dx_k`` with ``rows[i, k] == s``: Voigt's strains of a displacement
    (shear counts twice), and the gradient of one component.  A body of revolution is a ``ring`` around the axis y, x is
    the radius r: integrals are over rings of length ``2 pi r``, and beside these strains there is ``u_r / r``.
    """

    rows: IntArray  # (c, d)
    ring: bool

    @staticmethod
    def of(material: Material, dim: int) -> BodyKinematics:
        """That of a material in d dimensions."""
        return BodyKinematics(np.arange(dim)[None] if material.scalar else voigt_index(dim), material.axisymmetric)

    def strain(self, gradient: Array) -> Array:
        """Strains (k, v) of gradients (k, c, d)."""
        strain = np.zeros((int(self.rows.max()) + 1, len(gradient)))  # one after the other in memory
        for (i, k), row in np.ndenumerate(self.rows):
            strain[row] += gradient[:, i, k]
        return strain.T

    def hoop_strain(self, points: Array, values: Array, gradient: Array) -> Array:
        """The strain around the axis at points (k, d) of values (k, c) and gradients (k, c, d): on it ``du_r/dr``."""
        radius = points[:, 0]
        return np.where(radius > 0.0, values[:, 0] / np.where(radius > 0.0, radius, 1.0), gradient[:, 0, 0])

    def measure(self, points: Array) -> Array:
        """Lengths of the rings through points (..., d), shape (...); one of other bodies, shape ()."""
        return np.asarray(2.0 * np.pi * points[..., 0] if self.ring else 1.0)

    def over(self, density: Callable[[Array, _Where], Array]) -> Callable[[Array, _Where], Array]:
        """A density, function of points (k, d) and of where they are, times the measure."""
        if not self.ring:
            return density

        def measured(points: Array, where: _Where) -> Array:
            values = density(points, where)
            return np.asarray(self.measure(points).reshape(-1, *[1] * (values.ndim - 1)) * values)

        return measured

    def on_axis(self, nodes: Array) -> BoolArray:
        """Which nodes (k, d) lie on the axis of a body of revolution, shape (k,)."""
        return np.asarray(nodes[:, 0] <= SAME * nodes[:, 0].max(initial=0.0)) & self.ring
