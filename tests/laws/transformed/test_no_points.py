"""A law of no contact points at all, as a rank without any has."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.laws import Compliance, Signorini, Superpotential
from hemivar.laws.rescaled import RescaledLaw


@pytest.mark.parametrize("law", [Signorini(), Compliance(20.0)], ids=str)
def test_a_law_moved_at_no_points_has_no_rows(law: Superpotential) -> None:
    moved = RescaledLaw(law, np.ones(1), np.full(1, 2.0), np.zeros(0))
    assert moved.rows == 0
    assert moved.knots.shape[0] == 0
    assert np.broadcast_to(moved.domain.upper, (0,)).size == 0
    assert moved.value(np.zeros(0)).shape == (0,)
