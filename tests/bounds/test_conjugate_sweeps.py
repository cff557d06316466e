"""Conjugate gradients over sweeps: against sweeps alone, and against errors on meshes that are graded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.bounds import conjugate_sweeps
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.body_data import body_data
from hemivar.bounds.compiled_patches import Prices
from hemivar.bounds.conjugate_sweeps import Sweeps, unresolved
from hemivar.bounds.contact_traces import ContactTraces, contact_traces
from hemivar.bounds.exact_distance import exact_distance
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.sweeps import ContactPenalty, PatchSmoother
from hemivar.bounds.trace_bounds import TraceBounds, guaranteed_trace_bounds
from hemivar.fem import interpolate
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.discretize import discretize
from hemivar.formula import Formula, FormulaArray
from hemivar.gallery.survey_problems import survey, survey_cube
from hemivar.laws import NoContact, Signorini, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import solve

from .admissibility import imbalance
from .bodies import BODIES, VARYING


def graded_square(power: float, order: int = 1) -> ContactProblem:
    """A square with columns that shrink towards the clamped side."""
    mesh = rectangle((1.0, 1.0), 5, pattern="cross")
    points = mesh.points * 1.0
    points[:, 0] **= power
    mesh = Mesh(points, mesh.cells, dict(mesh.boundaries))
    return ContactProblem(
        mesh, Material.young(10.0, 0.3), {"bottom": Contact(Signorini(), Tresca(0.05))}, {"left": Clamped()},
        body_force=(0.1, -0.3), order=order,
    )  # fmt: skip


def first_stress(problem: ContactProblem) -> AdmissibleStress:
    return admissible_stress(body_data(problem, solve(problem).displacement))


def priced(stress: AdmissibleStress) -> tuple[ContactTraces, ContactPenalty] | tuple[None, None]:
    traces = contact_traces(stress.data)
    if traces is None:
        return None, None
    wanted = traces.moments(traces.allowed(traces.forces(stress.tractions.moments)))
    return traces, ContactPenalty(traces.facets, wanted, 0.5)


def cost(sweeper: PatchSmoother, penalty: ContactPenalty | None) -> float:
    """Misfit and price, but for a constant."""
    if penalty is None:
        return sweeper.misfit
    prices = sweeper.prices(penalty)
    moments = sweeper.moments
    return sweeper.misfit + prices.work(moments, prices.slope(moments) + prices.offsets)


@pytest.mark.parametrize("name", BODIES)
def test_a_step_gains_at_least_what_its_sweep_does_and_keeps_equilibrium(name: str) -> None:
    stress = first_stress(BODIES[name]())
    _, penalty = priced(stress)
    kind = PatchKind.VERTEX if stress.data.table.dim == 2 else PatchKind.EDGE
    sweeper, last = PatchSmoother(stress), None
    prices = None if penalty is None else sweeper.prices(penalty)
    first = cost(sweeper, penalty)
    for _ in range(4):
        beside = PatchSmoother(sweeper.stress)
        beside.sweep(kind, prices)
        before, misfit = cost(sweeper, penalty), sweeper.misfit
        last, gain, change = conjugate_sweeps._step(sweeper, kind, prices, last)
        after = cost(sweeper, penalty)
        rounding = 1e-12 * (abs(first) + misfit)
        assert after <= cost(beside, penalty) + rounding
        assert before - after == pytest.approx(gain, rel=1e-8, abs=rounding)
        assert sweeper.misfit - misfit == pytest.approx(change, rel=1e-8, abs=rounding)
    fresh = PatchSmoother(sweeper.stress)
    assert np.abs(sweeper.slopes - fresh.slopes).max() < 1e-11 * np.abs(PatchSmoother(stress).slopes).max()
    assert imbalance(sweeper.stress, 1, order=1 if name in VARYING else 2) < 1e-13


@pytest.mark.parametrize("order", [1, 2])
def test_few_steps_do_what_many_sweeps_do(order: int) -> None:
    """Six steps leave less misfit than twelve sweeps, where cells are stretched."""
    stress = first_stress(graded_square(3.0, order))
    swept, stepped, last = PatchSmoother(stress), PatchSmoother(stress), None
    for _ in range(12):
        swept.sweep(PatchKind.VERTEX)
    for _ in range(6):
        last, _, _ = conjugate_sweeps._step(stepped, PatchKind.VERTEX, None, last)
    assert stepped.misfit < swept.misfit


def error_of(problem: ContactProblem, u: Array) -> float:
    """Against quadratic elements on a mesh finer by four."""
    fine = replace(problem, mesh=problem.mesh.refined(2), order=2)
    solution, own = solve(fine), discretize(problem, check_coercivity=False).field
    assert own is not None
    assert solution.problem.field is not None
    off = (solution.displacement - interpolate(own, u, solution.problem.field)).ravel()
    return float(np.sqrt(off @ (stiffness_matrix(fine.mesh, fine.material, 2) @ off)))


@pytest.mark.parametrize(("power", "gain"), [(2.0, 1.0), (3.0, 1.3), (4.0, 3.0)])
def test_the_bound_is_sharp_on_graded_meshes(power: float, gain: float) -> None:
    problem = graded_square(power)
    solution = solve(problem)
    constants = guaranteed_trace_bounds(solution.problem)
    error = error_of(problem, solution.displacement)
    found = exact_distance(problem, solution.displacement, constants)
    assert found.guaranteed
    assert error <= found.distance < 3.0 * error
    swept = exact_distance(problem, solution.displacement, constants, sweeps=(PatchKind.VERTEX,))
    assert swept.distance >= gain * found.distance


@pytest.mark.parametrize(
    "problem", [survey("5.1", 8), survey("figure1", 8, pattern="right"), survey_cube("5.1", 4)], ids=str
)
def test_good_meshes_take_the_sweeps_that_they_took(problem: ContactProblem, monkeypatch: pytest.MonkeyPatch) -> None:
    taken, sweep = [], PatchSmoother.sweep

    def counted(self: PatchSmoother, kind: PatchKind, price: ContactPenalty | Prices | None = None) -> None:
        taken.append(kind)
        sweep(self, kind, price)

    monkeypatch.setattr(PatchSmoother, "sweep", counted)
    exact_distance(problem, (solution := solve(problem)).displacement, guaranteed_trace_bounds(solution.problem))
    assert taken == list(Sweeps.usual(problem.mesh.dim).kinds)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("name", ["survey", "layered"])
def test_what_is_not_resolved_is_about_the_error(name: str, scale: float) -> None:
    problem = BODIES[name]()
    u = solve(problem).displacement
    found = unresolved(body_data(problem, u))
    assert 0.4 < found / error_of(problem, u) < 1.1
    smaller = replace(problem, body_force=tuple(scale * np.asarray(problem.body_force)), tractions={})
    data = body_data(replace(problem, tractions={}), u)
    assert unresolved(body_data(smaller, scale * u)) == pytest.approx(scale * unresolved(data), rel=1e-10)


def test_first_tractions_are_the_nearest_by_what_they_cost() -> None:
    """At each vertex of a layered body with stretched cells; against a null space of the balance of its cells."""
    mesh = rectangle((1.0, 0.3), 4, pattern="right")
    below = np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 1] < 0.15)
    above = np.setdiff1d(np.arange(len(mesh.cells)), below)
    mesh = mesh.named(dict(mesh.boundaries), {"below": below, "above": above})
    material = Material.by_region({"below": Material.young(200.0, 0.3), "above": Material.young(10.0, 0.3)})
    problem = ContactProblem(mesh, material, supports={"left": Clamped()}, tractions={"right": (0.1, -0.2)})
    stress = first_stress(problem)
    data, table, m = stress.data, stress.data.table, stress.tractions.moments
    size = np.linalg.norm(np.linalg.inv(data.tensors.mean(axis=1)), axis=(1, 2))
    dear = (size * table.volumes)[:, None] / table.measures[table.cell_facets] ** 2
    off = dear[:, :, None, None] * (table.of_cells(m) - data.cell_moments) * table.signs[:, :, None, None]
    pull = np.zeros(m.shape)
    np.add.at(pull, table.cell_facets, off)  # half the slope of the cost by each moment
    middle = np.setdiff1d(np.arange(len(mesh.points)), table.facets[~table.interior])
    for vertex in middle:
        facets, place = np.nonzero(table.facets == vertex)
        cells = np.unique(table.owners[facets])
        C = np.zeros((len(cells), len(facets)))
        for column, facet in enumerate(facets):
            C[np.searchsorted(cells, table.owners[facet]), column] = 1.0, -1.0
        free = np.linalg.svd(C)[2][np.linalg.matrix_rank(C) :]
        assert len(free)
        assert np.abs(free @ pull[facets, place]).max() < 1e-11 * np.abs(off).max()
    assert len(middle)


def test_a_convex_law_does_without_constants_that_are_poor() -> None:
    """Constants that are smaller by far make the contact part large; the other theorem does not need any."""
    problem = graded_square(2.0)
    solution = solve(problem)
    constants = guaranteed_trace_bounds(solution.problem)
    poor = replace(
        constants, both=1e-4 * constants.both, normal=1e-4 * constants.normal, tangential=1e-6, weighted=None
    )
    good, found = (exact_distance(problem, solution.displacement, each) for each in (constants, poor))
    assert found.guaranteed
    assert error_of(problem, solution.displacement) < found.distance < 1.2 * good.distance


@pytest.mark.parametrize("contact", [True, False])
def test_a_load_with_kinks_is_answered_by_a_displacement(contact: bool) -> None:
    """A Hertzian pressure on quadratic elements: what the rule of the assembly misses was 22 times the error."""
    load = FormulaArray((0.0, Formula("-sqrt(max(0, 0.04 - (x - 0.5)^2))")), (2,))
    problem = ContactProblem(
        rectangle((1.0, 1.0), 8, pattern="cross"), Material.young(10.0, 0.3),
        {"bottom": Contact(Signorini(), Tresca(0.05))} if contact else {}, {"left": Clamped()},
        tractions={"top": load}, order=2,
    )  # fmt: skip
    solution = solve(problem)
    constants = guaranteed_trace_bounds(solution.problem) if contact else clamped_constants(problem)
    found = exact_distance(problem, solution.displacement, constants)
    assert found.guaranteed
    error = error_of(problem, solution.displacement)
    assert error < found.distance < 4.0 * error


def clamped_constants(problem: ContactProblem) -> TraceBounds:
    """Those of the body alone, with contact that asks for nothing."""
    free = replace(problem, contact={"bottom": Contact(NoContact())})
    return guaranteed_trace_bounds(discretize(free))
