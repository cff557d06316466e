"""From the statement to the discrete problem, verified on problems with known answers."""

from __future__ import annotations

import pytest

from hemivar.fem import discretize
from hemivar.laws import ThresholdCompliance, Tresca
from hemivar.mechanics import Contact
from tests.fem.test_discretize import survey_problem


def test_points_without_friction_are_in_log_result_and_json(caplog: pytest.LogCaptureFixture) -> None:
    from hemivar.files import solution_record
    from hemivar.solvers import solve

    rough = Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.5))
    with caplog.at_level("INFO", logger="hemivar"):
        problem = discretize(survey_problem(2, contact={"bottom": rough, "right": rough}))
    assert any("friction is left out" in line for line in caplog.messages)
    solution = solve(problem)
    assert problem.warnings != ()
    assert solution.warnings[: len(problem.warnings)] == problem.warnings
    record = solution_record(solution)
    assert any("x = (1, 0)" in sentence for sentence in record["warnings"])
    contact = record["contact"]
    named = [x for x, without in zip(contact["x"], contact["without_friction"], strict=True) if without]
    assert named == [[1.0, 0.0], [1.0, 0.0]]
