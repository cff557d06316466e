"""Ctrl-C, the time limit and a lack of memory: the best iterate so far, with a status that says what happened."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from hemivar.branches import find_solutions, follow_path
from hemivar.fem import discretize
from hemivar.gallery import broken_foundation
from hemivar.laws import PiecewiseQuadratic
from hemivar.solvers import Controls, NonsmoothNewton
from tests.problems import bar, discrete_square


def test_the_search_for_solutions_keeps_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = discretize(broken_foundation(4))  # its margin does not show that there is one solution
    step = NonsmoothNewton.step
    calls = []

    def interrupted(self: NonsmoothNewton, *arguments: Any) -> Any:
        calls.append(1)
        if len(calls) > 60:
            raise KeyboardInterrupt
        return step(self, *arguments)

    monkeypatch.setattr(NonsmoothNewton, "step", interrupted)
    found = find_solutions(problem, enumerate_up_to=0)
    assert found.interrupted
    assert len(calls) == 61
    assert len(found) >= 1
    assert found.searched.endswith("interrupted")


def test_the_search_for_solutions_keeps_to_its_time() -> None:
    found = find_solutions(discrete_square(n=4), enumerate_up_to=0, controls=Controls(max_time=0.0))
    assert len(found) == 0
    assert not found.interrupted
    assert found.searched.endswith("stopped at the time limit")


def test_a_path_keeps_its_points(monkeypatch: pytest.MonkeyPatch) -> None:
    from hemivar.branches.follower import Follower

    law = PiecewiseQuadratic([0.0, 0.1, 0.15], [0.0, 2.0, -2.0, 0.0], [0.0] * 3)  # type: ignore[arg-type]
    whole = follow_path(bar(0.5, law))
    step = Follower.straight_step
    calls = []

    def interrupted(self: Follower, *arguments: Any) -> Any:
        calls.append(1)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return step(self, *arguments)

    monkeypatch.setattr(Follower, "straight_step", interrupted)
    found = follow_path(bar(0.5, law))
    assert found.interrupted
    assert not whole.interrupted
    assert 2 <= len(found) < len(whole)
    np.testing.assert_allclose(found.load_factor, whole.load_factor[: len(found)])
    np.testing.assert_allclose(found.local, whole.local[: len(found)])
