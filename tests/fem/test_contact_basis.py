"""Contact of quadratic tetrahedra: positive weights, rows that select, patch tests, and the linear elements below."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete.contact import selects
from hemivar.fem.contact_basis import contact_shapes, lagrange_moments, seen_values
from hemivar.fem.contact_points import shares
from hemivar.fem.hierarchy import coarser
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.reactions import nodal_contact_forces
from tests.fem.test_mortar import blocks, turned

PRESSURE, YOUNG = 10.0, 1000.0


def pressed_cube(law: hv.laws.Superpotential, degrees: float = 0.0, order: int = 2) -> hv.ContactProblem:
    """A unit cube, pressed from above on a foundation."""
    return hv.ContactProblem(
        turned(hv.box((1.0, 1.0, 1.0), 2), degrees),
        hv.Material.young(YOUNG, 0.3),
        {"bottom": hv.Contact(law)},
        {"left": hv.Roller(), "front": hv.Roller()},
        tractions={"top": hv.Pressure(PRESSURE)},
        order=order,
    )


def own_axes(points: Array, degrees: float) -> Array:
    """Vectors in the axes of the cube before it was turned."""
    return points @ turned(hv.Mesh(np.eye(4, 3, -1), [[0, 1, 2, 3]]), degrees).points[1:].T


def test_integrals_of_the_functions_are_positive_and_values_of_linear_fields_stay() -> None:
    barycentric, weights = quadrature_rule(2, 2)
    shapes = contact_shapes(2, barycentric)
    np.testing.assert_allclose(weights @ shapes, [2 / 15] * 3 + [1 / 5] * 3, rtol=1e-13)
    np.testing.assert_allclose(shapes.sum(axis=1), 1.0, rtol=1e-13)
    lagrange = hv.fem.elements.shape_values(2, barycentric)
    np.testing.assert_allclose(weights @ lagrange, shares(2, 3), atol=1e-15)
    np.testing.assert_allclose(lagrange_moments(weights @ shapes), weights @ lagrange, atol=1e-15)
    mesh = hv.box((1.0, 2.0, 3.0), 1)
    nodes = mesh.nodes(2)
    seen = seen_values(mesh, 2, np.arange(len(nodes)))
    np.testing.assert_allclose(seen @ nodes, nodes, atol=1e-15)
    # the field by its new values and functions is the field by its nodal values
    facet = mesh.facet_nodes(mesh.boundary_facets[:1], 2)[0]
    field = np.sin(3.0 * nodes[:, 0]) + nodes[:, 1] ** 2 - nodes[:, 2] ** 3
    np.testing.assert_allclose(shapes @ (seen @ field)[facet], lagrange @ field[facet], rtol=1e-12)


@pytest.mark.parametrize("degrees", [0.0, 30.0])
@pytest.mark.parametrize("law", [hv.Signorini(), hv.Compliance(500.0)], ids=["rigid", "springs"])
def test_uniform_pressure_is_exact_on_a_foundation(law: hv.laws.Superpotential, degrees: float) -> None:
    problem = pressed_cube(law, degrees)
    solution = hv.solve(problem).raise_for_status()
    contact = solution.problem.contact
    assert selects(contact.trace)
    assert contact.weights.sum() == pytest.approx(1.0, rel=1e-13)
    assert contact.weights.min() == pytest.approx(2 / 15 / 8, rel=1e-12)  # of a corner with one facet
    x = own_axes(problem.mesh.nodes(2), degrees)
    sunk = 0.0 if isinstance(law, hv.Signorini) else PRESSURE / 500.0
    sides, down = 0.3 * PRESSURE / YOUNG, PRESSURE / YOUNG
    expected = np.column_stack([sides * x[:, 0], sides * x[:, 1], -down * x[:, 2] - sunk])
    np.testing.assert_allclose(own_axes(solution.displacement, degrees), expected, atol=1e-12 * (down + sunk))
    np.testing.assert_allclose(solution.pressure, PRESSURE, rtol=1e-11)
    # forces on the nodes are those of a uniform traction: nothing at corners, a third of each triangle at middles
    forces = own_axes(nodal_contact_forces(solution.problem, solution.multiplier), degrees)
    low, vertex = np.abs(x[:, 2]) < 1e-9, np.arange(len(x)) < problem.mesh.number_of_nodes
    np.testing.assert_allclose(forces[low & vertex, 2], 0.0, atol=1e-11)
    assert forces[low & ~vertex, 2].sum() == pytest.approx(PRESSURE, rel=1e-12)


@pytest.mark.parametrize("slave", ["u:bottom", "l:top"])
def test_weights_of_a_master_that_covers_little_are_those_of_what_it_covers(slave: str) -> None:
    """Corner functions are negative near the other edges; a node with such a weight hands its part on."""
    upper = hv.box((0.6, 0.6, 1.0), (2, 2, 1), origin=(0.13, 0.21, 1.0))
    mesh = hv.Mesh.assembled({"u": upper, "l": hv.box((1.0, 1.0, 1.0), (3, 2, 1))})
    contact = hv.Contact(hv.Signorini(), against="l:top", slave=slave)
    problem = hv.ContactProblem(
        mesh, hv.Material.young(YOUNG, 0.3), {"u:bottom": contact}, {"l:bottom": hv.Clamped(), "u:top": hv.Clamped()},
        order=2,
    )  # fmt: skip
    weights = hv.discretize(problem).contact.weights
    assert weights.min() > 0.0
    assert weights.sum() == pytest.approx(0.36, rel=1e-12)


def test_a_pair_on_meshes_that_do_not_match_selects_its_jumps() -> None:
    mesh = blocks((2, 3, 1), (3, 2, 1))
    law = hv.Contact(hv.Signorini(), hv.Tresca(0.1), against="l:top")
    held = {"l:bottom": hv.Clamped(), "u:top": hv.Clamped()}
    found = hv.discretize(hv.ContactProblem(mesh, hv.Material.young(YOUNG, 0.3), {"u:bottom": law}, held, order=2))
    assert selects(found.contact.trace)


def test_rows_that_see_one_node_along_one_direction_take_unknowns_of_different_nodes() -> None:
    """Rollers on both bodies of a turned pair: the jump along them sees the master alone, through several rows."""
    rng = np.random.default_rng(3)
    mesh = blocks((2, 3, 2), (3, 2, 1))
    points = mesh.points.copy()
    inside = ((points[:, :2] > 1e-9) & (points[:, :2] < 1.0 - 1e-9)).all(axis=1)
    points[inside, :2] += rng.uniform(-0.05, 0.05, (inside.sum(), 2))
    mesh = turned(hv.Mesh(points, mesh.cells, mesh.boundaries, mesh.regions), 25.0)
    for order, slave in ((1, "u:bottom"), (1, "l:top"), (2, "u:bottom"), (2, "l:top")):
        contact = hv.Contact(hv.Signorini(), against="l:top", slave=slave)
        held = {"l:bottom": hv.Roller()} | {f"{one}:{side}": hv.Roller() for one in "ul" for side in ("left", "front")}
        problem = hv.ContactProblem(
            mesh, hv.Material.young(YOUNG, 0.3), {"u:bottom": contact}, held, order=order,
            tractions={"u:top": hv.Pressure(PRESSURE)},
        )  # fmt: skip
        np.testing.assert_allclose(hv.solve(problem).pressure, PRESSURE, rtol=1e-10)


def bowl(x: Array) -> Array:
    """A gap of degree 2."""
    return -0.02 - 0.03 * (x[:, 0] - 0.4) ** 2 + 0.01 * x[:, 0] * x[:, 1]


BARREL = hv.mechanics.Cylinder((0.5, 0.5, -49.98), (0.0, 1.0, 0.0), 50.0)


@pytest.mark.parametrize(
    "contact",
    [
        hv.Contact(hv.Signorini(), gap=bowl),
        hv.Contact(hv.Signorini(), obstacle=BARREL, normals=hv.mechanics.Normals.BODY),
        hv.Contact(hv.Signorini(), obstacle=BARREL),
    ],
    ids=["gap", "along the normals of the body", "along those of the obstacle"],
)
@pytest.mark.parametrize("method", ["newton", "multigrid"])
def test_full_contact_on_a_curved_foundation_leaves_no_overlap_at_nodes(contact: hv.Contact, method: str) -> None:
    problem = replace(
        pressed_cube(hv.Signorini()), contact={"bottom": contact}, supports={"top": hv.Clamped()}, tractions={}
    )
    solution = hv.solve(problem, hv.solvers.METHODS[method], controls=hv.Controls(rtol=1e-11)).raise_for_status()
    assert (solution.pressure > 0.0).all()
    points, normals = solution.contact.points, solution.on("bottom").normals
    assert points is not None
    assert normals is not None
    gap = bowl(points)
    if contact.obstacle is not None:
        along = contact.normals is hv.mechanics.Normals.BODY
        gap = BARREL.along(points, normals) if along else BARREL.distance(points)
    moved = np.einsum("kd,kd->k", normals, solution.displacement[solution.contact.node])
    turn = np.ptp(normals[:, 0]) / 4.0  # of the normals along half an edge, with which a shift along them counts
    np.testing.assert_allclose(moved, gap, atol=1e-13 + turn * np.abs(solution.displacement[:, 0]).max())
    np.testing.assert_allclose(solution.gap, gap, atol=1e-13)
    assert np.abs(solution.penetration).max() < 1e-13


def test_full_contact_of_two_bodies_with_a_stated_curved_gap_leaves_no_overlap_at_nodes() -> None:
    contact = hv.Contact(hv.Signorini(), gap=bowl, against="l:top")
    held = {"l:bottom": hv.Clamped(), "u:top": hv.Clamped()}
    problem = hv.ContactProblem(
        blocks((2, 2, 1), (2, 2, 1)), hv.Material.young(YOUNG, 0.3), {"u:bottom": contact}, held, order=2
    )
    solution = hv.solve(problem).raise_for_status()
    assert (solution.pressure > 0.0).all()
    nodes, own = problem.mesh.nodes(2), solution.contact.node
    same = np.linalg.norm(nodes[:, None] - nodes[own], axis=2) < 1e-9
    same[own, np.arange(own.size)] = False
    other = same.argmax(axis=0)
    overlap = solution.displacement[other, 2] - solution.displacement[own, 2] - bowl(nodes[own])
    assert np.abs(overlap).max() < 1e-12


def test_a_curved_gap_keeps_the_order() -> None:
    """A layer without shear on a wave: energies of the uniform part and of the wave in closed form."""
    k, wave, depth = np.pi, 0.003, 0.02
    plane, confined = YOUNG / (1.0 - 0.3**2), YOUNG * 0.7 / (1.3 * 0.4)
    stiffness = plane * k / 2.0 * (np.sinh(2.0 * k) + 2.0 * k) / (2.0 * np.sinh(k) ** 2)
    known = 0.25 * (confined * depth**2 / 2.0 + stiffness * wave**2 / 4.0)
    contact = hv.Contact(hv.Signorini(), gap=lambda x: -depth + wave * np.cos(k * x[:, 0]))
    rollers = {side: hv.Roller() for side in ("top", "left", "right", "front", "back")}
    errors = []
    for cells in (2, 4, 8):
        mesh = hv.box((1.0, 0.25, 1.0), (cells, 1, cells))
        problem = hv.ContactProblem(mesh, hv.Material.young(YOUNG, 0.3), {"bottom": contact}, rollers, order=2)
        errors.append(hv.solve(problem).energy - known)
    assert np.log2(errors[0] / errors[1]) > 3.0
    assert np.log2(errors[1] / errors[2]) > 3.3


@pytest.mark.parametrize("high", [1e-3, 1e6])
def test_a_step_of_the_gap_is_no_interference(high: float) -> None:
    contact = {"bottom": hv.Contact(hv.Signorini(), gap=lambda x: np.where(x[:, 0] < 0.6, 0.0, high))}
    problem = hv.discretize(replace(pressed_cube(hv.Signorini()), contact=contact))
    assert set(problem.gap) == {0.0, high}


def test_held_nodes_at_a_curved_foundation_do_not_overlap_it_between_them() -> None:
    """The gap touches at the middle of an edge that is clamped."""
    contact = {"bottom": hv.Contact(hv.Signorini(), gap=lambda x: (x[:, 1] - 0.25) ** 2)}
    hv.discretize(replace(pressed_cube(hv.Signorini()), contact=contact, supports={"left": hv.Clamped()}))


def test_penetration_is_that_of_nodes() -> None:
    contact = {"bottom": hv.Contact(hv.Compliance(50.0), gap=bowl)}
    solution = hv.solve(replace(pressed_cube(hv.Signorini()), contact=contact))
    points, node = solution.contact.points, solution.contact.node
    assert points is not None
    depth = -solution.displacement[node, 2] - bowl(points)
    assert np.abs(solution.local[:, 0] - depth).max() > 1e-6
    np.testing.assert_allclose(solution.penetration, depth, atol=1e-13)
    np.testing.assert_allclose(solution.on("bottom").penetration, depth, atol=1e-13)


def test_methods_agree() -> None:
    """By multigrid, with linear elements below, and by condensation."""
    contact = {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(2.0))}
    problem = hv.discretize(replace(pressed_cube(hv.Signorini()), contact=contact, body_force=(80.0, 30.0, 0.0)))
    tight = hv.Controls(rtol=1e-11)
    one, other = (hv.solve(problem, hv.solvers.METHODS[name], controls=tight) for name in ("multigrid", "newton"))
    off = np.abs(one.unknowns - other.unknowns).max()
    assert off < 1e-8 * np.abs(other.unknowns).max()
    assert (one.pressure > 0.0).any()
    assert (one.pressure == 0.0).any()


def test_linear_elements_stand_below() -> None:
    """A linear field is the same on both, its contact too; what a mesh has below comes next."""
    problem = hv.discretize(pressed_cube(hv.Signorini()))
    step = coarser(problem)
    assert step is not None
    assert step.problem.field is not None
    assert step.problem.field.order == 1
    assert step.problem.field.mesh is problem.field.mesh  # type: ignore[union-attr]
    x = problem.field.mesh.points  # type: ignore[union-attr]
    u = step.problem.field.restrict(x * [0.02, 0.03, -0.01])
    fine = step.interpolate(u)
    np.testing.assert_allclose(fine, step.prolongation @ u, atol=1e-15)
    np.testing.assert_allclose(step.restrict(fine), u, atol=1e-15)
    coarse, found = step.problem.local(u), problem.local(fine)[step.shared]
    np.testing.assert_allclose(found, coarse, atol=1e-14)
    energy = 0.5 * fine @ (problem.stiffness @ fine)
    assert 0.5 * u @ (step.problem.stiffness @ u) == pytest.approx(energy, rel=1e-12)


def test_arcs_that_touch_at_the_middle_of_an_edge_do_not_overlap() -> None:
    """Means of a parabola are below its values there, and are not taken for an interference."""
    flat = hv.box((0.9, 0.9, 0.3), (3, 3, 1), origin=(-0.45, -0.45, 0.0))
    height = 0.5 * (flat.points[:, :2] ** 2).sum(axis=1)
    points = flat.points + np.column_stack([np.zeros((len(height), 2)), height])
    round_ = hv.Mesh(points, flat.cells, flat.boundaries, flat.regions)
    mesh = hv.Mesh.assembled({"u": round_, "l": hv.box((2.0, 2.0, 1.0), 4, origin=(-1.0, -1.0, -1.0))})
    contact = {"u:bottom": hv.Contact(hv.Signorini(), against="l:top")}
    held = {"l:bottom": hv.Clamped(), "u:top": hv.Clamped()}
    problem = hv.ContactProblem(mesh, hv.Material.young(YOUNG, 0.3), contact, held, order=2)
    found = hv.discretize(problem)
    lowest = 0.5 * 2 * 0.15**2
    assert found.gap.min() < -0.4 * lowest
    assert not [said for said in found.warnings if "overlap" in said]


def test_cycles_are_about_those_of_linear_elements_of_the_same_nodes() -> None:
    contact = {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.5))}
    counts = []
    for cells, order in ((4, 2), (8, 1)):
        mesh, held = hv.box((1.0, 1.0, 1.0), cells), {"left": hv.Clamped()}
        problem = hv.ContactProblem(
            mesh, hv.Material.young(YOUNG, 0.3), contact, held, body_force=(1.0, 0.5, -10.0), order=order
        )
        solution = hv.solve(problem, "multigrid")
        assert solution.status is hv.Status.CONVERGED
        counts.append(solution.evaluations)
    assert counts[0] <= 1.5 * counts[1]


def test_a_curved_support_beside_contact_holds_middles_of_edges() -> None:
    """Rollers along a curve hold ends and middle of an edge along different directions: no row sees the ends alone."""
    flat = hv.box((1.0, 1.0, 1.0), (2, 4, 2))
    points = flat.points.copy()
    points[:, 0] -= 0.3 * np.cos(2.0 * (points[:, 1] - 0.5)) * (1.0 - points[:, 0])
    mesh = hv.Mesh(points, flat.cells, flat.boundaries)
    contact = {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(1.0))}
    problem = hv.discretize(
        hv.ContactProblem(
            mesh, hv.Material.young(YOUNG, 0.3), contact, {"left": hv.Roller()}, tractions={"top": (3.0, 0.0, -10.0)},
            order=2,
        )
    )  # fmt: skip
    assert selects(problem.contact.trace)
    one, other = (hv.solve(problem, name, controls=hv.Controls(rtol=1e-11)) for name in ("newton", "multigrid"))
    np.testing.assert_allclose(one.unknowns, other.unknowns, atol=1e-8 * np.abs(one.unknowns).max())


@pytest.mark.parametrize("slave", ["u:bottom", "l:top"])
def test_jumps_in_a_circle_leave_all_others_selected(slave: str) -> None:
    """A foundation on the master takes unknowns at the joint; the few jumps that then see one another stay means."""
    mesh, rigid = hv.Mesh.assembled({
        "u": hv.box((1.0, 1.0, 1.0), (2, 3, 1), origin=(0.0, 0.0, 1.0)),
        "l": hv.box((1.0, 1.0, 1.0), (3, 2, 1)),
    }), hv.Signorini()  # fmt: skip
    contact = {"u:bottom": hv.Contact(rigid, against="l:top", slave=slave), "l:left": hv.Contact(hv.Compliance(100.0))}
    contact |= {"u:left": hv.Contact(rigid), "l:bottom": hv.Contact(rigid)}
    held = {"u:front": hv.Roller(), "l:front": hv.Roller(), "u:right": hv.Clamped()}
    problem = hv.ContactProblem(mesh, hv.Material.young(YOUNG, 0.3), contact, held, order=2)
    trace = hv.discretize(problem).contact.trace
    assert np.count_nonzero(np.diff(trace.indptr) > 1) <= 5
