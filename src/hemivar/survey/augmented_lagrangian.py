"""Augmented Lagrangian methods: the survey's, by root finding, and a semismooth Newton form."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.arguments import check_numbers
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws.vector_law import prox, prox_jacobian, spread
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget
from hemivar.solvers.status import Status
from hemivar.solvers.truncated_newton import lower_energy
from hemivar.systems.condensed import CondensedProblem

__all__ = ["AugmentedLagrangian", "AugmentedLagrangianNewton", "RootFinder"]


class RootFinder(Enum):
    """SciPy's root finders."""

    HYBR = "hybr"
    LEVENBERG_MARQUARDT = "lm"
    KRYLOV = "krylov"


def _check_penalty(penalty: float) -> None:
    if not (penalty > 0.0 and np.isfinite(penalty)):
        raise ProblemError(f"the penalty is {penalty}; give a positive number (in units of the local stiffness)")


def _too_concave(problem: DiscreteProblem) -> str | None:
    if problem.contact_points and any(np.isinf(alpha).any() for alpha in problem.law.weak_convexity):
        return "the law jumps down, so that its proximal map jumps as well; use newton"
    return None


def _safe_steps(system: CondensedProblem, penalty: float) -> Array:
    """Steps tau (m, 2) of the proximal map, with tau alpha <= 1/2 so that the map is single-valued."""
    tau = system.compliance / penalty
    for column, alpha in enumerate(system.law.weak_convexity):
        tau[:, column] = np.minimum(tau[:, column], 0.5 / np.maximum(alpha, 1e-300))
    return tau


@dataclass(frozen=True)
class AugmentedLagrangian(Solver):
    """The survey's augmented Lagrangian method (section 4.2) on the condensed unknowns (r, lambda).

    Solves ``A r - g + W (lambda + eps (r - p)) = 0``, ``r - p = 0`` with ``p = prox_{j/eps}(r + lambda/eps)``: the
    gradients of the Moreau-type function l_eps, valid for every law.  Each step is one call of SciPy's root finder,
    started from the last, with a smaller penalty.

    Parameters
    ----------
    penalty : float
        First penalty eps, in units of the stiffness of a contact point.
    decrease : float
        Factor by which it shrinks from step to step, down to ``smallest``.
    smallest : float
        Last penalty.
    root_finder : RootFinder
        ``fsolve``'s own (HYBR) by default.
    tolerance : float
        Relative tolerance of the unknowns that is asked of the root finder.
    """

    penalty: float = 10.0
    decrease: float = 0.5
    smallest: float = 0.1
    root_finder: RootFinder = RootFinder.HYBR
    tolerance: float = 1.5e-8
    name: ClassVar[str] = "augmented-lagrangian"
    default_steps: ClassVar[int] = 20

    def __post_init__(self) -> None:
        check_numbers(self)
        _check_penalty(self.penalty)
        _check_penalty(self.smallest)
        if not 0.0 < self.decrease <= 1.0:
            raise ProblemError(f"the factor that decreases the penalty is {self.decrease}; it must be in (0, 1]")

    def refuse(self, problem: DiscreteProblem) -> str | None:
        return _too_concave(problem)

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        lam = system.law.nearest_multiplier(start.r, start.lam)
        return replace(start, lam=lam, memory=(self.penalty, np.inf, 0))

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        penalty, last, idle = state.memory
        count = 0
        free = system.free
        m, d = system.shape
        tau = _safe_steps(system, penalty)
        rows = 1.0 / np.sqrt(system.diagonal.ravel()[free])
        columns = np.repeat(system.weights, d)[free]
        length, pressure = system.length_scale, system.pressure_scale
        steps = spread(tau, d)
        force_scale = length / float(np.median(rows))

        def split(x: Array) -> tuple[Array, Array]:
            r = system.fixed.copy()
            lam = np.zeros((m, d))
            r.ravel()[free] = length * x[: free.size]
            lam.ravel()[free] = pressure * x[free.size :]
            return r, lam

        def gradient(x: Array) -> Array:
            nonlocal count
            count += 1
            if count % 20 == 0:
                budget.check()
            r, lam = split(x)
            p = prox(system.law, r + steps * lam, tau)
            along = lam + (r - p) / steps
            first = -system.out_of_balance(r).ravel()[free] + columns * along.ravel()[free]
            return np.concatenate([rows * first / force_scale, (r - p).ravel()[free] / length])

        x0 = np.concatenate([state.r.ravel()[free] / length, state.lam.ravel()[free] / pressure])
        if free.size == 0:
            return replace(state, ended=Status.CONVERGED)
        with IMPORTS:
            from scipy.optimize import root

        options = {"xtol": self.tolerance} if self.root_finder is not RootFinder.KRYLOV else {"fatol": self.tolerance}
        zero = root(gradient, x0, method=self.root_finder.value, options=options)
        r, lam = split(np.asarray(zero.x))
        off = system.residual(r, lam)
        penalty = max(self.smallest, self.decrease * penalty)
        evaluations = state.evaluations + count
        if off.below(0.0, 1e-9):
            return State(r, lam, evaluations, memory=(penalty, off.total, 0))
        idle = idle + 1 if off.total > 0.5 * last else 0
        ended = Status.INACCURATE if idle >= self.patience else None
        # The root finder is stuck between pieces: move on by steps that lower the energy, and start again from there.
        r = lower_energy(system, system.start(r), 10)
        lam = system.law.nearest_multiplier(r, system.multiplier(r))
        return State(r, lam, evaluations, ended, memory=(penalty, min(off.total, last), idle))


