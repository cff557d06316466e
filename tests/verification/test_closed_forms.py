"""Closed forms: a bar, a block under its own weight, a manufactured solution."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hemivar.fem import discretize, v_norm
from hemivar.laws import Bilateral, Compliance, NoContact, Signorini, ThresholdCompliance, Tresca
from hemivar.mechanics import (
    Clamped,
    Contact,
    ContactProblem,
    Fixed,
    Prescribed,
    Pressure,
    Quadrature,
)
from hemivar.mesh import Mesh, rectangle
from hemivar.solvers import METHODS, solve
from tests import bodies

from ..problems import bar

ALL_PATTERNS = ["cross", "right", "left"]


@pytest.mark.parametrize(
    ("law", "load", "expected"),
    [
        (ThresholdCompliance(0.1, 2.0), 0.8, 0.1),  # kappa (r0 - r) = q + p r
        (ThresholdCompliance(0.5, 2.0), 0.8, 0.0),  # held by the rigid part
        (ThresholdCompliance(0.1, 2.0), -0.8, -0.4),  # lifted
        (ThresholdCompliance(0.1, 0.0), 0.8, 0.3),
        (Signorini(), 0.8, 0.0),
        (Bilateral(), -0.8, 0.0),
        (NoContact(), 0.8, 0.4),
        (Compliance(3.0), 0.8, 0.1),
        (Compliance(4.0, 2.0), 0.8, (np.sqrt(1.0 + 16.0 * 0.4) - 1.0) / 8.0),  # r + 4 r^2 = 0.4
    ],
)
def test_bar_on_a_convex_foundation(law: object, load: float, expected: float) -> None:
    """E1 for laws without softening; P1 is exact at the nodes."""
    found = solve(bar(load, law), rtol=1e-12)  # type: ignore[arg-type]
    assert found.penetration[0] == pytest.approx(expected, abs=1e-11 if isinstance(law, Compliance) else 1e-14)
    reaction = load / 2 - expected
    tolerance = 1e-11 if isinstance(law, Compliance) else 1e-13
    assert found.pressure[0] == pytest.approx(reaction, abs=tolerance)
    x = np.linspace(0.0, 1.0, 9)[1:]
    np.testing.assert_allclose(found.unknowns, load * (x - x**2 / 2) - reaction * x, atol=tolerance)


def column_e2(weight: float, q: float, p: float, quadrature: Quadrature) -> ContactProblem:
    """E2: (0, 0.5) x (0, 1), frictionless rollers on both sides, top fixed, body force (0, -weight)."""
    return bodies.column(
        Contact(ThresholdCompliance(q, p), Tresca(0.2)),
        cells=(2, 4),
        pattern="cross",
        size=(0.5, 1.0),
        top=Clamped(),
        body_force=(0.0, -weight),
        order=2,
        quadrature=quadrature,
    )


@pytest.mark.parametrize("quadrature", list(Quadrature))
@pytest.mark.parametrize(("q", "p"), [(0.3, 2.0), (0.3, 0.0), (0.0, 5.0), (9.0, 2.0)])
def test_block_under_its_own_weight(q: float, p: float, quadrature: Quadrature) -> None:
    """E2 with quadratic elements, which hold the exact solution: s = max(kappa r0 - q, 0)/(kappa + p)."""
    weight, b, M = 5.0, 1.0, 12.0
    kappa, r0 = M / b, weight * b**2 / (2.0 * M)
    found = solve(discretize(column_e2(weight, q, p, quadrature)))
    s = max(kappa * r0 - q, 0.0) / (kappa + p)
    P = kappa * (r0 - s)
    np.testing.assert_allclose(found.penetration, s, atol=1e-10)
    np.testing.assert_allclose(found.pressure, P, atol=1e-10)
    y = found.problem.field.nodes[:, 1]  # type: ignore[union-attr]
    np.testing.assert_allclose(found.displacement[:, 0], 0.0, atol=1e-10)
    np.testing.assert_allclose(found.displacement[:, 1], -s + (-P * y + weight * y**2 / 2.0) / M, atol=1e-10)


@pytest.mark.parametrize("method", [name for name in METHODS if name not in ("direct-powell",)])
def test_block_patch(method: str) -> None:
    """E2's patch version: top moved down by D, no body force: s = 0.9/14 and u linear."""
    problem = bodies.column(ThresholdCompliance(0.3, 2.0), cells=6, pattern="cross", top=Prescribed((0.0, -0.1)))
    found = solve(discretize(problem), METHODS[method])
    s = 0.9 / 14.0
    tolerance = 1e-10 if method in ("newton", "active-set", "augmented-lagrangian-newton") else 1e-8
    np.testing.assert_allclose(found.penetration, s, atol=tolerance)
    y = problem.mesh.points[:, 1]
    np.testing.assert_allclose(found.displacement[:, 1], -s - (0.1 - s) * y, atol=tolerance)
    # Energy of the linear field: M/2 ((D - s)/b)^2 a b + a j(s).
    exact = 0.5 * 12.0 * (0.1 - s) ** 2 + 0.3 * s + s**2
    assert found.energy == pytest.approx(exact, abs=10 * tolerance)


@pytest.mark.parametrize("q", [0.3, 0.6])
def test_block_held_by_its_foundation_alone(q: float) -> None:
    """Semicoercive case: no vertical support, pressure P on top: P in dj(s), s = (P - q)/p or rigid contact."""
    problem = bodies.column(
        ThresholdCompliance(q, 2.0), cells=4, pattern="cross", top=None, tractions={"top": Pressure(0.5)}
    )
    found = solve(discretize(problem))
    assert found.status.value == "converged"
    np.testing.assert_allclose(found.penetration, max(0.5 - q, 0.0) / 2.0, atol=1e-10)
    np.testing.assert_allclose(found.pressure, 0.5, atol=1e-9)


