"""Products of the matrices of an evolution with vectors: a step needs several of them twice."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.operators import Operator

__all__ = ["Products"]

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

    def stiffness(self, x: Array) -> Array:
        """``K x``."""
        return self._times("stiffness", self._discrete.stiffness, x)

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

    def _times(self, name: str, operator: Operator, x: Array) -> Array:
        first, second = self._known.get(name, _NOTHING)
        if first[0] is x:
            return first[1]
        found = second if second[0] is x else (x, operator.times(x))
        self._known[name] = found, first
        return found[1]
