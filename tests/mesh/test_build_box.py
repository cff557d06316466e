"""The built-in box, uniform refinement of tetrahedra, and curved surfaces from Gmsh."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize, interpolate
from hemivar.laws import Signorini
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material
from hemivar.mesh import Mesh, box, read_mesh, rectangle
from hemivar.mesh.keys import distinct_pairs

NORMALS = {
    "left": (-1, 0, 0),
    "right": (1, 0, 0),
    "front": (0, -1, 0),
    "back": (0, 1, 0),
    "bottom": (0, 0, -1),
    "top": (0, 0, 1),
}
AREAS = {"left": 6.0, "right": 6.0, "front": 3.0, "back": 3.0, "bottom": 2.0, "top": 2.0}


def shapes(mesh: Mesh) -> float:
    """The worst of the cells: volume over the cube of the longest edge."""
    ends = mesh.points[mesh.edges[mesh.cell_edges]]
    longest = np.linalg.norm(ends[:, :, 0] - ends[:, :, 1], axis=2).max(axis=1)
    return float((mesh.volumes / longest**3).min())


def cells_by_place(mesh: Mesh) -> set[tuple[tuple[float, ...], ...]]:
    corners = np.round(mesh.points[mesh.cells], 9) + 0.0
    return {tuple(sorted(map(tuple, cell))) for cell in corners.tolist()}


def test_box_is_a_valid_mesh_with_outward_boundaries() -> None:
    mesh = box((1.0, 2.0, 3.0), (2, 3, 4), origin=(-1.0, 0.5, 2.0))
    checked = Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))  # conforming, no cell inverted, facets outside
    assert mesh.volumes.min() > 0.0
    assert mesh.volumes.sum() == pytest.approx(6.0)
    np.testing.assert_allclose([mesh.points.min(axis=0), mesh.points.max(axis=0)], [[-1, 0.5, 2], [0, 2.5, 5]])
    assert sum(len(facets) for facets in mesh.boundaries.values()) == len(checked.boundary_facets)
    for name, normal in NORMALS.items():
        found, areas = mesh.facet_normals(mesh.boundaries[name])
        np.testing.assert_allclose(found, np.broadcast_to(normal, found.shape), atol=1e-14)
        assert areas.sum() == pytest.approx(AREAS[name])


def test_refined_box_is_a_box() -> None:
    coarse, fine = box((1.0, 2.0, 0.7), (1, 2, 3)), box((1.0, 2.0, 0.7), (4, 8, 12))
    twice = coarse.refined(2)
    assert cells_by_place(twice) == cells_by_place(fine)
    Mesh(twice.points, twice.cells, dict(twice.boundaries))
    for name, normal in NORMALS.items():
        assert len(twice.boundaries[name]) == len(fine.boundaries[name])
        found, _ = twice.facet_normals(twice.boundaries[name])
        np.testing.assert_allclose(found, np.broadcast_to(normal, found.shape), atol=1e-14)
    assert shapes(twice) == pytest.approx(shapes(coarse), rel=1e-12)


def test_refinement_keeps_numbers_regions_and_the_shape_of_any_tetrahedron() -> None:
    rng = np.random.default_rng(11)
    for _ in range(20):
        mesh = Mesh.oriented(rng.normal(size=(4, 3)), [[0, 1, 2, 3]], regions={"all": [0]})
        levels = [mesh.refined(times) for times in range(5)]
        assert shapes(levels[4]) >= shapes(levels[2]) * (1.0 - 1e-9)
        for coarse, fine in pairwise(levels):
            Mesh(fine.points, fine.cells)
            count = coarse.number_of_nodes
            np.testing.assert_array_equal(fine.points[:count], coarse.points)
            np.testing.assert_allclose(fine.points[count:], coarse.points[coarse.edges].mean(axis=1), atol=1e-14)
            assert fine.volumes.sum() == pytest.approx(mesh.volumes.sum(), rel=1e-12)
            children = fine.volumes.reshape(8, -1)  # those of cell c are c + k M
            np.testing.assert_allclose(children.sum(axis=0), coarse.volumes, rtol=1e-10)
            assert len(fine.regions["all"]) == fine.number_of_cells


REFINED = [box((1, 2, 3), (2, 4, 6)), box(cells=2).refined(), rectangle(cells=4, pattern="cross")]


@pytest.mark.parametrize("mesh", REFINED)
def test_parent_interpolates_its_own_fields(mesh: Mesh) -> None:
    assert mesh.parent is not None
    coarse = mesh.parent.mesh
    values = np.random.default_rng(4).normal(size=coarse.number_of_nodes)
    np.testing.assert_allclose(mesh.parent.interpolation @ values, interpolate(coarse, values, mesh.points), atol=1e-12)


def test_boxes_of_odd_numbers_have_no_parent() -> None:
    assert box(cells=(2, 2, 3)).parent is None


def test_edges_are_sorted_pairs_and_belong_to_their_cells() -> None:
    mesh = box(cells=3)
    local = np.array([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)])
    np.testing.assert_array_equal(mesh.edges[mesh.cell_edges], np.sort(mesh.cells[:, local], axis=2))
    np.testing.assert_array_equal(np.unique(mesh.edges, axis=0), mesh.edges)


@pytest.mark.parametrize("largest", [50, 2**29])
def test_distinct_pairs_of_small_and_large_numbers(largest: int) -> None:
    """The second does not fit into 64 bits together with its places."""
    rng = np.random.default_rng(5)
    numbers = np.concatenate([[0, largest], rng.integers(0, largest, 30)])
    first, second = rng.choice(numbers, (2, 500))
    pairs = np.sort(np.column_stack([first, second]), axis=1)
    expected, inverse = np.unique(pairs, axis=0, return_inverse=True)
    found, number = distinct_pairs(first, second)
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(number, inverse.ravel())


@pytest.mark.parametrize(
    "arguments",
    [{"size": (1, 1)}, {"size": (1, 0, 1)}, {"size": (1, np.nan, 1)}, {"cells": 0}, {"cells": (2, 2)}, {"cells": 1.5},
     {"origin": (0, 0)}, {"size": "abc"}],
)  # fmt: skip
def test_bad_boxes_are_refused(arguments: dict[str, object]) -> None:
    with pytest.raises(ProblemError, match=r"three|positive|whole numbers|finite|not an array of numbers"):
        box(**arguments)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def gmsh_balls(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Octants of the unit ball, below and beside the planes of symmetry, of two mesh sizes."""
    gmsh = pytest.importorskip("gmsh")
    folder = tmp_path_factory.mktemp("balls")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for size in (0.2, 0.1):
            gmsh.model.add(f"ball {size}")
            ball = gmsh.model.occ.addSphere(0, 0, 0, 1)
            corner = gmsh.model.occ.addBox(0, 0, -1, 1, 1, 1)
            gmsh.model.occ.intersect([(3, ball)], [(3, corner)])
            gmsh.model.occ.synchronize()
            flat = {"left": [], "front": [], "top": [], "ground": []}
            for _, tag in gmsh.model.getEntities(2):
                x, y, z = gmsh.model.occ.getCenterOfMass(2, tag)
                name = "left" if x < 1e-6 else "front" if y < 1e-6 else "top" if z > -1e-6 else "ground"
                flat[name].append(tag)
            for name, tags in flat.items():
                gmsh.model.addPhysicalGroup(2, tags, name=name)
            gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="body")
            gmsh.option.setNumber("Mesh.MeshSizeMin", size)
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)
            gmsh.model.mesh.generate(3)
            gmsh.write(str(folder / f"{size}.msh"))
            gmsh.model.remove()
    finally:
        gmsh.finalize()
    return folder


def test_normals_on_a_sphere_from_gmsh(gmsh_balls: Path) -> None:
    """Physical surfaces are boundaries; nodal normals differ from the radius by O(h)."""
    errors = []
    for size in (0.2, 0.1):
        mesh = read_mesh(gmsh_balls / f"{size}.msh")
        assert mesh.dim == 3
        assert set(mesh.boundaries) == {"left", "front", "top", "ground"}
        assert len(mesh.regions["body"]) == mesh.number_of_cells
        assert mesh.volumes.sum() == pytest.approx(np.pi / 6.0, rel=2.0 * size**2)
        problem = ContactProblem(
            mesh=mesh,
            material=Material.lame(1.0, 1.0),
            supports={"top": Clamped()},
            contact={"ground": Contact(Signorini())},
        )
        discrete = discretize(problem)
        error = np.linalg.norm(discrete.contact.frames[:, 0] - discrete.contact.points, axis=1)
        inner = (discrete.contact.points[:, :2] > 1e-9).all(axis=1)
        assert error.max() < size
        errors.append(error[inner].max())
        assert discrete.contact.weights.sum() == pytest.approx(
            np.pi / 2.0, rel=0.1 + size
        )  # the clamped rim has no points
    assert errors[1] < 0.8 * errors[0]
