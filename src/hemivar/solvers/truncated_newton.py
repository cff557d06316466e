"""Truncated nonsmooth Newton over any contact system: an active-set step and a line search; the energy never rises."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from hemivar.basics.arrays import COUNTS, ROUNDED
from hemivar.basics.types import Array
from hemivar.discrete.residual import Residual
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget, OutOfTime
from hemivar.solvers.line_search import ENERGY_ROUNDING, LineEnd, SearchLine, energy_scale
from hemivar.solvers.status import Status
from hemivar.systems.contact_moves import Search, best_component, diagonal_step, snap_to_kinks
from hemivar.systems.contact_system import ContactSystem
from hemivar.systems.newton_equation import Accuracy, LinearisedPoint, NewtonEquation

__all__ = ["NewtonMemory", "TruncatedNewton", "lower_energy"]

#: Part of the residual below which it has fallen in a step; how much closer Newton's equation is solved else, and most.
#: Half and twice of each cost the same steps and cycles to 1 % on small bodies.
_FALLS, _CLOSER, _CLOSEST = 0.9, 0.3, 1e-4


@dataclass(frozen=True, eq=False)
class NewtonMemory:
    """What the method keeps between its steps."""

    factor: float  # how much stiffer than its diagonal the body is made for diagonal minimisations
    force: Array  # of the shape of a point: load minus elastic force
    equation: NewtonEquation
    settled: bool = False  # whether the next step begins with Newton's equation
    # how much less than the contact conditions are off Newton's equation leaves: less after each step that did not
    # lower the residual
    share: float = 1.0


@dataclass(frozen=True)
class TruncatedNewton(Solver):
    """Truncated nonsmooth Newton (after Graeser, Sack and Sander 2009; Graeser and Sander 2019).

    A step has two parts.  First every contact point minimises, globally and at the same time as all others, the
    energy in which the elastic body is replaced by a stiffer diagonal one; this lowers the energy for any law and
    moves points onto and off the kinks.  Then Newton's equation is solved for the components that are off the
    kinks.  A step that does not stay on its pieces, or gains too little, ends at the bottom of the energy: straight
    across the pieces, or on the way on which points stop at their ends, whichever is lower.  Where what is left to
    gain is below the rounding of the energy, the residual judges the step.

    How Newton's equation is solved is a matter of the system: :class:`NonsmoothNewton` works on the condensed body
    with dense factors, :class:`NonsmoothMultigrid` on all unknowns with conjugate gradients.
    """

    sweeps: int = 2  # diagonal minimisations before each Newton step
    # whether components cross barriers of their own energy (GLOBAL), or only walk downhill (DOWNHILL)
    search: Search = Search.GLOBAL
    descends: ClassVar[bool] = True
    #: Whether a whole step that gains less than the rounding of the energy is taken before the residual judges it.
    trusts: ClassVar[bool] = False

    def local_descent(self) -> Self:
        return replace(self, search=Search.DOWNHILL)

    @property
    def accuracy(self) -> Accuracy:
        """How accurately Newton's equation is solved."""
        return Accuracy(0.0, 0.0, 1)

    @property
    def starts_settled(self) -> bool:
        """Whether the first step begins with Newton's equation."""
        return False

    def _evaluations(self, tries: int, cycles: int) -> int:
        """What counts as an evaluation: looks at the energy."""
        return tries

    def begin(self, system: ContactSystem, start: State, budget: Budget) -> State:
        force, known = system.out_of_balance(start.r), start.memory
        equation = system.newton_equation(known.equation if isinstance(known, NewtonMemory) else None)
        memory = NewtonMemory(system.lambda_max, force, equation, self.starts_settled and known is None)
        energy = system.energy(start.r, force=force)
        residual = system.residual(start.r, start.lam, force)
        return replace(start, evaluations=self._evaluations(1, 0), energy=energy, residual=residual, memory=memory)

    def step(self, system: ContactSystem, state: State, budget: Budget) -> State:
        memory: NewtonMemory = state.memory
        energy, factor, r = float(state.energy or 0.0), memory.factor, system.local(state.r)
        r = snap_to_kinks(system, r) if memory.settled else r
        pull, value, evaluations = system.at_contact(memory.force), None, state.evaluations
        for _ in range(0 if memory.settled else self.sweeps):
            move = diagonal_step(system, r, pull, factor, self.search, value)
            evaluations, factor = evaluations + self._evaluations(move.tries, 0), move.factor
            if move.unbounded:
                return replace(state, ended=Status.UNBOUNDED, evaluations=evaluations)
            if move.energy_change < 0.0 or not np.isfinite(energy):
                r, pull, value, energy = move.r, move.force, move.value, energy + move.energy_change
        x = system.moved(state.r, r)
        if not np.isfinite(energy):
            energy = system.energy(x)
        force = memory.force - system.multiply_contact(x - state.r)
        end, unbounded, cycles = self._newton(system, memory, LinearisedPoint.of(system, x, r, force), budget)
        evaluations += self._evaluations(end.tries, cycles)
        x, force, energy = end.x, end.force, energy + end.energy_change
        if unbounded:
            return replace(state, ended=Status.UNBOUNDED, evaluations=evaluations)
        if state.energy is not None and energy >= state.energy - ENERGY_ROUNDING * abs(state.energy):
            x, force, more = self._polish(system, memory.equation, x, force)
            evaluations += self._evaluations(0, more)
        new = self._state(system, x, force, evaluations, energy, replace(memory, factor=factor, settled=False))
        return replace(new, memory=replace(new.memory, share=_share(memory.share, state.residual, new.residual)))

    @staticmethod
    def _state(
        system: ContactSystem, x: Array, force: Array, evaluations: int, energy: float, memory: NewtonMemory
    ) -> State:
        """The state at a point where the elastic force is known."""
        force = system.refreshed(x, force)
        lam = system.multiplier(x, force)
        residual = system.residual(x, lam, force)
        return State(x, lam, evaluations, energy=energy, residual=residual, memory=replace(memory, force=force))

    def _newton(
        self, system: ContactSystem, memory: NewtonMemory, at: LinearisedPoint, budget: Budget
    ) -> tuple[LineEnd, bool, int]:
        """Newton's step from a point, whether the energy falls without end along it, and the number of cycles."""
        correction = memory.equation.solve(at, replace(self.accuracy, due=budget.due, share=memory.share))
        if system.vectors.largest(budget.due())[0]:
            raise OutOfTime
        best = LineEnd(at.x, at.force, 0.0)
        if not correction.cycles:
            return best, False, 0
        line = SearchLine.of(system, at, correction.step, correction.bent, self.search)
        best = line.lowest(correction.convex, self.trusts)
        if correction.negative is None:
            return best, False, correction.cycles
        # No curvature holds the energy back that way: as far as its laws let it fall.
        line = SearchLine.of(system, at, correction.negative, system.multiply(correction.negative), self.search)
        (stiff,) = system.vectors.total(float(np.vdot(line.along**2, system.diagonal)))
        other = line.bottom(line.slope / max(stiff, np.finfo(float).tiny))
        return (other if other.energy_change < best.energy_change else best), other.endless, correction.cycles

    def _polish(
        self, system: ContactSystem, equation: NewtonEquation, x: Array, force: Array
    ) -> tuple[Array, Array, int]:
        """Newton's step judged by the residual, where what is left to gain is below the rounding of the energy."""
        now = system.residual(x, system.multiplier(x, force), force)
        if now.below(4.0 * self.accuracy.absolute, 4.0 * self.accuracy.tolerance):
            return x, force, 0
        best, lowest, cycles = (x, force), 0.9 * now.total, 0
        r = system.local(x)
        here = LinearisedPoint.of(system, x, r, force)
        for start in (np.where(system.active, r, system.fixed), snap_to_kinks(system, r)):
            first = system.moved(x, start)
            at = LinearisedPoint.of(system, first, system.local(first), system.out_of_balance(first))
            correction = equation.solve(at, self.accuracy)
            cycles += correction.cycles
            if correction.negative is not None:
                continue
            near = at.clamp(at.r + system.at_contact(correction.step))
            new = system.moved(first + correction.step, near)
            line = SearchLine.of(system, here, new - x, system.multiply(new - x))
            there = system.out_of_balance(new)
            allowed = max(line.rounding, ENERGY_ROUNDING * energy_scale(system, x, line.value))
            if line.energy_change(1.0, near) <= allowed or _goes_down(system, here, new, near, there):
                total = system.residual(new, system.multiplier(new, there), there).total
                if total < lowest:
                    best, lowest = (new, there), total
        return *best, cycles

    def settle(self, system: ContactSystem, state: State, budget: Budget) -> State | None:
        bent = any((alpha != 0.0).any() for alpha in system.law.weak_convexity)
        if not system.vectors.largest(float(bent))[0]:
            return None
        memory: NewtonMemory = state.memory
        r, pull = system.local(state.r), system.at_contact(memory.force)
        threshold = -ROUNDED * energy_scale(system, state.r, system.law.value(r))
        if self.search is Search.GLOBAL:
            new, gained = best_component(system, r, pull)
        else:
            move = diagonal_step(system, r, pull, memory.factor, self.search)
            new, gained = move.r, 0.0 if move.unbounded else move.energy_change
        x = system.moved(state.r, new)
        if gained >= threshold:
            x, gained = self._leave_saddle(system, state)
            if gained >= threshold:
                return None
        energy = float(state.energy or 0.0) + gained
        return self._state(system, x, system.out_of_balance(x), state.evaluations, energy, memory)

    def _leave_saddle(self, system: ContactSystem, state: State) -> tuple[Array, float]:
        """A step along the direction of most negative curvature, to the bottom there: point, gain (0 if none)."""
        memory: NewtonMemory = state.memory
        at = LinearisedPoint.of(system, state.r, system.local(state.r), memory.force)
        direction = memory.equation.negative_curvature(at)
        if direction is None:
            return state.r, 0.0
        best = LineEnd(state.r, memory.force, 0.0)
        for along in (direction, -direction):
            end = SearchLine.of(system, at, along, system.multiply(along), self.search).bottom(1.0)
            best = end if end.energy_change < best.energy_change else best
        return best.x, best.energy_change

    def release(self, state: State) -> None:
        if isinstance(state.memory, NewtonMemory):
            state.memory.equation.release()


