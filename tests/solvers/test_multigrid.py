"""NonsmoothMultigrid against NonsmoothNewton, on geometric and algebraic hierarchies, in 2D and 3D."""

from __future__ import annotations

import itertools
import logging
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.errors import MethodError
from hemivar.fem.hierarchy import Coarser
from hemivar.gallery.survey_problems import SURVEY_DATA, SurveyData
from hemivar.kernels import kernels
from hemivar.laws import Superpotential
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import FixedPoint, NonsmoothMultigrid, NonsmoothNewton, Status
from hemivar.solvers.choice import choose
from hemivar.systems import workspace as workspace_module
from hemivar.systems.body_on_levels import levels_of
from tests import bodies
from tests.counting import at_most_calls
from tests.samples import sampled

TIGHT = hv.Controls(rtol=1e-10)


def without_parent(mesh: Mesh) -> Mesh:
    """The mesh as if it came from a file."""
    return Mesh(mesh.points, mesh.cells, dict(mesh.boundaries), dict(mesh.regions))


def shaken(n: int) -> Mesh:
    """An irregular mesh: the nodes inside are moved at random."""
    mesh = hv.rectangle((1.0, 1.0), n, pattern="cross")
    points = mesh.points.copy()
    inside = np.all((points > 0) & (points < 1), axis=1)
    points[inside] += 0.15 / n * np.random.default_rng(3).uniform(-1, 1, (int(inside.sum()), 2))
    return Mesh(points, mesh.cells, dict(mesh.boundaries))


def distance(problem: hv.DiscreteProblem, one: hv.Solution, other: hv.Solution) -> float:
    """Energy norm of the difference over that of the second."""
    gap = one.unknowns - other.unknowns
    return float(
        np.sqrt(gap @ (problem.stiffness @ gap)) / np.sqrt(other.unknowns @ (problem.stiffness @ other.unknowns))
    )


def check(statement: hv.ContactProblem, most_cycles: int = 45) -> hv.Solution:
    """Solve by both methods and compare."""
    problem = hv.discretize(statement)
    expected = hv.solve(problem, NonsmoothNewton(), TIGHT)
    found = hv.solve(problem, NonsmoothMultigrid(), TIGHT)
    assert expected.status is Status.CONVERGED
    assert found.status is Status.CONVERGED, (found.residual, found.history)
    assert distance(problem, found, expected) < 1e-9
    energies = [entry.energy for entry in found.history]
    assert all(b <= a for a, b in itertools.pairwise(energies))
    assert found.evaluations <= most_cycles
    return found


@pytest.mark.parametrize("pattern", ["cross", "right", "left"])
@pytest.mark.parametrize("data", SURVEY_DATA)
def test_survey_on_built_in_meshes(data: str, pattern: str) -> None:
    check(gallery.survey(data, 32, pattern))  # type: ignore[arg-type]


@pytest.mark.parametrize("data", SURVEY_DATA)
def test_survey_without_a_hierarchy_of_meshes(data: str) -> None:
    statement = gallery.survey(data, 32)
    check(replace(statement, mesh=without_parent(statement.mesh)), most_cycles=60)


def test_irregular_mesh_refined_uniformly() -> None:
    statement = gallery.survey("5.1", 4)
    found = check(replace(statement, mesh=shaken(4).refined(3)))
    sizes = [step.problem.unknowns for step in levels_of(found.problem, hv.systems.Workspace()).steps]
    assert sizes == [272, 1056]  # the coarsest mesh is not needed


def test_refinement_of_a_large_mesh_is_continued_algebraically() -> None:
    statement = gallery.survey("5.1", 4)
    check(replace(statement, mesh=shaken(16).refined(1)), most_cycles=60)


@pytest.mark.parametrize("data", ["figure1", "figure3", "5.1"])
def test_cube(data: str) -> None:
    check(gallery.survey_cube(data, 8))


def test_cube_without_a_hierarchy_of_meshes() -> None:
    statement = gallery.survey_cube("5.1", 8)
    check(replace(statement, mesh=without_parent(statement.mesh)), most_cycles=70)


@pytest.mark.parametrize("bound", [0.02, 0.05, 0.2])
def test_cube_on_the_edge_of_slip(bound: float) -> None:
    """Friction that has hardly begun to slip is stiff across the direction of slip."""
    statement = gallery.survey_cube(SurveyData((-0.8, -0.8), bound, 0.3, 2.0), 8)
    check(statement, most_cycles=60)


def test_weakening_inside_the_margin_in_both_dimensions() -> None:
    check(gallery.survey_logarithmic(0.3, 32))
    check(gallery.survey_cube_logarithmic(0.3, 8))


