"""Arc-length control: steps of unknown load factor, by dissipated energy or by an opening that is given.

Where glue lets go the load that a joint carries may have to fall, and displacements with it: a snap-back. No time that
loads follow leads through it.  Here the loads are those of a time that is an answer, the load factor (Riks 1979;
Gutierrez 2004).  A step solves, with the memory of the contact points as it was before it,

    A r + W lam = g_0 + (factor - factor_0) g_1,    lam in dj(memory; r),    c(r, lam) = goal

in Minty's chart of the laws, ``p = a r + lam``, by Newton's method for p and the factor together.  The goal is

* of ``"dissipation"`` an increment of ``sum w (lam_0.r - lam.r_0)/2``: what glue that unloads along secants to the
  origin dissipates on a straight way from the pair ``r_0, lam_0`` to ``r, lam`` (Verhoosel, Remmers, Gutierrez 2009).
  Unloading makes none, and so it leads onwards alone.  Where nothing dissipates the load factor is given instead;
* of an opening the largest one of a boundary.

The time of such a march is no physical one.  While nothing dissipates it runs as the load factor does. From there on
energy is dissipated at the rate at which the load was storing it, twice: ``2 E/factor``; or more slowly where the load
factor falls or rises faster than time.  With an opening time is that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from hemivar.basics.arguments import described, quoted
from hemivar.basics.arrays import COUNTS, ROUNDED, SOLVED, norm
from hemivar.basics.deadline import check_time
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.evolution.evolution_problem import Evolution
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.schemes import ImplicitEuler, Scheme
from hemivar.evolution.stage import Stage, discrete_stage, stage_state
from hemivar.evolution.state import LoadControl, TimeState
from hemivar.evolution.step_end import SolvedStage, with_products
from hemivar.evolution.step_laws import stage_law
from hemivar.evolution.stepper import AHEAD, StepResult, TimeStepper
from hemivar.evolution.steps import FixedStep, StepSizeController
from hemivar.solvers import Solution, Status
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.newton_on_graph import SEMISMOOTH, GraphEquation
from hemivar.systems.condensed import CondensedProblem

__all__ = ["DISSIPATION", "Control", "ControlledStepper", "control_of", "refuse_control"]

#: The control by what is dissipated.
DISSIPATION = "dissipation"
#: Newton's equations of a step at most.
_ROUNDS = 15
#: Change of a displacement, as a part of its size, that may be left where it falls no more.
_STILL = 1e-7
#: Weight of the law of a component that a support holds.
_HELD = 1e-12
#: By how much the load factor may fall in a step, in units of its length, and how often a step is cut for that.
_FALLS, _CUTS = 1.1, 4
#: How far pairs are taken outward for a guess. With two of them steps no longer lead over every peak of the tests.
_OUTWARD = (1e-6, 1e-3, 1e-2, 5e-2, 0.2)
#: Parts of the load of a first opening, as if the body were linear, by which its direction is sought.
_SMALL = tuple(10.0**-k for k in range(1, 5))
#: What memories dissipate in a step, in parts of what a straight way does: beyond these it led elsewhere.
#: The tests pass with 0.8 for the first as well.
_LEAST, _MOST = 0.5, 2.5
#: Its multiples, less whole numbers, fill an interval evenly and meet no period of a load.
_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)
#: Part of the most that glue carried at which it counts as broken.
_BROKEN = 1e-2


@dataclass(frozen=True)
class Control:
    """What is given in the place of the load factor: what is dissipated, or the opening of a contact boundary."""

    opening: str | None = None

    @property
    def stated(self) -> str | dict[str, str]:
        """It as it is given."""
        return DISSIPATION if self.opening is None else {"opening": self.opening}


def control_of(given: object) -> Control | None:
    """The control of a march as it is given: None, ``"dissipation"``, or ``{"opening": name}``."""
    if given is None or isinstance(given, Control):
        return given
    if isinstance(given, str) and given == DISSIPATION:
        return Control()
    if isinstance(given, Mapping) and set(given) == {"opening"} and isinstance(given["opening"], str):
        return Control(given["opening"])
    shown = quoted(given) if isinstance(given, str) else described(given)
    raise ProblemError(f"control is {shown}; give '{DISSIPATION}', or {{'opening': name}} of a contact boundary")


def refuse_control(
    stated: Evolution, control: Control, scheme: Scheme, step: StepSizeController, jump: SelectionRule
) -> None:
    """Refuse what does not go with a load factor that is unknown: rates, heat, bodies that are not linear."""
    material = stated.problem.material
    why = ""
    if stated.inertia:
        why = "has mass"
    elif material.viscous:
        why = "has viscosity"
    elif stated.heat is not None or material.capacity is not None:
        why = "has heat"
    elif not stated.linear:
        why = "is not linear"
    if why:
        raise ProblemError(
            f"control = ... looks for the load factor of an elastic body in equilibrium, and this one {why}; leave "
            "either out"
        )
    for name, contact in stated.problem.contact.items():
        rates = contact.damping is not None or any(part.iterates or not part.of_state for part in contact.remembers)
        if rates:
            raise ProblemError(
                f"control = ... has no time that rates could refer to, and contact '{name}' has a damping, or a memory "
                "other than that of glue; leave either out"
            )
    if control.opening is None and not any(contact.remembers for contact in stated.problem.contact.values()):
        raise ProblemError(
            f"control = '{DISSIPATION}' needs glue that remembers its damage, and nothing dissipates here; leave "
            "memory = () out, or give {'opening': name}"
        )
    if "law" in stated.problem.time_dependent:
        raise ProblemError("control = ... takes t for the load factor, and a law depends on t; leave t out of laws")
    if not isinstance(scheme, ImplicitEuler):
        raise ProblemError(f"control = ... goes with the scheme {ImplicitEuler.name}, not {scheme.name}; leave it out")
    if not isinstance(step, FixedStep):
        raise ProblemError("control = ... chooses no steps by an error in time; give a length of steps")
    if jump not in (SelectionRule.LOCAL, SelectionRule.STOP):
        raise ProblemError(f"control = ... leads around jumps, and jump = '{jump}' would choose one; leave it out")


@dataclass(frozen=True, eq=False)
class _Pair:
    """Displacements and multipliers (m, c) of contact points in equilibrium, at a load factor."""

    r: Array
    lam: Array
    factor: float
    rounds: int = 0


#: What a step misses, as a part of what is given, and its derivatives by r, lam (m, c) and the factor.
_Border = Callable[[_Pair], tuple[float, Array, Array, float]]


@dataclass(frozen=True, eq=False)
class _FrozenStep:
    """The equilibria of a step over the load factor, memories being what they are before it."""

    equation: GraphEquation
    start: _Pair
    #: Of balance and held components, by the factor.
    rate: Array  # (m c,)
    fixed_rate: Array  # (m, c)
    #: Components whose secants count.
    secant: BoolArray  # (m, c)

    @property
    def system(self) -> CondensedProblem:
        system = self.equation.system
        assert isinstance(system, CondensedProblem)
        return system

    @property
    def spread_weights(self) -> Array:
        """Weights (m, 1)."""
        return self.system.weights[:, None]

    def spent(self, pair: _Pair) -> float:
        """What is dissipated on the way to a pair, as if it were straight."""
        by_r, by_lam = self._dissipating
        return float((by_r * pair.r).sum() + (by_lam * pair.lam).sum())

    # ---- what is given -----------------------------------------------------------------------------------

    def load(self, change: float) -> _Border:
        """A change of the load factor."""
        zero, start = np.zeros(self.system.shape), self.start.factor
        return lambda pair: ((pair.factor - start) / change - 1.0, zero, zero, 1.0 / change)

    def dissipation(self, goal: float) -> _Border:
        """What is dissipated."""
        by_r, by_lam = (part / goal for part in self._dissipating)
        return lambda pair: (self.spent(pair) / goal - 1.0, by_r, by_lam, 0.0)

    @property
    def _dissipating(self) -> tuple[Array, Array]:
        """Derivatives of what is dissipated by r and lam."""
        half = 0.5 * self.spread_weights * self.secant
        return half * self.start.lam, -half * self.start.r

    def opened(self, points: IntArray, pair: _Pair) -> float:
        """By how much the largest opening of some contact points grows."""
        return float(self.start.r[points, 0].min() - pair.r[points, 0].min())

    def opening(self, points: IntArray, change: float) -> _Border:
        """A growth of the largest opening of some contact points."""
        zero = np.zeros(self.system.shape)

        def border(pair: _Pair) -> tuple[float, Array, Array, float]:
            by_r = zero.copy()
            by_r[points[int(np.argmin(pair.r[points, 0]))], 0] = -1.0 / change
            return self.opened(points, pair) / change - 1.0, by_r, zero, 0.0

        return border

    # ---- Newton's method -----------------------------------------------------------------------------------

    def ahead(self, increment: tuple[Array, Array, float], part: float) -> _Pair:
        """What lies a part of a way beyond the start."""
        slid, pressed, factor = increment
        start = self.start
        return _Pair(start.r + part * slid, start.lam + part * pressed, start.factor + part * factor)

    def outward(self, part: float) -> _Pair:
        """The start, all pairs a little farther from the origin: where glue that was damaged before softens on."""
        return self.ahead((self.start.r, self.start.lam, 0.0), part)

    @property
    def guesses(self) -> tuple[_Pair, ...]:
        """The start, and pairs farther outward."""
        return self.start, *map(self.outward, _OUTWARD)

    def increment(self, pair: _Pair) -> tuple[Array, Array, float]:
        """The way from the start to a pair."""
        return pair.r - self.start.r, pair.lam - self.start.lam, pair.factor - self.start.factor

    def yields(self, change: float) -> float:
        """How far points go where the load factor changes, by the slopes at the start."""
        a, (_, by_r, by_lam, by_factor) = self.equation.stiffness, self.load(change)(self.start)
        on = self.equation.chart.at(a * self.start.r + self.start.lam)
        response = self._change(on.jacobian, np.zeros(self.system.shape), -1.0, (by_r, by_lam, by_factor))
        return 0.0 if response is None else _largest(response[0] / a)

    def solved(self, guess: _Pair, border: _Border) -> _Pair | None:
        """The equilibrium near a guess at which a border is zero; None where Newton's method does not find it."""
        a, stands = self.equation.stiffness, False
        p, factor, last = a * guess.r + guess.lam, guess.factor, np.inf
        before = _largest(self.start.r + self.start.lam / a)
        for number in range(1, _ROUNDS + 1):
            check_time()
            try:
                on = self.equation.chart.at(p)
            except ProblemError:
                return None
            pair = _Pair(on.r, on.multiplier, factor, number)
            missed, by_r, by_lam, by_factor = border(pair)
            balance, size = self._balance(pair)
            if stands:  # what the last step left is not handed on to the next
                return pair if norm(balance) <= 1e-9 * size else None
            change = self._change(on.jacobian, balance, missed, (by_r, by_lam, by_factor))
            if change is None:
                return None
            step, more = change
            # As far as the place moves, in displacements; what is rounding falls no more.
            far, moved = max(before, _largest(p / a), _largest((p + step) / a)), _largest(step / a)
            moved /= far or 1.0
            stands = abs(missed) <= COUNTS and (moved <= ROUNDED or (moved <= _STILL and moved >= 0.5 * last))
            p, factor, last = p + step, factor + more, moved
        return None

    def _balance(self, pair: _Pair) -> tuple[Array, float]:
        """What is out of balance (m, c), and the size of what is added up in it."""
        system, weights, start = self.system, self.spread_weights, self.start
        since = pair.factor - start.factor
        stretched, pressed = (system.matrix @ pair.r.ravel()).reshape(system.shape), weights * pair.lam
        load = (system.load + since * self.rate).reshape(system.shape)
        balance = stretched + pressed - load
        stiff = weights * self.equation.stiffness
        fixed = system.fixed + since * self.fixed_rate
        left = np.where(system.active, balance, stiff * (pair.r - fixed) + _HELD * pressed)
        return left, norm(stretched) + norm(pressed) + norm(load) + norm(stiff * pair.r)

    def _change(
        self, jacobian: Array, balance: Array, missed: float, by: tuple[Array, Array, float]
    ) -> tuple[Array, float] | None:
        """The change of p (m, c) and of the factor; None where nothing tells it."""
        system, a, weights = self.system, self.equation.stiffness, self.spread_weights
        m, c = system.shape
        every, n = np.arange(m), m * c
        by_r, by_lam, by_factor = by
        rest = np.eye(c) - a[:, :, None] * jacobian  # of lam in p
        matrix = np.zeros((n + 1, n + 1))
        pulled = np.matmul(system.matrix.reshape(n, m, c).transpose(1, 0, 2), jacobian).transpose(1, 0, 2)
        matrix[:n, :n] = pulled.reshape(n, n)
        blocks = np.where(
            system.active[:, :, None],
            weights[:, :, None] * rest,
            weights[:, :, None] * (a[:, :, None] * jacobian + _HELD * rest),
        )
        inner = np.zeros((m, c, m, c))
        inner[every, :, every, :] = blocks
        matrix[:n, :n] += inner.reshape(n, n)
        load = np.where(system.active, self.rate.reshape(m, c), weights * a * self.fixed_rate)
        matrix[:n, n] = -load.ravel()
        row = np.einsum("mi,mij->mj", by_r, jacobian) + np.einsum("mi,mij->mj", by_lam, rest)
        matrix[n, :n], matrix[n, n] = row.ravel(), by_factor
        scale = np.abs(matrix).max(axis=1)
        if not (scale > 0.0).all():
            return None
        try:
            change = np.linalg.solve(matrix / scale[:, None], -np.append(balance.ravel(), missed) / scale)
        except np.linalg.LinAlgError:
            return None
        return (change[:n].reshape(m, c), float(change[n])) if np.isfinite(change).all() else None


