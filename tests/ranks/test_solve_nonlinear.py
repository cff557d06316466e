"""Bodies that are not linear with the engine ``petsc``: the serial solution, its certificate, and what is refused.

Starting ranks takes longer than solving: all problems of a number of ranks are solved in one run.
"""

from __future__ import annotations

import itertools
import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Record
from hemivar.certificates import certify
from hemivar.files.problem_file import write_problem
from tests.ranks.against_serial import compare, in_one_run, plan, record_of, serial_of, solve_on
from tests.ranks.running import mpirun

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

_EXAMPLES = Path(__file__).parent.parent.parent / "examples" / "problems"

HENCKY = 'law = "hencky"\nbulk = 6.667\nshear = 4.0\nsoftened = 0.25\nstrain = 0.02\n'
LOCKING = 'law = "locking"\nbulk = 6.0\nshear = 4.0\nstiffening = 50.0\nstrain = 0.03\n'
UNBOUNDED = 'law = "ramberg-osgood"\nyoung = 10.0\npoisson = 0.3\nyield_stress = 0.2\nexponent = 5.0\n'
STEEL = UNBOUNDED + "linear_from = 0.2\n"
FORMULA = 'law = "potential"\nenergy = "3*tr^2 + 4*dev2 + 50*dev2^2"\nreach = 0.5\n'

SURVEY = 'normal = { law = "survey", q_max = 0.1, p_const = 2.0 }\n'
TRESCA = 'friction = { law = "tresca", bound = 0.05 }\n'
SQUARE = "rectangle = [1.0, 1.0]\ncells = [16, 16]\n"
PUSHED = 'left = "roller"\nright = "roller"\ntop = { displacement = [0.0, -0.05] }\n'
FURTHER = PUSHED.replace("-0.05", "-0.08")


def nonlinear_file(
    material: str = HENCKY,
    mesh: str = SQUARE,
    loads: str = "body = [-0.2, -0.2]\n",
    supports: str = 'left = "clamped"\n',
    contact: str = SURVEY + TRESCA,
) -> str:
    """A problem file with a body that is not linear."""
    return f"[mesh]\n{mesh}[material]\n{material}[loads]\n{loads}[supports]\n{supports}[contact.bottom]\n{contact}"


CASES = {
    # several levels, and supports that move the body
    "levels": nonlinear_file(
        mesh="rectangle = [2.0, 1.0]\ncells = [24, 12]\nrefine = 1\n", supports=FURTHER, loads="body = [0.0, -0.2]\n"
    ),
    "locking, plane stress": nonlinear_file(LOCKING + 'plane = "stress"\n'),
    "cube": nonlinear_file(STEEL, "box = [1.0, 1.0, 1.0]\ncells = [6, 6, 6]\n", "body = [-0.3, -0.1, -0.2]\n"),
    "formula with a bedding": nonlinear_file(FORMULA, loads="body = [-0.3, -0.3]\nbedding = 2.0\n"),
    "bound by the pressure": nonlinear_file(contact=SURVEY + 'friction = { law = "coulomb", coefficient = 0.3 }\n'),
    "weakening friction": nonlinear_file(contact=SURVEY + 'friction = { law = "logarithmic", bound = 0.05 }\n'),
    # it softens more than C_low is stiff, and less than the stiffness at rest is
    "glue": nonlinear_file(
        mesh="rectangle = [1.0, 1.0]\ncells = [8, 8]\n",
        supports=PUSHED,
        contact='normal = { law = "softening", stiffness = 40.0, limit = 0.02, softening = 8.0 }\n',
    ),
    "no lower tensor": nonlinear_file(UNBOUNDED),
    **{name: (_EXAMPLES / f"{name}.toml").read_text(encoding="utf-8") for name in ("soft_layer", "steel_strip")},
}
ENERGIES = [name for name in CASES if name != "bound by the pressure"]