def test_cycles_are_bounded_as_the_mesh_is_refined() -> None:
    cycles = []
    for n in (16, 32, 64, 128):
        found = hv.solve(hv.discretize(gallery.survey("5.1", n, "right")), NonsmoothMultigrid())
        assert found.status is Status.CONVERGED
        cycles.append(found.evaluations)
    assert max(cycles) <= 24, cycles


def test_a_last_step_below_the_rounding_of_the_energy_is_taken() -> None:
    """It leads where Newton's equation says, as far as the digits of the displacements tell: no cycles to polish it."""
    problem = hv.discretize(gallery.survey_logarithmic(0.3, 128, "right"))
    found = hv.solve(problem, NonsmoothMultigrid(tolerance=5e-11), TIGHT)
    assert found.status is Status.CONVERGED
    assert found.evaluations <= 24


def test_rotation_of_the_body_changes_nothing() -> None:
    plain = gallery.survey("5.1", 16, "right")
    angle = 0.7
    c, s = np.cos(angle), np.sin(angle)
    turned = replace(
        plain, mesh=plain.mesh.rotated(angle), body_force=tuple(np.array([[c, -s], [s, c]]) @ np.array([-0.8, -0.8]))
    )
    one = hv.solve(hv.discretize(plain), NonsmoothMultigrid(), TIGHT)
    other = hv.solve(hv.discretize(turned), NonsmoothMultigrid(), TIGHT)
    assert one.energy == pytest.approx(other.energy, rel=1e-9)
    assert np.abs(one.multiplier - other.multiplier).max() < 1e-8 * np.abs(one.multiplier).max()


def test_rotation_of_a_cube_by_any_angle_changes_nothing() -> None:
    plain = gallery.survey_cube("5.1", 8)
    axis = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    turn = np.eye(3) + np.sin(1.1) * cross + (1 - np.cos(1.1)) * cross @ cross
    turned = replace(plain, mesh=plain.mesh.moved(turn), body_force=tuple(turn @ np.array([-0.8, -0.4, -0.8])))
    straight, oblique = hv.discretize(plain), hv.discretize(turned)
    one = hv.solve(straight, NonsmoothMultigrid(), TIGHT)
    other = hv.solve(oblique, NonsmoothMultigrid(), TIGHT)
    gap = other.displacement - one.displacement @ turn.T
    size = np.linalg.norm(one.displacement)
    assert np.linalg.norm(gap) < 1e-9 * size
    assert one.energy == pytest.approx(other.energy, rel=1e-9)


def test_units_change_nothing() -> None:
    """In millimetres and megapascals: lengths times 1000, stresses over 1e6."""
    plain = gallery.survey("5.1", 16, "right")
    law = hv.laws.ThresholdCompliance(0.3e-6, 2.0e-9)
    scaled = replace(
        plain,
        mesh=plain.mesh.scaled(1e3),
        material=hv.Material.lame(4e-6, 4e-6),
        contact={"bottom": hv.Contact(law, hv.Tresca(0.5e-6))},
        body_force=(-0.8e-9, -0.8e-9),
    )
    one = hv.solve(hv.discretize(plain), NonsmoothMultigrid(), TIGHT)
    other = hv.solve(hv.discretize(scaled), NonsmoothMultigrid(), TIGHT)
    assert one.evaluations == other.evaluations
    assert np.abs(1e3 * one.displacement - other.displacement).max() < 1e-9 * np.abs(other.displacement).max()


BEYOND = {
    "softening": (hv.Softening(40.0, 0.02, 20.0), hv.Tresca(0.1)),
    "jump down": (hv.laws.Capped(20.0, 0.02), hv.Tresca(0.1)),
    "layers": (hv.laws.Layered([0.01, 0.02], [10.0, 40.0], [0.05, 0.3], base=80.0), hv.Tresca(0.2)),
    "friction that drops": (hv.Compliance(20.0), hv.laws.StaticKinetic(0.3, 0.01, 1.0, 0.3)),
    "friction that weakens": (hv.Compliance(20.0), hv.SlipWeakening(0.5, 1.0, 0.3, 100.0)),
}


@pytest.mark.parametrize(("name", "dim"), sampled(itertools.product(BEYOND, (2, 3)), 3))
def test_energy_falls_beyond_the_margin(name: str, dim: int) -> None:
    """Laws with many local minima: the energy never rises and the end is stationary."""
    plain = gallery.survey("figure1", 32, "right") if dim == 2 else gallery.survey_cube("figure1", 8)
    problem = hv.discretize(replace(plain, contact={"bottom": hv.Contact(*BEYOND[name])}))
    for method in (NonsmoothMultigrid(), NonsmoothMultigrid(nested=False)):
        found = hv.solve(problem, method)
        assert found.status is Status.CONVERGED
        energies = [entry.energy for entry in found.history]
        assert all(b <= a for a, b in itertools.pairwise(energies))


