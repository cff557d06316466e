"""Problems between the unloaded body and the loaded one are those of the scaled data."""

from __future__ import annotations

import re

import pytest

from hemivar.branches import follow_path
from hemivar.errors import ProblemError
from hemivar.fem import LoadLine, discretize
from hemivar.laws import Compliance
from tests.fem.test_load_line import in_proportion
from tests.problems import bar


def test_constant_loads_are_names_of_loads() -> None:
    problem = discretize(in_proportion(1.0))
    for constant, said in (
        (["lefft"], "no load 'lefft'; did you mean 'left'"),
        (["top"], "no load 'top' (known: left); its loads are left"),
    ):
        with pytest.raises(ProblemError, match=re.escape(said)):
            LoadLine.to(problem, constant)
    for constant in ("left", 3, [2]):
        with pytest.raises(ProblemError, match="give names of loads, such as"):
            follow_path(problem, constant=constant)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="named in a ContactProblem"):
        LoadLine.to(bar(1.0, Compliance(5.0)), ["left"])
    with pytest.raises(ProblemError, match="either unloaded= or constant="):
        follow_path(problem, unloaded=problem, constant=["left"])
