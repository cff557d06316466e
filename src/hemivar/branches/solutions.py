"""All solutions of a problem, as far as they can be found."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from hemivar._typing import Array, IntArray
from hemivar.arguments import expect, whole_number
from hemivar.branches.chain import Chain, chain_of
from hemivar.branches.enumeration import enumerate_points
from hemivar.branches.path import trace
from hemivar.certify import one_solution, smallness
from hemivar.mechanics.discrete import DiscreteProblem
from hemivar.mechanics.posed import posed
from hemivar.mechanics.problem import ContactProblem
from hemivar.mechanics.residual import residual
from hemivar.solvers import (
    CondensedProblem,
    Controls,
    LoadStepping,
    NonsmoothNewton,
    Search,
    Solution,
    Solver,
    Status,
    condense,
    solve,
    suited,
)
from hemivar.solvers.condensed import depends_on_state
from hemivar.solvers.controls import Budget, OutOfTime
from hemivar.solvers.newton import newton_components, newton_system

__all__ = ["SolutionSet", "find_solutions"]

_SAME = 1e-8


@dataclass(frozen=True, eq=False)
class SolutionSet(Sequence[Solution]):
    """The solutions that were found, ordered by energy.

    Attributes
    ----------
    solutions : tuple of Solution
        Each with its energy and its ``kind``: "minimum" (no lower point nearby), "saddle", "maximum" (of the energy as
        a function of the contact displacements alone), or "jump" (a component at a downward jump of its law:
        stationary in Clarke's sense, never a local minimum).
    exhaustive : bool
        Whether there are no others: every combination of pieces and kinks was tried, or the problem has one solution
        by its margin.
    combinations : float
        Number of combinations of pieces and kinks; inf where the graph of the law is no curve (three dimensions, bounds
        that depend on the solution).
    starts : int
        Number of starting points tried, 0 where all combinations were.
    searched : str
        How far the search went, in words.
    interrupted : bool
        Whether it was stopped from the keyboard; what was found until then is here.
    """

    solutions: tuple[Solution, ...]
    exhaustive: bool
    combinations: float
    starts: int
    searched: str
    interrupted: bool = False

    def __len__(self) -> int:
        return len(self.solutions)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self.solutions[index]

    def __iter__(self) -> Iterator[Solution]:
        return iter(self.solutions)

    @property
    def energies(self) -> Array:
        """Energies in increasing order."""
        return np.array([solution.energy for solution in self.solutions])

    @property
    def minima(self) -> tuple[Solution, ...]:
        """The local minimisers among them."""
        return tuple(solution for solution in self.solutions if solution.kind == "minimum")


def find_solutions(
    problem: DiscreteProblem | ContactProblem,
    *,
    starts: int = 40,
    max_solutions: int = 100,
    enumerate_up_to: int = 20_000,
    seed: int = 0,
    controls: Controls | None = None,
    condensed: CondensedProblem | None = None,
) -> SolutionSet:
    """Find the stationary points of the energy: all of them where this is possible, otherwise as many as turn up.

    If all laws are piecewise quadratic and there are at most ``enumerate_up_to`` combinations of pieces and kinks, all
    are tried and nothing is missed.  If the margin of :func:`hemivar.certify.smallness` is positive, there is one
    solution, and it is solved for.  Otherwise the search goes on from many starts: the default method and the downhill
    one from zero, by load stepping, from both sides of every kink of the law and from random points; Newton's method on
    the residual deflated by what was found already, which also finds saddles and maxima; the load path through every
    solution, which meets others where it folds back; and both sides of every saddle.

    Parameters
    ----------
    problem : DiscreteProblem
    starts : int
        Number of random starts of each kind.
    max_solutions : int
        Stop after so many.
    enumerate_up_to : int
        Largest number of combinations that are all tried; 0 for the search from many starts.
    seed : int
        Seed of the random starts; any will do.
    controls : Controls, optional
        Tolerances of the solves; ``max_time`` limits the whole search.
    condensed : CondensedProblem, optional
        The condensation of this very problem.

    Returns
    -------
    SolutionSet

    Raises
    ------
    ProblemError
        ``starts`` or ``max_solutions`` make no sense, or the problem cannot be solved as stated.
    """
    starts, max_solutions = whole_number(starts, "starts", 0), whole_number(max_solutions, "max_solutions", 1)
    enumerate_up_to, seed = whole_number(enumerate_up_to, "enumerate_up_to", 0), whole_number(seed, "seed", 0)
    if controls is not None:
        expect(controls, Controls, "controls", "pass Controls(rtol=..., max_time=...)")
    if condensed is not None:
        expect(condensed, CondensedProblem, "the condensation", "pass what hemivar.condense(problem) returns")
    problem = posed(problem, "find_solutions")
    controls = Controls() if controls is None else controls
    system = condense(problem) if condensed is None else condensed
    plain = problem.dim <= 2 and not depends_on_state(problem.law) and problem.contact_points > 0
    chain = chain_of(system) if plain else None
    search = _Search(system, chain, controls, max_solutions, np.random.default_rng(seed))
    if chain is not None and chain.combinations <= enumerate_up_to and _affine(chain):
        with search.stopped_cleanly():
            points, continuum = enumerate_points(chain)
            for theta, segment in points:
                search.budget.check()
                search.add_point(theta, segment)
        if search.stopped:
            searched = f"not all of the {chain.combinations:.0f} combinations were tried; {search.stopped}"
            return SolutionSet(search.sorted(), False, chain.combinations, 0, searched, search.interrupted)
        complete = not continuum and not search.full
        searched = f"all {chain.combinations:.0f} combinations of pieces and kinks were tried"
        if continuum:
            searched += "; there is a continuum of solutions, of which one or some are given"
        if search.full:
            searched += f"; stopped at {max_solutions} solutions"
        return SolutionSet(search.sorted(), complete, chain.combinations, 0, searched)
    combinations = chain.combinations if chain is not None else np.inf
    constants = smallness(problem, trace_constant=False)
    proved = one_solution(problem, constants) and not constants.alpha_sampled
    with search.stopped_cleanly():
        if proved:
            search.run(NonsmoothNewton(), None)
        if not search.found:
            search.from_solvers(starts)
            if chain is not None:
                search.from_deflation(starts)
                search.from_paths_and_saddles()
    if proved and len(search.found) == 1:
        searched = f"the margin {constants.margin:.3g} is positive, so there is one solution"
        return SolutionSet(search.sorted(), True, combinations, search.starts, searched, search.interrupted)
    if chain is None:
        searched = f"{search.starts} starts of minimising methods; there may be more solutions, saddles above all"
    else:
        searched = (
            f"{search.starts} starts and the load paths through what they found, where there are {combinations:.3g} "
            "combinations of pieces and kinks; there may be more"
        )
    if search.full:
        searched += f"; stopped at {max_solutions} solutions"
    if search.stopped:
        searched += f"; {search.stopped}"
    return SolutionSet(search.sorted(), False, combinations, search.starts, searched, search.interrupted)


def _affine(chain: Chain) -> bool:
    used = np.arange(chain.kink.shape[1])[None, :] < chain.count[:, None]
    return bool((chain.affine | chain.kink)[used].all())


class _Search:
    """What was found so far."""

    def __init__(
        self,
        system: CondensedProblem,
        chain: Chain | None,
        controls: Controls,
        limit: int,
        random: np.random.Generator,
    ) -> None:
        self.system = system
        self.chain = chain
        self.controls = controls
        self.limit = limit
        self.random = random
        self.starts = 0
        self.found: list[Solution] = []
        self.points: list[tuple[Array, IntArray]] = []
        self._places: list[Array] = []
        self._traced = 0
        self.budget = Budget(controls.max_time)
        self.stopped = ""
        self.interrupted = False

    @contextmanager
    def stopped_cleanly(self) -> Iterator[None]:
        """An interruption or the time limit ends the search, and what was found stays."""
        try:
            yield
        except OutOfTime:
            self.stopped = "stopped at the time limit"
        except KeyboardInterrupt:
            self.stopped, self.interrupted = "interrupted", True

    @property
    def full(self) -> bool:
        return len(self.found) >= self.limit

    def sorted(self) -> tuple[Solution, ...]:
        return tuple(sorted(self.found, key=lambda solution: solution.energy))

    def known(self, r: Array) -> bool:
        if not self._places:
            return False
        places = np.array(self._places)
        size = max(float(np.abs(places).max(initial=0.0)), float(np.abs(r).max(initial=0.0)))
        return bool((np.abs(places - r[None]).max(axis=(1, 2), initial=0.0) <= _SAME * size).any())

    def add_point(self, theta: Array, segment: IntArray) -> bool:
        """Add a point of the chain if it is new and solves the problem."""
        chain = self.chain
        assert chain is not None
        corrected = chain.correct(theta, segment, chain.force)
        if corrected is not None and chain.inside(corrected, segment, 1e-9 * chain.length).all():
            theta = corrected
        r, lam = chain.local(theta, segment)
        if self.full or self.known(r):
            return False
        solution = _solution(self.system, r, lam, chain.kind(theta, segment), self.controls)
        if solution is None:
            return False
        self._keep(solution, r)
        self.points.append((theta, segment))
        return True

    def add_solution(self, solution: Solution) -> bool:
        """Add what a solver found if it converged and is new."""
        if solution.status is not Status.CONVERGED or self.full:
            return False
        if self.chain is not None:
            theta, segment = self.chain.nearest(solution.local, solution.multiplier)
            corrected = self.chain.correct(theta, segment, self.chain.force)
            if corrected is not None and self.chain.inside(corrected, segment, 1e-7 * self.chain.length).all():
                return self.add_point(corrected, segment)
        if self.known(solution.local):
            return False
        self._keep(replace(solution, kind=_kind(self.system, solution.local, solution.multiplier)), solution.local)
        if self.chain is not None:
            self.points.append(self.chain.nearest(solution.local, solution.multiplier))
        return True

    def _keep(self, solution: Solution, r: Array) -> None:
        self.found.append(solution)
        self._places.append(r)

    # ---- starts ------------------------------------------------------------------------------------------

    def run(self, solver: Solver, r: Array | None) -> None:
        problem = self.system.problem
        self.budget.check()
        self.starts += 1
        initial = None if r is None else self.system.unknowns(np.where(self.system.active, r, self.system.fixed))
        controls = replace(self.controls, max_time=max(self.budget.limit - self.budget.spent, 0.0))
        found = solve(problem, suited(solver, problem), controls, initial=initial, condensed=self.system)
        self.add_solution(found)
        if found.status is Status.INTERRUPTED:
            raise KeyboardInterrupt

    def from_solvers(self, count: int) -> None:
        """The minimising methods, from zero, under and over the load, from every piece, and at random."""
        m, d = self.system.shape
        newton, downhill = NonsmoothNewton(), NonsmoothNewton(search=Search.DOWNHILL)
        self.run(newton, None)
        self.run(downhill, None)
        self.run(LoadStepping(), None)
        size = self.system.length_scale
        places = [np.full(m, far * size) for far in (-5.0, 5.0)]
        if not depends_on_state(self.system.law):
            knots = np.broadcast_to(self.system.law.normal.knots, (m, self.system.law.normal.knots.shape[-1]))
            ends = np.where(np.isfinite(knots), knots, np.nan)
            for k in range(min(ends.shape[1], 12)):
                for side in (-1e-3, 1e-3):  # from both sides of every kink
                    places.append(np.where(np.isfinite(ends[:, k]), ends[:, k], 0.0) + side * size)
                if k:
                    middle = 0.5 * (ends[:, k - 1] + ends[:, k])
                    places.append(np.where(np.isfinite(middle), middle, 0.0))
        slips = (0.0,) if d == 1 else (0.0, size, -size)
        for place in places:
            for slip in slips:
                r = np.zeros((m, d))
                r[:, 0], r[:, 1:2] = place, slip
                self.run(downhill, self.system.start(r))
        for k in range(count):
            if self.full:
                return
            spread = size * 10.0 ** self.random.uniform(-1.0, 0.7)
            r = self.random.normal(size=(m, d)) * spread
            self.run(newton if k % 4 == 0 else downhill, self.system.start(r))

    def from_deflation(self, count: int) -> None:
        """Newton's method on the residual deflated by the known solutions, from random points of the graph."""
        chain = self.chain
        assert chain is not None
        rows = np.arange(chain.size)
        for k in range(2 * count):
            if self.full:
                return
            self.budget.check()
            self.starts += 1
            if k < chain.kink.shape[1]:  # every layer: all components on segments of one number
                choice = np.minimum(np.full(chain.size, k), chain.count - 1)
            else:
                choice = self.random.integers(0, chain.count)
            low, high = chain.start[rows, choice], chain.end[rows, choice]
            reach = chain.length * self.random.exponential(size=chain.size)
            low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high - reach, -reach))
            high = np.where(np.isfinite(high), high, low + reach)
            theta = low + (high - low) * self.random.uniform(size=chain.size)
            end = _deflated_newton(chain, theta, [point for point, _ in self.points])
            if end is not None:
                self.add_point(*end)

    def from_paths_and_saddles(self, rounds: int = 40) -> None:
        """The load path through every solution, and the ways down from every saddle."""
        chain = self.chain
        assert chain is not None
        downhill = NonsmoothNewton(search=Search.DOWNHILL)
        done = 0
        while done < min(len(self.points), rounds) and not self.full:
            self.budget.check()
            theta, segment = self.points[done]
            done += 1
            rate = np.where(chain.force != 0.0, chain.force, float(np.abs(chain.force).max(initial=1.0)))
            for point, where in trace(chain, chain.force, rate, theta, segment, -1.5, 3.0):
                self.add_point(point, where)
            r, _ = chain.local(theta, segment)
            step = 1e-3 * chain.length
            if not chain.stable(theta, segment):
                for sign in (-1.0, 1.0):
                    self.run(downhill, self.system.start(r + sign * step * _way_down(chain, theta, segment)))


