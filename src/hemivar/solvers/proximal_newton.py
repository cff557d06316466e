"""Proximal Newton for nonlinear bodies: contact problems of tangents, and a line search along the way to each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import expect, whole_number
from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array
from hemivar.discrete.contact_energy import contact_energy
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import NESTED, Budget, Controls, OutOfTime
from hemivar.solvers.line_search import ARMIJO, ENERGY_ROUNDING
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.status import STOPPED, Status
from hemivar.systems.nonlinear_body import LinearBody, NonlinearBody, NonlinearSystem, linear_bulk
from hemivar.systems.workspace import Workspace

__all__ = ["ProximalMemory", "ProximalNewton"]

#: What methods are told of the accuracy that is wanted: they aim at a tenth of it, where half of what is wanted serves.
_AIM = 5.0


@dataclass(frozen=True)
class ProximalNewton(Solver):
    """Proximal Newton method for bodies that are not linear (Lee, Sun and Saunders 2014).

    Each step solves the contact problem of a linear body that has the forces and the stiffness of this one at the
    place, as accurately as the residual has fallen so far, and goes towards its answer as far as the energy itself
    falls by a part of what the linear body makes it fall.  Where no part of that way serves, the stiffness of the upper
    bound of the material takes the place of the tangent; its energy lies above the true one.  So the energy never
    rises, and the steps converge where contact softens less than the lower bound of the material is stiff.

    With a method on meshes it starts from the answer on the next coarser mesh.

    Parameters
    ----------
    inner : Solver
        Method for the linear bodies.
    forcing : float
        Part of the residual that a step may leave at most, in (0, 1).
    halvings : int
        How often a step may be halved.
    tolerance : float, optional
        Residual, relative to the load, below which linear bodies need not be solved; a tenth of ``Controls.rtol`` by
        default.
    absolute : float
        Residual below which they need not be solved either, a force.
    """

    inner: Solver = field(default_factory=NonsmoothNewton)
    forcing: float = 0.1
    halvings: int = 30
    tolerance: float | None = None
    absolute: float = 0.0
    patience: ClassVar[int] = 30

    def __post_init__(self) -> None:
        expect(self.inner, Solver, "ProximalNewton.inner", "pass a method such as NonsmoothNewton()")
        whole_number(self.halvings, "ProximalNewton.halvings", 0)
        if not 0.0 < self.forcing < 1.0:
            raise ProblemError(f"ProximalNewton.forcing is {self.forcing}; it must be in (0, 1)")
        if self.inner.handles_state or isinstance(self.inner, ProximalNewton):
            raise ProblemError(
                f"{self.inner.name} inside ProximalNewton has no energy that could fall; put it outside: "
                "FixedPoint(ProximalNewton(...))"
            )

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name in tables."""
        return f"proximal-newton({self.inner.name})"

    @property
    def descends(self) -> bool:  # type: ignore[override]
        """Its energy never rises."""
        return True

    @property
    def condenses(self) -> bool:
        return self.inner.condenses

    @property
    def handles_nonlinear(self) -> bool:
        return True

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if not problem.contact_points:
            return None
        bulk = problem.bulk
        linear = bulk.at_rest if isinstance(bulk, Potential) else linear_bulk(bulk, np.zeros(problem.unknowns))
        return self.inner.refuse(problem.under(None, bulk=linear))

    def for_tolerance(self, rtol: float) -> Solver:
        return self if self.tolerance is not None else replace(self, tolerance=0.1 * rtol)

    def local_descent(self) -> Solver:
        return replace(self, inner=self.inner.local_descent())

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> NonlinearBody:
        return NonlinearBody.of(problem, workspace)

    def first_guess(self, system: NonlinearSystem, budget: Budget) -> tuple[Array, Status | None]:
        below = None if self.inner.condenses else system.coarse_system()
        if below is None:
            return system.start(), None
        x, stopped = self.first_guess(below, budget)
        if stopped is None:
            rough = replace(self, tolerance=0.1 * NESTED.rtol)
            end, status, _ = iterate(rough, below, State(x, below.multiplier(x)), NESTED, budget)
            x, stopped = end.r, status if status in STOPPED else None
        return system.start(system.from_below(x)), stopped

    def begin(self, system: NonlinearSystem, start: State, budget: Budget) -> State:
        return _state(system, start.r, start.evaluations, system.out_of_balance(start.r))

    def step(self, system: NonlinearSystem, state: State, budget: Budget) -> State:
        memory: ProximalMemory = state.memory
        assert state.residual is not None
        evaluations, now = state.evaluations, state.residual
        wanted = min(self.forcing, now.total / memory.first if memory.first > 0.0 else self.forcing) * now.total
        wanted = max(wanted, (self.tolerance or 0.0) * now.scale, self.absolute)
        for method, model in self._models(system, state.r, memory.force):
            if system.vectors.largest(budget.due())[0]:
                raise OutOfTime
            accurate = method.for_tolerance(_AIM * wanted / now.scale) if now.scale > 0.0 else method
            tangent = model.prepared(accurate.prepare)
            begin = tangent.start(tangent.of_unknowns(state.r))
            controls = Controls(rtol=0.0, atol=wanted, max_time=budget.left)
            inner, status, _ = iterate(accurate, tangent, State(begin, tangent.multiplier(begin)), controls, budget)
            evaluations += inner.evaluations
            end = tangent.recover(inner.r, inner.lam)[0]
            accurate.release(inner)
            if status in STOPPED or status is Status.UNBOUNDED:
                return replace(state, evaluations=evaluations, ended=status)
            reached = _Line.of(system, state, end - state.r, model).search(self.halvings)
            if reached is not None:
                x, energy = reached
                return _state(system, x, evaluations, system.out_of_balance(x), memory.first, energy)
        return replace(state, evaluations=evaluations, ended=Status.STALLED)

    def _models(self, system: NonlinearSystem, x: Array, force: Array) -> Iterator[tuple[Solver, LinearBody]]:
        """Methods and linear bodies, to be tried one after the other."""
        tangent = system.tangent_at(x, force)
        careful = self.inner.local_descent()
        if tangent is not None:
            yield self.inner, tangent
        if tangent is not None and careful is not self.inner:
            yield careful, tangent
        above = system.above_at(x, force)
        if above is not None:
            yield self.inner, above


