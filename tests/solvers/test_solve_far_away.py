"""Loads so small that the body stays far from its foundation: displacements are lost in the rounding of ``B u - g``."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse.linalg as sla

import hemivar as hv
from hemivar.basics.types import Array
from tests import bodies

METHODS = [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()]
#: Glue that has let go at an opening of 0.042.
TORN = hv.Adhesive(240, 2, 60, 72)
LAWS = [hv.Signorini(), hv.Compliance(3.0), TORN]


def hanging(load: object, law: hv.laws.Superpotential, friction: hv.laws.Friction | None = None) -> hv.ContactProblem:
    """A block under a ceiling, 0.05 above its foundation."""
    contact = hv.Contact(law, hv.laws.NoFriction() if friction is None else friction, gap=0.05)
    return bodies.square(contact, 4, density=1.0, supports={"top": hv.Clamped()}, body_force=load)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
@pytest.mark.parametrize("law", [hv.Signorini(), hv.Compliance(3.0), TORN], ids=lambda law: law.name)
@pytest.mark.parametrize("size", [1e-9, 1e-12, 1e-18, 1e-100])
def test_where_nothing_touches_the_linear_answer_is_the_answer(
    size: float, law: hv.laws.Superpotential, method: hv.solvers.NonsmoothNewton
) -> None:
    if law is TORN:
        assert TORN.subdifferential(np.array([-0.05])).upper == 0.0
    problem = hv.discretize(hanging((0.3 * size, -size), law))
    found = hv.solve(problem, method)
    linear = sla.spsolve(problem.stiffness.tocsc(), problem.load)
    assert found.status is hv.Status.CONVERGED
    assert np.abs(found.unknowns - linear).max() <= 1e-8 * np.abs(linear).max()
    assert not found.multiplier.any()


@pytest.mark.parametrize("size", [1e-6, 1e-12, 1e-18])
def test_points_that_friction_holds_without_contact_keep_their_reaction(size: float) -> None:
    problem = hv.discretize(hanging((0.3 * size, -size), hv.Signorini(), hv.Tresca(0.1)))
    found = hv.solve(problem)
    normal = problem.contact.trace[::2]  # components (normal, tangential) of each point
    sideways = problem.contact.trace[1::2]
    free = np.flatnonzero(abs(sideways).sum(axis=0) == 0)
    linear = np.zeros(problem.unknowns)
    linear[free] = sla.spsolve(problem.stiffness.tocsc()[free][:, free], problem.load[free])
    reaction = sideways @ (problem.load - problem.stiffness @ linear) / problem.contact.weights
    assert found.status is hv.Status.CONVERGED
    assert np.abs(found.unknowns - linear).max() <= 1e-9 * np.abs(linear).max()
    assert np.abs(found.multiplier[:, 1] - reaction).max() <= 1e-9 * np.abs(reaction).max()
    assert np.abs(normal @ linear).max() > 0.0


@pytest.mark.parametrize("power", [5, 6])
@pytest.mark.parametrize("inertia", [False, True])
def test_loads_may_begin_as_flat_as_they_like(power: int, inertia: bool) -> None:
    def load(points: Array, t: float) -> Array:
        return np.column_stack([np.zeros(len(points)), np.full(len(points), -(t**power))])

    evolution = hv.Evolution(hanging(load, hv.Signorini()), inertia=inertia)
    history = hv.march(evolution, until=0.01, step=0.001)
    assert history.finished
    assert history.residual < 1e-9
    if not inertia:
        unit = hv.discretize(hanging((0.0, -1.0), hv.laws.NoContact()))
        linear = 0.01**power * sla.spsolve(unit.stiffness.tocsc(), unit.load)
        assert np.abs(history.state.body.displacement[: linear.size] - linear).max() <= 1e-9 * np.abs(linear).max()
