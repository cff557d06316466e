"""The controls of steps by themselves: the ladder, its limits, and what follows a step that failed."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import SDIRK2, AdaptiveStep, Evolution, FixedStep, History, Midpoint, Scheme, march
from hemivar.evolution.steps import StepSizeState
from hemivar.formula import Formula
from hemivar.gallery import VelocityStep
from tests import bodies
from tests.evolution.messages import said_of


def paced(control: AdaptiveStep, constant: float, order: int, count: int) -> tuple[list[float], list[float]]:
    """Steps that stand and those that do not, of a motion whose local error is ``constant step^(order + 1)``."""
    pace, kept, rejected = control.first(100.0), [], []
    while len(kept) < count:
        step = pace.step
        stands, pace = control.after(pace, constant * step ** (order + 1), order)
        (kept if stands else rejected).append(step)
    return kept, rejected


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("constant", [1e-4, 0.3, 1e4])
def test_adaptive_steps_settle_where_the_error_is_below_its_tolerance(order: int, constant: float) -> None:
    control = AdaptiveStep(1e-2, first_step=0.1)
    kept, rejected = paced(control, constant, order, 60)
    assert all(constant * step ** (order + 1) <= 1e-2 for step in kept)
    assert all(constant * step ** (order + 1) > 1e-2 for step in rejected)
    rungs = np.log2(np.array(kept + rejected) / 0.1)
    assert np.abs(rungs - np.round(rungs)).max() < 1e-12
    # It settles on the last rung from which twice the step would still do, with some room.
    ideal = (1e-2 / constant) ** (1.0 / (order + 1))
    assert len(set(kept[-20:])) == 1
    assert 0.45 * ideal <= kept[-1] <= ideal
    assert not rejected or len(rejected) <= 2  # far off, it goes down many rungs at once


def test_a_rejected_step_goes_down_as_far_as_its_error_says() -> None:
    control = AdaptiveStep(1e-3, first_step=1.0)
    for order in (1, 2):
        for rungs in (1, 2, 5):  # an error of 2^(rungs (order + 1)) tolerances, less what 0.1 of a rung keeps back
            stands, pace = control.after(StepSizeState(1.0), 1e-3 * 2.0 ** ((order + 1) * (rungs - 0.2)), order)
            assert (stands, pace) == (False, StepSizeState(0.5**rungs, -rungs, 2))
            stands, pace = control.after(StepSizeState(1.0), 1e-3 * 2.0 ** ((order + 1) * (rungs - 0.05)), order)
            assert (stands, pace.rung) == (False, -rungs - 1)
    stands, pace = control.after(StepSizeState(1.0), 1.0000001e-3, 1)
    assert (stands, pace.rung) == (False, -1)
    assert control.after(StepSizeState(1.0), 1e-3, 1)[0]


def test_steps_grow_after_good_ones_only() -> None:
    control = AdaptiveStep(1e-3)
    pace = StepSizeState(0.5, -1, 2)
    for waiting in (1, 0):
        stands, pace = control.after(pace, 1e-9, 1)
        assert (stands, pace) == (True, StepSizeState(0.5, -1, waiting))
    stands, pace = control.after(pace, 1e-9, 1)
    assert (stands, pace) == (True, StepSizeState(1.0, 0, 1))
    assert control.after(StepSizeState(1.0, 0, 0), 0.19e-3, 1)[1].step == 2.0  # below 0.8/4 of the tolerance
    assert control.after(StepSizeState(1.0, 0, 0), 0.21e-3, 1)[1].step == 1.0
    assert control.after(StepSizeState(1.0, 0, 2), 0.21e-3, 1)[1] == StepSizeState(1.0, 0, 1)


def test_limits_of_adaptive_steps() -> None:
    control = AdaptiveStep(1e-3, first_step=0.1, least=0.05, most=0.4)
    kept, rejected = paced(control, 1e-9, 1, 20)
    assert max(kept) == 0.4  # and not 0.8
    assert not rejected
    kept, rejected = paced(control, 1e9, 1, 20)
    assert min(kept) == 0.05  # a step that cannot be smaller stands
    assert AdaptiveStep(1e-3, first_step=0.1, most=0.79).after(StepSizeState(0.4, 2, 0), 0.0, 1)[1].step == 0.4
    assert control.smaller(StepSizeState(0.1)) == StepSizeState(0.05, -1, 2)
    assert control.smaller(StepSizeState(0.05, -1)) is None
    # Down by fewer rungs where the least step does not allow more.
    assert AdaptiveStep(1e-3, least=0.2).after(StepSizeState(1.0), 1e6, 1) == (False, StepSizeState(0.25, -2, 2))
    deep = AdaptiveStep(1e-3, first_step=1.0)
    assert deep.smaller(StepSizeState(0.5**20, -20)) is None
    assert deep.smaller(StepSizeState(0.5**19, -19)) == StepSizeState(0.5**20, -20, 2)


def test_first_steps() -> None:
    assert AdaptiveStep(1e-3).first(2.0) == StepSizeState(2e-3)
    assert AdaptiveStep(1e-3, most=1e-3).first(2.0) == StepSizeState(1e-3)
    assert AdaptiveStep(1e-3, first_step=0.3).first(2.0) == StepSizeState(0.3)
    assert AdaptiveStep(1e-3, least=0.01).first(2.0) == StepSizeState(0.01)
    assert AdaptiveStep(1e-3, least=3.0).first(2.0) == StepSizeState(2.0)
    assert AdaptiveStep(1e-3, first_step=3.0).first(2.0) == StepSizeState(2.0)
    assert FixedStep(0.5).first(0.5) == StepSizeState(0.5)
    with pytest.raises(ProblemError, match="longer than the whole"):
        FixedStep(0.5).first(0.49)
    for wrong in (0.0, -1.0, math.inf):
        with pytest.raises(ProblemError, match="positive and finite"):
            FixedStep(wrong)
        with pytest.raises(ProblemError, match="positive and finite"):
            AdaptiveStep(1e-3, first_step=wrong)
    for rtol in (0.0, 1.0):
        with pytest.raises(ProblemError, match="between 0 and 1"):
            AdaptiveStep(rtol)
    assert AdaptiveStep(1e-3, least=0.1, most=0.1).least == 0.1


def test_a_fixed_step_that_failed_is_halved_and_comes_back() -> None:
    control = FixedStep(1.0, halvings=3)
    pace, lengths = control.first(10.0), []
    assert control.after(pace, None, 1) == (True, pace)
    while (smaller := control.smaller(pace)) is not None:
        pace = smaller
        lengths.append(pace.step)
    assert lengths == [0.5, 0.25, 0.125]
    steps = []
    while pace.rung:
        steps.append(pace.step)
        stands, pace = control.after(pace, None, 1)
        assert stands
    assert pace.step == 1.0
    assert steps == [0.125] * 2 + [0.25] * 2 + [0.5] * 2


def crept(scheme: Scheme, step: float | AdaptiveStep) -> tuple[History, Array, Array]:
    """A viscous block of stiffness 3 on a spring of 2 under a sudden load, with the exact displacement and velocity."""
    problem = bodies.column(hv.Compliance(2.0), 3.0, viscous=0.6, tractions={"bottom": (0.0, -0.1)})
    history = march(Evolution(problem), 1.0, step=step, scheme=scheme, save=hv.evolution.Save(every=1e-9))
    fading = np.exp(-history.times * 5.0 / 0.6)
    return history, 0.1 / 5.0 * (1.0 - fading), 0.1 / 0.6 * fading


@pytest.mark.parametrize("scheme", [Midpoint(), SDIRK2()])
def test_velocities_without_mass_forget_the_start(scheme: Scheme) -> None:
    """A body without mass has no initial velocity, whatever stands there: 0, where the exact one is 0.167."""
    off = []
    for step in (0.04, 0.02):
        history, _, velocity = crept(scheme, step)
        found = np.array([-frame.velocity[0, 1] for frame in history.frames])
        off.append(np.abs(found - velocity)[history.times > 0.19].max())
    assert off[0] < 0.002
    assert off[1] < off[0] / 3.0


@pytest.mark.parametrize("scheme", [Midpoint(), SDIRK2()])
def test_adaptive_steps_without_mass_are_few(scheme: Scheme) -> None:
    history, place, _ = crept(scheme, AdaptiveStep(1e-3))
    assert len(history.times) < 90
    assert np.abs(history["penetration"] - place).max() < 1e-3 * place[-1]


def test_adaptive_steps_go_on_after_a_support_that_stops_at_once() -> None:
    """Velocities jump there, whatever the step: steps became shorter until none could be solved."""
    problem = bodies.strip(
        hv.Compliance(20.0),
        (2, 1),
        size=(1.0, 0.5),
        density=1.0,
        viscosity=(0.2, 0.2),
        supports={"top": hv.Fixed(y=Formula("-0.1*min(t, 0.1)"))},
        body_force=(0.2, 0.0),
    )
    evolution = Evolution(problem, inertia=True, velocity=lambda x: np.array([0.0, -0.1]) + 0.0 * x)
    history = march(evolution, 0.2, step=AdaptiveStep(2e-3))
    assert history.finished, history.messages
    assert said_of(history) == ()
    assert 0.1 in history.times
    assert len(history.times) < 200
    fine = march(evolution, 0.2, step=1e-3).frames[-1].displacement
    np.testing.assert_allclose(history.frames[-1].displacement, fine, atol=0.03 * np.abs(fine).max())


def test_a_body_that_jumps_at_the_start_is_marched_all_the_same() -> None:
    """Nothing slows its rigid motion down, so that no step is short enough: steps that could not be solved ended it."""
    springs = hv.Contact(hv.Compliance(1000.0))
    problem = bodies.strip(
        springs,
        (4, 2),
        size=(1.0, 0.5),
        lame=(100.0, 100.0),
        viscosity=(1.0, 1.0),
        supports={"left": hv.Fixed(x=0.0)},
        tractions={"top": (0.0, -2.0)},
    )
    history = march(Evolution(problem), 0.05, step=AdaptiveStep(1e-2))
    assert history.finished, history.messages
    message, added = said_of(history)
    assert message.startswith("the tolerance of steps was missed first in the step to t = ")
    assert "which cannot be shorter" in message
    assert added.startswith("rtol bounds the error of one step")
    assert f"{100.0 * history['contact_error_sum'][-1]:.2g} % of the displacements" in added
    assert history["step"][history["step"] > 0.0].min() == pytest.approx(5e-5 * 2.0**-20)
    fixed = march(Evolution(problem), 0.05, step=5e-4).frames[-1].displacement
    np.testing.assert_allclose(history.frames[-1].displacement, fixed, atol=0.01 * np.abs(fixed).max())


@pytest.mark.slow
def test_errors_of_steps_are_summed() -> None:
    """Of rate-and-state friction on a spring, against steps forty times as exact; rtol bounds one step only."""
    evolution = VelocityStep().evolution(modulus=35.0)
    rtol, end = 4e-3, 3e6
    coarse, fine = (
        march(evolution, end, step=AdaptiveStep(one, first_step=end / 500.0), scheme=SDIRK2())
        for one in (rtol, rtol / 40.0)
    )
    bodies = coarse.state.body.displacement, fine.state.body.displacement
    energy = math.sqrt(coarse.discrete.stiffness.energy(bodies[0] - bodies[1]) / fine["elastic"].max())
    moved = float(np.abs(bodies[1]).max() - evolution.displacement(np.array([[0.0, 1.0]])).max())  # type: ignore[operator]
    slid = float(np.abs(coarse.state.local.displacement - fine.state.local.displacement).max()) / moved
    for name, off in (("error_sum", energy), ("contact_error_sum", slid)):
        sums = coarse[name]
        assert sums[0] == 0.0
        assert (np.diff(sums) >= 0.0).all()
        assert (np.diff(sums) <= rtol).all()
        assert off < sums[-1] < 12.0 * off
        assert fine[name][-1] < 0.2 * sums[-1]
    assert coarse["contact_error_sum"][-1] > 3.0 * rtol
    assert "error_sum" not in march(evolution, 1e4, step=1e4).columns
