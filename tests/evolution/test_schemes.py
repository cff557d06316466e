"""Schemes against closed forms: order, energy, impacts."""

from __future__ import annotations

import dataclasses
import math
from functools import cache

import numpy as np
import pytest
import scipy.linalg

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import (
    SDIRK2,
    Evolution,
    GeneralizedAlpha,
    ImplicitEuler,
    Midpoint,
    MoreauJean,
    Newmark,
    Save,
    Scheme,
    march,
)
from hemivar.gallery import (
    bar_on_wall,
    bonded_block,
    moving_bar,
    penetration_memory_block,
    sliding_block,
    thrown_bar,
    viscoelastic_cantilever,
    wearing_block,
)
from hemivar.gallery.known_evolutions import KnownEvolution
from hemivar.gallery.moving_bodies import CANTILEVER
from tests import bodies
from tests.samples import slow

TIP = Save(probes={"tip": (2.5, 0.0)})


def test_a_cantilever_moves_and_books_as_computed_elsewhere() -> None:
    history = march(viscoelastic_cantilever(True), 3.2, step=0.1, save=TIP)
    assert (history["tip.u_x"][-1], history["tip.u_y"][-1]) == pytest.approx(CANTILEVER["with mass"], abs=1e-8)
    ledger = history.ledger
    for name, value in CANTILEVER["ledger"].items():
        assert ledger[name] == pytest.approx(value, abs=1e-12), name
    assert abs(ledger["gap"]) < 1e-14


def test_without_mass_it_creeps_as_computed_elsewhere() -> None:
    history = march(viscoelastic_cantilever(False), 3.2, step=0.1, save=TIP)
    assert (history["tip.u_x"][-1], history["tip.u_y"][-1]) == pytest.approx(CANTILEVER["without"], abs=1e-7)


@pytest.mark.parametrize("scheme", [GeneralizedAlpha(0.8), slow(Newmark()), slow(Midpoint())], ids=lambda s: s.name)
def test_the_order_is_two_with_mass(scheme: Scheme) -> None:
    finest = march(viscoelastic_cantilever(True), 1.0, step=1 / 640, scheme=scheme).state.body.displacement
    errors = [
        np.linalg.norm(
            march(viscoelastic_cantilever(True), 1.0, step=step, scheme=scheme).state.body.displacement - finest
        )
        for step in (1 / 10, 1 / 20, 1 / 40)
    ]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders.min() > 1.8
    assert orders.max() < 2.6


@cache
def crept() -> Array:
    """Where the cantilever without mass is after a unit of time, with steps 16 times as fine."""
    return march(viscoelastic_cantilever(False), 1.0, step=1 / 1280, scheme=SDIRK2()).state.body.displacement


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "least"),
    [(ImplicitEuler(), 0.9), (SDIRK2(), 1.85), (Midpoint(), 1.85)],
    ids=["euler", "sdirk2", "midpoint"],
)
def test_the_orders_without_mass(scheme: Scheme, least: float) -> None:
    errors = [
        np.linalg.norm(
            march(viscoelastic_cantilever(False), 1.0, step=step, scheme=scheme).state.body.displacement - crept()
        )
        for step in (1 / 20, 1 / 40, 1 / 80)
    ]
    assert np.log2(np.array(errors[:-1]) / errors[1:]).min() > least


@pytest.mark.parametrize(
    ("known", "error"), [(penetration_memory_block(), 1e-3), (wearing_block(), 2e-2), (bonded_block(), 1e-1)],
    ids=["penetration", "wear", "bond"],
)  # fmt: skip
def test_what_points_remember_lasts_whole_steps(known: KnownEvolution, error: float) -> None:
    """Also where the law holds in the middle of a step, and the memory is asked for at its end."""
    history = march(known, known.until, step=known.until / 20, scheme=Midpoint(), stops=known.stops)
    found = history.frames[-1].memory["0.bond"][0] if known.quantity == "bond" else history[known.quantity][-1]
    assert found == pytest.approx(known.exact(known.until), rel=error)
    assert abs(history.ledger["numerical"]) < 0.05 * max(abs(history.ledger["moved"]), abs(history.ledger["memory"]))
    assert abs(history.ledger["gap"]) < 1e-8


@pytest.mark.parametrize(
    "memory", [hv.laws.ViscousFoundation(5.0), hv.laws.PenetrationMemory(30.0, 0.4)], ids=lambda m: m.name
)
def test_schemes_agree_on_what_points_remember(memory: hv.laws.Memory) -> None:
    contact = hv.Contact(hv.Compliance(24.0), memory=(memory,))
    problem = bodies.column(contact, 12.0, top=None, viscous=1.0, density=0.2, tractions={"top": (0.0, -1.0)})
    states = []
    for scheme in (Newmark(), Midpoint(), GeneralizedAlpha(0.5)):
        history = march(Evolution(problem, inertia=True), 0.8, step=0.02, scheme=scheme)
        states.append([float(values[0]) for values in history.frames[-1].memory.values()])
    np.testing.assert_allclose(states[1:], [states[0]] * 2, rtol=0.02)


def test_implicit_euler_rings_down_and_the_midpoint_rule_does_not() -> None:
    """The energy of a mode is divided by ``1 + omega^2 tau^2`` in a step."""
    evolution, step = moving_bar(3, clamped=True), 0.05
    body = march(evolution, step, step=step).discrete
    K, M = body.stiffness.inner.toarray(), body.mass.inner.toarray()  # type: ignore[union-attr]
    values, modes = scipy.linalg.eigh(K, M)
    omega2 = float(values[1])
    evolution = dataclasses.replace(evolution, displacement=body.full(modes[:, 1]))
    euler = march(evolution, 1.0, step=step)
    stored = euler["elastic"] + euler["kinetic"]
    assert stored[1:] / stored[:-1] == pytest.approx(1.0 / (1.0 + omega2 * step**2), rel=1e-10)
    middle = march(evolution, 1.0, step=step, scheme=Midpoint())
    assert middle["elastic"] + middle["kinetic"] == pytest.approx(stored[0], rel=1e-12)


