"""Glue beyond its load: a bracket of what it carries, for every law, and no advice that leads in a circle."""

from __future__ import annotations

import pytest

import hemivar as hv
from hemivar.branches.path import PathEnd
from hemivar.mesh import Mesh
from hemivar.solvers import solve
from tests.samples import slow
from tests.solvers.test_status_overloaded_glue import GLUES, PLANE, SPACE, STRENGTH, glued_only


@pytest.mark.parametrize("glue", GLUES)
def test_the_way_of_the_remedy_leads_on(glue: str) -> None:
    """A path that is named is there, and its limit load lies in the bracket."""
    found = solve(glued_only(glue, (0.0, 2.3 * STRENGTH)))
    assert found.carried is not None
    if "hemivar path" in found.remedy:
        limit = hv.follow_path(found.problem).limit_load
        assert limit is not None
        assert found.carried[0] <= limit <= found.carried[1]


@pytest.mark.parametrize(("glue", "mesh"), [("brittle", PLANE), slow("mixed-mode", PLANE), slow("mixed-mode", SPACE)])
def test_the_path_of_points_that_break_together_comes_back_to_no_load(glue: str, mesh: Mesh) -> None:
    pull = (*(0.0,) * (mesh.dim - 1), 2.3 * STRENGTH)
    path = hv.follow_path(glued_only(glue, pull, mesh))
    assert path.ended is PathEnd.LOWER_END
    assert path.limit_load == pytest.approx(1.0 / 2.3, rel=1e-4)
