"""The survey's methods are for laws with a normal law and a friction of their own."""

from __future__ import annotations

import pytest

import hemivar as hv
from hemivar.laws import OrthotropicFriction
from tests.bodies import body, glued_plate
from tests.laws.coupled.test_mixed_mode import BILINEAR
from tests.laws.coupled.test_own_coupled import LAWS


def test_what_needs_a_normal_law_and_friction_says_so() -> None:
    for method in (hv.survey.PrimalDualActiveSet(), hv.survey.ProximalBundle()):
        with pytest.raises(hv.HemivarError, match=r"couples opening and slip|not convex"):
            hv.solve(glued_plate(BILINEAR), method)
    with pytest.raises(hv.HemivarError, match="couples opening and slip"):
        hv.solve(glued_plate(LAWS["gauss"]()), hv.survey.PrimalDualActiveSet())


def test_active_sets_need_a_friction_that_is_the_same_in_all_directions() -> None:
    friction = OrthotropicFriction(1.5, ratio=0.3, axis=(1.0, 1.0, 0.0))
    problem = body(hv.box((1.0, 1.0, 0.5), 2), hv.Contact(hv.Signorini(), friction), body_force=(0.5, 0.3, -3.0))
    with pytest.raises(hv.HemivarError, match="depends on the direction of the slip"):
        hv.solve(problem, hv.survey.PrimalDualActiveSet())
