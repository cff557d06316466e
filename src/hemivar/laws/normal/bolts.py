"""The cut through a bolt: a stated tension while it is tightened, then no change of what it was shortened by."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, Parameter
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import PRESSURE, parameter
from hemivar.laws.parametrised import NamedLaw
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["Bolt"]


@named(
    LawKind.NORMAL,
    "bolt",
    "the cut through a bolt: a stated tension while it is tightened, then held as it is",
    "j(r) = -tension r; once it is held j(r) = 0 for r = 0, +inf otherwise",
)
@dataclass(frozen=True, eq=False)
class Bolt(NamedLaw):
    """The cut through a bolt, an interface that was opened or a face: its tension is stated, then it is held.

    While it is tightened both sides of the cut pull with ``tension``, whatever the displacement.  Once it is held the
    normal jump, by which it was shortened, stays what it was, at each contact point; at rest that is zero.  The two
    sides are free to slide along each other.  In load steps :attr:`hemivar.mechanics.Step.bolts` says when; in time
    formulas of ``t`` do, ``tension="500 * min(t, 1)"`` and ``held="max(0, t - 1)"``.

    Parameters
    ----------
    tension : Parameter
        Force per area across the cut, while it is not held.
    held : Parameter
        It is held where this is above 0.
    """

    tension: Parameter = field(
        default=0.0, metadata=parameter("force per area across the cut while it is not held", PRESSURE, 2.0)
    )
    held: Parameter = field(default=0.0, metadata=parameter("it is held where this is above 0", "1", least=0.0))
    name: ClassVar[str] = "bolt"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        tension, held = np.broadcast_arrays(values["tension"], values["held"] > 0.0)
        far, flat = np.where(held, 0.0, np.inf), np.zeros((1, 2))
        zero = np.zeros((1, 1))
        return PiecewiseQuadratic(zero, flat, zero, np.where(held, 0.0, -tension), -far, far, name=self.name)
