"""What objects look like at a prompt: a line or a small table, never arrays."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from tests.problems import bar, square

STATEMENT = square(n=4)
PROBLEM = hv.discretize(STATEMENT)
SOLUTION = hv.solve(PROBLEM)
SOFT = bar(0.5, hv.PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], [0.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (STATEMENT.mesh, ("41 nodes, 64 triangles", "bottom")),
        (hv.box((1.0, 1.0, 1.0), 2), ("tetrahedra",)),
        (STATEMENT, ("ContactProblem(Mesh(41 nodes", "contact on bottom: survey", "Clamped on left")),
        (PROBLEM, ("DiscreteProblem(72 unknowns", "4 contact points of 2 components on bottom", "law survey")),
        (PROBLEM.contact, ("ContactPoints(4 of 2 components on bottom)",)),
        (PROBLEM.bulk, ("Quadratic(72 unknowns, ",)),
        (PROBLEM.field, ("Field('displacement', order 1, 41 nodes of 2 components)",)),
        (PROBLEM.space, ("Space(fields=(Field('displacement'",)),
        (
            SOLUTION.on("bottom"),
            ("BoundaryResult('bottom', 4 contact points, normal force 0.3", "contact length 0.875)"),
        ),  # less half a facet at the held node
        (SOLUTION, ("72 unknowns by newton", "converged after", "energy", "4 points: 0 open", "normal force")),
        (SOLUTION.certify(), ("Certificate", "unique minimiser; the only solution", "distance          at most")),
        (hv.find_solutions(SOFT), ("SolutionSet(3 solutions, all; energies -0.0215", "combinations of pieces")),
        (hv.follow_path(SOFT), ("Path(", "from load factor 0 to 1, 0 folds", "the upper end of the load factors")),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_value_is_shown_in_a_few_lines(value: object, words: tuple[str, ...]) -> None:
    text = repr(value)
    for word in words:
        assert word in text
    assert "array" not in text
    assert len(text) < 600
    assert len(text.splitlines()) < 9


def test_a_solution_without_contact_or_with_nan_is_shown_as_well() -> None:
    free = hv.solve(hv.discretize(hv.ContactProblem(STATEMENT.mesh, STATEMENT.material, supports=STATEMENT.supports)))
    assert "contact" not in repr(free)
    lost = hv.Solution(
        PROBLEM, np.full(72, np.nan), np.full((4, 2), np.nan), hv.Status.NONFINITE, SOLUTION.residual, "own"
    )
    assert "nonfinite" in repr(lost)
