"""The slider on a spring: its cycle with other springs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from hemivar import march
from hemivar.errors import ProblemError
from hemivar.evolution import stepper
from hemivar.gallery import EarthquakeSlider


@dataclass(frozen=True)
class Other(EarthquakeSlider):
    """One with a spring of its own."""

    factor: float = 1.0

    @property
    def stiffness(self) -> float:
        return self.factor * super().stiffness


@pytest.mark.parametrize("factor", [2.0, 4.0, -1.0, 0.0, float("nan")])
def test_a_spring_without_a_cycle_is_refused_in_a_sentence(factor: float) -> None:
    with pytest.raises(ProblemError, match="no limit cycle"):
        Other(factor=factor).cycle(rtol=1e-4)


def test_a_softer_spring_takes_longer() -> None:
    """Between two events the spring is loaded by what the stress falls by: ``k Vp`` times the period, creep aside."""
    soft = Other(factor=0.25)
    period, _, least, most = soft.cycle(rtol=1e-6)
    assert period == pytest.approx((most - least) / (soft.stiffness * soft.creep), rel=0.1)


def test_a_slip_that_renews_its_contacts_settles_in_few_rounds(monkeypatch: pytest.MonkeyPatch) -> None:
    """What two rounds have found says where the next ones lead: each alone leaves a sixth of what its guess missed.

    What is found stands: the friction is that of the slip rate and of the age that the slip has left.
    """
    rounds, make = [], stepper.stage_law

    def counted(*given: Any) -> Any:
        rounds.append(given)
        return make(*given)

    monkeypatch.setattr(stepper, "stage_law", counted)
    slider, step = EarthquakeSlider(), 1e6
    before, now = (march(slider.evolution(1e-3), end, step=step).state for end in (9.0 * step, 10.0 * step))
    assert len(rounds) <= 7 * 19 + 4
    speed = np.abs(now.local.displacement - before.local.displacement)[:, 1] / step
    slid = speed * step / slider.length
    age = before.memory["bottom"]["0.age"] * np.exp(-slid) - slider.length / speed * np.expm1(-slid)
    np.testing.assert_allclose(now.memory["bottom"]["0.age"], age, rtol=1e-8)
    strength = slider.reference + slider.evolve * np.log(slider.rate * age / slider.length)
    friction = slider.direct * np.arcsinh(speed / (2.0 * slider.rate) * np.exp(strength / slider.direct))
    np.testing.assert_allclose(now.multiplier[:, 1], slider.pressure * friction, rtol=1e-9)
