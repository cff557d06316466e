"""What runs by default and what is slow: every sample is one of the two."""

from __future__ import annotations

import pytest

from tests.samples import sampled, slow


def test_no_sample_is_lost_and_a_part_runs_by_default() -> None:
    given = [("a", 1), ("b", 2), ("c", 3), ("d", 4), ("e", 5)]
    for quick, expected in ((2, ["a", "c", "e"]), ([("b", 2)], ["b"])):
        found = sampled(given, quick)
        cases = [getattr(one, "values", one) for one in found]
        assert cases == given
        assert [one[0] for one in found if isinstance(one, tuple) and not hasattr(one, "marks")] == expected
        assert all(one.marks == (pytest.mark.slow,) for one in found if hasattr(one, "marks"))
    assert sampled(range(21))[::10] == [0, 10, 20]
    assert slow("a", 1).values == ("a", 1)


def test_a_sample_that_is_not_there_is_named_at_once() -> None:
    with pytest.raises(AssertionError):
        sampled(["a", "b"], ["c"])
