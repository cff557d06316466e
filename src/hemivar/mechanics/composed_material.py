"""Materials made of others: one in each region, parallel sums, and the linear lower bound of another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import described, quoted
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.material import Material, no_matrices
from hemivar.mechanics.material_description import MaterialDescription
from hemivar.mechanics.material_words import BoundsBy, ScalarKind
from hemivar.mechanics.per_volume import Regional, refuse_uncovered

__all__ = ["ByRegion", "LowerElasticity", "lower_elasticity"]


@dataclass(frozen=True, eq=False)
class ByRegion(Material):
    """What :meth:`Material.by_region` makes."""

    parts: Mapping[str, Material]

    def __post_init__(self) -> None:
        if not isinstance(self.parts, Mapping):
            raise ProblemError(f"by_region takes a mapping of region names to materials, not {described(self.parts)}")
        object.__setattr__(self, "parts", MappingProxyType(dict(self.parts)))
        if not self.parts:
            raise ProblemError("Material.by_region needs at least one region")
        for name, part in self.parts.items():
            if not isinstance(part, Material):
                raise ProblemError(
                    f"region '{name}': {quoted(part)} is not a Material; use Material.lame(...) or the like"
                )
            if part.scalar:
                raise ProblemError(
                    f"region '{name}': a material of one component takes its regions itself; give "
                    "Material.gradient({'region': ...})"
                )
        round_ones = [name for name, part in self.parts.items() if part.axisymmetric]
        if 0 < len(round_ones) < len(self.parts):
            raise ProblemError(
                f"the material of region '{round_ones[0]}' is axisymmetric, those of other regions are not; write "
                "plane = 'axisymmetric' in every region or in none"
            )
        light = [name for name, part in self.parts.items() if not part.inert]
        if 0 < len(light) < len(self.parts):
            raise ProblemError(
                f"the material of region '{light[0]}' has no density, those of other regions have one; give a density "
                "in every region or in none"
            )

    @property
    def uniform(self) -> bool:
        return all(part.uniform for part in self.parts.values())

    def _masks(self, points: Array, regions: Mapping[str, BoolArray] | None) -> dict[str, BoolArray]:
        available = dict(regions or {})
        for name in self.parts:
            if name not in available:
                raise ProblemError(
                    f"the material names region '{name}', which the mesh does not have; it has: "
                    f"{', '.join(sorted(available)) or 'none'}"
                )
        masks = {name: np.asarray(available[name], dtype=bool) for name in self.parts}
        refuse_uncovered(masks, points, "that the material names", "body")
        return masks

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        size = points.shape[1] * (points.shape[1] + 1) // 2
        result = np.empty((len(points), size, size))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].stiffness_tensor(points[mask], inner)
        return result

    @property
    def axisymmetric(self) -> bool:
        return all(part.axisymmetric for part in self.parts.values())

    def hoop_row(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        result = np.empty((len(points), 4))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].hoop_row(points[mask], inner)
        return result

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        result = np.empty(len(points))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].out_of_plane_stress(points[mask], strain[mask], inner)
        return result

    def stiffness_across(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        result = np.empty(len(points))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].stiffness_across(points[mask], inner)
        return result

    @property
    def linear(self) -> bool:
        return all(part.linear for part in self.parts.values())

    @property
    def bounds_by(self) -> BoundsBy:
        return _least_certain(part.bounds_by for part in self.parts.values())

    @property
    def reach(self) -> float:
        return min(part.reach for part in self.parts.values())

    def describe(self, point: Sequence[float] | None = None) -> MaterialDescription:
        parts = {name: part.describe(point) for name, part in self.parts.items()}
        return MaterialDescription("materials by region", linear=self.linear, parts=parts)

    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        result = np.empty(len(points))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].energy(points[mask], strain[mask], inner)
        return result

    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        result = np.empty(strain.shape)
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].stress(points[mask], strain[mask], inner)
        return result

    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        result = np.empty((*strain.shape, strain.shape[1]))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].tangent(points[mask], strain[mask], inner)
        return result

    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        result = np.array(no_matrices(points))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].lower_tensor(points[mask], inner)
        return result

    def upper_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        result = np.array(no_matrices(points))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].upper_tensor(points[mask], inner)
        return result

    @property
    def inert(self) -> bool:
        return all(part.inert for part in self.parts.values())

    @property
    def viscous(self) -> bool:
        return any(part.viscous for part in self.parts.values())

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        return tuple(sorted({time for part in self.parts.values() for time in part.relaxation_times}))

    def density_at(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array | None:
        if not self.inert:
            return None
        result = np.empty(len(points))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].density_at(points[mask], inner)
        return result

    def viscosity_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        result = np.array(no_matrices(points))
        for name, mask, inner in self._split(points, regions):
            result[mask] = self.parts[name].viscosity_tensor(points[mask], inner)
        return result

    def branch_tensor(self, number: int, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        time = self.relaxation_times[number]
        result = np.array(no_matrices(points))
        for name, mask, inner in self._split(points, regions):
            part = self.parts[name]
            if time in part.relaxation_times:
                result[mask] = part.branch_tensor(part.relaxation_times.index(time), points[mask], inner)
        return result

    def homogeneous_in(self, viscous: bool, numbers: Sequence[int] = ()) -> bool:
        return False

    def _split(
        self, points: Array, regions: Mapping[str, BoolArray] | None
    ) -> Iterator[tuple[str, BoolArray, dict[str, BoolArray]]]:
        """The parts that have points: name, which points, and the regions there."""
        for name, mask in self._masks(points, regions).items():
            if mask.any():
                yield name, mask, {key: value[mask] for key, value in (regions or {}).items()}


@dataclass(frozen=True, eq=False)
class LowerElasticity(Material):
    """The linear elastic material of ``C_low``, the tensor below the tangent of another one at every strain."""

    material: Material

    @property
    def scalar(self) -> ScalarKind | None:
        return self.material.scalar

    @property
    def capacity(self) -> Regional | None:
        return self.material.capacity

    @property
    def homogeneous(self) -> bool:
        return self.material.homogeneous

    @property
    def uniform(self) -> bool:
        return self.material.uniform

    @property
    def bounds_by(self) -> BoundsBy:
        return self.material.bounds_by

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        tensors = self.material.lower_tensor(points, regions)
        at = tensors[:1] if self.homogeneous else tensors
        zero = ~(np.linalg.eigvalsh(at)[:, 0] > 1e-14 * np.abs(at).max(axis=(1, 2)))
        if zero.any():
            point = points[int(zero.argmax())].tolist()
            raise ProblemError(
                f"the stiffness of the material has no known lower bound at x = {point}, so margins and distances "
                f"are not available; give a material whose stress grows at every strain"
            )
        return tensors

    @property
    def reach(self) -> float:
        return self.material.reach

    @property
    def inert(self) -> bool:
        return self.material.inert

    @property
    def viscous(self) -> bool:
        return self.material.viscous

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        return self.material.relaxation_times

    def density_at(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array | None:
        return self.material.density_at(points, regions)

    def viscosity_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self.material.viscosity_tensor(points, regions)

    def branch_tensor(self, number: int, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self.material.branch_tensor(number, points, regions)

    def homogeneous_in(self, viscous: bool, numbers: Sequence[int] = ()) -> bool:
        return self.material.homogeneous_in(viscous, numbers)

    def describe(self, point: Sequence[float] | None = None) -> MaterialDescription:
        return self.material.describe(point)

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        return self.material.out_of_plane_stress(points, strain, regions)


def lower_elasticity(material: Material) -> Material:
    """The linear material of ``C_low`` of a material, in whose energy norm errors are bounded; itself if it is linear.

    Returned: its tensor is refused where no lower bound is known.
    """
    return material if material.linear else LowerElasticity(material)


def _least_certain(ways: Iterable[BoundsBy]) -> BoundsBy:
    order = list(BoundsBy)
    return order[max(order.index(kind) for kind in ways)]
