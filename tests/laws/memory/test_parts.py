"""Memories by themselves: dampers that cannot pull, the profile of rate and state, memories of some of the points."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from scipy.integrate import quad

from hemivar.basics.types import Array
from hemivar.errors import MethodError, ProblemError
from hemivar.laws import (
    Compliance,
    ContactLaw,
    CoupledFormulaLaw,
    NoContact,
    PiecewiseQuadratic,
    Signorini,
    SlipWeakening,
    Tresca,
)
from hemivar.laws.memory import (
    Bonding,
    DampedContact,
    LocalStep,
    Memory,
    MemoryChain,
    PenetrationMemory,
    RateAndState,
    Secant,
    SlipSum,
    ViscousFoundation,
    Wear,
    law_of_step,
)
from hemivar.laws.memory.contact_memory import kept, slide
from hemivar.laws.memory.rate_and_state import RateStateProfile
from hemivar.laws.registry import MEMORIES
from hemivar.laws.testing import check_law

DASHPOT = PiecewiseQuadratic([0.0], [4.0, 4.0], [0.0], name="dashpot")


def one_row(*values: float) -> Array:
    return np.array([values])


def test_a_damper_that_cannot_pull_and_what_it_takes() -> None:
    """Pressure ``max(0, 100 r + 4 r')`` in contact; what the springs do not give is lost, at most the whole."""
    law, memory, tau = ContactLaw(Compliance(100.0)), DampedContact(DASHPOT), 0.1
    for before, after in ((0.02, 0.05), (0.05, 0.02), (0.05, 0.048), (0.05, -0.01), (-0.02, 0.03)):
        step = LocalStep(tau, 1.0 / tau, one_row(before))
        state = memory.start(law, one_row(before))
        made = law_of_step(law, memory, state, step).normal
        lam = float(made.derivative(np.array([after]))[0])
        rate = (after - before) / tau
        wanted = max(0.0, 100.0 * after + 4.0 * rate) if after > 0.0 else 0.0
        assert lam == pytest.approx(wanted, abs=1e-12)
        later = memory.advance(law, state, step, one_row(after), one_row(lam))
        assert not later
        lost = memory.dissipated(law, state, later, step, one_row(after), one_row(lam))[0]
        assert lost == pytest.approx((wanted - 100.0 * max(after, 0.0)) * (after - before), abs=1e-13)
        assert lost >= -1e-15
        stored = memory.stored(law, later, one_row(after))[0]
        assert stored == pytest.approx(50.0 * max(after, 0.0) ** 2)
    with pytest.raises(ProblemError, match="superpotential of the rate"):
        DampedContact(4.0)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="nothing to damp"):
        law_of_step(ContactLaw(Signorini()), memory, kept(), LocalStep(0.1, 10.0, one_row(0.0)))


def test_a_bounce_on_a_damper_that_cannot_pull() -> None:
    """m on a spring 100 with a damper 4: restitution .571740027585, in contact for .279535444073; of order one."""
    law, found = ContactLaw(Compliance(100.0)), []
    for tau in (8e-3, 4e-3):
        memory = DampedContact(DASHPOT)
        r, speed, time = 0.0, 0.5, 0.0
        for _ in range(300):
            made = law_of_step(law, memory, kept(), LocalStep(tau, 1.0 / tau, one_row(r))).normal
            a = 1.0 / tau**2
            new = float(made.local_argmin(np.array([a]), np.array([a * (r + tau * speed)]))[0])
            if ((new - r) / tau - speed) / tau >= -1e-9:
                break
            r, speed, time = new, (new - r) / tau, time + tau
        assert r > 0.0  # it leaves before the springs are at rest
        found.append((time, -speed / 0.5))
    assert found[1][0] == pytest.approx(0.279535444073, abs=4e-3)
    assert 2.0 * found[1][1] - found[0][1] == pytest.approx(0.571740027585, abs=5e-3)
    assert found[1][1] - found[0][1] > 0.02  # one step alone is farther off


def test_dampers_of_some_points() -> None:
    each = PiecewiseQuadratic([0.0], np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]), [0.0])
    memory = DampedContact(each).at(np.zeros((3, 2))).take(np.array([2, 0]))
    law = ContactLaw(Compliance(10.0))
    made = law_of_step(law, memory, kept(), LocalStep(0.1, 10.0, np.zeros((2, 1)))).normal
    np.testing.assert_allclose(made.derivative(np.array([0.1, 0.1])), [1.0 + 3.0, 1.0 + 1.0], rtol=1e-12)


def conforms(profile: RateStateProfile) -> bool:
    """Of every check but one: that j(r)/r grows like a logarithm is more than the kit can tell."""
    failures = check_law(profile, reach=3.0, friction=True, raises=False).failures
    return all("the growth rate far away" in failure for failure in failures)


