"""Results by boundary: forces by name, reactions in equilibrium, tables of contact points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.fem.assembly import load_vector, stiffness_matrix
from hemivar.fem.reactions import internal_forces, nodal_contact_forces
from hemivar.gallery import beam, elastic_bar, survey, survey_cube
from hemivar.laws import Signorini, ThresholdCompliance, Tresca
from hemivar.mechanics import (
    Clamped,
    Contact,
    ContactProblem,
    Fixed,
    Material,
    Prescribed,
    Pressure,
    Quadrature,
    Roller,
    Sphere,
)
from hemivar.mesh import rectangle
from hemivar.solvers import NormalState, Solution, TangentialState, solve
from tests import bodies

from ..mesh.meshes import distorted

PLANE = replace(survey("figure4", 6), mesh=distorted(rectangle((1.0, 1.0), 6, pattern="cross")))
CUBE = survey_cube("5.1", 3)
FOUNDATION = PLANE.contact["bottom"]
TURN = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
TURN *= np.linalg.det(TURN)
SPHERE = Sphere((0.5, -3.0), 3.0)


def stiffer(x: Array) -> Array:
    return np.asarray(1.0 + x[:, 0] ** 2)


PROBLEMS: dict[str, ContactProblem] = {
    "clamped": PLANE,
    "pulled": replace(PLANE, tractions={"right": (0.3, 0.1), "top": Pressure(0.2)}),
    "roller and prescribed": replace(PLANE, supports={"left": Roller(), "top": Prescribed((0.0, -0.05))}),
    "components": replace(PLANE, mesh=PLANE.mesh.rotated(0.3), supports={"left": Fixed(x=0.0), "top": Fixed(y=-0.1)}),
    "turned rollers": replace(PLANE, mesh=PLANE.mesh.rotated(0.3), supports={"left": Roller(), "right": Roller()}),
    "two foundations": replace(PLANE, contact={"bottom": FOUNDATION, "right": FOUNDATION}),
    "midpoints": replace(PLANE, quadrature=Quadrature.MIDPOINT),
    "varying": replace(PLANE, material=Material.young(stiffer, 0.3)),
    "quadratic": replace(PLANE, order=2, material=Material.young(stiffer, 0.3)),
    "quadratic, midpoints": replace(PLANE, order=2, quadrature=Quadrature.MIDPOINT),
    "obstacle": replace(
        PLANE, contact={"bottom": Contact(Signorini(), Tresca(0.1), obstacle=Sphere((0.5, -3.0), 3.0))}
    ),
    "cube": CUBE,
    "cube, three supports": replace(
        CUBE, supports={"left": Roller(), "front": Roller(), "top": Prescribed((0.0, 0.0, -0.02))}
    ),
    "turned cube": replace(
        CUBE, mesh=CUBE.mesh.moved(TURN), supports={"left": Roller(), "top": Fixed(z=-0.02), "front": Roller()}
    ),
    "cube, two foundations": replace(CUBE, contact=dict.fromkeys(("bottom", "right"), CUBE.contact["bottom"])),
}


@pytest.fixture(scope="module", params=PROBLEMS)
def solution(request: pytest.FixtureRequest) -> Solution:
    return solve(discretize(PROBLEMS[request.param])).raise_for_status()


def statement_of(solution: Solution) -> ContactProblem:
    assert solution.problem.origin is not None
    return solution.problem.origin


def test_loads_contact_and_reactions_are_in_equilibrium(solution: Solution) -> None:
    """Forces and moments of the whole body add up to zero."""
    problem = statement_of(solution)
    nodes = problem.mesh.nodes(problem.order)
    load = load_vector(problem.mesh, problem.order, problem.body_force, problem.tractions).reshape(nodes.shape)
    contact = sum(solution.on(name).force for name in problem.contact)
    held = sum(solution.reactions.values())
    size = np.abs(load).sum() + np.abs(contact).sum()
    assert set(solution.reactions) == set(problem.supports)
    np.testing.assert_allclose(load.sum(axis=0) + contact + held, 0.0, atol=1e-9 * size)
    np.testing.assert_allclose(nodal_contact_forces(solution.problem, solution.multiplier).sum(axis=0), contact)


def test_reactions_are_what_all_equations_leave(solution: Solution) -> None:
    """By the assembled matrix of all nodes: nothing is left but at nodes of supports."""
    problem = statement_of(solution)
    K = stiffness_matrix(problem.mesh, problem.material, problem.order)
    load = load_vector(problem.mesh, problem.order, problem.body_force, problem.tractions)
    left = K @ solution.displacement.ravel() - load
    left -= nodal_contact_forces(solution.problem, solution.multiplier).ravel()
    held = np.zeros(len(left), dtype=bool)
    for name in problem.supports:
        nodes = np.unique(problem.mesh.facet_nodes(problem.mesh.boundaries[name], problem.order))
        held.reshape(-1, problem.mesh.dim)[nodes] = True
    assert np.abs(left[~held]).max() < 1e-9 * np.abs(left).max()
    total = sum(solution.reactions.values())
    np.testing.assert_allclose(left.reshape(-1, problem.mesh.dim).sum(axis=0), total, atol=1e-9 * np.abs(left).sum())


def test_internal_forces_are_those_of_the_matrix(solution: Solution) -> None:
    problem = statement_of(solution)
    u = np.random.default_rng(0).normal(size=solution.displacement.shape)
    K = stiffness_matrix(problem.mesh, problem.material, problem.order)
    force = internal_forces(problem, u, np.arange(problem.mesh.number_of_cells))
    np.testing.assert_allclose(force.ravel(), K @ u.ravel(), atol=1e-12 * np.abs(force).max())


def test_rollers_push_along_their_normals() -> None:
    reactions = solve(discretize(PROBLEMS["turned rollers"])).reactions
    along = np.array([np.cos(0.3), np.sin(0.3)])
    for force in reactions.values():
        assert abs(force @ [-along[1], along[0]]) < 1e-12 * np.linalg.norm(force)


def test_a_shared_node_is_booked_to_the_support_named_first() -> None:
    """Both hold x at the corner; whoever comes first takes its force, the other the rest of its boundary."""
    first = PROBLEMS["roller and prescribed"]
    second = replace(first, supports=dict(reversed(first.supports.items())))
    one, other = (solve(discretize(problem)).reactions for problem in (first, second))
    assert list(one) == ["left", "top"]
    assert list(other) == ["top", "left"]
    moved = one["left"] - other["left"]
    assert abs(moved[0]) > 1e-3
    assert moved[1] == 0.0
    np.testing.assert_allclose(moved, other["top"] - one["top"], atol=1e-12)


def test_a_column_on_its_foundation() -> None:
    """Uniaxial strain under a pressed top: lambda + 2 mu = 12, by hand."""
    column = bodies.column(ThresholdCompliance(100.0), cells=(4, 2), size=(2.0, 1.0), top=Fixed(y=-0.1))
    solution = solve(discretize(column)).raise_for_status()
    bottom = solution.on("bottom")
    np.testing.assert_allclose(bottom.force, [0.0, 2.4], atol=1e-12)
    assert bottom.normal_force == pytest.approx(2.4)
    np.testing.assert_allclose(bottom.moment((0.0, 0.0)), 2.4, rtol=1e-12)
    np.testing.assert_allclose(bottom.moment((1.0, 5.0)), 0.0, atol=1e-12)
    expected = {"left": [0.4, 0.0], "right": [-0.4, 0.0], "top": [0.0, -2.4]}
    for name, force in expected.items():
        np.testing.assert_allclose(solution.reactions[name], force, atol=1e-12)


def test_a_support_that_finds_everything_fixed_takes_nothing() -> None:
    twice = replace(PLANE, supports={"left": Clamped(), "same": Clamped()}, mesh=replace(
        PLANE.mesh, boundaries={**PLANE.mesh.boundaries, "same": PLANE.mesh.boundaries["left"]}
    ))  # fmt: skip
    reactions = solve(discretize(twice)).reactions
    np.testing.assert_allclose(reactions["same"], 0.0)
    np.testing.assert_allclose(reactions["left"], solve(discretize(PLANE)).reactions["left"])


def test_reactions_of_another_load_are_refused() -> None:
    problem = discretize(PLANE)
    loaded = solve(problem.with_(load=2.0 * problem.load))
    with pytest.raises(ProblemError, match="stated load only"):
        _ = loaded.reactions
    with pytest.raises(ProblemError, match="made of arrays"):
        _ = solve(elastic_bar()).reactions


def test_reactions_without_contact() -> None:
    solution = solve(discretize(beam()))
    problem = statement_of(solution)
    load = load_vector(problem.mesh, problem.order, problem.body_force, problem.tractions)
    total = load.reshape(-1, problem.mesh.dim).sum(axis=0) + sum(solution.reactions.values())
    np.testing.assert_allclose(total, 0.0, atol=1e-9 * np.abs(load).sum())
    assert solution.reactions.keys() == problem.supports.keys()


def test_results_of_one_boundary(solution: Solution) -> None:
    contact = solution.problem.contact
    seen = np.concatenate([solution.on(name).index for name in contact.names])
    assert sorted(seen) == list(range(contact.count))
    for name in contact.names:
        part = solution.on(name)
        assert part.name == name
        for values, whole in (
            (part.penetration, solution.penetration), (part.slip, solution.slip), (part.pressure, solution.pressure),
            (part.friction, solution.friction), (part.weights, contact.weights),
            (part.normal_state, solution.normal_state), (part.tangential_state, solution.tangential_state),
            (part.points, contact.points), (part.normals, contact.frames[:, 0] if contact.frames is not None else None),
        ):  # fmt: skip
            assert whole is not None
            np.testing.assert_array_equal(values, whole[part.index])
        assert part.contact_length == pytest.approx(
            contact.weights[part.index] @ (part.normal_state != NormalState.OPEN)
        )
        assert part.normals is not None
        pushed = -part.pressure[:, None] * part.normals
        np.testing.assert_allclose(part.tractions, pushed + part.friction_vectors, atol=1e-14)
        np.testing.assert_allclose(np.einsum("pd,pd->p", part.slip_vectors, part.normals), 0.0, atol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(part.slip_vectors, axis=1), np.linalg.norm(part.slip, axis=1))
        opposed = np.einsum("pd,pd->p", part.slip_vectors, part.friction_vectors)
        assert opposed.max() <= 1e-12 * np.abs(part.slip).max() * np.abs(part.friction).max()
        np.testing.assert_allclose(part.force, part.weights @ (pushed + part.friction_vectors), atol=1e-14)
        np.testing.assert_allclose(part.friction_force, part.weights @ part.friction, atol=1e-14)


def test_moments_in_the_plane() -> None:
    part = solve(discretize(PROBLEMS["components"])).on("bottom")
    assert part.points is not None
    arms, forces = (
        np.pad(values, ((0, 0), (0, 1))) for values in (part.points, part.weights[:, None] * part.tractions)
    )
    assert np.abs(forces[:, 0]).max() > 1e-3
    np.testing.assert_allclose(part.moment((0.0, 0.0)), np.cross(arms, forces).sum(axis=0)[2], rtol=1e-12)


def test_moments_in_space() -> None:
    part = solve(discretize(CUBE)).on("bottom")
    assert part.points is not None
    expected = sum(np.cross(x, w * t) for x, w, t in zip(part.points, part.weights, part.tractions, strict=True))
    np.testing.assert_allclose(part.moment((0.0, 0.0, 0.0)), expected)
    shifted = expected - np.cross([1.0, 2.0, 3.0], part.force)
    np.testing.assert_allclose(part.moment((1.0, 2.0, 3.0)), shifted)


def test_an_unknown_boundary_is_named_with_the_known_ones() -> None:
    solution = solve(discretize(PLANE))
    with pytest.raises(ProblemError, match=r"'botom' \(known: 'bottom'\)"):
        solution.on("botom")
    with pytest.raises(ProblemError, match="known: none"):
        solve(elastic_bar()).on("bottom")


def test_contact_table(solution: Solution) -> None:
    table = solution.contact_table
    contact = solution.problem.contact
    assert table.shape == (contact.count,)
    assert table["boundary"].tolist() == [contact.names[k] for k in contact.boundary]
    np.testing.assert_array_equal(table["x"], contact.points)
    np.testing.assert_array_equal(table["pressure"], solution.pressure)
    np.testing.assert_array_equal(table["friction"], np.squeeze(solution.friction, axis=1) if contact.components == 2
                                  else solution.friction)  # fmt: skip
    np.testing.assert_array_equal(table["gap"], solution.gap)
    for kind, name in ((NormalState, "normal_state"), (TangentialState, "tangential_state")):
        assert [kind[state.upper()] for state in table[name]] == getattr(solution, name).tolist()
    for name in contact.names:
        np.testing.assert_allclose(table["force"][table["boundary"] == name].sum(axis=0), solution.on(name).force)
    with pytest.raises(ValueError, match="read-only"):
        table["pressure"][0] = 1.0


def test_contact_table_of_arrays() -> None:
    bar = solve(elastic_bar())
    states = ("normal_state", "tangential_state")
    assert bar.contact_table.dtype.names == ("x", "weight", "gap", "penetration", "pressure", *states)
    assert bar.contact_table["tangential_state"].tolist() == ["free"] * bar.contact.count
    assert bar.contact_table["pressure"].tolist() == bar.pressure.tolist()
