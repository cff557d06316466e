"""What an energy norm asks of its matrix K, by a few multigrid cycles, and eigenvalues in small subspaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.contact import contact_unknowns, selects
from hemivar.discrete.problem import DiscreteProblem
from hemivar.linear.definite import lowest_quotient, quotient, rounding
from hemivar.linear.krylov import Matrix, conjugate_gradients
from hemivar.linear.levels import LevelMatrix, Truncated
from hemivar.linear.vectors import WHOLE, Vectors
from hemivar.systems.body_on_levels import levels_of
from hemivar.systems.free_unknowns import free_unknowns
from hemivar.systems.workspace import Workspace

__all__ = ["DENSE", "Mode", "SolveByCycles", "SolveByMultigrid", "Subspace", "start_vector"]

#: An estimate of the smallest eigenvalue of K, scaled to a unit diagonal, that stands for zero if no mesh says more.
_ESTIMATED = 1e-9
#: Such an eigenvalue down to which cycles in single precision serve: rounding in them is 6e-8 over its root, in K.
_SINGLE = 1e-8
#: A pivot of the coarsest matrix this small against the diagonal entry of its row means that the matrix is singular.
_SINGULAR = 1e-13
#: Rows up to which an eigenproblem on the coarsest level is solved as a dense one.
DENSE = 24


@dataclass(frozen=True)
class _Effort:
    """How much work a norm or an eigenvalue is worth."""

    #: Part of the square of a dual norm, and of an eigenvalue, that may be left to its bound.
    dual_accuracy: float = 0.02
    eigen_accuracy: float = 1e-3
    #: Part of the unknowns that a level has if work on it is for nothing, against work on the finest one.
    cheap: float = 1.0 / 30.0
    #: Cycles for a dual norm, and steps for an eigenvalue on the finest level and on coarser ones, at most.
    cycles: int = 60
    steps: int = 100
    coarse_steps: int = 8
    #: Vectors that are kept where work is for nothing.
    block: int = 3
    #: What an eigenvalue that was found on coarser meshes alone may be off by on the finest.
    safety: float = 0.5
    #: Part of the distance between an eigenvalue and the value that it is compared with.
    apart: float = 0.1
    #: Cycles that tell how good one is.
    tried: int = 12


_EFFORT = _Effort()

#: What is near to the inverse of a matrix, for vectors (n,).
Cycle = Callable[[Array], Array]


@dataclass(frozen=True, eq=False)
class Mode:
    """An eigenvalue at the upper end of a pencil."""

    #: What the vector attains, so that the eigenvalue is no smaller; what it is at most, as far as the method knows.
    value: float
    bound: float
    #: (n,), of energy norm one; None where it is not kept.
    vector: Array | None = None


class Subspace:
    """Vectors near the upper end of ``(S' diag(sign) S, K)``, and the best in the space that they span.

    A is K, S has the shape (q, n), sign (q,) and X, the vectors to start from, (n, k); ``cycles`` maps the columns of
    (n, k) by C, which is near to the inverse of K, ``count`` vectors are kept, and ``held`` unknowns are at rest.
    """

    def __init__(
        self,
        A: Matrix,
        cycles: Callable[[Array], Array],
        S: sp.csr_array,
        sign: Array,
        X: Array,
        count: int = 1,
        fixed: IntArray | None = None,
        vectors: Vectors = WHOLE,
    ) -> None:
        self._A, self._cycles, self._S, self._sign, self._held, self._vectors = A, cycles, S, sign, fixed, vectors
        #: A vector of the span along which K is not positive, where one was met.
        self.negative: Array | None = None
        self._pick(X, self._A @ X, S @ X, count)

    def _pick(self, X: Array, KX: Array, SX: Array, count: int) -> Array:
        """Rayleigh-Ritz: the best vectors in the span, and their coefficients."""
        gram, image = self._total(X.T @ KX, SX.T @ (self._sign[:, None] * SX))
        scale = 1.0 / np.sqrt(np.maximum(np.diagonal(gram), np.finfo(float).tiny))
        sizes, axes = np.linalg.eigh(scale[:, None] * gram * scale)
        kept = sizes > 1e-12 * sizes[-1]
        if sizes[0] < -1e-12 * sizes[-1]:
            self.negative = X @ (scale * axes[:, 0])
        root = scale[:, None] * axes[:, kept] / np.sqrt(sizes[kept])
        values, vectors = np.linalg.eigh(root.T @ image @ root)
        mix = root @ vectors[:, ::-1][:, :count]
        self.values = values[::-1][:count]
        self.X, self._KX, self._SX = X @ mix, KX @ mix, SX @ mix
        return np.asarray(mix)

    def _total(self, *parts: Array) -> list[Array]:
        """Sums of small matrices over all processes."""
        if self._vectors.alone:
            return list(parts)
        sums = self._vectors.total(*np.concatenate([part.ravel() for part in parts]).tolist())
        ends = np.cumsum([part.size for part in parts])[:-1]
        return [some.reshape(part.shape) for some, part in zip(np.split(sums, ends), parts, strict=True)]

    def gap(self, known: float) -> float:
        """Half the distance between the first two values; what is known of it where there is one vector only."""
        return 0.5 * float(self.values[0] - self.values[1]) if self.values.size > 1 else known

    def improve(
        self,
        quality: float,
        limit: int,
        accuracy: float,
        gap: float = np.inf,
        near: float | None = None,
        floor: float = 0.0,
    ) -> float:
        """Steps of locally optimal conjugate gradients (Knyazev 2001); what the largest value may be short of.

        ``|g|_{K^-1}``, g the residual of the first vector, bounds its distance to an eigenvalue, and the square of it
        over the gap to the next one as well (Kato, Temple).  ``quality`` is the smallest eigenvalue of C K.
        """
        P = KP = SP = None
        for step in range(limit + 1):
            check_time()
            R = self._S.T @ (self._sign[:, None] * self._SX) - self._KX * self.values
            if self._held is not None:
                R[self._held] = 0.0
            Z = self._cycles(R)
            gap = self.gap(gap)
            top = float(self.values[0])
            off = np.sqrt(max(float(self._vectors.total(float(R[:, 0] @ Z[:, 0]))[0]), 0.0) / quality)
            added = float(off**2 / gap if off < gap < np.inf else off)
            fine = added <= accuracy * max(abs(top), floor)
            if near is not None and top < near:
                fine = fine and added <= _EFFORT.apart * (near - top)
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


class SolveByCycles:
    """A symmetric matrix K by products, and a cycle C near to its inverse; over all processes that have parts of it.

    Dual norms are bounded from above by what conjugate gradients have found plus ``r'C r / quality``, r being the
    residual that is left, C the cycle, and ``quality`` the smallest eigenvalue of C K.  That one and :attr:`lowest` are
    estimates, made smaller by a factor two or more.

    K multiplies (n,) and (n, k), n being the unknowns of this process; a cycle (n,) leaves unknowns that are held at
    rest, and rows of eigenproblems see none of other processes.
    """

    factorised: ClassVar[bool] = False
    method: str = "multigrid"
    #: See :class:`Factorised`.
    proves: bool = True
    #: Whether rounding in a cycle is more than that of the products.
    flexible: bool = False

    def __init__(self, stiffness: Matrix, diagonal: Array, cycle: Cycle, vectors: Vectors = WHOLE) -> None:
        self._matrix, self.diagonal, self._cycle, self.vectors = stiffness, diagonal, cycle, vectors

    @property
    def indefinite(self) -> float | None:
        """Not looked for."""
        return None

    @cached_property
    def definite(self) -> bool:
        """Whether K is positive definite, as far as :attr:`lowest` is an estimate."""
        return bool(self.lowest > _ESTIMATED)

    @cached_property
    def lowest(self) -> float:
        """The smallest eigenvalue of K scaled to a unit diagonal, by half."""
        root = sp.csr_array(sp.diags_array(np.sqrt(self.diagonal)))
        subspace = self._started(root)
        added = subspace.improve(self.quality, _EFFORT.steps, 0.1)
        return 0.0 if subspace.negative is not None else _EFFORT.safety / (float(subspace.values[0]) + added)

    @cached_property
    def quality(self) -> float:
        """The smallest eigenvalue of C K, by half: how good a cycle C is."""
        return _EFFORT.safety * max(1.0 - _kept(self._matrix, self._cycle, self._start(), self.vectors), 0.01)

    def multiply(self, v: Array) -> Array:
        """``K v``."""
        return np.asarray(self._matrix @ v)

    def dual(self, b: Array, guess: Array | None = None) -> tuple[Array, float]:
        """About ``K^-1 b`` (n,), and a bound of ``b'K^-1 b`` that is at most about 2 % too large."""
        if guess is None:
            x, work, left = self._descend(self._matrix, self.diagonal, self._cycle, b)
            return x, work + left
        rest = b - self.multiply(guess)
        before = float(self.vectors.total(float(guess @ (b + rest)))[0])
        x, work, left = self._descend(self._matrix, self.diagonal, self._cycle, rest, before)
        return guess + x, before + work + left

    def least(self, b: Array) -> float:
        """A lower bound of ``b'K^-1 b``."""
        return self._descend(self._matrix, self.diagonal, self._cycle, b)[1]

    def top(self, part: sp.csr_array, near: float | None = None) -> Mode:
        """The largest eigenvalue of ``(S'S, K)``, ``S`` (k, n), by locally optimal conjugate gradients."""
        subspace = self._started(part)
        added = subspace.improve(self.quality, _EFFORT.steps, _EFFORT.eigen_accuracy, near=near)
        return Mode(float(subspace.values[0]), float(subspace.values[0]) + added, subspace.X[:, 0])

    def _start(self) -> Array:
        """A vector (n,) with every component present, the same for any number of processes."""
        n = self.diagonal.size
        return np.asarray(1.5 + np.cos(1.0 + (self.vectors.before(n) + np.arange(n)) ** 1.3))

    def _started(self, S: sp.csr_array) -> Subspace:
        cycles = partial(_columns, self._cycle)
        start = self._start()[:, None] * np.cos(np.arange(_EFFORT.block) * (1.0 + self._start()[:, None]))
        X = cycles(np.asarray(S.T @ (S @ start)))
        return Subspace(self._matrix, cycles, S, np.ones(S.shape[0]), X, _EFFORT.block, vectors=self.vectors)

    def _quality_met(self, gains: Array, rests: Array) -> float:
        """:attr:`quality`, or half of what conjugate gradients have met where that is less.

        What a cycle hardly changes is seen late, by few: nearly incompressible bodies have such motions.
        """
        if not gains.size or not (gains > 0.0).all() or not (rests > 0.0).all():
            return self.quality
        met = _least_ritz_value(gains, rests)
        return self.quality if met >= self.quality else max(_EFFORT.safety * met, np.finfo(float).tiny)

    def _descend(
        self, A: Matrix, diagonal: Array, cycle: Cycle, b: Array, before: float = 0.0
    ) -> tuple[Array, float, float]:
        """Conjugate gradients: x near ``A^-1 b``, ``b'x``, and a bound of what ``b'A^-1 b`` has above it.

        They end once that is a small part of the whole, ``before`` included.
        """
        total = self.vectors.total
        x, work, left, gains, rests = np.zeros_like(b), 0.0, 0.0, list[float](), list[float]()

        def precondition(rest: Array) -> Array:
            nonlocal work, left
            check_time()
            z = cycle(rest)
            # b'A^-1 b = x'(b + r) + r'A^-1 r whatever x is; r'x is zero but for the rounding of the cycles.
            gained, rest_seen = total(float(x @ b) + float(x @ rest), float(rest @ z)).tolist()
            work, seen = max(gained, 0.0), max(rest_seen, 0.0)
            gains.append(work)
            rests.append(seen)
            left = seen / self._quality_met(np.diff(gains), np.array(rests))
            # A step of length one gains at most what is left.
            return np.zeros_like(z) if left <= _EFFORT.dual_accuracy * (work + before) else z

        def moved(_: int, to: Array) -> Array:
            nonlocal x
            x = to
            return np.zeros(0)

        descent = conjugate_gradients(
            A, diagonal, b, precondition, 0.0, _EFFORT.cycles, moved, self.vectors, flexible=self.flexible
        )
        return descent.solution, work, left


def _least_ritz_value(gains: Array, rests: Array) -> float:
    """The least eigenvalue of C A that conjugate gradients have met: that of Lanczos' tridiagonal matrix of them.

    Shapes: ``gains`` (k,), of energy in each step; ``rests`` (k + 1,), ``r'C r`` before the steps and after them.
    """
    steps, turns = gains / rests[:-1], rests[1:-1] / rests[:-2]
    diagonal = 1.0 / steps
    diagonal[1:] += turns / steps[:-1]
    return float(la.eigvalsh_tridiagonal(diagonal, np.sqrt(turns) / steps[:-1])[0])


def _columns(cycle: Cycle, right: Array) -> Array:
    """A cycle for each column."""
    return np.stack([cycle(b) for b in np.ascontiguousarray(right.T)], axis=1)


def _kept(A: Matrix, cycle: Cycle, x: Array, vectors: Vectors = WHOLE) -> float:
    """The largest factor by which a cycle was seen to reduce the error of ``A x = 0``, from a start x."""
    factor = 0.0
    for _ in range(_EFFORT.tried):
        x = x / np.sqrt(abs(vectors.total(float(x @ (A @ x)))[0]))
        x = x - cycle(A @ x)
        factor = max(factor, float(np.sqrt(abs(vectors.total(float(x @ (A @ x)))[0]))))
    return factor


class SolveByMultigrid(SolveByCycles):
    """The stiffness K of a linear body and its levels, from coarse to fine."""

    flexible = True

    def __init__(self, problem: DiscreteProblem, workspace: Workspace) -> None:
        self.problem = problem
        self.stiffness = problem.linear.stiffness
        self._levels = levels_of(problem, workspace).levels
        self._top = top = len(self._levels.sizes) - 1
        self._negative: float | None = None
        super().__init__(LevelMatrix(self._levels, top), self._levels.diagonal(top), self._cycle_on(top))

    def _fast_on(self, k: int) -> Cycle:
        """The cycle on a level, in single precision where that is compiled."""
        return partial(self._levels.fast_cycle, k)

    def _cycle_on(self, k: int, truncated: Truncated | None = None) -> Cycle:
        """The same; in double precision where the body is hardly held."""
        levels = self._levels if truncated is None else truncated
        return lambda right: (levels.cycle if self.lowest < _SINGLE else levels.fast_cycle)(k, right)

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
        guard = rounding(self.stiffness, self.diagonal)
        return bool(self.lowest > (guard if self._known else max(guard, _ESTIMATED)))

    @cached_property
    def indefinite(self) -> float | None:
        """An eigenvalue of K, scaled to a unit diagonal, below zero by more than rounding; None if none was met.

        For matrices without a mesh: sought by Lanczos steps, and met where the levels' eigenvectors are sought.
        """
        if self._known is not None:
            return None
        guard = rounding(self.stiffness, self.diagonal)
        lowest = lowest_quotient(self.stiffness)
        if not self.definite and self._negative is not None:
            lowest = min(lowest, self._negative)
        return lowest if lowest < -guard else None

    def least(self, b: Array) -> float:
        """A lower bound of ``b'K^-1 b``: what the next coarser level sees of it.

        A proper bound where the coarse matrix is the Galerkin product, as it is for constant materials.
        """
        k, levels = self._top - 1, self._levels
        coarse = levels.transfers[k].restriction @ b
        return self._descend(LevelMatrix(levels, k), levels.diagonal(k), self._cycle_on(k), coarse)[1]

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
            subspace = self._subspace(k, roots[k], X, self._fast_on(k))
            added = 0.0
            if self._known is None:  # the coarse levels may know nothing of its rigid motions
                added = subspace.improve(self._fast_quality, _EFFORT.steps, 0.1)
            elif self._cheap(k):
                subspace.improve(self._fast_quality, 2, 0.1)
            if subspace.negative is not None:
                if k == self._top:
                    self._negative = quotient(self.stiffness, subspace.negative, self.diagonal)
                return 0.0
            X, lowest = subspace.X, 1.0 / (float(subspace.values[0]) + added)
        return _EFFORT.safety * lowest

    @cached_property
    def quality(self) -> float:
        """The smallest eigenvalue of C K, by half: how good a cycle C is, on a coarser level.

        By half once more for each algebraic level above that one, for such cycles deteriorate with their number.
        """
        return self._quality_of(self._cycle_on) if self.lowest < _SINGLE else self._fast_quality

    @cached_property
    def _fast_quality(self) -> float:
        """That of cycles in single precision."""
        return self._quality_of(self._fast_on)

    def _quality_of(self, cycle_on: Callable[[int], Cycle]) -> float:
        levels = self._levels
        k = max(k for k in range(self._top + 1) if self._cheap(k))
        A, cycle = LevelMatrix(levels, k), cycle_on(k)
        factor = _kept(A, cycle, cycle(np.random.default_rng(7).standard_normal(levels.sizes[k])))
        deeper = max(min(levels.algebraic, self._top) - k, 0)
        return float(_EFFORT.safety ** (1 + deeper) * max(1.0 - factor, 0.01))

    def _coarsest(self, S: sp.csr_array, count: int) -> Array | None:
        """Vectors (n, count) of the top of ``(S'S, K)`` on the coarsest level; None if K is singular there."""
        A = self._levels.matrix(0).toarray()
        try:
            root = la.cholesky(A, lower=True)
        except la.LinAlgError:
            return None
        if np.any(np.diagonal(root) ** 2 <= _SINGULAR * np.diagonal(A)):
            return None

        inverse, _ = la.lapack.dtrtri(root, lower=1)

        def up(x: Array) -> Array:
            return np.asarray(inverse.T @ x)

        if len(A) <= DENSE:
            image = S @ up(np.eye(len(A)))
            return up(np.linalg.eigh(image.T @ image)[1][:, ::-1][:, :count])
        operator = spla.LinearOperator(A.shape, matvec=lambda x: inverse @ (S.T @ (S @ up(x.ravel()))), dtype=float)
        vectors = spla.eigsh(operator, k=count, which="LA", v0=start_vector(len(A)), tol=1e-4)[1]
        return up(vectors[:, ::-1])

    def _cheap(self, k: int) -> bool:
        """Whether work on a level is for nothing."""
        return k <= 1 or self._levels.sizes[k] <= _EFFORT.cheap * self._levels.sizes[self._top]

    def top(self, part: sp.csr_array, near: float | None = None) -> Mode:
        """The largest eigenvalue of ``(S'S, K)``, ``S`` (k, n), from coarse to fine.

        The largest few are followed from the coarsest level up to cheap ones, the largest alone on the others.
        Its bound adds what its residual allows, and holds as far as no other mode has overtaken it on the way.
        """
        levels, parts = self._levels, [part]
        for k in range(self._top, 0, -1):
            parts.insert(0, sp.csr_array(parts[0] @ levels.transfers[k - 1].prolongation))
        X = self._coarsest(parts[0], _EFFORT.block)
        assert X is not None
        gap, added = np.inf, 0.0
        for k in range(1, self._top + 1):
            X = levels.transfers[k - 1].prolongation @ X
            count = _EFFORT.block if self._cheap(k) and k < self._top else 1
            subspace = self._subspace(k, parts[k], X, self._cycle_on(k), count)
            limit, target = (_EFFORT.steps, near) if k == self._top else (_EFFORT.coarse_steps, None)
            added = subspace.improve(self.quality, limit, _EFFORT.eigen_accuracy, gap, target)
            X, gap = subspace.X, subspace.gap(gap)
        top = float(subspace.values[0])
        return Mode(top, top + added, X[:, 0])

    def constrained(self, rows: sp.csr_array, weight: Array, fixed: BoolArray) -> Mode | None:
        """Largest eigenvalue of ``(C' diag(weight) C, K)`` on the displacements that leave the held components at rest.

        C (k, n) are ``rows``, the weights (k,) are of either sign, and ``held`` (m, d) are components of the contact
        points.  None where the trace does not select unknowns, or where the eigenvalue was not separated from one.
        """
        if not selects(self.problem.contact.trace):
            return None
        unknown, _, active, _ = contact_unknowns(self.problem.contact)
        levels, first = self._levels, self._levels.algebraic
        rest = [unknown[fixed[active]]]
        parts = [sp.csr_array(sp.diags_array(np.sqrt(np.abs(weight))) @ rows)]
        for k in range(self._top, first, -1):  # coarse functions that reach a held unknown are left out
            prolongation = levels.transfers[k - 1].prolongation
            rest.insert(0, np.unique(prolongation[rest[0]].indices))
            parts.insert(0, sp.csr_array(parts[0] @ prolongation))
        truncated = Truncated(levels, self._top, vanishing=True)
        truncated.change(fixed[active], sp.csr_array((unknown.size, unknown.size)))
        truncated.prepare()
        start = parts[0] @ (1.0 + 0.1 * np.random.default_rng(5).standard_normal((levels.sizes[first], _EFFORT.block)))
        X, gap, added = np.zeros((levels.sizes[first], 0)), np.inf, 0.0
        for k, part, out in zip(range(first, self._top + 1), parts, rest, strict=True):
            X = X if k == first else levels.transfers[k - 1].prolongation @ X
            fresh = np.asarray(
                part.T @ start[:, : _EFFORT.block if k == first else 1]
            )  # what was left out comes in again
            fresh[out] = 0.0
            count = _EFFORT.block if self._cheap(k) or k == first else 1
            cycles = partial(_columns, self._cycle_on(k, truncated))
            X = np.hstack([X, cycles(fresh)])
            subspace = Subspace(
                truncated.matrix(k),
                cycles,
                part,
                np.sign(weight),
                X,
                count,
                out,
            )
            added = subspace.improve(self.quality, _EFFORT.steps, _EFFORT.eigen_accuracy, gap, near=1.0, floor=1.0)
            X, gap = subspace.X, subspace.gap(gap)
        top = float(subspace.values[0])
        return Mode(top, top + added, X[:, 0]) if top > 1.0 or top + added < 1.0 else None

    def _subspace(self, k: int, S: sp.csr_array, X: Array, cycle: Cycle, count: int = 1) -> Subspace:
        return Subspace(self._levels.matrix(k), partial(_columns, cycle), S, np.ones(S.shape[0]), X, count)


def start_vector(n: int) -> Array:
    """A starting vector with every component present and most of it smooth."""
    return 1.0 + 0.3 * np.random.default_rng(11).standard_normal(n)
