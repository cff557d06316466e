"""Stresses in equilibrium with the loads, lifted from tractions in equilibrium cell by cell.

On a cell the moments of its tractions determine the linear stress s of the split element with them and with the mean

    int s = sum of m (x) x + sum of (int f0 phi_a) (x) x_a,

which makes ``int (div s + f0) . v`` vanish for all linear v on the cell. This is symmetric because the moments of the
cell balance. Of the quadratic stresses that is taken whose divergence is that of the linear part of ``-f0``, and of
those that nearest to ``C eps``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.bulk_gap import saved_by_curvature
from hemivar.bounds.cell_kinds import CellKinds, cell_kinds
from hemivar.bounds.compiled_cells import cell_sums
from hemivar.bounds.split_element import (
    SplitElement,
    split_element,
    voigt,
    voigt_map,
)
from hemivar.bounds.vertex_moments import Tractions, equilibrated
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mesh.keys import EDGES

__all__ = ["AdmissibleStress", "admissible_stress"]

#: Cells whose numbers are held at a time: they fit a cache.
_CELLS = 1 << 12


@dataclass(frozen=True, eq=False)
class AdmissibleStress:
    """A stress s with ``div s + f0 = 0`` against linear fields on cells, and the tractions that are given."""

    data: BodyData
    #: Which determine it.
    tractions: Tractions

    @property
    def element(self) -> SplitElement:
        """The element on each cell."""
        return split_element(self.data.table.dim, self.data.order)

    def with_moments(self, moments: Array) -> AdmissibleStress:
        """The stress of other tractions in equilibrium, (F, k, d)."""
        return AdmissibleStress(self.data, replace(self.tractions, moments=moments))

    @cached_property
    def difference(self) -> Array:
        """Degrees of freedom (M, n), on the reference simplex, of the difference to ``stresses`` of the data."""
        data, table = self.data, self.data.table
        element, dim = self.element, table.dim
        every = data.cell_moments
        # the divergence of the data's stresses is constant on cells: the balance with the moments brings it in
        loads = data.linear(data.loads + self.tractions.defect)
        out = np.empty((len(loads), len(element.loading)))
        for start in range(0, len(loads), _CELLS):
            part = slice(start, start + _CELLS)
            moments = table.of_cells(self.tractions.moments, part) - every[part]
            both = np.concatenate([moments.reshape(len(moments), -1, dim), loads[part]], axis=1)
            back = np.ascontiguousarray(both.transpose(1, 2, 0))  # cells last
            inverse = np.ascontiguousarray(table.inverse[part].transpose(1, 2, 0))
            turned = np.stack([sum(row[j] * back[:, j] for j in range(dim)) for row in inverse], axis=1)
            out[part] = (element.loading @ turned.reshape(-1, len(both))).T
        return element.settled(out, data.reference_compliance)

    @cached_property
    def misfit(self) -> Array:
        """What each cell adds to ``eta^2``, shape (M,): ``int_T (s - C eps) : C^-1 (s - C eps)``.

        Of a material that is not linear it is an upper bound of ``2 int_T W(eps) + W*(s) - s : eps``.
        """
        if self.data.stored is None:
            return self.square
        return np.asarray(np.maximum(self.square - saved_by_curvature(self.data, self.element, self.difference), 0.0))

    @cached_property
    def square(self) -> Array:
        """``int_T (s - C eps) : C^-1 (s - C eps)`` of each cell, shape (M,), exact where C is constant on the cell.

        Where it varies there it is integrated by a rule of degree 4 (6 for quadratic stresses) on the pieces of the
        cell. Of a material that is not linear that of ``s - W'(eps)`` with C_low.
        """
        data = self.data
        if data.stored is not None:
            return self._sums(cell_kinds(data.table, data.compliance))[0]
        return self._varying_misfit() if data.varies else self.mean_square

    @cached_property
    def mean_square(self) -> Array:
        """The same by the compliance by which patches are improved, which is constant on each cell."""
        return self._sums(self.data.kinds)[0]

    def slopes(self) -> Array:
        """Half the derivatives (M, n) of ``mean_square`` by the moments on facets, on the reference simplex."""
        energies, slopes = self._sums(self.data.kinds, slopes=True)
        vars(self).setdefault("mean_square", energies)
        return slopes

    def _sums(self, kinds: CellKinds, slopes: bool = False) -> tuple[Array, Array]:
        """Energies (M,) of the difference, and slopes where they are wanted."""
        compiled = cell_sums(self.data, self.tractions, self.element, kinds, slopes)
        if compiled is not None:
            return compiled
        element, matrix = self.element, self.data.reference_compliance
        energies, out = element.energy_of(self.difference, kinds.of_cells), np.empty((len(matrix), element.moments))
        for start in range(0, len(out) if slopes else 0, _CELLS):
            part = slice(start, start + _CELLS)
            out[part] = element.slope(self.difference[part], matrix[part])
        return energies, out

    @cached_property
    def stresses(self) -> Array:
        """The stress at the nodes of the pieces of each cell as vectors, shape (M, d + 1, l, v)."""
        data, table, dim = self.data, self.data.table, self.data.table.dim
        change = voigt_map(table.jacobian) / table.sizes[:, None, None]
        difference = self.element.at_nodes(self.difference)
        mapped = np.einsum("mpq,mbaq->mbap", change, difference, optimize=True)
        own = voigt(data.stresses)
        if data.order == 1:
            return np.asarray(mapped + own[:, :1, None])
        for piece in range(dim + 1):
            mapped[:, piece] += np.einsum("av,mvp->map", _linear_at_nodes(piece, dim, data.order), own)
        return np.asarray(mapped)

    def _varying_misfit(self) -> Array:
        data, dim = self.data, self.data.table.dim
        mesh, table = data.problem.mesh, data.table
        barycentric, weights = quadrature_rule(dim, 2 + 2 * data.order)
        corners = mesh.points[table.cells]
        engineering = voigt(data.strains) * np.where(np.arange(data.compliance.shape[1]) < dim, 1.0, 2.0)
        misfit = np.zeros(len(corners))
        masks = {name: np.isin(np.arange(len(corners)), ids) for name, ids in mesh.regions.items()}
        for piece in range(dim + 1):
            to_cell = _linear_at_nodes(piece, dim, 1)
            for point, weight in zip(barycentric, weights, strict=True):
                barycentre = point @ to_cell
                tensor = data.problem.material.stiffness_tensor(np.einsum("a,mad->md", barycentre, corners), masks)
                stress = np.einsum("a,map->mp", shape_values(data.order, point), self.stresses[:, piece])
                strain = np.einsum("a,map->mp", barycentre, engineering)
                off = stress - np.einsum(
                    "mpq,mq->mp", np.broadcast_to(tensor, (len(stress), *tensor.shape[1:])), strain
                )
                strain = np.linalg.solve(tensor, off[:, :, None])[:, :, 0]
                misfit += weight * table.volumes / (dim + 1) * np.einsum("mp,mp->m", off, strain)
        return misfit


def _linear_at_nodes(piece: int, dim: int, order: int) -> Array:
    """Barycentric coordinates (l, d + 1), in the cell, of the nodes of a piece."""
    corners = np.eye(dim + 1)
    corners[piece] = 1.0 / (dim + 1)
    middle = [0.5 * (corners[a] + corners[b]) for a, b in EDGES[dim]] if order == 2 else []
    return np.vstack([corners, *middle])


def admissible_stress(data: BodyData, pressures: Array | None = None) -> AdmissibleStress:
    """The stress of tractions in equilibrium vertex by vertex.

    ``pressures`` is (F, k, d).
    """
    return AdmissibleStress(data, equilibrated(data, pressures))
