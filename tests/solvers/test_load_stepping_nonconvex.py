"""Methods beyond convexity: descent, load stepping, outer fixed points, and honest refusals."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from hemivar.errors import MethodError, ProblemError
from hemivar.fem import discretize
from hemivar.laws import (
    Compliance,
    ContactLaw,
    CoulombBound,
    Friction,
    Logarithmic,
    PenetrationBound,
    PiecewiseQuadratic,
    SlipWeakening,
    Superpotential,
    Tresca,
)
from hemivar.mechanics import Contact
from hemivar.solvers import (
    METHODS,
    Controls,
    FixedPoint,
    LoadStepping,
    NonsmoothMultigrid,
    NonsmoothNewton,
    Search,
    Solution,
    Status,
    solve,
)
from hemivar.solvers.solve import suited
from hemivar.systems import Workspace, condense
from hemivar.systems.dense_newton import descent_direction
from tests import bodies

from ..problems import bar, discrete_square, relative_difference

SOFTENING = PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], [0.0, 0.0, 0.0], name="G")
LAYERED = PiecewiseQuadratic([0.0, 0.03, 0.06], [0.0, 40.0, -60.0, 0.0], [0.0, 0.0, 0.6], name="layered")
CAPPED = PiecewiseQuadratic([0.0, 0.1], [0.0, 20.0, 0.0], [0.0, -2.0], name="capped")


def published_strip(normal: Superpotential, friction: Friction, n: int = 8, factor: float = 1.0) -> DiscreteProblem:
    """The strip of Jureczka and Ochal (2019)."""
    return discretize(
        bodies.strip(Contact(normal, friction), (2 * n, n), "cross", body_force=(-1.2 * factor, -0.9 * factor))
    )


# ---- descent -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("load", "global_root"), [(0.48, 0.08), (0.5, 0.25), (0.52, 0.26)])
def test_newton_takes_the_global_minimum_of_a_single_point(load: float, global_root: float) -> None:
    # the switch is at r0 = sqrt(R1 R2) = 0.2449, load = 2 r0 = 0.4899
    assert solve(bar(load, SOFTENING), NonsmoothNewton()).penetration[0] == pytest.approx(global_root)


def test_a_start_at_a_local_maximum_is_left() -> None:
    problem = bar(0.5, SOFTENING)
    reaction = np.zeros((1, 1))
    reaction[0, 0] = 0.25 - 0.15
    at_top = np.linalg.solve(problem.stiffness.toarray(), problem.load - problem.contact_force(reaction))
    for search in Search:
        found = solve(problem, NonsmoothNewton(search=search), initial=at_top)
        assert found.status is Status.CONVERGED
        assert found.penetration[0] != pytest.approx(0.15)
        assert found.energy < problem.energy(at_top)


def test_downhill_search_stays_on_its_branch() -> None:
    problem = bar(0.5, SOFTENING)
    downhill = NonsmoothNewton(search=Search.DOWNHILL)
    assert solve(problem, downhill).penetration[0] == pytest.approx(1.0 / 12.0)
    broken = solve(problem, NonsmoothNewton())
    assert solve(problem, downhill, initial=broken).penetration[0] == pytest.approx(0.25)


@pytest.mark.parametrize(("load", "root"), [(0.5, 1.0 / 12.0), (0.59, 0.59 / 6.0), (0.61, 0.305)])
def test_load_stepping_follows_the_supported_branch_to_its_end(load: float, root: float) -> None:
    found = solve(bar(load, SOFTENING), LoadStepping())  # the fold is at r0 = 0.3, load = 0.6
    assert found.status is Status.CONVERGED
    assert found.penetration[0] == pytest.approx(root)


def test_supported_and_broken_through_solutions_of_a_capped_foundation() -> None:
    problem = published_strip(CAPPED, Tresca(0.1), factor=1.5)
    supported = solve(problem, LoadStepping())
    open_body = published_strip(PiecewiseQuadratic([0.0], [0.0, 0.0], [0.0]), Tresca(0.0), factor=1.5)
    through = solve(problem, NonsmoothNewton(search=Search.DOWNHILL), initial=solve(open_body).unknowns)
    assert supported.status is Status.CONVERGED
    assert through.status is Status.CONVERGED
    assert supported.penetration.max() < 0.1
    assert through.penetration.max() > 0.5
    assert through.normal_force < 0.5 * supported.normal_force


@pytest.mark.parametrize("n", [4, 16])
@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0, 3.0])
@pytest.mark.parametrize("law", [CAPPED, LAYERED], ids=["capped", "layered"])
def test_newton_converges_with_falling_energy_on_bodies(law: Superpotential, factor: float, n: int) -> None:
    found = solve(published_strip(law, SlipWeakening(0.5), n, factor))
    assert found.status is Status.CONVERGED, found.residual
    energies = np.array([line.energy for line in found.history])
    assert (np.diff(energies) <= 1e-12 * abs(energies).max()).all()


# ---- all methods ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_methods_on_a_weakly_convex_law_agree_or_refuse(method: str) -> None:
    problem = published_strip(
        PiecewiseQuadratic([0.0, 0.02, 0.06], [0.0, 8.0, -1.0, 0.0], [0.0] * 3), SlipWeakening(0.05), 4
    )
    reference = solve(problem)
    assert reference.status is Status.CONVERGED
    why = METHODS[method].refuse(problem)
    if why is not None:
        assert "not convex" in why
        assert "bundle" in method
        return
    found = solve(problem, METHODS[method], Controls(max_time=30.0))
    if found.status is Status.CONVERGED:
        assert relative_difference(found, reference) < 1e-7
    else:
        assert found.residual.relative > 1e-9
        assert method in ("direct-powell", "augmented-lagrangian", "active-set-krylov")


@pytest.mark.parametrize("method", METHODS)
def test_methods_on_a_law_that_jumps_down_solve_or_refuse(method: str) -> None:
    problem = published_strip(CAPPED, Tresca(0.1), 4)
    reference = solve(problem)
    why = METHODS[method].refuse(problem)
    if why is not None:
        assert "jumps down" in why or "not convex" in why
        with pytest.raises(MethodError, match="cannot solve"):
            solve(problem, METHODS[method])
        return
    found = solve(problem, METHODS[method], Controls(max_time=30.0))
    assert method in ("newton", "multigrid", "direct-powell")
    if found.status is Status.CONVERGED:
        assert relative_difference(found, reference) < 1e-7


# ---- bounds that depend on the solution ------------------------------------------------------------------------


def ramp(s: np.ndarray) -> np.ndarray:
    return np.where(s < 0.1, 8.0 * np.maximum(s, 0.0), 0.8)


def frozen(solution: Solution) -> DiscreteProblem:
    problem = solution.problem
    return problem.with_(law=problem.law.frozen(solution.local, solution.multiplier))


def test_a_bound_that_is_a_python_function_is_solved_by_a_fixed_point() -> None:
    problem = published_strip(CAPPED, Logarithmic(PenetrationBound(ramp)))
    found = solve(problem)
    assert found.method == "fixed-point(newton)"
    assert found.status is Status.CONVERGED
    assert found.contraction is not None
    assert found.contraction < 0.5
    again = solve(frozen(found), initial=found)
    assert relative_difference(again, found) < 1e-8


@pytest.mark.slow
def test_a_fixed_point_in_steps_of_the_load_ends_where_the_whole_load_does() -> None:
    problem = published_strip(CAPPED, Logarithmic(PenetrationBound(ramp)))
    found = solve(problem)
    by_steps = solve(problem, LoadStepping(FixedPoint(NonsmoothNewton(search=Search.DOWNHILL))))
    assert by_steps.status is Status.CONVERGED
    assert relative_difference(by_steps, found) < 1e-7


def test_coulomb_friction_is_mu_times_the_pressure_where_the_body_slips() -> None:
    problem = published_strip(Compliance(20.0), Friction(CoulombBound(0.2)))
    found = solve(problem)
    assert found.status is Status.CONVERGED
    bound = 0.2 * np.maximum(found.pressure, 0.0)
    assert (np.abs(found.friction[:, 0]) <= bound + 1e-9).all()
    moved = np.abs(found.slip[:, 0]) > 1e-9
    assert moved.any()
    np.testing.assert_allclose(np.abs(found.friction[moved, 0]), bound[moved], atol=1e-8)
    relaxed = solve(problem, FixedPoint(relaxation=0.7, max_outer=200))
    assert relative_difference(relaxed, found) < 1e-7


def two_springs(slope: float) -> DiscreteProblem:
    """One point whose penetration and slip are coupled: the bound slope * penetration reacts on the penetration."""
    K = np.array([[1.0, 0.9], [0.9, 1.0]])
    law = ContactLaw(
        PiecewiseQuadratic([0.0], [0.0, 0.0], [0.0]), Friction(PenetrationBound(lambda s: slope * np.maximum(s, 0.0)))
    )
    return DiscreteProblem.of_arrays(K, np.array([1.0, 2.5]), np.eye(2), np.ones(1), np.zeros(1), law)  # type: ignore[arg-type]


def test_a_fixed_point_that_does_not_contract_says_so() -> None:
    strong = DiscreteProblem.of_arrays(
        np.array([[1.0, -0.9], [-0.9, 1.0]]),  # type: ignore[arg-type]
        np.array([0.1, 20.0]),
        np.eye(2),  # type: ignore[arg-type]
        np.ones(1),
        np.zeros(1),
        ContactLaw(
            PiecewiseQuadratic([0.0], [0.0, 0.0], [0.0]), Friction(PenetrationBound(lambda s: 0.4 * np.maximum(s, 0.0)))
        ),
    )
    found = solve(strong, FixedPoint())  # dr_n/dh = -0.9/0.19, so the factor is 0.4 * 0.9/0.19 = 1.9
    assert found.status is Status.NOT_CONTRACTING
    assert "relaxation" in found.status.remedy
    assert found.contraction is not None
    assert found.contraction > 0.99
    relaxed = solve(strong, FixedPoint(relaxation=0.3, max_outer=200))
    assert relaxed.status is Status.CONVERGED


def test_the_measured_contraction_is_that_of_a_linear_fixed_point() -> None:
    found = solve(two_springs(0.05), FixedPoint(max_outer=100))
    assert found.status is Status.CONVERGED
    if found.contraction is not None and found.steps > 4:
        assert found.contraction == pytest.approx(0.05 * 0.9 / 0.19, rel=0.05)


def pressed_and_pulled(weight: float) -> DiscreteProblem:
    """The same point whatever its weight: Coulomb's friction on a compliant foundation, both coupled by the body."""
    K = np.array([[2.0, 1.2], [1.2, 2.0]])
    law = ContactLaw(Compliance(3.0 / weight), Friction(CoulombBound(0.6)))
    return DiscreteProblem.of_arrays(K, np.array([2.0, 3.0]), np.eye(2), np.array([weight]), np.zeros(1), law)  # type: ignore[arg-type]


