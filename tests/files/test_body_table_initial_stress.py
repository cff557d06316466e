"""Initial stress and strain in problem files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from tests.fem.test_initial_load import on_glue


def test_a_file_states_it(tmp_path: Path) -> None:
    around = np.diag([1e-4, 0.0, 2e-4])
    stated = on_glue(initial_stress=[[1.0, "x"], ["x", 0.0]], initial_strain=around, initial_scaled=True)
    file = tmp_path / "stressed.toml"
    hv.write_problem(stated, file)
    again = hv.read_problem(file)
    assert isinstance(again, hv.ContactProblem)
    assert again.initial_scaled
    np.testing.assert_allclose(hv.solve(again).displacement, hv.solve(stated).displacement, atol=1e-16)
