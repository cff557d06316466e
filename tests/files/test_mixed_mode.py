"""Mixed-mode glue: the law against its own value, closed forms of a point on springs, and bad input."""

from __future__ import annotations

from pathlib import Path

import pytest

import hemivar as hv
from hemivar.laws import MixedMode
from tests.bodies import glued_plate
from tests.files.mistakes import refused
from tests.laws.coupled.test_mixed_mode import BILINEAR

FILE = """
[mesh]
rectangle = [1.0, 0.5]
cells = [4, 2]

[material]
young = 3000.0
poisson = 0.3

[supports]
left = "clamped"

[loads.traction]
top = [12.0, 20.0]

[contact.bottom]
normal = { law = "mixed-mode", strength = 30.0, energy = 0.5, stiffness = 1e4, ratio = 1.5 }
"""


def test_problem_files_state_it(tmp_path: Path) -> None:
    path = tmp_path / "glued.toml"
    path.write_text(FILE)
    problem = hv.read_problem(path)
    assert isinstance(problem, hv.ContactProblem)
    law = problem.contact["bottom"].law
    assert isinstance(law, MixedMode)
    assert hv.solve(problem).energy == pytest.approx(hv.solve(glued_plate(BILINEAR, cells=2)).energy, rel=1e-12)
    hv.write_problem(problem, tmp_path / "again.toml")
    again = hv.read_problem(tmp_path / "again.toml")
    assert again.contact["bottom"].law.stated == law.stated  # type: ignore[union-attr]
    shapes = (', shape = "trapezoidal", plateau = 0.005, compression = 5e3', ', shape = "exponential"')
    for more in shapes:
        path.write_text(FILE.replace(", ratio = 1.5", more))
        hv.write_problem(hv.read_problem(path), tmp_path / "again.toml")
        assert hv.read_problem(tmp_path / "again.toml").contact["bottom"].law.stated == (  # type: ignore[union-attr]
            hv.read_problem(path).contact["bottom"].law.stated  # type: ignore[union-attr]
        )


@pytest.mark.parametrize(
    ("there", "instead", "words"),
    [
        ("strength = 30.0, ", "", "strength"),
        ("strength = 30.0", "strength = -1.0", "at least 0"),
        ("ratio = 1.5", 'shape = "square"', "shape"),
        ("ratio = 1.5", "plateau = 1.0", "trapezoidal"),
        ("ratio = 1.5", "beta = 1.5", "beta"),
        ("energy = 0.5", "energy = 0.01", "must exceed the elastic energy"),
        ("\n[contact", '\n[contact.bottom.friction]\nlaw = "tresca"\nbound = 0.3\n[contact', "friction"),
    ],
)
def test_mistakes_in_files_are_named(tmp_path: Path, there: str, instead: str, words: str) -> None:
    refused(FILE.replace(there, instead), tmp_path / "glued.toml", words)
