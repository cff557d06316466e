"""The bound of the error: it always holds, and is not far above the true error."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.special import lambertw

import hemivar
from hemivar.certificates import EnergyNorm, PointKind, bound, certify
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import ContactLaw, Friction, PenetrationBound, PiecewiseQuadratic, Signorini, Tresca
from hemivar.mechanics import Quadrature
from hemivar.solvers import Controls, solve
from tests import problems as plain
from tests.certificates.problems import (
    bar_problem,
    bar_solution,
    bar_unknowns,
    softening,
    survey_softening,
    weakening,
)
from tests.samples import sampled

FACTOR = 20.0


def true_error(problem: DiscreteProblem, u: np.ndarray, exact: np.ndarray) -> float:
    return EnergyNorm(problem.stiffness).norm(u - exact)


def check(
    problem: DiscreteProblem,
    u: np.ndarray,
    lam: np.ndarray,
    exact: np.ndarray,
    energy: EnergyNorm | None = None,
    slack: float = 0.0,
) -> float:
    """The bound holds; returns bound / error where the error is well above rounding."""
    certificate = certify(problem, u, lam, factor=energy, trace_constant=False)
    error = true_error(problem, u, exact)
    size = max(EnergyNorm(problem.stiffness).norm(exact), 1e-300)
    assert certificate.margin > 0.0
    assert certificate.error_bound >= error - slack
    return certificate.error_bound / error if error > 1e-9 * size else 1.0


def test_bar_with_a_known_solution() -> None:
    """E1 with alpha below the stiffness of the bar; displacement and multiplier disturbed at random."""
    rng = np.random.default_rng(3)
    worst = 0.0
    for _ in range(150):
        alpha, r0 = rng.uniform(0.01, 0.7), rng.uniform(-0.3, 0.7)
        problem = bar_problem(r0, 2.0, 0.1, alpha)
        r = bar_solution(r0, 2.0, 0.1, alpha)
        exact, lam = bar_unknowns(r0, r), np.array([[r0 - r]])
        shape = rng.choice([0, 1, 2])
        noise = [rng.standard_normal(8), np.linspace(0.0, 1.0, 9)[1:], np.zeros(8)][shape]
        u = exact + 10.0 ** rng.uniform(-8, 0) * noise
        disturbed = lam + rng.integers(0, 2) * 10.0 ** rng.uniform(-8, 0) * rng.standard_normal((1, 1))
        worst = max(worst, check(problem, u, disturbed, exact, slack=1e-14))
    assert worst < FACTOR


@pytest.mark.parametrize(
    ("friction", "alpha"), sampled(itertools.product(("tresca", "weakening"), (0.5, 1.5, 2.4)), [("weakening", 2.4)])
)
def test_softening_square(friction: str, alpha: float) -> None:
    """A body with many contact points, every kind of disturbance, normal law and friction softening."""
    law = Tresca(0.05) if friction == "tresca" else Friction(0.05, weakening(0.4, 10.0))
    problem = survey_softening(alpha, friction=law)
    energy = EnergyNorm(problem.stiffness)
    reference = solve(problem, controls=Controls(rtol=1e-13))
    exact, lam = reference.unknowns, reference.multiplier
    at_rest = certify(problem, exact, lam, factor=energy)
    assert 0.0 < at_rest.margin < 1.0
    assert at_rest.kind is PointKind.UNIQUE_MINIMISER
    assert at_rest.unique is True
    assert at_rest.error_bound_relative < 1e-11
    assert at_rest.smallness.constant < 0.75
    rng = np.random.default_rng(4)
    worst = 0.0
    for size in np.geomspace(1e-6, 1.0, 7):
        scale = size * np.abs(exact).max()
        for noise in (
            rng.standard_normal(exact.size),
            energy.solve(rng.standard_normal(exact.size)),
            energy.solve(problem.contact_force(rng.standard_normal(lam.shape))),
            exact,
        ):
            u = exact + scale * noise / np.abs(noise).max()
            for multiplier in (None, lam, lam + size * rng.standard_normal(lam.shape)):
                worst = max(worst, check(problem, u, multiplier, exact, energy, at_rest.error_bound))
    assert worst < FACTOR


def test_shear_block_of_arrays() -> None:
    """E3: friction that weakens exponentially, here as a table of many pieces; both its sides of sliding."""
    kappa, h, w0 = 4.0, 0.5, 0.3
    c = w0 - 0.7 * h / kappa
    w = c + lambertw(-(0.3 * h / kappa) * np.exp(-c)).real
    assert w == pytest.approx(0.181215413909818, abs=1e-13)
    # the tangent of the law at the solution, so that the slip stays exact
    slope, force = -0.3 * np.exp(-w), 0.7 + 0.3 * np.exp(-w)
    start = force - slope * w
    profile = PiecewiseQuadratic([0.0], [slope, slope], [2.0 * start], start=-start)
    law = ContactLaw(PiecewiseQuadratic([0.0], [1.0, 1.0], [0.0]), Friction(h, profile))
    problem = DiscreteProblem.of_arrays(
        np.diag([kappa, kappa]), np.array([0.0, kappa * w0]), np.eye(2), np.ones(1), np.zeros(1), law
    )
    exact = np.array([0.0, w])
    rng = np.random.default_rng(5)
    for _ in range(60):
        u = exact + 10.0 ** rng.uniform(-8, 0) * rng.standard_normal(2)
        assert check(problem, u, None, exact, slack=1e-14) < FACTOR


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1.0])
@pytest.mark.parametrize("coupling", [0.0, -1.0])
def test_two_contact_points_at_one_unknown(coupling: float, size: float) -> None:
    """Their displacements depend on one another: no better pair is found, and the one that is given is bounded."""
    law = ContactLaw(PiecewiseQuadratic([0.0], [1.5, 1.5], [0.0]))  # type: ignore[arg-type]
    K = np.array([[4.0, coupling], [coupling, 2.0]])
    both = np.array([[1.0, 0.0], [1.0, 0.0]])
    problem = DiscreteProblem.of_arrays(K, np.array([1.0, 0.5]), both, np.full(2, 0.5), np.zeros(2), law)
    exact = np.linalg.solve(K + np.diag([1.5, 0.0]), [1.0, 0.5])
    for off in ([1.0, 0.0], [0.0, 1.0], [-1.0, 2.0]):
        u = exact + size * np.array(off)
        assert check(problem, u, np.full((2, 1), 1.5 * u[0]), exact) < FACTOR


@pytest.mark.parametrize("off", [[0.1, 0.2], [-0.1, 0.2], [1e-4, -3e-4], [0.0, 0.5]])
def test_the_pair_that_is_sought_is_the_solution(off: list[float]) -> None:
    """On rigid ground, which the displacement may have entered: the bound is then the error itself."""
    K = np.array([[2.0, -1.0], [-1.0, 2.0]])
    problem = DiscreteProblem.of_arrays(
        K, np.array([1.0, 1.0]), np.array([[1.0, 0.0]]), np.ones(1), np.zeros(1), ContactLaw(Signorini())
    )
    exact = np.array([0.0, 0.5])
    assert check(problem, exact + np.array(off), np.array([[1.5]]), exact) == pytest.approx(1.0, rel=1e-9)


def test_rigid_foundation_and_midpoints() -> None:
    """A law with an end, and a trace that is no selection of unknowns."""
    for quadrature in Quadrature:
        problem = discretize(plain.square("rigid", 6, "cross", quadrature))
        reference = solve(problem, controls=Controls(rtol=1e-13))
        exact = reference.unknowns
        assert certify(problem, exact, reference.multiplier).error_bound_relative < 1e-11
        rng = np.random.default_rng(6)
        for size in (1e-5, 1e-2):
            u = exact + size * np.abs(exact).max() * rng.standard_normal(exact.size)
            assert check(problem, u, reference.multiplier, exact) < FACTOR


def test_three_dimensions() -> None:
    """Slip vectors with two components, sliding against weakening friction; kinds checked by sampled energies."""
    rng = np.random.default_rng(9)
    kinds = set()
    for trial in range(40):
        A = rng.standard_normal((6, 8))
        K = A @ A.T + 0.5 * np.eye(6)
        rate = 0.2 if trial % 2 else 4.0
        law = ContactLaw(softening(2.0, 0.1, rate), Friction(0.3, weakening(0.4, rate)))
        load = 2.0 * rng.standard_normal(6)
        problem = DiscreteProblem.of_arrays(K, load, np.eye(6), np.ones(2), np.zeros(2), law)  # type: ignore[arg-type]
        reference = solve(problem, controls=Controls(rtol=1e-13))
        exact, lam = reference.unknowns, reference.multiplier
        certificate = certify(problem, exact, lam)
        kinds.add(certificate.kind)
        assert certificate.stationary
        if certificate.kind in (PointKind.UNIQUE_MINIMISER, PointKind.LOCAL_MINIMISER):
            for _ in range(20):
                assert problem.energy(exact + 1e-5 * rng.standard_normal(6)) >= problem.energy(exact) - 1e-14
        if certificate.margin > 0.0:
            for size in (1e-6, 1e-2, 1.0):
                u = exact + size * rng.standard_normal(6)
                assert check(problem, u, lam, exact, slack=1e-14) < FACTOR
    assert {PointKind.UNIQUE_MINIMISER, PointKind.LOCAL_MINIMISER} <= kinds


def test_certificates_do_not_ask_the_solvers() -> None:
    code = "import sys, hemivar.certificates; sys.exit('hemivar.solvers' in sys.modules)"
    source = str(Path(hemivar.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": source}
    assert subprocess.run([sys.executable, "-c", code], env=environment, check=False).returncode == 0


def test_bound_that_depends_on_the_penetration() -> None:
    """J(w, v): the margin counts the coupling as well, and the bound is about the coupled problem."""
    friction = Friction(PenetrationBound("0.05 + 0.5*max(s, 0)"))
    problem = survey_softening(0.5, friction=friction)
    law = problem.law
    state = solve(problem.with_(law=law.frozen(np.zeros((problem.contact_points, 2)), np.zeros((1, 2)))))
    for _ in range(60):  # the outer fixed point, which contracts
        frozen = problem.with_(law=law.frozen(state.local, state.multiplier))
        state = solve(frozen, controls=Controls(rtol=1e-14), initial=state)
    exact, lam = state.unknowns, state.multiplier
    certificate = certify(problem, exact, lam)
    assert 0.0 < certificate.smallness.contraction < 1.0
    assert certificate.smallness.m_L == pytest.approx(0.5, rel=1e-6)
    assert certificate.kind is PointKind.UNIQUE_SOLUTION
    rng = np.random.default_rng(7)
    for size in (1e-5, 1e-2, 0.3):
        u = exact + size * np.abs(exact).max() * rng.standard_normal(exact.size)
        assert check(problem, u, lam, exact) < FACTOR


def test_units_do_not_matter() -> None:
    plain_units, engineering = survey_softening(1.5), survey_softening(1.5, scale=(1e3, 1e6))
    found = []
    for problem in (plain_units, engineering):
        reference = solve(problem, controls=Controls(rtol=1e-13))
        exact = reference.unknowns
        noise = np.random.default_rng(8).standard_normal(exact.size)
        u = exact + 1e-3 * np.abs(exact).max() * noise
        found.append(certify(problem, u, reference.multiplier))
    first, second = found
    assert second.margin == pytest.approx(first.margin, rel=1e-6)
    assert second.error_bound_relative == pytest.approx(first.error_bound_relative, rel=1e-5)
    assert second.equilibrium_relative == pytest.approx(first.equilibrium_relative, rel=1e-5)
    assert second.smallness.survey_margin == pytest.approx(first.smallness.survey_margin, rel=1e-6)


def test_no_bound_without_a_margin() -> None:
    certificate = certify(bar_problem(0.25, 2.0, 0.1, 2.0), bar_unknowns(0.25, 0.25))
    assert certificate.margin < 0.0
    assert certificate.error_bound == np.inf
    record = certificate.record()
    assert record["error_bound"] is None
    assert "error_bound" in record["infinite"]


def test_body_that_only_contact_holds() -> None:
    """A singular stiffness has no margin, and is no reason to fail."""
    K = np.array([[1.0, -1.0], [-1.0, 1.0]])
    problem = DiscreteProblem.of_arrays(K, np.array([1.0, 0.0]), np.array([[0.0, 1.0]]), np.ones(1), np.zeros(1),
                              ContactLaw(Signorini()))  # fmt: skip
    certificate = certify(problem, np.array([1.0, 0.0]), np.array([[1.0]]))
    assert certificate.margin == -np.inf
    assert certificate.stationary
    assert certificate.kind in (PointKind.GLOBAL_MINIMISER, PointKind.UNIQUE_MINIMISER)


def test_bad_input() -> None:
    problem = bar_problem(0.25, 2.0, 0.1, 0.5)
    with pytest.raises(ProblemError, match="shape"):
        certify(problem, np.zeros(3))
    with pytest.raises(ProblemError, match="nan"):
        certify(problem, np.full(8, np.nan))
    with pytest.raises(ProblemError, match="multiplier has shape"):
        certify(problem, np.zeros(8), np.zeros((2, 1)))


def test_the_margin_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    """On the falling piece the residual is (1 - c) times the error: without a search the bound is the error."""
    monkeypatch.setattr(bound, "REPEATED", 0)
    problem = bar_problem(0.4, 2.0, 0.1, 0.5)
    exact = bar_unknowns(0.4, 0.3)
    u = exact + 0.01 * np.linspace(0.0, 1.0, 9)[1:]
    error = true_error(problem, u, exact)
    certificate = certify(problem, u, np.array([[0.4 - 0.3 + 0.5 * -0.01]]))
    assert certificate.equilibrium == pytest.approx(0.5 * error, rel=1e-9)
    assert certificate.error_bound == pytest.approx(error, rel=1e-9)
    assert certificate.error_bound >= error * (1.0 - 1e-12)
