"""Forces over an area of contact: averages that converge where values at nodes jump."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.fem.area_average import area_average
from hemivar.files.vtu import write_vtu
from tests.fem.test_area_average import membrane_on_a_hill


def test_files_have_both(tmp_path: Path) -> None:
    found = hv.solve(membrane_on_a_hill(8, "cross"))
    write_vtu(found, tmp_path / "m.vtu")
    import meshio

    data = meshio.read(tmp_path / "m.vtu").point_data
    node = found.problem.contact.node
    np.testing.assert_allclose(data["pressure"][node], found.pressure)
    np.testing.assert_allclose(data["mean_pressure"][node], area_average(found.problem, found.pressure))
