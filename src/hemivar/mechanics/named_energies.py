"""Stored energies that have a name: Hencky's, Ramberg and Osgood's, and that of locking materials."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.known_keywords import known_fields
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import LARGEST, DataField
from hemivar.mechanics.material_words import BoundsBy, PlaneState, StrainMeasure, strain_measure
from hemivar.mechanics.moduli import Number
from hemivar.mechanics.per_volume import plain_constant
from hemivar.mechanics.stored_energy import InvariantEnergy, Invariants, IsotropicBounds

__all__ = ["Hencky", "Locking", "NamedEnergy", "RambergOsgood"]

#: Steps of Newton's method for the stress of Ramberg and Osgood, which converges from one side.
_STEPS = 100


@dataclass(frozen=True, eq=False)
class NamedEnergy(InvariantEnergy):
    """An isotropic stored energy with constants that are numbers or callables of the place."""

    def __post_init__(self) -> None:
        for name in self.constants:
            object.__setattr__(self, name, plain_constant(getattr(self, name), f"material constant {name}"))
        if self.homogeneous:
            self.at(np.zeros((1, 2)), "")
        super().__post_init__()

    @property
    def constants(self) -> tuple[str, ...]:
        """Names of the attributes that are its constants."""
        raise NotImplementedError

    def stated(self) -> Mapping[str, object]:
        plane = self.plane.value if self._in_plane_stress else None
        return {**{name: getattr(self, name) for name in self.constants}, **self._words, "plane": plane}

    @property
    def _words(self) -> Mapping[str, str]:
        """What is stated by words, beside the plane."""
        return {}

    @property
    def homogeneous(self) -> bool:
        return not any(callable(getattr(self, name)) for name in self.constants)

    @property
    def bounds_by(self) -> BoundsBy:
        return BoundsBy.CLOSED_FORM

    def at(self, points: Array, where: str | None = None) -> tuple[Array, ...]:
        """The constants at points (k, d), each (k,), checked."""
        given = []
        for name in self.constants:
            value = DataField(getattr(self, name), f"material constant {name}").at(points)
            if name == "nu":  # the only one without a unit that may be zero or negative
                self._require((value > -1.0) & (value < 0.5), points, value, name, "must lie between -1 and 0.5", where)
                given.append(value)
                continue
            self._require(value > 0.0, points, value, name, "must be positive", where)
            units = f"must lie between {1.0 / LARGEST:.0e} and {LARGEST:.0e}: take other units"
            self._require((value < LARGEST) & (value > 1.0 / LARGEST), points, value, name, units, where)
            given.append(value)
        return tuple(given)

    def _require(self, ok: BoolArray, points: Array, value: Array, name: str, what: str, where: str | None) -> None:
        if not ok.all():
            bad = int(np.argmin(ok))
            place = f" at x = {points[bad].tolist()}" if where is None else where
            raise ProblemError(f"material constant {name} = {value[bad]:g}{place}; it {what}")


@known_fields
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
    def formula(self) -> str:
        return "sigma = bulk tr(eps) I + 2 shear (q + (1 - q)/sqrt(1 + |dev eps|^2/strain^2)) dev eps, q = softened"

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


@known_fields
@dataclass(frozen=True, eq=False)
class RambergOsgood(NamedEnergy):
    """What :meth:`Material.ramberg_osgood` makes: ``F = k p^2 / 2 + w(t)``, t = |dev eps|, s = |dev sigma| = w'(t).

    Between them ``t = s / (2 G) + (3 offset / (2 E)) (q / yield_stress)^(exponent - 1) s``, von Mises' stress
    ``q = sqrt(3/2) s``. The slope of s falls as t grows, below s / t: its value at ``linear_from`` is the lower bound.
    """

    E: Number
    nu: Number
    yield_stress: Number
    exponent: Number
    offset: Number = 3.0 / 7.0
    linear_from: Number | None = None
    plane: PlaneState = PlaneState.STRAIN

    @property
    def kind(self) -> str:
        return "ramberg-osgood"

    @property
    def formula(self) -> str:
        return "a bar stretches by sigma/E + offset (sigma/E) (sigma/yield_stress)^(exponent - 1)" + (
            "; the tangent falls to zero, since linear_from is not given" if self.linear_from is None else ""
        )

    @property
    def constants(self) -> tuple[str, ...]:
        all_of_them = ("E", "nu", "yield_stress", "exponent", "offset", "linear_from")
        return all_of_them if self.linear_from is not None else all_of_them[:-1]

    def at(self, points: Array, where: str | None = None) -> tuple[Array, ...]:
        given = super().at(points, where)
        exponent = given[3]
        self._require((exponent >= 1.0) & (exponent <= 1e3), points, exponent, "exponent", "must be 1 to 1000", where)
        return given

    def invariants(self, points: Array, p: Array, s: Array) -> Invariants:
        given = self.at(points[:1], "") if self.homogeneous else self.at(points)
        curve = _RambergOsgoodCurve(*given[:5])
        t = np.sqrt(s)
        bend_from = np.minimum(t, given[5]) if self.linear_from is not None else t
        value, secant, slope = curve.at(bend_from)
        beyond = t - bend_from
        value = value + beyond * (secant * bend_from + 0.5 * slope * beyond)
        # where it is linear the stress is `kept + slope t`, so that secant less slope is kept / t
        kept = (secant - slope) * bend_from
        far = beyond > 0.0
        secant = np.where(far, slope + kept / np.where(far, t, 1.0), secant)
        squared = np.where(s > 0.0, s, 1.0)
        bend = np.where(s > 0.0, (slope - secant) / (4.0 * squared), 0.0)
        bulk = given[0] / (3.0 * (1.0 - 2.0 * given[1]))
        return Invariants(
            0.5 * bulk * p**2 + value,
            bulk * p,
            0.5 * secant,
            np.broadcast_to(bulk, p.shape),
            np.zeros(p.shape),
            bend,
        )

    def bounds(self, points: Array) -> IsotropicBounds:
        given = self.at(points)
        bulk, shear = given[0] / (3.0 * (1.0 - 2.0 * given[1])), given[0] / (2.0 * (1.0 + given[1]))
        if self.linear_from is None:
            least = np.where(given[3] > 1.0, 0.0, shear / (1.0 + given[4] * 3.0 * shear / given[0]))
        else:
            least = 0.5 * _RambergOsgoodCurve(*given[:5]).at(given[5])[2]
        largest = np.where(given[3] > 1.0, shear, least)
        return IsotropicBounds(bulk, least, bulk, largest)


class _RambergOsgoodCurve:
    """``t = a y + b y^n`` between t = |dev eps| and von Mises' stress over the yield stress, y; arrays (k,) or (1,)."""

    def __init__(self, young: Array, poisson: Array, yield_stress: Array, exponent: Array, offset: Array) -> None:
        self.unit, self.n = np.sqrt(2.0 / 3.0) * yield_stress, exponent  # |dev sigma| = unit y
        self.a = self.unit * (1.0 + poisson) / young
        self.b = np.sqrt(1.5) * offset * yield_stress / young

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """The stored energy, the stress over t, and the slope of the stress."""
        a, b, n = (np.broadcast_to(one, t.shape) for one in (self.a, self.b, self.n))
        y = np.minimum(t / a, (t / b) ** (1.0 / n))  # beyond the solution: Newton's method comes down to it
        for _ in range(_STEPS):
            more = b * y ** (n - 1.0)
            down = (a * y + more * y - t) / (a + n * more)
            y = np.maximum(y - down, 0.0)
            if (np.abs(down) <= 1e-10 * y).all():  # the next step would be the square of it
                break
        more = b * y ** (n - 1.0)
        value = self.unit * (0.5 * a + n / (n + 1.0) * more) * y**2
        return value, self.unit / (a + more), self.unit / (a + n * more)


