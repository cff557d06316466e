"""Stresses in equilibrium vertex by vertex: their work against random quadratic fields is that of the loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.bounds.admissible_stress import admissible_stress
from hemivar.bounds.body_data import body_data
from hemivar.bounds.facet_table import facet_vertices
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.sweeps import PatchSmoother
from hemivar.errors import ProblemError
from hemivar.fem.elements import shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.reactions import nodal_contact_forces
from hemivar.laws import Compliance
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import box
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import solve
from tests import bodies

from .admissibility import imbalance
from .bodies import BODIES, VARYING, layered, pulled_cube


@pytest.mark.parametrize("name", BODIES)
def test_stress_is_in_equilibrium(name: str) -> None:
    problem = BODIES[name]()
    stress = admissible_stress(body_data(problem, solve(problem).displacement))
    for seed in range(3):
        assert imbalance(stress, seed, order=1 if name in VARYING else 2) < 1e-13
    scale = np.abs(stress.data.loads).max() + np.abs(stress.data.facet_loads).max()
    left = (
        stress.tractions.defect - stress.tractions.missed
    )  # what the rule of the assembly misses of the loads is known
    assert np.abs(left).max() < 1e-12 * scale  # a solution leaves nothing but rounding
    assert np.all(stress.misfit > 0.0)


@pytest.mark.parametrize("name", BODIES)
def test_every_field_has_a_stress_where_the_rest_is_a_load(name: str) -> None:
    """A displacement that is no solution: what its vertices lack becomes a load, and the balance holds with it."""
    problem = BODIES[name]()
    u = np.random.default_rng(5).normal(size=problem.mesh.nodes(problem.order).shape)
    stress = admissible_stress(body_data(problem, u))
    assert np.abs(stress.tractions.defect).max() > 1e-3
    assert imbalance(stress, 1, order=1) < 1e-13


@pytest.mark.parametrize("name", ["survey", "layered", "graded", "cube", "survey, quadratic", "graded, quadratic"])
def test_given_pressures_leave_the_forces_of_the_nodes(name: str) -> None:
    """Whatever contact tractions one starts with, they are completed to the forces of the nodes, and all balances."""
    problem = BODIES[name]()
    data = body_data(problem, solve(problem).displacement)
    touched = np.flatnonzero(data.contact >= 0)
    given = np.zeros(data.facet_loads.shape)
    given[touched] = np.random.default_rng(6).normal(size=given[touched].shape) * np.abs(data.forces).max()
    plain, pressed = admissible_stress(data), admissible_stress(data, given)
    assert imbalance(pressed, 1, order=1 if name in VARYING else 2) < 1e-13
    assert np.array_equal(pressed.tractions.defect, plain.tractions.defect)
    change = np.einsum(
        "fij,faj->fai",
        np.eye(data.table.dim) - data.unknown[touched],
        pressed.tractions.moments[touched] - plain.tractions.moments[touched],
    )
    assert np.abs(change).max() > 1e-2 * np.abs(given).max()
    of_nodes = np.zeros(data.displacement.shape)
    np.add.at(of_nodes, data.facet_nodes[touched], change)
    held = data.facet_nodes[~data.table.interior & (data.contact < 0) & data.unknown.any(axis=(1, 2))]
    of_nodes[held] = 0.0  # there the supports take the rest
    assert np.abs(of_nodes).max() < 1e-13 * np.abs(given).max()


def test_cells_with_two_contact_facets_are_in_equilibrium() -> None:
    """At an edge where the contact boundary turns a cell may have two facets there, whatever the numbers of nodes."""
    mesh = box((1.0, 1.0, 1.0), 2)
    place = np.random.default_rng(1).permutation(mesh.number_of_nodes)
    points = np.empty(mesh.points.shape)
    points[place] = mesh.points
    mesh = Mesh(points, place[mesh.cells], {name: place[facets] for name, facets in mesh.boundaries.items()}, {})
    problem = bodies.body(
        mesh, {"bottom": Contact(Compliance(3.0)), "right": Contact(Compliance(2.0))}, body_force=(-0.4, -0.3, -0.4)
    )
    stress = admissible_stress(body_data(problem, solve(problem).displacement))
    outer = stress.data.contact[stress.data.table.cell_facets] >= 0
    assert (outer.sum(axis=1) == 2).any()
    assert imbalance(stress, 1) < 1e-13


@pytest.mark.parametrize("name", ["survey", "turned", "cube", "pulled cube", "survey, quadratic", "turned, quadratic"])
def test_contact_tractions_have_the_forces_of_the_nodes(name: str) -> None:
    problem = BODIES[name]()
    solution = solve(problem)
    stress = admissible_stress(body_data(problem, solution.displacement))
    data = stress.data
    touched = np.flatnonzero(data.contact >= 0)
    forces = np.zeros(problem.mesh.nodes(problem.order).shape)
    loose = np.eye(problem.mesh.dim) - data.unknown[touched]
    acting = stress.tractions.moments[touched] - data.facet_loads[touched]
    np.add.at(forces, data.facet_nodes[touched], np.einsum("fij,faj->fai", loose, acting))
    expected = nodal_contact_forces(solution.problem, solution.multiplier)
    supported = np.concatenate([problem.mesh.boundaries[support] for support in problem.supports])
    held = np.unique(problem.mesh.facet_nodes(supported, problem.order))
    free = np.setdiff1d(np.unique(data.facet_nodes[touched]), held)
    assert forces[free] == pytest.approx(expected[free], abs=1e-8)
    assert np.abs(expected[free]).max() > 1e-3


@pytest.mark.parametrize("name", ["survey", "layered", "cube"])
def test_stress_of_a_linear_field_is_its_own(name: str) -> None:
    """Held on the whole boundary as a linear field moves, a body has that field's stress, and no misfit."""
    stated = BODIES[name]()
    mesh = stated.mesh.named({"all": stated.mesh.boundary_facets}, {})
    material = Material.lame(4.0, 4.0) if name == "layered" else stated.material
    matrix = np.random.default_rng(4).normal(size=(mesh.dim, mesh.dim))
    problem = ContactProblem(mesh, material, supports={"all": Clamped()})
    stress = admissible_stress(body_data(problem, mesh.points @ matrix.T))
    size = np.abs(stress.data.stress).max()
    assert np.sqrt(stress.misfit.max()) < 1e-13 * size
    assert stress.stresses == pytest.approx(stress.stresses[:1, :1, :1] + 0.0 * stress.stresses, abs=1e-12 * size)


