"""Laws that couple the components of the local displacement, and whose parameters do not depend on the solution."""

from __future__ import annotations

from typing import Self

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws.vector_law import VectorLaw

__all__ = ["CoupledLaw"]


class CoupledLaw(VectorLaw):
    """A law of the whole local displacement that needs no state: it is frozen as it is."""

    @property
    def state_dependent(self) -> bool:
        return False

    def frozen(self, r: Array, lam: Array) -> Self:
        return self

    def frozen_at(self, r: Array) -> Self:
        return self

    @property
    def lipschitz(self) -> Array:
        return np.zeros(1)

    @property
    def lipschitz_sampled(self) -> bool:
        return False
