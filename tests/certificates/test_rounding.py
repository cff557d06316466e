"""What rounding can hide is counted in a bound: against sums of rational numbers."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.certificates import EnergyNorm, bound, certify
from hemivar.certificates.bound import Point, error_bound
from hemivar.discrete import DiscreteProblem
from hemivar.laws import Compliance, ContactLaw, PiecewiseQuadratic, Signorini, Tresca
from hemivar.linear import products

EPS, FINE = float(np.finfo(float).eps), float(np.finfo(np.longdouble).eps)


def product(matrix: Array, vector: Iterable[Fraction | float]) -> list[Fraction]:
    """A product without rounding."""
    given = [Fraction(x) for x in vector]
    return [sum((Fraction(a) * x for a, x in zip(row, given, strict=True)), Fraction(0)) for row in matrix.tolist()]


def random_point(seed: int, balanced: bool, units: float = 1.0) -> Point:
    """A stiff body, whose forces cancel to the last digits where they are balanced."""
    rng = np.random.default_rng(seed)
    n, m = 7, 2
    root = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-2, 2, n)
    K = units * (root.T @ root + 1e-2 * np.diag(np.diag(root.T @ root)))
    K = 0.5 * (K + K.T)
    B = rng.normal(size=(2 * m, n)) * (rng.random((2 * m, n)) < 0.6)
    w = rng.uniform(0.5, 2.0, m)
    u, lam = rng.normal(size=n), units * rng.normal(size=(m, 2))
    load = K @ u + B.T @ (np.repeat(w, 2) * lam.ravel())
    if not balanced:
        load = load * (1.0 + 0.1 * rng.normal(size=n))
    law = ContactLaw(Compliance(units), Tresca(0.1 * units))
    problem = DiscreteProblem.of_arrays(K, load, B, w, np.zeros(m), law)
    return Point(problem, EnergyNorm(problem.stiffness), u, lam)


@pytest.mark.parametrize("units", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("balanced", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_the_rounding_of_a_balance_of_forces(seed: int, balanced: bool, units: float) -> None:
    """The true rest is no farther than the doubt, and the doubt no larger than the sums can make it."""
    point = random_point(seed, balanced, units)
    problem, bulk = point.problem, point.bulk
    K, B = bulk.stiffness.toarray(), problem.contact.trace.toarray()
    weights = np.repeat(problem.contact.weights, 2).tolist()
    force = [Fraction(w) * Fraction(x) for w, x in zip(weights, point.lam.ravel().tolist(), strict=True)]
    inner, outer = product(K, point.u.tolist()), product(B.T, force)
    exact = [Fraction(f) - a - b for f, a, b in zip(problem.load.tolist(), inner, outer, strict=True)]
    rest, doubt = point.balance
    root = np.sqrt(np.diag(K))
    missed = np.array([float(Fraction(r) - e) for r, e in zip(rest.tolist(), exact, strict=True)]) / root
    assert np.linalg.norm(missed) <= doubt
    spread = (np.abs(K).sum(axis=1) / np.diag(K)).max()
    terms = np.abs(problem.load) + np.abs(B.T) @ np.abs(np.repeat(problem.contact.weights, 2) * point.lam.ravel())
    size = spread * np.linalg.norm(root * point.u) + np.linalg.norm(terms / root)
    last = EPS * np.linalg.norm(rest / root)
    longest = len(K)
    assert longest * FINE * size + last <= doubt * (1.0 + 1e-12)
    assert doubt <= ((longest + 4) * FINE * size + last) * (1.0 + 1e-12)
    if balanced:
        assert np.linalg.norm(rest / root) < 1e-13 * size  # the forces cancel


@pytest.mark.parametrize("units", [1e-9, 1.0, 1e9])
def test_the_bound_of_an_exact_solution_is_of_the_size_of_rounding(units: float) -> None:
    """Pressed against a wall at 0.1, the double: u1 = 0.1 and 2 u0 = f0 + 0.1, to the last digit."""
    K, f = units * np.array([[2.0, -1.0], [-1.0, 3.0]]), units * np.array([1.0 / 3.0, 1.0])
    problem = DiscreteProblem.of_arrays(K, f, [[0.0, 1.0]], [1.0], [0.1], ContactLaw(Signorini()))  # type: ignore[arg-type]
    u = np.array([(1.0 / 3.0 + 0.1) / 2.0, 0.1])
    found = certify(problem, u, np.array([[units * (1.0 - 0.3 + u[0])]]))
    exact = (Fraction(f[0]) - Fraction(K[0, 1]) * Fraction(0.1)) / Fraction(K[0, 0])
    assert float(abs(exact - Fraction(u[0]))) * np.sqrt(K[0, 0]) <= found.error_bound
    assert 0.0 < found.error_bound_relative < 1e-14


def test_the_parts_of_a_large_matrix_give_the_same_balance(monkeypatch: pytest.MonkeyPatch) -> None:
    point = random_point(11, balanced=False)
    whole = point.balance
    for rows in (1, 3, 7):
        monkeypatch.setattr(products, "_ROWS", rows)
        again = Point(point.problem, point.energy, point.u, point.lam).balance
        np.testing.assert_array_equal(again[0], whole[0])
        assert again[1] == whole[1]


def linear(stiffness: float, units: float) -> DiscreteProblem:
    """A foundation that is a spring, so that the exact solution is that of a matrix."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(6, 6))
    K = units * (root @ root.T + np.eye(6))
    law = ContactLaw(PiecewiseQuadratic([0.0], [units * stiffness, units * stiffness], [0.0]))  # type: ignore[arg-type]
    return DiscreteProblem.of_arrays(
        K, units * rng.normal(size=6), rng.normal(size=(2, 6)), [1.0, 2.0], [0.0, 0.0], law
    )  # type: ignore[arg-type]


