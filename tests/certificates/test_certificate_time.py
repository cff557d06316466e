"""Long tables, many points, little time."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics import deadline
from hemivar.certificates import PointKind, certify
from hemivar.laws import PiecewiseQuadratic
from hemivar.laws.minimisers import nearest_pair
from hemivar.solvers import solve
from tests.certificates.problems import survey_softening


def every_knot(law: PiecewiseQuadratic, r: np.ndarray, lam: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """The knot that fits best, or r, by looking at each."""
    best, place = law.distance(r, lam), r
    for i in range(law.knots.shape[-1]):
        at = np.broadcast_to(law.knots[:, i], r.shape)
        off = np.hypot((r - at) / tau, law.distance(at, lam))
        best, place = np.where(off < best, off, best), np.where(off < best, at, place)
    return place


@pytest.mark.parametrize("rows", [1, 5])
def test_the_best_knot_is_found_without_looking_at_each(rows: int) -> None:
    random = np.random.default_rng(8)
    moved = 0
    for k in range(100):
        count = int(random.integers(1, 9))
        knots = np.sort(random.normal(size=(rows, count)), axis=1) + 0.01 * np.arange(count)
        law = PiecewiseQuadratic(
            knots,
            random.normal(size=(rows, count + 1)),
            random.normal(size=(rows, count)),
            upper=knots[:, -1] if k % 3 == 0 else np.inf,
        )
        r = knots[0, random.integers(0, count, size=5)] + random.choice([0.0, 1e-15, 0.1], size=5) * random.normal()
        lam, tau = random.normal(size=5), 10.0 ** random.uniform(-3.0, 2.0, size=5)
        found, _ = nearest_pair(law, r, lam, tau)
        np.testing.assert_array_equal(found, every_knot(law, r, lam, tau))
        moved += not np.array_equal(found, r)
    assert moved > 20


def test_few_knots_of_a_long_table_are_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = 0
    distance = PiecewiseQuadratic.distance

    def counted(self: PiecewiseQuadratic, r: np.ndarray, lam: np.ndarray) -> np.ndarray:
        nonlocal asked
        asked += 1
        return distance(self, r, lam)

    monkeypatch.setattr(PiecewiseQuadratic, "distance", counted)
    knots = np.linspace(-1.0, 1.0, 3001)
    law = PiecewiseQuadratic(knots, np.ones(3002), np.zeros(3001))  # type: ignore[arg-type]
    r = np.linspace(-0.5, 0.5, 4) + 1e-9
    found, _ = nearest_pair(law, r, law.derivative(r) + 1e-7, np.ones(4))
    assert asked <= 2
    assert np.abs(found - r).max() < 1e-6


@pytest.mark.parametrize("max_time", [0.0, 1e-9])
def test_without_time_a_certificate_holds_the_residual_and_says_what_it_lacks(max_time: float) -> None:
    problem = survey_softening(0.5, n=3)
    solution = solve(problem)
    certificate = certify(problem, solution.unknowns, solution.multiplier, max_time=max_time)
    assert certificate.left_out == ("margin", "equilibrium", "error bound", "kind", "trace constant")
    assert certificate.residual.relative < 1e-9
    assert certificate.unique is None
    assert certificate.kind is PointKind.STATIONARY
    assert certificate.margin == -np.inf
    assert certificate.error_bound == np.inf
    assert certificate.record()["left_out"] == list(certificate.left_out)
    whole = certify(problem, solution.unknowns, solution.multiplier, max_time=600.0)
    assert whole.left_out == ()
    assert whole.unique is True
    assert whole.smallness.alpha_normal == certificate.smallness.alpha_normal


def test_the_time_ends_inside_a_part(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock is looked at in every solve with K, not only between the parts."""
    problem = survey_softening(0.5, n=3)
    solution = solve(problem)
    calls = 0

    def late(self: deadline.Budget) -> float:
        nonlocal calls
        calls += 1
        return np.inf if calls > 1 else 0.0

    monkeypatch.setattr(deadline.Budget, "spent", property(late))
    certificate = certify(problem, solution.unknowns, solution.multiplier, max_time=10.0)
    assert certificate.left_out[0] == "margin"


def test_a_limit_belongs_to_its_block() -> None:
    deadline.check_time()
    with pytest.raises(deadline.OutOfTime), deadline.limited(deadline.Budget(-1.0)):
        deadline.check_time()
    deadline.check_time()
    outer, inner = deadline.Budget(-1.0), deadline.Budget(100.0)
    with deadline.limited(outer), deadline.limited(inner), pytest.raises(deadline.OutOfTime):
        deadline.check_time()
