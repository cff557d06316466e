"""Stresses and nodal forces (gather, B-matrix, scatter) of linear elements by the compiled kernels."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.kernels.library import kernels
from hemivar.kernels.read_arrays import given, numbers

__all__ = ["cell_strains"]


def cell_strains(
    displacement: Array, cells: IntArray, gradients: Array, size: Array, stiffness: Array
) -> tuple[Array, Array] | None:
    """Stresses (M, d, d) and nodal forces (M, d + 1, d) of the cells; None where no kernels are compiled.

    ``displacement`` (N, d), ``gradients`` (M, d + 1, d) of the barycentric coordinates, ``size`` (M,) is d! times the
    volume, ``stiffness`` (M or 1, v, v); forces are ``int_T C eps grad phi_a``.
    """
    library = kernels()
    if library is None:
        return None
    (nodes, dim), count, number = displacement.shape, len(cells), stiffness.shape[-1]
    matrices = 1 if len(stiffness) == 1 else count
    out = np.empty((count, dim, dim)), np.empty((count, dim + 1, dim))
    arrays = (
        given("displacement", displacement, (nodes, 3 if number == 6 else 2)),
        numbers("cells", cells, (count, dim + 1), nodes),
        given("gradients", gradients, (count, dim + 1, dim)),
        given("sizes", size, (count,)),
        given("stiffness", stiffness, (matrices, number, number)),
        *out,
    )
    library.check(library.call.hv_strains(dim, count, matrices, *map(library.address, arrays)))
    return out
