"""Impacts on a rigid obstacle: the law of Newton at every node that hits, and the energy that it leaves."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, GeneralizedAlpha, March, Midpoint, MoreauJean, Newmark, Save, Scheme, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.march import marching
from hemivar.gallery import bouncing_block, moving_bar
from tests import bodies


@pytest.mark.parametrize(("restitution", "theta"), [(0.0, 0.5), (0.6, 0.5), (0.6, 0.6), (1.0, 0.5)])
def test_nodes_leave_with_a_part_of_their_velocity(restitution: float, theta: float) -> None:
    step = 0.02
    evolution = moving_bar(4, hv.Contact(hv.Signorini(), gap=0.01), modulus=4.0, velocity=1.0)
    history = march(evolution, 0.8, step=step, scheme=MoreauJean(restitution, theta), save=Save(step))
    hits = 0
    for before, after in zip(history.frames, history.frames[1:], strict=False):
        r, v = before.local[:, 0], before.rate[:, 0]
        pressed = after.multiplier[:, 0]
        closed = r + 0.5 * step * v >= 0.0
        assert (pressed[~closed] == 0.0).all()
        assert (pressed > -1e-9).all()
        hit = pressed > 1e-6
        np.testing.assert_allclose(after.rate[hit, 0], -restitution * v[hit], atol=1e-8)
        assert (after.rate[closed & ~hit, 0] <= -restitution * v[closed & ~hit] + 1e-8).all()
        mean = theta * after.rate[:, 0] + (1.0 - theta) * v
        np.testing.assert_allclose(after.local[:, 0], r + step * mean, atol=1e-10)
        hits += int(hit.sum())
    assert hits >= 2
    ledger = history.state.ledger
    assert abs(ledger.gap) < 1e-9 * ledger.start
    if (restitution, theta) == (1.0, 0.5):
        assert ledger.stored == pytest.approx(ledger.start, rel=1e-10)
    else:
        assert ledger.stored < ledger.start * (1.0 - 1e-4)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_wall_that_comes_is_a_bar_that_comes(restitution: float) -> None:
    """Whoever moves at a constant speed along with the wall sees the bar hit a wall at rest."""
    found = []
    for wall in (0.0, 0.75):

        def gap(x: Array, t: float, wall: float = wall) -> Array:
            return np.full(len(x), 0.01 - wall * t)

        contact = hv.Contact(hv.Signorini(), gap=gap)
        evolution = moving_bar(4, contact, modulus=4.0, velocity=1.0 - wall)
        found.append(march(evolution, 0.6, step=0.02, scheme=MoreauJean(restitution), save=Save(0.02)))
    for at_rest, coming in zip(found[0].frames, found[1].frames, strict=True):
        np.testing.assert_allclose(coming.local, at_rest.local, atol=1e-9)
        np.testing.assert_allclose(coming.rate, at_rest.rate, atol=1e-7)
        np.testing.assert_allclose(coming.multiplier, at_rest.multiplier, atol=1e-6)
    assert found[0]["normal_force"].max() > 0.1


def test_a_wall_that_sets_out_later_hits_later() -> None:
    """A kink in its path leaves no trace in the rate of the gap, which the law of impact depends on."""
    found, wait, step = [], 0.2, 0.02
    for late in (0.0, wait):

        def gap(x: Array, t: float, late: float = late) -> Array:
            return np.full(len(x), 0.02 - 0.75 * max(t - late, 0.0))

        evolution = moving_bar(4, hv.Contact(hv.Signorini(), gap=gap), modulus=4.0)
        history = march(evolution, 0.6 + late, step=step, scheme=MoreauJean(0.5), save=Save(step), stops=(wait,))
        found.append(history.frames[round(late / step) :])
    for early, later in zip(*found, strict=True):
        np.testing.assert_allclose(later.local, early.local, atol=1e-9)
        np.testing.assert_allclose(later.velocity, early.velocity, atol=1e-7)
        np.testing.assert_allclose(later.multiplier, early.multiplier, atol=1e-6)
    assert max(frame.multiplier.max() for frame in found[0]) > 0.1


@pytest.mark.parametrize(("restitution", "theta"), [(0.0, 0.5), (0.5, 0.5), (0.5, 0.6), (0.5, 1.0 / 1.5), (1.0, 0.5)])
def test_what_a_step_takes_from_the_energy_is_known(restitution: float, theta: float) -> None:
    """``P v (1 - theta (1 + e))`` of points that are hit with v, and what theta damps.

    A point that leaves and is pressed back adds energy, unless ``theta = 1/(1 + e)``.
    """
    step = 0.01
    problem = bodies.square(hv.Contact(hv.Signorini(), gap=0.05), 6, density=1.0, supports={}, body_force=(0.0, -1.0))
    evolution = hv.Evolution(problem, inertia=True, velocity=(0.3, -0.2))
    plan = March(2.4, step=step, scheme=MoreauJean(restitution, theta), controls=hv.Controls(rtol=1e-12))
    discrete, taken = discretize_evolution(evolution), []
    states = [event.state for event in marching(evolution, plan)]
    assert discrete.mass is not None
    weights = discrete.problem.contact.weights
    for before, after in pairwise(states):
        impulse = step * weights * after.multiplier[:, 0]
        moved, gained = after.body.displacement - before.body.displacement, after.body.velocity - before.body.velocity
        lost = (1.0 - theta * (1.0 + restitution)) * float(impulse @ before.local.velocity[:, 0])
        lost += (theta - 0.5) * float(moved @ discrete.stiffness.times(moved) + gained @ discrete.mass.times(gained))
        taken.append(after.ledger.numerical - before.ledger.numerical)
        assert taken[-1] == pytest.approx(lost, abs=1e-11)
    assert (min(taken) < -1e-7) == (theta == 0.5 and restitution < 1.0)
    assert states[-1].ledger.numerical > (1e-3 if restitution < 1.0 else -1e-11)


@pytest.mark.parametrize(("ramp", "says"), [(0.0, True), (0.4, False)], ids=["jump", "ramp"])
def test_an_obstacle_that_jumps_into_the_body_is_reported(ramp: float, says: bool) -> None:
    """A law of velocities leaves a body that is not seen to touch in the step of the jump where it is."""

    def gap(x: Array, t: float) -> Array:
        part = min(max((t - 0.505) / ramp, 0.0), 1.0) if ramp else float(t > 0.505)
        return np.full(len(x), 0.03 - 0.05 * part)

    problem = bodies.column(hv.Contact(hv.Signorini(), gap=gap), top=hv.Clamped(), density=1.0)
    found = march(Evolution(problem, inertia=True), 1.0, step=0.02, scheme=hv.evolution.MoreauJean())
    told = [message for message in found.messages if "jumps into the body" in message]
    assert (len(told) == 1) == says
    if says:
        assert "by 0.05 in the step to t = 0.52" in told[0]
        assert f"{found['penetration'][26]:.3g}" in told[0]
        assert found["penetration"][26] > 5e-3


@pytest.mark.parametrize("scheme", [Newmark(), GeneralizedAlpha(0.8), Midpoint()], ids=lambda scheme: scheme.name)
def test_a_scheme_that_makes_energy_does_not_finish(scheme: Scheme) -> None:
    """A block driven against an obstacle; what its table says of the energy is the reason."""
    found = {law.name: march(driven(law), until=1.0, step=0.02, scheme=scheme) for law in OBSTACLES}
    hit, met = found["signorini"], found["compliance"]
    assert -hit["numerical"].min() > 2.0 * np.abs(hit["work"]).max()
    assert (hit.ended, hit.finished) == ("energy made", False)
    assert f"the scheme {scheme.name} made energy" in hit.messages[-1]
    assert met.finished
    assert not any("made energy" in message for message in met.messages)


def test_a_bounce_without_work_makes_nothing() -> None:
    """A bounce from an initial velocity: nothing does work, and nothing is made."""
    known = bouncing_block()
    found = march(known.evolution, known.until, step=2e-3, scheme=Midpoint())
    assert found.finished
    assert not found["work"].any()


OBSTACLES = (hv.Signorini(), hv.Compliance(24.0))


def driven(law: hv.laws.Superpotential) -> Evolution:
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), (1, 2)),
        material=hv.Material.lame(4.0, 4.0, density=0.5),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Clamped()},
        tractions={"bottom": lambda x, t: np.tile([0.0, -3.6 * t], (len(x), 1))},
        contact={"bottom": hv.Contact(law, gap=0.01)},
    )
    return Evolution(problem, inertia=True)
