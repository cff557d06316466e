"""Poles of formulas: found with their place, which is known in closed form, or refused as an argument of a proof."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import FormulaLaw


def one_unknown(law: hv.laws.Superpotential, force: float) -> hv.DiscreteProblem:
    """``r + j'(r) = force``."""
    return hv.DiscreteProblem.of_arrays(
        stiffness=[[1.0]],
        load=[force],
        trace=[[1.0]],
        weights=[1.0],
        gap=[0.0],
        law=hv.laws.ContactLaw(law).at(None),
    )


@pytest.mark.parametrize(("pole", "reach"), [(1.0, 0.9), (20.0, 10.0)])
def test_a_pole_beyond_the_reach_leaves_no_claim_beyond_it(pole: float, reach: float) -> None:
    """``r + 1/(p - r) = f`` has the roots ``((p + f) -+ sqrt((p - f)^2 + 4))/2``, one of them behind the pole."""
    force = 0.4
    law = FormulaLaw(derivative=f"1/({pole} - r)", reach=reach)
    assert law.proof("alpha").reach == (reach,)
    assert law.describe().law_class == "convex within the reach"
    assert np.isinf(law.proof("alpha").value(2.0 * pole)[0][0])
    assert np.isinf(law.growth[0][0])
    near, far = (0.5 * (pole + force + s * math.sqrt((pole - force) ** 2 + 4.0)) for s in (-1.0, 1.0))
    for root in (near, far):
        assert root + 1.0 / (pole - root) == pytest.approx(force)
    solution = hv.solve(one_unknown(law, force))
    assert solution.penetration[0] == pytest.approx(near)
    assert "within the reach" in str(solution.certify())
    assert solution.certify().unique is not True
    found = hv.find_solutions(one_unknown(law, force), starts=3)
    assert "perhaps not all" in str(found)
    assert min(abs(one.penetration[0] - near) for one in found.solutions) < 1e-8
