"""The multigrid hierarchy of a body on one machine: discrete problems on its mesh and the coarser ones below."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.arrays import SOLVED
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.contact import contact_unknowns, selects
from hemivar.discrete.free_motion import free_growth
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.recession import RecessionFunction, growth_along
from hemivar.discrete.residual import contact_compliance
from hemivar.errors import ProblemError
from hemivar.fem.hierarchy import Coarser, coarser
from hemivar.fem.near_kernel import near_kernel, node_slots
from hemivar.fem.node_coarsening import LevelNodes, coarser_by_nodes
from hemivar.laws import VectorLaw
from hemivar.linear.definite import (
    below_zero,
    lowest_quotient,
    quotient,
    refuse_indefinite,
    rounding,
)
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import COARSEST, LevelMatrix, Levels, Preconditioner
from hemivar.linear.multilevel import Hierarchy
from hemivar.linear.products import product
from hemivar.linear.truncated_level import Coupling
from hemivar.linear.vectors import WHOLE
from hemivar.systems.body import Body, Truncation
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.contact_stiffness import ContactStiffness
from hemivar.systems.free_unknowns import free_unknowns, refuse_unseen
from hemivar.systems.krylov_newton import KrylovNewton
from hemivar.systems.newton_equation import NewtonEquation
from hemivar.systems.workspace import Workspace

__all__ = ["BodyProblem", "ElasticMultigrid", "levels_of", "set_up"]

#: What a body without its contact is computed for: part of the load that may be left, and the most cycles.
_ROUGH, _QUICK = 1e-2, 15
#: Part of the unknowns that a coarser mesh may have where it is the mesh itself of one of the bodies.
_MOST = 0.4
#: Unknowns up to which a coarse body is condensed: one on a mesh of its own, and one of some of the nodes.
_FEW, _FEW_NODES = 2500, 1000


@dataclass(frozen=True, eq=False)
class ElasticMultigrid:
    """A hierarchy of discrete problems with the matrices of all its levels; nothing in it changes."""

    steps: tuple[Coarser, ...]  # from coarse to fine: ``steps[k]`` holds the problem on mesh k and leads to mesh k + 1
    hierarchy: Hierarchy  # the matrices, with algebraic ones below that of the coarsest mesh where that is large
    seconds: float  # spent on setting up

    @staticmethod
    def of(problem: DiscreteProblem) -> ElasticMultigrid:
        """The hierarchy of a problem; it serves every other load, gap and law of the same body as well."""
        began = time.perf_counter()
        chain: list[Coarser] = []  # from fine to coarse
        coarsest = problem
        while coarsest.unknowns > COARSEST:
            step = coarser(coarsest)
            if step is None or _stays(step, coarsest):
                break
            chain.append(step)
            coarsest = step.problem
        problems = [problem] + [step.problem for step in chain]
        nothing = np.zeros(0, dtype=np.int64)
        parts = [contact_unknowns(p.contact) if selects(p.contact.trace) else (nothing,) * 4 for p in problems]
        large = coarsest.unknowns > COARSEST
        hierarchy = Hierarchy.of(
            [p.stiffness for p in problems],
            [step.prolongation for step in chain],
            near=near_kernel(coarsest.field) if large else None,
            slots=[node_slots(p.field, p.stiffness) for p in problems],
            contacts=[part[0] for part in parts],
            points=[part[3] for part in parts],
        )
        return ElasticMultigrid(tuple(reversed(chain)), hierarchy, time.perf_counter() - began)

    @property
    def levels(self) -> Levels:
        """The matrices from coarse to fine."""
        return self.hierarchy.stack

    @property
    def first(self) -> int:
        """Level of the coarsest mesh."""
        return self.levels.algebraic

    def solve(self, load: Array, tolerance: float = 1e-10, nested: bool = True) -> tuple[Array, int]:
        """``K^-1 load`` (n,), none of the contact laws acting, and the cycles that it took: :meth:`Hierarchy.solve`."""
        return self.hierarchy.solve(load, tolerance, nested)


def _stays(step: Coarser, finer: DiscreteProblem) -> bool:
    """Whether a coarser mesh is hardly coarser, for it leaves one of several bodies as it is: levels without a mesh do
    better than such that coarsen one side of a contact alone."""
    assert step.problem.field is not None
    cells = [np.bincount(field.mesh.parts.cell) for field in (step.problem.field, step.field)]
    same = cells[0].size > 1 and bool((cells[0] == cells[1]).any())
    return same and step.problem.unknowns > _MOST * finer.unknowns


class MatrixAtContact(ContactStiffness):
    """The stiffness of a body on one machine.

    ``matrix (n, n)``; ``times``: the matrix times a vector (n,); ``unknown, sign, active``: see
    :class:`ContactStiffness`; ``coupling``: places of what laws add to it; ``own (k,)``: which of the unknowns there
    are those of the contact points.
    """

    def __init__(
        self,
        matrix: sp.csr_array,
        times: Callable[[Array], Array],
        unknown: IntArray,
        sign: Array,
        active: BoolArray,
        coupling: Coupling,
        own: IntArray,
    ) -> None:
        super().__init__(WHOLE, unknown, sign, active)
        self.matrix = matrix
        self.times = times
        self.coupling, self.own = coupling, own

    @cached_property
    def _rows(self) -> sp.csr_array:
        """Rows of the matrix that belong to active components, (k, n)."""
        return sp.csr_array(self.matrix[self.unknown])

    def multiply(self, x: Array) -> Array:
        moved = np.count_nonzero(x)
        if moved <= self.unknown.size and moved == np.count_nonzero(x[self.unknown]):
            return self.push(x[self.unknown])  # a start at rest costs no product with the whole matrix
        return self.times(x)

    def pull(self, x: Array) -> Array:
        return product(self._rows, x)

    @cached_property
    def _columns(self) -> sp.csr_array:
        """The rows turned, (n, k)."""
        return sp.csr_array(self._rows.T)

    def push(self, values: Array) -> Array:
        return product(self._columns, values)

    def between_contacts(self) -> sp.csr_array:
        return self._rows[:, self.unknown]

    @cached_property
    def _blocks(self) -> tuple[IntArray, IntArray, Array]:
        """Entries of the blocks (m, d, d) between active components, their places in the coupling, and signs."""
        both = self.active[:, :, None] & self.active[:, None, :]
        number = np.zeros(self.active.shape, dtype=np.int64)
        number[self.active] = np.arange(self.unknown.size)
        rows, columns = (np.broadcast_to(index, both.shape)[both] for index in (number[:, :, None], number[:, None, :]))
        places = self.coupling.places(self.own[rows], self.own[columns])
        return np.flatnonzero(both), places, self.sign[rows] * self.sign[columns]

    def added(self, blocks: Array) -> Array:
        """Blocks (m, d, d) between the components of each point as entries of the coupling, (p,)."""
        entry, places, sign = self._blocks
        values = np.zeros(self.coupling.keys.size)
        values[places] = sign * blocks.ravel()[entry]
        return values


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyProblem(Body):
    """A discrete problem on one of the levels of its hierarchy."""

    elastic: MatrixAtContact
    problem: DiscreteProblem
    hierarchy: ElasticMultigrid  # matrices of this and the coarser levels
    top: int  # number of this level
    small: Workspace  # where coarse bodies are kept that were condensed
    floats: bool  # whether nothing but contact may hold the body, or a part of it
    # the body on the coarser meshes, from coarse to fine, for whoever asks for the problem there
    meshes: tuple[BodyProblem, ...] = ()
    graph: LevelNodes | None = None  # the nodes that were left where some were left out

    @staticmethod
    def of(
        problem: DiscreteProblem,
        hierarchy: ElasticMultigrid,
        top: int,
        small: Workspace,
        graph: LevelNodes | None = None,
    ) -> BodyProblem:
        """The body of a problem, no problem being posed below but by leaving out nodes."""
        unknown, sign, active, _ = contact_unknowns(problem.contact)
        levels, times = hierarchy.levels, partial(hierarchy.levels.multiply, top)
        coupling, own = levels.levels[top].coupling, levels.own[top]
        free = free_unknowns(problem)
        return BodyProblem(
            vectors=WHOLE,
            elastic=MatrixAtContact(problem.stiffness, times, unknown, sign, active, coupling, own),
            law=problem.law,
            weights=problem.contact.weights,
            offset=problem.offset.ravel().reshape(active.shape),
            unknown=unknown,
            sign=sign,
            active=active,
            load=problem.load,
            row_sums=problem.linear.row_sums,
            constant=problem.constant,
            compliance=contact_compliance(problem),
            problem=problem,
            hierarchy=hierarchy,
            top=top,
            small=small,
            floats=free is None or free.shape[1] > 0,
            thins=top == hierarchy.first,
            graph=graph,
        )

    @property
    def extent(self) -> float:
        return self.problem.extent

    def out_of_balance(self, x: Array) -> Array:
        return super().out_of_balance(self.problem.strained(x)[0])

    def answer_sizes(self, x: Array) -> Array:  # type: ignore[override]
        return self.rounding_sizes(self.problem.strained(x)[1])

    def truncation(self) -> Truncation:
        return _TruncatedBody(self)

    def newton_equation(self, known: NewtonEquation | None = None) -> KrylovNewton:
        return KrylovNewton.of(self, known)

    def coarse_system(self) -> BodyProblem | None:
        began = time.perf_counter()
        if self.meshes:
            step = self._step
            return self.meshes[-1].with_problem(step.on_coarse_mesh(self.problem), self.meshes[:-1], began)
        below = self._thinned
        return None if below is None else below[1].with_problem(below[0].on_coarse_mesh(self.problem), (), began)

    @property
    def _step(self) -> Coarser:
        """What leads from the next coarser body to this one."""
        below = None if self.meshes else self._thinned
        return self.hierarchy.steps[self.top - self.hierarchy.first - 1] if below is None else below[0]

    @property
    def _thinned(self) -> tuple[Coarser, BodyProblem] | None:
        """The body on some of its nodes, and what leads from there."""
        if not self.thins or self.problem.unknowns <= _FEW_NODES:
            return None
        return self.small.once("thinned", self.problem.model, self._thin)

    def _thin(self) -> tuple[Coarser, BodyProblem] | None:
        graph = LevelNodes.of(self.problem) if self.graph is None else self.graph
        coarse = None if graph is None else coarser_by_nodes(self.problem, graph)
        if coarse is None:
            return None
        step, left = coarse
        hierarchy = ElasticMultigrid.of(step.problem)
        return step, BodyProblem.of(step.problem, hierarchy, hierarchy.first, self.small, left)

    def condensed(self) -> CondensedProblem | None:
        # the half sweeps that serve many loads cost one load nothing
        few = _FEW if self.graph is None else _FEW_NODES
        return self.small.condensed(self.problem, many=True) if self.problem.unknowns <= few else None

    def start(self, guess: Array | None = None) -> Array:
        """The point of :class:`Body`, in rough balance but for its contact points where nothing else holds the body.

        What takes up no load lets a bound of friction that follows the pressure hold nothing, and Newton's equation
        there has no solution.
        """
        x = super().start(guess)
        enough, left = _ROUGH * self.load_scale.load, self.out_of_balance(x)
        left[self.unknown] = 0.0
        if not self.floats or not enough < float(np.linalg.norm(left)) < math.inf:
            return x
        m, d = self.active.shape
        truncation = self.truncation()
        truncation.change(x, np.ones(self.unknown.size, dtype=bool), np.zeros((m, d, d)))
        flexible, cycle = truncation.preconditioner()
        descent = conjugate_gradients(truncation, truncation.diagonal, left, cycle, enough, _QUICK, flexible=flexible)
        truncation.release()
        return x + descent.solution

    def untouched(self) -> Array | None:
        levels, top = self.hierarchy.levels, self.top
        enough = _ROUGH * float(np.linalg.norm(self.load))
        if self.floats or not levels.algebraic or not 0.0 < enough < math.inf:
            return None
        cycle = levels.preconditioner(top)
        descent = conjugate_gradients(
            LevelMatrix(levels, top), levels.diagonal(top), self.load, cycle, enough, _QUICK, flexible=cycle.flexible
        )
        return descent.solution if float(np.linalg.norm(descent.residual)) <= enough else None

    @property
    def carried(self) -> Array | None:
        below = None if self.meshes else self._thinned
        return None if below is None else below[0].shift

    def beyond(self, x: Array) -> BodyProblem:
        problem = self.problem
        offset = np.where(self.active, problem.offset - problem.contact.trace_of(x), problem.offset)
        there = problem.under(self.out_of_balance(x), offset=offset)
        return self.with_problem(there, self.meshes, time.perf_counter())

    def from_below(self, x: Array) -> Array:
        return self._step.interpolate(x)

    def with_law(self, law: VectorLaw) -> BodyProblem:
        return self.for_problem(self.problem.with_(law=law))

    def for_problem(self, problem: DiscreteProblem) -> BodyProblem:
        """The same body under another load, gap or law."""
        if (problem.unknowns, problem.contact.count) != (self.problem.unknowns, self.problem.contact.count):
            raise ProblemError("the other problem is of another size; set it up separately")
        return replace(self.with_problem(problem, (), time.perf_counter()), thins=False)

    def with_problem(self, problem: DiscreteProblem, meshes: tuple[BodyProblem, ...], began: float) -> BodyProblem:
        """The same body under the load, the gap and the law of a problem; what only the body decides stays."""
        return replace(
            self,
            problem=problem,
            law=problem.law,
            offset=problem.offset.ravel().reshape(self.active.shape),
            load=problem.load,
            constant=problem.constant,
            seconds=time.perf_counter() - began,
            meshes=meshes,
        )

    def refuse_direction(self, direction: Array) -> None:
        problem = self.problem
        if free_unknowns(problem) is None:
            K, diagonal = problem.stiffness, problem.linear.diagonal
            refuse_indefinite(below_zero(K, quotient(K, direction, diagonal), diagonal))

    def free_growth(self) -> list[RecessionFunction]:
        """Growth of the energy along the motions that deform nothing, by groups of parts that move by themselves.

        A large problem without a mesh does not tell its motions.
        """
        problem = self.problem
        if free_unknowns(problem) is not None:
            return free_growth(problem, problem.model.free_motions)
        if problem.unknowns > COARSEST:
            return []
        root = np.sqrt(problem.linear.diagonal)
        values, vectors = la.eigh(problem.stiffness.toarray() / np.outer(root, root))
        modes = vectors[:, values < rounding(problem.stiffness, problem.linear.diagonal)] / root[:, None]
        if not modes.shape[1]:
            return []
        modes /= np.abs(modes).max(axis=0)
        local = np.stack([self.spread(mode[self.unknown]) for mode in modes.T], axis=2)
        size = float(np.abs(problem.load) @ np.abs(modes).max(axis=1))
        return [growth_along(self.law, local, self.weights, modes.T @ problem.load, size, SOLVED)]


class _TruncatedBody:
    """Newton's matrix on the levels of a hierarchy."""

    def __init__(self, body: BodyProblem) -> None:
        self._body = body
        self._levels = body.hierarchy.levels.borrow(body.top)

    @property
    def diagonal(self) -> Array:
        return self._levels.diagonal(self._body.top)

    def change(self, x: Array, held: BoolArray, curvature: Array) -> None:
        self._levels.change_values(held, self._body.elastic.added(curvature))

    def __matmul__(self, vector: Array) -> Array:
        return self._levels.multiply(self._body.top, vector)

    def cycle(self, right: Array) -> Array:
        return self._levels.fast_cycle(self._body.top, right)

    def preconditioner(self) -> tuple[bool, Callable[[Array], Array]]:
        cycle = Preconditioner(self._levels, self._body.top)
        return cycle.flexible, cycle

    def release(self) -> None:
        levels = vars(self).pop("_levels", None)  # another solve may have it now
        if levels is not None:  # the best of a solve need not be its last, which gave them back already
            self._body.hierarchy.levels.give_back(levels)


