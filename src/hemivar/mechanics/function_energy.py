"""Stored energies of one's own by Python functions, and what all energies of one's own have in common."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.arguments import quoted
from hemivar.basics.arrays import real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.known_keywords import known_fields
from hemivar.basics.stated import Form, kept, stated
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.formula.reader import shown
from hemivar.mechanics.energy_bounds import FoundRange, once, sampled_range, strain_text
from hemivar.mechanics.material_words import BoundsBy
from hemivar.mechanics.stored_energy import StoredEnergy

__all__ = ["REACH", "ROUNDING", "FunctionEnergy", "RelativeEnergy", "refuse_at_zero"]

#: Part of the largest curvature below which one counts as zero.
ROUNDING = 1e-10


def _checked_reach(reach: object, name: str) -> float:
    number = real_array(reach, name, finite=False)
    if number.shape != () or not 1e-100 <= float(number) <= 1e100:
        raise ProblemError(f"{name} = {quoted(reach)}; give the size of the strain, a positive number")
    return float(number)


#: The metadata of the size of the strains that are examined.
REACH = stated(Form.QUANTITY, "size |eps| of the strain up to which it is examined", unit="1", example=0.2) | kept(
    _checked_reach
)


class RelativeEnergy(StoredEnergy):
    """An energy whose tangent is bounded by multiples of that at zero strain."""

    @property
    def kind(self) -> str:
        return "potential"

    @property
    def homogeneous(self) -> bool:
        return True

    @abstractmethod
    def _found(self, dim: int) -> FoundRange:
        """The range of the eigenvalues of the tangent relative to that at zero strain, looked for anew."""

    @cached_property
    def _in_the_plane(self) -> FoundRange:
        return self._found(2)

    @cached_property
    def _throughout(self) -> FoundRange:
        return self._found(3)

    def factors(self, dim: int) -> FoundRange:
        """The range of the eigenvalues of the tangent relative to that at zero strain."""
        return self._in_the_plane if dim == 2 else self._throughout

    def lower_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return np.asarray(self.factors(points.shape[1]).lower * self.stiffness_tensor(points))

    def upper_tensor(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return np.asarray(self.factors(points.shape[1]).upper * self.stiffness_tensor(points))

    def _first(self, dim: int) -> Array:
        """The tangent at zero strain (v, v), positive definite."""
        tangent = np.array(self.stiffness_tensor(np.zeros((1, dim)))[0])
        if np.abs(tangent - tangent.T).max() > 1e-8 * np.abs(tangent).max():
            raise ProblemError("the tangent at zero strain is not symmetric; it must be the derivative of the stress")
        scaled = once(dim) @ tangent @ once(dim)
        if not np.linalg.eigvalsh(scaled)[0] > 1e-12 * np.abs(scaled).max():
            where = "in the plane" if dim == 2 else "in space"
            raise ProblemError(
                f"the energy has no stiffness at zero strain against some strain {where}: its tangent there is not "
                "positive definite; give every component of the strain a stiffness"
            )
        return tangent

    def _checked(self, tangents: FoundRange, dim: int) -> FoundRange:
        if tangents.concave:
            raise ProblemError(
                f"the energy is not convex: at the strain {strain_text(tangents.least_at, dim)} its tangent has the "
                f"eigenvalue {tangents.least:.6g}, relative to zero strain; take a smaller reach, or another energy"
            )
        return tangents


@known_fields
@dataclass(frozen=True, eq=False)
class FunctionEnergy(RelativeEnergy):
    """An energy by Python functions of the strain."""

    value: Callable[[Array], object]
    first: Callable[[Array], object]
    second: Callable[[Array], object]
    reach: float = field(default=np.inf, metadata=REACH)

    def __post_init__(self) -> None:
        super().__post_init__()
        _ = self.factors(self._natural_dim)

    @property
    def formula(self) -> str:
        return f"W by the function {getattr(self.value, '__name__', type(self.value).__name__)}"

    def stated(self) -> Mapping[str, object]:
        return {"reach": self.reach}

    @cached_property
    def _dim(self) -> int:
        """3 if the functions take strains of space, else 2."""
        try:
            self._zero(3)
        except Exception as in_space:
            try:
                self._zero(2)
            except Exception:
                raise (
                    in_space
                    if isinstance(in_space, ProblemError)
                    else ProblemError(f"the functions fail at zero strain: {type(in_space).__name__}: {in_space}")
                ) from in_space
            return 2
        return 3

    def _zero(self, dim: int) -> None:
        points, strain = np.zeros((1, dim)), np.zeros((1, dim * (dim + 1) // 2))
        self.tangent(points, strain)
        stress = self.stress(points, strain)
        refuse_at_zero("", float(self.energy(points, strain)[0]), float(np.abs(stress).max()))

    @property
    def _natural_dim(self) -> int:
        return self._dim

    @property
    def bounds_by(self) -> BoundsBy:
        return BoundsBy.SAMPLED

    def _called(self, function: Callable[[Array], object], strain: Array, shape: tuple[int, ...], name: str) -> Array:
        values = real_array(function(strain), f"{name} of the material", finite=False)
        if values.shape != shape:
            raise ProblemError(
                f"the function of the {name} returned shape {values.shape} for strains of shape {strain.shape}; it "
                f"must return shape {shape}"
            )
        bad = ~np.isfinite(values.reshape(len(strain), -1)).all(axis=1)
        if bad.any():
            dim = 2 if strain.shape[1] == 3 else 3
            where = strain_text(strain[int(np.argmax(bad))] / np.diag(once(dim)), dim)
            raise ProblemError(f"the function of the {name} is not finite at the strain {where}; correct it")
        return values

    def energy(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._called(self.value, strain, (len(strain),), "energy")

    def stress(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._called(self.first, strain, strain.shape, "stress")

    def tangent(self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        return self._called(self.second, strain, (*strain.shape, strain.shape[1]), "tangent")

    def out_of_plane_stress(
        self, points: Array, strain: Array, regions: Mapping[str, BoolArray] | None = None
    ) -> Array:
        """Of functions that take strains of space that of plane strain; else zero, as nothing is known."""
        if self._dim == 2:
            return np.zeros(len(points))
        voigt = np.zeros((len(points), 6))
        voigt[:, 0], voigt[:, 1], voigt[:, 5] = strain[:, 0, 0], strain[:, 1, 1], 2.0 * strain[:, 0, 1]
        return self.stress(np.zeros((len(points), 3)), voigt)[:, 2]

    def _found(self, dim: int) -> FoundRange:
        first = self._first(dim)

        def tangent(strain: Array) -> Array:
            return self.tangent(np.zeros((len(strain), dim)), strain)

        return self._checked(FoundRange(sampled_range(tangent, first, self.reach, dim), ROUNDING), dim)


def refuse_at_zero(text: str, value: float, stress: float) -> None:
    """Refuse an energy or a stress at zero strain."""
    of = f"energy: formula '{shown(text)}'" if text else "the energy"
    if value != 0.0:
        raise ProblemError(f"{of} is {value:.6g} at zero strain; subtract it, so that zero strain has energy zero")
    if stress != 0.0:
        raise ProblemError(
            f"{of} has a stress of size {stress:.6g} at zero strain; leave out what is linear in the strain, and give "
            "it as a load"
        )
