"""An evolution over ranks: its matrices and contact points, each rank holding those of its nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.model import Model
from hemivar.discrete.operator_family import OperatorFamily
from hemivar.discrete.operators import Operator
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError
from hemivar.evolution import Evolution
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData, StepMatrices, dampings, refuse_unmeasured
from hemivar.evolution.evolution_problem import Mass
from hemivar.fem.assembly import load_vector, stiffness_blocks
from hemivar.fem.constitutive import ConstitutiveLaw, relaxing, viscous
from hemivar.fem.dynamics import moved_components
from hemivar.fem.edge_blocks import EdgeBlocks, NodeGraph, node_graph
from hemivar.fem.mass import body_blocks, inertia, mass_blocks
from hemivar.fem.unknowns import nodal_conditions
from hemivar.laws import VectorLaw
from hemivar.linear.krylov import conjugate_gradients
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh
from hemivar.ranks.assembly import _present, _with_facets_around, assemble_family
from hemivar.ranks.body_on_ranks import BodyOnRanks, BulkOnRanks, body_of
from hemivar.ranks.matrices import assembled, combined, row_sums
from hemivar.ranks.nodes import NodesOnRanks
from hemivar.ranks.pieces import Piece
from hemivar.ranks.preconditioner import MultigridForMany
from hemivar.ranks.ranks import Ranks, shared
from hemivar.ranks.stiffness import applied

if TYPE_CHECKING:
    from petsc4py import PETSc

__all__ = ["EvolutionOnRanks", "OperatorOnRanks", "discretize_on_ranks"]

#: Of the solution of a linear problem in terms of its right side.
_SOLVED = 1e-13


class OwnUnknowns:
    """Unknowns and prescribed displacements of this rank's nodes, ``U = P u + E z``."""

    def __init__(self, nodes: NodesOnRanks, moved: IntArray) -> None:
        self.nodes, self.moved = nodes, moved
        self.directions = nodes.directions[nodes.owned]
        self.free = nodes.free[nodes.owned]

    @property
    def unknowns(self) -> int:
        """Number of unknowns n of this rank, held ones included."""
        return int(self.free.size)

    def along(self, x: Array) -> Array:
        """``P u + E z`` along the directions of this rank's nodes, (n,), of ``x = (u, z)``."""
        n = self.unknowns
        values = np.where(self.free, x[:n].reshape(self.free.shape), 0.0)
        if self.moved.size:
            prescribed = np.zeros(n)
            prescribed[self.moved] = x[n:]
            values += np.einsum("ncd,nd->nc", self.directions, prescribed.reshape(self.free.shape))
        return values.ravel()

    def reduced(self, values: Array) -> Array:
        """``(P'y, E'y)`` of values y (n,) along the directions."""
        along = values.reshape(self.free.shape)
        inner = np.where(self.free, along, 0.0).ravel()
        if not self.moved.size:
            return inner
        return np.concatenate([inner, np.einsum("ncd,nc->nd", self.directions, along).ravel()[self.moved]])


class OperatorOnRanks(Operator):
    """A matrix of nodal displacements over ranks, as one over unknowns and prescribed displacements of this rank."""

    def __init__(self, matrix: PETSc.Mat, frame: OwnUnknowns) -> None:
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "_frame", frame)
        object.__setattr__(self, "_vectors", matrix.createVecs())

    matrix: PETSc.Mat  # along the directions of all nodes, be they held or not
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

    @cached_property
    def row_sums(self) -> Array:
        return row_sums(self.matrix, self._frame.nodes)

    def times(self, x: Array) -> Array:
        right, left = self._vectors
        return self._frame.reduced(applied(self.matrix.mult, right, left, self._frame.along(x)))

    def multiple_of(self, other: Operator) -> float | None:
        """Not looked for."""
        return None

    def solved(self, right: Array) -> Array | None:
        """By conjugate gradients with the diagonal, which is all that a mass matrix needs."""
        ranks, frame = self._frame.nodes.ranks, self._frame
        diagonal = np.array(self.matrix.getDiagonal().array_r)
        there = frame.free.ravel() & (diagonal > 0.0)
        diagonal, right = np.where(there, diagonal, 1.0), np.where(there, right, 0.0)
        size = _SOLVED * float(ranks.norms(right)[0])
        result = conjugate_gradients(
            _Inner(self), diagonal, right, lambda rest: np.where(there, rest / diagonal, 0.0), size, 500, vectors=ranks
        )
        return result.solution if float(ranks.norms(result.residual)[0]) <= size else None

    @property
    def numbers(self) -> tuple[Array, ...]:
        start, columns, entries = self.matrix.getValuesCSR()
        return np.asarray(start), np.asarray(columns), np.asarray(entries)


