"""Files that other programs wrote: cells and names arrive, from every format that carries them."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

from hemivar.mesh import Mesh, read_mesh
from hemivar.mesh.kinds import CODES, KINDS
from hemivar.mesh.msh import _KINDS, _ordered

from .foreign_models import FILES

#: Measures of boundaries, interfaces and regions.
PLANE = ({"left": 1.0, "right": 1.0}, {"middle": 1.0}, {"steel": 2.0, "rubber": 1.0})
CUBE = ({"bottom": 1.0, "top": 1.0}, {}, {"body": 1.0})
#: Names of entities that Gmsh adds in this format.
ADDED = {
    "plane": ({"Line4": 1.0, "Line6": 1.0}, {"Line2": 1.0}, {"Surface1": 2.0, "Surface2": 1.0}),
    "cube": ({"Surface5": 1.0, "Surface6": 1.0}, {}, {"Volume1": 1.0}),
    "wedges": ({"Surface1": 1.0, "Surface6": 1.0}, {}, {"Volume1": 1.0}),
}


def measures(mesh: Mesh) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    facets = [
        {name: float(mesh.facet_normals(own)[1].sum()) for name, own in group.items()}
        for group in (mesh.boundaries, mesh.interfaces)
    ]
    return facets[0], facets[1], {name: float(mesh.volumes[own].sum()) for name, own in mesh.regions.items()}


def wanted(path: Path) -> tuple[dict[str, float], dict[str, float], dict[str, float]]:
    name, suffix = path.stem, path.suffix
    plane = name in ("gmsh-plane", "gmsh-quads", "gmsh-second")
    parts = PLANE if plane else CUBE
    names = {  # numbers of the entities, of the groups in VTK
        ".bdf": ("4", "6", "2", "1", "2"), ".mesh": ("4", "6", "2", "1", "2"), ".vtk": ("1", "2", "3", "4", "5"),
    }.get(suffix)  # fmt: skip
    if suffix == ".su2":
        return parts[0], parts[1], {}
    if suffix == ".inp":
        more = ADDED["plane" if plane else "wedges" if "wedges" in name else "cube"]
        return parts[0] | more[0], parts[1] | more[1], parts[2] | more[2]
    if names and plane:
        left, right, middle, steel, rubber = names
        return {left: 1.0, right: 1.0}, {middle: 1.0}, {steel: 2.0, rubber: 1.0}
    if names:
        low, high = ("1", "2") if suffix == ".vtk" else ("1", "6") if "wedges" in name else ("5", "6")
        return {low: 1.0, high: 1.0}, {}, {"3" if suffix == ".vtk" else "1": 1.0}
    return parts


@pytest.mark.parametrize("path", sorted(FILES.glob("gmsh-*")), ids=lambda path: path.name)
def test_exports_of_gmsh(path: Path) -> None:
    """All names that the format carries, in their places; small fields of Nastran have seven digits."""
    if path.suffix == ".med":
        pytest.importorskip("h5py")
    mesh = read_mesh(path)
    for found, parts in zip(measures(mesh), wanted(path), strict=True):
        assert found == pytest.approx(parts, rel=1e-5)
    second = path.stem == "gmsh-second"
    assert mesh.suggested_order == (2 if second else 1)
    assert len(mesh.notes) == (path.stem != "gmsh-plane")
    outside = mesh.facet_normals(mesh.boundary_facets)[1].sum()
    assert outside == pytest.approx(8.0 if mesh.dim == 2 else 6.0, rel=1e-5)


@pytest.mark.parametrize("stem", sorted({path.stem for path in FILES.glob("gmsh-*")}))
def test_all_formats_hold_the_same_cells(stem: str) -> None:
    """Middles of cells and facets, whatever the numbers of the nodes."""
    sums = set()
    for path in FILES.glob(f"{stem}.*"):
        if path.suffix != ".med":
            mesh = read_mesh(path)
            moments = (mesh.volumes[:, None] * mesh.points[mesh.cells].mean(axis=1) ** 2).sum(axis=0)
            sums.add((mesh.number_of_nodes, mesh.number_of_cells, *np.round(moments, 4)))
    assert len(sums) == 1


def test_files_of_netgen() -> None:
    for name in ("netgen-box.vol", "netgen-box2.vol"):
        mesh = read_mesh(FILES / name)
        boundaries, _, regions = measures(mesh)
        assert {key: boundaries[key] for key in ("bottom", "top")} == pytest.approx({"bottom": 1.0, "top": 1.0})
        assert sum(boundaries.values()) == pytest.approx(6.0)
        assert regions == pytest.approx({"body": 1.0})
    boundaries, _, regions = measures(read_mesh(FILES / "netgen-plane.vol"))
    assert boundaries == pytest.approx({"bottom": 3.0, "right": 1.0, "top": 3.0, "left": 1.0})
    assert regions == pytest.approx({"steel": 3.0})


@pytest.mark.parametrize("suffix", ["node", "ele"])
def test_files_of_tetgen(suffix: str) -> None:
    boundaries, interfaces, regions = measures(read_mesh(FILES / f"tetgen-box.{suffix}"))
    assert boundaries == pytest.approx({"1": 1.0, "2": 1.0, "3": 4.0})
    assert interfaces == pytest.approx({"4": 1.0})
    assert regions == pytest.approx({"10": 0.5, "20": 0.5})


def test_files_of_pyvista() -> None:
    for name in ("voxels.vtu", "voxels.vtk", "voxels-binary.vtk"):
        mesh = read_mesh(FILES / f"pyvista-{name}")
        assert measures(mesh)[2] == pytest.approx({"material:1": 0.5, "material:2": 0.5})
        assert mesh.notes == ("8 hexahedra were split into 48 tetrahedra",)
    triangles = measures(read_mesh(FILES / "pyvista-triangles.vtu"))
    assert triangles[2] == pytest.approx({"material:0": 1.5, "material:1": 1.5})


def test_nodes_of_gmsh_are_where_their_places_say() -> None:
    """All kinds of second order, by the local coordinates that Gmsh itself gives: each middle between its ends."""
    gmsh = pytest.importorskip("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        for number, name in _KINDS.items():
            kind = KINDS[CODES[name]]
            _, dim, order, count, local, corners = gmsh.model.mesh.getElementProperties(number)
            assert (dim, count, corners, order > 1) == (kind.dim, kind.nodes, kind.shape.corners, kind.quadratic)
            if order == 2:
                places = np.reshape(local, (count, dim))
                turned = places[_ordered(kind, np.arange(count)[None])[0]]
                ends = turned[np.array(kind.shape.edges)].mean(axis=1)
                np.testing.assert_allclose(turned[corners : corners + len(ends)], ends, atol=1e-12)
    finally:
        gmsh.finalize()


@pytest.mark.parametrize("binary", [False, True])
def test_older_files_of_vtk(binary: bool, tmp_path: Path) -> None:
    """Version 4.2, whose cells begin with their numbers of nodes, with other arrays between."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [2.0, 0.5, 0.0]])
    mesh = meshio.Mesh(
        points, [("quad", np.array([[0, 1, 2, 3]])), ("triangle", np.array([[1, 4, 2]]))],
        point_data={"u": points}, cell_data={"part": [np.array([3]), np.array([4])], "f": [np.ones(1), np.ones(1)]},
    )  # fmt: skip
    meshio.vtk._vtk_42.write(tmp_path / "a.vtk", mesh, binary=binary)
    assert measures(read_mesh(tmp_path / "a.vtk"))[2] == pytest.approx({"part:3": 1.0, "part:4": 0.5})


def test_structured_files_of_vtk_go_through_meshio(tmp_path: Path) -> None:
    path = tmp_path / "a.vtk"
    path.write_text(
        "# vtk DataFile Version 3.0\ngrid\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 3 3\nORIGIN 0 0 0\n"
        "SPACING 0.5 0.5 0.5\nPOINT_DATA 27\nSCALARS a double 1\nLOOKUP_TABLE default\n" + 27 * "0 "
    )
    assert read_mesh(path).volumes.sum() == pytest.approx(1.0)
