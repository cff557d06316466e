"""The body: an energy of all unknowns with its derivatives, quadratic where the body is linear."""

from __future__ import annotations

import copy
import math
from dataclasses import InitVar, dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import norm, real_array, real_matrix
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array
from hemivar.errors import ProblemError

__all__ = ["Bulk", "Quadratic", "without_zeros"]

_SYMMETRY_TOLERANCE = 1e-10
#: Least work of a load against the diagonal stiffness, and the inverse of the largest one.
_LEAST_WORK = 1e-270
#: Rows of a matrix looked at in one go.
_PORTION = 1 << 16
#: Part of the stored entries of a matrix that are none of them zeros, above which zeros are left where they are.
_FEW_ZEROS = 0.95


@runtime_checkable
class Bulk(Protocol):
    """Smooth part of the energy: the body under its loads, without the foundation.

    Solvers and certificates ask for nothing else of a body. A step of Newton's method for a body that is not linear
    is a :class:`Quadratic`.
    """

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        ...

    def value(self, u: Array) -> float:
        """Energy at the unknowns u (n,)."""
        ...

    def gradient(self, u: Array) -> Array:
        """Derivative of the energy (n,): internal less external forces."""
        ...

    def hessian(self, u: Array) -> sp.csr_array:
        """Second derivative of the energy (n, n), symmetric."""
        ...


@dataclass(frozen=True, eq=False)
class Quadratic(Portable):
    """Linear elastic body: ``1/2 u'K u - f'u + constant``.

    Parameters
    ----------
    stiffness : sparse array, shape (n, n)
        ``K``, symmetric with positive diagonal. A dense array or any scipy sparse matrix is converted.
    load : array, shape (n,)
        ``f``.
    constant : float
        Energy that does not depend on the unknowns.
    assembled : bool
        The matrix is known to be finite and symmetric: it is taken as it is, and only the rest is checked.

    Raises
    ------
    ProblemError
        Shapes disagree, numbers are not finite, the stiffness is unsymmetric (relative to 1e-10) or has a diagonal
        entry that is not positive, or the work of the load is beyond the range of numbers.
    """

    stiffness: sp.csr_array
    load: Array
    constant: float = 0.0
    assembled: InitVar[bool] = False

    def __post_init__(self, assembled: bool) -> None:
        stiffness = self.stiffness if assembled else real_matrix(self.stiffness, "stiffness", own=True)
        if stiffness.shape[0] != stiffness.shape[1]:
            raise ProblemError(f"stiffness has shape {stiffness.shape}; it must be square")
        if not assembled:
            _check_symmetry(stiffness)
        object.__setattr__(self, "stiffness", stiffness)
        self._carry(self.load, self.constant, own=not assembled)
        _check_diagonal(self.diagonal)
        _check_size(self.diagonal, self.load)

    def _carry(self, load: Array, constant: float, own: bool) -> None:
        """Take a load and a constant."""
        load, n = real_array(load, "load", 1, own=own), self.stiffness.shape[0]
        if load.shape != (n,):
            m = load.shape[0]
            raise ProblemError(
                f"stiffness has shape {self.stiffness.shape} but load has {m} entries; "
                f"give a stiffness of shape ({m}, {m})"
            )
        number = float(real_array(constant, "constant", 0, finite=False))
        if not np.isfinite(number):
            raise ProblemError(f"constant = {constant}; the constant part of the energy must be finite")
        object.__setattr__(self, "load", load)
        object.__setattr__(self, "constant", number)

    def __repr__(self) -> str:
        return f"Quadratic({self.unknowns} unknowns, {self.stiffness.nnz} entries)"

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return int(self.load.shape[0])

    @cached_property
    def diagonal(self) -> Array:
        """Diagonal of the stiffness, shape (n,)."""
        return np.asarray(self.stiffness.diagonal())

    @cached_property
    def row_sums(self) -> Array:
        """Sums of the absolute entries of the rows of the stiffness, shape (n,)."""
        K = self.stiffness
        sums = np.zeros(K.shape[0])
        for start in range(0, K.shape[0], _PORTION):
            bounds = K.indptr[start : start + _PORTION + 1]
            part = np.abs(K.data[bounds[0] : bounds[-1]])
            sums[start : start + len(bounds) - 1] = np.add.reduceat(part, bounds[:-1] - bounds[0])
        return sums

    def value(self, u: Array) -> float:
        """``1/2 u'K u - f'u + constant``."""
        return 0.5 * float(u @ (self.stiffness @ u)) - float(self.load @ u) + self.constant

    def gradient(self, u: Array) -> Array:
        """``K u - f``, shape (n,)."""
        return np.asarray(self.stiffness @ u - self.load)

    def hessian(self, u: Array | None = None) -> sp.csr_array:
        """``K``, the same everywhere."""
        return self.stiffness

    def moved(self, u: Array) -> float:
        """Norm of the sizes of what is added up in ``K u - f``, entry by entry: rounding is a part of it."""
        sizes = np.abs(u)
        sizes *= self.row_sums
        sizes += np.abs(self.load)
        return norm(sizes)

    @cached_property
    def load_size(self) -> float:
        """Norm of the load."""
        return norm(self.load)

    @cached_property
    def _ends_of_diagonal(self) -> tuple[float, float]:
        return float(self.diagonal.min()), float(self.diagonal.max())

    def under(self, load: Array, constant: float | None = None, own: bool = True) -> Quadratic:
        """The same body under another load, shape (n,); the stiffness is shared, and what is known of it.

        The load is copied if ``own``; else it is taken as it is, and read-only from now on.
        """
        _ = self.diagonal, self.row_sums, self._ends_of_diagonal
        other = copy.copy(self)
        vars(other).pop("load_size", None)
        if constant is None and isinstance(load, np.ndarray) and load.dtype == float and load.shape == self.load.shape:
            least, largest = self._ends_of_diagonal
            with np.errstate(over="ignore"):
                square = float(load.dot(load))
            if _LEAST_WORK * largest < square < least / _LEAST_WORK:  # every number is finite, and so is the work
                kept = load.copy() if own else load
                kept.flags.writeable = False
                object.__setattr__(other, "load", kept)
                vars(other)["load_size"] = math.sqrt(square)
                return other
        other._carry(load, self.constant if constant is None else constant, own=True)
        _check_size(other.diagonal, other.load)
        return other


