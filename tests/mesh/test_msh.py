"""Gmsh's format: genuine files of every variant are read right, damaged ones are refused in one sentence."""

from __future__ import annotations

import re
import struct
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import Signorini
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Pressure
from hemivar.mesh import Mesh, read_mesh
from hemivar.mesh.msh import parse_msh
from hemivar.solvers import solve
from tests import bodies

from .gmsh_models import FILES, MODELS, file_name, variants, write

GENUINE = sorted(FILES.glob("*.msh"))
#: Lengths or areas of the boundaries and areas or volumes of the regions, from the geometry.
MEASURES = {
    "plane": (
        {"ground": 3.0, "side": 1.0, "body": 1.6, "7": 3.0},
        {"body": 2.84, "holed": 1.84, "3": 1.0},
    ),
    "solid": ({"ground": 1.0, "top": 1.0}, {"ground": 1.0, "layer": 0.25, "6": 0.75}),
}


def check_measures(mesh: Mesh, model: str) -> None:
    boundaries, regions = MEASURES[model]
    assert mesh.volumes.min() > 0.0
    assert mesh.volumes.sum() == pytest.approx(regions["body" if model == "plane" else "ground"])
    assert mesh.facet_normals(mesh.boundary_facets)[1].sum() == pytest.approx(9.6 if model == "plane" else 6.0)
    found = {name: mesh.facet_normals(facets)[1].sum() for name, facets in mesh.boundaries.items()}
    assert found == pytest.approx(boundaries)
    found = {name: mesh.volumes[cells].sum() for name, cells in mesh.regions.items()}
    assert found == pytest.approx(regions)


def contact_force(mesh: Mesh) -> float:
    """Total contact force of a body of two materials pressed onto the ground."""
    hard, soft = Material.lame(4.0, 4.0), Material.lame(1.0, 2.0)
    plane = mesh.dim == 2
    problem = ContactProblem(
        mesh,
        Material.by_region({"holed": hard, "3": soft} if plane else {"layer": hard, "6": soft}),
        contact={"ground": Contact(Signorini())},
        supports={"side": Clamped()} if plane else {"top": Clamped()},
        tractions={"7": Pressure(0.1)} if plane else {},
        body_force=0.0 if plane else (0.0, 0.0, -0.3),
    )
    return solve(discretize(problem)).normal_force


@pytest.mark.parametrize("path", GENUINE, ids=lambda path: path.stem)
def test_committed_files_of_gmsh(path: Path) -> None:
    check_measures(read_mesh(path), path.stem.split("-")[0])


#: Name of the model, dimension, what its groups and its entities hold, its files; and those that have no groups.
Genuine = tuple[str, int, dict[tuple[int, str], set], dict[tuple[int, str], set], list[Path], list[Path]]


