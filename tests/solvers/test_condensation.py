"""Condensation against dense linear algebra, and energies against the full problem."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, Signorini, ThresholdCompliance, Tresca
from hemivar.linear.factorisation import SuperLUFactorisation
from hemivar.linear.pardiso import PardisoFactorisation, pardiso_available
from hemivar.mechanics import Quadrature
from hemivar.solvers import METHODS, Status, solve
from hemivar.systems import condense

from ..problems import discrete_square


def dense_schur(K: np.ndarray, kept: np.ndarray) -> np.ndarray:
    rest = np.setdiff1d(np.arange(len(K)), kept)
    block = np.linalg.solve(K[np.ix_(rest, rest)], K[np.ix_(rest, kept)])
    return np.asarray(K[np.ix_(kept, kept)] - K[np.ix_(kept, rest)] @ block)


def random_matrix(n: int, seed: int) -> sp.csr_array:
    rng = np.random.default_rng(seed)
    half = sp.random(n, n, density=0.05, random_state=rng, format="csr")
    return sp.csr_array(half @ half.T + sp.eye_array(n))


BACKENDS = [SuperLUFactorisation] + ([PardisoFactorisation] if pardiso_available() else [])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("seed", range(6))
def test_schur_complement_is_the_dense_one(backend: type, seed: int) -> None:
    n = 150
    K = random_matrix(n, seed)
    kept = np.sort(np.random.default_rng(seed).choice(n, size=[0, 1, 7, 30, 100, 150][seed], replace=False))
    factor = backend(K, kept)
    dense = K.toarray()
    np.testing.assert_allclose(factor.schur, dense_schur(dense, kept), atol=1e-10 * np.abs(dense).max())
    rhs = np.random.default_rng(seed + 1).normal(size=n)
    x = factor.solve_interior(rhs)
    rest = np.setdiff1d(np.arange(n), kept)
    np.testing.assert_array_equal(x[kept], 0.0)
    np.testing.assert_allclose((K @ x)[rest], rhs[rest], atol=1e-10)


def test_schur_complement_by_solves_is_the_same() -> None:
    K = random_matrix(150, 3)
    kept = np.arange(0, 150, 5)
    factor = SuperLUFactorisation(K, kept)
    by_solves = factor._schur_by_solves(factor._factor, kept.size, block=8)
    order = np.argsort(factor._order[-kept.size :])
    np.testing.assert_allclose(
        by_solves[np.ix_(order, order)], factor.schur + np.diag(K.diagonal()[kept]), rtol=1e-9, atol=1e-9
    )


@pytest.mark.parametrize("quadrature", list(Quadrature))
@pytest.mark.parametrize("data", ["data (5.1)", "lifting", "power"])
def test_condensed_energy_is_the_energy_of_the_recovered_displacement(quadrature: Quadrature, data: str) -> None:
    problem = discrete_square(data, 6, quadrature=quadrature)
    condensed = condense(problem)
    rng = np.random.default_rng(0)
    for _ in range(5):
        r = -np.abs(rng.normal(size=condensed.shape)) * 0.1
        u = condensed.unknowns(r)
        np.testing.assert_allclose(problem.local(u), r, atol=1e-12)
        assert condensed.energy(r) == pytest.approx(problem.energy(u), rel=1e-11)
        assert condensed.energy_norm(r) == pytest.approx(np.sqrt(u @ (problem.stiffness @ u)), rel=1e-10)
        # No other displacement with these local displacements has less energy.
        other = rng.normal(size=u.size)
        B = problem.contact.trace.toarray()
        other -= np.linalg.lstsq(B, B @ other, rcond=None)[0]
        assert problem.energy(u + 1e-3 * other) > problem.energy(u)


def test_elasticity_without_contact_is_solved_as_well() -> None:
    problem = discrete_square(n=4)
    free = DiscreteProblem.of_arrays(
        problem.stiffness,
        problem.load,
        sp.csr_array((0, problem.unknowns)),
        np.zeros(0),
        np.zeros(0),
        ContactLaw(Signorini()),
    )
    found = solve(free)
    np.testing.assert_allclose(problem.stiffness @ found.unknowns, problem.load, atol=1e-13)
    assert found.status.value == "converged"


def test_user_trace_that_is_no_selection() -> None:
    """Rotated, scaled unknowns: u = T v with a random regular T must give the same local displacements."""
    problem = discrete_square(n=3)
    expected = solve(problem)
    rng = np.random.default_rng(4)
    T = np.eye(problem.unknowns) + 0.1 * rng.normal(size=(problem.unknowns,) * 2)
    K = T.T @ problem.stiffness.toarray() @ T
    other = DiscreteProblem.of_arrays(
        0.5 * (K + K.T),
        T.T @ problem.load,
        problem.contact.trace @ T,
        problem.contact.weights,
        problem.gap,
        problem.law,
    )
    found = solve(other)
    np.testing.assert_allclose(found.local, expected.local, atol=1e-10)
    np.testing.assert_allclose(found.multiplier, expected.multiplier, atol=1e-8)


def test_interior_that_hangs_on_nothing_is_reported() -> None:
    K = np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    B = np.array([[0.0, 0.0, 1.0]])
    problem = DiscreteProblem.of_arrays(K, np.ones(3), B, np.ones(1), np.zeros(1), ContactLaw(ThresholdCompliance(0.3)))
    with pytest.raises(ProblemError, match="can move freely"):
        condense(problem)


def test_contact_points_that_share_a_displacement_are_reported() -> None:
    K = np.eye(3)
    B = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    problem = DiscreteProblem.of_arrays(K, np.ones(3), B, np.ones(2), np.zeros(2), ContactLaw(ThresholdCompliance(0.3)))
    with pytest.raises(ProblemError, match="depend on one another"):
        solve(problem)


def test_fixed_component_of_a_contact_point_stays_fixed() -> None:
    """Slip of the only contact point is held at -0.2; its friction is the smallest that the law allows."""
    K = np.array([[2.0]])
    B = np.array([[1.0], [0.0]])
    law = ContactLaw(ThresholdCompliance(0.1, 2.0), Tresca(0.5))
    problem = DiscreteProblem.of_arrays(
        K, np.array([0.5]), B, np.ones(1), np.zeros(1), law, slip_offset=np.array([[0.2]])
    )
    found = solve(problem)
    assert found.slip[0, 0] == pytest.approx(-0.2)
    assert found.penetration[0] == pytest.approx(0.1)  # 2 r + 0.1 + 2 r = 0.5
    assert found.energy == pytest.approx(0.01 - 0.05 + 0.01 + 0.01 + 0.5 * 0.2)


def test_fixed_slip_carries_the_friction_of_the_law() -> None:
    """The reaction of the support takes no part in the law: the friction of a point held at a slip is the bound."""
    law = ContactLaw(ThresholdCompliance(0.1, 2.0), Tresca(0.5))
    B = np.array([[1.0], [0.0]])
    problem = DiscreteProblem.of_arrays(
        np.array([[2.0]]), np.array([0.5]), B, np.ones(1), np.zeros(1), law, slip_offset=np.array([[0.2]])
    )
    for method in METHODS.values():
        found = solve(problem, method)
        if method.name != "direct-powell":
            assert found.status is Status.CONVERGED, method
            assert found.friction[0, 0] == pytest.approx(0.5)