def levels_of(problem: DiscreteProblem, workspace: Workspace) -> ElasticMultigrid:
    """The levels of the body of a problem, made on the first call; many solves may work on them at the same time."""
    return workspace.once("levels", problem.model, lambda: ElasticMultigrid.of(problem))


def set_up(problem: DiscreteProblem, workspace: Workspace) -> BodyProblem:
    """The body of a problem on its mesh, and on every coarser one if asked; the workspace keeps the levels.

    Raises ProblemError: the stiffness has a negative eigenvalue, or the body can move without any contact point
    noticing it.
    """
    began = time.perf_counter()
    bodies = workspace.once("bodies", problem.model, lambda: _bodies(problem, workspace))
    return bodies[-1].with_problem(problem, tuple(bodies[:-1]), began)


def _bodies(problem: DiscreteProblem, workspace: Workspace) -> list[BodyProblem]:
    """The body on every mesh, from coarse to fine."""
    refuse_unseen(problem)
    parts = problem.model.parts
    if free_unknowns(problem) is None and (parts is None or parts.semidefinite):
        refuse_indefinite(below_zero(problem.stiffness, lowest_quotient(problem.stiffness), problem.linear.diagonal))
    hierarchy = levels_of(problem, workspace)
    problems = [step.problem for step in hierarchy.steps] + [problem]
    small = Workspace()
    return [BodyProblem.of(one, hierarchy, top, small) for top, one in enumerate(problems, hierarchy.first)]
