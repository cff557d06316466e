"""Supports and gaps whose speed jumps: the body takes the blow and goes on at the new one, whatever the scheme."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import null_space

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Checkpoint, Evolution, March, Scheme, march
from hemivar.evolution.discrete import ExternalData, discretize_evolution
from hemivar.evolution.initial import apply_impulse, velocity_discontinuity
from hemivar.evolution.march import marching
from hemivar.evolution.stepper import TimeStepper
from hemivar.evolution.thermal_stepper import ThermalStepper, stepper_of
from hemivar.formula import Formula
from hemivar.mechanics.thermal import Heat
from hemivar.solvers import Controls
from tests import bodies
from tests.evolution.messages import said_of
from tests.samples import slow

SPRING, PERIOD, BOUND = 60.0, 0.3, 0.05
SCHEMES = (hv.evolution.Newmark(), hv.evolution.GeneralizedAlpha(), hv.evolution.Midpoint())
#: Where the speed of the top (along, across) and of the gap jumps.
TOP, DOWN, SINKS, END = 0.4, 0.7, 0.5, 1.0


def dragged(**more: Any) -> Evolution:
    """A body pressed on springs, whose top is dragged, stops and goes down, and whose foundation sinks."""
    problem = bodies.strip(
        hv.Contact(hv.Compliance(SPRING), gap=Formula(f"-0.01 + 0.02*max(0, t - {SINKS})")),
        (4, 2),
        size=(1.0, 0.5),
        lame=(50.0, 40.0),
        density=1.0,
        viscosity=(0.02, 0.02),
        branches=[hv.materials.Branch(lame=(0.0, 10.0), time=PERIOD)],
        supports={"top": hv.Fixed(x=Formula(f"0.03*min(t, {TOP})"), y=Formula(f"-0.02*max(0, t - {DOWN})"))},
    )
    return Evolution(problem, inertia=True, **more)


@cache
def exact() -> tuple[Array, Array, float]:
    """Displacement and velocity (n,) at the end by DOP853, blows by the mass matrix; the work from outside."""
    discrete = discretize_evolution(dragged())
    assert discrete.mass is not None
    assert discrete.viscosity is not None
    n, held = discrete.unknowns, discrete.data_at(0.0).prescribed.size
    K, C, M = discrete.stiffness, discrete.viscosity, discrete.mass
    ((_, B),) = discrete.branches
    inverse, contact = np.linalg.inv(M.inner.toarray()), discrete.problem.contact

    def speed(t: float) -> Array:
        """Of the top just after a time."""
        return (discrete.data_at(t + 1e-7).prescribed - discrete.data_at(t).prescribed) / 1e-7

    def rate(t: float, y: Array, acting: ExternalData, begun: float, top: Array, sinks: Array) -> Array:
        """Between two kinks: places of the top and the foundation are lines in time, and no load acts."""
        u, v, h = y[:n], y[n : 2 * n], y[2 * n : -1]
        x, w = np.concatenate([u, acting.prescribed + (t - begun) * top]), np.concatenate([v, top])
        r = (contact.trace @ u).reshape(acting.offset.shape) - acting.offset - (t - begun) * sinks
        push = np.zeros_like(r)
        push[:, 0] = SPRING * np.maximum(r[:, 0], 0.0)
        force = acting.load - K.times(x) - C.times(w) - B.times(h)
        a = inverse @ (force[:n] - discrete.problem.contact_force(push))
        pull = M.times(np.concatenate([a, np.zeros(held)])) - force
        return np.concatenate([v, a, w - h / PERIOD, [pull[n:] @ top - contact.weights @ (push * sinks)[:, 0]]])

    ends, work = (0.0, TOP, SINKS, DOWN, END), 0.0
    y, before = np.zeros(2 * n + n + held + 1), speed(0.0)
    for start, end in pairwise(ends):
        acting = discrete.data_at(start)
        top, sinks = speed(start), (discrete.data_at(end).offset - acting.offset) / (end - start)
        change = np.concatenate([np.zeros(n), top - before])
        change[:n] = -inverse @ M.times(change)[:n]
        old = np.concatenate([y[n : 2 * n], before])
        work += M.energy(old + change) - M.energy(old)
        y[n : 2 * n] += change[:n]
        y = solve_ivp(
            rate, (start, end), y, args=(acting, start, top, sinks), method="DOP853", rtol=1e-9, atol=1e-12
        ).y[:, -1]
        before = top
    return y[:n], y[n : 2 * n], work + float(y[-1])


@pytest.mark.parametrize("scheme", [SCHEMES[0], *map(slow, SCHEMES[1:])], ids=lambda scheme: scheme.name)
def test_where_speeds_jump_schemes_stay_of_their_order(scheme: Scheme) -> None:
    """And the blows are work of the supports: nothing is lost by them."""
    place, velocity, work = exact()
    n, off = place.size, []
    for count in (300, 600):
        state = march(dragged(), END, step=END / count, scheme=scheme).state
        ledger, size = state.ledger, np.abs(velocity).max()
        off.append(
            [
                np.abs(state.body.displacement[:n] - place).max() / np.abs(place).max(),
                np.abs(state.body.velocity[:n] - velocity).max() / size,
                abs(ledger.moved - work) / abs(work),
            ]
        )
        assert state.body.velocity[n:] == pytest.approx(np.tile([0.0, -0.02], 5), abs=1e-9)
        assert abs(ledger.gap) < 1e-12 * ledger.stored
    errors = np.array(off)
    assert (np.log2(errors[0] / errors[1])[:2] > 1.7).all()
    assert (errors[-1] < (3e-3, 3e-2, 8e-3)).all()


@pytest.mark.parametrize(
    ("name", "until"),
    [("body", TOP), ("body", SINKS), ("heat", TOP), slow("body", DOWN), slow("heat", SINKS), slow("heat", DOWN)],
)
def test_after_a_blow_all_forces_balance(name: str, until: float) -> None:
    """The blow changes no momentum of the unknowns; accelerations are those of the new velocities."""
    stated = dragged() if name == "body" else warm()
    state = march(stated, until, step=0.02, scheme=hv.evolution.Newmark()).state
    discrete = discretize_evolution(stated)
    contact, n = discrete.problem.contact, discrete.unknowns
    assert discrete.mass is not None
    advance = stepper_of(discrete, hv.evolution.Newmark(), None, Controls())
    after = apply_impulse(advance, state, 0.02)
    if name == "heat" and until != TOP:
        assert after is state
        return
    body, local = after.body, after.local
    blow = discrete.mass.times(body.velocity - state.body.velocity)[:n]
    assert np.abs(blow).max() < 1e-12
    assert body.displacement is state.body.displacement
    load = discrete.data_at(until).load
    if isinstance(advance, ThermalStepper):
        assert state.heat is not None
        load = load + advance.heat.load(advance.heat.temperature(state.heat.state.body.displacement))
    sinks = np.zeros_like(local.velocity)
    if name == "body":
        sinks[:, 0] = 0.02 * (until >= SINKS)
    np.testing.assert_allclose(
        local.velocity, (contact.trace @ body.velocity[:n]).reshape(sinks.shape) - sinks, atol=1e-9
    )
    push = np.zeros_like(sinks)
    push[:, 0] = SPRING * np.maximum(local.displacement[:, 0], 0.0)
    if name == "heat":
        push[:, 1] = BOUND * np.sign(local.velocity[:, 1])
    left = load - discrete.stiffness.times(body.displacement) - discrete.mass.times(body.acceleration)
    if discrete.viscosity is not None:
        left -= discrete.viscosity.times(body.velocity)
    for h, (_, branch) in zip(state.branches, discrete.branches, strict=True):
        left -= branch.times(h)
    left = left[:n] - discrete.problem.contact_force(push)
    assert np.abs(left).max() < 1e-9 * np.abs(discrete.stiffness.times(body.displacement)).max()
    assert np.abs(body.acceleration[n:]).max() < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES, ids=lambda scheme: scheme.name)
def test_adaptive_steps_go_on_where_speeds_jump(scheme: Scheme) -> None:
    history = march(dragged(), END, step=hv.evolution.AdaptiveStep(1e-3, first_step=0.01), scheme=scheme)
    place, *_ = exact()
    assert history.ended == "finished"
    assert all(one.startswith("rtol bounds the error of one step") for one in said_of(history))
    assert len(history.steps) < 2500
    assert np.abs(history.state.body.displacement[: place.size] - place).max() < 3e-3 * np.abs(place).max()


SHAKES = "0.02*sin(6*t) + 0.02*abs(t - 0.5) - 0.01"


def shaken_foundation(tilt: float = 0.0) -> Evolution:
    """A body that is glued along its normal to a foundation which shakes, from a blow at the start on."""
    mesh = hv.rectangle((1.0, 0.5), (4, 2))
    c, s = np.cos(tilt), np.sin(tilt)
    problem = hv.ContactProblem(
        mesh=replace(mesh, parent=None, points=mesh.points @ np.array([[c, s], [-s, c]])),
        material=hv.Material.lame(50.0, 40.0, density=1.0, viscosity=(0.1, 0.1)),
        contact={"bottom": hv.Contact(hv.laws.Bilateral(), gap=Formula(SHAKES))},
    )
    return Evolution(problem, inertia=True)


@cache
def shaken_exactly() -> tuple[Array, Array]:
    """Displacement and velocity (nodes, 2) at the end by DOP853, on what the foundation leaves free."""
    discrete = discretize_evolution(shaken_foundation())
    assert discrete.mass is not None
    assert discrete.viscosity is not None
    K, C, M = (part.inner.toarray() for part in (discrete.stiffness, discrete.viscosity, discrete.mass))
    B = discrete.problem.contact.trace.toarray()[0::2]
    one, Z = np.linalg.pinv(B) @ np.ones(len(B)), null_space(B)
    small = Z.T @ M @ Z

    def way(t: float, sign: float) -> tuple[float, float, float]:
        sine, cosine = np.sin(6.0 * t), np.cos(6.0 * t)
        return 0.02 * (sine + abs(t - 0.5)) - 0.01, 0.12 * cosine + 0.02 * sign, -0.72 * sine

    def rate(t: float, y: Array, sign: float) -> Array:
        g, h, a = way(t, sign)
        z, w = np.split(y, 2)
        force = K @ (one * g + Z @ z) + C @ (one * h + Z @ w) + M @ one * a
        return np.concatenate([w, -np.linalg.solve(small, Z.T @ force)])

    def blow(speed: float) -> Array:
        return np.concatenate([np.zeros(len(small)), -np.linalg.solve(small, Z.T @ M @ one) * speed])

    y = blow(way(0.0, -1.0)[1])
    for begin, end, sign in ((0.0, 0.5, -1.0), (0.5, END, 1.0)):
        y = y + blow(0.04) if begin else y
        y = solve_ivp(rate, (begin, end), y, args=(sign,), method="DOP853", rtol=1e-9, atol=1e-12).y[:, -1]
    z, w = np.split(y, 2)
    g, h, _ = way(END, 1.0)
    return discrete.full(one * g + Z @ z), discrete.full(one * h + Z @ w)


@pytest.mark.parametrize(
    ("scheme", "tilt"),
    [(SCHEMES[0], 0.4), slow(SCHEMES[0], 0.0), *(slow(scheme, tilt) for scheme in SCHEMES[1:] for tilt in (0.0, 0.4))],
    ids=lambda value: value.name if isinstance(value, Scheme) else None,
)
def test_a_foundation_that_holds_the_body_takes_it_along_at_once(scheme: Scheme, tilt: float) -> None:
    off = []
    for count in (300, 600):
        history = march(shaken_foundation(tilt), END, step=END / count, scheme=scheme)
        state = history.state
        back = np.array([[np.cos(tilt), -np.sin(tilt)], [np.sin(tilt), np.cos(tilt)]])
        found = [history.discrete.full(part) @ back for part in (state.body.displacement, state.body.velocity)]
        off.append(
            [np.abs(one - two).max() / np.abs(two).max() for one, two in zip(found, shaken_exactly(), strict=True)]
        )
        assert np.abs(state.local.velocity[:, 0]).max() < 1e-8
        assert abs(state.ledger.gap) < 1e-10 * state.ledger.stored
        assert abs(state.ledger.numerical) < 0.3 * state.ledger.moved
    errors = np.array(off)
    assert (np.log2(errors[0] / errors[1]) > 1.7).all()
    assert (errors[1] < 0.01).all()


def test_an_impulse_that_is_not_found_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hemivar.evolution.initial._BLOW_STEPS", 1)
    with pytest.raises(hv.errors.ProblemError, match=r"t = 0 the impulse of the foundation .* could not be computed"):
        march(shaken_foundation(), END, step=0.05, scheme=hv.evolution.Newmark())


def warm() -> Evolution:
    """The same body, which friction and its deformation heat and heat stretches."""
    problem = bodies.strip(
        hv.Contact(hv.Compliance(SPRING), hv.Tresca(BOUND)),
        (4, 2),
        size=(1.0, 0.5),
        lame=(50.0, 40.0),
        density=1.0,
        supports={"top": hv.Fixed(x=Formula(f"0.03*min(t, {TOP})"), y=-0.01)},
    )
    heat = Heat(1e-2, 1.0, expansion=1e-2, coupling=300.0, temperature=5.0, supports={"top": 0.0})
    return Evolution(problem, inertia=True, heat=heat)


@pytest.mark.parametrize("stated", [dragged, slow(warm)], ids=["body", "heat"])
def test_a_march_goes_on_from_a_kink_bit_for_bit(stated: Callable[[], Evolution], tmp_path: Path) -> None:
    kept = Checkpoint(tmp_path / "kept.npz", 0.0)
    plan = March(0.6, step=0.05, scheme=hv.evolution.Newmark())
    whole = march(stated(), 0.6, step=0.05, scheme=hv.evolution.Newmark())
    steps = marching(stated(), replace(plan, checkpoint=kept))
    assert any(step.state.time == TOP for step in steps)  # ends it there
    resumed = march(stated(), 0.6, step=0.05, scheme=hv.evolution.Newmark(), checkpoint=kept, resume=True)
    assert len(resumed.steps) == len(whole.steps)
    for part in ("displacement", "velocity", "acceleration"):
        assert getattr(resumed.state.body, part).tobytes() == getattr(whole.state.body, part).tobytes()
    assert resumed.state.ledger == whole.state.ledger
    assert whole["kinetic"][-1] > 0.0


def test_paths_that_jump_themselves_are_left_alone() -> None:
    """No rate belongs to a place that jumps; smooth paths, at rest or turning, have no kink."""

    def kinks(path: str, at: float) -> bool:
        problem = bodies.strip(
            hv.Compliance(SPRING),
            (2, 1),
            size=(1.0, 0.5),
            lame=(50.0, 40.0),
            density=1.0,
            supports={"top": hv.Fixed(x=Formula(path), y=0.0)},
        )
        discrete = discretize_evolution(Evolution(problem, inertia=True))
        found = velocity_discontinuity(TimeStepper.of(discrete, hv.evolution.Newmark(), None, Controls()), at, 0.01)
        return found is not None

    assert kinks("0.1*abs(t - 0.5)", 0.5)
    assert kinks("1e3 + 1e-6*max(0, t - 0.5)", 0.5)
    for smooth in ("sin(9*t)", "(t - 0.5)**2", "max(0, t - 0.5)**2", "1e3 + 0*t", "cos(t - 0.5)", "0.3*t", "exp(20*t)"):
        assert not kinks(smooth, 0.5), smooth
    assert not kinks("max(0, min(1, 1e9*(t - 0.5) + 0.5))", 0.5)
