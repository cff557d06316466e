"""The gallery's problems have the solutions they claim."""

from typing import Any

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.gallery import BEAM_DISPLACEMENTS, beam, elastic_bar, manufactured_spring, survey
from hemivar.gallery.known import elastic_bar_penetrations, weighted_block
from hemivar.gallery.survey_problems import SURVEY_DATA, SurveyData
from hemivar.laws import Softening, ThresholdCompliance
from hemivar.mechanics import ContactProblem
from hemivar.solvers import Solution, solve


def solution_of(problem: ContactProblem) -> Solution:
    return solve(discretize(problem)).raise_for_status()


def test_survey_has_its_data_and_every_figure_is_solved() -> None:
    for key, data in SURVEY_DATA.items():
        problem = survey(key, 4)
        assert problem.body_force == data.body_force
        assert "h_tau" in data.text
        solution = solution_of(problem)
        assert np.abs(solution.friction).max() <= data.friction_bound * (1 + 1e-9)
    own = survey(SurveyData((0.0, -1.0), 0.2, 0.1, 1.0), 4)
    assert own.title == "survey's body, own data"


@pytest.mark.parametrize(("n", "largest"), [(32, 0.4986), (64, 0.4988)])
def test_figure_3_sticks_just_below_its_bound(n: int, largest: float) -> None:
    solution = solution_of(survey("figure3", n))
    assert np.abs(solution.friction).max() == pytest.approx(largest, abs=5e-5)
    assert np.abs(solution.slip).max() == 0.0


def test_unknown_survey_data_are_refused() -> None:
    with pytest.raises(ProblemError, match="figure1"):
        survey("figure7")


def test_softening_bar() -> None:
    solution = solve(elastic_bar()).raise_for_status()
    assert solution.penetration[0] == pytest.approx(0.3, rel=1e-12)
    assert elastic_bar_penetrations(1.0, 0.4, 2.0, 0.1, 0.5) == pytest.approx((0.3,))


def test_bar_with_three_solutions() -> None:
    exact = elastic_bar_penetrations(1.0, 0.25, 2.0, 0.1, 2.0)
    assert exact == pytest.approx((1 / 12, 0.15, 0.25))
    found = solve(elastic_bar(Softening(2.0, 0.1, 2.0), load=0.5)).raise_for_status()
    assert min(abs(found.penetration[0] - r) for r in exact) < 1e-12


@pytest.mark.parametrize(("load", "q", "p"), [(0.8, 0.1, 3.0), (0.8, 0.5, 1.0), (-0.8, 0.1, 1.0)])
def test_convex_bar(load: float, q: float, p: float) -> None:
    solution = solve(elastic_bar(ThresholdCompliance(q, p), 5, load=load)).raise_for_status()
    free = load / 2
    expected = max(free - q, 0.0) / (1.0 + p) if free > 0 else free
    assert solution.penetration[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("arguments", [{"elements": 0}, {"rigidity": -1.0}])
def test_bar_refuses_nonsense(arguments: dict[str, Any]) -> None:
    with pytest.raises(ProblemError, match="positive"):
        elastic_bar(**arguments)


def test_bar_with_a_vertical_branch_is_refused() -> None:
    with pytest.raises(ProblemError, match="interval"):
        elastic_bar_penetrations(1.0, 0.4, 2.0, 0.1, 1.0)


def test_patch_of_the_block_is_exact() -> None:
    known = weighted_block(n=4, top_displacement=0.1)
    solution = solution_of(known.problem)
    points = known.problem.mesh.points
    assert np.abs(solution.displacement - known.displacement(points)).max() < 1e-14
    assert solution.penetration == pytest.approx(0.9 / 14, rel=1e-12)
    assert solution.pressure == pytest.approx(known.pressure(solution.problem.contact.points), rel=1e-12)


@pytest.mark.parametrize("weight", [0.3, 2.0])
def test_block_under_its_own_weight(weight: float) -> None:
    known = weighted_block(n=8, weight=weight)
    solution = solution_of(known.problem)
    points = known.problem.mesh.points
    assert solution.normal_force == pytest.approx(float(known.pressure(points)[0]), rel=1e-9)
    assert np.abs(solution.displacement - known.displacement(points)).max() < 2e-3 * weight


def test_block_needs_constant_parameters() -> None:
    with pytest.raises(ProblemError, match="with numbers only"):
        weighted_block(ThresholdCompliance(lambda x: x[:, 0], 1.0))


def test_manufactured_solution_is_approached() -> None:
    errors = {}
    for order, n in ((1, 8), (1, 16), (2, 4), (2, 8)):
        known = manufactured_spring(n, order=order)
        solution = solution_of(known.problem)
        off = solution.displacement - known.displacement(solution.problem.field.nodes)
        errors[order, n] = float(np.sqrt(np.mean(off**2)))
    assert errors[1, 8] / errors[1, 16] > 3.0
    assert errors[2, 4] / errors[2, 8] > 7.0


def test_beam() -> None:
    solution = solution_of(beam())
    points = solution.problem.field.mesh.points
    for place, expected in BEAM_DISPLACEMENTS.items():
        node = int(np.argmin(np.linalg.norm(points - place, axis=1)))
        assert solution.displacement[node] == pytest.approx(expected, abs=5e-9)