def _share(before: float, old: Residual | None, new: Residual | None) -> float:
    """See :class:`NewtonMemory`."""
    falls = old is None or new is None or new.total < _FALLS * old.total
    return min(before / _CLOSER, 1.0) if falls else max(before * _CLOSER, _CLOSEST)


def _goes_down(system: ContactSystem, here: LinearisedPoint, new: Array, near: Array, there: Array) -> bool:
    """Whether the forces on a tiny way within pieces say that the energy falls along it: potentials of formulas cancel,
    and may know no difference there.  ``near (m, d)`` and ``there`` are local displacements and force at the end."""
    increment, end = near - here.r, LinearisedPoint.of(system, new, near, there)
    still = [np.abs(increment[~at.moving]).max(initial=0.0) for at in (here, end)]
    far, size, kinks = system.vectors.largest(
        np.abs(increment).max(initial=0.0), np.abs(here.r).max(initial=0.0), max(still)
    )
    if far > COUNTS * size or kinks > 0.0:
        return False
    push = [system.less_contact(at.force, system.weights[:, None] * at.multiplier) for at in (here, end)]
    return float(system.vectors.total(float((push[0] + push[1]) @ (new - here.x).ravel()))[0]) >= 0.0


def lower_energy(system: ContactSystem, x: Array, steps: int) -> Array:
    """Where some diagonal minimisations lead from a point; methods that are stuck start again from there."""
    factor, r, pull = system.lambda_max, system.local(x), system.at_contact(system.out_of_balance(x))
    for _ in range(steps):
        move = diagonal_step(system, r, pull, factor)
        if move.unbounded:
            break
        r, pull, factor = move.r, move.force, move.factor
    return system.moved(x, r)
