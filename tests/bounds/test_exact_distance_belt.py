"""A body dragged by a belt: closed forms at rest and in time, files, and bad input."""

from __future__ import annotations

import numpy as np

import hemivar as hv
from hemivar.bounds import exact_distance
from hemivar.bounds.trace_bounds import guaranteed_trace_bounds
from hemivar.laws import Tresca
from tests.fem.test_supports_belt import FRICTION, LIMIT, PRESSURE, SHEAR, cube_on_a_belt


def test_the_guaranteed_distance_counts_the_belt() -> None:
    problem = cube_on_a_belt((0.5 * LIMIT, 0.0), Tresca(FRICTION * PRESSURE))
    solution = hv.solve(problem)
    found = exact_distance(problem, solution.displacement, guaranteed_trace_bounds(hv.discretize(problem)))
    size = np.sqrt(SHEAR) * LIMIT
    assert found.distance < 1e-3 * size
    still = cube_on_a_belt(0.0, Tresca(FRICTION * PRESSURE))
    other = exact_distance(still, solution.displacement, guaranteed_trace_bounds(hv.discretize(still)))
    assert other.distance > 0.1 * size
