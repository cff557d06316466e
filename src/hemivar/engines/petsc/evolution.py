"""An evolution over ranks: its matrices and contact points, each rank holding those of its nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.loading import Loading
from hemivar.discrete.model import Model
from hemivar.discrete.operator_family import OperatorFamily
from hemivar.discrete.operators import Operator
from hemivar.discrete.problem import DiscreteProblem
from hemivar.engines.petsc.assembly import BodyOnRanks, _present, _with_facets_around, assemble
from hemivar.engines.petsc.matrices import stiffness_and_load
from hemivar.engines.petsc.pieces import Piece
from hemivar.engines.petsc.ranks import Ranks, shared
from hemivar.engines.petsc.step_body import StepBody
from hemivar.engines.petsc.stiffness import applied
from hemivar.errors import MethodError
from hemivar.evolution import Evolution, Mass
from hemivar.evolution.discrete import Acting, Bodies, DiscreteEvolution, dampings
from hemivar.fem.assembly import load_vector
from hemivar.fem.dynamics import moved_components
from hemivar.fem.edge_blocks import EdgeBlocks
from hemivar.fem.mass import body_blocks, mass_blocks
from hemivar.fem.unknowns import nodal_conditions
from hemivar.laws import ContactLaw, separable
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.vectors import Vectors
from hemivar.mechanics.bedding import Bedding, bedding_of
from hemivar.mechanics.composed_material import Combination
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh

if TYPE_CHECKING:
    from petsc4py import PETSc

__all__ = ["BulkOnRanks", "EvolutionOnRanks", "OperatorOnRanks", "discretize_on_ranks"]

#: Of the solution of a linear problem in terms of its right side.
_SOLVED = 1e-13


class OwnUnknowns:
    """Unknowns and prescribed displacements of this rank's nodes, ``U = P u + E z``.

    Attributes
    ----------
    body : BodyOnRanks
    moved : int array (k,)
        Components ``node * d + c`` that supports may move, the nodes being those of this rank in their order.
    """

    def __init__(self, body: BodyOnRanks, moved: IntArray) -> None:
        self.body, self.moved = body, moved
        self.directions = body.directions[body.owned]
        self.free = body.free[body.owned]

    @property
    def unknowns(self) -> int:
        """Number of unknowns n of this rank, held ones included."""
        return int(self.free.size)

    def nodal(self, x: Array) -> Array:
        """``P u + E z`` at this rank's nodes, (own nodes * d,), of ``x = (u, z)``."""
        n = self.unknowns
        along = np.where(self.free, x[:n].reshape(self.free.shape), 0.0)
        values = np.einsum("nc,ncd->nd", along, self.directions).ravel()
        values[self.moved] += x[n:]
        return np.asarray(values)

    def reduced(self, values: Array) -> Array:
        """``(P'y, E'y)`` of nodal values (own nodes * d,)."""
        along = np.einsum("ncd,nd->nc", self.directions, values.reshape(self.free.shape))
        return np.concatenate([np.where(self.free, along, 0.0).ravel(), values[self.moved]])


class OperatorOnRanks(Operator):
    """A matrix of nodal displacements over ranks, as one over unknowns and prescribed displacements of this rank.

    Parameters
    ----------
    matrix : petsc4py Mat
        Over the components of all nodes in the coordinates of the mesh.
    frame : Frame
    """

    def __init__(self, matrix: PETSc.Mat, frame: OwnUnknowns) -> None:
        object.__setattr__(self, "_matrix", matrix)
        object.__setattr__(self, "_frame", frame)
        object.__setattr__(self, "_vectors", matrix.createVecs())

    _matrix: PETSc.Mat
    _frame: OwnUnknowns
    _vectors: tuple[PETSc.Vec, PETSc.Vec]

    @property
    def inner(self) -> sp.csr_array:
        raise MethodError("the matrices of an evolution over ranks are in PETSc; multiply by them")

    @property
    def coupling(self) -> sp.csr_array:
        return self.inner

    @property
    def held(self) -> sp.csr_array:
        return self.inner

    @property
    def unknowns(self) -> int:
        return self._frame.unknowns

    def times(self, x: Array) -> Array:
        right, left = self._vectors
        return self._frame.reduced(applied(self._matrix.mult, right, left, self._frame.nodal(x)))

    def multiple_of(self, other: Operator) -> float | None:
        """Not looked for."""
        return None

    def solved(self, right: Array) -> Array | None:
        """By conjugate gradients with the diagonal, which is all that a mass matrix needs."""
        ranks, frame = self._frame.body.ranks, self._frame
        diagonal = np.einsum("ncd,nd,ncd->nc", frame.directions, self._diagonal, frame.directions).ravel()
        there = frame.free.ravel() & (diagonal > 0.0)
        diagonal, right = np.where(there, diagonal, 1.0), np.where(there, right, 0.0)
        size = _SOLVED * float(ranks.norms(right)[0])
        found = conjugate_gradients(
            _Inner(self), diagonal, right, lambda rest: np.where(there, rest / diagonal, 0.0), size, 500, vectors=ranks
        )
        return found.solution if float(ranks.norms(found.residual)[0]) <= size else None

    @property
    def _diagonal(self) -> Array:
        return np.asarray(self._matrix.getDiagonal().array_r).reshape(self._frame.free.shape)

    @property
    def numbers(self) -> tuple[Array, ...]:
        start, columns, entries = self._matrix.getValuesCSR()
        return np.asarray(start), np.asarray(columns), np.asarray(entries)


