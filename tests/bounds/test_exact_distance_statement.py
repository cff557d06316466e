"""What a certificate says of the distance to the exact solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds import exact_distance
from hemivar.bounds.exact_certificate import distance_to_exact
from hemivar.bounds.stated_distance import DistanceToExact
from hemivar.bounds.trace_bounds import body_constants
from hemivar.gallery import survey


@pytest.fixture(scope="module")
def workspace() -> hv.systems.Workspace:
    return hv.systems.Workspace()


@pytest.fixture(scope="module")
def solution(workspace: hv.systems.Workspace) -> hv.Solution:
    return hv.solve(survey("5.1", 4), workspace=workspace)


def test_a_certificate_holds_the_distance_where_it_is_asked_for(
    solution: hv.Solution, workspace: hv.systems.Workspace
) -> None:
    assert solution.certify().exact is None
    certificate = hv.certify(solution, exact=True, workspace=workspace)
    found = certificate.exact
    assert found is not None
    stated = solution.problem.origin
    assert isinstance(stated, hv.ContactProblem)
    expected = exact_distance(stated, solution.displacement, body_constants(solution.problem, workspace))
    assert (found.bound, found.relative, found.guaranteed) == (expected.distance, expected.relative, True)
    assert found.parts["misfit"] == expected.parts.misfit
    text = repr(certificate)
    assert "exact solution    at most " in text
    assert float(text.split("exact solution    at most ")[1].split()[0]) >= found.bound  # rounded upwards
    record = certificate.record()["exact"]
    assert record["bound"] == found.bound
    assert record["reasons"] == []
    assert "guaranteed up to rounding and quadrature" in certificate._repr_html_()


def test_any_displacement_is_bounded(solution: hv.Solution, workspace: hv.systems.Workspace) -> None:
    """One that solves nothing is farther away, by what it lacks for equilibrium, and called an estimate."""
    best = distance_to_exact(solution.problem, solution.unknowns, workspace=workspace)
    other = distance_to_exact(solution.problem, 1.1 * solution.unknowns, workspace=workspace)
    K = solution.problem.stiffness
    apart = 0.1 * np.sqrt(solution.unknowns @ (K @ solution.unknowns))
    assert other.bound > best.bound
    assert other.bound >= apart - best.bound
    assert other.parts["algebraic"] > best.parts["algebraic"]


def test_where_there_is_none(solution: hv.Solution, workspace: hv.systems.Workspace) -> None:
    problem, u = solution.problem, solution.unknowns

    def why(problem: hv.DiscreteProblem, u: np.ndarray, **options: float) -> str:  # type: ignore[type-arg]
        found = distance_to_exact(problem, u, workspace=workspace, **options)
        assert not found.known
        assert not found.guaranteed
        assert found.lines() == [f"exact solution    no bound of the distance: {found.why}"]
        assert found.record()["bound"] is None
        return found.why

    assert "time limit" in why(problem, u, max_time=0.0)
    changed = "not those of the stated problem"
    assert changed in why(problem.with_(load=1.01 * problem.load), u)
    assert changed in why(problem.with_(offset=problem.offset + 1e-3), u)
    stiffer = hv.discretize(
        replace(survey("5.1", 4), contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.1))})
    )
    assert changed in why(problem.with_(law=stiffer.law), u)
    arrays = hv.DiscreteProblem.of_arrays(
        problem.stiffness, problem.load, problem.contact.trace, problem.contact.weights,
        problem.gap, problem.law,
    )  # fmt: skip
    assert "made of arrays" in why(arrays, u)


def test_words_of_an_estimate() -> None:
    found = DistanceToExact(0.1, 0.2, False, ("it is so", "and so"), 0.06, 0.03, 0.01, 0.0, 0.0, 0.25, 1.0)
    lines = found.lines()
    assert lines[0] == "exact solution    about 0.1 away, relative 20 %: an estimate, not a bound"
    assert lines[1].strip() == "made of misfit 12 %, contact 6 %, oscillation 2 %, c = 0.25; in 1 s"
    assert lines[2].strip() == "60 % of it is misfit: refine the mesh, as adaptive refinement does where it is needed"
    assert lines[3].strip() == "because it is so; and so"
    assert "no bound" in DistanceToExact.none("nothing is known").lines()[0]
    nothing = DistanceToExact.none("there is no bound: the foundation softens too much")
    assert nothing.lines() == ["exact solution    no bound of the distance: the foundation softens too much"]


@pytest.mark.parametrize(
    ("parts", "gap", "words"),
    [
        ((3.0, 1.0, 0.0, 0.0), 0.0, "75 % of it is misfit: refine the mesh"),
        ((1.0, 3.0, 0.0, 0.0), 0.0, "75 % of it is contact: refine the mesh along the contact boundary"),
        ((1.0, 0.0, 0.0, 0.0), 20.0, "80 % of it is contact"),  # 1 + 4 = (1 + sqrt(1 + 4 * 20)) / 2
        ((1.0, 0.0, 4.0, 0.0), 0.0, "80 % of it is oscillation: refine the mesh where the loads vary"),
        ((1.0, 0.0, 0.0, 3.0), 0.0, "75 % of it is algebraic: solve more accurately"),
    ],
)
def test_the_part_that_is_most_of_the_bound_is_named(parts: tuple[float, ...], gap: float, words: str) -> None:
    for c in (0.0, 0.4, 0.8):
        whole = sum(parts)
        bound = (whole + np.sqrt(whole**2 + 4.0 * (1.0 - c) * gap)) / (2.0 * (1.0 - c))
        found = DistanceToExact(bound, 0.1, True, (), *parts, gap, c)
        if c < 0.8 or words.startswith("80"):
            assert found.advice.startswith(words)
        else:  # 1 / (1 - c) is 5: 80 % of the bound is the margin
            assert found.advice.startswith("80 % of it is margin: softening (c) multiplies it by 5")
            assert words.replace("of it", "of the rest") in found.advice
        assert ("softening (c) multiplies it by" in found.advice) == (c == 0.8)
        assert found.advice in "\n".join(found.lines())
        assert found.record()["advice"] == found.advice
    assert DistanceToExact.none("nothing is known").advice == DistanceToExact(0.0, 0.0, True, ()).advice == ""


def test_without_numbers_it_says_why() -> None:
    unknown = DistanceToExact(np.inf, np.inf, False, ())
    assert unknown.lines() == [f"{'exact solution':<18}no bound of the distance: its numbers are not finite"]
    refused = DistanceToExact.none("there is no bound: the body is not held")
    assert refused.lines() == [f"{'exact solution':<18}no bound of the distance: the body is not held"]
