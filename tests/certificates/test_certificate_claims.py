"""What a certificate claims of a point, and the words in which it does."""

from __future__ import annotations

from dataclasses import MISSING, fields, replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.certificates import Certificate, PointKind, certify
from hemivar.certificates.smallness import Smallness
from hemivar.discrete import DiscreteProblem
from hemivar.laws import (
    Capped,
    Compliance,
    ContactLaw,
    Friction,
    NoFriction,
    PenetrationBound,
    PiecewiseQuadratic,
    Signorini,
    ThresholdCompliance,
)
from tests import bodies
from tests.certificates.problems import bar_problem, bar_unknowns, softening


def test_where_no_energy_is_least_nothing_is_said_of_other_solutions() -> None:
    """On a slope that falls for ever the energy has no lower bound, and so no other point that must be a solution."""
    endless = ContactLaw(PiecewiseQuadratic([0.0], [-2.0, -2.0], [0.0]), NoFriction())  # type: ignore[arg-type]
    found = certify(bodies.points_on_springs(1.0, [-0.5], endless), np.array([0.5]))  # u - 2 u = f
    assert (found.kind, found.unique) == (PointKind.MAXIMUM, None)
    ends = ContactLaw(softening(8.0, 0.1, 2.0), NoFriction())
    found = certify(bodies.points_on_springs(1.0, [0.15 + 0.8 - 0.1], ends), np.array([0.15]))
    assert (found.kind, found.unique) == (PointKind.MAXIMUM, False)


def test_a_convex_law_leaves_global_minimisers_only() -> None:
    """A body that is constrained by contact only: its stiffness does not show that the solution is the only one."""
    K = np.array([[1.0, -1.0], [-1.0, 1.0]])
    problem = DiscreteProblem.of_arrays(
        K, np.array([1.0, 0.0]), np.array([[0.0, 1.0]]), np.ones(1), np.zeros(1), ContactLaw(Signorini())
    )
    found = certify(problem, np.array([1.0, 0.0]), np.array([[1.0]]))
    assert (found.kind, found.unique, found.direction) == (PointKind.GLOBAL_MINIMISER, None, None)
    assert (found.margin, found.error_bound) == (-np.inf, np.inf)
    assert found.equilibrium == np.inf
    assert found.equilibrium_relative == np.inf
    soft = problem.with_(law=ContactLaw(ThresholdCompliance(0.1, 10.0)))
    off = certify(soft, np.array([50.0, 49.0]), np.array([[1.0]]))
    assert off.kind is PointKind.NOT_STATIONARY


def test_a_pair_that_is_off_is_not_called_stationary_but_its_problem_may_have_one_solution() -> None:
    problem = bodies.points_on_springs(1.0, [1.0], ContactLaw(Compliance(3.0)))
    found = certify(problem, np.array([0.3]))
    assert (found.kind, found.unique, found.stationary) == (PointKind.NOT_STATIONARY, True, False)
    assert (found.curvature, found.direction) == (None, None)
    exact = certify(problem, np.array([0.25]))
    assert (exact.kind, exact.unique, exact.stationary) == (PointKind.UNIQUE_MINIMISER, True, True)


@pytest.mark.parametrize(("off", "tolerance", "expected"), [(1e-3, 1e-2, True), (1e-3, 1e-4, False), (0.0, 0.0, True)])
def test_stationary_is_a_matter_of_the_tolerance(off: float, tolerance: float, expected: bool) -> None:
    """A pair that is off by a thousandth of the load, in equilibrium alone."""
    problem = bodies.points_on_springs(1.0, [1.0], ContactLaw(Compliance(3.0)))
    found = certify(problem, np.array([0.25]), np.array([[0.75 + off]]), tolerance=tolerance)
    assert found.stationary is expected


@pytest.mark.parametrize("rate", [0.1, 0.8])
def test_where_the_bound_depends_on_the_solution_there_is_no_energy_to_minimise(rate: float) -> None:
    law = ContactLaw(Compliance(1.0), Friction(PenetrationBound(([0.0, 1.0], [0.0, rate]))))
    problem = DiscreteProblem.of_arrays(
        np.diag([1.0, 0.5]), np.array([1.0, 0.0]), np.eye(2), np.ones(1), np.zeros(1), law
    )
    found = certify(problem, np.array([0.5, 0.0]), np.array([[0.5, 0.0]]))
    assert found.stationary
    if rate < np.sqrt(0.5):
        assert (found.kind, found.unique) == (PointKind.UNIQUE_SOLUTION, True)
    else:
        assert (found.kind, found.unique) == (PointKind.BOUND_FIXED_MINIMISER, None)


