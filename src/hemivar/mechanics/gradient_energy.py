"""Quasilinear scalar problems: a stored energy W of the gradient (potential), whose derivative is the flux."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hemivar.basics.arguments import number
from hemivar.basics.arrays import LARGEST
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.errors import ProblemError

__all__ = ["Coefficient", "FluxDensity", "GradientEnergy", "PowerLaw", "Profile", "SaturatingFlux"]


@dataclass(frozen=True, eq=False)
class Profile:
    """An isotropic energy by the size t of the gradient, arrays (k,)."""

    value: Array  # W
    secant: Array  # W'/t, its limit where t is zero
    slope: Array  # W''


class FluxDensity(Protocol):
    """A stored energy of a gradient, isotropic or not, linear or not."""

    def at_rest(self, points: Array) -> Array:
        """Derivatives (k, d, d) of the flux where the gradient is zero."""

    def energy(self, points: Array, strain: Array) -> Array:
        """W of gradients (k, d), shape (k,)."""

    def stress(self, points: Array, strain: Array) -> Array:
        """The flux (k, d) of gradients (k, d)."""

    def tangent(self, points: Array, strain: Array) -> Array:
        """Derivatives (k, d, d) of the flux."""

    def lower_tensor(self, points: Array) -> Array:
        """Matrices (k, d, d) below all derivatives of the flux."""

    def upper_tensor(self, points: Array) -> Array:
        """Matrices (k, d, d) above all derivatives of the flux."""


class GradientEnergy(PickleMixin, ABC):
    """An isotropic stored energy W of a gradient g, in the place of the coefficient A of a :class:`ScalarProblem`.

    ``W = F(|g|)`` with a flux ``F'(|g|) g/|g|`` that grows with |g|: derivatives of the flux lie between
    :attr:`least` and :attr:`most`, both positive.
    """

    @abstractmethod
    def profile(self, size: Array) -> Profile:
        """F and its derivatives at sizes (k,) of the gradient."""

    @property
    @abstractmethod
    def least(self) -> float:
        """No derivative of the flux is smaller."""

    @property
    @abstractmethod
    def most(self) -> float:
        """No derivative of the flux is larger."""

    def energy(self, points: Array, strain: Array) -> Array:
        """W of gradients (k, d), shape (k,)."""
        return self.profile(np.linalg.norm(strain, axis=1)).value

    def stress(self, points: Array, strain: Array) -> Array:
        """The flux (k, d) of gradients (k, d)."""
        return self.profile(np.linalg.norm(strain, axis=1)).secant[:, None] * strain

    def tangent(self, points: Array, strain: Array) -> Array:
        """Derivatives (k, d, d) of the flux."""
        size = np.linalg.norm(strain, axis=1)
        profile = self.profile(size)
        along = strain / np.where(size > 0.0, size, 1.0)[:, None]
        bent = (profile.slope - profile.secant)[:, None, None] * along[:, :, None] * along[:, None, :]
        return np.asarray(profile.secant[:, None, None] * np.eye(strain.shape[1]) + bent)

    def lower_tensor(self, points: Array) -> Array:
        """Matrices (k, d, d) below all derivatives of the flux."""
        return self._isotropic(self.least, points)

    def upper_tensor(self, points: Array) -> Array:
        """Matrices (k, d, d) above all derivatives of the flux."""
        return self._isotropic(self.most, points)

    def at_rest(self, points: Array) -> Array:
        """Derivatives (k, d, d) of the flux where the gradient is zero."""
        return self._isotropic(self.conductivity, points)

    @property
    def conductivity(self) -> float:
        """The derivative of the flux where the gradient is zero."""
        return float(self.profile(np.zeros(1)).secant[0])

    @staticmethod
    def _isotropic(value: float, points: Array) -> Array:
        dim = points.shape[1]
        return np.broadcast_to(value * np.eye(dim), (len(points), dim, dim))

    def _check(self, **positive: float) -> None:
        for name, value in positive.items():
            given = number(value, f"{type(self).__name__}.{name}", "give a positive number")
            if not 1.0 / LARGEST < given < LARGEST:
                raise ProblemError(f"{type(self).__name__}.{name} = {value:g}; it must be positive")


#: A number, a tensor (d, d), a function of points (k, d) that returns either at each, or an energy of the gradient.
Coefficient = float | Array | Callable[[Array], object] | GradientEnergy


@dataclass(frozen=True, eq=False)
class PowerLaw(GradientEnergy):
    """The p-Laplacian, made smooth at zero and linear at large gradients (glaciers, non-Newtonian flow, soap films).

    The flux is ``a (e^2 + t^2)^((p - 2)/2) t`` for a gradient of size t up to ``linear_from``; beyond that it is linear
    in t, with the slope that it has there.

    Parameters
    ----------
    power : float
        p > 1.
    smoothing : float
        e > 0, a gradient.
    linear_from : float
        The gradient beyond which the flux is linear, > 0.
    coefficient : float
        a > 0.

    Raises
    ------
    ProblemError
        A number is not what it must be.
    """

    power: float
    smoothing: float
    linear_from: float
    coefficient: float = 1.0

    def __post_init__(self) -> None:
        self._check(smoothing=self.smoothing, linear_from=self.linear_from, coefficient=self.coefficient)
        if not 1.0 < number(self.power, "PowerLaw.power", "give a number above 1") <= 100.0:
            raise ProblemError(f"PowerLaw.power = {self.power:g}; it must be above 1, and at most 100")

    def profile(self, size: Array) -> Profile:
        p, e, end = self.power, self.smoothing, self.linear_from
        near = np.minimum(size, end)
        square = e**2 + near**2
        secant = self.coefficient * square ** (0.5 * (p - 2.0))
        slope = secant * (e**2 + (p - 1.0) * near**2) / square
        # ((e^2 + t^2)^(p/2) - e^p)/p, without the cancellation of both where t is small
        value = self.coefficient * e**p * np.expm1(0.5 * p * np.log1p((near / e) ** 2)) / p
        beyond, flux = size - near, secant * near
        value = value + beyond * (flux + 0.5 * slope * beyond)
        far = (flux + slope * beyond) / np.where(size > 0.0, size, 1.0)
        return Profile(value, np.where(beyond > 0.0, far, secant), slope)

    @property
    def _ends(self) -> tuple[float, float]:
        """Derivatives of the flux at zero and from ``linear_from`` on: between them both of its kinds are monotone."""
        return self.conductivity, float(self.profile(np.array([self.linear_from])).slope[0])

    @property
    def least(self) -> float:
        return min(self._ends)

    @property
    def most(self) -> float:
        return max(self._ends)


@dataclass(frozen=True, eq=False)
class SaturatingFlux(GradientEnergy):
    """A conductivity that falls as the gradient grows, to a part of what it was.

    The flux is ``a (q + (1 - q)/sqrt(1 + t^2/g^2)) t`` for a gradient of size t.

    Parameters
    ----------
    coefficient : float
        a > 0, the conductivity at small gradients.
    left : float
        The part q of it that is left at large ones, 0 < q <= 1.
    gradient : float
        g > 0, where it falls.

    Raises
    ------
    ProblemError
        A number is not what it must be.
    """

    coefficient: float
    left: float
    gradient: float

    def __post_init__(self) -> None:
        self._check(coefficient=self.coefficient, left=self.left, gradient=self.gradient)
        if self.left > 1.0:
            raise ProblemError(f"SaturatingFlux.left = {self.left:g}; it must not exceed 1")

    def profile(self, size: Array) -> Profile:
        square = (size / self.gradient) ** 2
        root = np.sqrt(1.0 + square)
        lost = 1.0 - self.left
        value = self.coefficient * size**2 * (0.5 * self.left + lost / (root + 1.0))
        secant = self.coefficient * (self.left + lost / root)
        return Profile(value, secant, self.coefficient * (self.left + lost / root**3))

    @property
    def least(self) -> float:
        return self.coefficient * self.left

    @property
    def most(self) -> float:
        return self.coefficient