@dataclass(frozen=True, eq=False)
class _Inner:
    """A matrix over the unknowns alone."""

    whole: OperatorOnRanks

    def __matmul__(self, vector: Array) -> Array:
        held = np.zeros(self.whole._frame.moved.size)
        return self.whole.times(np.concatenate([vector, held]))[: vector.size]


@dataclass(frozen=True, eq=False)
class BulkOnRanks:
    """The body of a step: a :class:`hemivar.discrete.Bulk` whose arrays are those of this rank.

    Attributes
    ----------
    body : StepBody
    """

    body: StepBody

    @property
    def unknowns(self) -> int:
        """Number of unknowns n of this rank."""
        return int(self.body.load.size)

    def value(self, u: Array) -> float:
        """``1/2 u'K u``, of all ranks, which call this together."""
        return float(self.body.vectors.total(0.5 * float(u @ self.body.multiply(u)))[0])

    def gradient(self, u: Array) -> Array:
        """``K u``, (n,)."""
        return self.body.multiply(u)

    def hessian(self, u: Array) -> sp.csr_array:
        """Refused: the matrix is in PETSc."""
        raise MethodError("the stiffness of a body over ranks is in PETSc; multiply by it")


@dataclass(frozen=True, eq=False)
class EvolutionOnRanks(DiscreteEvolution):
    """A discrete evolution whose arrays are those of this rank: its nodes and contact points.

    Attributes
    ----------
    ranks : Ranks
    pieces : tuple of Piece
        Of this and the coarser meshes, coarsest first.
    state : callable
        Makes the statement on a mesh.
    body : BodyOnRanks
        The elastic body at the start.
    frame : Frame
    skin : Mesh
        This rank's mesh with all boundary facets at its nodes.
    seen : int array (k,)
        Components of the nodes of ``skin`` that are ``moved``.
    """

    ranks: Ranks = None  # type: ignore[assignment]
    pieces: tuple[Piece, ...] = ()
    state: Callable[[Mesh], Evolution] = None  # type: ignore[assignment]
    body: BodyOnRanks = None  # type: ignore[assignment]
    frame: OwnUnknowns = None  # type: ignore[assignment]
    skin: Mesh = None  # type: ignore[assignment]
    seen: IntArray = None  # type: ignore[assignment]

    @property
    def vectors(self) -> Vectors:
        return self.ranks

    @property
    def unknowns(self) -> int:
        return self.frame.unknowns

    def full(self, x: Array) -> Array:
        """Nodal values (N, d) of all nodes of this rank's piece; all ranks call this."""
        scatter, local = self.body._scatter
        scatter.scatter(self.body.vector(self.frame.nodal(x)), local)
        return np.array(local.array_r).reshape(-1, self.body.dim)

    def restrict(self, values: Array, prescribed: Array) -> Array:
        rest = values[self.body.owned].ravel().copy()
        rest[self.moved] -= prescribed
        return np.concatenate([self.frame.reduced(rest)[: self.unknowns], prescribed])

    def acting(self, time: float) -> Acting:
        ranks, stated = self.ranks, self.evolution.body

        def forces() -> Array:
            bound = _present(stated.at_time(time), self.pieces[-1].mesh)
            if not bound.mesh.number_of_cells:
                return np.zeros(0)
            return load_vector(bound.mesh, 1, bound.body_force, bound.tractions)

        load = self.frame.reduced(self._summed(ranks.agree(forces)))
        if not stated.time_dependent & {"supports", "gap", "law"}:
            prescribed, loading = self._prescribed(self.body.prescribed), self.problem.loading
            return Acting(load, prescribed, loading.offset, separable(loading.law, "a march in time"), dampings(stated))

        def conditions() -> tuple[Array, ContactLaw, Array]:
            nodal = nodal_conditions(_present(self.state(self.skin).body.at_time(time)))
            inside = np.zeros(self.skin.number_of_nodes, dtype=bool)
            inside[: self.body.owned.size] = self.body.owned
            _, offset, law, _ = nodal.contact(inside)
            return offset, separable(law, "a march in time"), nodal.supports.value[: self.body.owned.size]

        offset, law, prescribed = ranks.agree(conditions)
        return Acting(load, self._prescribed(prescribed), offset, law, dampings(stated.at_time(time)))

    def _prescribed(self, values: Array) -> Array:
        """What supports prescribe (N, d), where they may move their nodes."""
        return np.asarray(values[self.body.owned].ravel()[self.moved])

    def _summed(self, force: Array) -> Array:
        """Nodal forces of the cells of this rank as those of all cells at its nodes."""
        from petsc4py import PETSc

        vector = self.body.vector()
        places = self.body.places.astype(PETSc.IntType)
        vector.setValuesBlocked(places, force, addv=PETSc.InsertMode.ADD_VALUES)
        vector.assemble()
        return np.array(vector.array_r)


