"""Globalised semismooth Newton on the graphs of the laws: steps are halved until |F| falls, with fallbacks.

The equation is that of :mod:`hemivar.solvers.newton_on_graph`.  Where the law depends on the state there is no energy,
and |F| is what falls.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import check_numbers, expect
from hemivar.basics.arrays import COUNTS, norm
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws.vector_law import softens as law_softens
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget, Controls
from hemivar.solvers.fixed_point import FixedPoint
from hemivar.solvers.loop import iterate
from hemivar.solvers.multigrid import TIGHTEST, NonsmoothMultigrid, nested_guess
from hemivar.solvers.newton_on_graph import SEMISMOOTH, GraphEquation, GraphPoint
from hemivar.solvers.status import Status, check_interrupt
from hemivar.solvers.truncated_newton import TruncatedNewton
from hemivar.systems.body import Body
from hemivar.systems.contact_moves import Search
from hemivar.systems.contact_system import ContactSystem
from hemivar.systems.newton_equation import Accuracy
from hemivar.systems.workspace import Workspace

__all__ = ["SemismoothNewton"]

#: Its name on all unknowns.
SEMISMOOTH_MULTIGRID = "semismooth-multigrid"
#: Part of what is added up in F that is rounding.
_ROUNDING = 8.0 * float(np.finfo(float).eps)
#: Part of |F| that Newton's equation leaves where it is solved by iteration: while pieces change, and once they stay.
#: Twice or half the first, and a hundred times or part of the second, cost up to a tenth more cycles on small bodies.
_FIRST, _SETTLED = 0.1, 1e-3
#: Part of the load that a step of the fixed point leaves from where Newton's equation begins again.
_ROUGH = 1e-2
#: How often larger a whole step may make |F|: Newton's equation leads astray beyond that.
_ASTRAY = 10.0
#: Rounds, and the part of |F| that has to be gone after as many: else another way is thought better.
_PATIENCE, _GAINED = 5, 0.1
#: The least part of the bound by which it is raised.
_LEAST = 1.0 / 512.0


@dataclass(frozen=True)
class SemismoothNewton(Solver):
    """Newton's method for laws whose friction bound depends on penetration or pressure, such as Coulomb's.

    Nothing is frozen: the bound is a part of Newton's equation, by its derivatives (Alart and Curnier 1991; Hueeber,
    Stadler and Wohlmuth 2008).  The equation is that of the system of the method inside the fixed point: on the
    condensed body it is solved by LU factors, on all unknowns by minimal residuals, preconditioned with the multigrid
    cycle of the law whose bound is frozen.  A step is halved until ``|F|`` falls.  Where it does not, as in a body that
    nothing holds where it starts, or where glue of two energies softens and the whole step does not lower ``|F|``,
    Newton's equation begins again where one step of the fixed point leads.  Where that fails, the bound is raised from
    zero in parts, each solved from the one before.  Where that fails, too, or where the bound has no derivatives or the
    profile falls at once, the fixed point takes over.  ``solution.fallbacks`` counts.

    Where laws soften, a solution must be one that the method inside the fixed point would not leave, the bound being
    frozen; else the fixed point goes on from what that method finds.

    Parameters
    ----------
    fallback : FixedPoint
    rounds : int
        Newton's equations that are solved before another way is thought better.
    halvings : int
        How often a step may be halved.
    tolerance : float, optional
        Where minimal residuals end on all unknowns, relative to the load; a tenth of ``Controls.rtol`` by default.
    absolute : float
        What they may leave in addition, in units of force.
    settled : bool
        The pieces of the laws on which the initial guess lies are those that are expected in the end.
    """

    fallback: FixedPoint = field(default_factory=FixedPoint)
    rounds: int = 30
    halvings: int = 12
    tolerance: float | None = None
    absolute: float = 0.0
    settled: bool = False

    def __post_init__(self) -> None:
        expect(self.fallback, FixedPoint, "SemismoothNewton.fallback", "pass FixedPoint(NonsmoothNewton())")
        check_numbers(self)
        for name in ("rounds", "halvings"):
            if getattr(self, name) < 1:
                raise ProblemError(f"SemismoothNewton.{name} is {getattr(self, name)}; it must be at least 1")
        if not (self.fallback.condenses or isinstance(self.fallback.inner, NonsmoothMultigrid)):
            raise ProblemError(
                "SemismoothNewton needs a method on the condensed body or NonsmoothMultigrid, and "
                f"{self.fallback.inner.name} is neither; take FixedPoint itself"
            )

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name in tables."""
        return SEMISMOOTH if self.condenses else SEMISMOOTH_MULTIGRID

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

    @property
    def displaces(self) -> bool:  # type: ignore[override]
        """As the method inside the fixed point."""
        return self.fallback.displaces

    def refuse(self, problem: DiscreteProblem) -> str | None:
        return self.fallback.refuse(problem)

    def local_descent(self) -> Solver:
        return self.fallback.local_descent()  # which crosses no barrier

    def for_tolerance(self, rtol: float) -> Solver:
        fallback = self.fallback.for_tolerance(rtol)
        assert isinstance(fallback, FixedPoint)
        own = max(0.1 * rtol, TIGHTEST) if self.tolerance is None else self.tolerance
        return replace(self, fallback=fallback, tolerance=own)

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> object:
        return self.fallback.prepare(problem, workspace)

    @property
    def condenses(self) -> bool:
        return self.fallback.condenses

    def first_guess(self, system: ContactSystem, budget: Budget) -> tuple[Array, Status | None]:
        inner = self.fallback.inner
        if isinstance(system, Body) and isinstance(inner, NonsmoothMultigrid) and inner.nested:
            direct = replace(self, fallback=replace(self.fallback, inner=inner.direct))
            return nested_guess(self, direct, system, budget)
        return super().first_guess(system, budget)

    def begin(self, system: ContactSystem, start: State, budget: Budget) -> State:
        equation = GraphEquation.of(system)
        softens = bool(system.vectors.largest(float(law_softens(system.law) and system.law.depends_on_whole_state))[0])
        search = None if equation is None else _Search(equation, self._accuracy, softens)
        point = None if search is None else search.at(start.r)
        if search is None or point is None:
            return self._fixed(system, start, start, budget)
        memory = _Memory(start, search, replace(point, part=_SETTLED if self.settled else _FIRST))
        return self._at(system, point, memory, State(start.r, start.lam, 1))

    @property
    def _accuracy(self) -> Accuracy:
        """How accurately Newton's equation is solved in the end; before, as |F| must be to fall fast."""
        inner = self.fallback.inner
        if self.condenses or not isinstance(inner, TruncatedNewton):
            return Accuracy(0.0, 0.0, 1)
        return replace(inner.accuracy, tolerance=self.tolerance or TIGHTEST, absolute=self.absolute)

    def _at(self, system: ContactSystem, point: _Iterate, memory: _Memory, state: State) -> State:
        """The state at a point."""
        residual = system.residual(point.x, point.lam, point.force)
        energy = system.energy(point.x, point.lam, point.force)
        return State(
            point.x,
            point.lam,
            state.evaluations,
            energy=energy,
            residual=residual,
            memory=memory,
            fallbacks=state.fallbacks,
        )

    def step(self, system: ContactSystem, state: State, budget: Budget) -> State:
        memory: _Memory = state.memory
        if memory.outer is not None:
            return self._followed(system, memory, state, budget)
        search, point = memory.search, memory.point
        assert search is not None
        assert point is not None
        if search.rounded(point):
            return self._last(system, memory, state, budget)
        fallbacks, new = state.fallbacks, None
        if memory.rounds < self.rounds and not _creeps(memory.past):
            # Where glue lets go |F| creeps along; a step of the fixed point, whose energy falls, leads past that.
            tries = 1 if search.softens and not memory.frozen else self.halvings
            new = search.lower(point, tries, budget, math.inf if memory.frozen else _ASTRAY)
        if new is None and not memory.frozen:
            return self._frozen(system, memory, state, budget)
        if new is None:
            fallbacks += 1
            new = self._raised(search, memory.start.r, budget) if memory.rounds >= 0 else None
            memory = replace(memory, rounds=-self.rounds, past=())
        state = replace(state, evaluations=state.evaluations + (1 if new is None else new.cycles), fallbacks=fallbacks)
        if new is None:
            search.release()
            fixed = self._fixed(system, memory.start, state, budget)
            return self._followed(system, fixed.memory, fixed, budget)
        return self._at(system, new, memory.after(new), state)

    def _last(self, system: ContactSystem, memory: _Memory, state: State, budget: Budget) -> State:
        """A step from where |F| is rounding: what a pair misses its law by may be more, and may still fall."""
        assert memory.search is not None
        assert memory.point is not None
        new = memory.search.whole(memory.point, budget)
        ended = replace(state, ended=Status.STALLED)
        if new is None:
            return ended
        after = self._at(system, new, memory.after(new), replace(state, evaluations=state.evaluations + new.cycles))
        assert after.residual is not None
        assert state.residual is not None
        return after if after.residual.total < 0.5 * state.residual.total else ended

    def settle(self, system: ContactSystem, state: State, budget: Budget) -> State | None:
        memory: _Memory = state.memory
        law = system.law_at(state.r, state.lam)
        if memory.outer is not None or all((alpha == 0.0).all() for alpha in law.weak_convexity):
            return None
        inner, frozen = self.fallback.inner, system.with_law(law)
        begun = inner.begin(frozen, State(state.r, state.lam), budget)
        try:
            lower = inner.settle(frozen, begun, budget)
        finally:
            inner.release(begun)
        if lower is None and self._leads_there(frozen, memory.start, state, budget):
            return None
        if memory.search is not None:
            memory.search.release()
        start = memory.start if lower is None else State(lower.r, lower.lam)
        return self._fixed(system, start, state, budget)

    def _leads_there(self, frozen: ContactSystem, start: State, state: State, budget: Budget) -> bool:
        """Whether the method inside, where it crosses no barrier, leads to a state from the start, all being frozen."""
        inner = self.fallback.inner
        if not isinstance(inner, TruncatedNewton) or inner.search is Search.GLOBAL:
            return True
        begun = State(start.r, frozen.multiplier(start.r))
        end, status, _ = iterate(inner, frozen, begun, Controls(rtol=self.fallback.inner_rtol), budget)
        inner.release(end)
        check_interrupt(status)
        return frozen.stretch(end.r - state.r) <= COUNTS * frozen.stretch(state.r)

    def release(self, state: State) -> None:
        memory = state.memory
        if isinstance(memory, _Memory) and memory.outer is not None:
            self.fallback.release(memory.outer)
        elif isinstance(memory, _Memory) and memory.search is not None:
            memory.search.release()

    def _fixed(self, system: ContactSystem, start: State, state: State, budget: Budget) -> State:
        """The fixed point from a start, from now on."""
        outer = self.fallback.begin(system, start, budget)
        return replace(
            outer, evaluations=state.evaluations, memory=_Memory(start, outer=outer), fallbacks=state.fallbacks + 1
        )

    def _frozen(self, system: ContactSystem, memory: _Memory, state: State, budget: Budget) -> State:
        """A step of the fixed point, whose energy falls from any start; Newton's equation goes on from there."""
        assert memory.search is not None
        inner = self.fallback.inner
        inner = replace(inner, tolerance=0.1 * _ROUGH) if isinstance(inner, NonsmoothMultigrid) else inner
        rough = replace(self.fallback, inner=inner, inner_rtol=max(_ROUGH, self.fallback.inner_rtol))
        end = rough.step(system, rough.begin(system, memory.start, budget), budget)
        rough.release(end)
        end = replace(end, evaluations=state.evaluations + end.evaluations, fallbacks=state.fallbacks + 1)
        point = None if end.ended is not None else memory.search.at(end.r)
        if point is None:
            memory.search.release()
            return end if end.ended is not None else self._fixed(system, end, end, budget)
        return self._at(system, point, _Memory(State(end.r, end.lam), memory.search, point, frozen=True), end)

    def _followed(self, system: ContactSystem, memory: _Memory, state: State, budget: Budget) -> State:
        """A step of the fixed point."""
        assert memory.outer is not None
        outer = self.fallback.step(system, memory.outer, budget)
        return replace(outer, memory=replace(memory, outer=outer), fallbacks=state.fallbacks)

    def _raised(self, search: _Search, start: Array, budget: Budget) -> _Iterate | None:
        """The solution to which the one without friction leads while the bound is raised to what it is."""
        first = search.times(0.0)
        point = None if first is None else self._solved(first, start, budget)
        done, part = 0.0, 0.25
        while point is not None and done < 1.0:
            here = min(done + part, 1.0)
            raised = search.times(here)
            assert raised is not None
            new = self._solved(raised, point.x, budget)
            if new is not None:
                point, done, part = new, here, 2.0 * part
            elif part <= _LEAST:
                return None
            else:
                part *= 0.5
        return point

    def _solved(self, search: _Search, x: Array, budget: Budget) -> _Iterate | None:
        """The solution that Newton's equation leads to from a point."""
        point, cycles, past = search.at(x), 0, list[float]()
        for _ in range(self.rounds):
            if point is None or search.rounded(point):
                return None if point is None else replace(point, cycles=cycles)
            past.append(point.off)
            if _creeps(past):
                return None
            budget.check()
            point = search.lower(point, self.halvings, budget)
            cycles += 0 if point is None else point.cycles
        return None


