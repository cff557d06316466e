"""What docs/tutorial-studio.md tells a class is so."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.files.problem_file import parse_problem
from hemivar.files.sample import template

PAGE = (Path(__file__).parents[2] / "docs" / "tutorial-studio.md").read_text(encoding="utf-8")
SURVEY, SOFTENING, DELAMINATION = (template(name) for name in ("survey", "softening", "delamination"))


def solved_text(text: str, old: str = "", new: str = "") -> hv.Solution:
    assert old in text
    return hv.solve(parse_problem(text.replace(old, new) if old else text))


def slipping(solution: hv.Solution) -> int:
    return sum(int(here.sum()) for kind, here in solution.states.present.items() if "slip" in kind.label)


def test_the_body_sinks_about_twice_as_deep_without_the_threshold() -> None:
    ratio = solved_text(SURVEY, "q_max = 0.3", "q_max = 0.0").penetration.max() / solved_text(SURVEY).penetration.max()
    assert 1.8 < ratio < 2.5


def test_points_that_slip() -> None:
    assert slipping(solved_text(SURVEY)) == 8
    assert slipping(solved_text(SURVEY, "bound = 0.5", "bound = 0.1")) == 32
    assert slipping(solved_text(SURVEY, "bound = 0.5", "bound = 0.55")) == 0
    lifted = solved_text(SURVEY, "-0.8, -0.8", "-0.8, 0.0")
    open_points = lifted.pressure == 0.0
    assert open_points.any()
    assert np.abs(lifted.friction[open_points]).max() > 0.0  # Tresca
    words = re.findall(r'`(law = "(?:tresca|coulomb)".*?)`', PAGE)
    coulomb = solved_text(SURVEY.replace(words[0], words[1]), "-0.8, -0.8", "-0.8, 0.0")
    assert np.abs(coulomb.friction[coulomb.pressure == 0.0]).max() < 1e-12  # rounding, of a friction of about 0.5


def test_three_solutions_and_one() -> None:
    assert [str(s.kind.value) for s in hv.find_solutions(parse_problem(SOFTENING)) if s.kind is not None] == [
        "local minimiser", "local minimiser", "saddle",
    ]  # fmt: skip
    for softening, count, unique in ((10.0, 1, True), (11.9, 1, True), (13.0, 1, None)):
        text = SOFTENING.replace("softening = 16.0", f"softening = {softening}")
        found = hv.find_solutions(parse_problem(text))
        assert (len(found), found.exhaustive) == (count, True)
        assert solved_text(text).certify().unique is unique
    assert any("no bound" in line for line in solved_text(SOFTENING).certify().lines())


def test_folds_of_the_glue() -> None:
    assert len(hv.follow_path(parse_problem(DELAMINATION)).main_folds) == 1
    glue = re.search(r"`(normal = \{ law = \"adhesive\".*?)`", PAGE)
    assert glue is not None
    text = re.sub(r"normal = .*", glue[1], DELAMINATION)
    path = hv.follow_path(parse_problem(text), (0.0, 2.0))
    assert [fold.load_factor for fold in path.main_folds] == pytest.approx([1.05, 0.63], abs=0.005)
