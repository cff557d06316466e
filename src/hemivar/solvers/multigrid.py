"""Nonsmooth multigrid: contact at the price of a linear elastic solve by multigrid."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.hold import Growth, growth_along
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import LoadScale, Residual, contact_compliance, load_scale, residual
from hemivar.errors import ProblemError
from hemivar.fem.free_motion import free_growth
from hemivar.fem.rigid import free_motions
from hemivar.laws import ContactLaw
from hemivar.laws.vector_law import Linearisation
from hemivar.linear.cycle import ElasticMultigrid, contact_unknowns, selects
from hemivar.linear.definite import (
    below_zero,
    free_unknowns,
    lowest_quotient,
    quotient,
    refuse_indefinite,
    refuse_unseen,
    rounding,
)
from hemivar.linear.krylov import Descent, conjugate_gradients
from hemivar.linear.levels import COARSEST
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget, Controls
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton import best_component, diagonal_step, majorant, newton_components, snapped
from hemivar.solvers.status import STOPPED, Status
from hemivar.systems.workspace import Workspace

__all__ = ["BodyProblem", "NonsmoothMultigrid"]

_NESTED = 1e-3
_PATIENCE = 0.5
_TIGHTEST = 1e-13
#: Gaps this many times larger than the displacements are far.
_FAR = 1e4
#: Local displacements that count as none in a motion whose stiffness is zero up to rounding.
_ROUNDED = 1e-9
#: How far, in powers of two of the length that the stiffness of the contact points suggests, a direction without
#: curvature is followed.
_FURTHEST = 60


@dataclass(frozen=True, eq=False)
class BodyProblem:
    """Energy of all unknowns, with the levels below: the system that multigrid works on.

    Attributes
    ----------
    problem : DiscreteProblem
    hierarchy : ElasticMultigrid
        Matrices of this and the coarser levels.
    top : int
        Number of this level.
    below : BodyProblem or None
        The same on the next coarser mesh, where a problem is posed there.
    unknown : int array (k,)
        The unknown behind each active component.
    sign : array (k,)
        Its sign in the local displacement.
    active : bool array (m, d)
        Components that are free to move.
    fixed : array (m, d)
        Values of the components that are not.
    seconds : float
        Spent on setting up.
    """

    problem: DiscreteProblem
    hierarchy: ElasticMultigrid
    top: int
    below: BodyProblem | None
    unknown: IntArray
    sign: Array
    active: BoolArray
    fixed: Array
    seconds: float

    # ---- views -----------------------------------------------------------------------------------------

    @property
    def law(self) -> ContactLaw:
        """The contact law."""
        return self.problem.law

    @property
    def weights(self) -> Array:
        """Quadrature weights (m,)."""
        return self.problem.weights

    @property
    def shape(self) -> tuple[int, int]:
        """Contact points m and components d."""
        return self.active.shape[0], self.active.shape[1]

    @cached_property
    def rows(self) -> sp.csr_array:
        """Rows of the stiffness that belong to active components, (k, n)."""
        return sp.csr_array(self.problem.stiffness[self.unknown])

    @cached_property
    def block(self) -> sp.csr_array:
        """Stiffness between local components, all other unknowns being held, (m d, m d)."""
        m, d = self.shape
        free = np.flatnonzero(self.active.ravel())
        entries = self.rows[:, self.unknown].tocoo()
        data = entries.data * self.sign[entries.row] * self.sign[entries.col]
        return sp.csr_array((data, (free[entries.row], free[entries.col])), shape=(m * d, m * d))

    @cached_property
    def stiffness(self) -> Array:
        """Stiffness of each local component when all other unknowns are held, (m, d)."""
        return np.asarray(self.block.diagonal().reshape(self.shape))

    @cached_property
    def stiffest(self) -> float:
        """Largest eigenvalue of :attr:`block` scaled by its diagonal."""
        return majorant(ContactBlock(self, np.zeros(self.shape), np.zeros(self.shape)))

    # ---- the protocol of systems -----------------------------------------------------------------------

    def local(self, x: Array) -> Array:
        """Local displacements (m, d) of the unknowns (n,)."""
        r = self.fixed.copy()
        r[self.active] = self.sign * x[self.unknown] - self.problem.offset.reshape(self.shape)[self.active]
        return r

    def free_growth(self) -> list[Growth]:
        """Growth of the energy along the motions that deform nothing, by groups of parts that move by themselves.

        A large problem without a mesh does not tell its motions.
        """
        problem = self.problem
        if free_unknowns(problem) is not None:
            assert problem.field is not None
            return free_growth(problem, free_motions(problem.field))
        if problem.unknowns > COARSEST:
            return []
        root = np.sqrt(problem.diagonal)
        values, vectors = la.eigh(problem.stiffness.toarray() / np.outer(root, root))
        modes = vectors[:, values < rounding(problem.stiffness, problem.diagonal)] / root[:, None]
        if not modes.shape[1]:
            return []
        modes /= np.abs(modes).max(axis=0)
        local = np.stack([self.spread(mode[self.unknown]) for mode in modes.T], axis=2)
        size = float(np.abs(problem.load) @ np.abs(modes).max(axis=1))
        return [growth_along(self.law, local, self.weights, modes.T @ problem.load, size, _ROUNDED)]

    def of_unknowns(self, unknowns: Array) -> Array:
        """The unknowns (n,) themselves."""
        return unknowns

    @cached_property
    def compliance(self) -> Array:
        """Displacement for a unit pressure at a point when all else is held, (m, 2)."""
        return contact_compliance(self.problem)

    def start(self, guess: Array | None = None) -> Array:
        """Admissible unknowns (n,) near ``guess``, or near zero displacement."""
        x = np.zeros(self.problem.unknowns) if guess is None else np.array(guess, dtype=float)
        return self.moved(x, self.law.admissible(self.local(x)))

    def from_below(self, x: Array) -> Array:
        """Unknowns (n,) of the displacement field given by those of the next coarser mesh."""
        return self.hierarchy.steps[self.top - self.hierarchy.first - 1].interpolate(x)

    def moved(self, x: Array, r: Array) -> Array:
        """The unknowns with their active components changed so that the local displacements are ``r``."""
        out = x.copy()
        offset = self.problem.offset.reshape(self.shape)
        out[self.unknown] = self.sign * (r + offset)[self.active]
        # Far from the foundation r is the gap, and has the digits of u no more: what differs by rounding stays.
        far = np.abs(offset) > _FAR * np.abs(r + offset)[self.active].max(initial=0.0)
        if far.any():
            now = self.local(x)
            same = far & (np.abs(r - now) <= 4.0 * np.finfo(float).eps * np.abs(offset))
            same[:, 0] &= ~self.law.normal.at_kink(r[:, 0])
            kept = self.unknown[same[self.active]]
            out[kept] = x[kept]
        return out

    def force(self, x: Array) -> Array:
        """``f - K u``, (n,); the last one is remembered."""
        if self._last.get("x") is not x:
            self.remember(x, self.problem.load - self.problem.stiffness @ x)
        return self._last["force"]

    def remember(self, x: Array, force: Array) -> None:
        """Be told ``f - K u``."""
        self._last["x"], self._last["force"] = x, force

    @cached_property
    def _last(self) -> dict[str, Array]:
        return {}

    def energy(self, x: Array) -> float:
        """E(u)."""
        return self.problem.energy(x)

    def stretch(self, change: Array) -> float:
        """Energy norm of a change of the unknowns (n,)."""
        return float(np.sqrt(max(float(change @ (self.problem.stiffness @ change)), 0.0)))

    def out_of_balance(self, x: Array) -> Array:
        """Elastic force on the contact points, (m, d)."""
        return self.spread(self.force(x)[self.unknown])

    def spread(self, values: Array) -> Array:
        """Values (k,) of the contact unknowns as (m, d), signs observed."""
        out = np.zeros(self.shape)
        out[self.active] = self.sign * values
        return out

    def law_at(self, x: Array, lam: Array) -> ContactLaw:
        """The law, with a bound that depends on the solution evaluated at ``x`` and the multiplier ``lam``."""
        return self.law.frozen(self.local(x), lam)

    def multiplier(self, x: Array) -> Array:
        """Pressure and friction in equilibrium with ``x``; on fixed components the smallest that the law allows."""
        lam = self.out_of_balance(x) / self.weights[:, None]
        if not self.active.all():
            r = self.local(x)
            reaction = self.law.frozen(r, lam).nearest_multiplier(r, np.zeros(self.shape))
            lam = np.where(self.active, lam, reaction)
        return lam

    def residual(self, x: Array, lam: Array) -> Residual:
        """The residual of the pair; its rounding is estimated by the sums of the rows of the stiffness."""
        problem = self.problem
        contact = problem.contact_force(lam)
        r = self.local(x)
        inclusion = self.law_at(x, lam).graph_distance(r, lam, self.compliance) if len(r) else np.zeros(0)
        return Residual.of(
            out_of_balance=self.force(x) - contact,
            inclusion=self.weights * inclusion,
            load=self.load_scale,
            contact_force=contact,
            moved=problem.row_sums * np.abs(x) + np.abs(problem.load),
        )

    def recover(self, x: Array, lam: Array) -> tuple[Array, Residual]:
        """The unknowns themselves, with the residual."""
        return x, residual(self.problem, x, lam)

    def for_problem(self, problem: DiscreteProblem) -> BodyProblem:
        """The same body under another load, gap or law."""
        if problem.stiffness.shape != self.problem.stiffness.shape or problem.trace.shape != self.problem.trace.shape:
            raise ProblemError("the other problem is of another size; set it up by itself")
        fixed = np.where(self.active, 0.0, -problem.offset.reshape(self.active.shape))
        return replace(self, problem=problem, fixed=fixed, below=None, seconds=0.0)

    @cached_property
    def load_scale(self) -> LoadScale:
        """What residuals are held against."""
        return load_scale(self.problem, self.compliance)


@dataclass(frozen=True, eq=False)
class ContactBlock:
    """The contact points alone, every other unknown being held where it is.

    Attributes
    ----------
    body : BodyProblem
    origin : array (m, d)
        Local displacements at which ``pull`` was found.
    pull : array (m, d)
        Elastic force on the contact points there.
    """

    body: BodyProblem
    origin: Array
    pull: Array

    @property
    def law(self) -> ContactLaw:
        """The contact law."""
        return self.body.law

    @property
    def weights(self) -> Array:
        """Quadrature weights (m,)."""
        return self.body.weights

    @property
    def active(self) -> BoolArray:
        """Components that are free to move."""
        return self.body.active

    @property
    def fixed(self) -> Array:
        """Values of those that are not."""
        return self.body.fixed

    @property
    def free(self) -> IntArray:
        """Indices of the free components in a flattened ``r``."""
        return np.flatnonzero(self.active.ravel())

    @property
    def matrix(self) -> sp.csr_array:
        """Stiffness, (m d, m d)."""
        return self.body.block

    @cached_property
    def diagonal(self) -> Array:
        """Stiffness of every component, one number for the tangential ones, (m, d)."""
        diagonal = self.body.stiffness.copy()
        if diagonal.shape[1] > 1:
            diagonal[:, 1:] = diagonal[:, 1:].max(axis=1, keepdims=True)
        return np.where(diagonal > 0.0, diagonal, diagonal.max(initial=1.0))

    @property
    def shape(self) -> tuple[int, int]:
        """Contact points m and components d."""
        return self.body.shape

    @property
    def tangential_blocks(self) -> Array:
        """Stiffness of the tangential components of each point, (m, d - 1, d - 1)."""
        m, d = self.shape
        entries = self.matrix.tocoo()
        own = entries.row // d == entries.col // d
        blocks = np.zeros((m, d, d))
        blocks[entries.row[own] // d, entries.row[own] % d, entries.col[own] % d] = entries.data[own]
        return np.asarray(blocks[:, 1:, 1:])

    def out_of_balance(self, r: Array) -> Array:
        """Elastic force on the contact points, (m, d)."""
        moved = (r - self.origin).ravel()
        change: Array = np.asarray(self.matrix @ moved)
        return self.pull - change.reshape(r.shape)


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
    """

    sweeps: int = 3
    iterations: int = 60
    halvings: int = 20
    tolerance: float | None = None
    nested: bool = True
    name: ClassVar[str] = "multigrid"
    descends: ClassVar[bool] = True

    @property
    def condenses(self) -> bool:
        return False

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if not selects(problem.trace):
            return (
                "some contact points share displacements; it needs quadrature at the nodes, and contact boundaries "
                "that meet smoothly or at a right angle. Use NonsmoothNewton"
            )
        return None

    def for_tolerance(self, rtol: float) -> Solver:
        return self if self.tolerance is not None else replace(self, tolerance=max(0.1 * rtol, _TIGHTEST))

    @property
    def _target(self) -> float:
        return _TIGHTEST if self.tolerance is None else self.tolerance

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> BodyProblem:
        return set_up(problem)

    def first_guess(self, system: BodyProblem, budget: Budget) -> tuple[Array, Status | None]:
        if system.below is None or not self.nested or system.law.state_dependent:
            return system.start(), None
        rough = replace(self, tolerance=0.1 * _NESTED, sweeps=min(self.sweeps, 2))
        x, stopped = rough.first_guess(system.below, budget)
        if stopped is None:
            controls = Controls(rtol=_NESTED, max_steps=15, max_time=max(budget.limit - budget.spent, 0.0))
            start = State(x, system.below.multiplier(x))
            found, status, _ = iterate(rough, system.below, start, controls, budget)
            x, stopped = found.r, status if status in STOPPED else None
        return system.start(system.from_below(x)), stopped

    def begin(self, system: BodyProblem, start: State, budget: Budget) -> State:
        return replace(start, energy=system.energy(start.r), memory=system.stiffest)

    def step(self, system: BodyProblem, state: State, budget: Budget) -> State:
        energy = float(state.energy or 0.0)
        r, force = system.local(state.r), system.force(state.r)
        block = ContactBlock(system, r, system.spread(force[system.unknown]))
        factor: float = state.memory
        for _ in range(self.sweeps):
            new, gain, _, factor = diagonal_step(block, r, factor)
            if new is None:
                return replace(state, ended=Status.UNBOUNDED)
            if gain < 0.0 or not np.isfinite(energy):
                r, energy = new, energy + gain
        x = system.moved(state.r, r)
        if not np.isfinite(energy):
            energy = system.energy(x)
        force = force - system.rows.T @ (x - state.r)[system.unknown]
        found, cycles = self._newton(system, x, r, force, budget)
        x, energy = found.x, energy + found.gain
        if found.endless:
            return replace(state, ended=Status.UNBOUNDED, evaluations=state.evaluations + cycles)
        if state.energy is not None and energy >= state.energy - 1e-14 * abs(state.energy):
            x, more = self._polish(system, x)
            cycles += more
        return State(x, system.multiplier(x), state.evaluations + cycles, energy=energy, memory=factor)

    def _polish(self, system: BodyProblem, x: Array) -> tuple[Array, int]:
        """Newton's step judged by the residual, where what is left to gain is below the rounding of the energy."""
        now = system.residual(x, system.multiplier(x))
        if now.below(0.0, 4.0 * self._target):
            return x, 0
        best, lowest, cycles = x, 0.9 * now.total, 0
        r, force = system.local(x), system.force(x)
        for start in (r, snapped(system.law, r)):
            first = system.moved(x, np.where(system.active, start, system.fixed))
            equation = _Equation.at(system, system.local(first), system.force(first))
            found, _ = equation.solve(self._target, self.iterations)
            cycles += found.iterations
            aim = equation.r + system.spread(found.solution[system.unknown])
            near = np.where(equation.moving, system.law.clamp(equation.r, aim), equation.r)
            new = system.moved(first + found.solution, near)
            at = replace(equation, r=r, force=force)
            line = _Line.of(at, x, new - x, system.problem.stiffness @ (new - x))
            if found.negative is None and line.gain(1.0, near) <= line.rounding:
                total = system.residual(new, system.multiplier(new)).total
                if total < lowest:
                    best, lowest = new, total
        return best, cycles

    def settle(self, system: BodyProblem, state: State, budget: Budget) -> State | None:
        if all((alpha == 0.0).all() for alpha in system.law.weak_convexity):
            return None
        r = system.local(state.r)
        block = ContactBlock(system, r, system.out_of_balance(state.r))
        new, gain = best_component(block, r)
        size = float(np.abs(system.problem.load) @ np.abs(state.r)) + float(
            system.weights @ np.abs(system.law.value(r))
        )
        if gain >= -1e-12 * size:
            return None
        x = system.moved(state.r, new)
        return replace(state, r=x, lam=system.multiplier(x), energy=float(state.energy or 0.0) + gain)

    def _newton(self, system: BodyProblem, x: Array, r: Array, force: Array, budget: Budget) -> tuple[_Found, int]:
        """Newton's step from ``x``, where the elastic force is ``force``, and the number of cycles."""
        equation = _Equation.at(system, r, force)
        found, bent = equation.solve(self._target, self.iterations, _Watch(equation, budget))
        best = _Found(x, 0.0)
        if np.any(found.solution):
            line = _Line.of(equation, x, found.solution, bent)
            best = self._search(line, [0.5**k for k in range(self.halvings)])
        if found.negative is not None:
            # No curvature holds the energy back that way: as far as its laws let it fall.
            if free_unknowns(system.problem) is None:
                curvature = quotient(system.problem.stiffness, found.negative, system.problem.diagonal)
                refuse_indefinite(below_zero(system.problem, curvature))
            line = _Line.of(equation, x, found.negative, system.problem.stiffness @ found.negative)
            unit = line.slope / max(float(np.vdot(line.along**2, system.stiffness)), np.finfo(float).tiny)
            other = self._search(line, [unit * 2.0**k for k in range(_FURTHEST, -20, -1)], every=True)
            best = min(best, other, key=lambda end: end.gain)
        return best, found.iterations

    def _search(self, line: _Line, lengths: Iterable[float], every: bool = False) -> _Found:
        """The first length that lowers the energy, or the best of all of them."""
        best = _Found(line.x, 0.0)
        for number, length in enumerate(lengths):
            for candidate in line.candidates(length):
                gain = line.gain(length, candidate)
                # A whole step that gains less than the rounding of the energy is taken on trust.
                trusted = length == 1.0 and not every and gain <= line.rounding and line.straight(candidate)
                if gain < best.gain or (trusted and best.x is line.x):
                    best = _Found(line.end(length, candidate), min(gain, 0.0), every and number == 0)
            if best.x is not line.x and not every:
                break
        return best


