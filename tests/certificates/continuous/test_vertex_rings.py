"""Rings of cells around inner vertices: all of them, in turn, solved as patches of any shape are; admissible always."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.certificates.continuous.admissible_stress import admissible_stress
from hemivar.certificates.continuous.body_data import BodyData, body_data
from hemivar.certificates.continuous.facet_table import facet_table
from hemivar.certificates.continuous.patches import PatchKind, coloured, patch_batches
from hemivar.certificates.continuous.sweeps import PatchSmoother
from hemivar.certificates.continuous.vertex_rings import VertexRings
from hemivar.mechanics import Clamped, ContactProblem
from hemivar.mesh import rectangle
from hemivar.mesh.mesh import Mesh

from .admissibility import imbalance
from .bodies import anisotropic, plane_mesh


def renumbered(mesh: Mesh, seed: int = 4) -> Mesh:
    """The same mesh with its nodes in another order."""
    order = np.random.default_rng(seed).permutation(mesh.number_of_nodes)
    place = np.argsort(order)
    boundaries = {name: place[facets] for name, facets in mesh.boundaries.items()}
    return Mesh(mesh.points[order], place[mesh.cells], boundaries, dict(mesh.regions))


def uneven() -> Mesh:
    """Rings of three to a dozen cells, refined in a corner."""
    mesh = rectangle((1.0, 1.0), 4, pattern="right")
    for _ in range(2):
        mesh = mesh.refined_where(np.linalg.norm(mesh.points[mesh.cells].mean(axis=1), axis=1) < 0.5)
    return renumbered(mesh)


def pulled(mesh: Mesh, stretch: float = 1.0, seed: int = 2) -> BodyData:
    """A body that is clamped on the left, with a displacement at random."""
    mesh = mesh.moved(np.diag([1.0, stretch]))
    problem = ContactProblem(mesh, anisotropic(2), supports={"left": Clamped()}, tractions={"right": (0.3, 0.2)})
    return body_data(problem, np.random.default_rng(seed).normal(size=mesh.points.shape) * [1.0, stretch])


@pytest.mark.parametrize("mesh", [plane_mesh(3), renumbered(plane_mesh(4)), uneven()], ids=["", "renumbered", "uneven"])
def test_rings_are_the_patches_of_all_vertices_inside(mesh: Mesh) -> None:
    table = facet_table(mesh)
    rings = VertexRings.of(table)
    inside = np.ones(mesh.number_of_nodes, dtype=bool)
    inside[mesh.boundary_facets] = False
    assert np.array_equal(rings.vertices, inside)
    expected = {}
    for batch in patch_batches(table, PatchKind.VERTEX, np.ones(len(table.facets), dtype=bool), inside):
        for facets, cells in zip(batch.facets, batch.cells, strict=True):
            expected[frozenset(facets.tolist())] = frozenset(cells.tolist())
    found = {}
    for corners, batch in zip(rings.batches, rings.as_batches(), strict=True):
        assert len(np.unique(batch.cells)) == batch.cells.size  # they share no cell
        assert (rings.nodes[corners] == rings.nodes[corners[0]]).all()
        assert np.array_equal(rings.following[corners], np.roll(corners, -1, axis=0))
        for facets, cells in zip(batch.facets, batch.cells, strict=True):
            found[frozenset(facets.tolist())] = frozenset(cells.tolist())
    assert found == expected


@pytest.mark.parametrize("stretch", [1.0, 1e-2, 1e2])
@pytest.mark.parametrize("mesh", [renumbered(plane_mesh(4)), uneven()], ids=["renumbered", "uneven"])
def test_closed_form_gives_what_patches_of_any_shape_give(mesh: Mesh, stretch: float) -> None:
    """Twice, so that the second sweep starts from what the first has left; on stretched meshes by the misfit."""
    stress = admissible_stress(pulled(mesh, stretch))
    quick, general = PatchSmoother(stress), PatchSmoother(stress, general=True)
    for _ in range(2):
        for sweeper in (quick, general):
            sweeper.sweep(PatchKind.VERTEX)
        found, expected = quick.stress, general.stress
        if stretch == 1.0:
            moments = expected.tractions.moments
            assert found.tractions.moments == pytest.approx(moments, abs=1e-11 * np.abs(moments).max())
        assert found.misfit.sum() == pytest.approx(expected.misfit.sum(), rel=1e-6)
    assert quick.stress.misfit.sum() < 0.9 * stress.misfit.sum()
    assert imbalance(quick.stress, 1, order=1) < 1e-12


def test_rings_whose_energy_is_not_definite_stay() -> None:
    data = pulled(renumbered(plane_mesh(6)))
    stress = admissible_stress(data)
    rings = VertexRings.of(data.table)
    cell = int(np.flatnonzero(rings.vertices[data.table.cells].all(axis=1))[0])
    for spoiled in (-1e3, np.nan):
        compliance = data.reference_compliance.copy()
        compliance[cell] *= spoiled
        moments, difference = stress.tractions.moments.copy(), stress.difference.copy()
        rings.improve(compliance, difference, moments)
        own = data.table.cell_facets[cell]
        assert np.array_equal(moments[own], stress.tractions.moments[own])
        assert (moments != stress.tractions.moments).any(axis=(1, 2)).sum() > len(moments) // 2
        swept = stress.with_moments(moments)
        assert imbalance(swept, 1, order=1) < 1e-13
        if np.isfinite(spoiled):  # what was kept in step is what the tractions have
            assert difference == pytest.approx(swept.difference, abs=1e-12 * np.abs(difference).max())


def test_bodies_of_other_units_have_the_same_stress() -> None:
    data = pulled(uneven())
    base = admissible_stress(data)
    small = data.problem.mesh.moved(1e-6 * np.eye(2))
    problem = replace(data.problem, mesh=small, tractions={"right": (0.3e6, 0.2e6)})
    other = admissible_stress(body_data(problem, data.displacement))
    moments = []
    for stress in (base, other):
        sweeper = PatchSmoother(stress)
        sweeper.sweep(PatchKind.VERTEX)
        moments.append(sweeper.stress.tractions.moments)
    assert moments[1] == pytest.approx(moments[0], abs=1e-11 * np.abs(moments[0]).max())


def test_patches_that_come_first_take_the_first_colours() -> None:
    table = facet_table(rectangle((1.0, 1.0), 6, pattern="cross"))
    middle = (np.rint(12.0 * table.mesh.points) % 2 == 1).all(axis=1)  # of squares: every cell has one
    assert middle.sum() == 36
    colours = coloured(table.cells, table.mesh.number_of_nodes, first=np.where(middle, 0, 1))
    assert np.array_equal(colours == 0, middle)
    assert all((colours[table.cells[:, i]] != colours[table.cells[:, j]]).all() for i, j in ((0, 1), (0, 2), (1, 2)))
