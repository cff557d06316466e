"""Primal-dual active set strategy: the survey's sets, one linear problem for each guess of the sets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy.linalg as la
import scipy.optimize as opt

from hemivar._typing import Array, IntArray
from hemivar.laws import Superpotential
from hemivar.mechanics.discrete import DiscreteProblem
from hemivar.solvers.base import Solver, State
from hemivar.solvers.condensed import CondensedProblem
from hemivar.solvers.controls import Budget
from hemivar.solvers.status import Status

__all__ = ["ExactInner", "InnerSolver", "NewtonKrylov", "PrimalDualActiveSet"]


class InnerSolver(ABC):
    """How the problem with given sets is solved."""

    #: Added to the name of the method.
    suffix: ClassVar[str] = ""

    @abstractmethod
    def solve(self, problem: FixedSets, start: Array, budget: Budget) -> tuple[Array, int]:
        """Local displacements (m d,) for the given sets, and the number of evaluations."""


@dataclass(frozen=True, eq=False)
class FixedSets:
    """The problem that is left when every component knows its piece or its knot.

    Attributes
    ----------
    system : CondensedProblem
    laws : tuple of Superpotential
        Scalar laws of the components: normal, and in 2D tangential.
    state : int array (m, d)
        Even entries 2 i: on piece i; odd entries 2 i + 1: at knot i.
    """

    system: CondensedProblem
    laws: tuple[Superpotential, ...]
    state: IntArray

    def held(self) -> tuple[IntArray, Array]:
        """Flat indices of the components that move, and all values with the held ones in place."""
        values = self.system.fixed.copy()
        moving = self.system.active.copy()
        for c, law in enumerate(self.laws):
            knots = np.broadcast_to(law.knots, (len(self.state), law.knots.shape[-1]))
            at_knot = self.state[:, c] % 2 == 1
            knot = np.take_along_axis(knots, np.minimum(self.state[:, c] // 2, knots.shape[1] - 1)[:, None], axis=1)
            hold = at_knot & self.system.active[:, c]
            values[hold, c] = knot[hold, 0]
            moving[:, c] &= ~at_knot
        return np.flatnonzero(moving.ravel()), values.ravel()

    def pressure(self, r: Array) -> tuple[Array, Array]:
        """Law derivative and curvature of every component on its own piece, continued beyond the piece."""
        r = r.reshape(self.state.shape)
        slope, curvature = np.zeros(r.shape), np.zeros(r.shape)
        for c, law in enumerate(self.laws):
            slope[:, c] = law.piece_derivative(self.state[:, c] // 2, r[:, c])
            curvature[:, c] = law.piece_curvature(self.state[:, c] // 2, r[:, c])
        return slope.ravel(), curvature.ravel()


@dataclass(frozen=True)
class ExactInner(InnerSolver):
    """Newton's method with a dense factorisation; one step where the pieces are linear."""

    max_steps: int = 30

    def solve(self, problem: FixedSets, start: Array, budget: Budget) -> tuple[Array, int]:
        system = problem.system
        free, r = problem.held()
        r[free] = start[free]
        weights = np.repeat(system.weights, system.shape[1])
        for used in range(1, self.max_steps + 1):
            budget.check()
            slope, curvature = problem.pressure(r)
            force = (system.force - system.matrix @ r - weights * slope)[free]
            H = system.matrix[np.ix_(free, free)]
            H[np.diag_indices_from(H)] += (weights * curvature)[free]
            step = _solve_symmetric(H, force)
            r[free] += step
            if np.abs(step).max(initial=0.0) <= 1e-13 * np.abs(r).max(initial=0.0):
                break
            if not curvature.any() and used == 2:
                break
        return r, used


@dataclass(frozen=True)
class NewtonKrylov(InnerSolver):
    """SciPy's ``newton_krylov`` on scaled unknowns, as in the survey.

    Parameters
    ----------
    tolerance : float
        Largest residual of a component, relative to the largest nodal load.
    """

    tolerance: float = 1e-10
    suffix: ClassVar[str] = "-krylov"

    def solve(self, problem: FixedSets, start: Array, budget: Budget) -> tuple[Array, int]:
        system = problem.system
        free, r = problem.held()
        if free.size == 0:
            return r, 0
        weights = np.repeat(system.weights, system.shape[1])
        length = system.length_scale
        precondition = 1.0 / np.sqrt(system.diagonal.ravel()[free])
        scale = float(np.abs(precondition * system.force[free]).max())
        scale = scale if scale > 0.0 else length
        count = 0

        def balance(x: Array) -> Array:
            nonlocal count
            count += 1
            if count % 50 == 0:
                budget.check()
            r[free] = length * precondition * x
            slope, _ = problem.pressure(r)
            return np.asarray(precondition * (system.matrix @ r - system.force + weights * slope)[free] / scale)

        x0 = start[free] / (length * precondition)
        try:
            x = opt.newton_krylov(balance, x0, f_tol=self.tolerance, maxiter=60)
        except opt.NoConvergence as error:
            x = np.asarray(error.args[0])
        except ValueError:  # SciPy's word for a Krylov space without a direction, as in a singular problem
            x = x0
        balance(np.asarray(x))
        return r.copy(), count


