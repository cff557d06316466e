"""What may be given to be certified: unknowns, the displacement of all nodes, a solution."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from tests.problems import bar, square

PROBLEM = hv.discretize(
    hv.ContactProblem(
        mesh=square(n=4).mesh,
        material=square().material,
        supports={"left": hv.Prescribed((0.01, -0.02))},
        contact=square().contact,
        body_force=(-0.2, -0.8),
    )
)
SOLUTION = hv.solve(PROBLEM)


def test_every_way_to_give_a_solution_certifies_the_same() -> None:
    expected = hv.certify(PROBLEM, SOLUTION.unknowns, SOLUTION.multiplier).record()
    for found in (
        SOLUTION.certify(),
        hv.certify(SOLUTION),
        hv.certify(PROBLEM, SOLUTION),
        hv.certify(PROBLEM, SOLUTION.displacement, SOLUTION.multiplier),
    ):
        assert found.unique
        record = found.record()
        for name in ("energy", "margin", "trace_constant"):
            assert record[name] == pytest.approx(expected[name], rel=1e-12)
        assert found.error_bound <= 1e-10


def test_options_reach_the_certificate() -> None:
    found = SOLUTION.certify(tolerance=0.01, trace_constant=False)
    assert found.tolerance == 0.01
    assert found.smallness.trace_constant is None
    assert SOLUTION.certify(max_time=0.0).left_out


def test_a_displacement_off_the_supports_is_refused() -> None:
    moved = SOLUTION.displacement.copy()
    corner = int(np.flatnonzero((PROBLEM.field.nodes == (0.0, 0.0)).all(axis=1))[0])
    moved[corner] += (0.0, 1e-6)
    with pytest.raises(hv.ProblemError, match=rf"fulfil the supports at 1 nodes; at node {corner}, x = \(0, 0\)"):
        hv.certify(PROBLEM, moved)
    moved[corner] -= (0.0, 1e-6)
    assert hv.certify(PROBLEM, moved).unique


@pytest.mark.parametrize("bad", [SOLUTION.displacement[1:], SOLUTION.unknowns[1:], SOLUTION.displacement.T])
def test_other_shapes_are_refused_with_both_that_are_not(bad: np.ndarray) -> None:
    with pytest.raises(hv.ProblemError, match=r"unknowns have shape \(\d+,\), the displacement of the nodes .*41, 2"):
        hv.certify(PROBLEM, bad)
    with pytest.raises(hv.ProblemError, match=r"the unknowns have shape \(8,\)$"):
        hv.certify(bar(1.0, hv.Compliance(1.0)), np.zeros((9, 1)))