def _way_down(chain: Chain, theta: Array, segment: IntArray) -> Array:
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


def _deflated_newton(chain: Chain, theta: Array, known: list[Array]) -> tuple[Array, IntArray] | None:
    """A zero of F away from the known ones (Farrell, Birkisson and Funke 2015), or None.

    Newton's method for ``M(theta) F(theta)`` with ``M = prod(1 + L^2/|theta - theta_k|^2)``: the direction is that for
    F, times a scalar.
    """
    force = chain.force
    size = float(np.abs(force).max(initial=0.0)) + float(np.abs(chain.matrix).max()) * chain.length
    centres = np.array(known).reshape(-1, chain.size)

    def merit(x: Array) -> float:
        segment = chain.segment_of(x)
        F, _ = chain.balance(x, segment, force)
        gap = np.maximum(((x - centres) ** 2).sum(axis=1), 1e-300)
        return float(np.linalg.norm(F) * np.exp(np.log1p(chain.length**2 / gap).sum()))

    now = merit(theta)
    for _ in range(60):
        segment = chain.segment_of(theta)
        F, J = chain.balance(theta, segment, force)
        if np.abs(F).max(initial=0.0) <= 1e-12 * size:
            return theta, segment
        try:
            step = np.linalg.solve(J, -F)
        except np.linalg.LinAlgError:
            step = np.linalg.lstsq(J, -F, rcond=1e-10)[0]
        away = theta - centres
        gap = np.maximum((away**2).sum(axis=1), 1e-300)
        slope = (-2.0 * chain.length**2 * away / (gap * (gap + chain.length**2))[:, None]).sum(axis=0)
        denominator = 1.0 - float(slope @ step)
        step = step / denominator if abs(denominator) > 1e-3 else step
        far = float(np.abs(step).max(initial=0.0))
        length = min(1.0, 20.0 * chain.length / far) if far > 0.0 else 1.0
        for _ in range(7):
            trial = theta + length * step
            value = merit(trial)
            if value < now:
                break
            length *= 0.5
        if not np.isfinite(value):
            return None
        theta, now = trial, value
    return None


