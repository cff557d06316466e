"""Solving over ranks, and what comes out of it."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.residual import Residual
from hemivar.engines.petsc.alarm import CALLED, Alarm
from hemivar.engines.petsc.assembly import BodyOnRanks
from hemivar.engines.petsc.newton import DistributedNewton, End, Iterate, Method, states
from hemivar.laws import ContactLaw
from hemivar.solvers import ContactState, Controls, Progress, Status

__all__ = ["DistributedSolution", "Saved", "solve_distributed"]

_OUTER = 50
_INNER_RTOL = 1e-11
_ROUNDING = 64.0 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Saved:
    """An iterate as a checkpoint keeps it; ``state`` is where the bounds of the laws are frozen, if they depend on it.

    Attributes
    ----------
    iterate : Iterate
    history : tuple of Progress
    state : pair of Vec and array (m, d), or None
        Displacement and multiplier.
    outer : int
        Steps of the fixed point so far.
    changes : tuple of float
        Their sizes.
    """

    iterate: Iterate
    history: tuple[Progress, ...]
    state: tuple[Any, Array] | None = None
    outer: int = 0
    changes: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class DistributedSolution:
    """Displacement and multiplier over ranks; arrays and vectors are the part of this rank.

    Attributes
    ----------
    body : BodyOnRanks
    x : petsc4py Vec
        Displacement in the unknowns of ``body``.
    force : petsc4py Vec
        ``f - K x``.
    multiplier : array (m, d)
        Pressure and friction at the contact points of this rank.
    status : Status
    residual : Residual
        Of the whole problem.
    energy : float
        E(u), of the whole problem.
    steps, cycles : int
        Newton steps, and applications of the preconditioner, those on coarser meshes included.
    history : tuple of Progress
    timings : mapping
        Seconds: ``assemble``, ``nested`` (coarser meshes), ``iterate``.
    contraction : float or None
        Of the outer fixed point, where bounds of the law depend on the solution.
    method : str
    """

    body: BodyOnRanks
    x: Any
    force: Any
    multiplier: Array
    status: Status
    residual: Residual
    energy: float
    steps: int
    cycles: int
    history: tuple[Progress, ...]
    timings: Mapping[str, float] = field(default_factory=dict)
    contraction: float | None = None
    method: str = "petsc"

    @cached_property
    def local(self) -> Array:
        """Penetration and slip at the contact points of this rank, (m, d)."""
        return self.body.local(self.x)

    @cached_property
    def displacement(self) -> Array:
        """Displacements (N, d) of the nodes of this rank's piece."""
        return self.body.displacement(self.x)

    @cached_property
    def state(self) -> IntArray:
        """A :class:`ContactState` for each contact point of this rank."""
        return states(self.body, self.x, self.multiplier)

    @cached_property
    def sums(self) -> dict[str, Any]:
        """Resultants and extremes of the whole contact boundary.

        Keys ``normal_force``, ``friction_force`` (d - 1,), ``force`` (d,), ``contact_length``, ``whole_length``,
        ``counts`` (open, stick, slip), ``max_penetration``, ``max_pressure``.
        """
        body, w, lam = self.body, self.body.weights, self.multiplier
        d = body.dim
        closed = self.state != ContactState.OPEN
        force = -w @ body.contact.global_vectors(lam)
        total = body.ranks.total(
            *(w @ lam),
            *force,
            float(w @ closed),
            float(w.sum()),
            *(np.count_nonzero(self.state == s) for s in range(3)),
        )
        top = body.ranks.largest(self.local[:, 0].max(initial=-np.inf), lam[:, 0].max(initial=-np.inf))
        return {
            "normal_force": float(total[0]), "friction_force": total[1:d], "force": total[d : 2 * d],
            "contact_length": float(total[2 * d]), "whole_length": float(total[2 * d + 1]),
            "counts": [int(c) for c in total[2 * d + 2 :]],
            "max_penetration": float(top[0]), "max_pressure": float(top[1]),
        }  # fmt: skip


def solve_distributed(
    bodies: Sequence[BodyOnRanks],
    solver: DistributedNewton | None = None,
    controls: Controls | None = None,
    *,
    resume: Saved | None = None,
    watch: Callable[[Saved], None] | None = None,
    alarm: Alarm | None = None,
) -> DistributedSolution:
    """Solve a contact problem over ranks; all of them call this.

    Parameters
    ----------
    bodies : sequence of BodyOnRanks
        The problem on coarser meshes, if there are any, and last on the mesh wanted.
    solver : DistributedNewton, optional
    controls : Controls, optional
    resume : Saved, optional
        Where to go on from.
    watch : function, optional
        Called with every iterate.
    alarm : Alarm, optional
        When to end before it is done; by default once ``controls.max_time`` has passed, coarser meshes included.

    Returns
    -------
    DistributedSolution
    """
    solver = DistributedNewton() if solver is None else solver
    controls = Controls() if controls is None else controls
    alarm = Alarm(controls.max_time) if alarm is None else alarm
    with np.errstate(all="ignore"):  # numbers that are not finite end the iteration, with a status that says so
        return _solve(bodies, solver, controls, resume, watch, alarm)


