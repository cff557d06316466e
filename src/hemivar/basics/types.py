"""Array types used throughout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["AnyArray", "Array", "BoolArray", "IntArray", "Parameter", "Record"]

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

#: An array of entries of any kind.
AnyArray = NDArray[Any]

#: What is written as a JSON object, or read from one: text, numbers, lists and such records.
Record = dict[str, Any]

#: A number, one number per contact point, or a function of the points ``x (m, d) -> (m,)``.
Parameter = float | str | Array | Callable[[Array], Array]
