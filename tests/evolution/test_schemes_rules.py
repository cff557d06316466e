"""The numbers of schemes against their definitions, and their orders and damping on one degree of freedom."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.evolution import SDIRK2, GeneralizedAlpha, Midpoint, MoreauJean, Newmark, Scheme
from hemivar.evolution.schemes import RateFormula, StageRule
from hemivar.evolution.schemes.by_name import SCHEMES

TAU = 0.37
OLD = np.array([0.3, -0.7, 1.9])  # place, velocity and acceleration at the beginning
NEW = np.array([0.8, 0.45, -1.1])  # and some at the end


def evaluated(rule: RateFormula, difference: float, v: float, w: float) -> float:
    return rule.difference * difference + rule.velocity * v + rule.acceleration * w


def ends(rule: StageRule, stage: float) -> tuple[float, float, float, float, float]:
    """v*, w* and place, velocity and acceleration at the end, of the place at the stage."""
    u, v, w = OLD
    whole = rule.reach * (stage - u)
    return (
        evaluated(rule.rate, stage - u, v, w),
        evaluated(rule.acceleration, stage - u, v, w),
        u + whole,
        evaluated(rule.new_velocity, whole, v, w),
        evaluated(rule.new_acceleration, whole, v, w),
    )


def newmarks(beta: float, gamma: float, w1: float) -> tuple[float, float]:
    """Place and velocity at the end of the acceleration there, as Newmark says."""
    u, v, w = OLD
    return (
        u + TAU * v + TAU**2 * ((0.5 - beta) * w + beta * w1),
        v + TAU * ((1.0 - gamma) * w + gamma * w1),
    )


@pytest.mark.parametrize(("beta", "gamma"), [(0.25, 0.5), (0.4, 0.6), (0.9, 1.3)])
def test_newmark_is_what_newmark_says(beta: float, gamma: float) -> None:
    (rule,) = Newmark(beta, gamma).rules(TAU)
    u1, v1 = newmarks(beta, gamma, NEW[2])
    assert (rule.at, rule.share) == (1.0, 1.0)
    assert ends(rule, u1) == pytest.approx((v1, NEW[2], u1, v1, NEW[2]), rel=1e-12)


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.8, 1.0])
def test_generalized_alpha_is_what_chung_and_hulbert_say(rho: float) -> None:
    am, af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    u1, v1 = newmarks(0.25 * (1.0 - am + af) ** 2, 0.5 - am + af, NEW[2])
    (rule,) = GeneralizedAlpha(rho).rules(TAU)
    assert rule.at == pytest.approx(1.0 - af)
    stage = (1.0 - af) * np.array([u1, v1]) + af * OLD[:2]
    whole = (1.0 - am) * NEW[2] + am * OLD[2]
    assert ends(rule, stage[0]) == pytest.approx((stage[1], whole, u1, v1, NEW[2]), rel=1e-12)


def test_the_midpoint_rule_is_what_it_is_called() -> None:
    u, v, _ = OLD
    (rule,) = Midpoint().rules(TAU)
    speed = (NEW[0] - u) / TAU
    v1 = 2.0 * speed - v
    pushed = (v1 - v) / TAU
    assert rule.at == 0.5
    assert ends(rule, 0.5 * (u + NEW[0])) == pytest.approx((speed, pushed, NEW[0], v1, pushed), rel=1e-12)


@pytest.mark.parametrize(("restitution", "theta"), [(0.0, 0.5), (0.4, 0.7), (0.0, 1.0)])
def test_moreau_and_jean_move_by_theta(restitution: float, theta: float) -> None:
    u, v, _ = OLD
    (rule,) = MoreauJean(restitution, theta).rules(TAU)
    speed = theta * NEW[1] + (1.0 - theta) * v
    pushed = (NEW[1] - v) / TAU
    found = ends(rule, u + theta * TAU * speed)
    assert (rule.at, rule.restitution) == (theta, restitution)
    assert found == pytest.approx((speed, pushed, u + TAU * speed, NEW[1], pushed), rel=1e-12)


def moved(scheme: Scheme, step: float, count: int, m: float, c: float, k: float, force: object, start: Array) -> Array:
    """Place and velocity after some steps of ``m u'' + c u' + k u = f(t)``, as stages are solved and ended."""
    u, v = start
    w = (force(0.0) - c * v - k * u) / m if m else 0.0  # type: ignore[operator]
    for n in range(count):
        speed, total = v, 0.0
        for rule in scheme.rules(step):
            p, q = evaluated(rule.rate, 0.0, speed, w), evaluated(rule.acceleration, 0.0, speed, w)
            f = force((n + rule.at) * step) - k * u - c * p - m * q  # type: ignore[operator]
            difference = f / (k + c * rule.rate.difference + m * rule.acceleration.difference)
            before, speed = speed, evaluated(rule.rate, difference, speed, w)
            total += rule.share * step * speed
        whole = rule.reach * difference
        assert total == pytest.approx(whole, rel=1e-11, abs=1e-13) or scheme.name not in ("sdirk2", "implicit-euler")
        u, v, w = (
            u + whole,
            evaluated(rule.new_velocity, whole, before, w),
            evaluated(rule.new_acceleration, whole, before, w),
        )
    return np.array([u, v])


