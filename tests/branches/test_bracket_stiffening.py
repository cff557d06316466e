"""Brackets of bodies that the stress of their load stiffens, and what refuses them."""

from __future__ import annotations

from dataclasses import replace

import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from tests.solvers.test_stiffening import BUCKLES, glued_block, leaning, pushed_cantilever


@pytest.mark.parametrize("function", [hv.find_solutions, hv.follow_path, hv.bounds.solve_adaptive])
def test_what_is_not_available_says_so(function: object) -> None:
    """All solutions, paths and adaptive solves."""
    problem = replace(pushed_cantilever(0.5 * BUCKLES), order=1, contact={"bottom": hv.Contact(hv.Signorini())})
    with pytest.raises(ProblemError, match="not available with stress stiffening"):
        function(problem)  # type: ignore[operator]


def test_the_problem_of_a_solution_is_the_one_that_was_stated() -> None:
    """It keeps no stress: a bracket and a path are those of the statement."""
    known = hv.solve(leaning(0.5, 1e-6)).problem
    assert hv.branches.load_bracket(known, upto=4.0).carried == pytest.approx(2.0, rel=0.02)
    for function in (hv.find_solutions, hv.follow_path):
        with pytest.raises(ProblemError, match="not available with stress stiffening"):
            function(known)


def test_glue_with_interference_carries_its_load() -> None:
    assert hv.branches.load_bracket(glued_block(), upto=2.0).carried == 2.0
