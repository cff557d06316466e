"""Loads the compiled library beside this module: its version is checked, and the threads that it may take."""

from __future__ import annotations

import ctypes
import os
from ctypes import c_double, c_int, c_int64, c_void_p
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import DTypeLike

from hemivar.basics.machine import cores
from hemivar.basics.types import AnyArray, Array

if TYPE_CHECKING:
    import scipy.sparse as sp

__all__ = ["Kernels", "expect_list", "kernels", "threads"]

#: What both sides agree on; a library of another version is left alone.
_ABI = 11
#: With a dot inside, so that nothing that lists the modules of a package takes the library for one.
_NAMES = ("_compiled.kernels.so", "_compiled.kernels.pyd")
#: Most threads that are ever taken.
_MOST = 256

#: Functions with their arguments and what they return; None for nothing.
_FUNCTIONS: dict[str, tuple[list[type], type | None]] = {
    "hv_set_threads": ([c_int], None),
    "hv_after_fork": ([], None),
    "hv_levels_new": ([c_int64], c_void_p),
    "hv_levels_free": ([c_void_p], None),
    "hv_levels_matrix": (
        [c_void_p, c_int64, c_int64, *[c_void_p] * 3, c_int, c_int64, *[c_void_p] * 3, c_int64],
        c_int,
    ),
    "hv_levels_transfer": ([c_void_p, c_int64, c_int64, c_int64, c_void_p, c_void_p, c_void_p], c_int),
    "hv_truncation_new": ([c_void_p], c_void_p),
    "hv_truncation_free": ([c_void_p], None),
    "hv_truncation_rows": ([c_void_p, c_int64, c_void_p, c_void_p], c_int),
    "hv_truncation_root": ([c_void_p, c_void_p], c_int),
    "hv_cycle": ([c_void_p, c_int64, c_void_p, c_void_p], c_int),
    "hv_edges_new": ([c_int, c_int64, c_int64, c_void_p, c_void_p], c_int),
    "hv_edges_free": ([c_void_p], None),
    "hv_edges_count": ([c_void_p], c_int64),
    "hv_edges_get": ([c_void_p] * 3, c_int),
    "hv_graph_new": ([c_int64, c_int64, c_void_p], c_void_p),
    "hv_graph_free": ([c_void_p], None),
    "hv_graph_add": (
        [c_void_p, c_int, *[c_int64] * 2, *[c_void_p] * 3, *[c_int64] * 2, *[c_int] * 2, c_int64, *[c_void_p] * 3],
        c_int,
    ),
    "hv_graph_close": ([c_void_p, c_int, c_void_p, c_void_p], c_int),
    "hv_graph_lengths": ([c_void_p, c_int, c_void_p, c_void_p], c_int64),
    "hv_graph_rows": ([c_void_p, c_int, *[c_void_p] * 6], c_int),
    "hv_diagonal": ([c_int64, c_int64, *[c_void_p] * 4], c_int),
    "hv_add_product": ([*[c_int64] * 2, *[c_void_p] * 9], c_int),
    "hv_multiply": ([c_int64, *[c_void_p] * 5], c_int),
    "hv_advance": ([c_int64, c_double, *[c_void_p] * 5], c_int),
    "hv_curvature": ([c_int64, *[c_void_p] * 4], c_int),
    "hv_products": ([c_int64, *[c_void_p] * 4], c_int),
    "hv_turn": ([c_int64, c_double, c_void_p, c_void_p], c_int),
    "hv_panels_new": ([c_int64, *[c_void_p] * 3], c_void_p),
    "hv_panels_free": ([c_void_p], None),
    "hv_panels_forward": ([c_void_p, c_void_p], None),
    "hv_panels_backward": ([c_void_p, c_void_p], None),
    "hv_active_sets_new": ([c_int64, c_int64, c_void_p], c_void_p),
    "hv_active_sets_free": ([c_void_p], None),
    "hv_active_sets_distance": ([*[c_void_p] * 3], c_double),
    "hv_active_sets_run": ([*[c_void_p] * 5, c_int64, c_double, c_double, c_double, c_void_p], c_int),
    "hv_law_value": ([c_void_p, *[c_int64] * 2, *[c_void_p] * 2], None),
    "hv_law_linearise": ([c_void_p, *[c_int64] * 2, *[c_void_p] * 4], None),
    "hv_law_nearest": ([c_void_p, *[c_int64] * 2, *[c_void_p] * 3], None),
    "hv_law_clamp": ([c_void_p, *[c_int64] * 2, *[c_void_p] * 3], None),
    "hv_law_distance": ([c_void_p, *[c_int64] * 2, *[c_void_p] * 4], None),
    "hv_law_minimise": ([c_void_p, *[c_int64] * 2, *[c_void_p] * 3], c_int),
    "hv_patch_order": ([c_int64, c_int64, c_void_p, c_int64, *[c_void_p] * 5], c_int64),
    "hv_improve_patches": ([c_void_p, c_void_p], c_int),
    "hv_pull_back": ([*[c_int64] * 3, *[c_void_p] * 5], c_int),
    "hv_strains": ([*[c_int64] * 3, *[c_void_p] * 7], c_int),
    "hv_cells": ([c_void_p, c_void_p], c_int),
    "hv_unresolved": ([c_void_p, c_void_p], c_int),
    "hv_facets_new": ([c_int, c_int64, c_int64, *[c_void_p] * 3], c_int),
    "hv_facets_free": ([c_void_p], None),
    "hv_facets_count": ([c_void_p], c_int64),
    "hv_facets_get": ([c_void_p] * 7, c_int),
    "hv_measure_simplices": ([c_int, c_int64, *[c_void_p] * 8], c_int),
    "hv_number_alike": ([c_int64, c_int64, c_void_p, c_int64, c_void_p, c_double, c_void_p], c_int),
    "hv_stars": ([c_int, c_int64, c_int64, *[c_void_p] * 4], c_int),
    "hv_settle_stars": ([c_void_p] * 5, c_int),
    "hv_share_on_contact": ([c_void_p, c_int64, c_void_p, c_void_p], c_int),
}


