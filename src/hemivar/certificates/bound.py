"""Guaranteed bound of the distance to the exact discrete solution; the proof is in docs/theory/certificates.md.

Any admissible pair (v, lam'), lam' in dj(Bv - g), near the given point bounds its error:

    |u - u*|_K <= |u - v|_K + |f - K v - B'W lam'|_{K^-1} / margin

Of a body that is not linear ``K v`` is the derivative of its energy, and K elsewhere the stiffness of C_low.
Several such pairs are made and the smallest bound counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import AnyArray, Array, BoolArray
from hemivar.certificates.norms import EnergyNorm
from hemivar.discrete.bulk import Quadratic, Sized
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import contact_compliance
from hemivar.laws import StateBound, VectorLaw
from hemivar.laws.coupled import bounded
from hemivar.laws.vector_law import prox, prox_jacobian
from hemivar.linear.definite import REPEATED
from hemivar.linear.products import portions

__all__ = [
    "OPERATIONS",
    "Point",
    "anywhere",
    "equilibrium_multiplier",
    "error_bound",
    "friction_bound",
    "gram_solve",
    "lift",
    "symmetric_inverse",
    "trace_force",
]

#: Search for a better pair if the bound is above this part of |u|_K: on a small problem, on a large one.
_POOR = (1e-10, 1e-7)
#: Contact components times unknowns of a small problem.
_SMALL = 2_000_000
#: Steps of that search: with half and twice as many tests/certificates find the same.
_SEARCH_STEPS = 60
#: Operations between a strain and the stress of a material that is not linear.
OPERATIONS = 32
_Real = TypeVar("_Real", bound=np.floating)


def gram_solve(trace: sp.csr_array, rhs: Array, active: BoolArray) -> Array | None:
    """``(B B')^-1 rhs`` on the active rows, 0 elsewhere, (k,); None if rows of the trace depend on one another."""
    out = np.zeros(trace.shape[0])
    if not np.any(rhs[active]):
        return out
    part = sp.csr_array(trace[np.flatnonzero(active)])
    gram = sp.csc_array(part @ part.T)
    diagonal = gram.diagonal()
    off = gram - sp.diags_array(diagonal)
    if np.abs(off.data).max(initial=0.0) == 0.0:
        out[active] = rhs[active] / diagonal
        return out
    try:
        solution = spla.splu(gram).solve(rhs[active])
    except RuntimeError:
        return None
    miss = np.abs(gram @ solution - rhs[active]).max()
    if not miss <= 1e-8 * np.abs(rhs[active]).max():
        return None
    out[active] = solution
    return out


def lift(trace: sp.csr_array, change: Array, active: BoolArray) -> Array | None:
    """Displacements ``v = B'(B B')^-1 change`` whose trace changes by ``change`` on the active rows."""
    inner = gram_solve(trace, change, active)
    return None if inner is None else np.asarray(trace.T @ inner)


def symmetric_inverse(matrix: Array) -> Array | None:
    """Inverse of a small symmetric positive definite matrix, None if it is not one."""
    try:
        factor = la.cho_factor(0.5 * (matrix + matrix.T))
    except la.LinAlgError:
        return None
    inverse = la.cho_solve(factor, np.eye(len(matrix)))
    return np.asarray(0.5 * (inverse + inverse.T))


@dataclass(frozen=True, eq=False)
class Point:
    """A pair under examination and what belongs to it."""

    problem: DiscreteProblem
    energy: EnergyNorm
    u: Array
    lam: Array

    @cached_property
    def bulk(self) -> Quadratic:
        """The body; where it is not linear the linear one above it, for the sizes of its forces."""
        bulk = self.problem.bulk
        if isinstance(bulk, Sized):
            return bulk.upper
        return Quadratic(bulk.hessian(self.u))

    @property
    def active(self) -> BoolArray:
        """Which local components can move, (m, d)."""
        problem = self.problem
        return np.asarray(
            np.diff(problem.contact.trace.indptr).reshape(problem.contact_points, problem.contact.components) > 0
        )

    def law(self, r: Array, lam: Array) -> VectorLaw:
        """The ordinary law at a state."""
        return self.problem.law.frozen(r, lam)

    @cached_property
    def balance(self) -> tuple[Array, float]:
        """``f - K u - B'W lam`` and the bound of its rounding, see :func:`_out_of_balance`."""
        return _out_of_balance(self, self.u, self.lam)

    @cached_property
    def compliance(self) -> Array:
        """See :func:`contact_compliance`, (m, 2)."""
        return contact_compliance(self.problem)

    @cached_property
    def imbalance(self) -> tuple[Array, float]:
        """Displacement (n,) that this force causes, and its norm in K^-1."""
        return self.energy.riesz(self.balance[0])


def equilibrium_multiplier(problem: DiscreteProblem, u: Array) -> Array:
    """The multiplier (m, d) that balances ``f - K u`` on the contact unknowns, in the sense of least squares.

    Parameters
    ----------
    problem : DiscreteProblem
    u : array
        Unknowns, shape (n,).

    Returns
    -------
    array
    """
    return trace_force(problem, problem.out_of_balance(u)) / problem.contact.weights[:, None]


def trace_force(problem: DiscreteProblem, force: Array) -> Array:
    """The contact forces (m, d) that balance a force (n,) on the contact unknowns, in the sense of least squares.

    Parameters
    ----------
    problem : DiscreteProblem
    force : array
        Shape (n,).

    Returns
    -------
    array
    """
    active = np.diff(problem.contact.trace.indptr) > 0
    inner = gram_solve(problem.contact.trace, np.where(active, problem.contact.trace @ force, 0.0), active)
    shape = (problem.contact_points, problem.contact.components)
    return np.zeros(shape) if inner is None else inner.reshape(shape)


def friction_bound(problem: DiscreteProblem, r: Array, lam: Array) -> Array:
    """The friction bound (m,) in a state, where it depends on the state."""
    bound = bounded(problem.law).friction.bound
    assert isinstance(bound, StateBound)
    return np.asarray(bound.value(r[:, 0], lam[:, 0]))


def anywhere(problem: DiscreteProblem, values: AnyArray | bool) -> bool:
    """Whether a value of any process is not zero or False; all processes ask together."""
    return bool(problem.vectors.largest(float(np.any(values)))[0])


def error_bound(point: Point, margin: float, ceiling: Array | None = None) -> float:
    """Bound of ``|u - u*|_K`` for every solution u* of the discrete problem; inf if the margin is not positive.

    ``ceiling`` is (m,).
    """
    if not (margin > 0.0 and point.energy.definite):
        return np.inf
    problem = point.problem
    counted = problem.vectors.total(problem.contact_points, int(point.active.sum()), problem.unknowns)
    points, rows, unknowns = counted.tolist()
    if points == 0:
        return _evaluate(point, point.u, np.zeros((0, problem.contact.components)), point.lam, margin)
    best = np.inf
    r = problem.local(point.u)
    tau = point.compliance
    scale = point.energy.norm(point.u)
    poor = _POOR[0] if rows * unknowns <= _SMALL else _POOR[1]
    for given in (True, False):
        lam = point.lam if given else equilibrium_multiplier(problem, point.u)
        law = point.law(r, lam)
        snap_to_kinks = np.where(point.active, law.fitted(r, lam, tau), r)
        best = min(best, _admissible(point, point.u, snap_to_kinks, lam, margin, ceiling))
        if best <= poor * scale and not point.energy.factorised:
            break
    linear = isinstance(problem.bulk, Quadratic)
    if best > poor * scale and linear and 0 < rows <= REPEATED and point.energy.factorised:
        best = min(best, _search(point, margin, best, ceiling))
    return best


def _admissible(point: Point, base: Array, r: Array, lam: Array, margin: float, ceiling: Array | None = None) -> float:
    """The bound from the pair ``(base moved to r, element of dj(r) nearest to lam)``; inf if there is no such pair."""
    problem = point.problem
    if ceiling is not None and not bool((friction_bound(problem, r, lam) <= ceiling).all()):
        return np.inf
    law = point.law(r, lam)
    with np.errstate(invalid="ignore"):
        if problem.vectors.largest(float(not np.isfinite(law.value(r)).all()))[0]:
            return np.inf
        nearest = law.nearest_multiplier(r, lam)
    return _evaluate(point, base, r, nearest, margin)


def _evaluate(point: Point, base: Array, r: Array, lam: Array, margin: float) -> float:
    """``|u - v|_K + |f - K v - B'W lam|_{K^-1} / margin`` with v = ``base``, moved so that its trace is exactly r."""
    problem, energy = point.problem, point.energy
    v = base
    if anywhere(problem, r != problem.local(base)):
        change = (r - problem.local(base)).ravel()
        moved = lift(problem.contact.trace, np.where(point.active.ravel(), change, 0.0), point.active.ravel())
        if moved is None:
            return np.inf
        v = base + moved
    distance = _distance(point, v) if v is not point.u else 0.0
    if v is point.u and not anywhere(problem, lam != point.lam):
        norm, doubt = point.imbalance[1], point.balance[1]
    else:
        rest, doubt = _nearby(point, v, lam)
        norm = energy.riesz(rest, point.imbalance[0])[1]
    return distance + (norm + energy.rounding_norm(doubt)) / margin


def _distance(point: Point, v: Array) -> float:
    """``|u - v|_K``, raised by what rounding can hide."""
    step, norms = point.u - v, point.problem.vectors.norms
    size, longest = _rounding_size(point, step, np.zeros_like(v), np.zeros_like(point.lam))
    hidden = longest * float(np.finfo(float).eps) * size * float(norms(np.sqrt(point.energy.diagonal) * step)[0])
    return float(np.hypot(point.energy.norm(step), np.sqrt(hidden)))


def _nearby(point: Point, v: Array, lam: Array) -> tuple[Array, float]:
    """The same as :func:`_out_of_balance`: the difference to the given pair alone where it is small."""
    problem, (rest, doubt) = point.problem, point.balance
    step, change = v - point.u, problem.contact_force(lam - point.lam)
    size, longest = _rounding_size(point, step, np.zeros_like(v), lam - point.lam)
    left = float(problem.vectors.norms(rest / np.sqrt(point.energy.diagonal))[0])
    more = longest * float(np.finfo(float).eps) * (size + left)
    if more > doubt or not (v is point.u or isinstance(problem.bulk, Quadratic)):
        return _out_of_balance(point, v, lam)
    moved = point.bulk.stiffness @ step if v is not point.u else 0.0
    return rest - moved - change, doubt + more


def _out_of_balance(point: Point, v: Array, lam: Array) -> tuple[Array, float]:
    """``f - K v - B'W lam``, summed in extended precision, and a bound of ``|D^-1/2 e|_2``, e its rounding errors.

    ``|e| <= longest eps (|K| |v| + |f| + |B'| |W lam|)``, entry by entry, longest being the number of terms. Forces of
    a body that is not linear have the precision of their arithmetic.
    """
    problem, bulk, long = point.problem, point.bulk, np.longdouble
    if not isinstance(problem.bulk, Quadratic):
        sizes = np.abs(problem.load) + getattr(problem.bulk, "initial_sizes", 0.0)
        size, longest = _rounding_size(point, v, sizes, lam)
        rest = problem.out_of_balance(v) - problem.contact_force(lam)
        return rest, (longest + OPERATIONS) * float(np.finfo(float).eps) * size
    force = problem.contact.weights[:, None].astype(long) * lam
    transposed = sp.csr_array(problem.contact.trace.T)
    rest = problem.load - _product(bulk.stiffness, v.astype(long)) - _product(transposed, force.ravel())
    rounded = rest.astype(float)
    size, longest = _rounding_size(point, v, problem.load, lam)
    last = float(np.finfo(float).eps * np.linalg.norm(rounded / np.sqrt(point.energy.diagonal)))
    return rounded, longest * float(np.finfo(long).eps) * size + last


def _rounding_size(point: Point, v: Array, load: Array, lam: Array) -> tuple[float, int]:
    """Bound of ``|D^-1/2 (|K| |v| + |f| + |B'| |W lam|)|_2``, and the largest number of terms in an entry.

    By Schur's test ``|D^-1/2 |K| |v||_2 <= max_i (sum_j |K_ij| / K_ii) |D^1/2 v|_2``.
    """
    problem, diagonal = point.problem, point.energy.diagonal
    transposed = sp.csr_array(problem.contact.trace.T)
    seen = int(np.diff(transposed.indptr).max(initial=0))
    root = np.sqrt(diagonal)
    applied = np.abs(load) + abs(transposed) @ np.abs(problem.contact.weights[:, None] * lam).ravel()
    own = float((point.bulk.row_sums / diagonal).max(initial=0.0))
    spread, longest = problem.vectors.largest(own, float(max(point.bulk.longest, seen))).tolist()
    moved, pressed = problem.vectors.norms(root * v, applied / root).tolist()
    return spread * moved + pressed, int(longest) + 4


def _product(matrix: sp.csr_array, x: NDArray[_Real]) -> NDArray[_Real]:
    """``matrix @ x`` in the precision of x, some rows at a time."""
    out = np.zeros(matrix.shape[0], dtype=x.dtype)
    for rows, part in portions(matrix, lambda data: data.astype(x.dtype)):
        out[rows] = part @ x
    return out


def _search(point: Point, margin: float, best: float, ceiling: Array | None) -> float:
    """Look for a better pair by Newton steps on the condensed problem; every iterate gives a pair."""
    problem, energy = point.problem, point.energy
    m, d = problem.contact_points, problem.contact.components
    rows = np.flatnonzero(point.active.ravel())
    part = problem.contact.trace[rows]
    columns = energy.solve(part.T.toarray())
    flexibility = part @ columns
    S = symmetric_inverse(np.asarray(flexibility))
    if S is None:
        return best
    w = np.repeat(problem.contact.weights, d)[rows]
    free = energy.solve(point.problem.load)
    target = (part @ free) - problem.offset.ravel()[rows]  # local displacement without contact
    local = problem.local(point.u)
    r = local.copy()
    tau = np.full((m, d), np.inf)
    tau.ravel()[rows] = w / np.diagonal(S)
    tau = np.stack([tau[:, 0], tau[:, 1:].min(axis=1) if d > 1 else tau[:, 0]], axis=1)
    tau = np.where(np.isfinite(tau), tau, point.compliance)

    def multiplier(r: Array) -> Array:
        out = np.zeros(m * d)
        out[rows] = S @ (target - r.ravel()[rows]) / w
        return out.reshape(m, d)

    least = np.inf
    start_norm = max(float(np.sqrt(abs(target @ S @ target))), np.finfo(float).tiny)
    for _ in range(_SEARCH_STEPS):
        check_time()
        lam = multiplier(r)
        law = point.law(r, lam)
        alpha = np.stack([np.broadcast_to(a, (m,)) for a in law.weak_convexity], axis=1)
        step = np.minimum(tau, 0.5 / np.maximum(alpha, np.finfo(float).tiny))
        spread = np.concatenate([step[:, :1], np.repeat(step[:, 1:], d - 1, axis=1)], axis=1)
        x = r + spread * lam
        image = np.where(point.active, prox(law, x, step), local)
        if not np.isfinite(image).all():
            break
        for candidate in (image, np.where(point.active, r, local)):
            balance = multiplier(candidate)
            fits = point.law(candidate, balance)
            if not np.isfinite(fits.value(candidate)).all():
                continue
            off = w * (balance - fits.nearest_multiplier(candidate, balance)).ravel()[rows]
            moved = (candidate - local).ravel()[rows]
            estimate = float(np.sqrt(abs(moved @ S @ moved))) + float(np.sqrt(abs(off @ flexibility @ off))) / margin
            if estimate < least:
                least, chosen, chosen_lam = estimate, candidate, balance
        gap = (r - image).ravel()[rows]
        if float(np.sqrt(abs(gap @ S @ gap))) <= 1e-13 * start_norm:
            break
        jacobian = prox_jacobian(law, x, step)
        block = np.zeros((m * d, m * d))
        index = np.arange(m * d).reshape(m, d)
        for i in range(d):
            for j in range(d):
                block[index[:, i], index[:, j]] = jacobian[:, i, j]
        D = block[np.ix_(rows, rows)]
        system = np.eye(rows.size) - D @ (np.eye(rows.size) - (spread.ravel()[rows] / w)[:, None] * S)
        try:
            move = np.linalg.solve(system, -gap)
        except np.linalg.LinAlgError:
            move = -gap
        r = r.copy()
        r.ravel()[rows] += move
        if not np.isfinite(r).all():
            break
    if not np.isfinite(least):
        return best
    load = point.problem.load - problem.contact_force(np.where(point.active, multiplier(chosen), 0.0))
    return min(best, _admissible(point, energy.solve(load), chosen, chosen_lam, margin, ceiling))
