"""Random bounds with obstacles and narrow loads against finer solutions by code of our own."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from tests.robustness.bounds import judge, make, run_bounds

CASES = 120


@pytest.mark.slow
def test_no_bound_is_below_the_error() -> None:
    """``python -m tests.robustness bounds --cases 1000 --seed 2`` runs more."""
    verdicts = list(run_bounds(5, range(CASES), jobs=2))
    count = Counter(one.outcome for one in verdicts)
    below = [
        f"{one.name}: bound {one.bound:.4g}, error {one.error:.4g}, {one.note}"
        for one in verdicts
        if one.outcome == "below"
    ]
    assert not below, "\n".join(below)
    # nothing that is accepted, or nothing that is compared, would pass as well
    assert count["held"] > CASES // 2, count
    assert count["no reference"] + count["refused"] < CASES // 5, count
    ratios = np.array([one.ratio for one in verdicts if one.outcome == "held"])
    assert np.median(ratios) < 4.0


def test_a_case_is_the_same_in_any_order() -> None:
    notes = [make(3, number).note for number in range(12)]
    assert [make(3, number).note for number in reversed(range(12))] == notes[::-1]
    assert len(set(notes)) == 12
    assert make(4, 0).note != notes[0]


def test_one_bound_holds() -> None:
    found = judge(make(1, 6))
    assert found.outcome == "held"
    assert 1.0 < found.ratio < 4.0
