"""Summaries of bodies that the stress of their load stiffens, and of quadratic tetrahedra on a curved gap."""

from __future__ import annotations

from dataclasses import replace

import hemivar as hv
from tests.fem.test_contact_basis import bowl, pressed_cube
from tests.fem.test_stress_stiffness import bar


def test_the_stress_that_is_held_or_left_out_is_said() -> None:
    slender = {"mesh": hv.rectangle((20.0, 1.0), (20, 2)), "order": 2, "tractions": {"right": (0.2, 2e-3)}}
    without, counted = hv.solve(bar(**slender)), hv.solve(bar(**slender, stiffening=True))
    assert "stiffening = true" in str(without.summary())
    assert "with the stress of the load held fixed" in str(counted.summary())


def test_penetration_is_that_of_nodes() -> None:
    contact = {"bottom": hv.Contact(hv.Compliance(50.0), gap=bowl)}
    solution = hv.solve(replace(pressed_cube(hv.Signorini()), contact=contact))
    assert f"{solution.penetration.max():.6g}" in str(solution.summary())
