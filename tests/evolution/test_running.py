"""What a march does with steps that fail, what it tells while it goes, which frames it keeps, how it looks back."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import AdaptiveStep, Evolution, FixedStep, History, March, Save, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.evolution_problem import Mass
from hemivar.evolution.initial import initial_state
from hemivar.evolution.march import Backend, marching
from hemivar.evolution.margin import step_error
from hemivar.evolution.schemes import Scheme
from hemivar.evolution.state import TimeState
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.solvers import Controls, Status
from tests import bodies
from tests.evolution.messages import said_of

KAPPA, VISCOUS = 3.0, 0.6


def pulled_spring(**more: Any) -> Evolution:
    """``3 u + 0.6 u' = 1``: a unit square between rollers, held at its top, pulled at its bottom."""
    options = {"start": more.pop("start", 0.0)}
    given: dict[str, Any] = {
        "mesh": hv.rectangle((1.0, 1.0), 1),
        "material": hv.Material.lame(0.0, 0.5 * KAPPA, viscosity=(0.0, 0.5 * VISCOUS)),
        "supports": {"left": hv.Roller(), "right": hv.Roller(), "top": hv.Fixed(y=0.0)},
        "tractions": {"bottom": (0.0, -1.0)},
        "contact": {"bottom": hv.Contact(hv.laws.NoContact())},
    }
    return Evolution(hv.ContactProblem(**given | more), **options)


class Stubborn(TimeStepper):
    """Steps longer than 0.03 that end between 0.25 and 0.35 fail."""

    most = 0.03
    status = Status.STALLED

    def take(self, before: TimeState, step: float, *rest: Any, **more: Any) -> StepResult:
        taken = super().take(before, step, *rest, **more)
        if step <= self.most or not 0.25 < taken.state.time < 0.35:
            return taken
        return replace(taken, solutions=(replace(taken.solutions[0], status=self.status),))


class Never(Stubborn):
    most = 0.0


class Interrupted(Never):
    status = Status.INTERRUPTED


def through(plan: March, kind: type[TimeStepper]) -> History:
    steps = marching(pulled_spring(), plan, tools=Backend(stepper=kind.of))
    while True:
        try:
            next(steps)
        except StopIteration as end:
            found: History = end.value
            return found


def test_a_step_that_fails_is_halved_until_it_does_not_and_grows_again() -> None:
    history = through(March(1.0, step=0.1), Stubborn)
    assert history.finished
    steps = np.diff(history.times)
    small = steps < 0.0999
    inside = (history.times[1:] > 0.25) & (history.times[1:] < 0.35)
    assert (steps[inside] <= 0.03).all()
    assert steps.min() == pytest.approx(0.025)
    assert small.sum() <= 8
    assert steps[:2] == pytest.approx(0.1)
    assert steps[-2] == pytest.approx(0.1)
    assert history.times[-1] == 1.0
    assert not said_of(history)


def test_a_step_that_cannot_be_solved_ends_the_march_where_it_is() -> None:
    for step in (FixedStep(0.1, halvings=2), AdaptiveStep(0.5, first_step=0.1, least=0.02, most=0.1)):
        history = through(March(1.0, step=step), Never)
        assert history.ended == Status.STALLED.value
        assert history.state.time <= 0.25 + 1e-12
        (message,) = said_of(history)
        assert f"t = {history.state.time:g}" in message
        assert Status.STALLED.remedy in message
        assert history.frames[-1].time == history.state.time


def test_a_step_that_is_interrupted_says_nothing_of_the_evolution() -> None:
    """So that the messages of a march that is resumed are those of one that never stopped."""
    history = through(March(1.0, step=0.1), Interrupted)
    assert history.ended == Status.INTERRUPTED.value
    assert not said_of(history)


def test_what_is_told_while_it_goes() -> None:
    told = []
    steps = marching(pulled_spring(start=2.0), March(3.0, step=0.25, save=Save(0.5)))
    for one in steps:
        told.append(one)
    assert [one.done for one in told] == pytest.approx([0.25, 0.5, 0.75, 1.0])
    assert [one.row.time for one in told] == pytest.approx([2.25, 2.5, 2.75, 3.0])
    assert [one.frame is None for one in told] == [True, False, True, False]
    assert [len(one.earlier) for one in told] == [1, 0, 0, 0]
    ((number, first),) = told[0].earlier
    assert (number, first.time) == (0, 2.0)