@dataclass(frozen=True, eq=False)
class _Found:
    """The end of a search along a line, what the energy gains there, and whether it falls without end."""

    x: Array
    gain: float
    endless: bool = False


@dataclass(frozen=True, eq=False)
class _Line:
    """A direction from ``x``, along which the energy costs no more than a look at the contact points.

    Attributes
    ----------
    system : BodyProblem
    x, direction : arrays (n,)
    r, along : arrays (m, d)
        Their local displacements.
    force, bent : arrays (n,)
        Elastic force at x, and what a unit of the direction takes away from it.
    slope, square : float
        Work of the elastic force along the direction, and its energy ``d'K d``.
    moving : bool array (m, d)
        Components that Newton's equation moves.
    value : array (m,)
        j(r).
    rounding : float
        What the arithmetic alone makes of the energy.
    """

    system: BodyProblem
    x: Array
    direction: Array
    r: Array
    along: Array
    force: Array
    bent: Array
    slope: float
    square: float
    moving: BoolArray
    value: Array
    rounding: float

    @staticmethod
    def of(equation: _Equation, x: Array, direction: Array, bent: Array) -> _Line:
        """The line from ``x``, where the equation was set up; ``bent`` is the stiffness times the direction."""
        system, r, force = equation.system, equation.r, equation.force
        value, slope = system.law.value(r), float(force @ direction)
        size = abs(slope) + float(np.abs(force) @ np.abs(x)) + float(system.weights @ np.abs(value))
        return _Line(
            system=system,
            x=x,
            direction=direction,
            r=r,
            along=system.spread(direction[system.unknown]),
            force=force,
            bent=bent,
            slope=slope,
            square=float(direction @ bent),
            moving=equation.moving,
            value=value,
            rounding=1e-15 * size,
        )

    def candidates(self, length: float) -> tuple[Array, Array]:
        """Local displacements after a step: cut back to their pieces, and across them."""
        far = np.where(self.system.active, self.r + length * self.along, self.system.fixed)
        return np.where(self.moving, self.system.law.clamp(self.r, far), self.r), far

    def gain(self, length: float, candidate: Array) -> float:
        """Change of the energy, free of the cancellation of two large energies."""
        extra = np.where(self.system.active, candidate - self.r - length * self.along, 0.0)
        contact = self.system.spread((length * self.bent[self.system.unknown]) - self.force[self.system.unknown])
        return (
            0.5 * length**2 * self.square
            - length * self.slope
            + float(np.vdot(extra, contact))
            + 0.5 * float(extra.ravel() @ (self.system.block @ extra.ravel()))
            + float(self.system.weights @ (self.system.law.value(candidate) - self.value))
        )

    def straight(self, candidate: Array) -> bool:
        """Whether a whole step leads to the candidate."""
        off = np.where(self.system.active, candidate - self.r - self.along, 0.0)
        return bool(np.abs(off).max(initial=0.0) <= 1e-10 * np.abs(self.along).max(initial=0.0))

    def end(self, length: float, candidate: Array) -> Array:
        """Unknowns (n,) after a step with these local displacements; the system is told the elastic force there."""
        system = self.system
        far = self.x + length * self.direction
        near = system.moved(far, candidate)
        extra = (near - far)[system.unknown]
        system.remember(near, self.force - length * self.bent - system.rows.T @ extra)
        return near


