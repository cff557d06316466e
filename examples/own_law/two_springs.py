"""A normal law that the problem file beside this one names: two springs, the second from a penetration on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws.parameters import positive
from hemivar.laws.parametrised import NamedLaw, columns
from hemivar.laws.piecewise import PiecewiseQuadratic


@dataclass(frozen=True, eq=False)
class TwoSprings(NamedLaw):
    """Pressure ``first * r``, from ``limit`` on with the slope ``second``."""

    first: float = field(metadata=positive("stiffness of the first spring", "force/area/length"))
    second: float = field(default=40.0, metadata=positive("stiffness of both springs", "force/area/length"))
    limit: float = field(default=0.02, metadata=positive("penetration at which the second begins", "length"))
    name: ClassVar[str] = "two-springs"

    def _build(self, values: Mapping[str, Array]) -> PiecewiseQuadratic:
        zero = np.zeros(1)
        knots, slopes = columns(zero, values["limit"]), columns(zero, values["first"], values["second"])
        return PiecewiseQuadratic(knots, slopes, np.zeros((1, 2)), name=self.name)
