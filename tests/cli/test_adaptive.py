"""``hemivar solve --adaptive`` and the distance to the exact solution that ``certify`` and ``solve --exact`` print."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import meshio
import pytest

from hemivar.bounds import adaptive as loop
from tests.cli.test_app import BASE, changed, run


@pytest.fixture
def problem(tmp_path: Path) -> Path:
    file = tmp_path / "block.toml"
    file.write_text(BASE)
    return file


def test_an_adaptive_solve_prints_and_writes(problem: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = problem.parent
    files = {option: where / name for option, name in (
        ("--csv", "a.csv"), ("--json", "a.json"), ("--vtu", "a.vtu"), ("--plot-error", "e.png"),
        ("--plot-meshes", "m.svg"))}  # fmt: skip
    words = [word for pair in files.items() for word in pair]
    code, out, err = run(capsys, "solve", problem, "--adaptive", "0.15", *words)
    assert (code, err) == (0, "")
    assert "adaptive          reached after" in out
    assert "guaranteed up to rounding" in out
    rows = list(csv.DictReader(files["--csv"].open()))
    table = [line.split() for line in out.splitlines() if line[:6].strip().isdigit()]
    assert [row["unknowns"] for row in rows] == [line[1] for line in table]
    assert float(rows[-1]["relative_bound"]) <= 0.15 < float(rows[-2]["relative_bound"])
    record = json.loads(files["--json"].read_text())
    assert record["adaptive"]["ended"] == "reached"
    assert record["adaptive"]["levels"][-1]["relative_bound"] == float(rows[-1]["relative_bound"])
    exact = record["certificate"]["exact"]
    assert exact["guaranteed"] is True
    assert exact["relative"] == record["adaptive"]["levels"][-1]["relative_bound"]
    assert list(record)[-1] == "displacement"
    (indicator,) = meshio.read(files["--vtu"]).cell_data["indicator"]
    assert len(indicator) == int(rows[-1]["cells"])
    # what cells add: the squares of the two parts, and the work of the gap
    parts = exact["misfit"] ** 2 + exact["contact"] ** 2 + exact["gap"]
    assert indicator.sum() == pytest.approx(parts, rel=1e-3)
    for option in ("--plot-error", "--plot-meshes"):
        assert files[option].stat().st_size > 5000


def test_a_goal(problem: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = problem.parent / "g.json"
    code, out, err = run(
        capsys, "solve", problem, "--adaptive", "0.1", "--goal", "contact.bottom.force", "--json", file,
        "--max-unknowns", "500",
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert "goal              contact.bottom.force.x = " in out
    assert "(guaranteed)" in out
    assert "an estimate" in out
    assert "adaptive          estimated after" in out
    assert "the guaranteed interval is within" in out
    goal = json.loads(file.read_text())["adaptive"]["goal"]
    assert goal["lower"][1] < goal["corrected"][1] < goal["upper"][1]


@pytest.mark.parametrize(
    ("options", "end"),
    [
        (["--rtol", "0.001", "--max-unknowns", "50"], "max_unknowns"),
        (["--rtol", "0.001", "--max-time", "1e-3"], "max_time"),
        (["--rtol", "0.001", "--max-memory", "1e-6"], "max_memory"),
    ],
)
def test_limits_are_an_end_of_their_own(
    problem: Path, capsys: pytest.CaptureFixture[str], options: list[str], end: str
) -> None:
    code, out, err = run(
        capsys, "solve", problem, "--adaptive", "0.01", "--quiet", *options, "--csv", problem.parent / "a.csv"
    )
    assert code == 1
    assert err.startswith(f"hemivar: not reached: {end} with ")
    assert err.count("\n") == 1
    assert f"adaptive          {end}" in out
    assert (problem.parent / "a.csv").exists()


def test_ctrl_c_leaves_the_meshes_that_were_finished(
    problem: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the third mesh, in the middle of its bound."""
    whole, calls = loop.exact_distance, []

    def interrupted(*args: object, **options: object) -> object:
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return whole(*args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(loop, "exact_distance", interrupted)
    code, out, _ = run(capsys, "solve", problem, "--adaptive", "0.01", "--csv", problem.parent / "a.csv")
    assert code == 130
    assert "adaptive          interrupted after 2 meshes" in out
    assert len(list(csv.DictReader((problem.parent / "a.csv").open()))) == 2


def test_what_cannot_be_solved_adaptively_is_refused(problem: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = problem.parent
    for options, words in (
        (["--adaptive", "0.1", "--goal", "contact.botom.force"], ["did you mean 'contact.bottom.force'"]),
        (["--goal", "contact.bottom.force"], ["--goal goes with --adaptive"]),
        (["--max-unknowns", "9"], ["--max-unknowns goes with --adaptive"]),
        (["--plot-error", where / "e.png"], ["--plot-error goes with --adaptive"]),
        (["--adaptive", "2"], ["--adaptive is 2", "below 1"]),
        (["--adaptive", "0.01", "--max-unknowns", "0"], ["--max-unknowns is 0"]),
        (["--adaptive", "0.01", "--max-memory", "-1"], ["--max-memory is -1"]),
        (["--adaptive", "0.01", "--warm-start"], ["--adaptive and --warm-start exclude"]),
        (["--adaptive", "0.01", "--engine", "petsc"], ["--adaptive and --engine petsc exclude"]),
        (["--adaptive", "0.01", "--csv", where / "a.txt"], ["must end in .csv"]),
        (["--adaptive", "0.01", "--plot-meshes", where / "a.txt"], ["--plot-meshes", "must end in"]),
    ):  # fmt: skip
        code, _, err = run(capsys, "solve", problem, *options)
        assert code == 2, options
        assert err.count("\n") == 1
        for word in words:
            assert word in err


def test_certify_and_solve_tell_the_distance_to_the_exact_solution(
    problem: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = problem.parent / "c.json"
    code, out, err = run(capsys, "certify", problem, "--json", file)
    assert (code, err) == (0, "")
    assert "exact solution    at most " in out
    assert "made of misfit" in out
    certified = json.loads(file.read_text())["certificate"]["exact"]
    assert certified["guaranteed"] is True
    code, out, _ = run(capsys, "certify", problem, "--no-exact", "--json", file)
    assert code == 0
    assert "exact solution" not in out
    assert json.loads(file.read_text())["certificate"]["exact"] is None
    code, out, _ = run(capsys, "solve", problem, "--exact", "--quiet", "--json", file)
    assert code == 0
    assert "exact solution    at most " in out
    solved = json.loads(file.read_text())["certificate"]["exact"]
    assert solved["relative"] == pytest.approx(certified["relative"], rel=1e-9)


def test_an_estimate_and_none_say_why(problem: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = problem.parent
    varying = where / "varying.toml"
    law = 'normal = { law = "survey", q_max = 0.3, p_const = 2.0 }'
    soft = 'normal = { law = "softening", stiffness = 2.0, limit = 0.05, softening = 0.5 }'
    varying.write_text(changed(("gap = 0.0", 'gap = "0.01 * x * x"'), (law, soft)))
    code, out, _ = run(capsys, "certify", varying)
    assert code == 0
    assert "exact solution    about " in out
    assert "an estimate, not a bound" in out
    assert "because the gap of contact 'bottom' varies" in out
    code, out, _ = run(capsys, "solve", varying, "--adaptive", "0.3")
    assert code == 0
    assert "adaptive          estimated after" in out
    assert "~" in out
    coulomb = where / "coulomb.toml"
    coulomb.write_text(changed(('{ law = "tresca", bound = 0.5 }', '{ law = "coulomb", coefficient = 0.1 }')))
    code, out, _ = run(capsys, "certify", coulomb)
    assert code == 0
    assert "exact solution    no bound of the distance: " in out
    assert "depends on the pressure" in out
