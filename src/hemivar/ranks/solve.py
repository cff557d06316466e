"""The iteration over ranks, by the serial solver, and its solution with residual and status."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from hemivar.discrete.problem import DiscreteProblem
from hemivar.ranks.body_on_ranks import BodyOnRanks
from hemivar.ranks.time_limit import TimeLimit
from hemivar.solvers import Controls, FixedPoint, NonsmoothMultigrid, Progress, ProximalNewton, Solution, Solver, Status
from hemivar.solvers.base import State
from hemivar.solvers.loop import Watch, finish, iterate

__all__ = ["Saved", "depends_on_ranks", "solve_distributed"]


@dataclass(frozen=True, eq=False)
class Saved:
    """A state with the history up to it, as a checkpoint keeps it."""

    state: State
    history: tuple[Progress, ...]


def depends_on_ranks(body: BodyOnRanks) -> bool:
    """Whether a bound of the law depends on the solution, on any rank."""
    return bool(body.ranks.largest(float(body.law.state_dependent))[0])


def solve_distributed(
    body: BodyOnRanks,
    solver: Solver | None = None,
    controls: Controls | None = None,
    *,
    resume: Saved | None = None,
    watch: Watch | None = None,
    alarm: TimeLimit | None = None,
    problem: DiscreteProblem | None = None,
) -> Solution:
    """Solve a contact problem over ranks by the serial method; all of them call this.

    Parameters
    ----------
    body : BodyOnRanks
        The problem on the mesh wanted; it is solved on coarser ones first, if it has them.
    solver : NonsmoothMultigrid, ProximalNewton or FixedPoint, optional
        By default what suits body and law.
    controls : Controls, optional
    resume : Saved, optional
        Where to go on from.
    watch : function, optional
        Called with every state, and the history up to it.
    alarm : TimeLimit, optional
        When to end before it is done; by default once ``controls.max_time`` has passed, coarser meshes included.
    problem : DiscreteProblem, optional
        What the body is of, under its load and with its law; ``body.problem`` by default.

    Returns
    -------
    Solution
        Of the problem: vectors and contact points are those of this rank; resultants and energy are those of all
        ranks, which ask for them together.
    """
    controls = Controls() if controls is None else controls
    alarm = TimeLimit(controls.max_time) if alarm is None else alarm
    problem = body.problem if problem is None else problem
    if solver is None:
        solver = NonsmoothMultigrid()
        solver = solver if body.stored is None else ProximalNewton(solver)
        solver = FixedPoint(solver) if depends_on_ranks(body) else solver
    solver = solver.for_tolerance(controls.rtol)
    with np.errstate(all="ignore"):  # numbers that are not finite end the iteration, with a status that says so
        began = time.perf_counter()
        if resume is None:
            x, stopped = solver.first_guess(body, alarm)
            resume = Saved(State(x, body.multiplier(x), ended=stopped), ())
        nested = time.perf_counter() - began
        state, status, history = iterate(solver, body, resume.state, controls, alarm, resume.history, watch)
        x, lam, residual, status = finish(body, state, status, controls)
        solver.release(state)
        levels = [body]
        while levels[-1].coarser is not None:
            levels.append(levels[-1].coarser)
        timings = {
            "assemble": sum(level.seconds for level in levels),
            "nested": nested,
            "iterate": time.perf_counter() - began - nested,
        }
        solution = Solution(
            problem, x, lam, status, residual, "petsc", len(history) - 1, state.evaluations, tuple(history), timings,
            contraction=state.contraction,
        )  # fmt: skip
        if status is Status.INACCURATE and not np.isfinite([residual.total, residual.scale, solution.energy]).all():
            return replace(solution, status=Status.NONFINITE)
        return solution
