"""What kind of point a stationary point is: one-sided derivatives first, then curvature on the critical cone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.bound import Point
from hemivar.certificates.by_multigrid import SolveByMultigrid
from hemivar.certificates.linear_bodies import at_tangent, convex_body
from hemivar.certificates.norms import EnergyNorm, energy_norm
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.problem import DiscreteProblem
from hemivar.laws.vector_law import Sides, is_convex

__all__ = ["LocalStudy", "kind_of", "study"]

#: Curvatures (relative to the elastic one) this small are not decided: where the load turns, a point is known to the
#: square root of rounding only, and so is the curvature there, which is zero.
_FLAT = 1e-7
#: A multiplier this near to the end of its interval (relative to the largest multiplier) may leave it; so may a place
#: that is as near, by the compliance of its point, to a knot where the curvature jumps.
_AT_END = 1e-8
#: Contact components up to which all curvatures are computed, not the smallest one alone.
_FEW = 200
#: The same for a body that its foundation holds at rest only.
_MOST = 2000


@dataclass(frozen=True, eq=False)
class LocalStudy:
    """Result of the study of a stationary point."""

    #: LOCAL_MINIMISER, SADDLE, MAXIMUM, DIRECTIONALLY_STATIONARY or CLARKE_STATIONARY; without an energy the same with
    #: the friction bound held fixed, or WITHOUT_ENERGY.
    kind: PointKind
    #: Smallest ``1 + v'B'W j''(r) B v / v'K v`` over the critical directions: 1 is the curvature of the body alone, K
    #: its stiffness at the point; -inf at a downward jump; None if not computed.
    curvature: float | None
    #: Local displacements along which the energy falls, largest component 1.
    direction: Array | None  # (m, d)
    #: The rigid motion along which other minimisers of a convex energy may lie.
    free_motion: str = ""


@dataclass(frozen=True, eq=False)
class _Components:
    """Contact components of one sort: rows ``axis . B_j``.

    ``point (k,)``, ``axis (k, d)``, and ``bend (k,)``, the curvature of the law.
    """

    point: IntArray
    axis: Array
    bend: Array

    @property
    def size(self) -> int:
        return self.point.size

    def where(self, chosen: BoolArray | IntArray) -> _Components:
        return _Components(self.point[chosen], self.axis[chosen], self.bend[chosen])

    def __add__(self, other: _Components) -> _Components:
        return _Components(*map(np.concatenate, zip(vars(self).values(), vars(other).values(), strict=True)))

    def ordered(self) -> _Components:
        """By contact point."""
        return self.where(np.argsort(self.point, kind="stable"))


@dataclass(frozen=True, eq=False)
class _Sorted:
    """The components by what they do: move freely, held at a kink, undecided, fall to both sides or to one."""

    free: _Components
    at_kink: _Components
    weak: _Components
    falls: _Components
    one_sided: _Components

    def __add__(self, other: _Sorted) -> _Sorted:
        return _Sorted(*(mine + more for mine, more in zip(vars(self).values(), vars(other).values(), strict=True)))


def _sort(sides: Sides, slack: float) -> _Sorted:
    """Sort components by their one-sided derivatives and multipliers."""
    point, axis, lam, below, above = sides.point, sides.axis, sides.multiplier, sides.below, sides.above
    low, high = sides.curvature_below, sides.curvature_above
    with np.errstate(invalid="ignore"):
        jump = above - below
        smooth = np.isfinite(jump) & (np.abs(jump) <= slack)
        up = ~smooth & (jump > 0.0)
        inside = (lam - below > slack) & (above - lam > slack)
        side = np.where(lam - below <= slack, low, high)
        down = ~smooth & ~up
        right, left = above - lam < -slack, below - lam > slack
    weak = (smooth & (low != high)) | (up & ~inside)
    bend = np.where(smooth, np.where(low == high, low, np.minimum(low, high)), side)
    outward = np.where(right[:, None], axis, -axis)
    every = _Components(point, axis, bend)
    return _Sorted(
        free=every.where(smooth & (low == high)),
        at_kink=every.where(up & inside),
        weak=every.where(weak),
        falls=every.where(down & right & left),
        one_sided=_Components(point, outward, bend).where(down & ~(right & left)),
    )


def _components(point: Point) -> _Sorted:
    """Every contact component, sorted."""
    problem = point.problem
    active = point.active
    law, tau = point.law(problem.local(point.u), point.lam), point.compliance
    r = np.where(active, law.fitted(problem.local(point.u), point.lam, tau), 0.0)
    slack = max(_AT_END * float(np.abs(point.lam).max(initial=0.0)), np.finfo(float).tiny)
    first, *others = (_sort(sides, slack) for sides in law.sides(r, point.lam, active, tau, slack))
    components = first
    for more in others:
        components += more
    return replace(components, free=components.free.ordered())


def kind_of(problem: DiscreteProblem, u: Array, lam: Array, energy: EnergyNorm) -> PointKind:
    """The kind of a pair ``u (n,)``, ``lam (m, d)`` that solves a problem, as its certificate finds it.

    Whether it is the only solution is not asked.  A pair whose curvature does not decide is a global minimiser where
    the law is convex and the problem has an energy.
    """
    kind = study(Point(problem, energy, u, lam)).kind
    if kind is PointKind.DIRECTIONALLY_STATIONARY:
        convex = is_convex(problem.law) and convex_body(problem)
        return PointKind.GLOBAL_MINIMISER if convex else kind
    return kind


def study(point: Point) -> LocalStudy:
    """Classify a pair that is stationary up to rounding; a body that is not linear by its tangent at the point.

    Where the law depends on the state there is no energy: kind and curvature are those with the state held fixed.
    """
    law, local = point.problem.law, _studied(point)
    if not (point.problem.contact_points and law.state_dependent):
        return local
    kind = PointKind.WITHOUT_ENERGY if law.depends_on_whole_state else local.kind.bound_fixed
    return replace(local, kind=kind)


def _studied(point: Point) -> LocalStudy:
    """The kind for the law as it is at the point."""
    if not isinstance(point.problem.bulk, Quadratic):
        tangent = at_tangent(point.problem, point.u)
        point = Point(tangent, energy_norm(tangent), point.u, point.lam)
    m, d = point.problem.contact_points, point.problem.contact.components
    parts = _components(point)
    free, at_kink, weak, falls, one_sided = parts.free, parts.at_kink, parts.weak, parts.falls, parts.one_sided

    alone = point.energy.definite  # else curvatures are those of a body on springs, of which the sign counts

    def shown(of: _Components) -> Array:
        out = np.zeros((m, d))
        out[of.point[0]] = of.axis[0]
        return out

    if one_sided.size and not falls.size:
        return LocalStudy(PointKind.CLARKE_STATIONARY, -np.inf, shown(one_sided))
    if falls.size:
        everywhere = not (at_kink.size or weak.size or one_sided.size) and (point.energy.factorised or not free.size)
        if everywhere and free.size:
            curvatures, _ = _curvatures(point, free, falls, every=True)
            everywhere = curvatures is not None and bool(np.all(curvatures < -_FLAT))
        return LocalStudy(PointKind.MAXIMUM if everywhere else PointKind.SADDLE, -np.inf, shown(falls))
    few = free.size <= _FEW and point.energy.factorised
    strict, direction = _curvatures(point, free, at_kink + weak, every=few)
    if strict is None:
        return LocalStudy(PointKind.DIRECTIONALLY_STATIONARY, None, None)
    lowest = float(strict.min(initial=1.0))
    if lowest < -_FLAT:
        whole = alone and few and not at_kink.size and not weak.size and bool(np.all(strict < -_FLAT))
        kind = PointKind.MAXIMUM if whole else PointKind.SADDLE
        return LocalStudy(kind, lowest if alone else None, direction)
    least = lowest
    if weak.size and lowest > _FLAT:
        wider, _ = _curvatures(point, free + weak, at_kink, every=few and free.size + weak.size <= _FEW)
        least = -np.inf if wider is None else float(wider.min(initial=1.0))
    if least > _FLAT:
        return LocalStudy(PointKind.LOCAL_MINIMISER, least if alone else None, None)
    return LocalStudy(PointKind.DIRECTIONALLY_STATIONARY, lowest if alone else None, None)


def _rows(point: Point, parts: _Components) -> sp.csr_array:
    """Rows ``axis . B_j`` of contact components."""
    problem = point.problem
    m, d = problem.contact_points, problem.contact.components
    columns = (parts.point[:, None] * d + np.arange(d)).ravel()
    starts = np.arange(parts.size + 1) * d
    select = sp.csr_array((parts.axis.ravel(), columns, starts), shape=(parts.size, m * d))
    return sp.csr_array(select @ problem.contact.trace)


def _curvatures(point: Point, free: _Components, fixed: _Components, every: bool) -> tuple[Array | None, Array | None]:
    """Eigenvalues of ``(K + C'W j'' C, K)``, the held rows at rest: those of the contact components, or the lowest.

    Returns them with the local displacements of the lowest one; None where they cannot be had.
    """
    problem = point.problem
    m, d = problem.contact_points, problem.contact.components
    C = _rows(point, free)
    weight = problem.contact.weights[free.point] * free.bend
    count = C.shape[0]
    if not point.energy.definite:
        return _curvatures_on_foundation(point, C, weight, fixed), None
    if count == 0 or not np.any(weight < 0.0):
        return np.ones(1), None
    if isinstance(point.energy.by, SolveByMultigrid):
        return _lowest_by_multigrid(point, point.energy.by, C, weight, fixed)
    solver = _ConstrainedSolver(point.energy, _rows(point, fixed))
    if not solver.definite:
        return None, None
    if every:
        bends, force, columns = _dense(solver, C, weight)
        return bends, _normalised(problem.contact.trace @ (columns @ force), m, d)
    A = sp.csr_array(C.T @ sp.diags_array(-weight) @ C)
    n = problem.unknowns
    inverse = spla.LinearOperator((n, n), matvec=lambda x: solver.solve(x.ravel()), dtype=float)
    start = solver.solve(np.asarray(C.T @ (1.0 + 0.1 * np.random.default_rng(5).standard_normal(count))))
    try:
        top, modes = spla.eigsh(A, k=1, M=point.energy.stiffness, Minv=inverse, which="LA", v0=start, tol=1e-8, ncv=16)
    except (spla.ArpackNoConvergence, RuntimeError):
        return None, None
    return 1.0 - top, _normalised(problem.contact.trace @ modes[:, 0], m, d)


def _curvatures_on_foundation(point: Point, C: sp.csr_array, weight: Array, fixed: _Components) -> Array | None:
    """The lowest eigenvalue of ``(K + C'W j'' C, K + S)`` for a body that its foundation holds at rest only.

    S are springs as stiff as the body at all contact points, with which K has no kernel.  The sign is that of the
    curvature of the energy, its size means nothing else.  None where it cannot be had.
    """
    problem = point.problem
    stiffness = problem.stiffness
    if not point.energy.factorised:
        return None
    trace = problem.contact.trace
    seen = np.flatnonzero(np.diff(trace.indptr))
    if C.shape[0] + seen.size > _MOST:
        return None
    d = problem.contact.components
    springs = (problem.contact.weights[:, None] / np.repeat(point.compliance, [1, d - 1], axis=1)).ravel()[seen]
    on = sp.csr_array(trace[seen])
    norm = EnergyNorm(sp.csr_array(stiffness + on.T @ sp.diags_array(springs) @ on))
    solver = _ConstrainedSolver(norm, _rows(point, fixed)) if norm.definite else None
    if solver is None or not solver.definite:
        return None
    values, _, _ = _dense(solver, sp.csr_array(sp.vstack([C, on])), np.concatenate([weight, -springs]))
    return values[:1]


def _dense(solver: _ConstrainedSolver, C: sp.csr_array, weight: Array) -> tuple[Array, Array, Array]:
    """All eigenvalues of ``(K + C' diag(weight) C, K)`` that C sees, the force (k,) of the lowest one, ``K^-1 C'``."""
    columns = solver.solve(C.T.toarray())
    F = np.asarray(C @ columns)
    F = 0.5 * (F + F.T)
    lift = float(np.abs(np.diagonal(F)).max(initial=0.0))
    # congruent to W j'' on the range of F: 1 + F^(1/2) W j'' F^(1/2)
    values, vectors = np.linalg.eigh(F)
    kept = values > 1e-13 * lift
    root = vectors[:, kept] * np.sqrt(values[kept])
    if not kept.any():  # all that C sees is held
        return np.ones(0), np.zeros(C.shape[0]), columns
    bends, modes = np.linalg.eigh(np.eye(int(kept.sum())) + root.T @ (weight[:, None] * root))
    return bends, np.linalg.lstsq(root.T, modes[:, 0], rcond=None)[0], columns


def _lowest_by_multigrid(
    point: Point, energy: SolveByMultigrid, C: sp.csr_array, weight: Array, fixed: _Components
) -> tuple[Array | None, Array | None]:
    """The lowest eigenvalue alone: what its vector attains where that is negative, else what it is at least."""
    problem = point.problem
    m, d = problem.contact_points, problem.contact.components
    at_rest = np.zeros((m, d), dtype=bool)
    row, component = np.nonzero(fixed.axis)
    if row.size != fixed.size or np.any(np.diff(row) == 0):  # a direction that is no component
        return None, None
    at_rest[fixed.point[row], component] = True
    mode = energy.constrained(C, -weight, at_rest)
    if mode is None or mode.vector is None:
        return None, None
    lowest = 1.0 - (mode.value if mode.value > 1.0 else mode.bound)
    return np.array([lowest]), _normalised(problem.contact.trace @ mode.vector, m, d)


def _normalised(vector: Array, m: int, d: int) -> Array:
    peak = float(np.abs(vector).max(initial=0.0))
    return np.asarray(vector / peak if peak > 0.0 else vector).reshape(m, d)


class _ConstrainedSolver:
    """``v`` minimising ``1/2 v'K v - b'v`` subject to ``D v = 0``."""

    def __init__(self, energy: EnergyNorm, fixed: sp.csr_array) -> None:
        self._energy = energy
        self._count = fixed.shape[0]
        self._factor: spla.SuperLU | None = None
        self.definite = energy.definite
        if self._count == 0:
            return
        scale = float(energy.stiffness.diagonal().mean())
        system = sp.csc_array(sp.block_array([[energy.stiffness, scale * fixed.T], [scale * fixed, None]]))
        try:
            self._factor = spla.splu(system)
        except RuntimeError:
            self.definite = False

    def solve(self, rhs: Array) -> Array:
        if self._factor is None:
            return self._energy.solve(rhs)
        padding = np.zeros((self._count, *rhs.shape[1:]))
        return np.asarray(self._factor.solve(np.concatenate([rhs, padding]))[: rhs.shape[0]])
