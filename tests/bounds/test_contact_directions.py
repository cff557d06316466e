"""Constants in the directions of the contact: planes and curved obstacles that do not face the contact boundary."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import contact_traces
from hemivar.bounds.exact_distance import exact_distance
from hemivar.bounds.low_mode import SoftModes
from hemivar.bounds.lower_bounds import lower_bounds
from hemivar.bounds.trace_bounds import guaranteed_trace_bounds
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.discretize import discretize
from hemivar.laws import Compliance, Friction, PenetrationBound, Softening, table_law
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Plane, Roller, Sphere
from hemivar.mesh import box, rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import solve
from tests import bodies
from tests.bounds.test_exact_distance import energy_of
from tests.samples import sampled

LAME = Material.lame(4.0, 4.0)


def leaning_column(angle: float = 80.0, cells: tuple[int, int] = (4, 16)) -> ContactProblem:
    """Clamped below, a plane at its top corner that is turned out of the top by an angle in degrees."""
    turn = np.radians(angle)
    contact = {
        "top": Contact(
            table_law([0.0, 10.0, 40.0, 50.0], [0.0, 15.0, 0.0, 0.0]),
            obstacle=Plane((1.0, 4.0), (-np.sin(turn), -np.cos(turn))),
        )
    }
    return bodies.strip(
        contact, cells, size=(1.0, 4.0), material=LAME, supports={"bottom": Clamped()}, body_force=(2.0, 0.0)
    )


def shown(problem: ContactProblem, normal: Array, parts: tuple[float, float]) -> float:
    """The largest quotient of quadratic displacements, by dense algebra, for a normal that is the same everywhere."""
    mesh, dim = problem.mesh, problem.mesh.dim
    [name] = problem.contact
    fine = replace(problem, order=2)
    K = stiffness_matrix(mesh, problem.material, 2)
    field = discretize(replace(fine, contact={name: Contact(hv.laws.NoContact())}), check_coercivity=False).field
    assert field is not None
    facets = mesh.facet_nodes(mesh.boundaries[name], 2)
    measures = mesh.facet_normals(mesh.boundaries[name])[1]
    assert dim == 2
    local = np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]) / 30.0
    along = np.outer(normal, normal)
    weight = parts[0] * along + parts[1] * (np.eye(dim) - along)
    M = np.zeros((len(mesh.nodes(2)) * dim,) * 2)
    for nodes, measure in zip(facets, measures, strict=True):
        rows = (nodes[:, None] * dim + np.arange(dim)).ravel()
        M[np.ix_(rows, rows)] += measure * np.kron(local, weight)
    basis = field.basis
    free = (basis.T @ M @ basis, (basis.T @ K @ basis).toarray())
    return float(la.eigh(*free, eigvals_only=True)[-1])


@pytest.mark.parametrize("angle", [0.0, 30.0, 80.0])
@pytest.mark.parametrize("rolling", [False, True])
def test_constants_have_the_directions_of_a_plane(angle: float, rolling: bool) -> None:
    """Not below what quadratic elements show, and near to it; where a roller holds the boundary along x, too."""
    problem = leaning_column(angle, (4, 8))
    if rolling:
        problem = replace(problem, supports={"bottom": Clamped(), "left": Roller()})
    normal = np.array([np.sin(np.radians(angle)), np.cos(np.radians(angle))])
    found = lower_bounds(problem)
    corners = problem.mesh.points[problem.mesh.boundaries["top"]]
    one = np.ones(len(corners))
    for bound, parts in ((found.both, (1.0, 1.0)), (found.normal, (1.0, 0.0)), (found.tangential, (0.0, 1.0))):
        most = shown(problem, normal, parts)
        assert most * (1.0 - 1e-9) <= 1.0 / bound.lower < 1.1 * most
        assert found.weighted(corners, parts[0] * one, parts[1] * one)[0] < 1.1 * most
    mixed = found.weighted(corners, 2.0 * one, one)[0]
    assert shown(problem, normal, (2.0, 1.0)) * (1.0 - 1e-9) <= mixed < 1.1 * shown(problem, normal, (2.0, 1.0))


def test_a_curved_obstacle_takes_the_whole_trace() -> None:
    problem = leaning_column()
    ball = replace(problem.contact["top"], obstacle=Sphere((6.0, 4.0), 5.0))
    found, plain = lower_bounds(replace(problem, contact={"top": ball})), lower_bounds(problem)
    assert found.whole
    assert not plain.whole
    assert found.normal.lower == found.tangential.lower == found.both.lower == pytest.approx(plain.both.lower)
    corners = problem.mesh.points[problem.mesh.boundaries["top"]]
    one = np.ones(len(corners))
    assert found.weighted(corners, one, 0.1 * one)[0] == pytest.approx(1.0 / found.both.lower)
    beside = hv.Contact(hv.laws.NoContact(), obstacle=Sphere((6.0, 4.0), 5.0), normals=hv.mechanics.Normals.BODY)
    assert not lower_bounds(replace(problem, contact={"top": beside})).whole


def test_two_solutions_have_no_guarantee_that_leaves_one_out() -> None:
    """The body leans on the plane, or is pushed through it: two solutions 13 apart in the energy norm."""
    problem = leaning_column()
    discrete = discretize(problem)
    constants = guaranteed_trace_bounds(discrete)
    solutions = [solve(discrete), solve(discrete, initial=solve(replace(problem, body_force=(20.0, 0.0))).unknowns)]
    u, v = (one.displacement for one in solutions)
    apart = energy_of(problem, u - v)
    assert apart > 10.0
    for one in solutions:
        assert one.status is hv.Status.CONVERGED
        found = exact_distance(problem, one.displacement, constants)
        assert not found.guaranteed or found.distance >= apart


@pytest.mark.parametrize("name", ["normal", "both", "weighted"])
def test_constants_that_the_mesh_contradicts_are_refused(name: str) -> None:
    problem = replace(leaning_column(10.0), contact={"top": Contact(Softening(4.0, 0.05, 0.5))})
    problem = replace(problem, body_force=(0.1, 0.5))
    solution = solve(problem)
    right = guaranteed_trace_bounds(solution.problem)
    assert exact_distance(problem, solution.displacement, right).guaranteed
    if name == "weighted":
        wrong = replace(right, weighted=lambda facets, normal, tangential: (1e-6, 1e-7))
    else:
        wrong = replace(right, both=1e6) if name == "both" else replace(right, normal=1e6)
    found = exact_distance(problem, solution.displacement, wrong)
    assert not found.guaranteed
    assert found.distance == np.inf
    [reason] = found.reasons
    assert "a displacement of the mesh shows" in reason


@pytest.mark.parametrize("seed", sampled(range(6), 3))
def test_what_a_mesh_shows_is_never_above_right_constants(seed: int) -> None:
    """Random planes, laws and bodies, in the plane and in space, graded meshes among them."""
    rng = np.random.default_rng(seed)
    dim = 3 if seed % 3 == 2 else 2
    mesh: Mesh = rectangle((1.0, 1.0), 4) if dim == 2 else box((1.0, 1.0, 1.0), 2)
    for _ in range(seed % 2):
        mesh = mesh.refined_where(mesh.points[mesh.cells].mean(axis=1)[:, 0] > 0.6)
    normal = rng.normal(size=dim)
    normal[-1] = -3.0 * abs(normal[-1])
    away = np.zeros(dim)
    away[-1] = 1.5
    contact = {"top": Contact(Compliance(1.0), obstacle=Plane(away, normal))}
    problem = bodies.body(mesh, contact, material=Material.young(10.0, rng.uniform(0.0, 0.45)))
    discrete = discretize(problem)
    constants = guaranteed_trace_bounds(discrete)
    traces = contact_traces(body_data(problem, np.zeros(mesh.points.shape)))
    assert traces is not None
    modes, corners = SoftModes(traces), mesh.points[traces.data.table.facets[traces.facets]]
    count = len(corners)
    for across in (0.0, 1.0, 3.0):
        alpha = (np.ones(count), across * rng.uniform(size=count))
        theta = modes.softest(*alpha).theta
        c = constants.softening(corners, *alpha)
        assert theta <= c < 4.0 * theta


def test_friction_that_depends_on_the_penetration_counts_once() -> None:
    """``int |v_nu| |v_tau|`` is at most half of ``int |v|^2``."""
    problem = replace(
        leaning_column(10.0), contact={"top": Contact(Compliance(3.0), Friction(PenetrationBound("0.5*s")))}
    )
    solution = solve(replace(problem, body_force=(0.1, 0.5)))
    constants = guaranteed_trace_bounds(solution.problem)
    found = exact_distance(replace(problem, body_force=(0.1, 0.5)), solution.displacement, constants)
    apart = np.sqrt(constants.normal * constants.tangential)
    assert found.constant == pytest.approx(0.5 / max(apart, 2.0 * constants.both))