class Kernels:
    """The functions of the library; they leave the interpreter to other threads while they work."""

    def __init__(self, call: ctypes.CDLL) -> None:
        self.call = call

    @staticmethod
    def address(array: np.ndarray) -> int:
        """Where the numbers of an array are."""
        return int(array.__array_interface__["data"][0])

    @staticmethod
    def made(pointer: int | None) -> int:
        """What a function has made; raises where there was no memory for it."""
        if not pointer:
            raise MemoryError("no memory for the compiled kernels")
        return pointer

    @staticmethod
    def check(status: int) -> None:
        """Raise what a function could not do."""
        if status == 1:
            raise MemoryError("no memory for the compiled kernels")
        if status:
            raise ValueError("the compiled kernels cannot hold this matrix")

    def diagonal(self, indptr: AnyArray, indices: AnyArray, data: Array) -> Array:
        """The diagonal (n,) of a square matrix by rows, whose columns are in order."""
        parts = {"starts": (indptr, np.int32), "columns": (indices, np.int32), "numbers": (data, np.float64)}
        for name, (array, kind) in parts.items():
            expect_list(f"{name} of rows", array, kind)
        if indices.size != data.size or not indptr.size:
            raise ValueError(f"{indices.size} columns must have as many numbers, not {data.size}")
        out, at = np.empty(indptr.size - 1), self.address
        self.check(self.call.hv_diagonal(out.size, data.size, at(indptr), at(indices), at(data), at(out)))
        return out

    def add_product(
        self, left: sp.csr_array, right: sp.csr_array, out: tuple[AnyArray, AnyArray, Array], columns: int
    ) -> None:
        """``C += A B`` of matrices by rows, C of this many columns on a pattern.

        ``out``: starts, columns and numbers of its rows, which are changed. Raises ValueError: C has no place for an
        entry, or an array is not what it should be.
        """
        starts, indices, data = out
        if left.shape[1] != right.shape[0] or columns != right.shape[1]:
            raise ValueError(f"a product of {left.shape} and {right.shape} must have {right.shape[1]} columns")
        _changed(data, data.size)
        _expect_rows((left.indptr, left.indices, left.data), left.shape)
        _expect_rows((right.indptr, right.indices, right.data), right.shape)
        _expect_rows(out, (left.shape[0], columns))
        at = self.address
        parts = (left.indptr, left.indices, left.data, right.indptr, right.indices, right.data, starts, indices, data)
        self.check(self.call.hv_add_product(left.shape[0], columns, *map(at, parts)))

    def curvature(self, p: Array, q: Array, diagonal: Array) -> tuple[float, float]:
        """``p'q`` and ``p' diag(diagonal) p`` of arrays (n,), summed in the same order by any number of threads."""
        at, p, q = self.address, _vector(p, p.size), _vector(q, p.size)
        out = np.empty(2)
        self.check(self.call.hv_curvature(p.size, at(p), at(q), at(_vector(diagonal, p.size)), at(out)))
        return float(out[0]), float(out[1])

    def products(self, z: Array, r: Array, q: Array) -> tuple[float, float]:
        """``z'r`` and ``z'q`` of arrays (n,), summed in the same order by any number of threads."""
        at, n, out = self.address, z.size, np.empty(2)
        self.check(self.call.hv_products(n, at(_vector(z, n)), at(_vector(r, n)), at(_vector(q, n)), at(out)))
        return float(out[0]), float(out[1])

    def turn(self, factor: float, z: Array, p: Array) -> None:
        """``p = z + factor p``, in place; both arrays (n,)."""
        _changed(p, p.size)
        self.check(self.call.hv_turn(p.size, factor, self.address(_vector(z, p.size)), self.address(p)))

    def advance(self, length: float, p: Array, q: Array, x: Array, r: Array) -> float:
        """``x += length p``, ``r -= length q``, in place, and the square of r; all arrays (n,)."""
        at, n = self.address, x.size
        for changed in (x, r):
            _changed(changed, n)
        square = np.empty(1)
        self.check(self.call.hv_advance(n, length, at(_vector(p, n)), at(_vector(q, n)), at(x), at(r), at(square)))
        return float(square[0])


