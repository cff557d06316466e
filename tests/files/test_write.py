"""Problem files written back: read again they state the same, to the last digit; what they cannot say is refused."""

from __future__ import annotations

import dataclasses
import math
import os
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import hemivar as hv
from hemivar import gallery
from hemivar.basics.stated import Form
from hemivar.errors import FileError, HemivarError, ProblemError
from hemivar.files.not_expressible import difference
from hemivar.files.problem_file import parse_problem_file, read_problem_file
from hemivar.files.settings import SolverSettings
from hemivar.files.toml import text_of
from hemivar.formula import Formula, FormulaArray
from hemivar.gallery.known import KnownProblem, weighted_block
from hemivar.gallery.survey_problems import SURVEY_DATA
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS, LawEntry, friction_law, normal_law
from hemivar.mesh import Mesh, box, read_mesh, rectangle

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "problems").glob("*.toml"))


def same_discrete(one: hv.ContactProblem, other: hv.ContactProblem) -> None:
    """Whether two statements give one discrete problem, bit for bit."""
    first, second = (
        hv.discretize(problem.at_time(0.5), check_coercivity=False, evolving=True) for problem in (one, other)
    )
    np.testing.assert_array_equal(first.load, second.load)
    np.testing.assert_array_equal(first.offset, second.offset)
    for name in ("weights", "points", "frames", "node", "boundary"):
        np.testing.assert_array_equal(getattr(first.contact, name), getattr(second.contact, name), err_msg=name)
    u = np.random.default_rng(2).normal(scale=0.01, size=first.unknowns)
    np.testing.assert_array_equal(first.bulk.gradient(u), second.bulk.gradient(u))
    for a, b in ((first.bulk.hessian(u), second.bulk.hessian(u)), (first.contact.trace, second.contact.trace)):
        np.testing.assert_array_equal(a.indices, b.indices)
        np.testing.assert_array_equal(a.data, b.data)
    if first.contact_points:
        r = np.random.default_rng(0).normal(scale=0.2, size=(first.contact_points, first.contact.components))
        r = first.law.admissible(r)
        lam = np.abs(np.random.default_rng(1).normal(size=r.shape))
        np.testing.assert_array_equal(first.law.frozen(r, lam).value(r), second.law.frozen(r, lam).value(r))
        np.testing.assert_array_equal(
            first.law.frozen(r, lam).nearest_multiplier(r, lam), second.law.frozen(r, lam).nearest_multiplier(r, lam)
        )


def round_trip(problem: hv.ContactProblem, folder: Path, discrete: bool = True, beside: bool = False) -> str:
    """Write, read, compare; returns the text."""
    path = hv.write_problem(problem, folder / "p.toml", beside=beside)
    found = hv.read_problem(path)
    assert difference(problem, found) is None
    text = path.read_text(encoding="utf-8")
    assert hv.write_problem(found, folder / "q.toml", beside=beside).read_text(encoding="utf-8") == text
    if discrete:
        same_discrete(problem, found)
    return text


def stated(**changes: object) -> hv.ContactProblem:
    base: dict[str, object] = {
        "mesh": rectangle((2.0, 1.0), (4, 2)),
        "material": hv.Material.lame(4.0, 3.0),
        "supports": {"left": hv.Clamped()},
    }
    return hv.ContactProblem(**{**base, **changes})  # type: ignore[arg-type]


# ---- what there is ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_comes_back(path: Path, tmp_path: Path) -> None:
    given_file = read_problem_file(path)
    written = hv.write_problem(given_file, tmp_path / path.name)
    found = read_problem_file(written)
    assert difference(given_file.problem, found.problem) is None
    assert found.solver == given_file.solver
    assert [mesh.number_of_cells for mesh in found.coarser_meshes()] == [
        mesh.number_of_cells for mesh in given_file.coarser_meshes()
    ]
    if given_file.problem.mesh.number_of_cells < 10_000:
        same_discrete(given_file.problem, found.problem)


