"""Arrays as the compiled kernels read them: contiguous, of the types and shapes that they must have."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, IntArray

__all__ = ["given", "numbers", "rising"]


def given(name: str, array: Array, shape: tuple[int, ...]) -> Array:
    """A contiguous array of float64 of this shape."""
    read = np.require(array, float, ["C", "A"])
    if read.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, not {read.shape}")
    return read


def numbers(name: str, array: IntArray, shape: tuple[int, ...], end: int | None, least: int = 0) -> IntArray:
    """A contiguous array of int64 of this shape; numbers from ``least`` to below the end, if there is one."""
    own = np.asarray(array)
    if own.shape != shape or own.dtype.kind not in "iu":
        raise ValueError(f"{name} must be integers of shape {shape}, not {own.dtype} of shape {own.shape}")
    read = np.require(own, np.int64, ["C", "A"])
    if end is not None and read.size and not (read.min() >= least and read.max() < end):
        raise ValueError(f"{name} must be from {least} to {end - 1}")
    return read


def rising(name: str, array: IntArray, end: int) -> IntArray:
    """Integers that rise from 0 to the end."""
    read = numbers(name, array, (len(array),), None)
    if not len(read) or read[0] != 0 or read[-1] != end or np.any(np.diff(read) < 0):
        raise ValueError(f"{name} must rise from 0 to {end}")
    return read