def _vector(x: Array, n: int) -> Array:
    """A contiguous and aligned array (n,) of these numbers."""
    vector = np.require(x, float, ["C", "A"])
    if vector.shape != (n,):
        raise ValueError(f"a vector of {n} numbers is needed, not {vector.shape}")
    return vector


def expect_list(what: str, array: AnyArray, kind: DTypeLike) -> None:
    """That the kernels can read a list of numbers where it is."""
    if array.dtype != kind or array.ndim != 1 or not array.flags.c_contiguous or not array.flags.aligned:
        raise ValueError(f"{what} must be a contiguous array of {np.dtype(kind).name}")


def _expect_rows(arrays: tuple[AnyArray, AnyArray, Array], shape: tuple[int, int]) -> None:
    """That the kernels can read a matrix by rows, and nothing beyond its ends."""
    starts, columns, numbers = arrays
    for array, kind in ((starts, np.int32), (columns, np.int32), (numbers, np.float64)):
        expect_list("rows of a product", array, kind)
    ends = starts.size == shape[0] + 1 and starts[0] == 0 and starts[-1] == columns.size == numbers.size
    if not ends or (np.diff(starts) < 0).any():
        raise ValueError("starts of rows must rise from 0 to the number of their entries")
    if columns.size and not (columns.min() >= 0 and columns.max() < shape[1]):
        raise ValueError(f"columns of a product must be between 0 and {shape[1] - 1}")


def _changed(x: Array, n: int) -> None:
    """That an array (n,) can be changed in place."""
    if x.dtype != float or x.shape != (n,) or not x.flags.carray:
        raise ValueError("what is changed in place must be a contiguous array of float64")


@lru_cache
def kernels() -> Kernels | None:
    """The compiled kernels; None where they were not built, or ``HEMIVAR_KERNELS`` is ``none``."""
    if os.environ.get("HEMIVAR_KERNELS", "").strip().lower() == "none":
        return None
    for path in (Path(__file__).with_name(name) for name in _NAMES):
        if not path.is_file():
            continue
        try:
            call = ctypes.CDLL(str(path))
            call.hv_abi.restype = c_int
            if call.hv_abi() != _ABI:
                continue
            for name, (arguments, result) in _FUNCTIONS.items():
                function = getattr(call, name)
                function.argtypes, function.restype = arguments, result
        except (OSError, AttributeError):  # of another machine, or damaged
            continue
        call.hv_set_threads(threads())
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=call.hv_after_fork)
        return Kernels(call)
    return None


def threads() -> int:
    """How many threads the kernels take.

    What ``HEMIVAR_NUM_THREADS`` says, else ``OMP_NUM_THREADS``, else the processors that this process may use.
    """
    for name in ("HEMIVAR_NUM_THREADS", "OMP_NUM_THREADS"):
        wanted = os.environ.get(name, "").split(",")[0].strip()
        if wanted.isascii() and wanted.isdigit() and int(wanted) > 0:
            return min(int(wanted), _MOST)
    return min(cores(), _MOST)
