"""What is known about a solution over ranks: residuals, the margin of uniqueness, a bound of the error."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.certificates import Certificate, PointKind, Smallness
from hemivar.certificates.bound import OPERATIONS
from hemivar.certificates.linear_bodies import UNKNOWN
from hemivar.engines.petsc.body_on_ranks import BodyOnRanks
from hemivar.engines.petsc.discrete_on_ranks import body_of
from hemivar.engines.petsc.preconditioner import Multigrid
from hemivar.engines.petsc.stiffness import applied
from hemivar.engines.petsc.time_limit import Alarm
from hemivar.solvers import Solution, Status

__all__ = ["ESTIMATE", "NOTHING", "certify_on_ranks", "largest_ratio"]

_STEPS = 60
_SETTLED = 1e-4
_SOLVED = 1e-4
#: Unknowns up to which a factorisation is made to show a margin, in two dimensions and in three; and to show the
#: smallest eigenvalue, which is of less use.
_FACTORISED = ((200_000, 30_000), (30_000, 6_000))
#: How much larger than what was found the constant is tried to be shown smaller than.
_TRIALS = (5e-5, 1e-3)
#: K counts as singular if the smallest eigenvalue of it, scaled to a unit diagonal, is below this.
_SINGULAR = 1e-12
_SAFETY = 0.5
#: Methods of a margin that nothing shows, and of none.
ESTIMATE, NOTHING = "LOBPCG, an estimate", "none"


@dataclass(frozen=True)
class _Margin:
    """The constant c, the margin 1 - c, and whether a factorisation (or convexity) has shown that c is no larger."""

    constant: float
    shown: bool

    @property
    def value(self) -> float:
        return 1.0 - self.constant


def certify_on_ranks(solution: Solution, tolerance: float = 1e-8, alarm: Alarm | None = None) -> Certificate:
    """A certificate, as far as it is known; what is not is named in ``left_out``.

    For convex laws the margin is 1.  Else ``1 - c`` comes from the largest eigenvalue c of ``(B'W diag(alpha) B, K)``,
    which LOBPCG (Knyazev 2001) finds from below, so that the margin is an estimate from the optimistic side.  A
    factorisation by MUMPS, all pivots of ``c K - B'W diag(alpha) B`` being positive, shows that c is no larger; where
    that is too much work (:data:`_FACTORISED`), where MUMPS is missing, or where a law knows its alpha from samples
    only, uniqueness and a bound are not claimed.  ``method`` says which it was.

    The bound of the distance to the exact discrete solution is ``|f - K u - B'W lam'|_{K^-1} / margin`` with ``lam'``
    in ``dj(r)`` (docs/certificates-theory.md).  Conjugate gradients find its norm to 1e-4 of itself, rounding included.

    Of a body that is not linear ``K u`` is the derivative of its energy, and K elsewhere the stiffness of C_low, as in
    the serial certificate.  Where C_low is not known at every strain nothing is claimed.

    Numbers that are left out are nan, "not known"; the margin without a mesh that holds the body, or with a derivative
    that jumps down, is -inf, and the bound without a positive margin inf.
    """
    with np.errstate(all="ignore"):
        return _certified(solution, tolerance, Alarm() if alarm is None else alarm)


def _certified(solution: Solution, tolerance: float, alarm: Alarm) -> Certificate:
    began = time.perf_counter()
    body, residual = body_of(solution.problem), solution.residual
    linear, proved, stiffness_by, reach = _stiffness(body)
    finite = bool(np.isfinite([residual.total, residual.scale, solution.energy]).all())
    stationary = finite and residual.below(0.0, tolerance)
    normal, tangential, dependent, sampled = _alphas(body)
    jumps = max(normal, tangential) == np.inf
    constant, bound, relative, method = (np.inf, np.inf, np.inf, NOTHING) if jumps else (np.nan,) * 3 + (NOTHING,)
    unique = False
    held = body.supported and finite and solution.status is Status.CONVERGED
    if linear is not None and held and not jumps and not dependent:
        cycle = Multigrid(linear)
        cycle.build(np.zeros(body.unknown.size, dtype=bool), np.zeros((*body.active.shape, body.dim)))
        margin = _margin(linear, cycle, alarm)
        if margin is not None:
            constant, method = margin.constant, ESTIMATE
        if margin is not None and margin.shown:
            lowest, factorised = _lowest(linear, cycle, alarm)
            method = "factorisation" if factorised else "multigrid"
            if lowest > _SINGULAR and margin.value > 0.0 and proved and not sampled:
                unique = True
                found, size = _error_bound(solution, linear, cycle, margin.value, lowest)
                if np.isfinite(found):
                    bound, relative = found, found / size if size > 0.0 else found
        cycle.release()
    kind = PointKind.STATIONARY if stationary else PointKind.NOT_STATIONARY
    left_out = ["equilibrium", "trace constant"]
    if np.isnan(constant):
        left_out.append("margin")
    if np.isnan(bound):
        left_out.append("error bound")
    if stationary and not unique:
        left_out.append("kind")
    frozen_only = np.nan if dependent else tangential  # else it is that of one state only
    smallness = Smallness(
        alpha_normal=normal,
        alpha_tangential=frozen_only,
        alpha_sampled=sampled,
        m_alpha=np.nan if dependent else max(normal, tangential),
        m_L=np.nan,
        m_A=None,
        trace_constant=None,
        survey_condition=None,
        survey_margin=None,
        constant=constant,
        constant_normal=None,
        constant_tangential=None,
        coupling=np.nan if np.isnan(constant) or jumps else 0.0,
        contraction=np.nan,
        margin=1.0 - constant,
        stiffness_by=stiffness_by,
        reach_strain=reach,
    )
    inclusion = residual.inclusion
    return Certificate(
        equilibrium=np.nan,
        equilibrium_relative=np.nan,
        inclusion=inclusion,
        inclusion_relative=inclusion / residual.scale if residual.scale > 0.0 else inclusion,
        inclusion_distance=np.nan,
        residual=residual,
        energy=solution.energy,
        margin=smallness.margin,
        error_bound=bound,
        error_bound_relative=relative,
        kind=PointKind.UNIQUE_MINIMISER if unique and stationary else kind,
        unique=True if unique else None,
        curvature=None,
        direction=None,
        stationary=stationary,
        tolerance=tolerance,
        smallness=smallness,
        method=method,
        seconds=time.perf_counter() - began,
        warnings=solution.warnings,
        left_out=tuple(left_out),
    )


def _stiffness(body: BodyOnRanks) -> tuple[BodyOnRanks | None, bool, str, float]:
    """The linear body below, itself if it is linear, None where none is known; whether that is shown at every strain;
    how it was found, and up to which strains it holds."""
    if body.stored is None:
        return body, True, "", np.inf
    low, material = body.below_all(), body.statement.material
    if low is None:
        return None, False, UNKNOWN, np.inf
    reach = float(material.reach)
    return low, material.bounds_by.proved and reach == np.inf, material.bounds_by.value, reach


def _margin(body: BodyOnRanks, cycle: Multigrid, alarm: Alarm) -> _Margin | None:
    """The margin, None where time was too short or it turned out to be wrong."""
    found = largest_ratio(body, cycle, alarm)
    if found is None or not np.isfinite(found):
        return None
    if found == 0.0:
        return _Margin(0.0, True)
    if body.unknowns > _FACTORISED[0][body.dim == 3]:
        return _Margin(found, False)
    for trial in (*(found * (1.0 + more) for more in _TRIALS), 0.5 * (found + 1.0)):
        if not trial < 1.0:
            continue
        if _late(body, alarm):
            return _Margin(found, False)
        definite = _definite(body, trial, _softening(body))
        if definite is None:
            return _Margin(found, False)
        if definite:
            return _Margin(trial * (1.0 + 1e-6), True)
    return _Margin(found, False) if found >= 1.0 else None


def _late(body: BodyOnRanks, alarm: Alarm) -> bool:
    return bool(body.ranks.largest(alarm.due())[0])


def _softening(body: BodyOnRanks) -> Array:
    """The diagonal of ``B'W diag(alpha) B`` at the contact unknowns, (k,)."""
    weight = np.zeros(body.active.shape)
    normal, tangential = (np.broadcast_to(alpha, (body.points,)) for alpha in body.law.weak_convexity)
    weight[:, 0] = body.weights * normal
    weight[:, 1:] = (body.weights * tangential)[:, None]
    return np.asarray(np.abs(body.gather(weight) * body.sign))


def _definite(body: BodyOnRanks, factor: float, less: Array, scaled: float = 0.0) -> bool | None:
    """Whether ``factor K - diag(less)``, ``less`` at the contact unknowns, is positive definite; None if not known.

    With ``scaled`` that multiple of the diagonal of K is taken off as well.
    """
    from petsc4py import PETSc

    matrix = body.K.duplicate(copy=True)
    off = body.K.getDiagonal()
    off.scale(-scaled)
    off.array_w[body.unknown] -= less
    matrix.scale(factor)
    pc = PETSc.PC().create(body.ranks.comm)
    try:
        matrix.setDiagonal(off, addv=PETSc.InsertMode.ADD_VALUES)
        matrix.setOption(PETSc.Mat.Option.SPD, False)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        pc.setOperators(matrix)
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setMumpsIcntl(13, 1)  # signs of all pivots
        pc.getFactorMatrix().setMumpsIcntl(24, 1)  # and of those that are zero
        pc.setUp()
        _, _, positive = pc.getFactorMatrix().getInertia()
        return bool(positive == body.K.getSize()[0])
    except PETSc.Error:  # no MUMPS, or no memory for it
        return None
    finally:
        pc.destroy()
        matrix.destroy()


def _lowest(body: BodyOnRanks, cycle: Multigrid, alarm: Alarm) -> tuple[float, bool]:
    """Half the smallest eigenvalue of K scaled to a unit diagonal, by inverse iteration; and whether it was shown.

    On small problems a factorisation shows it; it is 0 where it is not known.
    """
    diagonal, start = body.elastic.matrix_diagonal, body.K.getOwnershipRange()
    x = np.where(body.held, 0.0, 1.5 + np.cos(1.0 + np.arange(*start) ** 1.3))
    value = np.inf
    for _ in range(4):
        if _late(body, alarm):
            value = 0.0
            break
        out, _ = _solved(body, cycle, diagonal * x, 0.1, 20)
        out[body.held] = 0.0
        stiff, size = body.ranks.total(float(out @ body.multiply(out)), float(diagonal @ out**2))
        if not (stiff > 0.0 and size > 0.0):
            value = 0.0
            break
        value = min(value, float(stiff / size))
        x = out / float(np.sqrt(size))
    lowest = _SAFETY * value if np.isfinite(value) else 0.0
    if lowest > _SINGULAR and body.unknowns <= _FACTORISED[1][body.dim == 3] and not _late(body, alarm):
        shown = _definite(body, 1.0, np.zeros(body.unknown.size), lowest)
        return (lowest, shown) if shown is not None and shown else (lowest if shown is None else 0.0, False)
    return lowest, False


def _solved(body: BodyOnRanks, cycle: Multigrid, right: Array, rtol: float, limit: int) -> tuple[Array, bool]:
    """``K^-1 right`` by conjugate gradients in the norm of the preconditioner, and whether they got there."""
    from petsc4py import PETSc

    ksp = PETSc.KSP().create(body.ranks.comm)
    ksp.setType("cg")
    ksp.setOperators(body.K)
    ksp.setPC(cycle.pc)
    ksp.setNormType(PETSc.KSP.NormType.NATURAL)
    ksp.setTolerances(rtol=rtol, atol=1e-300, max_it=limit)
    found = applied(ksp.solve, body.vector(), body.vector(), right)
    reached = ksp.getConvergedReason() > 0
    ksp.destroy()
    return found, reached


def _alphas(body: BodyOnRanks) -> tuple[float, float, bool, bool]:
    """Largest weak convexity constants of normal law and friction; whether a bound depends on the solution, and whether
    one of the constants is known from samples only."""
    law = body.law
    dependent = law.state_dependent
    sampled = law.alpha_sampled and body.points > 0
    fixed = law.frozen(np.zeros(body.active.shape), np.zeros(body.active.shape)) if dependent else law
    normal, tangential = (float(np.max(alpha, initial=0.0)) for alpha in fixed.weak_convexity)
    tangential = 0.0 if dependent else tangential
    found = body.ranks.largest(normal, tangential, float(dependent), float(sampled))
    return float(found[0]), float(found[1]), bool(found[2]), bool(found[3])


def largest_ratio(body: BodyOnRanks, cycle: Multigrid, alarm: Alarm | None = None) -> float | None:
    """Largest eigenvalue of ``(B'W diag(alpha) B, K)``, from below; ``cycle`` is set up with nothing held.

    None where time was too short for it.
    """
    alarm = Alarm() if alarm is None else alarm
    alpha = _softening(body)
    if not body.ranks.largest(float(alpha.max(initial=0.0)))[0] > 0.0:
        return 0.0

    def soften(v: Array) -> Array:
        out = np.zeros(v.size)
        out[body.unknown] = alpha * v[body.unknown]
        return out

    def pressed(v: Array) -> Array:
        out = applied(cycle.pc.apply, body.vector(), body.vector(), v)
        out[body.held] = 0.0
        return out

    place = body.K.getOwnershipRange()[0] + body.unknown
    start = np.zeros(body.load.size)
    start[body.unknown] = alpha * (1.5 + np.cos(1.0 + place**1.3))
    x, p = pressed(start), None
    ratio = 0.0
    for _ in range(_STEPS):
        if _late(body, alarm):
            return None
        rest, bent = soften(x), body.multiply(x)
        soft_part, stiff_part = body.ranks.total(float(x @ rest), float(x @ bent))
        ratio_now = float(soft_part / stiff_part)
        rest -= ratio_now * bent
        done = ratio_now - ratio <= 0.1 * _SETTLED * ratio_now
        ratio = ratio_now
        if done and p is not None:
            break
        basis = np.stack([x, pressed(rest)] + ([] if p is None else [p]))
        parts = [basis @ np.stack([image(v) for v in basis]).T for image in (soften, body.multiply)]
        A, K = body.ranks.total(*np.ravel(parts)).reshape(2, len(basis), len(basis))
        factors = _top_vector(A, K)
        p = factors[1:] @ basis[1:]
        x = p + factors[0] * x
    return ratio


def _top_vector(A: Array, K: Array) -> Array:
    """Eigenvector of the largest eigenvalue of the small problem (A, K), directions that K hardly sees left out."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(K), 1e-300))
    values, vectors = np.linalg.eigh(scale[:, None] * (0.5 * (K + K.T)) * scale)
    keep = values > 1e-10 * values[-1]
    whiten = scale[:, None] * vectors[:, keep] / np.sqrt(values[keep])
    _, tops = np.linalg.eigh(whiten.T @ (0.5 * (A + A.T)) @ whiten)
    return np.asarray(whiten @ tops[:, -1])


def _error_bound(
    solution: Solution, linear: BodyOnRanks, cycle: Multigrid, margin: float, lowest: float
) -> tuple[float, float]:
    """Bound of the distance to the exact discrete solution, and the norm of this one, in the energy of ``linear``.

    Sums are rounded by no more than ``n eps`` of the sizes of their n terms, and such a force has a dual norm of at
    most ``|D^-1/2 e| / sqrt(lowest)``, D the diagonal of K; local displacements are rounded as well, which moves the
    point that the multiplier belongs to.  The forces of a body that is not linear have the sizes of those of C_up.
    """
    body, x = body_of(solution.problem), solution.unknowns
    ranks = body.ranks
    above, curved = body.above_all(), body.stored is not None
    lam = np.where(body.active, body.law.nearest_multiplier(solution.local, solution.multiplier), solution.multiplier)
    pressed = body.gather(body.weights[:, None] * lam)
    rest = body.out_of_balance(x)
    rest[body.unknown] -= pressed
    error, solved = _solved(linear, cycle, rest, 1e-3 * _SOLVED, 200)
    solved = solved or not ranks.norms(rest)[0] > 0.0
    diagonal, eps = linear.elastic.matrix_diagonal, float(np.finfo(float).eps)
    terms = above.row_sums * np.abs(x) + np.abs(body.load)
    if body.stored is not None:
        terms += np.abs(body.stored.initial_forces)
    terms[body.unknown] += np.abs(pressed)
    moved = eps * np.sqrt(diagonal[body.unknown]) * (np.abs(x[body.unknown]) + np.abs(body.offset[body.active]))
    mesh = body.piece.mesh
    edges = mesh.edges if mesh.number_of_cells else np.zeros((0, 2), dtype=np.int64)
    joined = np.bincount(edges.ravel(), minlength=mesh.number_of_nodes).astype(float)
    joined = body.piece.summed(ranks, joined[:, None])
    spread, most = ranks.largest(float((above.row_sums / diagonal).max(initial=1.0)), float(joined.max(initial=0.0)))
    rounded, shift = ranks.norms(terms / np.sqrt(diagonal), moved)
    rounded *= eps * (body.dim * (1.0 + most) + 4.0 + curved * OPERATIONS) / np.sqrt(lowest)
    force = spread / np.sqrt(lowest) if curved else np.sqrt(spread)  # of a shift of one, in the dual norm
    work, square = ranks.total(float(rest @ error), float(x @ linear.multiply(x)))
    found = float(np.sqrt(max(work, 0.0))) * (1.0 + _SOLVED)
    bound = np.sqrt(spread) * shift + (found + rounded + force * shift) / margin if solved else np.inf
    return float(bound), float(np.sqrt(max(square, 0.0)))
