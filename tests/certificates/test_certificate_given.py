"""What may be given to be certified: unknowns, the displacement of all nodes, a solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.certificates import energy_norm
from tests.certificates.problems import softening
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
    with pytest.raises(
        hv.errors.ProblemError, match=rf"violates the supports at 1 nodes; at node {corner}, x = \(0, 0\)"
    ):
        hv.certify(PROBLEM, moved)
    moved[corner] -= (0.0, 1e-6)
    assert hv.certify(PROBLEM, moved).unique


@pytest.mark.parametrize("units", [1e-6, 1.0, 1e6])
def test_what_rounding_puts_off_the_supports_is_no_fault(units: float) -> None:
    """A billionth of the largest displacement, in any unit of length."""
    statement = hv.ContactProblem(
        mesh=square(n=4).mesh.scaled(units),
        material=square().material,
        supports={"left": hv.Prescribed((0.01 * units, -0.02 * units))},
        contact={"bottom": hv.Contact(hv.Compliance(3.0 / units), hv.Tresca(0.5))},
        body_force=(-0.2 / units, -0.8 / units),
    )
    problem = hv.discretize(statement)
    solution = hv.solve(problem)
    largest = np.abs(solution.displacement).max()
    held = int(np.argmin(problem.field.nodes[:, 0]))
    for part, accepted in ((1e-10, True), (1e-8, False)):
        moved = solution.displacement.copy()
        moved[held, 1] += part * largest
        if accepted:
            assert hv.certify(problem, moved, trace_constant=False).unique
            continue
        with pytest.raises(hv.errors.ProblemError, match=f"at 1 nodes; at node {held}, .* it differs by"):
            hv.certify(problem, moved)


@pytest.mark.parametrize("bad", [SOLUTION.displacement[1:], SOLUTION.unknowns[1:], SOLUTION.displacement.T])
def test_other_shapes_are_refused_with_both_that_are_not(bad: np.ndarray) -> None:
    with pytest.raises(
        hv.errors.ProblemError, match=r"unknowns have shape \(\d+,\), the displacement of the nodes .*41, 2"
    ):
        hv.certify(PROBLEM, bad)
    with pytest.raises(hv.errors.ProblemError, match=r"the unknowns have shape \(8,\)$"):
        hv.certify(bar(1.0, hv.Compliance(1.0)), np.zeros((9, 1)))


def test_what_else_is_refused() -> None:
    n = PROBLEM.unknowns
    u, lam = SOLUTION.unknowns, SOLUTION.multiplier
    for given, words in (
        ((PROBLEM,), "no displacement is given"),
        ((PROBLEM, np.full(n, np.nan)), "displacement holds nan or infinity"),
        ((PROBLEM, u, lam[1:]), r"multiplier has shape \(3, 2\); this problem needs \(4, 2\)"),
        ((PROBLEM, u, lam + np.inf), "multiplier holds nan or infinity"),
        ((SOLUTION, u), "a solution already contains its unknowns"),
        ((SOLUTION, None, lam), "a solution already contains its unknowns"),
        (("square", u), "certify: the problem"),
    ):
        with pytest.raises(hv.errors.ProblemError, match=words):
            hv.certify(*given)  # type: ignore[arg-type]
    other = energy_norm(bar(1.0, hv.Compliance(1.0)))
    with pytest.raises(hv.errors.ProblemError, match="the factor given belongs to another problem"):
        hv.certify(PROBLEM, u, factor=other)


@pytest.mark.parametrize(("tolerance", "accepted"), [(0.0, True), (0.1, True), (-1e-12, False), (0.1001, False)])
def test_a_tolerance_is_a_part_of_the_load(tolerance: float, accepted: bool) -> None:
    if accepted:
        assert hv.certify(SOLUTION, tolerance=tolerance, trace_constant=False).tolerance == tolerance
        return
    with pytest.raises(hv.errors.ProblemError, match=r"it must be between 0 and 0\.1 of the load"):
        hv.certify(SOLUTION, tolerance=tolerance)


def test_the_record_names_what_is_infinite() -> None:
    rough = hv.certify(bar(0.5, softening(2.0, 0.1, 2.0)), np.zeros(8), trace_constant=False)
    record = rough.record()
    assert rough.error_bound == np.inf
    assert record["error_bound"] is None
    assert "error_bound" in record["infinite"]
    assert record["minus_infinite"] == []
    jump = replace(rough, curvature=-np.inf, equilibrium=np.nan, margin=-np.inf, seconds=1.5).record()
    assert jump["minus_infinite"] == ["margin", "curvature"]
    assert jump["equilibrium"] is None
    assert "equilibrium" not in jump["infinite"]
    assert (jump["seconds"], jump["kind"], jump["left_out"]) == (1.5, "not stationary", [])
    assert "residual" not in record
    assert "smallness" not in record
    assert record["alpha_normal"] == 2.0


def test_a_body_at_rest_fulfils_supports_that_hold_it_there() -> None:
    problem = hv.discretize(square(n=2))
    assert problem.field is not None
    rest = np.zeros((problem.field.number_of_nodes, 2))
    assert not hv.certify(problem, rest, trace_constant=False).stationary
    assert hv.certify(problem.with_(load=np.zeros(problem.unknowns)), rest, trace_constant=False).stationary
