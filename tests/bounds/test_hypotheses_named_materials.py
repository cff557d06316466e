"""Locking materials, that of Ramberg and Osgood, and energies of one's own: stresses by hand, bounds, descriptions."""

from __future__ import annotations

import numpy as np

import hemivar as hv
from hemivar.bounds.body_data import body_data
from hemivar.bounds.hypotheses import inexact_data, stated_conditions
from tests.mechanics.test_named_energies_by_hand import every


def test_what_is_shown_up_to_a_reach_is_a_condition_of_the_distance() -> None:
    mesh = hv.rectangle(cells=2)
    for material, told in ((every("formula"), "within the reach 0.5"), (every("hencky"), None)):
        problem = hv.ContactProblem(mesh, material, supports={"left": hv.Clamped()}, body_force=(0.0, -0.1))
        data = body_data(problem, np.zeros((len(mesh.points), 2)))
        outside, conditions = stated_conditions(data, None)
        assert not inexact_data(data)
        assert not outside
        assert len(conditions) == (told is not None)
        assert told is None or told in conditions[0]
