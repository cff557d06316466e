"""Density, Kelvin-Voigt viscosity and Maxwell branches: what a material of one kind has beside its elasticity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.arrays import LARGEST
from hemivar.basics.stated import CheckedFields, Form, Stated, kept, stated_fields
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import DataField, require
from hemivar.mechanics.material import Material, no_matrices
from hemivar.mechanics.material_description import MaterialDescription, described_point
from hemivar.mechanics.material_words import PlaneState
from hemivar.mechanics.moduli import Branch, Moduli, Number, moduli
from hemivar.mechanics.per_volume import plain_constant

__all__ = ["IN_TIME", "MaterialOfConstants", "SingleMaterial"]

#: The metadata of what materials have beside their elasticity.
IN_TIME = "in time"
_IN_RANGE = f"must lie between {1.0 / LARGEST:.0e} and {LARGEST:.0e}"


def _density(value: object, name: str) -> Number:
    density = plain_constant(value, name)
    if not callable(density):
        _check_density(np.full(1, density), np.zeros((1, 2)), "")
    return density  # type: ignore[return-value]


def _branches(given: object, name: str) -> tuple[Branch, ...]:
    branches = (given,) if isinstance(given, Branch) else given
    if not isinstance(branches, Sequence) or not all(isinstance(branch, Branch) for branch in branches):
        raise ProblemError(f"{name} is {described(given)}; give a list of Branch(lame=(lam, mu), time=T) or the like")
    return tuple(branches)


@dataclass(frozen=True, eq=False)
class SingleMaterial(CheckedFields, Material):
    """A material of one kind: what it has of density, viscosity and branches.

    Attributes
    ----------
    density : float, callable or None
        Mass per volume, of motion.
    viscosity : Moduli or None
        Of a force that follows the rate of the strain.
    branches : tuple of Branch
        What relaxes.
    """

    density: Number | None = field(
        default=None, kw_only=True, metadata=kept(_density) | {IN_TIME: Stated(Form.QUANTITY, above=0.0)}
    )
    viscosity: Moduli | None = field(default=None, kw_only=True, metadata=kept(moduli) | {IN_TIME: Stated(Form.OWN)})
    branches: tuple[Branch, ...] = field(
        default=(), kw_only=True, metadata=kept(_branches) | {IN_TIME: Stated(Form.OWN)}
    )

    @property
    def kind(self) -> str:
        """Its name in files, lists and messages."""
        raise NotImplementedError

    @property
    def formula(self) -> str:
        """Its stress or its stored energy, in words of its constants."""
        raise NotImplementedError

    def stated(self) -> Mapping[str, object]:
        """Its constants by name: numbers, callables, texts or words."""
        raise NotImplementedError

    @property
    def _natural_dim(self) -> int:
        """2 for a material of the plane only, else 3."""
        return 3 if getattr(self, "plane", PlaneState.STRAIN) is PlaneState.STRAIN else 2

    def describe(self, point: Sequence[float] | None = None) -> MaterialDescription:
        at = described_point(point, self._natural_dim)
        known = point is not None or self.homogeneous
        constants = {
            name: _text(value, at if known else None, name)
            for name, value in self.stated().items()
            if value is not None
        }
        if not known:
            return MaterialDescription(self.kind, self.formula, constants, self.linear)
        lower, upper = np.array(self.lower_tensor(at)[0]), np.array(self.upper_tensor(at)[0])
        return MaterialDescription(
            self.kind, self.formula, constants, self.linear, lower, upper, self.bounds_by, self.reach
        )

    @property
    def _in_plane_stress(self) -> bool:
        return getattr(self, "plane", None) is PlaneState.STRESS

    @property
    def inert(self) -> bool:
        return self.density is not None

    @property
    def viscous(self) -> bool:
        return self.viscosity is not None

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        return tuple(sorted({branch.time for branch in self.branches}))

    def _springs(self, number: int) -> list[Moduli]:
        time = self.relaxation_times[number]
        return [branch.moduli for branch in self.branches if branch.time == time]

    def density_at(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array | None:
        if self.density is None:
            return None
        density = DataField(self.density, "density").at(points)
        _check_density(density, points, None)
        return density

    def viscosity_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return no_matrices(points) if self.viscosity is None else self.viscosity.at(points, self._in_plane_stress)

    def branch_tensor(self, number: int, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        springs = [spring.at(points, self._in_plane_stress) for spring in self._springs(number)]
        return springs[0] if len(springs) == 1 else np.sum(springs, axis=0)

    def homogeneous_in(self, viscous: bool, numbers: Sequence[int] = ()) -> bool:
        parts = [spring for number in numbers for spring in self._springs(number)]
        parts += [self.viscosity] if viscous and self.viscosity is not None else []
        return all(part.homogeneous for part in parts)


def _text(value: object, at: Array | None, name: str) -> str:
    """A constant in a description: a number, a word, or a formula; its value where it is evaluated."""
    if isinstance(value, str):
        return value
    if callable(value) and at is None:
        return str(getattr(value, "text", "varies"))
    return f"{DataField(value, name).at(at if at is not None else np.zeros((1, 3)))[0]:.6g}"


def _check_density(density: Array, points: Array, where: str | None) -> None:
    require(density > 0.0, points, density, "density", "must be positive", where)
    in_range = (density < LARGEST) & (density > 1.0 / LARGEST)
    require(in_range, points, density, "density", f"{_IN_RANGE}: take other units", where)


@dataclass(frozen=True, eq=False)
class MaterialOfConstants(SingleMaterial):
    """A material whose stated fields are numbers or callables of the place, and words."""

    units: ClassVar[str] = "take other units"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.homogeneous:
            self.at(np.zeros((1, 2)), "")

    @property
    def constants(self) -> dict[str, Stated]:
        """Names of the fields that are its constants, but for those left out, and what is said of them."""
        named = {one.name: one.metadata["stated"] for one in fields(self) if "stated" in one.metadata}
        return {
            name: meta for name, meta in named.items() if meta.form is Form.QUANTITY and getattr(self, name) is not None
        }

    def stated(self) -> Mapping[str, object]:
        words = [one for one, meta in stated_fields(self).values() if meta.form is Form.TEXT]
        given = {one.name: getattr(self, one.name).value for one in words if getattr(self, one.name) != one.default}
        return {name: getattr(self, name) for name in self.constants} | given

    @property
    def homogeneous(self) -> bool:
        return not any(callable(getattr(self, name)) for name in self.constants)

    def at(self, points: Array, where: str | None = None) -> tuple[Array, ...]:
        """The constants at points (k, d), each (k,), checked."""
        values = []
        for name, stated in self.constants.items():
            what = f"material constant {name}"
            value = DataField(getattr(self, name), what).at(points)
            values.append(value)
            if stated.above is not None and stated.below is not None:
                inside = (value > stated.above) & (value < stated.below)
                require(inside, points, value, what, f"must lie between {stated.above:g} and {stated.below:g}", where)
                continue
            least, most = stated.least, np.inf if stated.most is None else stated.most
            if least is None:
                require(value > 0.0, points, value, what, "must be positive", where)
                in_range = (value < LARGEST) & (value > 1.0 / LARGEST)
                require(in_range, points, value, what, f"{_IN_RANGE}: {self.units}", where)
            limits = f"not exceed {most:g}" if least is None else f"be {least:g} to {most:g}"
            require((value <= most) & (value >= (least or 0.0)), points, value, what, f"must {limits}", where)
        return tuple(values)