def test_distances_and_sizes_of_a_pair_by_hand() -> None:
    """Stiffness 4, foundation 2 over a weight 3, load 10: u = 1, and a pressure that is off by 0.1."""
    problem = DiscreteProblem.of_arrays([[4.0]], [10.0], np.eye(1), [3.0], [0.0], ContactLaw(Compliance(2.0)))  # type: ignore[arg-type]
    found = certify(problem, np.array([1.0]), np.array([[2.1]]), tolerance=0.1)
    assert found.equilibrium == pytest.approx(0.3 / 2.0)
    assert found.equilibrium_relative == pytest.approx(0.03)
    assert found.inclusion_distance == pytest.approx(0.1)
    assert found.inclusion == pytest.approx(3.0 * 0.1)
    assert found.inclusion_relative == pytest.approx(found.inclusion / 10.0)
    assert found.energy == pytest.approx(2.0 - 10.0 + 3.0)
    assert found.error_bound_relative == pytest.approx(found.error_bound / 2.0)
    assert (found.method, found.stationary) == ("factorisation", True)
    at_rest = certify(problem.with_(load=np.zeros(1)), np.zeros(1))
    assert (at_rest.error_bound_relative, at_rest.equilibrium_relative) == (at_rest.error_bound, 0.0)


def said(certificate: Certificate, label: str, whole: bool = True) -> str:
    """What is written behind a label."""
    return next((line[18:] for line in certificate.lines(whole) if line.startswith(f"{label:<18}")), "")


def test_every_number_has_its_words() -> None:
    sure = certify(bar_problem(0.4, 2.0, 0.1, 0.5), bar_unknowns(0.4, 0.3))
    constants = sure.smallness
    assert said(sure, "margin") == "0.5 (c = 0.5)"
    both = replace(sure, smallness=replace(constants, constant_normal=0.25, constant_tangential=0.125))
    assert said(both, "margin") == "0.5 (c = 0.5, normal 0.25, tangential 0.125)"
    for one in ({"constant_normal": 0.0}, {"constant_tangential": 0.0}, {"constant_normal": None}):
        assert said(replace(both, smallness=replace(both.smallness, **one)), "margin") == "0.5 (c = 0.5)"  # type: ignore[arg-type]
    coupled = replace(sure, smallness=replace(constants, coupling=0.25, m_L=3.0, contraction=0.5))
    assert said(coupled, "margin") == "0.5 (c = 0.5, coupling 0.25)"
    assert said(coupled, "m_L") == "3, contraction of the outer fixed point 0.5"
    assert said(sure, "m_L") == ""
    assert said(sure, "m_A") == said(sure, "trace constant") == said(sure, "survey's (H_s)") == said(sure, "note") == ""
    full = replace(constants, m_A=8.0, trace_constant=1.5, survey_condition=True, survey_margin=0.25)
    assert said(replace(sure, smallness=full), "m_A") == "8"
    assert said(replace(sure, smallness=full), "trace constant") == "1.5"
    assert said(replace(sure, smallness=full), "survey's (H_s)") == "holds on this mesh, margin 0.25"
    bounded = replace(full, trace_bound=1.75)
    assert said(replace(sure, smallness=bounded), "survey's (H_s)") == "holds, margin 0.25"
    assert said(replace(sure, smallness=bounded), "trace constant") == (
        "1.5 on this mesh; for the continuous body at most 1.75"
    )
    between = replace(bounded, survey_condition=None, survey_margin=-0.25)
    told = "holds on this mesh; for the continuous body it is not known, margin -0.25"
    assert said(replace(sure, smallness=between), "survey's (H_s)") == told
    failing = replace(full, survey_condition=False, survey_margin=-1.0)
    assert said(replace(sure, smallness=failing), "survey's (H_s)") == "does not hold on this mesh, margin -1"
    assert "from samples only" in said(replace(sure, smallness=replace(constants, alpha_sampled=True)), "note")
    assert "from samples only" in said(replace(sure, smallness=replace(constants, m_L_sampled=True)), "note")
    assert said(replace(sure, curvature=0.5), "least curvature", whole=False) == "0.5 (the body alone: 1)"
    assert said(replace(sure, warnings=("it may lock",)), "warning", whole=False) == "it may lock"
    for label in ("equilibrium", "inclusion", "residual", "energy", "alpha", "margin", "left out", "least curvature"):
        assert said(sure, label, whole=False) == ""


