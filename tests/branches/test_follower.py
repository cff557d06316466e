"""Where a path crosses a load, in closed form."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.branches.follower import trace
from hemivar.systems.chain import chain_of
from tests.problems import bar

STIFFNESS, LIMIT, ALPHA = 2.0, 0.1, 4.0


@pytest.mark.parametrize("r0", [0.17, 0.2, 0.28])
def test_crossings_of_straight_stretches_are_equilibria(r0: float) -> None:
    """A bar of stiffness 1 on a foundation that softens has three, at ``r0 = r + j'(r)``; pieces are straight."""
    problem = bar(2.0 * r0, hv.Softening(STIFFNESS, LIMIT, ALPHA), 2)
    chain = chain_of(hv.systems.Workspace().condensed(problem))
    start = np.array([r0 / (1.0 + STIFFNESS)])
    segment = next(s for s in range(int(chain.count[0])) if chain.inside(start, np.array([s]), 0.0).all())
    theta = start + chain.origin[:, segment] - chain.value[:, segment]
    found = trace(chain, chain.force, chain.force, theta, np.array([segment]), -1.5, 3.0)
    crossed = sorted(float(chain.evaluate(point, where)[0][0]) for point, where in found)
    by_hand = sorted([(r0 - (STIFFNESS + ALPHA) * LIMIT) / (1.0 - ALPHA), r0])  # on the falling part, and beyond it
    assert crossed == pytest.approx(by_hand, rel=1e-10)
