"""The loop that every method shares."""

from __future__ import annotations

import time

import numpy as np
import scipy.linalg as la

from hemivar._typing import Array
from hemivar.errors import MethodError, ProblemError
from hemivar.mechanics.discrete import DiscreteProblem
from hemivar.mechanics.residual import residual
from hemivar.solvers.base import Solver, State
from hemivar.solvers.condensed import CondensedProblem, condense, depends_on_state
from hemivar.solvers.controls import Budget, Controls
from hemivar.solvers.fixed_point import FixedPoint
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import Status

__all__ = ["solve", "suited"]


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
        The method and its options; :class:`NonsmoothNewton` by default, inside a :class:`FixedPoint` where a bound
        of the law depends on the solution.
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
    if solver is None:
        solver = suited(NonsmoothNewton(), problem)
    controls = Controls() if controls is None else controls
    if depends_on_state(problem.law) and not solver.handles_state:
        raise MethodError(
            f"{solver.name} cannot solve this problem: a friction bound depends on the solution; "
            "wrap the method, FixedPoint(inner=...)"
        )
    why = solver.refuse(problem)
    if why is not None:
        raise MethodError(f"{solver.name} cannot solve this problem: {why}")
    if condensed is None:
        condensed = condense(problem)
    elif condensed.problem is not problem:
        raise ProblemError("the condensation given belongs to another problem; condense this one")
    _check_held(condensed)
    _check_coercive(condensed)
    began = time.perf_counter()
    budget = Budget(controls.max_time)
    start = _start(condensed, initial)
    state, status, history = iterate(solver, condensed, start, controls, budget)
    iterated = time.perf_counter()
    unknowns, found = condensed.recover(state.r, state.lam)
    multiplier = state.lam
    law = condensed.law_at(state.r, state.lam) if np.isfinite(state.r).all() else None
    if problem.contact_points and law is not None and np.isfinite(law.value(state.r)).all():
        # Rounding aside, a multiplier of the law itself: no pressure at all where the body has lifted.
        exact = np.where(condensed.active, law.nearest_multiplier(state.r, state.lam), state.lam)
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
        contraction=state.contraction,
    )


def suited(solver: Solver, problem: DiscreteProblem) -> Solver:
    """The method, inside a :class:`FixedPoint` where the law of the problem depends on the solution."""
    return FixedPoint(solver) if depends_on_state(problem.law) and not solver.handles_state else solver


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
    if depends_on_state(law) or not len(system.rigid_modes) or any((alpha > 0.0).any() for alpha in law.weak_convexity):
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


def _check_coercive(system: CondensedProblem) -> None:
    """Refuse laws that soften without end faster than the body is stiff: the energy has no lower bound then."""
    if system.free.size == 0:
        return
    m, d = system.shape
    law = system.law_at(system.start(), np.zeros(system.shape))  # the bound matters little far away
    laws = [law.normal] + [law.tangential] * (d - 1)
    ends = [
        np.stack([np.broadcast_to(law.asymptotic_curvature(sign), (m,)) for law in laws], axis=1)
        for sign in (1.0, -1.0)
    ]
    least = np.minimum(*ends)
    if not (least < 0.0).any():
        return
    weights = system.weights[:, None]
    stiffest = float(np.abs(system.matrix).max())
    softened = system.matrix + np.diag((weights * np.where(np.isfinite(least), least, 0.0)).ravel())
    values, vectors = la.eigh(softened[np.ix_(system.free, system.free)], subset_by_index=[0, 0])
    if values[0] >= -1e-12 * stiffest:
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
            name = laws[int(np.argmin(least[worst]))].name
            raise ProblemError(
                f"the energy has no lower bound: law '{name}' softens without end by {-least.min():.3g} per unit of "
                "displacement, faster than the body is stiff; end the softening, or take a stiffer body"
            )
