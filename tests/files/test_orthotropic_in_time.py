"""Friction that depends on the direction of the slip, in increments in time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from tests.evolution.test_orthotropic_in_time import forces


def test_a_file_with_wear_resumes_bit_for_bit(tmp_path: Path) -> None:
    text = """
    [mesh]
    box = [1.0, 1.0, 0.5]
    cells = [2, 2, 1]
    [material]
    young = 1e3
    poisson = 0.3
    [supports.top]
    displacement = ["t", "0.5*t^2", -0.01]
    [contact.bottom]
    normal = { law = "compliance", stiffness = 50.0 }
    friction = { law = "orthotropic", bound = 0.3, ratio = 0.5, axis = [0.6, 0.8, 0.0] }
    memory = [{ kind = "wear", coefficient = 0.05 }]
    [time]
    until = 0.1
    """
    file = tmp_path / "dragged.toml"
    file.write_text(text)
    evolution, kept = hv.Evolution(hv.read_problem(file)), tmp_path / "march.ckpt"
    whole = hv.march(evolution, 0.1, step=0.01)
    assert whole.ended == "finished"
    assert whole.state.memory["bottom"]["0.depth"].min() > 0.0
    hv.march(evolution, 0.05, step=0.01, checkpoint=hv.evolution.Checkpoint(kept, 0.0))
    again = hv.march(evolution, 0.1, step=0.01, checkpoint=hv.evolution.Checkpoint(kept, 0.0), resume=True)
    np.testing.assert_array_equal(again.state.body.displacement, whole.state.body.displacement)
    np.testing.assert_array_equal(again.state.multiplier, whole.state.multiplier)
    adaptive = hv.march(evolution, 0.1, step=hv.evolution.AdaptiveStep(rtol=1e-2))
    assert adaptive.ended == "finished"
    np.testing.assert_allclose(forces(adaptive), forces(whole), rtol=1e-2, atol=1e-3)