def regions() -> hv.ContactProblem:
    """A body of two regions, one of them linear; a rank may have cells of one of them only."""
    mesh = hv.rectangle((2.0, 1.0), cells=(16, 8))
    stiff = mesh.points[mesh.cells].mean(axis=1)[:, 0] > 1.0
    named = {"soft": np.flatnonzero(~stiff), "stiff": np.flatnonzero(stiff)}
    soft = hv.Material.hencky(bulk=6.667, shear=4.0, softened=0.25, strain=0.02)
    return hv.ContactProblem(
        hv.Mesh(mesh.points, mesh.cells, dict(mesh.boundaries), named),
        hv.Material.by_region({"soft": soft, "stiff": hv.Material.lame(4.0, 8.0)}),
        {"bottom": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.05))},
        {"left": hv.Clamped()},
        body_force=(-0.2, -0.2),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the problem files are."""
    path = tmp_path_factory.mktemp("problems")
    for name, text in CASES.items():
        (path / f"{name}.toml").write_text(text, encoding="utf-8")
    write_problem(regions(), path / "regions.toml", beside=True)
    shutil.copy(path / "levels.toml", path / "coarse.toml")
    plan(path, dict.fromkeys((*CASES, "regions"), 1e-12) | {"coarse": 1e-3})
    return path


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("name", [*CASES, "regions"])
def test_the_serial_solution_on_any_number_of_ranks(folder: Path, name: str, ranks: int) -> None:
    record = record_of(folder, name, ranks)
    assert record["energy"] == pytest.approx(serial_of(folder / f"{name}.toml")[1].energy, rel=1e-10)
    assert name == "steel_strip" or record["deformation"]["strain"] > 0.02  # where stresses are no longer proportional


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("name", ENERGIES)
def test_the_energy_never_rises(folder: Path, name: str, ranks: int) -> None:
    energies = [line["energy"] for line in record_of(folder, name, ranks)["history"]]
    assert len(energies) > 2
    rounding = 1e-14 * max(map(abs, energies))
    assert all(after <= before + rounding for before, after in itertools.pairwise(energies))


@pytest.mark.parametrize("material", [HENCKY, LOCKING])
def test_forces_tangents_and_bounds_are_those_of_the_energy(tmp_path: Path, material: str) -> None:
    """Far from the foundation, by differences; the energy lies between those of the lower and the upper tensor."""
    problem = tmp_path / "p.toml"
    far = 'normal = { law = "signorini" }\ngap = 100.0\n'
    problem.write_text(
        nonlinear_file(material, loads="body = [0.1, 0.2]\nbedding = 2.0\n", contact=far), encoding="utf-8"
    )
    done = mpirun(3, "-m", "tests.ranks.derivatives", problem)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["slope of the energy"] == pytest.approx(-found["force"], rel=1e-6)
    assert found["slope of the force"] == pytest.approx(found["tangent"], rel=1e-6)
    assert found["balance of the tangent"] < 1e-12
    assert 1.005 * found["gain below"] < found["gain"] < 0.995 * found["gain above"]


def test_stresses_in_files_and_more_ranks_than_make_sense(tmp_path: Path) -> None:
    """Eight triangles; some ranks have none."""
    import meshio

    from hemivar.files import write_vtu

    problem = tmp_path / "p.toml"
    problem.write_text(nonlinear_file(mesh="rectangle = [1.0, 1.0]\ncells = [2, 2]\n"), encoding="utf-8")
    done = solve_on(5, problem, "--json", tmp_path / "r.json", "--vtu", tmp_path / "r.vtu", "--rtol", "1e-12")
    assert done.returncode == 0, done.stderr
    compare(problem, tmp_path / "r.json")
    write_vtu(serial_of(problem)[1], tmp_path / "s.vtu")
    whole = meshio.read(tmp_path / "s.vtu")
    places = {tuple(np.round(point, 9)): k for k, point in enumerate(whole.points)}
    pieces = [tmp_path / f"r_{rank}.vtu" for rank in range(5)]
    for piece in (meshio.read(path) for path in pieces if path.exists()):
        index = [places[tuple(np.round(point, 9))] for point in piece.points]
        expected = whole.point_data["stress"][index]
        np.testing.assert_allclose(piece.point_data["stress"], expected, atol=1e-8 * np.abs(expected).max())


# ---- certificates ---------------------------------------------------------------------------------------------


def _certificates(folder: Path, name: str, ranks: int) -> tuple[Record, hv.certificates.Certificate]:
    """Of the run over ranks, and of the serial one."""
    discrete, reference = serial_of(folder / f"{name}.toml")
    found = record_of(folder, name, ranks)["certificate"]
    return found, certify(discrete, reference.unknowns, reference.multiplier)


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("name", ["levels", "cube", "weakening friction", "regions"])
def test_the_margin_is_that_of_the_lower_tensor(folder: Path, name: str, ranks: int) -> None:
    found, serial = _certificates(folder, name, ranks)
    assert serial.unique is True
    assert found["unique"] is True
    assert found["margin"] == pytest.approx(serial.margin, abs=1e-4)
    assert (serial.margin < 0.999) == (name == "weakening friction")
    assert found["stiffness_by"] == "closed form"
    assert "margin" not in found["left_out"]


def test_nothing_is_claimed_where_only_the_stiffness_at_rest_would_show_it(folder: Path) -> None:
    found, serial = _certificates(folder, "glue", 2)
    at_rest = serial_of(folder / "glue.toml")[0]
    linear = at_rest.with_(bulk=at_rest.bulk.at_rest)  # type: ignore[attr-defined]
    assert hv.certificates.smallness(linear, trace_constant=False).margin > 0.0
    assert serial.margin < 0.0
    assert serial.unique is not True
    assert found["unique"] is None
    assert found["margin"] == pytest.approx(serial.margin, rel=1e-3)
    assert found["error_bound"] is None


@pytest.mark.parametrize("ranks", [1, 2])
def test_the_bound_covers_the_distance_to_the_solution(folder: Path, ranks: int) -> None:
    """In the norm of C_low."""
    record = json.loads((in_one_run(folder, ranks) / "coarse.json").read_text(encoding="utf-8"))
    discrete, reference = serial_of(folder / "levels.toml")
    off = discrete.field.restrict(np.array(record["displacement"])) - reference.unknowns  # type: ignore[union-attr]
    low = discrete.bulk.lower.stiffness  # type: ignore[attr-defined]
    distance = float(np.sqrt(off @ (low @ off)))
    bound = record["certificate"]["error_bound"]
    assert 1e-10 < distance <= bound < 100.0 * distance


@pytest.mark.parametrize(("name", "how"), [("formula with a bedding", "intervals"), ("no lower tensor", "unknown")])
def test_nothing_is_claimed_without_a_lower_tensor_at_every_strain(folder: Path, name: str, how: str) -> None:
    found, serial = _certificates(folder, name, 2)
    assert found["unique"] is None
    assert (found["error_bound"] is None) == (how == "unknown")
    assert found["error_bound"] is None or found["error_bound_sampled"] is serial.error_bound_sampled is True
    assert found["kind"] == "stationary"
    assert found["stiffness_by"] == how
    assert ("margin" in found["minus_infinite"]) == (serial.margin == -np.inf) == (how == "unknown")


# ---- checkpoints ----------------------------------------------------------------------------------------------


def test_restart_from_a_checkpoint(folder: Path, tmp_path: Path) -> None:
    problem, kept = folder / "cube.toml", tmp_path / "kept"
    begun = solve_on(2, problem, "--checkpoint", kept, "--max-steps", "2", "--rtol", "1e-12")
    assert begun.returncode == 1, begun.stderr
    other = tmp_path / "other.toml"
    other.write_text(CASES["cube"].replace("exponent = 5.0", "exponent = 5.5"), encoding="utf-8")
    done = solve_on(2, other, "--checkpoint", kept, "--resume")
    assert done.returncode == 2
    assert "body, supports or laws differ" in done.stderr
    done = solve_on(2, problem, "--checkpoint", kept, "--resume", "--rtol", "1e-12", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    record, whole = compare(problem, tmp_path / "r.json"), record_of(folder, "cube", 2)
    assert record["history"][0]["step"] == 0
    for key in ("displacement", "contact", "energy", "residual_parts", "steps"):
        assert record[key] == whole[key]


def test_a_checkpoint_of_a_fixed_point(folder: Path, tmp_path: Path) -> None:
    problem, kept = folder / "bound by the pressure.toml", tmp_path / "kept"
    begun = solve_on(2, problem, "--checkpoint", kept, "--max-steps", "2", "--rtol", "1e-12")
    assert begun.returncode == 1, begun.stderr
    done = solve_on(3, problem, "--checkpoint", kept, "--resume", "--rtol", "1e-12", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    compare(problem, tmp_path / "r.json")


# ---- what is refused ------------------------------------------------------------------------------------------

REFUSED = {
    "integrates linear bodies in time only": (
        "march",
        CASES["weakening friction"] + "[time]\nuntil = 1.0\nstep = 0.5\n",
    ),
    "linear elements only": ("solve", nonlinear_file(mesh=SQUARE + "order = 2\n")),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_is_refused_is_refused_in_one_sentence(tmp_path: Path, words: str) -> None:
    command, text = REFUSED[words]
    problem = tmp_path / "p.toml"
    problem.write_text(text, encoding="utf-8")
    done = mpirun(2, "-m", "hemivar", command, problem, "--engine", "petsc", "-q")
    lines = [line for line in done.stderr.splitlines() if line.startswith("hemivar:")]
    assert done.returncode == 2, done.stderr
    assert len(lines) == 1, lines
    assert words in lines[0]
