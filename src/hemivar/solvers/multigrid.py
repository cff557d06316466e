"""Nonsmooth multigrid: contact at the price of a linear elastic solve by multigrid, on one machine or on many."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.laws.vector_law import Linearisation, Near
from hemivar.linear.cycle import selects
from hemivar.linear.krylov import Descent, conjugate_gradients
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget, Controls, OutOfTime
from hemivar.solvers.loop import iterate
from hemivar.solvers.status import STOPPED, Status
from hemivar.systems.body import Body, Truncation
from hemivar.systems.body_on_levels import BodyProblem, set_up
from hemivar.systems.contact_moves import Search, best_component, diagonal_step, snapped
from hemivar.systems.workspace import Workspace

__all__ = ["Memory", "NonsmoothMultigrid"]

#: Relative residual up to which coarser meshes are solved, and the most steps there.
_NESTED, _NESTED_STEPS = 1e-3, 15
#: How large a residual, by the distance to the contact conditions, conjugate gradients leave when they end early.
_PATIENCE = 1.5
#: Part of a move from which it counts as cut back to a piece, and not as rounded.
_CUT = 1e-9
#: Tightest tolerance of conjugate gradients, relative to the load.
_TIGHTEST = 1e-13
#: What rounding makes of the energy, relative to its parts, along a line and over a step; and what a move of one point
#: must gain at least.
_ROUNDED_LINE, _ROUNDED_STEP, _WORTH = 1e-15, 1e-14, 1e-12
#: How often Newton's equation is solved on the pieces of the laws: once more for what rounding leaves.
_CORRECTED = 2
#: How far, in powers of two of the length that the stiffness of the contact points suggests, a direction without
#: curvature is followed.
_FURTHEST, _NEAREST = 60, -20


@dataclass(frozen=True, eq=False)
class Memory:
    """What the method keeps between its steps.

    Attributes
    ----------
    factor : float
        How much stiffer than its diagonal the body is made for diagonal minimisations.
    force : array (n,)
        ``f - K u``.
    matrix : Truncation
        Newton's matrix, changed from step to step.
    settled : bool
        Whether the next step begins with Newton's equation.
    """

    factor: float
    force: Array
    matrix: Truncation
    settled: bool = False


@dataclass(frozen=True)
class NonsmoothMultigrid(Solver):
    """Truncated nonsmooth Newton multigrid (Graeser, Sack, Sander 2009; Graeser, Sander 2019).

    Each step lets the contact points settle while the rest of the body is held, as :class:`NonsmoothNewton` does,
    and then solves Newton's equation for all unknowns but those at a kink, by conjugate gradients with a multigrid
    cycle that leaves these out. Conjugate gradients end as soon as the contact conditions are further from being
    fulfilled than the equation, so that little is spent before the contact set is known, and go on to the end once
    it is.  The step is cut back to the pieces it started on, or halved, until the energy does not rise.

    It starts from the solution on the next coarser mesh, which starts from the one below it, and so on.  On meshes that
    are refinements of coarser ones (built in with even numbers of cells, or refined) the cycle is geometric; below the
    coarsest of them it is algebraic, with the rigid motions as near null space.

    For laws that are not convex it ends at a point that no contact point can leave downhill on its own, all else being
    held; :class:`NonsmoothNewton` looks further.  ``Solution.evaluations`` counts the cycles on the finest mesh.

    Parameters
    ----------
    sweeps : int
        Diagonal minimisations of the contact points before each Newton step.
    iterations : int
        Most iterations of conjugate gradients in one step.
    halvings : int
        How often a step may be halved.
    tolerance : float, optional
        Where conjugate gradients end, relative to the load; a tenth of ``Controls.rtol`` by default.
    nested : bool
        Start from the solution on the next coarser mesh.
    absolute : float
        What conjugate gradients may leave beside it, in units of force.
    settled : bool
        The contact points of the initial guess lie on the pieces of their laws and at the kinks where they are expected
        in the end: the first step begins with Newton's equation.
    search : Search
        Whether contact points cross barriers of their own energy (GLOBAL), or only walk downhill (DOWNHILL).
    """

    sweeps: int = 3
    iterations: int = 60
    halvings: int = 20
    tolerance: float | None = None
    nested: bool = True
    absolute: float = 0.0
    settled: bool = False
    search: Search = Search.GLOBAL
    name: ClassVar[str] = "multigrid"
    descends: ClassVar[bool] = True

    @property
    def condenses(self) -> bool:
        return False

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if not selects(problem.contact.trace):
            return (
                "some contact points share displacements; it needs quadrature at the nodes, and contact boundaries "
                "that meet smoothly or at a right angle. Use NonsmoothNewton"
            )
        return None

    def for_tolerance(self, rtol: float) -> Solver:
        return self if self.tolerance is not None else replace(self, tolerance=max(0.1 * rtol, _TIGHTEST))

    def downhill(self) -> Solver:
        return replace(self, search=Search.DOWNHILL)

    @property
    def _target(self) -> float:
        return _TIGHTEST if self.tolerance is None else self.tolerance

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> BodyProblem:
        return set_up(problem, workspace)

    def first_guess(self, system: Body, budget: Budget) -> tuple[Array, Status | None]:
        below = system.posed_below() if self.nested else None
        if below is None:
            return system.start(), None
        rough = replace(self, tolerance=0.1 * _NESTED, absolute=0.0, sweeps=min(self.sweeps, 2), settled=False)
        x, stopped = rough.first_guess(below, budget)
        if stopped is None:
            controls = Controls(rtol=_NESTED, max_steps=_NESTED_STEPS)
            start = State(x, below.multiplier(x))
            found, status, _ = iterate(rough, below, start, controls, budget)
            self.release(found)
            x, stopped = found.r, status if status in STOPPED else None
        return system.start(system.from_below(x)), stopped

    def begin(self, system: Body, start: State, budget: Budget) -> State:
        known = start.memory.matrix if isinstance(start.memory, Memory) else None
        force = system.out_of_balance(start.r)
        energy = system.energy(start.r, force=force)
        matrix, settled = (system.truncation(), self.settled) if known is None else (known, False)
        memory = Memory(system.stiffest, force, matrix, settled)
        return replace(start, energy=energy, residual=system.residual(start.r, start.lam, force), memory=memory)

    def step(self, system: Body, state: State, budget: Budget) -> State:
        memory: Memory = state.memory
        energy, factor, force = float(state.energy or 0.0), memory.factor, memory.force
        r = origin = system.local(state.r)
        if memory.settled:
            r = snapped(system, r)
        pull = system.spread(force[system.unknown])
        for _ in range(0 if memory.settled else self.sweeps):
            move = diagonal_step(system, r, pull - system.couple(r - origin), factor, self.search)
            factor = move.factor
            if move.endless:
                return replace(state, ended=Status.UNBOUNDED)
            if move.gain < 0.0 or not np.isfinite(energy):
                r, energy = move.r, energy + move.gain
        x = system.moved(state.r, r)
        if not np.isfinite(energy):
            energy = system.energy(x)
        force = force - system.push((x - state.r)[system.unknown])
        found, cycles = self._newton(system, memory.matrix, x, r, force, budget)
        x, force, energy = found.x, found.force, energy + found.gain
        if found.endless:
            return replace(state, ended=Status.UNBOUNDED, evaluations=state.evaluations + cycles)
        if state.energy is not None and energy >= state.energy - _ROUNDED_STEP * abs(state.energy):
            x, force, more = self._polish(system, memory.matrix, x, force)
            cycles += more
        memory = replace(memory, factor=factor, settled=False)
        return self._state(system, x, force, state.evaluations + cycles, energy, memory)

    @staticmethod
    def _state(system: Body, x: Array, force: Array, evaluations: int, energy: float, memory: Memory) -> State:
        """The state at a place where the elastic force is known."""
        lam = system.multiplier(x, force)
        found = system.residual(x, lam, force)
        return State(x, lam, evaluations, energy=energy, residual=found, memory=replace(memory, force=force))

    def _polish(self, system: Body, matrix: Truncation, x: Array, force: Array) -> tuple[Array, Array, int]:
        """Newton's step judged by the residual, where what is left to gain is below the rounding of the energy."""
        now = system.residual(x, system.multiplier(x, force), force)
        if now.below(4.0 * self.absolute, 4.0 * self._target):
            return x, force, 0
        best, lowest, cycles = (x, force), 0.9 * now.total, 0
        r = system.local(x)
        for start in (np.where(system.active, r, system.fixed), snapped(system, r)):
            first = system.moved(x, start)
            equation = _Equation.at(system, matrix, first, system.local(first), system.out_of_balance(first))
            found, _ = equation.solve(self._target, self.absolute, self.iterations)
            cycles += found.iterations
            aim = equation.r + system.spread(found.solution[system.unknown])
            near = np.where(equation.moving, equation.near.clamp(aim), equation.r)
            new = system.moved(first + found.solution, near)
            line = _Line.of(replace(equation, x=x, r=r, force=force), new - x, system.multiply(new - x))
            if found.negative is None and line.gains(1.0, near)[0] <= line.rounding:
                there = system.out_of_balance(new)
                total = system.residual(new, system.multiplier(new, there), there).total
                if total < lowest:
                    best, lowest = (new, there), total
        return *best, cycles

    def settle(self, system: Body, state: State, budget: Budget) -> State | None:
        bent = any((alpha != 0.0).any() for alpha in system.law.weak_convexity)
        if not system.vectors.largest(float(bent))[0]:
            return None
        r, memory = system.local(state.r), state.memory
        pull = system.spread(memory.force[system.unknown])
        if self.search is Search.GLOBAL:
            new, gained = best_component(system, r, pull)
        else:
            move = diagonal_step(system, r, pull, memory.factor, self.search)
            new, gained = move.r, 0.0 if move.endless else move.gain
        own = float(np.abs(system.load) @ np.abs(state.r)) + float(system.weights @ np.abs(system.law.value(r)))
        if gained >= -_WORTH * float(system.vectors.total(own)[0]):
            return None
        x, energy = system.moved(state.r, new), float(state.energy or 0.0) + gained
        return self._state(system, x, system.out_of_balance(x), state.evaluations, energy, memory)

    def on_pieces(self, system: Body, x: Array) -> Array | None:
        """The bottom of the pieces of the laws on which a place lies, with the points at kinks held there.

        Newton's equation leads straight to it where the laws are quadratic on their pieces.  Nothing is crossed on the
        way, for the energy is convex as far as conjugate gradients see.

        Parameters
        ----------
        system : Body
        x : array (n,)
            The place.

        Returns
        -------
        array (n,) or None
            None if the energy is not convex there, or falls beyond the ends of the pieces.
        """
        matrix = system.truncation()
        try:
            return self._bottom(system, matrix, x)
        finally:
            matrix.release()

    def _bottom(self, system: Body, matrix: Truncation, x: Array) -> Array | None:
        x = system.moved(x, snapped(system, system.local(x)))
        for _ in range(_CORRECTED):
            equation = _Equation.at(system, matrix, x, system.local(x), system.out_of_balance(x))
            found, bent = equation.solve(self._target, self.absolute, self.iterations)
            line = _Line.of(equation, found.solution, bent)
            near = line.candidates(1.0)[0]
            if found.negative is not None or not line.straight(near):
                return None
            x, _ = line.end(1.0, near)
        return x

    def release(self, state: State) -> None:
        if isinstance(state.memory, Memory):
            state.memory.matrix.release()

    def _newton(
        self, system: Body, matrix: Truncation, x: Array, r: Array, force: Array, budget: Budget
    ) -> tuple[_Found, int]:
        """Newton's step from ``x``, where the elastic force is ``force``, and the number of cycles."""
        equation = _Equation.at(system, matrix, x, r, force)
        found, bent = equation.solve(self._target, self.absolute, self.iterations, _Enough(equation, budget))
        if system.vectors.largest(budget.due())[0]:
            raise OutOfTime
        best = _Found(x, force, 0.0)
        if found.iterations:
            line = _Line.of(equation, found.solution, bent, self.search)
            best = _search(line, [0.5**k for k in range(self.halvings)])
        if found.negative is not None:
            # No curvature holds the energy back that way: as far as its laws let it fall.
            system.refuse_direction(found.negative)
            line = _Line.of(equation, found.negative, system.multiply(found.negative), self.search)
            (stiff,) = system.vectors.total(float(np.vdot(line.along**2, system.stiffness)))
            unit = line.slope / max(stiff, np.finfo(float).tiny)
            other = _search(line, [unit * 2.0**k for k in range(_FURTHEST, _NEAREST, -1)], every=True)
            best = min(best, other, key=lambda end: end.gain)
        return best, found.iterations


