"""The bound with quadratic elements in the plane: never below the error, not far above it, whatever the units."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.bounds.admissible_stress import admissible_stress
from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import admissible_displacement, contact_traces
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.sweeps import ContactPenalty, PatchSmoother
from hemivar.bounds.trace_bounds import discrete_trace_bounds, guaranteed_trace_bounds
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.discretize import discretize
from hemivar.fem.transfer import interpolate
from hemivar.gallery import manufactured_softening, survey
from hemivar.gallery.known import weighted_block
from hemivar.laws import (
    Compliance,
    PiecewiseQuadratic,
    Signorini,
    SlipWeakening,
    Softening,
    ThresholdCompliance,
    Tresca,
)
from hemivar.mechanics import Contact, ContactProblem, Material, Plane
from hemivar.mesh import rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import solve
from tests import bodies

from .admissibility import imbalance
from .test_exact_distance import random_square

V = PatchKind.VERTEX


def energy_of(problem: ContactProblem, v: Array) -> float:
    stiffness = stiffness_matrix(problem.mesh, problem.material, problem.order)
    return float(np.sqrt(v.ravel() @ (stiffness @ v.ravel())))


def bound_of_solution(problem: ContactProblem) -> tuple[ExactDistance, Array]:
    solution = solve(problem)
    return exact_distance(problem, solution.displacement, discrete_trace_bounds(solution.problem)), (
        solution.displacement
    )


def error_on_mesh(problem: ContactProblem, u: Array, mesh: Mesh) -> float:
    """Distance to the solution with quadratic elements on a mesh that holds that of the problem."""
    fine = replace(problem, mesh=mesh)
    reference = solve(fine)
    field = discretize(problem).field
    assert field is not None
    return energy_of(fine, reference.displacement - interpolate(field, u, fine.mesh.nodes(2)))


def refined_towards(mesh: Mesh, corners: Array, turns: int) -> Mesh:
    """Refined towards some places."""
    for _ in range(turns):
        far = np.linalg.norm(mesh.points[mesh.cells].mean(axis=1)[:, None] - corners, axis=2).min(axis=1)
        mesh = mesh.refined_where(far < 3.0 * np.sqrt(mesh.volumes))
    return mesh


EVERY = [(data, n) for data in ("figure1", "figure2", "figure3", "figure4", "5.1") for n in (1, 2)]


@pytest.mark.parametrize(
    ("data", "n"), [pytest.param(*one, marks=[] if one == ("figure2", 1) else pytest.mark.slow) for one in EVERY]
)
def test_effectivity_on_the_survey(data: str, n: int) -> None:
    """At most 1.6, the survey's laws being monotone; against a reference graded to the ends of the clamped side."""
    stated = replace(survey(data, 4), order=2)
    problem = replace(stated, mesh=stated.mesh.refined(n))
    fine = replace(stated, mesh=refined_towards(stated.mesh.refined(n + 1), np.array([[0.0, 0.0], [0.0, 1.0]]), 5))
    solution = solve(problem)
    found = exact_distance(problem, solution.displacement, guaranteed_trace_bounds(discretize(stated)))
    field = solution.problem.field
    assert field is not None
    off = solve(fine).displacement - interpolate(field, solution.displacement, fine.mesh.nodes(2))
    error = energy_of(fine, off)
    assert found.guaranteed, found.reasons
    assert found.constant == 0.0
    assert error < found.distance < 1.6 * error


def test_a_quadratic_solution_is_told_so() -> None:
    """The block under its weight, whose displacement is quadratic."""
    known = weighted_block(n=3)
    problem = replace(known.problem, order=2)
    found, u = bound_of_solution(problem)
    assert np.abs(u - known.displacement(problem.mesh.nodes(2))).max() < 1e-12
    assert found.distance < 1e-6 * found.energy_norm
    assert found.relative == pytest.approx(found.distance / energy_of(problem, u))


@pytest.mark.parametrize("pattern", ["right", pytest.param("cross", marks=pytest.mark.slow)])
def test_manufactured_softening(pattern: str) -> None:
    """Laws that soften, loads that vary: against the exact solution, and of second order."""
    bounds = []
    for n in (4, 8):
        known = manufactured_softening(n, pattern=pattern)  # type: ignore[arg-type]
        problem = replace(known.problem, order=2)
        found, u = bound_of_solution(problem)
        field = discretize(problem).field
        assert field is not None
        fine = replace(problem, mesh=problem.mesh.refined(2))
        off = known.displacement(fine.mesh.nodes(2)) - interpolate(field, u, fine.mesh.nodes(2))
        error = energy_of(fine, off)
        assert error < found.distance
        assert found.distance * (1.0 - found.constant) < 4.0 * error
        assert 0.1 < found.constant < 0.65
        assert found.parts.oscillation > 0.0
        bounds.append(found.distance)
    assert bounds[0] / bounds[1] > 3.3


