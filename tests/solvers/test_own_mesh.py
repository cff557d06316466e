"""Contact on a mesh of one's own in space, which no coarser mesh lies below: what it costs beside a linear solve."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import Coulomb, Friction, NoFriction
from hemivar.linear import truncated_level
from hemivar.mesh import Mesh
from hemivar.solvers.choice import predicted_seconds
from hemivar.systems.body_on_levels import levels_of
from tests import bodies
from tests.own_mesh import bracket_on_a_plate

#: Cycles of a linear solve to the accuracy of the contact problems.
LINEAR = 25


def solved(size: float, friction: Friction, **options: object) -> hv.Solution:
    problem = hv.discretize(bracket_on_a_plate(size, friction))
    return hv.solve(problem, "multigrid", rtol=1e-10, **options).raise_for_status()  # type: ignore[arg-type]


def force_by_newton(solution: hv.Solution) -> float:
    return hv.solve(solution.problem, "newton", rtol=1e-10).raise_for_status().normal_force


sizes = pytest.mark.parametrize("size", [3.5, pytest.param(1.8, marks=pytest.mark.slow)])


@sizes
def test_contact_costs_two_linear_solves(size: float) -> None:
    found = solved(size, NoFriction())
    assert found.steps <= 8
    assert found.evaluations <= 2 * LINEAR
    if size > 3.0:
        assert found.normal_force == pytest.approx(force_by_newton(found), rel=1e-7)


@sizes
def test_contact_with_coulomb_friction_costs_three(size: float) -> None:
    found = solved(size, Coulomb(0.2))
    assert found.method == "semismooth-multigrid"
    assert found.fallbacks == 0
    assert found.steps <= 12  # rounds of less accuracy: what they cost is told by the cycles
    assert found.evaluations <= 3 * LINEAR
    if size > 3.0:
        assert found.normal_force == pytest.approx(force_by_newton(found), rel=1e-7)


def test_a_method_that_creeps_is_left_after_five_steps() -> None:
    """From rest, with all of the foot on the plate, Newton's steps for Coulomb's law gain one per cent each."""
    problem = hv.discretize(bracket_on_a_plate(3.5, Coulomb(0.2)))
    found = hv.solve(problem, "multigrid", rtol=1e-8, initial=np.zeros(problem.unknowns)).raise_for_status()
    assert 1 <= found.fallbacks <= 2
    left = next(one.step for one in found.history if one.residual < 0.5)
    assert left <= 10
    assert found.steps <= 20


def test_algebraic_levels_follow_the_contact_set_only_where_that_pays(monkeypatch: pytest.MonkeyPatch) -> None:
    """To change them costs as much as many cycles; the answer of a solve depends on nothing before it."""
    problem, workspace, changes = hv.discretize(bracket_on_a_plate(3.5)), hv.systems.Workspace(), 0
    change = truncated_level.CoarseChange.of

    def counted(self: truncated_level.CoarseChange, *given: object) -> object:
        nonlocal changes
        changes += 1
        return change(self, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(truncated_level.CoarseChange, "of", counted)
    if levels_of(problem, workspace).levels.compiled is None:
        pytest.skip("cycles in double precision follow at once")
    first, again = (hv.solve(problem, "multigrid", workspace=workspace).raise_for_status() for _ in range(2))
    assert changes <= 2 * (first.steps - 1)
    np.testing.assert_array_equal(first.unknowns, again.unknowns)
    assert first.evaluations == again.evaluations


def test_what_nothing_but_contact_holds_starts_from_rest() -> None:
    """Its stiffness alone has no solution; friction with a given bound holds it sideways."""
    stated = bracket_on_a_plate(4.5, hv.laws.Tresca(0.3))
    free = hv.discretize(hv.ContactProblem(
        stated.mesh, stated.material, contact=stated.contact, tractions={"pull": (0.1, 0.0, -1.0)}
    ))  # fmt: skip
    found = hv.solve(free, "multigrid", rtol=1e-8).raise_for_status()
    assert found.steps <= 10
    assert found.normal_force == pytest.approx(8.0 * 40.0, rel=1e-6)


@pytest.mark.parametrize("size", [3.5, 2.5])
def test_a_convex_energy_that_falls_is_no_stall(size: float) -> None:
    """From rest the foot lifts a few points at a time: for a dozen steps the residual is no smaller than at first."""
    problem = hv.discretize(bracket_on_a_plate(size))
    found = hv.solve(problem, "multigrid", initial=np.zeros(problem.unknowns)).raise_for_status()
    energies = [one.energy for one in found.history]
    assert np.all(np.diff(energies) <= 1e-12 * abs(energies[-1]))


def test_the_choice_knows_that_meshes_without_a_coarser_one_cost_more() -> None:
    stated = bodies.cube(hv.laws.Signorini(), cells=12)
    mesh = stated.mesh
    alone = stated.on(Mesh(mesh.points, mesh.cells, dict(mesh.boundaries)))
    (newton, known), (same, unknown) = (predicted_seconds(hv.discretize(one)) for one in (stated, alone))
    assert same == newton
    assert unknown > 1.5 * known