def test_misfit_is_the_energy_of_the_difference() -> None:
    """Against the norm of the stress less that of the strain: ``|s|^2 - 2 int s : eps + |eps|^2``, C being constant."""
    for problem in (layered(), pulled_cube()):
        stress = admissible_stress(body_data(problem, solve(problem).displacement))
        data = stress.data
        pieces = stress.stresses
        d = problem.mesh.dim
        volumes = data.table.volumes / (d + 1)
        mass = (np.ones((d + 1, d + 1)) + np.eye(d + 1)) / ((d + 1) * (d + 2))
        compliance = np.broadcast_to(data.compliance, (len(pieces), *data.compliance.shape[1:]))
        whole = np.einsum("m,ac,mbap,mpq,mbcq->m", volumes, mass, pieces, compliance, pieces)
        double = np.where(np.arange(pieces.shape[-1]) < d, 1.0, 2.0)
        index = ((0, 0), (1, 1), (0, 1)) if d == 2 else ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
        eps = np.stack([data.strain[:, i, j] for i, j in index], axis=1) * double
        sigma = np.stack([data.stress[:, i, j] for i, j in index], axis=1)
        mixed = np.einsum("m,mbap,mp->m", volumes / (d + 1), pieces, eps)
        own = data.table.volumes * np.einsum("mp,mp->m", sigma, eps)
        assert stress.misfit == pytest.approx(whole - 2.0 * mixed + own, rel=1e-9)


