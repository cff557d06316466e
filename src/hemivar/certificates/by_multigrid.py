"""The energy norm, its dual and largest eigenvalues on the contact, by a few multigrid cycles.

They answer what :class:`hemivar.certificates.EnergyNorm` answers, where a factorisation would cost more than the solve.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray
from hemivar.certificates.linear_bodies import below
from hemivar.certificates.subspace import Mode, Subspace, counting_rows, start_vector
from hemivar.discrete.contact import contact_unknowns, selects
from hemivar.discrete.problem import DiscreteProblem
from hemivar.linear.definite import lowest_quotient, quotient, rounding
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import LevelMatrix, Levels, Truncated
from hemivar.systems.body_on_levels import levels_of
from hemivar.systems.free_unknowns import free_unknowns
from hemivar.systems.workspace import Workspace

__all__ = ["MultigridNorm"]

#: An estimate of the smallest eigenvalue of K, scaled to a unit diagonal, that stands for zero if no mesh says more.
_ESTIMATED = 1e-9
#: A pivot of the coarsest matrix this small against the diagonal entry of its row means that the matrix is singular.
_SINGULAR = 1e-13
#: Rows up to which an eigenproblem on the coarsest level is solved as a dense one.
_DENSE = 24

#: Part of the square of a dual norm, and of an eigenvalue, that may be left to its bound.
_DUAL_ACCURACY = 0.02
_EIGEN_ACCURACY = 1e-3
#: Part of the unknowns that a level has if work on it is for nothing, against work on the finest one.
_CHEAP = 1.0 / 30.0
_CYCLES = 60
_STEPS = 100
_COARSE_STEPS = 8
_BLOCK = 3
#: What an eigenvalue that was found on coarser meshes alone may be off by on the finest.
_SAFETY = 0.5


class MultigridNorm:
    """The same by multigrid: a few cycles for each question, to the accuracy that certificates need.

    Dual norms are bounded from above by what conjugate gradients have found plus ``r'C r / quality``, r being the
    residual that is left, C the cycle, and ``quality`` the smallest eigenvalue of C K.  That one and :attr:`lowest` are
    estimates from coarser levels, made smaller by a factor two or more.

    Parameters
    ----------
    problem : DiscreteProblem
        K is its stiffness; of a body that is not linear that of the body below.
    workspace : Workspace, optional
        Keeps the levels: those that a solve by multigrid made there, or will take.
    """

    factorised: ClassVar[bool] = False

    def __init__(self, problem: DiscreteProblem, workspace: Workspace | None = None) -> None:
        self.problem = below(problem)
        self.bulk = self.problem.linear
        self.stiffness = self.bulk.stiffness
        self._levels = levels_of(self.problem, Workspace.given(workspace)).levels
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
        guard = rounding(self.stiffness, self.bulk.diagonal)
        return bool(self.lowest > (guard if self._known else max(guard, _ESTIMATED)))

    @cached_property
    def indefinite(self) -> float | None:
        """An eigenvalue of K, scaled to a unit diagonal, below zero by more than rounding; None if none was met.

        For matrices without a mesh: sought by Lanczos steps, and met where the levels' eigenvectors are sought.
        """
        if self._known is not None:
            return None
        guard = rounding(self.stiffness, self.bulk.diagonal)
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
        return float(np.sqrt(max(float(v @ self._levels.multiply(self._top, v)), 0.0)))

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
        rest = b - self._levels.multiply(self._top, guess)
        before = float(guess @ (b + rest))
        x, found, left = self._descend(self._top, rest, before)
        return guess + x, float(np.sqrt(max(before + found + left, 0.0)))

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
            subspace = self._subspace(k, roots[k], X)
            added = 0.0
            if self._known is None:  # the coarse levels may know nothing of its rigid motions
                added = subspace.improve(self.quality, _STEPS, 0.1)
            elif self._cheap(k):
                subspace.improve(self.quality, 2, 0.1)
            if subspace.negative is not None:
                if k == self._top:
                    self._negative = quotient(self.stiffness, subspace.negative, self.bulk.diagonal)
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
        vectors = spla.eigsh(operator, k=count, which="LA", v0=start_vector(len(A)), tol=1e-4)[1]
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

        matrix = LevelMatrix(levels, k)
        x = conjugate_gradients(matrix, levels.diagonal(k), b, precondition, 0.0, _CYCLES, gained).solution
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
        parts = [counting_rows(trace, weight)]
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
            subspace = self._subspace(k, parts[k], X, count)
            limit, told = (_STEPS, near) if k == self._top else (_COARSE_STEPS, None)
            added = subspace.improve(self.quality, limit, _EIGEN_ACCURACY, gap, told)
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
        if not selects(self.problem.contact.trace):
            return None
        unknown, _, active, _ = contact_unknowns(self.problem.contact)
        levels, first = self._levels, self._levels.algebraic
        rest = [unknown[held[active]]]
        parts = [sp.csr_array(sp.diags_array(np.sqrt(np.abs(weight))) @ rows)]
        for k in range(self._top, first, -1):  # coarse functions that reach a held unknown are left out
            prolongation = levels.transfers[k - 1].prolongation
            rest.insert(0, np.unique(prolongation[rest[0]].indices))
            parts.insert(0, sp.csr_array(parts[0] @ prolongation))
        truncated = Truncated(levels, self._top, vanishing=True)
        truncated.change(held[active], sp.csr_array((unknown.size, unknown.size)))
        start = parts[0] @ (1.0 + 0.1 * np.random.default_rng(5).standard_normal((levels.sizes[first], _BLOCK)))
        X, gap, added = np.zeros((levels.sizes[first], 0)), np.inf, 0.0
        for k, part, out in zip(range(first, self._top + 1), parts, rest, strict=True):
            X = X if k == first else levels.transfers[k - 1].prolongation @ X
            fresh = np.asarray(part.T @ start[:, : _BLOCK if k == first else 1])  # what was left out comes in again
            fresh[out] = 0.0
            count = _BLOCK if self._cheap(k) or k == first else 1
            X = np.hstack([X, _cycles(truncated, k, fresh)])
            subspace = Subspace(
                truncated.matrix(k), partial(_cycles, truncated, k), part, np.sign(weight), X, count, out
            )
            added = subspace.improve(self.quality, _STEPS, _EIGEN_ACCURACY, gap, near=1.0, floor=1.0)
            X, gap = subspace.X, subspace.gap(gap)
        top = float(subspace.values[0])
        return Mode(top, top + added, X[:, 0]) if top > 1.0 or top + added < 1.0 else None

    def _subspace(self, k: int, S: sp.csr_array, X: Array, count: int = 1) -> Subspace:
        return Subspace(self._levels.matrix(k), partial(_cycles, self._levels, k), S, np.ones(S.shape[0]), X, count)


def _cycles(levels: Levels | Truncated, k: int, right: Array) -> Array:
    """A cycle on a level for each column."""
    return np.stack([levels.cycle(k, b) for b in np.ascontiguousarray(right.T)], axis=1)