@pytest.mark.parametrize("scheme", [Newmark(), GeneralizedAlpha(0.8), Midpoint()], ids=lambda s: s.name)
def test_a_bar_on_a_spring(scheme: Scheme) -> None:
    """r(1) of a thrown bar, by its impedance: ``z r' = z v0 - p``, ``p = 24 r``, and what comes back after 2L/c."""
    errors = []
    for cells in (16, 64):
        history = march(thrown_bar(cells), 1.0, step=0.5 / cells, scheme=scheme)
        errors.append(abs(history["penetration"][-1] - 0.024542109028))
        assert abs(history.ledger["gap"]) < 1e-12 * history.state.ledger.start
    assert errors[1] < 1e-4
    assert errors[1] < 0.5 * errors[0]


def test_a_bar_bounces_off_a_wall() -> None:
    """Pressure 1/2 for 1 < t < 2, then it goes back; period 3."""
    wall = hv.Contact(hv.Signorini())
    cells = 64
    for mass, scheme, ripple in (("redistributed", Newmark(), 0.1), ("consistent", MoreauJean(), 0.15)):
        history = march(
            moving_bar(cells, wall, clamped=True, mass=mass), 0.01, scheme=scheme
        )  # at rest: nothing happens
        assert history["normal_force"] == pytest.approx(0.0, abs=1e-12)
        history = march(bar_on_wall(cells, mass), 3.0, step=1 / 256, scheme=scheme)
        pressure, t = history["normal_force"] * cells, history.times
        inside = (t > 1.1) & (t < 1.9)
        assert pressure[inside].mean() == pytest.approx(0.5, abs=0.01)
        assert pressure[inside].std() < ripple
        assert np.abs(pressure[(t < 0.9) | (t > 2.15)]).max() < 0.2
        assert history.state.ledger.stored == pytest.approx(history.state.ledger.start, rel=0.03)
        assert history["penetration"][-1] == pytest.approx(-0.5, abs=0.04)


@pytest.mark.slow
def test_restitution_one_keeps_the_energy() -> None:
    evolution = bar_on_wall(32, "consistent")
    history = march(evolution, 3.0, step=1 / 128, scheme=MoreauJean(1.0))
    assert history.state.ledger.stored == pytest.approx(history.state.ledger.start, rel=1e-12)
    dull = march(evolution, 3.0, step=1 / 128, scheme=MoreauJean(0.0))
    assert 0.9 < dull.state.ledger.stored / dull.state.ledger.start < 1.0


@pytest.mark.parametrize("step", [0.1, 0.05])
def test_a_sliding_block_comes_to_rest(step: float) -> None:
    """v0 = 1, friction 0.3 on mass 1: implicit Euler's velocities are exact, and it stops at 1/0.3."""
    history = march(sliding_block().evolution, 5.0, step=step, save=Save(probes={"c": (0.5, 0.1)}))
    slowing = history.times < 3.2
    speed = np.diff(history["c.u_x"]) / np.diff(history.times)
    expected = 1.0 - 0.3 * history.times[1:]
    assert speed[slowing[1:]] == pytest.approx(expected[slowing[1:]], abs=2e-4)
    rest = history.times > 3.5
    assert np.ptp(history["c.u_x"][rest]) < 1e-6
    stopped = math.floor(1 / 0.3 / step) * step  # where the last whole step with the full friction ends
    expected_place = sum((1.0 - 0.3 * k * step) * step for k in range(1, round(stopped / step) + 1))
    assert history["c.u_x"][-1] == pytest.approx(expected_place, abs=1e-3 * step + 2e-4)
    assert history.ledger["friction"] + history.ledger["numerical"] == pytest.approx(0.5, rel=1e-4)


def test_a_block_on_ground_that_hardens_bounces_without_loss() -> None:
    """The mean of the law over a step keeps the energy, to the solver's tolerance; the law at the midpoint does not."""
    ground = hv.laws.PiecewiseQuadratic([0.0, 0.02, 0.04], [0.0, 20.0, 200.0, 2000.0], np.zeros(3))
    evolution = moving_bar(4, hv.Contact(ground), modulus=50.0, velocity=1.0)
    kept = march(evolution, 1.0, step=0.02, scheme=Midpoint(conserving=True))
    assert kept["normal_force"].max() > 0.5  # it has been down, and up again
    assert kept["normal_force"][-1] == 0.0
    stored = kept["elastic"] + kept["kinetic"] + kept["contact"]
    assert stored == pytest.approx(stored[0], rel=1e-9)
    plain = march(evolution, 1.0, step=0.02, scheme=Midpoint())
    assert np.abs(plain["elastic"] + plain["kinetic"] + plain["contact"] - stored[0]).max() > 1e-3 * stored[0]


def test_what_cannot_be_averaged_is_refused() -> None:
    with pytest.raises(ProblemError, match="ends at some penetration"):
        march(moving_bar(2, hv.Contact(hv.Signorini())), 1.0, scheme=Midpoint(conserving=True))
    damped = hv.Contact(hv.Compliance(1.0), damping=hv.Compliance(1.0))
    with pytest.raises(ProblemError, match="a memory, a damping or friction of the slip"):
        march(moving_bar(2, damped), 1.0, scheme=Midpoint(conserving=True))
    with pytest.raises(ProblemError, match="True or False"):
        Midpoint(conserving=1)  # type: ignore[arg-type]
