"""One meaning of the energy where a friction bound depends on the solution."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.certificates import certify
from hemivar.fem import discretize
from hemivar.files import solution_record
from hemivar.laws import Compliance, CoulombBound, Friction, PenetrationBound
from hemivar.mechanics import Contact
from hemivar.solvers import solve
from tests import bodies


@pytest.mark.parametrize("bound", [CoulombBound(0.4), PenetrationBound(([0.0, 1.0], [0.0, 2.0]))])
def test_solution_and_certificate_have_one_energy(bound: CoulombBound | PenetrationBound) -> None:
    problem = discretize(bodies.square(Contact(Compliance(20.0), Friction(bound)), 6, body_force=(-0.6, -0.9)))
    found = solve(problem).raise_for_status()
    r, lam = found.local, found.multiplier
    frozen = problem.law.frozen(r, lam)
    u = found.unknowns
    by_hand = 0.5 * u @ (problem.stiffness @ u) - problem.load @ u + problem.constant
    by_hand += problem.contact.weights @ frozen.value(r)
    assert np.abs(found.friction).max() > 1e-3
    assert found.energy == pytest.approx(by_hand, rel=1e-13)
    assert certify(problem, u, lam).energy == pytest.approx(by_hand, rel=1e-13)
    assert solution_record(found)["energy"] == found.energy
    assert found.history[-1].energy == pytest.approx(by_hand, rel=1e-6)
