"""Ctrl-C, the time limit and a lack of memory: the best iterate so far, with a status that says what happened."""

from __future__ import annotations

import pytest

from hemivar.solvers import Status, solve
from hemivar.solvers.controls import Budget
from hemivar.survey import Powell
from hemivar.systems import Workspace, condense
from tests.problems import discrete_square


def test_powell_keeps_the_best_point_of_its_only_step(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = discrete_square("figure 1", n=16)
    system = condense(problem)
    rest = system.energy(system.start())

    def check(self: Budget) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Budget, "check", check)  # Powell asks after a hundred evaluations
    found = solve(problem, Powell(), workspace=Workspace.holding(system))
    assert found.status is Status.INTERRUPTED
    assert found.evaluations >= 100
    assert found.energy < rest