@pytest.mark.parametrize("start", [0.0, 1.0])
def test_frames_that_are_kept(start: float) -> None:
    """The first at or after each multiple of the time between them; or at most so many, evenly spread."""
    times = [
        frame.time - start for frame in march(pulled_spring(start=start), start + 1.0, step=0.1, save=Save(0.25)).frames
    ]
    assert times == pytest.approx([0.0, 0.3, 0.5, 0.8, 1.0])
    times = [
        frame.time - start for frame in march(pulled_spring(start=start), start + 1.0, step=0.1, save=Save(0.3)).frames
    ]
    assert times == pytest.approx([0.0, 0.3, 0.6, 0.9, 1.0])  # the last one always
    for most, wanted in ((200, 11), (11, 11), (10, 6), (5, 4), (2, 2)):
        history = march(pulled_spring(start=start), start + 1.0, step=0.1, save=Save(most=most))
        times = [frame.time - start for frame in history.frames]
        assert len(times) <= most
        assert len(times) == wanted
        assert times[0] == 0.0
        assert times[-1] == pytest.approx(1.0) or most < 10
        assert len(set(np.round(np.diff(times[:-1]), 9))) <= 1


def test_frames_after_steps_that_were_longer_than_the_time_between_them() -> None:
    """What long steps have leapt over is not made up for by frames of the short ones that follow."""
    times = [
        frame.time for frame in march(pulled_spring(), 1.0, step=0.4, save=Save(0.1), stops=(0.85, 0.86, 0.87)).frames
    ]
    assert times == pytest.approx([0.0, 0.4, 0.8, 1.0])
    times = [
        frame.time for frame in march(pulled_spring(), 1.0, step=0.4, save=Save(0.1), stops=(0.85, 0.92, 0.95)).frames
    ]
    assert times == pytest.approx([0.0, 0.4, 0.8, 0.92, 1.0])


def test_looking_back() -> None:
    assert len(march(pulled_spring(), 1.0, step=0.4, save=Save(5e-324)).frames) == 4  # every step
    history = march(pulled_spring(), 1.0, step=0.1, save=Save(0.25))
    frame = history.at(0.4)
    wanted = 0.5 * (history.frames[1].displacement + history.frames[2].displacement)  # of 0.3 and 0.5
    np.testing.assert_allclose(frame.displacement, wanted, atol=1e-15)
    assert frame.time == 0.4
    for known in history.frames:
        assert history.at(known.time) is known
    for outside in (-0.01, 1.01):
        with pytest.raises(ProblemError, match="outside"):
            history.at(outside)
    assert history.residual == max(history["residual"][1:])
    assert history.margin == 1.0
    assert history.finished
    assert "10 steps to t = 1" in repr(history)
    np.testing.assert_array_equal(history.table["time"], history.times)
    with pytest.raises(ProblemError, match="no column 'nothing'"):
        history["nothing"]


def test_stops_are_met_once() -> None:
    history = march(pulled_spring(), 1.0, step=0.3, stops=(0.45, 0.45, 2.0, -1.0, 0.0, 1.0))
    assert history.times == pytest.approx([0.0, 0.3, 0.45, 0.75, 1.0])
    assert 0.45 in history.times
    assert history.times[-1] == 1.0
    nearly = march(pulled_spring(), 1.0, step=0.1).times  # ten times a tenth is not one
    assert len(nearly) == 11
    assert nearly[-1] == 1.0


def test_the_estimate_of_an_error_is_the_error() -> None:
    """Of implicit Euler ``tau^2 u''/2`` in the energy norm, and the largest displacement since the start."""
    discrete = discretize_evolution(pulled_spring())
    advance = TimeStepper.of(discrete, hv.evolution.ImplicitEuler(), None, Controls())
    state, tau = initial_state(advance), 1e-4
    origin = state.body.displacement
    for _ in range(3):
        before, taken = state, advance.take(state, tau)
        state = taken.state
    found = step_error(advance, taken, origin)
    u0, u1 = (np.abs(one.body.displacement).max() for one in (before, state))
    exact = 1.0 / KAPPA + (u0 - 1.0 / KAPPA) * math.exp(-KAPPA / VISCOUS * tau)
    assert found.energy == pytest.approx(math.sqrt(KAPPA) * abs(exact - u1), rel=2e-3)
    assert found.slid == pytest.approx(abs(exact - u1), rel=2e-3)
    assert found.size == pytest.approx(math.sqrt(KAPPA) * u1, rel=1e-9)
    assert found.displacement == pytest.approx(u1, rel=1e-12)
    assert found.relative(2.0, 4.0) == (found.energy / 2.0, found.slid / 4.0)
    assert found.relative(0.0, 0.0) == (0.0, 0.0)
    shifted = step_error(advance, taken, origin + 0.25)
    assert shifted.displacement == pytest.approx(0.25, abs=1.01 * u1)


