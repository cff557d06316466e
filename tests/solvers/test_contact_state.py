"""Open, stick and slip: told apart at 1e-9 of the largest displacement and multiplier."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.solvers import ContactState
from hemivar.solvers.solution import contact_state, state_counts

LARGE = (0.02, 50.0)  # displacement and multiplier of the point that sets the sizes


def states(*points: tuple[float, float, float]) -> list[ContactState]:
    """States of points (penetration, slip, pressure) in parts of the largest, which comes first and sticks."""
    rows = np.array([(1.0, 0.0, 1.0), *points])
    local = np.column_stack([rows[:, 0], rows[:, 1]]) * LARGE[0]
    multiplier = np.column_stack([rows[:, 2], np.zeros(len(rows))]) * LARGE[1]
    return [ContactState(state) for state in contact_state(local, multiplier)[1:]]


@pytest.mark.parametrize("slip", [1e-8, -1e-8, 1e-4, 0.5])
def test_points_that_moved_by_more_than_rounding_slip(slip: float) -> None:
    assert states((0.0, slip, 0.5)) == [ContactState.SLIP]


@pytest.mark.parametrize("slip", [0.0, 1e-10, -5e-10])
def test_points_that_moved_by_rounding_stick(slip: float) -> None:
    assert states((0.0, slip, 0.5)) == [ContactState.STICK]


@pytest.mark.parametrize(
    ("penetration", "pressure", "is_open"),
    [(-1e-8, 0.0, True), (-1e-4, 1e-10, True), (-1e-10, 0.0, False), (-0.5, 1e-8, False), (0.0, 0.0, False)],
)
def test_points_that_lifted_and_bear_nothing_are_open(penetration: float, pressure: float, is_open: bool) -> None:
    assert (states((penetration, 0.0, pressure)) == [ContactState.OPEN]) == is_open


@pytest.mark.parametrize("slip", [0.0, 1e-4])
def test_points_that_lifted_and_are_pulled_back_are_bonded(slip: float) -> None:
    assert states((-1e-4, slip, -1e-4)) == [ContactState.BONDED]


def test_bonded_points_are_counted_where_there_are_some() -> None:
    assert [*state_counts(np.array([0, 2, 2]))] == [ContactState.OPEN, ContactState.STICK, ContactState.SLIP]
    assert state_counts(np.array([0, 3, 3]))[ContactState.BONDED] == 2


def test_sizes_of_all_points_count_where_these_are_not_all() -> None:
    local, multiplier = np.array([[0.0, 1e-8]]), np.array([[1.0, 0.0]])
    assert contact_state(local, multiplier).tolist() == [ContactState.SLIP]
    assert contact_state(local, multiplier, (100.0, 1.0)).tolist() == [ContactState.STICK]
