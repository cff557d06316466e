"""What takes one problem refuses a sequence of load steps, in one sentence and before any work."""

from __future__ import annotations

from collections.abc import Callable

import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.mechanics import Step

STEPS = [Step("press", tractions={"top": (0.0, -1.0)}), Step("pull", tractions={"top": (0.1, -1.0)})]
TASKS: dict[str, Callable[[hv.ContactProblem], object]] = {
    "all solutions": hv.find_solutions,
    "path": hv.follow_path,
    "load bracket": hv.branches.load_bracket,
    "adaptive": hv.bounds.solve_adaptive,
    "study": hv.study,
}


@pytest.mark.parametrize("task", TASKS)
def test_a_task_for_one_problem_refuses_load_steps(task: str) -> None:
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 2), hv.Material.young(10.0, 0.3), {"bottom": hv.Contact(hv.Signorini())},
        {"left": "roller"}, steps=STEPS,
    )  # fmt: skip
    with pytest.raises(ProblemError, match="load steps"):
        TASKS[task](problem)
