"""Mode-mixity criteria (Benzeggagh-Kenane, power law): fracture energy of glue from those for opening and for shear.

The mode B is the share of the shear in the energy release rate, ``G_II / (G_I + G_II)``: 0 in opening, 1 in shear.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Self

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray, Parameter
from hemivar.laws.parameters import LINE, field_values, positive

__all__ = ["BenzeggaghKenane", "FractureCriterion", "PowerCriterion"]


@dataclass(frozen=True, eq=False)
class FractureCriterion(ABC):
    """A fracture energy G_c(B), and the effective opening of first damage between those of both pure modes.

    Parameters
    ----------
    opening, shear : Parameter
        G_Ic and G_IIc, > 0 (force per length).
    exponent : Parameter
        > 0.
    """

    opening: Parameter = field(metadata=positive("fracture energy in opening", LINE))
    shear: Parameter = field(metadata=positive("fracture energy in shear", LINE))
    exponent: Parameter = field(metadata=positive("how they mix", "1"))
    name: ClassVar[str] = ""

    def __post_init__(self) -> None:
        if not any(map(callable, vars(self).values())):
            self.values(None)

    def values(self, points: Array | None = None) -> tuple[Array, Array, Array]:
        """G_Ic, G_IIc and the exponent at the contact points, (m or 1,) each."""
        return self._own if points is None else self._at(points)

    @cached_property
    def _own(self) -> tuple[Array, Array, Array]:
        return self._at(None)

    def _at(self, points: Array | None) -> tuple[Array, Array, Array]:
        opening, shear, exponent = field_values(self, points, f"criterion '{self.name}'").values()
        return opening, shear, exponent

    def at(self, points: Array | None) -> Self:
        """The criterion with every parameter evaluated at ``points (m, d)``."""
        return type(self)(*self.values(points))

    def take(self, index: IntArray) -> Self:
        """The criterion at some of the contact points."""
        return type(self)(*(value if value.size == 1 else value[index] for value in self.values()))

    @abstractmethod
    def energy(self, mode: Array) -> tuple[Array, Array]:
        """G_c and its derivative by the mode, of modes that broadcast with (m or 1,)."""

    @abstractmethod
    def onset(self, mode: Array, first: Array, second: Array) -> tuple[Array, Array]:
        """rho of first damage and its derivative by the mode; ``first`` and ``second`` are those of both modes."""


@dataclass(frozen=True, eq=False)
class BenzeggaghKenane(FractureCriterion):
    """``G_c = G_Ic + (G_IIc - G_Ic) B^eta`` (Benzeggagh and Kenane 1996).

    The squares of the openings of first damage are mixed likewise (Turon et al. 2006).
    """

    name: ClassVar[str] = "benzeggagh-kenane"

    def _share(self, mode: Array) -> tuple[Array, Array]:
        eta = self.values()[2]
        with np.errstate(divide="ignore"):
            return mode**eta, eta * mode ** (eta - 1.0)

    def energy(self, mode: Array) -> tuple[Array, Array]:
        opening, shear, _ = self.values()
        (share, rate), apart = self._share(mode), shear - opening
        return opening + apart * share, np.where(apart == 0.0, 0.0, apart * np.where(apart == 0.0, 0.0, rate))

    def onset(self, mode: Array, first: Array, second: Array) -> tuple[Array, Array]:
        share, rate = self._share(mode)
        apart = second**2 - first**2
        rho = np.sqrt(first**2 + apart * share)
        return rho, np.where(apart == 0.0, 0.0, apart * np.where(apart == 0.0, 0.0, rate)) / (2.0 * rho)


@dataclass(frozen=True, eq=False)
class PowerCriterion(FractureCriterion):
    """``(G_I/G_Ic)^p + (G_II/G_IIc)^p = 1``.

    First damage is where the squares of both stresses over their strengths add to 1.
    """

    name: ClassVar[str] = "power"

    def energy(self, mode: Array) -> tuple[Array, Array]:
        opening, shear, p = self.values()
        with np.errstate(divide="ignore"):
            total = (((1.0 - mode) / opening) ** p + (mode / shear) ** p) ** (-1.0 / p)
            rate = (mode / shear) ** (p - 1.0) / shear - ((1.0 - mode) / opening) ** (p - 1.0) / opening
        return total, -(total ** (p + 1.0)) * rate

    def onset(self, mode: Array, first: Array, second: Array) -> tuple[Array, Array]:
        rho = ((1.0 - mode) / first**2 + mode / second**2) ** -0.5
        return rho, -0.5 * rho**3 * (second**-2 - first**-2)
