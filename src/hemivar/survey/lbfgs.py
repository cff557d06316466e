"""Limited-memory quasi-Newton minimisation of a nonsmooth energy, on its forward-backward envelope."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import check_numbers
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget
from hemivar.systems.condensed import CondensedProblem

__all__ = ["LBFGS"]


@dataclass(frozen=True)
class LBFGS(Solver):
    """L-BFGS for the nonsmooth energy (PANOC; Stella, Themelis, Sopasakis and Patrinos 2017).

    Plain L-BFGS needs gradients, which a kink does not have.  The forward-backward envelope of the energy is finite and
    continuous everywhere and has the same minimisers; the recursion is applied to its residual, and a line search on it
    makes the iteration converge from any start.  Laws that are +inf somewhere are admitted.

    Parameters
    ----------
    memory : int
        Number of pairs kept.
    """

    memory: int = 30
    name: ClassVar[str] = "direct-lbfgs"
    default_steps: ClassVar[int] = 5000
    patience: ClassVar[int] = 300

    def __post_init__(self) -> None:
        check_numbers(self)
        if self.memory < 1:
            raise ProblemError(f"L-BFGS needs a memory of at least 1 pair, not {self.memory}")

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if problem.contact_points and any(np.isinf(a).any() for a in problem.law.weak_convexity):
            return "the law jumps down, so that its proximal map jumps as well; use newton"
        return None

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        envelope = _Envelope(system, 0.95 / system.lambda_max)
        point = envelope.at(start.r)
        return _state(system, point, 1, _Memory(envelope, point))

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        budget.check()
        memory: _Memory = state.memory
        envelope, here = memory.envelope, memory.here
        evaluations = state.evaluations
        if not envelope.bounded(here):  # the power iteration underestimated the largest eigenvalue
            envelope = _Envelope(system, 0.5 * envelope.factor)
            here = envelope.at(here.x)
            return _state(system, here, evaluations + 1, _Memory(envelope, here))
        direction = -_two_loop(here.residual, memory.steps, memory.changes) / envelope.root
        direction = direction.reshape(here.x.shape)
        threshold = here.value - 1e-4 * float(here.residual @ here.residual)
        length, new = 1.0, None
        for _ in range(12):
            trial = here.x + length * direction + (1.0 - length) * (here.z - here.x)
            point = envelope.at(np.where(system.active, trial, system.fixed))
            evaluations += 1
            if point.value <= threshold:
                new = point
                break
            length *= 0.5
        if new is None:
            new = envelope.at(here.z)
            evaluations += 1
        s = envelope.root * (new.x - here.x).ravel()
        y = new.residual - here.residual
        steps, changes = memory.steps, memory.changes
        if s @ y > 1e-12 * np.linalg.norm(s) * np.linalg.norm(y):
            steps, changes = (*steps, s)[-self.memory :], (*changes, y)[-self.memory :]
        return _state(system, new, evaluations, replace(memory, here=new, steps=steps, changes=changes))


def _state(system: CondensedProblem, point: _Point, evaluations: int, memory: _Memory) -> State:
    """The forward-backward point is admissible and is the one that is reported."""
    return State(point.z, system.multiplier(point.z), evaluations, memory=memory)


@dataclass(frozen=True, eq=False)
class _Point:
    """A point x, its forward-backward point z, and the envelope there."""

    x: Array
    z: Array
    value: float
    residual: Array


@dataclass(frozen=True, eq=False)
class _Memory:
    envelope: _Envelope
    here: _Point
    steps: tuple[Array, ...] = ()
    changes: tuple[Array, ...] = ()


@dataclass(frozen=True, eq=False)
class _Envelope:
    """Forward-backward envelope in the metric of the diagonal of A divided by ``factor``."""

    system: CondensedProblem
    factor: float

    @cached_property
    def metric(self) -> Array:
        """Stiffness of the forward-backward step, (m, d); twice the weak convexity at least: the step is unique."""
        metric = self.system.diagonal / self.factor
        for alpha, columns in zip(self.system.law.weak_convexity, (slice(0, 1), slice(1, None)), strict=True):
            floor = 2.0 * self.system.weights * alpha
            metric[:, columns] = np.maximum(metric[:, columns], floor[:, None])
        return metric

    @cached_property
    def root(self) -> Array:
        """Square root of the metric, (m d,)."""
        return np.asarray(np.sqrt(self.metric.ravel()))

    def at(self, x: Array) -> _Point:
        """Value, forward-backward point and scaled residual at ``x (m, d)``."""
        system, metric = self.system, self.metric
        flat = x.ravel()
        Ax = system.matrix @ flat
        gradient = (Ax - system.load).reshape(x.shape)
        pair = np.stack([metric[:, 0], metric[:, min(1, x.shape[1] - 1)]], axis=1) / system.weights[:, None]
        z = system.law.local_argmin(pair, (metric * x - gradient) / system.weights[:, None])
        z = np.where(system.active, z, system.fixed)
        step = z - x
        value = 0.5 * flat @ Ax - system.load @ flat + (gradient * step).sum() + 0.5 * (metric * step**2).sum()
        value += system.weights @ system.law.value(z)
        return _Point(x, z, float(value), -self.root * step.ravel())

    def bounded(self, point: _Point) -> bool:
        """Whether the quadratic upper bound holds between x and z."""
        step = (point.z - point.x).ravel()
        curvature = float(step @ (self.system.matrix @ step))
        return curvature <= float(point.residual @ point.residual) * (1.0 + 1e-12)


def _two_loop(vector: Array, steps: tuple[Array, ...], changes: tuple[Array, ...]) -> Array:
    """Product of the inverse L-BFGS matrix with ``vector``."""
    q = vector.copy()
    stack = []
    for s, y in zip(reversed(steps), reversed(changes), strict=True):
        rho = 1.0 / float(s @ y)
        alpha = rho * float(s @ q)
        q -= alpha * y
        stack.append((rho, alpha, s, y))
    if steps:
        q *= float(steps[-1] @ changes[-1]) / float(changes[-1] @ changes[-1])
    for rho, alpha, s, y in reversed(stack):
        q += (alpha - rho * float(y @ q)) * s
    return q