def without_zeros(matrix: sp.csr_array) -> sp.csr_array:
    """The matrix without stored zeros, for products; the matrix itself where they are few."""
    if np.count_nonzero(matrix.data) > _FEW_ZEROS * matrix.nnz:
        return matrix
    found = matrix.copy()
    found.eliminate_zeros()
    return found


def _check_diagonal(diagonal: Array) -> None:
    if not np.all(diagonal > 0):
        bad = int(np.flatnonzero(~(diagonal > 0))[0])
        raise ProblemError(
            f"stiffness[{bad}, {bad}] = {diagonal[bad]:g}; a stiffness matrix needs a positive diagonal: "
            f"remove unknowns that no element carries"
        )


def _check_size(diagonal: Array, load: Array) -> None:
    """Refuse a load whose work over- or underflows: no energy could be compared with another."""
    with np.errstate(over="ignore", under="ignore"):
        work = float(np.sum(np.abs(load) * (np.abs(load) / diagonal)))
    if load.any() and not _LEAST_WORK < work < 1.0 / _LEAST_WORK:
        raise ProblemError(
            f"the largest entry of the load is {np.abs(load).max():.3g} with a stiffness of "
            f"{np.max(diagonal):.3g}: energies of that size {'over' if work > 1.0 else 'under'}flow; "
            "state the problem in units that fit it"
        )


def _check_symmetry(stiffness: sp.csr_array) -> None:
    if stiffness.nnz == 0:
        return
    skew = stiffness - stiffness.T
    largest = float(np.max(np.abs(skew.data), initial=0.0))
    if largest > _SYMMETRY_TOLERANCE * float(np.max(np.abs(stiffness.data))):
        raise ProblemError(
            f"stiffness is not symmetric: max |K - K'| = {largest:.3g}; pass (K + K') / 2 if this is round-off"
        )
