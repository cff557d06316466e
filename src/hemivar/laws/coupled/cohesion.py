"""Cohesive traction-separation curves over an effective opening rho: by strength, fracture energy and stiffness.

Each is an even scalar law Phi with ``Phi'(0) = 0``: it rises with the initial stiffness, has one strength, and lets go
at a finite opening; the area under ``Phi'`` is the fracture energy, exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.parameters import LENGTH, LINE, PRESSURE, RATE, parameter, positive
from hemivar.laws.parametrised import NamedLaw
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["BilinearCohesion", "ExponentialCohesion", "TrapezoidalCohesion", "cohesion_table"]

#: Chords of the exponential: none is further from it than 1/(3 n^2) = 1e-6 of the strength.
_CHORDS = 600


@dataclass(frozen=True, eq=False)
class _Cohesion(NamedLaw):
    """A cohesive traction with a strength, a fracture energy and an initial stiffness."""

    strength: Parameter = field(metadata=positive("largest traction in opening", PRESSURE, 30.0))
    energy: Parameter = field(metadata=positive("fracture energy G_c", LINE, 0.5))
    stiffness: Parameter = field(metadata=positive("initial stiffness", RATE, 1e4))


@dataclass(frozen=True, eq=False)
class BilinearCohesion(_Cohesion):
    """Traction ``stiffness rho`` up to ``strength``, then straight down to zero.

    It lets go at ``rho_f = 2 energy / strength``; weakly convex with alpha = strength / (rho_f - strength / stiffness).

    Parameters
    ----------
    strength : Parameter
        Largest traction, > 0 (force per area).
    energy : Parameter
        Fracture energy G_c, larger than what is stored at the strength, ``strength^2 / (2 stiffness)`` (force per
        length).
    stiffness : Parameter
        Initial stiffness, > 0 (force per area and length).
    """

    name: ClassVar[str] = "bilinear cohesion"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        strength, first, length = _softening_length(self.name, values)
        return _even([first, first + 2.0 * length], [strength, 0.0 * strength], self.name)


@dataclass(frozen=True, eq=False)
class TrapezoidalCohesion(_Cohesion):
    """Traction ``stiffness rho`` up to ``strength``, which stays for a ``plateau``, then straight down to zero.

    Parameters
    ----------
    strength, energy, stiffness : Parameter
        As those of :class:`BilinearCohesion`.
    plateau : Parameter
        Length over which the strength stays, >= 0.
    """

    plateau: Parameter = field(metadata=parameter("length of the plateau of a trapezoid", LENGTH, least=0.0))
    name: ClassVar[str] = "trapezoidal cohesion"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        strength, first, length = _softening_length(self.name, values)
        plateau = np.broadcast_to(values["plateau"], np.broadcast_shapes(values["plateau"].shape, length.shape))
        fall = 2.0 * (length - plateau)
        if np.any(fall <= 0.0):
            raise ProblemError(
                f"law '{self.name}': the plateau {plateau.max():g} takes more than the fracture energy; it must be "
                f"shorter than {np.min(length):g}"
            )
        if not plateau.any():
            return _even([first, first + fall], [strength, 0.0 * strength], self.name)
        if not plateau.all():
            raise ProblemError(f"law '{self.name}': the plateau is zero at some contact points only; make it positive")
        return _even([first, first + plateau, first + plateau + fall], [strength, strength, 0.0 * strength], self.name)


@dataclass(frozen=True, eq=False)
class ExponentialCohesion(_Cohesion):
    """Traction ``stiffness rho`` up to ``strength``, then falling as an exponential.

    The exponential is a chain of 600 chords, nowhere further from it than 1e-6 of the strength, that ends at a finite
    opening; the area is the fracture energy.

    Parameters
    ----------
    strength, energy, stiffness : Parameter
        As those of :class:`BilinearCohesion`.
    """

    name: ClassVar[str] = "exponential cohesion"  # type: ignore[misc]

    def _build(self, values: dict[str, Array]) -> PiecewiseQuadratic:
        strength, first, length = _softening_length(self.name, values)
        far, left = _exponential_chords()
        return _even([first + length * t for t in far], [strength * y for y in left], self.name)


def _exponential_chords() -> tuple[Array, Array]:
    """Places t and heights of a chain of chords of ``exp(-t)``, of the same area, that ends at a finite t.

    With ``z = exp(-t/2)`` in equal steps dz all chords sag by about ``dz^2/2``; two thirds lower they are below the
    curve at their ends and above it in the middle, and their areas are right. The last triangle settles the rest.
    """
    z = 1.0 - np.arange(_CHORDS) / _CHORDS
    t, height = -2.0 * np.log(z), z**2
    height[1:] -= 1.0 / (3.0 * _CHORDS**2)
    area = float((0.5 * (height[1:] + height[:-1]) * np.diff(t)).sum())
    return np.append(t, t[-1] + 2.0 * (1.0 - area) / height[-1]), np.append(height, 0.0)


def cohesion_table(openings: Sequence[float] | Array, tractions: Sequence[float] | Array) -> PiecewiseQuadratic:
    """A cohesive traction given at some effective openings, straight between them.

    Parameters
    ----------
    openings : sequence of float
        rho, from 0, increasing (length).
    tractions : sequence of float
        Phi'(rho) there, at least 0; zero at the first and at the last one (force per area).

    Returns
    -------
    PiecewiseQuadratic
        Even; the area of the table is the fracture energy.

    Raises
    ------
    ProblemError
        Lists of different lengths, openings that do not increase from 0, a traction that is negative, or is not zero at
        the ends.
    """
    name = "cohesion table"
    rho, traction = (real_array(v, f"{what} of law '{name}'", 1) for v, what in
                     ((openings, "openings"), (tractions, "tractions")))  # fmt: skip
    if rho.shape != traction.shape or rho.size < 3:
        raise ProblemError(
            f"law '{name}' has {rho.size} openings and {traction.size} tractions; give at least three of each"
        )
    if rho[0] != 0.0 or (np.diff(rho) <= 0.0).any():
        raise ProblemError(f"openings of law '{name}' are {rho.tolist()}; they must increase, from 0")
    if (traction < 0.0).any() or traction[0] != 0.0 or traction[-1] != 0.0 or not traction.any():
        raise ProblemError(
            f"tractions of law '{name}' are {traction.tolist()}; they must be at least 0, and 0 at the first and at "
            f"the last opening"
        )
    made = _even(list(rho[1:, None]), list(traction[1:, None]), name)
    object.__setattr__(made, "stated", MappingProxyType({"law": name, "openings": rho, "tractions": traction}))
    return made


def _softening_length(name: str, values: dict[str, Array]) -> tuple[Array, Array, Array]:
    """Strength, opening where it is reached, and G_c less the stored energy over the strength; (m or 1,) each."""
    strength, energy, stiffness = np.broadcast_arrays(values["strength"], values["energy"], values["stiffness"])
    first = strength / stiffness
    length = energy / strength - 0.5 * first
    if np.any(length <= 0.0):
        i = int(np.argmin(length))
        raise ProblemError(
            f"law '{name}': the fracture energy {energy[i]:g} must exceed the elastic energy at the strength, "
            f"strength^2/(2 stiffness) = {0.5 * strength[i] * first[i]:g}; take a stiffer start, a lower "
            "strength or more energy"
        )
    return strength, first, length


def _even(openings: list[Array], tractions: list[Array], name: str) -> PiecewiseQuadratic:
    """The even law with these tractions (m or 1,) at these openings, straight between them, from 0 at 0 on."""
    rho, traction = (
        np.stack(np.broadcast_arrays(*openings), axis=-1),
        np.stack(np.broadcast_arrays(*tractions), axis=-1),
    )
    zero = np.zeros((*rho.shape[:-1], 1))
    slopes = np.diff(np.concatenate([zero, traction], axis=-1)) / np.diff(np.concatenate([zero, rho], axis=-1))
    return PiecewiseQuadratic(
        np.concatenate([-rho[..., ::-1], zero, rho], axis=-1),
        np.concatenate([zero, slopes[..., ::-1], slopes, zero], axis=-1),
        np.zeros((*rho.shape[:-1], 2 * rho.shape[-1] + 1)),
        name=name,
    )