@pytest.mark.parametrize("seed", range(6))
def test_bound_is_not_below_the_error_of_random_problems(seed: int) -> None:
    problem = replace(random_square(seed), order=2)
    found, u = bound_of_solution(problem)
    error = error_on_mesh(problem, u, problem.mesh.refined(2))
    assert error <= found.distance
    assert found.distance * (1.0 - found.constant) < 2.5 * error


def test_friction_that_weakens() -> None:
    problem = replace(
        survey("5.1", 6),
        order=2,
        contact={"bottom": Contact(Compliance(10.0), SlipWeakening(0.1, 1.0, 0.5, 20.0))},
        body_force=(0.9, -0.3),
    )
    found, u = bound_of_solution(problem)
    error = error_on_mesh(problem, u, problem.mesh.refined(2))
    assert 0.1 < found.constant < 1.0
    assert error <= found.distance
    assert found.distance * (1.0 - found.constant) < 2.0 * error


def test_units_and_rotation_change_nothing() -> None:
    problem = replace(survey("figure2", 4), order=2, contact={"bottom": Contact(Signorini(), Tresca(0.05))},
                      body_force=(0.9, -0.3))  # fmt: skip
    found, _ = bound_of_solution(problem)
    assert found.parts.correction > 0.0
    assert found.parts.gap > 0.0
    parts = found.parts
    whole = parts.misfit + parts.contact + parts.oscillation + parts.algebraic
    rest = 0.5 * (whole + np.sqrt(whole**2 + 4.0 * parts.gap))
    assert found.distance == pytest.approx(rest + parts.correction, rel=1e-12)
    c, s = np.cos(0.7), np.sin(0.7)
    turned = replace(problem, mesh=problem.mesh.rotated(0.7),
                     body_force=tuple(np.array([[c, -s], [s, c]]) @ np.array([0.9, -0.3])))  # fmt: skip
    assert bound_of_solution(turned)[0].distance == pytest.approx(found.distance, rel=1e-7)
    length, force = 1e3, 1e6
    other = replace(
        problem,
        mesh=problem.mesh.scaled(length),
        material=Material.lame(4.0 * force, 4.0 * force),
        body_force=(0.9 * force / length, -0.3 * force / length),
        contact={"bottom": Contact(Signorini(), Tresca(0.05 * force))},
    )
    assert bound_of_solution(other)[0].distance == pytest.approx(found.distance * np.sqrt(force) * length, rel=1e-6)


# ---- traces --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_rigid_laws_get_a_trace_that_they_allow(seed: int) -> None:
    """Nodes are inside the domain, the edges between them after the least change of a midpoint."""
    rng = np.random.default_rng(seed)
    mesh = rectangle((1.0, 1.0), 5)
    problem = bodies.body(
        mesh, Contact(Signorini(), gap=0.03), supports={"top": survey("5.1", 2).supports["left"]}, tractions={}, order=2
    )
    u = rng.normal(size=mesh.nodes(2).shape)
    ground = mesh.nodes(2)[:, 1] == 0.0
    u[ground, 1] = -0.03 + np.where(
        rng.uniform(size=int(ground.sum())) < 0.4, 0.0, rng.uniform(0.0, 0.1, int(ground.sum()))
    )
    data = body_data(problem, u)
    before = contact_traces(data)
    moved = admissible_displacement(data)
    after = contact_traces(body_data(problem, moved))
    assert before is not None
    assert after is not None
    assert before.beyond > 1e-4
    assert after.beyond == 0.0
    change = np.abs(moved - u)
    assert not change[: mesh.number_of_nodes].any()
    assert not change[:, 0].any()
    facets = data.facet_nodes[data.contact >= 0]
    t = np.linspace(0.0, 1.0, 2001)[:, None]
    shapes = np.column_stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)])
    top = (-moved[facets, 1] - 0.03) @ shapes.T
    assert top.max() < 1e-12
    touched = change[facets[:, 2], 1] > 0.0
    assert touched.any()
    assert top[touched][:, 1:-1].max(axis=1) == pytest.approx(0.0, abs=1e-6)  # no more than is needed


