"""Numbers in words that are claims: an upper bound is shown rounded up, a lower one rounded down."""

from __future__ import annotations

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, Context

__all__ = ["rounded_down", "rounded_up"]


def rounded_up(value: float, digits: int = 3) -> str:
    """A number with so many digits that is not below it."""
    return _rounded(value, digits, ROUND_CEILING)


def rounded_down(value: float, digits: int = 3) -> str:
    """A number with so many digits that is not above it."""
    return _rounded(value, digits, ROUND_FLOOR)


def _rounded(value: float, digits: int, rounding: str) -> str:
    if not math.isfinite(value) or value == 0.0:
        return f"{value:g}"
    nearest = f"{value:.{digits}g}"
    off = float(nearest) - value
    if off == 0.0 or (off > 0.0) == (rounding == ROUND_CEILING):
        return nearest
    return f"{float(Context(prec=digits, rounding=rounding).create_decimal(value)):.{digits}g}"
