"""A stored solution of a body that the stress of its load stiffens has that stress."""

from __future__ import annotations

import pytest

import hemivar as hv
from hemivar.files.stored_solution import StoredSolution
from tests.solvers.test_stiffening import EULER, leaning


def test_reactions_and_energy_are_those_of_the_solution() -> None:
    problem = leaning(0.6, 0.03)
    solution, discrete = hv.solve(problem), hv.discretize(problem)
    kept = StoredSolution.of_line(StoredSolution.of(0, solution).line()).solution(discrete)
    assert kept.reactions["left"] == pytest.approx([0.6 * EULER, -0.03 * 0.6 * EULER], rel=1e-6)
    assert kept.energy == pytest.approx(solution.energy, rel=1e-12)
