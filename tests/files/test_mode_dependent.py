"""Glue whose fracture energy depends on the mode: work along paths, fixed points by other means, and refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

import hemivar as hv
from hemivar.laws import Compliance, ModeDependentGlue
from tests.bodies import glued_plate
from tests.files.mistakes import refused
from tests.laws.coupled.test_mode_dependent import PULL, soft

FILE = """
[mesh]
rectangle = [1.0, 0.5]
cells = [8, 4]

[material]
young = 3000.0
poisson = 0.3

[supports]
left = "clamped"

[loads.traction]
top = [60.0, 60.0]

[contact.bottom.normal]
law = "mode-dependent"
strength = 30.0
shear_strength = 45.0
energy = 0.5
shear_energy = 0.9
stiffness = 1e4
exponent = 2.0
"""


def test_problem_files_state_it(tmp_path: Path) -> None:
    path = tmp_path / "glued.toml"
    for more in ("", "shear_stiffness = 2e4\n", 'criterion = "power"\ncompression = 5e3\n'):
        path.write_text(FILE + more)
        problem = hv.read_problem(path)
        hv.write_problem(problem, tmp_path / "again.toml")
        again = hv.read_problem(tmp_path / "again.toml")
        law = problem.contact["bottom"].law  # type: ignore[union-attr]
        assert isinstance(law, ModeDependentGlue)
        assert again.contact["bottom"].law.stated == law.stated  # type: ignore[union-attr]
    assert isinstance(law.compression, Compliance)
    path.write_text(FILE)
    here = hv.solve(hv.read_problem(path))
    assert here.local == pytest.approx(hv.solve(glued_plate(soft(), PULL)).local, abs=1e-12)


@pytest.mark.parametrize(
    ("there", "instead", "words"),
    [
        ("exponent = 2.0\n", "", "exponent"),
        ("exponent = 2.0", "exponent = 0", "positive"),
        ("exponent = 2.0", 'exponent = 2.0\ncriterion = "maximum"', "criterion"),
        ("energy = 0.5", "energy = 0.01", "less than is stored"),
        ("stiffness = 1e4", "stiffness = -1", "at least 0"),
        ("exponent = 2.0", "eta = 2.0", "eta"),
    ],
)
def test_mistakes_in_files_are_named(tmp_path: Path, there: str, instead: str, words: str) -> None:
    refused(FILE.replace(there, instead), tmp_path / "glued.toml", words)
