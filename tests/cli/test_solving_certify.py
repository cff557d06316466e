"""``hemivar certify``, and the certificate that ``hemivar solve`` reports."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.test_app import BASE, changed, run


@pytest.fixture
def solved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    problem = tmp_path / "block.toml"
    problem.write_text(BASE)
    code, out, _ = run(capsys, "solve", problem, "--json", tmp_path / "s.json", "--vtu", tmp_path / "s.vtu", "--quiet")
    assert code == 0
    assert "unique minimiser; the only solution" in out
    return problem


def test_solve_writes_its_certificate(solved: Path) -> None:
    record = json.loads((solved.parent / "s.json").read_text())
    certificate = record["certificate"]
    for key in ("equilibrium", "inclusion", "energy", "margin", "error_bound", "kind", "unique", "alpha_normal",
                "alpha_tangential", "trace_constant", "m_A", "m_alpha", "m_L", "survey_condition",
                "survey_margin"):  # fmt: skip
        assert key in certificate
    assert certificate["kind"] == "unique minimiser"
    assert certificate["m_A"] == pytest.approx(8.0)
    assert certificate["error_bound_relative"] < 1e-10
    assert len(record["displacement"]) == 25


@pytest.mark.parametrize("name", ["s.json", "s.vtu", None])
def test_certify_a_file_or_a_solve(solved: Path, capsys: pytest.CaptureFixture[str], name: str | None) -> None:
    where = solved.parent
    options = [] if name is None else ["--solution", where / name]
    code, out, err = run(capsys, "certify", solved, *options, "--json", where / "c.json")
    assert (code, err) == (0, "")
    assert "survey's (H_s)    holds" in out
    record = json.loads((where / "c.json").read_text())
    assert record["fulfilled"] is True
    assert record["certificate"]["kind"] == "unique minimiser"
    assert record["certificate"]["error_bound_relative"] < 1e-10


def test_a_wrong_solution_is_found_out(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = solved.parent
    record = json.loads((where / "s.json").read_text())
    record["displacement"] = [[1.001 * c for c in row] for row in record["displacement"]]
    (where / "wrong.json").write_text(json.dumps(record))
    code, out, _ = run(capsys, "certify", solved, "--solution", where / "wrong.json")
    assert code == 1
    assert "not stationary" in out
    code, _, _ = run(capsys, "certify", solved, "--solution", where / "wrong.json", "--rtol", "0.01")
    assert code == 0


def test_other_meshes_and_broken_files(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    where = solved.parent
    finer, wider = where / "finer.toml", where / "wider.toml"
    finer.write_text(changed(("cells = [4, 4]", "cells = [5, 5]")))
    wider.write_text(changed(("rectangle = [1.0, 1.0]", "rectangle = [2.0, 1.0]")))
    (where / "bare.json").write_text("{}")
    (where / "text.vtu").write_text("nothing")
    (where / "s.txt").write_text("")
    moved = json.loads((where / "s.json").read_text())
    moved["displacement"] = [[1.0, 1.0]] * 25
    (where / "moved.json").write_text(json.dumps(moved))
    for problem, name, words in (
        (finer, "s.json", "another mesh"),
        (finer, "s.vtu", "another mesh"),
        (wider, "s.json", "another mesh"),
        (wider, "s.vtu", "another mesh"),
        (solved, "bare.json", "no key 'displacement'"),
        (solved, "moved.json", "violates the supports"),
        (solved, "text.vtu", "not readable XML"),
        (solved, "s.txt", "must end in .json or .vtu"),
        (solved, "missing.json", "no such file"),
    ):
        code, _, err = run(capsys, "certify", problem, "--solution", where / name)
        assert code == 2, name
        assert words in err
        assert err.count("\n") == 1
