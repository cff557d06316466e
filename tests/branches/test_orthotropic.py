"""Orthotropic friction: its ellipse by brute force, closed forms of a sheared block, what takes and what refuses it."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import Coulomb, CoulombBound, OrthotropicFriction, Signorini


def test_where_some_points_slide_and_others_stick_it_is_certified_and_searched() -> None:
    """The kind is that of friction without direction where the ratio is one."""
    found = []
    for friction in (OrthotropicFriction(CoulombBound(0.3), ratio=1.0), Coulomb(0.3)):
        problem = hv.ContactProblem(
            hv.box(cells=2),
            hv.Material.lame(1.0, 1.0),
            {"bottom": hv.Contact(Signorini(), friction)},
            {"top": hv.Fixed(x=0.02, y=0.0, z=-0.05)},
        )
        solution = hv.solve(problem)
        assert set(solution.states.names[1]) == {"stick", "slip"}
        searched = hv.find_solutions(problem, starts=2)
        assert len(searched.solutions) >= 1
        found.append((hv.certify(solution), solution, searched))
    (one, first, several), (other, second, others) = found
    assert one.kind is other.kind
    assert one.curvature == pytest.approx(other.curvature, rel=1e-6)
    assert np.abs(first.displacement - second.displacement).max() <= 1e-7
    assert len(several.solutions) == len(others.solutions)