def test_bounds_are_called_what_they_are() -> None:
    sure = certify(bar_problem(0.4, 2.0, 0.1, 0.5), bar_unknowns(0.4, 0.3))
    assert said(sure, "kind").endswith("the only solution")
    assert said(sure, "distance").startswith("at most ")
    sampled = replace(
        sure, unique=None, error_bound_sampled=True, smallness=replace(sure.smallness, alpha_sampled=True)
    )
    assert said(sampled, "kind").endswith("uniqueness not known (the margin is positive, but sampled)")
    assert said(sampled, "distance").startswith("about ")
    assert "an estimate" in said(sampled, "distance")
    negative = replace(sampled, margin=-1.0, error_bound=np.inf)
    assert said(negative, "kind").endswith("uniqueness not known")
    assert said(negative, "distance", whole=False) == "no bound, because the margin is not positive"
    assert said(negative, "margin", whole=False) == "-1 (c = 0.5)"
    for part in ("margin", "error bound"):
        late = replace(negative, left_out=(part, "kind"))
        assert said(late, "distance") == "no bound, because the time limit was reached"
        assert said(late, "left out") == f"{part}, kind: the time limit was reached"
    other = replace(negative, left_out=("trace constant",))
    assert said(other, "distance") == "no bound, because the margin is not positive"


def test_a_margin_of_minus_infinity_is_explained() -> None:
    """A block that only its foundation holds, by a convex law; and a held one on a law that gives way at once."""
    spring, one, none = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.ones(1), np.zeros(1)
    law = ContactLaw(Compliance(2.0))
    free = DiscreteProblem.of_arrays(spring, np.array([1.0, 0.0]), np.array([[1.0, 0.0]]), one, none, law)
    text = "\n".join(certify(free, np.array([0.5, 0.5])).lines())
    assert "margin            uniqueness is not known: " in text
    assert "the supports alone do not constrain the body" in text
    mesh, pressed = hv.rectangle((2.0, 1.0), (4, 2)), {"top": (0.0, -1.0)}
    block = hv.ContactProblem(
        mesh, hv.Material.young(1e3, 0.3), {"bottom": hv.Contact(Compliance(50.0))}, {"left": hv.Roller()},
        tractions=pressed,
    )  # fmt: skip
    text = "\n".join(certify(hv.solve(block)).lines())
    assert "margin            none, and the solution is the only one all the same: the supports alone" in text
    assert "not known" not in text
    held = DiscreteProblem.of_arrays(np.eye(1), one, np.eye(1), one, none, ContactLaw(Capped(2.0, 0.1)))
    text = "\n".join(certify(held, np.array([1.0])).lines())
    assert "margin            uniqueness is not known: " in text
    assert "drops discontinuously" in text
    assert "supports" not in text


def test_a_certificate_made_of_its_numbers_alone_is_whole_and_proved() -> None:
    """As another engine makes it: nothing sampled, nothing left out, no time spent."""
    given = certify(bar_problem(0.4, 2.0, 0.1, 0.5), bar_unknowns(0.4, 0.3))
    numbers = {item.name: getattr(given, item.name) for item in fields(given) if item.default is MISSING}
    made = Certificate(**numbers)
    assert (made.seconds, made.warnings, made.error_bound_sampled, made.left_out) == (0.0, (), False, ())
    assert made.lines()[:-1] == given.lines()[:-1]
    constants = {
        item.name: getattr(given.smallness, item.name) for item in fields(Smallness) if item.default is MISSING
    }
    assert not Smallness(**constants).sampled


def test_an_ellipticity_of_samples_is_told() -> None:
    """Moduli that are functions may be less between the points of a rule: m_A = 1 / 1.2 was told as 0.842."""
    contact = hv.Softening(1.0, 0.1, 0.05)
    stated = bodies.square(
        contact, 4, "cross", material=hv.Material.young(lambda x: 1.0 + 0.5 * x[:, 0], 0.2), body_force=(0.0, -0.1)
    )
    lines = "\n".join(hv.certify(hv.solve(stated)).lines(whole=True))
    assert "at the points of a rule" in lines
    assert "as far as samples of the material show" in lines
    even = "\n".join(hv.certify(hv.solve(replace(stated, material=hv.Material.young(1.0, 0.2)))).lines(whole=True))
    assert "samples" not in even
    assert "rule" not in even