def test_relaxation_counts_for_the_pressure_as_for_the_displacement() -> None:
    """r = K^-1 (f - (p, h)): the new h changes by q of the change of the old one, a relaxed one by (1 + q)/2."""
    known = 0.6 * 3.0 * 1.2 / (2.0 * 5.0 - 1.2**2)
    for relaxation, factor in ((1.0, known), (0.5, 0.5 + 0.5 * known)):
        found = solve(pressed_and_pulled(1.0), FixedPoint(relaxation=relaxation), Controls(rtol=1e-8))
        assert found.contraction == pytest.approx(factor, rel=1e-3)
    other = solve(pressed_and_pulled(1e3), FixedPoint(relaxation=0.5), Controls(rtol=1e-3))
    found = solve(pressed_and_pulled(1.0), FixedPoint(relaxation=0.5), Controls(rtol=1e-3))
    assert other.contraction == pytest.approx(found.contraction, rel=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_other_methods_want_to_be_wrapped(method: str) -> None:
    problem = published_strip(Compliance(20.0), Friction(CoulombBound(0.2)), 2)
    with pytest.raises(MethodError, match="FixedPoint"):
        solve(problem, METHODS[method])
    wrapped = suited(METHODS[method], problem)
    within = {"newton": "semismooth-newton", "multigrid": "semismooth-multigrid"}
    assert wrapped.name == within.get(method, f"fixed-point({method})")
    assert suited(wrapped, problem) is wrapped


def test_options_are_checked() -> None:
    with pytest.raises(ProblemError, match="relaxation"):
        FixedPoint(relaxation=0.0)
    with pytest.raises(ProblemError, match="max_outer"):
        FixedPoint(max_outer=0)
    with pytest.raises(ProblemError, match="steps"):
        LoadStepping(steps=0)
    with pytest.raises(ProblemError, match="has no effect"):
        FixedPoint(FixedPoint())


# ---- the same body otherwise -----------------------------------------------------------------------------------


def test_a_condensation_serves_other_loads_and_gaps() -> None:
    for problem in (discrete_square("data (5.1)", 4), discrete_square("data (5.1)", 4, quadrature="midpoint")):
        system = condense(problem)
        other = problem.with_(load=0.3 * problem.load, constant=1.0, offset=problem.offset + np.array([0.01, 0.0]))
        shared, fresh = system.for_problem(other), condense(other)
        np.testing.assert_allclose(shared.load, fresh.load, atol=1e-14)
        assert shared.constant == pytest.approx(fresh.constant)
        assert solve(other, workspace=Workspace.holding(shared)).energy == pytest.approx(solve(other).energy)


@pytest.mark.parametrize(
    ("down", "mu"), [(0.0616670468, 0.526166347), (0.3587170474755874, 0.26257230957936856), (0.120419864, 0.507610937)]
)
def test_a_potential_that_cancels_keeps_no_solution_from_its_tolerance(down: float, mu: float) -> None:
    """Its differences are rounding where the residual is 1e-9 to 7e-8; forces know them."""
    law = hv.FormulaLaw("piecewise((0, r < 0), (0.2 - (2*r + 0.2)*exp(-10*r), True))")
    problem = bodies.column(law, 2.0 * mu, top=hv.Fixed(y=-down))
    solution = hv.solve(problem, hv.solvers.NonsmoothNewton(), controls=hv.Controls(rtol=1e-9))
    assert solution.status is hv.Status.CONVERGED
    r = float(solution.local[0, 0])
    pressed = 2.0 * mu * (down - r)  # a bar of the stiffness 2 mu, of force per area
    assert 20.0 * r * np.exp(-10.0 * r) == pytest.approx(pressed, rel=1e-7)


# ---- what methods ask of what they are made of ------------------------------------------------------------------


def test_a_matrix_that_is_not_definite_counts_by_the_sizes_of_its_eigenvalues() -> None:
    """The direction is ``(H H)^-1/2 g``, so that steps along negative curvature are as long as others."""
    rng = np.random.default_rng(2)
    axes = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    H, g = (axes * [3.0, 0.5, -2.0, -0.25]) @ axes.T, rng.standard_normal(4)
    direction = descent_direction(H, g)
    np.testing.assert_allclose(np.real(la.sqrtm(H @ H)) @ direction, g, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("own", "asked"), [(1e-6, 1e-9), (1e-9, 1e-6)])
def test_steps_of_a_load_are_as_accurate_as_the_finer_of_both_tolerances(own: float, asked: float) -> None:
    inner = LoadStepping(NonsmoothMultigrid(), rtol=own).for_tolerance(asked)
    assert isinstance(inner, LoadStepping)
    assert inner.inner == NonsmoothMultigrid().for_tolerance(1e-9) != NonsmoothMultigrid().for_tolerance(1e-6)