@dataclass(frozen=True, eq=False)
class _Found:
    """The end of a search along a line, the force there, what the energy gains, and whether it falls without end."""

    x: Array
    force: Array
    gain: float
    endless: bool = False


def _search(line: _Line, lengths: Iterable[float], every: bool = False) -> _Found:
    """The first length that lowers the energy, or the best of all of them."""
    best, begun = _Found(line.x, line.force, 0.0), True
    for number, length in enumerate(lengths):
        candidates = line.candidates(length)
        for candidate, gained in zip(candidates, line.gains(length, *candidates), strict=True):
            # A whole step that gains less than the rounding of the energy is taken on trust.
            trusted = length == 1.0 and not every and gained <= line.rounding and line.straight(candidate)
            if gained < best.gain or (trusted and begun):
                best = _Found(*line.end(length, candidate), min(gained, 0.0), every and number == 0)
                begun = False
        if not begun and not every:
            break
    return best


@dataclass(frozen=True, eq=False)
class _Line:
    """A direction from ``x``, along which the energy costs no more than a look at the contact points.

    Attributes
    ----------
    system : Body
    x, direction : arrays (n,)
    r, along : arrays (m, d)
        Their local displacements.
    force, bent : arrays (n,)
        Elastic force at x, and what a unit of the direction takes away from it.
    slope, square : float
        Work of the elastic force along the direction, and its energy ``d'K d``.
    moving : bool array (m, d)
        Components that Newton's equation moves.
    near : Near
        The law around r.
    value : array (m,)
        j(r).
    rounding : float
        What the arithmetic alone makes of the energy.
    search : Search
        Whether steps across pieces are candidates.
    """

    system: Body
    x: Array
    direction: Array
    r: Array
    along: Array
    force: Array
    bent: Array
    slope: float
    square: float
    moving: BoolArray
    near: Near
    value: Array
    rounding: float
    search: Search = Search.GLOBAL

    @staticmethod
    def of(equation: _Equation, direction: Array, bent: Array, search: Search = Search.GLOBAL) -> _Line:
        """The line from the place of the equation; ``bent`` is the stiffness times the direction."""
        system, x, r, force = equation.system, equation.x, equation.r, equation.force
        value = system.law.value(r)
        slope, square, size = system.vectors.total(
            float(force @ direction),
            float(direction @ bent),
            float(np.abs(force) @ np.abs(x)) + float(system.weights @ np.abs(value)),
        ).tolist()
        return _Line(
            system=system,
            x=x,
            direction=direction,
            r=r,
            along=system.spread(direction[system.unknown]),
            force=force,
            bent=bent,
            slope=slope,
            square=square,
            moving=equation.moving,
            near=equation.near,
            value=value,
            rounding=_ROUNDED_LINE * (abs(slope) + size),
            search=search,
        )

    def candidates(self, length: float) -> tuple[Array, ...]:
        """Local displacements after a step: cut back to their pieces, and, unless only downhill, across them."""
        far = np.where(self.system.active, self.r + length * self.along, self.system.fixed)
        near = np.where(self.moving, self.near.clamp(far), self.r)
        return (near, far) if self.search is Search.GLOBAL else (near,)

    def gains(self, length: float, *candidates: Array) -> list[float]:
        """Changes of the energy, free of the cancellation of two large energies."""
        system = self.system
        own: list[float] = []
        contact = system.spread((length * self.bent[system.unknown]) - self.force[system.unknown])
        for candidate in candidates:
            extra = np.where(system.active, candidate - self.r - length * self.along, 0.0)
            own += [float(np.vdot(extra, contact)), float(np.vdot(extra, system.couple(extra)))]
            own.append(float(system.weights @ (system.law.value(candidate) - self.value)))
        alone = 0.5 * length**2 * self.square - length * self.slope
        sums = system.vectors.total(*own).reshape(-1, 3).tolist()
        return [alone + work + 0.5 * bent + change for work, bent, change in sums]

    def straight(self, candidate: Array) -> bool:
        """Whether a whole step leads to the candidate, as far as the digits of the local displacements tell."""
        off = np.where(self.system.active, candidate - self.r - self.along, 0.0)
        sizes = [np.abs(values).max(initial=0.0) for values in (off, self.along, self.r)]
        missed, step, size = self.system.vectors.largest(*sizes).tolist()
        return bool(missed <= 1e-10 * step + 4.0 * np.finfo(float).eps * size)

    def end(self, length: float, candidate: Array) -> tuple[Array, Array]:
        """Unknowns (n,) after a step with these local displacements, and the elastic force there."""
        system = self.system
        far = self.x + length * self.direction
        near = system.moved(far, candidate)
        return near, self.force - length * self.bent - system.push((near - far)[system.unknown])