@pytest.fixture(scope="module", params=sorted(MODELS))
def genuine(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Genuine:
    """A model as it is inside Gmsh, and its files in all variants, whole and partitioned."""
    gmsh = pytest.importorskip("gmsh")
    folder = tmp_path_factory.mktemp("msh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        MODELS[request.param](gmsh, 0.4)
        dim = gmsh.model.getDimension()
        known = {}
        for tag, places in zip(*_nodes(gmsh), strict=True):
            known[int(tag)] = tuple(places)
        inside: dict[tuple[int, str], set] = {}
        elementary: dict[tuple[int, str], set] = {}

        def hold(chosen: dict[tuple[int, str], set], of: int, entity: int, name: str) -> None:
            for element in np.concatenate(gmsh.model.mesh.getElements(of, entity)[2]).reshape(-1, of + 1):
                chosen.setdefault((of, name), set()).add(frozenset(known[int(node)] for node in element))

        for group_dim, group in gmsh.model.getPhysicalGroups():
            name = gmsh.model.getPhysicalName(group_dim, group) or str(group)
            for entity in gmsh.model.getEntitiesForPhysicalGroup(group_dim, group):
                hold(inside, group_dim, entity, name)
        for of in (dim - 1, dim):
            for _, tag in gmsh.model.getEntities(of):
                hold(elementary, of, tag, f"{('', 'curve', 'surface', 'volume')[of]} {tag}")
        files, bare = [], []
        for parts in (False, True):
            if parts:
                gmsh.model.mesh.partition(3)
            for variant in variants():
                path = folder / file_name(request.param, *variant, parts)
                write(gmsh, path, *variant)
                # Gmsh itself leaves the groups out of format 2.2 with all elements
                (bare if variant[0] == "2.2" and variant[2] else files).append(path)
        gmsh.model.removePhysicalGroups()
        for variant in (("2.2", False), ("4.0", False), ("4.1", True)):
            path = folder / f"bare-{variant[0]}.msh"
            write(gmsh, path, *variant, False, False)
            bare.append(path)
    finally:
        gmsh.finalize()
    return request.param, dim, inside, elementary, files, bare


def _nodes(gmsh: Any) -> tuple[np.ndarray, np.ndarray]:
    tags, places, _ = gmsh.model.mesh.getNodes()
    return tags, places.reshape(-1, 3)


def test_all_variants_hold_what_gmsh_holds(genuine: Genuine) -> None:
    """Each facet and cell of each group, by its corners; text rounds coordinates to 16 digits."""
    model, dim, inside, _, files, bare = genuine
    forces = []
    for path in files:
        mesh = read_mesh(path)
        check_measures(mesh, model)
        assert set(mesh.boundaries) == {name for of, name in inside if of == dim - 1}
        assert set(mesh.regions) == {name for of, name in inside if of == dim}
        _holds(mesh, inside)
        if len(forces) < 4 or "partitioned" in path.name:
            forces.append(contact_force(mesh))
    assert len(files) + len(bare) == 43
    np.testing.assert_allclose(forces, forces[0], rtol=1e-8)
    assert forces[0] > 1e-3


def test_entities_name_what_no_physical_group_names(genuine: Genuine) -> None:
    """In all formats alike, partitioned or not: each entity with its elements, in Gmsh's own numbers."""
    _, dim, _, elementary, _, bare = genuine
    for path in bare:
        mesh = read_mesh(path)
        assert {*mesh.boundaries, *mesh.interfaces} == {name for of, name in elementary if of == dim - 1}
        assert set(mesh.regions) == {name for of, name in elementary if of == dim}
        assert len(mesh.interfaces) == 1
        _holds(mesh, elementary)
        assert len(mesh.notes) == 2
        assert mesh.notes[0].startswith(f"no physical group names its {'curves' if dim == 2 else 'surfaces'}; ")


def _holds(mesh: Mesh, groups: dict[tuple[int, str], set]) -> None:
    facets = {**mesh.boundaries, **mesh.interfaces}
    for (of, name), wanted in groups.items():
        nodes = facets[name] if of == mesh.dim - 1 else mesh.cells[mesh.regions[name]]
        places = np.array([list(map(list, one)) for one in wanted])[..., : mesh.dim]
        assert _corners(mesh.points[nodes]) == _corners(places)


def _corners(places: np.ndarray) -> set[frozenset]:
    return {frozenset(map(tuple, np.round(one, 9) + 0.0)) for one in places}


# ---- files written here by the letter of the format ----------------------------------------------------------------

#: Two squares side by side cut into four triangles: nodes with gaps in their numbers, two edges, groups.
NODES = {3: (0.0, 0.0), 5: (1.0, 0.0), 9: (2.0, 0.0), 11: (2.0, 1.0), 12: (1.0, 1.0), 400: (0.0, 1.0)}
LINES, TRIANGLES = [(3, 5), (5, 9)], [(3, 5, 12), (3, 12, 400), (5, 9, 11), (5, 11, 12)]


def message(data: bytes) -> str:
    """What is wrong with a file; empty if it gives a mesh."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            raw = parse_msh(data)
        except ProblemError as error:
            text = str(error)
            return f"WRONG: {text!r}" if "\n" in text else text
    assert all((rows < len(raw.cells[dim])).all() for (dim, _), rows in raw.groups.items())
    assert all(((nodes >= 0) & (nodes < len(raw.points))).all() for nodes in raw.cells.values())
    return ""


def old_text(names: str, lines: list[int], triangles: list[int], nodes: dict | None = None) -> bytes:
    """A file in format 2.2; lines and triangles give the group of each."""
    rows = [f"{tag} {x} {y} 0" for tag, (x, y) in (NODES if nodes is None else nodes).items()]
    cells = [f"1 2 {group} 1 {a} {b}" for group, (a, b) in zip(lines, LINES, strict=True)]
    cells += [f"2 2 {group} 1 {a} {b} {c}" for group, (a, b, c) in zip(triangles, TRIANGLES, strict=True)]
    cells = [f"{number + 1} {cell}" for number, cell in enumerate(cells)]
    listed = names.strip().splitlines()
    parts = [
        "$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", len(listed), *listed, "$EndPhysicalNames",
        "$Nodes", len(rows), *rows, "$EndNodes", "$Elements", len(cells), *cells, "$EndElements",
    ]  # fmt: skip
    return "\n".join(map(str, parts)).encode() + b"\n"


def binary(version: str, order: str, word: int = 8) -> bytes:
    """The same body in binary: one entity of each dimension, with two groups for the lines."""
    size = {4: "I", 8: "Q"}[word]

    def pack(kinds: str, *values: float) -> bytes:
        return struct.pack(order + kinds.replace("S", size), *values)

    names = b'$PhysicalNames\n3\n1 1 "ground"\n1 2 "ground"\n2 1 "ground"\n$EndPhysicalNames\n'
    head = f"$MeshFormat\n{version} 1 {word}\n".encode() + pack("i", 1) + b"\n$EndMeshFormat\n" + names
    if version == "2.2":
        nodes = b"".join(pack("iddd", tag, x, y, 0.0) for tag, (x, y) in NODES.items())
        lines = pack("iii", 1, 1, 2) + pack("iiiii", 1, 1, 1, *LINES[0]) + pack("iii", 1, 1, 2)
        lines += pack("iiiii", 2, 2, 1, *LINES[1]) + pack("iii", 2, 4, 2)
        cells = b"".join(pack("iiiiii", 3 + k, 1, 1, *cell) for k, cell in enumerate(TRIANGLES))
        nodes, cells = b"6\n" + nodes, b"6\n" + lines + cells
        entities = b""
    else:
        new = version == "4.1"
        point = 3 if new else 6
        nothing = [0.0] * 6
        entities = pack("SSSS", 1, 1, 1, 0) + pack("i" + point * "d" + "S", 3, *nothing[:point], 0)
        entities += pack("i6dSiiSi", 1, *nothing, 2, 1, 2, 1, 3) + pack("i6dSiSi", 1, *nothing, 1, 1, 1, 1)
        entities = b"$Entities\n" + entities + b"\n$EndEntities\n"
        limits = pack("SS", 3, 400) if new else b""
        tags = list(NODES)
        nodes = pack("SS", 2, 6) + limits
        for place, count in ((0, 2), (2, 4)):
            nodes += pack("iii", 1, 1, 0) if place == 0 else pack("iii", *((2, 1, 0) if new else (1, 2, 0)))
            nodes += pack("S", count)
            part = tags[place : place + count]
            if new:
                nodes += pack(f"{count}S", *part) + b"".join(pack("ddd", *NODES[tag], 0.0) for tag in part)
            else:
                nodes += b"".join(pack("iddd", tag, *NODES[tag], 0.0) for tag in part)
        number = "S" if new else "i"
        cells = pack("SS", 2, 6) + limits + pack("iiiS", 1, 1, 1, 2)
        cells += b"".join(pack(3 * number, 1 + k, *line) for k, line in enumerate(LINES))
        cells += pack("iii", *((2, 1, 2) if new else (1, 2, 2))) + pack("S", 4)
        cells += b"".join(pack(4 * number, 3 + k, *cell) for k, cell in enumerate(TRIANGLES))
    sections = b"$Nodes\n" + nodes + b"\n$EndNodes\n$Elements\n" + cells + b"\n$EndElements\n"
    return head + entities + sections


NAMES = '1 1 "ground"\n1 2 "ground"\n2 1 "ground"'


@pytest.mark.parametrize(
    "data",
    [
        old_text(NAMES, [1, 2], [1, 1, 1, 1]),
        old_text(NAMES, [1, 2], [1, 1, 1, 1]).replace(b"\n", b"\r\n"),
        b"\xef\xbb\xbf" + old_text(NAMES, [1, -2], [1, 1, 1, 1]),
        old_text(NAMES, [1, 2], [1, 1, 1, 1]).replace(b"$Nodes", b"$Comments\nno $matter\n$EndComments\n$Nodes"),
        *[binary(version, order) for version in ("2.2", "4.0", "4.1") for order in "<>"],
        binary("4.1", "<", 4),
        binary("4.1", ">", 4),
    ],
)
def test_groups_of_one_name_are_united_and_kept_apart_by_dimension(data: bytes, tmp_path: Path) -> None:
    """Two groups of curves and one of surfaces, all called ground."""
    path = tmp_path / "part.msh"
    path.write_bytes(data)
    mesh = read_mesh(path)
    assert mesh.volumes.sum() == pytest.approx(2.0)
    assert mesh.facet_normals(mesh.boundaries["ground"])[1].sum() == pytest.approx(2.0)
    assert len(mesh.regions["ground"]) == 4
    assert set(mesh.boundaries) == set(mesh.regions) == {"ground"}


def test_a_group_with_an_empty_name_has_its_number_as_one() -> None:
    data = (FILES / "plane-2.2-text.msh").read_bytes()
    named, bare = parse_msh(data), parse_msh(data.replace(b'1 2 "side"', b'1 2 ""'))
    assert named.groups.keys() ^ bare.groups.keys() == {(1, "side"), (1, "2")}
    assert (bare.groups[1, "2"] == named.groups[1, "side"]).all()


def test_two_groups_of_one_name_bear_the_whole_force(tmp_path: Path) -> None:
    forces = []
    for names, groups in ((NAMES, [1, 2]), (NAMES, [2, 1]), ('1 1 "ground"\n2 1 "ground"', [1, 1])):
        path = tmp_path / "part.msh"
        path.write_bytes(old_text(names, groups, [1, 1, 1, 1]))
        mesh = read_mesh(path)
        mesh = mesh.with_boundaries({"ground": mesh.boundaries["ground"], "top": lambda x: x[:, 1] > 0.99}).refined()
        problem = bodies.body(
            mesh, {"ground": Contact(Signorini())}, supports={"top": Clamped()}, body_force=(0.0, -0.8)
        )
        forces.append(solve(discretize(problem)).normal_force)
    assert forces[0] > 0.1
    np.testing.assert_allclose(forces, forces[0], rtol=1e-9)


GOOD = old_text(NAMES, [1, 2], [1, 1, 1, 1])
NEW = b"""$MeshFormat
4.1 0 8
$EndMeshFormat
$Entities
0 1 1 0
1 0 0 0 1 0 0 1 7 0
1 0 0 0 1 1 0 1 8 1 1
$EndEntities
$Nodes
1 3 1 3
2 1 0 3
1
2
3
0 0 0
1 0 0
0 1 0
$EndNodes
$Elements
2 2 1 2
1 1 1 1
1 1 2
2 1 2 1
2 1 2 3
$EndElements
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"3 0.0 0.0 0", b"3 1e 0.0 0", r"'1e' is not a number \(\$Nodes, line 12\)"),
        (b"3 0.0 0.0 0", b"3 nan 0.0 0", "node 3 has the coordinates .nan.*finite"),
        (b"3 0.0 0.0 0", b"3 1e999 0.0 0", "node 3 has the coordinates .inf.*finite"),
        (b"3 0.0 0.0 0", b"3 0.0 0.0", r"says 6 nodes and holds 5\.75"),
        (b"3 0.0 0.0 0", b"3 0,5 0.0 0", "'0,5' is not a number"),
        (b"3 0.0 0.0 0", b"0 0.0 0.0 0", "a node of number 0; nodes are numbered from 1"),
        (b"3 0.0 0.0 0", b"-3 0.0 0.0 0", "a node of number -3"),
        (b"3 0.0 0.0 0", b"3.5 0.0 0.0 0", "not a whole number"),
        (b"3 0.0 0.0 0", b"1e300 0.0 0.0 0", "not a whole number"),
        (b"3 0.0 0.0 0", b"3.0 0.0 0.0 0", "'3.0' is not a whole number"),
        (b"3 0.0 0.0 0", b"5 0.0 0.0 0", "node 5 occurs twice"),
        (b"3 0.0 0.0 0", b"4 0.0 0.0 0", "refers to node 3, which is not in the file"),
        (b"3 0.0 0.0 0", b"1000000000 0.0 0.0 0", "refers to node 3, which is not in the file"),
        (b"$Nodes\n6", b"$Nodes\n7", "says 7 nodes and holds 6"),
        (b"$Nodes\n6", b"$Nodes\n-6", "where a count is due"),
        (b"$Nodes\n6", b"$Nodes\n1e30", "not a whole number"),
        (b"$Nodes\n6", b"$Nodes\nsix", "'six' is not a number"),
        (b"$EndNodes", b"", "section \\$Nodes does not end"),
        (b"$EndElements", b"", "section \\$Elements does not end"),
        (b"$Elements\n6", b"$Elements\n5", "more rows than it says"),
        (b"$Elements\n6", b"$Elements\n600000", "fewer rows than it says"),
        (b"1 1 2 1 1 3 5", b"1 1 2 1 1 3 0", "refers to node 0, which is not"),
        (b"1 1 2 1 1 3 5", b"1 1 2 1 1 3 -5", "refers to node -5, which is not"),
        (b"1 1 2 1 1 3 5", b"1 1 2 1 1 3 5.0", "'5.0' is not a whole number"),
        (b"1 1 2 1 1 3 5", b"1 1 2 1 1 3 99999999999999999999", "which is not in the file|not a whole number"),
        (b"1 1 2 1 1 3 5", b"1 21 2 1 1 3 5 12 400 9 11", "cells of type triangle10, which are not read"),
        (b"1 1 2 1 1 3 5", b"1 77 2 1 1 3 5", "cells of type 77 of the format"),
        (b"1 1 2 1 1 3 5", b"1 1 -2 1 1 3 5", "where a count is due"),
        (b'1 2 "ground"', b'1 1 "floor"', "group 1 of dimension 1 has two names, 'ground' and 'floor'"),
        (b'1 2 "ground"', b"1 2 ground", "has the line '1 2 ground'"),
        (b'1 2 "ground"', b'x 2 "ground"', "has the line 'x 2"),
        (b"$PhysicalNames\n3", b"$PhysicalNames\n4", "not hold as many names as it says"),
        (b"2.2 0 8", b"1.0 0 8", "version 1.0 of the format"),
        (b"2.2 0 8", b"2.2 0 8 8", "MeshFormat is not"),
        (b"2.2 0 8", b"2.2 1 8", "byte order|counts are wrong"),
        (b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", b"", "states no version"),
        (b"$Nodes", b"garbage\n$Nodes", "a section should begin at 'garbage' \\(line 10\\)"),
        (b"$Nodes", b"$Nodes\n0\n$EndNodes\n$Nodes", "section \\$Nodes occurs twice"),
    ],
)
def test_damaged_files_are_refused(old: bytes, new: bytes, words: str) -> None:
    assert message(GOOD) == ""
    assert GOOD.count(old) >= 1
    found = message(GOOD.replace(old, new, 1))
    assert re.search(words, found), found


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b"1 3 1 3", b"1 4 1 3", "says 4 nodes"),
        (b"1 3 1 3", b"2 3 1 3", "less than its counts say"),
        (b"2 1 0 3\n", b"2 1 0 30\n", "less than its counts say"),
        (b"2 1 0 3\n", b"2 1 0 -3\n", "where a count is due"),
        (b"2 2 1 2\n", b"2 3 1 2\n", "says 3 elements"),
        (b"2 2 1 2\n", b"3 2 1 2\n", "less than its counts say"),
        (b"1 1 1 1\n", b"1 1 1 -1\n", "where a count is due"),
        (b"1 1 1 1\n", b"1 2 1 1\n", "refers to entity 2 of dimension 1"),
        (b"1 1 1 1\n", b"2 1 1 1\n", "elements of type 1 on an entity of dimension 2"),
        (b"0 1 1 0\n", b"0 1 2 0\n", "holds less than its counts say"),
        (b"0 1 1 0\n", b"0 1 0 0\n", "holds more than its counts say"),
        (b"0 1 1 0\n", b"0 -1 1 0\n", "where a count is due"),
        (b"0 1 1 0\n", b"0 1 x 0\n", "'x' is not a number"),
    ],
)
def test_damaged_files_of_the_new_format_are_refused(old: bytes, new: bytes, words: str) -> None:
    assert message(NEW) == ""
    assert NEW.count(old) == 1
    found = message(NEW.replace(old, new))
    assert re.search(words, found), found


