"""Compliances of cells on the reference simplex: congruent cells of one material share one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, IntArray
from hemivar.bounds.facet_table import FacetTable
from hemivar.bounds.split_element import pulled_back, upper_pulled_back
from hemivar.kernels.mesh_sums import alike_rows
from hemivar.mesh.keys import equal_rows

__all__ = ["CellKinds", "cell_kinds", "congruent_cells"]


@dataclass(frozen=True, eq=False)
class CellKinds:
    """The kind of each cell, and the compliance of each kind."""

    number: IntArray  # (M,)
    #: Upper triangles on the reference simplex, row after row.
    compliance: Array  # (k, v (v + 1) / 2)

    @property
    def of_cells(self) -> Array:
        """The compliance of each cell, (M, v (v + 1) / 2)."""
        return np.asarray(self.compliance[self.number])


def cell_kinds(table: FacetTable, compliance: Array) -> CellKinds:
    """Those of cells with these compliances (M or 1, v, v)."""
    number = congruent_cells(table, compliance)
    first = np.empty(int(number.max(initial=-1)) + 1, dtype=np.int64)
    first[number[::-1]] = np.arange(len(number))[::-1]
    own, sizes = compliance if len(compliance) == 1 else compliance[first], table.sizes[first]
    upper = upper_pulled_back(own, table.mesh.points, table.cells[first], sizes)
    if upper is None:
        rows, columns = np.triu_indices(compliance.shape[-1])
        upper = np.ascontiguousarray(pulled_back(own, table.jacobian[first], sizes)[:, rows, columns])
    return CellKinds(number, upper)


def congruent_cells(table: FacetTable, compliance: Array) -> IntArray:
    """Numbers (M,) of cells: the same where Jacobians and compliances are, but for rounding.

    Cells of the regular meshes of boxes, and those that uniform refinement makes of one cell, are of a few kinds.
    """
    parts = [table.gradients.reshape(len(table.cells), -1)]
    if len(compliance) > 1:
        parts.append(np.ascontiguousarray(compliance).reshape(len(parts[0]), -1))
    number = alike_rows(parts[0], parts[1] if len(parts) > 1 else None, SAME)
    return equal_rows(np.concatenate([_rounded(part) for part in parts], axis=1)) if number is None else number


def _rounded(values: Array) -> IntArray:
    """Integers for numbers (M, q): those of each row over its largest, and the logarithm of that."""
    size = np.abs(values).max(axis=1, keepdims=True, initial=np.finfo(float).tiny)
    return np.rint(np.concatenate([values / size, np.log2(size)], axis=1) / SAME).astype(np.int64)
