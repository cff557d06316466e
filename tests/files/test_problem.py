"""Problem files say the same as the library: every key against what it stands for."""

from __future__ import annotations

import dataclasses
import inspect
from pathlib import Path

import numpy as np
import pytest

from hemivar.basics.stated import Form, keys_of
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.files.problem_file import parse_problem, parse_problem_file, read_problem
from hemivar.files.sample import SAMPLE
from hemivar.files.toml import KEYS
from hemivar.laws import (
    Adhesive,
    Bilateral,
    Capped,
    Compliance,
    CoulombBound,
    Friction,
    Layered,
    Logarithmic,
    NoContact,
    NoFriction,
    PenetrationBound,
    Signorini,
    SlipTable,
    SlipWeakening,
    Softening,
    Superpotential,
    ThresholdCompliance,
    Tresca,
    VectorLaw,
    table_law,
)
from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, NORMAL_LAWS, LawEntry, LawKind, friction_law, normal_law
from hemivar.mechanics import (
    Clamped,
    Contact,
    ContactProblem,
    Fixed,
    Material,
    Prescribed,
    Pressure,
    Quadrature,
    Roller,
)
from hemivar.mechanics.material_registry import MATERIAL_LAWS
from hemivar.mechanics.single_material import IN_TIME, SingleMaterial
from hemivar.mesh import Mesh, rectangle
from hemivar.solvers import Status, solve

SURVEY_FILE = """\
title = "survey, data (5.1)"
[mesh]
rectangle = [1.0, 1.0]
cells = [32, 32]
pattern = "cross"            # or "right", "left"; or: file = "part.msh"
[material]
lame = [4.0, 4.0]            # lambda, mu; or: young = .., poisson = .., plane = "strain"
[loads]
body = [-0.8, -0.8]
traction = { top = [0.0, 0.0] }
[supports]
left = "clamped"             # built-in names: left, right, bottom, top; or the mesh's groups
                             # also "roller" (normal component fixed), { x = 0.0 }, { displacement = [0.0, -0.1] }
[contact.bottom]
normal = { law = "survey", q_max = 0.3, p_const = 2.0 }
friction = { law = "tresca", bound = 0.5 }
gap = 0.0
"""

MESH = """
[mesh]
rectangle = [2.0, 1.0]
cells = [6, 4]
"""
MATERIAL = "[material]\nlame = [4.0, 3.0]\n"
LEFT = '[supports]\nleft = "clamped"\n'
BOTTOM = '[contact.bottom]\nnormal = "signorini"\n'

BODY = rectangle((2.0, 1.0), (6, 4))
STEEL = Material.lame(4.0, 3.0)


def same(text: str, expected: ContactProblem) -> None:
    """Whether a file states the expected problem, compared after discretisation."""
    found, wanted = discretize(parse_problem(text)), discretize(expected)
    assert found.unknowns == wanted.unknowns
    scale = abs(wanted.stiffness).max()
    assert abs(found.stiffness - wanted.stiffness).max() <= 1e-13 * scale
    np.testing.assert_allclose(found.load, wanted.load, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(found.contact.weights, wanted.contact.weights, rtol=1e-13)
    np.testing.assert_allclose(found.gap, wanted.gap, rtol=1e-13, atol=1e-15)
    assert found.constant == pytest.approx(wanted.constant, rel=1e-12, abs=1e-14)
    r = np.random.default_rng(0).normal(size=(found.contact_points, found.contact.components))
    r[:, 0] -= 2.0 * np.array([isinstance(wanted.law.normal, Signorini)], dtype=float) * np.abs(r[:, 0])
    if found.contact_points:
        np.testing.assert_allclose(found.law.value(r), wanted.law.value(r), rtol=1e-13)


def problem(**changes: object) -> ContactProblem:
    base: dict[str, object] = {"mesh": BODY, "material": STEEL, "supports": {"left": Clamped()}}
    return ContactProblem(**{**base, **changes})  # type: ignore[arg-type]


def test_the_survey_problem_as_printed() -> None:
    stated = parse_problem(SURVEY_FILE)
    assert stated.title == "survey, data (5.1)"
    same(
        SURVEY_FILE,
        ContactProblem(
            rectangle((1.0, 1.0), (32, 32), "cross"),
            Material.lame(4.0, 4.0),
            contact={"bottom": Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.5))},
            supports={"left": Clamped()},
            body_force=(-0.8, -0.8),
        ),
    )
    assert solve(discretize(stated)).status is Status.CONVERGED


