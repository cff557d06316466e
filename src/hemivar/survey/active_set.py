"""Primal-dual active set strategy: the survey's sets, one linear problem for each guess of the sets."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
import scipy.linalg as la

from hemivar.basics.arguments import expect
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.laws import Superpotential, separable
from hemivar.laws.minimisers import knot_forces
from hemivar.laws.scalar_graph import part_of
from hemivar.laws.vector_law import splits, spread
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget
from hemivar.solvers.status import Status
from hemivar.systems.condensed import CondensedProblem

__all__ = ["ExactInner", "InnerSolver", "NewtonKrylov", "PrimalDualActiveSet"]


class InnerSolver(ABC):
    """How the problem with given sets is solved."""

    #: Added to the name of the method.
    suffix: ClassVar[str] = ""

    @abstractmethod
    def solve(self, problem: FixedSets, start: Array, budget: Budget) -> tuple[Array, int]:
        """Local displacements (m d,) for the given sets, and the number of evaluations."""

    @abstractmethod
    def solve_radial(self, problem: RadialSets, budget: Budget) -> tuple[Array, int]:
        """The same in three dimensions, where the direction of the slip is unknown as well."""


@dataclass(frozen=True, eq=False)
class FixedSets:
    """The problem that is left when every component knows its piece or its knot."""

    system: CondensedProblem
    laws: tuple[Superpotential, ...]  # scalar laws of the components: normal, and in 2D tangential
    state: IntArray  # (m, d): even entries 2 i: on piece i; odd entries 2 i + 1: at knot i

    def at_knots(self) -> tuple[IntArray, Array]:
        """Flat indices of the components that move, and all values with those at knots or supports in place."""
        values = self.system.fixed.copy()
        moving = self.system.active.copy()
        for c, law in enumerate(self.laws):
            at_knot = self.state[:, c] % 2 == 1
            active = at_knot & self.system.active[:, c]
            values[active, c] = _knot(law, self.state[:, c])[active]
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


@dataclass(frozen=True, eq=False)
class RadialSets:
    """The problem with given sets in three dimensions, where the slip and its friction are vectors.

    The normal part is as in the plane.  The tangential part is at rest; or on a piece, where the friction has the size
    that the law gives for the size of the slip, and the direction of the primal-dual variable ``z = r + tau lambda``;
    or at another knot, where the slip has that size and the same direction.
    """

    system: CondensedProblem
    laws: tuple[Superpotential, ...]  # normal, and tangential as a function of the size of the slip
    state: IntArray  # (m, 2): as in :class:`FixedSets`, for the normal part and the size of the slip
    steps: Array  # (m, 2): tau
    r: Array  # (m, d): where the step starts
    lam: Array  # (m, d)

    def free(self) -> IntArray:
        """Flat indices of the components that move."""
        moving = np.stack([~self._at_knot(0), ~self._at_knot(1) | (self._knot(1) != 0.0)], axis=1)
        return np.flatnonzero((self.system.active & (spread(1.0 * moving, self.r.shape[1]) > 0.0)).ravel())

    def at_knots(self) -> Array:
        """A local displacement (m, d) with the components that do not move in place."""
        r = np.zeros(self.r.shape)
        r[:, 0] = np.where(self._at_knot(0), self._knot(0), 0.0)
        return np.where(self.system.active, r, self.system.fixed)

    def rows(self) -> tuple[Array, Array, Array]:
        """``R, L (m, d, d)`` and ``c (m, d)`` of ``R r + L tau lambda = c``: the rules of the sets, linearised.

        On a piece the rule is ``|z| lambda = j'(|r|) z``, in which the friction of the last step is cut back to j', as
        Hueber, Stadler and Wohlmuth (2008) do; at a knot s it is ``|z| r = s z``.
        """
        m, d = self.r.shape
        R, L, c = np.zeros((m, d, d)), np.zeros((m, d, d)), np.zeros((m, d))
        tau, law = self.steps[:, 0], self.laws[0]
        piece, at = self.state[:, 0] // 2, self._at_knot(0)
        curvature = tau * law.piece_curvature(piece, self.r[:, 0])
        slope = tau * law.piece_derivative(piece, self.r[:, 0])
        R[:, 0, 0] = np.where(at, 1.0, -curvature)
        L[:, 0, 0] = np.where(at, 0.0, 1.0)
        c[:, 0] = np.where(at, self._knot(0), slope - curvature * self.r[:, 0])
        tau, law = self.steps[:, 1], self.laws[1]
        piece, at = self.state[:, 1] // 2, self._at_knot(1)
        slip, friction = self.r[:, 1:], tau[:, None] * self.lam[:, 1:]
        z = slip + friction
        length, n = _polar(z)
        size, m_ = _polar(slip)
        m_ = np.where(size[:, None] > 0.0, m_, n)
        bound = np.where(at, self._knot(1), tau * law.piece_derivative(piece, size))
        given = _cut(np.where(at[:, None], slip, friction), bound)
        scale = np.maximum(np.maximum(length, np.abs(bound)), np.finfo(float).tiny)
        part, turned = bound / scale, np.einsum("mi,mj->mij", given / scale[:, None], n)
        unit = np.eye(d - 1)
        own = (1.0 - part)[:, None, None] * unit + turned
        other = turned - part[:, None, None] * unit
        bend = np.where(at, 0.0, tau * law.piece_curvature(piece, size))[:, None] * z / scale[:, None]
        R[:, 1:, 1:] = np.where(at[:, None, None], own, other) - np.einsum("mi,mj->mij", bend, m_)
        L[:, 1:, 1:] = np.where(at[:, None, None], other, own)
        c[:, 1:] = given * (length / scale)[:, None] - bend * size[:, None]
        return R, L, c

    def gap(self, r: Array) -> Array:
        """How far ``r (m, d)`` with the multiplier in equilibrium is from the rules of the sets, a length."""
        friction = spread(self.steps, r.shape[1]) * self.system.multiplier(r)
        out = np.empty(r.shape)
        law, piece = self.laws[0], self.state[:, 0] // 2
        out[:, 0] = friction[:, 0] - self.steps[:, 0] * law.piece_derivative(piece, r[:, 0])
        law, piece = self.laws[1], self.state[:, 1] // 2
        size, _ = _polar(r[:, 1:])
        _, n = _polar(r[:, 1:] + friction[:, 1:])
        bound = self.steps[:, 1] * law.piece_derivative(piece, size)
        on_piece, on_knot = friction[:, 1:] - bound[:, None] * n, r[:, 1:] - self._knot(1)[:, None] * n
        out[:, 1:] = np.where(self._at_knot(1)[:, None], on_knot, on_piece)
        return out

    def _at_knot(self, part: int) -> BoolArray:
        return np.asarray(self.state[:, part] % 2 == 1)

    def _knot(self, part: int) -> Array:
        return _knot(self.laws[part], self.state[:, part])


@dataclass(frozen=True)
class ExactInner(InnerSolver):
    """Newton's method with a dense factorisation; one step where the pieces are linear, and one in 3D.

    Parameters
    ----------
    max_steps : int
        Limit of the steps of Newton's method.
    """

    max_steps: int = 30

    def solve(self, problem: FixedSets, start: Array, budget: Budget) -> tuple[Array, int]:
        system = problem.system
        free, r = problem.at_knots()
        r[free] = start[free]
        weights = np.repeat(system.weights, system.shape[1])
        for used in range(1, self.max_steps + 1):
            budget.check()
            slope, curvature = problem.pressure(r)
            force = (system.load - system.matrix @ r - weights * slope)[free]
            H = system.matrix[np.ix_(free, free)]
            H[np.diag_indices_from(H)] += (weights * curvature)[free]
            step = _solve(H, force, symmetric=True)
            r[free] += step
            if np.abs(step).max(initial=0.0) <= 1e-13 * np.abs(r).max(initial=0.0):
                break
            if not curvature.any() and used == 2:
                break
        return r, used

    def solve_radial(self, problem: RadialSets, budget: Budget) -> tuple[Array, int]:
        system = problem.system
        m, d = system.shape
        R, L, c = problem.rows()
        # lambda = W^-1 (g - A r)
        compliance = (spread(problem.steps, d) / system.weights[:, None]).ravel()
        scaled = (compliance[:, None] * system.matrix).reshape(m, d, m * d)
        matrix = -np.einsum("mij,mjk->mik", L, scaled)
        index = np.arange(m)
        for component in range(d):
            matrix[index, :, d * index + component] += R[:, :, component]
        matrix = matrix.reshape(m * d, m * d)
        rhs = (c - np.einsum("mij,mj->mi", L, (compliance * system.load).reshape(m, d))).ravel()
        budget.check()
        free, r = problem.free(), problem.at_knots().ravel()
        r[free] = _solve(matrix[np.ix_(free, free)], (rhs - matrix @ r)[free])
        return r, 1


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
        free, r = problem.at_knots()
        if free.size == 0:
            return r, 0
        weights = np.repeat(system.weights, system.shape[1])
        length = system.length_scale
        precondition = 1.0 / np.sqrt(system.diagonal.ravel()[free])
        scale = float(np.abs(precondition * system.load[free]).max())
        scale = scale if scale > 0.0 else length
        count = 0

        def balance(x: Array) -> Array:
            nonlocal count
            count += 1
            if count % 50 == 0:
                budget.check()
            r[free] = length * precondition * x
            slope, _ = problem.pressure(r)
            return np.asarray(precondition * (system.matrix @ r - system.load + weights * slope)[free] / scale)

        balance(self._root(balance, start[free] / (length * precondition)))
        return r.copy(), count

    def solve_radial(self, problem: RadialSets, budget: Budget) -> tuple[Array, int]:
        system = problem.system
        free, r = problem.free(), problem.at_knots().ravel()
        if free.size == 0:
            return r, 0
        length = system.length_scale
        count = 0

        def gap(x: Array) -> Array:
            nonlocal count
            count += 1
            if count % 50 == 0:
                budget.check()
            r[free] = length * x
            return np.asarray(problem.gap(r.reshape(system.shape)).ravel()[free] / length)

        gap(self._root(gap, problem.r.ravel()[free] / length))
        return r.copy(), count

    def _root(self, function: Callable[[Array], Array], start: Array) -> Array:
        """Where a function is zero, or as near to that as SciPy comes."""
        with IMPORTS:
            from scipy.optimize import NoConvergence, newton_krylov
        try:
            return np.asarray(newton_krylov(function, start, f_tol=self.tolerance, maxiter=60))
        except NoConvergence as error:
            return np.asarray(error.args[0])
        except ValueError:  # SciPy's word for a Krylov space without a direction, as in a singular problem
            return start


@dataclass(frozen=True)
class PrimalDualActiveSet(Solver):
    """The survey's active set strategy (section 4.3), with membership by the primal-dual variable.

    Every component knows the piece or the kink of the graph it is on.  The problem with these sets given is solved,
    then ``z = r + tau lambda`` tells each component where it belongs, and it moves there by at most one place: from
    open to rigid to penetrating, from stick to slip.  It starts open and sticking (resting on the foundation where
    only that holds the body).  A set that has been met before is a cycle, and is reported as one.

    In three dimensions the sets are those of the normal part and of the size of the slip, which points along the
    tangential part of ``z``: stick where ``|z_tau| <= tau h``.  The direction turns from step to step, so that a set
    may come back on the way to the solution; it counts as a cycle if the residual is not smaller by then.

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

    def __post_init__(self) -> None:
        expect(self.inner, InnerSolver, "PrimalDualActiveSet.inner", "pass ExactInner() or NewtonKrylov()")

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name in tables."""
        return "active-set" + self.inner.suffix

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if problem.contact_points and any(np.isinf(alpha).any() for alpha in problem.law.weak_convexity):
            return "the law jumps down, so its kinks cannot be ordered into sets; use newton"
        if not splits(problem.law):
            return f"{problem.law.not_separable}, which the sets do not know; use newton"
        return None

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        laws = separable(system.law, self.name).scalar_laws(system.shape[1])
        sets = _sets_of_start(system, laws, _parts(start.r if self.sets_from_guess else system.start()))
        if system.shape[1] > 2:
            return replace(start, memory=(sets, {}))
        return replace(start, memory=(sets, frozenset([sets.tobytes()])))

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        if system.shape[1] > 2:
            return self._radial_step(system, state, budget)
        laws = separable(system.law, self.name).scalar_laws(system.shape[1])
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

    def _radial_step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        laws = separable(system.law, self.name).scalar_laws(system.shape[1])
        sets, seen = state.memory
        tau = np.stack([_step_length(system, law, c) for c, law in enumerate(laws)], axis=1)
        flat, used = self.inner.solve_radial(RadialSets(system, laws, sets, tau, state.r, state.lam), budget)
        r = flat.reshape(state.r.shape)
        evaluations = state.evaluations + used
        if not np.isfinite(r).all():
            return State(r, state.lam, evaluations, Status.NONFINITE, memory=state.memory)
        lam = system.multiplier(r)
        slope = laws[0].piece_derivative(sets[:, 0] // 2, r[:, 0])
        lam[:, 0] = np.where((sets[:, 0] % 2 == 0) & system.active[:, 0], slope, lam[:, 0])
        steps = spread(tau, system.shape[1])
        before, z = state.r + steps * state.lam, r + steps * lam
        size = _parts(z)
        # A sliding point whose z has turned round goes to rest, as one whose slip changes sign does in the plane.
        back = np.einsum("mi,mi->m", before[:, 1:], z[:, 1:]) < 0.0
        size[back & (sets[:, 1] > _rest(laws[1], len(r))), 1] *= -1.0
        new = _move(system, laws, sets, np.zeros(size.shape), size / tau)
        off = system.residual(r, lam).total
        known = seen.get(new.tobytes(), np.inf)
        ended = Status.CYCLING if not np.array_equal(new, sets) and off >= known else None
        return State(r, lam, evaluations, ended, memory=(new, {**seen, new.tobytes(): min(off, known)}))


def _parts(r: Array) -> Array:
    """Normal component and slip; in three dimensions the size of the slip."""
    return r if r.shape[1] <= 2 else np.stack([r[:, 0], np.linalg.norm(r[:, 1:], axis=1)], axis=1)


def _knot(law: Superpotential, state: IntArray) -> Array:
    """The knot that an odd entry of a state (m,) stands for, and some knot elsewhere, (m,)."""
    knots = np.broadcast_to(law.knots, (len(state), law.knots.shape[-1]))
    if knots.shape[1] == 0:
        return np.zeros(len(state))
    return np.asarray(knots[np.arange(len(state)), np.minimum(state // 2, knots.shape[1] - 1)])


def _polar(x: Array) -> tuple[Array, Array]:
    """Length and direction of each row; no direction where it is zero."""
    size = np.linalg.norm(x, axis=1)
    return size, x / np.where(size > 0.0, size, 1.0)[:, None]


def _cut(x: Array, size: Array) -> Array:
    """Each row of ``x``, cut back to the length ``size``."""
    length, direction = _polar(x)
    return np.asarray(np.minimum(length, np.abs(size))[:, None] * direction)


def _sets_of_start(system: CondensedProblem, laws: tuple[Superpotential, ...], r: Array) -> IntArray:
    """Open and sticking where the start is at rest, otherwise the piece or knot that holds the start."""
    sets = np.zeros((len(r), len(laws)), dtype=np.int64)
    for c, law in enumerate(laws):
        sets[:, c] = part_of(law, r[:, c])
        if c == 0 and not len(system.rigid_modes):  # a body that only its foundation holds starts on the foundation
            # "open": the piece below the knot, where there is one
            sets[:, 0] -= (sets[:, 0] % 2 == 1) & (law.domain.lower < r[:, 0])
    return sets


def _move(system: CondensedProblem, laws: tuple[Superpotential, ...], sets: IntArray, r: Array, lam: Array) -> IntArray:
    """Each component goes one place towards where ``p = r/tau + lambda`` belongs."""
    new = sets.copy()
    for c, law in enumerate(laws):
        tau = _step_length(system, law, c)
        p = (r[:, c] / tau + lam[:, c])[:, None]
        rounding = 1e-13 * (np.abs(r[:, c]) / tau + np.abs(lam[:, c]))[:, None]
        state = sets[:, c][:, None]
        knot = np.arange(law.knots.shape[-1])[None, :] * 2 + 1  # its state
        # A component on the boundary of its set stays: thresholds give way by rounding on its own side.
        below, above = knot_forces(law, 1.0 / tau)
        passed_below = np.where(state >= knot, p > below - rounding, p > below + rounding)
        passed_above = np.where(state > knot, p > above - rounding, p > above + rounding)
        target = passed_below.sum(axis=1) + passed_above.sum(axis=1)
        if system.shape[1] > 2 and c == 1:  # a size is never negative
            target = np.maximum(target, _rest(law, len(r)))
        moved = sets[:, c] + np.sign(target - sets[:, c])
        new[:, c] = np.where(system.active[:, c], moved, sets[:, c])
    return new


def _rest(law: Superpotential, m: int) -> IntArray:
    """The state of a slip of size zero, (m,)."""
    return part_of(law, np.zeros(m))


def _step_length(system: CondensedProblem, law: Superpotential, c: int) -> Array:
    """tau of a component, (m,): so small that the proximal map of the law is single-valued."""
    tau = system.compliance[:, c]
    alpha = np.broadcast_to(law.weak_convexity, tau.shape)
    return np.where(alpha > 0.0, np.minimum(tau, 0.5 / np.where(alpha > 0.0, alpha, 1.0)), tau)


def _solve(matrix: Array, rhs: Array, symmetric: bool = False) -> Array:
    """The solution, in the sense of least squares where the matrix is singular, or symmetric and not definite."""
    if matrix.size == 0:
        return np.zeros(0)
    try:
        return np.asarray(la.cho_solve(la.cho_factor(matrix), rhs) if symmetric else np.linalg.solve(matrix, rhs))
    except la.LinAlgError:
        return np.asarray(la.lstsq(matrix, rhs)[0])
