"""Sparse direct solvers with a Schur complement: SuperLU of SciPy, PARDISO where it is installed."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.kernels import kernels
from hemivar.kernels.library import Kernels
from hemivar.linear.condensed_load import CondensedLoad
from hemivar.linear.pardiso import PardisoFactorisation, pardiso_available
from hemivar.linear.superlu import LUFactors, superlu

__all__ = [
    "CondensedLoad",
    "Factorisation",
    "PanelSweeps",
    "SuperLUFactorisation",
    "factorise",
]

#: Entries a row up to which a matrix is taken for one of the plane: linear elements have 14 there, quadratic ones 23,
#: and linear ones in space 45. Fields of one component in space, such as temperatures, have 15 and go with the plane.
_PLANE = 30


class Factorisation(Protocol):
    """A symmetric matrix K, factorised apart from some *kept* unknowns C; I are the others."""

    #: Schur complement ``K_CC - K_CI K_II^-1 K_IC``, shape (k, k), symmetric.
    schur: Array

    def solve_interior(self, rhs: Array) -> Array:
        """``K_II^-1 rhs_I`` at the unknowns I, 0 at the kept ones; ``rhs (n,)``, its kept entries are ignored."""

    def reduce(self, load: Array) -> CondensedLoad:
        """A load f (n,), taken over to the kept unknowns."""

    def extend(self, reduced: CondensedLoad, kept: Array) -> Array:
        """The unknowns (n,) in equilibrium with a load, kept ones y (k,) given: ``K_II^-1 (f_I - K_IC y)`` at the
        unknowns I, y at the kept ones."""

    @property
    def interior_positive(self) -> bool:
        """Whether K is positive definite on the unknowns I, as far as rounding lets one see."""


def factorise(matrix: sp.csr_array, kept: IntArray, many: bool = False) -> Factorisation:
    """Factorise ``matrix`` apart from the ``kept`` unknowns, and form the Schur complement on these.

    ``matrix (n, n)``; ``kept (k,)``; ``many``: many loads are to come: for at most a fourth more than the factors cost,
    a load and its way back then take one sweep of the compiled kernels through each half of the factors, and not a
    whole solve each.  PARDISO has halves whatever comes; in the plane SuperLU's are taken for many loads. Raises
    ProblemError: a part of the body that is not kept can move freely.
    """
    swept = many and kernels() is not None and matrix.nnz <= _PLANE * matrix.shape[0]
    if pardiso_available() and not swept:
        return PardisoFactorisation(matrix, kept)
    return SuperLUFactorisation(matrix, kept, many)


class SuperLUFactorisation:
    """SuperLU with the kept unknowns ordered last, so that the trailing factors hold the Schur complement.

    A multiple of the diagonal is added to the kept unknowns before the factorisation, and taken off the Schur
    complement after it: the factors exist then even if only the contact holds the body.

    The ordering is a minimum degree ordering of the graph whose vertices are the groups of unknowns with the same
    sparsity pattern (the components at a node), which is several times smaller than the matrix.

    For many loads the factor ``L_I`` of the other unknowns, with the rows of the kept ones under it, is laid out for
    compiled sweeps.  Each half of a solve is then one of them, and what SuperLU holds is given back.  Without the
    kernels loads take whole solves.
    """

    def __init__(self, matrix: sp.csr_array, kept: IntArray, many: bool = False) -> None:
        n = matrix.shape[0]
        self._kept = kept
        self._shift = matrix.diagonal()[kept]
        shift = np.zeros(n)
        shift[kept] = self._shift
        others = np.setdiff1d(np.arange(n), kept)
        rank = np.empty(n, dtype=np.int64)
        rank[_fill_reducing_order(matrix)] = np.arange(n)
        self._order = np.concatenate([others[np.argsort(rank[others])], kept[np.argsort(rank[kept])]])
        permuted = sp.csc_array((matrix + sp.diags_array(shift))[self._order][:, self._order])
        self._factor: LUFactors | None = superlu(permuted, "NATURAL")
        in_order = self._trailing_product(self._factor, kept.size)
        if in_order is None:
            in_order = self._schur_by_solves(self._factor, kept.size)
        index = np.argsort(np.argsort(rank[kept]))
        self._shifted: Array = in_order[np.ix_(index, index)]
        self.schur: Array = self._shifted - np.diag(self._shift)
        self._halves = self._halved(self._factor, n - kept.size) if many else None
        if self._halves is not None:
            self._factor = None

    def _halved(self, factor: LUFactors, first: int) -> _TriangularFactors | None:
        """Both sweeps by themselves, if the factors are those of a symmetric elimination, the kept unknowns last."""
        n, compiled = self._order.size, kernels()
        columns = factor.columns
        if compiled is None or not (factor.symmetric and np.all(columns[first:] >= first)):
            return None
        full, upper = factor.triangles()
        pivots = upper.diagonal()[:first]
        if not np.all(pivots != 0.0):
            return None
        end = int(full.indptr[first])
        columns_before = full.data[:end], full.indices[:end], full.indptr[: first + 1]
        in_order = sp.csr_array(sp.csc_array(columns_before, shape=(n, first)))  # half the time that sorting rows takes
        sweeps = PanelSweeps(compiled, sp.csc_array(in_order))
        order = self._order[np.argsort(columns)]
        return _TriangularFactors(sweeps, pivots, order, np.searchsorted(self._kept, order[first:]), np.argsort(order))

    @staticmethod
    def _trailing_product(factor: LUFactors, count: int) -> Array | None:
        """The product of the trailing factors, if elimination kept the chosen unknowns last."""
        first, columns = factor.n - count, factor.columns
        if not (factor.symmetric and np.all(columns[first:] >= first)):
            return None
        lower, upper = (sp.csc_array(half)[:, first:][first:].toarray() for half in factor.triangles())
        index = columns[first:] - first
        product = (lower @ upper)[np.ix_(index, index)]
        return np.asarray(0.5 * (product + product.T))

    @staticmethod
    def _schur_by_solves(factor: LUFactors, count: int, block: int = 64) -> Array:
        n = factor.n
        last = np.arange(n - count, n)
        inverse = np.empty((count, count))
        for start in range(0, count, block):
            columns = last[start : start + block]
            rhs = np.zeros((n, columns.size))
            rhs[columns, np.arange(columns.size)] = 1.0
            inverse[:, start : start + block] = factor.solve(rhs)[last]
        schur = np.linalg.inv(0.5 * (inverse + inverse.T))
        return np.asarray(0.5 * (schur + schur.T))

    @property
    def interior_positive(self) -> bool:
        """Whether K is positive definite on the unknowns I, as far as rounding lets one see."""
        if self._factor is None:
            assert self._halves is not None
            return bool(np.all(self._halves.pivots > 0.0))
        return self._factor.positive  # with the shift on the kept unknowns, which only adds to it

    def _solve(self, rhs: Array) -> Array:
        assert self._factor is not None
        out = np.empty(rhs.shape)
        out[self._order] = self._factor.solve(rhs[self._order])
        return out

    def solve_interior(self, rhs: Array) -> Array:
        load = np.array(rhs, dtype=float)
        load[self._kept] = 0.0
        if self._halves is not None:
            return self._halves.backward(self._halves.forward(load), np.zeros(self._kept.size))
        first = self._solve(load)
        if self._kept.size:  # choose the forces on the kept unknowns that hold them at zero
            load[self._kept] = -(self._shifted @ first[self._kept])
            first = self._solve(load)
            first[self._kept] = 0.0
        return first

    def reduce(self, load: Array) -> CondensedLoad:
        if self._halves is not None:
            return self._halves.forward(load)
        free = self._solve(load)  # with the shift, the kept unknowns move as well
        force = np.asarray(self._shifted @ free[self._kept])
        return CondensedLoad(load, force, float(load @ free - force @ free[self._kept]))

    def extend(self, reduced: CondensedLoad, kept: Array) -> Array:
        if self._halves is not None and reduced.inner is not None:
            return self._halves.backward(reduced, kept)
        rhs = np.array(reduced.load, dtype=float)
        rhs[self._kept] += self._shifted @ kept - reduced.force  # these forces put the kept ones there
        out = self._solve(rhs)
        out[self._kept] = kept
        return out


@dataclass(frozen=True, eq=False)
class _TriangularFactors:
    """``K = L D L'`` with ``L = [[L_I, 0], [L_CI, 1]]``, the kept unknowns last."""

    sweeps: PanelSweeps  # through L and its transpose
    pivots: Array  # (n - k,): D on the unknowns I; on the kept ones it is the Schur complement
    order: IntArray  # (n,): the unknown in each place
    permutation: IntArray  # (k,): which of the kept unknowns stands in each of the last places
    back: IntArray  # (n,): the place of each unknown

    def forward(self, load: Array) -> CondensedLoad:
        """``L^-1`` of a load (n,)."""
        swept = load.take(self.order)
        self.sweeps.forward(swept)
        first = self.pivots.size
        inner, force = swept[:first], np.empty(self.permutation.size)
        force[self.permutation] = swept[first:]
        scaled = inner / self.pivots
        return CondensedLoad(load, force, float(inner @ scaled), scaled)

    def backward(self, reduced: CondensedLoad, kept: Array) -> Array:
        """``L'^-1`` of what the other sweep has left, values of the kept unknowns (k,) given."""
        assert reduced.inner is not None
        x = np.concatenate([reduced.inner, kept.take(self.permutation)])
        self.sweeps.backward(x)
        return x.take(self.back)