class BodiesOnRanks(Bodies):
    """Bodies of stages over ranks: the effective statement, assembled on every mesh as a static one is."""

    def __init__(self, discrete: DiscreteEvolution) -> None:
        super().__init__(discrete)
        self._resisted: tuple[object, float, StepBody] | None = None

    def slow(self, body: StepBody, resistance: float) -> StepBody:
        """The body with a stiffness that is larger by a factor; the last one is kept."""
        if self._resisted is None or self._resisted[0] is not body.elastic or self._resisted[1] != resistance:
            self._resisted = body.elastic, resistance, body.slower(resistance)
        return self._resisted[2]

    def _make(self, viscous: float, inert: float, branches: tuple[float, ...]) -> DiscreteProblem:
        discrete = self.discrete
        assert isinstance(discrete, EvolutionOnRanks)
        viscous = viscous if discrete.viscosity is not None else 0.0
        inert = inert if discrete.mass is not None else 0.0
        start, state = discrete.evolution.start, discrete.state

        def effective(mesh: Mesh) -> ContactProblem:
            return state(mesh).body.at_time(start).effective(viscous, branches, inert)

        body = _assembled(discrete.ranks, discrete.pieces, effective, check=False)
        known = discrete.problem.model
        return replace(discrete.problem, model=Model(BulkOnRanks(StepBody.of(body)), known.contact), law_known=True)


def discretize_on_ranks(
    ranks: Ranks, pieces: tuple[Piece, ...], state: Callable[[Mesh], Evolution]
) -> EvolutionOnRanks:
    """Matrices, supports and contact points of an evolution over ranks, which all call this.

    Parameters
    ----------
    ranks : Ranks
    pieces : tuple of Piece
        Of the mesh and the coarser ones that it is a refinement of, coarsest first.
    state : callable
        Makes the evolution on a mesh.

    Raises
    ------
    ProblemError, MethodError
        On all ranks, as :func:`assemble`.
    """
    piece = pieces[-1]
    evolution = ranks.agree(lambda: state(piece.mesh))
    if evolution.inertia and evolution.mass is Mass.REDISTRIBUTED:
        raise shared(
            MethodError("the engine 'petsc' has no redistributed mass; take mass = 'consistent', or leave --engine out")
        )
    if evolution.heat is not None:
        raise shared(MethodError("the engine 'petsc' couples no heat; leave the heat out, or --engine"))

    def at_start(mesh: Mesh) -> ContactProblem:
        return state(mesh).body.at_time(evolution.start)

    body = _assembled(ranks, pieces, at_start, check=not evolution.inertia)
    skin = _with_facets_around(ranks, piece)
    owned = np.zeros(skin.number_of_nodes, dtype=bool)
    owned[: body.owned.size] = body.owned
    moved, seen = ranks.agree(lambda: _moved(_present(state(skin).body), at_start, skin, owned))
    frame = OwnUnknowns(body, moved)
    problem = _own_problem(body)
    blocks = []
    for number, name in enumerate(problem.contact.names):
        index = np.flatnonzero(problem.contact.boundary == number)
        if ranks.total(float(index.size))[0]:
            blocks.append((name, index))
    evolution = replace(evolution, problem=evolution.problem)
    make = _Matrices(ranks, piece, body, frame, at_start)
    return EvolutionOnRanks(
        evolution, problem, make.family(problem, evolution.inertia), tuple(blocks), ranks, tuple(pieces), state, body,
        frame, skin, seen,
    )  # fmt: skip


