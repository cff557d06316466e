"""Discrete scalar problems: supports, free constants, contact points, levels, reactions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.fem.load_line import LoadLine
from tests.fem.test_scalar_energy import MESH


def test_loads_and_supports_grow_together() -> None:
    problem = hv.ScalarProblem(
        MESH, 1.0, {"right": hv.ScalarContact(hv.Tresca(0.1))}, supports={"left": 0.4}, source=1.0, fluxes={"top": 2.0}
    )
    line = LoadLine.of(problem)
    half = hv.discretize(replace(problem, supports={"left": 0.2}, body_force=0.5, tractions={"top": 1.0}))
    at = line.at(0.5)
    np.testing.assert_allclose(at.load, half.load, atol=1e-15)
    np.testing.assert_allclose(at.offset, half.offset, atol=1e-15)
    assert at.constant == pytest.approx(half.constant)
    path = hv.follow_path(line.loaded, (0.2, 1.0), unloaded=line.unloaded)
    assert len(path) > 1
