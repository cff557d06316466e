"""Long tables, many points, little time."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics import deadline
from hemivar.branches import find_solutions, follow_path
from hemivar.laws import ContactLaw, Tresca, table_law
from hemivar.solvers import Controls
from tests.certificates.problems import survey_softening
from tests.counting import at_most_calls, time_by_looks
from tests.problems import discrete_square


def test_search_and_path_end_with_their_time() -> None:
    problem = survey_softening(3.0, n=3)
    found = find_solutions(problem, controls=Controls(max_time=1e-6))
    assert not found.exhaustive
    assert "time limit" in found.searched


def test_a_path_ends_with_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = survey_softening(3.0, n=3)
    assert follow_path(problem).reached_end
    calls = 0

    def late(self: deadline.Budget) -> None:
        nonlocal calls
        calls += 1
        if calls > 4:
            raise deadline.OutOfTime

    monkeypatch.setattr(deadline.Budget, "check", late)
    path = follow_path(problem, max_time=60.0)
    assert not path.reached_end
    assert "time limit" in path.ended
    assert 1 < len(path) < 9


def test_long_tables_are_laid_out_only_where_the_margin_does_not_decide() -> None:
    r = np.linspace(0.0, 1.0, 30_001)
    convex = table_law(r, np.tanh(20.0 * r))
    with at_most_calls(100_000):
        found = find_solutions(discrete_square(n=4).with_(law=ContactLaw(convex, Tresca(0.5))))
    assert found.exhaustive
    assert len(found) == 1


def test_laying_out_a_long_table_obeys_the_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    r = np.linspace(0.0, 1.0, 30_001)
    softening = table_law(r, np.sin(40.0 * r))
    time_by_looks(monkeypatch)
    with at_most_calls(300_000):
        found = find_solutions(
            discrete_square(n=4).with_(law=ContactLaw(softening, Tresca(0.5))), controls=Controls(max_time=0.2)
        )
    assert not found.exhaustive
    assert "time limit" in found.searched
