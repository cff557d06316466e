"""What a material of one kind has beside its elasticity: density, viscosity, and branches that relax."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import LARGEST, DataField
from hemivar.mechanics.material import Material, no_matrices
from hemivar.mechanics.material_description import MaterialDescription, described_point
from hemivar.mechanics.moduli import Branch, Moduli, Number, moduli
from hemivar.mechanics.per_volume import plain_constant

__all__ = ["SingleMaterial"]


@dataclass(frozen=True, eq=False)
class SingleMaterial(Material):
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

    density: Number | None = field(default=None, kw_only=True)
    viscosity: Moduli | None = field(default=None, kw_only=True)
    branches: tuple[Branch, ...] = field(default=(), kw_only=True)

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
        return 2 if self._in_plane_stress or self.axisymmetric else 3

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

    def __post_init__(self) -> None:
        if self.density is not None:
            object.__setattr__(self, "density", plain_constant(self.density, "density"))
            if not callable(self.density):
                _check_density(np.full(1, self.density), np.zeros((1, 2)), "")
        if self.viscosity is not None:
            object.__setattr__(self, "viscosity", moduli(self.viscosity, "viscosity"))
        branches = (self.branches,) if isinstance(self.branches, Branch) else self.branches
        if not isinstance(branches, Sequence) or not all(isinstance(branch, Branch) for branch in branches):
            raise ProblemError(
                f"branches is {described(self.branches)}; give a list of Branch(lame=(lam, mu), time=T) or the like"
            )
        object.__setattr__(self, "branches", tuple(branches))

    @property
    def _in_plane_stress(self) -> bool:
        return False

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
    if not (density > 0.0).all():
        bad = int(np.flatnonzero(~(density > 0.0))[0])
        place = f" at x = {points[bad].tolist()}" if where is None else where
        raise ProblemError(f"density = {density[bad]:g}{place}; it must be positive")
    if not ((density < LARGEST) & (density > 1.0 / LARGEST)).all():
        bad = int(np.argmax(np.abs(np.log(density))))
        raise ProblemError(
            f"density = {density[bad]:g}; it must lie between {1.0 / LARGEST:.0e} and {LARGEST:.0e}: take other units"
        )