@pytest.mark.parametrize("exponent", [-3.0, 2.5])
@pytest.mark.parametrize("rate", [1.0, 20.0])
def test_the_profile_of_rate_and_state(exponent: float, rate: float) -> None:
    """``direct asinh(V exp(exponent))``: every answer, and its value by quadrature."""
    profile = RateStateProfile(np.array([0.7]), np.array([exponent]), rate)
    r = np.array([-2.0, -0.3, 1e-6, 0.04, 1.7])
    np.testing.assert_allclose(
        profile.derivative(r), 0.7 * np.sign(r) * np.arcsinh(rate * np.abs(r) * np.exp(exponent)), rtol=1e-12
    )
    for end, found in zip(r, profile.value(r), strict=True):
        wanted, _ = quad(lambda s: 0.7 * np.arcsinh(rate * s * np.exp(exponent)), 0.0, abs(end), epsabs=0, epsrel=1e-11)
        assert found == pytest.approx(wanted, rel=1e-9)
    assert conforms(profile)
    both = RateStateProfile(np.array([0.7, 0.2, 0.1]), np.array([exponent, 1.0, 2.0]), rate)
    assert conforms(both.take(np.array([0, 2])))
    np.testing.assert_array_equal(both.take(np.array([2, 0])).direct, [0.1, 0.7])
    np.testing.assert_array_equal(both.take(np.array([2, 0])).exponent, [2.0, exponent])
    c0, c1 = both.growth
    far = np.geomspace(1e-4, 1e4, 50)
    for i in range(3):
        slope = both.take(np.array([i])).derivative(far)
        assert (slope <= c0[i] + c1[i] * far).all()
    np.testing.assert_array_equal(both.recession(np.array([1.0, -1.0, 0.0])), [np.inf, np.inf, 0.0])


#: One with a number for every point in each of its parameters.
EACH: dict[str, Memory] = {
    "bonding": Bonding(np.array([50.0, 40.0, 30.0]), np.array([0.05, 0.04, 0.03]), np.array([0.2, 0.3, 0.4])),
    "penetration": PenetrationMemory(np.array([30.0, 20.0, -10.0]), np.array([0.4, 0.3, 0.2])),
    "wear": Wear(np.array([0.1, 0.2, 0.3])),
    "creep": ViscousFoundation(np.array([3.0, 2.0, 1.0])),
    "secant": Secant(),
    "slip sum": SlipSum(),
    "rate and state": RateAndState(0.01, np.array([0.015, 0.02, 0.01]), 8e-3, 0.6, 1e-3, np.array([1.0, 2.0, 3.0])),
    "chain": MemoryChain((PenetrationMemory(np.array([30.0, 20.0, 10.0]), 0.4), Wear(np.array([0.1, 0.2, 0.3])))),
}
#: The bond with plastic slip has its own file.
EACH |= {
    name: cast(Memory, entry.make(**(entry.example or {})))
    for name, entry in MEMORIES.items()
    if name not in {"plastic-bond", *(memory.name for memory in EACH.values())}
}


@pytest.mark.parametrize("name", EACH)
def test_points_together_are_points_alone(name: str) -> None:
    """Every answer of a memory at several points is that of the memory, taken there; states stay apart."""
    friction = {"slip sum": SlipWeakening(2.0, 1.0, 0.4, 3.0), "rate and state": Tresca(5.0)}.get(name)
    law = ContactLaw(Compliance(20.0), friction) if friction else ContactLaw(Compliance(20.0))
    if name == "secant":
        law = ContactLaw(PiecewiseQuadratic([-0.6, -0.2, 0.0], [0.0, -2.5, 5.0, 20.0], np.zeros(3)))
    points = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    memory = EACH[name].at(points)
    before = np.array([[0.02, 0.1], [-0.05, 0.0], [-0.25, 0.2]])
    r = np.array([[0.04, 0.02], [-0.1, -0.03], [-0.3, 0.01]])
    guess = np.array([[0.8, 0.1], [0.2, -0.2], [0.5, 0.3]])
    tau = 0.1

    def answers(memory: Memory, i: np.ndarray) -> list[Array]:
        state = memory.start(law, before[i])
        found = []
        for end in (r[i], r[i] * [1.5, -1.0]):
            step = LocalStep(tau, 1.0 / tau, before[i], end, guess[i])
            made = law_of_step(law, memory, state, step)
            lam = np.column_stack([made.normal.derivative(end[:, 0]), guess[i, 1]])
            after = memory.advance(law, state, step, end, lam)
            found += [lam[:, 0], memory.stored(law, after, end), memory.seen(after, end)[:, 0]]
            found += [memory.dissipated(law, state, after, step, end, lam), *after.values()]
            if friction:
                found.append(made.tangential.derivative(end[:, 1]))
            state = after
        return found

    together = answers(memory, np.arange(3))
    for j in range(3):
        i = np.array([j])
        for one, other in zip(together, answers(memory.take(i), i), strict=True):
            assert one[j] == pytest.approx(other[0], rel=1e-12, abs=1e-15)


