"""The default method: nonsmooth Newton on the condensed problem, with an energy that never rises."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws import ContactLaw
from hemivar.laws.vector_law import Linearisation
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget
from hemivar.solvers.status import Status
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.contact_moves import (
    Search,
    best_component,
    diagonal_step,
    gain,
    majorant,
    newton_components,
    smooth_components,
    snapped,
)

__all__ = ["NonsmoothNewton", "Search", "escape_saddle", "lower_energy", "newton_matrix", "newton_system"]

#: Part of local displacements that is a tiny way: along it the energy falls by what forces at both ends say.
_TINY = 1e-6


@dataclass(frozen=True)
class NonsmoothNewton(Solver):
    """Truncated nonsmooth Newton on the contact unknowns (after Graeser, Sack and Sander 2009).

    A step has two parts.  First every contact point minimises, globally and at the same time as all others, the
    energy in which the elastic body is replaced by a stiffer diagonal one; this lowers the energy for any law and
    moves points onto and off the kinks.  Then Newton's equation is solved for the components that are off the
    kinks, and the step is cut back to the pieces it started on, or taken across them if that is lower, and halved
    until the energy does not rise.

    For a convex energy the iteration converges from any start.  For any other law (softening, or a derivative that
    jumps down) it goes on from a stationary point as long as a single component, all others being held, has a lower
    global minimum, or a direction of negative curvature leads down; so it ends at a point that is minimal component by
    component, with an energy that never rises.

    Parameters
    ----------
    sweeps : int
        Diagonal minimisations before each Newton step.
    halvings : int
        How often a step may be halved.
    search : Search
        Whether components cross barriers of their own energy (GLOBAL), or only walk downhill (DOWNHILL).
    """

    sweeps: int = 2
    halvings: int = 20
    search: Search = Search.GLOBAL
    name: ClassVar[str] = "newton"
    descends: ClassVar[bool] = True

    def downhill(self) -> Solver:
        return replace(self, search=Search.DOWNHILL)

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        return replace(start, evaluations=1, energy=system.energy(start.r), memory=system.stiffest)

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        r, energy, evaluations = state.r, float(state.energy or 0.0), state.evaluations
        factor: float = state.memory
        value = system.law.value(r)
        for _ in range(self.sweeps):
            move = diagonal_step(system, r, system.out_of_balance(r), factor, self.search, value)
            evaluations, factor = evaluations + move.tries, move.factor
            if move.endless:
                return replace(state, ended=Status.UNBOUNDED, evaluations=evaluations)
            if move.gain < 0.0 or not np.isfinite(energy):
                r, value = move.r, move.value
                energy = energy + move.gain if np.isfinite(energy) else system.energy(r)
        new, gained, tries = _newton_step(system, r, value, self.halvings, self.search)
        evaluations += tries
        if gained <= 0.0:
            r, energy = new, energy + gained
        if np.isfinite(energy) and state.energy is not None and energy >= state.energy - 1e-14 * abs(state.energy):
            r = _polish(system, r)
        return State(r, system.multiplier(r), evaluations, energy=energy, memory=factor)

    def settle(self, system: CondensedProblem, state: State, budget: Budget) -> State | None:
        if all((alpha == 0.0).all() for alpha in system.law.weak_convexity):
            return None
        r, gained = state.r, 0.0
        threshold = -1e-12 * _energy_scale(system, r)
        if self.search is Search.GLOBAL:
            for _ in range(4 * r.size):
                budget.check()
                better, step_gain = best_component(system, r, system.out_of_balance(r))
                if step_gain >= threshold:
                    break
                r, gained = better, gained + step_gain
        else:
            move = diagonal_step(system, r, system.out_of_balance(r), float(state.memory), self.search)
            if not move.endless and move.gain < threshold:
                r, gained = move.r, move.gain
        if gained == 0.0:
            r, gained = escape_saddle(system, r, self.search)
            if gained >= threshold:
                return None
        energy = float(state.energy or 0.0) + gained
        return State(r, system.multiplier(r), state.evaluations, energy=energy, memory=state.memory)


def _energy_scale(system: CondensedProblem, r: Array) -> float:
    flat = np.abs(r).ravel()
    return float(np.abs(system.load) @ flat + flat @ (np.abs(system.matrix) @ flat)) + float(
        system.weights @ np.abs(system.law.value(r))
    )


def escape_saddle(system: CondensedProblem, r: Array, search: Search = Search.GLOBAL) -> tuple[Array, float]:
    """A step along the direction of most negative curvature of the smooth components: point, gain (0 if none)."""
    moving = newton_components(system.law, r, system.active)
    index = np.flatnonzero(moving.ravel())
    if index.size == 0:
        return r, 0.0
    force = system.out_of_balance(r)
    H, _ = newton_system(system, r, index, force)
    try:
        la.cho_factor(H, check_finite=False)
        return r, 0.0
    except la.LinAlgError:
        values, vectors = la.eigh(H, subset_by_index=[0, 0], check_finite=False)
    if values[0] >= -1e-12 * float(np.abs(H).max()):
        return r, 0.0
    direction = np.zeros(r.shape)
    direction.ravel()[index] = vectors[:, 0]
    value = system.law.value(r)
    best, best_gain = r, 0.0
    for sign in (1.0, -1.0):
        length = sign * room(system.law, r, sign * direction, moving)
        for _ in range(12):
            new = np.where(moving, r + length * direction, r)
            gained = _gain(system, r, new, force, value)
            if gained < best_gain:
                best, best_gain = new, gained
                break
            length *= 0.5
    return best, best_gain


def room(law: ContactLaw, r: Array, direction: Array, moving: BoolArray) -> float:
    """How far ``r`` can go along ``direction`` until the first component meets the end of its piece."""
    far = float(np.abs(r).max(initial=0.0)) or 1.0
    largest = float(np.abs(direction).max())
    if largest == 0.0:
        return 0.0
    length = 100.0 * far / largest
    for _ in range(60):
        aim = r + length * direction
        cut = np.where(moving, law.clamp(r, aim), aim)
        missed = np.abs(aim - cut) > 1e-14 * (np.abs(aim) + np.abs(r))
        if not missed.any():
            break
        ratio = np.where(missed, np.abs(cut - r) / np.maximum(np.abs(aim - r), 1e-300), 1.0)
        length *= min(max(float(ratio.min()), 1e-3), 1.0 - 1e-12)
    return length


def _gain(system: CondensedProblem, r: Array, new: Array, force: Array, value: Array) -> float:
    """Change of energy from ``r``, where the elastic force and j are given, to ``new``."""
    return gain(system, new - r, system.couple(new - r), force, system.law.value(new) - value)


def _newton_step(
    system: CondensedProblem, r: Array, value: Array, halvings: int, search: Search = Search.GLOBAL
) -> tuple[Array, float, int]:
    """Newton's step on the smooth components, cut back to their pieces: point, gain, evaluations."""
    law = system.law
    line = law.linearise(r)
    moving = smooth_components(line, system.active)
    index = np.flatnonzero(moving.ravel())
    if index.size == 0:
        return r, 0.0, 0
    force = system.out_of_balance(r)
    H, g = newton_system(system, r, index, force, line)
    direction = np.zeros(r.shape)
    found, convex = _descend(H, g)
    direction.ravel()[index] = found
    best, best_gain, tries = r, 0.0, 0
    length = 1.0
    first = None if convex else r + room(law, r, direction, moving) * direction
    for _ in range(halvings):
        far = np.where(system.active, r + length * direction, system.fixed)
        near = np.where(moving, law.clamp(r, far), r)
        candidates = (near, far) if search is Search.GLOBAL else (near,)
        if first is not None:
            candidates, first = (*candidates, np.where(system.active, first, system.fixed)), None
        for candidate in candidates:
            gained = _gain(system, r, candidate, force, value)
            tries += 1
            if gained < best_gain:
                best, best_gain = candidate, gained
        if best_gain < 0.0:
            break
        length *= 0.5
    return best, best_gain, tries