@dataclass(frozen=True)
class PrimalDualActiveSet(Solver):
    """The survey's active set strategy (section 4.3), with membership by the primal-dual variable.

    Every component knows the piece or the kink of the graph it is on.  The problem with these sets given is solved,
    then ``z = r + tau lambda`` tells each component where it belongs, and it moves there by at most one place: from
    open to rigid to penetrating, from stick to slip.  It starts open and sticking (resting on the foundation where
    only that holds the body).  A set that has been met before is a cycle, and is reported as one.

    Parameters
    ----------
    inner : InnerSolver
        Exact solution of the inner problem, or SciPy's Newton-Krylov as in the survey.
    sets_from_guess : bool
        Whether the first sets are those of the initial guess.  By default they are open and sticking whatever the
        guess, as in the survey, and the guess only starts the inner solver.
    """

    inner: InnerSolver = field(default_factory=ExactInner)
    sets_from_guess: bool = False
    default_steps: ClassVar[int] = 200

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name in tables."""
        return "active-set" + self.inner.suffix

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if problem.contact_points == 0:
            return None
        if problem.dim > 2:
            return (
                "its sets of sliding points are defined for one tangential direction (2D); "
                "use newton, or augmented-lagrangian-newton"
            )
        for alpha in problem.law.weak_convexity:
            if np.isinf(alpha).any():
                return "the law jumps down, so a kink has no place in the order of the sets; use newton"
        return None

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        laws = _component_laws(system)
        sets = _sets_of_start(system, laws, start.r if self.sets_from_guess else system.start())
        return replace(start, memory=(sets, frozenset([sets.tobytes()])))

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        laws = _component_laws(system)
        sets, seen = state.memory
        flat, used = self.inner.solve(FixedSets(system, laws, sets), state.r.ravel(), budget)
        r = flat.reshape(state.r.shape)
        evaluations = state.evaluations + used
        if not np.isfinite(r).all():
            return State(r, state.lam, evaluations, Status.NONFINITE, memory=state.memory)
        # On its piece a component carries what the piece says; at a knot what equilibrium asks for.
        slope, _ = FixedSets(system, laws, sets).pressure(r)
        on_piece = (sets % 2 == 0) & system.active
        lam = np.where(on_piece, slope.reshape(r.shape), system.multiplier(r))
        new = _move(system, laws, sets, r, lam)
        ended = None
        if np.array_equal(new, sets):
            ended = Status.CONVERGED
        elif new.tobytes() in seen:
            ended = Status.CYCLING
        return State(r, lam, evaluations, ended, memory=(new, seen | {new.tobytes()}))


def _component_laws(system: CondensedProblem) -> tuple[Superpotential, ...]:
    law = system.law
    return (law.normal,) if system.shape[1] == 1 else (law.normal, law.tangential)


def _sets_of_start(system: CondensedProblem, laws: tuple[Superpotential, ...], r: Array) -> IntArray:
    """Open and sticking where the start is at rest, otherwise the piece or knot that holds the start."""
    m, d = system.shape
    sets = np.zeros((m, d), dtype=np.int64)
    for c, law in enumerate(laws):
        knots = np.broadcast_to(law.knots, (m, law.knots.shape[-1]))
        at = r[:, c][:, None] == knots
        sets[:, c] = 2 * law.piece_of(r[:, c]) + at.any(axis=1)
        if c == 0:  # "open": the piece below the knot, where there is one
            closed = at.any(axis=1) & (law.domain.lower < r[:, 0])
            if not len(system.rigid_modes):  # a body that only its foundation holds starts on the foundation
                sets[:, 0] -= closed
    return sets


def _move(system: CondensedProblem, laws: tuple[Superpotential, ...], sets: IntArray, r: Array, lam: Array) -> IntArray:
    """Each component goes one place towards where ``z = r + tau lambda`` belongs."""
    new = sets.copy()
    for c, law in enumerate(laws):
        tau = system.compliance[:, c]
        alpha = np.broadcast_to(law.weak_convexity, tau.shape)
        tau = np.where(alpha > 0.0, np.minimum(tau, 0.5 / np.where(alpha > 0.0, alpha, 1.0)), tau)
        left, right = law.knot_slopes()
        z = (r[:, c] + tau * lam[:, c])[:, None]
        rounding = 1e-13 * (np.abs(r[:, c]) + tau * np.abs(lam[:, c]))[:, None]
        state = sets[:, c][:, None]
        place = np.arange(law.knots.shape[-1])[None, :] * 2 + 1
        # A component on the boundary of its set stays: thresholds give way by rounding on its own side.
        below = law.knots + tau[:, None] * left
        above = law.knots + tau[:, None] * right
        passed_below = np.where(state >= place, z > below - rounding, z > below + rounding)
        passed_above = np.where(state > place, z > above - rounding, z > above + rounding)
        target = passed_below.sum(axis=1) + passed_above.sum(axis=1)
        moved = sets[:, c] + np.sign(target - sets[:, c])
        new[:, c] = np.where(system.active[:, c], moved, sets[:, c])
    return new


def _solve_symmetric(H: Array, rhs: Array) -> Array:
    if H.size == 0:
        return np.zeros(0)
    try:
        return np.asarray(la.cho_solve(la.cho_factor(H), rhs))
    except la.LinAlgError:
        return np.asarray(la.lstsq(H, rhs)[0])
