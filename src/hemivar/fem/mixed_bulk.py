"""Saddle-point bodies (constraints), condensed by a Schur complement to the unknowns that contact sees."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.arrays import NULL
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.bulk import Quadratic
from hemivar.errors import ProblemError

__all__ = ["MixedBulk", "refuse_skew"]


#: Size of a solution, relative to the load and the matrix, from which the matrix is singular up to rounding.
_SINGULAR = 1e13
#: Rounds of scaling rows and columns, of which each takes the square root of what is left.
_SCALINGS = 8
#: Right sides solved at a time.
_COLUMNS = 64


@dataclass(frozen=True, eq=False)
class MixedBulk(Quadratic):
    """A body with constraints, ``[[A, D'], [D, -S]]``, condensed to the unknowns that contact sees.

    Its energy is the least ``1/2 u'A u - f'u`` under ``D u = g``, or with the compliance S of the constraints.  What is
    left after the factorisation of the whole symmetric indefinite matrix apart from the kept unknowns is a dense
    stiffness on these, which must be positive definite: it is so where A is on the kernel of D.
    """

    kept: IntArray = field(kw_only=True)  # (k,), the unknowns that are left
    others: IntArray = field(kw_only=True)  # (n - k,)
    coupling: sp.csr_array = field(kw_only=True)  # (n - k, k), rows of the others
    load: Array = field(kw_only=True)  # (n,)
    inner: sp.csc_array = field(kw_only=True)  # (n - k, n - k)

    @staticmethod
    def of(matrix: sp.csr_array, load: Array, kept: IntArray) -> MixedBulk:
        """Of a symmetric matrix; raises ProblemError: contact unknowns are not stiff, or the others do not follow."""
        others = np.setdiff1d(np.arange(matrix.shape[0]), kept)
        inner, coupling = sp.csc_array(matrix[others][:, others]), sp.csr_array(matrix[others][:, kept])
        factor = _factorised(inner)
        schur = matrix[kept][:, kept].toarray()
        for start in range(0, kept.size, _COLUMNS):
            part = slice(start, start + _COLUMNS)
            schur[:, part] -= coupling.T @ factor.solve(coupling[:, part].toarray())
        schur = 0.5 * (schur + schur.T)
        values = np.linalg.eigvalsh(schur)
        least = float(values.min(initial=np.inf))
        if least < -NULL * float(values.max(initial=0.0)):
            raise ProblemError(
                f"with its constraints the body has the stiffness {least:.3g} in some direction of the contact "
                "unknowns; the first block must not be negative where the constraints hold"
            )
        bulk = MixedBulk(
            sp.csr_array(schur), kept=kept, others=others, coupling=coupling, load=np.asarray(load), inner=inner
        )
        vars(bulk)["factor"] = factor  # it is there already
        return bulk

    @cached_property
    def factor(self) -> _Factor:
        """The factors of the matrix of the others, with pivots by size, for it is indefinite."""
        return _factorised(self.inner)

    def reduced(self) -> tuple[Array, float]:
        """The load of the kept unknowns (k,), and the work of that of the others."""
        inner = self.load[self.others]
        alone = self.factor.solve(inner)
        return self.load[self.kept] - self.coupling.T @ alone, float(inner @ alone)

    def extend(self, kept: Array) -> Array:
        """All unknowns (n,) of the kept ones (k,), under the stated load."""
        unknowns = np.empty(self.load.size)
        unknowns[self.kept] = kept
        unknowns[self.others] = self.factor.solve(self.load[self.others] - self.coupling @ kept)
        return unknowns


@dataclass(frozen=True, eq=False)
class _Factor:
    """The factors of ``S A S``, of a symmetric matrix A and a diagonal one S, with pivots by size."""

    scales: Array  # (n,)
    inner: spla.SuperLU

    def solve(self, right: Array) -> Array:
        """``A^-1 right``, for (n,) or (n, k)."""
        scales = self.scales if right.ndim == 1 else self.scales[:, None]
        return np.asarray(scales * self.inner.solve(scales * right))


def _scales(matrix: sp.sparray) -> Array:
    """Positive numbers (n,) with which ``s_i |a_ij| s_j`` is about 1 at most in each row (Ruiz 2001).

    Unknowns of several units, such as mm and V, then have entries of one size.
    """
    scales = np.ones(matrix.shape[0])
    for _ in range(_SCALINGS):
        largest = abs(_scaled(matrix, scales)).max(axis=1).toarray().ravel()
        scales /= np.sqrt(np.where(largest > 0.0, largest, 1.0))
    return scales


def _scaled(matrix: sp.sparray, scales: Array) -> sp.csr_array:
    return sp.csr_array(sp.diags_array(scales) @ matrix @ sp.diags_array(scales))


def _factorised(matrix: sp.csc_array) -> _Factor:
    """The factors of a symmetric indefinite matrix; raises ProblemError: it is singular."""
    singular = ProblemError(
        "the constraints do not determine the body apart from its contact: fix a pressure with fixed=, or add a "
        "support. Leave out a constraint that is stated twice; take elements that are stable together (P2, P1)"
    )
    scales = _scales(matrix)
    scaled = sp.csc_array(_scaled(matrix, scales))
    try:
        factor = spla.splu(scaled)
    except RuntimeError:
        raise singular from None
    probe = np.cos(np.arange(matrix.shape[0], dtype=float))
    size = float(abs(scaled).sum(axis=0).max(initial=0.0)) * float(np.abs(factor.solve(probe)).max(initial=0.0))
    if not size < _SINGULAR:
        raise singular
    return _Factor(scales, factor)


def refuse_skew(matrix: sp.csr_array, name: str) -> None:
    """Refuse a matrix that is not symmetric, in any units of its unknowns."""
    if np.abs(_scaled(matrix - matrix.T, _scales(matrix)).data).max(initial=0.0) > NULL:
        raise ProblemError(
            f"the {name} of the body is not symmetric; give one with a(u, v) = a(v, u), as a mixed "
            "body has [[A, D'], [D, -S]]"
        )