def test_the_estimate_with_mass_is_half_the_distance_from_the_prediction() -> None:
    problem = pulled_spring(material=hv.Material.lame(0.0, 1.5, density=2.0)).problem
    discrete = discretize_evolution(Evolution(problem, inertia=True))
    advance = TimeStepper.of(discrete, hv.evolution.Newmark(), None, Controls())
    state, tau = initial_state(advance), 0.05
    for _ in range(3):
        before, taken = state, advance.take(state, tau)
        state = taken.state
    assert discrete.mass is not None
    K, M = discrete.stiffness.inner.toarray(), discrete.mass.inner.toarray()
    u: Array = state.body.displacement - before.body.displacement - tau * before.body.velocity
    u = 0.5 * (u - 0.5 * tau**2 * before.body.acceleration)
    v = 0.5 * (state.body.velocity - before.body.velocity - tau * before.body.acceleration)
    found = step_error(advance, taken, 0.0 * u)
    assert found.energy == pytest.approx(math.sqrt(u @ K @ u + v @ M @ v), rel=1e-9)
    whole = state.body.displacement @ K @ state.body.displacement + state.body.velocity @ M @ state.body.velocity
    assert found.size == pytest.approx(math.sqrt(whole), rel=1e-9)


def test_the_acceleration_at_the_start_balances_the_forces() -> None:
    """``M w = f - K u - C v - B'W lam``: also of a body that is deformed, moves, and is pulled by glue at once."""
    problem = bodies.square(
        hv.Contact(hv.Compliance(5.0), gap=-0.1),
        2,
        lame=(1.0, 1.5),
        density=2.0,
        viscosity=(0.1, 0.2),
        supports={"top": hv.Clamped()},
        body_force=(0.3, -0.7),
    )
    evolution = Evolution(
        problem, inertia=True, displacement=lambda x: 0.1 * (1.0 - x[:, 1:]) * [1.0, 0.5],
        velocity=lambda x: (1.0 - x[:, 1:]) * [0.2, -1.0],
    )  # fmt: skip
    discrete = discretize_evolution(evolution)
    state = initial_state(TimeStepper.of(discrete, hv.evolution.Newmark(), None, Controls()))
    assert discrete.mass is not None
    assert discrete.viscosity is not None
    inertial = discrete.mass.times(state.body.acceleration)
    lam = state.multiplier
    assert lam[:, 0] == pytest.approx(5.0 * 0.05, rel=1e-9)
    pressed = discrete.problem.contact_force(lam)
    inner = discrete.stiffness.times(state.body.displacement) + discrete.viscosity.times(state.body.velocity)
    n = discrete.unknowns
    np.testing.assert_allclose((inertial + inner)[:n] + pressed, discrete.data_at(0.0).load[:n], atol=1e-10)
    trace = np.asarray(discrete.problem.contact.trace @ state.body.acceleration[:n]).reshape(lam.shape)
    np.testing.assert_allclose(state.local.acceleration, trace, atol=1e-12)
    assert state.local.velocity[:, 0] == pytest.approx(1.0)
    assert state.local.displacement[:, 0] == pytest.approx(0.05)
    ledger = state.ledger
    assert ledger.kinetic == pytest.approx(discrete.mass.energy(state.body.velocity))
    assert ledger.contact == pytest.approx(2.5 * 0.05**2)
    assert ledger.start == pytest.approx(ledger.elastic + ledger.kinetic + ledger.contact)


