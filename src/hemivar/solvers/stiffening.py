"""Bodies that the stress of their load stiffens or softens: the stress is held, solved with, and followed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.deadline import Budget
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.generators import result_of
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import contact_compliance, residual
from hemivar.errors import ProblemError
from hemivar.fem.load_line import LoadLine
from hemivar.fem.stress_stiffness import Stressed, stressed_problem
from hemivar.linear.definite import indefinite, lowest_quotient, positive
from hemivar.linear.krylov import conjugate_gradients
from hemivar.solvers.base import Solver, State
from hemivar.solvers.choice import affordable
from hemivar.solvers.controls import Controls, Progress
from hemivar.solvers.load_stepping import Climb, LoadStepping
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import STOPPED, Status
from hemivar.systems.body_on_levels import levels_of
from hemivar.systems.workspace import Workspace

__all__ = ["Ordinary", "StressedClimb", "stiffening"]

#: Most stresses that are tried one after the other.
_OUTER = 40
#: Part of the load whose answer, made larger, has the first stress where a law softens: nothing has softened there.
_LITTLE = 1e-3
#: Springs in the place of contact that holds, in units of the largest diagonal stiffness.
_HELD = 1e6
#: Unknowns up to which all eigenvalues are computed.
_DENSE = 400
#: Part of a random load that is left, and the most cycles, where multigrid is to meet every motion.
_MET, _CYCLES = 1e-9, 200

_Solving = Generator[Progress, bool | None, Solution]


class Buckled(ProblemError):  # noqa: N818 - a state of the body, which a growing load ends at
    """A stiffness with the stress of the load is not definite."""


class Solving(Protocol):
    """The solution of a problem, step by step: :func:`hemivar.solvers.solve.solving`."""

    def __call__(
        self,
        problem: DiscreteProblem,
        method: Solver | str | None,
        controls: Controls,
        *,
        initial: Array | None,
        workspace: Workspace,
    ) -> _Solving:
        """Yields every step."""


@dataclass(frozen=True, eq=False)
class Ordinary:
    """How a body is solved whose stress is held."""

    solving: Solving
    method: Solver | str | None
    workspace: Workspace

    def __call__(self, problem: DiscreteProblem, controls: Controls, initial: Array | None) -> _Solving:
        """The solution of a problem, from unknowns (n,) on."""
        return self.solving(problem, self.method, controls, initial=initial, workspace=self.workspace)

    def definite(self, found: Solution, plain: DiscreteProblem) -> bool:
        """Whether stiffness and contact together are shown to be definite at a solution, by what its method has set up.

        Where it has no condensed body, a random load tells, whose answer meets every motion: without contact, which
        only adds. Conjugate gradients are preconditioned by the body without its stress, which is definite.
        """
        problem, kept = found.problem, self.workspace
        if kept.condenses(problem):
            system = kept.condensed(problem)
            m, d = system.shape
            own = system.matrix.reshape(m, d, m, d).copy()
            own[np.arange(m), :, np.arange(m), :] += _contact_blocks(problem, found.unknowns, found.multiplier)
            return positive(own.reshape(m * d, m * d)[np.ix_(system.free, system.free)])
        hierarchy = levels_of(plain, kept)
        levels, top = hierarchy.levels, hierarchy.first + len(hierarchy.steps)
        load = np.random.default_rng(13).standard_normal(problem.unknowns)
        enough, cycle = _MET * float(np.linalg.norm(load)), levels.preconditioner(top)
        stiffness, diagonal = problem.stiffness, problem.linear.diagonal
        descent = conjugate_gradients(stiffness, diagonal, load, cycle, enough, _CYCLES, flexible=cycle.flexible)
        return float(np.linalg.norm(descent.residual)) <= enough


def stiffening(
    problem: DiscreteProblem, ordinary: Ordinary, controls: Controls, initial: Solution | Array | None
) -> _Solving:
    """The solution whose stress is that in its own stiffness: the secant iteration ``(K + K_s(u_k)) u_k+1 = f``.

    It ends where the residual with the stress of the answer itself is below the tolerance.

    Raises
    ------
    Buckled
        The stiffness with that stress is not definite: the body buckles.
    """
    budget = Budget(controls.max_time)
    place = initial.unknowns if isinstance(initial, Solution) else initial
    found = yield from _iterated(problem, ordinary, controls, place)
    lost = place is None and problem.limit is not None and found.status not in (Status.CONVERGED, *STOPPED)
    return _climbed(problem, found, ordinary, budget) if lost else found


def _iterated(problem: DiscreteProblem, ordinary: Ordinary, controls: Controls, place: Array | None) -> _Solving:
    """The secant iteration from a place (n,) on."""
    budget, plain, found = Budget(controls.max_time), _unstressed(problem), None
    place = place if place is not None else (yield from _first_place(plain, ordinary, controls))
    steps = evaluations = 0
    seconds: Counter[str] = Counter()
    for _ in range(_OUTER):
        posed = plain if place is None else _stressed(problem, place)
        left = None if found is None else residual(posed, found.unknowns, found.multiplier)
        if found is not None and left is not None and left.below(controls.atol, controls.rtol):
            if not ordinary.definite(found, plain):
                _refuse_buckled(posed, found.unknowns, found.multiplier)
            return replace(found, problem=posed, residual=left)
        try:
            now = replace(controls, max_time=max(controls.max_time - budget.spent, 0.0))
            found = yield from ordinary(posed, now, place)
        except ProblemError:
            if place is not None:
                _refuse_buckled(posed, place)
            raise
        steps, evaluations = steps + found.steps, evaluations + found.evaluations
        seconds.update(found.timings)  # type: ignore[arg-type]  # it adds up
        found = replace(found, steps=steps, evaluations=evaluations, timings=dict(seconds))
        if found.status is not Status.CONVERGED:
            if place is not None and found.status not in STOPPED:
                _refuse_buckled(posed, place)
            return found
        place = found.unknowns
    assert found is not None
    return replace(found, status=Status.MAX_STEPS)


def _climbed(problem: DiscreteProblem, found: Solution, ordinary: Ordinary, budget: Budget) -> Solution:
    """The solution while the load grows, of which the last one is the start; where none was found at once."""
    climb = StressedClimb(LoadStepping(), LoadLine.to(problem), budget, ordinary=ordinary)
    reached = result_of(climb.up(climb.at_rest))
    if reached.low == 1.0:
        last: Solution = reached.at.memory[1]
        return replace(last, steps=found.steps + last.steps, evaluations=found.evaluations + last.evaluations)
    status = reached.status if reached.status in STOPPED else Status.NOT_CARRIED
    return replace(found, status=status, carried=(reached.low, reached.failed))


@dataclass(frozen=True, eq=False)
class StressedClimb(Climb):
    """Equilibria of a body that its stress stiffens, each the start of the next; points are all unknowns (n,)."""

    ordinary: Ordinary = field(kw_only=True)

    @property
    def at_rest(self) -> State:
        """Where it begins."""
        loaded = self.line.loaded
        return State(np.zeros(loaded.unknowns), np.zeros(loaded.contact.shape))

    def _to(self, factor: float, start: State) -> tuple[State, Status]:
        if factor == 0.0 and self.line.unloaded is None:
            return start, Status.CONVERGED
        low = start.memory[0] if start.memory else 0.0
        place = factor / low * start.r if low else None
        try:
            controls = Controls(rtol=self.method.rtol, max_time=self.budget.left)
            found = result_of(_iterated(self.line.at(factor), self.ordinary, controls, place))
        except Buckled:
            return start, Status.NOT_CARRIED
        evaluations = start.evaluations + found.evaluations
        return State(found.unknowns, found.multiplier, evaluations, memory=(factor, found)), found.status


def _unstressed(problem: DiscreteProblem) -> DiscreteProblem:
    """The problem, which the stress of its load does not stiffen."""
    assert problem.origin is not None
    return problem.on_the_same(replace(problem.model, origin=replace(problem.origin, stiffening=False)))


def _first_place(
    problem: DiscreteProblem, ordinary: Ordinary, controls: Controls
) -> Generator[Progress, bool | None, Array | None]:
    """Unknowns (n,) whose stress is held first; none where the body without its stress gives them.

    Without stiffening, glue may fail under a load that it carries with it.
    """
    if not problem.contact_points or not problem.law.softens:
        return None
    try:
        little = yield from ordinary(LoadLine.to(problem).at(_LITTLE), controls, None)
    except ProblemError:
        return None
    return little.unknowns / _LITTLE if little.status is Status.CONVERGED else None


def _stressed(problem: DiscreteProblem, place: Array) -> DiscreteProblem:
    try:
        return stressed_problem(problem, place)
    except ProblemError:
        raise _buckles(None) from None


def _refuse_buckled(posed: DiscreteProblem, place: Array, multiplier: Array | None = None) -> None:
    """Refuse a place (n,) at which stiffness, stress and contact together are not definite, though without stress they
    are."""
    parts = posed.model.parts
    if not isinstance(parts, Stressed):
        return
    contact = _contact_stiffness(posed, place, multiplier)
    own, whole = sp.csr_array(parts.problem.stiffness + contact), sp.csr_array(posed.stiffness + contact)
    if not affordable(posed):
        if lowest_quotient(whole) < 0.0 <= lowest_quotient(own):
            raise _buckles(None)
    elif indefinite(whole) is not None and indefinite(own) is None:
        raise _buckles(_factor(own, sp.csr_array(own - whole)))


def _contact_blocks(problem: DiscreteProblem, place: Array, multiplier: Array | None) -> Array:
    """What contact adds to the stiffness between its components at a place (n,), (m, c, c): stiff springs where it
    holds at a kink of its law."""
    r, c = problem.local(place), problem.contact.components
    law = problem.law.frozen_at(r) if multiplier is None else problem.law.frozen(r, multiplier)
    if multiplier is not None:
        r = law.fitted(r, multiplier, contact_compliance(problem))
    line = law.linearise(r)
    held = np.where(line.smooth[:, [0, *([1] * (c - 1))]], 0.0, _HELD * problem.linear.diagonal_range[1])
    return np.asarray(problem.contact.weights[:, None, None] * line.hessian + held[:, :, None] * np.eye(c))


def _contact_stiffness(problem: DiscreteProblem, place: Array, multiplier: Array | None) -> sp.csr_array:
    """The same between all unknowns, (n, n)."""
    blocks, (m, c) = _contact_blocks(problem, place, multiplier), problem.contact.shape
    rows = sp.bsr_array((blocks, np.arange(m), np.arange(m + 1)), shape=(m * c, m * c))
    return sp.csr_array(problem.contact.trace.T @ (rows @ problem.contact.trace))


def _factor(own: sp.csr_array, falls: sp.csr_array) -> float | None:
    """The least positive t with ``own - t falls`` singular, own being definite; None where it is not found."""
    with IMPORTS:
        import scipy.sparse.linalg as spla  # only here: most bodies start without it

    n = own.shape[0]
    if n <= _DENSE:
        largest = float(la.eigh(falls.toarray(), own.toarray(), eigvals_only=True, subset_by_index=[n - 1, n - 1])[0])
        return 1.0 / largest if largest > 0.0 else None
    inverse = spla.LinearOperator(own.shape, matvec=spla.splu(sp.csc_array(own)).solve, dtype=float)
    start = np.random.default_rng(13).standard_normal(n)
    try:
        largest = float(
            spla.eigsh(falls, k=1, M=own, Minv=inverse, which="LA", v0=start, tol=1e-6, return_eigenvectors=False)[0]
        )
    except spla.ArpackError:
        return None
    return 1.0 / largest if largest > 0.0 else None


def _buckles(factor: float | None) -> Buckled:
    at = "" if factor is None else f", at about {factor:.3g} of this load"
    return Buckled(
        f"the body buckles under its load{at}: with the stress of the load its stiffness is not definite; take a "
        "smaller load, hold the body at more places, or make it thicker"
    )
