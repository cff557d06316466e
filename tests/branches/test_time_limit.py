"""The time limit of a march holds within a step."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import pytest

import hemivar as hv
from hemivar.basics import deadline
from tests.evolution.test_time_limit import falling


def test_a_search_for_the_lowest_state_is_left_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    """It begins before the first step, and what it has found until then need not be the lowest."""
    ticks = itertools.count()
    monkeypatch.setattr(deadline, "time", SimpleNamespace(perf_counter=lambda: float(next(ticks))))
    limited = hv.march(falling(), until=1.0, step=0.5, jump="global", max_time=100.0)
    assert limited.ended == "max_time"
    assert len(limited.steps) == 1
    assert next(ticks) < 500  # of tens of thousands
