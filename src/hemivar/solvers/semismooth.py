"""Newton's equation of a law whose friction bound depends on the solution, the bound being a part of it.

With the pressure and friction ``lam = W^-1 (g - A r)`` in equilibrium with r and ``p = a r + lam``, a pair solves the
problem where it is the one of the graphs of the laws at which p is what it is: ``F(r) = a (r - prox(p)) = 0``, the
bound h in the prox being that of the very penetration and pressure (:mod:`hemivar.laws.dependent`).  F is piecewise
smooth; its generalised derivative is not symmetric, and there is no energy, so that steps are halved until |F| falls.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import check_numbers, expect
from hemivar.basics.arrays import norm
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws.dependent import DependentLaw
from hemivar.laws.separate import OnGraph
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget
from hemivar.solvers.fixed_point import FixedPoint
from hemivar.solvers.nearby import SEMISMOOTH, Pieces
from hemivar.solvers.status import Status
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.workspace import Workspace

__all__ = ["SemismoothNewton"]

#: Part of what is added up in F that is rounding.
_ROUNDING = 8.0 * float(np.finfo(float).eps)
#: Part of a step by which |F| must fall at least.
_FALLS = 1e-4
#: Part of the bound by which it is raised first, and the least one.
_RAISED, _LEAST = 0.25, 1.0 / 512.0


@dataclass(frozen=True)
class SemismoothNewton(Solver):
    """Newton's method for laws whose friction bound depends on penetration or pressure, such as Coulomb's.

    Nothing is frozen: the bound is a part of Newton's equation on the condensed body, by its derivatives (Alart and
    Curnier 1991; Hueeber, Stadler and Wohlmuth 2008).  A step is halved until ``|F|`` falls.  Where it does not, the
    bound is raised from zero in parts, each solved from the one before; where that fails, too, or where the bound has
    no derivatives or the profile falls at once, the fixed point takes over.  ``solution.fallbacks`` counts both.

    Where laws soften, a solution must be one that the method inside the fixed point would not leave, the bound being
    frozen; else the fixed point goes on from what that method finds.

    Parameters
    ----------
    fallback : FixedPoint
    rounds : int
        Newton's equations that are solved before another way is thought better.
    halvings : int
        How often a step may be halved.
    """

    fallback: FixedPoint = field(default_factory=FixedPoint)
    rounds: int = 30
    halvings: int = 12

    def __post_init__(self) -> None:
        expect(self.fallback, FixedPoint, "SemismoothNewton.fallback", "pass FixedPoint(NonsmoothNewton())")
        check_numbers(self)
        for name in ("rounds", "halvings"):
            if getattr(self, name) < 1:
                raise ProblemError(f"SemismoothNewton.{name} is {getattr(self, name)}; it must be at least 1")
        if not self.fallback.condenses:
            raise ProblemError(
                f"SemismoothNewton works on the condensed body, and {self.fallback.name} does not; take that method "
                "itself"
            )

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name in tables."""
        return SEMISMOOTH

    @property
    def default_steps(self) -> int:  # type: ignore[override]
        """Limit of steps."""
        return self.rounds + self.fallback.default_steps

    @property
    def patience(self) -> int:  # type: ignore[override]
        """It ends by itself where |F| does not fall."""
        return self.default_steps

    @property
    def handles_state(self) -> bool:
        return True

    def refuse(self, problem: DiscreteProblem) -> str | None:
        return self.fallback.refuse(problem)

    def downhill(self) -> Solver:
        return self.fallback.downhill()  # which crosses no barrier

    def for_tolerance(self, rtol: float) -> Solver:
        fallback = self.fallback.for_tolerance(rtol)
        assert isinstance(fallback, FixedPoint)
        return replace(self, fallback=fallback)

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> object:
        return self.fallback.prepare(problem, workspace)

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        equation = _Equation.of(system)
        point = None if equation is None else equation.at(start.r)
        if equation is None or point is None:
            return self._fixed(system, start, start, budget)
        way = _Way(start, equation, point)
        return State(start.r, point.lam, 1, memory=way)

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        way: _Way = state.memory
        if way.outer is not None:
            return self._followed(system, way, state, budget)
        equation, point = way.equation, way.point
        assert equation is not None
        assert point is not None
        if point.off <= equation.rounding(point):
            return replace(state, ended=Status.STALLED)
        evaluations, fallbacks, new = state.evaluations + 1, state.fallbacks, None
        if way.rounds < self.rounds:
            new = equation.lower(point, self.halvings)
        if new is None:
            fallbacks += 1
            new = self._raised(equation, way.start.r, budget) if way.rounds >= 0 else None
            way = replace(way, rounds=-self.rounds)
        if new is None:
            fixed = self._fixed(system, way.start, replace(state, fallbacks=fallbacks), budget)
            return self._followed(system, fixed.memory, fixed, budget)
        way = replace(way, point=new, rounds=way.rounds + 1)
        return State(new.r, new.lam, evaluations, memory=way, fallbacks=fallbacks)

    def settle(self, system: CondensedProblem, state: State, budget: Budget) -> State | None:
        way: _Way = state.memory
        law = system.law_at(state.r, state.lam)
        if way.outer is not None or all((alpha == 0.0).all() for alpha in law.weak_convexity):
            return None
        inner, frozen = self.fallback.inner, system.with_law(law)
        lower = inner.settle(frozen, inner.begin(frozen, State(state.r, state.lam), budget), budget)
        return None if lower is None else self._fixed(system, State(lower.r, lower.lam), state, budget)

    def release(self, state: State) -> None:
        way: _Way = state.memory
        if way.outer is not None:
            self.fallback.release(way.outer)

    def _fixed(self, system: CondensedProblem, start: State, state: State, budget: Budget) -> State:
        """The fixed point from a start, from now on."""
        outer = self.fallback.begin(system, start, budget)
        return replace(
            outer, evaluations=state.evaluations, memory=_Way(start, outer=outer), fallbacks=state.fallbacks + 1
        )

    def _followed(self, system: CondensedProblem, way: _Way, state: State, budget: Budget) -> State:
        """A step of the fixed point."""
        assert way.outer is not None
        outer = self.fallback.step(system, way.outer, budget)
        return replace(outer, memory=replace(way, outer=outer), fallbacks=state.fallbacks)

    def _raised(self, equation: _Equation, start: Array, budget: Budget) -> _Point | None:
        """The solution to which the one without friction leads while the bound is raised to what it is."""
        point = self._solved(equation.times(0.0), start, budget)
        done, part = 0.0, _RAISED
        while point is not None and done < 1.0:
            here = min(done + part, 1.0)
            new = self._solved(equation.times(here), point.r, budget)
            if new is not None:
                point, done, part = new, here, 2.0 * part
            elif part <= _LEAST:
                return None
            else:
                part *= 0.5
        return point

    def _solved(self, equation: _Equation, r: Array, budget: Budget) -> _Point | None:
        """The solution that Newton's equation leads to from a place."""
        point = equation.at(r)
        for _ in range(self.rounds):
            if point is None or point.off <= equation.rounding(point):
                return point
            budget.check()
            point = equation.lower(point, self.halvings)
        return None


