"""From the statement to the discrete problem, verified on problems with known answers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from hemivar import gallery
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import discretize, interpolate, stress, v_norm
from hemivar.laws import Bilateral, Compliance, NoContact, Signorini, ThresholdCompliance, Tresca
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
)
from hemivar.mesh import Mesh, rectangle
from tests import bodies

from ..mesh.meshes import cube, distorted

SURVEY = Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.5))


def survey_problem(cells: int = 8, **options: Any) -> ContactProblem:
    data = {
        "mesh": rectangle((1.0, 1.0), cells),
        "material": Material.lame(4.0, 4.0),
        "contact": {"bottom": SURVEY},
        "supports": {"left": Clamped()},
        "body_force": (-0.8, -0.8),
    }
    return ContactProblem(**(data | options))


def solve_linear(discrete: DiscreteProblem, spring: float = 0.0) -> np.ndarray:
    """Solution with the law 1/2 spring r_nu^2 in place of the problem's own; the full field."""
    normal = sp.csr_array(discrete.contact.trace[:: discrete.contact.components]) if discrete.contact_points else None
    K, f = discrete.stiffness, discrete.load
    if normal is not None and spring:
        weights = sp.diags_array(spring * discrete.contact.weights)
        K = K + normal.T @ weights @ normal
        f = f + normal.T @ (weights @ discrete.gap)
    u = sla.spsolve(sp.csc_array(K), f)
    assert discrete.field is not None
    return discrete.field.full(u)


def at(problem: ContactProblem, field: np.ndarray, point: tuple[float, ...]) -> np.ndarray:
    return interpolate(problem.mesh, field, np.array([point]))[0]


# ---- known answers -----------------------------------------------------------------------------------------


def test_nothing_is_computed_that_nobody_asked_for() -> None:
    """Sums of rows read the whole matrix, on every level."""
    assert "row_sums" not in vars(discretize(gallery.survey("5.1", 4)).bulk)


def test_clamped_rectangle() -> None:
    problem = bodies.strip(cells=(5, 2), pattern="cross", size=(2.5, 1.0), body_force=(0.0, 0.2))
    u = solve_linear(discretize(problem))
    np.testing.assert_allclose(at(problem, u, (0.5, 0.0)), [0.11787841, 0.1252073], atol=1e-7)
    np.testing.assert_allclose(at(problem, u, (2.5, 0.0)), [0.24898703, 1.07004206], atol=1e-7)


def all_round(mesh: Mesh) -> Mesh:
    return mesh.with_boundaries({"all": mesh.boundary_facets})


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_patch(dim: int, order: int) -> None:
    mesh = all_round(distorted(rectangle((1, 1), 4, "cross") if dim == 2 else cube(3)))
    gradient = np.random.default_rng(5).standard_normal((dim, dim))
    problem = ContactProblem(
        mesh, Material.young(3.0, 0.3), supports={"all": Prescribed(lambda x: x @ gradient.T)}, order=order
    )
    u = solve_linear(discretize(problem))
    np.testing.assert_allclose(u, mesh.nodes(order) @ gradient.T, atol=1e-12)


def test_order_two_is_exact_on_quadratic_fields() -> None:
    mesh = all_round(distorted(rectangle((1, 1), 4, "cross")))

    def exact(x: np.ndarray) -> np.ndarray:
        return np.column_stack([x[:, 0] ** 2 + x[:, 0] * x[:, 1], x[:, 1] ** 2 - 3 * x[:, 0] * x[:, 1]])

    # -div sigma, with lam = 3, mu = 2: div u = 2x + y + 2y - 3x, lap u = (2, 2)
    force = (-(5.0 * -1.0 + 2.0 * 2.0), -(5.0 * 3.0 + 2.0 * 2.0))
    problem = ContactProblem(
        mesh, Material.lame(3.0, 2.0), supports={"all": Prescribed(exact)}, body_force=force, order=2
    )
    u = solve_linear(discretize(problem))
    np.testing.assert_allclose(u, exact(mesh.nodes(2)), atol=1e-12)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_uniaxial_tension(plane: str, order: int) -> None:
    E, nu = 5.0, 0.3
    problem = bodies.strip(
        cells=(4, 2),
        material=Material.young(E, nu, plane),
        supports={"left": Roller(), "bottom": Roller()},
        tractions={"right": (0.1, 0.0)},
        order=order,
    )
    u = solve_linear(discretize(problem))
    along, across = (1 / E, -nu / E) if plane == "stress" else ((1 - nu**2) / E, -nu * (1 + nu) / E)
    np.testing.assert_allclose(u, problem.mesh.nodes(order) * [0.1 * along, 0.1 * across], atol=1e-13)


