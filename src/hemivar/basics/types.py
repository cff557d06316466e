"""Array types used throughout."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["Array", "BoolArray", "IntArray", "Parameter"]

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

#: A number, one number per contact point, or a function of the points ``x (m, d) -> (m,)``.
Parameter = float | Array | Callable[[Array], Array]
