"""The pair of mixed-mode glue in a chart: found by its piece, without a search."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import BilinearCohesion, MixedMode


@pytest.mark.parametrize("seed", range(8))
def test_a_pair_comes_back_from_its_place_in_the_chart(seed: int) -> None:
    """Elastic, softening, broken and pressed points, at knots and beside them; units of any size."""
    rng = np.random.default_rng(seed)
    strength, first = 10.0 ** rng.uniform(-3.0, 6.0), 10.0 ** rng.uniform(-6.0, 0.0)
    last = first * rng.uniform(1.5, 50.0)
    cohesion = BilinearCohesion(strength, 0.5 * strength * last, strength / first)
    law = MixedMode(cohesion, float(rng.uniform(0.3, 3.0)), hv.Compliance(strength / first)).at(None)
    alphas = np.array([float(alpha.max()) for alpha in law.weak_convexity])
    a = alphas * (1.0 + 10.0 ** rng.uniform(-2.0, 2.0, (80, 2)))
    r = last * rng.uniform(-2.0, 1.0, (80, 2)) * 10.0 ** rng.uniform(-3.0, 0.5, (80, 1))
    r[:3] = 0.0
    r[3:12] = np.outer(-np.repeat([first, last, 2.0 * last], 3) * np.tile([1.0, 1.0 - 1e-9, 1.0 + 1e-9], 3), [1.0, 0.0])
    lam = law.nearest_multiplier(r, np.zeros_like(r))
    found = law.on_graph(a * r + lam, a)
    np.testing.assert_allclose(found.r, r, atol=1e-11 * last)
    np.testing.assert_allclose(found.multiplier, lam, atol=1e-9 * float((a * last).max()))