@pytest.mark.parametrize(
    ("order", "quadrature", "rate"),
    [
        (1, Quadrature.NODAL, 0.95),
        (1, Quadrature.MIDPOINT, 0.95),
        (2, Quadrature.NODAL, 1.9),
        (2, Quadrature.MIDPOINT, 1.4),
    ],
)
def test_spring_foundation(order: int, quadrature: Quadrature, rate: float) -> None:
    """A manufactured solution on a linear spring foundation converges at the order of the elements."""
    lam, mu = 3.0, 2.0

    def exact(x: np.ndarray) -> np.ndarray:
        return 0.05 * np.column_stack([2 * x[:, 0] * x[:, 1] + x[:, 0] * x[:, 1] ** 2, -(x[:, 0] ** 2) * (1 + x[:, 1])])

    def sigma(x: np.ndarray) -> np.ndarray:
        xx, yy = 0.05 * (2 * x[:, 1] + x[:, 1] ** 2), -0.05 * x[:, 0] ** 2
        result = np.zeros((len(x), 2, 2))
        result[:, 0, 0] = (lam + 2 * mu) * xx + lam * yy
        result[:, 1, 1] = (lam + 2 * mu) * yy + lam * xx
        return result

    errors = []
    for cells in (8, 16):
        problem = bodies.strip(
            Compliance(lam + 2 * mu),
            (2 * cells, cells),
            lame=(lam, mu),
            body_force=lambda x: 0.1 * lam * np.column_stack([x[:, 0], -(1 + x[:, 1])]),
            tractions={"right": lambda x: sigma(x)[:, :, 0], "top": lambda x: sigma(x)[:, :, 1]},
            order=order,
            quadrature=quadrature,
        )
        u = solve_linear(discretize(problem), lam + 2 * mu)
        fine = problem.mesh.refined(2)
        errors.append(v_norm(fine, interpolate(problem.mesh, u, fine.nodes(2)) - exact(fine.nodes(2))))
    assert math.log2(errors[0] / errors[1]) > rate
    assert errors[1] < 0.02


@pytest.mark.parametrize("order", [1, 2])
def test_block_pressed_by_its_top(order: int) -> None:
    """Top moved down by D on the survey's foundation: the closed form satisfies the discrete equations."""
    D, q, p, M = 0.1, 0.3, 2.0, 12.0
    problem = bodies.column(ThresholdCompliance(q, p), cells=4, top=Fixed(y=-D), order=order)
    discrete = discretize(problem)
    s = (M * D - q) / (M + p)
    assert math.isclose(s, 0.9 / 14)
    nodes = problem.mesh.nodes(order)
    exact = np.column_stack([np.zeros(len(nodes)), -s - (D - s) * nodes[:, 1]])
    u = discrete.field.restrict(exact)
    np.testing.assert_allclose(discrete.field.full(u), exact, atol=1e-15)
    np.testing.assert_allclose(discrete.local(u)[:, 0], s)
    multiplier = np.zeros((discrete.contact_points, 2))
    multiplier[:, 0] = q + p * s
    residual = discrete.stiffness @ u + discrete.contact_force(multiplier) - discrete.load
    assert np.abs(residual).max() < 1e-13
    assert math.isclose(discrete.energy(u), 0.5 * M * (D - s) ** 2 + q * s + 0.5 * p * s**2)


def test_zero_poisson_block() -> None:
    """A block with nu = 0 pressed onto springs carries a uniform pressure to round-off."""
    problem = ContactProblem(
        distorted(cube(3)),
        Material.young(10.0, 0.0),
        contact={"bottom": Contact(Compliance(5.0), Tresca(0.1))},
        supports={"left": Roller(), "front": Roller(), "top": Fixed(z=-0.3)},
    )
    discrete = discretize(problem)
    u = solve_linear(discrete, 5.0)
    # springs in a row: pressure = 0.3 / (1/5 + 1/10)
    np.testing.assert_allclose(u[:, 2], -0.2 - 0.1 * problem.mesh.points[:, 2], atol=1e-13)
    np.testing.assert_allclose(stress(problem, u)[:, 2, 2], -1.0, atol=1e-12)


# ---- structure ---------------------------------------------------------------------------------------------


