"""Jumps of a body on a law that softens faster than the body is stiff: which equilibrium follows, and what is lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, March, descent, march
from hemivar.evolution.march import marching
from hemivar.formula import Formula
from hemivar.solvers import solve
from tests import bodies
from tests.evolution.messages import said_of
from tests.evolution.test_jumps import DELTA, DOWN, FALL, KAPPA, LAW, LOSS, STIFF, UP, cycle, jumps
from tests.samples import slow


@pytest.mark.slow
def test_energetic_solutions_jump_at_the_maxwell_load() -> None:
    step = 0.002
    history, pushed = cycle("global", step)
    up, down = jumps(history, pushed)
    assert up == pytest.approx(np.sqrt(UP * DOWN), abs=1.01 * step)
    assert down == pytest.approx(np.sqrt(UP * DOWN), abs=1.01 * step)


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
