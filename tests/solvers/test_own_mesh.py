"""Contact on a mesh of one's own in space, which no coarser mesh lies below: what it costs beside a linear solve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.laws import Coulomb, Friction, NoFriction, Tresca
from hemivar.linear import fixed_patterns
from hemivar.mesh import Mesh
from hemivar.solvers.choice import predicted_seconds
from hemivar.systems.body_on_levels import BodyProblem, levels_of
from tests import bodies
from tests.own_mesh import bracket_on_a_plate

#: Cycles of a linear solve to the accuracy of the contact problems.
LINEAR = 25


def solved_bracket(size: float, friction: Friction, **options: object) -> hv.Solution:
    problem = hv.discretize(bracket_on_a_plate(size, friction))
    return hv.solve(problem, "multigrid", rtol=1e-10, **options).raise_for_status()  # type: ignore[arg-type]


def force_by_newton(solution: hv.Solution) -> float:
    return hv.solve(solution.problem, "newton", rtol=1e-10).raise_for_status().normal_force


sizes = pytest.mark.parametrize("size", [3.5, pytest.param(1.8, marks=pytest.mark.slow)])


@sizes
def test_contact_costs_two_linear_solves(size: float) -> None:
    found = solved_bracket(size, NoFriction())
    assert found.steps <= 8
    assert found.evaluations <= 2 * LINEAR
    if size > 3.0:
        assert found.normal_force == pytest.approx(force_by_newton(found), rel=1e-7)


@sizes
def test_contact_with_coulomb_friction_costs_three(size: float) -> None:
    found = solved_bracket(size, Coulomb(0.2))
    assert found.method == "semismooth-multigrid"
    assert found.fallbacks == 0
    assert found.steps <= 14  # rounds of less accuracy: what they cost is told by the cycles
    assert found.evaluations <= 3 * LINEAR
    if size > 3.0:
        assert found.normal_force == pytest.approx(force_by_newton(found), rel=1e-7)


def test_once_contact_points_keep_their_pieces_few_equations_are_left() -> None:
    """The derivative of a slip in space has entries beside its diagonal that are rounding: they change no piece."""
    found = hv.solve(pressed_bracket(Coulomb(0.3)), "multigrid", rtol=1e-8).raise_for_status()
    before, last = (one.residual for one in found.history[-3:-1])
    assert last <= 0.01 * before


def bolted(
    above: tuple[int, int, int], below: tuple[int, int, int], friction: Friction, pull: float
) -> hv.DiscreteProblem:
    """Two plates, pressed together round two bolts; the lower one is held at an end, friction holds the upper one."""

    def force(way: float) -> Callable[[np.ndarray], np.ndarray]:
        def at(x: np.ndarray) -> np.ndarray:
            near = np.minimum(*(np.hypot(x[:, 0] - bolt, x[:, 1] - 30.0) for bolt in (30.0, 90.0))) < 12.0
            return near[:, None] * np.array([0.0, 0.0, way * 45.6])

        return at

    lower = hv.box((120.0, 60.0, 10.0), cells=below, origin=(0.0, 0.0, -10.0))
    mesh = Mesh.assembled({"u": hv.box((120.0, 60.0, 10.0), cells=above), "l": lower})
    touch = {"u:bottom": hv.Contact(hv.Signorini(), friction, against="l:top")}
    loads = {"u:top": force(-1.0), "l:bottom": force(1.0), "u:right": (pull, 0.0, pull)}
    return hv.discretize(
        hv.ContactProblem(mesh, hv.Material.young(210e3, 0.3), touch, {"l:left": hv.Clamped()}, tractions=loads)
    )


def test_where_newtons_equation_leads_astray_another_way_is_taken_at_once() -> None:
    """The second equation makes |F| many times larger; halving its step led nowhere in 200 cycles."""
    problem = bolted((15, 8, 2), (12, 6, 2), Coulomb(0.15), 4.0)
    found, reference = (hv.solve(problem, one, rtol=1e-8).raise_for_status() for one in ("multigrid", "newton"))
    assert found.fallbacks == 1
    assert found.evaluations <= 120
    assert found.energy < problem.energy(np.zeros(problem.unknowns))
    assert found.energy == pytest.approx(reference.energy, rel=1e-7)


def test_jumps_at_nodes_that_a_support_holds_ask_no_fewer_nodes() -> None:
    """They come in the place of unknowns of the other body."""
    problem = bolted((13, 7, 1), (17, 9, 1), Coulomb(0.15), 2.0)
    found, reference = (hv.solve(problem, one, rtol=1e-8).raise_for_status() for one in ("multigrid", "newton"))
    assert found.energy == pytest.approx(reference.energy, rel=1e-7)


def pressed_bracket(friction: Friction) -> hv.DiscreteProblem:
    """The bracket held at its top, its hole pressed down and aside: most of its foot touches or slides."""
    stated = bracket_on_a_plate(3.5, friction)
    held, push = {"pull": hv.Clamped()}, {"hole": (0.3, 0.2, -1.0)}
    return hv.discretize(replace(stated, supports=held, tractions=push))


@pytest.mark.parametrize(("friction", "steps", "cycles"), [(Tresca(0.05), 8, 40), (Coulomb(0.3), 12, 50)])
def test_a_foot_that_is_pressed_starts_from_its_solution_on_some_of_the_nodes(
    friction: Friction, steps: int, cycles: int
) -> None:
    """Without that start its front moves by thirty steps."""
    problem = pressed_bracket(friction)
    found, reference = (hv.solve(problem, one, rtol=1e-10).raise_for_status() for one in ("multigrid", "newton"))
    assert (found.fallbacks, found.steps <= steps, found.evaluations <= cycles) == (0, True, True)
    size = np.abs(reference.unknowns).max()
    np.testing.assert_allclose(found.unknowns, reference.unknowns, atol=1e-8 * size)
    assert friction.state_dependent or found.history[0].energy <= 0.0  # that at rest


def test_a_law_whose_force_falls_starts_from_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """What fewer nodes find may choose the branch."""
    monkeypatch.setattr(BodyProblem, "_thin", lambda self: pytest.fail("it asks fewer nodes"))
    problem = pressed_bracket(hv.laws.SlipWeakening(0.05, 1.0, 0.5, 20.0))
    assert hv.solve(problem, "multigrid", rtol=1e-8).raise_for_status().history[0].step == 0


def test_nodes_on_which_contact_does_not_hold_the_body_are_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(self: BodyProblem) -> None:
        raise ProblemError("the stiffness matrix is singular")

    problem = pressed_bracket(Tresca(0.05))
    good = hv.solve(problem, "multigrid", rtol=1e-8).raise_for_status()
    monkeypatch.setattr(BodyProblem, "condensed", singular)
    found = hv.solve(problem, "multigrid", rtol=1e-8).raise_for_status()
    np.testing.assert_allclose(found.unknowns, good.unknowns, atol=1e-7 * np.abs(good.unknowns).max())
    assert found.history[0].energy <= 0.0


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
    change = fixed_patterns.FixedChange.of

    def counted(self: fixed_patterns.FixedChange, *given: object) -> object:
        nonlocal changes
        changes += 1
        return change(self, *given)  # type: ignore[arg-type]

    monkeypatch.setattr(fixed_patterns.FixedChange, "of", counted)
    if levels_of(problem, workspace).levels.compiled is None:
        pytest.skip("cycles in double precision follow at once")
    first, again = (hv.solve(problem, "multigrid", workspace=workspace).raise_for_status() for _ in range(2))
    assert 0 < changes <= 2 * (first.steps - 1)
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


def test_sums_that_cancel_in_products_are_there_once_unknowns_are_held() -> None:
    """A free body with an odd number of cells: what SciPy leaves out of a product is needed after that."""
    problem = hv.ContactProblem(
        hv.rectangle(cells=25), hv.Material.lame(4.0, 4.0), {"bottom": hv.Contact(hv.Signorini(), Tresca(0.1))}, {},
        tractions={"top": (0.02, -0.1)},
    )  # fmt: skip
    found, reference = (hv.solve(problem, method).raise_for_status() for method in ("multigrid", "newton"))
    assert found.energy == pytest.approx(reference.energy, rel=1e-8)


def test_levels_answer_with_the_same_bits_whatever_they_solved_before() -> None:
    """Another solve ended with the contact points with which this one begins."""
    contact, tractions = (
        {"bottom": hv.Contact(hv.Signorini())},
        {"right": (0.02, 0.03, -0.05), "top": (0.0, 0.0, -0.05)},
    )
    body = hv.ContactProblem(
        hv.box(cells=9), hv.Material.lame(4.0, 4.0), contact, {"left": hv.Clamped()}, tractions=tractions
    )
    problem, workspace = hv.discretize(body), hv.systems.Workspace()
    other = problem.with_(load=problem.load + np.where(np.arange(problem.unknowns) % 3 == 2, np.abs(problem.load), 0.0))
    before = hv.solve(problem, "multigrid", workspace=workspace)
    used = hv.solve(other, "multigrid", initial=before, workspace=workspace)
    fresh = hv.solve(other, "multigrid", initial=before)
    assert used.evaluations == fresh.evaluations
    np.testing.assert_array_equal(used.unknowns, fresh.unknowns)
