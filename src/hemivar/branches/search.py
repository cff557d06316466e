"""The search for solutions: multistart, deflated Newton's method and continuation, and what was found so far."""

from __future__ import annotations

import itertools
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from hemivar.basics.deadline import Budget, OutOfTime, check_time, limited
from hemivar.basics.types import Array, IntArray
from hemivar.branches.enumeration import Candidate
from hemivar.branches.follower import trace
from hemivar.branches.polish import Polished, polish, polish_by_solver
from hemivar.certificates import energy_norm
from hemivar.certificates.kind import kind_of
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import residual
from hemivar.laws import MixedMode
from hemivar.laws.normal_and_friction import NormalAndFriction
from hemivar.laws.vector_law import frozen_at
from hemivar.solvers import Controls, LoadStepping, NonsmoothNewton, Search, Solution, Solver, Status, solve
from hemivar.solvers.solve import suited
from hemivar.solvers.status import check_interrupt
from hemivar.systems import CondensedProblem
from hemivar.systems.chain import Chain
from hemivar.systems.nonlinear_body import linear_bulk
from hemivar.systems.workspace import Workspace

__all__ = ["SearchProgress", "SolutionSearch"]

#: Steps of Newton's method to a saddle. 12 and 50 give the same solutions in tests/branches.
_NEWTON = 25
#: Starts that are deflated side by side: what one finds, the others no longer go to. 5 and 80 give the same solutions
#: in tests/branches.
_AT_ONCE = 20
#: Entries of their Jacobians at most, which take 8 MiB.
_ENTRIES = 2**20
#: Relative residual of a start whose pieces and kinks are tried. 1e-1 and 1e-3 give the same solutions in
#: tests/branches.
_ROUGH = 1e-2
#: Part of the length of a chain by which two zeros differ. They are solved to 1e-12 of the force; 1e-8 and 1e-10
#: give the same solutions in tests/branches.
_APART = 1e-9
#: Points of glue that couples of which all 2^4 combinations of intact and broken are tried; with more points, so many
#: at random. 2 and 6 give the same solutions in tests/branches.
_COMBINED = 4
#: Methods that start from where they begin by themselves.
_SOLVERS = (NonsmoothNewton(), NonsmoothNewton(search=Search.DOWNHILL), LoadStepping())


@dataclass(frozen=True)
class SearchProgress:
    """The search begins, or a start was tried.

    Attributes
    ----------
    starts : int
        Tried so far; 0 while combinations of pieces and kinks are.
    found : int
        Solutions so far.
    planned : int
        Starts that there will be; what is found leads to more.  0 where none are planned.
    """

    starts: int
    found: int
    planned: int = 0