def test_the_sample_solves() -> None:
    solution = solve(discretize(parse_problem(SAMPLE)))
    assert solution.status is Status.CONVERGED
    assert solution.normal_force > 0.0


# ---- mesh ------------------------------------------------------------------------------------------------


def test_rectangle_keys() -> None:
    stated = parse_problem(
        "[mesh]\nrectangle = [2, 1]\ncells = 3\norigin = [1.0, -1.0]\nscale = 1e-3\nrefine = 1\n"
        f'pattern = "left"\n{MATERIAL}'
    )
    wanted = rectangle((2.0, 1.0), 3, "left", (1.0, -1.0)).scaled(1e-3).refined()
    np.testing.assert_allclose(stated.mesh.points, wanted.points)
    np.testing.assert_array_equal(stated.mesh.cells, wanted.cells)
    assert stated.order == 1
    assert stated.quadrature is Quadrature.NODAL


def test_order_and_quadrature() -> None:
    text = f'{MESH}order = 2\nquadrature = "midpoint"\n{MATERIAL}{LEFT}{BOTTOM}'
    assert parse_problem(text).order == 2
    contact = {"bottom": Contact(Signorini())}
    same(text, problem(contact=contact, order=2, quadrature=Quadrature.MIDPOINT))


def test_mesh_file_is_looked_for_beside_the_problem_file(tmp_path: Path) -> None:
    import meshio

    mesh = rectangle((1.0, 1.0), 2)
    lines = np.vstack([mesh.boundaries["left"], mesh.boundaries["bottom"]])
    meshio.Mesh(
        np.column_stack([mesh.points, np.zeros(len(mesh.points))]),
        [("line", lines), ("triangle", mesh.cells)],
        cell_data={
            "gmsh:physical": [np.repeat([1, 2], 2), np.repeat([3, 4], 4)],
            "gmsh:geometrical": [np.repeat([1, 2], 2), np.repeat([3, 4], 4)],
        },
        field_data={
            "left": np.array([1, 1]), "floor": np.array([2, 1]), "below": np.array([3, 2]), "above": np.array([4, 2])
        },
    ).write(tmp_path / "part.msh", file_format="gmsh22", binary=False)  # fmt: skip
    (tmp_path / "part.toml").write_text(
        '[mesh]\nfile = "part.msh"\nrefine = 1\n'
        "[material.regions.below]\nlame = [4.0, 3.0]\n[material.regions.above]\nyoung = 2.0\npoisson = 0.3\n"
        '[supports]\nleft = "clamped"\n[contact.floor]\nnormal = "signorini"\n'
    )
    stated = read_problem(tmp_path / "part.toml")
    assert sorted(stated.mesh.boundaries) == ["floor", "left"]
    assert stated.mesh.number_of_cells == 32
    parts = {"below": STEEL, "above": Material.young(2.0, 0.3)}
    expected = ContactProblem(
        stated.mesh,
        Material.by_region(parts),
        contact={"floor": Contact(Signorini())},
        supports={"left": Clamped()},
    )
    assert abs(discretize(stated).stiffness - discretize(expected).stiffness).max() < 1e-12


def test_coarser_meshes() -> None:
    def sizes(mesh: str) -> list[int]:
        stated = parse_problem_file(f"[mesh]\nrectangle = [1, 1]\n{mesh}\n{MATERIAL}")
        return [coarse.number_of_cells for coarse in stated.coarser_meshes()]

    assert sizes("cells = 16") == [8, 32, 128]
    assert sizes("cells = [8, 4]") == [16]
    assert sizes("cells = [5, 4]") == []
    assert sizes("cells = [5, 4]\nrefine = 2") == [40, 160]
    assert sizes("cells = 4\nrefine = 1") == [8, 32]


