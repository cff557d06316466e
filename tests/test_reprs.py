"""What objects look like at a prompt: a line or a small table, never arrays."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from tests.problems import bar, square

STATEMENT = square(n=4)
PROBLEM = hv.discretize(STATEMENT)
SOLUTION = hv.solve(PROBLEM)
SOFT = bar(0.5, hv.laws.PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], [0.0, 0.0, 0.0]))


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
        (SOLUTION, ("72 unknowns by newton", "converged after", "energy", "4 points: 4 contact; ", "normal force")),
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


def test_every_public_value_is_shown_shortly() -> None:
    from tests.test_public_types import examples

    several = {id(one): one for found in examples().values() for one in found}
    assert len(several) > 100
    for one in several.values():
        text = repr(one)
        assert len(text) <= 600, type(one).__name__
        assert "array(" not in text, type(one).__name__


def test_results_of_workflows_are_shown_shortly() -> None:
    flows = hv.workflows
    run = flows.result_of(flows.run(PROBLEM))
    compared = flows.result_of(flows.compare(PROBLEM))
    adapted = flows.result_of(flows.adapt(STATEMENT, flows.AdaptOptions(rtol=0.5)))
    history = hv.march(hv.Evolution(STATEMENT), 0.2, step=0.1)
    for value in (run, compared, *compared.attempts, adapted, history.frames[0], history.steps[0], run.certificate):
        text = repr(value)
        assert len(text) <= 600, type(value).__name__
        assert "array(" not in text, type(value).__name__


def test_a_description_by_fields() -> None:
    from dataclasses import dataclass

    from hemivar.basics.display import brief

    @dataclass(frozen=True)
    class Value:
        size: float
        field: object
        several: tuple[object, ...]

        __repr__ = brief

    table = repr(Value(1.0 / 3.0, np.zeros((3, 3)), ("a", 1)))
    assert table == "Value(size=0.333333, field=array (3, 3), several=('a', 1))"
    many = repr(Value(1.0, np.eye(2), tuple(range(99))))
    assert many == "Value(size=1.0, field=[[1.0, 0.0], [0.0, 1.0]], several=<99 entries>)"
    assert repr(Value(1.0, "x" * 99, (np.zeros(9),))).endswith("xxx...', several=(array (9,),))")
    assert repr(Value(1.0, SOLUTION, (1,))) == "Value(size=1.0, field=<Solution>, several=(1,))"
    assert len(repr(Value(1.0, "x" * 80, tuple("y" * 9 for _ in range(99))))) < 401
