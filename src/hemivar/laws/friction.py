"""Friction laws: radial in the slip vector, h_tau j_tau(|u_tau|), the same in two and three dimensions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from hemivar._typing import Array, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.base import Superpotential
from hemivar.laws.bounds import StateBound
from hemivar.laws.parameters import evaluate
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.portable import Portable

__all__ = ["ABSOLUTE_VALUE", "Friction", "NoFriction", "Tresca"]

#: j(r) = |r|, the profile of Tresca's law.
ABSOLUTE_VALUE = PiecewiseQuadratic(
    np.zeros((1, 1)), np.zeros((1, 2)), np.full((1, 1), 2.0), start=-1.0, name="absolute value"
)


@dataclass(frozen=True, eq=False)
class Friction(Portable):
    """Friction h_tau j_tau(|u_tau|).

    Parameters
    ----------
    bound : Parameter or StateBound
        Friction bound h_tau >= 0 (force per area), or one that depends on penetration or pressure.
    profile : Superpotential
        Even scalar law j_tau, extended to the whole line by j_tau(-r) = j_tau(r).
    """

    bound: Parameter | StateBound
    profile: Superpotential = ABSOLUTE_VALUE

    def __post_init__(self) -> None:
        if not isinstance(self.profile, Superpotential):
            raise ProblemError(f"the profile of a friction law must be a superpotential, not {self.profile!r}")

    def _stated(self) -> dict[str, Any]:
        state = super()._stated()
        if self.profile is ABSOLUTE_VALUE:  # the same object wherever the law arrives
            del state["profile"]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        super().__setstate__({"profile": ABSOLUTE_VALUE} | state)

    @property
    def name(self) -> str:
        """Name used in messages and tables."""
        return "tresca" if self.profile is ABSOLUTE_VALUE else self.profile.name

    def at(self, points: Array | None) -> Self:
        """The law with bound and profile evaluated at ``points (m, d)``."""
        bound: Array | StateBound
        if isinstance(self.bound, StateBound):
            bound = self.bound.at(points)
        else:
            bound = evaluate(self.bound, points, f"bound of friction law '{self.name}'", 0.0)
        return replace(self, bound=bound, profile=self.profile.at(points))

    @property
    def state_dependent(self) -> bool:
        """Whether the bound depends on penetration or pressure."""
        return isinstance(self.bound, StateBound)

    def frozen(self, penetration: Array, pressure: Array) -> Self:
        """The law with the bound it has in a state, arrays (m,)."""
        if not isinstance(self.bound, StateBound):
            return self
        return replace(self, bound=self.bound.value(penetration, pressure))

    def take(self, index: IntArray) -> Self:
        """The law, with resolved parameters, at some of the contact points."""
        bound: Array | StateBound
        if isinstance(self.bound, StateBound):
            bound = self.bound.take(index)
        else:
            bound = self.bounds if self.bounds.size == 1 else self.bounds[index]
        return replace(self, bound=bound, profile=self.profile.take(index))

    @property
    def bounds(self) -> Array:
        """Values of the friction bound, shape (1,) or (m,), for resolved parameters.

        Raises
        ------
        ProblemError
            If the bound depends on the state.
        """
        if isinstance(self.bound, StateBound):
            raise ProblemError(
                f"the bound of friction law '{self.name}' depends on penetration or pressure: evaluate the law at a "
                f"state first, law.frozen(r, lam)"
            )
        return evaluate(self.bound, None, f"bound of friction law '{self.name}'", 0.0)

    @property
    def radial(self) -> Superpotential:
        """The even scalar law h_tau j_tau, for resolved parameters."""
        return self.profile.scaled(self.bounds)


def Tresca(bound: Parameter | StateBound) -> Friction:  # noqa: N802 - a law, named as the others are
    """Tresca's law: friction at most ``bound``, against the slip once it slips (j_tau = |.|)."""
    return Friction(bound)


def NoFriction() -> Friction:  # noqa: N802 - a law, named as the others are
    """No friction."""
    return Friction(0.0)