BOX = "[mesh]\nbox = [1, 2, 3]\n"


def test_box() -> None:
    stated = parse_problem_file(f"{BOX}cells = [2, 4, 8]\norigin = [0, 0, -3]\n{MATERIAL}")
    mesh = stated.problem.mesh
    assert mesh.number_of_cells == 6 * 2 * 4 * 8
    assert set(mesh.boundaries) == {"left", "right", "front", "back", "bottom", "top"}
    np.testing.assert_allclose(mesh.points.min(axis=0), [0, 0, -3])
    np.testing.assert_allclose(mesh.points.max(axis=0), [1, 2, 0])


def test_coarser_boxes() -> None:
    stated = parse_problem_file(f"{BOX}cells = [4, 8, 8]\nrefine = 1\n{MATERIAL}")
    assert [mesh.number_of_cells for mesh in stated.coarser_meshes()] == [6 * 2 * 4 * 4, 6 * 4 * 8 * 8]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("box = [1, 1]\ncells = 2", "three numbers"),
        ("box = [1, 1, 0]\ncells = 2", "must be positive"),
        ("box = [1, 1, 1]", r"is missing.*\[32, 32, 32\]"),
        ("box = [1, 1, 1]\ncells = [2, 2]", "list of three"),
        ('box = [1, 1, 1]\ncells = 2\npattern = "cross"', "belongs to a rectangle"),
        ("box = [1, 1, 1]\nrectangle = [1, 1]\ncells = 2", "rectangle and box are given"),
        ("box = [1, 1, 1]\ncells = 2000", "take fewer"),
    ],
)
def test_bad_boxes(text: str, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        parse_problem_file(f"[mesh]\n{text}\n{MATERIAL}")


def test_quadrature_at_midpoints_is_for_plane_bodies() -> None:
    text = f'{BOX}cells = 2\nquadrature = "midpoint"\n{MATERIAL}{LEFT}'
    assert parse_problem(text).quadrature is Quadrature.MIDPOINT
    with pytest.raises(ProblemError, match=r'\[mesh\] quadrature: .*twice as many facets.*write quadrature = "nodal"'):
        parse_problem(text + BOTTOM)


def test_a_byte_order_mark_is_no_obstacle(tmp_path: Path) -> None:
    (tmp_path / "part.toml").write_text(SAMPLE, encoding="utf-8-sig")
    assert read_problem(tmp_path / "part.toml").title.startswith("elastic block")


# ---- material, loads, supports ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "material"),
    [
        ("lame = [4, 3]", STEEL),
        ('lame = [4.0, 3.0]\nplane = "stress"', Material.lame(4.0, 3.0, "stress")),
        ("young = 10.0\npoisson = 0.3", Material.young(10.0, 0.3)),
        ('young = 10.0\npoisson = 0.3\nplane = "stress"', Material.young(10.0, 0.3, "stress")),
        ('lame = ["1 + x", "2 + y^2"]', Material.lame(lambda p: 1 + p[:, 0], lambda p: 2 + p[:, 1] ** 2)),
        ('young = "exp(-x)"\npoisson = "0.3"', Material.young(lambda p: np.exp(-p[:, 0]), 0.3)),
        (
            "tensor = [[4, 1, 0], [1, 3, 0], [0, 0, 1]]\nout_of_plane = [0.3, 0.2, 0.0]",
            Material.tensor([[4, 1, 0], [1, 3, 0], [0, 0, 1]], [0.3, 0.2, 0.0]),
        ),
        (
            'tensor = [["4 + x", 1, 0], [1, 3, 0], [0, 0, 1]]',
            Material.tensor(
                lambda p: np.array([[4, 1, 0], [1, 3, 0], [0, 0, 1.0]]) + p[:, :1, None] * np.diag([1.0, 0, 0])[None]
            ),
        ),
    ],
)
def test_materials(text: str, material: Material) -> None:
    same(f"{MESH}[material]\n{text}\n{LEFT}", problem(material=material))


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("body = [0.5, -1]", {"body_force": (0.5, -1.0)}),
        ('body = ["x*y", -1]', {"body_force": lambda p: np.column_stack([p[:, 0] * p[:, 1], -np.ones(len(p))])}),
        ("traction = { top = [0.0, -2.0], right = [1, 0] }", {"tractions": {"top": (0.0, -2.0), "right": (1.0, 0.0)}}),
        (
            'traction.top = ["x^2", 0]',
            {"tractions": {"top": lambda p: np.column_stack([p[:, 0] ** 2, np.zeros(len(p))])}},
        ),
        ("pressure = { right = 2.0 }", {"tractions": {"right": Pressure(2.0)}}),
        ('pressure = { right = "y" }', {"tractions": {"right": Pressure(lambda p: p[:, 1])}}),
    ],
)  # fmt: skip
def test_loads(text: str, changes: dict[str, object]) -> None:
    same(f"{MESH}{MATERIAL}{LEFT}[loads]\n{text}\n", problem(**changes))