@dataclass(frozen=True, eq=False)
class _Equation:
    """Newton's equation for all unknowns but those at a kink.

    Attributes
    ----------
    system : Body
    matrix : Truncation
        Changed by :meth:`solve`.
    x : array (n,)
    r : array (m, d)
        Local displacements at which the laws are linearised.
    moving : bool array (m, d)
        Components that move.
    line : Linearisation
        Of the law.
    curvature : array (m, d, d)
        Its second derivatives between components that move, with their weights.
    force : array (n,)
        Elastic force.
    """

    system: Body
    matrix: Truncation
    x: Array
    r: Array
    moving: BoolArray
    line: Linearisation
    curvature: Array
    force: Array

    @cached_property
    def near(self) -> Near:
        """The law around r."""
        return self.system.law.near(self.r)

    @staticmethod
    def at(system: Body, matrix: Truncation, x: Array, r: Array, force: Array) -> _Equation:
        """The equation at a point."""
        line, moving, curvature = system.linearised(r)
        return _Equation(system, matrix, x, r, moving, line, curvature, force)

    def solve(
        self, tolerance: float, absolute: float, limit: int, enough: _Enough | None = None
    ) -> tuple[Descent, Array]:
        """By conjugate gradients, to a tolerance relative to the load and an absolute one beside it; and the stiffness
        times the solution, (n,)."""
        system, held = self.system, ~self.moving[self.system.active]
        self.matrix.change(self.x, held, self.curvature)
        right = self.force.copy()
        right[system.unknown] -= system.gather(system.weights[:, None] * self.line.gradient)
        right[system.unknown[held]] = 0.0
        scale = system.load_scale.of(float(system.vectors.norms(self.force[system.unknown])[0]))
        found = conjugate_gradients(
            self.matrix, self.matrix.diagonal, right, self.matrix.cycle, absolute + tolerance * scale, limit, enough,
            system.vectors, sparing=True,
        )  # fmt: skip
        bent = right - found.residual  # laws and held unknowns act in the contact rows only
        bent[system.unknown] = system.pull(found.solution)
        return found, bent


@dataclass(frozen=True, eq=False)
class _Enough:
    """Forces by which the contact conditions fail: Newton's equation need not be solved much better than that."""

    equation: _Equation
    budget: Budget

    def __call__(self, iteration: int, step: Array) -> Array:
        at = self.equation
        system, weights = at.system, at.system.weights[:, None]
        pulled = system.pull(step)  # by all processes, whether they are late or not
        if self.budget.due():
            return np.full(1, np.inf)
        way = system.spread(step[system.unknown])
        aim = np.where(at.moving, at.near.clamp(at.r + way), at.r)
        beyond = np.where(at.moving, at.r + way - aim, 0.0)
        lam = system.spread(at.force[system.unknown] - pulled) / weights
        off = np.where(system.active, lam - at.near.nearest_multiplier(lam), 0.0)
        bend = at.near.gradient(aim) - at.line.gradient - np.einsum("mij,mj->mi", at.line.hessian, way)
        bend[np.abs(beyond) > _CUT * np.abs(way)] = 0.0  # at the end of its piece a law has no gradient
        missed = np.hypot(system.stiffness * beyond, weights * np.where(at.moving, bend, off))
        return np.asarray(_PATIENCE * missed).ravel()