@dataclass(frozen=True, eq=False)
class _Equation:
    """Newton's equation for all unknowns but those at a kink.

    Attributes
    ----------
    system : BodyProblem
    r : array (m, d)
        Local displacements at which the laws are linearised.
    moving : bool array (m, d)
        Components that move.
    line : Linearisation
        Of the law.
    force : array (n,)
        Elastic force.
    """

    system: BodyProblem
    r: Array
    moving: BoolArray
    line: Linearisation
    force: Array

    @staticmethod
    def at(system: BodyProblem, r: Array, force: Array) -> _Equation:
        """The equation at a point."""
        return _Equation(system, r, newton_components(system.law, r, system.active), system.law.linearise(r), force)

    def solve(self, tolerance: float, limit: int, watch: _Watch | None = None) -> tuple[Descent, Array]:
        """By conjugate gradients, to a tolerance relative to the load; and the stiffness times the solution, (n,)."""
        system, active = self.system, self.system.active
        levels, held = system.hierarchy.levels, ~self.moving[active]
        levels.change(system.top, held, _curvature(system, self.line.hessian, self.moving))
        right = self.force.copy()
        right[system.unknown] -= system.sign * (system.weights[:, None] * self.line.gradient)[active]
        right[system.unknown[held]] = 0.0
        scale = system.load_scale.of(norm(self.force[system.unknown]))
        found = conjugate_gradients(
            levels.matrix(system.top),
            levels.diagonal(system.top),
            right,
            lambda v: levels.cycle(system.top, v),
            tolerance * scale,
            limit,
            watch,
        )
        bent = right - found.residual  # laws and held unknowns act in the contact rows only
        bent[system.unknown] = system.rows @ found.solution
        return found, bent