def _assembled(
    ranks: Ranks, pieces: tuple[Piece, ...], state: Callable[[Mesh], ContactProblem], check: bool
) -> BodyOnRanks:
    """The bodies of all meshes; the finest of them."""
    body: BodyOnRanks | None = None
    for piece in pieces:
        last = piece is pieces[-1]
        body = assemble(ranks, piece, state, coarser=body, check_coercivity=check and last, evolving=True)
    assert body is not None
    return body


def _moved(
    stated: ContactProblem, at_start: Callable[[Mesh], ContactProblem], skin: Mesh, owned: BoolArray
) -> tuple[IntArray, IntArray]:
    """Components of this rank's nodes that supports may move, by their places among these nodes and in ``skin``."""
    supports = nodal_conditions(_present(at_start(skin))).supports
    every = moved_components(stated, supports)
    dim = skin.dim
    seen = every[owned[every // dim]]
    place = np.cumsum(owned) - 1
    return np.asarray(place[seen // dim] * dim + seen % dim), seen


def _own_problem(body: BodyOnRanks) -> DiscreteProblem:
    """The contact points of this rank in terms of its unknowns."""
    rows = np.flatnonzero(body.active.ravel())
    trace = sp.csr_array((body.sign, (rows, body.unknown)), shape=(body.active.size, body.load.size))
    model = Model(BulkOnRanks(StepBody.of(body)), replace(body.contact, trace=trace))
    return DiscreteProblem(model, Loading(body.load, body.offset, body.law), body.warnings)


class _Matrices:
    """Makes the matrices of an evolution, over the components of all nodes."""

    def __init__(
        self,
        ranks: Ranks,
        piece: Piece,
        body: BodyOnRanks,
        frame: OwnUnknowns,
        at_start: Callable[[Mesh], ContactProblem],
    ) -> None:
        self.ranks, self.body, self.frame, self.mesh = ranks, body, frame, piece.mesh
        self.stated = ranks.agree(lambda: at_start(piece.mesh))
        self.material = self.stated.material

    def family(self, problem: DiscreteProblem, inertia: bool) -> OperatorFamily:
        mass = self.mass() if inertia else None
        return OperatorFamily(problem, self.stiffness(), self.viscosity(), mass, self.branches(), self.frame.moved)

    def stiffness(self) -> OperatorOnRanks:
        bedding = bedding_of(self.stated.bedding)
        return self._operator(lambda: body_blocks(self.mesh, self.material, bedding))

    def viscosity(self) -> OperatorOnRanks | None:
        none = (0.0,) * len(self.material.relaxation_times)
        return self._combined(0.0, 1.0, none) if self.material.viscous else None

    def mass(self) -> OperatorOnRanks:
        return self._operator(lambda: mass_blocks(self.mesh, Bedding(0.0, self.material, 1.0)))

    def branches(self) -> tuple[tuple[float, Operator], ...]:
        times = self.material.relaxation_times
        none = (0.0,) * len(times)
        return tuple((time, self._combined(0.0, 0.0, (*none[:i], 1.0, *none[i + 1 :]))) for i, time in enumerate(times))

    def _combined(self, elastic: float, viscous: float, branches: tuple[float, ...]) -> OperatorOnRanks:
        material = Combination(self.material, elastic, viscous, branches)
        return self._operator(lambda: body_blocks(self.mesh, material, Bedding()))

    def _operator(self, make: Callable[[], EdgeBlocks]) -> OperatorOnRanks:
        body, nodes, dim = self.body, self.mesh.number_of_nodes, self.body.dim
        blocks = self.ranks.agree(lambda: make() if self.mesh.number_of_cells else None)
        axes = np.broadcast_to(np.eye(dim), (nodes, dim, dim))
        every = np.ones((nodes, dim), dtype=bool)
        made = stiffness_and_load(self.ranks, blocks, np.zeros(nodes * dim), axes, every, body.places, body.owned)
        return OperatorOnRanks(made[0], self.frame)