def test_an_oblique_plane_asks_for_a_change_along_its_normal() -> None:
    problem = replace(
        survey("5.1", 4), order=2,
        contact={"bottom": Contact(Signorini(), obstacle=Plane((0.0, -0.05), (0.1, 1.0)))},
    )  # fmt: skip
    u = np.zeros(problem.mesh.nodes(2).shape)
    x = problem.mesh.nodes(2)
    normal = np.array([0.1, 1.0]) / np.hypot(0.1, 1.0)
    u[x[:, 1] == 0.0] -= 0.999 * ((x[x[:, 1] == 0.0] - [0.0, -0.05]) @ normal)[:, None] * normal
    u[(x[:, 1] == 0.0) & (np.abs(x[:, 0] - 0.5) < 0.01)] += 0.05 * normal
    data = body_data(problem, u)
    moved = admissible_displacement(data)
    found = contact_traces(body_data(problem, moved))
    assert found is not None
    assert found.beyond == 0.0
    change = moved - u
    assert np.abs(change).max() > 1e-4
    assert change @ np.array([-normal[1], normal[0]]) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("law", [ThresholdCompliance(0.3, 2.0), Softening(4.0, 0.05, 1.5),
                                 PiecewiseQuadratic(np.array([-0.1, 0.02, 0.07]), np.array([0.0, 2.0, -1.0, 3.0]),
                                                    np.array([0.1, 0.2, 0.3]))])  # fmt: skip
def test_rules_resolve_kinks_along_quadratic_traces(law: ThresholdCompliance) -> None:
    """The integral of j' along the boundary by a rule with 20 000 points."""
    problem = replace(survey("5.1", 3), order=2, contact={"bottom": Contact(law)})
    u = 0.2 * np.random.default_rng(2).normal(size=problem.mesh.nodes(2).shape)
    data = body_data(problem, u)
    traces = contact_traces(data)
    assert traces is not None
    found = np.einsum("fq,fq->f", traces.weights, traces.allowed(np.zeros(traces.local.shape))[..., 0])
    t = (np.arange(20_000) + 0.5) / 20_000
    shapes = np.column_stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)])
    r = -u[data.facet_nodes[traces.facets], 1] @ shapes.T
    scalar = law.at(np.zeros((1, 2)))
    fine = np.array([scalar.take(np.zeros(len(t), dtype=np.int64)).derivative(row) for row in r])
    expected = data.table.measures[traces.facets] * fine.mean(axis=1)
    assert found == pytest.approx(expected, abs=1e-4 * np.abs(fine).max())
    assert traces.weights.sum(axis=1) == pytest.approx(data.table.measures[traces.facets])
    # moments of a quadratic force, and back
    force = traces.shapes @ np.random.default_rng(2).normal(size=(3, 2))
    assert traces.forces(traces.on_facets(-traces.moments(force)) + data.facet_loads) == pytest.approx(force)


def test_points_without_weight_stand_where_the_trace_is_extreme() -> None:
    problem = replace(survey("5.1", 4), order=2)
    u = np.random.default_rng(0).normal(size=problem.mesh.nodes(2).shape)
    data = body_data(problem, u)
    traces = contact_traces(data)
    assert traces is not None
    t = np.linspace(0.0, 1.0, 20_001)
    shapes = np.column_stack([(1 - t) * (1 - 2 * t), t * (2 * t - 1), 4 * t * (1 - t)])
    for component, way in ((0, np.array([0.0, -1.0])), (1, np.array([1.0, 0.0]))):
        r = (u[data.facet_nodes[traces.facets]] @ way) @ shapes.T
        for most in (np.max, np.min):
            assert most(traces.local[..., component], axis=1) == pytest.approx(most(r, axis=1), abs=1e-7)
    assert (traces.weights >= 0.0).all()


def test_data_of_another_displacement() -> None:
    problem = replace(survey("5.1", 3), order=2)
    rng = np.random.default_rng(1)
    u, v = rng.normal(size=(2, *problem.mesh.nodes(2).shape))
    moved, expected = body_data(problem, u).moved(v), body_data(problem, v)
    for name in ("displacement", "strains", "stresses", "forces", "loads"):
        assert np.array_equal(getattr(moved, name), getattr(expected, name))
    assert expected.energy == pytest.approx(energy_of(problem, v) ** 2)


def test_sweeps_near_the_contact_alone_keep_the_rest() -> None:
    problem = replace(survey("5.1", 5), order=2)
    stress = admissible_stress(body_data(problem, solve(problem).displacement))
    sweeper = PatchSmoother(stress)
    touched = np.flatnonzero(stress.data.contact >= 0)
    price = ContactPenalty(touched, -stress.tractions.moments[touched], 0.2)
    sweeper.sweep(V, price, only_contact=True)
    changed = np.abs(sweeper.stress.tractions.moments - stress.tractions.moments).max(axis=(1, 2)) > 0.0
    table = stress.data.table
    ground = np.unique(table.facets[stress.data.contact >= 0])
    near = np.isin(table.facets, ground).any(axis=1)
    assert near[changed].all()
    assert changed[near].mean() > 0.9
    assert imbalance(sweeper.stress, 1) < 1e-13
