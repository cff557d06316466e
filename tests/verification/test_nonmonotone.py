"""Closed forms and a manufactured solution for laws that weaken."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.certificates import PointKind, certify, smallness
from hemivar.fem import discretize, interpolate, v_norm
from hemivar.gallery import manufactured_softening, shear_block, softening_block
from hemivar.mesh import rectangle
from hemivar.solvers import Status, solve
from tests.samples import slow


@pytest.mark.parametrize(
    ("bound", "kinetic", "rate", "free", "count"),
    [(0.5, 0.7, 1.0, 0.3, 1), (0.5, 0.7, 1.0, 0.1, 1), (1.0, 0.5, 20.0, 0.248, 3)],
)
def test_shear_block_on_both_branches(bound: float, kinetic: float, rate: float, free: float, count: int) -> None:
    """E3 in the plane: sticking and both branches of Lambert's function; quadratic elements hold them exactly.

    The upper branch is stable in the plane only where friction has nearly ceased to fall: a body with free sides is
    softer than a column in shear.
    """
    known = shear_block(bound, 4, load=8.0 * free, kinetic=kinetic, rate=rate).solutions
    assert len(known) == count
    for number, one in enumerate(known):
        problem = discretize(one.problem)
        assert problem.field is not None
        exact = one.displacement(problem.field.nodes)
        unknowns = problem.field.restrict(exact)
        what = certify(problem, unknowns)
        assert what.stationary
        unstable = count == 3 and number == 1
        assert (what.unique is True) is (count == 1)
        if unstable:
            assert what.kind not in (PointKind.UNIQUE_MINIMISER, PointKind.LOCAL_MINIMISER)
            continue
        assert what.kind in (PointKind.UNIQUE_MINIMISER, PointKind.LOCAL_MINIMISER)
        found = solve(problem, initial=None if count == 1 else unknowns).raise_for_status()
        np.testing.assert_allclose(found.displacement, exact, atol=1e-9)
        slip = float(exact[np.argmin(problem.field.nodes[:, 1]), 0])
        np.testing.assert_allclose(found.friction[:, 0] ** 2, (4.0 * (free - slip)) ** 2, atol=1e-8)


@pytest.mark.parametrize(
    ("softening", "top", "penetrations"),
    [
        (6.0, 0.12, [1.44 / 42.0]),  # rising branch: kappa D/(kappa + k)
        (6.0, 0.2, [0.1]),  # falling branch: (12 * 0.2 - 36 * 0.05)/6
        (6.0, 0.25, [0.2]),
        (6.0, 0.4, [0.4]),  # given way
        (20.0, 0.14, [0.04, 0.1025, 0.14]),
    ],
)
def test_block_on_softening_springs(softening: float, top: float, penetrations: list[float]) -> None:
    """E2 with a softening law, kappa = 12, k = 30, delta = 0.05."""
    known = softening_block(softening=softening, top_displacement=top, n=6).solutions
    assert len(known) == len(penetrations)
    for one, s in zip(known, penetrations, strict=True):
        problem = discretize(one.problem)
        assert problem.field is not None
        exact = one.displacement(problem.field.nodes)
        what = certify(problem, problem.field.restrict(exact))
        assert what.stationary
        assert (what.margin > 0.0) is (softening < 12.0)
        assert what.margin == pytest.approx(1.0 - softening / 12.0, abs=1e-9)
        if len(known) == 3 and s == 0.1025:
            assert what.kind in (PointKind.SADDLE, PointKind.MAXIMUM)
            continue
        found = solve(problem, initial=None if len(known) == 1 else problem.field.restrict(exact)).raise_for_status()
        if len(known) == 1:
            np.testing.assert_allclose(found.penetration, s, atol=1e-12)
            np.testing.assert_allclose(found.displacement, exact, atol=1e-12)
        np.testing.assert_allclose(one.pressure(np.zeros((1, 2))), 12.0 * (top - s))


def manufactured_errors(pattern: str, sizes: tuple[int, ...]) -> tuple[list[float], list[float]]:
    """V-norm errors against the exact field on a finer mesh, and largest errors of the pressure."""
    fine = rectangle((2.0, 1.0), (8 * sizes[-1], 4 * sizes[-1]), "cross")
    errors, pressures = [], []
    for n in sizes:
        known = manufactured_softening(n, pattern)  # type: ignore[arg-type]
        problem = discretize(known.problem)
        found = solve(problem)
        assert found.status is Status.CONVERGED
        coarse = interpolate(problem.field, found.displacement, fine.points)  # type: ignore[arg-type]
        errors.append(v_norm(fine, coarse - known.displacement(fine.points)))
        pressures.append(float(np.abs(found.pressure - known.pressure(problem.contact.points)).max()))  # type: ignore[arg-type]
    return errors, pressures


@pytest.mark.parametrize("pattern", ["cross", slow("right")])
def test_manufactured_softening_converges_at_order_one(pattern: str) -> None:
    """P1 in the V-norm: rate close to 1; the pressure, at the nodes, converges faster."""
    sizes = (8, 16, 32) if pattern == "cross" else (16, 32, 64)
    errors, pressures = manufactured_errors(pattern, sizes)
    rate = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert 0.9 < rate < 1.25, (rate, errors)
    assert -np.polyfit(np.log(sizes), np.log(pressures), 1)[0] > 1.5


def test_manufactured_softening_is_what_it_says() -> None:
    """Inside the margin, pressure falling on one half, sticking and slipping, equilibrium of the fields."""
    known = manufactured_softening(16, "cross")
    problem = discretize(known.problem)
    constants = smallness(problem)
    assert 0.4 < constants.margin < 0.6
    assert constants.constant_normal > 0.2
    assert constants.constant_tangential > 0.2
    found = solve(problem).raise_for_status()
    assert problem.contact.points is not None
    x = problem.contact.points[:, 0]
    order = np.argsort(x)
    pressure = found.pressure[order]
    assert pressure[-1] < 0.7 * pressure.max()
    assert np.all(np.diff(found.penetration[order]) > 0.0)
    moved = np.abs(found.slip[:, 0]) > 1e-9
    assert (~moved[x < 0.3]).all()
    assert moved[x > 0.7].all()
    assert np.abs(found.slip).max() == pytest.approx(0.2025, rel=0.01)
    what = certify(problem, found.unknowns, found.multiplier)
    assert what.unique
    # -div sigma = f by central differences of the displacement, away from the kinks.
    at, h = np.array([[0.23, 0.4], [0.77, 0.6], [1.6, 0.3]]), 1e-3
    lam = mu = 40.0

    def stress(p: np.ndarray) -> np.ndarray:
        step = [np.array([h, 0.0]), np.array([0.0, h])]
        gradient = np.stack([(known.displacement(p + s) - known.displacement(p - s)) / (2 * h) for s in step], axis=-1)
        eps = 0.5 * (gradient + gradient.transpose(0, 2, 1))
        return np.asarray(lam * np.trace(eps, axis1=1, axis2=2)[:, None, None] * np.eye(2) + 2 * mu * eps)

    along, up = np.array([h, 0.0]), np.array([0.0, h])
    divergence = (stress(at + along)[:, :, 0] - stress(at - along)[:, :, 0]) / (2 * h)
    divergence += (stress(at + up)[:, :, 1] - stress(at - up)[:, :, 1]) / (2 * h)
    np.testing.assert_allclose(-divergence, known.problem.body_force(at), atol=1e-3)  # type: ignore[operator]