@pytest.mark.parametrize(
    ("text", "support"),
    [
        ('"roller"', Roller()),
        ("{ x = 0.1 }", Fixed(x=0.1)),
        ('{ x = "0.1 * y", y = 0.0 }', Fixed(x=lambda p: 0.1 * p[:, 1], y=0.0)),
        ("{ displacement = [0.0, -0.1] }", Prescribed((0.0, -0.1))),
        (
            '{ displacement = ["y", 0] }',
            Prescribed(lambda p: np.column_stack([p[:, 1], np.zeros(len(p))])),
        ),
    ],
)
def test_supports(text: str, support: object) -> None:
    supports = {"left": Clamped(), "right": support}
    same(f"{MESH}{MATERIAL}{LEFT}right = {text}\n", problem(supports=supports))


# ---- laws ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "contact"),
    [
        ('normal = "signorini"', Contact(Signorini())),
        ('normal = { law = "signorini" }\nfriction = "none"', Contact(Signorini(), NoFriction())),
        ('normal = "bilateral"', Contact(Bilateral())),
        ('normal = "none"', Contact(NoContact())),
        ('normal = { law = "survey", q_max = 1 }', Contact(ThresholdCompliance(1.0))),
        (
            'normal = { law = "survey", q_max = "0.1 + x", p_const = "y" }\n'
            'friction = { law = "tresca", bound = "max(0, x - 1)" }\ngap = "0.1*x*(2-x)"',
            Contact(
                ThresholdCompliance(lambda p: 0.1 + p[:, 0], lambda p: p[:, 1]),
                Tresca(lambda p: np.maximum(0.0, p[:, 0] - 1.0)),
                lambda p: 0.1 * p[:, 0] * (2.0 - p[:, 0]),
            ),
        ),
        ('normal = { law = "compliance", stiffness = 50.0 }\ngap = -0.01', Contact(Compliance(50.0), gap=-0.01)),
        ('normal = { law = "compliance", stiffness = 50, exponent = 2 }', Contact(Compliance(50.0, 2.0))),
        (
            'normal = { law = "compliance", stiffness = "50 + x", exponent = "1 + y" }',
            Contact(Compliance(lambda p: 50.0 + p[:, 0], lambda p: 1.0 + p[:, 1])),
        ),
        ('normal = "none"\nfriction = { law = "tresca", bound = "2*pi" }', Contact(NoContact(), Tresca(2 * np.pi))),
    ],
)
def test_contact(text: str, contact: Contact) -> None:
    # bilateral contact is compared by what it solves to, for its value is infinite almost everywhere
    stated = f"{MESH}{MATERIAL}{LEFT}[loads]\nbody = [0.1, -0.4]\n[contact.bottom]\n{text}\n"
    expected = problem(contact={"bottom": contact}, body_force=(0.1, -0.4))
    if not isinstance(contact.normal, Bilateral):
        same(stated, expected)
    found, wanted = solve(discretize(parse_problem(stated))), solve(discretize(expected))
    np.testing.assert_allclose(found.unknowns, wanted.unknowns, atol=1e-10)


