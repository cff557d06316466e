"""Every method on every convex problem: the same solution, and no false claim of convergence."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hemivar.basics.generators import result_of
from hemivar.discrete import DiscreteProblem
from hemivar.errors import MethodError
from hemivar.fem import discretize
from hemivar.gallery import survey_logarithmic
from hemivar.mechanics import Quadrature
from hemivar.solvers import METHODS, Controls, Solution, Status, solve, solve_nested
from hemivar.solvers.solve import solving
from hemivar.systems import Workspace, condense
from tests.samples import sampled

from ..problems import OTHER_DATA, SURVEY_DATA, bar, discrete_square, relative_difference

EXACT = [name for name in METHODS if name not in ("direct-powell", "augmented-lagrangian", "active-set-krylov")]
#: Methods whose accuracy is that of SciPy's routine inside them; what is asked of each.
LOOSE = {"direct-powell": 0.05, "augmented-lagrangian": 1e-6, "active-set-krylov": 1e-6}

#: Each method with the data of the survey.
NESTED = tuple(itertools.product(METHODS, SURVEY_DATA))

_references: dict[tuple[str, int, Quadrature], tuple[DiscreteProblem, Solution]] = {}


def reference(data: str, n: int, quadrature: Quadrature = Quadrature.NODAL) -> tuple[DiscreteProblem, Solution]:
    key = (data, n, quadrature)
    if key not in _references:
        problem = discrete_square(data, n, quadrature=quadrature)
        _references[key] = problem, solve(problem)
    return _references[key]


@pytest.mark.parametrize(
    ("method", "n", "data"), sampled(itertools.product(EXACT, (4, 16), (*SURVEY_DATA, *OTHER_DATA)), 3)
)
def test_exact_methods_agree(method: str, data: str, n: int) -> None:
    problem, expected = reference(data, n)
    assert expected.status is Status.CONVERGED
    found = solve(problem, METHODS[method])
    assert found.status is Status.CONVERGED, found.residual
    assert relative_difference(found, expected) < 1e-8
    assert found.energy == pytest.approx(expected.energy, rel=1e-9)
    np.testing.assert_allclose(found.multiplier, expected.multiplier, atol=2e-6 * np.abs(expected.multiplier).max())


@pytest.mark.parametrize(("n", "data"), sampled(itertools.product((4, 16, 64), (*SURVEY_DATA, *OTHER_DATA)), 5))
def test_the_rounds_of_active_sets_find_what_the_steps_of_newton_find(data: str, n: int) -> None:
    problem = discrete_square(data, n)
    workspace = Workspace()
    for initial in (None, np.random.default_rng(1).standard_normal(problem.unknowns)):
        rounds = solve(problem, METHODS["newton"], initial=initial, workspace=workspace)
        steps = solve(problem, METHODS["newton"], Controls(max_steps=100), initial=initial, workspace=workspace)
        assert rounds.status is steps.status is Status.CONVERGED
        assert relative_difference(rounds, steps) < 1e-9
        assert rounds.energy <= steps.energy + 1e-12 * abs(steps.energy)
        assert rounds.history[0].residual == pytest.approx(steps.history[0].residual)
        assert rounds.history[-1].step == rounds.steps


@pytest.mark.parametrize(("step", "status"), [(0, Status.INTERRUPTED), (4, Status.CONVERGED)])
def test_rounds_of_active_sets_heed_who_ends_them(step: int, status: Status) -> None:
    told = result_of(solving(discrete_square("data (5.1)", 16)), lambda line: line.step >= step)
    assert told.status is status
    assert [line.step for line in told.history] == [0, told.steps]
    assert told.residual.relative < 1e-9


def test_a_law_that_is_not_convex_is_left_to_the_steps_of_newton() -> None:
    problem = discretize(survey_logarithmic(0.3, 16))
    found, counted = solve(problem), solve(problem, controls=Controls(max_steps=100))
    np.testing.assert_array_equal(found.unknowns, counted.unknowns)
    assert len(found.history) == found.steps + 1


@pytest.mark.parametrize(
    ("method", "data"), sampled(itertools.product([name for name in EXACT if name != "multigrid"], SURVEY_DATA), 4)
)
def test_exact_methods_agree_with_midpoint_quadrature(method: str, data: str) -> None:
    problem, expected = reference(data, 8, Quadrature.MIDPOINT)
    # Where two cutting planes meet follows from their values. Rounding leaves the root of the machine's epsilon.
    rtol = 3e-8 if method == "bundle" else 1e-9
    found = solve(problem, METHODS[method], Controls(max_steps=3000, rtol=rtol))
    assert found.status is Status.CONVERGED, found.residual
    assert relative_difference(found, expected) < max(1e-8, rtol)


def test_the_bundle_method_ends_below_the_root_of_rounding_under_loads_nearby() -> None:
    """The minimiser of a model is found by slopes: energies tell points apart up to 1.5e-8 only."""
    problem, _ = reference("data (5.1)", 8, Quadrature.MIDPOINT)
    for shift in np.random.default_rng(0).standard_normal((6, *problem.load.shape)):
        near = problem.with_(load=problem.load * (1.0 + 1e-9 * shift))
        found = solve(near, METHODS["bundle"], Controls(rtol=1e-8))
        assert found.status is Status.CONVERGED
        assert relative_difference(found, solve(near)) < 5e-9


@pytest.mark.parametrize(("method", "data"), sampled(itertools.product(LOOSE, (*SURVEY_DATA, *OTHER_DATA)), 3))
def test_methods_of_scipy_come_as_close_as_they_can_and_say_so(method: str, data: str) -> None:
    problem, expected = reference(data, 16)
    if method == "direct-powell" and data in ("rigid", "lifting"):
        with pytest.raises(MethodError, match=r"\+inf"):
            solve(problem, METHODS[method])
        return
    found = solve(problem, METHODS[method])
    assert relative_difference(found, expected) < LOOSE[method]
    if found.status is Status.CONVERGED:
        assert relative_difference(found, expected) < 1e-8
    else:
        assert found.status is Status.INACCURATE
        assert found.residual.relative > 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_every_method_solves_a_bar_of_the_users_own_arrays(method: str) -> None:
    from hemivar.laws import ThresholdCompliance

    # kappa (r0 - r) in dj(r) with kappa = 1, r0 = 0.4: q = 0.1, p = 2 gives r = 0.3 / 3.
    problem = bar(0.8, ThresholdCompliance(0.1, 2.0))
    found = solve(problem, METHODS[method])
    tolerance = 1e-3 if method == "direct-powell" else 1e-8
    assert found.penetration[0] == pytest.approx(0.1, abs=tolerance)
    assert found.pressure[0] == pytest.approx(0.3, abs=3 * tolerance)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_leaves_a_body_without_load_at_rest(method: str) -> None:
    from hemivar.laws import ThresholdCompliance

    found = solve(bar(0.0, ThresholdCompliance(0.1, 2.0)), METHODS[method])
    np.testing.assert_array_equal(found.unknowns, 0.0)
    assert found.status is Status.CONVERGED
    assert found.energy == 0.0


@pytest.mark.parametrize("data", [*SURVEY_DATA, *OTHER_DATA])
@pytest.mark.parametrize("n", [4, 16, 64])
def test_energy_of_the_default_never_rises_and_few_steps_suffice(data: str, n: int) -> None:
    problem, found = reference(data, n)
    energies = [line.energy for line in found.history]
    assert all(later <= earlier for earlier, later in itertools.pairwise(energies))
    assert found.steps <= 10
    assert energies[-1] == pytest.approx(problem.energy(found.unknowns), rel=1e-9)


@pytest.mark.slow
def test_the_certified_bound_of_the_bundle_method_holds() -> None:
    for data in SURVEY_DATA:
        problem, expected = reference(data, 16)
        found = solve(problem, METHODS["bundle"])
        assert found.error_bound is not None
        v = found.unknowns - expected.unknowns
        # The reference itself is known to about 1e-12.
        assert np.sqrt(v @ (problem.stiffness @ v)) <= found.error_bound + 1e-11
        assert found.error_bound <= 1e-8 * np.sqrt(expected.unknowns @ (problem.stiffness @ expected.unknowns))


def test_warm_start_at_the_solution_ends_at_once() -> None:
    problem, expected = reference("data (5.1)", 16)
    again = solve(problem, initial=expected)
    assert again.steps == 0
    assert again.status is Status.CONVERGED
    for name in EXACT:
        assert relative_difference(solve(problem, METHODS[name], initial=expected), expected) < 1e-8


def test_methods_share_a_condensation() -> None:
    problem, expected = reference("data (5.1)", 16)
    shared = condense(problem)
    for name in EXACT:
        assert relative_difference(solve(problem, METHODS[name], workspace=Workspace.holding(shared)), expected) < 1e-8


@pytest.mark.parametrize(
    ("method", "data"), sampled(NESTED, [(method, data) for method, data in NESTED[::3] if method != "bundle"])
)
def test_warm_start_over_nested_meshes(method: str, data: str) -> None:
    """Every method of the survey, as in the survey: h = 1/2, 1/4, ... each started from the last."""
    problems = [discrete_square(data, n) for n in (2, 4, 8, 16)]
    expected = solve(problems[-1])
    solutions = solve_nested(problems, METHODS[method])
    assert len(solutions) == 4
    tolerance = {"direct-powell": 0.02, "active-set-krylov": 1e-6}.get(method, 1e-8)
    assert relative_difference(solutions[-1], expected) < tolerance