def test_groups_of_turned_entities_and_without_names() -> None:
    """A negative number marks the opposite orientation of the same group."""
    for data in (NEW, NEW.replace(b"0 0 1 7 0", b"0 0 1 -7 0")):
        assert set(parse_msh(data).groups) == {(1, "7"), (2, "8")}


def sources() -> Iterator[bytes]:
    yield from (path.read_bytes() for path in GENUINE if path.stat().st_size < 20000)
    yield from (binary(version, order) for version in ("2.2", "4.0", "4.1") for order in "<>")


def test_a_file_that_is_cut_off_is_never_read() -> None:
    for data in sources():
        whole = len(data.rstrip())
        for end in np.unique(np.linspace(1, whole - 1, 60).astype(int)).tolist():
            assert message(data[:end]) != "", f"cut at {end} of {whole}"


def test_random_damage_never_breaks_the_reader() -> None:
    """A mesh or a sentence, nothing else; memory does not follow wrong counts."""
    rng = np.random.default_rng(7)
    for data in sources():
        for _ in range(40):
            damaged = bytearray(data)
            for place in rng.integers(0, len(data), rng.integers(1, 4)):
                damaged[place] = rng.integers(0, 256) if rng.random() < 0.5 else ord(rng.choice(list("0123456789-. e")))
            assert not message(bytes(damaged)).startswith("WRONG")