@pytest.mark.parametrize(
    "scheme",
    [hv.evolution.ImplicitEuler(), hv.evolution.Midpoint(), hv.evolution.Newmark(), hv.evolution.GeneralizedAlpha(0.8)],
)
def test_a_body_that_sets_out_with_its_support_is_the_body_at_rest(scheme: Scheme) -> None:
    """Who moves along at a constant speed sees a body that hangs from a support at rest and swings."""
    found, speed = [], 0.3
    for pace in (0.0, speed):
        problem = bodies.square(
            hv.Compliance(8.0),
            2,
            density=1.0,
            supports={"top": hv.Prescribed(lambda x, t, pace=pace: np.tile([pace * t, 0.0], (len(x), 1)))},
            body_force=(0.0, -1.0),
        )
        evolution = Evolution(problem, inertia=True, velocity=(pace, 0.0))
        found.append(march(evolution, 1.0, step=0.05, scheme=scheme, save=Save(0.05)))
    for at_rest, moving in zip(found[0].frames, found[1].frames, strict=True):
        along = np.array([speed, 0.0])
        np.testing.assert_allclose(moving.displacement, at_rest.displacement + moving.time * along, atol=1e-9)
        np.testing.assert_allclose(moving.velocity, at_rest.velocity + along, atol=1e-7)
        np.testing.assert_allclose(moving.multiplier, at_rest.multiplier, atol=1e-7)
    np.testing.assert_allclose(found[1]["elastic"], found[0]["elastic"], atol=1e-9)


@pytest.mark.parametrize(
    ("scheme", "normal", "mass", "told"),
    [
        (hv.evolution.Newmark(), hv.Signorini(), "consistent", True),
        (hv.evolution.GeneralizedAlpha(), hv.Adhesive(5.0, 1.0, 2.0), "consistent", True),
        (hv.evolution.Midpoint(), hv.Signorini(), "consistent", True),
        (hv.evolution.Newmark(), hv.Signorini(), "redistributed", False),
        (hv.evolution.Newmark(), hv.Compliance(4.0), "consistent", False),
        (hv.evolution.Midpoint(), hv.laws.Bilateral(), "consistent", False),
        (hv.evolution.Newmark(), hv.laws.Bilateral(), "redistributed", False),
        (hv.evolution.ImplicitEuler(), hv.Signorini(), "consistent", False),
        (hv.evolution.MoreauJean(), hv.Signorini(), "consistent", False),
    ],
)
def test_a_scheme_for_springs_says_that_it_rings_on_a_rigid_obstacle(
    scheme: Scheme, normal: hv.laws.Superpotential, mass: str, told: bool
) -> None:
    problem = bodies.square(normal, 2, density=1.0, supports={}, body_force=(0.0, -1.0))
    history = march(Evolution(problem, inertia=True, mass=Mass(mass)), 0.02, step=0.02, scheme=scheme)
    assert ["rigid" in message and scheme.name in message for message in said_of(history)] == [True] * told


@pytest.mark.parametrize(
    "scheme", [hv.evolution.ImplicitEuler(), hv.evolution.GeneralizedAlpha(0.8), hv.evolution.MoreauJean()]
)
@pytest.mark.parametrize("velocity", [(0.1, -0.2), (0.0, -1.0)])
def test_a_body_on_which_nothing_acts_flies_on(scheme: Scheme, velocity: tuple[float, float]) -> None:
    """Far from its foundation, thrown, without a load: all forces are rounding, against which nothing can be held."""
    for gap in (1.0, 10.0):
        problem = bodies.square(hv.Contact(hv.Signorini(), gap=gap), 4, lame=(40.0, 40.0), density=1.0, supports={})
        history = march(Evolution(problem, inertia=True, velocity=velocity), 0.1, step=0.02, scheme=scheme)
        assert history.finished, history.messages
        assert not history["normal_force"].any()
        np.testing.assert_allclose(history.frames[-1].displacement, 0.1 * np.tile(velocity, (25, 1)), rtol=1e-12)
        assert history["kinetic"] == pytest.approx(0.5 * float(np.square(velocity).sum()), rel=1e-12)


def set_out(path: Callable[[float], float]) -> TimeState:
    """The first state of a block whose top follows a path, over a foundation that sinks along it."""

    def along(x: Array, t: float) -> Array:
        return np.full(len(x), path(t))

    def below(x: Array, t: float) -> Array:
        return 1.0 + along(x, t)

    problem = bodies.square(
        hv.Contact(hv.Compliance(8.0), gap=below), 2, density=1.0, supports={"top": hv.Fixed(x=along)}
    )
    still = Evolution(problem, inertia=True, displacement=(path(0.0), 0.0))
    return initial_state(TimeStepper.of(discretize_evolution(still), hv.evolution.Newmark(), None, Controls()), 0.1)


