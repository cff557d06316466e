"""The body: its stored energy with its derivatives, quadratic where the body is linear; no load acts on it."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import InitVar, dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import NULL, norm, real_matrix
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.linear.products import diagonal
from hemivar.mesh.keys import PORTION

__all__ = ["FEW_ZEROS", "Bulk", "Quadratic", "Sized", "without_zeros"]

#: Least work of a load against the diagonal stiffness, and the inverse of the largest one.
_LEAST_WORK = 1e-270
#: Part of the stored entries of a matrix that are none of them zeros, above which zeros are left where they are.
FEW_ZEROS = 0.95


@runtime_checkable
class Bulk(Protocol):
    """Stored energy of the body, without what acts on it and without the foundation.

    Solvers and certificates ask for nothing else of a body. A step of Newton's method for a body that is not linear
    is a :class:`Quadratic`.
    """

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""

    def value(self, u: Array) -> float:
        """Stored energy at the unknowns u (n,)."""

    def gradient(self, u: Array) -> Array:
        """Its derivative (n,): the internal forces."""

    def hessian(self, u: Array) -> sp.csr_array:
        """Its second derivative (n, n), symmetric."""

    @property
    def row_sums(self) -> Array:
        """Sums (n,) of the absolute entries of the rows of a second derivative, by which rounding is measured."""


class Sized(ABC):
    """A bulk that knows the sizes of its forces, and the linear bodies below and above it."""

    @property
    @abstractmethod
    def diagonal(self) -> Array:
        """Diagonal of the stiffness (n,), at rest."""

    @property
    @abstractmethod
    def lower(self) -> Quadratic | None:
        """The linear body by which this one is strongly monotone, itself if it is linear; None where none is known."""

    @property
    @abstractmethod
    def upper(self) -> Quadratic:
        """The linear body above, itself if it is linear."""

    @abstractmethod
    def rounding_scale(self, u: Array, load: Array) -> float:
        """Norm of the sizes of what is added up in ``f - K u``, entry by entry."""


@dataclass(frozen=True, eq=False)
class Quadratic(PickleMixin, Sized):
    """Stored energy of a linear elastic body: ``1/2 u'K u``.

    Parameters
    ----------
    stiffness : sparse array, shape (n, n)
        ``K``, symmetric with positive diagonal. A dense array or any scipy sparse matrix is converted.
    assembled : bool
        The matrix is known to be finite and symmetric: it is taken as it is.

    Raises
    ------
    ProblemError
        The stiffness is not square, has numbers that are not finite, is unsymmetric (relative to 1e-10), or has a
        diagonal entry that is not positive.
    """

    stiffness: sp.csr_array
    assembled: InitVar[bool] = False

    def __post_init__(self, assembled: bool) -> None:
        stiffness = self.stiffness if assembled else real_matrix(self.stiffness, "stiffness", own=True)
        if stiffness.shape[0] != stiffness.shape[1]:
            raise ProblemError(f"stiffness has shape {stiffness.shape}; it must be square")
        if not assembled:
            _check_symmetry(stiffness)
        object.__setattr__(self, "stiffness", stiffness)
        _check_diagonal(self.diagonal)

    def __repr__(self) -> str:
        return f"Quadratic({self.unknowns} unknowns, {self.stiffness.nnz} entries)"

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return int(self.stiffness.shape[0])

    @cached_property
    def diagonal(self) -> Array:
        """Diagonal of the stiffness, shape (n,)."""
        return diagonal(self.stiffness)

    @cached_property
    def diagonal_range(self) -> tuple[float, float]:
        """Smallest and largest entry of the diagonal."""
        return float(self.diagonal.min(initial=np.inf)), float(self.diagonal.max(initial=0.0))

    @cached_property
    def row_sums(self) -> Array:
        """Sums of the absolute entries of the rows of the stiffness, shape (n,)."""
        K = self.stiffness
        sums = np.zeros(K.shape[0])
        for start in range(0, K.shape[0], PORTION):
            bounds = K.indptr[start : start + PORTION + 1]
            part = np.abs(K.data[bounds[0] : bounds[-1]])
            sums[start : start + len(bounds) - 1] = np.add.reduceat(part, bounds[:-1] - bounds[0])
        return sums

    @property
    def longest(self) -> int:
        """Most entries in a row of the stiffness."""
        return int(np.diff(self.stiffness.indptr).max(initial=0))

    def value(self, u: Array) -> float:
        """``1/2 u'K u``."""
        return 0.5 * float(u @ (self.stiffness @ u))

    def gradient(self, u: Array) -> Array:
        """``K u``, shape (n,)."""
        return np.asarray(self.stiffness @ u)

    def hessian(self, u: Array | None = None) -> sp.csr_array:
        """``K``, the same everywhere."""
        return self.stiffness

    def tangent(self, u: Array | None = None) -> Quadratic:
        """The body itself."""
        return self

    @property
    def at_rest(self) -> Quadratic:
        """The body itself."""
        return self

    @property
    def lower(self) -> Quadratic:
        """The body itself, for its second derivative is the same everywhere."""
        return self

    @property
    def upper(self) -> Quadratic:
        """The body itself."""
        return self

    def resisting(self) -> Quadratic:
        """The body itself."""
        return self

    def rounding_scale(self, u: Array, load: Array) -> float:
        """Norm of the sizes of what is added up in ``f - K u``, entry by entry: rounding is a part of it."""
        sizes = np.abs(u)
        sizes *= self.row_sums
        sizes += np.abs(load)
        return norm(sizes)

    def check_work(self, load: Array, size: float, *, stated: bool = True) -> None:
        """Refuse a load (n,) of norm ``size`` whose work over- or underflows: no energy could be compared with another.

        What an iteration leaves of a load may be zero but for rounding: only a ``stated`` load can be too small.

        Raises
        ------
        ProblemError
        """
        least, largest = self.diagonal_range
        tiny = math.sqrt(_LEAST_WORK)
        if size == 0.0 or tiny * math.sqrt(largest) < size < math.sqrt(least) / tiny:
            return
        with np.errstate(over="ignore", under="ignore"):
            work = float(np.sum(np.abs(load) * (np.abs(load) / self.diagonal)))
        if load.any() and not (_LEAST_WORK if stated else -1.0) < work < 1.0 / _LEAST_WORK:
            raise ProblemError(
                f"the largest entry of the load is {np.abs(load).max():.3g} with a stiffness of {largest:.3g}: "
                f"energies of that size {'over' if work > 1.0 else 'under'}flow; use units that suit the problem"
            )


def without_zeros(matrix: sp.csr_array) -> sp.csr_array:
    """The matrix without stored zeros, for products; the matrix itself where they are few."""
    if np.count_nonzero(matrix.data) > FEW_ZEROS * matrix.nnz:
        return matrix
    thinned = matrix.copy()
    thinned.eliminate_zeros()
    return thinned


def _check_diagonal(diagonal: Array) -> None:
    if not np.all(diagonal > 0):
        bad = int(np.flatnonzero(~(diagonal > 0))[0])
        raise ProblemError(
            f"stiffness[{bad}, {bad}] = {diagonal[bad]:g}; a stiffness matrix needs a positive diagonal: "
            f"remove unknowns that belong to no element"
        )


def _check_symmetry(stiffness: sp.csr_array) -> None:
    if stiffness.nnz == 0:
        return
    skew = stiffness - stiffness.T
    largest = float(np.max(np.abs(skew.data), initial=0.0))
    if largest > NULL * float(np.max(np.abs(stiffness.data))):
        raise ProblemError(
            f"stiffness is not symmetric: max |K - K'| = {largest:.3g}; pass (K + K') / 2 if this is round-off"
        )
