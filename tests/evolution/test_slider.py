"""The slider on a spring: its cycle with other springs."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from hemivar.errors import ProblemError
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
