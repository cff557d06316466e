"""The energy norm of a problem: one class, and two ways to solve with its matrix."""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.certificates.by_multigrid import DENSE, Mode, SolveByMultigrid, start_vector
from hemivar.certificates.linear_bodies import below
from hemivar.discrete.problem import DiscreteProblem
from hemivar.linear.definite import EIGENVALUE, indefinite, positive_pivots, rounding
from hemivar.linear.vectors import WHOLE, Vectors
from hemivar.systems.free_unknowns import free_unknowns
from hemivar.systems.workspace import Workspace

__all__ = ["FACTORISED", "EnergyNorm", "Factorised", "Solve", "energy_norm", "factorises"]

#: Unknowns up to which K is factorised, in two dimensions and in three: a moment's work.
FACTORISED = (30_000, 6_000)


class Solve(Protocol):
    """How an energy norm solves with its matrix K; vectors may be the parts that one of many processes has."""

    @property
    def factorised(self) -> bool: ...

    @property
    def vectors(self) -> Vectors: ...

    @property
    def diagonal(self) -> Array: ...

    @property
    def definite(self) -> bool: ...

    @property
    def indefinite(self) -> float | None: ...

    @property
    def lowest(self) -> float: ...

    @property
    def method(self) -> str: ...

    @property
    def proves(self) -> bool: ...

    def multiply(self, v: Array) -> Array:
        """``K v``."""

    def dual(self, b: Array, guess: Array | None = None) -> tuple[Array, float]:
        """About ``K^-1 b`` (n,), and an upper bound of ``b'K^-1 b``."""

    def least(self, b: Array) -> float:
        """A lower bound of ``b'K^-1 b``."""

    def top(self, part: sp.csr_array, near: float | None = None) -> Mode:
        """The largest eigenvalue of ``(S'S, K)``, ``S`` (k, n)."""


class Factorised:
    """A symmetric matrix K and its factors.

    K counts as definite if its pivots are positive and its smallest eigenvalue, scaled to a unit diagonal, is above
    what rounding makes of zero: a pivot alone may be a rounding error many times larger than that.  Where that is not
    shown, nothing else may be asked for but :meth:`multiply` and :attr:`indefinite`.  ``singular`` says that K is
    known to be singular, by the motions without deformation of its mesh.
    """

    factorised: ClassVar[bool] = True
    method: ClassVar[str] = "factorisation"
    #: Whether eigenvalues are shown to be no larger, as far as the method goes.
    proves: ClassVar[bool] = True
    vectors: ClassVar[Vectors] = WHOLE

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

    def multiply(self, v: Array) -> Array:
        """``K v``."""
        return np.asarray(self.stiffness @ v)

    def dual(self, b: Array, guess: Array | None = None) -> tuple[Array, float]:
        """``K^-1 b`` (n,) and ``b'K^-1 b``; no guess is needed."""
        x = self.solve(b)
        return x, float(b @ x)

    def least(self, b: Array) -> float:
        """``b'K^-1 b``."""
        return self.dual(b)[1]

    @cached_property
    def lowest(self) -> float:
        """A lower bound of the smallest eigenvalue of K scaled to a unit diagonal."""
        root = np.sqrt(self.diagonal)
        n = root.size
        if n <= DENSE:
            scaled = self.stiffness.toarray() / np.outer(root, root)
            return float(np.linalg.eigvalsh(scaled)[0])
        inverse = spla.LinearOperator((n, n), matvec=lambda x: root * self.solve(root * x.ravel()), dtype=float)
        top = spla.eigsh(inverse, k=1, tol=0.05, v0=start_vector(n), ncv=8, return_eigenvectors=False)
        return float(0.9 / top[0])

    def top(self, part: sp.csr_array, near: float | None = None) -> Mode:
        """The largest eigenvalue of ``(S'S, K)``, ``S`` (k, n); a solve with K for each step of a Lanczos iteration."""
        count = part.shape[0]
        if count <= DENSE:
            flexibility = part @ self.solve(part.T.toarray())
            top = float(np.linalg.eigvalsh(0.5 * (flexibility + flexibility.T))[-1])
            return Mode(top, top * (1.0 + 1e-12))
        operator = spla.LinearOperator(
            (count, count), matvec=lambda x: part @ self.solve(part.T @ x.ravel()), dtype=float
        )
        top = spla.eigsh(
            operator, k=1, which="LA", tol=EIGENVALUE, v0=start_vector(count), ncv=12, return_eigenvectors=False
        )[0]
        return Mode(float(top), float(top * (1.0 + EIGENVALUE)))


