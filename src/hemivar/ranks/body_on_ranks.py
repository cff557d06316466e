"""A body over ranks: the system that methods work on, each rank holding the unknowns of its nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.bulk import Sized
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.contact_energy import contact_energy
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field, Space
from hemivar.errors import MethodError
from hemivar.fem.edge_blocks import EdgeBlocks
from hemivar.laws import VectorLaw
from hemivar.mechanics.statement import ContactProblem
from hemivar.ranks.matrices import assembled, hold, row_sums
from hemivar.ranks.nodes import NodesOnRanks
from hemivar.ranks.pieces import Piece
from hemivar.ranks.ranks import Ranks
from hemivar.ranks.stiffness import Stiffness
from hemivar.ranks.stored_on_ranks import StoredOnRanks
from hemivar.systems.body import Body, Truncation
from hemivar.systems.krylov_newton import KrylovNewton
from hemivar.systems.newton_equation import NewtonEquation
from hemivar.systems.nonlinear_body import Prepare

if TYPE_CHECKING:
    from petsc4py import PETSc

__all__ = ["BodyOnRanks", "BulkOnRanks", "FieldOnRanks", "body_of", "compliance_of", "problem_of"]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyOnRanks(Body):
    """Energy of a discrete contact problem, spread over the ranks by nodes.

    Every node has d unknowns, those along its directions; the ones that supports hold are zero, with a row of the unit
    matrix (times the mean of the diagonal), so that PETSc sees blocks of size d.  Arrays are those of this rank.

    Attributes
    ----------
    nodes : NodesOnRanks
    statement : ContactProblem
        The problem on this piece.
    near : petsc4py NullSpace
        Rigid motions, for algebraic multigrid.
    prescribed : array (N, d)
        Prescribed displacements.
    contact : ContactPoints
        Contact points at the nodes of this rank; ``names`` are all contact boundaries of the whole problem.
    typical : float
        Mean of the diagonal of K.
    supported : bool
        Whether the supports alone stop every rigid motion.
    unknowns, contact_points : int
        Of the whole problem.
    warnings : tuple of str
        As :attr:`hemivar.DiscreteProblem.warnings`.
    coarser : BodyOnRanks or None
        The problem on the next coarser mesh; a solve starts there if it is ``below`` as well.
    cycle : callable
        What makes the cycles of multigrid for a solve on the body.
    stored : StoredOnRanks or None
        The energy of a body that is not linear; its stiffness is that at rest then, by which sizes are compared.
    """

    elastic: Stiffness
    nodes: NodesOnRanks
    statement: ContactProblem
    near: PETSc.NullSpace
    prescribed: Array
    contact: ContactPoints
    typical: float
    supported: bool
    unknowns: int
    contact_points: int
    warnings: tuple[str, ...]
    cycle: Callable[[BodyOnRanks], Truncation]
    coarser: BodyOnRanks | None = None
    stored: StoredOnRanks | None = None

    @property
    def K(self) -> PETSc.Mat:  # noqa: N802 - the matrix
        """Stiffness, a petsc4py Mat."""
        return self.elastic.K

    @property
    def ranks(self) -> Ranks:
        """The ranks."""
        return self.nodes.ranks

    @property
    def piece(self) -> Piece:
        """Cells and nodes of this rank."""
        return self.nodes.piece

    @property
    def dim(self) -> int:
        """Space dimension d."""
        return self.nodes.dim

    @property
    def owned(self) -> BoolArray:
        """Nodes that this rank owns, (N,)."""
        return self.nodes.owned

    @property
    def points(self) -> int:
        """Contact points m of this rank."""
        return len(self.weights)

    @cached_property
    def problem(self) -> DiscreteProblem:
        """The serial problem, whose arrays are those of this rank."""
        return problem_of(self)

    # ---- what the methods ask for ------------------------------------------------------------------------

    def truncation(self) -> Truncation:
        return self.cycle(self)

    def newton_equation(self, known: NewtonEquation | None = None) -> KrylovNewton:
        return KrylovNewton.of(self, known)

    def from_below(self, x: Array) -> Array:
        below, ends = self.below, self.piece.ends
        assert below is not None
        assert ends is not None
        return self.restrict(below.displacement(x)[ends].mean(axis=1))

    def prepared(self, prepare: Prepare) -> Self:
        """The body itself: methods work on it as it is."""
        return self

    def with_law(self, law: VectorLaw) -> Self:
        return replace(self, law=law, below=None)

    def under(self, load: Array, offset: Array, law: VectorLaw) -> Self:
        """The body under a load (n,), with offsets (m, d) and a law of its contact points; all ranks call this."""
        load = np.where(self.nodes.fixed, 0.0, load)
        body = replace(self, load=load, offset=offset, law=law, below=None, constant=0.0)
        _ = body.load_scale, body.lambda_max  # found by all ranks together, so that each may look at it alone
        return body

    def stiffened(self, matrix: PETSc.Mat, supported: bool, cycle: Callable[[BodyOnRanks], Truncation]) -> Self:
        """The body with another stiffness, held where it is; all ranks call this."""
        return replace(self._with_matrix(matrix), supported=supported, cycle=cycle)

    def _with_matrix(self, matrix: PETSc.Mat) -> Self:
        """The linear body with another stiffness, held where this one is; all ranks call this."""
        typical = hold(matrix, self.nodes)
        elastic = Stiffness(matrix, self.ranks, self.unknown, self.sign, self.active)
        compliance = compliance_of(self.ranks, self.weights, self.active, self.unknown, elastic.matrix_diagonal)
        return replace(
            self, elastic=elastic, row_sums=row_sums(matrix, self.nodes), compliance=compliance, typical=typical,
            below=None, stored=None,
        )  # fmt: skip

    # ---- bodies that are not linear ---------------------------------------------------------------------------

    def out_of_balance(self, x: Array) -> Array:
        """``f`` less the internal forces, (n,); those of the last place are known again if it is not linear."""
        if self.stored is None:
            return super().out_of_balance(x)
        if not self._last or self._last[0] is not x:
            self._last[:] = x, self.load - self.stored.forces(self.displacement(x))
        return self._last[1]

    @cached_property
    def _last(self) -> list[Array]:
        return []

    def energy(self, x: Array, lam: Array | None = None, force: Array | None = None) -> float:  # type: ignore[override]
        """E(u), see :meth:`hemivar.systems.contact_system.Equilibrium.energy`."""
        stored = self.stored
        if stored is None:
            return super().energy(x, lam, force)
        law, close = self.law_at(x, lam), ROUNDED * float(self.vectors.largest(self.magnitude(x))[0])
        own = stored.value(self.displacement(x)) - float((self.load + stored.initial_forces) @ x)
        own += contact_energy(law, self.weights, self.local(x), close)
        return float(self.vectors.total(own)[0]) - stored.initial_value + self.constant

    def rounding_sizes(self, x: Array) -> Array:
        """Sizes of what is added up in the forces (n,), by the sums of the rows of the stiffness."""
        sizes = super().rounding_sizes(x)
        return sizes if self.stored is None else sizes + np.abs(self.stored.initial_forces)

    def tangent_at(self, x: Array, force: Array) -> Self:
        """See :class:`hemivar.systems.nonlinear_body.NonlinearSystem`; all ranks call this."""
        assert self.stored is not None
        return self._linear_at(self.stored.tangent(self.displacement(x)), x, force)

    def above_at(self, x: Array, force: Array) -> Self:
        """See :class:`hemivar.systems.nonlinear_body.NonlinearSystem`; all ranks call this."""
        assert self.stored is not None
        return self._linear_at(self.stored.bound(upper=True), x, force)

    def _linear_at(self, blocks: EdgeBlocks | None, x: Array, force: Array) -> Self:
        body = self._with_matrix(assembled(self.nodes, blocks))
        body = replace(body, load=np.where(self.nodes.fixed, 0.0, force + body.multiply(x)), constant=0.0)
        _ = body.load_scale, body.lambda_max  # found by all ranks together, so that each may look at it alone
        return body

    def below_all(self) -> Self | None:
        """The linear body of C_low, by which this one is strongly monotone; None where none is known."""
        if self.stored is None:
            return self
        known = self.stored.bounded_below()
        return self._with_matrix(assembled(self.nodes, self.stored.bound(upper=False))) if known else None

    def above_all(self) -> Self:
        """The linear body of C_up."""
        if self.stored is None:
            return self
        return self._with_matrix(assembled(self.nodes, self.stored.bound(upper=True)))

    # ---- vectors and displacements -----------------------------------------------------------------------

    def vector(self, x: Array | None = None) -> PETSc.Vec:
        """See :meth:`NodesOnRanks.vector`."""
        return self.nodes.vector(x)

    def displacement(self, x: Array) -> Array:
        """Displacements (N, d) of all nodes of the piece."""
        nodes = self.nodes
        values = np.where(nodes.free, nodes.everywhere(x), 0.0)
        return np.asarray(np.einsum("nc,ncd->nd", values, nodes.directions) + self.prescribed)

    def restrict(self, displacement: Array) -> Array:
        """Vector (n,) of a displacement (N, d) of the nodes of the piece."""
        nodes = self.nodes
        return np.where(nodes.free, nodes.along(displacement - self.prescribed), 0.0)[nodes.owned].ravel()


def compliance_of(ranks: Ranks, weights: Array, active: BoolArray, unknown: IntArray, diagonal: Array) -> Array:
    """As :func:`hemivar.discrete.residual.contact_compliance`."""
    m, dim = active.shape
    flexibility = np.zeros((m, dim))
    flexibility[active] = 1.0 / diagonal[unknown]
    tangential = flexibility[:, 1:].max(axis=1) if dim > 1 and m else flexibility[:, 0]
    pair = np.stack([flexibility[:, 0], tangential], axis=1)
    largest = float(ranks.largest(float(pair.max(initial=0.0)))[0])
    return np.asarray(weights[:, None] * np.where(pair > 0.0, pair, largest if largest > 0.0 else 1.0))


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