def _polish(system: CondensedProblem, r: Array) -> Array:
    """Newton's step judged by the residual, where what is left to gain is below the rounding of the energy."""
    now = system.residual(r, system.multiplier(r))
    force, value = system.out_of_balance(r), system.law.value(r)
    allowed = 1e-14 * _energy_scale(system, r)
    best, lowest = r, 0.9 * now.total
    for start in (np.where(system.active, r, system.fixed), snapped(system, r)):
        moving = newton_components(system.law, start, system.active)
        index = np.flatnonzero(moving.ravel())
        new = start.copy()
        if index.size:
            H, g = newton_system(system, start, index, system.out_of_balance(start))
            new.ravel()[index] += _descend(H, g)[0]
            new = np.where(moving, system.law.clamp(start, new), start)
        if _gain(system, r, new, force, value) <= allowed or _goes_down(system, r, new):
            found = system.residual(new, system.multiplier(new)).total
            if found < lowest:
                best, lowest = new, found
    return best


def _goes_down(system: CondensedProblem, r: Array, new: Array) -> bool:
    """Whether the forces on a tiny way within pieces say that the energy falls along it: potentials of formulas cancel,
    and may know no difference there."""
    way = new - r
    if np.abs(way).max(initial=0.0) > _TINY * np.abs(r).max(initial=0.0):
        return False
    push = np.zeros(r.shape)
    for at in (r, new):
        line = system.law.linearise(at)
        if way[~smooth_components(line, system.active)].any():
            return False
        push += system.out_of_balance(at) - system.weights[:, None] * line.gradient
    return float((push * way).sum()) >= 0.0