class PanelSweeps:
    """Substitution through a unit lower triangle L (n, n) and its transpose: neighbouring columns with the same rows
    together.

    ``columns (n, count)``: the first columns of L, of each the rows in order, the one of the diagonal first; 32-bit
    indices. Raises ValueError: an array is not what it should be.
    """

    def __init__(self, kernels: Kernels, columns: sp.csc_array) -> None:
        self.kernels, (self.size, count) = kernels, columns.shape
        starts, rows, data = columns.indptr, columns.indices, columns.data
        for name, array, kind in (
            ("indptr", starts, np.int32),
            ("indices", rows, np.int32),
            ("data", data, np.float64),
        ):
            if array.dtype != kind or array.ndim != 1 or not array.flags.carray:
                raise ValueError(f"{name} of a triangle must be a contiguous array of {np.dtype(kind).name}")
        if starts.size != count + 1 or starts[0] != 0 or starts[-1] != rows.size or rows.size != data.size:
            raise ValueError("indptr of a triangle must rise from 0 to the number of its entries")
        if np.any(np.diff(starts) < 1) or not np.array_equal(rows[starts[:-1]], np.arange(count)):
            raise ValueError("every column of a triangle must begin with its diagonal")
        rising = np.diff(rows) > 0
        rising[starts[1:-1] - 1] = True
        if not rising.all() or rows.max(initial=-1) >= self.size:
            raise ValueError(f"rows of a triangle must rise in each column, up to {self.size - 1}")
        at = kernels.address
        self._pointer = kernels.made(kernels.call.hv_panels_new(count, at(starts), at(rows), at(data)))
        weakref.finalize(self, kernels.call.hv_panels_free, self._pointer)

    def __reduce__(self) -> str:
        raise TypeError("compiled factors belong to this process")

    def forward(self, x: Array) -> None:
        """``L^-1 x`` (n,) in place."""
        self.kernels.call.hv_panels_forward(self._pointer, self._place(x))

    def backward(self, x: Array) -> None:
        """``L'^-1 x`` (n,) in place."""
        self.kernels.call.hv_panels_backward(self._pointer, self._place(x))

    def _place(self, x: Array) -> int:
        if x.shape != (self.size,) or x.dtype != np.float64 or not x.flags.carray:
            raise ValueError(f"a contiguous vector of {self.size} numbers is needed, not {x.shape} of {x.dtype}")
        return self.kernels.address(x)