def test_block_sticks_and_slides_like_a_rigid_one() -> None:
    """Top moved sideways by D with no vertical motion: uniform shear mu (D - w)/b, carried up to the bound 0.2."""
    for shear, sticks in ((0.19, True), (0.21, False)):
        problem = bodies.square(
            Contact(Bilateral(), Tresca(0.2)),
            8,
            "cross",
            supports={"top": Prescribed((shear / 4.0, 0.0)), "left": Fixed(y=0.0), "right": Fixed(y=0.0)},
        )
        # On the sides the shear of the uniform field is a reaction of the supports; inside it is in balance.
        found = solve(discretize(problem))
        slip = 0.0 if sticks else (shear - 0.2) / 4.0
        np.testing.assert_allclose(np.abs(found.slip[:, 0]), slip, atol=1e-12)
        np.testing.assert_allclose(np.abs(found.friction[:, 0]), min(shear, 0.2), atol=1e-12)


def test_plain_elasticity_of_a_cantilever() -> None:
    """B9: squares of side 0.5 cut by their centres; displacements of two corner nodes."""
    problem = bodies.strip(cells=(5, 2), pattern="cross", size=(2.5, 1.0), body_force=(0.0, 0.2))
    found = solve(discretize(problem))
    points = problem.mesh.points
    for x, y, u in (
        (0.5, 0.0, (0.11787841, 0.1252073)),
        (2.5, 0.0, (0.24898703, 1.07004206)),
    ):
        node = int(np.argmin(np.hypot(points[:, 0] - x, points[:, 1] - y)))
        np.testing.assert_allclose(found.displacement[node], u, atol=1e-7)


def spring_problem(mesh: Mesh, quadrature: Quadrature = Quadrature.NODAL, order: int = 1) -> ContactProblem:
    """B10: manufactured displacement on a linear spring foundation, lambda = mu = 4.

    u = 0.05 (2xy + xy^2, -x^2 (1 + y)): u_y at y = 0 is -0.05 x^2, so that the body penetrates everywhere.
    """
    lam = mu = 4.0

    def stress(x: np.ndarray) -> np.ndarray:
        exx = 0.05 * (2.0 * x[:, 1] + x[:, 1] ** 2)
        eyy = -0.05 * x[:, 0] ** 2
        exy = 0.5 * 0.05 * ((2.0 * x[:, 0] + 2.0 * x[:, 0] * x[:, 1]) - 2.0 * x[:, 0] * (1.0 + x[:, 1]))
        trace = lam * (exx + eyy)
        return np.stack([trace + 2 * mu * exx, trace + 2 * mu * eyy, 2 * mu * exy], axis=1)

    def side(normal: tuple[float, float]) -> Callable[[np.ndarray], np.ndarray]:
        def traction(x: np.ndarray) -> np.ndarray:
            s = stress(x)
            return np.stack(
                [s[:, 0] * normal[0] + s[:, 2] * normal[1], s[:, 2] * normal[0] + s[:, 1] * normal[1]], axis=1
            )

        return traction

    def body(x: np.ndarray) -> np.ndarray:
        # -Div sigma of the displacement above.
        divergence = np.stack(
            [lam * (-0.1 * x[:, 0]) + 0.0 * x[:, 0], (lam + 2 * mu) * 0.0 * x[:, 0] + lam * 0.1 * (1.0 + x[:, 1])],
            axis=1,
        )
        return -divergence

    return bodies.body(
        mesh,
        Compliance(lam + 2 * mu),
        lame=(lam, mu),
        body_force=body,
        tractions={"right": side((1.0, 0.0)), "top": side((0.0, 1.0))},
        order=order,
        quadrature=quadrature,
    )


def exact_spring(x: np.ndarray) -> np.ndarray:
    return 0.05 * np.stack(
        [2.0 * x[:, 0] * x[:, 1] + x[:, 0] * x[:, 1] ** 2, -(x[:, 0] ** 2) * (1.0 + x[:, 1])], axis=1
    )


@pytest.mark.parametrize("quadrature", list(Quadrature))
def test_manufactured_solution_converges_at_the_rate_of_the_elements(quadrature: Quadrature) -> None:
    """B10: order 1 in the V-norm with linear elements (against the exact field, on a finer mesh)."""
    from hemivar.fem import interpolate

    fine = rectangle((2.0, 1.0), (256, 128), "cross")
    sizes, errors = [], []
    for n in (4, 8, 16, 32):
        problem = spring_problem(rectangle((2.0, 1.0), (2 * n, n), "cross"), quadrature)
        found = solve(discretize(problem))
        assert found.status.value == "converged"
        assert (found.penetration > 0.0).all()
        coarse = interpolate(found.problem.field, found.displacement, fine.points)  # type: ignore[arg-type]
        sizes.append(1.0 / n)
        errors.append(v_norm(fine, coarse - exact_spring(fine.points)))
    rate = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert 0.95 < rate < 1.1, (rate, errors)


@pytest.mark.parametrize("order", [1, 2])
def test_pressure_of_the_manufactured_solution(order: int) -> None:
    found = solve(discretize(spring_problem(rectangle((2.0, 1.0), (32, 16), "cross"), order=order)))
    x = found.problem.contact.points[:, 0]  # type: ignore[index]
    assert np.abs(found.pressure - 12.0 * 0.05 * x**2).max() < (0.02 if order == 1 else 2e-3) * 2.4