@dataclass(frozen=True, eq=False)
class _Inner:
    """A matrix over the unknowns alone."""

    whole: OperatorOnRanks

    def __matmul__(self, vector: Array) -> Array:
        resting = np.zeros(self.whole._frame.moved.size)
        return self.whole.times(np.concatenate([vector, resting]))[: vector.size]


@dataclass(frozen=True, eq=False)
class EvolutionOnRanks(DiscreteEvolution):
    """A discrete evolution whose arrays are those of this rank: its nodes and contact points."""

    ranks: Ranks = None  # type: ignore[assignment]
    pieces: tuple[Piece, ...] = ()  # of this and the coarser meshes, coarsest first
    state: Callable[[Mesh], Evolution] = None  # type: ignore[assignment]  # makes the statement on a mesh
    body: BodyOnRanks = None  # type: ignore[assignment]  # the elastic body at the start
    frame: OwnUnknowns = None  # type: ignore[assignment]
    skin: Mesh = None  # type: ignore[assignment]  # this rank's mesh with all boundary facets at its nodes
    seen: IntArray = None  # type: ignore[assignment]  # (k,): components of the nodes of ``skin`` that are ``moved``

    @property
    def unknowns(self) -> int:
        return self.frame.unknowns

    def full(self, x: Array) -> Array:
        """Nodal values (N, d) of all nodes of this rank's piece; all ranks call this."""
        nodes = self.body.nodes
        return np.asarray(np.einsum("nc,ncd->nd", nodes.everywhere(self.frame.along(x)), nodes.directions))

    def restrict(self, values: Array, prescribed: Array) -> Array:
        rest = values[self.body.owned].ravel().copy()
        rest[self.moved] -= prescribed
        along = np.einsum("ncd,nd->nc", self.frame.directions, rest.reshape(self.frame.free.shape))
        return np.concatenate([self.frame.reduced(along)[: self.unknowns], prescribed])

    def data_at(self, time: float) -> ExternalData:
        ranks, stated = self.ranks, self.evolution.body

        def forces() -> Array:
            bound = _present(stated.at_time(time), self.pieces[-1].mesh)
            if not bound.mesh.number_of_cells:
                return np.zeros(0)
            return load_vector(bound.mesh, 1, bound.body_force, bound.tractions)

        nodes = self.body.nodes
        load = self.frame.reduced(nodes.summed(nodes.along(ranks.agree(forces).reshape(nodes.free.shape))))
        if not stated.time_dependent & {"supports", "gap", "law"}:
            prescribed, loading = self._prescribed(self.body.prescribed), self.problem.loading
            return ExternalData(load, prescribed, loading.offset, loading.law, dampings(stated.contact))

        def conditions() -> tuple[Array, VectorLaw, Array]:
            nodal = nodal_conditions(_present(self.state(self.skin).body.at_time(time)))
            inside = np.zeros(self.skin.number_of_nodes, dtype=bool)
            inside[: self.body.owned.size] = self.body.owned
            _, offset, law, _ = nodal.contact(inside)
            return offset, law, nodal.supports.value[: self.body.owned.size]

        offset, law, prescribed = ranks.agree(conditions)
        return ExternalData(load, self._prescribed(prescribed), offset, law, dampings(stated.at_time(time).contact))

    def _prescribed(self, values: Array) -> Array:
        """What supports prescribe (N, d), where they may move their nodes."""
        return np.asarray(values[self.body.owned].ravel()[self.moved])


class StepMatricesOnRanks(StepMatrices):
    """Bodies of stages over ranks: that of the start with another stiffness, which is combined of its matrices.

    Matrices on coarser meshes are products of the finest one with the prolongations.
    """

    def __init__(self, discrete: DiscreteEvolution) -> None:
        super().__init__(discrete)
        self._resisted: tuple[BodyOnRanks, float, Model] | None = None

    def slower(self, problem: DiscreteProblem, resistance: float) -> DiscreteProblem:
        body, known = body_of(problem), self._resisted
        if known is None or known[0] is not body or known[1] != resistance:
            stiffer = body.stiffened(combined(body.K, [(resistance, body.K)]), body.supported, MultigridForMany())
            self._resisted = known = body, resistance, replace(problem.model, bulk=BulkOnRanks(stiffer))
        return problem.fitted(known[2])

    def _make(self, viscous: float, inert: float, branches: tuple[float, ...]) -> DiscreteProblem:
        discrete = self.discrete
        assert isinstance(discrete, EvolutionOnRanks)
        family = discrete.family
        parts = [(viscous, family.viscosity), (inert, family.mass)]
        parts += [(share, part) for share, (_, part) in zip(branches, family.branches, strict=True)]
        there = [(factor, part.matrix) for factor, part in parts if factor and isinstance(part, OperatorOnRanks)]
        known, start = discrete.problem.model, discrete.body
        inertia = bool(inert) and family.mass is not None
        body = start.stiffened(combined(start.K, there), start.supported or inertia, MultigridForMany())
        return discrete.problem.fitted(replace(known, bulk=BulkOnRanks(body)))


