"""The stiffness matrix of a body over ranks, given to methods that know arrays only."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.linear.vectors import Vectors
from hemivar.systems.contact_stiffness import ContactStiffness

if TYPE_CHECKING:
    from petsc4py import PETSc

__all__ = ["Stiffness", "applied"]


class Stiffness(ContactStiffness):
    """The matrix of a body, and the parts of it that contact points see; vectors are arrays of this rank."""

    def __init__(self, K: PETSc.Mat, vectors: Vectors, unknown: IntArray, sign: Array, active: BoolArray) -> None:
        super().__init__(vectors, unknown, sign, active)
        self.K = K
        self.matrix_diagonal: Array = K.getDiagonal().array_r.copy()

    @cached_property
    def _chosen(self) -> PETSc.IS:
        """The contact unknowns."""
        from petsc4py import PETSc

        places = self.K.getOwnershipRange()[0] + self.unknown
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

    def between_contacts(self) -> sp.csr_array:
        first, columns, entries = self._block[0].getDiagonalBlock().getValuesCSR()
        return sp.csr_array((entries, columns, first), shape=(self.unknown.size, self.unknown.size))

    def multiply(self, x: Array) -> Array:
        matrix, right, left = self._all
        return applied(matrix.mult, right, left, x)

    def pull(self, x: Array) -> Array:
        matrix, right, left = self._rows
        return applied(matrix.mult, right, left, x)

    def push(self, values: Array) -> Array:
        matrix, right, left = self._rows
        return applied(matrix.multTranspose, left, right, values)

    def couple(self, step: Array) -> Array:
        matrix, right, left = self._block
        return self.spread(applied(matrix.mult, right, left, self.gather(step)))


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
