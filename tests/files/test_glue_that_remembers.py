"""Glue in time: unloading to the origin, breaks and jumps, the mode of onset, and marches by hand."""

from __future__ import annotations

from pathlib import Path

import hemivar as hv
from hemivar.laws import Secant
from tests import bodies
from tests.evolution.test_glue_that_remembers import LAWS


def test_what_remembers_in_a_file(tmp_path: Path) -> None:
    """Nothing is said, or that there is no memory: glue remembers, or heals; each comes back as it was."""
    problem = bodies.column(hv.Contact(hv.Adhesive(24.0, 2.4, 6.0, 72.0)))
    for memory, kept in ((None, ("secant",)), ((), ()), ((Secant(),), ("secant",))):
        stated = hv.ContactProblem(
            problem.mesh, problem.material, {"bottom": hv.Contact(LAWS["mixed-mode"], memory=memory)}, problem.supports
        )
        path = hv.write_problem(stated, tmp_path / "glue.toml", beside=True)
        again = hv.read_problem(path).contact["bottom"]  # type: ignore[union-attr]
        assert tuple(part.name for part in again.remembers) == kept  # type: ignore[union-attr]
        assert again.memory is None if memory is None else again.memory is not None  # type: ignore[union-attr]
    assert hv.Contact(hv.Compliance(1.0)).remembers == ()
