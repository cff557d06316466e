"""Jumps of a body on a law that softens faster than the body is stiff: which equilibrium follows, and what is lost."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, History, march
from tests import bodies

#: kappa (r0 - r) in dj(r): j' = 2 r up to 0.1, falls with slope -2 to zero at 0.2.
KAPPA, STIFF, DELTA, FALL = 1.0, 2.0, 0.1, 2.0
UP, DOWN = DELTA * (1 + STIFF / KAPPA), DELTA * (1 + STIFF / FALL)
LOSS = KAPPA * STIFF * (UP**2 - DOWN**2) / (2 * (KAPPA + STIFF))


#: j' of the block's foundation.
LAW = hv.laws.PiecewiseQuadratic([0.0, DELTA, DELTA * (1 + STIFF / FALL)], [0.0, STIFF, -FALL, 0.0], np.zeros(3))


def cycle(
    jump: str,
    step: float,
    viscosity: object = None,
    law: hv.laws.Superpotential = LAW,
    until: float = 0.8,
    width: float = 1.0,
    density: float = 1.0,
) -> tuple[History, Array]:
    """The top of a block pushed down by r0 = t up to 0.4 and back; r0 at every row."""
    top = hv.Fixed(y=lambda x, t: np.full(len(x), -min(t, 0.8 - t)))
    lame, size = (0.0, 0.5 * KAPPA), (width, 1.0)
    problem = bodies.column(law, top=top, size=size, lame=lame, viscosity=viscosity, density=density)  # type: ignore[arg-type]
    history = march(Evolution(problem), until, step=step, stops=(0.4,), jump=jump)
    return history, np.minimum(history.times, 0.8 - history.times)


def jumps(history: History, pushed: Array) -> tuple[float, float]:
    """r0 at which the pressure drops on the way in, and comes back on the way out."""
    force = history["normal_force"]
    inward = history.times <= 0.4
    gone = pushed[inward][np.flatnonzero(force[inward] > 0.05)[-1]]
    back = pushed[~inward][np.flatnonzero(force[~inward] > 0.05)[0]]
    return float(gone), float(back)


@pytest.mark.slow
def test_local_jumps_are_late_both_ways() -> None:
    step = 0.002
    history, pushed = cycle("local", step)
    up, down = jumps(history, pushed)
    assert up == pytest.approx(UP, abs=1.01 * step)
    assert down == pytest.approx(DOWN, abs=1.01 * step)
    assert history["jumped"].sum() == 2
    assert history.ledger["jumps"] == pytest.approx(LOSS, rel=0.05)
    assert abs(history.ledger["gap"]) < 1e-12
    assert any("jumped" in message for message in history.messages)


@pytest.mark.slow
def test_viscous_jumps_are_the_local_ones() -> None:
    step = 0.004
    history, pushed = cycle("viscous", step)
    assert jumps(history, pushed) == pytest.approx((UP, DOWN), abs=2.01 * step)  # the jump takes some steps
    assert history.ledger["jumps"] > 0.5 * LOSS
    slow, pushed = cycle("local", step, viscosity=(0.0, 1e-4))
    assert jumps(slow, pushed) == pytest.approx((UP, DOWN), abs=3 * step)


def test_the_march_stops_where_it_is_told() -> None:
    history, _ = cycle("stop", 0.002)
    assert history.ended == "margin lost"
    assert history.state.time < UP
    assert "several solutions" in history.messages[-1]


def test_what_the_ways_of_jumping_need_is_said_before() -> None:
    still = bodies.square(LAW, 1, lame=(0.0, 0.5), supports={"top": hv.Clamped()})
    with pytest.raises(ProblemError, match="was removed: march with inertia"):
        march(Evolution(still), 1.0, jump="dynamic")
    with pytest.raises(ProblemError, match="ends of steps"):
        march(Evolution(still), 1.0, jump="arc-length", scheme=hv.evolution.Midpoint())


@pytest.mark.slow
def test_viscosity_that_slows_the_body_down_is_told() -> None:
    """A body on a law that falls 50 times as fast as it is stiff is some 54 steps late."""
    steep = hv.laws.PiecewiseQuadratic([0.0, DELTA, DELTA * 1.04], [0.0, STIFF, -50.0, 0.0], np.zeros(3))
    late, pushed = cycle("viscous", 0.002, law=steep, until=0.4)
    slow, r = 1.1 * (50.0 / KAPPA - 1.0) + 0.05, 0.0
    for r0 in pushed[1:41]:
        r = KAPPA * (slow * r + r0) / (slow * KAPPA + KAPPA + STIFF)
    assert late["penetration"][40] == pytest.approx(r, rel=1e-6)
    assert r < 0.61 * KAPPA * pushed[40] / (KAPPA + STIFF)
    assert sum("lags behind what acts on it by up to 0.108, " in message for message in late.messages) == 1
    soon, _ = cycle("viscous", 0.002, until=0.4)
    assert not any("lags" in message for message in soon.messages)


def test_points_that_rest_on_what_falls_are_found_by_multigrid_too() -> None:
    """A strip peeled off glue that falls 13 times as fast as the strip is stiff, without the graph of the law."""
    problem = bodies.strip(
        hv.Adhesive(stiffness=50.0, strength=0.25, softening=20.0, compression=500.0),
        (12, 4),
        size=(3.0, 1.0),
        material=hv.Material.young(100.0, 0.3),
        tractions={"right": lambda x, t: np.stack([0.0 * x[:, 0], 0.6 * t + 0.0 * x[:, 0]], axis=1)},
    )
    runs = [
        march(Evolution(problem), 0.36, step=0.12, method=solver, max_time=60.0)
        for solver in (None, hv.solvers.NonsmoothMultigrid())
    ]
    assert all(run.finished for run in runs)
    assert runs[0]["jumped"].tolist() == runs[1]["jumped"].tolist() == [0, 0, 0, 1]
    assert runs[0]["margin"][1:].max() < -12.0
    for column in ("normal_force", "elastic", "contact", "jumps"):
        np.testing.assert_allclose(runs[1][column], runs[0][column], rtol=0.0, atol=1e-7, err_msg=column)