def test_body_that_only_its_foundation_holds() -> None:
    """Pressed down without a support: the stiffness is singular, the foundation and friction hold the body."""
    statement = bodies.strip(
        hv.Contact(hv.Compliance(5.0), hv.Tresca(0.4)), (32, 16), supports={}, tractions={"top": (0.1, -0.5)}
    )
    check(statement, most_cycles=80)


def test_rigid_foundation_and_gap() -> None:
    statement = replace(
        gallery.survey("5.1", 32, "right"),
        contact={"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.05), gap=lambda x: 0.02 * x[:, 0])},
    )
    check(statement)


def test_coulomb_friction_by_fixed_point() -> None:
    statement = replace(
        gallery.survey("5.1", 16, "right"),
        contact={"bottom": hv.Contact(hv.Compliance(20.0), hv.laws.Friction(hv.laws.CoulombBound(0.3)))},
    )
    problem = hv.discretize(statement)
    expected = hv.solve(problem, FixedPoint(NonsmoothNewton()))
    found = hv.solve(problem, FixedPoint(NonsmoothMultigrid()))
    assert found.status is Status.CONVERGED
    assert distance(problem, found, expected) < 1e-8
    assert found.contraction == pytest.approx(expected.contraction, abs=0.05)


def test_starting_from_the_solution_takes_no_steps() -> None:
    problem = hv.discretize(gallery.survey("5.1", 32))
    found = hv.solve(problem, NonsmoothMultigrid(), TIGHT)
    again = hv.solve(problem, NonsmoothMultigrid(), hv.Controls(rtol=1e-9), initial=found)
    assert again.status is Status.CONVERGED
    assert again.steps == 0


def test_coarser_problems_are_posed_only_for_a_start_that_nobody_names(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, workspace = hv.discretize(gallery.survey("5.1", 32)), hv.systems.Workspace()
    NonsmoothMultigrid().prepare(problem, workspace)
    made, make = [], Coarser.on_coarse_mesh

    def counted(self: Coarser, finer: hv.DiscreteProblem) -> hv.DiscreteProblem:
        made.append(finer.unknowns)
        return make(self, finer)

    monkeypatch.setattr(Coarser, "on_coarse_mesh", counted)
    found = hv.solve(problem, NonsmoothMultigrid(), TIGHT, initial=np.zeros(problem.unknowns), workspace=workspace)
    assert found.status is Status.CONVERGED
    assert not made
    nested = hv.solve(problem, NonsmoothMultigrid(), TIGHT, workspace=workspace)
    assert made
    assert made == sorted(made, reverse=True)
    assert distance(problem, nested, found) < 1e-8


def test_a_start_at_rest_needs_no_product_with_the_whole_matrix() -> None:
    problem = hv.discretize(gallery.survey_cube("5.1", 4))
    body, K = NonsmoothMultigrid().prepare(problem, hv.systems.Workspace()), problem.stiffness
    rng, x = np.random.default_rng(7), np.zeros(problem.unknowns)
    for unknown in (body.unknown, np.arange(problem.unknowns)[::-7], body.unknown[:0]):
        x[unknown] = rng.standard_normal(unknown.size)
        np.testing.assert_allclose(body.multiply(x), K @ x, atol=1e-13 * np.abs(K).max() * np.abs(x).max())


def test_midpoint_quadrature_is_refused_in_words() -> None:
    statement = replace(gallery.survey("5.1", 8), quadrature=hv.mechanics.Quadrature.MIDPOINT)
    with pytest.raises(MethodError, match="quadrature at the nodes"):
        hv.solve(hv.discretize(statement), NonsmoothMultigrid())


def test_time_limit_returns_the_best_iterate() -> None:
    problem = hv.discretize(gallery.survey("5.1", 64))
    found = hv.solve(problem, NonsmoothMultigrid(), hv.Controls(max_time=0.0))
    assert found.status is Status.MAX_TIME
    assert np.isfinite(found.unknowns).all()


def test_interruption_returns_the_best_iterate() -> None:
    problem = hv.discretize(gallery.survey("5.1", 32))

    def interrupt(progress: hv.Progress) -> bool:
        if progress.step == 1:
            raise KeyboardInterrupt
        return False

    found = hv.solve(problem, NonsmoothMultigrid(), hv.Controls(rtol=1e-13, callback=interrupt))
    assert found.status in (Status.INTERRUPTED, Status.CONVERGED)
    assert np.isfinite(found.unknowns).all()


def test_choice_depends_on_size_and_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    small = hv.discretize(gallery.survey("5.1", 8))
    assert isinstance(choose(small)[0], NonsmoothNewton)
    large = hv.discretize(gallery.survey("5.1", 192, "right"))
    assert isinstance(choose(large)[0], NonsmoothMultigrid)
    with caplog.at_level(logging.INFO, logger="hemivar"):
        found = hv.solve(large)
    assert found.method == "multigrid"
    assert found.status is Status.CONVERGED
    assert "predicted" in caplog.text
    midpoints = replace(gallery.survey("5.1", 64), quadrature=hv.mechanics.Quadrature.MIDPOINT)
    assert isinstance(choose(hv.discretize(midpoints))[0], NonsmoothNewton)


def test_many_loads_repay_a_condensation() -> None:
    problem, workspace = hv.discretize(gallery.survey_cube("5.1", 9)), hv.systems.Workspace()
    loads = [factor * problem.load for factor in (1.0, 1.5, 0.8, 1.2)]
    found = [hv.solve(problem.with_(load=load), workspace=workspace) for load in loads]
    assert [one.method for one in found] == ["multigrid", "multigrid", "newton", "newton"]
    for one, load in zip(found, loads, strict=True):
        alone = hv.solve(problem.with_(load=load))
        assert alone.method == "multigrid"
        np.testing.assert_allclose(one.unknowns, alone.unknowns, atol=1e-8 * np.abs(alone.unknowns).max())
    assert choose(problem, many=True)[0].name == "newton"


def test_choice_heeds_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hemivar.solvers.choice.available_bytes", lambda: 1e6)
    monkeypatch.setattr("hemivar.solvers.choice._LITTLE", 0.0)
    method, why = choose(hv.discretize(gallery.survey("5.1", 32)))
    assert isinstance(method, NonsmoothMultigrid)
    assert "GiB" in why


#: Calls with the compiled kernels, and without.
PRICED = {
    "plane": (gallery.survey("5.1", 64, "right"), 5_000, 12_000),
    "space": (gallery.survey_cube("5.1", 16), 11_000, 34_000),
}


@pytest.mark.parametrize("which", PRICED)
def test_contact_costs_few_calls_beside_its_cycles(which: str) -> None:
    """What contact costs a body of middle size is Python; steps on each mesh took up to four times as many calls."""
    statement, compiled, without = PRICED[which]
    most = without if kernels() is None else compiled
    problem, workspace = hv.discretize(statement), hv.systems.Workspace()
    first = hv.solve(problem, "multigrid", workspace=workspace).raise_for_status()
    with at_most_calls(most):
        again = hv.solve(problem, "multigrid", workspace=workspace)
    np.testing.assert_array_equal(first.unknowns, again.unknowns)
    _, linear = levels_of(problem, workspace).solve(problem.load, 1e-9)
    assert again.evaluations <= 1.25 * linear + 1


def test_coarse_bodies_are_condensed_once_for_all_loads(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, workspace, sizes = hv.discretize(gallery.survey("5.1", 64, "right")), hv.systems.Workspace(), []
    condense = workspace_module.condense

    def counted(one: hv.DiscreteProblem, many: bool) -> object:
        sizes.append(one.unknowns)
        return condense(one, many)

    monkeypatch.setattr(workspace_module, "condense", counted)
    for factor in (1.0, 0.5, 2.0):
        found = hv.solve(problem.with_(load=factor * problem.load), "multigrid", workspace=workspace)
        assert found.status is Status.CONVERGED
    assert sizes == [2112]  # of four coarser meshes, the largest that is small


@pytest.mark.parametrize(
    ("statement", "part"),
    [
        (gallery.survey("5.1", 32, "right"), 0.9),
        (gallery.survey_logarithmic(0.3, 32, "right"), 0.5),
        (gallery.survey_cube("5.1", 8), 0.9),
    ],
    ids=["survey", "weakening", "cube"],
)
def test_from_the_right_pieces_one_equation_is_solved(statement: hv.ContactProblem, part: float) -> None:
    # What conjugate gradients do on the way carries contact points beyond their pieces, and back.
    problem = hv.discretize(statement)
    body = NonsmoothMultigrid().prepare(problem, hv.systems.Workspace())
    expected = hv.solve(problem, NonsmoothNewton(), TIGHT)
    start = body.moved(part * expected.unknowns, expected.local)
    found = hv.solve(problem, NonsmoothMultigrid(settled=True), TIGHT, initial=start)
    assert found.status is Status.CONVERGED
    assert found.steps == 1
    assert distance(problem, found, expected) < 1e-9
    assert hv.solve(problem, NonsmoothMultigrid(), TIGHT, initial=start).steps > 1


def test_from_the_wrong_pieces_the_same_is_found() -> None:
    problem = hv.discretize(gallery.survey_cube("5.1", 8))
    body = NonsmoothMultigrid().prepare(problem, hv.systems.Workspace())
    expected = hv.solve(problem, NonsmoothNewton(), TIGHT)
    far = body.moved(expected.unknowns, expected.local + 0.1)
    found = hv.solve(problem, NonsmoothMultigrid(settled=True), TIGHT, initial=far)
    assert found.status is Status.CONVERGED
    assert distance(problem, found, expected) < 1e-9


@pytest.mark.parametrize("slenderness", [20, 100])
@pytest.mark.parametrize(
    ("law", "load"),
    [(hv.Compliance(50.0), -5e-4), (hv.Compliance(0.01), -5e-4), (hv.Signorini(), -5e-4), (hv.Signorini(), 5e-4)],
)
def test_thin_bodies_take_few_steps(law: Superpotential, load: float, slenderness: int) -> None:
    """The answer is a tiny part of what the beam alone would do; or it lifts off, and is the beam alone."""
    problem = hv.ContactProblem(
        hv.rectangle((float(slenderness), 1.0), (slenderness * 4, 4)), hv.Material.lame(1.0, 1.0),
        {"bottom": hv.Contact(law)}, {"left": hv.Clamped()}, tractions={"top": (0.0, load)},
    )  # fmt: skip
    found, other = (hv.solve(problem, method) for method in ("multigrid", "newton"))
    assert found.status is hv.Status.CONVERGED
    assert found.steps <= 4
    size = np.abs(other.displacement).max()
    np.testing.assert_allclose(found.displacement, other.displacement, atol=1e-5 * size)


@pytest.mark.parametrize("force", [1e-4, 1.0, 100.0])
def test_a_lightly_loaded_beam_over_a_large_gap_keeps_its_digits(force: float) -> None:
    """Where the gap is many times the displacement, its rounding must not become one of the displacement."""
    problem = hv.ContactProblem(
        hv.rectangle((60.0, 8.0), (60, 4)), hv.Material.young(2e4, 0.3, plane="stress"),
        {"bottom": hv.Contact(hv.Signorini(), gap=lambda x: (x[:, 0] - 50.0) ** 2 / 10.0)}, {"left": hv.Fixed(x=0.0)},
        tractions={"top": (0.0, -force / 60.0)},
    )  # fmt: skip
    found = hv.solve(problem, "multigrid")
    assert found.status is hv.Status.CONVERGED
    assert found.residual.relative < 1e-9
    assert found.normal_force == pytest.approx(force, rel=1e-8)


@pytest.mark.parametrize("cells", [16, 32])
def test_wavy_laws_on_quadratic_elements_converge_on_every_mesh(cells: int) -> None:
    """The residual rises and falls while the energy falls on the way over the waves."""
    problem = hv.ContactProblem(
        hv.rectangle((2.0, 1.0), (2 * cells, cells)), hv.Material.lame(1.0, 1.0),
        {"bottom": hv.Contact(hv.FormulaLaw("0.1*(1 - cos(5*r))", reach=2.0))}, {"left": hv.Clamped()},
        tractions={"top": (0.0, -0.5)}, order=2,
    )  # fmt: skip
    found = hv.solve(problem, "multigrid")
    assert found.status is hv.Status.CONVERGED
    assert found.energy == pytest.approx(-1.154, abs=3e-3)  # less and less above that of finer meshes
    assert found.certify().kind.value == "local minimiser"


def test_what_is_advised_where_linear_elements_lock_is_solved() -> None:
    mesh, contact = hv.rectangle((4.0, 1.0), (32, 8)), {"bottom": hv.Contact(hv.Signorini(), gap=0.01)}
    supports, tractions = {"left": hv.Clamped()}, {"top": (0.0, -0.01)}

    def solved(order: int, method: str) -> hv.Solution:
        material = hv.Material.young(1.0, 0.4999 if order == 1 else 0.499)
        return hv.solve(hv.ContactProblem(mesh, material, contact, supports, tractions=tractions, order=order), method)

    assert any("use order = 2" in line for line in solved(1, "multigrid").warnings)
    found, other = solved(2, "multigrid"), solved(2, "newton")
    assert found.status is hv.Status.CONVERGED
    assert found.normal_force == pytest.approx(other.normal_force, rel=1e-6)
