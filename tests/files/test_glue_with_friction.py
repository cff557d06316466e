"""Glue whose damaged share rubs where it is pressed: ``memory=(Secant(friction=mu),)``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv

FILE = """
[mesh]
rectangle = [2.0, 0.5]
cells = [4, 1]
[material]
young = 500.0
poisson = 0.3
[supports]
left = { x = 0.0 }
top = { displacement = ["0.12*t*x", "-0.01*min(t, 1)"] }
[contact.bottom]
normal = { law = "mixed-mode", stiffness = 24.0, strength = 0.5, energy = 0.02 }
memory = [{ kind = "secant", friction = "0.4 + 0.1*x" }]
"""


def test_a_soft_body_from_a_file_resumes_bit_for_bit(tmp_path: Path) -> None:
    file, kept = tmp_path / "sheared.toml", tmp_path / "march.ckpt"
    file.write_text(FILE)
    hv.write_problem(hv.read_problem(file), tmp_path / "again.toml")
    evolution = hv.Evolution(hv.read_problem(tmp_path / "again.toml"))
    whole = hv.march(evolution, 2.0, step=0.2)
    assert whole.ended == "finished"
    assert np.abs(whole["gap"]).max() <= 1e-6 * whole["moved"][-1]
    stiffness = whole.state.memory["bottom"]["0.stiffness"]
    assert 0.0 == stiffness.min() < stiffness.max()  # some broken, some not
    hv.march(evolution, 1.0, step=0.2, checkpoint=hv.evolution.Checkpoint(kept, 0.0))
    again = hv.march(evolution, 2.0, step=0.2, checkpoint=hv.evolution.Checkpoint(kept, 0.0), resume=True)
    np.testing.assert_array_equal(again.state.body.displacement, whole.state.body.displacement)
    np.testing.assert_array_equal(again.state.multiplier, whole.state.multiplier)
