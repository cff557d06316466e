"""PARDISO of Intel's MKL, a sparse direct solver, by pypardiso: Schur complement and sweeps of one factorisation."""

from __future__ import annotations

import ctypes
import importlib
import weakref
from enum import IntEnum
from functools import lru_cache
from types import ModuleType
from typing import TypeVar

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.linear.condensed_load import CondensedLoad, singular_interior

__all__ = ["PardisoFactorisation", "pardiso_available"]

_Number = TypeVar("_Number", bound=np.generic)


class _Kind(IntEnum):
    """Kinds of matrices: ``L L'`` of a positive definite one, ``L D L'`` of a symmetric one."""

    DEFINITE = 2
    SYMMETRIC = -2


class _Phase(IntEnum):
    """What is to be done; a solve in its halves leaves the reduced load at the kept unknowns in between."""

    ANALYSE = 11
    FACTORISE = 22
    FORWARD = 331
    DIAGONAL = 332
    BACKWARD = 333
    RELEASE = -1


class _Failure(IntEnum):
    """Answers of PARDISO."""

    NO_MEMORY = -2
    NOT_DEFINITE = -4


@lru_cache(maxsize=1)
def _pypardiso() -> ModuleType | None:
    try:
        package = importlib.import_module("pypardiso")
        package.PyPardisoSolver()  # looks for the library
    except (ImportError, OSError):
        return None
    return package


def pardiso_available() -> bool:
    """Whether condensation will use PARDISO."""
    return _pypardiso() is not None


class _Handle:
    """A matrix in PARDISO's memory, of which the marked unknowns are kept."""

    def __init__(self, upper: sp.csr_array, kept: IntArray, kind: int) -> None:
        module = _pypardiso()
        assert module is not None
        self._call = module.PyPardisoSolver(kind).libmkl.pardiso
        self._kind, self._size = kind, upper.shape[0]
        self._memory = np.zeros(64, dtype=np.int64)
        self.options = np.zeros(64, dtype=np.int32)
        self.options[[0, 1, 9, 10, 12]] = (
            1,
            2,
            8,
            kind == _Kind.SYMMETRIC,
            kind == _Kind.SYMMETRIC,
        )  # METIS; scaling, matching
        self.options[35] = 2 * (kept.size > 0)  # the Schur complement, and the factors for sweeps
        self._marks = np.zeros(self._size, dtype=np.int32)
        self._marks[kept] = 1
        self._values = np.ascontiguousarray(upper.data)
        self._rows, self._columns = (np.asarray(part + 1, dtype=np.int32) for part in (upper.indptr, upper.indices))

    def run(self, phase: int, load: Array, solution: Array) -> int:
        """Returns the error, 0 if there was none."""

        def whole(value: int) -> object:
            return ctypes.byref(ctypes.c_int32(value))

        error = ctypes.c_int32(0)
        marks, rows, columns, options = (
            _pointer(part, ctypes.c_int32) for part in (self._marks, self._rows, self._columns, self.options)
        )
        values, right, left = (_pointer(part, ctypes.c_double) for part in (self._values, load, solution))
        self._call(
            _pointer(self._memory, ctypes.c_int64), whole(1), whole(1), whole(self._kind), whole(phase),
            whole(self._size), values, rows, columns, marks, whole(1), options, whole(0), right, left,
            ctypes.byref(error),
        )  # fmt: skip
        return error.value


def _pointer(values: np.ndarray[tuple[int, ...], np.dtype[_Number]], kind: type) -> object:
    return values.ctypes.data_as(ctypes.POINTER(kind))


class PardisoFactorisation:
    """PARDISO, whose Schur complement costs about half as much again as the factorisation alone.

    Half a solve is a sweep of its own, so that a load and its way back take one through each half.
    """

    def __init__(self, matrix: sp.csr_array, kept: IntArray) -> None:
        self._kept, self._matrix = kept, matrix
        self.schur: Array = np.zeros((kept.size, kept.size))
        self._others = np.setdiff1d(np.arange(matrix.shape[0]), kept)
        self.interior_positive = True
        if not self._others.size:
            self.schur = matrix.toarray()[np.ix_(kept, kept)]
            return
        upper = sp.csr_array(sp.triu(matrix) + sp.csr_array(matrix.shape))
        upper.sort_indices()
        self._definite = True
        error = self._factorise(upper, _Kind.DEFINITE)
        if error == _Failure.NOT_DEFINITE:
            self._release()
            self._definite = self.interior_positive = False
            error = self._factorise(upper, _Kind.SYMMETRIC)
        if error == _Failure.NO_MEMORY:
            raise MemoryError("PARDISO got no memory for the factors; take a coarser mesh, or method multigrid")
        if error:
            raise singular_interior()
        self.schur = 0.5 * (self.schur + self.schur.T)
        self._check()

    def _factorise(self, upper: sp.csr_array, kind: int) -> int:
        self._handle = _Handle(upper, self._kept, kind)
        nothing = np.zeros(upper.shape[0])
        self._release = weakref.finalize(self, self._handle.run, _Phase.RELEASE, nothing, nothing)
        return self._handle.run(_Phase.ANALYSE, nothing, self.schur) or self._handle.run(
            _Phase.FACTORISE, nothing, self.schur
        )

    def _check(self) -> None:
        """PARDISO goes on where a pivot is zero up to rounding; a solve shows it."""
        probe = self._matrix.diagonal() * np.cos(np.arange(self._matrix.shape[0]))
        probe[self._kept] = 0.0
        rest = self._matrix @ self.solve_interior(probe) - probe
        rest[self._kept] = 0.0
        if not np.linalg.norm(rest) <= 1e-6 * np.linalg.norm(probe):
            raise singular_interior()

    def _swept(self, phase: int, values: Array) -> Array:
        if values.shape != (self._matrix.shape[0],):  # the library would read and write beyond it
            raise ValueError(f"a vector of {self._matrix.shape[0]} numbers is needed, not {values.shape}")
        out = np.zeros(values.shape)
        error = self._handle.run(phase, np.ascontiguousarray(values, dtype=float), out)
        if error == _Failure.NO_MEMORY:
            raise MemoryError("PARDISO got no memory for a solve")
        if error:
            raise singular_interior()
        return out

    def solve_interior(self, rhs: Array) -> Array:
        load = np.array(rhs, dtype=float)
        load[self._kept] = 0.0
        return self.extend(self.reduce(load), np.zeros(self._kept.size))

    def reduce(self, load: Array) -> CondensedLoad:
        if not self._others.size:
            return CondensedLoad(load, np.array(load[self._kept]), 0.0, np.zeros(0))
        inner = self._swept(_Phase.FORWARD, load)
        if not (self._definite or self._kept.size):  # beside a Schur complement the way back divides by the pivots
            inner = self._swept(_Phase.DIAGONAL, inner)
        force = inner[self._kept]
        inner[self._kept] = 0.0
        work = inner @ inner if self._definite else load @ self._swept(_Phase.BACKWARD, inner)
        return CondensedLoad(load, force, float(work), inner[self._others])

    def extend(self, reduced: CondensedLoad, kept: Array) -> Array:
        assert reduced.inner is not None
        out = np.zeros(self._matrix.shape[0])
        out[self._others], out[self._kept] = reduced.inner, kept
        return self._swept(_Phase.BACKWARD, out) if self._others.size else out
