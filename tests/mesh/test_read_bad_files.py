"""Mesh files of other programs that cannot be taken: one plain sentence that names the file and the place."""

from __future__ import annotations

import shutil
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.mesh import read_mesh

from .foreign_models import FILES

INP = """*NODE, NSET=all
1, 0., 0.
2, 1., 0.
3, 1., 1.
4, 0., 1.
*ELEMENT, TYPE=CPE4, ELSET=body
1, 1, 2, 3, 4
*SURFACE, NAME=low
body, S1
*NSET, NSET=high
3, 4
"""
BDF = """$ a comment
BEGIN BULK
GRID,1,,0.,0.,0.
GRID,2,,1.,0.,0.
GRID,3,,1.,1.,0.
GRID,4,,0.,1.,0.
CQUAD4,1,7,1,2,3,4
ENDDATA
"""
SU2 = """NDIME= 2
NELEM= 1
9 0 1 2 3 0
NPOIN= 4
0 0 0
1 0 1
1 1 2
0 1 3
NMARK= 1
MARKER_TAG= low
MARKER_ELEMS= 1
3 0 1
"""
VOL = """mesh3d
dimension
2
geomtype
0
surfaceelements
1
1 1 0 0 4 1 2 3 4
edgesegmentsgi2
1
1 0 1 2 -1 -1 1 0 1 0 1 1
points
4
0 0 0
1 0 0
1 1 0
0 1 0
bcnames
1
1 low
endmesh
"""
VTK = """# vtk DataFile Version 4.2
a square
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 4 float
0 0 0 1 0 0 1 1 0 0 1 0
CELLS 1 5
4 0 1 2 3
CELL_TYPES 1
9
CELL_DATA 1
SCALARS part int 1
LOOKUP_TABLE default
2
"""
UNV = """    -1
  2411
         1         1         1        11
   0.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
         2         1         1        11
   1.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
         3         1         1        11
   1.0000000000000000D+00   1.0000000000000000D+00   0.0000000000000000D+00
         4         1         1        11
   0.0000000000000000D+00   1.0000000000000000D+00   0.0000000000000000D+00
    -1
    -1
  2412
         1        11         2         1         7         2
         0         1         1
         1         2
         2        44         2         1         7         4
         1         2         3         4
         3       136         2         1         7         2
         1         3
    -1
    -1
  2467
         1         0         0         0         0         0         0         1
low
         8         1         0         0
         2         0         0         0         0         0         0         4
all
         7         1         0         0         7         2         0         0
         7         3         0         0         7         4         0         0
         3         0         0         0         0         0         0         1
plate
         8         2         0         0
    -1
"""
TEXTS = {"unv": UNV, "inp": INP, "bdf": BDF, "su2": SU2, "vol": VOL, "vtk": VTK}


def message_of_file(tmp_path: Path, suffix: str, text: str) -> str:
    """What is said of a file; empty if it gives a mesh."""
    path = tmp_path / f"part.{suffix}"
    path.write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            read_mesh(path)
        except ProblemError as error:
            said = str(error)
            assert said.startswith(f"mesh file '{path}'")
            assert "\n" not in said
            assert "meshio" not in said.lower().replace(str(tmp_path).lower(), "")
            return said.replace(str(path), "part")
    return ""


@pytest.mark.parametrize("suffix", TEXTS)
def test_the_files_are_good_as_they_stand(suffix: str, tmp_path: Path) -> None:
    assert message_of_file(tmp_path, suffix, TEXTS[suffix]) == ""


