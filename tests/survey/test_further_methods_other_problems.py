"""The survey's methods on problems that other tests solve by the methods of the library."""

from __future__ import annotations

import pytest

import hemivar as hv
from tests.discrete import test_residual, test_space
from tests.linear import test_threads


@pytest.mark.parametrize("size", [1e100, 1e130])
@pytest.mark.parametrize("name", ["bundle", "direct-lbfgs"])
def test_sizes_near_the_ends_of_the_numbers(name: str, size: float) -> None:
    test_residual.test_sizes_near_the_ends_of_the_numbers(name, size)


def test_a_membrane_on_a_plane() -> None:
    test_space.test_a_membrane_on_a_plane("active-set")


def test_a_solve_changes_no_bit_of_problem_and_workspace() -> None:
    method = hv.survey.PrimalDualActiveSet()
    test_threads.test_a_solve_changes_no_bit_of_problem_and_workspace(test_threads.without_meshes, method)
