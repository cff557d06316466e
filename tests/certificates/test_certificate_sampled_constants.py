"""What rests on sampled constants is an estimate, and is never called unique, exhaustive or guaranteed."""

from __future__ import annotations

import numpy as np

from hemivar.certificates import smallness
from hemivar.laws import Compliance, ContactLaw, Friction, FunctionLaw, PenetrationBound
from tests.bodies import points_on_springs


def test_profiles_of_friction_whose_bound_depends_on_the_penetration() -> None:
    steep = FunctionLaw(lambda r: r, lambda r: np.ones_like(r), even=True)
    bound = PenetrationBound("min(max(s, 0), 0.5)/4")
    for friction, sampled in ((Friction(bound, steep), True), (Friction(0.2, steep), False)):
        problem = points_on_springs(1.0, (1.0, 0.3), ContactLaw(Compliance(0.5), friction), 2)
        assert smallness(problem).m_L_sampled == sampled
