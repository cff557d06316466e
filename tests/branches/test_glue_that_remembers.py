"""Glue in time: unloading to the origin, breaks and jumps, the mode of onset, and marches by hand."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws.coupled import MixedMode
from tests.evolution.test_glue_that_remembers import SHUT, bilinear, pulled_along


@pytest.mark.parametrize("jump", ["local", "arc-length"])
def test_steep_glue_breaks_in_one_jump(jump: str) -> None:
    """With alpha = 36 above 12: at d = 0.3 from w = 0.1 to broken; of 0.36 that is stored before, G = 0.2 is taken."""
    laws = [MixedMode(bilinear(36.0), 1.0, SHUT)] if jump == "local" else []
    for law in (*laws, hv.Adhesive(24.0, 2.4, 36.0, 72.0)):
        history = pulled_along(law, [0.0, 0.29, 0.31, 0.1], 0.1, jump=jump, controls=hv.Controls())
        assert history.finished
        opened = [-frame.local[0, 0] for frame in history.frames]
        np.testing.assert_allclose(opened, [0.0, 12.0 * 0.29 / 36.0, 0.31, 0.1], atol=1e-8)
        assert any("the body jumped at t = 1.5" in message or "at t = 1.6" in message for message in history.messages)
        assert history["memory"][-1] == pytest.approx(0.2, rel=1e-8)
        assert history["jumps"][-1] == pytest.approx(0.16, rel=1e-2)
