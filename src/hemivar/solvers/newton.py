"""The default method: nonsmooth Newton on the condensed problem, with an energy that never rises."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.linalg as la

from hemivar._typing import Array, BoolArray, IntArray
from hemivar.laws import ContactLaw
from hemivar.solvers.base import Solver, State
from hemivar.solvers.condensed import CondensedProblem
from hemivar.solvers.controls import Budget
from hemivar.solvers.status import Status

__all__ = ["NonsmoothNewton", "diagonal_step", "lower_energy", "majorant", "newton_components", "newton_system"]


@dataclass(frozen=True)
class NonsmoothNewton(Solver):
    """Truncated nonsmooth Newton on the contact unknowns (after Graeser, Sack and Sander 2009).

    A step has two parts.  First every contact point minimises, globally and at the same time as all others, the
    energy in which the elastic body is replaced by a stiffer diagonal one; this lowers the energy for any law and
    moves points onto and off the kinks.  Then Newton's equation is solved for the components that are off the
    kinks, and the step is cut back to the pieces it started on, or taken across them if that is lower, and halved
    until the energy does not rise.

    For a convex energy the iteration converges from any start; in general it ends at a stationary point at which
    every contact point is at a global minimum of its own diagonal problem.

    Parameters
    ----------
    sweeps : int
        Diagonal minimisations before each Newton step.
    halvings : int
        How often a step may be halved.
    """

    sweeps: int = 2
    halvings: int = 20
    name: ClassVar[str] = "newton"
    descends: ClassVar[bool] = True

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        return replace(start, evaluations=1, energy=system.energy(start.r), memory=majorant(system))

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        r, energy, evaluations = state.r, float(state.energy or 0.0), state.evaluations
        factor: float = state.memory
        for _ in range(self.sweeps):
            new, gain, tries, factor = diagonal_step(system, r, factor)
            evaluations += tries
            if new is None:
                return replace(state, ended=Status.UNBOUNDED, evaluations=evaluations)
            if gain < 0.0 or not np.isfinite(energy):
                r = new
                energy = energy + gain if np.isfinite(energy) else system.energy(r)
        new, gain, tries = _newton_step(system, r, self.halvings)
        evaluations += tries
        if gain <= 0.0:
            r, energy = new, energy + gain
        return State(r, system.multiplier(r), evaluations, energy=energy, memory=factor)


def _gain(system: CondensedProblem, r: Array, new: Array, force: Array, value: Array) -> float:
    """Change of energy from ``r`` to ``new``, free of the cancellation of two large energies."""
    step = (new - r).ravel()
    elastic = 0.5 * step @ (system.matrix @ step) - force.ravel() @ step
    return float(elastic + system.weights @ (system.law.value(new) - value))


def majorant(system: CondensedProblem) -> float:
    """Largest eigenvalue of A scaled by its diagonal: what makes the diagonal body stiffer than A."""
    free = system.free
    if free.size == 0:
        return 1.0
    A = system.matrix[np.ix_(free, free)]
    scale = 1.0 / np.sqrt(system.diagonal.ravel()[free])
    v = np.cos(1.0 + np.arange(free.size) ** 1.3)  # no symmetry of the mesh has a part in this
    v /= np.linalg.norm(v)
    largest = 1.0
    for _ in range(15):
        w = scale * (A @ (scale * v))
        largest = float(np.linalg.norm(w))
        if largest == 0.0:
            return 1.0
        v = w / largest
    return max(1.05 * largest, 1.0)


def diagonal_step(system: CondensedProblem, r: Array, factor: float) -> tuple[Array | None, float, int, float]:
    """All points minimise their diagonal problem at once; it is stiffened until the energy falls."""
    d = r.shape[1]
    force = system.out_of_balance(r)
    value = system.law.value(r)
    feasible = np.isfinite(value).all()
    for attempt in range(1, 9):
        stiffness = factor * system.diagonal
        pair = np.stack([stiffness[:, 0], stiffness[:, min(1, d - 1)]], axis=1) / system.weights[:, None]
        pull = (stiffness * r + force) / system.weights[:, None]
        new = np.where(system.active, system.law.local_argmin(pair, pull), system.fixed)
        if not np.isfinite(new).all():
            return None, 0.0, attempt, factor
        if not feasible:
            return new, 0.0, attempt, factor
        gain = _gain(system, r, new, force, value)
        if gain <= 0.0:
            return new, gain, attempt, factor
        factor *= 1.5
    return r, 0.0, attempt, factor


def _newton_step(system: CondensedProblem, r: Array, halvings: int) -> tuple[Array, float, int]:
    """Newton's step on the smooth components, cut back to their pieces: point, gain, evaluations."""
    law = system.law
    moving = newton_components(law, r, system.active)
    index = np.flatnonzero(moving.ravel())
    if index.size == 0:
        return r, 0.0, 0
    force = system.out_of_balance(r)
    value = law.value(r)
    H, g = newton_system(system, r, index, force)
    direction = np.zeros(r.shape)
    direction.ravel()[index] = _descend(H, g)
    best, best_gain, tries = r, 0.0, 0
    length = 1.0
    for _ in range(halvings):
        far = np.where(system.active, r + length * direction, system.fixed)
        near = np.where(moving, law.clamp(r, far), r)
        for candidate in (near, far):
            gain = _gain(system, r, candidate, force, value)
            tries += 1
            if gain < best_gain:
                best, best_gain = candidate, gain
        if best_gain < 0.0:
            break
        length *= 0.5
    return best, best_gain, tries


def lower_energy(system: CondensedProblem, r: Array, steps: int) -> Array:
    """Where some diagonal minimisations lead from ``r``; methods that are stuck start again from there."""
    factor = majorant(system)
    for _ in range(steps):
        new, _, _, factor = diagonal_step(system, r, factor)
        if new is None:
            break
        r = new
    return r


def newton_components(law: ContactLaw, r: Array, active: BoolArray) -> BoolArray:
    """Components on which the law is smooth at ``r`` and that are free to move, (m, d)."""
    smooth = law.linearise(r).smooth
    spread = np.concatenate([smooth[:, :1], np.repeat(smooth[:, 1:], r.shape[1] - 1, axis=1)], axis=1)
    return np.asarray(active & spread)


def newton_system(system: CondensedProblem, r: Array, index: IntArray, force: Array) -> tuple[Array, Array]:
    """Hessian and downhill force of the energy on the components ``index``."""
    m, d = system.shape
    line = system.law.linearise(r)
    H = system.matrix[np.ix_(index, index)].copy()
    point, component = np.divmod(index, d)
    position = np.full(m * d, -1)
    position[index] = np.arange(index.size)
    for c in range(d):
        partner = position[point * d + c]
        here = partner >= 0
        rows = np.flatnonzero(here)
        H[rows, partner[here]] += system.weights[point[here]] * line.hessian[point[here], component[here], c]
    g = (force - system.weights[:, None] * line.gradient).ravel()[index]
    return H, g


def _descend(H: Array, g: Array) -> Array:
    """``H^-1 g`` where H is positive definite, and a descent direction of the same length scale otherwise."""
    try:
        return np.asarray(la.cho_solve(la.cho_factor(H, check_finite=False), g, check_finite=False))
    except la.LinAlgError:
        values, vectors = la.eigh(H, check_finite=False)
        floor = 1e-10 * float(np.abs(values).max(initial=1.0))
        return np.asarray(vectors @ ((vectors.T @ g) / np.maximum(np.abs(values), floor)))
