"""A keyword that there is not is answered by one sentence."""

from __future__ import annotations

import pytest

import hemivar as hv
from tests.problems import square


def test_an_unknown_keyword_is_named_with_its_neighbour() -> None:
    problem = square(n=2)
    with pytest.raises(hv.errors.ProblemError, match=r"find_solutions .*did you mean 'starts'\?"):
        hv.find_solutions(problem, start=3)
    with pytest.raises(hv.errors.ProblemError, match=r"study has no argument 'exakt'; did you mean 'exact'\?"):
        hv.study(problem, exakt=True)
