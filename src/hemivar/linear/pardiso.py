"""PARDISO of Intel's MKL: symmetric positive definite matrices, apart from some unknowns that are kept.

The library comes with the package pypardiso, which only loads it: what is asked for here are its phases one by one.
"""

from __future__ import annotations

import ctypes
import importlib
import threading
import weakref
from functools import lru_cache
from types import ModuleType
from typing import Final

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from hemivar.basics.types import Array, IntArray

__all__ = ["NotDefiniteError", "Pardiso", "pardiso_available"]

_Numbers = NDArray[np.generic]
_DEFINITE: Final = 2
_FACTORISE, _FORWARD, _BACKWARD, _FORGET = 12, 331, 333, -1
_NO_MEMORY, _ZERO_PIVOT = (-2, -9), (-4, -7)
#: Places in its table of options: whether there is one, the ordering and METIS for it, bits of pivots that are
#: replaced, numbers from zero, and a Schur complement with factors that solve.
_OPTIONS: Final = {0: 1, 1: 2, 9: 13, 34: 1}
_COMPLEMENT: Final = (35, 2)


class NotDefiniteError(ArithmeticError):
    """The matrix is not positive definite apart from the kept unknowns."""


class Pardiso:
    """``K_II = L L'`` for the unknowns I that are not kept, and the Schur complement on those that are.

    On one thread: the numbers are the same in every run, and steps of one factorisation are small.  Threads that share
    it take turns.

    Parameters
    ----------
    matrix : sparse array (n, n)
        Symmetric.
    kept : int array (k,)
        Not all of them.

    Raises
    ------
    NotDefiniteError
    MemoryError
    """

    def __init__(self, matrix: sp.csr_array, kept: IntArray) -> None:
        library = _library()
        assert library is not None
        assert kept.size < matrix.shape[0]
        upper = sp.csr_array(sp.triu(matrix, format="csr"))
        upper.sort_indices()
        self._size = matrix.shape[0]
        self._entries = np.array(upper.data, dtype=float)
        self._rows = upper.indptr.astype(np.int32)
        self._columns = upper.indices.astype(np.int32)
        self._marks = np.zeros(self._size, dtype=np.int32)
        self._marks[kept] = 1
        self._handle = np.zeros(64, dtype=np.int64)
        self._options = np.zeros(64, dtype=np.int32)
        for place, value in _OPTIONS.items():
            self._options[place] = value
        if kept.size:
            self._options[_COMPLEMENT[0]] = _COMPLEMENT[1]
        self._lock = threading.Lock()
        #: Schur complement (k, k), in the order of the unknowns.
        self.schur: Array = np.zeros((kept.size, kept.size))
        weakref.finalize(self, _forget, library, self._handle, self._options, self._size)
        self._call(_FACTORISE, np.zeros(self._size), self.schur if kept.size else np.zeros(self._size))

    def forward(self, load: Array) -> Array:
        """``L^-1 f_I`` at the unknowns I of a load (n,), and what is left of it on the kept ones."""
        return self._call(_FORWARD, np.array(load, dtype=float), np.zeros(self._size))

    def backward(self, swept: Array) -> Array:
        """The unknowns (n,) of what :meth:`forward` has left, with the kept ones themselves in their places."""
        return self._call(_BACKWARD, np.array(swept, dtype=float), np.zeros(self._size))

    def _call(self, phase: int, right: Array, found: Array) -> Array:
        with self._lock:
            failed = _asked(
                _library(), self._handle, phase, self._size, self._options, right, found,
                (self._entries, self._rows, self._columns, self._marks),
            )  # fmt: skip
        if failed in _NO_MEMORY:
            raise MemoryError("PARDISO got no memory for its factors")
        if failed in _ZERO_PIVOT:
            raise NotDefiniteError
        if failed:
            raise RuntimeError(f"PARDISO failed in phase {phase} with its error {failed}")
        return found


def _asked(
    library: ctypes.CDLL | None,
    handle: _Numbers,
    phase: int,
    size: int,
    options: _Numbers,
    right: Array,
    found: Array,
    matrix: tuple[_Numbers, ...],
) -> int:
    """One call of the library, on one thread; its error."""
    assert library is not None
    one, failed = ctypes.c_int32(1), ctypes.c_int32(0)
    numbers = [ctypes.byref(ctypes.c_int32(value)) for value in (_DEFINITE, phase, size)]
    data, rows, columns, marks = (part.ctypes.data_as(ctypes.c_void_p) for part in matrix)
    before = library.MKL_Set_Num_Threads_Local(1)
    try:
        library.pardiso(
            handle.ctypes.data_as(ctypes.c_void_p), ctypes.byref(one), ctypes.byref(one), *numbers,
            data, rows, columns, marks, ctypes.byref(one), options.ctypes.data_as(ctypes.c_void_p),
            ctypes.byref(ctypes.c_int32(0)), right.ctypes.data_as(ctypes.c_void_p),
            found.ctypes.data_as(ctypes.c_void_p), ctypes.byref(failed),
        )  # fmt: skip
    finally:
        library.MKL_Set_Num_Threads_Local(before)
    return failed.value


def _forget(library: ctypes.CDLL, handle: _Numbers, options: _Numbers, size: int) -> None:
    """Give the memory of factors back."""
    nothing: tuple[_Numbers, ...] = (np.zeros(1), *(np.zeros(1, dtype=np.int32) for _ in range(3)))
    _asked(library, handle, _FORGET, size, options, np.zeros(1), np.zeros(1), nothing)


@lru_cache(maxsize=1)
def _library() -> ctypes.CDLL | None:
    """MKL as pypardiso finds it, with names of our own for its functions; None where it is not there."""
    try:
        package: ModuleType = importlib.import_module("pypardiso")
        path = package.PyPardisoSolver().libmkl._name
        return ctypes.CDLL(path)
    except (ImportError, AttributeError, OSError):
        return None


def pardiso_available() -> bool:
    """Whether PARDISO can be loaded."""
    return _library() is not None