def test_trace_selects_unknowns() -> None:
    discrete = discretize(survey_problem(8))
    assert (discrete.unknowns, discrete.contact_points, discrete.contact.components) == (2 * 72, 8, 2)
    assert discrete.contact.trace.nnz == 16
    assert set(discrete.contact.trace.data) == {1.0}
    assert (np.diff(discrete.contact.trace.indptr) == 1).all()
    np.testing.assert_allclose(discrete.contact.weights, [*[1 / 8] * 7, 1 / 16])
    np.testing.assert_allclose(discrete.contact.frames, np.broadcast_to([[0, -1], [1, 0]], (8, 2, 2)), atol=0)
    np.testing.assert_allclose(discrete.contact.points[:, 0], np.arange(1, 9) / 8)


def test_simpson_weights() -> None:
    discrete = discretize(survey_problem(2, order=2))
    np.testing.assert_allclose(
        discrete.contact.points[np.argsort(discrete.contact.points[:, 0]), 0], [0.25, 0.5, 0.75, 1.0]
    )
    order = np.argsort(discrete.contact.points[:, 0])
    np.testing.assert_allclose(discrete.contact.weights[order], [1 / 3, 1 / 6, 1 / 3, 1 / 12])
    assert set(discrete.contact.trace.data) == {1.0}


@pytest.mark.parametrize(("order", "share"), [(1, 1 / 8), (2, 1 / 24)])
def test_midpoints(order: int, share: float) -> None:
    problem = survey_problem(4, order=order, quadrature=Quadrature.MIDPOINT)
    discrete = discretize(problem)
    np.testing.assert_allclose(discrete.contact.points[:, 0], [0.125, 0.375, 0.625, 0.875])
    np.testing.assert_allclose(discrete.contact.weights, 0.25)
    nodes = problem.mesh.nodes(order)
    u = discrete.field.restrict(nodes[:, :1] * [0.3, -0.2])
    np.testing.assert_allclose(discrete.local(u), discrete.contact.points[:, :1] * [0.2, 0.3])
    assert math.isclose(discrete.contact_force(np.tile([1.0, 0.0], (4, 1))).sum(), -1.0 + share)


def test_midpoints_are_for_plane_bodies() -> None:
    body = ContactProblem(cube(2), Material.lame(1, 1), {}, {"top": Clamped()}, quadrature=Quadrature.MIDPOINT)
    assert discretize(body).contact_points == 0
    with pytest.raises(ProblemError, match=r"twice as many facets.*take Quadrature\.NODAL"):
        replace(body, contact={"bottom": SURVEY})


@pytest.mark.parametrize("order", [1, 2])
def test_basis_is_orthonormal(order: int) -> None:
    mesh = rectangle((1, 1), 4).rotated(0.3)
    discrete = discretize(survey_problem(mesh=mesh, supports={"left": Roller(), "right": Clamped()}, order=order))
    P = discrete.field.basis
    assert abs(P.T @ P - sp.eye(discrete.unknowns)).max() < 1e-14
    assert np.abs(P.T @ discrete.field.prescribed).max() == 0.0
    normal = discrete.contact.frames[:, 0]
    np.testing.assert_allclose(normal, np.broadcast_to([math.sin(0.3), -math.cos(0.3)], normal.shape))


@pytest.mark.parametrize("order", [1, 2])
def test_rotated_problem_is_the_same_problem(order: int) -> None:
    angle = math.pi / 6
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    force, pull, D = np.array([0.3, -0.8]), np.array([0.2, 0.1]), np.array([0.05, -0.1])

    def make(mesh: Mesh, Q: np.ndarray) -> DiscreteProblem:
        return discretize(
            survey_problem(
                mesh=mesh,
                supports={"left": Roller(), "top": Prescribed(Q @ D)} | {},
                body_force=Q @ force,
                tractions={"right": Q @ pull},
                order=order,
            )
        )

    mesh = rectangle((1.0, 1.0), (4, 4), "cross")
    with pytest.raises(ProblemError, match="'left' and 'top' prescribe different"):
        make(mesh, np.eye(2))
    D = np.array([0.0, -0.1])
    plain, turned = make(mesh, np.eye(2)), make(mesh.rotated(angle), turn)
    assert plain.unknowns == turned.unknowns
    for spring in (0.0, 3.0):
        u, v = solve_linear(plain, spring), solve_linear(turned, spring)
        np.testing.assert_allclose(v, u @ turn.T, atol=1e-13)
        first, second = plain.energy(plain.field.restrict(u)), turned.energy(turned.field.restrict(v))
        assert math.isclose(first, second, rel_tol=1e-12)


