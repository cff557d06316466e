"""Newton's equations near a solution, against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from hemivar.systems.dense_newton import DenseFactor


@pytest.mark.parametrize("components", [2, 3])
@pytest.mark.parametrize("coupled", [False, True], ids=["components", "points"])
def test_newtons_equation_is_that_of_dense_algebra(components: int, coupled: bool) -> None:
    """``H = A + W D`` with weights that differ from point to point, D diagonal or a block of every point."""
    rng = np.random.default_rng(components)
    m = 4
    n = m * components
    root = rng.standard_normal((n, n))
    stiffness, weights = root @ root.T + n * np.eye(n), rng.uniform(0.1, 5.0, m)
    problem = DiscreteProblem.of_arrays(
        stiffness,
        rng.standard_normal(n),
        np.eye(n),
        weights,
        np.zeros(m),
        hv.laws.ContactLaw(hv.Compliance(1.0), hv.Tresca(0.1)),
    )
    system = hv.systems.Workspace().condensed(problem)
    index = np.sort(rng.choice(n, n - 2, replace=False))
    bends = rng.uniform(0.0, 9.0, (m, components))
    blocks = np.zeros((m, components, components))
    blocks[:, range(components), range(components)] = bends
    if coupled and components == 3:
        blocks[:, 1, 2] = blocks[:, 2, 1] = 0.5 * np.sqrt(bends[:, 1] * bends[:, 2])
    dense = stiffness.copy()
    for point in range(m):
        own = slice(point * components, (point + 1) * components)
        dense[own, own] += weights[point] * blocks[point]
    right = rng.standard_normal(index.size)
    found = DenseFactor().solve(system, index, blocks if coupled else bends, right)
    np.testing.assert_allclose(found, np.linalg.solve(dense[np.ix_(index, index)], right), rtol=1e-9)
