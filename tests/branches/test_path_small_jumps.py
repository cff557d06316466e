"""Jumps of one degree of freedom in few steps: where they happen, and what every way of jumping books."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, march
from hemivar.solvers import NonsmoothMultigrid, Solver
from tests import bodies
from tests.evolution.messages import said_of
from tests.evolution.test_jumps_small import DELTA, FALL, KAPPA, LAW, STIFF, cycle, pushed_block
from tests.samples import slow

STRENGTH = 0.5 * STIFF * DELTA**2 + 0.5 * (STIFF * DELTA) ** 2 / FALL


def stored(r0: float, broken: bool) -> float:
    """Energy of the equilibrium on the rising branch, or behind the law."""
    return STRENGTH if broken else 0.5 * KAPPA * STIFF / (KAPPA + STIFF) * r0**2


def pressure(r0: float, broken: bool) -> float:
    return 0.0 if broken else KAPPA * STIFF / (KAPPA + STIFF) * r0


@pytest.mark.parametrize(
    ("jump", "up", "down", "solver"),
    [
        ("local", 0.3, 0.2, None),
        pytest.param("local", 0.3, 0.2, NonsmoothMultigrid(), marks=pytest.mark.slow),
        ("global", np.sqrt(0.06), np.sqrt(0.06), None),
    ],
)
def test_both_jumps_and_every_book(jump: str, up: float, down: float, solver: Solver | None) -> None:
    """In coarse steps all numbers are known: where the pressure goes, the work of the support, what is lost."""
    history, pushed = cycle(jump, 0.034 if jump == "global" else 0.023, solver)
    broken = np.zeros(len(pushed), dtype=bool)
    for i in range(1, len(pushed)):
        broken[i] = pushed[i] > up or (broken[i - 1] and pushed[i] > down)
    assert broken.any()
    assert not broken[-1]
    force = np.array([pressure(*pair) for pair in zip(pushed, broken, strict=True)])
    energy = np.array([stored(*pair) for pair in zip(pushed, broken, strict=True)])
    np.testing.assert_allclose(history["normal_force"], force, atol=1e-7)
    np.testing.assert_allclose(history["elastic"] + history["contact"], energy, atol=1e-8)
    # Implicit Euler: the support is moved against the force at the end of a step.
    work = force[1:] * np.diff(pushed)
    np.testing.assert_allclose(np.diff(history["moved"]), work, atol=1e-8)
    lost = work - np.diff(energy)
    jumped = broken[1:] != broken[:-1]
    np.testing.assert_array_equal(history["jumped"][1:].astype(bool), jumped)
    # Between equilibria of the same energy the scheme may give: it moves the support against the last force.
    at_once = np.where(jumped, np.maximum(lost, 0.0), 0.0)
    np.testing.assert_allclose(np.diff(history["jumps"]), at_once, atol=1e-8)
    np.testing.assert_allclose(np.diff(history["numerical"]), lost - at_once, atol=1e-8)
    assert np.abs(history["gap"]).max() < 1e-10
    (message,) = (one for one in history.messages if "jumped" in one)
    first = history.times[1:][jumped][0]
    assert f"t = {first:.8g}" in message
    assert f"jump = '{jump}'" in message


def test_where_nothing_jumps_nothing_is_booked() -> None:
    history, _ = cycle("stop", 0.034)
    assert history.ended == "margin lost"
    assert len(history.times) == 1
    soft = bodies.column(LAW, 4.0, top=hv.Fixed(y=lambda x, t: np.full(len(x), -t)))
    for jump in ("local", "global"):
        history = march(Evolution(soft), 0.5, step=0.06, jump=jump)  # kappa = 4 > alpha
        assert history.finished
        assert history.ledger["jumps"] == 0.0
        assert not history["jumped"].any()
        assert history["margin"][1:] == pytest.approx(0.5, rel=1e-6)


@pytest.mark.parametrize("beyond", [1e-6, 1e-3])
def test_a_jump_at_the_very_end_of_a_step_is_taken_in_it(beyond: float) -> None:
    """The path ends at 0.3, a millionth before the step does: the load need not wait for the next one."""
    end = 0.3 * (1.0 + beyond)
    history, _ = cycle("arc-length", 0.5 * end, until=end)
    assert history.finished
    assert history["normal_force"][-1] == pytest.approx(0.0, abs=1e-9)
    lost = 0.5 * KAPPA * STIFF / (KAPPA + STIFF) * 0.3**2 - STRENGTH
    assert history.ledger["jumps"] == pytest.approx(lost, rel=1e-2)
    assert history["jumped"].tolist() == [0.0, 0.0, 1.0]
    assert abs(history.ledger["gap"]) < 1e-12
    stays, _ = cycle("arc-length", 0.2, until=0.2999)
    assert not stays["jumped"].any()
    assert stays["normal_force"][-1] == pytest.approx(pressure(0.2999, False), rel=1e-9)


@pytest.mark.parametrize("jump", ["local", "global", "viscous"])
def test_a_law_that_weakens_with_time_is_no_jump(jump: str) -> None:
    """Well below its limit the foundation softens, and the block follows its equilibrium ``r = .1/(1 + k)``."""

    def stiffness(x: Array, t: float) -> Array:
        return np.full(len(x), STIFF * (1.0 - 0.5 * t))

    law = hv.Softening(stiffness, DELTA, FALL)
    history = march(Evolution(pushed_block(hv.Contact(law), hold=0.1)), 1.0, step=0.1, jump=jump)
    assert history.finished
    if jump != "viscous":
        expected = 0.1 / (1.0 + STIFF * (1.0 - 0.5 * history.times[1:]))
        np.testing.assert_allclose(history["penetration"][1:], expected, atol=1e-9)
        assert history.ledger["jumps"] == 0.0
    assert (history["margin"][1:] < 0.0).all()
    assert not history["jumped"].any()
    assert not said_of(history)


def reached_with_branch(until: float, instant: float, rest: float, time: float) -> float:
    """r at the end of the rising branch of the law, the block being a spring beside a branch: ``rest e + q = 2 r``."""

    def rate(t: float, e: Array) -> Array:
        relaxed = (STIFF * t - (STIFF + rest) * e) / time
        return np.asarray((STIFF + relaxed) / (STIFF + instant))

    found = solve_ivp(rate, (0.0, until), [0.0], rtol=1e-10, atol=1e-13)
    return float(until - found.y[0, -1])


@pytest.mark.parametrize("jump", ["local", "arc-length", *map(slow, ("global", "stop", "viscous"))])
def test_a_branch_yields_at_once_and_chooses_nothing(jump: str) -> None:
    """A spring of 1/2 beside a branch of 1/2: stiffer steps than 1 there are none, and the law falls by 2."""
    material = hv.Material.lame(0.0, 0.25, density=1.0, branches=[hv.materials.Branch(lame=(0.0, 0.25), time=0.5)])
    up = brentq(lambda t: reached_with_branch(t, 1.0, 0.5, 0.5) - DELTA, 0.3, 0.4)
    step = 0.02
    history = march(Evolution(pushed_block(hv.Contact(LAW), material)), 0.4, step=step, jump=jump)
    if jump == "stop":
        assert history.ended == "margin lost"
        assert len(history.times) == 1
        return
    assert history.finished, history.messages
    assert np.abs(history["gap"]).max() < 1e-12
    assert (history["margin"][1:] < 0.0).all()
    (when,) = history.times[history["jumped"].astype(bool)][:1]
    assert history.ledger["jumps"] > 0.0 or jump == "global"
    if jump == "global":
        assert 0.2 < when < up - step
    else:
        assert up < when < up + step + 1e-9
    if jump == "arc-length":
        (told,) = re.findall(r"jumped at t = ([0-9.]+):", said_of(history)[0])
        assert float(told) == pytest.approx(up, abs=1e-4)


def test_leaving_rest_on_a_kink_of_the_law_is_no_jump() -> None:
    """Glue that is stiffer in compression: all branches end at rest, and the first load picks one."""
    problem = bodies.strip(
        hv.Adhesive(20.0, 0.5, 40.0, 30.0),
        1,
        size=(1.0, 0.5),
        lame=(1.0, 1.0),
        density=1.0,
        supports={"top": hv.Prescribed(lambda x, t: 0.05 * t * (1.0 + x[:, :1]) * np.array([[1.0, 2.0]]))},
    )
    history = march(Evolution(problem), 0.2, step=0.05, jump="arc-length")
    assert history.finished
    assert not history["jumped"].any()
    assert not said_of(history)
    force = history["normal_force"]
    np.testing.assert_allclose(force, force[-1] * history.times / 0.2, rtol=1e-9)
    assert history.ledger["jumps"] == 0.0
