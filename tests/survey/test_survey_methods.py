"""What the methods of the survey are made of."""

from __future__ import annotations

import numpy as np

from hemivar.laws import Interval
from hemivar.survey.bundle import CuttingPlanes


def test_tangents_that_meet_in_one_point_have_the_subdifferential_of_all() -> None:
    """Three tangents of |r| and of max(0, 2 r) through the origin: two of their corners are the same place."""
    slopes = np.array([[-1.0, 0.0, 2.0]])
    points = np.array([[-1.0, 0.0, 1.0]])
    planes = CuttingPlanes(points, slopes * points, slopes, Interval(np.full(1, -np.inf), np.full(1, np.inf)))
    assert (planes.knots[:, :2] == 0.0).all()
    found = planes.subdifferential(np.zeros(1))
    assert (found.lower[0], found.upper[0]) == (-1.0, 2.0)
    assert planes.at_kink(np.zeros(1)).all()
