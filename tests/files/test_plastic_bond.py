"""Bonds with plastic slip: closed forms of a material point, the law of a step, marches, energy, files, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from tests.laws.memory.test_plastic_bond import state

FILE = """
[mesh]
rectangle = [2.0, 0.5]
cells = [16, 4]
[material]
young = 3000.0
poisson = 0.3
[supports]
left = "clamped"
[loads]
traction = { top = ["160*t", "32*t"] }
[contact.bottom]
normal = { law = "signorini" }
[[contact.bottom.memory]]
kind = "plastic-bond"
stiffness = "2000 + 10*x"
shear_stiffness = 1000.0
energy = 0.969
yield_traction = 30.0
hardening = 692.0
"""


def test_a_file_resumes_bit_for_bit(tmp_path: Path) -> None:
    file, kept = tmp_path / "peeled.toml", tmp_path / "march.ckpt"
    file.write_text(FILE)
    problem = hv.read_problem(file)
    hv.write_problem(problem, tmp_path / "again.toml")
    evolution = hv.Evolution(hv.read_problem(tmp_path / "again.toml"))
    whole = hv.march(evolution, 1.0, step=0.1, save=hv.evolution.Save(every=0.5))
    assert whole.ended == "finished"
    assert state(whole)[0].min() == 0.0
    assert state(whole)[1].any()
    for cut in (0.5, 0.9):
        hv.march(evolution, cut, step=0.1, checkpoint=hv.evolution.Checkpoint(kept, 0.0))
        again = hv.march(evolution, 1.0, step=0.1, checkpoint=hv.evolution.Checkpoint(kept, 0.0), resume=True)
        np.testing.assert_array_equal(again.state.body.displacement, whole.state.body.displacement)
        for one, other in zip(state(again), state(whole), strict=True):
            np.testing.assert_array_equal(one, other)
    whole.write(tmp_path / "peeled.pvd")
