"""Laws of penetration and slip by a formula or functions: the kit, other solvers of the same problem, and bad input."""

from __future__ import annotations

from pathlib import Path

import pytest

from hemivar.cli.app import main
from hemivar.laws import CoupledFormulaLaw
from hemivar.report.law_figures import plot_coupled_law


def test_the_command_shows_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "law.png"
    assert main(["laws", "coupled-formula", "--plot", str(picture)]) == 0
    assert "shown by intervals" in capsys.readouterr().out
    assert picture.stat().st_size > 10_000
    plot_coupled_law(CoupledFormulaLaw("20*s", reach=0.1, rigid=True), reach=0.05, title="friction")
