"""What kind of point it is."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.certificates import PointKind, certify
from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, NoFriction, PiecewiseQuadratic, Signorini, Tresca
from hemivar.solvers import Controls, solve
from tests.certificates.problems import (
    bar_problem,
    bar_unknowns,
    block_of_arrays,
    brittle,
    softening,
    survey_softening,
)
from tests.problems import bar, discrete_square
from tests.samples import slow


@pytest.mark.parametrize(
    ("r", "kind"),
    [(1.0 / 12.0, PointKind.LOCAL_MINIMISER), (0.15, PointKind.MAXIMUM), (0.25, PointKind.LOCAL_MINIMISER)],
)
def test_the_three_roots_of_a_bar(r: float, kind: PointKind) -> None:
    """E1 with alpha = 2 above kappa = 1."""
    certificate = certify(bar_problem(0.25, 2.0, 0.1, 2.0), bar_unknowns(0.25, r))
    assert certificate.kind is kind
    assert certificate.stationary
    if kind is PointKind.MAXIMUM:
        assert certificate.curvature == pytest.approx(1.0 - 2.0)  # 1 - alpha / kappa
        assert certificate.unique is False
        assert certificate.direction is not None
        assert abs(certificate.direction[0, 0]) == pytest.approx(1.0)


def test_downward_jump() -> None:
    """At a downward jump the energy falls to both sides; at the end of the interval to one side only."""
    problem = bar(2.0 * 0.25, brittle(2.0, 0.15))
    top = certify(problem, bar_unknowns(0.25, 0.15), np.array([[0.10]]))
    assert top.kind is PointKind.MAXIMUM
    assert top.curvature == -np.inf
    edge = bar(2.0 * 0.15, brittle(2.0, 0.15))
    certificate = certify(edge, bar_unknowns(0.15, 0.15), np.array([[0.0]]))
    assert certificate.kind is PointKind.CLARKE_STATIONARY
    assert certificate.direction is not None
    assert certificate.direction[0, 0] == -1.0  # the foundation pushes it back


def test_saddle_with_friction() -> None:
    """Falls in the normal direction, held by friction or by a spring in the other."""
    for friction in (Tresca(0.1), NoFriction()):
        problem = block_of_arrays(softening(8.0, 0.1, 8.0), friction, (0.9, 0.0))
        u = np.zeros(2)
        r = (0.9 - 16.0 * 0.1) / (4.0 - 8.0)  # 4 r + (0.8 - 8 (r - 0.1)) = 0.9 on the falling piece
        u[0] = r
        certificate = certify(problem, u)
        assert certificate.stationary
        assert certificate.kind is PointKind.SADDLE
        assert certificate.curvature == pytest.approx(-1.0)


def test_many_contact_points_agree_with_the_dense_hessian() -> None:
    problem = survey_softening(40.0, n=6, friction=NoFriction())
    solution = solve(problem, controls=Controls(rtol=1e-12))
    certificate = certify(problem, solution.unknowns, solution.multiplier)
    assert certificate.margin < 0.0
    assert certificate.stationary
    line = problem.law.linearise(problem.local(solution.unknowns))
    assert line.smooth.all()
    B = problem.contact.trace.toarray()
    bend = np.zeros((B.shape[0],) * 2)
    d = problem.contact.components
    for j in range(problem.contact_points):
        bend[j * d : j * d + d, j * d : j * d + d] = problem.contact.weights[j] * line.hessian[j]
    K = problem.stiffness.toarray()
    root = np.linalg.inv(np.linalg.cholesky(K))
    lowest = np.linalg.eigvalsh(root @ (K + B.T @ bend @ B) @ root.T)[0]
    assert certificate.curvature == pytest.approx(min(lowest, 1.0), rel=1e-8)
    expected = PointKind.LOCAL_MINIMISER if lowest > 0 else PointKind.SADDLE
    assert certificate.kind is expected


def test_disturbed_point_is_not_stationary() -> None:
    problem = discrete_square("data (5.1)", 4)
    solution = solve(problem)
    certificate = certify(problem, 1.01 * solution.unknowns, solution.multiplier)
    assert certificate.kind is PointKind.NOT_STATIONARY
    assert certificate.unique is True
    assert not certificate.stationary


def test_fold_is_not_decided() -> None:
    """alpha = kappa: the curvature vanishes on the falling piece."""
    problem = bar(2.0 * 0.3, softening(2.0, 0.1, 1.0))
    certificate = certify(problem, bar_unknowns(0.3, 0.2))
    assert certificate.kind is PointKind.DIRECTIONALLY_STATIONARY
    assert certificate.unique is None


def test_convex_law_on_a_body_without_supports_of_its_own() -> None:
    problem = DiscreteProblem.of_arrays(
        np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([1.0, 0.0]), np.array([[0.0, 1.0]]), np.ones(1), np.zeros(1),
        ContactLaw(Signorini()),
    )  # fmt: skip
    certificate = certify(problem, np.array([1.0, 0.0]), np.array([[1.0]]))
    assert certificate.kind in (PointKind.UNIQUE_MINIMISER, PointKind.GLOBAL_MINIMISER)


@pytest.mark.parametrize(
    ("laws", "kinds"),
    [(12, {PointKind.LOCAL_MINIMISER}), slow(40, {PointKind.LOCAL_MINIMISER, PointKind.SADDLE, PointKind.MAXIMUM})],
)
def test_random_laws_against_sampled_energies(laws: int, kinds: set[PointKind]) -> None:
    """Random tables with jumps both ways: minimisers are minimisers, and where the energy is said to fall, it falls."""
    rng = np.random.default_rng(12)
    seen: dict[PointKind, int] = {}
    for _ in range(laws):
        count = int(rng.integers(1, 4))
        knots = np.sort(rng.uniform(-1.0, 1.0, (1, 3)))
        slopes = np.concatenate([[0.0], rng.uniform(-8.0, 4.0, 2), [0.0]])
        law = PiecewiseQuadratic(knots, slopes, rng.uniform(-1.0, 1.0, 3), start=rng.uniform(-1.0, 1.0))
        A = rng.standard_normal((count, count))
        K = A @ A.T + 0.3 * np.eye(count)
        load = 2.0 * rng.standard_normal(count)
        ones = np.ones(count)
        problem = DiscreteProblem.of_arrays(K, load, np.eye(count), ones, 0.0 * ones, ContactLaw(law))
        points = [solve(problem, controls=Controls(rtol=1e-12)).unknowns]
        for _ in range(20):  # stationary points of any kind on the smooth pieces, by Newton's method
            u = rng.uniform(-1.5, 1.5, count)
            for _ in range(8):
                line = law.curvature(u)
                u = u - np.linalg.solve(K + np.diag(line), K @ u - problem.load + law.derivative(u))
            points.append(u)
        for u in points:
            certificate = certify(problem, u)
            if not certificate.stationary:
                continue
            seen[certificate.kind] = seen.get(certificate.kind, 0) + 1
            here = problem.energy(u)
            if certificate.kind in (PointKind.LOCAL_MINIMISER, PointKind.UNIQUE_MINIMISER):
                for _ in range(20):
                    step = 1e-5 * rng.standard_normal(count)
                    assert problem.energy(u + step) >= here - 1e-14
            elif certificate.direction is not None:
                assert problem.energy(u + 1e-5 * certificate.direction[:, 0]) < here
    assert kinds <= set(seen), seen


@pytest.mark.parametrize("force", [1e-13, 1.0, 1e13])
def test_the_unit_of_force_does_not_matter(force: float) -> None:
    """What counts as the end of an interval is small against the multiplier, in whatever unit."""
    law = PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 8.0 * force, -8.0 * force, 0.0], [0.0] * 3)  # type: ignore[arg-type]
    problem = DiscreteProblem.of_arrays(
        force * np.diag([4.0, 4.0]), force * np.array([0.9, 0.0]), np.eye(2), np.ones(1), np.zeros(1),
        ContactLaw(law, Tresca(0.1 * force)),
    )  # fmt: skip
    certificate = certify(problem, np.array([0.7 / 4.0, 0.0]))
    assert certificate.stationary
    assert certificate.kind is PointKind.SADDLE
    assert certificate.curvature == pytest.approx(-1.0)
    jump = PiecewiseQuadratic([0.0, 0.15], [0.0, 2.0 * force, 0.0], [0.0, -0.3 * force])  # type: ignore[arg-type]
    bar_of_one = DiscreteProblem.of_arrays(
        np.array([[force]]), np.array([0.25 * force]), np.eye(1), np.ones(1), np.zeros(1), ContactLaw(jump)
    )
    certificate = certify(bar_of_one, np.array([0.15]), np.array([[0.10 * force]]))
    assert certificate.kind is PointKind.MAXIMUM
    assert certificate.curvature == -np.inf


@pytest.mark.parametrize(
    ("knots", "slopes", "pressure"),
    [
        ([0.0, 0.2], [0.0, 2.0, -5.0], 0.4),
        ([0.0, 0.1, 0.2], [0.0, 4.0, -1.5, 3.0], 0.25),
        ([0.0, 0.2], [0.0, 2.0, 5.0], 0.4),
    ],
)
def test_where_the_slope_bends_the_softer_side_decides(
    knots: list[float], slopes: list[float], pressure: float
) -> None:
    """At r = 0.2, kappa = 1: a side on which the law falls by more than kappa leaves no minimiser."""
    law = PiecewiseQuadratic(knots, slopes, [0.0] * len(knots))  # type: ignore[arg-type]
    r0 = 0.2 + pressure
    certificate = certify(bar(2.0 * r0, law), bar_unknowns(r0, 0.2), np.array([[pressure]]))
    assert certificate.stationary
    minimisers = (PointKind.UNIQUE_MINIMISER, PointKind.GLOBAL_MINIMISER, PointKind.LOCAL_MINIMISER)
    assert (certificate.kind in minimisers) is (min(slopes[-2:]) > -1.0)
