"""Glue whose fracture energy depends on the mode: work along paths, fixed points by other means, and refusals."""

from __future__ import annotations

from pathlib import Path

import pytest

from hemivar.cli.app import main


def test_the_command_shows_and_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "law.png"
    assert main(["laws", "mode-dependent", "--plot", str(picture)]) == 0
    assert "1.719 in shear" in capsys.readouterr().out
    assert picture.stat().st_size > 10_000
