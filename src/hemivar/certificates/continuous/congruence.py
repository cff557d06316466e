"""Cells that are translates of each other, in numbering and material too: what is computed of one holds for all."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.certificates.continuous.body_data import BodyData
from hemivar.mesh.keys import equal_rows

__all__ = ["congruent_cells"]

#: Part of the largest number of a cell by which its numbers may differ.
_TOLERANCE = 1e-9


def congruent_cells(data: BodyData) -> IntArray:
    """Numbers (M,) of cells: the same where Jacobians and compliances are, but for rounding.

    Cells of the regular meshes of boxes, and those that uniform refinement makes of one cell, are of a few kinds.
    """
    parts = [_rounded(data.table.jacobian.reshape(len(data.table.cells), -1))]
    if len(data.sweep_compliance) > 1:
        parts.append(_rounded(data.sweep_compliance.reshape(len(data.sweep_compliance), -1)))
    return equal_rows(np.concatenate(parts, axis=1))


def _rounded(values: Array) -> IntArray:
    """Integers for numbers (M, q): those of each row over its largest, and the logarithm of that."""
    size = np.abs(values).max(axis=1, keepdims=True, initial=np.finfo(float).tiny)
    return np.rint(np.concatenate([values / size, np.log2(size)], axis=1) / _TOLERANCE).astype(np.int64)
