"""An elastic bedding of the body itself, which resists its displacement at every place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import LARGEST, ScalarData, check_finite, evaluate_scalar
from hemivar.mechanics.instants import refuse_time
from hemivar.mechanics.material import Material

__all__ = ["Bedding", "bedding_of"]


@dataclass(frozen=True, eq=False)
class Bedding(Portable):
    """Stiffness per volume of a force ``-bedding u``, in part a multiple of the density of a material.

    A step in time of a body with mass is a static problem with such a bedding.

    Attributes
    ----------
    own : float or callable
        Stiffness per volume, not negative; a callable gets points, shape (k, d), and returns shape (k,).
    material : Material or None
        Whose density counts.
    factor : float
        What the density is multiplied by; not negative.

    Raises
    ------
    ProblemError
        If a number is negative or not finite, or the material has no density.
    """

    own: ScalarData = 0.0
    material: Material | None = None
    factor: float = 0.0

    def __post_init__(self) -> None:
        refuse_time(self.own, "bedding")
        if not callable(self.own):
            given = check_finite(self.own, "bedding", LARGEST)
            if given.ndim != 0:
                raise ProblemError(f"bedding has shape {given.shape}; it must be one number or a callable")
            if given < 0.0:
                raise ProblemError(f"bedding = {float(given):g}; it must not be negative, for it resists displacement")
            object.__setattr__(self, "own", float(given))
        if not (np.isfinite(self.factor) and self.factor >= 0.0):
            raise ProblemError(f"the density is multiplied by {self.factor:g}; give a number that is not negative")
        if self.factor and (self.material is None or not self.material.inert):
            raise ProblemError("a body without density has no inertia; give the material a density")

    @property
    def none(self) -> bool:
        """Whether there is no bedding at all."""
        return not callable(self.own) and self.own == 0.0 and not self.factor

    @property
    def everywhere(self) -> bool:
        """Whether it is known to be positive at every place of the body."""
        return self.factor > 0.0 or (not callable(self.own) and self.own > 0.0)

    def at(self, points: Array, regions: Mapping[str, BoolArray] | None = None) -> Array:
        """Stiffness per volume at points, shape (k,).

        Raises
        ------
        ProblemError
            If it is negative or not finite at some point.
        """
        value = evaluate_scalar(self.own, points, "bedding")
        if not (value >= 0.0).all():
            bad = int(np.argmin(value))
            raise ProblemError(
                f"bedding = {value[bad]:g} at x = {points[bad].tolist()}; it must not be negative, for it resists "
                "displacement"
            )
        if self.factor and self.material is not None:
            density = self.material.density_at(points, regions)
            assert density is not None
            value = value + self.factor * density
        return value

    @property
    def constant(self) -> float | None:
        """The stiffness per volume where it is the same everywhere; None where it varies."""
        density = getattr(self.material, "density", None) if self.factor else 0.0
        if callable(self.own) or density is None or callable(density):
            return None
        return float(self.own + self.factor * density)


def bedding_of(value: Bedding | ScalarData) -> Bedding:
    """A bedding as a statement may give it: a number, a callable or a bedding."""
    if isinstance(value, Bedding):
        return value
    if isinstance(value, str):
        raise ProblemError(f"bedding is {described(value)}; give a number or a callable")
    return Bedding(value)
