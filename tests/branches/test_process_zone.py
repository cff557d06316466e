"""A path says when its process zone has too few contact points: the arm of a double cantilever, two strengths."""

from __future__ import annotations

import pytest

import hemivar as hv
from hemivar.branches import Path, follow_path
from hemivar.fem import LoadLine
from hemivar.laws import Adhesive
from hemivar.mechanics import Contact, ContactProblem, Fixed, Material
from hemivar.mesh import rectangle


def peeled_arm(strength: float, cells: int) -> Path:
    """The arm of a laminate on half of the glue, quadratic elements."""
    arm = ContactProblem(
        mesh=rectangle((60.0, 1.5), (cells, 2)).marked({"glue": "y < 1e-9 and x > 29.99"}),
        material=Material.young(135300.0, 0.3, plane="stress"),
        contact={"glue": Contact(Adhesive(stiffness=2e6, strength=strength, energy=0.14, compression=2e6))},
        supports={"left": Fixed(y=0.5), "right": "clamped"},
        order=2,
    )
    line = LoadLine.of(arm)
    return follow_path(line.loaded, (0.0, 2.5), unloaded=line.unloaded)


@pytest.mark.parametrize(("strength", "cells", "few"), [(57.0, 30, True), (5.0, 60, False)])
def test_few_points_in_the_process_zone_are_said(strength: float, cells: int, few: bool) -> None:
    said = [warning for warning in peeled_arm(strength, cells).warnings if "soften" in warning]
    assert bool(said) is few


def test_springs_that_soften_all_at_once_have_no_process_zone() -> None:
    block = ContactProblem(
        mesh=rectangle((1.0, 1.0), (12, 2)),
        material=Material.young(1.0, 0.0),
        contact={"bottom": Contact(hv.Softening(stiffness=4.0, limit=0.05, softening=0.2))},
        supports={"top": Fixed(x=0.0, y=-1.5), "left": "roller", "right": "roller"},
    )
    line = LoadLine.of(block)
    path = follow_path(line.loaded, (0.0, 1.0), unloaded=line.unloaded)
    assert path.multiplier[-1] == pytest.approx(0.0)
    assert not any("soften" in warning for warning in path.warnings)
