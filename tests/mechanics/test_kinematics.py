"""Kinematics of bodies, and of the parts of them that a rank has."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.mechanics.kinematics import BodyKinematics, voigt_index


@pytest.mark.parametrize("ring", [False, True])
def test_which_nodes_lie_on_the_axis(ring: bool) -> None:
    """A rank without cells has no nodes."""
    kinematics = BodyKinematics(voigt_index(2), ring)
    assert kinematics.on_axis(np.array([[0.0, 1.0], [2.0, 0.0], [0.0, 0.0]])).tolist() == [ring, False, ring]
    assert kinematics.on_axis(np.zeros((0, 2))).tolist() == []
