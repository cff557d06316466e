"""The solve of a contact problem: a method is chosen, started, iterated, and another one takes over where it fails."""

from __future__ import annotations

import logging
import time
from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace
from functools import partial
from itertools import count

import numpy as np
import scipy.linalg as la

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import COUNTS, SOLVED, real_array
from hemivar.basics.generators import result_of
from hemivar.basics.known_keywords import known_keywords
from hemivar.basics.types import Array
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.recession import Coercivity, decide
from hemivar.discrete.residual import Residual
from hemivar.errors import MethodError, ProblemError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.fem.stress_stiffness import stiffens
from hemivar.laws.vector_law import softens
from hemivar.linear.factor_memory import shortage
from hemivar.linear.threads import one_thread
from hemivar.solvers.base import Solver, SolverSystem, State
from hemivar.solvers.choice import choose, repaid
from hemivar.solvers.controls import Budget, Controls, Progress
from hemivar.solvers.fallbacks import LOWER, best_of, others, took_over
from hemivar.solvers.fixed_point import FixedPoint
from hemivar.solvers.load_stepping import LoadStepping
from hemivar.solvers.loop import finish, steps
from hemivar.solvers.methods import as_method
from hemivar.solvers.multigrid import NonsmoothMultigrid
from hemivar.solvers.newton import NonsmoothNewton, Search
from hemivar.solvers.newton_on_graph import FEW_ROUNDS, KnownRounds, active_set_newton, small_and_convex
from hemivar.solvers.proximal_newton import ProximalNewton
from hemivar.solvers.semismooth import SemismoothNewton
from hemivar.solvers.sliding import with_slides
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import STOPPED, Status
from hemivar.solvers.stiffening import Ordinary, stiffening
from hemivar.solvers.truncated_newton import TruncatedNewton
from hemivar.systems.body import Body
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.contact_moves import best_component
from hemivar.systems.workspace import Workspace

__all__ = ["default_method", "method_for", "solve", "solving", "suited"]

#: What is said of a residual above the tolerance that rounding explains.
_ROUNDED = (
    "the residual is above the tolerance: {:.1e} against forces of {:.1e}, of which rounding of the answer may leave "
    "{:.1e}"
)
#: Ends that a solve beyond the limit of a foundation has.
_LOST = (Status.STALLED, Status.UNBOUNDED, Status.NONFINITE, Status.NOT_CONTRACTING)


@known_keywords
def solve(
    problem: ProblemLike,
    method: Solver | str | None = None,
    controls: Controls | None = None,
    *,
    rtol: float | None = None,
    max_steps: int | None = None,
    max_time: float | None = None,
    initial: Solution | Array | None = None,
    workspace: Workspace | None = None,
) -> Solution:
    """Solve a contact problem.

    ``solve(problem, method="newton", rtol=1e-8)`` does what ``hemivar solve --method newton --rtol 1e-8`` does.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
        From :func:`hemivar.discretize`, or made of the user's own arrays; a statement is discretised.
    method : Solver or str, optional
        The method with its options, or the name of one, as ``hemivar methods`` lists them; by name, it is made
        :func:`suited` to friction bounds that depend on the solution. By default :class:`NonsmoothNewton`, or
        :class:`NonsmoothMultigrid` where that is predicted to be faster or the memory to be too small (:func:`choose`;
        the logger ``hemivar`` says which and why). Where a force of the foundation can fall as the body moves on, it
        goes downhill from rest; a remark says so where a state of less energy was met. Where the body is not linear it
        runs inside a :class:`ProximalNewton`.
    controls : Controls, optional
        Tolerances, limits, callback.
    rtol, max_steps, max_time : optional
        Relative tolerance, limit of steps, limit in seconds; each replaces that of ``controls``.
    initial : Solution or array (n,), optional
        Where to start; zero displacement by default.
    workspace : Workspace, optional
        Where factors and levels of the body are kept; pass the same one to solve for another method, load, gap or law,
        to certify, and to search for other solutions.

    Returns
    -------
    Solution
        Always with a status; a solve that does not converge returns its best iterate and says why.

    Raises
    ------
    MethodError
        The method cannot treat this problem, or the memory does not suffice for it.
    ProblemError
        The problem cannot be solved as stated.

    Examples
    --------
    >>> import hemivar as hv
    >>> solution = hv.solve(hv.gallery.survey("5.1", 8))
    >>> solution.status.value, solution.certify().unique
    ('converged', True)
    """
    discrete = as_discrete(problem, "solve")
    limits = Controls.of(controls, rtol=rtol, max_steps=max_steps, max_time=max_time)
    return result_of(solving(discrete, method, limits, initial=initial, workspace=workspace))


