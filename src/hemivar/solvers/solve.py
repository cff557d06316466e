"""The loop that every method shares."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from hemivar._typing import Array
from hemivar.errors import MethodError, ProblemError
from hemivar.mechanics.discrete import DiscreteProblem
from hemivar.mechanics.residual import residual
from hemivar.solvers.base import Solver, State
from hemivar.solvers.condensed import CondensedProblem, condense
from hemivar.solvers.controls import Budget, Controls, OutOfTime, Progress
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.solution import Solution, contact_state
from hemivar.solvers.status import Status

__all__ = ["solve"]


def solve(
    problem: DiscreteProblem,
    solver: Solver | None = None,
    controls: Controls | None = None,
    *,
    initial: Solution | Array | None = None,
    condensed: CondensedProblem | None = None,
) -> Solution:
    """Solve a discrete contact problem.

    Parameters
    ----------
    problem : DiscreteProblem
        From :func:`hemivar.discretize`, or made of the user's own arrays.
    solver : Solver, optional
        The method and its options; :class:`NonsmoothNewton` by default.
    controls : Controls, optional
        Tolerances, limits, callback.
    initial : Solution or array (n,), optional
        Where to start; zero displacement by default.
    condensed : CondensedProblem, optional
        The condensation of this very problem, to be shared by several methods.

    Returns
    -------
    Solution
        Always with a status; a solve that does not converge returns its best iterate and says why.

    Raises
    ------
    MethodError
        The method cannot treat this problem; nothing has been computed.
    ProblemError
        The problem cannot be solved as stated.
    """
    solver = NonsmoothNewton() if solver is None else solver
    controls = Controls() if controls is None else controls
    why = solver.refuse(problem)
    if why is not None:
        raise MethodError(f"{solver.name} cannot solve this problem: {why}")
    if condensed is None:
        condensed = condense(problem)
    elif condensed.problem is not problem:
        raise ProblemError("the condensation given belongs to another problem; condense this one")
    _check_held(condensed)
    began = time.perf_counter()
    budget = Budget(controls.max_time)
    start = _start(condensed, initial)
    state, status, history = _iterate(solver, condensed, start, controls, budget)
    iterated = time.perf_counter()
    unknowns, found = condensed.recover(state.r, state.lam)
    multiplier = state.lam
    if problem.contact_points and np.isfinite(problem.law.value(state.r)).all():
        # Rounding aside, a multiplier of the law itself: no pressure at all where the body has lifted.
        exact = np.where(condensed.active, problem.law.nearest_multiplier(state.r, state.lam), state.lam)
        with_exact = residual(problem, unknowns, exact)
        if with_exact.total <= found.total + found.rounding:
            multiplier, found = exact, with_exact
    if found.below(controls.atol, controls.rtol):
        status = Status.CONVERGED
    elif status is Status.CONVERGED and state.error_bound is None:
        status = Status.INACCURATE
    return Solution(
        problem=problem,
        unknowns=unknowns,
        multiplier=multiplier,
        status=status,
        residual=found,
        method=solver.name,
        steps=len(history) - 1,
        evaluations=state.evaluations,
        history=tuple(history),
        timings={
            "condense": condensed.seconds,
            "iterate": iterated - began,
            "recover": time.perf_counter() - iterated,
        },
        error_bound=state.error_bound,
    )


def _start(system: CondensedProblem, initial: Solution | Array | None) -> State:
    """The starting point, checked and moved into the domain of the laws."""
    if initial is None:
        r = system.start()
        return State(r, system.multiplier(r))
    problem = system.problem
    u = initial.unknowns if isinstance(initial, Solution) else np.asarray(initial, dtype=float)
    if u.shape != problem.load.shape:
        raise ProblemError(
            f"the initial guess has shape {u.shape}, the problem {problem.load.shape}; "
            "between meshes use hemivar.solvers.transfer_solution"
        )
    if not np.isfinite(u).all():
        raise ProblemError("the initial guess holds nan or infinity")
    r = system.start(problem.local(u))
    return State(r, system.multiplier(r))


def _check_held(system: CondensedProblem) -> None:
    """Refuse a convex problem whose energy falls without end along a rigid motion.

    With one rigid motion the check is complete; with several, it looks along each of them.
    """
    law = system.law
    if not len(system.rigid_modes) or any((alpha > 0.0).any() for alpha in law.weak_convexity):
        return
    for mode in system.rigid_modes:
        for sign in (1.0, -1.0):
            direction = np.zeros(system.shape)
            direction.ravel()[system.free] = sign * mode
            pull = float(system.force @ direction.ravel())
            hold = float(system.weights @ law.recession(direction))
            if hold - pull < -1e-9 * float(np.abs(system.force) @ np.abs(direction).ravel()):
                raise ProblemError(
                    "the energy has no lower bound: the load pushes the body along a rigid motion that neither supports"
                    " nor foundation resist strongly enough; add a support, lower the load, or take a law that holds it"
                )


def _iterate(
    solver: Solver, system: CondensedProblem, state: State, controls: Controls, budget: Budget
) -> tuple[State, Status, list[Progress]]:
    """Step until the residual is small, the method ends, or a limit is reached; keeps the best iterate."""
    steps = solver.default_steps if controls.max_steps is None else controls.max_steps
    history: list[Progress] = []
    best, best_rank, smallest = state, np.inf, np.inf
    lowest: list[float] = []
    status: Status | None = None
    try:
        state = solver.begin(system, state, budget)
        for step in range(steps + 1):
            if step:
                before = contact_state(state.r, state.lam)
                state = solver.step(system, state, budget)
                changed = int(np.count_nonzero(contact_state(state.r, state.lam) != before))
            else:
                changed = 0
            now = system.residual(state.r, state.lam)
            finite = bool(np.isfinite(state.r).all() and np.isfinite(now.total))
            energy = system.energy(state.r) if state.energy is None else state.energy
            history.append(Progress(step, energy, now.relative, changed, budget.spent))
            rank = energy if solver.descends else now.total
            certified = state.ended is Status.CONVERGED and state.error_bound is not None
            if finite and (rank <= best_rank or certified):
                best, best_rank = state, rank
            smallest = min(smallest, now.total if finite else np.inf)
            stop = controls.callback is not None and controls.callback(history[-1])
            if not finite and step:
                status = state.ended or Status.NONFINITE
            elif now.below(controls.atol, controls.rtol):
                status = Status.CONVERGED
            elif state.ended is not None:
                status = state.ended
            elif stop:
                status = Status.INTERRUPTED
            elif budget.spent > budget.limit:
                status = Status.MAX_TIME
            lowest.append(smallest)
            stuck = step > solver.patience and lowest[-1] > 0.999 * lowest[-1 - solver.patience]
            if status is None and stuck:
                status = Status.STALLED
            if status is not None:
                break
    except OutOfTime:
        status = Status.MAX_TIME
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    if not history:
        first = system.residual(best.r, best.lam).relative
        history.append(Progress(0, system.energy(best.r), first, 0, budget.spent))
    best = replace(best, evaluations=max(best.evaluations, state.evaluations))
    return best, Status.MAX_STEPS if status is None else status, history
