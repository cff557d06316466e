"""The constants, against dense eigenproblems and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from hemivar.certify import ellipticity, one_solution, smallness, trace_constants
from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.fem.assembly import stiffness_matrix
from hemivar.gallery import survey
from hemivar.laws import Compliance, ContactLaw, Friction, PenetrationBound
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import rectangle
from tests.certify.problems import bar_problem, softening, square, weakening


def test_bar():
    found = smallness(bar_problem(0.4, 2.0, 0.1, 0.5))
    assert found.constant == pytest.approx(0.5, rel=1e-10)  # alpha / kappa
    assert found.margin == pytest.approx(0.5, rel=1e-10)
    assert found.m_A is None
    assert found.trace_constant is None
    assert found.survey_condition is None
    assert smallness(bar_problem(0.4, 2.0, 0.1, 2.0)).margin == pytest.approx(-1.0, rel=1e-10)


@pytest.mark.parametrize("n", [4, 20])
def test_constant_is_the_largest_eigenvalue(n):
    """Small and many contact points take different paths."""
    problem = square(1.5, n=n, friction=Friction(0.05, weakening(0.4, 10.0)))
    found = smallness(problem)
    B, K, w, d = (
        problem.contact.trace.toarray(),
        problem.linear.stiffness.toarray(),
        problem.contact.weights,
        problem.contact.components,
    )

    def top(normal: float, tangential: float) -> float:
        weight = np.tile([normal, tangential], len(w)) * np.repeat(w, d)
        return float(la.eigh(B.T @ (weight[:, None] * B), K, eigvals_only=True)[-1])

    assert found.alpha_tangential == pytest.approx(0.5)
    assert found.constant == pytest.approx(top(1.5, 0.5), rel=1e-6)
    assert found.constant_normal == pytest.approx(top(1.5, 0.0), rel=1e-6)
    assert found.constant_tangential == pytest.approx(top(0.0, 0.5), rel=1e-6)
    assert found.constant >= top(1.5, 0.5) * (1.0 - 1e-12)
    assert max(found.constant_normal, found.constant_tangential) <= found.constant
    assert found.constant <= found.constant_normal + found.constant_tangential
    # the discrete margin is sharper than the survey's condition
    assert found.survey_margin is not None
    assert found.margin >= found.survey_margin


@pytest.mark.parametrize(("rate", "alpha"), [(0.3, 0.0), (1.2, 0.5), (3.0, 0.9), (0.3, 1.8)])
def test_margin_of_one_point_with_a_bound_that_depends_on_the_penetration(rate: float, alpha: float) -> None:
    """c = alpha / k_nu, coupling = L / sqrt(k_nu k_tau), and both count."""
    stiffness = np.diag([1.5, 6.0])
    normal = softening(2.0, 0.1, alpha) if alpha > 0.0 else Compliance(1.0)
    law = ContactLaw(normal, Friction(PenetrationBound(([0.0, 1.0], [0.0, rate]))))
    problem = DiscreteProblem.of_arrays(stiffness, np.ones(2), np.eye(2), np.ones(1), np.zeros(1), law)
    found = smallness(problem)
    coupling = rate / np.sqrt(1.5 * 6.0)
    assert found.coupling == pytest.approx(coupling, rel=1e-10)
    assert found.constant == pytest.approx(alpha / 1.5, rel=1e-10)
    assert found.margin == pytest.approx(1.0 - alpha / 1.5 - coupling, rel=1e-10)
    assert found.contraction == (pytest.approx(coupling / (1.0 - alpha / 1.5)) if alpha < 1.5 else np.inf)
    assert found.m_L == pytest.approx(rate)
    assert one_solution(problem, found) == (found.margin > 0.0)


def test_trace_constant_by_a_dense_eigenproblem():
    problem = discretize(survey("5.1", 6))
    found = trace_constants(problem)
    assert problem.field is not None
    P = problem.field.basis.toarray()
    V = P.T @ stiffness_matrix(problem.field.mesh, Material.lame(0.0, 0.5)).toarray() @ P
    B = problem.contact.trace.toarray()
    w = np.repeat(problem.contact.weights, 2)
    assert found.both**2 == pytest.approx(la.eigh(B.T @ (w[:, None] * B), V, eigvals_only=True)[-1], rel=1e-8)
    assert max(found.normal, found.tangential) < found.both < np.hypot(found.normal, found.tangential)


def test_trace_constant_converges():
    values = [trace_constants(discretize(survey("5.1", n))).both for n in (8, 16, 32)]
    assert values[0] < values[1] < values[2]
    assert values[2] - values[1] < 0.5 * (values[1] - values[0])
    assert values[2] == pytest.approx(1.8345, abs=2e-3)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (Material.lame(4.0, 4.0), 8.0),
        (Material.lame(-1.0, 4.0), 6.0),  # 2 mu + 2 lam is the smaller one
        (Material.tensor(np.diag([5.0, 6.0, 1.5])), 3.0),
        (Material.lame(4.0, lambda x: 4.0 + x[:, 0]), 8.0),
    ],
)
def test_ellipticity(material, expected):
    problem = ContactProblem(
        mesh=rectangle((1.0, 1.0), (16, 16)), material=material, supports={"left": Clamped()},
        contact={"bottom": Contact(softening(1.0, 0.1, 0.1))}, body_force=(0.0, -0.1),
    )  # fmt: skip
    assert ellipticity(problem) == pytest.approx(expected, rel=5e-3)
