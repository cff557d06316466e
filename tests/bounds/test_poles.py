"""Poles of formulas: found with their place, which is known in closed form, or refused as an argument of a proof."""

from __future__ import annotations

import numpy as np

from hemivar.bounds.load_values import load_values
from hemivar.formula import Formula, FormulaArray


def test_nothing_is_known_of_a_load_with_a_pole_in_space() -> None:
    """One on a line through the cell, between the points of every rule: no bound may be guaranteed."""
    corners, area = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]]), np.array([0.5])
    inside, outside = (
        load_values(FormulaArray((0.0, Formula(f"1/(x {place})")), (2,)), corners, area, "load")
        for place in ("- 0.4321", "+ 0.4321")
    )
    assert inside.doubt
    assert not outside.doubt
