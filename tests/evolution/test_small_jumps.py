"""Jumps of one degree of freedom in few steps: where they happen, and what every way of jumping books."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import MethodError
from hemivar.evolution import Evolution, History, march
from hemivar.solvers import NonsmoothMultigrid, Solver
from tests import bodies
from tests.evolution.messages import said_of
from tests.samples import slow

#: kappa (r0 - r) in dj(r): j' = 2 r up to 0.1, falls with slope -2 to zero at 0.2; up at 0.3, down at 0.2.
KAPPA, STIFF, DELTA, FALL = 1.0, 2.0, 0.1, 2.0
LAW = hv.laws.PiecewiseQuadratic([0.0, DELTA, DELTA * (1 + STIFF / FALL)], [0.0, STIFF, -FALL, 0.0], np.zeros(3))
STRENGTH = 0.5 * STIFF * DELTA**2 + 0.5 * (STIFF * DELTA) ** 2 / FALL


def cycle(jump: str, step: float, solver: Solver | None = None, until: float = 0.8) -> tuple[History, Array]:
    """The top of a block pushed down by r0 = t up to 0.4 and back; r0 at every row."""
    problem = bodies.column(LAW, KAPPA, top=hv.Fixed(y=lambda x, t: np.full(len(x), -min(t, 0.8 - t))))
    history = march(Evolution(problem), until, step=step, stops=(0.4,), jump=jump, method=solver)
    return history, np.minimum(history.times, 0.8 - history.times)


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


def test_a_viscous_jump_books_the_resistance_it_was_found_against() -> None:
    """``kappa (r0 - r) - rho kappa (r - r_n) = j'(r)``, rho above c - 1 = 1; ``rho kappa (r - r_n)^2`` is lost."""
    history, pushed = cycle("viscous", 0.034)
    r, force = history["penetration"], history["normal_force"]
    way = np.diff(r)
    resisted = KAPPA * (pushed - r)[1:] - force[1:]
    rho = resisted / (KAPPA * way)
    assert rho == pytest.approx(rho[0], rel=1e-6)
    assert 1.0 < rho[0] < 1.5
    jumped = history["jumped"][1:].astype(bool)
    assert jumped.any()
    assert (np.diff(history["numerical"])[jumped] <= 0.0).all()  # where the body jumps, all that is lost is lost so
    np.testing.assert_allclose(np.diff(history["jumps"])[~jumped], (rho * KAPPA * way**2)[~jumped], rtol=1e-6)
    assert (np.diff(history["jumps"])[jumped] > (rho * KAPPA * way**2)[jumped] - 1e-9).all()
    (message,) = (one for one in history.messages if "jumped" in one)
    assert f"t = {history.times[1:][jumped][0]:.8g}" in message
    assert np.abs(history["gap"]).max() < 1e-10
    np.testing.assert_allclose(force, LAW.derivative(r), atol=1e-8)


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


def pushed_block(contact: hv.Contact, material: hv.Material | None = None, hold: float = np.inf) -> hv.ContactProblem:
    """The block of :func:`cycle`, its top pushed down by ``min(t, hold)``."""
    return bodies.column(
        contact,
        top=hv.Fixed(y=lambda x, t: np.full(len(x), -min(t, hold))),
        material=hv.Material.lame(0.0, 0.5 * KAPPA) if material is None else material,
    )


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


@pytest.mark.parametrize(("jump", "up"), [("local", 0.3), ("viscous", 0.3)])
def test_friction_after_coulomb_does_not_change_where_the_body_jumps(jump: str, up: float) -> None:
    """Nothing slides; bounds that depend on the pressure leave the choice what it is."""
    contact = hv.Contact(LAW, hv.Coulomb(0.3))
    step = 0.048
    history = march(Evolution(pushed_block(contact)), 0.384, step=step, jump=jump)
    assert history.finished
    free = march(Evolution(pushed_block(hv.Contact(LAW))), 0.384, step=step, jump=jump)
    np.testing.assert_allclose(history["normal_force"], free["normal_force"], atol=1e-8)
    np.testing.assert_allclose(history["jumps"], free["jumps"], atol=1e-8)
    np.testing.assert_array_equal(history["jumped"], free["jumped"])
    assert up < history.times[history["jumped"].astype(bool)][0] <= up + 1.01 * step


@pytest.mark.parametrize("jump", ["global", "arc-length"])
def test_choices_by_energy_refuse_friction_that_has_none(jump: str) -> None:
    material = hv.Material.lame(0.0, 0.5 * KAPPA, density=1.0)
    contact = hv.Contact(LAW, hv.Coulomb(0.3))
    with pytest.raises(MethodError, match=r"\(Coulomb\); take jump = 'local'"):
        march(Evolution(pushed_block(contact, material)), 0.4, jump=jump)
    still = hv.Contact(hv.Compliance(STIFF), hv.Coulomb(0.3))
    assert march(Evolution(pushed_block(still, material)), 0.1, step=0.05, jump=jump).finished


@pytest.mark.parametrize("scheme", [hv.evolution.Midpoint(), hv.evolution.SDIRK2()])
def test_viscous_jumps_are_booked_by_schemes_whose_stages_lie_within_the_step(scheme: hv.Scheme) -> None:
    history = march(Evolution(pushed_block(hv.Contact(LAW))), 0.4, step=0.02, scheme=scheme, jump="viscous")
    assert history["jumped"].any()
    assert history.ledger["jumps"] > 0.0
    assert np.abs(history["gap"]).max() < 1e-12
    assert any("oscillate after a jump" in message for message in history.messages) == isinstance(
        scheme, hv.evolution.Midpoint
    )


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


def test_what_a_branch_holds_together_does_not_jump() -> None:
    """A spring of 1/2 beside a branch of 1 on a law that falls by 1.2 up to 0.3, and by 3 only beyond it.

    The margin is lost for what lies beyond; the body follows the fall: ``1.5 r + 0.4 - 1.2 (r - 0.1) = 0.58`` at last.
    """
    law = hv.table_law([0.0, 0.1, 0.3, 0.3 + 0.16 / 3.0], [0.0, 0.4, 0.16, 0.0])
    material = hv.Material.lame(0.0, 0.25, branches=[hv.materials.Branch(lame=(0.0, 0.5), time=1e6)])
    problem = bodies.column(
        law,
        top=hv.Clamped(),
        material=material,
        tractions={"bottom": lambda x, t: np.tile([0.0, -0.58 * t], (len(x), 1))},
    )
    history = march(Evolution(problem), 1.0, step=0.05)
    assert history.finished
    assert history["penetration"][-1] == pytest.approx(0.2, rel=1e-5)
    assert history.margin == pytest.approx(1.0 - 3.0 / 1.5, rel=1e-5)
    assert not history["jumped"].any()
    assert not said_of(history)
