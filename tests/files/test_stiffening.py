"""Stress stiffening in a problem file: read, written, solved by the command, and recorded."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem_file

TEXT = """
[mesh]
rectangle = [20.0, 1.0]
cells = [10, 1]
order = 2
[material]
young = 1000.0
poisson = 0.0
[loads]
traction = {{ right = [0.2, 2e-3] }}
stiffening = {}
[supports]
left = "clamped"
[contact.bottom]
normal = {{ law = "none" }}
"""


def test_it_is_read_written_and_recorded(tmp_path: Path) -> None:
    problem = parse_problem_file(TEXT.format("true")).problem
    assert problem.stiffening
    again = hv.read_problem(hv.write_problem(problem, tmp_path / "problem.toml"))
    assert again.stiffening
    plain = parse_problem_file(TEXT.format("false")).problem
    assert not plain.stiffening
    for stated, told in ((again, False), (plain, True)):
        solution = hv.solve(stated)
        record = json.loads(solution.to_json(tmp_path / "solution.json").read_text())
        assert any("stiffening = true" in said for said in record["warnings"]) == told
        discrete = hv.discretize(stated)
        certificate = hv.certify(discrete, *hv.files.read_solution(tmp_path / "solution.json", discrete))
        assert certificate.residual.relative < 1e-8
    assert "by the stress of the load" in again._repr_html_()


def test_a_text_is_refused() -> None:
    with pytest.raises(ProblemError, match=r"\[loads\] stiffening: must be true or false"):
        parse_problem_file(TEXT.format('"yes"'))
