"""Block Jacobi moves of the contact points alone: the body is held, or follows as a stiffer diagonal one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, BoolArray
from hemivar.laws import ContactLaw
from hemivar.laws.vector_law import snapped
from hemivar.linear.vectors import Vectors
from hemivar.systems.contact_system import ContactSystem

__all__ = [
    "ContactStep",
    "Search",
    "best_component",
    "diagonal_step",
    "energy_change",
    "majorant",
    "moving_curvature",
    "snap_to_kinks",
]

#: How often the diagonal body is made stiffer, and by how much, before a step is given up: the largest stiffness is 17
#: times the first.
_ATTEMPTS, _STIFFER = 8, 1.5


class Search(Enum):
    """How far a contact point looks for less energy."""

    GLOBAL = "global"
    """It takes the lowest point of its own energy, over any barrier."""
    DOWNHILL = "downhill"
    """It walks downhill and never crosses a barrier of its own energy: the branch it is on is kept while it lasts."""


@dataclass(frozen=True, eq=False)
class ContactStep:
    """A step of the local displacements."""

    r: Array  # (m, d): where it leads; where it began if it was given up
    energy_change: float  # change of the energy, at most 0 unless the step began outside of the domain of the laws
    tries: int  # evaluations of the energy
    factor: float  # how much stiffer than its diagonal the body had to be
    value: Array  # (m,): j(r) where it leads
    force: Array  # (m, d): elastic force there
    unbounded: bool = False  # whether the energy of a point falls without end; ``r`` is where it began then


def energy_change(body: ContactSystem, step: Array, bent: Array, force: Array, change: Array) -> float:
    """Part of this process of the change of energy with a step, free of the cancellation of two large energies.

    ``bent`` is what the step takes away from the elastic ``force``, ``change (m,)`` that of j(r); all other (m, d).
    """
    flat = step.ravel()
    return float(0.5 * flat @ bent.ravel() - force.ravel() @ flat + body.weights @ change)


def majorant(vectors: Vectors, active: BoolArray, diagonal: Array, couple: Callable[[Array], Array]) -> float:
    """Largest eigenvalue of a body scaled by its ``diagonal (m, d)``, ``couple`` being a product with it: what makes
    the diagonal body stiffer than it."""
    count = int(np.count_nonzero(active))
    v = np.zeros(active.shape)
    v[active] = np.cos(1.0 + (vectors.before(count) + np.arange(count)) ** 1.3)  # no symmetry has a part in this
    size = float(vectors.norms(v.ravel())[0])
    if size == 0.0:
        return 1.0
    scale = np.where(active, 1.0 / np.sqrt(diagonal), 0.0)
    for _ in range(15):
        v = scale * couple(scale * v / size)
        size = float(vectors.norms(v.ravel())[0])
        if size == 0.0:
            return 1.0
    return max(1.05 * size, 1.0)  # powers come near from below


def diagonal_step(
    body: ContactSystem,
    r: Array,
    force: Array,
    factor: float,
    search: Search = Search.GLOBAL,
    value: Array | None = None,
) -> ContactStep:
    """All points minimise their diagonal problem at once; it is stiffened until the energy falls.

    ``r, force (m, d)``: local displacements, and the elastic force there; ``factor``: how much stiffer than its
    diagonal the body is made at first; ``value (m,)``: j(r) where it is known.
    """
    d, vectors, first = r.shape[1], body.vectors, factor
    value = body.law.value(r) if value is None else value
    feasible = not vectors.largest(float(not np.isfinite(value).all()))[0]
    for attempt in range(1, _ATTEMPTS + 1):
        stiffness = factor * body.diagonal
        pair = np.stack([stiffness[:, 0], stiffness[:, min(1, d - 1)]], axis=1) / body.weights[:, None]
        pull = (stiffness * r + force) / body.weights[:, None]
        if search is Search.GLOBAL or not feasible:
            target = body.law.local_argmin(pair, pull)
        else:
            target = body.law.local_minimiser(pair, pull, r)
        new = np.where(body.active, target, body.fixed)
        if vectors.largest(float(not np.isfinite(new).all()))[0]:
            return ContactStep(r, 0.0, attempt, factor, value, force, unbounded=True)
        there = body.law.value(new)
        bent = body.couple(new - r)
        if not feasible:
            return ContactStep(new, 0.0, attempt, factor, there, force - bent)
        (gained,) = vectors.total(energy_change(body, new - r, bent, force, there - value)).tolist()
        if gained <= 0.0:
            return ContactStep(new, gained, attempt, factor, there, force - bent)
        factor *= _STIFFER
    return ContactStep(r, 0.0, attempt, first, value, force)  # what is left to gain is below the rounding


def best_component(body: ContactSystem, r: Array, force: Array) -> tuple[Array, float]:
    """The best move of one component (the tangential ones of a point together), all others being held: point, gain.

    Where the law couples them all components of a point move together. ``force (m, d)`` is the elastic force at ``r``.
    """
    m, d = r.shape
    law, w = body.law, body.weights
    if not isinstance(law, ContactLaw):
        return _best_point(body, r, force)
    a = body.diagonal.copy()
    if d > 2:  # the tangential block is replaced by its largest eigenvalue
        (first, mixed), (_, second) = body.blocks[:, 1:, 1:].transpose(1, 2, 0)
        largest = 0.5 * (first + second) + np.hypot(0.5 * (first - second), mixed)
        a[:, 1:] = np.maximum(largest[:, None], 1e-12 * a[:, 1:])
    pair = np.stack([a[:, 0], a[:, min(1, d - 1)]], axis=1) / w[:, None]
    target = law.local_argmin(pair, (a * r + force) / w[:, None])
    target = np.where(body.active & np.isfinite(target), target, r)
    step = target - r
    quadratic = 0.5 * a * step**2 - force * step
    gains = np.zeros((m, 2))
    gains[:, 0] = quadratic[:, 0] + w * (law.normal.value(target[:, 0]) - law.normal.value(r[:, 0]))
    if d > 1:
        size, old = np.linalg.norm(target[:, 1:], axis=1), np.linalg.norm(r[:, 1:], axis=1)
        gains[:, 1] = quadratic[:, 1:].sum(axis=1) + w * (law.tangential.value(size) - law.tangential.value(old))
    best, mine = body.vectors.lowest(float(gains.min(initial=np.inf)))
    new = r.copy()
    if mine and m:
        point, part = np.unravel_index(int(np.argmin(gains)), gains.shape)
        columns = slice(0, 1) if part == 0 else slice(1, d)
        new[point, columns] = target[point, columns]
    return new, best


def _best_point(body: ContactSystem, r: Array, force: Array) -> tuple[Array, float]:
    """The best move of one point in the diagonal body that is stiffer than its block, all other points being held."""
    law, scale = body.law, 1.0 / np.sqrt(body.diagonal)
    lambda_max = np.linalg.eigvalsh(scale[:, :, None] * body.blocks * scale[:, None, :])[:, -1:]
    a = body.diagonal * np.maximum(lambda_max, 1e-12)
    pair = np.stack([a[:, 0], a[:, -1]], axis=1) / body.weights[:, None]
    target = law.local_argmin(pair, (a * r + force) / body.weights[:, None])
    target = np.where(body.active & np.isfinite(target).all(axis=1, keepdims=True), target, r)
    step = target - r
    gains = (0.5 * a * step**2 - force * step).sum(axis=1) + body.weights * (law.value(target) - law.value(r))
    best, mine = body.vectors.lowest(float(gains.min(initial=np.inf)))
    new = r.copy()
    if mine and len(r):
        point = int(np.argmin(gains))
        new[point] = target[point]
    return new, best


def moving_curvature(body: ContactSystem, curvature: Array, moving: BoolArray) -> Array:
    """Second derivatives (m, d, d) of the laws between components that move, weights included."""
    return np.asarray(body.weights[:, None, None] * curvature * (moving[:, :, None] & moving[:, None, :]))


def snap_to_kinks(body: ContactSystem, r: Array) -> Array:
    """``r`` with the components that miss a kink by rounding put on it."""
    near = ROUNDED * float(body.vectors.largest(np.abs(r).max(initial=0.0))[0])
    return np.where(body.active, snapped(body.law, r, near), body.fixed)
