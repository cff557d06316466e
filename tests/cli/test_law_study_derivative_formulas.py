"""Laws by the formula of their derivative: the same law as by the potential, and integrals against scipy."""

from __future__ import annotations

import pytest

from hemivar.cli import main


def test_the_command_shows_a_law_by_its_derivative(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["laws", "formula", "--set", "derivative=r*exp(-r^2)"]) == 0
    assert "exp" in capsys.readouterr().out