def test_energy_is_the_energy_of_the_full_field() -> None:
    """Reduced energy, prescribed part and dropped points included, against the plain formula."""
    from hemivar.fem.assembly import load_vector, stiffness_matrix

    problem = survey_problem(
        4, supports={"left": Prescribed(lambda x: np.column_stack([0.1 * x[:, 1], -0.2 + 0 * x[:, 1]]))}
    )
    discrete = discretize(problem)
    assert discrete.contact_points == 4
    z = np.random.default_rng(0).standard_normal(discrete.unknowns)
    U = discrete.field.full(z)
    K = stiffness_matrix(problem.mesh, problem.material)
    F = load_vector(problem.mesh, 1, problem.body_force)
    bottom = U[:5]
    weights = np.array([1, 2, 2, 2, 1]) / 8
    law = SURVEY.law.at(None)
    contact = weights @ law.value(np.column_stack([-bottom[:, 1], bottom[:, 0]]))
    assert math.isclose(discrete.energy(z), 0.5 * U.ravel() @ K @ U.ravel() - F @ U.ravel() + contact)


def test_gap_function() -> None:
    problem = survey_problem(4, contact={"bottom": Contact(Signorini(), gap=lambda x: 0.1 * x[:, 0] ** 2)})
    discrete = discretize(problem)
    np.testing.assert_allclose(discrete.gap, 0.1 * discrete.contact.points[:, 0] ** 2)


def test_array_parameters_follow_dropped_points() -> None:
    bound = np.arange(1.0, 6.0)
    discrete = discretize(survey_problem(4, contact={"bottom": Contact(ThresholdCompliance(bound), Tresca(bound))}))
    r = np.zeros((4, 2))
    r[:, 1] = 1.0
    np.testing.assert_allclose(discrete.law.value(r), [2, 3, 4, 5])


def test_roller_across_the_contact_boundary() -> None:
    """The corner keeps its normal freedom; its fixed tangential row is zero."""
    discrete = discretize(survey_problem(4, supports={"left": Roller()}))
    corner = int(np.argmin(discrete.contact.points[:, 0]))
    assert discrete.contact_points == 5
    assert discrete.contact.trace[[2 * corner]].nnz == 1
    assert discrete.contact.trace[[2 * corner + 1]].nnz == 0


def test_roller_along_the_contact_boundary() -> None:
    """Bilateral contact by a roller: normal rows are zero, friction remains."""
    discrete = discretize(survey_problem(4, supports={"bottom": Roller(), "left": Clamped()}))
    assert discrete.contact_points == 4
    assert np.diff(discrete.contact.trace.indptr).reshape(-1, 2).tolist() == [[0, 1]] * 4


def test_sliding_support_enters_the_slip() -> None:
    discrete = discretize(survey_problem(4, supports={"left": Fixed(x=0.2)}))
    corner = int(np.argmin(discrete.contact.points[:, 0]))
    z = np.zeros(discrete.unknowns)
    np.testing.assert_allclose(discrete.local(z)[corner], [0.0, 0.2])
    np.testing.assert_allclose(discrete.offset[:, 1:][corner], -0.2)


def test_oblique_support_at_a_contact_node() -> None:
    """A support oblique to the normal couples slip and penetration: the tangential row is dropped."""
    plain = rectangle((1, 1), 4)
    skewed = Mesh(plain.points @ np.array([[1.0, 0.0], [0.5, 1.0]]), plain.cells, dict(plain.boundaries))
    discrete = discretize(survey_problem(mesh=skewed, supports={"left": Roller()}))
    corner = int(np.argmin(discrete.contact.points[:, 0]))
    rows = discrete.contact.trace.toarray().reshape(-1, 2, discrete.unknowns)[corner]
    assert np.count_nonzero(rows[0]) == 1
    assert np.count_nonzero(rows[1]) == 0
    assert np.linalg.matrix_rank(discrete.contact.trace.toarray()) == 2 * discrete.contact_points - 1


def test_corner_of_a_roller_boundary_is_held_both_ways() -> None:
    plain = rectangle((1, 1), 3)
    facets = np.vstack([plain.boundaries["left"], plain.boundaries["bottom"]])
    mesh = plain.with_boundaries({"walls": facets, "right": plain.boundaries["right"]})
    problem = ContactProblem(mesh, Material.young(1.0, 0.2), supports={"walls": Roller()}, tractions={"right": (1, 0)})
    u = solve_linear(discretize(problem))
    np.testing.assert_allclose(u[0], 0.0, atol=1e-15)
    np.testing.assert_allclose(u, mesh.points * [0.96, -0.24], atol=1e-13)


