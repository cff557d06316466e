"""Jumps of a body on a law that softens faster than the body is stiff: which equilibrium follows, and what is lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, History, March, descent, march
from hemivar.evolution.march import marching
from hemivar.formula import Formula
from hemivar.solvers import solve
from tests import bodies
from tests.evolution.messages import said_of
from tests.samples import slow

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
def test_energetic_solutions_jump_at_the_maxwell_load() -> None:
    step = 0.002
    history, pushed = cycle("global", step)
    up, down = jumps(history, pushed)
    assert up == pytest.approx(np.sqrt(UP * DOWN), abs=1.01 * step)
    assert down == pytest.approx(np.sqrt(UP * DOWN), abs=1.01 * step)


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
    assert history.moment.time < UP
    assert "several solutions" in history.messages[-1]


def test_along_the_path_jumps_do_not_depend_on_the_step() -> None:
    """With steps of a quarter of the load: both jumps where they are, and what each of them loses."""
    history, _ = cycle("arc-length", 0.1)
    assert history.finished, history.messages
    assert history["jumped"].sum() == 2
    lost = np.diff(history["jumps"])
    there = KAPPA * STIFF * UP**2 / (2 * (KAPPA + STIFF))  # stored at r0 = UP, less the strength of the foundation
    strength = 0.5 * STIFF * DELTA**2 + 0.5 * (STIFF * DELTA) ** 2 / FALL
    up = 0.5 * KAPPA * (UP - DELTA) ** 2 + 0.5 * STIFF * DELTA**2 - strength
    down = strength - KAPPA * STIFF * DOWN**2 / (2 * (KAPPA + STIFF))
    assert there - strength == pytest.approx(up)
    assert lost[lost > 0.0] == pytest.approx([up, down], rel=1e-5)
    assert history.ledger["jumps"] == pytest.approx(LOSS, rel=1e-5)
    assert abs(history.ledger["gap"]) < 1e-12
    assert any(f"t = {UP:.8g}" in message for message in history.messages)


def bump(r: Array) -> Array:
    """j' of springs that give way smoothly."""
    return np.where(r > 0.0, 3.0 * r * np.exp(-0.5 * (r / DELTA) ** 2), 0.0)


@pytest.mark.parametrize("law", ["table", slow("function")])
def test_smooth_laws_jump_where_they_must_without_crawling(law: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Folds by ``kappa + j'' = 0``; beside a fold of a smooth law the energy falls by next to nothing at first."""
    count = 0

    def counted(*given: object, **more: object) -> object:
        nonlocal count
        count += 1
        return solve(*given, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(descent, "solve", counted)
    at = np.concatenate([[-1.0], np.linspace(0.0, 0.5, 401)])
    stated = (
        hv.laws.FunctionLaw(derivative=bump, kinks=(0.0,), reach=1.0)
        if law == "function"
        else hv.table_law(at, bump(at))
    )
    history, _ = cycle("arc-length", 0.05, law=stated, until=0.75)

    def out(r: float, r0: float) -> float:
        return KAPPA * (r - r0) + float(bump(np.array(r)))

    def energy(r: float, r0: float) -> float:
        return 0.5 * KAPPA * (r - r0) ** 2 - 3.0 * DELTA**2 * np.exp(-0.5 * (r / DELTA) ** 2)

    lost, pushed = [], []
    for low, high, ends in ((0.1, 0.17, (0.2, 0.4)), (0.18, 0.4, (0.0, 0.1))):
        fold = brentq(lambda x: KAPPA + 3.0 * np.exp(-0.5 * (x / DELTA) ** 2) * (1.0 - (x / DELTA) ** 2), low, high)
        pushed.append(fold + float(bump(np.array(fold))) / KAPPA)
        lost.append(energy(fold, pushed[-1]) - energy(brentq(out, *ends, args=(pushed[-1],)), pushed[-1]))
    assert history.finished, history.messages
    found = np.diff(history["jumps"])
    near = 1e-6 if law == "function" else 5e-3  # of the table's chords
    assert found[found > 0.0] == pytest.approx(lost, rel=near)
    told = said_of(history)[0].split("t = ")[1].split(":")[0]
    assert float(told) == pytest.approx(pushed[0], abs=1e-5)
    assert abs(history.ledger["gap"]) < 1e-12
    assert count < 300


@pytest.mark.slow
def test_a_body_of_many_points_jumps_point_by_point() -> None:
    """A strip is bent onto glue-like ground and back: what is lost in jumps is the same with steps of a third."""
    law = hv.laws.PiecewiseQuadratic([0.0, 0.02, 0.04], [0.0, 40.0, -40.0, 0.0], np.zeros(3))
    problem = bodies.strip(
        law,
        (6, 1),
        size=(2.0, 0.5),
        lame=(1.0, 1.0),
        supports={
            "left": hv.Clamped(),
            "top": hv.Prescribed(lambda x, t: np.stack([0.0 * x[:, 0], -0.2 * min(t, 2.0 - t) * x[:, 0]], 1)),
        },
    )
    histories = [march(Evolution(problem), 2.0, step=step, jump="arc-length") for step in (0.5, 1.0 / 6.0)]
    for history in histories:
        assert history.finished
        assert history.residual < 1e-9
        assert abs(history.ledger["gap"]) < 1e-12
    coarse, fine = (history.ledger["jumps"] for history in histories)
    assert coarse > 0.0
    assert coarse == pytest.approx(fine, rel=1e-5)
    local = march(Evolution(problem), 2.0, step=0.5, jump="local")
    assert local["normal_force"] == pytest.approx(histories[0]["normal_force"], abs=1e-9)


def test_what_the_ways_of_jumping_need_is_said_before() -> None:
    still = bodies.square(LAW, 1, lame=(0.0, 0.5), supports={"top": hv.Clamped()})
    with pytest.raises(ProblemError, match="was removed: march with inertia"):
        march(Evolution(still), 1.0, jump="dynamic")
    with pytest.raises(ProblemError, match="ends of steps"):
        march(Evolution(still), 1.0, jump="arc-length", scheme=hv.evolution.Midpoint())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("jump", "up", "down"), [("local", UP, DOWN), ("global", np.sqrt(UP * DOWN), np.sqrt(UP * DOWN))]
)
def test_adaptive_steps_go_through_jumps_and_go_on_bit_for_bit(
    jump: str, up: float, down: float, tmp_path: Path
) -> None:
    """A step in which a body jumps is never short enough; what follows does not depend on what was computed before."""
    problem = bodies.column(LAW, KAPPA, cells=2, top=hv.Fixed(y=Formula("-min(t, 0.8 - t)")))
    file = hv.evolution.Checkpoint(tmp_path / "a.ckpt", 0.0)
    plan = March(0.8, step=hv.evolution.AdaptiveStep(0.1), jump=jump, save=hv.evolution.Save(0.4), checkpoint=file)
    steps = marching(Evolution(problem), plan)
    done = [next(steps) for _ in range(12)]
    steps.close()
    assert done[-1].row.time < up
    resumed = march(Evolution(problem), 0.8, step=plan.step, jump=jump, save=plan.save, checkpoint=file, resume=True)
    whole = march(Evolution(problem), 0.8, step=plan.step, jump=jump, save=plan.save)
    assert whole.finished, whole.messages
    assert whole.times[whole["jumped"] > 0] == pytest.approx([up, 0.8 - down], abs=1e-6)
    for name in whole.columns:
        np.testing.assert_array_equal(resumed[name], whole[name], err_msg=name)


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
