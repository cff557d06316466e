"""Problems, laws and results are pickled and copied, and answer as before."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from tests.basics.test_portable import TRIPS
from tests.problems import bar


@pytest.mark.parametrize("trip", TRIPS)
def test_solution_sets_and_paths(trip: str) -> None:
    discrete = bar(0.5, hv.laws.ThresholdCompliance(0.3, 2.0))
    found = hv.find_solutions(discrete)
    there = TRIPS[trip](found)
    np.testing.assert_array_equal(there.energies, found.energies)
    path = hv.follow_path(discrete)
    np.testing.assert_array_equal(TRIPS[trip](path).normal_force, path.normal_force)
