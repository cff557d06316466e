"""Largest strain and rotation, and what is said where they are not small."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.fem import deformation
from hemivar.report import plot_contact, plot_solution
from tests.branches.test_small_strain import shelf
from tests.fem.test_small_strain import field, meshes
from tests.report.test_picture_figures import texts


def test_a_soft_shelf_warns_and_a_stiff_one_does_not(tmp_path: Path) -> None:
    soft, stiff = hv.solve(shelf(1.0)).raise_for_status(), hv.solve(shelf(1e-4)).raise_for_status()
    assert soft.deformation is not None
    assert soft.deformation.rotation > 0.3
    (warning,) = soft.warnings
    assert warning.startswith("beyond small strains")
    squeezed = deformation(meshes(2), field(meshes(2), 1, np.diag([0.0, -0.2]))).warning
    assert squeezed is not None
    assert "strain 20 %, rotation 0 rad, above 10 % in 100 % of the body" in squeezed
    assert soft.certify().warnings == (warning,)
    assert not stiff.warnings
    assert not stiff.certify().warnings
    record = json.loads(soft.to_json(tmp_path / "r.json").read_text(encoding="utf-8"))
    assert record["warnings"] == [warning]
    assert record["deformation"] == {
        "strain": soft.deformation.strain, "rotation": soft.deformation.rotation, "large": True,
    }  # fmt: skip
    assert not json.loads(stiff.to_json(tmp_path / "s.json").read_text(encoding="utf-8"))["deformation"]["large"]
    for draw in (plot_solution, plot_contact):
        assert "beyond small strains" in texts(draw(soft))
        assert "beyond small strains" not in texts(draw(stiff))
    assert warning in repr(soft)