@dataclass(frozen=True)
class AugmentedLagrangianNewton(Solver):
    """Semismooth Newton form of the augmented Lagrangian method, on all unknowns with sparse linear algebra.

    Each step linearises ``K u + B'W lambda = f``, ``r = prox(r + tau lambda)`` with the generalised derivative of the
    proximal map and solves for (u, lambda) by one sparse factorisation.  The step is halved while the residual of
    this system grows.

    Parameters
    ----------
    penalty : float
        1/tau in units of the stiffness of a contact point.
    halvings : int
        How often a step may be halved.
    """

    penalty: float = 1.0
    halvings: int = 6
    name: ClassVar[str] = "augmented-lagrangian-newton"
    default_steps: ClassVar[int] = 60

    def __post_init__(self) -> None:
        check_numbers(self)
        _check_penalty(self.penalty)

    def refuse(self, problem: DiscreteProblem) -> str | None:
        return _too_concave(problem)

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        lam = system.law.nearest_multiplier(start.r, start.lam)
        return replace(start, lam=lam, memory=system.unknowns(start.r))

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        problem = system.problem
        m, d = system.shape
        u = state.memory
        tau = _safe_steps(system, self.penalty)
        steps = spread(tau, d)
        free = system.free
        B = problem.contact.trace[free]
        stiffness = (np.repeat(problem.contact.weights, d) / steps.ravel())[free]

        def out_of_balance(v: Array, lam: Array) -> tuple[Array, Array]:
            first = problem.load - problem.stiffness @ v - problem.contact_force(np.where(system.active, lam, 0.0))
            r = problem.local(v)
            second = r - prox(problem.law, r + steps * lam, tau)
            return first, stiffness * second.ravel()[free]

        first, second = out_of_balance(u, state.lam)
        jacobian = prox_jacobian(problem.law, problem.local(u) + steps * state.lam, tau)
        pull = sp.csr_array(sp.block_diag(list(jacobian), format="csr"))[free][:, free]
        stay = sp.eye_array(free.size) - pull
        # The law's rows are multiplied by W/tau and the unknown is tau dlambda: every entry is a stiffness.
        scale = sp.diags_array(stiffness)
        matrix = sp.csc_array(sp.block_array([[problem.stiffness, B.T @ scale], [scale @ stay @ B, -(scale @ pull)]]))
        rhs = np.concatenate([first, -second])
        try:
            step = spla.splu(matrix, permc_spec="MMD_AT_PLUS_A").solve(rhs)
        except RuntimeError:
            step = np.full(rhs.size, np.inf)
        far = 1e6 * system.length_scale
        if not np.abs(step[: u.size]).max(initial=0.0) <= far:
            # No contact holds the body at this point, or not enough of it: let the energy fall until some does.
            r = lower_energy(system, system.start(problem.local(u)), 20)
            lam = problem.law.nearest_multiplier(r, system.multiplier(r))
            return State(r, lam, state.evaluations + 20, memory=system.unknowns(r))
        du = step[: u.size]
        dlam = np.zeros((m, d))
        dlam.ravel()[free] = step[u.size :] / steps.ravel()[free]

        def merit(pair: tuple[Array, Array]) -> float:
            return float(np.hypot(np.linalg.norm(pair[0]), np.linalg.norm(pair[1])))

        now = merit((first, second))
        length, best = 1.0, (np.inf, 1.0)
        evaluations = state.evaluations + 1
        for _ in range(self.halvings + 1):
            budget.check()
            evaluations += 1
            trial = merit(out_of_balance(u + length * du, state.lam + length * dlam))
            best = min(best, (trial, length))
            if trial < now:
                break
            length *= 0.5
        length = best[1]
        u = u + length * du
        lam = np.where(system.active, state.lam + length * dlam, 0.0)
        local = prox(problem.law, problem.local(u) + steps * lam, tau)
        local = np.where(system.active, local, system.fixed)
        lam = np.where(system.active, lam, problem.law.nearest_multiplier(local, system.multiplier(local)))
        return State(local, lam, evaluations, memory=u)
