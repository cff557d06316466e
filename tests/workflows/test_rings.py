"""Axial symmetry: closed forms of cylinders, press fits and a punch; integrals are those of the whole ring."""

from __future__ import annotations

import hemivar as hv
from tests.fem.test_rings import E, steel


def test_a_study_against_a_uniform_stress_has_no_error() -> None:
    """The pressure of a known field counts the strain around the axis."""
    c, d, stiffness = (0.3 * 1.7 - 0.5) / E, (2.0 * 0.3 * 0.5 - 1.2) / E, 40.0
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 2.0), (4, 4)),
        steel(0.3),
        {"bottom": hv.Contact(hv.Compliance(stiffness))},
        {},
        tractions={"right": hv.Pressure(0.5), "top": hv.Pressure(1.2)},
    )
    study = hv.study(problem, 1, known=[f"{c!r} * x", f"{d!r} * y - {1.2 / stiffness!r}"])
    for level in study.levels:
        assert level.pressure < 1e-10
