"""A block dragged at a speed: its friction over its pressure is the coefficient that the law has at that speed."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv


@pytest.mark.parametrize("unit", [1.0, 1e-3], ids=["mm", "m"])
@pytest.mark.parametrize("speed", [0.01, 0.2, 1.0, 5.0])
def test_a_block_dragged_steadily_rubs_with_the_coefficient_of_its_speed(speed: float, unit: float) -> None:
    law = hv.laws.ExponentialDecay(0.5, 0.2, decay=3.0 / unit)
    problem = hv.ContactProblem(
        hv.rectangle((2.0 * unit, unit), (4, 2)),
        hv.Material.young(1e3, 0.3),
        contact={
            "bottom": hv.Contact(
                hv.Signorini(), law, belt=lambda x, t: speed * unit * t * np.tile([1.0, 0.0], (len(x), 1))
            )
        },
        supports={"top": hv.Fixed(x=0.0, y=-0.001 * unit)},
    )
    history = hv.march(hv.Evolution(problem), until=1.0, step=0.05)
    coefficient = 0.2 + 0.3 * np.exp(-3.0 * speed)
    assert history["friction_force"][-1] / history["normal_force"][-1] == pytest.approx(coefficient, rel=1e-9)
