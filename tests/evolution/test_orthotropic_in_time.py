"""Friction that depends on the direction of the slip, in increments in time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import Compliance, CoulombBound, Friction, OrthotropicFriction, Secant, Tresca
from hemivar.solvers import Controls
from tests.samples import slow

AXIS = np.array([0.6, 0.8])
ACROSS = np.array([-0.8, 0.6])
TIGHT = Controls(rtol=1e-13)


def dragged(friction: Friction, way: Any, unit: float = 1.0, young: float = 1e5, **contact: Any) -> hv.ContactProblem:
    """A stiff block pressed onto springs, its top dragged along ``way(t)``; lengths in units of ``unit``."""

    def moved(x: Array, t: float) -> Array:
        return np.tile(np.append(way(t), -0.01) / unit, (len(x), 1))

    stiff = hv.Material.young(young * unit**2, 0.3, density=1e-3 * unit**4)
    return hv.ContactProblem(
        hv.box((1.0 / unit, 1.0 / unit, 0.5 / unit), (2, 2, 1)), stiff,
        {"bottom": hv.Contact(Compliance(50.0 * unit**3), friction, **contact)}, {"top": hv.Prescribed(moved)},
    )  # fmt: skip


def straight(angle: float) -> Any:
    return lambda t: t * np.array([np.cos(angle), np.sin(angle)])


def forces(history: hv.History) -> Array:
    """Forces per area of the body on the foundation in the axes of the space, (m, 3)."""
    return history.discrete.problem.contact.global_vectors(history.state.multiplier)


def on_the_ellipse(angle: float, along: float, across: float) -> Array:
    """What opposes a slip rate v: ``D^2 v/|D v|`` with the half axes on the diagonal of D."""
    v = np.array([np.cos(angle), np.sin(angle)])
    parts = np.array([along * (v @ AXIS), across * (v @ ACROSS)])
    return np.asarray((along * parts[0] * AXIS + across * parts[1] * ACROSS) / np.linalg.norm(parts))


@pytest.mark.parametrize("angle", [0.4, 2.1, slow(0.0), slow(4.0)])
@pytest.mark.parametrize("coulomb", [False, True])
def test_a_point_dragged_at_an_angle_is_held_by_a_force_on_the_ellipse(angle: float, coulomb: bool) -> None:
    bound = CoulombBound(0.6) if coulomb else 0.3
    problem = dragged(OrthotropicFriction(bound, ratio=0.5, axis=(0.6, 0.8, 0.0)), straight(angle))
    history = hv.march(hv.Evolution(problem), 0.1, step=0.01, controls=Controls(rtol=1e-11))
    assert history.ended == "finished"
    force = forces(history)
    for point in force:
        most = -0.6 * point[2] if coulomb else 0.3
        assert point[:2] == pytest.approx(on_the_ellipse(angle, most, 0.5 * most), rel=1e-5)
    slid = float(history["friction"][-1])
    assert slid == pytest.approx(0.1 * float(on_the_ellipse(angle, 0.3, 0.15) @ straight(angle)(1.0)), rel=5e-3)
    assert abs(history["gap"][-1]) <= 1e-8 * history["moved"][-1]


def round_about(t: float) -> Array:
    """A way that turns all the time, and comes to rest."""
    return 0.05 * np.array([np.sin(7.0 * t), 1.0 - np.cos(11.0 * t)])


@pytest.mark.parametrize("scheme", [hv.evolution.ImplicitEuler(), hv.evolution.Midpoint(), slow(hv.evolution.BDF2())])
@pytest.mark.parametrize("inertia", [False, True])
def test_with_one_bound_it_is_that_of_tresca(scheme: Any, inertia: bool) -> None:
    found = []
    for friction in (OrthotropicFriction(0.3, ratio=1.0, axis=(0.6, 0.8, 0.0)), Tresca(0.3)):
        problem = dragged(friction, round_about, young=1e3)
        history = hv.march(hv.Evolution(problem, inertia=inertia), 0.4, step=0.02, scheme=scheme, controls=TIGHT)
        assert history.ended == "finished"
        found.append((history.state.body.displacement, history.state.multiplier, history["friction"]))
    for one, other in zip(*found, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-10 * np.abs(other).max())


def test_the_energy_is_that_of_the_force_on_its_way() -> None:
    """The balance closes, and what friction took is the sum of ``|D ds|`` over the slip increments."""
    slips: list[Array] = []
    friction = OrthotropicFriction(0.3, ratio=0.5, axis=(0.6, 0.8, 0.0))
    evolution = hv.Evolution(dragged(friction, round_about, young=1e3))
    save = hv.evolution.Save(every=0.02)
    history = hv.march(evolution, 0.4, step=0.02, save=save, controls=TIGHT)
    contact = history.discrete.problem.contact
    for frame in history.frames:
        slip = np.zeros_like(frame.local)
        slip[:, 1:] = frame.local[:, 1:]
        slips.append(contact.global_vectors(slip)[:, :2])
    ways = np.diff(np.array(slips), axis=0)
    gone = float((np.hypot(0.3 * (ways @ AXIS), 0.15 * (ways @ ACROSS)) @ contact.weights).sum())
    assert history["friction"][-1] == pytest.approx(gone, rel=1e-9)
    assert np.abs(history["gap"]).max() <= 1e-10 * history["friction"][-1]


def test_friction_of_the_slip_is_the_static_law_and_stores() -> None:
    friction = OrthotropicFriction(0.3, ratio=0.5, axis=(0.6, 0.8, 0.0), of="slip")
    problem = dragged(friction, round_about, young=1e3)
    history = hv.march(hv.Evolution(problem), 0.4, step=0.02, controls=TIGHT)
    assert history.ended == "finished"
    assert history["friction"][-1] == 0.0
    at_rest = hv.solve(problem.at_time(0.4), controls=TIGHT)
    np.testing.assert_allclose(history.state.multiplier, at_rest.multiplier, atol=1e-9)


def test_units_change_nothing() -> None:
    friction = OrthotropicFriction(CoulombBound(0.6), ratio=0.5, axis=(0.6, 0.8, 0.0))
    found = []
    for unit in (1.0, 1e3):
        problem = dragged(friction, round_about, unit, young=1e3)
        history = hv.march(hv.Evolution(problem, inertia=True), 0.2, step=0.02)
        assert history.ended == "finished"
        found.append(history.state.multiplier / unit**2)
    np.testing.assert_allclose(found[1], found[0], atol=1e-8 * np.abs(found[0]).max())


def test_glue_remembers_beside_it() -> None:
    """Glue that has been pulled off, and is pressed again, rubs by direction."""
    glue = hv.Adhesive(50.0, 1.0, 20.0, compression=50.0)
    friction = OrthotropicFriction(0.3, ratio=0.5, axis=(0.6, 0.8, 0.0))
    problem = dragged(friction, straight(0.4))
    contact = hv.Contact(
        glue, friction, memory=(Secant(),), damping=hv.laws.PiecewiseQuadratic([0.0], [1.0, 1.0], [0.0])
    )
    problem = hv.ContactProblem(problem.mesh, problem.material, {"bottom": contact}, problem.supports)
    history = hv.march(hv.Evolution(problem), 0.1, step=0.01)
    assert history.ended == "finished"
    assert forces(history)[0, :2] == pytest.approx(on_the_ellipse(0.4, 0.3, 0.15), rel=1e-5)


def test_rate_and_state_has_no_direction() -> None:
    memory = hv.laws.RateAndState(0.01, 0.015, 8e-3, 0.6, 1e-3, 1.0)
    friction = OrthotropicFriction(1.0, ratio=0.5)
    with pytest.raises(hv.HemivarError, match="makes its own profile"):
        hv.march(hv.Evolution(dragged(friction, straight(0.4), memory=(memory,))), 0.1, step=0.01)
