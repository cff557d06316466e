"""Material of one component: diffusion coefficient or energy of the gradient, and what it has in time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import cast

import numpy as np

from hemivar.basics.arguments import one_of
from hemivar.basics.arrays import LARGEST, real_array
from hemivar.basics.stated import Form, Stated
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.gradient_energy import Coefficient, FluxDensity, GradientEnergy
from hemivar.mechanics.instants import refuse_time
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_description import MaterialDescription
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mechanics.per_volume import Regional, at_place, by_region, checked_per_volume, constant_of, refuse_unknown

__all__ = ["GradientMaterial"]


def _by_kind(form: Form, keys: Mapping[ScalarKind, str], **how: float | None) -> Mapping[str, Stated]:
    """What a field is in the files of each kind that has it."""
    return {kind.value: Stated(form, key=key, by="region", **how) for kind, key in keys.items()}  # type: ignore[arg-type]


_IN_MOTION = (ScalarKind.MEMBRANE, ScalarKind.ANTIPLANE)


@dataclass(frozen=True, eq=False)
class GradientMaterial(Material):
    """What :meth:`Material.gradient` makes: strains are here the gradient (k, d), stresses the flux."""

    coefficient: Coefficient | Mapping[str, Coefficient] = field(
        metadata=_by_kind(Form.TENSOR, {kind: kind.constant.replace(" ", "_") for kind in ScalarKind}, above=0.0)
    )
    scalar: ScalarKind = ScalarKind.MEMBRANE
    density: Regional | None = field(
        default=None, metadata=_by_kind(Form.QUANTITY, dict.fromkeys(_IN_MOTION, "density"), least=0.0)
    )
    viscosity: Regional | None = field(
        default=None, metadata=_by_kind(Form.QUANTITY, dict.fromkeys(_IN_MOTION, "viscosity"), least=0.0)
    )
    capacity: Regional | None = field(
        default=None, metadata=_by_kind(Form.QUANTITY, {ScalarKind.HEAT: "capacity"}, least=0.0)
    )

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "scalar", one_of(self.scalar, "kind", ScalarKind))
        given, what = self.coefficient, self.scalar.constant
        if not isinstance(given, Mapping):
            put(self, "coefficient", _plain(given, what))
        elif not given:
            raise ProblemError(f"the {what} is an empty mapping; give one for each region of the mesh")
        else:
            parts = {name: _plain(value, f"{what} of region '{name}'") for name, value in given.items()}
            put(self, "coefficient", MappingProxyType(parts))
        for part in self._parts.values():
            refuse_time(part, what)
        for name in ("density", "viscosity", "capacity"):
            if getattr(self, name) is not None:
                put(self, name, checked_per_volume(getattr(self, name), name))
        self._check_rates()

    def describe(self, point: Sequence[float] | None = None) -> MaterialDescription:
        constants = {what: getattr(part, "text", None) or str(part) for what, part in self._parts.items()}
        return MaterialDescription(self.scalar.value, "flux = A grad u", constants, self.linear)

    def _check_rates(self) -> None:
        heat = self.scalar is ScalarKind.HEAT
        for name, meaning in (("density", "has no inertia"), ("viscosity", "has no viscosity")):
            if heat and getattr(self, name) is not None:
                raise ProblemError(f"heat {meaning}; leave the {name} out, what stores heat is its capacity=")
        if not heat and self.capacity is not None:
            raise ProblemError(
                f"a capacity stores heat, and this problem is one of kind '{self.scalar}'; give its density= and "
                "viscosity=, or kind='heat'"
            )

    def check_on(self, dim: int, regions: Sequence[str]) -> None:
        for what, part in self._parts.items():
            shape = np.shape(part) if isinstance(part, np.ndarray) else ()
            if shape not in ((), (dim, dim)):
                raise ProblemError(
                    f"the {what} has shape {shape}; on this mesh it is one number or a tensor of shape ({dim}, {dim})"
                )
        for name in ("coefficient", "density", "viscosity", "capacity"):
            value = getattr(self, name)
            if isinstance(value, Mapping):
                refuse_unknown(self.scalar.constant if name == "coefficient" else name, value, regions)

    @property
    def _parts(self) -> dict[str, Coefficient]:
        """The coefficient, or that of each region, by what messages call it."""
        given, what = self.coefficient, self.scalar.constant
        if not isinstance(given, Mapping):
            return {what: given}
        return {f"{what} of region '{name}'": part for name, part in given.items()}

    @property
    def homogeneous(self) -> bool:
        return not callable(self.coefficient) and not isinstance(self.coefficient, Mapping)

    @property
    def uniform(self) -> bool:
        return not any(callable(part) for part in self._parts.values())

    @property
    def linear(self) -> bool:
        return not any(isinstance(part, GradientEnergy) for part in self._parts.values())

    def _of_parts(
        self,
        function: Callable[[FluxDensity, BoolArray | slice], Array],
        points: Array,
        regions: Mapping[str, BoolArray] | None,
    ) -> Array:
        """What a function makes of the coefficient, or of that of each region for the points there."""
        return by_region(
            self.coefficient,
            self.scalar.constant,
            lambda value, what, at: function(_flux_density(cast(Coefficient, value), what), at),
            points,
            regions,
        )

    def stiffness_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._of_parts(lambda part, at: part.at_rest(points[at]), points, regions)

    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._of_parts(lambda part, at: part.energy(points[at], strain[at]), points, regions)

    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._of_parts(lambda part, at: part.stress(points[at], strain[at]), points, regions)

    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._of_parts(lambda part, at: part.tangent(points[at], strain[at]), points, regions)

    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._of_parts(lambda part, at: part.lower_tensor(points[at]), points, regions)

    def upper_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._of_parts(lambda part, at: part.upper_tensor(points[at]), points, regions)

    @property
    def inert(self) -> bool:
        return self.density is not None and constant_of(self.density) != 0.0

    @property
    def viscous(self) -> bool:
        return self.viscosity is not None

    def density_at(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array | None:
        return None if self.density is None else at_place(self.density, "density", points, regions)

    def viscosity_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        given = 0.0 if self.viscosity is None else self.viscosity
        return at_place(given, "viscosity", points, regions)[:, None, None] * np.eye(points.shape[1])

    def homogeneous_in(self, viscous: bool, numbers: Sequence[int] = ()) -> bool:
        return not viscous or self.viscosity is None or constant_of(self.viscosity) is not None


def _plain(value: object, what: str) -> Coefficient:
    """A number, a read-only array or a callable; checked as far as it can be without points."""
    if callable(value) or isinstance(value, GradientEnergy):
        return value
    array = np.array(real_array(value, f"the {what}", finite=False))
    if array.ndim == 0 or (array.ndim == 2 and len(set(array.shape)) == 1):
        _tensors(array, np.zeros((1, len(array) if array.ndim else 2)), what)
    array.flags.writeable = False
    return float(array) if array.ndim == 0 else array


def _tensors(value: Coefficient, points: Array, what: str) -> Array:
    """A coefficient at points as tensors (k, d, d), checked; of an energy those where the gradient is zero."""
    k, dim = points.shape
    if isinstance(value, GradientEnergy):
        return value.at_rest(points)
    constant = not callable(value)
    array = real_array(value(points) if callable(value) else value, f"the {what}", finite=False)
    plain = array.ndim < 2
    if plain:
        numbers = np.atleast_1d(array) if constant else DataField(lambda _: array, f"the {what}").at(points)
        size = lowest = numbers
    else:
        if array.shape not in ((dim, dim), (k, dim, dim)):
            raise ProblemError(
                f"the {what} has shape {array.shape}; at {k} points it has shape ({k},), or ({k}, {dim}, {dim}) as a "
                "tensor"
            )
        numbers = array.reshape(-1, dim, dim)
        size = np.abs(numbers).max(axis=(1, 2))
        skew = np.abs(numbers - numbers.transpose(0, 2, 1)).max(axis=(1, 2))
        safe = np.where(np.isfinite(size)[:, None, None], numbers, np.eye(dim))
        lowest = np.where(skew <= 1e-12 * size, np.linalg.eigvalsh(safe)[:, 0] - 1e-14 * size, -1.0)
    good = np.isfinite(size) & (lowest > 0.0) & (size < LARGEST) & (size > 1.0 / LARGEST)
    if not good.all():
        bad = int(np.flatnonzero(~good)[0])
        where = "" if constant or len(good) < k else f" at x = {points[bad].tolist()}"
        shown = f"{numbers[bad]:g}" if plain else f"{numbers[bad].tolist()}"
        must = "be positive" if plain else "be symmetric and positive definite"
        raise ProblemError(
            f"the {what} is {shown}{where}; it must {must}, between {1.0 / LARGEST:.0e} and {LARGEST:.0e}"
        )
    return np.broadcast_to(numbers[:, None, None] * np.eye(dim) if plain else numbers, (k, dim, dim))


def _flux_density(value: Coefficient, what: str) -> FluxDensity:
    """The stored energy that belongs to a coefficient."""
    return value if isinstance(value, GradientEnergy) else _LinearFlux(value, what)


@dataclass(frozen=True, eq=False)
class _LinearFlux:
    """The energy ``A g . g / 2``."""

    coefficient: Coefficient
    what: str

    def at_rest(self, points: Array) -> Array:
        return _tensors(self.coefficient, points, self.what)

    def energy(self, points: Array, strain: Array) -> Array:
        return np.asarray(0.5 * np.einsum("ki,ki->k", self.stress(points, strain), strain))

    def stress(self, points: Array, strain: Array) -> Array:
        return np.asarray(np.einsum("kij,kj->ki", self.at_rest(points), strain))

    def tangent(self, points: Array, strain: Array) -> Array:
        return self.at_rest(points)

    def lower_tensor(self, points: Array) -> Array:
        return self.at_rest(points)

    def upper_tensor(self, points: Array) -> Array:
        return self.at_rest(points)