class SolutionSearch:
    """What was found so far, and the ways to find more.

    Of a body that is not linear ``problem`` is the problem, and ``system`` that of the linear body at rest, which tells
    where to start.
    """

    def __init__(
        self,
        system: CondensedProblem,
        workspace: Workspace,
        chain: Chain | None,
        controls: Controls,
        limit: int,
        random: np.random.Generator,
        budget: Budget,
        problem: DiscreteProblem | None = None,
    ) -> None:
        self.system = system
        self.problem = system.problem if problem is None else problem
        self.workspace = workspace
        self.chain = chain
        self.controls = controls
        self.limit = limit
        self.random = random
        self.starts = self.planned = 0
        self.carried = True
        self.solutions: list[Solution] = []
        self.points: list[tuple[Array, IntArray]] = []
        self.left_out = 0
        self.full_and_more = False
        self._displacements: list[Array] = []
        self._errors: list[Array] = []
        self._stiffness = np.sqrt(system.diagonal)
        self.budget = budget
        self.stopped = ""
        self.interrupted = False

    def follow(self, chain: Chain) -> None:
        """Take up the curves of the law, which were not there before."""
        self.chain = chain
        self.points = [chain.nearest(solution.local, solution.multiplier) for solution in self.solutions]

    @contextmanager
    def stopped_cleanly(self) -> Iterator[None]:
        """An interruption or the time limit ends the search, and what was found stays."""
        try:
            yield
        except OutOfTime:
            self.stopped = "stopped at the time limit"
        except KeyboardInterrupt:
            self.stopped, self.interrupted = "interrupted", True

    def working(self, work: Iterator[None]) -> Generator[SearchProgress, bool | None, None]:
        """Do work one start after the other, within the time, and tell of each; being sent True ends the search."""
        while True:
            self.budget.check()
            with limited(self.budget):
                if next(work, self) is self:
                    return
            if (yield self.progress):
                raise KeyboardInterrupt

    @property
    def progress(self) -> SearchProgress:
        """How far the search is."""
        return SearchProgress(self.starts, len(self.solutions), self.planned)

    @property
    def full(self) -> bool:
        """Whether as many solutions as were asked for are there."""
        return len(self.solutions) >= self.limit

    def sorted(self) -> tuple[Solution, ...]:
        """The solutions by their energy."""
        return tuple(sorted(self.solutions, key=lambda solution: solution.energy))

    # ---- what was found ------------------------------------------------------------------------------------

    def known(self, r: Array, error: Array) -> bool:
        """Whether a point (m, d) is one of those that were found, within the errors (m, d) of both.

        Compared is the energy that moves each component by itself, so that rigid motions count as well.
        """
        if not self._displacements:
            return False
        size = np.array([(self._stiffness * np.abs(other - r)).max(initial=0.0) for other in self._displacements])
        slack = (self._stiffness * error).max(initial=0.0)
        return bool((size <= 2.0 * slack + 2.0 * np.array(self._errors)).any())

    def add_candidate(self, candidate: Candidate) -> None:
        """Add a point of the enumeration if it is new; one that is not shown to be a solution, or none, is counted."""
        chain, system = self.chain, self.system
        assert chain is not None
        r, error = system.fixed.copy(), np.zeros(system.shape)
        r[chain.point, chain.column], error[chain.point, chain.column] = candidate.r, candidate.error
        if self.known(r, error):
            return
        lam = system.multiplier(r)
        lam[chain.point, chain.column] = candidate.lam
        theta, segment = chain.at(candidate.r, candidate.lam, candidate.segment), candidate.segment
        polished = polish(system, chain, r, lam, theta, segment, self.controls)
        if not polished.solves(self.controls, candidate.rounding):
            self.left_out += 1
        elif self.full:
            self.full_and_more = True
        else:
            self._keep(self._solution(polished), r, error)
            self.points.append((theta, segment))

    def add_point(self, theta: Array, segment: IntArray) -> bool:
        """Add a point of the chain if it is new and solves the problem."""
        chain = self.chain
        assert chain is not None
        corrected = chain.correct(theta, segment, chain.force)
        if corrected is not None and chain.inside(corrected, segment, 1e-9 * chain.length).all():
            theta = np.clip(corrected, chain.pick(chain.start, segment), chain.pick(chain.end, segment))
        r, lam = chain.balanced(theta, segment)
        error = chain.error(theta, segment)
        if self.full or self.known(r, error):
            return False
        polished = polish(self.system, chain, r, lam, theta, segment, self.controls)
        if not polished.solves(self.controls):
            return False
        self._keep(self._solution(polished), r, error)
        self.points.append((theta, segment))
        return True

    def add_solution(self, solution: Solution) -> bool:
        """Add what a solver found if it converged and is new."""
        if solution.status is not Status.CONVERGED or self.full:
            return False
        point = self._on_its_pieces(solution)
        if point is not None:
            return self.add_point(*point)
        solution, error = polish_by_solver(solution, self.system, self.workspace, self.controls, self.budget)
        if self.known(solution.local, error):
            return False
        kind = self._kind(solution.unknowns, solution.multiplier)
        self._keep(replace(solution, kind=kind), solution.local, error)
        if self.chain is not None:
            self.points.append(self.chain.nearest(solution.local, solution.multiplier))
        return True

    def _on_its_pieces(self, solution: Solution) -> tuple[Array, IntArray] | None:
        """theta and segment of the zero of F on the pieces and kinks that a solution is nearest to, if it is there."""
        chain = self.chain
        if chain is None or solution.status is not Status.CONVERGED:
            return None
        theta, segment = chain.nearest(solution.local, solution.multiplier)
        corrected = chain.correct(theta, segment, chain.force)
        inside = corrected is not None and chain.inside(corrected, segment, 1e-7 * chain.length).all()
        return (corrected, segment) if corrected is not None and inside else None

    def from_candidates(self, candidates: Iterable[Candidate]) -> Iterator[None]:
        """The points of the enumeration."""
        for candidate in candidates:
            self.add_candidate(candidate)
            yield

    def _kind(self, u: Array, lam: Array) -> PointKind:
        """What a certificate will call it; that it is stationary where there is no time for more."""
        problem = self.problem
        try:
            return kind_of(problem, u, lam, energy_norm(problem, self.workspace))
        except OutOfTime:
            return PointKind.STATIONARY

    def _solution(self, polished: Polished) -> Solution:
        below = polished.residual.below(self.controls.atol, self.controls.rtol)
        return Solution(
            problem=self.system.problem,
            unknowns=polished.unknowns,
            multiplier=polished.multiplier,
            status=Status.CONVERGED if below else Status.STALLED,
            residual=polished.residual,
            method="find-solutions",
            kind=self._kind(polished.unknowns, polished.multiplier),
        )

    def _keep(self, solution: Solution, r: Array, error: Array) -> None:
        self.solutions.append(solution)
        self._displacements.append(r)
        self._errors.append((self._stiffness * error).max(initial=0.0))

    # ---- starts ------------------------------------------------------------------------------------------

    def run(self, solver: Solver, r: Array | None = None) -> None:
        """Solve from a point, or from where the method begins, and keep what is new.

        From a point roughly at first: Newton's method on the pieces and kinks of what it ends at makes that exact, and
        a start that is lost already is not solved once more.
        """
        self.starts += 1
        initial: Array | Solution | None = None
        if r is not None:
            initial = self.system.unknowns(np.where(self.system.active, r, self.system.fixed))
            if self.chain is not None:
                initial = self._solved(solver, initial, _ROUGH)
                if initial.status is not Status.CONVERGED or self._on_its_pieces(initial) is not None:
                    self.add_solution(initial)
                    return
        solution = self._solved(solver, initial, self.controls.rtol)
        self.carried = self.carried and (r is not None or solution.status is not Status.NOT_CARRIED)
        self.add_solution(solution)

    def _solved(self, solver: Solver, initial: Array | Solution | None, rtol: float) -> Solution:
        controls = replace(self.controls, rtol=max(rtol, self.controls.rtol), max_time=self.budget.left)
        method = suited(solver, self.problem)
        solution = solve(self.problem, method, controls, initial=initial, workspace=self.workspace)
        check_interrupt(solution.status)
        return solution

    def plan(self, count: int) -> None:
        """Count the starts there will be, with so many at random of each kind."""
        self.planned = len(_SOLVERS) + len(self._penetrations_to_start()) + len(self._bonded_or_broken()) + count
        self.planned += 0 if self.chain is None else 2 * count

    def _penetrations_to_start(self) -> list[tuple[Array, float]]:
        """Penetrations (m,) and a slip: under and over the load, and every piece of the law from both sides."""
        m, d = self.system.shape
        size = self.system.length_scale
        penetrations = [np.full(m, far * size) for far in (-5.0, 5.0)]
        if not (self.system.law.state_dependent or isinstance(self.system.law, MixedMode)):
            knots = self.system.law.penetration_knots
            ends = np.broadcast_to(np.where(np.isfinite(knots), knots, np.nan), (m, knots.shape[-1]))
            for k in range(min(ends.shape[1], 12)):
                for side in (-1e-3, 1e-3):  # from both sides of every kink
                    penetrations.append(np.where(np.isfinite(ends[:, k]), ends[:, k], 0.0) + side * size)
                if k:
                    middle = 0.5 * (ends[:, k - 1] + ends[:, k])
                    penetrations.append(np.where(np.isfinite(middle), middle, 0.0))
        slips = (0.0,) if d == 1 else (0.0, size, -size)
        return [(penetration, slip) for penetration in penetrations for slip in slips]

    def _bonded_or_broken(self) -> list[Array]:
        """Places (m, d) of glue that couples: each point intact or broken, the body in balance with these springs.

        All combinations of few points, else some at random beside none broken and all.
        """
        system = self.system
        m, d = system.shape
        if isinstance(system.law, NormalAndFriction) or system.law.depends_on_whole_state:
            return []
        if m <= _COMBINED:
            broken = np.array(list(itertools.product((False, True), repeat=m)))
        else:
            broken = np.random.default_rng(m).random((2**_COMBINED, m)) < np.linspace(0.0, 1.0, 2**_COMBINED)[:, None]
        rest = system.start(np.column_stack([np.full(m, -1e-9 * system.length_scale), np.zeros((m, d - 1))]))
        glue = system.weights[:, None, None] * frozen_at(system.law, rest).linearise(rest).hessian
        free, starts = system.free, []
        for choice in broken:
            matrix = system.matrix + la.block_diag(*np.where(choice[:, None, None], 0.0, glue))
            supported = matrix[np.ix_(free, free)] + 1e-9 * np.diag(system.diagonal.ravel()[free])
            r = system.fixed.ravel().copy()
            r[free] = la.solve(supported, (system.load - system.matrix @ r)[free], assume_a="sym")
            starts.append(r.reshape(m, d))
        return starts

    def from_solvers(self, count: int) -> Iterator[None]:
        """The minimising methods, from zero, under and over the load, from every piece, and at random."""
        m, d = self.system.shape
        for solver in _SOLVERS[self.starts :]:
            if self.carried:  # else the load has grown from rest already, and so it would once more
                self.run(solver)
                yield
        newton, descent, _ = _SOLVERS
        for penetration, slip in self._penetrations_to_start():
            r = np.zeros((m, d))
            r[:, 0], r[:, 1:2] = penetration, slip
            self.run(descent, self.system.start(r))
            yield
        for r in self._bonded_or_broken():
            self.run(descent, self.system.start(r))
            yield
        size = self.system.length_scale
        for k in range(count):
            if self.full:
                return
            spread = size * 10.0 ** self.random.uniform(-1.0, 0.7)
            r = self.random.normal(size=(m, d)) * spread
            self.run(newton if k % 4 == 0 else descent, self.system.start(r))
            yield

    def from_between(self) -> Iterator[None]:
        """Newton's method, not downhill, from between any two solutions of a body that is not linear: to saddles."""
        for first, second in itertools.combinations(tuple(self.solutions), 2):
            if self.full:
                return
            self.starts += 1
            for part in (0.5, 0.25, 0.75):
                solution = self._newton(first.unknowns + part * (second.unknowns - first.unknowns))
                if solution is not None and self.add_solution(solution):
                    break
            yield

    def _newton(self, u: Array) -> Solution | None:
        """Where Newton's method goes from unknowns (n,) on the pieces of the laws, be it no minimum."""
        problem, contact = self.problem, self.problem.contact
        weights = contact.weights[:, None]
        for _ in range(_NEWTON):
            line = frozen_at(problem.law, problem.local(u)).linearise(problem.local(u))
            off = residual(problem, u, line.gradient)
            if off.below(self.controls.atol, self.controls.rtol):
                return Solution(problem, u, line.gradient, Status.CONVERGED, off, "newton")
            bent = sp.block_diag(list(weights[:, :, None] * line.hessian), format="csr")
            matrix = linear_bulk(problem.bulk, u).stiffness + contact.trace.T @ bent @ contact.trace
            rest = problem.out_of_balance(u) - contact.force(line.gradient)
            if not (np.isfinite(rest).all() and np.isfinite(matrix.data).all()):
                return None
            try:
                u = u + splu(sp.csc_array(matrix)).solve(rest)
            except RuntimeError:  # singular
                return None
        return None

    def from_deflation(self, count: int) -> Iterator[None]:
        """Newton's method on the residual deflated by the known solutions, from random points of the graph."""
        chain = self.chain
        assert chain is not None
        at_once = min(max(_ENTRIES // max(chain.size, 1) ** 2, 1), _AT_ONCE)
        starts = [self._on_graph(k) for k in range(2 * count)]
        for first in range(0, len(starts), at_once):
            if self.full:
                return
            rows = np.array(starts[first : first + at_once])
            self.starts += len(rows)
            for theta, segment in _deflated_newton(chain, rows, [point for point, _ in self.points]):
                self.add_point(theta, segment)
            for _ in rows:
                yield

    def _on_graph(self, k: int) -> Array:
        """A random theta (n,): far off, and close to the ends of the pieces, where a steep law may turn."""
        chain = self.chain
        assert chain is not None
        if k < chain.kink.shape[1]:  # every layer: all components on segments of one number
            choice = np.minimum(np.full(chain.size, k), chain.count - 1)
        else:
            choice = self.random.integers(0, chain.count)
        low, high = chain.pick(chain.start, choice), chain.pick(chain.end, choice)
        reach = chain.length * 10.0 ** self.random.uniform(-4.0 if k % 2 else -1.0, 0.5, size=chain.size)
        low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - reach, -reach))
        high = np.where(np.isfinite(high), high, low + reach)
        return np.asarray(low + (high - low) * self.random.uniform(size=chain.size))

    def from_paths_and_saddles(self, rounds: int = 40) -> Iterator[None]:
        """The load path through every solution, and the ways down from every saddle."""
        chain = self.chain
        assert chain is not None
        _, descent, _ = _SOLVERS
        done = 0
        while done < min(len(self.points), rounds) and not self.full:
            theta, segment = self.points[done]
            done += 1
            rate = np.where(chain.force != 0.0, chain.force, float(np.abs(chain.force).max(initial=1.0)))
            for point, where in trace(chain, chain.force, rate, theta, segment, -1.5, 3.0):
                self.add_point(point, where)
            r, _ = chain.local(theta, segment)
            step = 1e-3 * chain.length
            if not chain.stable(theta, segment):
                for sign in (-1.0, 1.0):
                    self.run(descent, self.system.start(r + sign * step * _descent_direction(chain, theta, segment)))
            yield


