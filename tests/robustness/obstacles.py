"""Obstacles by code of our own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from tests.robustness.expression import parse, value

__all__ = ["signed_distance", "way_along"]


def signed_distance(obstacle: Mapping[str, Any]) -> Callable[[np.ndarray], float]:
    """The signed distance of an obstacle of a problem file, at one place."""
    shape, given = next(iter(obstacle.items()))
    if shape == "distance":
        tree = parse(given)
        return lambda x: value(tree, dict(zip("xyz", map(float, x), strict=False)))
    if shape == "plane":
        n = np.array(given["normal"], dtype=float)
        n = n / np.linalg.norm(n)
        return lambda x: float((x - np.array(given["point"], dtype=float)) @ n)
    sign, radius = (-1.0 if given.get("inside") else 1.0), float(given["radius"])
    if shape == "sphere":
        return lambda x: sign * (float(np.linalg.norm(x - np.array(given["center"], dtype=float))) - radius)
    a = np.array(given["axis"], dtype=float)
    a = a / np.linalg.norm(a)

    def cylinder(x: np.ndarray) -> float:
        arm = x - np.array(given["point"], dtype=float)
        return sign * (float(np.linalg.norm(arm - (arm @ a) * a)) - radius)

    return cylinder


def way_along(
    distance: Callable[[np.ndarray], float], x: np.ndarray, direction: np.ndarray, size: float
) -> float | None:
    """Way along a direction to the surface of an obstacle: zero of the distance by marching and bisection."""
    start = distance(x)
    sign, way = (1.0 if start >= 0.0 else -1.0), 0.0
    for _ in range(2000):
        here = distance(x + way * direction)
        if here * sign <= 0.0 or abs(here) < 1e-14 * size:
            break
        way += sign * max(abs(here), 1e-6 * size)
        if abs(way) > 50.0 * size:
            return None
    step = max(abs(way), 1e-6 * size)
    low, high = way - sign * step, way
    low = 0.0 if sign * low < 0.0 else low
    for _ in range(200):
        middle = 0.5 * (low + high)
        if distance(x + middle * direction) * sign > 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
