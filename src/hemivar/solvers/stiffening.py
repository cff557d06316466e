"""Stress stiffening (geometric stiffness): the stress of a load is held, solved with, and followed."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.arrays import COUNTS, SOLVED
from hemivar.basics.deadline import Budget
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.generators import result_of
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import contact_compliance, residual
from hemivar.errors import ProblemError
from hemivar.fem.load_line import LoadLine
from hemivar.fem.stress_stiffness import geometric_stiffness, stressed_problem
from hemivar.laws.vector_law import frozen_at, softens
from hemivar.linear.definite import indefinite, lowest_quotient, positive
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import COARSEST
from hemivar.solvers.base import Solver, State
from hemivar.solvers.choice import affordable
from hemivar.solvers.controls import Controls, Progress
from hemivar.solvers.load_stepping import Climb, LoadStepping
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import STOPPED, Status
from hemivar.systems.body_on_levels import levels_of
from hemivar.systems.workspace import Workspace

__all__ = ["Ordinary", "StressedClimb", "Tally", "stiffening"]

#: Most stresses that are tried one after the other, and how many of them without a smaller residual.
_OUTER, _PATIENCE = 40, 20
#: Part of the load whose answer, made larger, has the first stress where a law softens: nothing has softened there.
_LITTLE = 1e-3
#: Pairs that accelerate.
_DEPTH = 4
#: Springs in the place of contact that holds, in units of the largest diagonal stiffness.
_HELD = 1e6

_Solving = Generator[Progress, bool | None, Solution]


class Buckled(ProblemError):  # noqa: N818 - a state of the body, which a growing load ends at
    """The stiffness with the stress of the load is not definite."""


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

    def plain(self, problem: DiscreteProblem) -> DiscreteProblem:
        """The problem, which the stress of its load does not stiffen; the model of it is kept."""
        made = self.workspace.once("without its stress", problem.model, lambda: _unstressed(problem).model)
        return problem.on_the_same(made)

    def __call__(self, problem: DiscreteProblem, controls: Controls, initial: Array | None) -> _Solving:
        """The solution of a problem, from unknowns (n,) on."""
        return self.solving(problem, self.method, controls, initial=initial, workspace=self.workspace)

    def definite(self, solution: Solution, plain: DiscreteProblem) -> bool:
        """Whether stiffness and contact together are shown to be definite at a solution, by what its method has set up.

        Where it has no condensed body, a random load tells, whose answer meets every motion: without contact, which
        only adds unless it softens. Conjugate gradients are preconditioned by the body without its stress, which is
        definite.
        """
        problem, kept = solution.problem, self.workspace
        if kept.condenses(problem):
            system = kept.condensed(problem)
            m, d = system.shape
            own = system.matrix.reshape(m, d, m, d).copy()
            own[np.arange(m), :, np.arange(m), :] += _contact_blocks(problem, solution.unknowns, solution.multiplier)
            return positive(own.reshape(m * d, m * d)[np.ix_(system.free, system.free)])
        if problem.contact_points and softens(problem.law):
            return False
        hierarchy = levels_of(plain, kept)
        levels, top = hierarchy.levels, hierarchy.first + len(hierarchy.steps)
        load = np.random.default_rng(13).standard_normal(problem.unknowns)
        enough, cycle = SOLVED * float(np.linalg.norm(load)), levels.preconditioner(top)
        stiffness, diagonal = problem.stiffness, problem.linear.diagonal
        descent = conjugate_gradients(stiffness, diagonal, load, cycle, enough, 200, flexible=cycle.flexible)
        return float(np.linalg.norm(descent.residual)) <= enough


class Tally:
    """What all solves of one call take together, of what they may take."""

    def __init__(self, controls: Controls, budget: Budget) -> None:
        self.controls, self.budget = controls, budget
        self.steps = self.evaluations = 0
        self.seconds: Counter[str] = Counter()

    @property
    def used_up(self) -> bool:
        """Whether no step is left."""
        return self.controls.max_steps is not None and self.steps >= self.controls.max_steps

    @property
    def left(self) -> Controls:
        """What the next solve may take."""
        most = self.controls.max_steps
        return replace(
            self.controls,
            max_time=max(self.controls.max_time - self.budget.spent, 0.0),
            max_steps=None if most is None else max(most - self.steps, 1),
        )

    def with_(self, solution: Solution) -> None:
        """Count a solve."""
        self.steps, self.evaluations = self.steps + solution.steps, self.evaluations + solution.evaluations
        self.seconds.update(solution.timings)  # type: ignore[arg-type]  # it adds up

    def of_all(self, solution: Solution) -> Solution:
        """The solution with what was counted."""
        return replace(solution, steps=self.steps, evaluations=self.evaluations, timings=dict(self.seconds))


class _Mixing:
    """Anderson's acceleration of ``x = g(x)``, by the last few pairs."""

    def __init__(self) -> None:
        self.pairs: deque[tuple[Array, Array]] = deque(maxlen=_DEPTH)

    def after(self, displacement: Array, answer: Array) -> Array:
        """The next place (n,), after one whose answer (n,) is known."""
        self.pairs.append((answer - displacement, answer))
        left, answers = (np.array(rows) for rows in zip(*self.pairs, strict=True))
        if len(left) < 2:
            return answer
        shares = np.linalg.lstsq(np.diff(left, axis=0).T, left[-1], rcond=1e-8)[0]
        return np.asarray(answer - shares @ np.diff(answers, axis=0))