@pytest.mark.parametrize(
    ("path", "speed", "push"), [(lambda t: 0.2 * t - 0.3 * t**2, 0.2, -0.6), (lambda t: 0.4 + 2.0 * t, 2.0, 0.0)]
)
def test_supports_and_gaps_set_out_with_the_rates_of_their_paths(
    path: Callable[[float], float], speed: float, push: float
) -> None:
    state = set_out(path)
    assert state.body.velocity[-3:] == pytest.approx(speed, rel=1e-9)
    assert state.body.acceleration[-3:] == pytest.approx(push, abs=1e-7)
    assert state.local.velocity[:, 0] == pytest.approx(-speed, rel=1e-9)


def test_what_jumps_at_the_start_has_no_rate() -> None:
    for path in (lambda t: 0.3 if t > 0.0 else 0.0, lambda t: 0.3 * math.sqrt(t)):
        state = set_out(path)
        assert not state.body.velocity.any()
        assert not state.local.velocity[:, 0].any()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_forces_of_the_foundation_have_a_direction(sign: float) -> None:
    """Sheared by 1 against friction of at most 0.2 on a length of 1: against the slip."""
    evolution = pulled_spring(
        supports={"top": hv.Clamped()},
        tractions={"bottom": (sign, -0.5)},
        contact={"bottom": hv.Contact(hv.Compliance(1e9), hv.Tresca(0.2))},
    )
    history = march(evolution, 0.1, step=0.1)
    assert history["friction_force"][-1] == pytest.approx(-0.2 * sign, rel=1e-6)


def test_what_a_support_moves_is_the_component_that_it_holds() -> None:
    """A top that is lifted, free to slide: the body is stretched by as much, its sides go in."""
    lifted = hv.Fixed(y=lambda x, t: 0.1 * t + 0.0 * x[:, 0])
    evolution = pulled_spring(
        mesh=hv.rectangle((1.0, 1.0), 2),
        material=hv.Material.lame(1.0, 1.0),
        supports={"bottom": hv.Fixed(y=0.0), "left": hv.Fixed(x=0.0), "top": lifted},
        tractions={},
        contact={"right": hv.Contact(hv.laws.NoContact())},
    )
    discrete = discretize_evolution(evolution)
    mesh = discrete.field.mesh
    top = np.flatnonzero(mesh.points[:, 1] == 1.0)
    free = [node for node in top if mesh.points[node, 0] > 0.0]
    assert set(discrete.moved.tolist()) >= {2 * node + 1 for node in top}
    assert not set(discrete.moved.tolist()) & {2 * node for node in free}
    history = march(evolution, 1.0, step=0.5, save=Save(probes={"p": (1.0, 0.5), "q": (0.5, 1.0)}))
    assert history["q.u_y"] == pytest.approx(0.1 * history.times)
    assert history["p.u_x"] == pytest.approx(-0.1 / 3.0 * history.times)  # lam/(lam + 2 mu)


def test_a_tolerance_that_steps_cannot_keep_is_told() -> None:
    """A step at the least length stands whatever its error: nothing said so."""
    told = march(pulled_spring(), 0.4, step=AdaptiveStep(1e-4, first_step=0.2, least=0.1))
    assert told.finished
    message, added = said_of(told)
    assert message.startswith("the tolerance of steps was missed first in the step to t = 0.1,")
    assert added.startswith("rtol bounds the error of one step")
    assert said_of(march(pulled_spring(), 0.4, step=AdaptiveStep(1e-2))) == ()


@pytest.mark.parametrize(("start", "step"), [(0.0, 1e-300), (1e9, 1e-8)])
def test_steps_that_time_does_not_resolve_are_refused(start: float, step: float) -> None:
    """One divided by zero, the other did not end."""
    with pytest.raises(ProblemError, match="too short for times up to"):
        march(pulled_spring(start=start), start + 1.0, step=step, max_time=0.1)


@pytest.mark.parametrize(
    "scheme", [hv.evolution.ImplicitEuler(), hv.evolution.GeneralizedAlpha(0.8), hv.evolution.Newmark()]
)
def test_a_very_short_step_is_as_exact_as_displacements_are(scheme: Scheme) -> None:
    """Its forces are those of differences that rounding hides: with a mass they were too inexact for any tolerance."""
    contact = hv.Contact(hv.Compliance(10.0), hv.Tresca(0.1))
    problem = bodies.square(
        contact, 2, lame=(40.0, 40.0), density=1.0, supports={"top": hv.Clamped()}, body_force=(0.1, -1.0)
    )

    def marched(**stops: Any) -> History:
        return march(Evolution(problem, inertia=True), 0.6, step=0.1, scheme=scheme, **stops)

    whole, parted = marched(), marched(stops=(0.5, 0.500001))
    assert parted.finished, parted.messages
    assert parted.residual < 1e-5
    size = np.abs(whole.frames[-1].displacement).max()
    np.testing.assert_allclose(parted.frames[-1].displacement, whole.frames[-1].displacement, atol=0.02 * size)
    short = marched(stops=(0.5, 0.5 + 1e-11))
    assert not short.finished
    assert "move the stop" in short.messages[-1]