def _fill_reducing_order(matrix: sp.csr_array) -> IntArray:
    """Minimum degree order of the unknowns, by groups of unknowns with the same pattern."""
    n = matrix.shape[0]
    marks = np.random.default_rng(7).integers(1, 2**62, size=n, dtype=np.int64)
    pattern = sp.csr_array((np.ones_like(matrix.indices, dtype=np.int64), matrix.indices, matrix.indptr), matrix.shape)
    signature = pattern @ marks
    _, first, group = np.unique(signature, return_index=True, return_inverse=True)
    count = first.size
    by_appearance = np.argsort(first)  # ties are broken by position, and neighbours should stay neighbours
    first = first[by_appearance]
    renumber = np.empty(count, dtype=np.int64)
    renumber[by_appearance] = np.arange(count)
    group = renumber[group]
    members = sp.csr_array((np.ones(n), (group, np.arange(n))), shape=(count, n))
    rows = sp.csr_array(pattern[first].astype(float))
    graph = sp.csr_array(rows @ members.T)
    graph.data[:] = -1.0
    graph = graph + graph.T
    degree = -np.asarray(graph.sum(axis=1)).ravel()
    graph = sp.csc_array(graph + sp.diags_array(2.0 * degree + 1.0))
    order = np.argsort(superlu(graph, "MMD_AT_PLUS_A").columns)
    rank = np.empty(count, dtype=np.int64)
    rank[order] = np.arange(count)
    return np.argsort(rank[group], kind="stable")
