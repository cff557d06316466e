"""Sweeps: the same equilibrium, less misfit; patches and colours; against a minimisation over all tractions at once."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import contact_traces
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.patches import PatchKind, coloured, patch_batches, rigid_modes
from hemivar.bounds.sweeps import ContactPenalty, PatchSmoother
from hemivar.gallery.survey_problems import survey
from hemivar.mechanics import Clamped, ContactProblem, Material
from hemivar.mesh import rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.solvers import solve
from tests.samples import sampled

from .admissibility import imbalance
from .bodies import BODIES, VARYING, plane_mesh, space_mesh

KINDS = (PatchKind.FACET, PatchKind.EDGE, PatchKind.VERTEX)


def first_stress(name: str) -> AdmissibleStress:
    problem = BODIES[name]()
    return admissible_stress(body_data(problem, solve(problem).displacement))


@pytest.mark.parametrize("name", BODIES)
def test_sweeps_keep_equilibrium_and_lower_the_misfit(name: str) -> None:
    stress = first_stress(name)
    data = stress.data
    sweeper = PatchSmoother(stress)
    before, first = _energy(stress), stress.misfit.sum()
    for kind in (*KINDS, PatchKind.VERTEX):
        sweeper.sweep(kind)
        after = _energy(sweeper.stress)
        assert after < before * (1.0 + 1e-14)
        before = after
    swept = sweeper.stress
    assert swept.misfit.sum() < 0.4 * first
    assert imbalance(swept, 1, order=1 if name in VARYING else 2) < 1e-13
    given = ~data.unknown.any(axis=(1, 2))
    assert np.array_equal(swept.tractions.moments[given], stress.tractions.moments[given])
    loose = np.eye(data.table.dim) - data.unknown
    change = np.einsum("fij,faj->fai", loose, swept.tractions.moments - stress.tractions.moments)
    assert np.abs(change).max() < 1e-14 * np.abs(swept.tractions.moments).max()


def test_sweeps_leave_stresses_that_others_have_seen_as_they_are() -> None:
    stress = first_stress(next(iter(BODIES)))
    sweeper, own = PatchSmoother(stress), PatchSmoother(first_stress(next(iter(BODIES))), own=True)
    seen = [stress, sweeper.stress]
    kept = [each.tractions.moments.copy() for each in seen]
    room = own.moments
    for one in (sweeper, own):
        one.sweep(PatchKind.VERTEX)
    seen.append(sweeper.stress)
    kept.append(sweeper.moments.copy())
    sweeper.sweep(PatchKind.VERTEX)
    own.sweep(PatchKind.VERTEX)
    for before, moments in zip(seen, kept, strict=True):
        assert np.array_equal(before.tractions.moments, moments)
    assert own.moments is room
    assert np.array_equal(own.moments, sweeper.moments)
    assert own.misfit == sweeper.misfit


def _energy(stress: AdmissibleStress) -> float:
    """The misfit in the compliance of the mean elasticity matrix, which sweeps lower."""
    values = stress.element.at_nodes(stress.difference)
    return float(stress.element.energy(values, stress.data.reference_compliance).sum())


@pytest.mark.parametrize(
    ("thin", "name"),
    sampled(itertools.product((1e-2, 1e-3, 1e-4, 1e-6, 1e-9), ("layered", "layered, quadratic", "pulled cube")), 7),
)
def test_flat_cells_lose_no_balance(name: str, thin: float) -> None:
    """A body thousand times as high as it is wide, and its cells: what rounding leaves unbalanced is not changed."""
    problem = BODIES[name]()
    flat = np.diag([thin, *np.ones(problem.mesh.dim - 1)])
    u = solve(problem).displacement @ flat
    problem = replace(problem, mesh=problem.mesh.moved(flat))
    stress = admissible_stress(body_data(problem, u))
    # On cells 1e9 times as high as wide the order of elimination decides: 0.6e-14 and 2.5e-14 by the two ways.
    assert imbalance(stress, 1, order=1) < (1e-14 if thin > 1e-8 else 4e-14)
    for compiled in (False, True):
        sweeper, before = PatchSmoother(stress, compiled), _energy(stress)
        for _ in range(2):
            sweeper.sweep(PatchKind.VERTEX if problem.mesh.dim == 2 else PatchKind.EDGE)
            after = _energy(sweeper.stress)
            assert after < before or thin < 1e-3  # where it is all rounding it may rise, and is told
            before = after
        assert imbalance(sweeper.stress, 1, order=1) < 1e-12 * max(1.0, (1e-3 / thin) ** 2)


@pytest.mark.parametrize("name", ["survey", "layered", "graded", "cube", "pulled cube"])
def test_contact_tractions_are_freed_at_a_price(name: str) -> None:
    """The sum of misfit and price falls; the balance holds with the new forces."""
    stress = first_stress(name)
    traces = contact_traces(stress.data)
    assert traces is not None
    wanted = traces.allowed(traces.forces(stress.tractions.moments))
    price = ContactPenalty(traces.facets, traces.moments(wanted), 0.5)

    def cost(of: AdmissibleStress) -> float:
        linear = traces.forces(
            traces.on_facets(-price.wanted) + stress.data.facet_loads
        )  # what linear tractions see of zeta
        along, across = traces.square(traces.forces(of.tractions.moments) - linear)
        return _energy(of) + 0.5 * float(along.sum() + across.sum())

    sweeper = PatchSmoother(stress)
    before = cost(stress)
    for kind in KINDS:
        sweeper.sweep(kind, price)
        after = cost(sweeper.stress)
        assert after < before * (1.0 + 1e-13)
        before = after
    swept = sweeper.stress
    assert imbalance(swept, 2, order=1 if name in VARYING else 2) < 1e-13
    assert np.abs(swept.tractions.moments - stress.tractions.moments)[stress.data.contact >= 0].max() > 1e-4


def test_contact_tractions_settle_last() -> None:
    """In the plane those of the boundary are improved behind the rest: more of it alone changes next to nothing."""
    problem = survey("5.1", 8)
    stress = admissible_stress(body_data(problem, solve(problem).displacement))
    traces = contact_traces(stress.data)
    assert traces is not None
    price = ContactPenalty(traces.facets, traces.moments(traces.allowed(traces.forces(stress.tractions.moments))), 0.5)
    sweeper = PatchSmoother(stress)
    sweeper.sweep(PatchKind.VERTEX, price)
    swept = sweeper.stress.tractions.moments
    sweeper.sweep(PatchKind.VERTEX, price, only_contact=True)
    assert np.abs(sweeper.stress.tractions.moments - swept).max() < 5e-3 * np.abs(swept).max()


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1)])
def test_a_patch_of_the_whole_body_finds_the_least_misfit(dim: int, order: int) -> None:
    """All facets at one inner vertex are a patch; against a minimisation with a null space of all its conditions."""
    if dim == 2:
        mesh = rectangle((1.0, 1.0), 1, pattern="cross")
        mesh = mesh.moved([[1.0, 0.2], [0.0, 1.1]])
    else:
        corners = np.vstack([np.zeros(3), np.eye(3)]) * np.array([1.0, 1.2, 0.9])
        points = np.vstack([corners, [[0.3, 0.25, 0.2]]])
        cells = [[4 if a == i else a for a in range(4)] for i in range(4)]
        mesh = Mesh.oriented(points, np.array(cells))
    mesh = mesh.named({"all": mesh.boundary_facets}, {})
    problem = ContactProblem(mesh, Material.lame(3.0, 2.0), tractions={"all": (0.0,) * dim}, order=order)
    u = np.random.default_rng(3).normal(size=mesh.nodes(order).shape)
    stress = admissible_stress(body_data(problem, u))
    sweeper = PatchSmoother(stress)
    sweeper.sweep(PatchKind.VERTEX)
    least = _least_misfit(stress)
    for _ in range(60):
        sweeper.sweep(PatchKind.VERTEX)
    assert sweeper.stress.misfit.sum() == pytest.approx(least, rel=1e-9)
    assert stress.misfit.sum() > 1.05 * least


def _least_misfit(stress: AdmissibleStress) -> float:
    """Of all stresses with the same loads, by dense linear algebra."""
    data, table = stress.data, stress.data.table
    dim, inner = table.dim, np.flatnonzero(table.interior)
    count = data.facet_nodes.shape[1]
    columns = []
    for facet in inner:
        for way in np.eye(count * dim):
            change = np.zeros((len(table.facets), count, dim))
            change[facet] = way.reshape(count, dim)
            columns.append(change)
    places = table.mesh.nodes(data.order)[data.facet_nodes][table.cell_facets]
    modes = rigid_modes(places)
    C = np.stack([np.einsum("mfarc,mfac->mr", modes, table.of_cells(change)).ravel() for change in columns], axis=1)
    values = np.linalg.svd(C)
    rank = int((values[1] > 1e-10 * values[1][0]).sum())
    free = values[2][rank:]
    start = stress.difference
    shapes = []
    for way in free:
        moments = stress.tractions.moments + np.tensordot(way, np.stack(columns), axes=1)
        shapes.append(stress.with_moments(moments).difference - start)

    def product(a: Array, b: Array) -> float:
        element, compliance = stress.element, data.reference_compliance
        both = element.energy(element.at_nodes(a + b), compliance).sum()
        return float(0.25 * (both - element.energy(element.at_nodes(a - b), compliance).sum()))

    gram = np.array([[product(a, b) for b in shapes] for a in shapes])
    right = np.array([product(a, start) for a in shapes])
    return product(start, start) - float(right @ np.linalg.solve(gram, right))


@pytest.mark.parametrize("mesh", [plane_mesh(5), space_mesh(2)], ids=["plane", "space"])
@pytest.mark.parametrize("kind", KINDS)
def test_patches_of_one_batch_share_no_cell_and_all_facets_have_one(mesh: Mesh, kind: PatchKind) -> None:
    table = facet_table(mesh)
    free = np.ones(len(table.facets), dtype=bool)
    batches = patch_batches(table, kind, free)
    seen = np.zeros(len(table.facets), dtype=int)
    for batch in batches:
        cells = batch.cells.ravel()
        assert len(np.unique(cells)) == len(cells)
        np.add.at(seen, batch.facets.ravel(), 1)
        at = table.cell_facets[batch.cells]
        for place, facets in ((batch.local[0], batch.facets[0]),):
            inside = place < len(facets)
            assert np.array_equal(facets[place[inside]], at[0][inside])
            assert not np.isin(at[0][~inside], facets).any()
        assert (batch.local < batch.facets.shape[1]).any(axis=2).all()  # every cell has a facet of the patch
    per_facet = {PatchKind.FACET: 1, PatchKind.EDGE: {2: 1, 3: 3}[table.dim], PatchKind.VERTEX: table.dim}[kind]
    assert (seen == per_facet).all()


def test_colours_are_few_and_the_same_each_time() -> None:
    table = facet_table(plane_mesh(12))
    colours = coloured(table.cells, table.mesh.number_of_nodes)
    assert np.array_equal(colours, coloured(table.cells, table.mesh.number_of_nodes))
    ends = table.mesh.edges
    assert (colours[ends[:, 0]] != colours[ends[:, 1]]).all()
    assert colours.max() < 8
    some = np.where(np.arange(table.mesh.number_of_nodes) % 2 == 0, table.cells[0, 0], -1)
    assert coloured(some[:, None], table.mesh.number_of_nodes).min() >= 0  # those of no cell have a colour too


def test_a_stress_without_free_facets_stays() -> None:
    mesh = rectangle((1.0, 1.0), 1, pattern="right")
    problem = ContactProblem(mesh, Material.lame(1.0, 1.0), supports={"left": Clamped()})
    stress = admissible_stress(body_data(problem, np.zeros(mesh.points.shape)))
    sweeper = PatchSmoother(stress)
    sweeper.sweep(PatchKind.VERTEX)
    assert sweeper.stress.misfit.sum() == pytest.approx(0.0, abs=1e-28)
