"""Boundaries that are named by conditions, in Python and in problem files."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.formula.condition import Condition
from hemivar.mesh.recipe import Marking


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