def test_entities_stand_in_for_groups_of_one_dimension_alone(tmp_path: Path) -> None:
    """Curves without groups beside surfaces with them; one surface alone needs no name."""
    path = tmp_path / "part.msh"
    for cells, regions, notes in (((1, 1, 1, 1), {"ground"}, 1), ((0, 0, 0, 0), set(), 1)):
        path.write_bytes(old_text(NAMES, [0, 0], list(cells)))
        mesh = read_mesh(path)
        assert (set(mesh.boundaries), set(mesh.regions), len(mesh.notes)) == ({"curve 1"}, regions, notes)
    rows = "".join(f"{n} {n} 0 0\n{n + 400} {n} 1 0\n" for n in range(1, 401))
    cells = "".join(
        f"{n} 1 2 0 {n} {n} {n + 1}\n{n + 400} 3 2 0 1 {n} {n + 1} {n + 401} {n + 400}\n" for n in range(1, 400)
    )
    path.write_text(
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n800\n{rows}$EndNodes\n$Elements\n798\n{cells}$EndElements\n"
    )
    mesh = read_mesh(path)
    assert (len(mesh.boundaries), mesh.notes[-1]) == (
        0,
        "its 399 curves are in no physical group, and too many for names",
    )


def test_an_element_of_several_groups_counts_once() -> None:
    """Format 2 repeats it; one that is repeated in the same group stays, and the mesh refuses it."""
    twice = b"7 2 2 3 1 3 5 12\n$EndElements"
    raw = parse_msh(GOOD.replace(b"$Elements\n6", b"$Elements\n7").replace(b"$EndElements", twice))
    assert len(raw.cells[2]) == 4
    assert raw.groups[2, "3"].tolist() == [0]
    assert raw.groups[2, "ground"].tolist() == [0, 1, 2, 3]
    same = twice.replace(b"2 2 3", b"2 2 1")
    raw = parse_msh(GOOD.replace(b"$Elements\n6", b"$Elements\n7").replace(b"$EndElements", same))
    assert len(raw.cells[2]) == 5