def test_a_modulus_that_hardly_varies_gives_nearly_the_misfit_of_a_constant_one() -> None:
    problem = layered()
    problem = replace(problem, material=Material.lame(4.0, 4.0))
    u = solve(problem).displacement
    constant = admissible_stress(body_data(problem, u))
    varying = replace(problem, material=Material.lame(lambda x: 4.0 + 1e-9 * x[:, 0], 4.0))
    other = admissible_stress(body_data(varying, u))
    assert other.data.varies
    assert other.misfit == pytest.approx(constant.misfit, rel=1e-6)


def test_no_stress_where_cells_meet_at_a_vertex_only() -> None:
    points = np.array([[0.0, 0.0], [-1.0, -0.5], [-1.0, 0.5], [1.0, -0.5], [1.0, 0.5]])
    mesh = Mesh(points, np.array([[0, 2, 1], [0, 3, 4]]), {"left": np.array([[2, 1]]), "right": np.array([[3, 4]])})
    problem = ContactProblem(mesh, Material.lame(1.0, 1.0), supports={"left": Clamped(), "right": Clamped()})
    with pytest.raises(ProblemError, match=r"cells around the node 0, x = \(0, 0\), meet there and share no facet"):
        admissible_stress(body_data(problem, np.zeros(points.shape)))


def test_refusals() -> None:
    problem = BODIES["survey"]()
    u = np.zeros(problem.mesh.points.shape)
    with pytest.raises(ProblemError, match="in 3D admissible stresses are made of linear elements"):
        body_data(replace(BODIES["cube"](), order=2, contact={}), u)
    with pytest.raises(ProblemError, match="a field of order 2"):
        body_data(replace(problem, order=2), u)
    with pytest.raises(ProblemError, match="without bedding"):
        body_data(replace(problem, bedding=1.0), u)
    with pytest.raises(ProblemError, match="the displacement has shape"):
        body_data(problem, u[:-1])


@pytest.mark.parametrize("name", ["turned", "layered", "without contact"])
def test_quadratic_stresses_balance_at_every_place(name: str) -> None:
    """Constant loads: ``div s = -f0`` on all pieces, and one traction on both sides of every facet inside."""
    problem = replace(BODIES[name](), order=2)
    stress = admissible_stress(body_data(problem, solve(problem).displacement))
    sweeper = PatchSmoother(stress)
    sweeper.sweep(PatchKind.VERTEX)
    for found in (stress, sweeper.stress):
        table = found.data.table
        size = np.abs(found.stresses).max()
        corners = problem.mesh.points[table.cells]
        at, _ = quadrature_rule(1, 4)
        sides = np.zeros((2, len(table.facets), len(at), 2))
        for piece in range(3):
            own = corners.copy()
            own[:, piece] = corners.mean(axis=1)
            inverse = np.linalg.inv((own[:, 1:] - own[:, :1]).transpose(0, 2, 1))
            slopes = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
            tensors = found.stresses[:, piece][..., [[0, 2], [2, 1]]]
            for point in (np.array([0.2, 0.7, 0.1]), np.array([0.3, 0.3, 0.4])):
                derivatives = np.einsum("ab,mbj->maj", shape_derivatives(2, point), slopes)
                divergence = np.einsum("maij,maj->mi", tensors, derivatives)
                force = np.asarray(problem.body_force, dtype=float)
                off = np.abs(divergence + force).max(axis=1) * np.sqrt(table.volumes)
                assert off.max() < 1e-11 * size
            members = facet_vertices(2)[piece]
            inside = np.zeros((len(at), 3))
            inside[:, members] = at
            facets = table.cell_facets[:, piece]
            traction = np.einsum("qa,maij,mj->mqi", shape_values(2, inside), tensors, table.normals_of(facets))
            second = (table.signs[:, piece] < 0.0).astype(int)
            sides[second, facets] = traction
        inner = table.interior
        assert np.abs(sides[0, inner] - sides[1, inner]).max() < 1e-11 * size
