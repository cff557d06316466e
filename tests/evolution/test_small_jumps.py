"""Jumps of one degree of freedom in few steps: where they happen, and what every way of jumping books."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, History, march
from hemivar.solvers import NonsmoothMultigrid, Solver

#: kappa (r0 - r) in dj(r): j' = 2 r up to 0.1, falls with slope -2 to zero at 0.2; up at 0.3, down at 0.2.
KAPPA, STIFF, DELTA, FALL = 1.0, 2.0, 0.1, 2.0
LAW = hv.PiecewiseQuadratic([0.0, DELTA, DELTA * (1 + STIFF / FALL)], [0.0, STIFF, -FALL, 0.0], np.zeros(3))
STRENGTH = 0.5 * STIFF * DELTA**2 + 0.5 * (STIFF * DELTA) ** 2 / FALL


def cycle(jump: str, step: float, solver: Solver | None = None, until: float = 0.8) -> tuple[History, Array]:
    """The top of a block pushed down by r0 = t up to 0.4 and back; r0 at every row."""
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 1),
        material=hv.Material.lame(0.0, 0.5 * KAPPA),
        supports={
            "left": hv.Roller(),
            "right": hv.Roller(),
            "top": hv.Fixed(y=lambda x, t: np.full(len(x), -min(t, 0.8 - t))),
        },
        contact={"bottom": hv.Contact(LAW)},
    )
    history = march(Evolution(problem), until, step=step, stops=(0.4,), jump=jump, solver=solver)
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
    if jump == "global":  # both equilibria have the same energy: what a step loses may be less than its work
        jumped = history["jumped"][1:].astype(bool)
    np.testing.assert_array_equal(history["jumped"][1:].astype(bool), jumped)
    np.testing.assert_allclose(np.diff(history["jumps"]), np.where(jumped, lost, 0.0), atol=1e-8)
    np.testing.assert_allclose(np.diff(history["numerical"]), np.where(jumped, 0.0, lost), atol=1e-8)
    assert np.abs(history["gap"]).max() < 1e-10
    if jump == "global":
        return
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
    taken = np.diff(history["numerical"])
    assert (taken[jumped] == 0.0).all()  # where the body jumps, all that is lost is
    np.testing.assert_allclose(np.diff(history["jumps"])[~jumped], (rho * KAPPA * way**2)[~jumped], rtol=1e-6)
    assert (np.diff(history["jumps"])[jumped] > (rho * KAPPA * way**2)[jumped]).all()
    assert np.abs(history["gap"]).max() < 1e-10
    np.testing.assert_allclose(force, LAW.derivative(r), atol=1e-8)


def test_where_nothing_jumps_nothing_is_booked() -> None:
    history, _ = cycle("stop", 0.034)
    assert history.ended == "margin lost"
    assert len(history.times) == 1
    soft = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 1),
        material=hv.Material.lame(0.0, 2.0),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Fixed(y=lambda x, t: np.full(len(x), -t))},
        contact={"bottom": hv.Contact(LAW)},
    )
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