TECPLOT = 'TITLE="x"\nVARIABLES="X","Y"\nZONE N=3,E=1,F=FEPOINT,ET=TRIANGLE\n0 0\n1 0\n0 1\n1 2 3\n'
CASES = [
    ("inp", "1, 1, 2, 3, 4", "1, 1, 2, 3", r"\*ELEMENT of type CPE4: 4 numbers are not rows of 5"),
    ("inp", "1, 1, 2, 3, 4", "1, 1, 2, 3, 9", "refers to node 9, which is not in the file"),
    ("inp", "1, 1, 2, 3, 4", "1, 1, 2, 0_3, 4", r"'0_3' is not a whole number \(\*ELEMENT\)"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,2,,0_1.,0.,0.", r"'0_1.' is not a number \(GRID\)"),
    ("inp", "1, 1, 2, 3, 4", "1, 1, 2, x, 4", r"'x' is not a whole number \(\*ELEMENT\)"),
    ("inp", "1, 1, 2, 3, 4", "1, 1, 3, 2, 4", "quad 1 of the file, at .* crosses itself or has no area"),
    ("inp", "CPE4", "CPE17", "cells of type CPE17, which are not read"),
    ("inp", "CPE4", "CIN3D8", "cells of type CIN3D8, which are not read; mesh with triangles"),
    ("inp", ", TYPE=CPE4", "", r"\*ELEMENT without TYPE"),
    ("inp", "2, 1., 0.", "2, 1., zero", r"'zero' is not a number \(\*NODE\)"),
    ("inp", "2, 1., 0.", "2, nan, 0.", r"node 2 has the coordinates \[nan, 0.0, 0.0\]; all must be finite"),
    ("inp", "2, 1., 0.", "1, 1., 0.", "node 1 occurs twice"),
    ("inp", "*NODE, NSET=all", "*NODE, SYSTEM=C", "cylindrical or spherical coordinates"),
    ("inp", "body, S1", "body, S5", "surface 'low' names face S5 of a quad; it has 4"),
    ("inp", "body, S1", "bodies, S1", "'low' refers to the set 'bodies', which is not there"),
    ("inp", "NAME=low", "TYPE=ELEMENT", r"a \*SURFACE has no name; add NAME="),
    ("inp", "high\n3, 4\n", "high\n3, 4, top\n", "'high' refers to the set 'top', which is not there"),
    ("inp", "NSET=high\n3, 4", "NSET=high, GENERATE\n3", "a generated set has the line '3'; give first, last and step"),
    ("inp", "*SURFACE", "*NGEN\n1, 4\n*SURFACE", r"nodes or elements by \*NGEN, which is not read"),
    ("inp", "*SURFACE", "*INCLUDE, INPUT=none.inp\n*SURFACE", "'part.inp' includes 'none.inp', which is not there"),
    ("inp", "*SURFACE", "*INCLUDE, INPUT=\n*SURFACE", "'part.inp' includes '', which is not there"),
    ("inp", "*SURFACE", "*INCLUDE\n*SURFACE", "'part.inp' includes '', which is not there"),
    ("inp", "*SURFACE", "*INCLUDE, INPUT=" + 300 * "a" + "\n*SURFACE", "aaa', which is not there"),
    ("inp", "*NODE, NSET=all", "*NODE, INPUT=none.txt", "'part.inp' includes 'none.txt', which is not there"),
    ("inp", "*SURFACE", "*INCLUDE, INPUT=part.inp\n*SURFACE", "'part.inp' includes 'part.inp', which includes it"),
    ("inp", "*ELEMENT, TYPE=CPE4, ELSET=body\n1, 1, 2, 3, 4\n", "", r"it holds no \*ELEMENT"),
    ("inp", INP, "nothing here", "it holds no keyword of Abaqus"),
    ("inp", "*SURFACE", "*INSTANCE, NAME=a, PART=b\n*END INSTANCE\n*SURFACE", "instance 'A' is of part 'B'"),
    ("bdf", "CQUAD4,1,7,1,2,3,4", "CQUAD4,1,7,1,2,3", "a CQUAD4 has fewer than 4 nodes"),
    ("bdf", "CQUAD4,1,7,1,2,3,4", "CQUAD4,1,7,1,2,3,8", "refers to node 8, which is not in the file"),
    ("bdf", "CQUAD4,1,7,1,2,3,4", "CTRIAX6,1,7,1,2,3", "cells of type CTRIAX6, which are not read"),
    ("bdf", "CQUAD4,1,7,1,2,3,4", "CHACAB,1,7,1,2,3", "cells of type CHACAB, which are not read"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,2,3,1.,0.,0.", "node 2 lies in coordinate system 3, which no CORD2R, CORD2C or"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,2,3,1.,0.,0.\nCORD2R,3,,0,0,0,0,0,1\n,0,0,2", "system 3 lie on a line"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,2,3,1.,0.,0.\nCORD2R,3,7,0,0,0,0,0,1\n,1,0,0", "3 is stated in system 7"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,2,3,1.,0.,0.\nCORD2R,3,3,0,0,0,0,0,1\n,1,0,0", "one another in a circle"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,2,3,1.,0.,0.\nCORD2R,3,,a,0,0,0,0,1\n,1,0,0", "'a' is not a number .CORD2R"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,2,x,1.,0.,0.", "'x' is not a whole number .coordinate system of a GRID"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,2,,one,0.,0.", r"'one' is not a number \(GRID\)"),
    ("bdf", "GRID,2,,1.,0.,0.", "GRID,two,,1.,0.,0.", r"'two' is not a whole number \(number of a GRID\)"),
    ("bdf", "GRID,3,,1.,1.,0.", "GRID,3,,1.,1.,0.5", r"a surface in 3D \(z from 0 to 0.5\)"),
    ("bdf", "CQUAD4,1,7,1,2,3,4", "CBAR,1,7,1,2", "it holds lines only, and no cells of a body"),
    ("bdf", "BEGIN BULK\n", "BEGIN BULK\n+,1,2\n", "goes on from another one"),
    ("su2", "NDIME= 2", "NDIME= 4", "NDIME is 4; it must be 2 or 3"),
    ("su2", "9 0 1 2 3 0", "9 0 1 2 7 0", "refers to node 8"),
    ("su2", "9 0 1 2 3 0", "7 0 1 2 3 0", "cells of type 7 of VTK, which are not read"),
    ("su2", "9 0 1 2 3 0", "9 0 1 2", "3 numbers are not rows of 4"),
    ("su2", "NPOIN= 4", "NPOIN= 40", "NPOIN says 40 lines, and 8 are there; it is cut off"),
    ("su2", "NPOIN= 4", "NPOIN= 3", "its line '0 1 3' is not 'KEY= value'; the counts before it are wrong"),
    ("su2", "NPOIN= 4", "NPOIN= four", r"'four' is not a whole number \(NPOIN\)"),
    ("su2", "1 0 1\n", "1 a 1\n", r"'a' is not a number \(NPOIN\)"),
    ("vol", "1 1 0 0 4 1 2 3 4", "1 1 0 0 5 1 2 3 4", "cells of type of 5 nodes"),
    ("vol", "1 1 0 0 4 1 2 3 4", "1 1 0 0 4 1 2 3", "3 numbers are not rows of 4"),
    ("vol", "points\n4", "points\n40", "points says 40 rows, and the file ends before"),
    ("vol", "mesh3d\n", "", "it is not a Netgen mesh"),
    ("vtk", "4 0 1 2 3", "4 0 1 2 9", "a cell refers to a node that is not in it"),
    ("vtk", "\n9\n", "\n7\n", "cells of type polygon, which are not read"),
    ("vtk", "\n9\n", "\n5\n", "its cells do not belong to their types"),
    ("vtk", "CELL_TYPES 1\n9", "", "it holds no points or no cells"),
    ("vtk", "part int 1", "part words 1", "part is of type 'words', which VTK does not have"),
    ("vtk", "POINTS 4", "POINTS 400", "POINTS has 32 numbers in place of 1200"),
    ("vtk", "LOOKUP_TABLE default\n", "", "SCALARS part lacks its LOOKUP_TABLE"),
    ("med", None, "no HDF5", "read with the package h5py; pip install|cannot be read as a mesh of the format"),
    ("unv", None, "    -1\n  2411\n", "its last dataset has no end"),
    ("unv", "        44 ", "        47 ", "cells of type 47 of universal files, which are not read"),
    ("unv", "  7         4\n", "  7         3\n", "an element of type 44 has 3 nodes in place of 4"),
    ("unv", "         2\n         1         3\n", "         9\n         1         3\n", "element 3 ends before its 9"),
    ("unv", "  2411", "  9911", "it holds no nodes \\(dataset 2411\\)"),
    ("unv", "3         4\n         3 ", "3         9\n         3 ", "an element refers to node 9"),
    ("unv", "0         1\nlow", "0        40\nlow", "a group of dataset 2467 says 40 members"),
    ("mesh", None, "MeshVersionFormatted 2\nDimension 2\nTrianglesP2\n0\nEnd\n", "cells of type TrianglesP2"),
    ("mesh", None, "MeshVersionFormatted 2\nDimension 2\nSpheres\n0\nEnd\n", "format medit .Unknown keyword 'Spheres'"),
    ("bdf", "CQUAD4", "INCLUDE 'none.bdf'\nCQUAD4", "'part.bdf' includes 'none.bdf', which is not there"),
    ("bdf", "CQUAD4", "include part.bdf\nCQUAD4", "'part.bdf' includes 'part.bdf', which includes it"),
    ("tec", None, TECPLOT[:60], "format tecplot: it is cut off, damaged or of another kind"),
    ("wkt", None, "TIN (((0 0 0, 1 0 0, 0 1 0, 0 0 0)), ((1 0 0, 1 1 0, 0 1", "it is not a TIN of triangles"),
    ("mdpa", None, "Begin Nodes\n 1 0.0 0.0 0.0\n", "format mdpa: it is cut off, damaged or of another kind"),
    ("msh", None, '(0 "x")(2 3)(10 (0 1 3 0 3))(10 (1 1 3 1 3)(0 0', "format ansys: it is cut off"),
    ("msh", None, "$ a comment of another program\n1,,0.,0.,0.\n", r"does not begin like a Gmsh file"),
    ("bdf", None, "$ only a comment\nCTRIA3,1,7,1,2,3\n", "it holds no GRID"),
    ("msh", None, "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", r"it has no section \$Nodes"),
]  # fmt: skip


@pytest.mark.parametrize(("suffix", "old", "new", "says"), CASES)
def test_bad_files_are_refused_in_a_sentence(suffix: str, old: str | None, new: str, says: str, tmp_path: Path) -> None:
    assert len(CASES) >= 40
    text = new if old is None else TEXTS[suffix].replace(old, new, 1)
    assert text != TEXTS.get(suffix)
    found = message_of_file(tmp_path, suffix, text)
    with pytest.raises(ProblemError, match=says):
        raise ProblemError(found)


@pytest.mark.parametrize("suffix", TEXTS)
def test_files_that_are_cut_off_or_damaged_end_in_a_mesh_or_a_sentence(suffix: str, tmp_path: Path) -> None:
    text, rng = TEXTS[suffix], np.random.default_rng(3)
    for end in range(0, len(text), 7):
        message_of_file(tmp_path, suffix, text[:end])
    for _ in range(150):
        damaged = list(text)
        for place in rng.integers(0, len(text), rng.integers(1, 4)):
            damaged[place] = rng.choice(list("0123456789-.,= e*\nX"))
        message_of_file(tmp_path, suffix, "".join(damaged))


def test_what_could_not_be_taken_is_said(tmp_path: Path) -> None:
    path = tmp_path / "part.inp"
    more = "*ELEMENT, TYPE=MASS, ELSET=m\n9, 1\n*NSET, NSET=point\n1\n*ELSET, ELSET=Body\nbody\n"
    path.write_text(INP + more + "*SURFACE, NAME=skin\nbody\n")
    assert read_mesh(path).notes == (
        "1 quadrilaterals were split into 4 triangles",
        "surface 'skin' has a row without the number of a face (S1, S2, ...); it was ignored",
        "elements MASS belong to no body and were ignored",
        "'all' is a group of all nodes; it was ignored",
        "group 'point' holds nodes only; it is a set of nodes, which supports may name",
    )
    assert {path.suffix for path in FILES.iterdir()} >= {
        ".inp",
        ".bdf",
        ".med",
        ".su2",
        ".mesh",
        ".vtk",
        ".vol",
        ".ele",
        ".vtu",
    }


def test_groups_of_universal_files_are_boundaries_and_regions(tmp_path: Path) -> None:
    path = tmp_path / "plate"
    path.write_text(UNV)
    mesh = read_mesh(path)
    assert {name: len(facets) for name, facets in mesh.boundaries.items()} == {"low": 1}
    np.testing.assert_allclose(mesh.points[mesh.boundaries["low"]][:, :, 1], 0.0)
    assert mesh.volumes[mesh.regions["plate"]].sum() == pytest.approx(1.0)
    assert mesh.notes == (
        "1 quadrilaterals were split into 4 triangles",
        "elements of type 136 belong to no body and were ignored",
        "'all' is a group of all nodes; it was ignored",
    )


def test_a_deck_of_nastran_holds_what_it_includes(tmp_path: Path) -> None:
    """Two tetrahedra, one of them in a file of a file; in quotes a name goes on over lines."""
    (tmp_path / "sub").mkdir()
    part = "GRID,5,,1.,1.,1.\ninclude sub/part3.inc $ the cells\nENDDATA\n"
    (tmp_path / "part2.inc").write_text(part)
    (tmp_path / "sub" / "part3.inc").write_text("CTETRA,2,8,2,3,4,5\n")
    nodes = "".join(f"GRID,{n},,{x}.,{y}.,{z}.\n" for n, (x, y, z) in enumerate(((0, 0, 0), *np.eye(3, dtype=int)), 1))
    deck = tmp_path / "half.bdf"
    deck.write_text(f"BEGIN BULK\n{nodes}CTETRA,1,7,1,2,3,4\nINCLUDE 'part\n 2.inc'\nENDDATA\nCHACAB,9,9,1,2,3\n")
    mesh = read_mesh(deck)
    assert (len(mesh.points), mesh.number_of_cells, sorted(mesh.regions)) == (5, 2, ["7", "8"])
    deck.write_text("INCLUDE 'cells.inc'\n")
    (tmp_path / "cells.inc").write_text(f"{nodes}CTETRA,1,7,1,2,3,4\n")
    assert read_mesh(deck).number_of_cells == 1


@pytest.mark.parametrize("suffix", ["inp", "bdf"])
def test_included_files_are_looked_for_beside_the_one_that_includes_them(suffix: str, tmp_path: Path) -> None:
    """Two deep in a folder; one name counts from the folder of the first file. Circles of three are named."""
    word = "*INCLUDE, INPUT={}\n" if suffix == "inp" else "INCLUDE '{}'\n"
    nodes, cells = (
        ("*NODE\n1, 0., 0.\n2, 1., 0.\n3, 0., 1.\n", "*ELEMENT, TYPE=CPS3\n1, 1, 2, 3\n")
        if suffix == "inp"
        else ("GRID,1,,0.,0.,0.\nGRID,2,,1.,0.,0.\nGRID,3,,0.,1.,0.\n", "CTRIA3,1,7,1,2,3\n")
    )
    (tmp_path / "sub" / "more").mkdir(parents=True)
    first = tmp_path / f"part.{suffix}"
    first.write_text(word.format("sub/a.inc"))
    (tmp_path / "sub" / "a.inc").write_text(word.format("more\\b.inc") + word.format("last.inc"))
    (tmp_path / "sub" / "more" / "b.inc").write_text(nodes)
    (tmp_path / "last.inc").write_text(cells)
    assert read_mesh(first).volumes.sum() == pytest.approx(0.5)
    (tmp_path / "last.inc").write_text(cells + word.format("sub/a.inc"))
    with pytest.raises(ProblemError, match=r"'last.inc' includes 'sub/a.inc', which includes it; remove the circle"):
        read_mesh(first)
    (tmp_path / "last.inc").write_text(cells + word.format("gone.inc"))
    with pytest.raises(ProblemError, match=r"'last.inc' includes 'gone.inc', which is not there; put that file beside"):
        read_mesh(first)


def test_included_files_that_go_too_deep_or_too_often_are_refused(tmp_path: Path) -> None:
    """No circle, but 60 files in a row; and ten files that are each included twice by the one before."""
    for count, times, says in ((60, 1, "more than 50 deep"), (11, 2, "more than 1000 times")):
        for k in range(count):
            (tmp_path / f"{k}.inp").write_text(times * f"*INCLUDE, INPUT={k + 1}.inp\n")
        (tmp_path / f"{count}.inp").write_text(INP)
        with pytest.raises(ProblemError, match=f"include one another {says}, at '.*'; write them as one file"):
            read_mesh(tmp_path / "0.inp")


def test_data_of_abaqus_stand_in_files_of_their_own(tmp_path: Path) -> None:
    """By INPUT of a keyword, or as lines that go on with it."""
    (tmp_path / "nodes.txt").write_text("** x and y\n1, 0., 0.\n2, 1., 0.\n")
    (tmp_path / "more.txt").write_text("3, 1., 1.\n4, 0., 1.\n")
    (tmp_path / "cells.txt").write_text("1, 1, 2, 3, 4\n")
    path = tmp_path / "part.inp"
    path.write_text(
        "*NODE, INPUT=nodes.txt\n*NODE, NSET=top\n*include, input=more.txt\n"
        "*ELEMENT, TYPE=CPS4, INPUT=cells.txt, ELSET=plate\n"
    )
    mesh = read_mesh(path)
    assert (mesh.volumes.sum(), set(mesh.boundaries), set(mesh.regions)) == (pytest.approx(1.0), {"top"}, {"plate"})


@pytest.mark.parametrize(
    ("name", "text", "note"),
    [("all.msh", "inp", "its suffix '.msh' stands for Gmsh, but it holds Abaqus and was read so"),
     ("all.txt", "bdf", ""),
     ("all.inp", "unv", "its suffix '.inp' stands for Abaqus, but it holds I-DEAS and was read so"),
     ("all.msh", "bdf", "its suffix '.msh' stands for Gmsh, but it holds Nastran and was read so"),
     ("all.su2", "vol", "its suffix '.su2' stands for SU2, but it holds Netgen and was read so"),
     ("all.vol", "su2", "its suffix '.vol' stands for Netgen, but it holds SU2 and was read so"),
     ("all.inp", "vtk", "its suffix '.inp' stands for Abaqus, but it holds VTK and was read so"),
     ("all.bdf", "inp", "its suffix '.bdf' stands for Nastran, but it holds Abaqus and was read so"),
     ("all.e", "msh", "its suffix '.e' stands for Exodus, but it holds Gmsh and was read so"),
     ("all.grid", "su2", ""), ("all", "tec", ""), ("all.dat", "vtk", ""),
     ("all.dat", "inp", ""), ("all.frd", "unv", "")],
)  # fmt: skip
def test_a_file_is_known_by_what_it_holds(name: str, text: str, note: str, tmp_path: Path) -> None:
    """A byte order mark before it does not matter; a suffix that stands for another format is told."""
    others = {"tec": TECPLOT, "msh": (FILES.parent / "gmsh" / "plane-2.2-text.msh").read_text()}
    for mark in ("", "\ufeff") if text in ("inp", "bdf", "unv", "vol", "msh") else ("",):
        (tmp_path / name).write_text(mark + {**TEXTS, **others}[text], encoding="utf-8")
        mesh = read_mesh(tmp_path / name)
        assert mesh.number_of_cells
        assert [one for one in mesh.notes if "suffix" in one] == ([note] if note else [])


def test_med_without_h5py_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "h5py", None)
    for name in ("part.mmed", "part.med", "part.e", "part"):
        (tmp_path / name).write_bytes((FILES / "gmsh-plane.med").read_bytes())
        with pytest.raises(ProblemError, match="its format is read with the package h5py; pip install h5py"):
            read_mesh(tmp_path / name)


def test_arrays_that_were_never_written_are_not_made(tmp_path: Path) -> None:
    """Coordinates of 2 GiB in a file of some kB; and under a suffix that is told by its content alone."""
    h5py = pytest.importorskip("h5py")
    file = tmp_path / "body.mmed"
    shutil.copy(Path(__file__).parent / "files" / "gmsh-plane.med", file)
    assert read_mesh(file).number_of_cells
    with h5py.File(file, "r+") as opened:
        found: list[str] = []
        opened.visititems(lambda name, _: found.append(name) if name.endswith("COO") else None)
        told = dict(opened[found[0]].attrs)
        del opened[found[0]]
        made = opened.create_dataset(found[0], (2**28,), "f8", chunks=(2**20,), compression="gzip", fillvalue=0)
        made.attrs.update(told)
    assert file.stat().st_size < 1e5
    with pytest.raises(ProblemError, match="COO' is said to hold 2048 MiB, and most of it was never written"):
        read_mesh(file)
