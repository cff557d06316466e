"""Quasistatic marches of bodies that glue alone holds."""

from __future__ import annotations

import numpy as np

import hemivar as hv
from hemivar.evolution.descent import slowed
from hemivar.evolution.discrete import StepMatrices, discretize_evolution
from tests import bodies


def test_a_step_against_springs_at_the_contact_points_has_one_solution() -> None:
    """K + R - B'W diag(alpha) B is positive definite, where no multiple of K alone makes it so."""
    block = bodies.column(hv.Adhesive(24.0, 2.0, 60.0, 72.0), cells=2, top=None, tractions={"top": (0.0, 1.0)})
    discrete = discretize_evolution(hv.Evolution(block))
    slow = slowed(StepMatrices(discrete), discrete.problem, np.inf)
    assert slow.contact is not None
    problem, B = discrete.problem, discrete.problem.contact.trace.toarray()
    falls = np.zeros((problem.contact_points, 2))
    falls[:, 0] = 60.0 * problem.contact.weights
    softened = slow.problem.stiffness.toarray() - B.T @ np.diag(falls.ravel()) @ B
    assert np.linalg.eigvalsh(softened)[0] > 0.0
    K = problem.stiffness.toarray()
    assert np.linalg.eigvalsh(1e6 * K - B.T @ np.diag(falls.ravel()) @ B)[0] < 0.0
    u = np.linspace(0.0, 1.0, problem.unknowns)
    dragged = slow.problem.stiffness @ u - K @ u
    np.testing.assert_allclose(slow.drag(problem.stiffness, u), dragged, atol=1e-12)