@dataclass(frozen=True, eq=False)
class ProximalMemory:
    """What the method keeps between its steps: out of balance force (n,) at the place, and the first residual."""

    force: Array
    first: float


def _state(
    system: NonlinearSystem,
    x: Array,
    evaluations: int,
    force: Array,
    first: float | None = None,
    energy: float | None = None,
) -> State:
    """The state at a place where the force that is left is known; and the energy, if it was compared with another."""
    lam = system.multiplier(x, force)
    residual = system.residual(x, lam, force)
    memory = ProximalMemory(force, residual.total if first is None else first)
    energy = system.energy(x) if energy is None else energy
    return State(x, lam, evaluations, energy=energy, residual=residual, memory=memory)


@dataclass(frozen=True, eq=False)
class _Line:
    """The energy, and that of the model, along the way from a place to the answer of the model."""

    system: NonlinearSystem
    x: Array  # (n,)
    direction: Array  # (n,)
    total: float  # residual at x
    energy: float
    contact: float  # the part of the energy that contact points have
    slope: float  # work of the out of balance force along the way
    square: float  # twice the energy of the linear body along it
    rounding: float  # what the arithmetic alone makes of a difference of energies

    @staticmethod
    def of(system: NonlinearSystem, state: State, direction: Array, model: LinearBody) -> _Line:
        assert state.residual is not None
        assert state.energy is not None
        contact, load = _contact(system, state.r), system.load
        work, size, slope, square = system.vectors.total(
            float(load @ state.r), float(np.abs(load) @ np.abs(state.r)), float(state.memory.force @ direction),
            float(direction @ model.multiply(direction)),
        ).tolist()  # fmt: skip
        stored = state.energy - system.constant - contact + work
        parts = abs(stored) + size + abs(contact) + abs(system.constant)
        return _Line(
            system,
            state.r,
            direction,
            state.residual.total,
            state.energy,
            contact,
            slope,
            square,
            ENERGY_ROUNDING * parts,
        )

    def fall(self, length: float, contact: float) -> float:
        """What the energy of the linear body changes by up to a part of the way, where the law adds ``contact``."""
        return contact - self.contact - length * self.slope + 0.5 * length**2 * self.square

    def search(self, halvings: int) -> tuple[Array, float] | None:
        """Where the energy falls enough, (n,), and the energy there; None where it does not."""
        length = 1.0
        for attempt in range(halvings + 1):
            new = self.x + length * self.direction
            contact = _contact(self.system, new)
            model = self.fall(length, contact)
            if math.isfinite(contact):
                energy = self.system.energy(new)
                fall = energy - self.energy
                if model < 0.0 and fall <= ARMIJO * model:
                    return new, energy
                rounded = max(abs(model), fall) <= self.rounding
                if attempt == 0 and rounded and self._better(new):
                    return new, min(energy, self.energy)
            length *= 0.5
        return None

    def _better(self, new: Array) -> bool:
        """Whether the residual is smaller; asked where energies cannot be told apart."""
        force = self.system.out_of_balance(new)
        return self.system.residual(new, self.system.multiplier(new, force), force).total < self.total


def _contact(system: NonlinearSystem, x: Array) -> float:
    """What the law adds to the energy."""
    close = ROUNDED * float(system.vectors.largest(system.magnitude(x))[0])
    own = contact_energy(system.law_at(x), system.weights, system.local(x), close)
    return float(system.vectors.total(own)[0])