def test_curved_roller_averages_normals() -> None:
    angle = 2 * np.pi * np.arange(12) / 12
    ring = np.vstack([np.column_stack([r * np.cos(angle), r * np.sin(angle)]) for r in (1.0, 1.5)])
    k = np.arange(12)
    after = (k + 1) % 12
    cells = np.vstack([np.column_stack([k, k + 12, after + 12]), np.column_stack([k, after + 12, after])])
    mesh = Mesh(ring, cells, {"inner": np.column_stack([after, k])})
    problem = ContactProblem(mesh, Material.lame(1, 1), supports={"inner": Roller()})
    with pytest.raises(ProblemError, match="rotation"):
        discretize(problem)
    free = discretize(problem, check_coercivity=False)
    assert free.unknowns == 2 * 24 - 12


def test_two_contact_boundaries_meet() -> None:
    problem = survey_problem(
        4, contact={"bottom": SURVEY, "right": Contact(Signorini(), gap=0.5)}, supports={"left": Clamped()}
    )
    discrete = discretize(problem)
    assert discrete.contact_points == 4 + 5
    corner = np.flatnonzero(np.all(discrete.contact.points == [1.0, 0.0], axis=1))
    assert len(corner) == 2
    u = np.random.default_rng(0).standard_normal(discrete.unknowns)
    r, U = discrete.local(u), discrete.field.full(u)
    tip = U[4]
    # Both normals, and no friction, so that the rows of the trace stay independent.
    np.testing.assert_allclose(r[corner[0]], [-tip[1], 0.0])
    np.testing.assert_allclose(r[corner[1]], [tip[0] - 0.5, 0.0])
    rows = discrete.contact.trace.toarray()
    assert np.linalg.matrix_rank(rows) == np.count_nonzero(np.abs(rows).sum(axis=1))


def test_contact_boundaries_that_continue_each_other_share_one_point() -> None:
    mesh = rectangle((1.0, 1.0), 8)
    bottom = mesh.boundaries["bottom"]
    middle = mesh.points[bottom].mean(axis=1)[:, 0]
    mesh = mesh.with_boundaries({**mesh.boundaries, "west": bottom[middle < 0.5], "east": bottom[middle > 0.5]})
    laws = {"west": Contact(Signorini(), Tresca(0.1)), "east": Contact(SURVEY.normal, Tresca(0.1))}
    discrete = discretize(ContactProblem(mesh, Material.lame(4, 4), laws, {"top": Clamped()}))
    assert discrete.contact_points == 9
    assert math.isclose(discrete.contact.weights.sum(), 1.0)
    order = np.argsort(discrete.contact.points[:, 0])
    np.testing.assert_allclose(discrete.contact.weights[order], [1 / 16, *[1 / 8] * 7, 1 / 16])
    # The node in the middle follows the boundary named first, which is rigid.
    r = np.full((9, 2), 0.01)
    value = discrete.law.value(r)[order]
    assert np.isinf(value[:5]).all()
    assert np.isfinite(value[5:]).all()


