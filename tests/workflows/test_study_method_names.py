"""``method=``: a name or an object, with the same result wherever it is taken."""

from __future__ import annotations

import pytest

import hemivar as hv
from hemivar import workflows
from hemivar.solvers import METHODS, Controls
from tests.problems import square


def test_workflows_and_adaptive_solves_take_a_name() -> None:
    problem = hv.discretize(square(n=4))
    for method in ("multigrid", METHODS["multigrid"]):
        found = workflows.result_of(workflows.run(problem, workflows.RunOptions(method, Controls())))
        assert found.solution.method == "multigrid"
    adapted = hv.bounds.solve_adaptive(hv.gallery.survey("5.1", 2), rtol=0.5, method="multigrid")
    assert adapted.solution.method == "multigrid"
    assert hv.study(square(n=2), 1, method="multigrid").levels[0].solution.method == "multigrid"


def test_a_method_that_there_is_not_is_refused_before_any_work() -> None:
    for make in (
        lambda: hv.march(hv.Evolution(square(n=2)), 0.1, method="nwton"),
        lambda: hv.study(square(n=2), 1, method="nwton"),
        lambda: workflows.StudyOptions(method="nwton"),
        lambda: workflows.result_of(workflows.run(square(n=2), workflows.RunOptions("nwton"))),
        lambda: hv.bounds.solve_adaptive(hv.gallery.survey("5.1", 2), method="nwton"),
    ):
        with pytest.raises(hv.errors.MethodError, match="did you mean 'newton'"):
            make()
    with pytest.raises(hv.errors.MethodError, match="pass one with its options"):
        hv.march(hv.Evolution(square(n=2)), 0.1, method=type(METHODS["newton"]))
    with pytest.raises(hv.errors.ProblemError, match="solver"):
        hv.march(hv.Evolution(square(n=2)), 0.1, solver=METHODS["newton"])