def solving(
    problem: ProblemLike,
    method: Solver | str | None = None,
    controls: Controls | None = None,
    *,
    initial: Solution | Array | None = None,
    workspace: Workspace | None = None,
) -> Generator[Progress, bool | None, Solution]:
    """:func:`solve` step by step: yields every step, ends after it if it is sent True, returns the solution."""
    problem = as_discrete(problem, "solve")
    given = method_for(method, problem)
    workspace = Workspace.given(workspace)
    if controls is not None:
        expect(controls, Controls, "controls", "pass Controls(rtol=..., max_steps=...)")
    if stiffens(problem):
        ordinary = Ordinary(solving, method, workspace)
        return (yield from stiffening(problem, ordinary, controls or Controls(), initial))
    solver = default_method(problem, workspace) if given is None else _for_body(given, problem)
    controls = Controls() if controls is None else controls
    solver = solver if problem.limit is None else solver.local_descent()
    if problem.law.state_dependent and not solver.handles_state:
        raise MethodError(
            f"{solver.name} cannot solve this problem: a friction bound depends on the solution; "
            "wrap the method, FixedPoint(inner=...)"
        )
    why = solver.refuse(problem)
    if why is not None:
        raise MethodError(f"{solver.name} cannot solve this problem: {why}")
    task = _Task(problem, controls, initial, workspace)
    solution = yield from task.by(solver)
    if solution.status not in (Status.CONVERGED, *STOPPED):
        solution = yield from task.handed_on(solver, solution, asked=given is not None)
    if problem.limit is not None and solution.status in _LOST and not solution.residual.relative <= COUNTS:
        return replace(solution, status=Status.NOT_CARRIED)
    remarks = [LOWER] if given is None and task.below(solver, solution) else []
    if solution.status is Status.CONVERGED and solution.residual.excused(controls.atol, controls.rtol):
        remarks.append(_ROUNDED.format(solution.residual.total, solution.residual.scale, solution.residual.rounding))
    return replace(solution, remarks=(*solution.remarks, *remarks)) if remarks else solution


def default_method(problem: DiscreteProblem, workspace: Workspace) -> Solver:
    """The method where none was asked for; where a force can fall, downhill from rest, as a load that grows goes.

    ``workspace``: one that condenses the problem already makes a condensing method cheap; one of many solves by
    multigrid gets one as soon as it costs no more than these did.
    """
    chosen, reason = workspace.under_any_load("default method", problem, lambda: choose(problem))
    if not isinstance(chosen, NonsmoothNewton):
        solves = next(workspace.once("solves by default", problem.model, count))
        if workspace.condenses(problem) or repaid(problem, solves):
            kept = "condensed already" if workspace.condenses(problem) else f"after {solves} solves by multigrid"
            chosen, reason = NonsmoothNewton(), f"NonsmoothNewton for {problem.unknowns} unknowns, {kept}"
    logging.getLogger("hemivar").info("%s", reason)
    solver = _for_body(suited(chosen, problem), problem)
    if problem.limit is None and not _falls(problem):
        return solver
    careful = solver.local_descent()
    follows = problem.limit is None and problem.law.follows_state
    return _for_body(SemismoothNewton(careful), problem) if follows and isinstance(careful, FixedPoint) else careful


def _falls(problem: DiscreteProblem) -> bool:
    """Whether a force of the foundation can fall while the body moves on, so that there may be several solutions."""
    return problem.contact_points > 0 and softens(problem.law)


