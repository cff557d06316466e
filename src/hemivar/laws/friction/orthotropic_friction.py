"""Friction that depends on the direction of the slip: an ellipse of tractions with given axes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.friction.friction_law import Friction
from hemivar.laws.friction.profiles import ABSOLUTE_VALUE
from hemivar.laws.parameters import evaluate
from hemivar.laws.superpotential import Superpotential

__all__ = ["OrthotropicFriction"]


@dataclass(frozen=True, eq=False)
class OrthotropicFriction(Friction):
    """Friction at most ``bound`` along an axis of the surface and ``ratio * bound`` across it, in space.

    ``j_tau(s) = bound sqrt(s_1^2 + ratio^2 s_2^2)`` with the slip s_1 along the axis and s_2 across it: the friction
    lies in an ellipse, and slip is normal to it (associated).

    Parameters
    ----------
    bound : Parameter or StateBound
        Friction bound along the axis, >= 0 (force per area); ``CoulombBound(mu)`` for Coulomb's law.
    ratio : Parameter
        Bound across the axis over that along it, > 0.
    axis : sequence of float, shape (3,)
        A direction; its projection on the surface is the axis.

    Raises
    ------
    ProblemError
        The axis is no direction, or the ratio is not positive.
    """

    profile: Superpotential = field(default=ABSOLUTE_VALUE, init=False)
    ratio: Parameter = 1.0
    axis: Sequence[float] = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        axis = real_array(self.axis, "axis of the orthotropic friction", 1)
        if axis.shape != (3,) or not np.abs(axis).max() > 0.0:
            raise ProblemError(
                f"axis of the orthotropic friction is {axis.tolist()}; give a direction in space, such as (1, 0, 0)"
            )
        object.__setattr__(self, "axis", tuple(axis.tolist()))
        if not callable(self.ratio):
            self._ratio_at(None)

    def _ratio_at(self, points: Array | None) -> Array:
        ratio = evaluate(self.ratio, points, "ratio of the orthotropic friction")
        if (ratio <= 0.0).any():
            raise ProblemError(
                f"ratio of the orthotropic friction is {ratio.min():g}; it must be positive: the bound across the axis "
                "over that along it"
            )
        return ratio

    @property
    def name(self) -> str:
        return "orthotropic"

    @property
    def stated(self) -> Mapping[str, object]:
        """The law by its name and parameters, the bound apart, as problem files have it."""
        return {"law": self.name, "ratio": self.ratio, "axis": self.axis}

    @property
    def ratios(self) -> Array:
        """Values of the ratio, (m or 1,), for resolved parameters."""
        return self._ratio_at(None)

    def at(self, points: Array | None) -> Self:
        return replace(self, bound=Friction(self.bound).at(points).bound, ratio=self._ratio_at(points))

    def take(self, index: IntArray) -> Self:
        ratio = self.ratios
        bound = Friction(self.bound).take(index).bound
        return replace(self, bound=bound, ratio=ratio if ratio.size == 1 else ratio[index])
