"""Equilibrium paths through folds."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.branches import find_solutions, follow, follow_path
from hemivar.branches.follower import Follower, Track
from hemivar.branches.path import Path
from hemivar.discrete.point_kind import PointKind
from hemivar.discrete.residual import residual
from hemivar.errors import ProblemError
from hemivar.fem import LoadLine, discretize
from hemivar.laws import Compliance, PiecewiseQuadratic, Softening
from hemivar.mechanics import Clamped, ContactProblem, Prescribed
from hemivar.solvers import LoadStepping, solve
from hemivar.systems import condense
from tests import bodies
from tests.samples import sampled

from ..problems import bar, discrete_square
from .random_problems import random_problem
from .test_solutions import columns, shear_column, softening


def test_bar_folds_at_the_loads_of_the_closed_form() -> None:
    path = follow_path(bar(0.5, softening()), (0.0, 2.0))  # r0 = t/4, R1 = 0.3, R2 = 0.2
    assert path.reached_end
    np.testing.assert_allclose([fold.load_factor for fold in path.folds], [0.3 / 0.25, 0.2 / 0.25], rtol=1e-13)
    np.testing.assert_allclose(path.local[[f.index for f in path.folds], 0, 0], [0.1, 0.2], rtol=1e-13)
    # the three branches at t = 1, the middle one unstable
    crossings = path.at(1.0)
    np.testing.assert_allclose([r[0, 0] for r, _ in crossings], [1.0 / 12.0, 0.15, 0.25], atol=1e-12)
    assert [stable for _, stable in crossings] == [True, False, True]
    # jumps under load control
    up, down = path.jumps
    assert up.loading
    assert not down.loading
    assert up.load_factor == pytest.approx(1.2)
    assert down.load_factor == pytest.approx(0.8)
    assert up.local is not None
    assert down.local is not None
    assert up.local[0, 0] == pytest.approx(0.3)
    assert down.local[0, 0] == pytest.approx(0.2 / 3.0)


def test_energy_and_balance_hold_along_the_path() -> None:
    problem = bar(0.5, softening())
    path = follow_path(problem, (0.0, 2.0))
    for i in range(len(path)):
        t = path.load_factor[i]
        at_load = LoadLine(problem).at(t)
        u = np.linalg.solve(problem.stiffness.toarray(), at_load.load - problem.contact_force(path.multiplier[i]))
        np.testing.assert_allclose(at_load.local(u), path.local[i], atol=1e-12)
        assert path.energy[i] == pytest.approx(at_load.energy(u), abs=1e-13)


def test_a_brittle_law_falls_straight_down() -> None:
    law = PiecewiseQuadratic([0.0, 0.1], [0.0, 20.0, 0.0], [0.0, -2.0])
    path = follow_path(bar(2.0, law), (0.0, 3.0))  # kappa = 1, r0 = t
    np.testing.assert_allclose([f.load_factor for f in path.folds], [2.1, 0.1], rtol=1e-12)
    np.testing.assert_array_equal(path.stable[-3:], [True, False, True])


def test_a_curved_law_folds_at_the_load_of_the_closed_form() -> None:
    kappa, h = 0.1, 0.5
    path = follow_path(shear_column(1.0, kappa, h), (0.0, 8.0))  # w0 = t
    # sticks up to kappa w0 = h; slips back to where the Lambert argument is -1/e
    np.testing.assert_allclose(
        [fold.load_factor for fold in path.folds],
        [h / kappa, 0.7 * h / kappa + 1.0 + np.log(0.3 * h / kappa)],
        rtol=1e-12,
    )
    slip, t = path.local[:, 0, 1], path.load_factor
    assert (np.abs(np.diff(slip)) + np.abs(np.diff(t)) > 1e-9).all()  # a fold is one point, though stability ends there
    moving = slip > 1e-12
    np.testing.assert_allclose(kappa * (t - slip)[moving], h * (0.7 + 0.3 * np.exp(-slip[moving])), rtol=1e-11)


@pytest.mark.parametrize("corrected", [True, False])
def test_a_jump_to_a_curved_branch_lands_on_a_solution_or_says_interpolated(
    corrected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = shear_column(1.0, 0.1, 0.5)
    assemble = follow._assemble

    def without_corrector(line: LoadLine, follower: Follower, track: Track, perturbed: bool) -> Path:
        if not corrected:
            monkeypatch.setattr(Follower, "at_the_load", lambda *given: None)
        return assemble(line, follower, track, perturbed)

    monkeypatch.setattr(follow, "_assemble", without_corrector)
    up = next(jump for jump in follow_path(problem, (0.0, 8.0)).jumps if jump.loading)
    assert up.local is not None
    at_load = condense(LoadLine(problem).at(up.load_factor))
    lam = at_load.law.nearest_multiplier(up.local, np.zeros_like(up.local))
    lam[:, 0] = at_load.multiplier(up.local)[:, 0]  # of the side that is held
    relative = residual(at_load.problem, at_load.recover(up.local, lam)[0], lam).relative
    assert up.interpolated is not corrected
    assert (relative < 1e-12) is corrected


def test_columns_break_one_after_the_other() -> None:
    path = follow_path(columns(4, coupling=0.1), (0.0, 2.0))
    assert path.reached_end
    assert path.perturbed  # the ends of the row are alike
    assert path.stable[0]
    assert path.stable[-1]
    for t in (0.7, 0.95, 1.1):
        known = np.array([s.local for s in find_solutions(LoadLine(columns(4, coupling=0.1)).at(t))])
        for r, _ in path.at(t):
            assert np.abs(known - r).max(axis=(1, 2)).min() < 1e-6


def test_a_convex_problem_has_a_stable_path_without_folds() -> None:
    problem = discrete_square("data (5.1)", 4)
    path = follow_path(problem, (0.0, 1.0))
    assert path.reached_end
    assert not path.folds
    assert not path.jumps
    assert path.stable.all()
    np.testing.assert_allclose(path.local[-1], solve(problem).local, atol=1e-10)


def test_prescribed_displacements_grow_with_the_load() -> None:
    problem = bodies.square(Compliance(3.0), 3, "cross", supports={"left": Clamped(), "top": Prescribed((0.0, -0.05))})
    problem = ContactProblem(
        mesh=problem.mesh,
        material=problem.material,
        supports={"top": Prescribed((0.0, -0.05))},
        contact=problem.contact,
        body_force=(0.1, 0.0),
    )
    line = LoadLine.of(problem)
    path = follow_path(problem, (0.0, 1.0))
    assert path.load_factor[0] == 0.0
    assert np.abs(path.local[0]).max() < 1e-15
    end = solve(discretize(problem))
    np.testing.assert_allclose(path.local[-1], end.local, atol=1e-10)
    assert path.energy[-1] == pytest.approx(end.energy)
    half = solve(line.at(0.5))
    np.testing.assert_allclose(path.at(0.5)[0][0], half.local, atol=1e-9)


@pytest.mark.parametrize("seed", sampled(range(20)))
def test_every_crossing_of_a_random_path_is_a_solution(seed: int) -> None:
    problem = random_problem(500 + seed)
    path = follow_path(problem, (0.0, 1.3))
    known = find_solutions(problem, max_solutions=1000, starts=5)
    places = np.array([s.local for s in known])
    kinds = [s.kind for s in known]
    for r, stable in path.at(1.0):
        distance = np.abs(places - r).max(axis=(1, 2))
        assert distance.min() < 1e-6
        if known.exhaustive:
            assert (kinds[int(np.argmin(distance))] is PointKind.LOCAL_MINIMISER) == stable


def test_the_path_starts_where_load_stepping_arrives() -> None:
    problem = bar(0.5, softening())
    path = follow_path(problem, (1.0, 2.0))
    assert path.local[0, 0, 0] == pytest.approx(solve(problem, LoadStepping()).penetration[0])
    other = follow_path(problem, (1.0, 2.0), start=find_solutions(problem)[0])
    assert other.local[0, 0, 0] == pytest.approx(0.25)


@pytest.mark.parametrize("bounds", [(1.0, 1.0), (2.0, 1.0), (0.0, np.inf)])
def test_an_empty_range_is_refused(bounds: tuple[float, float]) -> None:
    with pytest.raises(ProblemError, match="load factors"):
        follow_path(columns(1), bounds)


def test_block_of_several_points_jumps_where_its_column_does() -> None:
    """E2 on law G, alpha > kappa: all points meet every event at once; folds and landings in closed form."""
    kappa, k, delta, alpha = 12.0, 24.0, 0.1, 20.0
    contact = Softening(k, delta, alpha)
    block = bodies.column(
        contact, cells=(2, 4), pattern="cross", size=(0.5, 1.0), top=Clamped(), body_force=(0.0, -6.0)
    )
    path = follow_path(discretize(block), (0.0, 2.0))
    per_load = 6.0 / (2.0 * kappa)  # r0 at load factor 1
    up, down = path.jumps
    assert up.loading
    assert up.load_factor == pytest.approx(delta * (1.0 + k / kappa) / per_load, rel=1e-9)
    assert up.local is not None
    np.testing.assert_allclose(up.local[:, 0], up.load_factor * per_load, rtol=1e-6)
    assert not down.loading
    assert down.load_factor == pytest.approx(delta * (1.0 + k / alpha) / per_load, rel=1e-9)
    assert down.local is not None
    np.testing.assert_allclose(down.local[:, 0], kappa * down.load_factor * per_load / (kappa + k), rtol=1e-6)


@pytest.mark.parametrize("slender", [10.0, 20.0, 60.0])
def test_a_cantilever_over_a_gap(slender: float) -> None:
    """It meets its stop at the load factor at which the free beam has closed the gap, and ends where a solve ends."""
    gap, named = (
        0.02,
        {
            "root": lambda x: x[:, 0] < 1e-9,
            "stop": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 0.9 * slender),
            "up": lambda x: x[:, 1] > 1.0 - 1e-9,
        },
    )
    mesh = hv.rectangle((slender, 1.0), (40, 3)).with_boundaries(named)
    law = {"stop": hv.Contact(hv.Signorini(), gap=gap)}
    load = 1e4 * gap / slender**4
    beam = hv.ContactProblem(
        mesh, hv.Material.young(1e4, 0.3), law, {"root": hv.Clamped()}, tractions={"up": (0.0, -load)}
    )
    problem = hv.discretize(beam)
    free = problem.contact.trace_of(np.linalg.solve(problem.stiffness.toarray(), problem.load))[:, 0]
    touches = gap / free.max()
    path = hv.follow_path(problem, (0.0, 2.0 * touches))
    assert path.reached_end
    assert np.abs(path.load_factor - touches).min() <= 1e-6 * touches
    solved = hv.solve(problem.with_(load=2.0 * touches * problem.load))
    assert np.abs(path.local[-1] - solved.local).max() <= 1e-7 * np.abs(solved.local).max()
