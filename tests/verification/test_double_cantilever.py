"""The double cantilever on a bilinear cohesive zone: exact beam, beam elements, plane stress, and a dead load."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.test_examples import run_example

#: Opening and load of the exact beam: first damage, peak, and growth by 5 and 20 mm, from another computation.
ONSET, PEAK = (0.3257791356, 13.39647198), (3.8741502, 122.54156)
GROWN = {5.0: (4.628313861, 112.4747645), 20.0: (7.113604785, 90.69944232)}


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    return run_example("double_cantilever")


def test_the_closed_form(found: dict[str, Any]) -> None:
    assert found["exact"](found["crack"], 0.0)[1::-1] == pytest.approx(ONSET, rel=1e-9)
    assert found["peak"] == pytest.approx(PEAK[1], rel=1e-6)
    for growth, (opening, load) in GROWN.items():
        assert found["grown"](growth) == pytest.approx((load, opening), rel=1e-9)


def load_errors(computed: tuple[np.ndarray, np.ndarray], curve: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Relative errors of the load from the first damage on, with the opening."""
    load, opening = computed
    beyond = opening > ONSET[0]
    return load[beyond] / np.interp(opening[beyond], curve[:, 1], curve[:, 0]) - 1.0, opening[beyond]


def test_beam_elements(found: dict[str, Any]) -> None:
    """Half a per cent all along; nodes that let go one after the other make the teeth."""
    off, _ = load_errors(found["beams"], found["curve"])
    assert np.abs(off).max() < 0.005
    assert found["beams"][0].max() == pytest.approx(PEAK[1], rel=0.005)


def test_the_order_of_beam_elements(found: dict[str, Any]) -> None:
    """Springs at nodes: the stiffness before any damage is of second order in the size of the cells."""
    misses = []
    for cells in (40, 80, 160):
        load, opening = found["by_beams"](cells)
        misses.append(np.interp(0.1, opening, load) / (0.1 * ONSET[1] / ONSET[0]) - 1.0)
    assert np.log2(misses[0] / misses[1]) == pytest.approx(2.0, abs=0.2)
    assert np.log2(misses[1] / misses[2]) == pytest.approx(2.0, abs=0.2)


def test_a_plane_stress_arm_on_its_plane_of_symmetry(found: dict[str, Any]) -> None:
    """It shears and is pressed across, which the beam is not: 1.5 % where the glue lets go."""
    off, opening = load_errors(found["plane"], found["curve"])
    assert np.abs(off[opening > 2.0]).max() < 0.015
    assert found["plane"][0].max() == pytest.approx(PEAK[1], rel=0.015)


def test_a_dead_load_fails_at_the_peak(found: dict[str, Any]) -> None:
    bracket = found["bracket"]
    assert 0.995 * bracket.carried <= PEAK[1] <= 1.005 * bracket.not_carried
    assert bracket.not_carried - bracket.carried <= 0.01 * bracket.not_carried