def stiffening(
    problem: DiscreteProblem, ordinary: Ordinary, controls: Controls, initial: Solution | Array | None
) -> _Solving:
    """The solution whose stress is that in its own stiffness: of ``(K + K_s(u_k)) u_k+1 = f``, accelerated.

    It ends where the residual with the stress of the answer itself is below the tolerance. Where that is not reached
    the load grows, each solution being the start of the next.

    Raises Buckled: where no more is carried, the stress of the largest load that was solved makes the stiffness lose
    its definiteness, and strain and rotation are small until then. Raises ProblemError: no part of the load has a
    solution that was found.
    """
    tally, displacement = Tally(controls, Budget(controls.max_time)), initial
    displacement = displacement.unknowns if isinstance(displacement, Solution) else displacement
    solution = yield from _iterated(problem, ordinary, tally, displacement)
    if solution is not None and (solution.status in (Status.CONVERGED, *STOPPED) or tally.used_up or _near(solution)):
        return solution
    return _climbed(problem, solution, ordinary, tally)


def _near(solution: Solution) -> bool:
    """Whether an answer misses the tolerance by what methods leave."""
    return solution.status is Status.INACCURATE and solution.residual.relative <= COUNTS


def _iterated(
    problem: DiscreteProblem, ordinary: Ordinary, tally: Tally, displacement: Array | None
) -> Generator[Progress, bool | None, Solution | None]:
    """The iteration from a place (n,) on; the last answer, whose residual is that with its own stress.

    None where no answer was found. What buckles at its own stress is NOT_CARRIED.
    """
    plain, mixing = ordinary.plain(problem), _Mixing()
    displacement = displacement if displacement is not None else (yield from _first_place(plain, ordinary, tally))
    discrete, best, sound, worse = plain if displacement is None else _stressed(plain, displacement), None, None, 0
    for _ in range(_OUTER):
        answer = None if discrete is None else (yield from _answer(discrete, ordinary, tally, displacement))
        own = None if answer is None else _stressed(plain, answer.unknowns)
        if answer is not None and own is not None:
            now = tally.of_all(_judged(replace(answer, problem=own), answer, plain, ordinary, tally.controls))
            now = replace(now, problem=problem)
            if now.residual.below(tally.controls.atol, tally.controls.rtol) or now.status in STOPPED or tally.used_up:
                return now
            gained = 0.0 if best is None else now.residual.relative / best.residual.relative
            if gained > 0.5 and _near(now):
                return now
            best, worse = (now, 0) if gained < 1.0 else (best, worse + 1)
        elif answer is None:
            worse += 1
        if worse > _PATIENCE or (answer is None and (displacement is None or sound is None)):
            break
        if answer is None:  # such a place is a guess: one nearer to the last that had an answer is taken
            assert displacement is not None
            assert sound is not None
            displacement, mixing = 0.5 * (displacement + sound), _Mixing()
        else:
            sound = displacement
            displacement = answer.unknowns if displacement is None else mixing.after(displacement, answer.unknowns)
        discrete = own if sound is None else _stressed(plain, displacement)
    return None if best is None else tally.of_all(best)


