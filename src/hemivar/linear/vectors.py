"""Distributed vectors, in one piece or in parts on many machines: the sums and norms that all parts answer together.

A vector is an array of the entries that this process has; sums and multiples of vectors are those of NumPy.  Whatever a
method decides by goes through :class:`Vectors`, so that all processes decide alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array

__all__ = ["WHOLE", "Vectors", "Whole"]


class Vectors(Protocol):
    """Sums and maxima over all processes; each of them calls these functions, and gets the same answer."""

    @property
    def alone(self) -> bool:
        """Whether this process has all entries."""

    def total(self, *values: float) -> Array:
        """Sums of numbers that each process has."""

    def largest(self, *values: float) -> Array:
        """Largest of numbers that each process has; nan counts as infinity, for comparisons would lose it."""

    def norms(self, *vectors: Array) -> Array:
        """Euclidean norms of vectors, without overflow or underflow on the way."""

    def lowest(self, value: float) -> tuple[float, bool]:
        """The lowest of numbers that each process has, and whether it is that of this one; of equals the first."""

    def named(self, names: Iterable[str]) -> tuple[str, ...]:
        """The names that any process knows, in the same order on all."""

    def before(self, count: int) -> int:
        """How many of something the processes before this one have, which has ``count`` of it."""


@dataclass(frozen=True)
class Whole:
    """Vectors in one piece."""

    alone = True

    def total(self, *values: float) -> Array:
        return np.asarray(values, dtype=float)

    def largest(self, *values: float) -> Array:
        return np.asarray([math.inf if value != value else value for value in values], dtype=float)

    def norms(self, *vectors: Array) -> Array:
        return np.array([norm(vector) for vector in vectors])

    def lowest(self, value: float) -> tuple[float, bool]:
        return value, True

    def named(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple(names)

    def before(self, count: int) -> int:
        return 0


#: The one of a process that works alone.
WHOLE = Whole()