@dataclass(frozen=True, eq=False)
class _Iterate(GraphPoint):
    """A point, and how far it is off the laws and its own equilibrium."""

    off: float = np.inf  # |F|, as a force
    cycles: int = 0  # what it cost to come there from the point before
    part: float = _FIRST  # of |F|, which Newton's equation leaves here


@dataclass(frozen=True, eq=False)
class _Search:
    """Steps of Newton's equation that lower |F|."""

    equation: GraphEquation
    accuracy: Accuracy
    softens: bool = False  # whether the law does, anywhere

    def times(self, part: float) -> _Search | None:
        """The search with a part of the bound; None where the law has none."""
        chart = self.equation.chart.bounded(part)
        return None if chart is None else replace(self, equation=replace(self.equation, chart=chart))

    def release(self) -> None:
        """Give the memory of Newton's equation back."""
        self.equation.equation.release()

    def rounded(self, point: _Iterate) -> bool:
        """Whether |F| is what rounding leaves of it in an answer; the sizes of a point are no smaller, and known."""
        system = self.equation.system
        if point.off > self._rounding(point, system.rounding_sizes(point.x)):
            return False
        return point.off <= self._rounding(point, system.answer_sizes(point.x))

    def _rounding(self, point: GraphPoint, sizes: Array) -> float:
        """What rounding leaves in F of what has these sizes."""
        system = self.equation.system
        return _ROUNDING * float(system.vectors.norms(sizes, system.weights[:, None] * point.lam).sum())

    def tells(self, point: GraphPoint) -> bool:
        """Whether |F| shows anything: it shows nothing so far away that rounding is a part of the load."""
        system = self.equation.system
        size = float(system.vectors.norms(system.weights[:, None] * point.lam)[0])
        return self._rounding(point, system.rounding_sizes(point.x)) <= COUNTS * system.load_scale.of(size)

    def at(self, x: Array, cycles: int = 0, force: Array | None = None) -> _Iterate | None:
        """A point with |F|, ``force`` being what is out of balance there; None where that is not known."""
        point, system = self.equation.at(x, force), self.equation.system
        if point is None or point.force is None:
            return None
        rest = system.less_contact(point.force, system.weights[:, None] * point.lam)
        off = norm(system.vectors.norms(self.equation.missed(point), rest))
        return _Iterate(**vars(point), off=off, cycles=cycles) if np.isfinite(off) else None

    def whole(self, point: _Iterate, budget: Budget) -> _Iterate | None:
        """The place after a whole step, wherever that leads."""
        step = self.equation.step(point, replace(self.accuracy, due=budget.due))
        budget.check()
        return None if step is None else self.at(step[0], step[2])

    def lower(self, point: _Iterate, halvings: int, budget: Budget, astray: float = math.inf) -> _Iterate | None:
        """The place after a step that lowers |F|; None where there is none, or where |F| grows beyond ``astray`` times
        itself along the whole of it."""
        accuracy = self.accuracy
        accuracy = replace(accuracy, absolute=accuracy.absolute + point.part * point.off, due=budget.due)
        step = self.equation.step(point, accuracy)
        budget.check()
        if step is None:
            return None
        (end, force, cycles), length, first = step, 1.0, point.x
        for halved in range(halvings):
            x = first + length * (end - first) if halved else end
            new = self.at(x, cycles, None if halved else self.equation.system.refreshed(x, force))
            if new is not None and new.off < (1.0 - 1e-4 * length) * point.off and self.tells(new):
                return replace(new, part=_part(point, new))
            if not halved and new is not None and new.off > astray * point.off:
                return None
            length *= 0.5
        return None


