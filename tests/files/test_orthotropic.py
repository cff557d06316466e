"""Orthotropic friction: its ellipse by brute force, closed forms of a sheared block, what takes and what refuses it."""

from __future__ import annotations

from pathlib import Path

import pytest

import hemivar as hv
from hemivar.laws import OrthotropicFriction, OrthotropicLaw

FILE = """
[mesh]
box = [1.0, 1.0, 1.0]
cells = [2, 2, 2]

[material]
young = 200.0
poisson = 0.0

[supports]
top = "clamped"

[contact.bottom]
normal = "signorini"
friction = { law = "orthotropic", bound = { coulomb = 0.3 }, ratio = 0.4, axis = [1.0, 1.0, 0.0] }
"""


@pytest.mark.parametrize("bound", ["{ coulomb = 0.3 }", "0.5", '"0.5 + x"', '{ formula = "min(s, 1)" }'])
def test_problem_files_state_it(tmp_path: Path, bound: str) -> None:
    path = tmp_path / "o.toml"
    path.write_text(FILE.replace("{ coulomb = 0.3 }", bound))
    problem = hv.read_problem(path)
    hv.write_problem(problem, tmp_path / "again.toml")
    again = hv.read_problem(tmp_path / "again.toml")
    for one in (problem, again):
        friction = one.contact["bottom"].friction  # type: ignore[union-attr]
        assert isinstance(friction, OrthotropicFriction)
        assert (friction.ratio, friction.axis) == (0.4, (1.0, 1.0, 0.0))
        assert isinstance(hv.discretize(one).law, OrthotropicLaw)


@pytest.mark.parametrize(
    ("there", "instead", "words"),
    [
        ("bound = { coulomb = 0.3 }, ", "", "bound"),
        ("ratio = 0.4, ", "", "ratio"),
        (", axis = [1.0, 1.0, 0.0]", "", "axis"),
        ("[1.0, 1.0, 0.0]", "[1.0, 1.0]", "give a direction in 3D"),
        ("[1.0, 1.0, 0.0]", "1.0", "list of numbers"),
        ("ratio = 0.4", "ratio = -1.0", "at least 0"),
        ("ratio = 0.4", "ratio = 0.0", "must be positive"),
        ("ratio = 0.4", 'ratio = 0.4, profile = "x"', "profile"),
    ],
)
def test_mistakes_in_files_are_named(tmp_path: Path, there: str, instead: str, words: str) -> None:
    path = tmp_path / "o.toml"
    path.write_text(FILE.replace(there, instead))
    with pytest.raises(hv.errors.ProblemError, match=words):
        hv.read_problem(path)
