"""Mixed-mode glue: the law against its own value, closed forms of a point on springs, and bad input."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from tests.bodies import opened_point
from tests.laws.coupled.test_mixed_mode import glue


def test_soft_springs_have_a_bonded_and_a_broken_solution_and_no_claim_of_one() -> None:
    law = glue()
    problem = opened_point(800.0, np.array([17.5, 17.5]), law)
    found = hv.find_solutions(problem, starts=4)
    damages = sorted(law.damage(solution.local)[0] for solution in found.minima)
    assert damages == pytest.approx([0.0, 1.0], abs=1e-12)
    assert not found.exhaustive
    margin = hv.certificates.smallness(problem).margin
    assert margin < 0.0
    assert hv.certify(found[0]).unique is not True
