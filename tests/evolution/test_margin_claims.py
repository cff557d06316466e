"""Where a bound of the error in time is claimed, and where not, in words; which step has one solution."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Evolution, Midpoint, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.initial import initial_state
from hemivar.evolution.margin import Margins
from hemivar.evolution.stepper import TimeStepper
from hemivar.laws import FunctionLaw
from hemivar.mechanics.thermal import Heat
from hemivar.solvers import Controls
from tests import bodies

KAPPA, VISCOUS = 3.0, 0.6


def viscous_spring(contact: hv.Contact, viscous: float | None = VISCOUS, **more: Any) -> Evolution:
    """A unit square between rollers, modulus 3, viscosity 0.6, held at its top."""
    stated = {name: more.pop(name) for name in ("inertia", "heat") if name in more}
    modulus = more.pop("modulus", KAPPA)
    problem = bodies.column(contact, modulus, viscous=viscous, tractions={"bottom": (0.0, -0.1)}, **more)
    return Evolution(problem, **stated)


def decaying(r: np.ndarray) -> np.ndarray:
    return np.asarray(np.where(r > 0.0, np.exp(-r), 1.0))


SAMPLED = FunctionLaw(derivative=decaying)
FLAT = hv.Tresca(hv.laws.PenetrationBound(lambda s: np.full(np.shape(s), 0.1)))  # as far as samples tell
DASHPOT = hv.laws.PiecewiseQuadratic([0.0], [1.0, 1.0], [0.0])
FALLING = hv.laws.PiecewiseQuadratic([0.0, 1.0], [1.0, -0.5, 0.0], [0.0, 0.0])

CASES: dict[str, tuple[hv.Contact, dict[str, Any], str, str]] = {
    "displacement": (hv.Contact(hv.Compliance(2.0)), {}, "viscosity", "gradient flow"),
    "softer than the body": (hv.Contact(hv.Softening(2.0, 0.1, 2.9)), {}, "viscosity", "gradient flow"),
    "steeper than the body": (hv.Contact(hv.Softening(2.0, 0.1, 3.1)), {}, "", "not convex"),
    "of samples": (hv.Contact(SAMPLED), {}, "", "samples only"),
    "damping": (hv.Contact(hv.laws.NoContact(), damping=DASHPOT), {}, "stiffness", "law of the rate"),
    "damping that falls": (hv.Contact(hv.laws.NoContact(), damping=FALLING), {}, "", "not monotone"),
    "damping beside springs": (hv.Contact(hv.Compliance(2.0), damping=DASHPOT), {}, "", "beside a law of the rate"),
    "friction": (hv.Contact(hv.laws.Bilateral(), hv.Tresca(0.1)), {}, "stiffness", "c = 0"),
    "friction beside springs": (hv.Contact(hv.Compliance(2.0), hv.Tresca(0.1)), {}, "", "beside a law of the rate"),
    "friction of the pressure": (
        hv.Contact(hv.Compliance(2.0), hv.Coulomb(0.3)), {}, "", "depends on the solution",
    ),
    "memory": (hv.Contact(hv.Compliance(2.0), memory=(hv.laws.ViscousFoundation(1.0),)), {}, "", "internal variables"),
    "branches": (
        hv.Contact(hv.Compliance(2.0)), {"branches": [hv.materials.Branch(lame=(0.0, 1.0), time=1.0)]}, "", "branches",
    ),
    "inertia": (hv.Contact(hv.Compliance(2.0)), {"density": 1.0, "inertia": True}, "", "inertia"),
    "no viscosity": (hv.Contact(hv.Compliance(2.0)), {"viscous": None}, "", "without viscosity"),
    "heat": (hv.Contact(hv.Compliance(2.0)), {"heat": Heat(1.0, 1.0)}, "", "heat"),
    "a law that changes": (
        hv.Contact(hv.Compliance(lambda x, t: 1.0 + t + 0.0 * x[:, 0])), {}, "", "change with time",
    ),
    "a gap that changes": (
        hv.Contact(hv.Compliance(2.0), gap=lambda x, t: t + 0.0 * x[:, 0]), {}, "", "change with time",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_where_a_bound_is_claimed(name: str) -> None:
    contact, more, norm, words = CASES[name]
    history = march(viscous_spring(contact, **more), 0.1, step=0.1)
    error = history.time_error
    assert error.norm == norm, error.why
    assert words in error.why
    assert math.isfinite(error.bound) == bool(norm)
    assert math.isfinite(history["time_error"][-1]) == bool(norm)


def test_no_bound_of_other_schemes() -> None:
    error = march(viscous_spring(hv.Contact(hv.Compliance(2.0))), 0.1, step=0.1, scheme=Midpoint()).time_error
    assert (error.norm, math.isnan(error.bound)) == ("", True)
    assert "not for midpoint" in error.why


@pytest.mark.parametrize(("weakening", "norm"), [(0.55, "stiffness"), (0.65, "")])
def test_friction_that_weakens_must_be_slower_than_the_body_is_viscous(weakening: float, norm: str) -> None:
    """One degree of freedom in shear, viscosity 0.6: alpha of the law against it."""
    problem = bodies.square(
        hv.Contact(hv.laws.Bilateral(), hv.SlipWeakening(1.0, 1.0, 0.5, 2.0 * weakening, of="rate")),
        1,
        lame=(0.0, 3.0),
        viscosity=(0.0, VISCOUS),
        supports={"left": hv.Fixed(y=0.0), "right": hv.Fixed(y=0.0), "top": hv.Fixed(x=0.0, y=0.0)},
        tractions={"bottom": (1.0, 0.0)},
    )
    error = march(Evolution(problem), 0.1, step=0.1).time_error
    assert error.norm == norm, error.why
    if norm:
        assert f"c = {weakening / VISCOUS:.3g}" in error.why
    else:
        assert "softens faster than the body is viscous" in error.why


@pytest.mark.parametrize("alpha", [3.5, 5.0, 20.0])
def test_the_largest_step_with_one_solution(alpha: float) -> None:
    """``alpha < kappa + c/tau``: tau below ``c/(alpha - kappa)``, found to a percent and not above; margins alike."""
    discrete = discretize_evolution(viscous_spring(hv.Contact(hv.Softening(10.0, 0.1, alpha))))
    advance = TimeStepper.of(discrete, hv.evolution.ImplicitEuler(), None, Controls())
    margins, first = Margins(advance), initial_state(advance)
    exact = VISCOUS / (alpha - KAPPA)
    for tau in (0.01, 0.3 * exact):
        taken = advance.take(first, tau)
        assert 0.985 * exact <= margins.largest_step(taken) <= exact * (1.0 + 1e-9)
        assert margins.margin(taken) == pytest.approx(1.0 - alpha / (KAPPA + VISCOUS / tau), rel=1e-6)


@pytest.mark.parametrize("tau", [0.005, 0.01, 0.02, 0.05, 0.1])
def test_the_largest_step_beside_damping(tau: float) -> None:
    """``36 < 12 + (.9 + .4)/tau`` while the damper hides the softening: tau below 1.3/24, whichever step it is asked
    from; the damper alone makes the law of a step convex below .4/36."""
    damped = hv.Contact(hv.Softening(24.0, 0.1, 36.0), damping=hv.Compliance(0.4))
    evolution = viscous_spring(damped, 0.9, modulus=12.0)
    discrete = discretize_evolution(evolution)
    advance = TimeStepper.of(discrete, hv.evolution.ImplicitEuler(), None, Controls())
    margins = Margins(advance)
    taken = advance.take(initial_state(advance), tau)
    exact = 1.3 / 24.0
    assert 0.985 * exact <= margins.largest_step(taken) <= exact * (1.0 + 1e-9)
    assert margins.margin(taken) == pytest.approx(1.0 - max(36.0 - 0.4 / tau, 0.0) / (12.0 + 0.9 / tau), abs=1e-7)


def test_the_largest_step_of_a_long_way_off_is_no_infinite_one() -> None:
    """``alpha < kappa + c/tau``: a hundred million times the step is finite."""
    discrete = discretize_evolution(viscous_spring(hv.Contact(hv.Softening(10.0, 0.1, 3.5))))
    advance = TimeStepper.of(discrete, hv.evolution.ImplicitEuler(), None, Controls())
    exact = VISCOUS / (3.5 - KAPPA)
    found = Margins(advance).largest_step(advance.take(initial_state(advance), 1e-8 * exact))
    assert 0.985 * exact <= found <= exact * (1.0 + 1e-9)


def test_steps_of_any_length_or_none() -> None:
    """Where the body alone is stiff enough there is no largest step; without viscosity there is none at all."""
    for contact, viscous, largest in (
        (hv.Contact(hv.Softening(2.0, 0.1, 2.5)), VISCOUS, math.inf),
        (hv.Contact(hv.Compliance(5.0)), VISCOUS, math.inf),
        (hv.Contact(hv.Softening(2.0, 0.1, 2.5)), None, math.inf),
        (hv.Contact(hv.Softening(2.0, 0.1, 3.5)), None, 0.0),
    ):
        discrete = discretize_evolution(viscous_spring(contact, viscous))
        advance = TimeStepper.of(discrete, hv.evolution.ImplicitEuler(), None, Controls())
        taken = advance.take(initial_state(advance), 0.01)
        assert Margins(advance).largest_step(taken) == largest


def test_the_largest_step_of_a_mass() -> None:
    """``alpha < kappa + m/tau^2`` of each mode: the largest step of a body that softens goes with the square root."""
    law, found = hv.Contact(hv.Softening(10.0, 0.1, 50.0)), []
    for density in (1.0, 4.0):
        discrete = discretize_evolution(viscous_spring(law, None, density=density, inertia=True))
        advance = TimeStepper.of(discrete, hv.evolution.ImplicitEuler(), None, Controls())
        found.append(Margins(advance).largest_step(advance.take(initial_state(advance), 1e-3)))
    assert found[1] / found[0] == pytest.approx(2.0, rel=0.03)
    assert 0.0 < found[0] < math.sqrt(1.0 / (50.0 - KAPPA))


def test_a_law_that_falls_at_once_is_refused_in_words() -> None:
    """No viscosity, however large, leaves a step one solution."""
    for viscous in (VISCOUS, None):
        with pytest.raises(hv.errors.ProblemError, match="drops discontinuously"):
            march(viscous_spring(hv.Contact(hv.laws.Capped(2.0, 0.1)), viscous), 0.1, step=0.1)


@pytest.mark.parametrize(
    ("contact", "more", "words"),
    [
        (hv.Contact(hv.Softening(2.0, 0.01, 0.5)), {}, "every step has one solution only"),
        (hv.Contact(hv.Compliance(2.0), hv.Tresca(0.1), memory=(hv.laws.Wear(0.1),)), {}, "only for given wear"),
        (hv.Contact(hv.Compliance(2.0)), {"heat": Heat(1.0, 1.0)}, "only for given heat"),
        (hv.Contact(SAMPLED), {}, "as far as samples of the law show"),
        (hv.Contact(hv.Compliance(2.0), FLAT), {}, "as far as samples of the law show"),
        (hv.Contact(hv.Softening(50.0, 0.01, 10.0)), {"viscous": None}, "1 step may have several solutions"),
    ],
    ids=["softening", "wear", "heat", "function", "friction", "steep"],
)
def test_one_solution_is_said_of_steps_where_it_is_shown(contact: hv.Contact, more: dict[str, Any], words: str) -> None:
    """What a step iterates, and constants from samples, are no part of the margin."""
    history = march(viscous_spring(contact, **more), 0.1, step=0.1)
    if words.endswith("only"):
        assert history.uniqueness == words
    assert words in history.uniqueness


def test_no_margin_of_a_march_without_steps() -> None:
    steep = viscous_spring(hv.Contact(hv.Softening(50.0, 0.01, 10.0)), viscous=None)
    stopped = march(steep, 0.1, step=0.1, jump="stop")
    assert len(stopped.steps) == 1
    assert stopped.margin == math.inf
    assert stopped.uniqueness == "no step was taken"


def test_the_largest_step_is_that_of_heat_too() -> None:
    """A cell of capacity 1, which hardly conducts, with an exchange on its bottom that falls by 9."""
    exchange = hv.laws.PiecewiseQuadratic([0.0, 0.1], [10.0, -9.0, 0.0], [0.0, 0.0])
    heat = Heat(1e-6, 1.0, contact={"bottom": hv.mechanics.HeatContact(exchange=exchange)}, supports={"top": 0.0})
    found = []
    for step in (0.02, 0.2):
        history = march(viscous_spring(hv.Contact(hv.Compliance(2.0)), heat=heat), 2.0 * step, step=step)
        assert (history["margin"][-1] > 0.0) == (step < history["largest_step"][-1])
        found.append(history["largest_step"][-1])
    # Capacity of the two nodes of the bottom, ((4, 1), (1, 2))/24 in two triangles, against 9/2 at each of them.
    limit = (3.0 - math.sqrt(2.0)) / 24.0 / 4.5
    assert 0.98 * limit < found[0] <= limit
    assert 0.98 * limit < found[1] <= limit


def test_the_largest_step_under_a_law_that_changes_is_that_of_each_step() -> None:
    """Glue that falls by 4 until t = 0.5, by 20 from then on: no step may lead beyond it, then none exceed 0.6/17."""

    def falls(x: np.ndarray, t: float) -> np.ndarray:
        return np.full(len(x), 4.0 if t < 0.5 else 20.0)

    found = march(viscous_spring(hv.Contact(hv.Softening(10.0, 0.1, falls))), 0.75, step=0.15)["largest_step"]
    for k, exact in enumerate([0.5, 0.35, 0.2, 0.05, 0.6 / 17.0]):
        assert 0.98 * exact < found[k + 1] <= exact
