"""The way downhill from a kink at which the law has the slope zero but for rounding."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws.scalar_graph import local_minimiser

GLUE = hv.Adhesive(stiffness=2000.0, strength=20.0, softening=1000.0, compression=1e4)


@pytest.mark.parametrize("force", [-1e-12, -1e-17, 0.0, 1e-20, 1e-17, 1e-12])
@pytest.mark.parametrize("stiffness", [823.4, 4813.9, 1e5])
def test_a_kink_at_rest_is_left_by_rounding_alone(force: float, stiffness: float) -> None:
    """The table of the glue has the slope 3.6e-15 to the left of 0, where it is 0."""
    law = GLUE.at(None)
    one = np.ones(1)
    found = local_minimiser(law, stiffness * one, force * one, 0.0 * one)
    assert abs(found[0]) <= 2e-12 / stiffness


def test_an_energy_that_falls_without_end_is_still_found() -> None:
    falling = hv.table_law([0.0, 0.1, 0.2], [0.0, 1.0, 0.5], extend="linear").at(None)  # slope -5 beyond 0.1
    one = np.ones(1)
    assert np.isnan(local_minimiser(falling, 2.0 * one, 0.1 * one, 0.5 * one)).all()
    assert np.isfinite(local_minimiser(falling, 2.0 * one, 0.1 * one, 0.0 * one)).all()
