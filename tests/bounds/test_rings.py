"""Axial symmetry: closed forms of cylinders, press fits and a punch; integrals are those of the whole ring."""

from __future__ import annotations

import pytest

import hemivar as hv
from tests.fem.test_rings import NU, E, steel


def test_materials_that_have_no_axial_symmetry_say_so() -> None:
    with pytest.raises(hv.errors.ProblemError, match="no viscosity"):
        hv.Material.young(E, NU, plane="axisymmetric", viscosity=(1.0, 1.0))
    with pytest.raises(hv.errors.ProblemError, match="linear materials"):
        hv.Material.hencky(2.0, 1.0, 0.5, 0.1, plane="axisymmetric")
    with pytest.raises(hv.errors.ProblemError, match="every region or in none"):
        hv.Material.by_region({"a": steel(), "b": hv.Material.young(E, NU)})
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), (2, 2)), steel(), {"bottom": hv.Contact(hv.Signorini())}, {"top": hv.Clamped()}
    )
    found = hv.certify(hv.solve(problem), exact=True)
    assert "one of revolution" in str(found)
    assert found.smallness.trace_bound is None  # that of the plane body would be another one