def _descent_direction(chain: Chain, theta: Array, segment: IntArray) -> Array:
    """A direction (m, d) along which the energy falls from an unstable point, on both sides of it."""
    out = np.zeros(chain.system.shape)
    direction = np.zeros(chain.size)
    falling = chain.pick(chain.kink, segment) & (chain.pick(chain.direction, segment) < 0.0)
    if falling.any():
        direction[falling] = 1.0
    else:
        moving = ~chain.pick(chain.kink, segment)
        direction[moving] = np.linalg.eigh(chain.reduced_hessian(theta, segment))[1][:, 0]
    out[chain.point, chain.column] = direction
    return out


def _deflated_newton(chain: Chain, starts: Array, known: list[Array]) -> list[tuple[Array, IntArray]]:
    """Zeros of F away from the known ones (Farrell, Birkisson and Funke 2015), from all rows of ``starts (k, n)``.

    Newton's method for ``M(theta) F(theta)`` with ``M = prod(1 + L^2/|theta - theta_k|^2)``: the direction is that for
    F, times a scalar.  What one row finds is deflated for all others; one that comes to the same starts again.
    """
    force, theta = chain.force, starts
    size = float(np.abs(force).max(initial=0.0)) + float(np.abs(chain.matrix).max(initial=0.0)) * chain.length
    centres, zeros = np.array(known).reshape(-1, chain.size), list[tuple[Array, IntArray]]()

    def merit(x: Array, F: Array) -> Array:
        gap = np.maximum(((x[:, None] - centres) ** 2).sum(axis=-1), 1e-300)
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(np.linalg.norm(F, axis=1) * np.exp(np.log1p(chain.length**2 / gap).sum(axis=1)))

    for _ in range(60):
        check_time()
        segment = chain.segment_of(theta)
        F, J = chain.balance(theta, segment, force)
        done = np.abs(F).max(axis=1, initial=0.0) <= 1e-12 * size
        again = done.copy()
        for i in np.flatnonzero(done):
            again[i] = (np.abs(centres - theta[i]).max(axis=1, initial=0.0) <= _APART * chain.length).any()
            if not again[i]:
                zeros.append((theta[i], segment[i]))
                centres = np.concatenate([centres, theta[i : i + 1]])
        restarted, theta, starts, F, J = starts[again], theta[~done], starts[~done], F[~done], J[~done]
        now, step = merit(theta, F), _newton_steps(J, F)
        away = theta[:, None] - centres
        gap = np.maximum((away**2).sum(axis=-1), 1e-300)
        slope = (-2.0 * chain.length**2 * away / (gap * (gap + chain.length**2))[..., None]).sum(axis=1)
        denominator = 1.0 - (slope * step).sum(axis=1)
        step /= np.where(np.abs(denominator) > 1e-3, denominator, 1.0)[:, None]
        far = np.abs(step).max(axis=1, initial=0.0)
        length = 20.0 * chain.length / np.maximum(far, 20.0 * chain.length)
        trial, value, trying = theta.copy(), np.empty(len(theta)), np.arange(len(theta))
        for _ in range(7):
            trial[trying] = at = theta[trying] + length[trying, None] * step[trying]
            value[trying] = merit(at, chain.out_of_balance(at, chain.segment_of(at), force))
            trying = trying[~(value[trying] < now[trying])]
            length[trying] *= 0.5
            if not trying.size:
                break
        finite = np.isfinite(value)
        theta, starts = np.concatenate([trial[finite], restarted]), np.concatenate([starts[finite], restarted])
        if not len(theta):
            break
    return zeros


def _newton_steps(J: Array, F: Array) -> Array:
    """Newton's steps (k, n), those of least squares where a Jacobian (k, n, n) is singular."""
    try:
        return np.asarray(np.linalg.solve(J, -F[..., None])[..., 0])
    except np.linalg.LinAlgError:
        return np.array([_newton_step(*row) for row in zip(J, F, strict=True)])


def _newton_step(J: Array, F: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(J, -F))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(J, -F, rcond=1e-10)[0])