def discretize_on_ranks(
    ranks: Ranks, pieces: tuple[Piece, ...], state: Callable[[Mesh], Evolution]
) -> EvolutionOnRanks:
    """Matrices, supports and contact points of an evolution over ranks, which all call this."""
    piece = pieces[-1]
    evolution = ranks.agree(lambda: state(piece.mesh))
    if evolution.inertia and evolution.mass is Mass.REDISTRIBUTED:
        raise shared(
            MethodError("the engine 'petsc' has no redistributed mass; take mass = 'consistent', or leave --engine out")
        )
    if evolution.steps:
        raise shared(MethodError("the engine 'petsc' has no load steps; leave --engine out"))
    if evolution.heat is not None:
        raise shared(MethodError("the engine 'petsc' has no heat coupling; leave the heat out, or --engine"))

    def at_start(mesh: Mesh) -> ContactProblem:
        return state(mesh).body.at_time(evolution.start)

    body = assemble_family(ranks, pieces, at_start, not evolution.inertia, evolving=True)
    skin = _with_facets_around(ranks, piece)
    owned = np.zeros(skin.number_of_nodes, dtype=bool)
    owned[: body.owned.size] = body.owned
    moved, seen = ranks.agree(lambda: _moved(_present(state(skin).body), at_start, skin, owned))
    frame = OwnUnknowns(body.nodes, moved)
    problem = body.problem
    blocks = []
    for number, name in enumerate(problem.contact.names):
        index = np.flatnonzero(problem.contact.boundary == number)
        if ranks.total(float(index.size))[0]:
            blocks.append((name, index))
    ranks.agree(lambda: refuse_unmeasured(evolution.statement.at_time(evolution.start), problem, tuple(blocks), False))
    evolution = replace(evolution, problem=evolution.problem)
    make = _Matrices(body, frame, at_start)
    return EvolutionOnRanks(
        evolution, problem, make.family(problem, evolution.inertia), tuple(blocks), ranks, tuple(pieces), state, body,
        frame, skin, seen,
    )  # fmt: skip


def _moved(
    stated: ContactProblem, at_start: Callable[[Mesh], ContactProblem], skin: Mesh, owned: BoolArray
) -> tuple[IntArray, IntArray]:
    """Components of this rank's nodes that supports may move, by their places among these nodes and in ``skin``."""
    conditions = nodal_conditions(_present(at_start(skin)))
    every = moved_components(stated, conditions)
    dim = skin.dim
    seen = every[owned[every // dim]]
    number = np.cumsum(owned) - 1
    return np.asarray(number[seen // dim] * dim + seen % dim), seen


class _Matrices:
    """Makes the matrices of an evolution, along the directions of all nodes and on one sparsity."""

    def __init__(self, body: BodyOnRanks, frame: OwnUnknowns, at_start: Callable[[Mesh], ContactProblem]) -> None:
        self.nodes, self.frame, self.mesh = body.nodes, frame, body.piece.mesh
        self.stated = body.ranks.agree(lambda: at_start(self.mesh))

    def family(self, problem: DiscreteProblem, with_mass: bool) -> OperatorFamily:
        """All of them; the mass if it is asked for."""
        mesh, material, dim = self.mesh, self.stated.material, self.mesh.dim
        graph = node_graph(mesh, 1) if mesh.number_of_cells else None

        def of(law: ConstitutiveLaw) -> OperatorOnRanks:
            return self._operator(graph, lambda graph: stiffness_blocks(mesh, law, graph))

        viscosity = of(viscous(material, dim)) if material.viscous else None
        mass = self._operator(graph, lambda graph: mass_blocks(mesh, inertia(material), graph)) if with_mass else None
        branches = tuple((time, of(relaxing(material, i, dim))) for i, time in enumerate(material.relaxation_times))
        stiffness = self._operator(graph, lambda graph: body_blocks(self.stated, graph))
        return OperatorFamily(problem, stiffness, viscosity, mass, branches, self.frame.moved)

    def _operator(self, graph: NodeGraph | None, make: Callable[[NodeGraph], EdgeBlocks]) -> OperatorOnRanks:
        blocks = self.nodes.ranks.agree(lambda: None if graph is None else make(graph))
        return OperatorOnRanks(assembled(self.nodes, blocks), self.frame)
