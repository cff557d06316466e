"""Poles of formulas: found with their place, which is known in closed form, or refused as an argument of a proof."""

from __future__ import annotations

import pytest

from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem
from tests.files.test_problem_file_derivative_formulas import FILE


def test_files_with_a_pole_are_refused_with_the_place_in_the_file() -> None:
    text = FILE.replace("LAW", "derivative = '1/(1 - r)'")
    with pytest.raises(ProblemError, match=r"contact\.bottom.*normal.*a pole, or no value, at r = 1:"):
        parse_problem(text)