@dataclass(frozen=True, eq=False)
class _Task:
    """A problem with what every method gets that is tried on it."""

    problem: DiscreteProblem
    controls: Controls
    initial: Solution | Array | None
    workspace: Workspace

    def by(self, solver: Solver, spent: float = 0.0) -> Generator[Progress, bool | None, Solution]:
        """The solution by a method, in the time that is left, with as many threads as serve it."""
        controls = replace(self.controls, max_time=max(self.controls.max_time - spent, 0.0))
        with one_thread(not solver.condenses):
            own = solver.for_tolerance(controls.rtol)
            solution = yield from _run(self.problem, own, controls, self.initial, self.workspace)
        return with_slides(solution)

    def handed_on(self, solver: Solver, first: Solution, asked: bool) -> Generator[Progress, bool | None, Solution]:
        """What other methods find where the first has failed; the best iterate of all where they fail as well."""
        failed, spent = [first], first.timings.get("iterate", 0.0)
        for other in self._others(solver, first, asked):
            try:
                solution = yield from self.by(other, spent)
            except (MethodError, ProblemError):  # as where the memory does not suffice for it
                continue
            if solution.status in (Status.CONVERGED, Status.NOT_CARRIED, Status.INTERRUPTED):
                return replace(solution, remarks=(took_over(solution, failed), *solution.remarks))
            spent += solution.timings.get("iterate", 0.0)
            failed.append(solution)
            if solution.status in STOPPED:
                break
        return best_of(failed)

    def _others(self, solver: Solver, first: Solution, asked: bool) -> Iterable[Solver]:
        """The methods that are tried after the first; a load that may not be carried grows, whatever was asked for."""
        if self.problem.limit is not None:
            steps = isinstance(solver, NonsmoothNewton | NonsmoothMultigrid | FixedPoint | ProximalNewton)
            return [LoadStepping(solver)] if steps and self.initial is None else []
        counted = first.status is Status.MAX_STEPS and self.controls.max_steps is not None
        return () if asked or counted else others(solver, first.status, self.problem)

    def below(self, solver: Solver, solution: Solution) -> bool:
        """Whether a contact point alone would find less energy across a barrier, where a force can fall."""
        problem = self.problem
        if solution.status is not Status.CONVERGED or problem.limit is not None or not _falls(problem):
            return False
        system = solver.prepare(problem, self.workspace)
        if not isinstance(system, CondensedProblem | Body):
            return False
        x = system.of_unknowns(solution.unknowns)
        law, r, force = system.law_at(x, solution.multiplier), system.local(x), system.out_of_balance(x)
        body = system.with_law(law) if problem.law.state_dependent else system
        size = float(np.abs(system.load) @ np.abs(x.ravel())) + float(system.weights @ np.abs(law.value(r)))
        return best_component(body, r, system.at_contact(force))[1] < -SOLVED * size


def _run(
    problem: DiscreteProblem,
    solver: Solver,
    controls: Controls,
    initial: Solution | Array | None,
    workspace: Workspace,
) -> Generator[Progress, bool | None, Solution]:
    """Set up, start, iterate and recover."""
    try:
        system: SolverSystem = solver.prepare(problem, workspace)
        _check_held(system)
        if isinstance(system, CondensedProblem):
            workspace.under_any_load("held far away", problem, partial(_check_coercive, system))
        began = time.perf_counter()
        budget = Budget(controls.max_time)
        start = _start(system, solver, initial, budget)
        short = None
        if isinstance(system, CondensedProblem):
            known = workspace.under_any_load("rounds", problem, KnownRounds)
            short = _without_iteration(system, solver, start, controls, budget, known)
        if (
            short is None
            and isinstance(system, CondensedProblem)
            and _lost_in_rounding(system, solver, start, controls)
        ):
            system = system.displaced
            start = _start(system, solver, initial, budget)
    except MemoryError:
        raise shortage(problem.unknowns, problem.contact.trace.nnz, solver.condenses) from None
    if short is not None:
        ended = replace(short, status=Status.INTERRUPTED)  # it is the solution all the same
        try:
            for progress in short.history[:-1]:
                if (yield progress):
                    return ended
            yield short.history[-1]
        except KeyboardInterrupt:
            return ended
        return short
    state, status, history = yield from steps(solver, system, start, controls, budget)
    solver.release(state)
    end = _End(solver, controls, state, status, history, time.perf_counter() - began)
    try:
        return _solution(system, end)
    except KeyboardInterrupt:  # the iterate is there, and what is left to do is short
        return _solution(system, replace(end, status=Status.INTERRUPTED))
    except MemoryError:
        pass
    try:  # what the first attempt held is free again
        return _solution(system, replace(end, status=Status.OUT_OF_MEMORY))
    except MemoryError:
        raise shortage(problem.unknowns, problem.contact.trace.nnz, solver.condenses) from None


