"""The stiffness matrix of a body over ranks, given to methods that know arrays only."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray

if TYPE_CHECKING:
    from petsc4py import PETSc

__all__ = ["Stiffness", "applied"]


class Stiffness:
    """The matrix of a body, and the parts of it that contact points see; vectors are arrays of this rank.

    Attributes
    ----------
    K : petsc4py Mat
    diagonal : array (n,)
    """

    def __init__(self, K: PETSc.Mat, unknown: IntArray) -> None:
        self.K, self._unknown = K, unknown
        self.diagonal: Array = K.getDiagonal().array_r.copy()

    @cached_property
    def _chosen(self) -> PETSc.IS:
        """The contact unknowns."""
        from petsc4py import PETSc

        places = self.K.getOwnershipRange()[0] + self._unknown
        return PETSc.IS().createGeneral(places.astype(PETSc.IntType), comm=self.K.getComm())

    @cached_property
    def _all(self) -> tuple[PETSc.Mat, PETSc.Vec, PETSc.Vec]:
        return self.K, *self.K.createVecs()

    @cached_property
    def _rows(self) -> tuple[PETSc.Mat, PETSc.Vec, PETSc.Vec]:
        from petsc4py import PETSc

        start, end = self.K.getOwnershipRangeColumn()
        columns = PETSc.IS().createStride(end - start, start, 1, comm=self.K.getComm())
        rows = self.K.createSubMatrix(self._chosen, columns)
        return rows, *rows.createVecs()

    @cached_property
    def _block(self) -> tuple[PETSc.Mat, PETSc.Vec, PETSc.Vec]:
        block = self.K.createSubMatrix(self._chosen, self._chosen)
        return block, *block.createVecs()

    @cached_property
    def own_block(self) -> sp.csr_array:
        """Stiffness between the contact unknowns of this rank, (k, k)."""
        first, columns, entries = self._block[0].getDiagonalBlock().getValuesCSR()
        return sp.csr_array((entries, columns, first), shape=(self._unknown.size, self._unknown.size))

    def multiply(self, x: Array) -> Array:
        """``K x``."""
        matrix, right, left = self._all
        return applied(matrix.mult, right, left, x)

    def pull(self, x: Array) -> Array:
        """``K x`` at the contact unknowns."""
        matrix, right, left = self._rows
        return applied(matrix.mult, right, left, x)

    def push(self, values: Array) -> Array:
        """``K x`` of a vector with these values at the contact unknowns and zeros elsewhere."""
        matrix, right, left = self._rows
        return applied(matrix.multTranspose, left, right, values)

    def couple(self, values: Array) -> Array:
        """The same at the contact unknowns alone."""
        matrix, right, left = self._block
        return applied(matrix.mult, right, left, values)


def applied(work: Callable[[PETSc.Vec, PETSc.Vec], None], given: PETSc.Vec, made: PETSc.Vec, x: Array) -> Array:
    """What ``work`` makes of an array, by way of two petsc4py vectors of its form and of that of the answer."""
    x, out = np.ascontiguousarray(x, dtype=float), np.empty(made.getLocalSize())
    given.placeArray(x)
    made.placeArray(out)
    try:
        work(given, made)
    finally:
        made.resetArray()
        given.resetArray()
    return out