@dataclass(frozen=True, eq=False)
class ControlledStepper(TimeStepper):
    """Takes steps of an evolution whose load factor is unknown."""

    control: Control = field(kw_only=True)
    #: Load factors between which what acts is looked at.
    span: tuple[float, float] = field(kw_only=True)

    @classmethod
    def over(cls, stepper: TimeStepper, control: Control, until: float) -> Self:
        """That of an evolution, whose loads must be straight lines over the time."""
        discrete = stepper.discrete
        made = cls(
            discrete, stepper.scheme, stepper.stages, stepper.operators, stepper.data, control=control,
            span=(discrete.evolution.start, until),
        )  # fmt: skip
        if discrete.branches:
            raise ProblemError(
                "control = ... looks for the load factor of an elastic body in equilibrium, and the branches of this "
                "one relax; leave either out"
            )
        if not discrete.vectors.alone:
            raise ProblemError("control = ... is for one process; leave the engine out")
        if control.opening is not None:
            discrete.problem.contact.on(control.opening)
        low = made.span[0]
        made._refuse_bent(*(low + (number * _GOLDEN % 1.0) * (until - low) for number in range(1, 9)), until)
        return made

    @cached_property
    def _reach(self) -> float:
        """A distance of load factors over which what acts grows by its own size, or the whole one."""
        low, high = self.span
        parts = [(_largest(two - one), _largest(one)) for one, two in zip(*map(self._acting, self.span), strict=True)]
        grown = max(growth / size if size else np.inf * growth if growth else 0.0 for growth, size in parts)
        if not grown:
            raise ProblemError(
                "control = ... takes t for the load factor, and no load, support or gap grows with t; state it as a "
                "multiple of t"
            )
        return (high - low) * max(1.0, 1.0 / grown)

    def _acting(self, factor: float) -> tuple[Array, Array, Array]:
        data = self.data.at(factor)
        return data.load, data.prescribed, data.offset

    def _refuse_bent(self, *factors: float) -> None:
        """Refuse what acts where it is no straight line over the load factor, or stays as it is."""
        low, reach = self.span[0], self._reach
        first, far = self._acting(low), self._acting(low + reach)
        for factor in factors:
            part = (factor - low) / reach
            for one, two, there in zip(first, far, self._acting(factor), strict=True):
                size = max(map(_largest, (one, two, there, part * (two - one))))
                if _largest(there - one - part * (two - one)) > SOLVED * size:
                    raise ProblemError(
                        f"control = ... takes t for the load factor, and a load, support or gap bends over t, at t = "
                        f"{factor:.6g} or before; state it as a multiple of t"
                    )

    # ---- what is reported --------------------------------------------------------------------------------------

    def known(self, state: TimeState) -> LoadControl:
        """What a state knows of the load factor."""
        if state.control is not None:
            return state.control
        none = np.zeros_like(state.multiplier)
        return LoadControl(self.span[0], 0.0, 0.0, self._carried(state), 0.0, 0.0, 0.0, none, none)

    def extra_columns(self, state: TimeState) -> dict[str, float]:
        return {"load_factor": self.known(state).factor}

    def broken(self, state: TimeState) -> bool:
        """Whether glue has dissipated, and carries next to nothing of the most that it carried."""
        known = self.known(state)
        lost = state.ledger.memory > SOLVED * known.pace * known.largest
        return lost and self._carried(state) <= _BROKEN * known.carried

    def _carried(self, state: TimeState) -> float:
        """What glue holds the body with: tension and shear, not what presses it."""
        holds = state.multiplier.copy()
        np.minimum(holds[:, 0], 0.0, out=holds[:, 0])
        weights = self.discrete.problem.contact.weights[:, None]
        return max(
            (norm((weights * holds)[at]) for name, at in self.discrete.blocks if name in state.memory), default=0.0
        )

    # ---- a step ----------------------------------------------------------------------------------------------

    def take(
        self, before: TimeState, step: float, end_time: float | None = None, jump: SelectionRule = SelectionRule.LOCAL
    ) -> StepResult:
        """One step; see :meth:`TimeStepper.take`."""
        before = with_products(self.discrete, before)
        known = self.known(before)
        (operator,) = self.operators.of(step, None)
        start = self.data.at(known.factor)
        guess = self.discrete.counted(before.local.displacement, before.local.displacement)
        law = stage_law(self.discrete, start, before, operator.rule, step, guess, before.multiplier, operator.laws)

        def stage_at(factor: float) -> Stage:
            end = self.data.at(factor)
            return discrete_stage(self.discrete, self.stages.bodies, before, operator, end, end, start, law)

        # Loads are straight lines: from one end or the other nothing cancels.
        low, high = self.span[0], self.span[0] + self._reach
        other = low if abs(known.factor - low) > abs(known.factor - high) else high
        frozen = self._frozen(before, known, stage_at(known.factor), stage_at(other), other - known.factor)
        pair = None if frozen is None else self._pair(frozen, known, before, step)
        factor = known.factor if pair is None else pair.factor
        self._refuse_bent(factor)
        stage = stage_at(factor)
        most = 0.0 if frozen is None else known.largest * norm(frozen.rate)
        solved = self._solved_stage(stage, before, pair, most)
        time = before.time + step if end_time is None else end_time
        taken = self._balanced(self._ended(before, [solved], step, time, self.data.at(factor)), [solved])
        if frozen is None or pair is None or taken.status is not Status.CONVERGED:
            return taken
        spent, ledger, gone = frozen.spent(pair), taken.state.ledger, abs(pair.factor - self.span[0])
        given = _is_step(pair.factor - known.factor, step)
        if not self._straight(known.pace * step, spent, ledger.memory - before.ledger.memory, given):
            return replace(taken, solutions=(replace(taken.solutions[0], status=Status.STALLED),))
        largest = max(known.largest, gone)
        # At the first step the body is elastic: what it stores of the growth alone is a square of the factor.
        pace = known.pace / known.largest if known.pace else 2.0 * self._stored(before, taken.state) / gone**2
        control = LoadControl(
            pair.factor,
            pace * largest,
            largest,
            max(known.carried, self._carried(taken.state)),
            step,
            pair.factor - known.factor,
            spent,
            *frozen.increment(pair)[:2],
        )
        return replace(taken, state=replace(taken.state, control=control))

    def _stored(self, before: TimeState, after: TimeState) -> float:
        """Energy of the change from one state to another, as if it were alone."""
        one, other = before.body, with_products(self.discrete, after).body
        assert one.stiffness_force is not None
        assert other.stiffness_force is not None
        stretched = (other.displacement - one.displacement) @ (other.stiffness_force - one.stiffness_force)
        moved, pressed = after.local.displacement - before.local.displacement, after.multiplier - before.multiplier
        weights = self.discrete.problem.contact.weights[:, None]
        return 0.5 * max(float(stretched) + float((weights * moved * pressed).sum()), 0.0)

    def _frozen(
        self, before: TimeState, known: LoadControl, first: Stage, second: Stage, apart: float
    ) -> _FrozenStep | None:
        workspace, problem = self.stages.workspace, first.problem
        system = workspace.condensed(problem, many=True)
        other = system.for_problem(second.problem)
        law = problem.law
        equation = GraphEquation.of(system, law.curve_above if law.depends_on_whole_state else law.weak_convexity)
        if equation is None:
            raise ProblemError(
                f"control = ... follows laws that are curves beside the body, and '{problem.law.name}' falls at once; "
                "give its drop a slope"
            )
        secant = np.zeros(system.shape, dtype=bool)
        for name, index in self.discrete.blocks:
            secant[index] = name in before.memory
        secant[:, 1:] &= self.discrete.follows_slip[:, None]
        start = _Pair(before.local.displacement - first.origin, before.multiplier, known.factor)
        rate, fixed_rate = (other.load - system.load) / apart, (other.fixed - system.fixed) / apart
        return _FrozenStep(equation, start, rate, fixed_rate, secant)

    def _straight(self, goal: float, spent: float, lost: float, given: bool) -> bool:
        """Whether what memories dissipated in a step agrees with what is dissipated on a straight way there.

        A step whose load factor was given may dissipate nothing.
        """
        if self.control.opening is not None or not goal:
            return True
        return lost <= _MOST * max(spent, goal) and (given or lost >= _LEAST * spent)

    def _pair(self, frozen: _FrozenStep, known: LoadControl, before: TimeState, step: float) -> _Pair | None:
        """The next equilibrium."""
        increment = known.slid, known.pressed, known.moved
        on = frozen.ahead(increment, min(step / known.step, AHEAD) if known.step else 0.0)
        if self.control.opening is not None:
            return self._opening(frozen, on if known.step else None, step, self.control.opening)
        goal = known.pace * step
        if known.spent > 0.0 and not _is_step(known.moved, known.step):
            pair = self._dissipating(frozen, goal, step, increment, known.spent)
            if pair is not None and pair.factor <= known.factor + step:
                return pair
        load = frozen.load(step)
        loaded = frozen.solved(on, load) or frozen.solved(frozen.start, load)
        if loaded is None:
            return self._dissipating(frozen, goal, step) if known.pace else None
        spent = frozen.spent(loaded)
        if spent <= (1.0 + COUNTS) * goal or not known.pace:
            return loaded
        return self._dissipating(frozen, goal, step, frozen.increment(loaded), spent)

    def _opening(self, frozen: _FrozenStep, on: _Pair | None, step: float, boundary: str) -> _Pair | None:
        """The equilibrium at which a boundary has opened by a step: sought from where the last step leads.

        At first there is none, and a small load tells the direction.
        """
        points = self.discrete.problem.contact.on(boundary)
        border = frozen.opening(points, step)
        if on is None:
            load = step / max(frozen.yields(self._reach), np.finfo(float).tiny) * self._reach
            tried = (frozen.solved(frozen.start, frozen.load(part * load)) for part in _SMALL)
            loaded = next((pair for pair in tried if pair is not None), None)
            if loaded is None:
                return None
            increment, grown = frozen.increment(loaded), frozen.opened(points, loaded)
            if grown <= SOLVED * _largest(increment[0]):
                raise ProblemError(
                    f"control = {{'opening': '{boundary}'}} needs loads that open '{boundary}' as t grows, and these "
                    "do not; turn their sign, or name a boundary that opens"
                )
            on = frozen.ahead(increment, step / grown)
        return next(filter(None, (frozen.solved(guess, border) for guess in (on, *frozen.guesses))), None)

    def _dissipating(
        self,
        frozen: _FrozenStep,
        goal: float,
        step: float,
        increment: tuple[Array, Array, float] | None = None,
        spent: float = 1.0,
    ) -> _Pair | None:
        """The equilibrium at which that is dissipated, or less where the load factor falls by more than the step.

        It is sought along a way on which so much was dissipated, and at the start.
        """
        pair = None
        for _ in range(_CUTS):
            guesses = [] if increment is None else [frozen.ahead(increment, min(goal / spent, AHEAD))]
            border, guesses = frozen.dissipation(goal), [*guesses, *frozen.guesses[1:]]
            pair = next(filter(None, (frozen.solved(guess, border) for guess in guesses)), None)
            fall = 0.0 if pair is None else frozen.start.factor - pair.factor
            if fall <= _FALLS * step:
                return pair
            goal *= step / fall
        return None

    def _solved_stage(self, stage: Stage, before: TimeState, pair: _Pair | None, most: float) -> SolvedStage:
        """A pair as the solution of its stage; where there is none the state before, which solves nothing.

        Near the end next to nothing acts: what is left is held against the most that did, ``most``.
        """
        size = max(self.stages.size(stage), most)
        system, controls = self.stages.workspace.condensed(stage.problem, many=True), self.stages.controls
        r, lam = (before.local.displacement - stage.origin, before.multiplier) if pair is None else (pair.r, pair.lam)
        unknowns, (residual, *_) = system.recover(r, lam)
        good = pair is not None and residual.below(controls.within(controls.rtol * size).atol, controls.rtol)
        solution = Solution(
            stage.problem, unknowns, lam,
            Status.CONVERGED if good else Status.STALLED if pair is None else Status.INACCURATE,
            residual,
            method=SEMISMOOTH if stage.problem.law.state_dependent else NonsmoothNewton.name,
            steps=0 if pair is None else pair.rounds,
        )  # fmt: skip
        point = stage.local_motion(stage.local(solution))
        return SolvedStage(stage, solution, stage_state(self.discrete, stage, unknowns), point, lam)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))


def _is_step(moved: float, step: float) -> bool:
    """Whether a load factor moved by a whole step."""
    return abs(moved - step) <= SOLVED * step
