"""Bounds of the tangent (convexity) of a stored energy: by interval arithmetic, or sampled at strains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.formula.curvature import BoxVariable, EnclosedRange, second_derivatives
from hemivar.formula.graph import Graph

__all__ = [
    "FoundRange",
    "component_derivatives",
    "invariant_derivatives",
    "once",
    "sampled_range",
    "strain_text",
    "tried_strains",
]

#: Strains that are tried.
_SAMPLES = 3000
_NAMES = {2: ("xx", "yy", "xy"), 3: ("xx", "yy", "zz", "yz", "xz", "xy")}


@dataclass(frozen=True)
class FoundRange:
    """A range with what is to be believed of it."""

    enclosed: EnclosedRange
    rounding: float  # part of the largest value below which a value counts as zero

    @property
    def _zero(self) -> float:
        return self.rounding * abs(self.enclosed.largest)

    @property
    def proved(self) -> bool:
        """Whether bounds by intervals are finite, and the lower one is not negative."""
        return self.enclosed.lower >= -self._zero and self.enclosed.upper < np.inf

    @property
    def lower(self) -> float:
        """The lower bound: proved, or the least value that was seen; not negative."""
        return max(self.enclosed.lower if self.proved else self.enclosed.least, 0.0)

    @property
    def upper(self) -> float:
        """The upper bound: proved, or the largest value that was seen."""
        return self.enclosed.upper if self.proved else self.enclosed.largest

    @property
    def concave(self) -> bool:
        """Whether a value was seen that is negative, beyond rounding."""
        return not self.enclosed.least >= -self._zero

    @property
    def least(self) -> float:
        """The least value that was seen."""
        return self.enclosed.least

    @property
    def least_at(self) -> tuple[float, ...]:
        """Where it was seen."""
        return self.enclosed.least_at


def once(dim: int) -> Array:
    """The diagonal matrix M of ``strain = M e``, e the components whose Euclidean norm is that of the strain.

    A shear strain gamma has the norm ``gamma / sqrt(2)``; a matrix C of engineering strains becomes ``M C M``.
    """
    return np.diag([1.0] * dim + [np.sqrt(2.0)] * (dim * (dim - 1) // 2))


def strain_text(at: Array | Sequence[float], dim: int) -> str:
    """A strain in a message; components as :func:`once` has them."""
    values = np.asarray(at, dtype=float) / np.diag(once(dim))
    return (
        ", ".join(f"e{name} = {value:.6g}" for name, value in zip(_NAMES[dim], values, strict=True) if value) or "zero"
    )


def invariant_derivatives(graph: Graph, node: int, low: Array, high: Array) -> tuple[Array, Array]:
    """Bounds (3, k) of the second derivatives of a formula of ``tr`` and ``dev2`` by q and t on boxes (k, 2).

    ``tr = sqrt(3) q`` and ``dev2 = t^2``; the order is qq, qt, tt.
    """
    none, ones, root = np.zeros(len(low)), np.ones(len(low)), np.sqrt(3.0)
    (q, t), (q_last, t_last) = low.T, high.T
    slope = np.stack([root * ones, none])
    trace = BoxVariable((root * q, root * q_last), (slope, slope))
    twice = np.stack([none, none, 2.0 * ones])
    square = BoxVariable(
        (t * t, t_last * t_last), (np.stack([none, 2.0 * t]), np.stack([none, 2.0 * t_last])), (twice, twice)
    )
    return second_derivatives(graph, node, {"tr": trace, "dev2": square})


def component_derivatives(
    graph: Graph, node: int, names: Sequence[str], scale: Array, low: Array, high: Array
) -> tuple[Array, Array]:
    """Bounds of the second derivatives of a formula by ``e = component / scale`` on boxes (k, v); other names are 0."""
    count, size = low.shape
    none = np.zeros((size, count))
    variables = {name: BoxVariable((none[0], none[0]), (none, none)) for name in graph.names(node)}
    for i, name in enumerate(names):
        slope = np.zeros((size, count))
        slope[i] = scale[i]
        variables[name] = BoxVariable((scale[i] * low[:, i], scale[i] * high[:, i]), (slope, slope))
    return second_derivatives(graph, node, variables)


def tried_strains(dim: int, reach: float, count: int = _SAMPLES, seed: int = 0) -> Array:
    """Strains (k, v), with engineering shear, of sizes up to a reach: random ones, and each component by itself."""
    size = dim * (dim + 1) // 2
    random = np.random.default_rng(seed)
    ways = random.normal(size=(count, size))
    ways[: count // 4, dim:] = 0.0
    shear = np.eye(size)[dim:]
    volume = np.concatenate([np.ones(dim), np.zeros(size - dim)])[None]
    single = np.concatenate([np.eye(size), -np.eye(size), shear, volume, -volume])
    ways = np.concatenate([ways, np.repeat(single, 20, axis=0)])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    small, large = 10.0 ** random.uniform(-6.0, 0.0, count), random.uniform(0.0, 1.0, count)
    graded = np.tile(np.geomspace(1e-4, 1.0, 20), len(single))
    sizes = reach * np.concatenate([np.where(random.uniform(size=count) < 0.5, small, large), graded])
    return np.asarray(sizes[:, None] * ways @ once(dim))


def sampled_range(tangent: Callable[[Array], Array], first: Array, reach: float, dim: int) -> EnclosedRange:
    """The range of the eigenvalues of tangents relative to the first one, at strains that are tried."""
    strain = tried_strains(dim, reach)
    half = np.linalg.inv(np.linalg.cholesky(once(dim) @ first @ once(dim))) @ once(dim)
    values = np.linalg.eigvalsh(half @ tangent(strain) @ half.T)
    i, k = int(np.argmin(values[:, 0])), int(np.argmax(values[:, -1]))
    places = [tuple((strain[row] / np.diag(once(dim))).tolist()) for row in (i, k)]
    return EnclosedRange(-np.inf, np.inf, float(values[i, 0]), float(values[k, -1]), places[0], places[1])
