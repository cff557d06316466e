"""Problem files of scalar problems: read, written back, refused in words; what is written of their solutions."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.files.not_expressible import difference
from hemivar.files.problem_file import parse_problem
from hemivar.formula import Formula, FormulaArray
from hemivar.mechanics.foundation import Side
from hemivar.mechanics.material_words import ScalarKind
from tests.samples import slow

FILE = """\
kind = "membrane"
title = "hill"
[mesh]
rectangle = [2, 2]
cells = 8
origin = [-1, -1]
[material]
tension = "2 + x"
density = 3
viscosity = "1 + y^2"
[loads]
source = -1
bedding = "0.5*x^2"
flux = { right = "y" }
[supports]
left = 0
top = "0.1*(x + 1)"
[contact.bottom]
normal = { law = "survey", q_max = 0.1 }
level = "0.1*x"
"""


def test_a_file_says_what_the_library_says() -> None:
    found = parse_problem(FILE)
    assert found.kind is ScalarKind.MEMBRANE
    same = hv.ScalarProblem(
        hv.rectangle((2.0, 2.0), 8, origin=(-1.0, -1.0)), Formula("2 + x"),
        {"bottom": hv.ScalarContact(hv.laws.ThresholdCompliance(0.1), Formula("0.1*x"))},
        supports={"left": 0.0, "top": Formula("0.1*(x + 1)")},
        source=-1.0, fluxes={"right": Formula("y")}, bedding=Formula("0.5*x^2", minimum=0.0), title="hill",
        density=3.0, viscosity=Formula("1 + y^2", minimum=0.0),
    )  # fmt: skip
    assert difference(same, found) is None
    assert hv.solve(found).raise_for_status().energy == pytest.approx(hv.solve(same).energy, rel=1e-14)


def rich() -> list[hv.ContactProblem]:
    halves = hv.rectangle((1.0, 1.0), 4)
    tensor = FormulaArray((Formula("2 + x"), 0.5, 0.5, 1.0), (2, 2))
    return [
        gallery.membrane_obstacle(4).problem,
        gallery.antiplane_friction(4).problem,
        parse_problem(FILE),  # type: ignore[list-item]
        hv.ScalarProblem(halves, [[2.0, 0.5], [0.5, 1.0]], area=hv.ScalarContact(hv.Tresca(0.1), 0.2), bedding=1.0),
        hv.ScalarProblem(halves, tensor, {"left": hv.ScalarContact(hv.SlipWeakening(0.3), side=Side.BELOW)}, order=2),
        hv.ScalarProblem(
            hv.box((1.0, 1.0, 2.0), 2), 3.0, {"bottom": hv.ScalarContact(hv.Softening(1.0, 2.0, 3.0))},
            kind=ScalarKind.HEAT,
        ),
    ]  # fmt: skip


@pytest.mark.parametrize("number", range(6))
def test_written_and_read_again(number: int, tmp_path: Path) -> None:
    problem = rich()[number]
    path = hv.write_problem(problem, tmp_path / "p.toml")
    found = hv.read_problem(path)
    assert difference(problem, found) is None
    again = hv.write_problem(found, tmp_path / "q.toml")
    assert again.read_text() == path.read_text()
    one, other = (hv.discretize(p, check_coercivity=False) for p in (problem, found))
    np.testing.assert_array_equal(one.stiffness.data, other.stiffness.data)
    np.testing.assert_array_equal(one.load, other.load)
    np.testing.assert_array_equal(one.offset, other.offset)


def test_what_one_key_gives_by_regions_another_may_give_for_all(tmp_path: Path) -> None:
    mesh = hv.rectangle((1.0, 1.0), 4)
    mesh = hv.Mesh(mesh.points, mesh.cells, mesh.boundaries, {"low": np.arange(16), "high": np.arange(16, 32)})
    by_region = {"low": 1.0, "high": Formula("1 + x", minimum=0.0)}
    for coefficient, density in ((2.0, by_region), ({"low": 2.0, "high": 3.0}, 4.0)):
        problem = hv.ScalarProblem(mesh, coefficient, density=density, supports={"left": 0.0})  # type: ignore[arg-type]
        path = hv.write_problem(problem, tmp_path / "p.toml", beside=True)
        assert difference(problem, hv.read_problem(path)) is None
    lines = path.read_text().replace("density = 4.0", "").replace("tension = 3.0", "tension = 3.0\ndensity = 1.0")
    path.write_text(lines)
    with pytest.raises(
        hv.errors.ProblemError, match=r"regions.low. density: is missing; give it in every .*or in none"
    ):
        hv.read_problem(path)


def test_regions_are_written_beside(tmp_path: Path) -> None:
    mesh = hv.rectangle((1.0, 1.0), 4)
    mesh = hv.Mesh(mesh.points, mesh.cells, mesh.boundaries, {"low": np.arange(16), "high": np.arange(16, 32)})
    problem = hv.ScalarProblem(
        mesh, {"low": 1.0, "high": Formula("1 + x")}, supports={"left": 0.0},
        area={
            "low": hv.ScalarContact(hv.Signorini(), 0.1),
            "high": hv.ScalarContact(hv.laws.ThresholdCompliance(0.1), -0.1, Side.BELOW),
        },
    )  # fmt: skip
    path = hv.write_problem(problem, tmp_path / "p.toml", beside=True)
    assert difference(problem, hv.read_problem(path)) is None
    with pytest.raises(hv.errors.ProblemError, match="Python function"):
        hv.write_problem(hv.ScalarProblem(hv.rectangle(), lambda x: 1.0 + x[:, 0]), tmp_path / "r.toml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"membrane"', '"plate"', "kind: 'plate' is not known"),
        ('"membrane"', "1", "kind: must be a text"),
        ('"membrane"', '"heat"', "tension: unknown key"),
        ("rectangle = [2, 2]\ncells = 8\norigin = [-1, -1]", "box = [1, 1, 1]\ncells = 2", "needs a plane mesh"),
        ("[mesh]\n", '[mesh]\nquadrature = "midpoint"\n', "has its laws at the nodes"),
        ('tension = "2 + x"', "tension = 0", "tension: is 0; it must be greater than 0"),
        ('tension = "2 + x"', 'tension = "x"', "the tension is -0.83"),
        ('tension = "2 + x"\n', "", "tension, regions: none is given"),
        ('tension = "2 + x"', "tension = [1, 2, 3]", "has 3 entries; it must be a number, a formula, or 2 lists of 2"),
        ('tension = "2 + x"', "regions = { low = { tension = 1 } }", "the mesh has no region 'low'"),
        ("density = 3", "density = -3", "density: is -3; it must be at least 0"),
        ("left = 0", 'left = "clamped"', "must be the value of u"),
        ("left = 0", "left = { x = 0 }", "must be the value of u, a number or a formula, not a table"),
        ("left = 0", "left = [0, 1]", "must be the value of u, a number or a formula, not a list"),
        ("left = 0", "lft = 0", "the mesh has no boundary 'lft'; did you mean 'left'"),
        ('right = "y"', 'rigt = "y"', "loads. flux.rigt: the mesh has no boundary"),
        ("source = -1", "body = [0, 1]", "body: unknown key"),
        ("[contact.bottom]", "[contact.botom]", "the mesh has no boundary 'botom'"),
        ("level = ", "gap = ", "gap: unknown key"),
        ("level = ", 'friction = "tresca"\nlevel = ', "normal, friction: both are given"),
        ('normal = { law = "survey", q_max = 0.1 }\n', "", "normal, friction: none is given"),
        ('normal = { law = "survey", q_max = 0.1 }', 'friction = { law = "coulomb", coefficient = 1 }', "depends"),
        ('level = "0.1*x"', 'level = "0.1*x"\nside = "left"', "side: 'left' is not known"),
        ("[contact.bottom]", '[area]\nnormal = "signorini"\ngap = 1\n[contact.bottom]', "gap: unknown key"),
        ("[contact.bottom]", '[area.low]\nnormal = "signorini"\n[contact.bottom]', "a region of the mesh"),
        ("[contact.bottom]", '[membrane]\nx = 1\n[contact.bottom]', "membrane: unknown table"),
    ],
)  # fmt: skip
def test_what_a_file_refuses(old: str, new: str, words: str) -> None:
    assert old in FILE
    with pytest.raises(hv.errors.ProblemError, match=words) as refused:
        parse_problem(FILE.replace(old, new), name="file.toml")
    assert str(refused.value).startswith("file.toml: ")
    assert "\n" not in str(refused.value)


def test_the_area_of_a_body_has_no_law_of_the_penetration() -> None:
    with pytest.raises(hv.errors.ProblemError, match=r"\[area\] normal: .* its points only slide"):
        parse_problem(
            '[mesh]\nrectangle = [1, 1]\ncells = 2\n[material]\nlame = [1, 1]\n[area]\nnormal = "signorini"\n'
        )


@pytest.mark.parametrize("number", range(6))
def test_records_and_vtu(number: int, tmp_path: Path) -> None:
    problem = rich()[number]
    if not problem.supports and number > 3:
        name = "right" if number == 4 else "top"
        problem = replace(problem, supports={name: 0.3})
    found = hv.solve(problem).raise_for_status()
    record = json.loads(found.to_json(tmp_path / "s.json").read_text())
    assert record["contact_points"] == found.problem.contact_points
    assert record["resultants"]["force"] is None
    assert set(record["boundaries"]) == set(found.problem.contact.names)
    assert record["reactions"].keys() == problem.supports.keys()
    assert len(found.contact_table) == found.problem.contact_points
    assert "normal" not in found.contact_table.dtype.names  # type: ignore[operator]
    grid = meshio.read(found.to_vtu(tmp_path / "s.vtu"))
    named = {"membrane": "deflection", "antiplane": "u_z", "heat": "temperature"}[problem.kind.value]
    np.testing.assert_allclose(grid.point_data[named], found.displacement[:, 0])
    if problem.kind is not ScalarKind.HEAT:
        np.testing.assert_allclose(grid.point_data["displacement"][:, 2], found.displacement[:, 0])
    node = found.problem.contact.node
    np.testing.assert_allclose(grid.point_data["pressure"][node], found.pressure)
    np.testing.assert_array_equal(grid.point_data["state"][node], found.states.codes)
    np.testing.assert_array_equal(grid.point_data["tangential_state"][node], found.tangential_state)
    assert (np.delete(grid.point_data["state"], node) == -1).all()
    assert grid.cell_data["flux"][0].shape == (problem.mesh.number_of_cells, 3)


@pytest.mark.parametrize("name", ["membrane_obstacle", slow("antiplane_friction")])
def test_the_command_solves_and_draws(name: str, tmp_path: Path) -> None:
    file = Path(__file__).parents[2] / "examples" / "problems" / f"{name}.toml"
    outputs = [f"--{kind}={tmp_path / f'{kind}.{suffix}'}" for kind, suffix in (
        ("json", "json"), ("vtu", "vtu"), ("plot", "png"), ("plot-contact", "png"),
    )]  # fmt: skip
    command = [sys.executable, "-m", "hemivar", "solve", str(file), "--quiet", *outputs]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "json.json").read_text())["certificate"]["unique"] is True
    assert "unique minimiser" in done.stdout
    assert ("contact area" if name.startswith("membrane") else "contact length") in done.stdout
    assert (tmp_path / "plot.png").stat().st_size > 10_000
    assert (tmp_path / "plot-contact.png").stat().st_size > 10_000


def test_contact_stated_as_a_bodys_is_written(tmp_path: Path) -> None:
    made = {"area": hv.Contact(hv.Compliance(2.0), gap=0.1, side=Side.BELOW)}
    problem = hv.ContactProblem(hv.rectangle((1.0, 1.0), 2), hv.Material.gradient(1.0), made)
    assert difference(problem, hv.read_problem(hv.write_problem(problem, tmp_path / "p.toml"))) is None
    damped = replace(problem, contact={"area": replace(made["area"], damping=hv.Compliance(1.0))})
    with pytest.raises(hv.errors.ProblemError, match=r"contact\['area'\].damping would be read back differently"):
        hv.write_problem(damped, tmp_path / "q.toml")
