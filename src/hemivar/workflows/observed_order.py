"""The observed order of convergence of a table of errors."""

from __future__ import annotations

import math

import numpy as np

from hemivar.basics.types import Array

__all__ = ["observed_order"]


def observed_order(sizes: Array, errors: Array, points: int = 4) -> float:
    """Slope of log(error) against log(h), fitted to the ``points`` smallest sizes; nan with fewer than two."""
    sizes, errors = np.asarray(sizes, dtype=float), np.asarray(errors, dtype=float)
    good = np.isfinite(errors) & (errors > 0.0)
    sizes, errors = sizes[good], errors[good]
    if len(sizes) < 2:
        return math.nan
    chosen = np.argsort(sizes)[:points]
    return float(np.polyfit(np.log(sizes[chosen]), np.log(errors[chosen]), 1)[0])