def _without_iteration(
    system: CondensedProblem, solver: Solver, start: State, controls: Controls, budget: Budget, known: KnownRounds
) -> Solution | None:
    """The solution where no iteration of the method is needed for it; None where it is."""
    if start.ended is not None:
        return None
    first = system.residual(start.r, start.lam)
    if first.noise > controls.rtol * first.scale:
        return _without_contact(system, solver, first, controls, budget)
    if first.below(controls.atol, controls.rtol) or budget.due():
        return None
    return _by_active_sets(system, solver, start, first, controls, known)


def _lost_in_rounding(system: CondensedProblem, solver: Solver, start: State, controls: Controls) -> bool:
    """Whether the rounding of gaps hides what the load does, and the method can do with displacements instead."""
    if not solver.displaces or start.ended is not None:
        return False
    first = system.residual(start.r, start.lam)
    return first.noise > controls.rtol * first.scale


def _by_active_sets(
    system: CondensedProblem, solver: Solver, start: State, first: Residual, controls: Controls, known: KnownRounds
) -> Solution | None:
    """What a few rounds of the primal-dual active set method find for a small body on a convex foundation.

    They cost a fifth of the steps of :class:`NonsmoothNewton`.  Who counts, watches or changes those gets them.
    """
    watched = controls.callback is not None or controls.max_steps is not None
    usual = suited(NonsmoothNewton(), system.problem).for_tolerance(controls.rtol)
    if solver != usual or watched or not small_and_convex(system):
        return None
    with known.lent() as cache:
        solution = active_set_newton(system, start.r, start.lam, controls, cache, rounds=FEW_ROUNDS)
    if solution is None:
        return None
    seconds = solution.timings["iterate"]
    history = (
        Progress(0, system.energy(start.r), first.relative, 0, 0.0),
        Progress(
            solution.steps, solution.energy, solution.residual.relative, 0, seconds
        ),  # in the last round no set changes
    )
    return replace(solution, history=history)


def _without_contact(
    system: CondensedProblem, solver: Solver, rounded: Residual, controls: Controls, budget: Budget
) -> Solution | None:
    """The linear answer of a body that its load leaves so far from the foundation that the gap's rounding hides it."""
    balanced = system.displaced.at_a_distance()
    if balanced is None or not balanced[2].below(controls.atol, controls.rtol):
        return None
    unknowns, multiplier, reached = balanced
    energy = system.problem.energy(unknowns)
    progress = Progress(0, energy, reached.relative, 0, budget.spent)
    return Solution(
        problem=system.problem,
        unknowns=unknowns,
        multiplier=multiplier,
        status=Status.CONVERGED,
        residual=reached,
        method=solver.name,
        steps=0,
        evaluations=1,
        history=(progress,),
        timings={"condense": system.seconds, "iterate": budget.spent, "recover": 0.0},
    )


@dataclass(frozen=True, eq=False)
class _End:
    """How and where an iteration ended."""

    solver: Solver
    controls: Controls
    state: State
    status: Status
    history: list[Progress]
    seconds: float


def _solution(system: SolverSystem, end: _End) -> Solution:
    """All unknowns from the iterate, with the residual of the full problem and the status that this allows."""
    problem, state = system.problem, end.state
    began = time.perf_counter()
    excused = 0.0 if state.error_bound is None else COUNTS
    unknowns, multiplier, residual, status = finish(system, state, end.status, end.controls, excused)
    return Solution(
        problem=problem,
        unknowns=unknowns,
        multiplier=multiplier,
        status=status,
        residual=residual,
        method=end.solver.name,
        steps=len(end.history) - 1,
        evaluations=state.evaluations,
        history=tuple(end.history),
        timings={
            "condense" if end.solver.condenses else "levels": system.seconds,
            "iterate": end.seconds,
            "recover": time.perf_counter() - began,
        },
        error_bound=state.error_bound,
        contraction=state.contraction,
        fallbacks=state.fallbacks,
        carried=state.carried,
    )


