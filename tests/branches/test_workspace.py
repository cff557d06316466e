"""What a workspace spares certificates, searches and paths, and that it changes none of their answers."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import hemivar as hv
from hemivar.systems import Workspace
from tests.certificates.test_workspace import counted  # noqa: F401
from tests.problems import bar


def test_searches_and_paths_share_the_condensation(counted: list[str]) -> None:  # noqa: F811
    law = hv.laws.PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], [0.0, 0.0, 0.0])
    problem = bar(0.5, law)
    kept = Workspace()
    known = hv.find_solutions(problem, workspace=kept)
    assert counted.count("condensation") == 1
    counted.clear()
    assert len(hv.find_solutions(problem, enumerate_up_to=0, starts=3, workspace=kept)) == len(known)
    path = hv.follow_path(problem, workspace=kept)
    assert path.reached_end
    assert "condensation" not in counted


@pytest.mark.parametrize("call", [hv.find_solutions, hv.follow_path])
def test_something_else_is_no_workspace(call: Callable[..., object]) -> None:
    with pytest.raises(hv.errors.ProblemError, match="the workspace is"):
        call(bar(0.5, hv.Compliance(1.0)), workspace={})