def exact(t: float, m: float, c: float, k: float) -> Array:
    """``exp(-t/3) cos(2 t)`` and its rate."""
    return np.array([np.cos(2 * t), -np.cos(2 * t) / 3 - 2 * np.sin(2 * t)]) * np.exp(-t / 3)


@pytest.mark.parametrize(
    "scheme",
    [
        Newmark(0.5, 0.5), Newmark(0.49, 0.9), *(GeneralizedAlpha(rho) for rho in (0.0, 0.4, 1.0)),
        MoreauJean(0.3, 0.7), *(one for one in SCHEMES.values() if one.takes_mass and not one.multistep),
    ],
)  # fmt: skip
def test_orders_with_mass(scheme: Scheme) -> None:
    """A damped oscillator that is pushed, whose motion is known; Newmark with gamma above 1/2 is of order one."""
    m, c, k = 1.3, 0.7, 2.1

    def force(t: float) -> float:
        u, v = exact(t, m, c, k)
        w = (1.0 / 9.0 - 4.0) * u + 4.0 / 3.0 * np.exp(-t / 3) * np.sin(2 * t)
        return float(m * w + c * v + k * u)

    start = exact(0.0, m, c, k)
    errors = [np.abs(moved(scheme, 1.0 / n, n, m, c, k, force, start) - exact(1.0, m, c, k)) for n in (40, 80, 160)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    order = 1 if isinstance(scheme, Newmark) and scheme.gamma > 0.5 else scheme.order
    order = 2 if scheme == MoreauJean() else order  # theta = 1/2 without contact
    assert orders == pytest.approx(order, abs=0.15)


def test_sdirk2_has_its_function_of_stability() -> None:
    """``R(z) = (1 + (1 - 2 g) z)/(1 - g z)^2``, g = 1 - 1/sqrt 2, and order two where it is pushed."""
    g = 1.0 - 1.0 / math.sqrt(2.0)
    for z in (-0.3, -2.0, -50.0):
        u, _ = moved(SDIRK2(), 1.0, 1, 0.0, 1.0, -z, lambda t: 0.0, np.array([1.0, 0.0]))
        assert u == pytest.approx((1.0 + (1.0 - 2.0 * g) * z) / (1.0 - g * z) ** 2, rel=1e-12)
    errors = [
        abs(moved(SDIRK2(), 1 / n, n, 0.0, 1.0, 2.0, lambda t: np.cos(t) + 2 * np.sin(t), np.zeros(2))[0] - np.sin(1.0))
        for n in (20, 40, 80)
    ]
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("rho", [0.0, 0.25, 0.8, 1.0])
def test_what_a_step_cannot_resolve_falls_by_rho(rho: float) -> None:
    """The spectral radius of a step of an undamped oscillator: one for long waves, rho for the shortest."""

    def radius(k: float) -> float:
        (rule,) = GeneralizedAlpha(rho).rules(1.0)
        columns = []
        for unit in np.eye(3):
            u, v, w = unit
            q = evaluated(rule.acceleration, 0.0, v, w)
            difference = (-k * u - q) / (k + rule.acceleration.difference)
            whole = rule.reach * difference
            columns.append(
                [u + whole, evaluated(rule.new_velocity, whole, v, w), evaluated(rule.new_acceleration, whole, v, w)]
            )
        return float(np.abs(np.linalg.eigvals(np.array(columns).T)).max())

    assert radius(1e-4) == pytest.approx(1.0, abs=1e-6)
    assert radius(1e10) == pytest.approx(rho, abs=2e-3)
    assert all(radius(k) <= 1.0 + 1e-9 for k in np.geomspace(1e-3, 1e6, 40))