def test_several_contact_boundaries_keep_their_laws() -> None:
    text = (
        f"{MESH}{MATERIAL}{LEFT}[contact.bottom]\nnormal = 'signorini'\n"
        "[contact.right]\nnormal = {law = 'compliance', stiffness = 3}\ngap = 0.2\n"
    )
    stated = parse_problem(text)
    assert list(stated.contact) == ["bottom", "right"]
    discrete = discretize(stated)
    assert isinstance(discrete, DiscreteProblem)
    assert discrete.contact_points == 6 + 5


#: Arguments of laws and materials that files have no key for, or one elsewhere.
NOT_IN_FILES = {"where", "name", "even", "friction", "stress", "tangent", "in_time"} | {
    *keys_of(SingleMaterial, by=IN_TIME)
}
NAMED = [*NORMAL_LAWS.values(), *COUPLED_LAWS.values(), *FRICTION_LAWS.values(), *MATERIAL_LAWS.values()]


@pytest.mark.parametrize("entry", NAMED, ids=[f"{entry.kind}-{entry.name}" for entry in NAMED])
def test_every_argument_of_a_named_law_is_stated(entry: LawEntry) -> None:
    names = [name for name in inspect.signature(entry.build).parameters if name not in NOT_IN_FILES]
    assert [p.name for p in entry.parameters] == names
    assert all(p.stated.says and p.stated.unit for p in entry.parameters)
    if dataclasses.is_dataclass(entry.build):
        assert entry.name == getattr(entry.build, "kind" if entry.kind is LawKind.MATERIAL else "name")
    if not any(p.stated.form is Form.FILE for p in entry.parameters):
        made = entry.make(**{p.key: p.shown for p in entry.parameters if p.required or p.key == "potential"})
        kinds = {LawKind.FRICTION: Friction, LawKind.MATERIAL: Material}
        assert isinstance(made, kinds.get(entry.kind, Superpotential | VectorLaw))


LAW_TEXTS = {
    'normal = { law = "softening", stiffness = 2, limit = 0.1, softening = 0.5 }': Contact(Softening(2.0, 0.1, 0.5)),
    'normal = { law = "capped", stiffness = "20 + x", limit = 0.1 }': Contact(Capped(lambda p: 20 + p[:, 0], 0.1)),
    'normal = { law = "adhesive", stiffness = 5, strength = 1, compression = 7 }': Contact(
        Adhesive(5.0, 1.0, compression=7.0)
    ),
    'normal = { law = "layered", thicknesses = [0.1, 0.2], stiffnesses = [3, 1], drops = [0.1, 0], base = 2 }': Contact(
        Layered([0.1, 0.2], [3.0, 1.0], [0.1, 0.0], 2.0)
    ),
    'normal = { law = "table", file = "law.csv" }\n'
    'friction = { law = "table", file = "law.csv", bound = 0.2 }': Contact(
        table_law([0, 0.1, 0.1], [1, 2, 0]), Friction(0.2, table_law([0, 0.1, 0.1], [1, 2, 0], friction=True))
    ),
    'normal = { law = "pressure-table", penetrations = [0, 0.1, 0.1], pressures = [1, 2, 0], '
    'extend = "linear" }': Contact(table_law([0, 0.1, 0.1], [1, 2, 0], extend="linear")),
    'normal = { law = "formula", potential = "7/10*abs(r) - 3/10*exp(-abs(r))" }\n'
    'friction = { law = "formula", potential = "log(1+r)", bound = 0.5 }': Contact(
        SlipWeakening(1.0).radial, Logarithmic(0.5)
    ),
    'normal = "none"\nfriction = { law = "slip-weakening", bound = "0.1 + x", rate = 3 }': Contact(
        NoContact(), SlipWeakening(lambda p: 0.1 + p[:, 0], rate=3.0)
    ),
    'normal = "none"\nfriction = { law = "slip-table", bound = 2, slips = [0, 0.1], values = [1, 0.5] }': Contact(
        NoContact(), SlipTable(2.0, [0.0, 0.1], [1.0, 0.5])
    ),
    'normal = "none"\nfriction = { law = "tresca", bound = { table = "bound.csv" } }': Contact(
        NoContact(), Tresca(PenetrationBound(([0.0, 0.1], [0.0, 0.8])))
    ),
    'normal = "none"\nfriction = { law = "tresca", bound = { formula = "8*s" } }': Contact(
        NoContact(), Tresca(PenetrationBound("8*s"))
    ),
    'normal = "none"\nfriction = { law = "logarithmic", bound = { coulomb = 0.3 } }': Contact(
        NoContact(), Logarithmic(CoulombBound(0.3))
    ),
    'normal = "none"\nfriction = { law = "coulomb", coefficient = 0.3 }': Contact(
        NoContact(), Tresca(CoulombBound(0.3))
    ),
}