@pytest.mark.parametrize("supports", [{"top": Clamped()}, {"top": Clamped(), "left": Roller(), "front": Roller()}])
def test_contact_in_space(supports: dict) -> None:
    mesh = cube(3)
    angle = 0.4
    c, s = math.cos(angle), math.sin(angle)
    mesh = mesh.moved([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    problem = ContactProblem(mesh, Material.lame(1, 1), {"bottom": SURVEY}, supports)
    discrete = discretize(problem)
    assert math.isclose(discrete.contact.weights.sum(), 1.0)
    gram = np.einsum("kci,kdi->kcd", discrete.contact.frames, discrete.contact.frames)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=1e-14)
    assert (np.linalg.det(discrete.contact.frames) > 0).all()
    P = discrete.field.basis
    assert abs(P.T @ P - sp.eye(discrete.unknowns)).max() < 1e-14
    assert np.diff(discrete.contact.trace.indptr).max() == 1
    u = np.random.default_rng(0).standard_normal(discrete.unknowns)
    U = discrete.field.full(u)
    for j in (0, 3, 7, 15):
        node = int(np.argmin(np.linalg.norm(mesh.points - discrete.contact.points[j], axis=1)))
        np.testing.assert_allclose(discrete.local(u)[j], discrete.contact.frames[j] @ U[node], atol=1e-13)


# ---- supports ----------------------------------------------------------------------------------------------


def test_supports_that_agree_may_meet() -> None:
    problem = survey_problem(4, contact={}, supports={"left": Prescribed((0.1, 0.2)), "top": Fixed(y=0.2)})
    u = solve_linear(discretize(problem))
    mesh = problem.mesh
    np.testing.assert_allclose(u[mesh.boundaries["left"]], np.broadcast_to([0.1, 0.2], (4, 2, 2)))
    np.testing.assert_allclose(u[mesh.boundaries["top"], 1], 0.2)


def test_supports_may_differ_by_rounding() -> None:
    wave = Prescribed(lambda x: np.column_stack([0 * x[:, 0], 0.1 * np.sin(np.pi * x[:, 0])]))
    problem = survey_problem(4, contact={}, supports={"top": wave, "left": Clamped(), "right": Clamped()})
    u = solve_linear(discretize(problem))
    assert np.isclose(at(problem, u, (0.5, 1.0))[1], 0.1)


def test_supports_that_disagree() -> None:
    with pytest.raises(
        ProblemError, match=r"'left' and 'top' prescribe different displacements at node 20, x = \(0, 1\)"
    ):
        discretize(survey_problem(4, supports={"left": Clamped(), "top": Fixed(y=-0.1)}))


def test_held_penetration_that_the_law_forbids() -> None:
    problem = survey_problem(4, contact={"bottom": Contact(Signorini())}, supports={"left": Prescribed((0.0, -0.1))})
    with pytest.raises(ProblemError, match=r"x = \(0, 0\) at penetration 0.1, which its law forbids"):
        discretize(problem)


def test_no_freedom_left() -> None:
    mesh = all_round(rectangle((1, 1), 1))
    with pytest.raises(ProblemError, match="no freedom"):
        discretize(ContactProblem(mesh, Material.lame(1, 1), supports={"all": Clamped()}))


def test_contact_points_all_held() -> None:
    problem = survey_problem(1, supports={"left": Clamped(), "right": Clamped(), "top": Roller()})
    with pytest.raises(ProblemError, match="no freedom"):
        discretize(problem)
    mesh = rectangle((1, 1), 1, "cross")
    discrete = discretize(survey_problem(mesh=mesh, supports={"left": Clamped(), "right": Clamped()}))
    assert discrete.contact_points == 0
    assert discrete.local(np.zeros(2)).shape == (0, 2)


def test_points_without_friction_are_named() -> None:
    """At the corner of two contact boundaries, and where a roller is oblique to the contact normal; not elsewhere."""
    rough, smooth = Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.5)), Contact(ThresholdCompliance(0.3, 2.0))

    def warned(angle: float = 0.0, **options: Any) -> DiscreteProblem:
        problem = survey_problem(4, **options)
        return discretize(replace(problem, mesh=problem.mesh.rotated(angle)))

    for angle in (0.0, 0.4):
        corner = warned(angle, contact={"bottom": rough, "right": rough})
        assert corner.contact.without_friction is not None
        place = corner.contact.points[corner.contact.without_friction]
        expected = np.array([np.cos(angle), np.sin(angle)])
        np.testing.assert_allclose(place, [expected, expected], atol=1e-12)
        (sentence,) = corner.warnings
        assert "friction is left out" in sentence
        assert f"({expected[0]:.6g}, {expected[1]:.6g})" in sentence
        assert not warned(angle, contact={"bottom": smooth, "right": smooth}).warnings
        mixed = warned(angle, contact={"bottom": smooth, "right": rough})
        assert np.count_nonzero(mixed.contact.without_friction) == 1
    assert not warned().warnings
    slanted = Mesh.oriented(
        np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.5, 1.0]]), np.array([[0, 1, 2], [0, 2, 3]])
    )
    slanted = slanted.with_boundaries(
        {"bottom": lambda x: x[:, 1] < 1e-9, "left": lambda x: x[:, 0] < 0.5, "right": lambda x: x[:, 0] > 1.9}
    )
    oblique = discretize(bodies.body(slanted, rough, supports={"left": Roller(), "right": Clamped()}))
    assert "x = (0, 0)" in oblique.warnings[0]
    assert "support" in oblique.warnings[0]


# ---- coercivity --------------------------------------------------------------------------------------------

WALLS = {"left": Roller(), "right": Roller()}


def survey_under_pressure(pressure: float, contact: Contact, **options: Any) -> ContactProblem:
    data = {
        "supports": WALLS,
        "body_force": 0.0,
        "tractions": {"top": Pressure(pressure)},
        "contact": {"bottom": contact},
    }
    return survey_problem(4, **(data | options))