def _judged(
    own: Solution, answer: Solution, plain: DiscreteProblem, ordinary: Ordinary, controls: Controls
) -> Solution:
    """An answer with the residual under its own stress, and the status that this allows."""
    left = residual(own.problem, own.unknowns, own.multiplier)
    status: Status = Status.MAX_STEPS
    if not left.below(controls.atol, controls.rtol):
        status = own.status if own.status is not Status.CONVERGED else status
    else:
        stands = ordinary.definite(answer, plain) or _falls(plain, answer) is None
        status = Status.CONVERGED if stands else Status.NOT_CARRIED
    return replace(own, residual=left, status=status)


def _answer(
    discrete: DiscreteProblem, ordinary: Ordinary, tally: Tally, displacement: Array | None
) -> Generator[Progress, bool | None, Solution | None]:
    """The solution under a stress that is held; None where its stiffness does not allow one."""
    try:
        solution = yield from ordinary(discrete, tally.left, displacement)
    except ProblemError:
        if displacement is None:
            raise
        return None
    tally.with_(solution)
    return solution if np.isfinite(solution.unknowns).all() else None


def _climbed(problem: DiscreteProblem, first: Solution | None, ordinary: Ordinary, tally: Tally) -> Solution:
    """The solution while the load grows; where it is not reached, the refusal of what buckles, or the last answer."""
    climb = StressedClimb(LoadStepping(), LoadLine.to(problem), tally.budget, ordinary=ordinary, tally=tally)
    reached = result_of(climb.up(climb.at_rest))
    last = climb.solved(reached.at)
    if last is not None and reached.low == 1.0:
        return tally.of_all(last)
    ended = reached.status in STOPPED or tally.used_up or last is None or reached.low == 0.0
    if last is not None and not ended and not (last.deformation is not None and last.deformation.large):
        times = (1.0 + climb.method.width) * reached.failed / reached.low
        buckles = _falls(ordinary.plain(last.problem), last, times, reached.low)
        if buckles is not None:
            raise buckles
    best = first if first is not None else last
    if best is None:
        raise ProblemError(
            "no equilibrium with the stress of the load was found, at any part of it: take a smaller load, or hold the "
            "body at more places"
        )
    lost = Status.MAX_STEPS if problem.limit is None else Status.NOT_CARRIED
    status = reached.status if reached.status in STOPPED and not tally.used_up else lost
    return tally.of_all(replace(best, problem=problem, status=status, carried=(reached.low, reached.failed)))


@dataclass(frozen=True, eq=False)
class StressedClimb(Climb):
    """Equilibria of a body that its stress stiffens, each the start of the next; points are all unknowns (n,)."""

    ordinary: Ordinary = field(kw_only=True)
    tally: Tally = field(kw_only=True)

    @property
    def at_rest(self) -> State:
        """Where it begins."""
        loaded = self.line.loaded
        return State(np.zeros(loaded.unknowns), np.zeros(loaded.contact.shape))

    @staticmethod
    def solved(at: State) -> Solution | None:
        """The solution at an equilibrium; None at rest."""
        return at.memory[1] if at.memory else None

    def _to(self, factor: float, start: State) -> tuple[State, Status]:
        problem = self.line.at(factor)
        if factor == 0.0 and self.line.unloaded is None and not problem.offset.any():
            return start, Status.CONVERGED
        if self.tally.used_up:
            return start, Status.MAX_TIME
        try:
            solution = result_of(_iterated(problem, self.ordinary, self.tally, _onward(start, factor)))
        except ProblemError:  # a body that contact alone holds, at rest, or one whose law does not carry the load
            return start, Status.NOT_CARRIED
        if solution is None:
            return start, Status.NOT_CARRIED
        evaluations, before = solution.evaluations, ((start.memory or (0.0,))[0], start.r)
        return State(
            solution.unknowns, solution.multiplier, evaluations, memory=(factor, solution, before)
        ), solution.status


