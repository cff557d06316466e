"""Boundaries that are named by conditions, in Python and in problem files."""

from __future__ import annotations

from pathlib import Path

import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem, write_problem

FILE = """
[mesh]
rectangle = [40.0, 20.0]
cells = [16, 8]
boundaries = { end = "x > 39.9", "lower half" = "x < 1e-6 and y <= 10" }
refine = 1

[material]
young = 5.0
poisson = 0.3

[supports]
"lower half" = "clamped"

[contact.end]
normal = { law = "compliance", stiffness = 2.0 }
"""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x", "'x' is not a condition; compare by < or >"),
        ("", "'' is not a condition"),
        ("x == 1", r"'x == 1' is not a condition; .* abs\(x - 1\) < 1e-6"),
        ("x > 1 and", "'' is not a condition"),
        ("x > 1 && y > 2", "'&' does not belong in a formula"),
        ("q > 1", "q"),
        ("x > ", "it is empty"),
        ("z > 1", "uses z, but the points have only 2 coordinates"),
        ("t > 1", "uses t"),
        ("x > 40.1", r"x > 40.1 holds at no facet of the outer boundary; the mesh has x from 0 to 40, y from 0 to 20"),
    ],
)
def test_what_is_no_condition_is_refused(text: str, says: str) -> None:
    mesh = hv.rectangle((40.0, 20.0), 4)
    with pytest.raises(ProblemError, match=says) as caught:
        mesh.marked({"right side": text})
    assert "boundary 'right side'" in str(caught.value)
    with pytest.raises(ProblemError, match=says):
        parse_problem(FILE.replace('"x > 39.9"', f'"{text}"'))


def test_problem_files_name_boundaries(tmp_path: Path) -> None:
    """After placing, before opening and refining; they are written back."""
    problem = parse_problem(FILE)
    mesh = problem.mesh
    assert mesh.facet_normals(mesh.boundaries["end"])[1].sum() == pytest.approx(20.0)
    assert mesh.facet_normals(mesh.boundaries["lower half"])[1].sum() == pytest.approx(10.0)
    assert mesh.parent.mesh.boundaries.keys() == mesh.boundaries.keys()
    path = tmp_path / "again.toml"
    write_problem(problem, path)
    assert hv.read_problem(path).mesh.recipe == mesh.recipe
    assert 'end = "x > 39.9"' in path.read_text()
    moved = parse_problem(
        FILE.replace("refine = 1", "scale = 0.1\nshift = [36.0, 0.0]").replace("x < 1e-6 and y <= 10", "x < 36.1")
    )
    assert moved.mesh.facet_normals(moved.mesh.boundaries["end"])[1].sum() == pytest.approx(2.0)


def test_conditions_name_the_same_facets_whatever_the_start(tmp_path: Path) -> None:
    """A warm start from coarser cells would take other facets: there is none."""
    stated = hv.files.problem_file.parse_problem_file(FILE.replace("refine = 1", ""))
    assert stated.levels == 0


def test_parts_have_conditions_of_their_own() -> None:
    text = FILE.replace("[mesh]", "[mesh.one]").replace("[contact.end]", '[contact."one:end"]')
    problem = parse_problem(text.replace('"lower half" = "clamped"', '"one:lower half" = "clamped"'))
    assert {"one:end", "one:lower half", "one:left"} <= set(problem.mesh.boundaries)


def test_the_time_and_other_types_are_no_conditions() -> None:
    with pytest.raises(ProblemError, match=r"\[mesh\] boundaries.end"):
        parse_problem(FILE.replace('"x > 39.9"', "3"))
    with pytest.raises(ProblemError, match="boundaries: must be a table"):
        parse_problem(FILE.replace('{ end = "x > 39.9", "lower half" = "x < 1e-6 and y <= 10" }', "3"))
