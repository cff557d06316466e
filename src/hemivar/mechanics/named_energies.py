"""Stored energies that have a name: Hencky's, Ramberg and Osgood's, and that of locking materials."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.known_keywords import known_fields
from hemivar.basics.types import Array
from hemivar.laws.named import LawKind, named
from hemivar.mechanics.material_words import MEASURE, PLANE_OF_ENERGY, BoundsBy, PlaneState, StrainMeasure
from hemivar.mechanics.moduli import Number
from hemivar.mechanics.per_volume import constant
from hemivar.mechanics.single_material import MaterialOfConstants
from hemivar.mechanics.stored_energy import STEPS, InvariantEnergy, Invariants, IsotropicBounds

__all__ = ["Hencky", "Locking", "NamedEnergy", "RambergOsgood"]

_BULK = constant("bulk modulus", example=6.5)


@dataclass(frozen=True, eq=False)
class NamedEnergy(MaterialOfConstants, InvariantEnergy):
    """An isotropic stored energy with constants that are numbers or callables of the place."""

    @property
    def bounds_by(self) -> BoundsBy:
        return BoundsBy.CLOSED_FORM


@named(
    LawKind.MATERIAL,
    "hencky",
    "elastic in volume, with a shear modulus that softens as the strain grows (deformation theory)",
    "sigma = bulk tr(eps) I + 2 shear (q + (1 - q)/sqrt(1 + |dev eps|^2/strain^2)) dev eps, q = softened",
)
@known_fields
@dataclass(frozen=True, eq=False)
class Hencky(NamedEnergy):
    """What :meth:`Material.hencky` makes: ``F = k p^2 / 2 + mu0 (q s + 2 (1 - q) e0^2 (sqrt(1 + s / e0^2) - 1))``.

    The slope of ``t -> phi(t^2) t`` with ``phi(s) = 2 mu0 (q + (1 - q) / sqrt(1 + s / e0^2))``, t = |dev eps|, lies in
    ``[2 mu0 q, 2 mu0]``, and so does phi: these are the bounds of the shear.
    """

    bulk: Number = field(metadata=_BULK)
    shear: Number = field(metadata=constant("shear modulus at small strain", example=4.0))
    softened: Number = field(
        metadata=constant("part of the shear modulus left at large strain, at most 1", "1", most=1.0, example=0.25)
    )
    strain: Number = field(metadata=constant("size of the deviator |dev eps| at which it softens", "1", example=0.05))
    plane: PlaneState = field(default=PlaneState.STRAIN, metadata=PLANE_OF_ENERGY)

    kind = "hencky"
    formula = "sigma = bulk tr(eps) I + 2 shear (q + (1 - q)/sqrt(1 + |dev eps|^2/strain^2)) dev eps, q = softened"

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


@named(
    LawKind.MATERIAL,
    "ramberg-osgood",
    "metal in the deformation theory of plasticity, with von Mises' stress",
    "a bar stretches by sigma/young + offset (sigma/young) (sigma/yield_stress)^(exponent - 1)",
)
@known_fields
@dataclass(frozen=True, eq=False)
class RambergOsgood(NamedEnergy):
    """What :meth:`Material.ramberg_osgood` makes: ``F = k p^2 / 2 + w(t)``, t = |dev eps|, s = |dev sigma| = w'(t).

    Between them ``t = s / (2 G) + (3 offset / (2 E)) (q / yield_stress)^(exponent - 1) s``, von Mises' stress
    ``q = sqrt(3/2) s``. The slope of s falls as t grows, below s / t: its value at ``linear_from`` is the lower bound.
    """

    E: Number = field(metadata=constant("Young's modulus at small strain", key="young", example=200e3))
    nu: Number = field(
        metadata=constant("Poisson's ratio at small strain", "1", key="poisson", example=0.3, above=-1.0, below=0.5)
    )
    yield_stress: Number = field(metadata=constant("yield stress", example=400.0))
    exponent: Number = field(
        metadata=constant("of the stress; 5 to 20 for metals", "1", least=1.0, most=1e3, example=5.0)
    )
    offset: Number = field(default=3.0 / 7.0, metadata=constant("plastic over elastic strain at the yield stress", "1"))
    linear_from: Number | None = field(
        default=None,
        metadata=constant(
            "|dev eps| from which on the stress grows linearly; left out: no bound holds", "1", example=0.02
        ),
    )
    plane: PlaneState = field(default=PlaneState.STRAIN, metadata=PLANE_OF_ENERGY)

    kind = "ramberg-osgood"

    @property
    def formula(self) -> str:
        return "a bar stretches by sigma/E + offset (sigma/E) (sigma/yield_stress)^(exponent - 1)" + (
            "; the tangent falls to zero, because linear_from is not given" if self.linear_from is None else ""
        )

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
        for _ in range(STEPS):
            more = b * y ** (n - 1.0)
            down = (a * y + more * y - t) / (a + n * more)
            y = np.maximum(y - down, 0.0)
            if (np.abs(down) <= 1e-10 * y).all():  # the next step would be the square of it
                break
        more = b * y ** (n - 1.0)
        value = self.unit * (0.5 * a + n / (n + 1.0) * more) * y**2
        return value, self.unit / (a + more), self.unit / (a + n * more)


@named(
    LawKind.MATERIAL,
    "locking",
    "elastic with projection on a convex set of strains, beyond which it stiffens",
    "sigma = C eps + stiffening (eps - P eps), P the projection on |dev eps| <= strain",
)
@known_fields
@dataclass(frozen=True, eq=False)
class Locking(NamedEnergy):
    """What :meth:`Material.locking` makes: ``F = k p^2 / 2 + mu s + beta dist^2 / 2``.

    The distance to the convex set is ``max(sqrt(s) - e, 0)``, or ``max(sqrt(s + p^2 / 3) - e, 0)`` for the whole
    strain. Half its square has a second derivative between 0 and 1, hence the upper bound; the lower is C itself.
    """

    bulk: Number = field(metadata=_BULK)
    shear: Number = field(metadata=constant("shear modulus", example=4.0))
    stiffening: Number = field(metadata=constant("stiffness added beyond the set", example=20.0))
    strain: Number = field(metadata=constant("size of the set", "1", example=0.03))
    measure: StrainMeasure = field(default=StrainMeasure.DEVIATOR, metadata=MEASURE)
    plane: PlaneState = field(default=PlaneState.STRAIN, metadata=PLANE_OF_ENERGY)

    kind = "locking"

    @property
    def formula(self) -> str:
        size = "|dev eps|" if self._of_deviator else "|eps|"
        return f"sigma = C eps + stiffening (eps - P eps), P the projection on {size} <= strain"

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
