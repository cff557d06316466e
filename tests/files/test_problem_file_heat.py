"""Heat in bodies: what is refused, files, restarts, what stands in tables and frames."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, march
from hemivar.files.not_expressible import difference
from hemivar.files.problem_file import ProblemFile, parse_problem_file
from hemivar.mechanics.thermal import Heat, HeatContact
from hemivar.workflows.marching import evolution_of
from tests.evolution.test_thermal_stepper import RICH, body, two_blocks


def test_a_file_of_two_bodies_with_heat(tmp_path: Path) -> None:
    """Written, read again, marched, stopped and gone on: the same temperatures."""
    given = {"upper:bottom": HeatContact(HeatContact.touching(0.5, 2.0), share=0.3)}
    heat = Heat(2.0, {"upper": 1.0, "lower": 2.0}, expansion=0.05, supports={"upper:top": 4.0}, contact=given)
    stated = ProblemFile(two_blocks(), time=parse_problem_file(FILE).time, heat=heat)
    hv.write_problem(stated, tmp_path / "two.toml")
    again = parse_problem_file((tmp_path / "two.toml").read_text(), tmp_path)
    assert difference(stated.heat, again.heat) is None
    one, two = (
        march(evolution, 0.4, step=0.1) for evolution in (evolution_of(again), Evolution(two_blocks(), heat=heat))
    )
    np.testing.assert_allclose(one.frames[-1].temperature, two.frames[-1].temperature, rtol=1e-12)  # type: ignore[arg-type]
    assert one["heat.friction"].shape == (5,)
    one.write(tmp_path / "two.pvd")
    last = sorted(file for file in (tmp_path / "two").iterdir() if "contact" not in file.name)[-1]
    np.testing.assert_allclose(meshio.read(last).point_data["temperature"], one.frames[-1].temperature)


FILE = """\
[mesh]
rectangle = [1.0, 1.0]
cells = [2, 2]
[material]
lame = [4.0, 4.0]
viscosity = [0.4, 0.4]
[loads]
traction = { top = [0.3, -0.5] }
[supports]
left = "clamped"
[contact.bottom]
normal = { law = "compliance", stiffness = 20.0 }
friction = { law = "tresca", bound = 0.1 }
[heat]
conductivity = 2.0
capacity = "1 + x"
expansion = 0.05
coupling = 2.0
stress_free = 0.1
temperature = "0.5*y"
source = 0.3
supports = { right = "0.1*t" }
flux = { top = 0.2 }
[heat.contact.bottom]
conductance = { closed = 0.5, per_pressure = 2.0 }
temperature = "t"
share = 0.5
[heat.contact.left]
exchange = { law = "compliance", stiffness = 2.0 }
[time]
until = 0.5
step = 0.1
"""


def test_a_file_says_what_the_library_says(tmp_path: Path) -> None:
    found = parse_problem_file(FILE)
    hv.write_problem(found, tmp_path / "body.toml")
    again = parse_problem_file((tmp_path / "body.toml").read_text(), tmp_path)
    assert difference(found.heat, again.heat) is None
    assert difference(found.problem, again.problem) is None
    contact = {**RICH.contact, "left": HeatContact(exchange=hv.Compliance(2.0))}
    by_hand = Heat(**{name: getattr(RICH, name) for name in RICH.__dataclass_fields__} | {"contact": contact})
    one, two = (march(evolution, 0.5, step=0.1) for evolution in (evolution_of(found), Evolution(body(), heat=by_hand)))
    np.testing.assert_allclose(one.frames[-1].temperature, two.frames[-1].temperature, rtol=1e-9)  # type: ignore[arg-type]
    np.testing.assert_allclose(one.frames[-1].displacement, two.frames[-1].displacement, atol=1e-10)
    one.write(tmp_path / "body.pvd")
    files = sorted(file for file in (tmp_path / "body").iterdir() if "contact" not in file.name)
    last = meshio.read(files[-1])
    np.testing.assert_allclose(last.point_data["temperature"], one.frames[-1].temperature)
    assert last.cell_data["thermal_stress"][0].shape == (8, 4)
    unsaid = ProblemFile(found.problem, time=found.time, heat=Heat(1.0, 1.0, contact={"bottom": HeatContact(_leaning)}))
    with pytest.raises(hv.errors.ProblemError, match="conductance"):
        hv.write_problem(unsaid, tmp_path / "no.toml")


def test_tables_of_a_conductance_are_read_and_written(tmp_path: Path) -> None:
    tables = "{ pressures = [0, 1.0], conductances = [0, 2], temperatures = [0.0, 9], factors = [1, 0.5] }"
    read = parse_problem_file(FILE.replace("{ closed = 0.5, per_pressure = 2.0 }", tables))
    assert read.heat is not None
    stated = read.heat.contact["bottom"].conductance
    assert stated == HeatContact.touching(pressures=[0, 1], conductances=[0, 2], temperatures=[0, 9], factors=[1, 0.5])
    hv.write_problem(read, tmp_path / "body.toml")
    again = parse_problem_file((tmp_path / "body.toml").read_text(), tmp_path)
    assert again.heat is not None
    assert again.heat.contact["bottom"].conductance == stated
    with pytest.raises(hv.errors.ProblemError, match="2 and 1 numbers"):
        parse_problem_file(FILE.replace("{ closed = 0.5, per_pressure = 2.0 }", tables.replace("[1, 0.5]", "[1]")))


def _leaning(penetration: Array, pressure: Array) -> Array:
    return 1.0 + pressure


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("conductivity = 2.0\n", "", "conductivity: is missing; heat needs a conductivity and a capacity"),
        ('capacity = "1 + x"\n', "", "capacity: is missing"),
        ('capacity = "1 + x"', "capacity = -1", "capacity"),
        ("expansion = 0.05", "expansion = 0.05\nthermal_stress = 1.0", "both given"),
        ("expansion = 0.05", "expansion = { steel = 1.0 }", "the mesh has no region 'steel'"),
        ("coupling = 2.0", "coupling = -2.0", "coupling = -2"),
        ("share = 0.5", "share = 2", "share = 2"),
        ("share = 0.5", "part = 2", "part"),
        ("[heat.contact.left]", "[heat.contact.lft]", "no boundary 'lft'"),
        ("{ closed = 0.5, per_pressure = 2.0 }", '"2*p"', "must be a number or"),
        ('exchange = { law = "compliance"', 'exchange = { law = "complaint"', "'complaint' is not a normal law"),
        ("supports = { right", "supports = { rigth", "no boundary 'rigth'"),
        ('temperature = "0.5*y"', 'temperature = "0.5*t"', "cannot change with time"),
        ("[time]\nuntil = 0.5\nstep = 0.1\n", "", "heat: depends on time; add a table"),
    ],
)
def test_what_files_refuse(old: str, new: str, words: str) -> None:
    assert old in FILE
    with pytest.raises(hv.errors.ProblemError, match=words):
        parse_problem_file(FILE.replace(old, new))
