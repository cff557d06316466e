"""Cells refined by choice: the mesh stays conforming, nested and of good shape, and keeps its names."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mesh import Mesh, box, rectangle
from hemivar.mesh.local_refinement import bisected
from hemivar.solvers import NonsmoothMultigrid, NonsmoothNewton
from tests import bodies

from .meshes import cube

Make = Callable[[], Mesh]
MESHES: dict[str, Make] = {
    "cross": lambda: rectangle((2.0, 1.0), (4, 2)),
    "right": lambda: rectangle((2.0, 1.0), (4, 2), "right").rotated(0.4),
    "box": lambda: box((1.0, 2.0, 1.0), (2, 4, 2)),
    "cube": lambda: cube(2).moved(np.diag([1.0, 2.0, 0.5]), (1.0, 0.0, -1.0)),
}


def lengths(mesh: Mesh) -> Array:
    """The longest edges of the cells, (M,)."""
    ends = mesh.points[mesh.edges]
    longest: Array = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1)[mesh.cell_edges].max(axis=1)
    return longest


def shapes(mesh: Mesh) -> Array:
    """Volume by the longest edge, which is 0 for a degenerate cell, (M,)."""
    return np.asarray(mesh.volumes / lengths(mesh) ** mesh.dim)


def around(mesh: Mesh, count: int) -> Array:
    """The cells nearest to the first corner."""
    middle = mesh.points[mesh.cells].mean(axis=1)
    return np.argsort(np.linalg.norm(middle - mesh.points[0], axis=1), kind="stable")[:count]


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("seed", [0, 1])
def test_refined_meshes_are_sound(name: str, seed: int) -> None:
    """By the constructor's checks: conforming, positive, named facets outside, made of the parent's cells."""
    rng, mesh = np.random.default_rng(seed), MESHES[name]()
    volume, surface = mesh.volumes.sum(), mesh.facet_normals(mesh.boundary_facets)[1].sum()
    areas = {key: mesh.facet_normals(facets)[1].sum() for key, facets in mesh.boundaries.items()}
    for _ in range(4):
        before = mesh
        mesh = mesh.refined_where(rng.choice(mesh.number_of_cells, 2 + mesh.number_of_cells // 60, replace=False))
        assert mesh.number_of_cells > before.number_of_cells
        Mesh(mesh.points, mesh.cells, mesh.boundaries, mesh.regions, mesh.parent)
        assert mesh.volumes.sum() == pytest.approx(volume, rel=1e-13)
        # A crack between cells that do not meet would be surface.
        assert mesh.facet_normals(mesh.boundary_facets)[1].sum() == pytest.approx(surface, rel=1e-13)
        for key, facets in mesh.boundaries.items():
            assert mesh.facet_normals(facets)[1].sum() == pytest.approx(areas[key], rel=1e-13)
        coarse: Mesh | None = mesh
        while coarse is not None and coarse.parent is not None:
            coarse = coarse.parent.mesh
            Mesh(coarse.points, coarse.cells, coarse.boundaries, coarse.regions, coarse.parent)


@pytest.mark.parametrize("name", MESHES)
def test_chosen_cells_are_cut(name: str) -> None:
    """Each cell that was asked for is covered by cells of at most half its volume, red ones by 2^d equal parts."""
    mesh = MESHES[name]()
    for _ in range(3):
        chosen = around(mesh, 3)
        where, volumes = mesh.points[mesh.cells[chosen]].mean(axis=1), mesh.volumes[chosen]
        mesh = mesh.refined_where(chosen)
        first = mesh.points[mesh.cells[:, 0]]
        inverse = np.linalg.inv(np.swapaxes(mesh.points[mesh.cells[:, 1:]] - first[:, None], 1, 2))
        for x, volume in zip(where, volumes, strict=True):
            inside = np.einsum("mij,mj->mi", inverse, x - first)
            here = (inside > -1e-12).all(axis=1) & (inside.sum(axis=1) < 1.0 + 1e-12)
            assert mesh.volumes[here].max() <= 0.5 * volume * (1.0 + 1e-12)


@pytest.mark.parametrize("name", MESHES)
def test_shapes_do_not_degrade(name: str) -> None:
    mesh = MESHES[name]()
    worst, counts = shapes(mesh).min(), [mesh.number_of_cells]
    for _ in range(8):
        mesh = mesh.refined_where(around(mesh, 4))
        counts.append(mesh.number_of_cells)
        # Two cuts of a green closure in space, one in the plane, each halving; in space red cells are of a few shapes.
        assert shapes(mesh).min() > 0.99 * worst / 2.0 ** (mesh.dim - 1) * (1.0 if name != "cube" else 0.5)
    # Towards a corner the number of cells grows by as many in every generation.
    growth = np.diff(counts)
    assert growth[3:].max() <= growth[:3].max() * 2


@pytest.mark.parametrize("name", MESHES)
def test_all_cells_refined_are_the_refined_mesh(name: str) -> None:
    mesh = MESHES[name]()
    all_of_them = mesh.refined_where(np.ones(mesh.number_of_cells, dtype=bool))
    uniform = mesh.refined()
    for one in (all_of_them, uniform):
        assert one.number_of_cells == mesh.number_of_cells * 2**mesh.dim
    np.testing.assert_allclose(all_of_them.points, uniform.points, rtol=0.0, atol=1e-14)

    def sets(of: Mesh) -> set[tuple[int, ...]]:
        return {tuple(sorted(cell)) for cell in of.cells.tolist()}

    assert sets(all_of_them) == sets(uniform)


def test_closures_are_taken_back() -> None:
    """A green cell that is asked for becomes part of a red one: the cell that it closed is cut into four."""
    mesh = rectangle((1.0, 1.0), (2, 2), "right")
    once = mesh.refined_where([0])
    assert once.parent is not None
    parts = np.bincount(once.parent.cells, minlength=mesh.number_of_cells)
    green = int(np.flatnonzero(parts == 2)[0])
    twice = once.refined_where(np.flatnonzero(once.parent.cells == green)[:1])
    assert twice.parent is not None
    assert twice.parent.mesh is mesh
    assert np.bincount(twice.parent.cells, minlength=mesh.number_of_cells)[green] == 4


def test_coarser_meshes_are_kept_where_nothing_changes() -> None:
    """So that what a workspace knows of them holds on."""
    mesh = rectangle((1.0, 1.0), (8, 8))
    once = mesh.refined_where(around(mesh, 6))
    twice = once.refined_where(np.flatnonzero(once.volumes <= 1.001 * once.volumes.min())[:1])
    assert once.parent is not None
    assert once.parent.mesh is mesh
    chain = []
    coarse: Mesh | None = twice
    while coarse is not None:
        chain.append(coarse)
        coarse = coarse.parent.mesh if coarse.parent else None
    assert mesh in chain


def test_regions_and_names_follow_the_cells() -> None:
    mesh = rectangle((2.0, 1.0), (4, 2))
    left = np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 0] < 1.0)
    mesh = Mesh(mesh.points, mesh.cells, mesh.boundaries, {"left": left})
    for _ in range(4):
        mesh = mesh.refined_where(around(mesh, 5))
    x = mesh.points[mesh.cells].mean(axis=1)[:, 0]
    np.testing.assert_array_equal(np.sort(mesh.regions["left"]), np.flatnonzero(x < 1.0))
    normals, _ = mesh.facet_normals(mesh.boundaries["bottom"])
    np.testing.assert_allclose(normals, [[0.0, -1.0]] * len(normals), atol=1e-14)


def test_nothing_chosen_is_the_mesh_itself() -> None:
    mesh = rectangle((1.0, 1.0), (2, 2))
    assert mesh.refined_where([]) is mesh
    assert mesh.refined_where(np.zeros(mesh.number_of_cells, dtype=bool)) is mesh


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ([99], "valid numbers are 0 to 7"),
        ([-1], "valid numbers"),
        (np.ones(3, dtype=bool), "give a mask of shape \\(8,\\)"),
        ([[0, 1]], "give a list of their numbers"),
        (["a"], "must hold whole numbers"),
        ([float("nan")], "must hold whole numbers"),
        ([0.5], "must hold whole numbers"),
    ],
)
def test_what_cannot_be_refined_is_refused(cells: object, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        rectangle((1.0, 1.0), (2, 2)).refined_where(cells)


# ---- solving on them --------------------------------------------------------------------------------------


def rubbing_body(mesh: Mesh) -> hv.DiscreteProblem:
    force = (-0.2, *([0.0] * (mesh.dim - 2)), -0.8)
    law = hv.Contact(hv.Compliance(20.0), hv.Tresca(0.02))
    return hv.discretize(bodies.body(mesh, law, body_force=force))


@pytest.mark.parametrize(("mesh", "times"), [("cross", 6), ("box", 2)])
def test_multigrid_takes_hardly_more_cycles_than_on_uniform_meshes(mesh: str, times: int) -> None:
    """Small cells beside coarse ones, towards both ends of the contact boundary."""
    local = MESHES[mesh]()
    for _ in range(times):
        middle = local.points[local.cells].mean(axis=1)[:, [0, -1]]
        size = local.points[:, 0].max()
        near = np.minimum(np.hypot(*middle.T), np.hypot(middle[:, 0] - size, middle[:, 1]))
        local = local.refined_where(
            np.argsort(-(local.volumes ** (1.0 / local.dim)) / (0.02 + near))[: len(middle) // 4]
        )
    even = rectangle((2.0, 1.0), (32, 16)) if local.dim == 2 else box((1.0, 2.0, 1.0), (4, 8, 4))
    assert local.volumes.min() < 1.001 * 4.0**-local.dim * local.volumes.max()
    problem, other = rubbing_body(local), rubbing_body(even)
    found, reference = hv.solve(problem, NonsmoothMultigrid()), hv.solve(other, NonsmoothMultigrid())
    assert found.status is hv.Status.CONVERGED
    assert found.evaluations <= 1.5 * reference.evaluations
    direct = hv.solve(problem, NonsmoothNewton())
    size = np.abs(direct.unknowns).max()
    np.testing.assert_allclose(found.unknowns, direct.unknowns, rtol=0.0, atol=1e-6 * size)
    assert found.energy == pytest.approx(direct.energy, rel=1e-10)


@pytest.mark.parametrize("name", MESHES)
def test_halved_cells_come_nearer_to_good_shapes(name: str) -> None:
    """Flat cells halved at their longest edges: sound meshes, named alike, cells at most half as long in the end."""
    whole = MESHES[name]()
    points, half_of_them = whole.points.copy(), np.arange(whole.number_of_cells // 2)
    points[:, -1] *= 0.02
    mesh = Mesh(points, whole.cells, dict(whole.boundaries), {"half": half_of_them})
    volume, half = mesh.volumes.sum(), mesh.volumes[mesh.regions["half"]].sum()
    areas = {key: mesh.facet_normals(facets)[1].sum() for key, facets in mesh.boundaries.items()}
    chosen = np.zeros(mesh.number_of_cells, dtype=bool)
    chosen[around(mesh, 3)] = True
    longest = lengths(mesh)[chosen].max()
    for _ in range(6):
        finer, parent = bisected(mesh, chosen)
        Mesh(finer.points, finer.cells, finer.boundaries, finer.regions)
        assert np.bincount(parent)[chosen].min() >= 2
        assert np.bincount(parent, weights=finer.volumes) == pytest.approx(mesh.volumes, rel=1e-12)
        mesh, chosen = finer, chosen[parent]
    assert mesh.volumes.sum() == pytest.approx(volume, rel=1e-12)
    assert mesh.volumes[mesh.regions["half"]].sum() == pytest.approx(half, rel=1e-12)
    for key, facets in mesh.boundaries.items():
        assert mesh.facet_normals(facets)[1].sum() == pytest.approx(areas[key], rel=1e-12)
    assert lengths(mesh)[chosen].max() <= 0.51 * longest