def _law_folder(folder: Path) -> Path:
    (folder / "law.csv").write_text("r,derivative\n0,1\n0.1,2\n0.1,0\n")
    (folder / "bound.csv").write_text("s,bound\n0,0\n0.1,0.8\n")
    (folder / "falling.csv").write_text("r,derivative\n0,1\n0.2,2\n0.1,0\n")
    return folder


@pytest.mark.parametrize("text", LAW_TEXTS)
def test_nonmonotone_laws(tmp_path: Path, text: str) -> None:
    stated = f"{MESH}{MATERIAL}{LEFT}[contact.bottom]\n{text}\n"
    law = discretize(parse_problem(stated, _law_folder(tmp_path))).law
    expected = discretize(problem(contact={"bottom": LAW_TEXTS[text]})).law
    assert law.state_dependent == expected.state_dependent
    count = discretize(problem(contact={"bottom": LAW_TEXTS[text]})).contact_points
    r, lam = np.random.default_rng(3).normal(0.0, 0.2, (2, count, 2))
    np.testing.assert_allclose(law.frozen(r, lam).value(r), expected.frozen(r, lam).value(r), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('normal = { law = "table", file = "falling.csv" }', ["[contact.bottom] normal", "falling.csv, row 3"]),
        (
            'normal = { law = "pressure-table", penetrations = [0, 1], pressures = [0] }',
            ["[contact.bottom] normal", "lists of equal length"],
        ),
        (
            'normal = { law = "pressure-table", penetrations = [0, 0.2, 0.1], pressures = [0, 1, 2] }',
            ["[contact.bottom] normal", "row 3", "must not fall"],
        ),
        ('normal = { law = "table", file = "none.csv" }', ["none.csv", "no such file"]),
        ('normal = { law = "formula", potential = "7/10*q" }', ["normal.potential", "character 6", "'q'"]),
        ('normal = { law = "formula", potential = "log(r)" }', ["normal.potential", "not finite at r = "]),
        ('normal = { law = "layered", thicknesses = 1, stiffnesses = [1] }', ["thicknesses", "list of numbers"]),
        ('normal = { law = "layered", thicknesses = [1], stiffnesses = [1, 2] }', ["stiffnesses", "needs 1"]),
        ('normal = "none"\nfriction = { law = "table", file = "law.csv", extend = "x" }', ["extend", "linear"]),
        (
            'normal = "none"\nfriction = { law = "tresca", bound = { formula = "8*x" } }',
            ["bound.formula", "character 3"],
        ),
        ('normal = "none"\nfriction = { law = "tresca", bound = { formula = "1 - s" } }', ["bound.formula", "-9 at"]),
        ('normal = "none"\nfriction = { law = "tresca", bound = { formla = "s" } }', ["did you mean 'formula'?"]),
        ('normal = "none"\nfriction = { law = "tresca", bound = {} }', ["bound", "give one of"]),
        ('normal = "none"\nfriction = { law = "coulomb", coefficient = -1 }', ["coefficient", "at least 0"]),
    ],
)
def test_bad_laws_are_reported_with_their_key(tmp_path: Path, text: str, words: list[str]) -> None:
    with pytest.raises(ProblemError) as caught:
        parse_problem(f"{MESH}{MATERIAL}{LEFT}[contact.bottom]\n{text}\n", _law_folder(tmp_path))
    for word in words:
        assert word in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("deep", ["[" + ".".join(["a"] * 1000) + "]", ".".join(["a"] * 200) + " = 1"])
