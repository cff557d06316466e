"""What is known about a solution over ranks: residuals, the margin of uniqueness, a bound of the error."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from hemivar._typing import Array
from hemivar.certify import Certificate, PointKind, Smallness
from hemivar.distributed.assembly import BodyOnRanks
from hemivar.distributed.multigrid import Multigrid
from hemivar.distributed.solve import DistributedSolution
from hemivar.solvers import Status

__all__ = ["certify_on_ranks", "largest_ratio"]

_STEPS = 60
_SETTLED = 1e-4
_SOLVED = 1e-4


def certify_on_ranks(solution: DistributedSolution, tolerance: float = 1e-8) -> dict[str, Any]:
    """The record of :meth:`hemivar.certify.Certificate.record`, as far as it is known; other values are None.

    The margin ``1 - c`` comes from the largest eigenvalue c of ``(B'W diag(alpha) B, K)``, found iteratively to about
    1e-4 of itself (LOBPCG with one vector, Knyazev 2001); for convex laws it is 1.  The bound of the distance to the
    exact discrete solution is ``|f - K u - B'W lam'|_{K^-1} / margin`` with ``lam'`` in ``dj(r)``
    (docs/certificates.md), its norm found by conjugate gradients to about 1e-4 of itself.
    """
    body = solution.body
    record: dict[str, Any] = {
        item.name: None
        for owner in (Certificate, Smallness)
        for item in fields(owner)
        if item.name not in ("residual", "smallness")
    }
    residual = solution.residual
    stationary = residual.below(0.0, tolerance)
    record |= {
        "inclusion": residual.inclusion,
        "inclusion_relative": residual.inclusion / residual.scale if residual.scale > 0.0 else residual.inclusion,
        "energy": solution.energy,
        "stationary": stationary,
        "tolerance": tolerance,
    }
    infinite: list[str] = []
    minus: list[str] = []
    normal, tangential, dependent, sampled = _alphas(body)
    record |= {"alpha_sampled": sampled, "error_bound_sampled": sampled}
    record |= {"alpha_normal": _finite(normal), "alpha_tangential": _finite(tangential)}
    record["m_alpha"] = _finite(max(normal, tangential))
    infinite += [
        name for name, value in (("alpha_normal", normal), ("alpha_tangential", tangential)) if value == np.inf
    ]
    if max(normal, tangential) == np.inf:
        infinite += ["m_alpha", "constant", "error_bound", "error_bound_relative"]
        minus.append("margin")
    elif not dependent and body.supported and solution.status is Status.CONVERGED:
        cycle = Multigrid(body)
        cycle.build(np.zeros(body.unknown.size, dtype=bool), np.zeros((*body.active.shape, body.dim)))
        constant = largest_ratio(body, cycle)
        margin = 1.0 - constant
        record |= {"constant": constant, "margin": margin, "coupling": 0.0}
        if margin > 0.0:
            bound, size = _error_bound(solution, cycle, margin)
            record |= {"error_bound": bound, "error_bound_relative": bound / size if size > 0.0 else bound}
            record["unique"] = None if sampled else True
            if stationary and not sampled:
                record["kind"] = PointKind.UNIQUE_MINIMISER.value
        cycle.destroy()
    return {**record, "infinite": infinite, "minus_infinite": minus}


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _alphas(body: BodyOnRanks) -> tuple[float, float, bool, bool]:
    """Largest weak convexity constants of normal law and friction; whether a bound depends on the solution, and whether
    the constants are sampled."""
    normal = tangential = 0.0
    sampled = False
    dependent = bool(body.points) and body.law.state_dependent
    if body.points:
        normal = float(np.max(body.law.normal.weak_convexity))
        if not dependent:
            tangential = float(np.max(body.law.weak_convexity[1]))
        sampled = body.law.normal.alpha_sampled or body.law.friction.profile.alpha_sampled
    found = body.ranks.largest(normal, tangential, float(dependent), float(sampled))
    return float(found[0]), float(found[1]), bool(found[2]), bool(found[3])


def largest_ratio(body: BodyOnRanks, cycle: Multigrid) -> float:
    """Largest eigenvalue of ``(B'W diag(alpha) B, K)``, from below; ``cycle`` is set up with nothing held."""
    weight = np.zeros(body.active.shape)
    if body.points:
        normal, tangential = (np.broadcast_to(alpha, (body.points,)) for alpha in body.law.weak_convexity)
        weight[:, 0] = body.weights * normal
        weight[:, 1:] = (body.weights * tangential)[:, None]
    alpha = np.abs(body.gather(weight) * body.sign)
    if not body.ranks.largest(float(alpha.max(initial=0.0)))[0] > 0.0:
        return 0.0

    def soften(v: Any) -> Any:
        out = body.f.duplicate()
        out.array_w[body.unknown] = alpha * v.array_r[body.unknown]
        return out

    def stiffen(v: Any) -> Any:
        out = body.f.duplicate()
        body.K.mult(v, out)
        return out

    def pressed(v: Any) -> Any:
        out = body.f.duplicate()
        cycle.apply(v, out)
        out.array_w[body.held] = 0.0
        return out

    start = body.f.duplicate()
    place = body.K.getOwnershipRange()[0] + body.unknown
    start.array_w[body.unknown] = alpha * (1.5 + np.cos(1.0 + place**1.3))
    x, p = pressed(start), None
    ratio = 0.0
    for _ in range(_STEPS):
        rest, bent = soften(x), stiffen(x)
        soft_part, stiff_part = body.ranks.total(_dot(x, rest), _dot(x, bent))
        ratio_now = float(soft_part / stiff_part)
        rest.axpy(-ratio_now, bent)
        done = ratio_now - ratio <= 0.1 * _SETTLED * ratio_now
        ratio = ratio_now
        if done and p is not None:
            break
        basis = [x, pressed(rest)] + ([] if p is None else [p])
        soft, stiff = [soften(v) for v in basis], [stiffen(v) for v in basis]
        count = len(basis)
        entries = [_dot(basis[i], images_[j]) for images_ in (soft, stiff) for i in range(count) for j in range(count)]
        A, K = body.ranks.total(*entries).reshape(2, count, count)
        factors = _top_vector(A, K)
        new = body.f.duplicate()
        p = body.f.duplicate()
        for factor, vector in zip(factors[1:], basis[1:], strict=True):
            p.axpy(factor, vector)
        p.copy(new)
        new.axpy(factors[0], x)
        x = new
    return ratio


def _dot(a: Any, b: Any) -> float:
    return float(a.array_r @ b.array_r)


def _top_vector(A: Array, K: Array) -> Array:
    """Eigenvector of the largest eigenvalue of the small problem (A, K), directions that K hardly sees left out."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(K), 1e-300))
    values, vectors = np.linalg.eigh(scale[:, None] * (0.5 * (K + K.T)) * scale)
    keep = values > 1e-10 * values[-1]
    whiten = scale[:, None] * vectors[:, keep] / np.sqrt(values[keep])
    _, tops = np.linalg.eigh(whiten.T @ (0.5 * (A + A.T)) @ whiten)
    return np.asarray(whiten @ tops[:, -1])


def _error_bound(solution: DistributedSolution, cycle: Multigrid, margin: float) -> tuple[float, float]:
    """Bound of the distance to the exact discrete solution, and the energy norm of this one."""
    from petsc4py import PETSc

    body = solution.body
    lam = solution.multiplier
    if body.points:
        lam = np.where(body.active, body.law.nearest_multiplier(solution.local, lam), lam)
    rest = solution.force.copy()
    rest.array_w[body.unknown] -= body.gather(body.weights[:, None] * lam)
    ksp = PETSc.KSP().create(body.ranks.comm)
    ksp.setType("cg")
    ksp.setOperators(body.K)
    ksp.setPC(cycle.pc)
    ksp.setTolerances(rtol=1e-3 * _SOLVED, atol=1e-300, max_it=200)
    error = body.f.duplicate()
    ksp.solve(rest, error)
    ksp.destroy()
    bent = body.f.duplicate()
    body.K.mult(solution.x, bent)
    work, square = body.ranks.total(_dot(rest, error), _dot(solution.x, bent))
    return float(np.sqrt(max(work, 0.0)) * (1.0 + _SOLVED) / margin), float(np.sqrt(max(square, 0.0)))
