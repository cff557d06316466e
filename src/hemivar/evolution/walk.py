"""Gradient flow of the condensed body (Schur complement on contact points), by implicit steps that grow.

The energy is followed along its gradient in a norm: that of the body, or of springs at its contact points where it
has free motions.  A step is an equilibrium against a resistance in that norm.  It counts if it is a strict minimiser,
and the energy with the resistance bends downwards nowhere on the straight way: then no barrier is crossed.  The
resistance is eased after a step that counts and grows after one that does not, until each step has one solution.  Where
a step without resistance counts the body has come to rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import norm
from hemivar.basics.deadline import Budget, check_time
from hemivar.basics.types import Array
from hemivar.evolution.barrier import PARTS, bends_downwards
from hemivar.evolution.descent import AWAY, FLOW_STEPS, TIGHT
from hemivar.laws.vector_law import weak_convexity_at
from hemivar.solvers import Controls, NonsmoothNewton, Solution, Status
from hemivar.solvers.base import State
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton_on_graph import FEW_ROUNDS, SEMISMOOTH, GraphEquation, GraphPoint, stands
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.newton_equation import Accuracy

__all__ = ["Walk"]

_DIRECT = Accuracy(0.0, 0.0, 1)
#: What goes downhill where a bound is held, and to which tolerance.
_SEARCH, _HELD = NonsmoothNewton().local_descent(), Controls(rtol=1e-6)


@dataclass(frozen=True, eq=False)
class Walk:
    """A gradient flow of a condensed body."""

    system: CondensedProblem
    #: Of a unit of the resistance, (m d, m d).
    norm: Array
    #: The resistance with which each step has one solution.
    most: float
    controls: Controls
    #: By how much the resistance is eased at most and at least, and how it grows. The tests pass with 4 and with 32 for
    #: the first.
    eases: float = 8.0
    eases_at_least: float = 1.3
    grows: float = 4.0
    #: Part of the tolerance of the whole that a step may miss.
    missed: float = 0.1
    #: Bounds that are held one after another in a step, at most.
    frozen: int = 4

    def down(self, r: Array, lam: Array) -> Solution | None:
        """The minimiser that is reached from a place near a pair (m, d); None where steps do not settle."""
        resistance, wait, left, eased, ease = self.most / self.eases**2, 1, 1, 1.0, self.eases
        budget = Budget(self.controls.max_time)
        for _ in range(FLOW_STEPS):
            check_time()
            if budget.due():
                return self._solution(r, lam, Status.MAX_TIME)
            left -= 1
            if left <= 0:
                undamped = self._step(r, lam, 0.0)
                ended = None if undamped is None else self._solution(undamped.x, self._multiplier(undamped))
                if ended is not None:
                    return ended
                left = wait = 2 * wait
            point = self._step(r, lam, resistance, eased == 1.0)
            if point is None:  # back to what the last step stood against; if that fails, beyond
                resistance, ease = (
                    (eased if eased > 1.0 else self.grows) * resistance,
                    max(math.sqrt(ease), self.eases_at_least),
                )
                eased = 1.0
                if resistance > self.grows * self.most:
                    return None
                continue
            before, r, lam = r, point.x, point.on.multiplier
            off, allowed = resistance * norm(self.norm @ (r - before).ravel()), self._tolerance(lam)
            if off <= TIGHT * allowed:
                return self._solution(r, self._multiplier(point))
            if self._falls_for_ever(point, r - before):
                return self._solution(r, self._multiplier(point), Status.NOT_CARRIED)
            left = 1 if off <= allowed else left
            ease = min(ease**2, self.eases) if eased > 1.0 else ease
            resistance, eased = resistance / ease, ease
        return None

    def _tolerance(self, lam: Array) -> float:
        size = self.system.problem.loading.load_size + norm(self.system.weights[:, None] * lam)
        return self.controls.atol + self.controls.rtol * size

    def _step(self, r: Array, lam: Array, resistance: float, thorough: bool = False) -> GraphPoint | None:
        """A step against a resistance; None where it does not count.

        ``thorough``: where a bound follows the state, whether it may be held meanwhile.
        """
        system = self.system if resistance == 0.0 else self.system.resisted(resistance * self.norm, r)
        point = self._newton(system, r, lam)
        if point is None and thorough and system.law.state_dependent:
            point = self._frozen_first(system, r, lam)
        if point is None:
            return None
        law, increment = system.law.frozen(point.x, point.on.multiplier), point.x - r
        body = np.full(PARTS, float(increment.ravel() @ (system.matrix @ increment.ravel())))
        counts = stands(system, point.x, point.on.multiplier)
        return point if counts and not bends_downwards(law, system.weights, r, point.x, body) else None

    def _newton(self, system: CondensedProblem, r: Array, lam: Array) -> GraphPoint | None:
        """Where Newton's equations lead from a pair; None where they do not settle."""
        equation = GraphEquation.of(system, weak_convexity_at(system.law, r))
        point = None if equation is None else equation.begin(np.where(system.active, r, system.fixed), lam)
        for _ in range(FEW_ROUNDS):
            change = None if point is None or equation is None else equation.step(point, _DIRECT)
            point = None if change is None or equation is None else equation.at(*change[:2])
            if point is None or equation is None or not math.isfinite(missed := norm(equation.missed(point))):
                return None
            if missed <= self.missed * self._tolerance(point.on.multiplier):
                return point
        return None

    def _frozen_first(self, system: CondensedProblem, r: Array, lam: Array) -> GraphPoint | None:
        """The same where the sets of a bound that follows the state go round: from where the bound, held, leads."""
        for _ in range(self.frozen):
            frozen = system.with_law(system.law.frozen(r, lam))
            begin, budget = State(r, frozen.multiplier(r)), Budget(self.controls.max_time)
            state, status, _ = iterate(_SEARCH, frozen, begin, _HELD, budget)
            if status is not Status.CONVERGED:
                return None
            r, lam = state.r, np.where(system.active, frozen.law.nearest_multiplier(state.r, state.lam), state.lam)
            point = self._newton(system, r, lam)
            if point is not None:
                return point
        return None

    def _multiplier(self, point: GraphPoint) -> Array:
        """That of the laws at a place, and of supports what they hold."""
        return np.where(self.system.active, point.on.multiplier, point.lam)

    def _solution(self, r: Array, lam: Array, status: Status | None = None) -> Solution | None:
        """What a pair (m, d) comes to; None where it is no equilibrium."""
        system = self.system
        u, (residual, *_) = system.recover(r, lam)
        if status is None and not residual.below(self.controls.atol, self.controls.rtol):
            return None
        name = SEMISMOOTH if system.law.state_dependent else NonsmoothNewton.name
        return Solution(system.problem, u, lam, status or Status.CONVERGED, residual, name, 1)

    def _falls_for_ever(self, point: GraphPoint, increment: Array) -> bool:
        """Whether the energy still falls where a way leads on to, many times the size of the body away, on the same
        pieces of all laws."""
        system, far = self.system, float(np.abs(increment).max(initial=0.0))
        field = system.problem.field
        if field is None or not len(system.rigid_modes) or not far > 0.0:
            return False
        r = point.x + AWAY * float(np.ptp(field.nodes, axis=0).max()) / far * increment
        law = system.law.frozen(r, point.on.multiplier)
        if not np.array_equal(law.clamp(point.x, r), r):
            return False
        force = system.out_of_balance(r) - system.weights[:, None] * law.linearise(r).gradient
        return float((force * increment).sum()) > 0.0
