"""Forces stand beside displacements of their own time, or with the time that is theirs."""

from __future__ import annotations

from pathlib import Path

import hemivar as hv
from hemivar.evolution import Midpoint, march
from tests.evolution.test_history_end_forces import pressed_in_time


def test_files_tell_the_time_of_forces(tmp_path: Path) -> None:
    found = march(pressed_in_time(hv.Contact(hv.Signorini())), until=0.2, step=0.1, scheme=Midpoint())
    found.write(tmp_path / "run.pvd")
    for name in ("run_000002.vtu", "run_000002_contact.vtu"):
        text = (tmp_path / "run" / name).read_text(encoding="latin-1")
        assert 'type="Float64" Name="force_time" NumberOfTuples="1" format="ascii">0.15' in text
