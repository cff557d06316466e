"""The discrete problem of a body over ranks: the serial one, whose arrays are those of this rank."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.discrete.bulk import Sized
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field, Space
from hemivar.errors import MethodError

if TYPE_CHECKING:
    from hemivar.ranks.body_on_ranks import BodyOnRanks

__all__ = ["BulkOnRanks", "FieldOnRanks", "body_of", "problem_of"]


@dataclass(frozen=True, eq=False)
class BulkOnRanks(Sized):
    """The stored energy of a body over ranks: a :class:`hemivar.discrete.Bulk` whose arrays are those of this rank."""

    body: BodyOnRanks

    @property
    def unknowns(self) -> int:
        """Number of unknowns n of this rank, held ones included."""
        return int(self.body.load.size)

    def value(self, u: Array) -> float:
        """The stored energy of all ranks, which call this together."""
        body, stored = self.body, self.body.stored
        if stored is None:
            return float(body.vectors.total(0.5 * float(u @ body.multiply(u)))[0])
        own = stored.value(body.displacement(u)) - float(stored.initial_forces @ u)
        return float(body.vectors.total(own)[0]) - stored.initial_value

    def gradient(self, u: Array) -> Array:
        """The internal forces, (n,)."""
        body = self.body
        return body.multiply(u) if body.stored is None else body.load - body.out_of_balance(u)

    def hessian(self, u: Array) -> sp.csr_array:
        """Refused: the matrix is in PETSc."""
        raise MethodError("the stiffness of a body over ranks is in PETSc; multiply by it")

    @property
    def diagonal(self) -> Array:
        """Diagonal of the stiffness, (n,) of this rank."""
        return self.body.elastic.matrix_diagonal

    def rounding_scale(self, u: Array, load: Array) -> float:
        """Norm of the sizes of what is added up in the forces of all ranks."""
        return float(self.body.vectors.norms(self.body.row_sums * np.abs(u) + np.abs(load))[0])

    @cached_property
    def lower(self) -> BulkOnRanks | None:  # type: ignore[override]
        """The linear body of C_low, itself if it is linear; None where none is known."""
        low = self.body.below_all()
        if low is None:
            return None
        return self if low is self.body else BulkOnRanks(low)

    @cached_property
    def upper(self) -> BulkOnRanks:  # type: ignore[override]
        """The linear body of C_up, itself if it is linear."""
        above = self.body.above_all()
        return self if above is self.body else BulkOnRanks(above)

    @property
    def longest(self) -> int:
        """Most entries in a row of the stiffness."""
        return int(np.diff(self.body.K.getValuesCSR()[0]).max(initial=0))

    @property
    def initial_sizes(self) -> Array:
        """Sizes of the forces under the prescribed displacements alone, (n,)."""
        stored = self.body.stored
        return np.zeros(self.unknowns) if stored is None else np.abs(stored.initial_forces)

    @property
    def row_sums(self) -> Array:
        """Sums of the absolute entries of the rows of the stiffness, (n,) of this rank."""
        return self.body.row_sums


class FieldOnRanks(Field):
    """The displacement of the nodes of this rank's piece; all ranks ask for it together."""

    body: BodyOnRanks

    def __init__(self, body: BodyOnRanks) -> None:
        rows = body.prescribed.size
        for name, value in {
            "mesh": body.piece.mesh, "order": 1, "basis": sp.csr_array((rows, body.load.size)),
            "prescribed": body.prescribed.ravel(), "components": body.dim, "body": body,
        }.items():  # fmt: skip
            object.__setattr__(self, name, value)

    def full(self, unknowns: Array) -> Array:
        return self.body.displacement(unknowns)

    def restrict(self, values: Array) -> Array:
        return self.body.restrict(values)


def problem_of(body: BodyOnRanks) -> DiscreteProblem:
    """The problem of a body, with the contact points of this rank in terms of its unknowns."""
    rows = np.flatnonzero(body.active.ravel())
    trace = sp.csr_array((body.sign, (rows, body.unknown)), shape=(body.active.size, body.load.size))
    contact = replace(body.contact, trace=trace, vectors=body.ranks)
    model = Model(BulkOnRanks(body), contact, Space((FieldOnRanks(body),)), body.statement)
    return DiscreteProblem(model, Loading(body.load, body.offset, body.law, body.constant), body.warnings, None, True)


def body_of(problem: DiscreteProblem) -> BodyOnRanks:
    """The body of a problem over ranks."""
    assert isinstance(problem.bulk, BulkOnRanks)
    return problem.bulk.body
