"""Stored energies that have a name: Hencky's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import LARGEST, evaluate_scalar
from hemivar.mechanics.instants import refuse_time
from hemivar.mechanics.material import BoundsBy, PlaneState
from hemivar.mechanics.moduli import Number
from hemivar.mechanics.stored_energy import InvariantEnergy, Invariants, IsotropicBounds

__all__ = ["Hencky", "NamedEnergy"]


@dataclass(frozen=True, eq=False)
class NamedEnergy(InvariantEnergy):
    """An isotropic stored energy with constants that are numbers or callables of the place."""

    def __post_init__(self) -> None:
        for name in self.constants:
            refuse_time(getattr(self, name), f"material constant {name}")
        if self.homogeneous:
            self.at(np.zeros((1, 2)), "")
        super().__post_init__()

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of the attributes that are its constants."""
        raise NotImplementedError

    @property
    def homogeneous(self) -> bool:
        return not any(callable(getattr(self, name)) for name in self.constants)

    @property
    def bounds_by(self) -> BoundsBy:
        return BoundsBy.CLOSED_FORM

    def at(self, points: Array, where: str | None = None) -> tuple[Array, ...]:
        """The constants at points (k, d), each (k,), checked.

        Raises
        ------
        ProblemError
            If one is not what it must be; the message names the point.
        """
        given = []
        for name in self.constants:
            value = evaluate_scalar(getattr(self, name), points, f"material constant {name}")
            self._require((value > 0.0), points, value, name, "must be positive", where)
            units = f"must lie between {1.0 / LARGEST:.0e} and {LARGEST:.0e}: take other units"
            self._require((value < LARGEST) & (value > 1.0 / LARGEST), points, value, name, units, where)
            given.append(value)
        return tuple(given)

    def _require(self, ok: BoolArray, points: Array, value: Array, name: str, what: str, where: str | None) -> None:
        if not ok.all():
            bad = int(np.argmin(ok))
            place = f" at x = {points[bad].tolist()}" if where is None else where
            raise ProblemError(f"material constant {name} = {value[bad]:g}{place}; it {what}")


@dataclass(frozen=True, eq=False)
class Hencky(NamedEnergy):
    """What :meth:`Material.hencky` makes: ``F = k p^2 / 2 + mu0 (q s + 2 (1 - q) e0^2 (sqrt(1 + s / e0^2) - 1))``.

    The slope of ``t -> phi(t^2) t`` with ``phi(s) = 2 mu0 (q + (1 - q) / sqrt(1 + s / e0^2))``, t = |dev eps|, lies in
    ``[2 mu0 q, 2 mu0]``, and so does phi: these are the bounds of the shear.

    Attributes
    ----------
    bulk, shear, softened, strain : float or callable
        k, mu0, q and e0.
    plane : PlaneState
    """

    bulk: Number
    shear: Number
    softened: Number
    strain: Number
    plane: PlaneState = PlaneState.STRAIN

    @property
    def kind(self) -> str:
        return "hencky"

    @property
    def constants(self) -> tuple[str, ...]:
        return ("bulk", "shear", "softened", "strain")

    def at(self, points: Array, where: str | None = None) -> tuple[Array, ...]:
        given = super().at(points, where)
        self._require(given[2] <= 1.0, points, given[2], "softened", "must not exceed 1", where)
        return given

    def invariants(self, points: Array, p: Array, s: Array) -> Invariants:
        bulk, shear, softened, strain = self.at(points[:1], "") if self.homogeneous else self.at(points)
        root = np.sqrt(1.0 + s / strain**2)
        lost = 1.0 - softened
        value = 0.5 * bulk * p**2 + shear * (softened * s + 2.0 * lost * s / (root + 1.0))
        slope = shear * (softened + lost / root)
        bend = -0.5 * shear * lost / (strain**2 * root**3)
        return Invariants(value, bulk * p, slope, np.broadcast_to(bulk, p.shape), np.zeros(p.shape), bend)

    def bounds(self, points: Array) -> IsotropicBounds:
        bulk, shear, softened, _ = self.at(points)
        return IsotropicBounds(bulk, softened * shear, bulk, shear)