def lower_energy(system: CondensedProblem, r: Array, steps: int) -> Array:
    """Where some diagonal minimisations lead from ``r``; methods that are stuck start again from there."""
    factor = majorant(system)
    for _ in range(steps):
        move = diagonal_step(system, r, system.out_of_balance(r), factor)
        if move.endless:
            break
        r, factor = move.r, move.factor
    return r


def newton_system(
    system: CondensedProblem, r: Array, index: IntArray, force: Array, line: Linearisation | None = None
) -> tuple[Array, Array]:
    """Hessian and downhill force of the energy on the components ``index``; ``line`` is the law at ``r`` if known."""
    line = system.law.linearise(r) if line is None else line
    g = (force - system.weights[:, None] * line.gradient).ravel()[index]
    return newton_matrix(system, index, line.hessian), g


def newton_matrix(system: CondensedProblem, index: IntArray, hessian: Array) -> Array:
    """Hessian (k, k) of the energy on the components ``index``, those of the laws being given, (m, d, d)."""
    m, d = system.shape
    H = np.asarray(system.matrix[np.ix_(index, index)])
    point, component = np.divmod(index, d)
    position = np.full(m * d, -1)
    position[index] = np.arange(index.size)
    for c in range(d):
        partner = position[point * d + c]
        here = partner >= 0
        rows = np.flatnonzero(here)
        H[rows, partner[here]] += system.weights[point[here]] * hessian[point[here], component[here], c]
    return H


def _descend(H: Array, g: Array) -> tuple[Array, bool]:
    """``H^-1 g`` where H is positive definite, else a descent direction of the same length scale; and whether it is."""
    try:
        return np.asarray(la.cho_solve(la.cho_factor(H, check_finite=False), g, check_finite=False)), True
    except la.LinAlgError:
        values, vectors = la.eigh(H, check_finite=False)
        floor = 1e-10 * float(np.abs(values).max(initial=1.0))
        return np.asarray(vectors @ ((vectors.T @ g) / np.maximum(np.abs(values), floor))), False
