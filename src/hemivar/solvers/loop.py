"""The loop that every method shares: step until the residual is small, the method ends, or a limit is reached."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace

import numpy as np

from hemivar.basics.generators import result_of
from hemivar.solvers.base import Solver, State, System
from hemivar.solvers.controls import Budget, Controls, OutOfTime, Progress
from hemivar.solvers.solution import contact_state
from hemivar.solvers.status import Status

__all__ = ["iterate", "steps"]


def iterate(
    solver: Solver, system: System, state: State, controls: Controls, budget: Budget
) -> tuple[State, Status, list[Progress]]:
    """All :func:`steps`: the best iterate, how it ended, and the history."""
    return result_of(steps(solver, system, state, controls, budget))


def steps(
    solver: Solver, system: System, state: State, controls: Controls, budget: Budget
) -> Generator[Progress, bool | None, tuple[State, Status, list[Progress]]]:
    """Step until the residual is small, the method ends, or a limit is reached; keeps the best iterate.

    Yields every step, and stops after it if it is sent True, as if the callback had returned it.  An interruption
    (Ctrl-C), the time limit and a lack of memory end it in the middle of a step, with the best iterate so far.  Once
    the residual is small the method is asked whether it can do better (:meth:`Solver.settle`); it goes on from there
    if so.
    """
    limit = solver.default_steps if controls.max_steps is None else controls.max_steps
    history: list[Progress] = []
    best, best_rank, smallest = state, np.inf, np.inf
    lowest: list[float] = []
    status: Status | None = None
    try:
        state = solver.begin(system, state, budget)
        for step in range(limit + 1):
            if step:
                before = contact_state(system.local(state.r), state.lam)
                state = solver.step(system, state, budget)
                changed = int(np.count_nonzero(contact_state(system.local(state.r), state.lam) != before))
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
            told = controls.callback is not None and controls.callback(history[-1])
            stop = (yield history[-1]) or told
            if not finite and step:
                status = state.ended or Status.NONFINITE
            elif now.below(controls.atol, controls.rtol):
                better = solver.settle(system, state, budget)
                if better is None:
                    status = Status.CONVERGED
                else:
                    state, best, best_rank, smallest = better, better, np.inf, np.inf
                    lowest.clear()
            elif state.ended is not None:
                status = state.ended
            elif stop:
                status = Status.INTERRUPTED
            elif budget.spent > budget.limit:
                status = Status.MAX_TIME
            lowest.append(smallest)
            stuck = len(lowest) > solver.patience + 1 and lowest[-1] > 0.999 * lowest[-1 - solver.patience]
            if status is None and stuck:
                status = Status.STALLED
            if status is not None:
                break
    except OutOfTime:
        status = Status.MAX_TIME
    except KeyboardInterrupt:
        status = Status.INTERRUPTED
    except MemoryError:
        status = Status.OUT_OF_MEMORY
    if not history:
        first = system.residual(best.r, best.lam).relative
        history.append(Progress(0, system.energy(best.r), first, 0, budget.spent))
    best = replace(best, evaluations=max(best.evaluations, state.evaluations), contraction=state.contraction)
    return best, Status.MAX_STEPS if status is None else status, history