@dataclass(frozen=True, eq=False)
class _Watch:
    """Ends conjugate gradients once the contact conditions are further from being fulfilled than the equation."""

    equation: _Equation
    budget: Budget

    def __call__(self, iteration: int, step: Array, rest: Array) -> bool:
        self.budget.check()
        if iteration < 2:
            return False
        at = self.equation
        system, law, weights = at.system, at.system.law, at.system.weights[:, None]
        way = system.spread(step[system.unknown])
        aim = np.where(at.moving, law.clamp(at.r, at.r + way), at.r)
        overshoot = system.stiffness * np.where(at.moving, at.r + way - aim, 0.0)
        lam = system.spread(at.force[system.unknown] - system.rows @ step) / weights
        off = np.where(system.active, lam - law.nearest_multiplier(at.r, lam), 0.0)
        bend = law.linearise(aim).gradient - at.line.gradient - np.einsum("mij,mj->mi", at.line.hessian, way)
        wrong = np.hypot(overshoot, weights * np.where(at.moving, bend, off))
        return bool(np.linalg.norm(rest) < _PATIENCE * np.linalg.norm(wrong))


def _curvature(system: BodyProblem, hessian: Array, moving: BoolArray) -> sp.csr_array:
    """Second derivative of the laws between contact unknowns, (k, k)."""
    data = system.weights[:, None, None] * hessian * (moving[:, :, None] & moving[:, None, :])
    number = np.zeros(system.shape, dtype=np.int64)
    number[system.active] = np.arange(system.unknown.size)
    there = data != 0.0
    rows = np.broadcast_to(number[:, :, None], data.shape)[there]
    columns = np.broadcast_to(number[:, None, :], data.shape)[there]
    entries = data[there] * system.sign[rows] * system.sign[columns]
    return sp.csr_array((entries, (rows, columns)), shape=(system.unknown.size,) * 2)


def set_up(problem: DiscreteProblem) -> BodyProblem:
    """The body of a problem on its mesh and on every coarser one."""
    began = time.perf_counter()
    refuse_unseen(problem)
    if free_unknowns(problem) is None:
        refuse_indefinite(below_zero(problem, lowest_quotient(problem.stiffness)))
    hierarchy = ElasticMultigrid.of(problem)
    body: BodyProblem | None = None
    coarser = [step.problem for step in hierarchy.steps] if hierarchy.poses(problem) else []
    for k, posed in enumerate([*coarser, problem], len(hierarchy.steps) - len(coarser)):
        unknown, sign, active, _ = contact_unknowns(posed)
        fixed = np.where(active, 0.0, -posed.offset.reshape(active.shape))
        body = BodyProblem(posed, hierarchy, hierarchy.first + k, body, unknown, sign, active, fixed, 0.0)
    assert body is not None
    return replace(body, seconds=time.perf_counter() - began)
