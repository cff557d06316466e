"""A nonlinear body with its foundation: all unknowns, and the linear bodies (tangents) that stand for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, Self, cast

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.bulk import Bulk, Quadratic
from hemivar.discrete.contact import selects
from hemivar.discrete.free_motion import free_growth
from hemivar.discrete.potential import Potential, Softened
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.recession import RecessionFunction
from hemivar.discrete.residual import LoadScale, contact_compliance, load_scale
from hemivar.fem.hierarchy import Coarser, coarser, tangent_problem
from hemivar.laws import VectorLaw
from hemivar.systems.contact_system import OfProblem, OfUnknowns, PointSystem
from hemivar.systems.workspace import Workspace

__all__ = ["LinearBody", "NonlinearBody", "NonlinearSystem", "linear_bulk"]

#: Makes of a problem what a method works on.
Prepare = Callable[[DiscreteProblem, Workspace], object]


class LinearBody(Protocol):
    """A linear body with its foundation, in the place of one that is not linear."""

    def prepared(self, prepare: Prepare) -> PointSystem:
        """What a method works on; ``prepare`` makes it of a problem that is in one place."""

    def multiply(self, change: Array) -> Array:
        """Elastic force (n,) that a change (n,) of all unknowns takes away."""


class NonlinearSystem(PointSystem, Protocol):
    """A body that is not linear with its foundation: all unknowns, in one place or over many."""

    def tangent_at(self, x: Array, force: Array) -> LinearBody | None:
        """The linear body that has the forces and the stiffness of this one at ``x``, where ``force`` is what is left
        of the load; its energy lacks a constant. None where that stiffness is negative and another body is above."""

    def above_at(self, x: Array, force: Array) -> LinearBody | None:
        """A linear body that has the same forces at ``x`` and more energy elsewhere; None where none is known."""

    def coarse_system(self) -> Self | None:
        """The same on the next coarser mesh, where there is one."""

    def from_below(self, x: Array) -> Array:
        """Unknowns (n,) of the displacement field given by those of the next coarser mesh."""


@dataclass(frozen=True, eq=False)
class _LinearProblem:
    """A linear body in the place of another one, as a problem in one place."""

    problem: DiscreteProblem

    def prepared(self, prepare: Prepare) -> PointSystem:
        return cast(PointSystem, prepare(self.problem, Workspace(1)))

    def multiply(self, change: Array) -> Array:
        return self.problem.linear.gradient(change)


@dataclass(frozen=True, eq=False)
class NonlinearBody(OfProblem, OfUnknowns):
    """Energy of all unknowns, points (n,), of a body whose stored energy need not be quadratic, as a
    :class:`NonlinearSystem`."""

    problem: DiscreteProblem
    workspace: Workspace  # where what belongs to its model is kept
    seconds: float = 0.0  # spent on setting up

    @staticmethod
    def of(problem: DiscreteProblem, workspace: Workspace) -> NonlinearBody:
        """The body of a problem; its stiffness at rest is made."""
        began = time.perf_counter()
        body = NonlinearBody(problem, workspace)
        body.at_rest  # noqa: B018 - made while the clock runs
        return replace(body, seconds=time.perf_counter() - began)

    @property
    def bulk(self) -> Bulk:
        """The stored energy."""
        return self.problem.bulk

    @property
    def at_rest(self) -> Quadratic:
        """The linear body with the stiffness at rest, by which sizes are compared."""
        bulk = self.bulk
        if isinstance(bulk, Quadratic | Potential):
            return bulk.at_rest
        model = self.problem.model
        return self.workspace.once("stiffness at rest", model, lambda: linear_bulk(bulk, np.zeros(bulk.unknowns)))

    @cached_property
    def active(self) -> BoolArray:
        return np.asarray(np.diff(self.problem.contact.trace.indptr) > 0).reshape(self.problem.contact.shape)

    @cached_property
    def fixed(self) -> Array:
        return np.where(self.active, 0.0, -self.problem.offset)

    @cached_property
    def compliance(self) -> Array:
        return contact_compliance(self.problem)

    @property
    def load(self) -> Array:
        return self.problem.load

    @property
    def constant(self) -> float:
        return self.problem.constant

    @cached_property
    def load_scale(self) -> LoadScale:
        return load_scale(self.problem, self.compliance)

    def start(self, guess: Array | None = None) -> Array:
        x = np.zeros(self.load.shape) if guess is None else np.array(guess, dtype=float)
        r = self.local(x)
        change = np.where(self.active, self.law.admissible(np.where(self.active, r, self.fixed)) - r, 0.0)
        return x + self._lifted(change) if change.any() else x

    def local(self, x: Array) -> Array:
        return self.problem.contact.trace_of(x) - self.problem.offset

    def magnitude(self, x: Array) -> float:
        moved = self.problem.contact.sizes @ np.abs(x)
        return float(max(moved.max(initial=0.0), np.abs(self.problem.offset).max(initial=0.0)))

    def out_of_balance(self, x: Array) -> Array:
        """The forces of the last place are known again."""
        if not self._last or self._last[0] is not x:
            self._last[:] = x, self.problem.out_of_balance(x)
        return self._last[1]

    @cached_property
    def _last(self) -> list[Array]:
        return []

    def at_contact(self, force: Array) -> Array:
        """Those that come closest to the force."""
        B = self.problem.contact.trace
        pulled = np.asarray(B @ force)
        return (pulled if self._gram is None else self._gram(pulled)).reshape(self.active.shape)

    def less_contact(self, force: Array, contact: Array) -> Array:
        return np.asarray(force - self.problem.contact.trace.T @ contact.ravel())

    def rounding_sizes(self, x: Array) -> Array:
        """By the stiffness at rest."""
        sizes = self.at_rest.row_sums * np.abs(x) + np.abs(self.load)
        bulk = self.bulk
        return np.asarray(sizes + bulk.initial_sizes if isinstance(bulk, Potential) else sizes)

    def answer_sizes(self, x: Array) -> Array:  # type: ignore[override]
        return self.rounding_sizes(self.problem.strained(x)[1])

    def stretch(self, change: Array) -> float:
        """By the stiffness at rest."""
        return float(np.sqrt(max(float(change @ self.at_rest.gradient(change)), 0.0)))

    def energy(self, x: Array, lam: Array | None = None, force: Array | None = None) -> float:  # type: ignore[override]
        return self.problem.energy(x, self.multiplier(x, force) if lam is None and self.law.state_dependent else lam)

    def with_law(self, law: VectorLaw) -> NonlinearBody:
        return self.for_problem(self.problem.with_(law=law))

    def for_problem(self, problem: DiscreteProblem) -> NonlinearBody:
        """The same body under another load, gap or law."""
        return NonlinearBody(problem, self.workspace)

    def free_growth(self) -> list[RecessionFunction]:
        """Growth of the energy along the motions that deform nothing, where mesh and supports tell them."""
        field = self.problem.field
        if field is None or not field.kernel_known:
            return []
        return free_growth(self.problem, self.problem.model.free_motions)

    # ---- linear bodies in its place ----------------------------------------------------------------------

    def tangent_at(self, x: Array, force: Array) -> LinearBody | None:
        if not isinstance(self.bulk, Potential):
            return self._linear(linear_bulk(self.bulk, x), x, force)
        try:
            tangent = tangent_problem(self.problem, x)
        except Softened:
            return None
        return _LinearProblem(tangent.under(force + tangent.bulk.gradient(x)))

    def above_at(self, x: Array, force: Array) -> LinearBody | None:
        return self._linear(self.bulk.upper, x, force) if isinstance(self.bulk, Potential) else None

    def _linear(self, bulk: Quadratic, x: Array, force: Array) -> LinearBody:
        return _LinearProblem(self.problem.under(force + bulk.gradient(x), bulk=bulk))

    def coarse_system(self) -> NonlinearBody | None:
        below = self._below
        return None if below is None else NonlinearBody(below.on_coarse_mesh(self.problem), self.workspace)

    def from_below(self, x: Array) -> Array:
        assert self._below is not None
        return self._below.interpolate(x)

    @cached_property
    def _below(self) -> Coarser | None:
        problem, bulk = self.problem, self.bulk
        if not isinstance(bulk, Potential) or not selects(problem.contact.trace):
            return None
        return cast("Coarser | None", bulk.known.once("coarser", lambda: coarser(problem)))

    @cached_property
    def _gram(self) -> Callable[[Array], Array] | None:
        """Solves with ``B B'`` where contact points share unknowns."""
        B = self.problem.contact.trace
        if selects(B):
            return None
        rows = np.flatnonzero(self.active.ravel())
        inverse = spla.factorized(sp.csc_array(B[rows] @ B[rows].T))

        def solve(pulled: Array) -> Array:
            out = np.zeros(pulled.shape)
            out[rows] = inverse(pulled[rows])
            return out

        return solve

    def _lifted(self, change: Array) -> Array:
        """Least unknowns (n,) with these local displacements (m, d)."""
        flat = change.ravel() if self._gram is None else self._gram(change.ravel())
        return np.asarray(self.problem.contact.trace.T @ flat)


def linear_bulk(bulk: Bulk, u: Array) -> Quadratic:
    """The linear body with the stiffness of another one at unknowns (n,)."""
    if isinstance(bulk, Quadratic | Potential):
        return bulk.tangent(u)
    return Quadratic(bulk.hessian(u))
