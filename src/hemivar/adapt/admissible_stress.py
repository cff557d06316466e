"""Stresses in equilibrium with the loads, lifted from tractions in equilibrium cell by cell.

On a cell the moments of its tractions determine the stress s of the split element with them and with the mean

    int s = sum of m (x) x + sum of (int f0 phi_a) (x) x_a,

which makes ``int (div s + f0) . v`` vanish for all linear v on the cell. This is symmetric because the moments of the
cell balance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from hemivar.adapt.body_data import BodyData
from hemivar.adapt.vertex_moments import Tractions, equilibrated
from hemivar.basics.types import Array
from hemivar.fem.assembly import quadrature_rule
from hemivar.fem.facet_table import facet_vertices
from hemivar.fem.split_element import SplitElement, split_element, voigt, voigt_map

__all__ = ["AdmissibleStress", "admissible_stress", "reference_corners"]


def reference_corners(dim: int) -> Array:
    """Corners (d + 1, d) of the reference simplex, from its centroid."""
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    return np.asarray(corners - corners.mean(axis=0))


@dataclass(frozen=True, eq=False)
class AdmissibleStress:
    """A stress s with ``div s + f0 = 0`` against linear fields on cells, and the tractions that are given.

    Attributes
    ----------
    data : BodyData
    tractions : Tractions
        Which determine it.
    """

    data: BodyData
    tractions: Tractions

    @property
    def element(self) -> SplitElement:
        """The element on each cell."""
        return split_element(self.data.table.dim)

    def with_moments(self, moments: Array) -> AdmissibleStress:
        """The stress of other tractions in equilibrium, (F, d, d)."""
        return AdmissibleStress(self.data, replace(self.tractions, moments=moments))

    @cached_property
    def difference(self) -> Array:
        """Degrees of freedom (M, n), on the reference simplex, of the difference to the mean of ``C eps`` on cells."""
        table = self.data.table
        dim = table.dim
        moments = table.of_cells(self.tractions.moments) - self.data.cell_moments[:, :, None]
        back = np.einsum("mij,mfaj->mfai", table.inverse, moments, optimize=True)
        loads = np.einsum("mij,maj->mai", table.inverse, self.data.loads + self.tractions.defect, optimize=True)
        x = reference_corners(dim)
        integral = np.einsum("mfai,faj->mij", back, x[facet_vertices(dim)], optimize=True)
        integral += np.einsum("mai,aj->mij", loads, x)
        return np.concatenate([back.reshape(len(back), -1), voigt(integral)], axis=1)

    @cached_property
    def misfit(self) -> Array:
        """``int_T (s - C eps) : C^-1 (s - C eps)`` of each cell, shape (M,), exact where C is constant on the cell.

        Where it varies there it is integrated by a rule of degree 4 on the pieces of the cell.
        """
        data = self.data
        if not data.varies:
            stress = self.element.at_vertices(self.difference)
            return self.element.energy(stress, data.reference_compliance)
        return self._varying_misfit()

    @cached_property
    def stresses(self) -> Array:
        """The stress at the vertices of the pieces of each cell as vectors, shape (M, d + 1, d + 1, v)."""
        table = self.data.table
        change = voigt_map(table.jacobian) / table.sizes[:, None, None]
        difference = self.element.at_vertices(self.difference)
        mapped = np.einsum("mpq,mbaq->mbap", change, difference, optimize=True)
        return np.asarray(mapped + voigt(self.data.stress)[:, None, None])

    def _varying_misfit(self) -> Array:
        data, dim = self.data, self.data.table.dim
        mesh, table = data.problem.mesh, data.table
        barycentric, weights = quadrature_rule(dim, 4)
        corners = mesh.points[table.cells]
        centroid = corners.mean(axis=1)
        engineering = voigt(data.strain) * np.where(np.arange(data.compliance.shape[1]) < dim, 1.0, 2.0)
        misfit = np.zeros(len(corners))
        masks = {name: np.isin(np.arange(len(corners)), ids) for name, ids in mesh.regions.items()}
        for piece in range(dim + 1):
            own = corners.copy()
            own[:, piece] = centroid
            for point, weight in zip(barycentric, weights, strict=True):
                tensor = data.problem.material.stiffness_tensor(np.einsum("a,mad->md", point, own), masks)
                stress = np.einsum("a,map->mp", point, self.stresses[:, piece])
                off = stress - np.einsum(
                    "mpq,mq->mp", np.broadcast_to(tensor, (len(own), *tensor.shape[1:])), engineering
                )
                strain = np.linalg.solve(tensor, off[:, :, None])[:, :, 0]
                misfit += weight * table.volumes / (dim + 1) * np.einsum("mp,mp->m", off, strain)
        return misfit


def admissible_stress(data: BodyData, pressures: Array | None = None) -> AdmissibleStress:
    """The stress of tractions in equilibrium vertex by vertex.

    Parameters
    ----------
    data : BodyData
    pressures : array, shape (F, d, d), optional
        See :func:`hemivar.adapt.vertex_moments.equilibrated`; zero by default.

    Raises
    ------
    ProblemError
        Cells around a vertex are joined there through no facet.
    """
    start = np.zeros(data.facet_loads.shape) if pressures is None else pressures
    return AdmissibleStress(data, equilibrated(data, start))
