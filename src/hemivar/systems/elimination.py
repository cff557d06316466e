"""Schur complement: elimination of the unknowns that no contact law acts on, and their recovery."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.bulk import without_zeros
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import contact_compliance
from hemivar.discrete.rigid_part import RigidPart
from hemivar.errors import ProblemError
from hemivar.linear.definite import EIGENVALUE, FEW, below_zero, indefinite, quotient, refuse_indefinite
from hemivar.linear.factorisation import CondensedLoad, Factorisation, factorise
from hemivar.linear.vectors import WHOLE, Vectors
from hemivar.systems.contact_moves import majorant
from hemivar.systems.free_unknowns import free_unknowns, refuse_unseen

__all__ = ["Recovery", "SchurComplement"]


@dataclass(frozen=True, eq=False)
class SchurComplement:
    """What the condensation makes of stiffness and trace alone, whatever the load, the gap and the law."""

    factor: Factorisation  # of the stiffness, apart from the unknowns ``kept``
    kept: IntArray  # (k,): the unknowns that contact points see
    # (m d, m d): stiffness between local displacements; rows and columns of components that a support fixes are zero
    matrix: Array
    active: BoolArray  # (m, d): components that are free to move
    compliance: Array  # (m, 2): displacement for a unit pressure at a contact point when all other unknowns are held
    weights: Array  # (m,)
    spread: sp.csr_array  # (k, m d): kept unknowns from local displacements
    drift: Array | None  # (k, k): displacement of what no contact point sees, for a force on the kept unknowns
    free_unknowns: Array | None  # (n, a): of the motions without deformation; None where K is not that of a mesh
    stiffness: sp.csr_array  # (n, n): K
    rigid_part: RigidPart  # of local displacements

    vectors: Vectors = field(default=WHOLE, init=False)
    # law, offset and rest of the load scale that was asked for last: loads that follow have the same
    last_rest: list[tuple[object, object, float]] = field(default_factory=lambda: [(None, None, 0.0)], init=False)

    @staticmethod
    def of(problem: DiscreteProblem, many: bool = False) -> SchurComplement:
        """Factorise the body of a problem and reduce it to its local displacements; ``many`` if many loads follow.

        Raises ProblemError: the interior is singular, the stiffness has a negative eigenvalue, or contact rows depend
        on one another.
        """
        refuse_unseen(problem)
        K, B = problem.stiffness, sp.csr_array(problem.contact.trace)
        m, d = problem.contact_points, problem.contact.components
        B.eliminate_zeros()
        kept = np.unique(B.indices).astype(np.int64)
        factor = factorise(K, kept, many)
        active = (np.diff(B.indptr) > 0).reshape(m, d)
        rows = np.flatnonzero(active.ravel())
        trace = sp.csr_array(B[rows][:, kept])
        select = trace.nnz == rows.size == kept.size and np.all(trace.data == 1.0)
        S = factor.schur
        known, parts = free_unknowns(problem), problem.model.parts
        if parts is not None and not parts.semidefinite:
            refuse_indefinite(None if factor.interior_positive else indefinite(K))
        elif known is None:
            _check_semidefinite(problem, factor, kept)
        matrix = np.zeros((m * d, m * d))
        drift: Array | None = None
        if select:
            columns = trace.indices
            matrix[np.ix_(rows, rows)] = S[np.ix_(columns, columns)]
            spread = sp.csr_array((np.ones(rows.size), (columns, rows)), shape=(kept.size, m * d))
        else:
            local, remainder = _local_coordinates(trace.toarray())
            if remainder.shape[1]:
                # Minimise over the combinations of contact unknowns that no contact point sees.
                pivot = la.cho_factor(_positive(remainder.T @ S @ remainder))
                follow = -la.cho_solve(pivot, remainder.T @ S @ local)
                local = local + remainder @ follow
                drift = remainder @ la.cho_solve(pivot, remainder.T)
            spread = np.zeros((kept.size, m * d))
            spread[:, rows] = local
            block = local.T @ S @ local
            matrix[np.ix_(rows, rows)] = 0.5 * (block + block.T)
        compliance, weights = contact_compliance(problem), problem.contact.weights
        rigid = RigidPart.none(m * d)
        if problem.model.free_unknowns is not None:
            groups = [group.columns for group in problem.model.free_motions.groups]
            rigid = RigidPart.of(B @ problem.model.free_unknowns, groups)
        return SchurComplement(factor, kept, matrix, active, compliance, weights, spread, drift, known, K, rigid)

    @cached_property
    def sizes(self) -> Array:
        """Absolute entries of the matrix, by which rounding is estimated."""
        return np.abs(self.matrix)

    @cached_property
    def diagonal(self) -> Array:
        """Stiffness of every component when all others are held, one number for the tangential ones, (m, d).

        Where a body hangs on a contact point alone, that stiffness is zero; the stiffness of the material at the point
        takes its place.
        """
        m, d = self.active.shape
        pair = self.weights[:, None] / self.compliance
        local = np.concatenate([pair[:, :1], np.repeat(pair[:, 1:], d - 1, axis=1)], axis=1)
        diagonal = np.diagonal(self.matrix).reshape(m, d).copy()
        if d > 1:
            diagonal[:, 1:] = diagonal[:, 1:].max(axis=1, keepdims=True)
        return np.where(diagonal > 1e-10 * local, diagonal, local)

    @cached_property
    def pointwise(self) -> Array:
        """The same per area, of the normal and of the tangential part, (m, 2)."""
        d = self.active.shape[1]
        return np.asarray(self.diagonal[:, [0, min(1, d - 1)]] / self.weights[:, None])

    @cached_property
    def per_area(self) -> Array:
        """:attr:`diagonal` per area, (m, d)."""
        return np.asarray(self.diagonal / self.weights[:, None])

    @cached_property
    def resilience(self) -> Array:
        """:attr:`compliance` of every component, (m, d)."""
        return np.repeat(self.compliance, [1, self.active.shape[1] - 1], axis=1)

    @cached_property
    def entries(self) -> sp.csr_array:
        """The stiffness without stored zeros, for products."""
        return without_zeros(self.stiffness)

    @cached_property
    def nothing(self) -> Array:
        """Zeros (m, d)."""
        return np.zeros(self.active.shape)

    @cached_property
    def everywhere(self) -> bool:
        """Whether all components are free to move."""
        return bool(self.active.all())

    @cached_property
    def order(self) -> IntArray | None:
        """Which local component each of the kept unknowns is, where each is one and all are free to move; else None."""
        simple = self.drift is None and self.everywhere and sp.issparse(self.spread)
        return self.spread.indices.astype(np.int64) if simple and self.spread.nnz == self.kept.size else None

    @cached_property
    def component(self) -> IntArray | None:
        """Which of the kept unknowns each local component is, the inverse of :attr:`order`."""
        return None if self.order is None else np.argsort(self.order)

    def gathered(self, force: Array) -> Array:
        """Forces (m d,) on the local components of forces (k,) on the kept unknowns."""
        return np.asarray(self.spread.T @ force) if self.component is None else force.take(self.component)

    def couple(self, step: Array) -> Array:
        """Elastic force (m, d) that a step (m, d) of the local displacements takes away."""
        return np.asarray(self.matrix @ step.ravel()).reshape(step.shape)

    @cached_property
    def lambda_max(self) -> float:
        """Largest eigenvalue of the matrix scaled by its diagonal."""
        return majorant(self.vectors, self.active, self.diagonal, self.couple)

    @cached_property
    def _factor_of_matrix(self) -> tuple[IntArray, tuple[Array, bool]]:
        free = np.flatnonzero(self.active.ravel())
        return free, la.cho_factor(self.matrix[np.ix_(free, free)], check_finite=False)

    def softening(self, normal: Array, tangential: Array) -> float:
        """Largest eigenvalue of ``(B'W diag(alpha) B, K)``, alpha (m or 1,) being that of normal and of tangential
        components, raised by its tolerance; inf where the body is not held, or an alpha is infinite."""
        alpha = np.empty(self.active.shape)
        alpha[:, 0], alpha[:, 1:] = normal, np.asarray(tangential)[:, None]
        rigid = self.free_unknowns is not None and self.free_unknowns.shape[1] > 0
        if rigid or not np.isfinite(alpha[self.active]).all():
            return math.inf
        try:
            free, factor = self._factor_of_matrix
        except la.LinAlgError:
            return math.inf
        root = np.sqrt(self.weights[:, None] * alpha).ravel()[free]
        n = root.size

        def product(x: Array) -> Array:
            return np.asarray(root * la.cho_solve(factor, root * x.ravel(), check_finite=False))

        if n <= FEW:
            inverse = la.cho_solve(factor, np.eye(n), check_finite=False)
            return (1.0 + EIGENVALUE) * float(np.linalg.eigvalsh(root[:, None] * inverse * root)[-1]) if n else 0.0
        matrix = spla.LinearOperator((n, n), matvec=product, dtype=float)
        start = np.where(root > 0.0, 1.0 + np.cos(np.arange(n)), 0.0)
        return (1.0 + EIGENVALUE) * float(spla.eigsh(matrix, k=1, v0=start, tol=1e-12, return_eigenvectors=False)[0])

    def under(self, problem: DiscreteProblem) -> tuple[Recovery, float]:
        """The load and the gap of a problem, taken over to the kept unknowns; and the elastic energy of the rest.

        It costs one sparse solve, or half of one where the factorisation is meant for many loads.
        """
        reduced = self.factor.reduce(problem.load)
        shift = np.zeros(self.kept.size) if self.drift is None else self.drift @ reduced.force
        offset = problem.offset.ravel()
        if not self.everywhere:
            offset = np.where(self.active.ravel(), offset, 0.0)
        return Recovery(self, problem, offset, reduced, shift), 0.5 * reduced.work


@dataclass(frozen=True, eq=False)
class Recovery:
    """All unknowns from contact unknowns: ``u_I = K_II^-1 (f_I - K_IC y)``, ``y = Y (r + offset) + shift``."""

    body: SchurComplement
    problem: DiscreteProblem
    offset: Array  # (m d,): of the components that are free to move
    reduced: CondensedLoad  # the load
    shift: Array  # (k,): where the load moves what no contact point sees

    def __call__(self, r: Array) -> Array:
        body, y = self.body, r.ravel() + self.offset
        order = body.order
        y = body.spread @ y + self.shift if order is None else y.take(order)
        return body.factor.extend(self.reduced, y)

    def linear(self, change: Array) -> Array:
        """The same for a change of the local displacements, without load and shift."""
        body = self.body
        n, k = self.problem.unknowns, body.kept.size
        nothing = CondensedLoad(np.zeros(n), np.zeros(k), 0.0, np.zeros(n - k))
        return body.factor.extend(nothing, body.spread @ change.ravel())


def _check_semidefinite(problem: DiscreteProblem, factor: Factorisation, kept: IntArray) -> None:
    """Refuse a stiffness without a mesh along which the energy falls: shown by a displacement, free of doubt."""
    K, scale = problem.stiffness, problem.linear.diagonal[kept]
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
        diagonal = problem.linear.diagonal
        refuse_indefinite(below_zero(K, quotient(K, u, diagonal), diagonal))
    else:
        refuse_indefinite(indefinite(K))


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
        raise ProblemError("the body has a rigid motion that moves no contact point; add a support")
    return matrix
