"""Quantities, numbers and formulas of a statement, as a problem file writes them."""

from __future__ import annotations

import numpy as np

from hemivar.files.not_expressible import not_expressible
from hemivar.formula import Formula, FormulaArray

__all__ = ["entries_record", "quantity_record"]


def entries_record(value: object, where: str) -> list[object]:
    """The entries of a vector or matrix of numbers and formulas, in row-major order."""
    if isinstance(value, FormulaArray):
        return [quantity_record(entry, where) for entry in value.entries]
    if callable(value):
        raise not_expressible(where, value)
    return np.asarray(value, dtype=float).ravel().tolist()


def quantity_record(value: object, where: str) -> object:
    """A number, or the text of a formula."""
    if isinstance(value, Formula):
        return value.text
    if callable(value):
        raise not_expressible(where, value)
    numbers = np.asarray(value, dtype=float)
    if numbers.size != 1:
        raise not_expressible(where, f"given as {numbers.size} numbers, one for each contact point")
    return float(numbers.ravel()[0])