def test_tables_that_are_too_deep_are_refused(deep: str) -> None:
    with pytest.raises(ProblemError, match="nested too deeply"):
        parse_problem(f"{deep}\n")


def test_laws_by_name() -> None:
    assert isinstance(normal_law("survey", q_max=0.3), ThresholdCompliance)
    assert friction_law("tresca", bound=0.5).bound == 0.5
    with pytest.raises(ProblemError, match="law 'glue' is not known; the laws are adhesive, barton-bandis"):
        normal_law("glue")
    with pytest.raises(ProblemError, match="needs the parameter q_max"):
        normal_law("survey")
    with pytest.raises(ProblemError, match=r"no parameter 'bond' \(parameters: bound, of\)"):
        friction_law("tresca", bond=0.5)


# ---- solver settings -------------------------------------------------------------------------------------


def test_solver_settings() -> None:
    none = parse_problem_file(MESH + MATERIAL).solver
    assert (none.method, none.rtol, none.max_steps, none.max_time) == (None, None, None, None)
    given = parse_problem_file(
        f'{MESH}{MATERIAL}[solver]\nmethod = "active-set"\nrtol = 1e-8\nmax_steps = 7\nmax_time = 3\n'
    ).solver
    assert (given.method, given.rtol, given.max_steps, given.max_time) == ("active-set", 1e-8, 7, 3.0)


# ---- what only the library can be told -------------------------------------------------------------------


def test_inverted_cells_and_dangling_nodes_are_reported() -> None:
    points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
    with pytest.raises(ProblemError, match="cells are inverted: cells 0"):
        Mesh(points, [[0, 2, 1], [1, 3, 2]])
    with pytest.raises(ProblemError, match="1 nodes belong to no cell: nodes 3"):
        Mesh(points, [[0, 1, 2]])
    with pytest.raises(ProblemError, match="boundary 'left' holds no facets"):
        Mesh(points, [[0, 1, 2], [1, 3, 2]], {"left": np.zeros((0, 2), dtype=int)})


def test_gap_function_of_the_wrong_shape_is_reported() -> None:
    contact = {"bottom": Contact(Signorini(), gap=lambda p: p)}
    with pytest.raises(ProblemError, match=r"gap of contact 'bottom'.* shape \(7, 2\)"):
        discretize(problem(contact=contact))


# ---- documentation ---------------------------------------------------------------------------------------


def test_every_key_and_every_law_is_documented() -> None:
    page = Path(__file__).parents[2] / "docs" / "problem-file.md"
    text = page.read_text(encoding="utf-8")
    for table, keys in KEYS.items():
        if table:
            assert f"`[{table.replace('*', 'NAME')}]`" in text
        for key in keys:
            assert f"`{key}`" in text, f"{table}: {key}"
    for entry in (*NORMAL_LAWS.values(), *FRICTION_LAWS.values()):
        assert f'`"{entry.name}"`' in text
        for parameter in entry.parameters:
            assert f"`{parameter.key}`" in text


def test_the_examples_of_the_documentation_are_valid() -> None:
    page = Path(__file__).parents[2] / "docs" / "problem-file.md"
    blocks = page.read_text(encoding="utf-8").split("```toml\n")[1:]
    whole = [block.split("```")[0] for block in blocks if "[mesh]" in block.split("```")[0]]
    whole = [block for block in whole if "file =" not in block]
    assert len(whole) >= 3
    for text in whole:
        solution = solve(discretize(parse_problem(text)))
        assert solution.status is Status.CONVERGED


def test_an_unknown_support_names_every_way_to_hold_a_boundary() -> None:
    with pytest.raises(ProblemError) as told:
        parse_problem(MESH + MATERIAL + LEFT.replace("clamped", "fixed") + BOTTOM)
    for part in ("'fixed' is not known", "clamped, roller", "{ x = 0.0 }", "{ displacement = [...] }"):
        assert part in str(told.value)
    for way in ("{ x = 0.0 }", "{ displacement = [0.0, -0.1] }"):
        parse_problem(MESH + MATERIAL + LEFT.replace('"clamped"', way) + BOTTOM)
