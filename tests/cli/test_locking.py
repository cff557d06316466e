"""Nearly incompressible bodies are warned of, in every result."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hemivar.certificates import certify
from hemivar.cli import main
from hemivar.files import solution_record
from hemivar.mechanics import Material
from hemivar.solvers import solve
from tests.fem.test_locking import on_springs


def test_every_result_carries_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problem = on_springs(Material.young(10.0, 0.4999))
    found = solve(problem)
    certificate = certify(problem, found.unknowns, found.multiplier)
    assert found.warnings == certificate.warnings == problem.warnings
    assert solution_record(found)["warnings"] == list(problem.warnings)
    assert json.loads(json.dumps(certificate.record()))["warnings"] == list(problem.warnings)
    file = tmp_path / "soft.toml"
    file.write_text(
        "[mesh]\nrectangle = [1.0, 1.0]\ncells = [4, 4]\n[material]\nyoung = 10.0\npoisson = 0.4999\n"
        '[loads]\nbody = [0.2, -1.0]\n[supports]\nleft = "clamped"\n[contact.bottom]\n'
        'normal = { law = "compliance", stiffness = 5.0 }\n'
    )
    for command in ("solve", "compare", "certify", "solutions"):
        assert main([command, str(file)]) == 0
        shown = capsys.readouterr().out
        assert shown.count("warning           Poisson's ratio is 0.4999") == 1, command
