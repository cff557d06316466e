"""The survey's own numbers: largest friction of Figure 3, orders of Figure 5, evaluations of Table 1."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hemivar.fem import discretize, interpolate, v_norm
from hemivar.gallery import survey
from hemivar.solvers import METHODS, solve, solve_nested
from hemivar.systems import Workspace


@pytest.mark.parametrize(("n", "largest"), [(32, 0.4986), (64, 0.4988), (128, 0.4990)])
def test_every_node_of_figure_3_sticks_just_below_the_bound(n: int, largest: float) -> None:
    found = solve(discretize(survey("figure3", n)))
    assert np.abs(found.friction).max() == pytest.approx(largest, abs=5e-5)
    np.testing.assert_array_equal(found.slip, 0.0)


def test_orders_of_figure_5() -> None:
    """Below 1 for the corners of the body are singular: 0.8 to 0.95, fitted without the mesh next to the reference."""
    sizes = (4, 8, 16, 32, 64, 128)
    *levels, reference = solve_nested([discretize(survey("5.1", n)) for n in sizes])
    field = reference.problem.field
    assert field is not None
    errors = []
    for level in levels:
        assert level.problem.field is not None
        lifted = interpolate(level.problem.field, level.displacement, field)
        errors.append(v_norm(field, lifted - reference.displacement))
    assert all(fine < coarse for coarse, fine in itertools.pairwise(errors))
    order = -np.polyfit(np.log(sizes[:-2]), np.log(errors[:-1]), 1)[0]
    assert 0.8 < order < 0.95


def test_powell_takes_about_as_many_evaluations_as_in_the_survey() -> None:
    """Table 1, h = 1/8, 1/16, 1/32, 1/64: 1027, 1397, 2832, 2748, with the survey's tolerances and warm start."""
    problems = [discretize(survey("5.1", n)) for n in (2, 4, 8, 16, 32, 64)]
    workspace = Workspace()
    solutions = solve_nested(problems, METHODS["direct-powell"], workspace=workspace)
    for found, theirs in zip(solutions[2:], (1027, 1397, 2832, 2748), strict=True):
        assert found.evaluations == pytest.approx(theirs, rel=0.35)
    # It stops about half a per cent short of the minimiser in the energy norm.
    exact = solve(problems[-1], workspace=workspace)
    v = solutions[-1].unknowns - exact.unknowns
    K = problems[-1].stiffness
    short = np.sqrt((v @ (K @ v)) / (exact.unknowns @ (K @ exact.unknowns)))
    assert 1e-4 < short < 0.02
