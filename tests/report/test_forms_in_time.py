"""Bodies by forms of scikit-fem in time: against the library's own elements, and bars in closed form."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Checkpoint, Evolution, Save, march
from hemivar.fem import FormProblem
from tests.evolution.test_forms_in_time import GLUE, form_block


def test_a_march_of_forms_is_resumed_and_written(tmp_path: Path) -> None:
    stated, kept = FormProblem(form_block(), {"bottom": GLUE}), Checkpoint(tmp_path / "march.ckpt", 0.0)
    straight = march(Evolution(stated, True, (0.0, -0.02)), 0.4, step=0.05, save=Save(probes={"tip": (1.0, 0.0)}))
    for until, resume in ((0.2, False), (0.4, True)):
        resumed = march(
            Evolution(stated, True, (0.0, -0.02)), until, step=0.05, checkpoint=kept, resume=resume,
            save=Save(probes={"tip": (1.0, 0.0)}),
        )  # fmt: skip
    np.testing.assert_array_equal(resumed.frames[-1].displacement, straight.frames[-1].displacement)
    np.testing.assert_array_equal(resumed["tip.u_y"], straight["tip.u_y"])
    other = FormProblem(form_block(viscosity=None), {"bottom": GLUE})
    with pytest.raises(hv.errors.FileError):
        march(Evolution(other, True, (0.0, -0.02)), 0.4, step=0.05, checkpoint=kept, resume=True)
    for name in ("run.pvd", "run.csv", "run.json"):
        straight.write(tmp_path / name)
    straight.plot().savefig(tmp_path / "march.png")
    last = sorted(tmp_path.rglob("*.vtu"))
    fields = [meshio.read(path).point_data for path in last if "contact" not in path.name]
    size = np.abs(straight.frames[-1].velocity).max()
    assert any(np.abs(data["velocity"]).max() == pytest.approx(size, rel=1e-6) for data in fields)