@pytest.mark.parametrize(
    ("pressure", "contact"),
    [
        (0.4, Contact(ThresholdCompliance(0.3, 2.0))),
        (0.2, Contact(ThresholdCompliance(0.3, 0.0))),
        (0.4, Contact(Signorini())),
        (0.4, Contact(Bilateral())),
        (-0.4, Contact(Bilateral())),
    ],
)
def test_held_by_the_foundation(pressure: float, contact: Contact) -> None:
    assert discretize(survey_under_pressure(pressure, contact)).contact_points == 5


@pytest.mark.parametrize(
    ("pressure", "contact", "words"),
    [
        (0.4, Contact(ThresholdCompliance(0.3, 0.0)), r"translation \(0, -1\).*energy falls by 0.1"),
        (0.3, Contact(ThresholdCompliance(0.3, 0.0)), "in balance"),
        (-0.1, Contact(Signorini()), r"translation \(0, 1\)"),
        (0.0, Contact(NoContact()), "in balance"),
        (0.4, Contact(NoContact()), r"translation \(0, -1\)"),
    ],
)
def test_not_held(pressure: float, contact: Contact, words: str) -> None:
    problem = survey_under_pressure(pressure, contact)
    with pytest.raises(ProblemError, match=words):
        discretize(problem)
    assert discretize(problem, check_coercivity=False).contact_points == 5


def test_loose_block() -> None:
    """A block that stands on a rigid foundation: friction must hold it, and its weight keep it from "
    "tipping."""
    rough, smooth = Contact(Signorini(), Tresca(0.5)), Contact(Signorini())
    discretize(survey_under_pressure(1.0, rough, supports={}))
    with pytest.raises(ProblemError, match="in balance"):
        discretize(survey_under_pressure(1.0, smooth, supports={}))
    with pytest.raises(ProblemError, match=r"translation \(1, 0\)"):
        discretize(survey_under_pressure(1.0, rough, supports={}, tractions={"top": (0.6, -1.0)}))
    tipping = {"top": lambda x: np.column_stack([0 * x[:, 0], 1.0 - 3.0 * x[:, 0]])}
    with pytest.raises(ProblemError, match="rotation"):
        discretize(survey_under_pressure(1.0, rough, supports={}, tractions=tipping))


def test_loose_body_without_contact() -> None:
    with pytest.raises(ProblemError, match="free to move"):
        discretize(survey_problem(4, contact={}, supports={}))
    with pytest.raises(ProblemError, match="in balance"):
        discretize(survey_problem(4, contact={}, supports={}, body_force=0.0))
    mesh = cube(1)
    with pytest.raises(ProblemError, match="free to move"):
        discretize(ContactProblem(mesh, Material.lame(1, 1), body_force=(0, 0, -1)))
    hinge = {"bottom": Fixed(z=0.0)}
    turning = {"left": lambda x: np.column_stack([0.5 - x[:, 1], 0 * x[:, 0], 0 * x[:, 0]])}
    with pytest.raises(ProblemError, match="rotation about the z axis"):
        discretize(ContactProblem(mesh, Material.lame(1, 1), supports=hinge, tractions=turning))


def test_loose_block_in_space() -> None:
    mesh = cube(2)
    rough = Contact(Signorini(), Tresca(0.5))
    discretize(ContactProblem(mesh, Material.lame(1, 1), {"bottom": rough}, body_force=(0.1, 0.1, -1.0)))
    with pytest.raises(ProblemError, match="translation"):
        discretize(ContactProblem(mesh, Material.lame(1, 1), {"bottom": rough}, body_force=(0.5, 0.5, -1.0)))


