"""Evolutions with known answers: ``benchmarks/evolution_verification.py`` with few and long steps."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.errors import ProblemError
from hemivar.evolution import march

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def cases() -> ModuleType:
    """The benchmark."""
    sys.path.insert(0, str(BENCHMARKS))
    try:
        spec = importlib.util.spec_from_file_location(
            "evolution_verification", BENCHMARKS / "evolution_verification.py"
        )
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(BENCHMARKS))
    return module


def test_closed_forms_of_the_gallery_have_the_published_values() -> None:
    """Digits computed apart from the gallery."""
    assert gallery.relaxing_block().exact(1.0) == pytest.approx(0.156833711943, abs=1e-12)
    assert gallery.wearing_block().exact(4.0) == pytest.approx(0.742540070167, abs=1e-12)
    assert gallery.bounce(100.0, 4.0) == pytest.approx((0.279535444073, 0.571740027585), abs=1e-12)
    assert gallery.bounce(100.0, 0.0) == pytest.approx((np.pi / 10.0, 1.0), rel=1e-14)
    rubbing = gallery.StickSlip()
    assert (rubbing.sticks, rubbing.slips) == pytest.approx((2.0, 2.034443936), abs=1e-9)
    assert (rubbing.peak, rubbing.loss) == pytest.approx((0.323606798, 0.06 * 4.034443936), abs=1e-9)
    step = gallery.VelocityStep()
    assert (step.coefficient(0.0), step.coefficient(1e12)) == pytest.approx((0.657564627, 0.623025851), abs=1e-9)
    assert gallery.jumping_block().exact(0.8) == pytest.approx(0.016666667, abs=1e-9)


def test_the_loss_of_a_rubbed_sphere_is_the_area_of_its_loop() -> None:
    """The closed form against the integral of the loop that Masing's rule makes of the first loading."""
    sphere, share = gallery.MindlinSphere(), 0.7
    force, shift = sphere.friction * sphere.force, sphere.shift
    x = np.linspace(-share, share, 200001)
    back = np.array([shift(share) - 2.0 * shift(0.5 * (share - y)) for y in x])
    forth = np.array([-shift(share) + 2.0 * shift(0.5 * (share + y)) for y in x])
    assert sphere.loss(share) == pytest.approx(np.trapezoid(back - forth, x) * force, rel=1e-7)


def test_a_bounce_against_its_equation() -> None:
    """The closed forms of contact against integration in small steps."""
    k, c, r, v, t, tau = 100.0, 30.0 / 2.0, 0.0, 1.0, 0.0, 1e-5
    while k * r + c * v > 0.0:
        half = v - 0.5 * tau * (k * r + c * v)
        r += tau * half
        v = (half - 0.5 * tau * k * r) / (1.0 + 0.5 * tau * c)
        t += tau
    assert gallery.bounce(k, c) == pytest.approx((t, -v), abs=1e-3)


@pytest.mark.parametrize(
    ("case", "steps", "error", "order"),
    [("d3", (8, 16), 0.01, 0.9), ("d2", (5, 10), 1e-4, 0.9), ("d6", (8, 16), 0.02, 0.7)],
)
def test_errors_fall_as_they_should(
    cases: ModuleType, case: str, steps: tuple[int, ...], error: float, order: float
) -> None:
    row = getattr(cases, case)(steps)[0]
    assert row["error"] < error, row
    assert row["order"] > order, row


def test_stick_slip(cases: ModuleType) -> None:
    """Friction falls over rates up to 0.04, where the largest is 0.3."""
    for row in cases.d10((0.04,)):
        assert row["error"] < 0.25, row


@pytest.mark.slow
def test_stick_slip_converges(cases: ModuleType) -> None:
    for row in cases.d10((0.04, 0.02, 0.01)):
        assert row["error"] < 0.08, row
        assert row["order"] > 0.2, row  # the delay at the beginning of a slip goes as decay log decay


def test_rubbed_spheres(cases: ModuleType) -> None:
    """Six cells along the radius: the loss is that of the force which was measured, within 6 %."""
    (row,) = cases.d11((6,))
    assert row["error"] < 0.06
    with pytest.raises(ProblemError, match="between 0 and"):
        gallery.MindlinSphere().evolution(4, 1.2)


def test_the_friction_force_in_space_is_that_of_its_vectors() -> None:
    """The tangents of contact points on planes of symmetry differ from those of others."""
    history = march(gallery.MindlinSphere().evolution(3, sides=3.0), 1.0, step=1.0)
    contact = history.discrete.problem.contact
    local = history.state.multiplier.copy()
    local[:, 0] = 0.0
    force = contact.weights @ contact.global_vectors(local)
    assert history["friction_force"][-1] == pytest.approx(np.linalg.norm(force), rel=1e-12)
    assert force[0] > 5.0 * abs(force[1])
    assert float(np.ptp(contact.frames[:, 1, 0])) > 0.5  # otherwise this shows nothing


def test_a_step_of_the_slip_rate(cases: ModuleType) -> None:
    peak, end, off = cases.d13(10)
    assert peak["error"] < 1e-7
    assert peak["known"] == pytest.approx(0.657564627, abs=1e-5)
    assert end["error"] < 1e-7
    assert off["error"] < 1e-6


def test_the_equations_of_an_earthquake_cycle() -> None:
    """Period and largest rate; the stress is least and largest where the slider creeps as its spring does."""
    slider = gallery.EarthquakeSlider()
    period, peak, low, high = slider.cycle(1e-8)
    assert period / (365.25 * 86400.0) == pytest.approx(14.1686865, rel=1e-5)
    assert peak == pytest.approx(0.83203, rel=1e-4)
    # What the spring has lost in a slip it has gained back in a period at most; some of it slowly.
    assert high - low < slider.stiffness * slider.creep * period
    assert high - low > 0.9 * slider.stiffness * slider.creep * period


def test_a_manufactured_motion_on_springs_and_dampers(cases: ModuleType) -> None:
    places = {row["what"]: row for row in cases.d15((4, 8))}
    orders = {what: row["order"] for what, row in places.items()}
    assert orders["mean square error of u at nodes, implicit-euler"] > 0.9
    assert orders["mean square error of u at nodes, generalized-alpha"] > 1.7
    assert orders["error in the energy norm, implicit-euler"] > 0.8
    assert orders["error in the energy norm, generalized-alpha"] > 0.8
    known = gallery.ManufacturedMotion()
    history = march(known.evolution(8), 1.0, step=1.0 / 16, scheme=hv.evolution.GeneralizedAlpha(0.8))
    points = history.discrete.problem.contact.points
    exact = known.pressure(points, 1.0)
    inside = (points[:, 0] > 0.1) & (points[:, 0] < 1.9)
    assert np.abs(history.state.multiplier[:, 0] - exact)[inside].max() < 0.05 * exact.max()
    assert abs(history.ledger["gap"]) < 1e-12


def test_restarts_and_rejections(cases: ModuleType) -> None:
    assert cases.d18((3,))[0]["found"] == 0.0
    assert cases.d19()[0]["found"] == 0.0


def test_ledgers_computed_elsewhere(cases: ModuleType) -> None:
    assert all(row["error"] < 1e-7 for row in cases.d16())


def test_every_case_has_a_row(cases: ModuleType) -> None:
    assert list(cases.CASES) == [f"D{k}" for k in range(1, 20)]
    table = cases.shown([cases.row("D1", "what", 1.0, 1.5, "tau = 1", 0.5)])
    assert table.splitlines()[-1] == "| D1 | what | 1 | 1.5 | 5.0e-01 | tau = 1 | 0.50 |"
