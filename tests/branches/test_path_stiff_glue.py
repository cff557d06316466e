"""Stiff glue in time and on the path of its load."""

from __future__ import annotations

import numpy as np

import hemivar as hv
from hemivar.evolution import Evolution, march
from tests.evolution.test_walk_stiff_glue import FIRST, LAWS, arm_under_load


def test_a_march_without_memory_is_on_the_load_path_before_its_first_fold() -> None:
    problem = arm_under_load(LAWS["without memory"], 2.0).problem
    path = hv.follow_path(problem.at_time(1.0))
    fold = path.load_factor[int(np.argmax(np.diff(path.load_factor) < 0.0))]
    assert 0.5 < fold < 1.0
    history = march(Evolution(problem), 0.95 * fold, step=0.95 * fold / 6.0)
    assert history.finished
    softened = 0
    for time, frame in zip(history.times[1:], history.frames[1:], strict=True):
        there, stable = path.at(float(time))[0]
        assert stable
        np.testing.assert_allclose(frame.local, there, atol=1e-8 * np.abs(there).max())
        softened += bool(frame.local[:, 0].min() < -FIRST)
    assert softened >= 1