def _part(before: _Iterate, point: _Iterate) -> float:
    """See :class:`_Iterate`: less where what moves is what moved before, and |F| has fallen as it was solved."""
    moving = [np.einsum("mii->mi", one.on.jacobian) != 0.0 for one in (before, point)]  # entries beside may be rounding
    if not np.array_equal(*moving) or point.off > 2.0 * _FIRST * before.off:
        return _FIRST
    return _SETTLED if point.off > 2.0 * _SETTLED * before.off else 0.0


@dataclass(frozen=True, eq=False)
class _Memory:
    """Where the method is."""

    start: State  # where it began
    search: _Search | None = None
    point: _Iterate | None = None
    rounds: int = 0  # Newton's equations that were solved; counted from below zero once the bound was raised in parts
    frozen: bool = False  # whether it has begun anew from a solution with a frozen bound
    outer: State | None = None  # that of the fixed point, once it has taken over
    past: tuple[float, ...] = ()  # |F| at the points so far

    def after(self, point: _Iterate) -> _Memory:
        """One round further."""
        return replace(self, point=point, rounds=self.rounds + 1, past=(*self.past, point.off))


def _creeps(past: Sequence[float]) -> bool:
    """Whether |F| hardly falls any more."""
    return len(past) > _PATIENCE and past[-1] > (1.0 - _GAINED) * past[-1 - _PATIENCE]
