"""Laws of penetration and slip by a formula or functions: the kit, other solvers of the same problem, and bad input."""

from __future__ import annotations

import hemivar as hv
from tests.bodies import opened_point
from tests.laws.coupled.test_own_coupled import LAWS


def test_soft_springs_have_a_bonded_and_a_broken_solution() -> None:
    found = hv.find_solutions(opened_point(300.0, (12.0, 0.0), LAWS["rigid"]()), starts=4)
    places = sorted(-solution.local[0, 0] for solution in found.minima)
    assert [round(place, 3) for place in places] == [0.002, 0.04]
    assert not found.exhaustive
    assert hv.certify(found[0]).unique is not True