def _solve(
    bodies: Sequence[BodyOnRanks], solver: DistributedNewton, controls: Controls, resume: Saved | None,
    watch: Callable[[Saved], None] | None, alarm: Alarm,
) -> DistributedSolution:  # fmt: skip
    body = bodies[-1]
    began = time.perf_counter()
    dependent = bool(body.ranks.largest(float(body.law.state_dependent if body.points else False))[0])
    cycles = 0
    if resume is not None:
        start, history = resume.iterate, resume.history
    else:
        chain = bodies if solver.nested and not dependent else bodies[-1:]
        x, cycles = solver.first_guess(chain, alarm)
        start, history = None, ()
    nested = time.perf_counter() - began
    method = Method(solver, body, controls, alarm)
    if dependent:
        end, contraction = _fixed_point(method, x if resume is None else None, resume, watch)
    else:
        now = method.begin(x) if start is None else start
        tell = None if watch is None else (lambda it, lines: watch(Saved(it, lines)))
        end, contraction = method.run(now, history, tell), None
    cycles += method.cycles
    lam, found = _exact_multiplier(method, end)
    energy = method.at(law_at(body, end.iterate, lam)).energy(end.iterate.x)
    status = end.status
    finite = bool(np.isfinite([found.total, found.scale, energy]).all())
    if finite and found.below(controls.atol, controls.rtol):
        status = Status.CONVERGED
    elif status is Status.CONVERGED:
        status = Status.INACCURATE if finite else Status.NONFINITE
    timings = {
        "assemble": sum(level.seconds for level in bodies),
        "nested": nested,
        "iterate": time.perf_counter() - began - nested,
    }
    method.destroy()
    return DistributedSolution(
        body, end.iterate.x, end.iterate.force, lam, status, found, energy, len(end.history) - 1, cycles, end.history,
        timings, contraction,
    )  # fmt: skip


def law_at(body: BodyOnRanks, now: Iterate, lam: Array) -> ContactLaw:
    """The law with bounds frozen at an iterate."""
    return body.law.frozen(body.local(now.x), lam) if body.points else body.law


def _exact_multiplier(method: Method, end: End) -> tuple[Array, Residual]:
    """Rounding aside, a multiplier of the law itself: no pressure at all where the body has lifted."""
    body = method.body
    lam, r = end.multiplier, body.local(end.iterate.x)
    found = method.residual(end.iterate, lam, law_at(body, end.iterate, lam))
    exact = lam
    if body.points:
        exact = np.where(body.active, law_at(body, end.iterate, lam).nearest_multiplier(r, lam), lam)
    with_exact = method.residual(end.iterate, exact, law_at(body, end.iterate, exact))
    return (exact, with_exact) if with_exact.total <= found.total + found.rounding else (lam, found)


def _fixed_point(
    method: Method, guess: Any, resume: Saved | None, watch: Callable[[Saved], None] | None
) -> tuple[End, float | None]:
    """Freeze the bounds, solve, move on: :class:`hemivar.solvers.FixedPoint` over ranks."""
    body, controls = method.body, method.controls
    if resume is not None and resume.state is not None:
        now, history = resume.iterate, list(resume.history)
        state, outer, changes = resume.state, resume.outer, list(resume.changes)
    else:
        r = body.local(guess)
        first = Method.admissible(body, guess)
        now = Iterate(first, method.force(first), 0.0, method.block.stiffest())
        history, outer, changes = [], 0, []
        state = (first, np.zeros(r.shape) if not body.points else method.multiplier(now))
    status: Status | None = None
    contraction: float | None = None
    end: End | None = None
    while status is None:
        law = body.law.frozen(body.local(state[0]), state[1]) if body.points else body.law
        inner = method.at(law, Controls(rtol=_INNER_RTOL))
        inner.cycles = 0
        end = inner.run(inner.begin(now.x, now.built_at), ())
        method.cycles += inner.cycles
        outer += 1
        lam = end.multiplier
        r = body.local(end.iterate.x)
        if body.points:
            lam = np.where(body.active, law.nearest_multiplier(r, lam), lam)
        found = method.residual(end.iterate, lam, law_at(body, end.iterate, lam))
        change, size = method.size_of_change(end.iterate, state, lam)
        changes.append(change)
        spent = time.perf_counter() - method.began
        energy = method.at(law_at(body, end.iterate, lam)).energy(end.iterate.x)
        history.append(Progress(outer, energy, found.relative, 0, spent))
        ratios = [b / a for a, b in itertools.pairwise(changes) if a > 1e3 * _ROUNDING * size][-4:]
        contraction = float(np.exp(np.mean(np.log(np.maximum(ratios, 1e-300))))) if ratios else contraction
        settled = change <= _ROUNDING * size
        now = end.iterate
        end = End(now, lam, found, end.status, tuple(history))
        state = (now.x, lam)
        stop = controls.callback is not None and bool(controls.callback(history[-1]))
        due = float(body.ranks.largest(CALLED if stop else method.alarm.due())[0])
        if watch is not None:
            watch(Saved(now, tuple(history), state, outer, tuple(changes)))
        finite = bool(np.isfinite([found.total, found.scale, energy]).all())
        if finite and found.below(controls.atol, controls.rtol):
            status = Status.CONVERGED
        elif end.status in (Status.NONFINITE, Status.UNBOUNDED):
            status = end.status
        elif not finite:
            status = Status.NONFINITE
        elif due:
            status = Status.INTERRUPTED if due == CALLED else Status.MAX_TIME
        elif settled:
            status = Status.STALLED
        elif len(ratios) == 4 and contraction is not None and contraction >= 0.999:
            status = Status.NOT_CONTRACTING
        elif outer >= (_OUTER if controls.max_steps is None else controls.max_steps):
            status = Status.MAX_STEPS
    assert end is not None
    return End(end.iterate, end.multiplier, end.residual, status, tuple(history)), contraction