# ---- solutions -----------------------------------------------------------------------------------------------


def _solution(system: CondensedProblem, r: Array, lam: Array, kind: str, controls: Controls) -> Solution | None:
    """A solution of the full problem from local displacements and multiplier; None where it does not solve it."""
    u, found = system.recover(r, lam)
    problem = system.problem
    exact = np.where(system.active, system.law.nearest_multiplier(r, lam), lam)
    with_exact = residual(problem, u, exact)
    if with_exact.total <= found.total + found.rounding:
        lam, found = exact, with_exact
    if not found.below(controls.atol, controls.rtol):
        return None
    return Solution(
        problem=problem,
        unknowns=u,
        multiplier=lam,
        status=Status.CONVERGED,
        residual=found,
        method="find-solutions",
        kind=kind,
    )


def _kind(system: CondensedProblem, r: Array, lam: Array) -> str:
    """The kind of a stationary point by the curvature of the components that are off the kinks, in any dimension."""
    frozen = system.for_problem(system.problem.with_law(system.law_at(r, lam)))
    index = np.flatnonzero(newton_components(frozen.law, r, frozen.active).ravel())
    if index.size == 0:
        return "minimum"
    H, _ = newton_system(frozen, r, index, frozen.out_of_balance(r))
    values = np.linalg.eigvalsh(H)
    if values[0] > 0.0:
        return "minimum"
    return "maximum" if values[-1] < 0.0 and values.size == frozen.free.size else "saddle"