GALLERY: dict[str, Callable[[], hv.ContactProblem]] = {
    **{f"survey {name}": lambda name=name: gallery.survey(name, 4) for name in SURVEY_DATA},  # type: ignore[misc]
    "survey cube": lambda: gallery.survey_cube("5.1", 2),
    "weighted block": lambda: weighted_block(n=2).problem,
    "patch": lambda: weighted_block(n=2, top_displacement=0.1).problem,
    "beam": gallery.beam,
    "broken foundation": lambda: gallery.broken_foundation(2),
    "delamination": lambda: gallery.delamination(2),
    "survey logarithmic": lambda: gallery.survey_logarithmic(n=4),
    "survey cube logarithmic": lambda: gallery.survey_cube_logarithmic(n=2),
    "softening block": lambda: gallery.softening_block(n=2).problem,
}


@pytest.mark.parametrize("name", GALLERY)
def test_every_statement_of_the_gallery_comes_back(name: str, tmp_path: Path) -> None:
    problem = GALLERY[name]()
    if name == "broken foundation":  # its friction bound is a table that comes from no file
        with pytest.raises(ProblemError, match=r"contact\['bottom'\]\.friction\.bound is a table .* beside=True"):
            hv.write_problem(problem, tmp_path / "p.toml")
        assert list(tmp_path.iterdir()) == []
    round_trip(problem, tmp_path, beside=name == "broken foundation")


@pytest.mark.parametrize(
    "make",
    [gallery.manufactured_spring, gallery.manufactured_softening, gallery.shear_block],
    ids=["spring", "softening", "shear"],
)
def test_statements_with_python_functions_are_refused(make: Callable[[], KnownProblem], tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=r"is the Python function .*, which a problem file cannot express"):
        hv.write_problem(make().problem, tmp_path / "p.toml")
    assert list(tmp_path.iterdir()) == []


def test_what_is_no_statement_is_refused(tmp_path: Path) -> None:
    discrete = hv.discretize(gallery.survey("5.1", 2))
    with pytest.raises(ProblemError, match="is a DiscreteProblem; give a ContactProblem, a ScalarProblem or"):
        hv.write_problem(discrete, tmp_path / "p.toml")  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


# ---- random statements ------------------------------------------------------------------------------------

numbers = st.floats(1e-6, 1e6) | st.sampled_from([0.1, 1.0, 1 / 3, 3, 1e-5])
signed = st.floats(-1e6, 1e6) | st.just(-0.0)
POSITIVE = ["1 + 0.5 * sin(pi * y)", "1 + abs(x - 0.3)"]
TEXTS = [*POSITIVE, "0.1 * x", "max(x, y)^2 + 1e-3"]
formulas = st.sampled_from([*TEXTS, "0.1 * x * min(t, 1)"]).map(Formula)


def vectors(dim: int) -> st.SearchStrategy[object]:
    plain = st.lists(signed, min_size=dim, max_size=dim).map(tuple)
    one = st.tuples(formulas, *[signed | formulas] * (dim - 1))
    return plain | one.map(lambda v: FormulaArray(tuple(v), (dim,)))


def written_tables(folder: Path) -> list[Path]:
    law, slip, bound = folder / "law.csv", folder / "slip table.csv", folder / "bound.csv"
    law.write_text("r,derivative\n-0.1,0\n0,0\n0.1,2\n0.1,0.5\n0.3,0.1\n", encoding="utf-8")
    slip.write_text("derivative;r\n1;0\n0.25;0.1\n", encoding="utf-8")
    bound.write_text("s,bound\n0,0\n0.1,0.8\n", encoding="utf-8")
    return [law, slip, bound]