@known_fields
@dataclass(frozen=True, eq=False)
class Locking(NamedEnergy):
    """What :meth:`Material.locking` makes: ``F = k p^2 / 2 + mu s + beta dist^2 / 2``.

    The distance to the convex set is ``max(sqrt(s) - e, 0)``, or ``max(sqrt(s + p^2 / 3) - e, 0)`` for the whole
    strain. Half its square has a second derivative between 0 and 1, hence the upper bound; the lower is C itself.

    Attributes
    ----------
    bulk, shear, stiffening, strain : float or callable
        k, mu, beta and e.
    measure : StrainMeasure
    plane : PlaneState
    """

    bulk: Number
    shear: Number
    stiffening: Number
    strain: Number
    measure: StrainMeasure = StrainMeasure.DEVIATOR
    plane: PlaneState = PlaneState.STRAIN

    def __post_init__(self) -> None:
        object.__setattr__(self, "measure", strain_measure(self.measure))
        super().__post_init__()

    @property
    def kind(self) -> str:
        return "locking"

    @property
    def formula(self) -> str:
        size = "|dev eps|" if self._of_deviator else "|eps|"
        return f"sigma = C eps + stiffening (eps - P eps), P the projection on {size} <= strain"

    @property
    def constants(self) -> tuple[str, ...]:
        return ("bulk", "shear", "stiffening", "strain")

    @property
    def _words(self) -> Mapping[str, str]:
        return {} if self._of_deviator else {"measure": self.measure.value}

    @property
    def _of_deviator(self) -> bool:
        return self.measure is StrainMeasure.DEVIATOR

    def invariants(self, points: Array, p: Array, s: Array) -> Invariants:
        bulk, shear, beta, strain = self.at(points[:1], "") if self.homogeneous else self.at(points)
        part = 0.0 if self._of_deviator else 1.0 / 3.0
        size = np.sqrt(s + part * p**2)
        beyond = size > strain
        safe = np.where(beyond, size, strain)
        value = 0.5 * bulk * p**2 + shear * s + 0.5 * beta * (safe - strain) ** 2
        rate = 0.5 * beta * (1.0 - strain / safe)  # by the square of the size
        bend = np.where(beyond, 0.25 * beta * strain / safe**3, 0.0)
        return Invariants(
            value,
            (bulk + 2.0 * part * rate) * p,
            shear + rate,
            bulk + 2.0 * part * rate + (2.0 * part * p) ** 2 * bend,
            2.0 * part * p * bend,
            bend,
        )

    def bounds(self, points: Array) -> IsotropicBounds:
        bulk, shear, beta, _ = self.at(points)
        return IsotropicBounds(bulk, shear, bulk + (0.0 if self._of_deviator else beta / 3.0), shear + 0.5 * beta)
