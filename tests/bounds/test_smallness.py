"""The constants, against dense eigenproblems and closed forms."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hemivar.certificates import smallness
from hemivar.certificates.smallness import trace_constants
from hemivar.fem import discretize
from hemivar.gallery import survey_cube
from hemivar.laws import Compliance, ContactLaw, Friction, Softening
from hemivar.mechanics import Contact, ContactProblem
from hemivar.solvers import solve
from hemivar.systems.workspace import Workspace
from tests.certificates.problems import survey_softening


def test_the_survey_condition_of_a_law_without_softening_holds_whatever_the_trace() -> None:
    problem = survey_softening(1.5)
    softened = smallness(problem)
    assert softened.trace_constant is not None
    assert softened.trace_bound is not None
    assert softened.trace_constant < softened.trace_bound  # that of the body is larger than that of a mesh
    assert softened.m_A == pytest.approx(8.0)
    assert softened.survey_margin == pytest.approx(1.0 - 1.5 * softened.trace_bound**2 / 8.0)
    assert softened.survey_condition == (softened.survey_margin > 0.0)
    steep = smallness(survey_softening(20.0))
    assert steep.survey_condition is False
    assert steep.survey_margin < 0.0
    convex = smallness(problem.with_(law=ContactLaw(Compliance(3.0), Friction(0.1)).at(problem.contact.points)))
    assert (convex.survey_condition, convex.survey_margin) == (True, 1.0)
    assert smallness(problem, trace_constant=False).survey_condition is None
    assert smallness(problem, trace_constant=False).m_A == pytest.approx(8.0)


def softening_cube(alpha: float, n: int = 2) -> ContactProblem:
    return replace(survey_cube("5.1", n), contact={"bottom": Contact(Softening(3.0, 0.1, alpha), Friction(0.5))})


def test_the_survey_condition_in_space_speaks_of_the_body_where_that_is_asked_for() -> None:
    """Clamped at its sides: c_gamma of the body is larger than on a mesh, which finer ones approach from below."""
    cube, kept = softening_cube, Workspace()
    finer = trace_constants(discretize(cube(0.5, 6))).both
    found = smallness(discretize(cube(0.5)), workspace=kept)
    assert found.trace_constant is not None
    assert found.trace_bound is not None
    assert found.trace_constant < finer < found.trace_bound < 1.2 * finer
    assert found.survey_margin == pytest.approx(1.0 - 0.5 * found.trace_bound**2 / found.m_A)
    assert found.survey_condition is True
    middle = 0.5 * (found.trace_constant**-2 + found.trace_bound**-2) * found.m_A  # between both
    for alpha, holds in ((middle, None), (1.01 * found.m_A / found.trace_constant**2, False)):
        other = smallness(discretize(cube(alpha)), workspace=kept)
        assert other.survey_condition is holds
        assert other.survey_margin < 0.0


@pytest.mark.slow
def test_a_certificate_in_space_judges_the_survey_condition_of_the_body_beside_the_exact_distance() -> None:
    solution, kept = solve(softening_cube(0.5)), Workspace()
    assert solution.certify(workspace=kept).smallness.trace_bound is None  # it takes longer than such a solve
    sure = solution.certify(exact=True, workspace=kept).smallness
    assert sure.trace_bound == smallness(solution.problem, workspace=kept).trace_bound
