"""Cells of other kinds, made into simplices that fit together: volumes, facets, and patches of linear displacement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.mesh import Mesh, read_mesh
from hemivar.mesh.kinds import SHAPES

Blocks = dict[str, list[list[int]]]
GRADIENT = np.array([[0.3, -0.2, 0.1], [0.5, 0.2, -0.4], [0.1, 0.3, 0.2]])


def plane_cells(n: int, rng: np.random.Generator) -> tuple[np.ndarray, Blocks]:
    """A unit square of quadrilaterals and triangles, its inner nodes shaken."""
    grid = np.linspace(0.0, 1.0, n + 1)
    points = np.array([[x, y] for y in grid for x in grid])
    inner = ((points > 0.0) & (points < 1.0)).all(axis=1)
    points[inner] += 0.15 / n * rng.uniform(-1.0, 1.0, (inner.sum(), 2))
    blocks: Blocks = {"quad": [], "triangle": []}
    for j in range(n):
        for i in range(n):
            a = j * (n + 1) + i
            b, c, d = a + 1, a + n + 2, a + n + 1
            if rng.random() < 0.5:
                blocks["quad"].append([a, b, c, d])
            else:
                blocks["triangle"] += [[a, b, c], [a, c, d]]
    return points, blocks


def solid_cells(n: int, rng: np.random.Generator) -> tuple[np.ndarray, Blocks]:
    """A unit cube of hexahedra and wedges, some of them cut into pyramids and tetrahedra round their centres."""
    flat, base = plane_cells(n, rng)
    layers = np.linspace(0.0, 1.0, n + 1)
    points = [[x, y, z] for z in layers for x, y in flat]
    blocks: Blocks = {"hexahedron": [], "wedge": [], "pyramid": [], "tetra": []}
    for layer in range(n):
        for kind, cells in base.items():
            for cell in cells:
                solid = [node + k * len(flat) for k in (layer, layer + 1) for node in cell]
                name = "hexahedron" if kind == "quad" else "wedge"
                if rng.random() < 0.6:
                    blocks[name].append(solid)
                    continue
                points.append(np.mean([points[node] for node in solid], axis=0).tolist())
                for face in SHAPES[name].faces:
                    turned = [solid[k] for k in face][::-1]
                    blocks["pyramid" if len(face) == 4 else "tetra"].append([*turned, len(points) - 1])
    return np.array(points), blocks


def second_order(
    points: np.ndarray, blocks: Blocks, bend: Callable[[np.ndarray], np.ndarray]
) -> tuple[np.ndarray, Blocks]:
    """The same cells with nodes in the middles of their edges, and all nodes moved."""
    middles: dict[tuple[int, ...], int] = {}
    more, found = list(points), {}
    names = {"quad": "quad8", "triangle": "triangle6", "hexahedron": "hexahedron20", "wedge": "wedge15"}
    names |= {"pyramid": "pyramid13", "tetra": "tetra10"}
    for kind, cells in blocks.items():
        found[names[kind]] = own = []
        for cell in cells:
            ends = [tuple(sorted((cell[a], cell[b]))) for a, b in SHAPES[kind].edges]
            for edge in ends:
                if edge not in middles:
                    middles[edge] = len(more)
                    more.append(points[list(edge)].mean(axis=0))
            own.append([*cell, *(middles[edge] for edge in ends)])
    return bend(np.array(more)), found


def bubble(x: np.ndarray) -> np.ndarray:
    """Moves what is inside the unit square or cube, and bends edges there."""
    return x + 0.3 * np.prod(x * (1.0 - x), axis=1)[:, None] * np.sin(3.0 * x + 1.0)


NUMBERS = {
    "quad": 9, "triangle": 5, "hexahedron": 12, "wedge": 13, "pyramid": 14, "tetra": 10, "quad8": 23, "triangle6": 22,
    "hexahedron20": 25, "wedge15": 26, "pyramid13": 27, "tetra10": 24,
}  # fmt: skip


def written(
    path: Path, points: np.ndarray, blocks: Blocks, rng: np.random.Generator | None = None, group: Blocks | None = None
) -> Path:
    """A VTU file, whose nodes have numbers in random order; ``group`` are cells of group 1."""
    order = np.arange(len(points)) if rng is None else rng.permutation(len(points))
    places = np.zeros((len(points), 3))
    places[order, : points.shape[1]] = points
    rows = [(kind, cell, 0) for kind, cells in blocks.items() for cell in cells]
    rows += [(kind, cell, 1) for kind, cells in (group or {}).items() for cell in cells]
    arrays = {
        "connectivity": [node for _, cell, _ in rows for node in order[cell]],
        "offsets": np.cumsum([len(cell) for _, cell, _ in rows]),
        "types": [NUMBERS[kind] for kind, _, _ in rows],
    }
    cells = "".join(_array(name, "Int64", values) for name, values in arrays.items())
    tags = _array("medit:ref", "Int64", [tag for _, _, tag in rows]) if group else ""
    nodes = _array("p", "Float64", [repr(float(x)) for x in places.ravel()], ' NumberOfComponents="3"')
    path.write_text(
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(rows)}"><Points>{nodes}</Points>'
        f"<Cells>{cells}</Cells><CellData>{tags}</CellData></Piece></UnstructuredGrid></VTKFile>"
    )
    return path


def _array(name: str, kind: str, values: Sequence, more: str = "") -> str:
    return f'<DataArray Name="{name}" type="{kind}" format="ascii"{more}>{" ".join(map(str, values))}</DataArray>'


def check_conversion(mesh: Mesh) -> None:
    """The unit square or cube without gaps, on which linear displacements are exact."""
    assert mesh.volumes.min() > 0.0
    assert mesh.volumes.sum() == pytest.approx(1.0, rel=1e-12)
    outside = mesh.facet_normals(mesh.boundary_facets)[1].sum()
    assert outside == pytest.approx(4.0 if mesh.dim == 2 else 6.0, rel=1e-12)  # a gap would add its two sides
    facets = np.sort(mesh.cells[:, [np.delete(np.arange(mesh.dim + 1), k) for k in range(mesh.dim + 1)]], axis=2)
    _, counts = np.unique(facets.reshape(-1, mesh.dim), axis=0, return_counts=True)
    assert np.count_nonzero(counts == 1) == len(mesh.boundary_facets)
    assert counts.max() == 2
    linear = GRADIENT[: mesh.dim, : mesh.dim]
    problem = hv.ContactProblem(
        mesh.with_boundaries({"all": mesh.boundary_facets}),
        hv.Material.lame(4.0, 4.0),
        supports={"all": hv.Prescribed(lambda x: x @ linear.T)},
        order=1,
    )
    found = hv.solve(problem).displacement
    np.testing.assert_allclose(found, mesh.points @ linear.T, atol=1e-11)


@pytest.mark.parametrize("make", [plane_cells, solid_cells])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_kinds_that_touch_one_another_fit_together(make: Callable, seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    points, blocks = make(4 if make is solid_cells else 6, rng)
    mesh = read_mesh(written(tmp_path / "a.vtu", points, blocks, rng))
    check_conversion(mesh)
    counts = {"quad": 4, "triangle": 1, "hexahedron": 6, "wedge": 3, "pyramid": 2, "tetra": 1}
    assert all(blocks.values())
    assert mesh.number_of_cells == sum(counts[kind] * len(own) for kind, own in blocks.items())
    for kind, own in blocks.items():
        said = f"{len(own)} {SHAPES[kind].plural} were split into {counts[kind] * len(own)} "
        assert any(note.startswith(said) for note in mesh.notes) == (counts[kind] > 1)


@pytest.mark.parametrize("seed", [1, 2])
def test_solids_of_second_order_are_cut_once(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    points, blocks = second_order(*solid_cells(2, rng), bubble)
    assert all(blocks.values())
    mesh = read_mesh(written(tmp_path / "a.vtu", points, blocks, rng))
    check_conversion(mesh)
    used = set(map(tuple, mesh.points.tolist()))
    assert used >= set(map(tuple, points.tolist()))  # middles are where the file puts them
    assert mesh.suggested_order == 1
    assert any("tetrahedra of second order were cut at the middles of their edges" in note for note in mesh.notes)


@pytest.mark.parametrize("bend", [lambda x: x, bubble], ids=["straight", "curved"])
def test_tetrahedra_of_second_order_keep_their_order(bend: Callable[[np.ndarray], np.ndarray], tmp_path: Path) -> None:
    """Unless linear elements are asked for: then they are cut at the middles of the file."""
    rng = np.random.default_rng(6)
    cube = hv.box((1.0, 1.0, 1.0), 2)
    points, blocks = second_order(cube.points, {"tetra": cube.cells.tolist()}, bend)
    path = written(tmp_path / "a.vtu", points, blocks, rng)
    mesh, cut = read_mesh(path), read_mesh(path, order=1)
    check_conversion(mesh)
    check_conversion(cut)
    assert (mesh.suggested_order, cut.suggested_order) == (2, 1)
    assert (mesh.number_of_cells, cut.number_of_cells) == (48, 8 * 48)
    assert set(map(tuple, cut.points.tolist())) == set(map(tuple, points.tolist()))
    assert any("of second order" in note and "order = 2 unless another" in note for note in mesh.notes)
    assert any("order = 1 cuts the edges there" in note for note in mesh.notes) == (bend is bubble)
    for one in (mesh, cut):
        assert one.recipe is not None
        assert one.recipe.build().number_of_cells == one.number_of_cells
    # linear tetrahedra among them have that order too, and a note says so
    some = {"tetra10": blocks["tetra10"][:40], "tetra": [cell[:4] for cell in blocks["tetra10"][40:]]}
    both = read_mesh(written(tmp_path / "both.vtu", points, some))
    assert (both.suggested_order, both.number_of_cells) == (2, 48)
    assert any("8 tetrahedra of first order have order 2 as well" in note for note in both.notes)
    assert not any("of first order" in note for note in mesh.notes)
    # beside a part of other cells the body is one of order 2
    assert Mesh.assembled({"file": mesh.moved(np.eye(3), (2.0, 0.0, 0.0)), "box": cube}).suggested_order == 2
    with pytest.raises(hv.errors.ProblemError, match="order = 3; give 1 or 2"):
        read_mesh(path, order=3)


def test_plane_cells_of_second_order(tmp_path: Path) -> None:
    """Straight ones keep their corners, and order 2 is suggested; an explicit order wins. Curved ones are cut once."""
    rng = np.random.default_rng(4)
    points, blocks = plane_cells(4, rng)
    straight = read_mesh(written(tmp_path / "a.vtu", *second_order(points, blocks, lambda x: x), rng))
    check_conversion(straight)
    plain = read_mesh(written(tmp_path / "b.vtu", points, blocks, rng))
    assert straight.number_of_cells == plain.number_of_cells
    assert (straight.suggested_order, plain.suggested_order) == (2, 1)
    assert all(mesh.suggested_order == 2 for mesh in (straight.scaled(2.0), straight.refined(), straight.rotated(1.0)))
    curved = read_mesh(written(tmp_path / "c.vtu", *second_order(points, blocks, bubble), rng))
    check_conversion(curved)
    assert curved.suggested_order == 1
    assert curved.number_of_cells == 4 * plain.number_of_cells


def test_boundaries_are_cut_as_the_cells_are(tmp_path: Path) -> None:
    """Quadrilaterals and lines on the boundary, of first order beside cells of second order, too."""
    rng = np.random.default_rng(5)
    for elevate in (False, True):
        points, blocks = solid_cells(3, rng)
        low = [[i + 4 * j, i + 1 + 4 * j, i + 5 + 4 * j, i + 4 + 4 * j] for j in range(3) for i in range(3)]
        low = [quad for quad in low if any(set(quad) <= set(cell) for cell in blocks["hexahedron"] + blocks["pyramid"])]
        if elevate:
            points, blocks = second_order(points, blocks, bubble)
        mesh = read_mesh(written(tmp_path / "a.vtu", points, blocks, rng, {"quad": low}))
        normals, areas = mesh.facet_normals(mesh.boundaries["1"])
        np.testing.assert_allclose(normals, np.tile([0.0, 0.0, -1.0], (len(areas), 1)), atol=1e-12)
        assert len(low) > 2
        wanted = sum(_area(points[quad, :2]) for quad in low)
        assert areas.sum() == pytest.approx(wanted, rel=1e-12)
        assert len(areas) == (8 if elevate else 2) * len(low)


def _area(ring: np.ndarray) -> float:
    x, y = ring.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


# ---- cells of bad shape --------------------------------------------------------------------------------------------

CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))])


def jacobians(points: np.ndarray) -> np.ndarray:
    """Determinants at the corners of a hexahedron."""
    ends = [(1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3)]
    return np.array([np.linalg.det(points[list(near)] - points[k]) for k, near in enumerate(ends)])


def test_hexahedra_that_the_least_node_would_invert_are_split_from_their_centre(tmp_path: Path) -> None:
    """Those with positive Jacobians at all corners; the volume is that of the surface by the divergence theorem."""
    rng = np.random.default_rng(8)
    shaken = [CUBE + 0.3 * rng.uniform(-1.0, 1.0, CUBE.shape) for _ in range(1000)]
    good, counts = [points for points in shaken if jacobians(points).min() > 0.0], []
    for points in good:
        try:
            mesh = read_mesh(written(tmp_path / "a.vtu", points, {"hexahedron": [list(range(8))]}))
        except ProblemError as error:
            counts.append("is inside out somewhere" in str(error))
            continue
        counts.append(mesh.number_of_cells)
        assert mesh.volumes.sum() == pytest.approx(_volume(points), rel=1e-10)
        assert len(mesh.boundary_facets) == 12
    assert set(counts) <= {6, 12, True}
    assert counts.count(6) > 10 * counts.count(12) > 0
    assert counts.count(True) < counts.count(12)


def _volume(points: np.ndarray) -> float:
    """By the divergence theorem, faces cut at their least nodes."""
    total = 0.0
    for face in SHAPES["hexahedron"].faces:
        least = int(np.argmin(face))
        a, b, c, d = (points[face[(least + k) % 4]] for k in range(4))
        total += np.dot(a, np.cross(b, c)) + np.dot(a, np.cross(c, d))
    return total / 6.0


@pytest.mark.parametrize(
    ("quads", "cells"),
    [
        ([[0, 1, 2, 3]], 4),
        ([[3, 2, 1, 0]], 4),
        ([[0, 1, 2, 2]], 1),
        ([[0, 0, 1, 2]], 1),
        ([[2, 0, 1, 2]], 1),
        ([[0, 1, 2, 4]], 2),
        ([[4, 0, 1, 2]], 2),
        ([[0, 1, 5, 3]], 4),
    ],
)
def test_plane_quadrilaterals_of_any_shape(quads: list, cells: int, tmp_path: Path) -> None:
    """Convex, turned, collapsed, with a corner that points inwards, and one that is straight."""
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.6, 0.4], [0.5, 0.5]])
    mesh = read_mesh(written(tmp_path / "a.vtu", points, {"quad": quads}))
    assert mesh.number_of_cells == cells
    assert mesh.volumes.sum() == pytest.approx(abs(_area(points[quads[0]])), rel=1e-12)
    assert len(mesh.boundary_facets) == len(set(quads[0]))


@pytest.mark.parametrize(
    ("cell", "wanted", "volume"),
    [
        ([0, 1, 2, 2, 4, 5, 6, 6], 3, 1 / 2),  # a wedge
        ([0, 1, 2, 3, 4, 4, 4, 4], 2, 1 / 3),  # a pyramid
        ([0, 1, 2, 2, 4, 4, 4, 4], 1, 1 / 6),  # a tetrahedron
        ([0, 1, 2, 3, 4, 5, 6, 6], 4, 2 / 3),
        ([4, 5, 6, 7, 0, 1, 2, 3], 6, 1.0),  # inside out as a whole: turned
    ],
)
def test_collapsed_hexahedra_are_split_as_what_they_are(cell: list, wanted: int, volume: float, tmp_path: Path) -> None:
    mesh = read_mesh(written(tmp_path / "a.vtu", CUBE, {"hexahedron": [cell]}))
    assert mesh.number_of_cells == wanted
    assert mesh.volumes.sum() == pytest.approx(volume, rel=1e-12)


@pytest.mark.parametrize(
    ("kind", "cell", "says"),
    [
        ("quad", [0, 2, 1, 3], r"quad 2 of the file, at \(.*\), crosses itself or has no area; correct its shape"),
        ("quad", [0, 0, 2, 2], "quad 2 of the file, .* has fewer than three corners"),
        (
            "hexahedron",
            [0, 1, 2, 3, 4, 6, 5, 7],
            "hexahedron 2 of the file, .* is inside out somewhere, or has no volume",
        ),
        ("hexahedron", [0, 1, 2, 3, 0, 1, 2, 3], "hexahedron 2 of the file, .* has no volume"),
        ("wedge", [0, 1, 2, 4, 6, 5], "wedge 2 of the file, .* is inside out"),
    ],
)
def test_cells_that_cannot_be_split_are_named(kind: str, cell: Sequence[int], says: str, tmp_path: Path) -> None:
    points = CUBE[:4, :2] if kind == "quad" else CUBE
    good = list(range(SHAPES[kind].corners)) if kind != "wedge" else [0, 1, 2, 4, 5, 6]
    points = np.concatenate([points, points + 5.0])
    bad = (np.array(cell) + len(points) // 2).tolist()
    with pytest.raises(ProblemError, match=says):
        read_mesh(written(tmp_path / "a.vtu", points, {kind: [good, bad]}))


def test_solutions_agree_with_those_on_triangles(tmp_path: Path) -> None:
    """A block on a soft bed, of quadrilaterals and of triangles: the same energy up to the size of the cells."""
    energies = []
    for n in (8, 16):
        points, blocks = plane_cells(n, np.random.default_rng(1))
        quads = read_mesh(written(tmp_path / "a.vtu", points, blocks))
        for mesh in (quads, hv.rectangle((1.0, 1.0), n)):
            named = mesh.with_boundaries({"bottom": lambda x: x[:, 1] < 1e-9, "left": lambda x: x[:, 0] < 1e-9})
            problem = hv.ContactProblem(
                named, hv.Material.lame(4.0, 4.0), supports={"left": hv.Clamped()},
                contact={"bottom": hv.Contact(hv.Compliance(2.0))}, body_force=(0.0, -0.8),
            )  # fmt: skip
            energies.append(hv.solve(problem).energy)
    coarse, fine = abs(energies[0] - energies[1]), abs(energies[2] - energies[3])
    assert fine < 0.5 * coarse < 0.05 * abs(energies[3])
