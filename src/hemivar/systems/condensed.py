"""Condensation: the discrete problem reduced to the local displacements of its contact points."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.arrays import real_array
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.hold import Growth, growth_along
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import LoadScale, Residual, contact_compliance, load_scale, residual
from hemivar.errors import ProblemError
from hemivar.fem.free_motion import free_growth
from hemivar.fem.posed import posed
from hemivar.laws import ContactLaw
from hemivar.linear.definite import below_zero, free_unknowns, indefinite, quotient, refuse_indefinite, refuse_unseen
from hemivar.linear.factor_memory import check_memory, shortage
from hemivar.linear.factorisation import Factorisation, factorise
from hemivar.linear.vectors import WHOLE, Vectors
from hemivar.mechanics.statement import ContactProblem

__all__ = ["CondensedProblem", "condense"]

#: Gaps this many times larger than the displacements are far.
_FAR = 1e4
#: Local displacements that count as none in a motion whose stiffness is zero up to rounding.
ROUNDED = 1e-9


@dataclass(frozen=True, eq=False)
class CondensedProblem(Portable):
    """Energy of the contact unknowns alone: ``1/2 r'A r - g'r + sum_j w_j j(r_j) + constant``.

    ``r (m, d)`` are the local displacements (penetration and slip).  All other unknowns have been eliminated, so
    that minimising this energy is minimising E(u).

    Attributes
    ----------
    problem : DiscreteProblem
        Where it comes from.
    matrix : array (m d, m d)
        A, symmetric; rows and columns of components that a support fixes are zero.
    force : array (m d,)
        g.
    active : bool array (m, d)
        Components that are free to move.
    fixed : array (m, d)
        Values of the components that are not.
    constant : float
        Energy that does not depend on r.
    rest_energy : float
        Elastic energy of the body under its load when r = 0 (strictly: when all contact unknowns are held at zero).
    seconds : float
        Time the condensation took.
    """

    problem: DiscreteProblem
    matrix: Array
    force: Array
    active: BoolArray
    fixed: Array
    constant: float
    rest_energy: float
    seconds: float
    _recovery: _Recovery
    _body: _Body

    def __reduce__(self) -> tuple[Any, ...]:
        return condense, (self.problem,)  # factors cannot travel: they are made again on arrival

    def __deepcopy__(self, memo: dict[int, Any]) -> CondensedProblem:
        return condense(copy.deepcopy(self.problem, memo))

    # ---- views -----------------------------------------------------------------------------------------

    @property
    def law(self) -> ContactLaw:
        """The contact law."""
        return self.problem.law

    @property
    def weights(self) -> Array:
        """Quadrature weights (m,)."""
        return self.problem.weights

    @property
    def shape(self) -> tuple[int, int]:
        """Contact points m and components d."""
        return self.active.shape[0], self.active.shape[1]

    @cached_property
    def free(self) -> IntArray:
        """Indices of the free components in a flattened ``r``."""
        return np.flatnonzero(self.active.ravel())

    @cached_property
    def diagonal(self) -> Array:
        """Stiffness of every component when all others are held, one number for the tangential ones, (m, d).

        Where a body hangs on a contact point alone, that stiffness is zero; the stiffness of the material at the point
        takes its place.
        """
        m, d = self.shape
        pair = self.weights[:, None] / self._full_compliance
        local = np.concatenate([pair[:, :1], np.repeat(pair[:, 1:], d - 1, axis=1)], axis=1)
        diagonal = np.diagonal(self.matrix).reshape(m, d).copy()
        if d > 1:
            diagonal[:, 1:] = diagonal[:, 1:].max(axis=1, keepdims=True)
        return np.where(diagonal > 1e-10 * local, diagonal, local)

    @property
    def vectors(self) -> Vectors:
        """A condensed body is in one piece."""
        return WHOLE

    def couple(self, step: Array) -> Array:
        """Elastic force ``A step`` (m, d) that a step (m, d) of the local displacements takes away."""
        return np.asarray(self.matrix @ step.ravel()).reshape(step.shape)

    @property
    def tangential_blocks(self) -> Array:
        """Stiffness of the tangential components of each point, (m, d - 1, d - 1)."""
        m, d = self.shape
        return np.asarray(self.matrix.reshape(m, d, m, d)[np.arange(m), 1:, np.arange(m), 1:])

    @cached_property
    def compliance(self) -> Array:
        """Displacement for a unit pressure at a point when all other contact points are held, (m, 2)."""
        d = self.shape[1]
        return np.asarray(self.weights[:, None] / self.diagonal[:, [0, min(1, d - 1)]])

    @cached_property
    def rigid_modes(self) -> Array:
        """Directions of the free components in which the body moves without deforming, (k, free.size).

        Those of mesh and supports; of a stiffness without a mesh, its eigenvectors with eigenvalue zero up to rounding.
        """
        known = free_unknowns(self.problem)
        if known is not None:
            return np.asarray((self.problem.trace[self.free] @ known).T)
        A = self.matrix[np.ix_(self.free, self.free)]
        if self.free.size == 0:
            return np.zeros((0, 0))
        scale = 1.0 / np.sqrt(self.diagonal.ravel()[self.free])
        scaled = scale[:, None] * A * scale
        try:
            factor, _ = la.cho_factor(scaled)
            if np.diagonal(factor).min() > 1e-6:
                return np.zeros((0, self.free.size))
        except la.LinAlgError:
            pass
        values, vectors = la.eigh(scaled)
        return np.asarray((scale[:, None] * vectors[:, values < 1e-11]).T)

    def free_growth(self) -> list[Growth]:
        """Growth of the energy along the motions that deform nothing, by groups of parts that move by themselves."""
        if free_unknowns(self.problem) is not None:
            assert self.problem.field is not None
            return free_growth(self.problem, self.problem.field.free_motions)
        modes = self.rigid_modes
        if not len(modes):
            return []
        local = np.zeros((*self.shape, len(modes)))
        local.reshape(-1, len(modes))[self.free] = modes.T
        moved = np.stack([self._recovery.linear(r) for r in local.transpose(2, 0, 1)], axis=1)
        load = self.problem.load
        size = float(np.abs(load) @ np.abs(moved).max(axis=1))
        return [growth_along(self.law, local, self.weights, moved.T @ load, size, ROUNDED)]

    @cached_property
    def length_scale(self) -> float:
        """A typical displacement, for methods that work on scaled unknowns."""
        size = max(float(np.abs(self.fixed).max(initial=0.0)), float(np.abs(self.problem.gap).max(initial=0.0)))
        if self.free.size:
            A = self.matrix[np.ix_(self.free, self.free)]
            held = A + 1e-3 * np.diag(self.diagonal.ravel()[self.free])
            moved: Array = np.asarray(la.solve(held, self.force[self.free], assume_a="pos"))
            size = max(size, float(np.abs(moved).max()))
        return size if size > 0.0 else 1.0

    @cached_property
    def pressure_scale(self) -> float:
        """A typical multiplier."""
        scale = float(np.linalg.norm(self.force) / np.linalg.norm(self.weights)) if self.weights.size else 0.0
        return scale if scale > 0.0 else 1.0

    def local(self, r: Array) -> Array:
        """Local displacements, which the points of a condensed body are."""
        return r

    def of_unknowns(self, unknowns: Array) -> Array:
        """Local displacements (m, d) of the unknowns (n,)."""
        return self.problem.local(unknowns)

    # ---- energy and balance -----------------------------------------------------------------------------

    def energy_norm(self, r: Array) -> float:
        """``sqrt(u'K u)`` of the displacement with local displacements ``r``."""
        square = float(r.ravel() @ (self.matrix @ r.ravel())) + 2.0 * self.rest_energy
        return float(np.sqrt(max(square, 0.0)))

    def stretch(self, change: Array) -> float:
        """Energy norm of a difference of two local displacements, the rest of the body following."""
        flat = change.ravel()
        return float(np.sqrt(max(float(flat @ (self.matrix @ flat)), 0.0)))

    def start(self, guess: Array | None = None) -> Array:
        """An admissible starting point ``(m, d)`` near ``guess``, or near zero displacement."""
        m, d = self.shape
        if guess is None:
            guess = -self.problem.offset.reshape(m, d)
        r = real_array(guess, "the starting point", finite=False)
        return np.where(self.active, self.law.admissible(np.where(self.active, r, self.fixed)), self.fixed)

    def energy(self, r: Array) -> float:
        """E of the displacement with local displacements ``r``."""
        x = r.ravel()
        answer = self.law_at(r).value(r)
        return float(0.5 * x @ (self.matrix @ x) - self.force @ x + self.weights @ answer) + self.constant

    def law_at(self, r: Array, lam: Array | None = None) -> ContactLaw:
        """The law, with a bound that depends on the solution evaluated at ``r`` and the multiplier ``lam``."""
        if not self.law.state_dependent:
            return self.law
        return self.law.frozen(r, self.out_of_balance(r) / self.weights[:, None] if lam is None else lam)

    def out_of_balance(self, r: Array) -> Array:
        """Elastic force ``g - A r`` on the contact points, (m, d); it must equal ``W lambda``."""
        return (self.force - self.matrix @ r.ravel()).reshape(self.shape)

    def multiplier(self, r: Array) -> Array:
        """Pressure and friction in equilibrium with ``r``; on fixed components the smallest that the law allows."""
        lam = self.out_of_balance(r) / self.weights[:, None]
        if not self.active.all():
            reaction = self.law_at(r, lam).nearest_multiplier(r, np.zeros(self.shape))
            lam = np.where(self.active, lam, reaction)
        return lam

    def residual(self, r: Array, lam: Array) -> Residual:
        """The residual of the full problem for ``(r, lambda)``, the other unknowns being in equilibrium."""
        off_balance = np.where(self.active, self.out_of_balance(r) - self.weights[:, None] * lam, 0.0)
        off_law = self.law_at(r, lam).graph_distance(r, lam, self._full_compliance) if len(r) else np.zeros(0)
        return Residual.of(
            out_of_balance=off_balance,
            inclusion=self.weights * off_law,
            load=self._load_scale,
            contact_force=np.where(self.active, self.weights[:, None] * lam, 0.0),
            moved=np.abs(self.matrix) @ np.abs(r.ravel()) + np.abs(self.force),
        )

    @cached_property
    def _full_compliance(self) -> Array:
        return contact_compliance(self.problem)

    @cached_property
    def _load_scale(self) -> LoadScale:
        return load_scale(self.problem, self._full_compliance)

    # ---- the same body otherwise ---------------------------------------------------------------------------

    def for_problem(self, problem: DiscreteProblem) -> CondensedProblem:
        """The condensation of the same body under another load, gap or law, without a new factorisation.

        Parameters
        ----------
        problem : DiscreteProblem
            With the same stiffness, trace and weights.
        """
        old = self.problem
        if problem.stiffness.shape != old.stiffness.shape or problem.trace.shape != old.trace.shape:
            raise ProblemError("the other problem is of another size; condense it by itself")
        began = time.perf_counter()
        if problem is old:
            return self
        if problem.bulk is old.bulk and problem.contact.offset is old.contact.offset:
            return replace(self, problem=problem, seconds=0.0)
        return _load(self._body, problem, began)

    def with_law(self, law: ContactLaw) -> CondensedProblem:
        """The same body on another foundation."""
        return self.for_problem(self.problem.with_law(law))

    # ---- the way back --------------------------------------------------------------------------------------

    def full_residual(self, unknowns: Array, lam: Array) -> Residual:
        """The residual of the problem with all its unknowns (n,)."""
        return residual(self.problem, unknowns, lam)

    def unknowns(self, r: Array) -> Array:
        """All unknowns u (n,) in equilibrium with the local displacements ``r (m, d)``."""
        return self._recovery(r)

    def follow(self, change: Array) -> Array:
        """Change of all unknowns (n,) that goes with a change (m, d) of the local displacements alone."""
        return self._recovery.linear(change)

    def spread_force(self, force: Array, reaction: Callable[[DiscreteProblem, Array], Array]) -> tuple[Array, Array]:
        """A small force (n,) taken up by the unknowns that no contact point sees: their change (n,), and what is left.

        ``reaction`` gives the contact forces (m, d) of a force (n,).
        """
        inner = self._recovery.factor.solve_interior(force)
        return inner, reaction(self.problem, force - self.problem.stiffness @ inner)

    def recover(self, r: Array, lam: Array) -> tuple[Array, Residual]:
        """All unknowns u (n,) from the local displacements, with the residual of the full problem."""
        u = self._recovery(r)
        found = residual(self.problem, u, lam)
        # One step of iterative refinement where rounding in the elimination shows.
        u_refined = self._recovery.refine(u, self.problem, lam)
        refined = residual(self.problem, u_refined, lam)
        if refined.total < found.total:
            u, found = u_refined, refined
        sharper = self._sharpened(u, r, lam)
        if sharper is not None and sharper[1] < found.total:
            return sharper[0], residual(self.problem, sharper[0], lam)
        return u, found

    def _sharpened(self, u: Array, r: Array, lam: Array) -> tuple[Array, float] | None:
        """Equilibrium of the contact points that are far from the foundation, where r is the gap and u is lost in it.

        With its residual for the multiplier of the law, which must not depend on r there.  None where no gap is that
        large, or where the points are not held.
        """
        offset = self.problem.offset.reshape(self.shape)
        moved = float(np.abs(r + offset)[self.active].max(initial=0.0))
        far = self.active & (np.abs(offset) > _FAR * moved)
        if moved == 0.0 or not far.any():
            return None
        law = self.law_at(r, lam)
        lam = np.where(self.active, law.nearest_multiplier(r, lam), lam)
        smooth = law.linearise(r)
        flat = smooth.smooth[:, [0] + [1] * (self.shape[1] - 1)]
        flat &= np.abs(smooth.hessian).sum(axis=2) == 0.0
        free = np.flatnonzero((self.active & flat).ravel())
        if not far.ravel()[free].any():
            return None
        rest = self.problem.load - self.problem.stiffness @ u - self.problem.contact_force(lam)
        inner = self._recovery.factor.solve_interior(rest)
        reduced = (rest - self.problem.stiffness @ inner)[self._recovery.kept]
        try:
            factor = la.cho_factor(self.matrix[np.ix_(free, free)])
        except la.LinAlgError:
            return None
        change = np.zeros(self.active.size)
        change[free] = la.cho_solve(factor, np.asarray(self._recovery.spread.T @ reduced)[free])
        u = u + inner + self._recovery.linear(change)
        return u, residual(self.problem, u, lam).total


@dataclass(frozen=True, eq=False)
class _Recovery:
    """Interior unknowns from contact unknowns: ``u_I = K_II^-1 (f_I - K_IC y)``, ``y = Y (r + offset) + y0``."""

    factor: Factorisation
    stiffness: sp.csr_array
    load: Array
    kept: IntArray
    offset: Array
    spread: Any  # (k, m d) array or sparse array
    shift: Array  # (k,)

    def __call__(self, r: Array) -> Array:
        u = np.zeros(self.load.size)
        u[self.kept] = self.spread @ (r.ravel() + self.offset) + self.shift
        return u + self.factor.solve_interior(self.load - self.stiffness @ u)

    def linear(self, change: Array) -> Array:
        """The same for a change of the local displacements, without load and shift."""
        u = np.zeros(self.load.size)
        u[self.kept] = self.spread @ change.ravel()
        return u - self.factor.solve_interior(self.stiffness @ u)

    def refine(self, u: Array, problem: DiscreteProblem, lam: Array) -> Array:
        rest = self.load - self.stiffness @ u - problem.contact_force(lam)
        return u + self.factor.solve_interior(rest)


def condense(problem: DiscreteProblem | ContactProblem) -> CondensedProblem:
    """Eliminate every unknown that no contact law acts on (the survey's Schur complement, section 5.2).

    Costs one sparse factorisation.  Where the trace selects single unknowns (nodal quadrature) the contact unknowns
    are kept as they are; otherwise (midpoints, arrays of the user's) they are changed for the local displacements
    by an orthogonal factorisation of the trace, and what is left over is eliminated as well.

    Raises
    ------
    ProblemError
        The interior is singular (part of the body can move freely), the stiffness has a negative eigenvalue, or contact
        rows depend on one another.
    MethodError
        The memory that is free does not suffice.
    """
    problem = posed(problem, "condense")
    began = time.perf_counter()
    contact = problem.contact_points * problem.dim
    check_memory(problem.unknowns, problem.dim, contact)
    try:
        return _load(_condense_body(problem), problem, began)
    except MemoryError:
        raise shortage(problem) from None


@dataclass(frozen=True, eq=False)
class _Body:
    """What the condensation makes of stiffness and trace alone, whatever the load, the gap and the law."""

    factor: Factorisation
    kept: IntArray
    matrix: Array
    active: BoolArray
    spread: Any  # (k, m d) array or sparse array
    drift: Array | None  # (k, k): displacement of what no contact point sees, for a force on the kept unknowns


def _condense_body(problem: DiscreteProblem) -> _Body:
    refuse_unseen(problem)
    K, B = problem.stiffness, problem.trace
    m, d = problem.contact_points, problem.dim
    B = sp.csr_array(B)
    B.eliminate_zeros()
    kept = np.unique(B.indices).astype(np.int64)
    factor = factorise(K, kept)
    active = (np.diff(B.indptr) > 0).reshape(m, d)
    rows = np.flatnonzero(active.ravel())
    trace = sp.csr_array(B[rows][:, kept])
    select = trace.nnz == rows.size == kept.size and np.all(trace.data == 1.0)
    S = factor.schur
    if free_unknowns(problem) is None:
        _check_semidefinite(problem, factor, kept)
    matrix = np.zeros((m * d, m * d))
    drift: Array | None = None
    if select:
        columns = trace.indices
        matrix[np.ix_(rows, rows)] = S[np.ix_(columns, columns)]
        spread: Any = sp.csr_array((np.ones(rows.size), (columns, rows)), shape=(kept.size, m * d))
    else:
        local, remainder = _local_coordinates(trace.toarray())
        if remainder.shape[1]:
            # Minimise over the combinations of contact unknowns that no contact point sees.
            pivot = la.cho_factor(_positive(remainder.T @ S @ remainder))
            follow = -la.cho_solve(pivot, remainder.T @ S @ local)
            local = local + remainder @ follow
            drift = remainder @ la.cho_solve(pivot, remainder.T)
        dense = np.zeros((kept.size, m * d))
        dense[:, rows] = local
        spread = dense
        block = local.T @ S @ local
        matrix[np.ix_(rows, rows)] = 0.5 * (block + block.T)
    return _Body(factor, kept, matrix, active, spread, drift)


def _check_semidefinite(problem: DiscreteProblem, factor: Factorisation, kept: IntArray) -> None:
    """Refuse a stiffness without a mesh along which the energy falls: shown by a displacement, free of doubt."""
    K, scale = problem.stiffness, problem.diagonal[kept]
    if factor.interior_positive:
        root = np.sqrt(scale)
        scaled = factor.schur / np.outer(root, root)
        try:
            la.cho_factor(scaled + 1e-13 * np.eye(kept.size))
            return
        except la.LinAlgError:
            u = np.zeros(problem.unknowns)
            u[kept] = la.eigh(scaled, subset_by_index=[0, 0])[1][:, 0] / root
            u += factor.solve_interior(-(K @ u))
        refuse_indefinite(below_zero(problem, quotient(K, u, problem.diagonal)))
    else:
        refuse_indefinite(indefinite(K))


def _load(body: _Body, problem: DiscreteProblem, began: float) -> CondensedProblem:
    K, f = problem.stiffness, problem.load
    interior = body.factor.solve_interior(f)
    reduced_force = (f - K @ interior)[body.kept]
    rest_energy = 0.5 * float(f @ interior)
    constant = problem.constant - rest_energy
    shift = np.zeros(body.kept.size)
    if body.drift is not None:
        shift = body.drift @ reduced_force
        constant -= 0.5 * float(shift @ reduced_force)
    force = np.asarray(body.spread.T @ reduced_force)
    # From contact unknowns y = r + offset to r.
    offset = problem.offset
    free_offset = np.where(body.active.ravel(), offset, 0.0)
    constant += 0.5 * float(free_offset @ (body.matrix @ free_offset)) - float(force @ free_offset)
    force = force - body.matrix @ free_offset
    fixed = np.where(body.active, 0.0, -offset.reshape(body.active.shape))
    recovery = _Recovery(body.factor, K, f, body.kept, free_offset, body.spread, shift)
    return CondensedProblem(
        problem,
        body.matrix,
        force,
        body.active,
        fixed,
        constant,
        rest_energy,
        time.perf_counter() - began,
        recovery,
        body,
    )


def _local_coordinates(trace: Array) -> tuple[Array, Array]:
    """Columns ``(T, N)`` with ``trace @ T = 1`` and N an orthonormal basis of the null space of ``trace``."""
    count = trace.shape[0]
    if count > trace.shape[1]:
        raise _dependent()
    q, upper = la.qr(trace.T)
    upper = upper[:count]
    pivots = np.abs(np.diagonal(upper))
    if pivots.min(initial=np.inf) <= 1e-12 * pivots.max(initial=0.0):
        raise _dependent()
    return q[:, :count] @ la.solve_triangular(upper, np.eye(count), trans="T"), q[:, count:]


def _dependent() -> ProblemError:
    return ProblemError(
        "the rows of the trace depend on one another: two contact points share their displacement; "
        "use nodal quadrature, or join the points and add their weights"
    )


def _positive(matrix: Array) -> Array:
    smallest = np.linalg.eigvalsh(matrix)[0] if matrix.size else 1.0
    if smallest <= 0.0:
        raise ProblemError(
            "the body can move without deforming and without any contact point noticing it; add a support"
        )
    return matrix
