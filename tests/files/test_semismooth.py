"""Friction bounds that depend on the solution, inside Newton's equation."""

from __future__ import annotations

import numpy as np

import hemivar as hv
from hemivar.laws import CoulombBound, PenetrationBound, Signorini, Tresca
from hemivar.solvers import SemismoothNewton
from tests.solvers.test_semismooth import bounce, in_space


def test_fallbacks_of_steps_are_in_the_table() -> None:
    """A bound that is a Python function is frozen in every step."""
    friction = Tresca(PenetrationBound(lambda s: np.maximum(s, 0.0)))
    found = hv.march(bounce(2, friction), 0.04, step=0.02, method=SemismoothNewton())
    assert found.finished
    assert found["fallbacks"].tolist() == [0.0, 1.0, 1.0]
    assert found.to_dict()["table"]["fallbacks"] == [0, 1, 1]


def test_fallbacks_of_a_solution_are_in_its_record() -> None:
    found = hv.solve(in_space(0, Signorini(), Tresca(CoulombBound(0.2))), SemismoothNewton(rounds=1))
    assert found.to_dict()["fallbacks"] == found.fallbacks == 3