def suited(solver: Solver, problem: DiscreteProblem) -> Solver:
    """The method, able to treat a body that is not linear, and a law that depends on the solution, if there is one.

    Every method runs inside a :class:`ProximalNewton` where the body is not linear. Else
    :class:`NonsmoothNewton` and :class:`NonsmoothMultigrid` become :class:`SemismoothNewton` where the bound has
    derivatives; every other method runs inside a :class:`FixedPoint`.
    """
    solver = _for_body(solver, problem)
    if not problem.law.state_dependent or solver.handles_state:
        return solver
    follows = isinstance(solver, TruncatedNewton) and solver.search is Search.GLOBAL and problem.law.follows_state
    return SemismoothNewton(FixedPoint(solver)) if follows else FixedPoint(solver)


def method_for(method: Solver | str | None, problem: DiscreteProblem) -> Solver | None:
    """The method as an object; one given by its name is made :func:`suited` to the problem, and None stays None."""
    solver = as_method(method)
    return suited(solver, problem) if isinstance(method, str) and solver is not None else solver


def _for_body(solver: Solver, problem: DiscreteProblem) -> Solver:
    """The method, able to treat the body of a problem."""
    if isinstance(problem.bulk, Quadratic) or solver.handles_nonlinear:
        return solver
    if isinstance(solver, SemismoothNewton):
        return _for_body(solver.fallback, problem)
    if isinstance(solver, FixedPoint | LoadStepping):
        return replace(solver, inner=_for_body(solver.inner, problem))
    return ProximalNewton(solver)


def _start(system: SolverSystem, solver: Solver, initial: Solution | Array | None, budget: Budget) -> State:
    """The starting point, checked and moved into the domain of the laws."""
    if initial is None:
        r, stopped = solver.first_guess(system, budget)
        return State(r, system.multiplier(r), ended=stopped)
    problem = system.problem
    u = initial.unknowns if isinstance(initial, Solution) else real_array(initial, "the initial guess", finite=False)
    if u.shape != problem.load.shape:
        raise ProblemError(
            f"the initial guess has shape {u.shape}, the problem {problem.load.shape}; "
            "between meshes use hemivar.solvers.transfer_solution"
        )
    if not np.isfinite(u).all():
        raise ProblemError("the initial guess holds nan or infinity; give finite numbers")
    r = system.start(system.of_unknowns(u))
    return State(r, system.multiplier(r))


def _check_held(system: SolverSystem) -> None:
    """Refuse a convex problem whose energy falls without end along a motion that deforms nothing, unless it was shown
    to be held when it was discretised."""
    law = system.law
    if system.problem.held or law.state_dependent or any((alpha > 0.0).any() for alpha in law.weak_convexity):
        return
    if any(decide(growth).verdict is Coercivity.FALLS for growth in system.free_growth()):
        raise ProblemError(
            "the energy has no lower bound: nothing resists the load strongly enough along a rigid motion; add a "
            "support, lower the load, or use a law that constrains the body"
        )


def _check_coercive(system: CondensedProblem) -> None:
    """Refuse laws that soften without end faster than the body is stiff: the energy has no lower bound then."""
    if system.free.size == 0:
        return
    m, d = system.shape
    law = system.law_at(system.start(), np.zeros(system.shape))  # the bound matters little far away
    pairs = [law.asymptotic_curvature(sign) for sign in (1.0, -1.0)]
    ends = [np.stack([np.broadcast_to(pair[min(c, 1)], (m,)) for c in range(d)], axis=1) for pair in pairs]
    least = np.minimum(*ends)
    if not (least < 0.0).any():
        return
    weights = system.weights[:, None]
    lambda_max = float(np.abs(system.matrix).max())
    softened = system.matrix + np.diag((weights * np.where(np.isfinite(least), least, 0.0)).ravel())
    values, vectors = la.eigh(softened[np.ix_(system.free, system.free)], subset_by_index=[0, 0])
    if values[0] >= -1e-12 * lambda_max:
        return
    for sign in (1.0, -1.0):
        v = np.zeros(m * d)
        v[system.free] = sign * vectors[:, 0]
        far = np.where(v.reshape(m, d) >= 0.0, *ends)
        growth = float(v @ (system.matrix @ v)) + float(
            (weights * far * v.reshape(m, d) ** 2)[v.reshape(m, d) != 0].sum()
        )
        if growth < 0.0:
            worst = int(np.argmin(least.min(axis=1)))
            name = law.name if int(np.argmin(least[worst])) == 0 else law.tangential_name
            raise ProblemError(
                f"the energy has no lower bound: law '{name}' softens without bound, by {-least.min():.3g} per unit of "
                "displacement; end the softening, or take a stiffer body"
            )
