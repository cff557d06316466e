"""Boundaries that are named by conditions, in Python and in problem files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem, write_problem
from hemivar.formula.condition import Condition
from hemivar.mesh.recipe import Marking

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
    ("text", "wanted"),
    [
        ("x > 1", lambda x, y: x > 1),
        ("x >= 1 and y < 1", lambda x, y: (x >= 1) & (y < 1)),
        ("0.5 < x <= 2 - y", lambda x, y: (x > 0.5) & (x <= 2 - y)),
        ("x < 0.5 or x > 1.5 and y > 1", lambda x, y: (x < 0.5) | ((x > 1.5) & (y > 1))),
        ("(x - 1)^2 + y^2 < 1", lambda x, y: (x - 1) ** 2 + y**2 < 1),
        ("min(x, y) > 1", lambda x, y: np.minimum(x, y) > 1),
        ("sqrt(4) < 3", lambda x, y: x < 9),
    ],
)
def test_conditions(text: str, wanted: object) -> None:
    points = np.random.default_rng(1).uniform(0.0, 2.0, (200, 2))
    np.testing.assert_array_equal(Condition(text)(points), wanted(*points.T))  # type: ignore[operator]


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


def test_formulas_functions_and_facets_name_boundaries() -> None:
    """A formula is true at all corners: the facets beside the edge that reach over the limit are not taken."""
    mesh = hv.rectangle((4.0, 2.0), (8, 4))
    right = mesh.boundaries["right"]
    found = mesh.marked(
        {"formula": "x > 3.6", "function": lambda x: x[:, 0] > 3.99, "facets": right, "corner": "x >= 3.5 and y < 1e-9"}
    )
    for name in ("formula", "function", "facets"):
        assert sorted(map(tuple, found.boundaries[name])) == sorted(map(tuple, right))
    assert len(found.boundaries["corner"]) == 1
    assert set(found.boundaries) == {*mesh.boundaries, "formula", "function", "facets", "corner"}
    assert found.recipe is None
    assert mesh.marked({"formula": "x > 3.6"}).recipe.boundaries == (Marking("formula", "x > 3.6"),)
    assert mesh.refined().marked({"formula": "x > 3.6"}).recipe is None
    for name in ("left", "right"):
        with pytest.raises(ProblemError, match=f"has a boundary or an interface '{name}' already"):
            mesh.marked({name: "x > 1"})
    with pytest.raises(ProblemError, match="give a dict"):
        mesh.marked("x > 1")  # type: ignore[arg-type]


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
