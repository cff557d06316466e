"""Products of the matrices of an evolution with vectors: a step needs several of them twice."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.operators import Operator

__all__ = ["Products"]

#: Vectors whose norms are known again: load, displacement, velocity and acceleration, those before, and branches.
_NUMBERS = 12
_NOTHING = ((np.zeros(0), np.zeros(0)),) * 2


class Products:
    """Stiffness, viscosity and mass times vectors (n + k,), which nobody changes: the last two of each are known again.

    A vector is known by itself, not by its numbers, so that what is remembered changes no answer.

    Parameters
    ----------
    discrete : DiscreteEvolution
    """

    def __init__(self, discrete: DiscreteEvolution) -> None:
        self._discrete = discrete
        self._known: dict[str, tuple[tuple[Array, Array], tuple[Array, Array]]] = {}
        self._pulled = np.zeros(0), np.zeros(0), np.zeros(0)
        self._norms: list[tuple[Array, float]] = []
        self._maxima: list[tuple[Array, float]] = []

    def stiffness(self, x: Array) -> Array:
        """``K x``."""
        return self._times("stiffness", self._discrete.stiffness, x)

    def pull(self, x: Array, y: Array) -> Array:
        """``K x - K y``."""
        first, second, found = self._pulled
        if first is not x or second is not y:
            found = self.stiffness(x) - self.stiffness(y)
            self._pulled = x, y, found
        return found

    def viscosity(self, v: Array) -> Array:
        """``C v``; there is a viscosity."""
        operator = self._discrete.viscosity
        assert operator is not None
        return self._times("viscosity", operator, v)

    def mass(self, v: Array) -> Array:
        """``M v``; there is a mass."""
        operator = self._discrete.mass
        assert operator is not None
        return self._times("mass", operator, v)

    def size(self, parts: Sequence[tuple[float, Array, Array]], enough: float) -> float:
        """Sum of norms of ``factor sums x``, entry by entry: how far rounding may take products with matrices.

        More than that, and quicker, if this is not above ``enough``: the largest of the sums of rows times the norm of
        x.

        Parameters
        ----------
        parts : sequence of (float, array (n,), array (n,))
            Factor, sums of the rows of a matrix, and x.
        enough : float
        """
        more = sum(factor * self._largest(sums) * self.norm(x) for factor, sums, x in parts)
        return more if more <= enough else sum(factor * norm(sums * x) for factor, sums, x in parts)

    def norm(self, x: Array) -> float:
        """Euclidean norm of a vector that nobody changes."""
        return self._known_number(self._norms, x, norm)

    def _largest(self, sums: Array) -> float:
        return self._known_number(self._maxima, sums, lambda x: float(x.max(initial=0.0)))

    @staticmethod
    def _known_number(known: list[tuple[Array, float]], x: Array, make: Callable[[Array], float]) -> float:
        for vector, number in known:
            if vector is x:
                return number
        found = make(x)
        known.insert(0, (x, found))
        del known[_NUMBERS:]
        return found

    def _times(self, name: str, operator: Operator, x: Array) -> Array:
        first, second = self._known.get(name, _NOTHING)
        if first[0] is x:
            return first[1]
        found = second if second[0] is x else (x, operator.times(x))
        self._known[name] = found, first
        return found[1]
