"""Ties in problem files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem

TEXT = """
mesh.upper = { rectangle = [1.0, 0.5], cells = [3, 1], origin = [0.0, 0.5] }
mesh.lower = { rectangle = [1.0, 0.5], cells = [2, 1] }
material = { young = 10.0, poisson = 0.3 }
supports."lower:bottom" = "clamped"
loads.traction."upper:top" = [0.1, -0.2]

[contact."upper:bottom"]
normal = "tie"
against = "lower:top"
"""


def test_files_state_ties(tmp_path: Path) -> None:
    read = parse_problem(TEXT)
    assert list(read.ties) == ["upper:bottom"]
    assert not read.contact
    hv.write_problem(read, tmp_path / "again.toml")
    again = hv.read_problem(tmp_path / "again.toml")
    assert np.array_equal(hv.solve(again).displacement, hv.solve(read).displacement)


def test_bad_ties_are_refused_with_their_place() -> None:
    with pytest.raises(ProblemError, match=r"upper:bottom.* a tie takes no friction"):
        parse_problem(TEXT + 'friction = { law = "tresca", bound = 1.0 }\n')
    with pytest.raises(ProblemError, match="a tie takes against"):
        parse_problem(TEXT.replace('against = "lower:top"', ""))
