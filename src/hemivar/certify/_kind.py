"""What kind of point a stationary point is: one-sided derivatives first, then curvature on the critical cone."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar._typing import Array
from hemivar.certify._bound import Point, snap
from hemivar.certify._linear import EnergyNorm, MultigridNorm
from hemivar.laws import Superpotential

__all__ = ["LocalStudy", "PointKind", "study"]

#: Curvatures (relative to the elastic one) this small are not decided.
_FLAT = 1e-9
#: A multiplier this near to the end of its interval (relative to the largest multiplier) may leave it.
_AT_END = 1e-8
#: Contact components up to which all curvatures are computed, not the smallest one alone.
_FEW = 200


class PointKind(StrEnum):
    """What a point is for the energy."""

    UNIQUE_MINIMISER = "unique minimiser"
    """The only solution there is, and the global minimiser of the energy."""
    GLOBAL_MINIMISER = "global minimiser"
    """The law is convex, so every stationary point is a global minimiser; there may be others with the same energy."""
    UNIQUE_SOLUTION = "unique solution"
    """The only solution of a problem whose friction bound depends on the solution, which has no energy."""
    LOCAL_MINIMISER = "local minimiser"
    """The energy (for a state-dependent bound, frozen here) rises in every direction."""
    SADDLE = "saddle"
    """The energy falls to both sides in some direction and rises in another."""
    MAXIMUM = "maximum"
    """The energy, as a function of the contact displacements alone, falls in every direction."""
    DIRECTIONALLY_STATIONARY = "directionally stationary"
    """The energy falls in no direction to first order; its curvature does not decide."""
    CLARKE_STATIONARY = "Clarke-stationary"
    """Stationary in the sense of Clarke only: at a downward jump the energy falls to one side to first order."""
    STATIONARY = "stationary"
    """The residual is below the tolerance; what kind of point it is was not looked at, for lack of time."""
    NOT_STATIONARY = "not stationary"
    """Equilibrium or the law is not fulfilled to the tolerance."""


@dataclass(frozen=True, eq=False)
class LocalStudy:
    """Result of the study of a stationary point.

    Attributes
    ----------
    kind : PointKind
        LOCAL_MINIMISER, SADDLE, MAXIMUM, DIRECTIONALLY_STATIONARY or CLARKE_STATIONARY.
    curvature : float or None
        Smallest ``1 + v'B'W j''(r) B v / v'K v`` over the critical directions: 1 is the curvature of the body alone;
        -inf at a downward jump; None if not computed.
    direction : array (m, d) or None
        Local displacements along which the energy falls, largest component 1.
    """

    kind: PointKind
    curvature: float | None
    direction: Array | None


@dataclass(frozen=True, eq=False)
class _Part:
    """One-sided derivatives of a scalar law at r."""

    below: Array
    above: Array
    curvature_below: Array
    curvature_above: Array


def _sides(law: Superpotential, r: Array) -> _Part:
    piece = law.piece_of(r)
    below, above = law.piece_derivative(piece, r), law.piece_derivative(piece, r)
    bend_below = np.array(np.broadcast_to(law.piece_curvature(piece, r), r.shape))
    bend_above = bend_below.copy()
    below, above = np.array(np.broadcast_to(below, r.shape)), np.array(np.broadcast_to(above, r.shape))
    left, right = (np.broadcast_to(side, (r.size, side.shape[-1])) for side in law.knot_slopes())
    knots = np.broadcast_to(law.knots, (r.size, law.knots.shape[-1]))
    for i in range(knots.shape[-1]):
        here = (r == knots[:, i]) & np.isfinite(knots[:, i])
        if not here.any():
            continue
        at = np.where(here, knots[:, i], 0.0)
        below, above = np.where(here, left[:, i], below), np.where(here, right[:, i], above)
        index = np.full(r.shape, i, dtype=np.int64)
        bend_below = np.where(here, law.piece_curvature(index, at), bend_below)
        bend_above = np.where(here, law.piece_curvature(index + 1, at), bend_above)
    return _Part(below, above, bend_below, bend_above)


def study(point: Point) -> LocalStudy:
    """Classify a pair that is stationary up to rounding."""
    problem = point.problem
    m, d = problem.contact_points, problem.dim
    active = point.active
    law = point.law(problem.local(point.u), point.lam)
    r = np.where(active, snap(law, problem.local(point.u), point.lam, point.compliance), 0.0)
    scale = max(float(np.abs(point.lam).max(initial=0.0)), np.finfo(float).tiny)
    slack = _AT_END * scale

    # every contact component becomes a row of ``rows``: free (with its curvature), held at a kink, or undecided
    free: list[tuple[int, Array, float]] = []
    held: list[tuple[int, Array]] = []
    weak: list[tuple[int, Array, float]] = []
    falls: list[tuple[int, Array]] = []
    one_sided: tuple[int, Array] | None = None

    def sort(j: int, axis: Array, lam: float, below: float, above: float, low: float, high: float) -> None:
        nonlocal one_sided
        jump = above - below
        if abs(jump) <= slack if np.isfinite(jump) else False:
            if low == high:
                free.append((j, axis, low))
            else:
                weak.append((j, axis, min(low, high)))
        elif jump > 0.0:
            if lam - below > slack and above - lam > slack:
                held.append((j, axis))
            else:
                side = low if lam - below <= slack else high
                weak.append((j, axis, side))
        else:
            ends = (above - lam < -slack, below - lam > slack)  # falls to the right, to the left
            if all(ends):
                falls.append((j, axis))
            elif one_sided is None:
                one_sided = (j, axis if ends[0] else -axis)

    normal = _sides(law.normal, r[:, 0])
    for j in np.flatnonzero(active[:, 0]).tolist():
        sort(j, np.eye(d)[0], float(point.lam[j, 0]), float(normal.below[j]), float(normal.above[j]),
             float(normal.curvature_below[j]), float(normal.curvature_above[j]))  # fmt: skip
    if d > 1 and m:
        size = np.linalg.norm(r[:, 1:], axis=1)
        radial = _sides(law.tangential, size)
        for j in np.flatnonzero(active[:, 1:].any(axis=1)).tolist():
            axes = np.eye(d)[1:][active[j, 1:]]
            if size[j] == 0.0:
                bound = float(radial.above[j])
                force = float(np.linalg.norm(point.lam[j, 1:][active[j, 1:]]))
                if bound <= slack:
                    bend = float(radial.curvature_above[j])
                    free.extend((j, axis, bend) for axis in axes)
                elif bound - force > slack:
                    held.extend((j, axis) for axis in axes)
                else:
                    weak.extend((j, axis, float(radial.curvature_above[j])) for axis in axes)
                continue
            outward = np.zeros(d)
            outward[1:] = r[j, 1:] / size[j]
            lam = float(outward @ point.lam[j])
            sort(j, outward, lam, float(radial.below[j]), float(radial.above[j]),
                 float(radial.curvature_below[j]), float(radial.curvature_above[j]))  # fmt: skip
            if d == 3:
                across = np.array([0.0, -outward[2], outward[1]])
                if np.any(across[active[j]]):
                    free.append((j, across, lam / size[j]))

    def shown(j: int, axis: Array) -> Array:
        out = np.zeros((m, d))
        out[j] = axis
        return out

    if one_sided is not None and not falls:
        return LocalStudy(PointKind.CLARKE_STATIONARY, -np.inf, shown(*one_sided))
    if falls:
        everywhere = not held and not weak and one_sided is None and (point.energy.factorised or not free)
        worst: float | None = -np.inf
        if everywhere and free:
            curvatures, _ = _curvatures(point, free, [(j, axis) for j, axis in falls], every=True)
            everywhere = curvatures is not None and bool(np.all(curvatures < -_FLAT))
        return LocalStudy(PointKind.MAXIMUM if everywhere else PointKind.SADDLE, worst, shown(*falls[0]))
    few = len(free) <= _FEW and point.energy.factorised
    strict, direction = _curvatures(point, free, [*held, *((j, axis) for j, axis, _ in weak)], every=few)
    if strict is None:
        return LocalStudy(PointKind.DIRECTIONALLY_STATIONARY, None, None)
    lowest = float(strict.min(initial=1.0))
    if lowest < -_FLAT:
        whole = few and not held and not weak and bool(np.all(strict < -_FLAT))
        return LocalStudy(PointKind.MAXIMUM if whole else PointKind.SADDLE, lowest, direction)
    if weak and lowest > _FLAT:
        wider, _ = _curvatures(point, [*free, *weak], held, every=few and len(free) + len(weak) <= _FEW)
        lowest_wide = -np.inf if wider is None else float(wider.min(initial=1.0))
        if lowest_wide > _FLAT:
            return LocalStudy(PointKind.LOCAL_MINIMISER, lowest_wide, None)
        return LocalStudy(PointKind.DIRECTIONALLY_STATIONARY, lowest, None)
    if lowest > _FLAT:
        return LocalStudy(PointKind.LOCAL_MINIMISER, lowest, None)
    return LocalStudy(PointKind.DIRECTIONALLY_STATIONARY, lowest, None)


def _rows(point: Point, parts: list[tuple[int, Array]]) -> sp.csr_array:
    """Rows ``axis . B_j`` of contact components."""
    problem = point.problem
    m, d = problem.contact_points, problem.dim
    data = np.concatenate([axis for _, axis in parts]) if parts else np.zeros(0)
    columns = np.concatenate([np.arange(j * d, (j + 1) * d) for j, _ in parts]) if parts else np.zeros(0, dtype=int)
    select = sp.csr_array((data, columns, np.arange(len(parts) + 1) * d), shape=(len(parts), m * d))
    return sp.csr_array(select @ problem.trace)


def _curvatures(
    point: Point, free: list[tuple[int, Array, float]], held: list[tuple[int, Array]], every: bool
) -> tuple[Array | None, Array | None]:
    """Eigenvalues of ``(K + C'W j'' C, K)``, the held rows at rest: those of the contact components, or the lowest.

    Returns them with the local displacements of the lowest one; None where they cannot be had.
    """
    problem = point.problem
    m, d = problem.contact_points, problem.dim
    C = _rows(point, [(j, axis) for j, axis, _ in free])
    weight = np.array([problem.weights[j] * bend for j, _, bend in free])
    count = C.shape[0]
    if not point.energy.definite:
        return None, None
    if count == 0 or not np.any(weight < 0.0):
        return np.ones(1), None
    if isinstance(point.energy, MultigridNorm):
        return _lowest_by_multigrid(point, point.energy, C, weight, held)
    solver = _ConstrainedSolver(point.energy, _rows(point, held))
    if not solver.definite:
        return None, None
    if every:
        columns = solver.solve(C.T.toarray())
        F = np.asarray(C @ columns)
        F = 0.5 * (F + F.T)
        lift = float(np.abs(np.diagonal(F)).max(initial=0.0))
        # congruent to W j'' on the range of F: 1 + F^(1/2) W j'' F^(1/2)
        values, vectors = np.linalg.eigh(F)
        kept = values > 1e-13 * lift
        root = vectors[:, kept] * np.sqrt(values[kept])
        bends, modes = np.linalg.eigh(np.eye(int(kept.sum())) + root.T @ (weight[:, None] * root))
        force = np.linalg.lstsq(root.T, modes[:, 0], rcond=None)[0]
        return bends, _normalised(problem.trace @ (columns @ force), m, d)
    A = sp.csr_array(C.T @ sp.diags_array(-weight) @ C)
    n = problem.unknowns
    inverse = spla.LinearOperator((n, n), matvec=lambda x: solver.solve(x.ravel()), dtype=float)
    start = solver.solve(np.asarray(C.T @ (1.0 + 0.1 * np.random.default_rng(5).standard_normal(count))))
    try:
        top, modes = spla.eigsh(A, k=1, M=problem.stiffness, Minv=inverse, which="LA", v0=start, tol=1e-8, ncv=16)
    except (spla.ArpackNoConvergence, RuntimeError):
        return None, None
    return 1.0 - top, _normalised(problem.trace @ modes[:, 0], m, d)


def _lowest_by_multigrid(
    point: Point, energy: MultigridNorm, C: sp.csr_array, weight: Array, held: list[tuple[int, Array]]
) -> tuple[Array | None, Array | None]:
    """The lowest eigenvalue alone: what its vector attains where that is negative, else what it is at least."""
    problem = point.problem
    m, d = problem.contact_points, problem.dim
    at_rest = np.zeros((m, d), dtype=bool)
    for j, axis in held:
        component = np.flatnonzero(axis)
        if component.size != 1:
            return None, None
        at_rest[j, component] = True
    mode = energy.constrained_eigenvalue(C, -weight, at_rest)
    if mode is None or mode.vector is None:
        return None, None
    lowest = 1.0 - (mode.value if mode.value > 1.0 else mode.bound)
    return np.array([lowest]), _normalised(problem.trace @ mode.vector, m, d)


def _normalised(vector: Array, m: int, d: int) -> Array:
    peak = float(np.abs(vector).max(initial=0.0))
    return np.asarray(vector / peak if peak > 0.0 else vector).reshape(m, d)


class _ConstrainedSolver:
    """``v`` minimising ``1/2 v'K v - b'v`` subject to ``D v = 0``."""

    def __init__(self, energy: EnergyNorm, held: sp.csr_array) -> None:
        self._energy = energy
        self._count = held.shape[0]
        self._factor: spla.SuperLU | None = None
        self.definite = energy.definite
        if self._count == 0:
            return
        scale = float(energy.stiffness.diagonal().mean())
        system = sp.csc_array(sp.block_array([[energy.stiffness, scale * held.T], [scale * held, None]]))
        try:
            self._factor = spla.splu(system)
        except RuntimeError:
            self.definite = False

    def solve(self, rhs: Array) -> Array:
        if self._factor is None:
            return self._energy.solve(rhs)
        padding = np.zeros((self._count, *rhs.shape[1:]))
        return np.asarray(self._factor.solve(np.concatenate([rhs, padding]))[: rhs.shape[0]])