@dataclass(frozen=True, eq=False)
class _Point:
    """A place, what is in equilibrium with it, and how far it is off the law.

    Attributes
    ----------
    r, lam : arrays (m, d)
    on : OnGraph
        Where the law is linearised.
    off : float
        |F|, as a force.
    """

    r: Array
    lam: Array
    on: OnGraph
    off: float


@dataclass(frozen=True, eq=False)
class _Equation:
    """``F(r) = 0``.

    Attributes
    ----------
    system : CondensedProblem
    graphs : DependentLaw
    pieces : Pieces
    """

    system: CondensedProblem
    graphs: DependentLaw
    pieces: Pieces

    @staticmethod
    def of(system: CondensedProblem) -> _Equation | None:
        """The equation of a problem; None where p does not sort its points, or its law has no derivatives."""
        pieces = Pieces()
        graphs = pieces.graphs(system)
        if not isinstance(graphs, DependentLaw):
            return None
        soft = (system.law.normal.weak_convexity >= system.body.pointwise[:, 0]).any()
        return None if soft else _Equation(system, graphs, pieces)

    def times(self, factor: float) -> _Equation:
        """The equation with a part of the bound."""
        return replace(self, graphs=replace(self.graphs, factor=factor))

    def rounding(self, point: _Point) -> float:
        """What rounding leaves in F."""
        system = self.system
        size = system.body.sizes @ np.abs(point.r.ravel()) + np.abs(system.load)
        return _ROUNDING * (norm(size) + norm(system.weights[:, None] * point.lam))

    def at(self, r: Array) -> _Point | None:
        """F at a place; None where the bound has no value."""
        system, stiffness, active = self.system, self.system.body.per_area, self.system.active
        try:
            lam = system.multiplier(r)
            on = self.graphs.onto(stiffness * r + lam, r)
        except ProblemError:
            return None
        off = np.abs(on.multiplier - lam)
        if on.moved:
            off += stiffness * np.abs(on.place - r)
        missed = norm(system.weights[:, None] * np.where(active, off, 0.0))
        return _Point(r, lam, on, missed) if np.isfinite(missed) else None

    def lower(self, point: _Point, halvings: int) -> _Point | None:
        """The point after a step that lowers |F|; None where there is none."""
        system, on = self.system, point.on
        place = np.where(system.active, on.place, system.fixed)
        change = self.pieces.direction(system, on, system.active & ~on.held, system.out_of_balance(place))
        if change is None or not np.isfinite(change).all():
            return None
        way, length = place + change - point.r, 1.0
        for _ in range(halvings):
            new = self.at(point.r + length * way)
            if new is not None and new.off < (1.0 - _FALLS * length) * point.off:
                return new
            length *= 0.5
        return None


@dataclass(frozen=True, eq=False)
class _Way:
    """Where the method is.

    Attributes
    ----------
    start : State
        Where it began.
    equation, point : _Equation and _Point, or None
    rounds : int
        Newton's equations that were solved; counted from below zero once the bound was raised in parts.
    outer : State or None
        That of the fixed point, once it has taken over.
    """

    start: State
    equation: _Equation | None = None
    point: _Point | None = None
    rounds: int = 0
    outer: State | None = None
