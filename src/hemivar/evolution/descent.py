"""Gradient flow in the energy norm: from a displacement down to a minimiser, without a leap over a barrier."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import SOLVED
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.bulk import Bulk, Quadratic
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual, residual
from hemivar.errors import ProblemError
from hemivar.evolution.discrete import StepMatrices
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import frozen_at, splits
from hemivar.linear.definite import REPEATED
from hemivar.solvers import Controls, FixedPoint, NonsmoothMultigrid, Solution, Solver, Status, solve
from hemivar.solvers.base import State
from hemivar.solvers.loop import finish
from hemivar.solvers.status import STOPPED, check_interrupt
from hemivar.systems.body import Body
from hemivar.systems.chain import Chain, chain_of
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.workspace import Workspace

__all__ = [
    "AWAY",
    "FLOW_STEPS",
    "TIGHT",
    "DescentSolver",
    "Slowed",
    "bottom",
    "gradient_flow",
    "regularising_viscosity",
    "slowed",
]

#: Least resistance to a jump in units of the stiffness.
_LEAST = 0.05
#: Steps of a jump at most.
FLOW_STEPS = 2000
#: Rounding of a point on a segment, as a part of a typical displacement, and of the solution of Newton's equation on
#: pieces of laws, as one of the load: a thousand operations, each exact to 1.1e-16.
_ROUNDING = 1e-13
#: Tolerance of the steps of a jump as a part of that of the whole.
TIGHT = 1e-3
#: Part of penetrations and slips by which a step of a jump that crawls goes on at most.
_ONWARD = 0.01
#: Sizes of the body from its place at which nothing holds one that still falls.
AWAY = 100.0


class _Backoff:
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


def regularising_viscosity(convexity_defect: float) -> float:
    """The viscosity, in units of the stiffness, with which there is one solution; ``convexity_defect`` is c - 1."""
    if not math.isfinite(convexity_defect):
        raise ProblemError(
            "a contact law drops discontinuously (alpha is infinite), so a step may have several solutions; give its "
            "drop a slope, as Softening and Adhesive(softening=...) do"
        )
    return 1.1 * convexity_defect + _LEAST


@dataclass(frozen=True, eq=False)
class Slowed:
    """One step of a body against a resistance that leaves it one solution."""

    #: With the stiffness of body and resistance.
    problem: DiscreteProblem
    #: In units of the stiffness.
    resistance: float
    #: The resistance where the body has free motions, which its own stiffness would not resist: of the contact points.
    contact: sp.csr_array | None = None  # (n, n)
    #: Of its springs, force per area and length.
    springs: float = 0.0

    def on_contact(self, system: CondensedProblem) -> tuple[Array, float]:
        """The norm (m d, m d) of the resistance on the contact points of the condensed body, and how much of it there
        is."""
        if self.contact is None:
            return system.matrix, self.resistance
        spring = self.springs * np.repeat(system.weights, system.shape[1])
        return np.diag(np.where(system.active.ravel(), spring, 0.0)), 1.0

    def drag(self, body: Bulk, u: Array) -> Array:
        """Force (n,) that moves the resistance to u (n,)."""
        return self.resistance * body.gradient(u) if self.contact is None else np.asarray(self.contact @ u)


def slowed(bodies: StepMatrices, problem: DiscreteProblem, convexity_defect: float) -> Slowed:
    """The step of a problem with the viscosity that it needs; ``convexity_defect`` is c - 1, infinite with free
    motions.
    """
    steepest = math.inf
    if not math.isfinite(convexity_defect):
        law = frozen_at(problem.law, np.zeros((problem.contact_points, problem.contact.components)))
        steepest = max(float(np.max(alpha, initial=0.0)) for alpha in law.weak_convexity)
    if not math.isfinite(steepest):
        resistance = regularising_viscosity(convexity_defect)
        return Slowed(bodies.slower(problem, resistance), resistance)
    if not isinstance(problem.bulk, Quadratic):
        raise ProblemError(
            "the stiffness of the nonlinear body has no known lower bound, or only a softening foundation holds the "
            "body; add a support, or take a material whose stress always grows"
        )
    springs = (1.0 + _LEAST) * steepest
    slow, contact = bodies.on_its_foundation(problem, springs)
    return Slowed(slow, math.inf, contact, springs)


def bottom(
    chain: Chain, problem: DiscreteProblem, theta: Array, segment: IntArray, controls: Controls, workspace: Workspace
) -> Solution | None:
    """The minimiser on the segments on which a place lies: nothing is crossed on the way; None if there is none.

    ``theta`` is (n,); ``segment`` is (n,).
    """
    system = workspace.condensed(problem)
    if not chain.stable(theta, segment):
        return None
    minimiser = chain.correct(theta, segment, system.load[system.free])
    if minimiser is None or not chain.inside(minimiser, segment, _ROUNDING * chain.length).all():
        return None
    if not chain.stable(minimiser, segment):
        return None
    r, lam = chain.local(minimiser, segment)
    u, residuals = system.recover(r, lam)
    if not residuals[0].below(controls.atol, controls.rtol):
        return None
    return Solution(problem, u, lam, Status.CONVERGED, residuals[0], "nonsmooth-newton", 1)


@dataclass(frozen=True, eq=False)
class DescentSolver:
    """How the problems of a descent are solved."""

    solver: Solver | None
    workspace: Workspace

    @property
    def multigrid(self) -> NonsmoothMultigrid:
        """The method on levels."""
        inner = self.solver.inner if isinstance(self.solver, FixedPoint) else self.solver
        return inner if isinstance(inner, NonsmoothMultigrid) else NonsmoothMultigrid()

    def solved(self, problem: DiscreteProblem, u: Array, controls: Controls) -> Solution:
        """The solution of a problem from u (n,)."""
        solution = solve(problem, self.solver, controls, initial=u, workspace=self.workspace)
        check_interrupt(solution.status)
        return solution

    def on_levels(self, problem: DiscreteProblem) -> Body | None:
        """The body of a problem as multigrid has it; None where it treats it not."""
        if not isinstance(problem.bulk, Quadratic) or self.multigrid.refuse(problem) is not None:
            return None
        return self.multigrid.prepare(problem, self.workspace)


def gradient_flow(
    problem: DiscreteProblem,
    slowed: Slowed,
    u: Array,
    by: DescentSolver,
    controls: Controls,
    chain: Chain | None = None,
) -> Solution:
    """The equilibrium that is reached from u (n,): steps against a resistance that leaves each of them one solution."""
    load, slow, bulk, vectors = problem.load, slowed.problem, problem.bulk, problem.vectors
    body = bulk.resisting() if isinstance(bulk, Potential) else bulk
    dependent = bool(vectors.largest(float(problem.law.state_dependent))[0])
    tight = replace(controls, rtol=TIGHT * controls.rtol, atol=TIGHT * controls.atol)
    last: IntArray | None = None
    looks, solved = _Backoff(), u
    for _ in range(FLOW_STEPS):
        start, before, here = u, problem.local(u), load + slowed.drag(body, u)
        solution = by.solved(slow.under(here), u, tight)
        u = solution.unknowns
        # What a leap onward leaves out of balance inside the body is no part of the way of a body with free motions.
        increment, solved = u - (start if slowed.contact is None else solved), u
        off = residual(problem, u, solution.multiplier)
        if off.below(controls.atol, controls.rtol) and solution.status not in STOPPED:
            return replace(solution, problem=problem, residual=off, status=Status.CONVERGED)
        if not _leads_on(solution, controls):
            return replace(solution, problem=problem, residual=off)
        if slowed.contact is not None and _endless(problem, u, increment):
            return replace(solution, problem=problem, residual=off, status=Status.NOT_CARRIED)
        known = dependent or not splits(problem.law) or problem.contact.components > 2
        if chain is None and not known and by.workspace.condenses(slow):
            system = by.workspace.condensed(problem)
            chain = chain_of(system) if system.free.size <= REPEATED else None
        if chain is not None:
            theta, segment = chain.nearest(solution.local, solution.multiplier)
            if last is not None and np.array_equal(segment, last):
                there = bottom(chain, problem, theta, segment, controls, by.workspace)
                if there is not None:
                    return there
            last = segment
            u = _onward(problem, u, increment)
            continue
        after = problem.local(u)
        law = problem.law.frozen(after, solution.multiplier)
        bent = bool((np.linalg.eigvalsh(law.linearise(after).hessian) < 0.0).any())
        softens, leaves = vectors.largest(float(bent), float(_leaves(law, before, after))).tolist()
        if softens and not dependent:
            if looks.due(not leaves):
                minimiser = _on_pieces(problem, u, by, controls)
                if minimiser is not None:
                    return minimiser
        elif looks.due(not leaves) if dependent else not leaves:
            # On pieces where all laws harden there is no barrier: straight to the bottom, if it lies there.
            there = by.solved(problem, u, controls)
            stays = not vectors.largest(float(_leaves(law, after, there.local)))[0]
            if _leads_on(there, controls) and stays:
                return there
        u = _onward(problem, u, increment)
    return replace(solution, problem=problem, residual=off, status=Status.STALLED)


def _leaves(law: VectorLaw, before: Array, after: Array) -> bool:
    """Whether a contact point of this process is on another piece of its law than before."""
    return not np.array_equal(law.clamp(before, after), after)


def _leads_on(solution: Solution, controls: Controls) -> bool:
    """Whether a solve to the tight tolerance leads on: it has converged, or ended by itself below that of the step."""
    if solution.status is Status.CONVERGED:
        return True
    return solution.status not in STOPPED and solution.residual.below(controls.atol, controls.rtol)


def _further(problem: DiscreteProblem, u: Array, increment: Array) -> tuple[Callable[[float], bool], float] | None:
    """Whether the energy goes on to fall so many times the last step further, on the same pieces of all laws; and the
    steps that are a small part of where the body is. None where contact points do not move, or leave their kinks."""
    r, bulk, vectors = problem.local(u), problem.bulk, problem.vectors
    slip = r - problem.local(u - increment)
    size, far = vectors.largest(float(np.abs(slip).max(initial=0.0)), float(np.abs(r).max(initial=0.0))).tolist()
    at_kink = ~problem.law.linearise(r).smooth
    at_kink = np.column_stack([at_kink[:, :1], np.repeat(at_kink[:, 1:], slip.shape[1] - 1, axis=1)])
    moves = float(np.abs(slip[at_kink]).max(initial=0.0))
    if not size > 0.0 or vectors.largest(moves)[0] > SOLVED * size:
        return None
    slip = np.where(at_kink, 0.0, slip)
    linear = not isinstance(bulk, Potential)
    pull = -float(increment @ problem.out_of_balance(u))
    bend = float(increment @ bulk.gradient(increment)) if linear else 0.0
    weights = problem.contact.weights[:, None]

    def against(times: float) -> float:
        if linear:
            return pull + times * bend
        return -float(increment @ problem.out_of_balance(u + times * increment))

    def falls(times: float) -> bool:
        there = r + times * slip
        if vectors.largest(float(_leaves(problem.law, r, there)))[0]:
            return False
        pushed = weights * problem.law.linearise(there).gradient
        return bool(vectors.total(against(times) + float((pushed * slip).sum()))[0] < 0.0)

    return falls, _ONWARD * far / size


def _onward(problem: DiscreteProblem, u: Array, increment: Array) -> Array:
    """Further along the last step, where steps crawl, as they do beside the end of a path of equilibria (n,).

    As far as the energy goes on to fall, on the same pieces of all laws, so that no barrier is crossed.
    """
    dependent = problem.vectors.largest(float(problem.law.state_dependent))[0]
    further = None if dependent else _further(problem, u, increment)
    if further is None:
        return u
    (falls, most), times = further, 0.0
    while max(2.0 * times, 1.0) <= most and falls(max(2.0 * times, 1.0)):
        times = max(2.0 * times, 1.0)
    return u + times * increment


def _endless(problem: DiscreteProblem, u: Array, increment: Array) -> bool:
    """Whether the energy still falls where the last step leads on to, many times the size of the body away, on the same
    pieces of all laws."""
    further = None if problem.law.state_dependent or problem.field is None else _further(problem, u, increment)
    if further is None or problem.field is None:
        return False
    step = float(np.abs(problem.contact.trace @ increment).max(initial=0.0))
    return step > 0.0 and further[0](AWAY * float(np.ptp(problem.field.nodes, axis=0).max()) / step)


def _on_pieces(problem: DiscreteProblem, u: Array, by: DescentSolver, controls: Controls) -> Solution | None:
    """The bottom of the pieces on which a place lies, where laws that soften leave the body stable there."""
    method, body = by.multigrid, by.on_levels(problem)
    minimiser = None if body is None else _minimiser_on_pieces(method, body, u, controls)
    if minimiser is None:
        return None
    x, multiplier, off = minimiser
    return Solution(problem, x, multiplier, Status.CONVERGED, off, method.name, 1)


def _minimiser_on_pieces(
    method: NonsmoothMultigrid, body: Body, u: Array, controls: Controls
) -> tuple[Array, Array, Residual] | None:
    """The bottom of the pieces on which a place lies, with its multiplier and residual; None if there is none there.

    ``u`` is (n,).
    """
    x = replace(method, tolerance=_ROUNDING).on_pieces(body, u)
    if x is None:
        return None
    x, multiplier, off, status = finish(body, State(x, body.multiplier(x)), Status.INACCURATE, controls)
    return (x, multiplier, off) if status is Status.CONVERGED else None