# ---- statements that make no sense ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"contact": {"botom": SURVEY}}, "did you mean 'bottom'"),
        ({"supports": {"nowhere": Clamped()}}, r"supports names boundary 'nowhere'.*boundaries: left, right"),
        ({"tractions": {"Top": (0, 1)}}, "did you mean 'top'"),
        ({"contact": {"left": SURVEY}}, "'left' is clamped"),
        ({"contact": {"top": SURVEY}, "supports": {"top": Prescribed((0, 0))}}, "prescribed displacement"),
        ({"contact": {"bottom": ThresholdCompliance(1.0)}}, r"wrap the law: Contact\(law"),
        ({"supports": {"left": "glued"}}, "glued"),
        ({"supports": {"left": 3}}, r"pass Clamped\(\)"),
        ({"supports": {"left": Prescribed((0, 0, 0))}}, "needs 2 components"),
        ({"supports": {"left": Fixed(z=0.0)}}, "fixes z, but the mesh is plane"),
        ({"body_force": (0, 0, 1)}, "body_force has shape"),
        ({"body_force": (0, math.nan)}, "body_force: .* is not finite"),
        ({"body_force": 1.0}, "body_force has shape"),
        ({"tractions": {"top": (1, math.inf)}}, "not finite"),
        ({"tractions": {"top": "down"}}, r"tractions\['top'\]: formula .*: 'down' is not known"),
        ({"order": 3}, "order = 3"),
        ({"quadrature": "gauss"}, "quadrature = 'gauss'"),
        ({"mesh": "mesh.msh"}, "mesh is 'mesh.msh'"),
        ({"material": 4.0}, "material is 4.0"),
        ({"supports": [Clamped()]}, "supports must map"),
    ],
)
def test_statement_refused(changes: dict, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        survey_problem(4, **changes)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Fixed(), "fixes nothing"),
        (lambda: Fixed(x=math.nan), "not finite"),
        (lambda: Prescribed((0.0, math.inf)), "not finite"),
        (lambda: Pressure(math.nan), "not finite"),
        (lambda: Pressure((1.0, 2.0)), "one number or a callable"),
        (lambda: Contact(ThresholdCompliance(1.0), gap=math.nan), "not finite"),
        (lambda: Contact(ThresholdCompliance(1.0), gap=[1.0, 2.0]), "one number or a callable"),
        (lambda: Contact(3.0), "superpotential"),
        (lambda: Contact(ThresholdCompliance(1.0), 0.5), "Friction"),
    ],
)
def test_condition_refused(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"contact": {"bottom": Contact(Signorini(), gap=lambda x: x)}}, "gap of contact 'bottom'.*shape"),
        (
            {"contact": {"bottom": Contact(Signorini(), gap=lambda x: np.nan * x[:, 0])}},
            "gap of contact 'bottom'",
        ),
        ({"contact": {"bottom": Contact(ThresholdCompliance(lambda x: x))}}, "q_max"),
        ({"contact": {"bottom": Contact(ThresholdCompliance(1.0), Tresca(lambda x: -x[:, 0]))}}, "bound"),
        (
            {"supports": {"left": Prescribed(lambda x: x[:, 0])}},
            r"supports\['left'\]: the callable returned shape",
        ),
        ({"supports": {"left": Fixed(y=lambda x: x)}}, r"supports\['left'\], y"),
        ({"material": Material.lame(4.0, lambda x: x[:, 0] - 0.5)}, "mu = .* at x ="),
    ],
)
def test_functions_checked(changes: dict, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        discretize(survey_problem(4, **changes))


def test_overlapping_contact_boundaries() -> None:
    plain = rectangle((1, 1), 4)
    bottom = plain.boundaries["bottom"]
    mesh = plain.with_boundaries({"a": bottom[:3], "b": bottom[2:], "left": plain.boundaries["left"]})
    with pytest.raises(ProblemError, match="'a' and 'b' share 1 facets"):
        survey_problem(mesh=mesh, contact={"a": SURVEY, "b": SURVEY})


def test_folded_contact_boundary() -> None:
    """A boundary that turns back on itself has no normal at the fold."""
    split = Mesh.oriented(
        [[0, 0], [1, 0], [1, 0], [2, 1], [2, -1], [0, 2], [0, -2]],
        [[0, 1, 5], [0, 6, 2], [1, 3, 5], [2, 6, 4]],
        {"crack": [[0, 1], [0, 2]], "top": [[3, 5]]},
    )
    problem = ContactProblem(split, Material.lame(1, 1), {"crack": SURVEY}, {"top": Clamped()})
    with pytest.raises(ProblemError, match="folds back on itself at node 0"):
        discretize(problem)


def test_on_another_mesh() -> None:
    problem = survey_problem(4)
    finer = problem.on(problem.mesh.refined())
    assert discretize(finer).contact_points == 8
    with pytest.raises(ProblemError, match="does not have"):
        problem.on(all_round(rectangle()))


@pytest.mark.slow
def test_large_mesh() -> None:
    """Half a million unknowns take seconds."""
    discrete = discretize(survey_problem(512))
    assert discrete.unknowns == 2 * 512 * 513
    assert abs(discrete.stiffness - discrete.stiffness.T).max() == 0.0
