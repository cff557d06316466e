"""Cohesive glue that remembers: damage and secant (unloading) law, asked of laws with an effective opening."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import MethodError
from hemivar.laws.vector_law import VectorLaw

__all__ = ["Glue", "glue_of"]


class Glue(VectorLaw):
    """A law with an effective opening, of which :class:`~hemivar.laws.Secant` remembers the largest.

    What it has remembered, ``known``, are arrays (m,): the ``opening`` and the ``stiffness`` from there back to rest.
    """

    @property
    def remembers(self) -> bool:
        return True

    @abstractmethod
    def damaged(self, known: Mapping[str, Array] | None, r: Array) -> dict[str, Array]:
        """What is remembered after it has come to ``r (m, c)``; known is None of intact glue."""

    @abstractmethod
    def unloading(self, known: Mapping[str, Array]) -> VectorLaw:
        """The law along the secant up to the largest opening, and as it is beyond."""

    def unloading_energy(self, known: Mapping[str, Array], r: Array, of_law: Callable[[Array], Array]) -> Array:
        """Energy (m,) that :meth:`unloading` stores at ``r (m, c)``; ``of_law(r)`` is what the law stores."""
        return self.unloading(known).stored_energy(r)

    def spent_by(self, known: Mapping[str, Array]) -> Array:
        """Energy per area (m,) that has been lost since it was intact."""
        opening = known["opening"]
        return np.asarray(self.value(-opening[:, None]) - 0.5 * known["stiffness"] * opening**2)

    def lost_by(self, known: Mapping[str, Array]) -> Array:
        """Share (m,) of its first stiffness that is lost: 0 intact, 1 broken."""
        opening = known["opening"]
        first = self.damaged(None, np.zeros((len(opening), 1)))["stiffness"]
        return np.where(opening > 0.0, 1.0 - known["stiffness"] / first, 0.0)

    def softened(self, known: Mapping[str, Array]) -> BoolArray:
        """Whether it is past its peak, (m,)."""
        return self.past_peak(-known["opening"][:, None])


def glue_of(law: VectorLaw) -> Glue:
    """The law, which must have an effective opening."""
    if isinstance(law, Glue):
        return law
    raise MethodError(
        f"law '{law.name}' has no effective opening to store as an internal variable; leave the memory out, or use "
        f"MixedMode(...)"
    )
