"""Solving over ranks, and what comes out of it."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, Record
from hemivar.discrete.residual import Residual
from hemivar.engines.petsc.body_on_ranks import BodyOnRanks
from hemivar.engines.petsc.time_limit import Alarm
from hemivar.fem import Deformation, deformation
from hemivar.solvers import Controls, FixedPoint, NonsmoothMultigrid, Progress, ProximalNewton, Solver, Status
from hemivar.solvers.base import State
from hemivar.solvers.contact_states import ContactStates, NormalState, TangentialState
from hemivar.solvers.loop import Watch, finish, iterate, states_of

__all__ = ["DistributedSolution", "Saved", "depends_on_ranks", "solve_distributed"]


@dataclass(frozen=True, eq=False)
class Saved:
    """A state with the history up to it, as a checkpoint keeps it."""

    state: State
    history: tuple[Progress, ...]


@dataclass(frozen=True, eq=False)
class DistributedSolution:
    """Displacement and multiplier over ranks; arrays are the part of this rank.

    Attributes
    ----------
    body : BodyOnRanks
    x : array (n,)
        Displacement in the unknowns of ``body``.
    multiplier : array (m, d)
        Force per area of the body on the foundation at the contact points of this rank: pressure (column 0), and minus
        the friction.
    status : Status
    residual : Residual
        Of the whole problem.
    energy : float
        E(u), of the whole problem.
    steps, cycles : int
        Newton steps, and cycles of multigrid, both on the finest mesh.
    history : tuple of Progress
    timings : mapping
        Seconds: ``assemble``, ``nested`` (coarser meshes), ``iterate``.
    contraction : float or None
        Of the outer fixed point, where bounds of the law depend on the solution.
    method : str
    """

    body: BodyOnRanks
    x: Array
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

    @property
    def remedy(self) -> str:
        """What happened in words, and what to try."""
        return self.status.remedy

    @cached_property
    def local(self) -> Array:
        """Penetration and slip at the contact points of this rank, (m, d)."""
        return self.body.local(self.x)

    @cached_property
    def displacement(self) -> Array:
        """Displacements (N, d) of the nodes of this rank's piece."""
        return self.body.displacement(self.x)

    @cached_property
    def deformation(self) -> Deformation:
        """Largest strain and rotation of the whole body; all ranks ask for it together."""
        own, ranks = deformation(self.body.piece.mesh, self.displacement), self.body.ranks
        return Deformation(*ranks.largest(own.strain, own.rotation), *ranks.total(own.volume, own.whole))

    @property
    def warnings(self) -> tuple[str, ...]:
        """As :attr:`hemivar.Solution.warnings`; all ranks ask for them together."""
        strained = self.deformation.warning
        return self.body.warnings if strained is None else (*self.body.warnings, strained)

    @cached_property
    def states(self) -> ContactStates:
        """The states of the contact points of this rank."""
        return states_of(self.body, self.x, self.multiplier, without_friction=self.body.contact.without_friction)

    @cached_property
    def debonding(self) -> Mapping[str, Array]:
        """As :attr:`hemivar.Solution.debonding`, at the contact points of this rank; all ranks ask for it together."""
        body = self.body
        own = body.law.debonding(self.local) if body.points else {}
        names = sorted({name for told in body.ranks.mpi.allgather(tuple(own)) for name in told})
        return {name: own.get(name, np.full(body.points, np.nan)) for name in names}

    @cached_property
    def sums(self) -> Record:
        """Resultants and extremes of the whole contact boundary.

        Keys ``normal_force``, ``friction_force`` (d - 1,) and ``force`` (d,) of the foundation on the body,
        ``contact_length``, ``whole_length``,
        ``counts`` (of each normal and of each tangential state), ``max_penetration``, ``max_pressure``.
        """
        body, w, lam = self.body, self.body.weights, self.multiplier
        d = body.dim
        force = -w @ body.contact.global_vectors(lam)
        total = body.ranks.total(
            *(w @ lam),
            *force,
            float(w @ self.states.closed),
            float(w.sum()),
            *(float(count) for own in self.states.counts for count in own.values()),
        )
        top = body.ranks.largest(self.local[:, 0].max(initial=-np.inf), lam[:, 0].max(initial=-np.inf))
        found = [int(count) for count in total[2 * d + 2 :]]
        return {
            "normal_force": float(total[0]), "friction_force": 0.0 - total[1:d], "force": total[d : 2 * d],
            "contact_length": float(total[2 * d]), "whole_length": float(total[2 * d + 1]),
            "counts": (
                dict(zip(NormalState, found[:-3], strict=True)), dict(zip(TangentialState, found[-3:], strict=True))
            ),
            "max_penetration": float(top[0]), "max_pressure": float(top[1]),
        }  # fmt: skip


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
    alarm: Alarm | None = None,
) -> DistributedSolution:
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
    alarm : Alarm, optional
        When to end before it is done; by default once ``controls.max_time`` has passed, coarser meshes included.

    Returns
    -------
    DistributedSolution
    """
    if solver is None:
        solver = NonsmoothMultigrid()
        solver = solver if body.stored is None else ProximalNewton(solver)
        solver = FixedPoint(solver) if depends_on_ranks(body) else solver
    controls = Controls() if controls is None else controls
    alarm = Alarm(controls.max_time) if alarm is None else alarm
    with np.errstate(all="ignore"):  # numbers that are not finite end the iteration, with a status that says so
        return _solve(body, solver.for_tolerance(controls.rtol), controls, resume, watch, alarm)


def _solve(
    body: BodyOnRanks, solver: Solver, controls: Controls, resume: Saved | None, watch: Watch | None, alarm: Alarm
) -> DistributedSolution:
    began = time.perf_counter()
    if resume is None:
        x, stopped = solver.first_guess(body, alarm)
        resume = Saved(State(x, body.multiplier(x), ended=stopped), ())
    nested = time.perf_counter() - began
    state, status, history = iterate(solver, body, resume.state, controls, alarm, resume.history, watch)
    x, lam, found, status = finish(body, state, status, controls)
    energy = body.energy(x, lam)
    if status is Status.INACCURATE and not np.isfinite([found.total, found.scale, energy]).all():
        status = Status.NONFINITE
    levels = [body]
    while levels[-1].coarser is not None:
        levels.append(levels[-1].coarser)
    timings = {
        "assemble": sum(level.seconds for level in levels),
        "nested": nested,
        "iterate": time.perf_counter() - began - nested,
    }
    solver.release(state)
    return DistributedSolution(
        body, x, lam, status, found, energy, len(history) - 1, state.evaluations, tuple(history), timings,
        state.contraction,
    )  # fmt: skip
