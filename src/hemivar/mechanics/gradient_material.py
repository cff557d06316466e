"""The material of one component: its coefficient or energy of the gradient, density and viscosity."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.coefficient import Coefficient, flux_density
from hemivar.mechanics.gradient_energy import FluxDensity, GradientEnergy
from hemivar.mechanics.material import Material
from hemivar.mechanics.per_volume import Regional, at_place, constant_of

__all__ = ["GradientMaterial"]


@dataclass(frozen=True, eq=False)
class GradientMaterial(Material):
    """What makes a flux of a gradient: strains of a :class:`Material` are here the gradient (k, d), stresses the flux.

    Attributes
    ----------
    coefficient : Coefficient, or mapping of region name to one
        As a :class:`ScalarProblem` has checked it.
    constant : str
        What the coefficient is called.
    density, viscosity : float, callable, mapping or None
    """

    coefficient: Coefficient | Mapping[str, Coefficient]
    constant: str
    density: Regional | None = None
    viscosity: Regional | None = None

    @property
    def _parts(self) -> tuple[Coefficient, ...]:
        given = self.coefficient
        return tuple(given.values()) if isinstance(given, Mapping) else (given,)

    @property
    def homogeneous(self) -> bool:
        return not callable(self.coefficient) and not isinstance(self.coefficient, Mapping)

    @property
    def uniform(self) -> bool:
        return not any(callable(part) for part in self._parts)

    @property
    def linear(self) -> bool:
        return not any(isinstance(part, GradientEnergy) for part in self._parts)

    def _of_parts(
        self,
        function: Callable[[FluxDensity, BoolArray | slice], Array],
        points: Array,
        regions: Mapping[str, BoolArray] | None,
    ) -> Array:
        """What a function makes of the coefficient, or of that of each region for the points there."""
        what = self.constant
        if not isinstance(self.coefficient, Mapping):
            return function(flux_density(self.coefficient, what), slice(None))
        found: Array | None = None
        covered = np.zeros(len(points), dtype=int)
        for name, value in self.coefficient.items():
            mask = (regions or {})[name]
            covered += mask
            if mask.any():
                part = function(flux_density(value, f"{what} of region '{name}'"), mask)
                found = np.zeros((len(points), *part.shape[1:])) if found is None else found
                found[mask] = part
        if (covered != 1).any():
            bad = int(np.flatnonzero(covered != 1)[0])
            where = "no region" if covered[bad] == 0 else "more than one region"
            raise ProblemError(
                f"the point {points[bad].tolist()} lies in {where} that the {what} names; the regions must cover the "
                "mesh without overlap"
            )
        assert found is not None
        return found

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
