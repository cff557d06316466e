"""What forces on the contact boundary are worth by constants of its trace, against dense algebra."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.bounds.trace_bounds import TraceBounds


def constants(stiffness: Array) -> TraceBounds:
    """Those of a body whose traces are unknowns (f, 2), normal and tangential, on f facets of measure one."""
    inverse = np.linalg.inv(stiffness)
    parts = (inverse, inverse[::2, ::2], inverse[1::2, 1::2])
    both, normal, tangential = (1.0 / np.linalg.eigvalsh(part)[-1] for part in parts)
    return TraceBounds(both, normal, tangential, 1.0, True, "dense algebra")


@pytest.mark.parametrize("seed", range(5))
def test_a_force_is_worth_at_least_its_dual_norm(seed: int) -> None:
    """``sup <s, v> / |v|_a`` is ``sqrt(s' K^-1 s)``; forces of one part alone attain it."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((6, 6)) * np.tile(10.0 ** rng.uniform(-1.0, 1.0, 2), 3)
    stiffness = root.T @ root + 0.01 * np.eye(6)
    known, inverse = constants(stiffness), np.linalg.inv(stiffness)
    for part in (slice(0, 2), slice(0, 1), slice(1, 2)):
        for _ in range(200):
            s = np.zeros((3, 2))
            s[:, part] = rng.standard_normal(s[:, part].shape) * 10.0 ** rng.uniform(-2.0, 2.0, s[0, part].shape)
            exact = math.sqrt(s.ravel() @ inverse @ s.ravel())
            assert known.distance(s[:, 0] ** 2, s[:, 1] ** 2) >= (1.0 - 1e-12) * exact
    axes = np.linalg.eigh(inverse[1::2, 1::2])[1]
    worst = axes[:, -1]
    exact = math.sqrt(worst @ inverse[1::2, 1::2] @ worst)
    assert known.distance(np.zeros(3), worst**2) == pytest.approx(exact, rel=1e-10)
