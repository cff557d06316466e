"""A body dragged by a belt: closed forms at rest and in time, files, and bad input."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import Coulomb, Signorini

FILE = """
[mesh]
rectangle = [1.0, 1.0]
cells = [2, 2]

[material]
young = 200.0
poisson = 0.0

[supports]
top = "clamped"

[contact.bottom]
normal = "signorini"
friction = { law = "coulomb", coefficient = 0.3 }
belt = ["0.2 * t", 0.0]

[time]
until = 1.0
step = 0.1
"""


def test_problem_files_state_a_belt(tmp_path: Path) -> None:
    path = tmp_path / "belt.toml"
    path.write_text(FILE)
    problem = hv.read_problem(path)
    assert isinstance(problem, hv.ContactProblem)
    assert problem.time_dependent == {"gap"}
    contact = problem.contact["bottom"].at_time(2.0)
    assert callable(contact.belt)
    assert np.asarray(contact.belt(np.zeros((1, 2))))[0] == pytest.approx([0.4, 0.0])  # type: ignore[call-arg]
    with pytest.raises(hv.HemivarError, match="a belt of the problem depends on time"):
        hv.solve(problem)
    still = hv.ContactProblem(
        problem.mesh, problem.material, {"bottom": hv.Contact(Signorini(), Coulomb(0.3), belt=(0.1, 0.0))},
        problem.supports,
    )  # fmt: skip
    hv.write_problem(still, tmp_path / "still.toml")
    again = hv.read_problem(tmp_path / "still.toml")
    assert isinstance(again, hv.ContactProblem)
    assert again.contact["bottom"].belt == (0.1, 0.0)


@pytest.mark.parametrize(
    ("belt", "words"),
    [
        ("0.1", "belt.*a list of 2 numbers"),
        ("[0.1]", "belt.*a list of 2 numbers"),
        ('["u", 0.0]', "belt"),
        ('["z", 0.0]', "the mesh is plane"),
        ("true", "belt.*a list of 2 numbers"),
    ],
)
def test_bad_belts_of_files_are_named(tmp_path: Path, belt: str, words: str) -> None:
    path = tmp_path / "belt.toml"
    path.write_text(FILE.replace('["0.2 * t", 0.0]', belt))
    with pytest.raises(hv.HemivarError, match=words):
        hv.read_problem(path)
