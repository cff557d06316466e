"""Forces over an area of contact: averages that converge where values at nodes jump."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.fem.area_average import area_average


def membrane_on_a_hill(cells: int, pattern: str, region: bool = False) -> hv.ContactProblem:
    """A membrane of tension 2 that is pressed onto a hill: where they touch, the pressure is 3.7 + 0.3 x."""
    mesh = hv.rectangle((2.0, 2.0), cells, pattern, origin=(-1.0, -1.0))
    law = hv.ScalarContact(hv.Signorini(), lambda x: 0.12 - 0.4 * (x**2).sum(axis=1), side="below")
    load = {"supports": dict.fromkeys(("left", "right", "top", "bottom"), 0.0)}
    if region:
        inner = np.abs(mesh.points[mesh.cells].mean(axis=1)).max(axis=1) < 0.75
        mesh = replace(mesh, regions={"inner": np.flatnonzero(inner), "outer": np.flatnonzero(~inner)})
    where = {"area": {"inner": law} if region else law}
    return hv.ScalarProblem(mesh, 2.0, source=lambda x: -0.5 - 0.3 * x[:, 0], kind="membrane", **load, **where)


@pytest.mark.parametrize("pattern", ["cross", "right", "left"])
@pytest.mark.parametrize("region", [False, True])
def test_the_pressure_over_an_area_is_that_of_the_load(pattern: str, region: bool) -> None:
    """Exactly: -2 div grad level - source; well inside of what touches, where there is no edge to resolve."""
    found = hv.solve(membrane_on_a_hill(32, pattern, region), rtol=1e-11).raise_for_status()
    mean, x = area_average(found.problem, found.pressure), found.problem.contact.points
    deep = np.hypot(*x.T) < 0.15
    assert deep.sum() > 3
    weights = found.problem.contact.weights
    assert weights @ mean == pytest.approx(weights @ found.pressure, rel=1e-12 if pattern == "cross" else 0.05)
    assert np.abs(mean - 3.7 - 0.3 * x[:, 0])[deep].max() < 1e-6
    if pattern == "cross":
        assert np.abs(found.pressure - 3.7 - 0.3 * x[:, 0])[deep].max() > 0.5  # the law's own, at the nodes
