"""The engine ``petsc`` under mpirun: the serial solution, on any number of ranks."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from hemivar.cli import main
from hemivar.fem import discretize
from hemivar.files.problem_file import read_problem
from tests.problem_files import block_file, conditions
from tests.ranks.against_serial import compare, serial_of, solve_on
from tests.ranks.running import mpirun

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

_HERE = Path(__file__).parent
_EXAMPLES = _HERE.parent.parent / "examples" / "problems"

CASES = {
    "crossed": '[mesh]\nrectangle = [1.0, 1.0]\ncells = [32, 32]\npattern = "cross"\n' + conditions(),
    # several levels, and refinement after them
    "levels": "[mesh]\nrectangle = [2.0, 1.0]\ncells = [48, 24]\norigin = [0.5, -1.0]\nscale = 0.5\nrefine = 1\n"
    + conditions(friction='{ law = "tresca", bound = "0.3 + 0.1 * x" }'),
    "weakening": block_file(24, friction='{ law = "logarithmic", bound = 0.5 }'),
    "cube": "[mesh]\nbox = [1.0, 1.0, 1.0]\ncells = [8, 8, 8]\n"
    + conditions(friction='{ law = "tresca", bound = 0.2 }', body="[-0.8, -0.3, -0.8]"),
    # friction is left out where two foundations meet
    "corner": block_file(16)
    + '[contact.right]\nnormal = { law = "compliance", stiffness = 5.0 }\nfriction = { law = "tresca", bound = 0.1 }\n',
}
FILES = {
    "gmsh, curved": "half_disc.toml",
    "bound that depends on the penetration": "broken_foundation.toml",
    "weakening in space": "cube_logarithmic.toml",
    "downward jumps": "delamination.toml",
}


def _written(tmp_path: Path, name: str) -> Path:
    path = tmp_path / "problem.toml"
    path.write_text(CASES[name], encoding="utf-8")
    return path


@pytest.mark.parametrize("ranks", [1, 2, 3])
@pytest.mark.parametrize("name", CASES)
def test_the_serial_solution_on_any_number_of_ranks(tmp_path: Path, name: str, ranks: int) -> None:
    problem = _written(tmp_path, name)
    done = solve_on(ranks, problem, "--json", tmp_path / "r.json", "--rtol", "1e-12")
    assert done.returncode == 0, done.stderr
    record = compare(problem, tmp_path / "r.json")
    assert any("friction is left out" in warning for warning in record["warnings"]) == (name == "corner")  # type: ignore[attr-defined]


@pytest.mark.parametrize(("name", "ranks"), list(zip(FILES, (2, 3, 3, 2), strict=True)))
def test_problems_of_the_examples(tmp_path: Path, name: str, ranks: int) -> None:
    problem = _EXAMPLES / FILES[name]
    done = solve_on(ranks, problem, "--json", tmp_path / "r.json", "--rtol", "1e-12")
    assert done.returncode == 0, done.stderr
    compare(problem, tmp_path / "r.json")


def test_the_files_are_those_of_the_serial_run(tmp_path: Path) -> None:
    import meshio

    from hemivar.certificates import certify
    from hemivar.files import write_json, write_vtu

    problem = _EXAMPLES / "cube_logarithmic.toml"
    done = solve_on(2, problem, "--json", tmp_path / "r.json", "--vtu", tmp_path / "r.vtu", "--rtol", "1e-12")
    assert done.returncode == 0, done.stderr
    discrete, reference = serial_of(problem)
    certificate = certify(discrete, reference.unknowns, reference.multiplier)
    serial = json.loads(write_json(reference, tmp_path / "s.json", certificate).read_text(encoding="utf-8"))
    record = compare(problem, tmp_path / "r.json")
    assert list(record) == list(serial)
    for key in ("contact", "certificate", "resultants", "residual_parts"):
        assert list(record[key]) == list(serial[key])  # type: ignore[call-overload]
    rubs = [one["resultants"]["friction_force"] for one in (record, serial)]  # type: ignore[index]
    np.testing.assert_allclose(*rubs, atol=1e-9)
    for name, expected in serial["boundaries"].items():
        assert list(record["boundaries"][name]) == list(expected)  # type: ignore[index]
        for key, value in expected.items():
            np.testing.assert_allclose(record["boundaries"][name][key], value, rtol=1e-9, atol=1e-11)  # type: ignore[index]
    np.testing.assert_allclose(record["contact"]["friction"], serial["contact"]["friction"], atol=1e-9)  # type: ignore[index]
    for name in ("normal_state", "tangential_state"):
        assert record["contact"][name] == serial["contact"][name]  # type: ignore[index]
    assert record["certificate"]["margin"] == pytest.approx(certificate.margin, abs=1e-4)  # type: ignore[index]
    assert record["certificate"]["unique"] is True  # type: ignore[index]

    write_vtu(reference, tmp_path / "s.vtu")
    for suffix in ("", "_contact"):
        whole = meshio.read(tmp_path / f"s{suffix}.vtu")
        text = (tmp_path / f"r{suffix}.pvtu").read_text(encoding="utf-8")
        pieces = [tmp_path / f"r{suffix}_{rank}.vtu" for rank in range(2)]
        pieces = [path for path in pieces if path.exists()]
        assert all(path.name in text for path in pieces)
        places = {tuple(np.round(point, 9)): k for k, point in enumerate(whole.points)}
        seen, cells = set(), 0
        for path in pieces:
            piece = meshio.read(path)
            index = [places[tuple(np.round(point, 9))] for point in piece.points]
            seen |= set(index)
            cells += len(piece.cells[0].data)
            for name, values in piece.point_data.items():
                expected = whole.point_data[name][index]
                np.testing.assert_allclose(values, expected, atol=1e-8 * max(1.0, np.abs(expected).max()), err_msg=name)
        assert len(seen) == len(whole.points)
        assert cells == len(whole.cells[0].data)


def _probe(ranks: int, problem: Path) -> dict[str, object]:
    done = mpirun(ranks, "-m", "tests.ranks.probe", problem)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])  # type: ignore[no-any-return]


def test_no_rank_holds_the_whole_mesh_or_matrix(tmp_path: Path) -> None:
    problem = tmp_path / "p.toml"
    problem.write_text(CASES["cube"].replace("[8, 8, 8]", "[16, 16, 16]"), encoding="utf-8")
    found = _probe(3, problem)["ranks"]
    serial = discretize(read_problem(problem))
    assert sum(rank["cells"] for rank in found) == serial.field.mesh.number_of_cells  # type: ignore[attr-defined, union-attr, misc]
    assert sum(rank["owned"] for rank in found) == serial.field.number_of_nodes  # type: ignore[attr-defined, union-attr, misc]
    for rank in found:  # type: ignore[attr-defined]
        assert rank["cells"] < 0.45 * serial.field.mesh.number_of_cells  # type: ignore[union-attr]
        assert rank["nodes"] < 0.5 * serial.field.number_of_nodes  # type: ignore[union-attr]
        assert 0 < rank["entries"] < 0.5 * 9 * 15 * serial.field.number_of_nodes  # type: ignore[union-attr]


@pytest.mark.parametrize(("size", "split"), [((4.0, 1.0), True), ((1.0, 4.0), False)])
def test_contact_work_is_where_the_contact_is(tmp_path: Path, size: tuple[float, float], split: bool) -> None:
    """A long body lies on both ranks with its foundation, a tall one stands on one rank alone."""
    problem = tmp_path / "p.toml"
    text = f"[mesh]\nrectangle = {list(size)}\ncells = {[int(16 * s) for s in size]}\n" + conditions()
    problem.write_text(text.replace("left = ", "top = "), encoding="utf-8")
    probe = _probe(2, problem)
    points = [rank["contact"] for rank in probe["ranks"]]  # type: ignore[attr-defined]
    assert sum(points) == serial_of(problem)[0].contact_points
    assert (min(points) > 0) is split
    assert points == [rank["laws"] for rank in probe["ranks"]]  # type: ignore[attr-defined]
    # three reductions in each iteration of conjugate gradients, some more around them
    counts: dict[str, int] = probe["counts"]  # type: ignore[assignment]
    assert 3 * probe["cycles"] < counts["reductions"] < 60 * probe["cycles"]  # type: ignore[operator]
    assert counts["exchanges"] == 0
    done = solve_on(2, problem, "--json", tmp_path / "r.json", "--rtol", "1e-12")
    assert done.returncode == 0, done.stderr
    compare(problem, tmp_path / "r.json")


@pytest.mark.parametrize("ranks", [5, 11])
def test_more_ranks_than_make_sense(tmp_path: Path, ranks: int) -> None:
    """Eight triangles; some ranks have none."""
    problem = tmp_path / "p.toml"
    problem.write_text(block_file(2))
    done = solve_on(ranks, problem, "--json", tmp_path / "r.json", "--vtu", tmp_path / "r.vtu", "--rtol", "1e-12")
    assert done.returncode == 0, done.stderr
    compare(problem, tmp_path / "r.json")


# ---- checkpoints and failure ------------------------------------------------------------------------------


def test_restart_from_a_checkpoint(tmp_path: Path) -> None:
    problem, kept = _written(tmp_path, "cube"), tmp_path / "kept"
    whole = solve_on(2, problem, "--json", tmp_path / "whole.json", "--rtol", "1e-12")
    assert whole.returncode == 0, whole.stderr
    begun = solve_on(2, problem, "--checkpoint", kept, "--max-steps", "1", "--rtol", "1e-12")
    assert begun.returncode == 1, begun.stderr
    reference = json.loads((tmp_path / "whole.json").read_text())
    assert reference["steps"] > 1
    for ranks in (2, 3):
        done = solve_on(
            ranks, problem, "--checkpoint", kept, "--resume", "--json", tmp_path / "rest.json", "--rtol", "1e-12"
        )
        assert done.returncode == 0, done.stderr
        record = compare(problem, tmp_path / "rest.json")
        assert record["history"][0]["step"] == 0  # type: ignore[index]
        if ranks == 2:
            for key in ("displacement", "contact", "energy", "residual_parts", "steps"):
                assert record[key] == reference[key]


def test_a_checkpoint_of_a_fixed_point(tmp_path: Path) -> None:
    problem, kept = _EXAMPLES / "broken_foundation.toml", tmp_path / "kept"
    begun = solve_on(2, problem, "--checkpoint", kept, "--max-steps", "4", "--rtol", "1e-12")
    assert begun.returncode == 1, begun.stderr
    done = solve_on(3, problem, "--checkpoint", kept, "--resume", "--json", tmp_path / "r.json", "--rtol", "1e-12")
    assert done.returncode == 0, done.stderr
    assert compare(problem, tmp_path / "r.json")["steps"] > 4  # type: ignore[operator]


def test_a_checkpoint_of_another_problem_is_refused(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    assert solve_on(2, _written(tmp_path, "weakening"), "--checkpoint", kept).returncode == 0
    for problem in (_EXAMPLES / "survey_5_1.toml", _EXAMPLES / "cube_friction.toml"):
        done = solve_on(2, problem, "--checkpoint", kept, "--resume")
        assert done.returncode == 2
        assert done.stderr.count("belongs to another problem") == 1
    (tmp_path / "kept").write_bytes((tmp_path / "kept").read_bytes()[:-100])
    done = solve_on(2, tmp_path / "problem.toml", "--checkpoint", kept, "--resume")
    assert done.returncode == 2
    assert "damaged" in done.stderr


def test_bad_input_is_refused_once_for_all_ranks(tmp_path: Path) -> None:
    path = tmp_path / "p.toml"
    bad = {
        "clampd": CASES["cube"].replace("clamped", "clampd"),
        "free to move": CASES["cube"].replace('left = "clamped"', 'front = "roller"'),
        "linear elements": CASES["crossed"].replace('pattern = "cross"', "order = 2"),
        "does not exist": '[mesh]\nfile = "nothing.msh"\n[material]\nlame = [1.0, 1.0]\n',
        # only the ranks with a part of this boundary can see it
        "it must be": CASES["crossed"].replace("bound = 0.5", 'bound = "0.5 - x"'),
    }
    for words, text in bad.items():
        path.write_text(text, encoding="utf-8")
        done = solve_on(3, path)
        lines = [line for line in done.stderr.splitlines() if line.startswith("hemivar:")]
        assert done.returncode == 2, (words, done.stderr)
        assert len(lines) == 1, lines
        assert words in lines[0] or words == "it must be", lines


@pytest.mark.parametrize(("how", "code", "words"), [
    ("exit", 7, None), ("kill", 137, None), ("bug", 70, "something broke"), ("refusal", 2, "friction is negative"),
])  # fmt: skip
def test_a_rank_that_fails_ends_all_of_them(tmp_path: Path, how: str, code: int, words: str | None) -> None:
    done = mpirun(3, "-m", "tests.ranks.probe", _written(tmp_path, "crossed"), how, limit=60.0)
    assert done.returncode == code
    lines = [line for line in done.stderr.splitlines() if line.startswith("hemivar: error")]
    assert len(lines) == (words is not None)
    assert words is None or words in lines[0]


#: What the summary says that has to be the same on any number of ranks; numbers are printed with six digits.
_SAID = (
    "normal force", "friction force", "contact length", "contact area", "contact points", "max opening", "damage",
    "dissipated", "max penetration", "least opening", "max pressure", "max von Mises", "largest",
)  # fmt: skip
_UNITS = '[units]\nlength = "mm"\nforce = "N"\nstress = "MPa"\nenergy = "mJ"\n'


def _summary(text: str) -> list[tuple[str, str]]:
    lines = text.partition("\nstatus ")[2].splitlines()
    return [(line[:18].rstrip(), line[18:]) for line in lines if line[:18].rstrip() in _SAID]


@pytest.mark.parametrize("name", ["crossed", "cube", "corner", "tall", "mixed_mode.toml", "broken_foundation.toml"])
def test_three_ranks_print_the_summary_of_one_process(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ranks without contact points, or without glue, know of none of it: all of them sum up together."""
    path = tmp_path / "problem.toml"
    if name == "tall":  # the upper ranks have no part of the glue
        text = (_EXAMPLES / "mixed_mode.toml").read_text(encoding="utf-8")
        text = text.replace("[1.0, 0.5]", "[0.5, 4.0]").replace("[16, 8]", "[4, 32]")
    else:
        text = CASES.get(name) or (_EXAMPLES / name).read_text(encoding="utf-8")
    path.write_text(text + _UNITS, encoding="utf-8")
    assert main(["solve", str(path), "-q", "--rtol", "1e-11"]) == 0
    serial = capsys.readouterr().out
    done = solve_on(3, path, "--rtol", "1e-11", "--json", tmp_path / "r.json")
    assert done.returncode == 0, done.stderr
    found, wanted = _summary(done.stdout), _summary(serial)
    assert len(wanted) > 7
    assert found == wanted
    assert "residual              energy" not in done.stdout  # as --quiet asks
    assert json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))["units"]["length"] == "mm"
