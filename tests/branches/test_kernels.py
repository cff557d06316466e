"""The numerical parts of a certificate one by one, against dense matrices and by hand."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.branches import find_solutions
from hemivar.certificates import PointKind, certify
from hemivar.systems import condense
from hemivar.systems.chain import chain_of
from tests.branches.random_problems import random_problem
from tests.certificates.test_kernels import curvature_by_hand


def test_curvatures_of_random_points_with_held_and_sliding_components() -> None:
    seen: dict[PointKind, int] = {}
    for seed in range(50):
        problem = random_problem(seed)
        if chain_of(condense(problem)).combinations > 1500:
            continue
        for solution in find_solutions(problem, max_solutions=50):
            expected = curvature_by_hand(solution)
            found = certify(solution)
            if expected is None or found.curvature is None:
                continue
            assert found.curvature == pytest.approx(min(expected, 1.0), abs=1e-7), f"seed {seed}"
            if found.kind in (PointKind.SADDLE, PointKind.MAXIMUM):
                assert expected < 0.0
                assert found.direction is not None
                assert np.abs(found.direction).max() == pytest.approx(1.0)
            seen[found.kind] = seen.get(found.kind, 0) + 1
    assert seen.get(PointKind.SADDLE, 0) > 3
    assert seen.get(PointKind.LOCAL_MINIMISER, 0) > 5
