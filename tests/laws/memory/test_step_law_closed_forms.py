"""A spring and a contact point, stepped by hand, against solutions that are known in closed form."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hemivar.laws import (
    Bonding,
    Compliance,
    ContactLaw,
    DampedContact,
    LocalStep,
    MemoryChain,
    NoContact,
    PenetrationMemory,
    PiecewiseQuadratic,
    RateAndState,
    Softening,
    Tresca,
    ViscousFoundation,
    Wear,
    law_of_step,
)


def one_row(*values: float) -> np.ndarray:
    return np.array([values])


def in_order(errors: list[float], order: int) -> None:
    """Errors of steps that are halved fall as they should."""
    for coarse, fine in itertools.pairwise(errors):
        assert coarse / fine == pytest.approx(2.0**order, rel=0.1)


def test_memory_of_penetration() -> None:
    """kappa (r0 - r) = k r + int b exp(-(t - s)/T) r: D2."""
    kappa, k, b, time, r0 = 12.0, 24.0, 30.0, 0.4, 0.1
    law, errors = ContactLaw(Compliance(k)), []
    exact = 0.026573963357
    for count in (20, 40, 80):
        memory, tau = PenetrationMemory(b, time), 0.5 / count
        r = one_row(kappa * r0 / (kappa + k))
        state = memory.start(law, r)
        for _ in range(count):
            step = LocalStep(tau, 1.0 / tau, r)
            made = law_of_step(law, memory, state, step).normal
            new = made.local_argmin(np.array([kappa]), np.array([kappa * r0]))[:, None]
            state = memory.advance(law, state, step, new, kappa * (r0 - new))
            r = new
        errors.append(abs(r[0, 0] - exact))
    assert errors[-1] < 1e-6
    in_order(errors, 2)


@pytest.mark.parametrize("wears", [True, False])
def test_wear_and_a_creeping_foundation(wears: bool) -> None:
    """p = S D exp(-S k V t), S = 12 of body and foundation: D3; a dashpot 1/(k V) in series does the same."""
    kappa, k, speed, pushed = 24.0, 0.02, 0.5, 0.1
    law, errors = ContactLaw(Compliance(24.0)), []
    for count in (50, 100, 200):
        tau = 4.0 / count
        memory = Wear(k) if wears else ViscousFoundation(1.0 / (k * speed))
        r, lam = one_row(0.0, 0.0), one_row(1.2, 0.0)
        state = memory.start(law, r)
        for _ in range(count):
            step = LocalStep(tau, 1.0 / tau, r, one_row(0.0, speed * tau), lam)
            made = law_of_step(law, memory, state, step).normal
            new = float(made.local_argmin(np.array([kappa]), np.array([kappa * pushed]))[0])
            lam = one_row(kappa * (pushed - new), 0.0)
            state = memory.advance(law, state, step, one_row(new, speed * tau), lam)
            r = one_row(new, 0.0)
        errors.append(abs(lam[0, 0] - 0.742540070167))
    assert errors[-1] < 1e-3
    in_order(errors, 1)


def test_bond_at_a_fixed_opening() -> None:
    """beta = b* + (1 - b*) exp(-gamma r^2 t/eta), b* = w0/(gamma r^2): D4."""
    law, memory, errors = ContactLaw(NoContact()), Bonding(50.0, 0.05, 0.2), []
    for count in (100, 200, 400):
        tau, r = 1.0 / count, one_row(-0.1)
        state = memory.start(law, r)
        for _ in range(count):
            step = LocalStep(tau, 1.0 / tau, r)
            lam = law_of_step(law, memory, state, step).normal.derivative(r[:, 0])
            state = memory.advance(law, state, step, r, lam[:, None])
            assert lam[0] == pytest.approx(50.0 * state["bond"][0] ** 2 * -0.1, rel=1e-13)
        errors.append(abs(state["bond"][0] - 0.173876498762))
    assert errors[-1] < 3e-3
    in_order(errors, 1)
    closed = memory.advance(law, memory.start(law, -r), step, one_row(0.1), one_row(0.0))
    assert closed["bond"][0] == 1.0  # pressing does not break it


@pytest.mark.slow
def test_bounce_with_a_damper_that_cannot_pull() -> None:
    """m on a spring k with a damper c: time in contact and restitution: D7."""
    mass, law = 1.0, ContactLaw(Compliance(100.0))
    dashpot = PiecewiseQuadratic([0.0], [4.0, 4.0], [0.0], name="dashpot")
    found = []
    for tau in (4e-4, 2e-4):
        memory = DampedContact(dashpot)
        state, r, speed, time = memory.start(law, one_row(0.0)), 0.0, 0.5, 0.0
        while True:
            step = LocalStep(tau, 1.0 / tau, one_row(r))
            made = law_of_step(law, memory, state, step).normal
            a = mass / tau**2
            new = float(made.local_argmin(np.array([a]), np.array([a * (r + tau * speed)]))[0])
            force = -mass * ((new - r) / tau - speed) / tau
            if force <= 1e-9:
                break
            r, speed, time = new, (new - r) / tau, time + tau
        found.append((time, -speed / 0.5))
        assert r > 0.0  # it leaves before the springs are at rest
    duration, restitution = (2.0 * fine - coarse for coarse, fine in zip(*found, strict=True))
    assert duration == pytest.approx(0.279535444073, abs=6e-4)
    assert restitution == pytest.approx(0.571740027585, abs=1e-4)


def test_the_global_jump_of_a_softening_law() -> None:
    """kappa (r0 - r) in dj(r) with alpha > kappa: the lowest energy changes sides at sqrt(R1 R2): D12."""
    law = Softening(2.0, 0.1, 2.0)
    low, high = 0.2, 0.3
    for _ in range(60):
        middle = 0.5 * (low + high)
        jumped = law.local_argmin(np.array([1.0]), np.array([middle]))[0] > 0.1
        low, high = (low, middle) if jumped else (middle, high)
    assert low == pytest.approx(np.sqrt(0.3 * 0.2), abs=1e-12)
    _points, energies = law.table.local_minimisers(np.array([1.0]), np.array([0.25]))
    assert np.isfinite(energies).sum() == 2
    for r0, count in ((0.199, 1), (0.201, 2), (0.299, 2), (0.301, 1)):
        assert np.isfinite(law.table.local_minimisers(np.array([1.0]), np.array([r0]))[1]).sum() == count


def test_a_step_of_the_rate_in_rate_and_state_friction() -> None:
    """f0 + a ln(V2/V0) + b ln(V0 theta/L) with the ageing law: D13, exact for any step."""
    length, first, second = 8e-3, 1e-9, 1e-8
    memory = RateAndState(0.01, 0.015, length, 0.6, 1e-6, length / first)
    law, sigma = ContactLaw(NoContact(), Tresca(50.0)), 50.0
    state = memory.start(law, np.zeros((1, 2)))
    assert memory.coefficient(state["age"], np.array([first]))[0] == pytest.approx(0.634538776, abs=1e-9)
    assert memory.coefficient(state["age"], np.array([second]))[0] == pytest.approx(0.657564627, abs=1e-9)
    time = 0.0
    for tau in (1e4, 3e5, 1e5, 5e6, 1e7):
        slip = one_row(0.0, second * tau)
        step = LocalStep(tau, 1.0 / tau, np.zeros((1, 2)), slip)
        made = law_of_step(law, memory, state, step)
        state = memory.advance(law, state, step, slip, slip)
        time += tau
        theta = length / second + (length / first - length / second) * np.exp(-second * time / length)
        assert state["age"][0] == pytest.approx(theta, rel=1e-12)
        wanted = 0.6 + 0.01 * np.log(second / 1e-6) + 0.015 * np.log(1e-6 * theta / length)
        assert made.tangential.derivative(slip[:, 1])[0] == pytest.approx(sigma * wanted, rel=1e-12)
    assert memory.coefficient(state["age"], np.array([second]))[0] == pytest.approx(0.623025851, abs=1e-8)
    rest = memory.advance(law, state, LocalStep(7.0, 1.0 / 7.0, slip), np.zeros((1, 2)), slip)
    assert rest["age"][0] == pytest.approx(state["age"][0] + 7.0, rel=1e-15)  # at rest contacts age


def test_a_chain_lets_the_law_beneath_see_what_is_left() -> None:
    """Wear above memory of penetration: the memory acts at r less the wear."""
    law, tau = ContactLaw(Compliance(24.0)), 0.1
    chain = MemoryChain((PenetrationMemory(30.0, 0.4), Wear(0.02)))
    r, lam = one_row(0.05, 0.0), one_row(0.7, 0.0)
    state = chain.start(law, r)
    for _ in range(5):
        step = LocalStep(tau, 1.0 / tau, r, one_row(0.05, 0.3), lam)
        made = law_of_step(law, chain, state, step).normal
        lam = one_row(float(made.derivative(np.array([0.05]))[0]), 0.0)
        worn = state["1.depth"][0] + 0.02 * 0.3 * lam[0, 0]
        keep, x = np.exp(-tau / 0.4), tau / 0.4
        weight = 0.4 * (1.0 - (1.0 - keep) / x)
        other = 0.4 * ((1.0 - keep) / x - keep)
        before, left = 0.05 - state["1.depth"][0], 0.05 - worn
        q = keep * state["0.integral"][0] + other * before + weight * left
        state = chain.advance(law, state, step, one_row(0.05, 0.3), lam)
        assert state["1.depth"][0] == pytest.approx(worn, rel=1e-13)
        assert state["0.integral"][0] == pytest.approx(q, rel=1e-12)
        assert lam[0, 0] == pytest.approx(24.0 * left + 30.0 * q, rel=1e-12)
    assert chain.iterates
