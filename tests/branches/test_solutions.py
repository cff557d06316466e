"""All solutions of small problems, against closed forms and against brute force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from hemivar.basics.types import Array
from hemivar.branches import find_solutions, search
from hemivar.certificates import certify
from hemivar.discrete import DiscreteProblem
from hemivar.discrete.point_kind import PointKind
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import Bilateral, ContactLaw, Coulomb, PiecewiseQuadratic, SlipWeakening, Softening
from hemivar.mechanics import Contact, ContactProblem, Material, Quadrature
from hemivar.mesh import rectangle
from hemivar.solvers import Solution, Status, solve
from hemivar.systems import condense
from hemivar.systems.chain import chain_of
from tests.samples import sampled, slow

from ..problems import bar, discrete_square
from .random_problems import random_problem


def softening(k: float = 2.0, delta: float = 0.1, alpha: float = 2.0) -> PiecewiseQuadratic:
    """Law G of the bar on a softening foundation (E1)."""
    return PiecewiseQuadratic([0.0, delta, delta * (1.0 + k / alpha)], [0.0, k, -alpha, 0.0], [0.0] * 3, name="G")


def columns(count: int, force: float = 0.25, coupling: float = 0.0, **law: float) -> DiscreteProblem:
    """Columns of stiffness 1, side by side, each on its own softening foundation; neighbours may be coupled."""
    difference = np.diff(np.eye(count), axis=0)
    K = np.eye(count) + coupling * difference.T @ difference
    load = np.full(count, force)
    return DiscreteProblem.of_arrays(
        K,
        load,
        np.eye(count),
        np.ones(count),
        np.zeros(count),
        ContactLaw(softening(**law)),
        0.5 * force * force * count,
    )  # type: ignore[arg-type]


def shear_column(w0: float, kappa: float, h: float, n: int = 4) -> DiscreteProblem:
    """Column of unit height sheared by its own weight over a bilateral foundation with slip weakening (E3)."""
    K = np.zeros((2 * n, 2 * n))
    load = np.zeros(2 * n)
    for c, stiffness in ((0, 3.0 * kappa), (1, kappa)):
        for i in range(n):
            a = 2 * i + c
            K[a, a] = stiffness * n * (2 if i else 1)
            if i:
                K[a, a - 2] = K[a - 2, a] = -stiffness * n
    load[1::2] = 2.0 * kappa * w0 / n
    load[1] *= 0.5
    B = np.zeros((2, 2 * n))
    B[0, 0] = B[1, 1] = 1.0
    law = ContactLaw(Bilateral(), SlipWeakening(h))
    return DiscreteProblem.of_arrays(K, load, B, np.ones(1), np.zeros(1), law)  # type: ignore[arg-type]


@pytest.mark.parametrize("enumerate_up_to", [20_000, 0])
def test_bar_on_a_softening_foundation_has_its_three_solutions(enumerate_up_to: int) -> None:
    found = find_solutions(columns(1), enumerate_up_to=enumerate_up_to, starts=5)
    assert found.exhaustive == (enumerate_up_to > 0)
    np.testing.assert_allclose([s.penetration[0] for s in found], [0.25, 1.0 / 12.0, 0.15], atol=1e-10)
    np.testing.assert_allclose(found.energies, [0.02, 1.0 / 48.0, 0.0225], atol=1e-10)
    assert [s.kind for s in found] == ["local minimiser", "local minimiser", "maximum"]
    assert len(found.minima) == 2
    assert all(s.status is Status.CONVERGED and s.residual.relative < 1e-12 for s in found)


def test_bar_with_interior_unknowns_has_the_same_roots() -> None:
    found = find_solutions(bar(0.5, softening()))
    np.testing.assert_allclose([s.penetration[0] for s in found], [0.25, 1.0 / 12.0, 0.15], atol=1e-10)
    np.testing.assert_allclose(np.diff(found.energies), [1.0 / 48.0 - 0.02, 0.0225 - 1.0 / 48.0], atol=1e-12)


def test_bar_with_weak_softening_has_one_solution() -> None:
    found = find_solutions(bar(0.8, softening(alpha=0.5)))
    assert len(found) == 1
    assert found.exhaustive
    assert found[0].penetration[0] == pytest.approx(0.3, abs=1e-12)


def test_global_minimum_switches_where_the_areas_are_equal() -> None:
    switch = np.sqrt(0.3 * 0.2)
    assert find_solutions(columns(1, switch - 1e-6))[0].penetration[0] < 0.1
    assert find_solutions(columns(1, switch + 1e-6))[0].penetration[0] > 0.2


def test_a_capped_law_has_its_jump_as_a_clarke_point() -> None:
    law = PiecewiseQuadratic([0.0, 0.1], [0.0, 20.0, 0.0], [0.0, -2.0])
    found = find_solutions(bar(2.0, law))  # kappa = 1, r0 = 1
    kinds = {s.kind: s for s in found}
    assert sorted(s.kind for s in found) == ["local minimiser", "local minimiser", "maximum"]
    assert kinds[PointKind.MAXIMUM].penetration[0] == pytest.approx(0.1)
    assert kinds[PointKind.MAXIMUM].pressure[0] == pytest.approx(0.9)


@pytest.mark.parametrize("w0", [4.92, *map(slow, (4.85, 4.97, 5.3))])
def test_shear_block_with_slip_weakening_has_the_roots_of_its_closed_form(w0: float) -> None:
    kappa, h = 0.1, 0.5
    found = find_solutions(shear_column(w0, kappa, h), starts=10)

    def force(w: float) -> float:
        return kappa * (w0 - w) - h * (0.7 + 0.3 * np.exp(-w))

    turn = np.log(0.3 * h / kappa)  # where the out-of-balance force is largest
    roots = [0.0] if kappa * w0 <= h else []
    if force(turn) > 0.0:
        roots += [brentq(force, 0.0, turn, xtol=1e-15)] if force(0.0) < 0.0 else []
        roots += [brentq(force, turn, w0, xtol=1e-15)]
    np.testing.assert_allclose(sorted(s.slip[0, 0] for s in found), roots, atol=1e-10)
    assert len(roots) == {4.85: 1, 4.92: 3, 4.97: 3, 5.3: 1}[w0]


def test_shear_block_of_the_benchmark() -> None:
    found = find_solutions(shear_column(0.3, 4.0, 0.5), starts=10)
    assert len(found) == 1
    assert found[0].slip[0, 0] == pytest.approx(0.181215413909818, abs=1e-12)


def test_two_columns_have_nine_solutions() -> None:
    found = find_solutions(columns(2))
    assert found.exhaustive
    assert len(found) == 9
    pairs = {tuple(np.round(s.penetration, 8)) for s in found}
    values = [round(v, 8) for v in (1.0 / 12.0, 0.15, 0.25)]
    assert pairs == {(a, b) for a in values for b in values}
    assert sorted(s.kind or "" for s in found) == 4 * ["local minimiser"] + ["maximum"] + 4 * ["saddle"]


def test_many_columns_say_how_far_the_search_went() -> None:
    assert len(find_solutions(columns(4))) == 81
    found = find_solutions(columns(8), max_solutions=30, starts=5)
    assert not found.exhaustive
    assert len(found) == 30
    assert found.combinations == 4**8
    assert "6.55e+04" in found.searched
    assert "stopped at 30" in found.searched
    assert 0 < found.starts <= 4**8


def test_a_continuum_of_solutions_is_said_to_be_one() -> None:
    # Softening as fast as the bar is stiff: all r between 0.1 and 0.3 balance r0 = 0.3.
    found = find_solutions(columns(1, 0.3, alpha=1.0))
    assert not found.exhaustive
    assert "continuum" in found.searched


@pytest.mark.parametrize("quadrature", list(Quadrature))
def test_a_convex_problem_has_one_solution(quadrature: Quadrature) -> None:
    problem = discrete_square("data (5.1)", 2, quadrature=quadrature)
    found = find_solutions(problem)
    assert len(found) == 1
    np.testing.assert_allclose(found[0].unknowns, solve(problem).unknowns, atol=1e-10)
    assert found[0].kind is PointKind.LOCAL_MINIMISER


def test_bad_options_are_named() -> None:
    with pytest.raises(ProblemError, match="max_solutions is 0"):
        find_solutions(columns(1), max_solutions=0)


def brute_force(problem: DiscreteProblem, points: int) -> float:
    """Lowest energy of the condensed problem on a grid that is refined three times around its best point."""
    from hemivar.systems import condense

    system = condense(problem)
    size = system.shape[0] * system.shape[1]
    centre, reach = np.zeros(size), 4.0 * system.length_scale + 2.0
    for _ in range(6):
        axes = [np.linspace(c - reach, c + reach, points) for c in centre]
        grid: Array = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, size)
        energy = 0.5 * np.einsum("bi,ij,bj->b", grid, system.matrix, grid) - grid @ system.load + system.constant
        rows = grid.reshape(-1, *system.shape)
        for j in range(system.shape[0]):
            law = problem.law.take(np.array([j]))
            energy += problem.contact.weights[j] * law.value(rows[:, j])
        centre, reach = grid[np.argmin(energy)], 3.0 * reach / points
    return float(energy.min())


@pytest.mark.parametrize("seed", sampled(range(12), 4))
def test_no_point_of_a_grid_is_below_the_lowest_solution(seed: int) -> None:
    problem = random_problem(1000 + seed)
    size = problem.contact_points * problem.contact.components
    if size > 4:
        pytest.skip("too many unknowns for a grid")
    found = find_solutions(problem, max_solutions=10_000, starts=10)
    lowest = brute_force(problem, {1: 2001, 2: 201, 3: 51, 4: 21}[size])
    assert found[0].energy <= lowest + 1e-12 * abs(lowest)


def test_a_positive_margin_ends_the_search() -> None:
    """Where 1 - c > 0, one solution is proved; where it is not, the search does not claim so (17 columns, E1)."""
    proved = find_solutions(columns(17, alpha=0.5, delta=0.1), starts=2)
    assert (len(proved), proved.exhaustive, proved.starts) == (1, True, 1)
    assert "margin 0.5" in proved.searched
    searched = find_solutions(columns(17, alpha=2.0), starts=2, max_solutions=3)
    assert not searched.exhaustive
    assert searched.starts > 1


def test_the_kind_of_each_solution_is_that_of_its_certificate() -> None:
    """One word for one thing."""
    seen: dict[PointKind, int] = {}
    for seed in range(40):
        problem = random_problem(seed)
        if chain_of(condense(problem)).combinations > 1500:
            continue
        for solution in find_solutions(problem, max_solutions=200):
            kind = certify(solution).kind
            if kind in (PointKind.UNIQUE_MINIMISER, PointKind.GLOBAL_MINIMISER):
                kind = PointKind.LOCAL_MINIMISER
            assert solution.kind is kind, f"seed {seed}"
            seen[kind] = seen.get(kind, 0) + 1
    assert min(seen[kind] for kind in (PointKind.LOCAL_MINIMISER, PointKind.SADDLE, PointKind.MAXIMUM)) > 1


@pytest.mark.parametrize("enumerate_up_to", [20_000, 0])
@pytest.mark.parametrize(("load", "turn"), [(0.6, 0.1), (0.4, 0.2)])  # the folds of test_path
def test_where_the_load_turns_the_curvature_does_not_decide(load: float, turn: float, enumerate_up_to: int) -> None:
    found = find_solutions(bar(load, softening()), enumerate_up_to=enumerate_up_to, starts=5)
    kinds = {round(s.penetration[0], 9): s.kind for s in found}
    assert kinds.pop(turn) is PointKind.DIRECTIONALLY_STATIONARY
    assert list(kinds.values()) == [PointKind.LOCAL_MINIMISER]
    assert len(found.minima) == 1
    assert [certify(s).kind for s in found] == [s.kind for s in found]


def test_where_the_load_turns_on_a_curved_law_the_curvature_does_not_decide() -> None:
    kappa, h = 0.1, 0.5
    slip = np.log(0.3 * h / kappa)
    found = find_solutions(shear_column(0.7 * h / kappa + 1.0 + slip, kappa, h), starts=5)
    turning = [s for s in found if abs(s.slip[0, 0] - slip) < 1e-6]
    assert turning
    for solution in turning:
        assert certify(solution).kind is solution.kind is PointKind.DIRECTIONALLY_STATIONARY


def test_one_of_many_minimisers_of_a_convex_energy_is_a_global_one() -> None:
    """Two points on a spring that nothing holds, one of them on a foundation that is rigid-plastic at no force."""
    law = PiecewiseQuadratic([0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0])
    K, B = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[1.0, 0.0]])
    problem = DiscreteProblem.of_arrays(K, np.zeros(2), B, np.ones(1), np.zeros(1), ContactLaw(law))
    found = find_solutions(problem)
    assert not found.exhaustive
    assert found.minima == found.solutions
    for solution in found:
        assert certify(solution).kind is solution.kind is PointKind.GLOBAL_MINIMISER


def test_the_kinds_on_a_body_that_its_foundation_alone_holds() -> None:
    K, B = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.eye(2)
    law = PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -1.5, 2.0], [0.0, 0.0, 0.0])
    problem = DiscreteProblem.of_arrays(K, np.full(2, 0.14), B, np.ones(2), np.zeros(2), ContactLaw(law))
    found = find_solutions(problem)
    middle = [s for s in found if np.ptp(s.penetration) < 1e-9 and 0.1 < s.penetration[0] < 0.2]
    assert [s.kind for s in middle] == [PointKind.SADDLE]
    assert len(found.minima) >= 2
    for solution in found:
        assert certify(solution).kind is solution.kind


def test_a_jump_met_at_its_end_is_stationary_to_one_side_only() -> None:
    found = find_solutions(bar(2.0 * 0.15, PiecewiseQuadratic([0.0, 0.15], [0.0, 2.0, 0.0], [0.0, -0.3])))
    at_end = [s for s in found if abs(s.penetration[0] - 0.15) < 1e-12]
    assert [s.kind for s in at_end] == [PointKind.CLARKE_STATIONARY]
    assert at_end[0] not in found.minima


def test_a_load_that_is_not_carried_from_rest_grows_from_there_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Weight near what the foundation can bear, which friction tilts; other starts are from points."""
    statement = ContactProblem(
        mesh=rectangle((1.0, 1.0), 3),
        material=Material.lame(4.0, 4.0),
        contact={"bottom": Contact(Softening(60.0, 0.02, 16.0), Coulomb(0.3))},
        body_force=(0.25, -1.0),
    )
    from_rest = []

    def counted(*args: Any, initial: Any, **options: Any) -> Solution:
        from_rest.append(initial is None)
        return solve(*args, initial=initial, **options)

    monkeypatch.setattr(search, "solve", counted)
    solutions = find_solutions(discretize(statement), starts=0)
    assert len(solutions) == 0
    assert sum(from_rest) == 1
    assert "the load is not carried" in solutions.searched
