"""Everyday problems in time, loads and prescribed displacements growing from zero, and their load paths."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from tests.evolution.test_march_everyday import KINDS, drawn, seeds
from tests.samples import slow


@pytest.mark.parametrize(
    ("kind", "seed"), [("beam_on_two_supports", 501), ("beam_on_two_supports", 508), slow("tip", 104)]
)
def test_the_load_path_of_coulombs_law_ends_at_the_solution(kind: str, seed: int) -> None:
    """From rest, where all cones have their apex, past corners that lie close to one another beside wide gaps."""
    path = hv.follow_path(drawn(kind, seed), (0.0, 1.5), max_points=100)
    assert path.load_factor[[0, -1]].tolist() == [0.0, 1.5]
    assert not path.folds
    assert len(path) <= (60 if kind == "tip" else 8)
    solved = hv.solve(path.line.at(1.5), controls=hv.Controls(rtol=1e-11)).raise_for_status()
    np.testing.assert_allclose(path.local[-1], solved.local, atol=1e-9 * np.abs(solved.unknowns).max())


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("walled_cube", "ball")])
def test_everyday_problems_have_load_paths(kind: str) -> None:
    """They end at the upper load factor, or at a limit load."""
    for seed in seeds(kind):
        path = hv.follow_path(drawn(kind, seed), (0.0, 1.5), max_time=60.0)
        assert path.reached_end or path.limit_load is not None, (seed, path.ended)
