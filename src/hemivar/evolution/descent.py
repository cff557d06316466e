"""Downhill from a place without a leap over a barrier."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.branches.chain import Chain, chain_of
from hemivar.branches.state_chain import state_chain_of
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual, residual
from hemivar.errors import ProblemError
from hemivar.solvers import Controls, NonsmoothMultigrid, Solution, Solver, Status, solve
from hemivar.solvers.base import State
from hemivar.solvers.loop import finish
from hemivar.systems.body import Body
from hemivar.systems.workspace import Workspace

__all__ = ["CREEPS", "TIGHT", "Looks", "bottom", "bottom_of_pieces", "downhill", "resistance_against"]

#: Least resistance to a jump in units of the stiffness.
_LEAST = 0.05
#: Steps of a jump at most.
CREEPS = 2000
#: Components of contact points up to which the graph of the law is laid out: every step on it is a dense solve.
_LARGEST = 1500
#: Rounding of a place on a segment, as a part of a typical displacement.
_ROUNDING = 1e-13
#: Tolerance of the steps of a jump as a part of that of the whole.
TIGHT = 1e-3
#: Part of penetrations and slips by which a step of a jump that crawls goes on at most.
_ONWARD = 0.01
#: Part of the largest motion below which a point at a kink of its law rests there.
_RESTS = 1e-9
#: Of the solution of Newton's equation on the pieces of the laws, in terms of the load.
_EXACT = 1e-13


class Looks:
    """When to look at the bottom of the pieces of the laws: once all points stay on them, and then ever more rarely."""

    def __init__(self) -> None:
        self._wait = self._left = 1

    def due(self, stays: bool) -> bool:
        """Whether after this step; ``stays`` tells whether all points are on the pieces that they were on before it."""
        if not stays:
            self._wait = self._left = 1
            return False
        self._left -= 1
        if self._left:
            return False
        self._wait *= 2
        self._left = self._wait
        return True


def resistance_against(excess: float) -> float:
    """The resistance, in units of the stiffness, against which a problem has one solution; ``excess`` is c - 1.

    Raises
    ------
    ProblemError
        There is none, for a law falls at once.
    """
    if not math.isfinite(excess):
        raise ProblemError(
            "a contact law falls at once (its alpha is infinite), so that a step may have several solutions however "
            "stiff, viscous or heavy the body is; give its fall a slope, as Softening and Adhesive(softening=...) do"
        )
    return 1.1 * excess + _LEAST


def bottom(
    chain: Chain, problem: DiscreteProblem, theta: Array, segment: IntArray, controls: Controls, workspace: Workspace
) -> Solution | None:
    """The minimiser on the segments on which a place lies: nothing is crossed on the way; None if there is none.

    Parameters
    ----------
    chain : Chain
        Of the body and the law of the problem.
    problem : DiscreteProblem
    theta, segment : arrays (n,)
        The place on the graph of the law.
    controls : Controls
    workspace : Workspace
    """
    system = workspace.condensed(problem)
    if not chain.stable(theta, segment):
        return None
    found = chain.correct(theta, segment, system.force[system.free])
    if found is None or not chain.inside(found, segment, _ROUNDING * chain.length).all():
        return None
    if not chain.stable(found, segment):
        return None
    r, lam = chain.local(found, segment)
    u, residuals = system.recover(r, lam)
    if not residuals[0].below(controls.atol, controls.rtol):
        return None
    return Solution(problem, u, lam, Status.CONVERGED, residuals[0], "nonsmooth-newton", 1)


def downhill(
    problem: DiscreteProblem,
    slow: DiscreteProblem,
    resistance: float,
    u: Array,
    solver: Solver | None,
    controls: Controls,
    workspace: Workspace,
    chain: Chain | None = None,
) -> Solution:
    """The equilibrium that is reached from u (n,): steps against a resistance that leaves each of them one solution.

    Parameters
    ----------
    problem : DiscreteProblem
    slow : DiscreteProblem
        The same with the stiffness ``(1 + resistance) K``.
    resistance : float
        In units of the stiffness.
    u : array (n,)
    solver : Solver or None
    controls : Controls
    workspace : Workspace
    chain : Chain, optional
        The graph of the law at the contact points of the body; made here where the solver condenses the body.
    """
    K, load = problem.linear.stiffness, problem.linear.load
    tight = replace(controls, rtol=TIGHT * controls.rtol, atol=TIGHT * controls.atol)
    last: IntArray | None = None
    looks = Looks()
    for _ in range(CREEPS):
        start, before, here = u, problem.local(u), load + resistance * np.asarray(K @ u)
        solution = solve(slow.with_(load=here), solver, tight, initial=u, workspace=workspace)
        u = solution.unknowns
        off = residual(problem, u, solution.multiplier)
        if off.below(controls.atol, controls.rtol) or solution.status is not Status.CONVERGED:
            return replace(solution, problem=problem, residual=off)
        if chain is None and workspace.condenses(slow) and problem.contact.components <= 2:
            system = workspace.condensed(problem)
            laid_out = state_chain_of if problem.law.state_dependent else chain_of
            chain = laid_out(system) if system.free.size <= _LARGEST else None
        if chain is not None:
            theta, segment = chain.nearest(solution.local, solution.multiplier)
            if last is not None and np.array_equal(segment, last):
                there = bottom(chain, problem, theta, segment, controls, workspace)
                if there is not None:
                    return there
            last = segment
            u = _onward(problem, u, u - start)
            continue
        if problem.law.state_dependent:
            continue
        after = problem.local(u)
        softens = bool((np.linalg.eigvalsh(problem.law.linearise(after).hessian) < 0.0).any())
        stays = np.array_equal(problem.law.clamp(before, after), after)
        if softens:
            if looks.due(stays):
                found = _on_pieces(problem, u, solver, controls, workspace)
                if found is not None:
                    return found
        elif stays:
            # On pieces where all laws harden there is no barrier: straight to the bottom, if it lies there.
            there = solve(problem, solver, controls, initial=u, workspace=workspace)
            if np.array_equal(problem.law.clamp(after, there.local), there.local):
                return there
        u = _onward(problem, u, u - start)
    return replace(solution, problem=problem, residual=off, status=Status.STALLED)


def _onward(problem: DiscreteProblem, u: Array, way: Array) -> Array:
    """Further along the last step, where steps crawl, as they do beside the end of a path of equilibria (n,).

    As far as the energy goes on to fall, on the same pieces of all laws, so that no barrier is crossed.
    """
    if problem.law.state_dependent:
        return u
    r, K = problem.local(u), problem.linear.stiffness
    slip = r - problem.local(u - way)
    size = float(np.abs(slip).max(initial=0.0))
    held = ~problem.law.linearise(r).smooth
    held = np.column_stack([held[:, :1], np.repeat(held[:, 1:], slip.shape[1] - 1, axis=1)])
    if not size > 0.0 or (np.abs(slip[held]) > _RESTS * size).any():
        return u
    slip = np.where(held, 0.0, slip)
    pull, bend = float(way @ (K @ u - problem.linear.load)), float(way @ (K @ way))
    weights = problem.contact.weights[:, None]

    def falls(times: float) -> bool:
        there = r + times * slip
        if not np.array_equal(problem.law.clamp(r, there), there):
            return False
        pushed = weights * problem.law.linearise(there).gradient
        return pull + times * bend + float((pushed * slip).sum()) < 0.0

    most, times = _ONWARD * float(np.abs(r).max()) / size, 0.0
    while max(2.0 * times, 1.0) <= most and falls(max(2.0 * times, 1.0)):
        times = max(2.0 * times, 1.0)
    return u + times * way


def _on_pieces(
    problem: DiscreteProblem, u: Array, solver: Solver | None, controls: Controls, workspace: Workspace
) -> Solution | None:
    """The bottom of the pieces on which a place lies, where laws that soften leave the body stable there."""
    method = solver if isinstance(solver, NonsmoothMultigrid) else NonsmoothMultigrid()
    if method.refuse(problem) is not None:
        return None
    body = method.prepare(problem, workspace)
    found = bottom_of_pieces(method, body, u, controls)
    if found is None:
        return None
    x, multiplier, off = found
    return Solution(problem, x, multiplier, Status.CONVERGED, off, method.name, 1)


def bottom_of_pieces(
    method: NonsmoothMultigrid, body: Body, u: Array, controls: Controls
) -> tuple[Array, Array, Residual] | None:
    """The bottom of the pieces on which a place lies, with its multiplier and residual; None if there is none there.

    Parameters
    ----------
    method : NonsmoothMultigrid
    body : Body
        Under the load of the step.
    u : array (n,)
        The place.
    controls : Controls
    """
    x = replace(method, tolerance=_EXACT).on_pieces(body, u)
    if x is None:
        return None
    x, multiplier, off, status = finish(body, State(x, body.multiplier(x)), Status.INACCURATE, controls)
    return (x, multiplier, off) if status is Status.CONVERGED else None
