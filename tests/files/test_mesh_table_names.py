"""Names in Abaqus and Nastran files, and what becomes of groups of facets and nodes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem
from tests.mesh.test_abaqus_and_nastran_names import abaqus, length, nodes


def test_groups_that_lie_partly_inside_make_a_boundary_and_an_interface(tmp_path: Path) -> None:
    """A line through the middle and along the left side: kept, and refused only as contact before it is opened."""
    text = nodes([(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)])
    text += "*ELEMENT, TYPE=CPS4, ELSET=a\n1, 1, 2, 5, 4\n*ELEMENT, TYPE=CPS4, ELSET=b\n2, 2, 3, 6, 5\n"
    text += "*ELEMENT, TYPE=T2D2, ELSET=line\n3, 1, 4\n4, 2, 5\n"
    mesh = abaqus(tmp_path, text)
    assert (length(mesh, "line"), length(mesh, "line:inside")) == (1.0, 1.0)
    assert mesh.notes[-1] == "group 'line' lies partly inside the body; that part is the interface 'line:inside'"
    assert {"line:inside:a", "line:inside:b"} <= set(mesh.opened("line:inside").boundaries)
    assert mesh.opened("line:inside").notes == mesh.notes
    for part in ("contact", "supports"):
        stated_on = {part: {"line:inside": hv.Contact(hv.Signorini()) if part == "contact" else "clamped"}}
        with pytest.raises(ProblemError, match=r"lies inside the body; take mesh.opened\('line:inside'\) and one of"):
            hv.ContactProblem(mesh, hv.Material.lame(1.0, 1.0), **{"supports": {"line": "clamped"}, **stated_on})
    stated = """
[mesh]
file = "part.inp"
[material]
lame = [4.0, 4.0]
[supports]
line = "clamped"
[contact."line:inside"]
normal = "signorini"
"""
    with pytest.raises(ProblemError, match=r"lies inside the body; write \[mesh\] opened"):
        parse_problem(stated, tmp_path)
    parse_problem(stated.replace('[contact."line:inside"]\nnormal = "signorini"', ""), tmp_path)


def test_an_explicit_order_wins(tmp_path: Path) -> None:
    """Second order in the plane: order 2 unless the file or the call says 1; what is written reads back the same."""
    ring = [(0, 0), (2, 0), (0, 2), (1, 0), (1, 1), (0, 1)]
    text = nodes(ring) + "*ELEMENT, TYPE=CPE6, ELSET=body\n1, 1, 2, 3, 4, 5, 6\n*NSET, NSET=left\n1, 3, 6\n"
    mesh = abaqus(tmp_path, text)
    material, supports = hv.Material.lame(1.0, 1.0), {"left": hv.Clamped()}
    assert hv.ContactProblem(mesh, material, supports=supports).order == 2
    assert hv.ContactProblem(mesh, material, supports=supports, order=1).order == 1
    assert hv.ContactProblem(hv.rectangle(), material, supports=supports).order == 1
    for key, order in (("", 2), ("order = 1", 1), ("order = 2", 2)):
        stated = f'[mesh]\nfile = "part.inp"\n{key}\n[material]\nlame = [1.0, 1.0]\n[supports]\nleft = "clamped"\n'
        problem = parse_problem(stated, tmp_path)
        assert problem.order == order
        hv.write_problem(problem, tmp_path / "again.toml")
        again = hv.read_problem(tmp_path / "again.toml")
        assert again.order == order
        assert ("order" in (tmp_path / "again.toml").read_text()) == (order == 1)


def test_the_order_of_tetrahedra_of_a_file(tmp_path: Path) -> None:
    """C3D10 have order 2; order = 1 cuts each into eight, in parts as well, and what is written reads back the same."""
    corners = [(0, 0, 0), (2, 0, 0), (0, 2, 0), (0, 0, 2)]
    middles = [(1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)]
    rows = "".join(f"{k}, {x}, {y}, {z}\n" for k, (x, y, z) in enumerate(corners + middles, 1))
    text = f"*NODE\n{rows}*ELEMENT, TYPE=C3D10, ELSET=body\n1, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10\n"
    abaqus(tmp_path, text + "*NSET, NSET=floor\n1, 2, 3, 5, 6, 7\n*NSET, NSET=left\n1, 3, 4, 7, 8, 10\n")
    rest = (
        '[material]\nlame = [1.0, 1.0]\n[contact."{0}floor"]\nnormal = "signorini"\n[supports]\n"{0}left" = "clamped"\n'
    )
    for part in ("", "only:"):
        table = "[mesh]\n{}\n" + ("[mesh.only]\n" if part else "") + 'file = "part.inp"\n'
        for key, order, cells in (("", 2, 1), ("order = 1", 1, 8), ("order = 2", 2, 1)):
            problem = parse_problem(table.format(key) + rest.format(part), tmp_path)
            assert (problem.order, problem.mesh.number_of_cells) == (order, cells)
            assert len(problem.mesh.boundaries[f"{part}floor"]) == (4 if order == 1 else 1)
            assert hv.discretize(problem).contact_points == 3  # the rest is clamped
            hv.write_problem(problem, tmp_path / "again.toml")
            again = hv.read_problem(tmp_path / "again.toml")
            assert (again.order, again.mesh.number_of_cells) == (order, cells)
    # linear elements on the corners alone are no mesh that the file gives: the mesh is written beside
    for key, order, cells in (("", 1, 1), ("order = 1", 2, 8)):
        problem = replace(parse_problem(table.format(key) + rest.format(part), tmp_path), order=order)
        with pytest.raises(ProblemError, match=rf"read for elements of order {3 - order}.*order={order}\)"):
            hv.write_problem(problem, tmp_path / f"own{order}.toml")
        hv.write_problem(problem, tmp_path / f"own{order}.toml", beside=True)
        again = hv.read_problem(tmp_path / f"own{order}.toml")
        assert (again.order, again.mesh.number_of_cells) == (order, cells)
        said = [warning for warning in hv.discretize(problem).warnings if "order=1" in warning]
        assert len(said) == (order == 1)
