"""The iteration that every method shares: step until the residual is small, the method ends, or a limit is reached."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import replace

import numpy as np

from hemivar.basics.deadline import CALLED
from hemivar.basics.generators import result_of
from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.residual import Residual
from hemivar.laws.vector_law import softens
from hemivar.solvers.base import Solver, State
from hemivar.solvers.contact_states import ContactStates, contact_states
from hemivar.solvers.controls import Budget, Controls, OutOfTime, Progress
from hemivar.solvers.status import Status
from hemivar.systems.contact_system import PointSystem

__all__ = ["Watch", "finish", "iterate", "states_of", "steps"]

#: Between steps glue is not looked at more closely.
_UNKNOWN = np.zeros(1, dtype=bool)
#: What no progress is over the steps that a method has patience for: of the residual, and part of all energy won.
_LITTLE, _WON = 0.999, 1e-8
#: Extents of the body beyond which it is lost on laws that may let it go, or, where none is known, times what the load
#: would press a contact point in.
_FAR, _BEYOND = 100.0, 1e12

#: Called with every state and the history up to it.
Watch = Callable[[State, tuple[Progress, ...]], None]


def iterate(
    solver: Solver,
    system: PointSystem,
    state: State,
    controls: Controls,
    budget: Budget,
    past: tuple[Progress, ...] = (),
    watch: Watch | None = None,
) -> tuple[State, Status, list[Progress]]:
    """All :func:`steps`: the best iterate, how it ended, and the history."""
    return result_of(steps(solver, system, state, controls, budget, past, watch))


def steps(
    solver: Solver,
    system: PointSystem,
    state: State,
    controls: Controls,
    budget: Budget,
    past: tuple[Progress, ...] = (),
    watch: Watch | None = None,
) -> Generator[Progress, bool | None, tuple[State, Status, list[Progress]]]:
    """Step until the residual is small, the method ends, or a limit is reached; keeps the best iterate.

    Yields every step, and stops after it if it is sent True, as if the callback had returned it.  An interruption
    (Ctrl-C), the time limit and a lack of memory end it in the middle of a step, with the best iterate so far.  Once
    the residual is small the method is asked whether it can do better (:meth:`Solver.settle`); it goes on from there
    if so.

    ``state``: where to start, or what a run before this one ended with; ``past``: steps that a run before this one has
    done; the last is that of ``state``.
    """
    vectors = system.vectors
    limit = solver.default_steps if controls.max_steps is None else controls.max_steps
    history: list[Progress] = list(past[:-1])
    first, changed = len(history), past[-1].changed if past else 0
    best, best_rank, smallest = state, np.inf, np.inf
    lowest: list[float] = []
    energies: list[float] = []
    status: Status | None = None
    contact: ContactStates | None = None
    far, away = _far(system), 0
    unloaded, forces = system.load_scale.load == system.load_scale.rest == 0.0, 0.0
    try:
        if not past:
            state = solver.begin(system, state, budget)
        for step in range(first, max(limit, first) + 1):
            if step > first:
                before = states_of(system, state.r, state.lam, past_peak=_UNKNOWN) if contact is None else contact
                state = solver.step(system, state, budget)
                contact = states_of(system, state.r, state.lam, past_peak=_UNKNOWN)
                changed = int(vectors.total(float(np.count_nonzero(contact.numbers != before.numbers)))[0])
            now = system.residual(state.r, state.lam) if state.residual is None else state.residual
            forces = forces or now.total
            if unloaded and 0.0 < now.total <= controls.rtol * forces:
                solver.release(state)
                state = replace(solver.begin(system, _at_rest(system, state), budget), ended=Status.CONVERGED)
                now = system.residual(state.r, state.lam)
            broken = float(not np.isfinite(state.r).all())
            finite = bool(np.isfinite(now.total)) and not vectors.largest(broken)[0]
            energy = system.energy(state.r) if state.energy is None else state.energy
            history.append(Progress(step, energy, now.relative, changed, budget.spent))
            rank = energy if solver.descends else now.total
            certified = state.ended is Status.CONVERGED and state.error_bound is not None
            if finite and (rank <= best_rank or certified):
                best, best_rank = state, rank
            smallest = min(smallest, now.total if finite else np.inf)
            asked = controls.callback is not None and controls.callback(history[-1])
            stop = (yield history[-1]) or asked
            due = float(vectors.largest(CALLED if stop else budget.due())[0])
            size = _largest(system, state.r) if far != np.inf else 0.0
            away = away + 1 if size > far else 0
            if watch is not None:
                watch(state, tuple(history))
            if not finite and step:
                status = state.ended or Status.NONFINITE
            elif now.below(controls.atol, controls.rtol):
                better = solver.settle(system, state, budget)
                if better is None:
                    status = Status.CONVERGED
                else:
                    state, best, best_rank, smallest, contact = better, better, np.inf, np.inf, None
                    lowest.clear()
                    energies.clear()
            elif state.ended is not None:
                status = state.ended
            elif due:
                status = _stopped(due)
            elif away >= 3:  # steps in a row
                status = Status.UNBOUNDED
            lowest.append(smallest)
            energies.append(energy)
            stuck = len(lowest) > solver.patience + 1 and lowest[-1] > _LITTLE * lowest[-1 - solver.patience]
            if status is None and stuck and not (solver.descends and _falls(energies, solver.patience)):
                status = Status.STALLED
            if status is not None:
                break
    except OutOfTime:
        status = _stopped(float(vectors.largest(budget.due())[0]))
    except KeyboardInterrupt:
        if not vectors.alone:
            raise
        status = Status.INTERRUPTED
    except MemoryError:
        if not vectors.alone:
            raise
        status = Status.OUT_OF_MEMORY
    if not history:
        reached = system.residual(best.r, best.lam).relative
        history.append(Progress(0, system.energy(best.r), reached, 0, budget.spent))
    evaluations = max(best.evaluations, state.evaluations)
    best = replace(
        best,
        evaluations=evaluations,
        contraction=state.contraction,
        fallbacks=state.fallbacks,
        carried=state.carried,
    )
    return best, Status.MAX_STEPS if status is None else status, history


def _at_rest(system: PointSystem, state: State) -> State:
    """The body where it was made, which no force has moved.

    Where the data set no force at all, as where a bond has snapped, it is in balance there.  What comes close to that
    from somewhere else has nothing to be held against: it would go on until the smallest of numbers.
    """
    r = system.start()
    return State(r, system.multiplier(r), state.evaluations, fallbacks=state.fallbacks)


def _falls(energies: list[float], patience: int) -> bool:
    """Whether the last steps have won more energy than rounding makes, as where glue lets go point by point."""
    return energies[-1 - patience] - energies[-1] > _WON * (energies[0] - energies[-1])


def _far(system: PointSystem) -> float:
    """How far contact points may move; infinite where the law holds them."""
    if not (system.vectors.alone and softens(system.law)):
        return np.inf
    if system.extent < np.inf:
        return _FAR * system.extent
    pressed = system.load_scale.load * float((system.material_compliance / system.weights[:, None]).max(initial=0.0))
    return _BEYOND * pressed if pressed > 0.0 else np.inf


def _largest(system: PointSystem, r: Array) -> float:
    return float(system.vectors.largest(np.abs(system.local(r)).max(initial=0.0))[0])


def _stopped(due: float) -> Status:
    return Status.INTERRUPTED if due == CALLED else Status.MAX_TIME


def states_of(
    system: PointSystem,
    r: Array,
    lam: Array,
    *,
    past_peak: BoolArray | None = None,
    without_friction: BoolArray | None = None,
) -> ContactStates:
    """The states of the contact points of this process, by the sizes of all; see :func:`contact_states`."""
    local = system.local(r)
    sizes = system.vectors.largest(np.abs(local).max(initial=0.0), np.abs(lam).max(initial=0.0)).tolist()
    return contact_states(
        system.law, local, lam, (sizes[0], sizes[1]), past_peak=past_peak, without_friction=without_friction
    )


def finish(
    system: PointSystem, state: State, status: Status, controls: Controls, excused: float = 0.0
) -> tuple[Array, Array, Residual, Status]:
    """All unknowns from the iterate, a multiplier, the residual of the full problem and the status that this allows.

    Rounding aside, the multiplier is one of the law itself: no pressure at all where the body has lifted.  A method
    that ended by its own rule is believed up to the relative residual ``excused``.
    """
    multipliers, r = [state.lam], system.local(state.r)
    law = system.law_at(state.r, state.lam) if np.isfinite(r).all() else None
    outside = law is None or not np.isfinite(law.value(r)).all()
    if not system.vectors.largest(float(outside))[0] and law is not None:
        multipliers.append(np.where(system.active, law.nearest_multiplier(r, state.lam), state.lam))
    unknowns, residuals = system.recover(state.r, *multipliers)
    multiplier, residual = state.lam, residuals[0]
    if residuals[-1].total <= residual.total + residual.rounding:
        multiplier, residual = multipliers[-1], residuals[-1]
    if status is Status.INTERRUPTED:  # whoever asked for it must be told, however far it came
        return unknowns, multiplier, residual, status
    if residual.below(controls.atol, controls.rtol):
        status = Status.CONVERGED
    elif status is Status.CONVERGED and not residual.below(0.0, excused):
        status = Status.INACCURATE
    return unknowns, multiplier, residual, status