class EnergyNorm:
    """The norm of a symmetric positive definite matrix K: ``|v|_K``, ``K^-1 b``, ``|b|_{K^-1}``, and its eigenvalues.

    Parameters
    ----------
    stiffness : sparse array (n, n) or Solve
        K, which is factorised; or another way to solve with it, as :meth:`by_multigrid` has.

    Notes
    -----
    If K is not shown to be definite (a body held by contact only), :attr:`definite` is False and nothing else
    may be asked for but :meth:`norm` and :attr:`indefinite`.  By multigrid dual norms are at most about 1 % too large,
    and :attr:`lowest` is an estimate, made smaller by a factor two or more.
    """

    def __init__(self, stiffness: sp.csr_array | Solve) -> None:
        self.by: Solve = Factorised(stiffness) if isinstance(stiffness, sp.csr_array) else stiffness

    @classmethod
    def by_multigrid(cls, problem: DiscreteProblem, workspace: Workspace | None = None) -> EnergyNorm:
        """By a few multigrid cycles for each question, where a factorisation would cost more than the solve.

        Parameters
        ----------
        problem : DiscreteProblem
            K is its stiffness; of a body that is not linear that of the body below.
        workspace : Workspace, optional
            Keeps the levels: those that a solve by multigrid made there, or will take.
        """
        return cls(SolveByMultigrid(below(problem), Workspace.given(workspace)))

    @property
    def factorised(self) -> bool:
        """Whether K is factorised; else what is found by multigrid is less accurate, on the safe side."""
        return self.by.factorised

    @property
    def at_hand(self) -> bool:
        """Whether this process has all of K."""
        return isinstance(self.by, Factorised | SolveByMultigrid)

    @property
    def stiffness(self) -> sp.csr_array:
        """K, where this process has all of it."""
        assert isinstance(self.by, Factorised | SolveByMultigrid)
        return self.by.stiffness

    @property
    def diagonal(self) -> Array:
        """The diagonal of K, (n,)."""
        return self.by.diagonal

    @property
    def definite(self) -> bool:
        """Whether K has been shown to be positive definite; by multigrid, as far as :attr:`lowest` is known."""
        return self.by.definite

    @property
    def indefinite(self) -> float | None:
        """An eigenvalue of K, scaled to a unit diagonal, below zero by more than rounding; None if none was met."""
        return self.by.indefinite

    @property
    def lowest(self) -> float:
        """A lower bound of the smallest eigenvalue of K scaled to a unit diagonal."""
        return self.by.lowest

    def norm(self, v: Array) -> float:
        """``|v|_K = sqrt(v'K v)``."""
        return _root(self.by.vectors.total(float(v @ self.by.multiply(v)))[0])

    def solve(self, rhs: Array) -> Array:
        """``K^-1 rhs`` for one (n,) or several (n, k) right-hand sides, by factors."""
        assert isinstance(self.by, Factorised)
        return self.by.solve(rhs)

    def riesz(self, b: Array, guess: Array | None = None) -> tuple[Array, float]:
        """``K^-1 b`` (n,), from a guess for it where there is one, and an upper bound of ``|b|_{K^-1}``."""
        x, square = self.by.dual(b, guess)
        return x, _root(square)

    def least_dual_norm(self, b: Array) -> float:
        """A lower bound of ``|b|_{K^-1}``."""
        return _root(self.by.least(b))

    def rounding_norm(self, weighted: float) -> float:
        """Bound of ``|b|_{K^-1}`` over all b with ``|D^-1/2 b|_2 <= weighted``, D the diagonal of K."""
        return float(weighted / np.sqrt(self.lowest))

    def largest_eigenvalue(self, trace: sp.csr_array, weight: Array, near: float | None = None) -> Mode:
        """Largest eigenvalue of ``(B' diag(weight) B, K)``; its bound is raised by what the method may be short of.

        Parameters
        ----------
        trace : sparse array (k, n)
            B.
        weight : array (k,)
            Weights >= 0; rows of weight zero are dropped.
        near : float, optional
            A value that the eigenvalue must be separated from.
        """
        rows = np.flatnonzero((weight > 0.0) & (np.diff(trace.indptr) > 0))
        if not self.by.vectors.total(rows.size)[0]:
            return Mode(0.0, 0.0)
        return self.by.top(sp.csr_array(sp.diags_array(np.sqrt(weight[rows])) @ trace[rows]), near)


def _root(square: float) -> float:
    return float(np.sqrt(max(square, 0.0)))


def energy_norm(problem: DiscreteProblem, workspace: Workspace | None = None) -> EnergyNorm:
    """The energy norm of a problem: factorised where that takes no more than a moment, by multigrid beyond.

    Of a body that is not linear it is that of C_low (:func:`hemivar.certificates.linear_bodies.below`). A workspace
    keeps it for other loads, gaps and laws of the body.

    Parameters
    ----------
    problem : DiscreteProblem
    workspace : Workspace, optional
        Where factors and levels are kept.

    Returns
    -------
    EnergyNorm
    """
    kept = Workspace.given(workspace)

    def make() -> EnergyNorm:
        if not factorises(problem):
            return EnergyNorm.by_multigrid(problem, kept)
        body = below(problem)
        free = free_unknowns(body)
        return EnergyNorm(Factorised(body.stiffness, singular=free is not None and free.shape[1] > 0))

    return kept.once("energy norm", problem.model, make)


def factorises(problem: DiscreteProblem) -> bool:
    """Whether :func:`energy_norm` factorises the stiffness of a problem.

    Parameters
    ----------
    problem : DiscreteProblem

    Returns
    -------
    bool
    """
    dimension = problem.contact.components if problem.field is None else problem.field.mesh.dim
    return problem.unknowns <= FACTORISED[dimension == 3]
