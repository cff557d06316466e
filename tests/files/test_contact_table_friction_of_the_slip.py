"""Friction that follows the slip, as in statics, and friction that follows its rate."""

from __future__ import annotations

from pathlib import Path

import pytest

import hemivar as hv
from hemivar.files import read_problem, write_problem
from hemivar.laws import SlipMeasure
from tests.evolution.test_step_laws_friction_of_the_slip import glued_bar


@pytest.mark.parametrize("of", list(SlipMeasure))
def test_files_say_it(of: SlipMeasure, tmp_path: Path) -> None:
    frictions = (hv.Tresca(1.0, of=of), hv.Coulomb(0.3, of=of), hv.SlipWeakening(1.0, of=of))
    for friction in frictions:
        stated = glued_bar({"bottom": hv.Contact(hv.laws.Bilateral(), friction)}, time=False)
        path = tmp_path / "p.toml"
        write_problem(stated, path)
        assert f'of = "{of}"' in path.read_text()
        assert read_problem(path).contact["bottom"].friction.of is of  # type: ignore[union-attr]
