"""Nonlinear materials in problem files: read, written, refused, and listed on the page."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.not_expressible import difference
from hemivar.files.problem_file import parse_problem
from hemivar.mechanics import Material
from hemivar.mechanics.material_registry import MATERIAL_LAWS, named_material
from hemivar.mechanics.statement import ContactProblem

PAGE = (Path(__file__).parents[2] / "docs" / "problem-file.md").read_text(encoding="utf-8")
PLANE, SPACE = "rectangle = [1.0, 1.0]\ncells = [2, 2]", "box = [1.0, 1.0, 1.0]\ncells = [1, 1, 1]"

#: What stands under [material], and the same in Python.
SAID = {
    "hencky": (
        'law = "hencky"\nbulk = 6.7\nshear = 4.0\nsoftened = 0.25\nstrain = 0.05',
        Material.hencky(6.7, 4.0, 0.25, 0.05),
    ),
    "hencky in time": (
        'law = "hencky"\nbulk = 6.7\nshear = 4.0\nsoftened = 0.25\nstrain = 0.05\nplane = "stress"\ndensity = 2.0\n'
        "viscosity = [0.1, 0.2]\nbranches = [{ lame = [1.0, 1.0], time = 0.5 }]",
        Material.hencky(
            6.7, 4.0, 0.25, 0.05, "stress",
            density=2.0, viscosity=(0.1, 0.2), branches=[hv.materials.Branch(lame=(1.0, 1.0), time=0.5)],
        ),
    ),
    "ramberg-osgood": (
        'law = "ramberg-osgood"\nyoung = 200e3\npoisson = 0.3\nyield_stress = 400.0\nexponent = 5.0\noffset = 0.4\n'
        "linear_from = 0.02",
        Material.ramberg_osgood(200e3, 0.3, 400.0, 5.0, 0.4, 0.02),
    ),
    "ramberg-osgood without bound": (
        'law = "ramberg-osgood"\nyoung = 200e3\npoisson = 0.3\nyield_stress = 400.0\nexponent = 5.0',
        Material.ramberg_osgood(200e3, 0.3, 400.0, 5.0),
    ),
    "locking": (
        'law = "locking"\nbulk = 6.7\nshear = 4.0\nstiffening = 20.0\nstrain = 0.03\nmeasure = "strain"',
        Material.locking(6.7, 4.0, 20.0, 0.03, "strain"),
    ),
    "potential": (
        'law = "potential"\nenergy = "3*tr^2 + 4*dev2 + tr^4"\nreach = 0.2',
        Material.potential("3*tr^2 + 4*dev2 + tr^4", reach=0.2),
    ),
    "potential of components": (
        'law = "potential"\nenergy = "3*exx^2 + 4*eyy^2 + 2*exy^2"\nreach = 0.2',
        Material.potential("3*exx^2 + 4*eyy^2 + 2*exy^2", reach=0.2),
    ),
}  # fmt: skip


def material_text(material: str, mesh: str = PLANE) -> str:
    return f'[mesh]\n{mesh}\n[material]\n{material}\n[supports]\nleft = "clamped"\n'


def read(text: str) -> ContactProblem:
    problem = parse_problem(text)
    assert isinstance(problem, ContactProblem)
    return problem


@pytest.mark.parametrize("name", SAID)
def test_what_a_file_says_is_the_material(name: str, tmp_path: Path) -> None:
    said, material = SAID[name]
    problem = read(material_text(said))
    assert difference(problem.material, material) is None
    points, strain = np.zeros((3, 2)), np.array([[0.01, 0.02, 0.0], [0.0, -0.1, 0.05], [0.1, 0.0, 0.0]])
    np.testing.assert_array_equal(problem.material.stress(points, strain), material.stress(points, strain))
    again = hv.read_problem(hv.write_problem(problem, tmp_path / "p.toml"))
    assert difference(problem, again) is None
    first = (tmp_path / "p.toml").read_text()
    assert hv.write_problem(again, tmp_path / "q.toml").read_text() == first
    assert "plane" in first or 'plane = "stress"' not in said


def test_constants_may_be_formulas(tmp_path: Path) -> None:
    problem = read(material_text('law = "hencky"\nbulk = "6 + x"\nshear = 4\nsoftened = 0.25\nstrain = "0.05*(1 + y)"'))
    other = Material.hencky(lambda x: 6 + x[:, 0], 4.0, 0.25, lambda x: 0.05 * (1.0 + x[:, 1]))
    points, strain = np.random.default_rng(0).uniform(size=(5, 2)), np.full((5, 3), 0.03)
    np.testing.assert_allclose(problem.material.stress(points, strain), other.stress(points, strain), rtol=1e-14)
    written = hv.write_problem(problem, tmp_path / "p.toml")
    assert 'strain = "0.05*(1 + y)"' in written.read_text()
    assert difference(problem, hv.read_problem(written)) is None


def test_regions_have_materials_each_of_its_own(tmp_path: Path) -> None:
    mesh = hv.rectangle((1.0, 1.0), 2)
    left = mesh.points[mesh.cells].mean(axis=1)[:, 0] < 0.5
    mesh = mesh.named(dict(mesh.boundaries), {"a": np.flatnonzero(left), "b": np.flatnonzero(~left)})
    mixed = Material.by_region({"a": SAID["locking"][1], "b": Material.young(210.0, 0.3)})
    problem = hv.ContactProblem(mesh, mixed, supports={"left": hv.Clamped()})
    written = hv.write_problem(problem, tmp_path / "p.toml", beside=True)
    assert "[material.regions.a]\nlaw = " in written.read_text()
    assert difference(problem.material, read_back(written).material) is None


def read_back(path: Path) -> ContactProblem:
    problem = hv.read_problem(path)
    assert isinstance(problem, ContactProblem)
    return problem


def test_functions_cannot_be_written(tmp_path: Path) -> None:
    own = Material.potential(energy, linear_stress, tangent, reach=1.0)
    problem = hv.ContactProblem(hv.rectangle(cells=1), own, supports={"left": hv.Clamped()})
    with pytest.raises(ProblemError, match="material is a FunctionEnergy, which a problem file cannot express"):
        hv.write_problem(problem, tmp_path / "p.toml")


def energy(strain: np.ndarray) -> np.ndarray:
    return np.asarray((strain**2).sum(axis=1))


def linear_stress(strain: np.ndarray) -> np.ndarray:
    return np.asarray(2.0 * strain)


def tangent(strain: np.ndarray) -> np.ndarray:
    return np.broadcast_to(2.0 * np.eye(strain.shape[1]), (*strain.shape, strain.shape[1]))


HENCKY = 'law = "hencky"\nbulk = 6.7\nshear = 4.0\nsoftened = 0.25\nstrain = 0.05\n'
LOCKING = 'law = "locking"\nbulk = 6.7\nshear = 4.0\nstiffening = 20.0\nstrain = 0.03\n'
STEEL = 'law = "ramberg-osgood"\nyoung = 200e3\npoisson = 0.3\nyield_stress = 400.0\nexponent = 5.0\n'


def without(text: str, key: str) -> str:
    return "".join(f"{line}\n" for line in text.splitlines() if not line.startswith(key))


def with_line(text: str, line: str) -> str:
    return without(text, line.split(" ")[0]) + line + "\n"


BAD = {
    "unknown law": ('law = "henky"', r"law: 'henky' is not known; did you mean 'hencky'\?"),
    "law is a number": ("law = 3", r"law: must be a text, not the number 3; write one of .*\"hencky\""),
    "constant missing": (
        without(HENCKY, "softened"),
        r"softened: is missing \(part of the shear .*write law = \"hencky\"",
    ),
    "energy missing": ('law = "potential"\nreach = 0.1', r"energy: is missing \(formula of the stored energy\)"),
    "reach missing": ('law = "potential"\nenergy = "tr^2 + dev2"', r"reach: is missing"),
    "law and lame": (HENCKY + "lame = [1.0, 1.0]", r"lame: does not go with law = \"hencky\"; remove it"),
    "constant of another law": (HENCKY + "stiffening = 2.0", r"stiffening: does not go with law = \"hencky\""),
    "constant without law": (
        "lame = [4.0, 4.0]\nsoftened = 0.25", r"softened: belongs to law = \"hencky\"; add the law, or remove it",
    ),
    "no law at all": ("bulk = 6.7\nshear = 4.0", r"no elastic constants are given; give lame.* or a law"),
    "unknown key": (HENCKY + "soft = 1", r"soft: unknown key; did you mean 'softened'\?"),
    "negative bulk": (with_line(HENCKY, "bulk = -1"), r"constant bulk = -1; it must be positive"),
    "zero strain": (with_line(HENCKY, "strain = 0"), r"constant strain = 0; it must be positive"),
    "softened above one": (with_line(HENCKY, "softened = 1.5"), r"constant softened = 1\.5; it must not exceed 1"),
    "a text that is no formula": (with_line(HENCKY, 'bulk = "6 +"'), r"bulk: formula '6 \+'"),
    "a formula of time": (with_line(HENCKY, 'bulk = "6 + t"'), r"bulk: formula '6 \+ t' uses t, but"),
    "a formula of z": (with_line(HENCKY, 'bulk = "6 + z"'), r"uses z, but the mesh is plane"),
    "a formula that turns negative": (
        with_line(HENCKY, 'bulk = "x - 0.5"'),
        r"bulk = -\S+ at x = \[.*; it must be positive",
    ),
    "a list": (with_line(HENCKY, "bulk = [1.0]"), r"bulk: must be a number or a formula in quotes, not a list"),
    "poisson too large": (with_line(STEEL, "poisson = 0.5"), r"constant nu = 0\.5; it must lie between -1 and 0\.5"),
    "exponent below one": (with_line(STEEL, "exponent = 0.5"), r"exponent: is 0\.5; it must be at least 1"),
    "exponent far too large": (with_line(STEEL, "exponent = 1e6"), r"exponent = 1e\+06; it must be 1 to 1000"),
    "linear_from zero": (STEEL + "linear_from = 0", r"linear_from = 0; it must be positive"),
    "units of giants": (with_line(LOCKING, "bulk = 1e150"), r"bulk = 1e\+150; it must lie between .* other units"),
    "unknown measure": (LOCKING + 'measure = "volume"', r"measure: 'volume' is not known"),
    "unknown plane": (LOCKING + 'plane = "both"', r"plane: 'both' is not known"),
    "not convex": (
        'law = "potential"\nenergy = "tr^2 + dev2 - dev2^2"\nreach = 1.0',
        r"is not convex: at tr = \S+, dev2 = ",
    ),
    "not convex with components": (
        'law = "potential"\nenergy = "exx^2 + eyy^2 + exy^2 - exx^4"\nreach = 1.0',
        r"is not convex: at the strain exx = ",
    ),
    "energy at zero strain": (
        'law = "potential"\nenergy = "1 + tr^2 + dev2"\nreach = 1.0', r"is 1 at zero strain; subtract it",
    ),
    "stress at zero strain": (
        'law = "potential"\nenergy = "tr + tr^2 + dev2"\nreach = 1.0', r"has a stress of size 1 at zero strain",
    ),
    "unknown variable": (
        'law = "potential"\nenergy = "tr^2 + dev^2"\nreach = 1.0',
        r"'dev' is not known; did you mean 'dev2'",
    ),
    "a place in the energy": ('law = "potential"\nenergy = "x*tr^2 + dev2"\nreach = 1.0', r"'x' is not known"),
    "energy not finite": (
        'law = "potential"\nenergy = "tr^2 + dev2 + sqrt(dev2 - 1)"\nreach = 1.0', r"is not finite at tr = 0, dev2 = 0",
    ),
    "derivative not finite": (
        'law = "potential"\nenergy = "tr^2 + dev2^0.6"\nreach = 1.0',
        r"or a derivative is not finite at tr = 0, dev2 = 0",
    ),
    "energy is a number": ('law = "potential"\nenergy = 3\nreach = 1.0', r"energy: must be a text, not the number 3"),
    "reach negative": ('law = "potential"\nenergy = "tr^2 + dev2"\nreach = -1.0', r"reach = -1\.0; give the size"),
    "no stiffness": (
        'law = "potential"\nenergy = "exx^2 + eyy^2"\nreach = 1.0',
        r"has no stiffness at zero strain against some strain",
    ),
    "components in plane stress": (
        'law = "potential"\nenergy = "exx^2 + eyy^2 + exy^2"\nreach = 1.0\nplane = "stress"',
        r"plane stress is for energies of tr",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_refused_in_words(name: str) -> None:
    material, words = BAD[name]
    with pytest.raises(ProblemError, match=words) as caught:
        parse_problem(material_text(material))
    message = str(caught.value)
    assert message.startswith("problem: [material]")
    assert "\n" not in message


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (LOCKING + 'plane = "stress"', r"plane: is for plane meshes, but this mesh is three-dimensional"),
        ('law = "potential"\nenergy = "exx^2 + eyy^2 + exy^2"\nreach = 1.0', r"against some strain in space"),
    ],
)
def test_in_space_it_is_refused_in_words(material: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        parse_problem(material_text(material, SPACE))


def test_the_page_lists_every_material_with_its_constants() -> None:
    table = PAGE.split("| `law` |", 1)[1].split("\n\n", 1)[0]
    rows = {found[1]: row for row in table.splitlines() if (found := re.match(r'\| `"([\w-]+)"`', row))}
    assert set(rows) == set(MATERIAL_LAWS)
    for name, entry in MATERIAL_LAWS.items():
        told = set(re.findall(r"`(\w+)`", rows[name].split("|")[-2]))
        assert told == {p.key for p in entry.parameters} - {"plane"}, name


def test_materials_are_made_by_name() -> None:
    made = named_material("locking", bulk=6.7, shear=4.0, stiffening=20.0, strain=0.03)
    assert difference(made, Material.locking(6.7, 4.0, 20.0, 0.03)) is None
    with pytest.raises(ProblemError, match="material 'locking' needs the parameter strain"):
        named_material("locking", bulk=6.7, shear=4.0, stiffening=20.0)
    with pytest.raises(ProblemError, match="material 'rubber' is not known; the materials are hencky"):
        named_material("rubber")
