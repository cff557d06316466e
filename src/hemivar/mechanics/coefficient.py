"""The coefficient of a scalar problem: a number, a tensor, or a function of the place that returns either."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import LARGEST, evaluate_scalar
from hemivar.mechanics.gradient_energy import FluxDensity, GradientEnergy

__all__ = ["Coefficient", "flux_density", "plain_coefficient", "tensors_at"]

#: A number, a tensor (d, d), a function of points (k, d) that returns either at each, or an energy of the gradient.
Coefficient = float | Array | Callable[[Array], object] | GradientEnergy


def plain_coefficient(value: object, what: str, dim: int) -> Coefficient:
    """A number, a read-only (d, d) array or a callable; checked as far as it can be without points."""
    if callable(value) or isinstance(value, GradientEnergy):
        return value
    array = np.array(real_array(value, f"the {what}", finite=False))
    if array.shape not in ((), (dim, dim)):
        raise ProblemError(
            f"the {what} has shape {array.shape}; on this mesh it is one number or a tensor of shape ({dim}, {dim})"
        )
    tensors_at(array, np.zeros((1, dim)), what)
    array.flags.writeable = False
    return float(array) if array.ndim == 0 else array


def tensors_at(value: Coefficient, points: Array, what: str) -> Array:
    """A coefficient at points as tensors (k, d, d), checked; of an energy those where the gradient is zero."""
    k, dim = points.shape
    if isinstance(value, GradientEnergy):
        return value.at_rest(points)
    constant = not callable(value)
    array = real_array(value(points) if callable(value) else value, f"the {what}", finite=False)
    plain = array.ndim < 2
    if plain:
        numbers = np.atleast_1d(array) if constant else evaluate_scalar(lambda _: array, points, f"the {what}")
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
        place = "" if constant or len(good) < k else f" at x = {points[bad].tolist()}"
        shown = f"{numbers[bad]:g}" if plain else f"{numbers[bad].tolist()}"
        must = "be positive" if plain else "be symmetric and positive definite"
        raise ProblemError(
            f"the {what} is {shown}{place}; it must {must}, between {1.0 / LARGEST:.0e} and {LARGEST:.0e}"
        )
    return np.broadcast_to(numbers[:, None, None] * np.eye(dim) if plain else numbers, (k, dim, dim))


def flux_density(value: Coefficient, what: str) -> FluxDensity:
    """The stored energy that belongs to a coefficient."""
    return value if isinstance(value, GradientEnergy) else _LinearFlux(value, what)


@dataclass(frozen=True, eq=False)
class _LinearFlux:
    """The energy ``A g . g / 2``."""

    coefficient: Coefficient
    what: str

    def at_rest(self, points: Array) -> Array:
        return tensors_at(self.coefficient, points, self.what)

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
