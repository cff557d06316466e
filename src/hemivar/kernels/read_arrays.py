"""Arrays as the compiled kernels read them, of the types and shapes that they must have."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, IntArray

__all__ = ["given", "numbers", "rising"]


def given(name: str, array: Array, shape: tuple[int, ...]) -> Array:
    """A contiguous array of float64 of this shape."""
    found = np.require(array, float, ["C", "A"])
    if found.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, not {found.shape}")
    return found


def numbers(name: str, array: IntArray, shape: tuple[int, ...], end: int | None, least: int = 0) -> IntArray:
    """A contiguous array of int64 of this shape; numbers from ``least`` to below the end, if there is one."""
    own = np.asarray(array)
    if own.shape != shape or own.dtype.kind not in "iu":
        raise ValueError(f"{name} must be integers of shape {shape}, not {own.dtype} of shape {own.shape}")
    found = np.require(own, np.int64, ["C", "A"])
    if end is not None and found.size and not (found.min() >= least and found.max() < end):
        raise ValueError(f"{name} must be from {least} to {end - 1}")
    return found


def rising(name: str, array: IntArray, end: int) -> IntArray:
    """Integers that rise from 0 to the end."""
    found = numbers(name, array, (len(array),), None)
    if not len(found) or found[0] != 0 or found[-1] != end or np.any(np.diff(found) < 0):
        raise ValueError(f"{name} must rise from 0 to {end}")
    return found