def test_lengths_of_slips() -> None:
    np.testing.assert_array_equal(slide(np.zeros((3, 0))), np.zeros(3))
    np.testing.assert_array_equal(slide(np.array([[-2.0], [3.0]])), [2.0, 3.0])
    np.testing.assert_array_equal(slide(np.array([[-3.0, 4.0], [0.0, -1.0]])), [5.0, 1.0])


def test_a_step_as_contact_points_see_it() -> None:
    step = LocalStep(0.1, 20.0, np.array([[0.3, 0.1]]))
    assert step.shift == pytest.approx(-6.0)
    assert step.sliding == pytest.approx(0.0)
    assert step.pressing == pytest.approx(0.0)
    other = LocalStep(0.1, 20.0, np.array([[0.3, 0.1]]), drift=np.array([[1.5, 0.7]]))
    assert other.shift == pytest.approx(-4.5)
    for tau, rate in ((0.0, 1.0), (np.inf, 1.0), (0.1, 0.0), (0.1, np.nan)):
        with pytest.raises(ProblemError, match="must be"):
            LocalStep(tau, rate, np.zeros((1, 1)))


def test_two_makers_of_the_friction_law_are_refused() -> None:
    rate = EACH["rate and state"]
    for parts in ((SlipSum(), SlipSum()), (rate, rate)):
        with pytest.raises(ProblemError, match="both define the friction law"):
            MemoryChain(parts)
    with pytest.raises(ProblemError, match=r"such as Secant\(\)"):
        MemoryChain((NoContact(),))  # type: ignore[arg-type]


@pytest.mark.parametrize("order", [0, 1])
def test_friction_of_the_slip_sum_sees_no_rate_in_a_chain(order: int) -> None:
    """Whatever stands beside it, its law is that of the slip; a law of the rate is one of increments."""
    friction = SlipWeakening(2.0, 1.0, 0.4, 3.0)
    law, step = ContactLaw(Compliance(20.0), friction), LocalStep(0.1, 10.0, np.zeros((1, 2)))
    parts = (SlipSum(), PenetrationMemory(5.0, 0.4))
    chain = MemoryChain(parts if order else parts[::-1])
    assert chain.of_slip
    state = chain.start(law, np.zeros((1, 2)))
    d = np.array([0.05])
    slope = law_of_step(law, chain, state, step).tangential.derivative(d)[0]
    assert slope == pytest.approx(2.0 * (0.4 + 0.6 * np.exp(-3.0 * 0.05)), rel=1e-12)
    alone = MemoryChain((PenetrationMemory(5.0, 0.4),))
    assert not alone.of_slip
    slope = law_of_step(law, alone, alone.start(law, np.zeros((1, 2))), step).tangential.derivative(d)[0]
    assert slope == pytest.approx(2.0 * (0.4 + 0.6 * np.exp(-3.0 * 0.5)), rel=1e-12)


@pytest.mark.parametrize(
    ("memory", "words"),
    [
        (Bonding(-1.0, 1.0, 1.0), "stiffness of memory 'bonding' is -1; it must be at least 0"),
        (Bonding(1.0, -1.0, 1.0), "energy of memory 'bonding' is -1; it must be at least 0"),
        (Bonding(1.0, 1.0, 0.0), "viscosity of memory 'bonding' is 0; it must be positive"),
        (PenetrationMemory(-1.0, 0.0), "time of memory 'penetration-memory' is 0; it must be positive"),
        (Secant(friction=-0.1), "friction of memory 'secant' is -0.1; it must be at least 0"),
        (Wear(-1.0), "coefficient of memory 'wear' is -1; it must be at least 0"),
        (ViscousFoundation(0.0), "viscosity of memory 'viscous-foundation' is 0; it must be positive"),
        *(
            (
                replace(RateAndState(1.0, -1.0, 1.0, -1.0, 1.0, 1.0), **{key: 0.0}),
                f"{key} of memory 'rate-and-state' is 0; it must be positive",
            )
            for key in ("direct", "length", "rate", "age")
        ),
    ],
)
def test_a_parameter_beyond_its_limits_is_refused(memory: Memory, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        memory.at(None)


def test_limits_that_nobody_reads_are_refused() -> None:
    with pytest.raises(ProblemError, match=r"memory 'own' has limits .* give each field its own"):
        type("Own", (Memory,), {"name": "own", "positive": ("size",)})


def test_a_law_without_an_effective_opening_has_no_largest_one() -> None:
    law = CoupledFormulaLaw("r^2 + s^2", reach=1.0)
    with pytest.raises(MethodError, match="has no effective opening to store as an internal variable"):
        Secant().start(law, np.zeros((1, 2)))
