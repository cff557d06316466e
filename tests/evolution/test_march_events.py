"""Every kind of event, at a time that a closed form tells."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.evolution import BondBroken, Evolution, MarginLost, Release, Save, Slip, Touch, When, march
from tests import bodies

KAPPA = 3.0


def pushed_spring(contact: hv.Contact, load: Any, **material: Any) -> Evolution:
    """A unit square between rollers, modulus 3, held at its top and pushed at its bottom: ``3 s + g(s) = load``."""
    problem = bodies.column(
        contact, material=hv.Material.lame(0.0, 0.5 * KAPPA, **material), tractions={"bottom": load}
    )
    return Evolution(problem)


def falling(x: Array, t: float) -> Array:
    return np.stack([0.0 * x[:, 0], np.full(len(x), 2.0 * t - 1.0)], axis=1)  # downwards until t = 1/2


def test_touch_and_release_of_a_block_that_is_pushed_and_pulled() -> None:
    """Pushed by ``1 - 2 t``, it leaves the foundation at t = 1/2; pushed by ``2 t - 1``, it comes to it then."""
    for sign, name, boundary in ((1.0, "release", "bottom"), (-1.0, "touch", None)):
        events = (Release(boundary=boundary), Touch(boundary=boundary))
        evolution = pushed_spring(hv.Contact(hv.Compliance(2.0)), lambda x, t, s=sign: s * falling(x, t))
        history = march(evolution, 1.0, step=0.3, events=events)
        # At the start the block is at rest without load: what happens in the first step is not looked at.
        (time, found) = history.events[-1]
        assert (time, found) == (pytest.approx(0.5, abs=1e-6), name)
        assert time in history.times
        assert any(frame.time == time for frame in history.frames)


def test_slip_starts_where_friction_is_overcome() -> None:
    """A block of mass 1, bound 0.3, pushed by ``t``: it sticks until then. Rigid but for 1e-4 of the load."""
    problem = bodies.strip(
        hv.Contact(hv.laws.Bilateral(), hv.Tresca(0.3)),
        (2, 1),
        size=(1.0, 0.2),
        lame=(1e4, 1e4),
        density=5.0,
        supports={"top": hv.Fixed(y=0.0)},
        body_force=lambda x, t: np.stack([5.0 * t + 0.0 * x[:, 0], 0.0 * x[:, 0]], axis=1),
    )
    history = march(Evolution(problem, inertia=True), 0.5, step=0.04, events=[Slip("stop", rate=1e-3)])
    # From then on the velocity is (t - 0.3)^2/2, which passes the rate after sqrt(2e-3); a step counts its end.
    assert history.ended == "event: slip"
    assert 0.3 < history.state.time < 0.3 + math.sqrt(2e-3) + 0.02
    assert np.abs(history.state.local.velocity[:, 1]).max() == pytest.approx(1e-3, rel=1e-3)
    assert march(Evolution(problem, inertia=True), 0.28, step=0.04, events=[Slip(rate=1e-3)]).events == ()
    # One point that slips is enough, in either direction; how fast it sinks does not count.
    local = history.state.local
    for rates, above in (([0.0, -2.0, 0.5], 1.5), ([0.0, 0.1, 0.2], -0.3), ([0.0, 0.0, 0.0], -0.5)):
        moved = replace(local, velocity=np.column_stack([np.full(3, 9.0), rates]))
        state = replace(history.state, local=moved)
        assert Slip(rate=0.5).level(history.discrete, state, 1.0) == pytest.approx(above)


def test_a_point_that_sticks_does_not_slip_by_rounding_or_by_sinking() -> None:
    history = march(
        pushed_spring(hv.Contact(hv.Compliance(2.0), hv.Tresca(1.0)), falling), 0.4, step=0.1, events=[Slip("stop")]
    )
    assert history.finished
    assert np.abs(history.state.local.velocity[:, 0]).min() > 0.1


def test_a_bond_is_broken_where_it_falls_below() -> None:
    """``beta = b + (1 - b) exp(-gamma r^2 t/eta)`` falls to 1/2 at a known time; steps are of order one."""
    known = gallery.bonded_block()
    pull, rest = 50.0 * 0.1**2, 0.05 / (50.0 * 0.1**2)
    exact = -0.2 / pull * math.log((0.5 - rest) / (1.0 - rest))
    events = [BondBroken("stop", below=0.5), BondBroken("stop", "top", below=0.9), BondBroken("stop", below=0.4)]
    history = march(known.evolution, 1.0, step=0.1, stops=known.stops, events=events)
    assert history.ended == "event: bond broken"
    (state,) = history.state.memory.values()
    (bond,) = (values for name, values in state.items() if name.endswith("bond"))
    assert bond.min() == pytest.approx(0.5, abs=1e-5)
    assert exact < history.state.time < exact + 0.1


def test_the_margin_is_lost_where_the_law_softens_as_fast_as_the_body_is_stiff() -> None:
    """alpha = 1 + 4 t passes kappa = 3 at t = 1/2."""
    law = hv.Softening(10.0, 0.1, lambda x, t: 1.0 + 4.0 * t + 0.0 * x[:, 0])
    history = march(pushed_spring(hv.Contact(law), (0.0, -0.1)), 1.0, step=0.3, events=[MarginLost("stop")])
    assert history.ended == "event: margin lost"
    assert history.state.time == pytest.approx(0.5, abs=1e-6)
    assert history["margin"][1] == pytest.approx(1.0 - (1.0 + 4.0 * 0.3) / 3.0, rel=1e-6)  # claimed from below


def test_a_margin_of_minus_infinity_is_lost_and_one_that_was_not_looked_for_is_not() -> None:
    """As it is of a law that falls at once."""
    evolution = pushed_spring(hv.Contact(hv.Compliance(2.0)), (0.0, -0.1))
    history = march(evolution, 1.0, step=1.0)
    levels = [MarginLost().level(history.discrete, history.state, m) for m in (-math.inf, math.nan, math.inf)]
    assert [level > 0.0 for level in levels] == [True, False, False]


def test_events_are_counted_once_and_every_one_that_happens() -> None:
    """Two at one time are both told; one that stays above zero is not told again, one that comes back is."""
    waves = When(function=lambda discrete, state: math.sin(2.0 * math.pi * state.time), label="wave")
    late = When(function=lambda discrete, state: state.time - 0.25, label="late")
    same = When(function=lambda discrete, state: 4.0 * (state.time - 0.25), label="same")
    evolution = pushed_spring(hv.Contact(hv.Compliance(2.0)), (0.0, -1.0))
    history = march(evolution, 2.2, step=0.2, events=[waves, late, same], save=Save(10.0))
    names = [name for _, name in history.events]
    assert names == ["wave", "late", "same", "wave", "wave"] or names.count("wave") == 3
    assert [time for time, name in history.events if name in ("late", "same")] == pytest.approx([0.25] * 2, abs=1e-6)
    assert [time for time, name in history.events if name == "wave"] == pytest.approx([0.0, 1.0, 2.0], abs=1e-6)
    # After an event the steps are as long as before.
    assert np.diff(history.times).max() == pytest.approx(0.2)
    assert np.sum(np.diff(history.times) > 0.1999) >= 6


def test_a_worn_foundation_is_left_where_it_is_worn_to() -> None:
    """Rubbed and then lifted by 0.1 t: it is left when nothing presses any more, not when the wear is undone."""

    def moved(x: Array, t: float) -> Array:
        lifted = 0.1 * max(t - 1.0, 0.0) - 0.05
        return np.stack([np.full(len(x), min(t, 1.0)), np.full(len(x), lifted)], axis=1)

    contact = hv.Contact(hv.Compliance(50.0), hv.Tresca(1e-3), memory=(hv.laws.Wear(0.3),))
    problem = bodies.square(contact, 1, lame=(0.0, 6.0), supports={"top": hv.Prescribed(moved)})
    history = march(Evolution(problem), 1.6, step=0.25, stops=(1.0,), events=[Release("stop")])
    worn = history.state.memory["bottom"]["0.depth"]
    assert history.ended == "event: release"
    assert worn.min() > 0.03
    assert history.times[-1] < 1.3  # what is worn would be undone at t = 1.5
    assert history["normal_force"][-2] > 0.0
    assert history["penetration"][-1] == pytest.approx(worn.max(), abs=1e-6)
