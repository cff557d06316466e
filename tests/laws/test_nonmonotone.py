"""Nonmonotone laws: the conformance kit, brute force, known constants."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hemivar.errors import ProblemError
from hemivar.laws import (
    Adhesive,
    Capped,
    ContactLaw,
    FinitePenetration,
    FormulaLaw,
    Layered,
    Logarithmic,
    NoContact,
    PiecewiseQuadratic,
    SawTooth,
    Signorini,
    SlipWeakening,
    Softening,
    StaticKinetic,
    ThresholdCompliance,
    table_law,
)
from hemivar.laws.piecewise_law import stack
from hemivar.laws.proof import SAMPLED, Constant, Proof
from hemivar.laws.testing import check_law
from tests.samples import sampled

from .catalogue import LAWS, REACH


@pytest.mark.parametrize("name", LAWS)
def test_every_law_passes_the_kit(name: str) -> None:
    report = check_law(LAWS[name], reach=REACH.get(name))
    assert report.passed
    assert len(report.checks) == 20


def _local_minima(grid: np.ndarray, energies: np.ndarray) -> np.ndarray:
    inner = (energies[1:-1] < energies[:-2]) & (energies[1:-1] < energies[2:])
    return grid[1:-1][inner]


@pytest.mark.parametrize("name", sampled(LAWS, 3))
@given(stiffness=st.floats(0.3, 30.0), b=st.integers(-3000, 3000).map(lambda n: 1e-3 * n))
@settings(max_examples=10, deadline=None)
def test_all_local_minimisers_are_found(name: str, stiffness: float, b: float) -> None:
    law = LAWS[name]
    far = REACH.get(name, 8.0)  # where the curvature of a formula turns is known up to its reach
    low, high = max(-far, float(law.domain.lower[0])), min(far, float(law.domain.upper[0]))
    grid = np.linspace(low, high, 40001)
    a = np.array([stiffness])
    energies = 0.5 * stiffness * grid**2 - b * grid + law.value(grid)
    points, found = law.local_minimisers(a, np.array([b]))
    points = points[0][np.isfinite(found[0])]
    spacing = grid[1] - grid[0]
    for r in _local_minima(grid, energies):
        assert np.abs(points - r).min() <= 2.0 * spacing
    for r in points[np.abs(points) < far - 0.1]:  # and each of them is one
        away = np.abs(r - law.knots[0])
        if np.any((away > 0.0) & (away < 2e-5)):
            continue
        around = np.clip(r + np.array([-1e-5, 0.0, 1e-5]), low, high)
        e = 0.5 * stiffness * around**2 - b * around + law.value(around)
        assert e[1] <= e.min() + 1e-13 * (1.0 + np.abs(e).max())
    best = law.local_argmin(a, np.array([b]))
    assert float((0.5 * a * best**2 - b * best + law.value(best))[0]) <= energies.min() + 1e-9


def test_a_sampled_constant_that_is_too_small_does_not_hide_the_lowest_minimiser() -> None:
    """Two wells of a/2 r^2 - b r + j(r), a above the alpha that was sampled and below the true one."""

    table = Softening(2.0, 0.1, 2.0).table  # alpha is 2

    class Missed(type(table)):  # type: ignore[misc]
        weak_convexity = np.array([0.5])

        def proof(self, constant: Constant) -> Proof:
            return SAMPLED

    law = copy.copy(table)
    object.__setattr__(law, "__class__", Missed)
    assert not law.convex
    a, grid = np.ones(1), np.linspace(-1.0, 1.0, 200001)
    for b in (0.22, 0.235, 0.25, 0.26, 0.28):
        energies = 0.5 * grid**2 - b * grid + law.value(grid)
        assert float(law.local_argmin(a, np.array([b]))[0]) == pytest.approx(grid[np.argmin(energies)], abs=2e-5)


def test_the_bar_on_a_softening_foundation_has_its_two_minimisers() -> None:
    law = Softening(2.0, 0.1, 2.0)  # E1 with kappa = 1, r0 = 0.25: r = 1/12, 0.25, and a maximum at 0.15
    points, energies = law.local_minimisers(np.ones(1), np.array([0.25]))
    found = np.sort(points[0][np.isfinite(energies[0])])
    np.testing.assert_allclose(found, [1 / 12, 0.25], rtol=1e-14)
    np.testing.assert_allclose(
        np.sort(energies[0][np.isfinite(energies[0])]) + 0.5 * 0.25**2, [0.02, 0.0208333333333333], rtol=1e-12
    )
    assert law.distance(np.array([0.15]), np.array([0.1]))[0] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(
    ("law", "alpha", "growth"),
    [
        (Softening(2.0, 0.1, 0.5), 0.5, (0.2, 0.0)),
        (Capped(20.0, 0.1), np.inf, (2.0, 0.0)),
        (Capped(300.0, 0.1, 1.0), 0.0, (30.0, 0.0)),
        (FinitePenetration(3.0, 0.2), 0.0, (np.inf, np.inf)),
        (Adhesive(5.0, 1.0, 2.0, 30.0), 2.0, (0.0, 30.0)),
        (SlipWeakening(0.5).radial, 0.15, (0.5, 0.0)),
        (SlipWeakening(0.5, 0.7, 1.0).radial, 0.0, (0.5, 0.0)),
        (Logarithmic(0.5, 0.2).radial, 12.5, (2.5, 0.0)),
        (StaticKinetic(0.5, 0.1).radial, np.inf, (0.5, 0.0)),
        (FormulaLaw("7/10*abs(r) - 3/10*exp(-abs(r))"), 0.3, (1.0, 0.0)),
        (FormulaLaw("0.3*cos(5*r) + 0.05*r^2", reach=4.0), 7.4, None),
    ],
)
def test_constants(law: object, alpha: float, growth: tuple[float, float] | None) -> None:
    told = law.describe()  # type: ignore[attr-defined]
    assert told.alpha == pytest.approx(alpha, rel=1e-6)
    assert told.law_class == ("jumps down" if alpha == np.inf else "weakly convex" if alpha else "convex")
    if growth is not None:
        assert (told.c0, told.c1) == pytest.approx(growth, rel=1e-6, abs=1e-12)


def test_the_delamination_of_makela() -> None:
    law = SawTooth([0.5e-3, 1e-3, 2e-3], [60e6, 20e6, 10e6], [0.0, 10e3, 5e3])
    w = np.array([0.25e-3, 0.75e-3, 1.5e-3, 2.5e-3])
    np.testing.assert_allclose(-law.derivative(-w), [15e3, 25e3, 20e3, 0.0], rtol=1e-12)
    told = law.describe()
    falls = [(k.place, k.left, k.right) for k in told.kinks if np.isfinite(k.jump)]
    np.testing.assert_allclose(falls, [(-2e-3, 0, -25e3), (-1e-3, -15e3, -30e3), (-0.5e-3, -20e3, -30e3)], atol=1e-9)
    assert told.alpha_places == (-2e-3, -1e-3, -0.5e-3)
    assert "jumps down at r = -0.002, -0.001, -0.0005" in str(told)
    check_law(law)
    assert law.value(np.array([1e-9]))[0] == np.inf


@pytest.mark.parametrize("shift", [0.0, 1.0])
def test_teeth_on_springs_pull_from_the_first_opening_on(shift: float) -> None:
    """Tension ``6 w + shift`` up to 0.5, ``2 w + 0.25`` up to 1; springs of 9 below: at zero anything between."""
    law = SawTooth([0.5, 1.0], [6.0, 2.0], [shift, 0.25], compression=9.0)
    w = np.array([-0.2, 1e-9, 0.3, 0.7, 1.2])
    np.testing.assert_allclose(
        law.derivative(-w), [1.8, -shift - 6e-9, -1.8 - shift, -1.65, 0.0], rtol=1e-12, atol=1e-15
    )
    at_rest = law.subdifferential(np.zeros(1))
    assert (at_rest.lower[0], at_rest.upper[0]) == (-shift, 0.0)


def test_parameters_may_vary_from_point_to_point() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    laws = [
        Softening(lambda x: 1.0 + x[:, 0], 0.1, lambda x: x[:, 0]).at(points),
        Adhesive(lambda x: 5.0 + x[:, 0], 1.0, compression=lambda x: 1.0 + x[:, 0]).at(points),
        SlipWeakening(lambda x: 0.5 + x[:, 0], 1.0, 0.7, lambda x: 1.0 + x[:, 0]).at(points).radial,
        Logarithmic(0.5, lambda x: 0.1 + x[:, 0]).at(points).radial,
        StaticKinetic(0.5, lambda x: 0.1 + x[:, 0]).at(points).radial,
        stack([(Capped(20.0, 0.1), 1), (FormulaLaw("r^2"), 1), (NoContact(), 1)]),
    ]
    for law in laws:
        assert check_law(law).passed
        for j in range(3):
            assert check_law(law.take(np.array([j]))).passed
            assert law.describe(j).alpha == law.take(np.array([j])).describe().alpha


def test_coercivity() -> None:
    falling = PiecewiseQuadratic([0.0], [0.0, -2.0], [0.0])  # type: ignore[arg-type]
    np.testing.assert_array_equal(falling.coercive_against(np.array([1.0, 2.0, 2.1])), [False, False, True])
    assert falling.describe().coercive_above == 2.0
    assert "only if the body is stiffer than 2" in str(falling.describe())
    for law in (ThresholdCompliance(0.3), Signorini(), Capped(20.0, 0.1), LAWS["slip weakening"], LAWS["waves"]):
        assert law.coercive_against(1e-3).all()
    assert not FormulaLaw("-r^4").coercive_against(1e6).any()
    assert not FormulaLaw("-3*r^2").coercive_against(5.9).any()
    assert FormulaLaw("-3*r^2").coercive_against(6.1).all()
    assert np.isnan(falling.local_argmin(np.ones(1), np.ones(1))).all()
    assert np.isnan(FormulaLaw("-r^4").local_argmin(np.ones(1), np.ones(1))).all()


def test_friction_laws_are_radial_in_3d() -> None:
    rng = np.random.default_rng(5)
    law = ContactLaw(ThresholdCompliance(0.3, 2.0), SlipWeakening(0.5, rate=4.0))
    a, b = np.full((40, 2), 0.9), rng.normal(size=(40, 3))
    r = law.local_argmin(a, b)
    lam = b - 0.9 * r
    assert np.all(law.distance(r, lam) < 1e-10)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Softening(0.0, 0.1, 1.0).at(None), ["stiffness", "softening", "positive"]),
        (lambda: Softening(1.0, [0.1, 0.2], [1.0, 2.0, 3.0]).at(None), ["2, 3", "contact points"]),
        (lambda: Capped(1.0, 0.1, -1.0).at(None), ["residual", "at least 0"]),
        (lambda: Layered([0.1, -0.2], [1.0, 2.0]), ["thicknesses", "-0.2", "positive"]),
        (lambda: Layered([0.1, 0.2], [1.0]), ["stiffnesses", "needs 2", "each layer"]),
        (lambda: Layered([0.1], [1.0], [-1.0]), ["drops", "at least 0"]),
        (lambda: SawTooth([0.2, 0.1], [1.0, 1.0]), ["openings", "increase"]),
        (lambda: SawTooth([0.2], [1.0], compression=-1.0), ["compression", "at least 0"]),
        (lambda: SawTooth(["a"], [1.0]), ["openings", "numbers"]),
        (lambda: SlipWeakening(0.5, rate=0.0).at(None).radial.knots, ["rate", "positive"]),
        (lambda: LAWS["waves"].scaled(-1.0), ["scaled by -1", "at least 0"]),
        (lambda: table_law([0.0, 1.0], [0.0, 1.0], extend="flat"), ["extend", "'constant' or 'linear'"]),
    ],
)
def test_bad_parameters_are_named(make: object, words: list[str]) -> None:
    with pytest.raises(ProblemError) as caught:
        make()  # type: ignore[operator]
    for word in words:
        assert word in str(caught.value)