def _onward(start: State, factor: float) -> Array | None:
    """The place (n,) to begin with at a load factor: on the line through the last two that were solved."""
    if not start.memory or start.memory[0] == 0.0:
        return None
    low, _, (before, first) = start.memory
    return np.asarray(start.r + (factor - low) / (low - before) * (start.r - first))


def _unstressed(problem: DiscreteProblem) -> DiscreteProblem:
    """The problem, which the stress of its load does not stiffen."""
    assert problem.origin is not None
    return problem.on_the_same(replace(problem.model, origin=replace(problem.origin, stiffening=False)))


def _first_place(
    problem: DiscreteProblem, ordinary: Ordinary, tally: Tally
) -> Generator[Progress, bool | None, Array | None]:
    """Unknowns (n,) whose stress is held first; none where the body without its stress gives them.

    Without stiffening, glue may fail under a load that it carries with it: what a little of the load moves is made
    larger, and gaps are not.
    """
    if not problem.contact_points or not softens(problem.law):
        return None
    line = LoadLine.to(problem)
    try:
        rest: Array | float = 0.0
        if problem.offset.any() or line.unloaded is not None:
            rest = (yield from ordinary(line.at(0.0), tally.left, None)).unknowns
        little = yield from ordinary(line.at(_LITTLE), tally.left, None)
    except ProblemError:
        return None
    return rest + (little.unknowns - rest) / _LITTLE if little.status is Status.CONVERGED else None


def _stressed(problem: DiscreteProblem, displacement: Array) -> DiscreteProblem | None:
    try:
        return stressed_problem(problem, displacement)
    except ProblemError:
        return None


def _falls(plain: DiscreteProblem, solution: Solution, times: float = 1.0, part: float = 1.0) -> Buckled | None:
    """The refusal where the stress of a solution at a part of the load, so many times larger, buckles the body.

    There stiffness, stress and contact together are not definite, though without stress they are.
    """
    contact = _contact_stiffness(plain, solution.unknowns, solution.multiplier)
    own, falls = sp.csr_array(plain.stiffness + contact), -geometric_stiffness(plain, solution.unknowns)
    whole = sp.csr_array(own - times * falls)
    if not affordable(plain):
        lost = whole.diagonal().min() <= 0.0 or lowest_quotient(whole) < 0.0
        return _buckles(None) if lost and lowest_quotient(own) >= 0.0 else None
    lost = whole.diagonal().min() <= 0.0 or indefinite(whole) is not None
    if not lost or indefinite(own) is not None:
        return None
    factor = _factor(own, falls)
    return _buckles(None if factor is None else factor * part)


def _contact_blocks(problem: DiscreteProblem, displacement: Array, multiplier: Array | None) -> Array:
    """What contact adds to the stiffness between its components at a place (n,), (m, c, c): stiff springs where it
    holds at a kink of its law."""
    r, c = problem.local(displacement), problem.contact.components
    law = frozen_at(problem.law, r) if multiplier is None else problem.law.frozen(r, multiplier)
    if multiplier is not None:
        r = law.fitted(r, multiplier, contact_compliance(problem))
    line = law.linearise(r)
    clamped = np.where(line.smooth[:, [0, *([1] * (c - 1))]], 0.0, _HELD * problem.linear.diagonal_range[1])
    return np.asarray(problem.contact.weights[:, None, None] * line.hessian + clamped[:, :, None] * np.eye(c))


def _contact_stiffness(problem: DiscreteProblem, displacement: Array, multiplier: Array | None) -> sp.csr_array:
    """The same between all unknowns, (n, n)."""
    blocks, (m, c) = _contact_blocks(problem, displacement, multiplier), problem.contact.shape
    rows = sp.bsr_array((blocks, np.arange(m), np.arange(m + 1)), shape=(m * c, m * c))
    return sp.csr_array(problem.contact.trace.T @ (rows @ problem.contact.trace))


def _factor(own: sp.csr_array, falls: sp.csr_array) -> float | None:
    """The least positive t with ``own - t falls`` singular, own being definite; None where it is not found."""
    with IMPORTS:
        import scipy.sparse.linalg as spla  # only here: most bodies start without it

    n = own.shape[0]
    if n <= COARSEST:
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
