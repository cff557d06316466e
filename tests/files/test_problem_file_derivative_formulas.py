"""Laws by the formula of their derivative: the same law as by the potential, and integrals against scipy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem
from tests.laws.test_own_derivative_formulas import PAIRS

FILE = """
[mesh]
rectangle = [1.0, 1.0]
cells = [4, 4]
[material]
lame = [4.0, 4.0]
[supports]
left = "clamped"
[loads]
body = [0.1, -0.8]
[contact.bottom]
normal = { law = "formula", LAW }
friction = { law = "formula", bound = 0.2, derivative = "exp(-r)" }
"""


LAWS = [f"{key} = '{text}'" for key, text in zip(("potential", "derivative"), PAIRS["softening"], strict=True)]


def test_problem_files_take_a_derivative(tmp_path: Path) -> None:
    expected, found = (parse_problem(FILE.replace("LAW", law)) for law in LAWS)
    one, two = (hv.solve(problem).raise_for_status() for problem in (expected, found))
    np.testing.assert_allclose(two.unknowns, one.unknowns, atol=1e-9)
    file = tmp_path / "problem.toml"
    hv.write_problem(found, file)
    assert 'derivative = "piecewise((0, r < 0), (r*exp(-r), True))"' in file.read_text(encoding="utf-8")
    np.testing.assert_array_equal(hv.solve(hv.read_problem(file)).unknowns, two.unknowns)
    with pytest.raises(ProblemError, match="give either potential"):
        parse_problem(FILE.replace("LAW", ", ".join(LAWS)))
    with pytest.raises(ProblemError, match="give either potential"):
        parse_problem(FILE.replace(", LAW", ""))
    with pytest.raises(ProblemError, match=r"derivative.*'slip'"):
        parse_problem(FILE.replace("LAW", "derivative = '2*slip'"))
