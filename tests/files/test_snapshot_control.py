"""What is written of a march whose load factor is an answer."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Evolution, march
from hemivar.files.snapshot import snapshot
from tests import bodies
from tests.evolution.test_control import SPRING, STIFF, STRENGTH


def test_what_is_written_of_a_gap_is_that_of_the_load_factor() -> None:
    """A foundation that recedes by the factor: stretched by spring and glue in a row, whichever way it goes."""
    contact = hv.Contact(hv.Adhesive(STIFF, STRENGTH, 36.0, 72.0), gap=lambda x, t: np.full(len(x), t))
    receding = Evolution(bodies.column(contact, stiffness=SPRING, top=hv.Fixed(y=0.0)))
    history = march(receding, 0.6, step=0.05, control="dissipation")
    assert history.ended == "broken"
    for frame in history.frames:
        seen = snapshot(history.discrete, frame)
        np.testing.assert_allclose(seen.gap[0], -frame.local[0, 0] - frame.displacement[:, 1].min(), atol=1e-12)
    between = snapshot(history.discrete, history.at(0.375))
    assert between.gap[0] == pytest.approx(history["load_factor"][7:9].mean(), rel=1e-9)