@pytest.mark.parametrize("unit", [1e-299, 1e299])
def test_steps_beyond_the_range_of_numbers_are_refused(unit: float) -> None:
    problem = bodies.square(hv.Compliance(8.0), 1, density=1.0, supports={})
    with pytest.raises(ProblemError, match="state times in another unit"):
        march(Evolution(problem, inertia=True), 10.0 * unit, step=unit)
    told = hv.evolution.When(function=lambda discrete, state: "high", label="level")  # type: ignore[arg-type,return-value]
    with pytest.raises(ProblemError, match="event 'level' gave 'high'; return a number"):
        march(Evolution(problem, inertia=True), 1.0, step=0.5, events=[told])


@pytest.mark.parametrize(
    "scheme",
    [hv.evolution.Newmark(), hv.evolution.Midpoint(), hv.evolution.GeneralizedAlpha(0.8), hv.evolution.ImplicitEuler()],
)
def test_pressures_of_what_is_held_do_not_ring_from_the_start(scheme: Scheme) -> None:
    """From one step to the next they bend less than they change, and nothing is told."""
    problem = bodies.square(
        hv.laws.Bilateral(), 2, lame=(40.0, 40.0), density=1.0, supports={"top": hv.Clamped()}, body_force=(0.0, -1.0)
    )
    history = march(Evolution(problem, inertia=True), 0.2, step=0.01, scheme=scheme)
    force = history["normal_force"][1:]
    assert np.abs(np.diff(force, 2)).max() < 0.5 * np.abs(force).max()
    assert not said_of(history)


@pytest.mark.parametrize(
    "scheme",
    [hv.evolution.Midpoint(), hv.evolution.GeneralizedAlpha(0.5), hv.evolution.Newmark(), hv.evolution.ImplicitEuler()],
    ids=repr,
)
def test_nodes_without_mass_swing_where_forces_balance_within_a_step(scheme: Scheme) -> None:
    """Half a block of mass 1/2 and a side without any, which its weight takes to ``w`` at once, swings as is told."""
    problem = bodies.column(hv.Contact(hv.Signorini(), gap=0.2), 10.0, density=1.0, tractions={"bottom": (0.0, -1.0)})
    evolution = Evolution(problem, inertia=True, mass=Mass.REDISTRIBUTED)
    history = march(evolution, 0.06, step=0.01, scheme=scheme)
    place = -0.2 - history["penetration"]
    rest, told = -0.1, [message for message in history.messages if "oscillate about" in message]
    ratio = {"midpoint": 1.0, "generalized-alpha": 0.5}.get(scheme.name, 0.0)
    np.testing.assert_allclose(place - rest, 0.1 * (-ratio) ** np.arange(7), atol=1e-9)
    assert [f"{ratio:.3g} times as far" in message for message in told] == [True] * (ratio > 0.0)


@pytest.mark.parametrize(
    ("scheme", "told"),
    [(hv.evolution.Midpoint(), True), (hv.evolution.SDIRK2(), False), (hv.evolution.ImplicitEuler(), False)],
)
def test_a_body_without_mass_rings_on_a_rigid_obstacle_with_the_midpoint_rule(scheme: Scheme, told: bool) -> None:
    """Pushed onto it by ``t``, it rests from then on; with the midpoint rule it goes to and fro, as the march says."""
    problem = bodies.column(
        hv.Contact(hv.Signorini(), gap=0.053), 3.0, viscous=0.6, tractions={"bottom": lambda x, t: np.array([0.0, -t])}
    )
    lost = []
    for count in (20, 40):
        history = march(Evolution(problem), 1.0, step=1.0 / count, scheme=scheme)
        ground = np.flatnonzero(history["normal_force"] > 0.0)
        lost.append(history["viscous"][-1] - history["viscous"][ground[0]])
        assert any("an obstacle is rigid" in message for message in said_of(history)) == told
        assert history.ended == ("energy made" if told else "finished")  # velocities that ring are damped
    assert (min(lost) > 1e-5) == told