@st.composite
def laws(draw: st.DrawFn, entry: LawEntry, folder: Path) -> hv.laws.Superpotential | hv.laws.Friction:
    """A law by its name, with parameters in every form that a file can hold."""
    law, slip, bound = written_tables(folder)
    values: dict[str, object] = {}
    for parameter in entry.parameters:
        if not parameter.required and parameter.key != "potential" and draw(st.booleans()):
            continue
        if parameter.key == "derivative" or (parameter.key == "potential" and "derivative" in values):
            continue  # one of the two is given; test_derivative_formulas writes the other
        match parameter.stated.form:
            case Form.QUANTITY:
                values[parameter.key] = draw(st.floats(1.0, 9.0) | st.sampled_from(POSITIVE).map(Formula))
                if parameter.key in ("reach", "base", "compression"):
                    values[parameter.key] = draw(st.floats(1.0, 9.0))
            case Form.OWN:
                choices: list[st.SearchStrategy[object]] = [
                    st.floats(0.0, 9.0),
                    formulas,
                    st.just(hv.laws.CoulombBound(0.3)),
                    st.just(hv.laws.CoulombBound(Formula("0.1 + abs(x)"))),
                    st.just(hv.laws.PenetrationBound("min(8*s, 0.8)")),
                    st.just(hv.laws.PenetrationBound(_read_bound(bound), file=bound)),
                ]
                values[parameter.key] = draw(st.one_of(choices))
            case Form.FILE:
                values[parameter.key] = slip if entry in FRICTION_LAWS.values() else law
            case Form.TEXT:
                values[parameter.key] = draw(st.sampled_from(parameter.stated.choices or (parameter.shown,)))
            case Form.LIST:
                values[parameter.key] = parameter.stated.example or draw(st.sampled_from([(0.5, 2.0), (0.25, 0.75)]))
    if values.get("extend") == "linear" and entry in FRICTION_LAWS.values():
        values["extend"] = "constant"  # the table falls
    if {"softening", "energy"} <= values.keys():
        del values[draw(st.sampled_from(["softening", "energy"]))]  # each follows from the other
    if "energy" in values:
        values["energy"] = draw(st.floats(1e4, 2e4))  # more than glue of any of these strengths has at its peak
    make = friction_law if entry in FRICTION_LAWS.values() else normal_law
    return make(entry.name, **values)


def _read_bound(path: Path) -> object:
    from hemivar.laws.own.columns import BOUND_COLUMNS, read_columns

    return read_columns(path, BOUND_COLUMNS)


