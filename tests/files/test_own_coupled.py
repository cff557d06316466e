"""Laws of penetration and slip by a formula or functions: the kit, other solvers of the same problem, and bad input."""

from __future__ import annotations

from pathlib import Path

import pytest

import hemivar as hv
from hemivar.laws import OwnCoupledLaw
from tests.bodies import glued_plate
from tests.files.mistakes import refused
from tests.laws.coupled.test_own_coupled import BILINEAR, mixed

FILE = f"""
[mesh]
rectangle = [1.0, 0.5]
cells = [8, 4]

[material]
young = 3000.0
poisson = 0.3

[supports]
left = "clamped"

[loads.traction]
top = [12.0, 20.0]

[contact.bottom]
normal = {{ law = "coupled-formula", potential = "{BILINEAR} + 5e3*max(r, 0)^2", reach = 0.1 }}
"""


def test_problem_files_state_it(tmp_path: Path) -> None:
    path = tmp_path / "glued.toml"
    path.write_text(FILE)
    problem = hv.read_problem(path)
    assert hv.solve(problem).energy == pytest.approx(hv.solve(glued_plate(mixed())).energy, rel=1e-8)
    hv.write_problem(problem, tmp_path / "again.toml")
    again = hv.read_problem(tmp_path / "again.toml")
    assert again.contact["bottom"].law.stated == problem.contact["bottom"].law.stated  # type: ignore[union-attr]
    path.write_text(FILE.replace("reach = 0.1", 'reach = 0.1, penetration = "rigid"'))
    law = hv.read_problem(path).contact["bottom"].law  # type: ignore[union-attr]
    assert isinstance(law, OwnCoupledLaw)
    assert law.rigid


@pytest.mark.parametrize(
    ("there", "instead", "words"),
    [
        (", reach = 0.1", "", "reach"),
        ("reach = 0.1", "reach = -1", "positive length"),
        ("reach = 0.1", 'reach = "x"', "reach"),
        ("reach = 0.1", 'reach = 0.1, penetration = "soft"', "penetration"),
        ("max(r, 0)^2", "max(q, 0)^2", "glued.toml.*'q'"),
        ("max(r, 0)^2", "max(-s, r)", "glued.toml"),
        ("\n[contact", '\n[contact.bottom.friction]\nlaw = "tresca"\nbound = 0.3\n[contact', "friction"),
    ],
)
def test_mistakes_in_files_are_named(tmp_path: Path, there: str, instead: str, words: str) -> None:
    refused(FILE.replace(there, instead), tmp_path / "glued.toml", words)
