"""Sparse linear algebra of the certificates: the energy norm, its dual, and largest eigenvalues on the contact.

Two classes answer the same questions: :class:`EnergyNorm` by a factorisation, :class:`MultigridNorm` by a few multigrid
cycles where a factorisation would cost more than the solve.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.deadline import check_time
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.linear.cycle import ElasticMultigrid, contact_unknowns, selects
from hemivar.linear.definite import free_unknowns, indefinite, lowest_quotient, positive_pivots, quotient, rounding
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import Levels, Truncated

__all__ = [
    "EnergyNorm",
    "Mode",
    "MultigridNorm",
    "Norm",
    "energy_norm",
    "factorises",
    "gram_solve",
    "lift",
    "symmetric_inverse",
]

#: Unknowns up to which K is factorised, in two dimensions and in three: a moment's work.
_FACTORISED = (30_000, 6_000)

#: An estimate of the smallest eigenvalue of K, scaled to a unit diagonal, that stands for zero if no mesh says more.
_ESTIMATED = 1e-9
#: A pivot of the coarsest matrix this small against the diagonal entry of its row means that the matrix is singular.
_SINGULAR = 1e-13
#: Relative accuracy asked of an eigenvalue; what is returned is raised by as much.
_EIGEN_TOLERANCE = 1e-8
_DENSE = 24

#: By multigrid: part of the square of a dual norm, and of an eigenvalue, that may be left to its bound.
_DUAL_ACCURACY = 0.02
_EIGEN_ACCURACY = 1e-3
#: Part of the distance between an eigenvalue and the value that it is compared with.
_APART = 0.1
#: Part of the unknowns that a level has if work on it is for nothing, against work on the finest one.
_CHEAP = 1.0 / 30.0
_CYCLES = 60
_STEPS = 100
_COARSE_STEPS = 8
_BLOCK = 3
#: What an eigenvalue that was found on coarser meshes alone may be off by on the finest.
_SAFETY = 0.5


@dataclass(frozen=True, eq=False)
class Mode:
    """An eigenvalue at the upper end of a pencil.

    Attributes
    ----------
    value : float
        What the vector attains, so that the eigenvalue is no smaller.
    bound : float
        What it is at most, up to the accuracy of the method.
    vector : array (n,) or None
        Of energy norm one; None where it is not kept.
    """

    value: float
    bound: float
    vector: Array | None = None


class EnergyNorm:
    """A symmetric positive definite matrix K, factorised: ``|v|_K``, ``K^-1 b`` and ``|b|_{K^-1}``.

    K counts as definite if its pivots are positive and its smallest eigenvalue, scaled to a unit diagonal, is above
    what rounding makes of zero: a pivot alone may be a rounding error many times larger than that.

    Parameters
    ----------
    stiffness : sparse array (n, n)
        K; if it is not shown to be definite (a body that nothing but contact holds), :attr:`definite` is False and
        nothing else may be asked for but :meth:`norm` and :attr:`indefinite`.
    singular : bool
        Whether K is known to be singular, by the motions without deformation of its mesh.

    Attributes
    ----------
    diagonal : array (n,)
        Of K.
    """

    factorised: ClassVar[bool] = True

    def __init__(self, stiffness: sp.csr_array, singular: bool = False) -> None:
        self.stiffness = stiffness
        self.diagonal = stiffness.diagonal()
        self._singular = singular
        self._factor: spla.SuperLU | None = None
        if stiffness.shape[0] == 0 or singular:
            return
        try:
            factor = spla.splu(
                sp.csc_array(stiffness),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True, "Equil": False},
            )
        except RuntimeError:
            return
        if not positive_pivots(factor):
            return
        self._factor = factor
        if not self.lowest > rounding(stiffness, self.diagonal):
            self._factor = None

    @property
    def definite(self) -> bool:
        """Whether K has been shown to be positive definite."""
        return self._factor is not None

    @cached_property
    def indefinite(self) -> float | None:
        """An eigenvalue of K, scaled to a unit diagonal, below zero by more than rounding; None if there is none."""
        return None if self.definite or self._singular else indefinite(self.stiffness)

    def solve(self, rhs: Array) -> Array:
        """``K^-1 rhs`` for one (n,) or several (n, k) right-hand sides."""
        assert self._factor is not None
        check_time()
        return np.asarray(self._factor.solve(np.asarray(rhs, dtype=float)))

    def norm(self, v: Array) -> float:
        """``|v|_K = sqrt(v'K v)``."""
        return float(np.sqrt(max(float(v @ (self.stiffness @ v)), 0.0)))

    def riesz(self, b: Array, guess: Array | None = None) -> tuple[Array, float]:
        """``K^-1 b`` (n,) and ``|b|_{K^-1} = sqrt(b'K^-1 b)``; no guess is needed."""
        x = self.solve(b)
        return x, float(np.sqrt(max(float(b @ x), 0.0)))

    def dual_norm(self, b: Array) -> float:
        """``|b|_{K^-1} = sqrt(b'K^-1 b)``."""
        return self.riesz(b)[1]

    def least_dual_norm(self, b: Array) -> float:
        """``|b|_{K^-1}``."""
        return self.dual_norm(b)

    def rounding_norm(self, weighted: float) -> float:
        """Bound of ``|b|_{K^-1}`` over all b with ``|D^-1/2 b|_2 <= weighted``, D the diagonal of K."""
        return float(weighted / np.sqrt(self.lowest))

    @cached_property
    def lowest(self) -> float:
        """A lower bound of the smallest eigenvalue of K scaled to a unit diagonal."""
        root = np.sqrt(self.diagonal)
        n = root.size
        if n <= _DENSE:
            scaled = self.stiffness.toarray() / np.outer(root, root)
            return float(np.linalg.eigvalsh(scaled)[0])
        inverse = spla.LinearOperator((n, n), matvec=lambda x: root * self.solve(root * x.ravel()), dtype=float)
        top = spla.eigsh(inverse, k=1, tol=0.05, v0=_start(n), ncv=8, return_eigenvectors=False)
        return float(0.9 / top[0])

    def largest_eigenvalue(self, trace: sp.csr_array, weight: Array, near: float | None = None) -> Mode:
        """Largest eigenvalue of ``(B' diag(weight) B, K)``, its bound raised by the tolerance of the eigensolver.

        Works on the rows of B that count: one solve with K for each step of a Lanczos iteration.

        Parameters
        ----------
        trace : sparse array (k, n)
            B.
        weight : array (k,)
            Weights >= 0; rows of weight zero are dropped.
        near : float, optional
            Of no use here.
        """
        part = _weighted(trace, weight)
        count = part.shape[0]
        if count == 0:
            return Mode(0.0, 0.0)
        if count <= _DENSE:
            flexibility = part @ self.solve(part.T.toarray())
            top = float(np.linalg.eigvalsh(0.5 * (flexibility + flexibility.T))[-1])
            return Mode(top, top * (1.0 + 1e-12))
        operator = spla.LinearOperator(
            (count, count), matvec=lambda x: part @ self.solve(part.T @ x.ravel()), dtype=float
        )
        top = spla.eigsh(
            operator, k=1, which="LA", tol=_EIGEN_TOLERANCE, v0=_start(count), ncv=12, return_eigenvectors=False
        )[0]
        return Mode(float(top), float(top * (1.0 + _EIGEN_TOLERANCE)))


class MultigridNorm:
    """The same by multigrid: a few cycles for each question, to the accuracy that certificates need.

    Dual norms are bounded from above by what conjugate gradients have found plus ``r'C r / quality``, r being the
    residual that is left, C the cycle, and ``quality`` the smallest eigenvalue of C K.  That one and :attr:`lowest` are
    estimates from coarser levels, made smaller by a factor two or more.

    Parameters
    ----------
    problem : DiscreteProblem
        K is its stiffness; the levels are those that a solve by multigrid made, or will take.
    """

    factorised: ClassVar[bool] = False

    def __init__(self, problem: DiscreteProblem) -> None:
        self.problem = problem
        self.stiffness = problem.stiffness
        self._levels = ElasticMultigrid.of(problem).levels
        self._top = len(self._levels.sizes) - 1
        self._negative: float | None = None

    @cached_property
    def _known(self) -> bool | None:
        """Whether the mesh and its supports leave no motion without deformation; None if there is no mesh."""
        free = free_unknowns(self.problem)
        return None if free is None else free.shape[1] == 0

    @cached_property
    def definite(self) -> bool:
        """Whether K is positive definite: by mesh and supports, and as far as :attr:`lowest` is an estimate."""
        if self._known is False:
            return False
        guard = rounding(self.stiffness, self.problem.diagonal)
        return bool(self.lowest > (guard if self._known else max(guard, _ESTIMATED)))

    @cached_property
    def indefinite(self) -> float | None:
        """An eigenvalue of K, scaled to a unit diagonal, below zero by more than rounding; None if none was met.

        For matrices without a mesh: sought by Lanczos steps, and met where the levels' eigenvectors are sought.
        """
        if self._known is not None:
            return None
        guard = rounding(self.stiffness, self.problem.diagonal)
        found = lowest_quotient(self.stiffness)
        if not self.definite and self._negative is not None:
            found = min(found, self._negative)
        return found if found < -guard else None

    @property
    def diagonal(self) -> Array:
        """The diagonal of K, (n,)."""
        return self._levels.diagonal(self._top)

    def norm(self, v: Array) -> float:
        """``|v|_K = sqrt(v'K v)``."""
        return float(np.sqrt(max(float(v @ (self.stiffness @ v)), 0.0)))

    def riesz(self, b: Array, guess: Array | None = None) -> tuple[Array, float]:
        """About ``K^-1 b`` (n,), and a bound of ``|b|_{K^-1}`` that is at most about 1 % too large.

        Parameters
        ----------
        b : array (n,)
        guess : array (n,), optional
            For ``K^-1 b``.
        """
        if guess is None:
            x, found, left = self._descend(self._top, b)
            return x, float(np.sqrt(found + left))
        rest = b - self.stiffness @ guess
        before = float(guess @ (b + rest))
        x, found, left = self._descend(self._top, rest, before)
        return guess + x, float(np.sqrt(max(before + found + left, 0.0)))

    def dual_norm(self, b: Array) -> float:
        """A bound of ``|b|_{K^-1}``, at most about 1 % too large."""
        return self.riesz(b)[1]

    def least_dual_norm(self, b: Array) -> float:
        """A lower bound of ``|b|_{K^-1}``: what the next coarser level sees of it.

        A proper bound where the coarse matrix is the Galerkin product, as it is for constant materials.
        """
        below = self._levels.transfers[self._top - 1].restriction @ b
        return float(np.sqrt(self._descend(self._top - 1, below)[1]))

    def rounding_norm(self, weighted: float) -> float:
        """Bound of ``|b|_{K^-1}`` over all b with ``|D^-1/2 b|_2 <= weighted``, as good as :attr:`lowest` is."""
        return float(weighted / np.sqrt(self.lowest))

    @cached_property
    def lowest(self) -> float:
        """The smallest eigenvalue of K scaled to a unit diagonal, by half; from the coarser levels."""
        levels = self._levels
        roots = [sp.csr_array(sp.diags_array(np.sqrt(levels.diagonal(k)))) for k in range(self._top + 1)]
        X = self._coarsest(roots[0], 1)
        if X is None:
            return 0.0
        lowest = 0.0
        for k in range(1, self._top + 1):
            X = levels.transfers[k - 1].prolongation @ X
            subspace = _Subspace(self, k, roots[k], np.ones(roots[k].shape[0]), X)
            added = 0.0
            if self._known is None:  # the coarse levels may know nothing of its rigid motions
                added = subspace.improve(_STEPS, 0.1)
            elif self._cheap(k):
                subspace.improve(2, 0.1)
            if subspace.negative is not None:
                if k == self._top:
                    self._negative = quotient(self.stiffness, subspace.negative, self.problem.diagonal)
                return 0.0
            X, lowest = subspace.X, 1.0 / (float(subspace.values[0]) + added)
        return _SAFETY * lowest

    @cached_property
    def quality(self) -> float:
        """The smallest eigenvalue of C K, by half: how good a cycle C is, on a coarser level.

        By half once more for each algebraic level above that one, for such cycles deteriorate with their number.
        """
        levels = self._levels
        k = max(k for k in range(self._top + 1) if self._cheap(k))
        A, factor = levels.matrix(k), 0.0
        x = levels.cycle(k, np.random.default_rng(7).standard_normal(A.shape[0]))
        size = np.sqrt(abs(float(x @ (A @ x))))
        for _ in range(12):
            x = x / size
            x = x - levels.cycle(k, A @ x)
            size = np.sqrt(abs(float(x @ (A @ x))))
            factor = max(factor, size)
        deeper = max(min(levels.algebraic, self._top) - k, 0)
        return float(_SAFETY ** (1 + deeper) * max(1.0 - factor, 0.01))

    def _coarsest(self, S: sp.csr_array, count: int) -> Array | None:
        """Vectors (n, count) of the top of ``(S'S, K)`` on the coarsest level; None if K is singular there."""
        A = self._levels.matrix(0).toarray()
        try:
            root = la.cholesky(A, lower=True)
        except la.LinAlgError:
            return None
        if np.any(np.diagonal(root) ** 2 <= _SINGULAR * np.diagonal(A)):
            return None

        def up(x: Array) -> Array:
            return np.asarray(la.solve_triangular(root, x, lower=True, trans="T"))

        if len(A) <= _DENSE:
            image = S @ up(np.eye(len(A)))
            return up(np.linalg.eigh(image.T @ image)[1][:, ::-1][:, :count])
        operator = spla.LinearOperator(
            A.shape, matvec=lambda x: la.solve_triangular(root, S.T @ (S @ up(x.ravel())), lower=True), dtype=float
        )
        vectors = spla.eigsh(operator, k=count, which="LA", v0=_start(len(A)), tol=1e-4)[1]
        return up(vectors[:, ::-1])

    def _cheap(self, k: int) -> bool:
        """Whether work on a level is for nothing."""
        return k <= 1 or self._levels.sizes[k] <= _CHEAP * self._levels.sizes[self._top]

    def _descend(self, k: int, b: Array, before: float = 0.0) -> tuple[Array, float, float]:
        """Conjugate gradients on a level: x near ``K^-1 b``, ``b'x``, and a bound of what ``b'K^-1 b`` has above it.

        They end once that is a small part of the whole, ``before`` included.
        """
        quality, levels = self.quality, self._levels
        found, left = 0.0, 0.0

        def precondition(rest: Array) -> Array:
            nonlocal found, left
            check_time()
            z = levels.cycle(k, rest)
            left = max(float(rest @ z), 0.0) / quality
            # A step of length one gains at most what is left.
            return np.zeros_like(z) if left <= _DUAL_ACCURACY * (found + before) else z

        def gained(_: int, x: Array) -> Array:
            nonlocal found
            found = float(b @ x)
            return np.zeros(0)

        x = conjugate_gradients(levels.matrix(k), levels.diagonal(k), b, precondition, 0.0, _CYCLES, gained).solution
        return x, max(found, 0.0), left

    def largest_eigenvalue(self, trace: sp.csr_array, weight: Array, near: float | None = None) -> Mode:
        """Largest eigenvalue of ``(B' diag(weight) B, K)``, by locally optimal conjugate gradients from coarse to fine.

        The largest few are followed from the coarsest level up to cheap ones, the largest alone on the others.
        Its bound adds what its residual allows, and holds as far as no other mode has overtaken it on the way.

        Parameters
        ----------
        trace : sparse array (k, n)
            B.
        weight : array (k,)
            Weights >= 0; rows of weight zero are dropped.
        near : float, optional
            A value that the eigenvalue must be told apart from.
        """
        levels = self._levels
        parts = [_weighted(trace, weight)]
        if parts[0].shape[0] == 0:
            return Mode(0.0, 0.0)
        for k in range(self._top, 0, -1):
            parts.insert(0, sp.csr_array(parts[0] @ levels.transfers[k - 1].prolongation))
        X = self._coarsest(parts[0], _BLOCK)
        assert X is not None
        gap, added = np.inf, 0.0
        for k in range(1, self._top + 1):
            X = levels.transfers[k - 1].prolongation @ X
            count = _BLOCK if self._cheap(k) and k < self._top else 1
            subspace = _Subspace(self, k, parts[k], np.ones(parts[k].shape[0]), X, count)
            limit, told = (_STEPS, near) if k == self._top else (_COARSE_STEPS, None)
            added = subspace.improve(limit, _EIGEN_ACCURACY, gap, told)
            X, gap = subspace.X, subspace.gap(gap)
        top = float(subspace.values[0])
        return Mode(top, top + added, X[:, 0])

    def constrained_eigenvalue(self, rows: sp.csr_array, weight: Array, held: BoolArray) -> Mode | None:
        """Largest eigenvalue of ``(C' diag(weight) C, K)`` on the displacements that leave the held components at rest.

        Parameters
        ----------
        rows : sparse array (k, n)
            C.
        weight : array (k,)
            Of either sign.
        held : bool array (m, d)
            Components of the contact points at rest.

        Returns
        -------
        Mode or None
            None where the trace does not select unknowns, or where the method did not tell the eigenvalue from one.
        """
        if not selects(self.problem.trace):
            return None
        unknown, _, active, _ = contact_unknowns(self.problem)
        levels, first = self._levels, self._levels.algebraic
        rest = [unknown[held[active]]]
        parts = [sp.csr_array(sp.diags_array(np.sqrt(np.abs(weight))) @ rows)]
        for k in range(self._top, first, -1):  # coarse functions that reach a held unknown are left out
            prolongation = levels.transfers[k - 1].prolongation
            rest.insert(0, np.unique(prolongation[rest[0]].indices))
            parts.insert(0, sp.csr_array(parts[0] @ prolongation))
        truncated = Truncated(levels, self._top)
        truncated.change(held[active], sp.csr_array((unknown.size, unknown.size)))
        start = parts[0] @ (1.0 + 0.1 * np.random.default_rng(5).standard_normal((levels.sizes[first], _BLOCK)))
        X, gap, added = np.zeros((levels.sizes[first], 0)), np.inf, 0.0
        for k, part, out in zip(range(first, self._top + 1), parts, rest, strict=True):
            X = X if k == first else levels.transfers[k - 1].prolongation @ X
            fresh = np.asarray(part.T @ start[:, : _BLOCK if k == first else 1])  # what was left out comes in again
            fresh[out] = 0.0
            count = _BLOCK if self._cheap(k) or k == first else 1
            X = np.hstack([X, _cycles(truncated, k, fresh)])
            subspace = _Subspace(self, k, part, np.sign(weight), X, count, out, truncated)
            added = subspace.improve(_STEPS, _EIGEN_ACCURACY, gap, near=1.0, floor=1.0)
            X, gap = subspace.X, subspace.gap(gap)
        top = float(subspace.values[0])
        return Mode(top, top + added, X[:, 0]) if top > 1.0 or top + added < 1.0 else None


Norm = EnergyNorm | MultigridNorm


def energy_norm(problem: DiscreteProblem) -> Norm:
    """The energy norm of a problem: factorised where that takes no more than a moment, by multigrid beyond."""
    if not factorises(problem):
        return MultigridNorm(problem)
    free = free_unknowns(problem)
    return EnergyNorm(problem.stiffness, singular=free is not None and free.shape[1] > 0)


def factorises(problem: DiscreteProblem) -> bool:
    """Whether :func:`energy_norm` factorises the stiffness of a problem."""
    return problem.unknowns <= _FACTORISED[problem.dim == 3]


def _cycles(levels: Levels | Truncated, k: int, right: Array) -> Array:
    """A cycle on a level for each column."""
    return np.stack([levels.cycle(k, b) for b in np.ascontiguousarray(right.T)], axis=1)


class _Subspace:
    """Vectors near the upper end of ``(S' diag(sign) S, K)`` on a level, and the best in the space that they span."""

    def __init__(
        self,
        norm: MultigridNorm,
        k: int,
        S: sp.csr_array,
        sign: Array,
        X: Array,
        count: int = 1,
        held: IntArray | None = None,
        truncated: Truncated | None = None,
    ) -> None:
        self._norm, self._k, self._S, self._sign, self._held = norm, k, S, sign, held
        self._levels: Levels | Truncated = truncated or norm._levels
        self._A = self._levels.matrix(k)
        #: A vector of the span along which K is not positive, where one was met.
        self.negative: Array | None = None
        self._pick(X, self._A @ X, S @ X, count)

    def _pick(self, X: Array, KX: Array, SX: Array, count: int) -> Array:
        """Rayleigh-Ritz: the best vectors in the span, and their coefficients."""
        gram = X.T @ KX
        scale = 1.0 / np.sqrt(np.maximum(np.diagonal(gram), np.finfo(float).tiny))
        sizes, axes = np.linalg.eigh(scale[:, None] * gram * scale)
        kept = sizes > 1e-12 * sizes[-1]
        if sizes[0] < -1e-12 * sizes[-1]:
            self.negative = X @ (scale * axes[:, 0])
        root = scale[:, None] * axes[:, kept] / np.sqrt(sizes[kept])
        image = SX @ root
        values, vectors = np.linalg.eigh(image.T @ (self._sign[:, None] * image))
        mix = root @ vectors[:, ::-1][:, :count]
        self.values = values[::-1][:count]
        self.X, self._KX, self._SX = X @ mix, KX @ mix, SX @ mix
        return np.asarray(mix)

    def gap(self, known: float) -> float:
        """Half the distance between the first two values; what is known of it where there is one vector only."""
        return 0.5 * float(self.values[0] - self.values[1]) if self.values.size > 1 else known

    def improve(
        self, limit: int, accuracy: float, gap: float = np.inf, near: float | None = None, floor: float = 0.0
    ) -> float:
        """Steps of locally optimal conjugate gradients (Knyazev 2001); what the largest value may be short of.

        ``|g|_{K^-1}``, g the residual of the first vector, bounds its distance to an eigenvalue, and the square of it
        over the gap to the next one as well (Kato, Temple).
        """
        quality = self._norm.quality
        P = KP = SP = None
        for step in range(limit + 1):
            check_time()
            R = self._S.T @ (self._sign[:, None] * self._SX) - self._KX * self.values
            if self._held is not None:
                R[self._held] = 0.0
            Z = _cycles(self._levels, self._k, R)
            gap = self.gap(gap)
            top = float(self.values[0])
            off = np.sqrt(max(float(R[:, 0] @ Z[:, 0]), 0.0) / quality)
            added = float(off**2 / gap if off < gap < np.inf else off)
            fine = added <= accuracy * max(abs(top), floor)
            if near is not None and top < near:
                fine = fine and added <= _APART * (near - top)
            if fine or step == limit:
                break
            KZ, SZ = self._A @ Z, self._S @ Z
            X, KX, SX, count = self.X, self._KX, self._SX, self.X.shape[1]
            if P is None or KP is None or SP is None:
                mix = self._pick(np.hstack([X, Z]), np.hstack([KX, KZ]), np.hstack([SX, SZ]), count)
            else:
                mix = self._pick(np.hstack([X, Z, P]), np.hstack([KX, KZ, KP]), np.hstack([SX, SZ, SP]), count)
            old = mix[:count]
            P, KP, SP = self.X - X @ old, self._KX - KX @ old, self._SX - SX @ old
        return added


def _weighted(trace: sp.csr_array, weight: Array) -> sp.csr_array:
    """Rows of B that count, times the roots of their weights."""
    rows = np.flatnonzero((weight > 0.0) & (np.diff(trace.indptr) > 0))
    return sp.csr_array(sp.diags_array(np.sqrt(weight[rows])) @ trace[rows])


def _start(n: int) -> Array:
    """A starting vector with every component present and most of it smooth."""
    return 1.0 + 0.3 * np.random.default_rng(11).standard_normal(n)


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