@pytest.mark.parametrize("units", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("size", [1e-15, 1e-12, 1e-8, 1e-3, 10.0])
def test_the_bound_of_a_linear_problem_lies_just_above_the_error(size: float, units: float) -> None:
    problem = linear(3.0, units)
    K, B, w = problem.stiffness.toarray(), problem.contact.trace.toarray(), problem.contact.weights
    full = K + B.T @ (3.0 * units * w[:, None] * B)
    exact = np.linalg.solve(full, problem.load)
    for _ in range(3):  # refined in extended precision
        rest = problem.load - (full.astype(np.longdouble) @ exact.astype(np.longdouble)).astype(float)
        exact = exact + np.linalg.solve(full, rest)
    u = exact + size * np.abs(exact).max() * np.random.default_rng(3).standard_normal(6)
    error = float(np.sqrt((u - exact) @ K @ (u - exact)))
    rest = full @ (exact - u)
    unbalanced = float(np.sqrt(rest @ np.linalg.solve(K, rest)))
    slack = 4.0 * EPS * float(np.sqrt(exact @ K @ exact))  # exact is rounded, too
    point = Point(problem, EnergyNorm(problem.stiffness), u, bound.equilibrium_multiplier(problem, u))
    for margin in (1.0, 0.5):
        found = error_bound(point, margin)
        assert error <= found + slack
        # a small one is not searched for: the norm of what is out of balance where the law is fulfilled
        largest = error if size > 1e-9 else unbalanced / margin
        assert found <= 1.001 * largest + 50.0 * slack


@pytest.mark.parametrize("units", [2.0**-30, 1.0, 2.0**30])
def test_the_bound_of_whole_numbers_is_what_rounding_might_have_hidden(units: float) -> None:
    """K u + B'lam = f without any rounding: nothing is out of balance, and yet the sums might have hidden something."""
    K, u = units * np.array([[2.0, -1.0], [-1.0, 3.0]]), np.array([1.0, 1.0])
    load = K @ u + units * np.array([0.0, 2.0])
    law = ContactLaw(Compliance(2.0 * units))
    problem = DiscreteProblem.of_arrays(K, load, np.array([[0.0, 1.0]]), np.ones(1), np.zeros(1), law)
    point = Point(problem, EnergyNorm(problem.stiffness), u, np.array([[2.0 * units]]))
    assert point.imbalance[1] == 0.0
    hidden = point.balance[1] / np.sqrt(point.energy.lowest)
    for margin in (1.0, 0.25):
        assert error_bound(point, margin) == pytest.approx(hidden / margin, rel=1e-9, abs=0.0)
    assert 0.0 < hidden < 1e-16 * np.sqrt(u @ K @ u)


def test_a_careless_multiplier_does_not_spoil_the_bound_of_a_displacement(monkeypatch: pytest.MonkeyPatch) -> None:
    """At a wall every pressure fulfils the law; the one that balances the forces is tried too, before any search."""
    monkeypatch.setattr(bound, "REPEATED", 0)
    K = np.array([[2.0, -1.0], [-1.0, 3.0]])
    u = np.array([0.5, 0.25])
    load = K @ u + np.array([0.0, 2.0])
    law = ContactLaw(Signorini())
    problem = DiscreteProblem.of_arrays(K, load, np.array([[0.0, 1.0]]), np.ones(1), np.array([0.25]), law)
    for pressure in (2.0, 1.5, 3.0, 0.0):
        point = Point(problem, EnergyNorm(problem.stiffness), u, np.array([[pressure]]))
        assert error_bound(point, 1.0) < 1e-14
