"""Mixed-mode laws against brute force: local problems on fine grids, small bodies by scipy from many starts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import minimum_filter

from hemivar.laws import (
    BilinearCohesion,
    Compliance,
    ExponentialCohesion,
    MixedMode,
    Signorini,
    TrapezoidalCohesion,
    cohesion_table,
)
from hemivar.laws.coupled.opening import OpeningProblem


def random_mixed_mode(random: np.random.Generator, compliant: bool = False) -> MixedMode:
    strength, first = 10.0 ** random.uniform(-1.0, 2.0), 10.0 ** random.uniform(-4.0, -1.0)
    stored = 0.5 * strength * first
    stated = (strength, stored * (1.0 + 10.0 ** random.uniform(-1.0, 1.5)), strength / first)
    cohesion = [
        BilinearCohesion(*stated),
        ExponentialCohesion(*stated),
        TrapezoidalCohesion(*stated, 0.5 * (stated[1] / strength - 0.5 * first)),
        cohesion_table(first * np.array([0.0, 1.0, 2.0, 3.0, 5.0]), strength * np.array([0.0, 0.3, 1.0, 0.8, 0.0])),
    ][random.integers(4)]
    shut = Compliance(stated[2]) if compliant or random.random() < 0.3 else Signorini()
    return MixedMode(cohesion, 10.0 ** random.uniform(-0.5, 0.5), shut).at(None)


@pytest.mark.parametrize("laws", [30, pytest.param(250, marks=pytest.mark.slow)])
def test_local_problems_against_a_grid(laws: int) -> None:
    """Ten local problems of each law: also where springs are softer than the glue falls, so that there are several."""
    random = np.random.default_rng(11)
    for _ in range(laws):
        law = random_mixed_mode(random)
        alpha, last = float(law.weak_convexity[0][0]), law.opening_at_break.item()
        beta = float(law.beta[0])
        scale = np.array([1.0, 1.0 / beta])
        a = alpha * 10.0 ** random.uniform(-2.0, 1.0, (10, 2)) / scale**2
        b = a * random.uniform(-1.3, 1.3, (10, 2)) * last * scale
        b += law.strength * random.uniform(-1.0, 1.0, (10, 2)) / scale
        r = law.local_argmin(a, b)
        found = (0.5 * a * r**2 - b * r).sum(axis=1) + law.value(r)
        for i in range(10):
            free = np.maximum(-b[i, 0] / a[i, 0], 0.0)
            opening = np.concatenate([np.linspace(0.0, 1.5 * last, 120), np.linspace(0.0, 1.2 * free, 80)])
            pushed = -np.linspace(0.0, 2.0 * last, 60) if np.isinf(law.penetrations.upper).all() else np.zeros(1)
            slip = np.concatenate(
                [np.linspace(0.0, 1.5 * last / beta, 120), np.linspace(0.0, 1.2 * abs(b[i, 1]) / a[i, 1], 80)]
            )
            w, s = np.meshgrid(np.concatenate([opening, pushed]), np.sign(b[i, 1]) * slip, indexing="ij")
            places = np.column_stack([-w.ravel(), s.ravel()])
            energy = (0.5 * a[i] * places**2 - b[i] * places).sum(axis=1) + law.value(places)
            assert found[i] <= energy.min() + 1e-9 * (abs(found[i]) + law.fracture_energy.item())
        off = law.graph_distance(r, b - a * r, 1.0 / a)
        assert (off <= 1e-8 * (np.abs(b).max(axis=1) + law.strength)).all()


def test_as_many_minimisers_are_found_as_a_dense_row_of_secants_shows() -> None:
    """Two on one piece among them, whose ends both pull or both do not."""
    random = np.random.default_rng(5)
    rho, traction = np.array([0.0, 0.05, 0.3, 1.0, 3.0]), np.array([0.0, 1.0, 1.2, 0.9, 0.0])
    slopes = np.append(np.diff(traction) / np.diff(rho), 0.0)
    stiffness, force = 10.0 ** random.uniform(-2.0, 1.5, (2, 4000, 2))
    tables = (np.broadcast_to(part, (4000, part.size)) for part in (rho[1:], traction[1:], slopes))
    found = np.isfinite(OpeningProblem(stiffness, force, *tables).minimisers()).sum(axis=1)
    m = np.logspace(-6.0, 3.0, 3001)
    size = np.hypot(*(force.T[:, :, None] / (stiffness.T[:, :, None] + m)))
    u = m * size - np.interp(size, rho, traction)
    shown = ((u[:, :-1] <= 0.0) & (u[:, 1:] > 0.0)).sum(axis=1) + (u[:, 0] > 0.0)
    np.testing.assert_array_equal(found, shown)


@pytest.mark.parametrize("force", [(2.39985, 0.83611), (2.4, 0.838), (2.3996, 0.835)])
def test_two_minimisers_on_both_sides_of_the_turning_point(force: tuple[float, float]) -> None:
    """Stiff in opening and soft in slip: u rises and falls on one piece, with one minimum there and one far away."""
    (a, b), (c, t), k, first, last = (2.472, 0.24366), force, 0.99059, 0.93982, 3.54019
    fall = k * first / (last - first)
    local = OpeningProblem(
        *(np.array([part]) for part in ([a, b], [c, t], [first, last], [k * first, 0.0], [k, -fall, 0.0]))
    )
    x = np.linspace(0.0, 6.0, 1201)
    w, s = np.meshgrid(x, x, indexing="ij")
    rho = np.hypot(w, s)
    beyond = np.clip(rho, first, last) - first
    glue = 0.5 * k * np.minimum(rho, first) ** 2 + k * first * beyond - 0.5 * fall * beyond**2
    energy = 0.5 * a * w**2 + 0.5 * b * s**2 - c * w - t * s + glue
    lowest = energy == minimum_filter(energy, 5, mode="nearest")
    on_grid = np.column_stack([w[lowest], s[lowest]])
    m = local.minimisers()
    found = local.places(m)[0][np.isfinite(m[0])]
    assert len(found) == len(on_grid)
    np.testing.assert_allclose(found[np.argsort(found[:, 1])], on_grid[np.argsort(on_grid[:, 1])], atol=0.01)