@st.composite
def statements(draw: st.DrawFn, folder: Path) -> hv.ContactProblem:
    dim = draw(st.sampled_from([2, 2, 3]))
    sizes = st.floats(0.5, 3.0)
    if dim == 2:
        cells = (draw(st.integers(1, 4)), draw(st.integers(1, 3)))
        pattern = draw(st.sampled_from(["cross", "right", "left"]))
        mesh = rectangle((draw(sizes), draw(sizes)), cells, pattern, (draw(sizes), -draw(sizes)))  # type: ignore[arg-type]
    else:
        mesh = box((draw(sizes), draw(sizes), draw(sizes)), (1, draw(st.integers(1, 2)), 1))
    if draw(st.booleans()):
        mesh = mesh.scaled(draw(st.sampled_from([1e-3, 0.3, 7.0])))
    mesh = mesh.refined(draw(st.integers(0, 1)))
    contact = {}
    for name in draw(st.lists(st.sampled_from(["bottom", "right"]), unique=True, max_size=2)):
        normal = draw(laws(draw(st.sampled_from(list(NORMAL_LAWS.values()))), folder))
        friction = draw(laws(draw(st.sampled_from(list(FRICTION_LAWS.values()))), folder))
        gap = draw(st.just(0.0) | signed | formulas)
        obstacle, normals = None, None
        if draw(st.booleans()):
            gap = 0.0
            ends = tuple(draw(st.floats(-9.0, 9.0)) for _ in range(dim))
            way = tuple(draw(st.floats(0.1, 9.0)) for _ in range(dim))
            shapes: list[st.SearchStrategy[object]] = [
                st.just(hv.Plane(ends, way)),
                st.builds(hv.mechanics.Sphere, st.just(ends), numbers, st.booleans()),
                st.just(hv.mechanics.SignedDistance(Formula("y + 0.1"))),
            ]
            if dim == 3:
                shapes.append(st.builds(hv.mechanics.Cylinder, st.just(ends), st.just(way), numbers, st.booleans()))
            obstacle = draw(st.one_of(shapes))
            normals = draw(st.sampled_from(list(hv.mechanics.Normals)))
        damping = draw(st.none() | laws(draw(st.sampled_from(list(NORMAL_LAWS.values()))), folder))
        contact[name] = hv.Contact(normal, friction, gap, obstacle, normals, damping)  # type: ignore[arg-type]
    held: list[st.SearchStrategy[object]] = [
        st.just(hv.Clamped()),
        st.just(hv.Roller()),
        vectors(dim).map(hv.Prescribed),  # type: ignore[arg-type]
        st.builds(hv.Fixed, x=signed | formulas, y=st.none() | signed),
    ]
    free = [name for name in ("left", "top") if name in mesh.boundaries]
    supports: dict[str, object] = {
        name: draw(st.one_of(held)) for name in draw(st.lists(st.sampled_from(free), unique=True))
    }
    loads = vectors(dim) | (numbers | formulas).map(hv.Pressure)
    tractions = {name: draw(loads) for name in draw(st.lists(st.sampled_from(["top", "right"]), unique=True))}
    planes = st.sampled_from(["strain", "stress"]) if dim == 2 else st.just("strain")
    size = 3 if dim == 2 else 6
    full = np.eye(size) + 0.1 * np.ones((size, size))
    entries = [Formula("1 + x^2") if k % (size + 1) == 0 else 0.0 for k in range(size * size)]
    pairs = st.tuples(st.floats(0.0, 9.0), st.floats(0.0, 9.0) | st.just(Formula("1 + x^2")))
    branches: list[st.SearchStrategy[hv.materials.Branch]] = [
        st.builds(hv.materials.Branch, lame=pairs, time=numbers),
        st.builds(hv.materials.Branch, young=numbers, poisson=st.floats(-0.5, 0.45), time=numbers),
        st.builds(hv.materials.Branch, tensor=st.just(FormulaArray(tuple(entries), (size, size))), time=numbers),
    ]
    in_time: dict[str, st.SearchStrategy[object]] = {
        "density": st.none() | numbers | st.sampled_from(POSITIVE).map(Formula),
        "viscosity": st.none() | pairs | st.just(np.diag(np.arange(float(size)))),
        "branches": st.lists(st.one_of(branches), max_size=3),
    }
    materials: list[st.SearchStrategy[hv.Material]] = [
        st.builds(hv.Material.lame, numbers | st.just(Formula("1 + x^2")), st.floats(0.1, 9.0), planes, **in_time),
        st.builds(hv.Material.young, numbers, st.floats(-0.5, 0.45), planes, **in_time),
        st.just(hv.Material.tensor(full, None if dim == 3 else (0.1, 0.2, 1 / 3))),
        st.just(hv.Material.tensor(FormulaArray(tuple(entries), (size, size)))),
    ]
    return hv.ContactProblem(
        mesh,
        draw(st.one_of(materials)),
        contact,
        supports,  # type: ignore[arg-type]
        draw(st.just(0.0) | vectors(dim)),  # type: ignore[arg-type]
        tractions,  # type: ignore[arg-type]
        draw(st.text(st.characters(exclude_categories=["Cs"]), max_size=12)),
        draw(st.sampled_from([1, 2])) if dim == 2 or not contact else 1,
        draw(st.sampled_from(list(hv.mechanics.Quadrature))) if dim == 2 else hv.mechanics.Quadrature.NODAL,
        draw(st.just(0.0) | st.floats(0.0, 9.0) | st.sampled_from(POSITIVE).map(Formula)),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder whose name wants quotes."""
    made = tmp_path_factory.mktemp("tables") / 'a "b" ü'
    made.mkdir()
    return made


@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_random_statements_come_back(folder: Path, data: st.DataObject) -> None:
    round_trip(data.draw(statements(folder)), folder, discrete=False)


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_many_random_statements_come_back(folder: Path, data: st.DataObject) -> None:
    round_trip(data.draw(statements(folder)), folder, discrete=False)


def can_be_discretised(problem: hv.ContactProblem) -> bool:
    """Whether the body is held, and its obstacles lie where obstacles can."""
    try:
        hv.discretize(problem.at_time(0.5), check_coercivity=False, evolving=True)
    except HemivarError:
        return False
    return True


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.filter_too_much, HealthCheck.too_slow])
@given(data=st.data())
def test_random_statements_give_the_same_discrete_problem(folder: Path, data: st.DataObject) -> None:
    problem = data.draw(statements(folder).filter(can_be_discretised))
    same_discrete(problem, hv.read_problem(hv.write_problem(problem, folder / "p.toml")))


# ---- meshes, tables and settings ----------------------------------------------------------------------------


def test_a_mesh_of_a_file_is_named_from_where_the_problem_file_lies(tmp_path: Path) -> None:
    mesh_file = tmp_path / "meshes" / "body.msh"
    mesh_file.parent.mkdir()
    from hemivar.mesh.write import msh_text

    mesh_file.write_text(msh_text(rectangle((2.0, 1.0), 3)), encoding="utf-8")
    (tmp_path / "deep").mkdir()
    problem = stated(mesh=read_mesh(mesh_file).scaled(1e-3).refined())
    hv.write_problem(problem, tmp_path / "deep" / "p.toml")
    data = tomllib.loads((tmp_path / "deep" / "p.toml").read_text(encoding="utf-8"))
    assert data["mesh"] == {"file": "../meshes/body.msh", "scale": 1e-3, "refine": 1}
    same_discrete(problem, hv.read_problem(tmp_path / "deep" / "p.toml"))
    mesh_file.write_text(msh_text(rectangle((2.0, 1.5), 3)), encoding="utf-8")
    with pytest.raises(ProblemError, match="mesh would be read back differently"):
        hv.write_problem(problem, tmp_path / "deep" / "p.toml")


def own_meshes() -> dict[str, Mesh]:
    plane, solid = rectangle((2.0, 1.0), (4, 2), "cross"), box((1.0, 2.0, 1.0), (2, 3, 2))
    half = np.flatnonzero(plane.points[plane.cells].mean(axis=1)[:, 0] < 1.0)
    regions = {"one": half, "two words": np.setdiff1d(np.arange(plane.number_of_cells), half)}
    some = {"every": np.arange(0, solid.number_of_cells, 2), "third": np.arange(0, solid.number_of_cells, 3)}
    return {
        "turned": plane.rotated(0.3),
        "refined, then scaled": plane.refined().scaled(0.3),
        "with other boundaries": plane.with_boundaries(
            {"all": lambda x: x[:, 0] >= 0, "left": lambda x: x[:, 0] < 1e-9, "ünder": lambda x: x[:, 1] < 1e-9}
        ),
        "with regions": Mesh(plane.points, plane.cells, plane.boundaries, regions),
        "with regions that overlap": Mesh(solid.points, solid.cells, solid.boundaries, some),
        "solid": solid.moved(np.diag([1.0, 0.5, 2.0]), 1.0),
    }


@pytest.mark.parametrize("name", own_meshes())
def test_a_mesh_of_ones_own_is_written_beside_if_asked(name: str, tmp_path: Path) -> None:
    mesh = own_meshes()[name]
    problem = stated(mesh=mesh)
    with pytest.raises(ProblemError, match=r"mesh is made of arrays, or changed .* beside=True"):
        hv.write_problem(problem, tmp_path / "p.toml")
    assert list(tmp_path.iterdir()) == []
    hv.write_problem(problem, tmp_path / "p.toml", beside=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["p.mesh.msh", "p.toml"]
    found = hv.read_problem(tmp_path / "p.toml")
    np.testing.assert_array_equal(found.mesh.points, mesh.points)
    np.testing.assert_array_equal(found.mesh.cells, mesh.cells)
    assert {name: set(part.tolist()) for name, part in found.mesh.regions.items()} == {
        name: set(part.tolist()) for name, part in mesh.regions.items()
    }
    if mesh.dim == 2:
        same_discrete(problem, found)


def test_a_scaled_mesh_whose_digits_no_recipe_gives_has_none() -> None:
    mesh = rectangle((1.0, 1.0), 4)
    assert mesh.refined().scaled(0.3).recipe is None
    assert mesh.scaled(0.3).scaled(0.3).recipe is None
    assert mesh.rotated(0.1).recipe is None
    assert mesh.with_boundaries({}).recipe is None
    recipe = mesh.scaled(0.3).refined(2).recipe
    assert recipe is not None
    np.testing.assert_array_equal(recipe.begin().refined(recipe.refine).points, mesh.scaled(0.3).refined(2).points)


def test_tables_are_written_beside_and_take_no_other_files_place(tmp_path: Path) -> None:
    law = hv.table_law([0.0, 0.1, 0.1, 0.3], [0.0, 2.0, 1 / 3, 0.1])
    friction = hv.laws.Friction(
        hv.laws.PenetrationBound(([0.0, 0.1], [0.0, 0.8])), hv.table_law([0, 1], [1, 0.5], friction=True)
    )
    problem = stated(contact={"bottom": hv.Contact(law, friction)})
    round_trip(problem, tmp_path, beside=True)
    names = {"p.bottom-normal.csv", "p.bottom-friction.csv", "p.bottom-bound.csv", "p.toml"}
    assert {path.name for path in tmp_path.iterdir() if path.name.startswith("p")} == names
    (tmp_path / "p.bottom-normal.csv").write_text("precious", encoding="utf-8")
    (tmp_path / "p.bottom-bound.csv").unlink()
    before = (tmp_path / "p.toml").read_bytes()
    with pytest.raises(FileError, match=r"p\.bottom-normal\.csv: another file has that name"):
        hv.write_problem(problem, tmp_path / "p.toml", beside=True)
    assert (tmp_path / "p.bottom-normal.csv").read_text(encoding="utf-8") == "precious"
    assert not (tmp_path / "p.bottom-bound.csv").exists()
    assert (tmp_path / "p.toml").read_bytes() == before


def test_files_beside_go_again_where_the_problem_is_refused(tmp_path: Path) -> None:
    problem = stated(mesh=rectangle().rotated(0.1), body_force=lambda x: np.zeros(x.shape))
    with pytest.raises(ProblemError, match="body_force is the Python function"):
        hv.write_problem(problem, tmp_path / "p.toml", beside=True)
    assert list(tmp_path.iterdir()) == []


def test_settings_of_the_solver(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    hv.write_problem(
        stated(), path, method=hv.solvers.METHODS["multigrid"], controls=hv.Controls(rtol=1e-7, max_time=3.0)
    )
    assert read_problem_file(path).solver == SolverSettings("multigrid", 1e-7, None, 3.0)
    hv.write_problem(read_problem_file(path), path, method="newton")
    assert read_problem_file(path).solver == SolverSettings("newton", 1e-7, None, 3.0)
    for options, words in (
        (
            {"method": dataclasses.replace(hv.solvers.NonsmoothNewton(), sweeps=17)},
            "method is 'newton' with options of its own",
        ),
        ({"method": "nought"}, "method is nought, .* one of newton"),
        ({"controls": hv.Controls(atol=1.0)}, "controls.atol is 1.0, which a problem file cannot express"),
        ({"controls": hv.Controls(callback=print)}, "controls.callback is the Python function print"),
    ):
        with pytest.raises(ProblemError, match=words):
            hv.write_problem(stated(), path, **options)  # type: ignore[arg-type]


# ---- what cannot be said ------------------------------------------------------------------------------------


def law(r: np.ndarray) -> np.ndarray:
    return np.maximum(r, 0.0)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"contact": {"bottom": hv.Contact(hv.laws.ThresholdCompliance(lambda x: x[:, 0]))}},
            r"normal\.q_max is the Python function",
        ),
        (
            {"contact": {"bottom": hv.Contact(hv.laws.ThresholdCompliance(np.ones(5)))}},
            r"normal\.q_max is given as 5 numbers",
        ),
        (
            {"contact": {"bottom": hv.Contact(hv.laws.PiecewiseQuadratic([0.0], [0.0, 1.0], [0.0]))}},
            r"contact\['bottom'\]\.normal is a PiecewiseQuadratic, which .* it can express the laws",
        ),
        (
            {"contact": {"bottom": hv.Contact(hv.Signorini(), hv.Tresca(hv.laws.PenetrationBound(law)))}},
            r"friction\.bound is the Python function law",
        ),
        (
            {
                "contact": {
                    "bottom": hv.Contact(hv.Signorini(), hv.Tresca(hv.laws.PenetrationBound("s + 1", reach=3.0)))
                }
            },
            r"friction\.bound\.reach would be read back differently",
        ),
        (
            {"contact": {"bottom": hv.Contact(hv.FormulaLaw("r^2", even=True))}},
            r"contact\['bottom'\]\.normal\.even would be read back differently",
        ),
        (
            {
                "contact": {
                    "bottom": hv.Contact(dataclasses.replace(hv.laws.Layered([1.0], [2.0]), slopes=[0.0, 3.0, 0.0]))
                }
            },
            r"contact\['bottom'\]\.normal\.slopes would be read back differently",
        ),
        (
            {"contact": {"bottom": hv.Contact(hv.Signorini(), gap=Formula("x", minimum=0.5))}},
            r"contact\['bottom'\]\.gap would be read back differently",
        ),
        (
            {
                "contact": {
                    "bottom": hv.Contact(hv.Signorini(), obstacle=hv.mechanics.SignedDistance(lambda x: x[:, 1]))
                }
            },
            r"obstacle\.function is the Python function",
        ),
        ({"material": hv.Material.lame(lambda x: x[:, 0] + 1, 2.0)}, r"material\.lam is the Python function"),
        (
            {"material": hv.Material.by_region({"a": hv.Material.by_region({"a": hv.Material.lame(1.0, 1.0)})})},
            r"material\['a'\] is a ByRegion, which a problem file cannot express",
        ),
        ({"supports": {"left": hv.Fixed(x=lambda x: x[:, 0])}}, r"supports\['left'\]\.x is the Python function"),
        ({"tractions": {"top": hv.Pressure(lambda x: x[:, 0])}}, r"tractions\['top'\] is the Python function"),
        (
            {"body_force": (Formula("z"), 0.0) and FormulaArray((Formula("z"), 0.0), (2,))},
            "uses z, but the mesh is plane",
        ),
        ({"title": "\ud800"}, "is not valid Unicode"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_a_problem_file_cannot_say(changes: dict[str, object], words: str, tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match=words) as caught:
        hv.write_problem(stated(**changes), tmp_path / "p.toml")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


def test_text_of_odd_names_and_values() -> None:
    odd = 'a "b"\\ \n\t\x7f\x01 é.'
    data: dict[str, object] = {
        "title": odd,
        "mesh": {"rectangle": (1.0, 2e-300), "cells": [3, 4]},
        "material": {"regions": {odd: {"lame": [1.0, math.pi]}, "": {"young": -0.0}}},
        "loads": {"traction": {odd: [1.0, "x"]}},
        "supports": {odd: "clamped"},
        "contact": {odd: {"normal": {"law": "survey", "q_max": 1e22}}, "b": {"gap": True}},
    }
    found = tomllib.loads(text_of(data))
    assert found == {**data, "mesh": {"rectangle": [1.0, 2e-300], "cells": [3, 4]}}


def test_a_folder_that_is_a_link_is_no_obstacle(tmp_path: Path) -> None:
    real = tmp_path / "real" / "deep"
    real.mkdir(parents=True)
    os.symlink(real, tmp_path / "link")
    written_tables(tmp_path)
    problem = stated(contact={"bottom": hv.Contact(hv.laws.read_law_table(tmp_path / "law.csv"))})
    hv.write_problem(problem, tmp_path / "link" / "p.toml")
    assert "../../law.csv" in (real / "p.toml").read_text(encoding="utf-8")
    assert parse_problem_file((real / "p.toml").read_text(encoding="utf-8"), real).problem.contact.keys() == {"bottom"}
