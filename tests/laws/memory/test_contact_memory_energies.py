"""What is stored and lost in a memory is the work of the multiplier; what cannot be undone only grows."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.laws import (
    Adhesive,
    Bonding,
    Compliance,
    ContactLaw,
    Layered,
    LocalStep,
    MemoryChain,
    NoContact,
    PenetrationMemory,
    SawTooth,
    Secant,
    SlipSum,
    SlipWeakening,
    Superpotential,
    ViscousFoundation,
    law_of_step,
)
from tests.samples import slow

GLUES: dict[str, Superpotential] = {
    "softening": Adhesive(5.0, 1.0, 2.0, compression=30.0),
    "brittle": Adhesive(5.0, 1.0, compression=30.0),
    "saw-tooth": SawTooth([0.5, 1.0], [6.0, 2.0], compression=9.0),
}


@pytest.mark.parametrize("name", GLUES)
def test_secant_unloading_books_every_step_exactly(name: str) -> None:
    """Within a step the law is a potential, so that its work is a difference of values."""
    random = np.random.default_rng(3)
    law, memory = ContactLaw(GLUES[name]), Secant()
    r = np.zeros((6, 1))
    state, lost = memory.start(law, r), np.zeros(6)
    for _ in range(60):
        new = r + random.uniform(-0.15, 0.12, r.shape)
        step = LocalStep(0.1, 10.0, r)
        made = law_of_step(law, memory, state, step).normal
        work = made.value(new[:, 0]) - made.value(r[:, 0])
        after = memory.advance(law, state, step, new, new)
        gone = memory.dissipated(law, state, after, step, new, new)
        change = memory.stored(law, after, new) - memory.stored(law, state, r)
        np.testing.assert_allclose(work, change + gone, atol=1e-13)
        assert (gone >= -1e-14).all()
        assert (after["opening"] >= state["opening"]).all()
        r, state, lost = new, after, lost + gone
    assert lost.max() > 0.05


def test_memories_in_a_row_ask_the_law_for_its_energy_once() -> None:
    """Along the secants it is the triangle beneath the last one, beyond them what the law stores."""
    law, chain = ContactLaw(GLUES["softening"]), MemoryChain((Secant(),) * 16)
    state = chain.start(law, np.array([[-0.3]]))
    asked: list[int] = []

    def counted(r: Array) -> Array:
        asked.append(len(r))
        return law.stored_energy(r)

    stiffness = (1.0 - 2.0 * (0.3 - 0.2)) / 0.3
    r = np.array([[-0.12]])
    np.testing.assert_allclose(chain.stored(law, state, r, counted), 0.5 * stiffness * 0.12**2, rtol=1e-14)
    assert asked == [1]
    beyond = np.array([[-0.4]])
    np.testing.assert_allclose(chain.stored(law, state, beyond, counted), law.value(beyond), rtol=1e-14)


def path(count: int) -> np.ndarray:
    t = np.linspace(0.0, 1.0, count + 1)
    return -0.25 + 0.4 * np.cos(5.0 * t) + 0.1 * np.sin(11.0 * t)


@pytest.mark.parametrize(
    ("memory", "law", "passive"),
    [
        (Bonding(50.0, 0.05, 0.2), NoContact(), True),
        slow(Bonding(50.0, 0.0, 2.0), Compliance(20.0), True),
        slow(ViscousFoundation(30.0), Compliance(20.0), True),
        slow(MemoryChain((Bonding(5.0, 0.01, 1.0), ViscousFoundation(30.0))), Compliance(20.0), True),
        (PenetrationMemory(-30.0, 0.4), Compliance(200.0), True),
        (PenetrationMemory(30.0, 0.4), Compliance(20.0), False),
    ],
)
def test_stored_and_lost_are_the_work_in_the_limit(memory: object, law: Superpotential, passive: bool) -> None:
    contact, gaps = ContactLaw(law), []
    for count in (200, 400, 800):
        places, tau = path(count), 1.0 / count
        state = memory.start(contact, places[:1, None])  # type: ignore[attr-defined]
        first, work, gone, before = None, 0.0, 0.0, None
        for start, end in itertools.pairwise(places):
            step = LocalStep(tau, 1.0 / tau, np.array([[start]]))
            made = law_of_step(contact, memory, state, step).normal  # type: ignore[arg-type]
            lam = made.derivative(np.array([end]))
            if before is None:
                first = memory.stored(contact, state, np.array([[start]]))  # type: ignore[attr-defined]
                before = made.derivative(np.array([start]))
            work += float(0.5 * (before + lam)[0] * (end - start))
            after = memory.advance(contact, state, step, np.array([[end]]), lam[:, None])  # type: ignore[attr-defined]
            lost = memory.dissipated(contact, state, after, step, np.array([[end]]), lam[:, None])[0]  # type: ignore[attr-defined]
            assert not passive or lost >= -1e-15
            gone, state, before = gone + float(lost), after, lam
        last = memory.stored(contact, state, np.array([[places[-1]]]))  # type: ignore[attr-defined]
        gaps.append(abs(work - float((last - first)[0]) - gone))
        size = abs(gone)
    assert size > 1e-3
    assert gaps[-1] < 3.0 / count * size  # of first order; it may change its sign before
    assert passive or gone < 0.0  # a foundation that hardens gives back more than it takes


def test_the_loss_of_a_memory_of_penetration_is_exact_for_linear_motion() -> None:
    memory, law = PenetrationMemory(30.0, 0.4), ContactLaw(NoContact())
    r, end = np.array([[0.1]]), np.array([[0.35]])
    once = {"integral": np.array([0.02]), "last": r[:, 0]}
    whole = LocalStep(0.3, 1.0 / 0.3, r)
    after = memory.advance(law, once, whole, end, end)
    gone = memory.dissipated(law, once, after, whole, end, end)
    work, count, state, place, parts = 0.0, 4000, once, r, 0.0
    for i in range(count):
        new = r + (end - r) * (i + 1) / count
        step = LocalStep(0.3 / count, count / 0.3, place)
        later = memory.advance(law, state, step, new, new)
        parts += float(memory.dissipated(law, state, later, step, new, new)[0])
        work += 30.0 * 0.5 * float((state["integral"] + later["integral"])[0]) * 0.25 / count
        state, place = later, new
    assert state["integral"][0] == pytest.approx(after["integral"][0], rel=1e-11)
    assert parts == pytest.approx(gone[0], rel=1e-11)
    change = memory.stored(law, after, end) - memory.stored(law, once, r)
    assert work == pytest.approx(float((change + gone)[0]), rel=1e-6)


def test_friction_weakens_with_the_sum_of_slips_and_does_not_recover() -> None:
    law, memory = ContactLaw(NoContact(), SlipWeakening(2.0, 1.0, 0.4, 3.0)), SlipSum()
    state, total, work = memory.start(law, np.zeros((1, 3))), 0.0, 0.0
    random = np.random.default_rng(1)
    for _ in range(20):
        slip = np.concatenate([[0.0], random.uniform(-0.1, 0.1, 2)])[None]
        step = LocalStep(0.1, 10.0, np.zeros((1, 3)))
        made = law_of_step(law, memory, state, step)
        size = float(np.hypot(*slip[0, 1:]))
        assert made.tangential.subdifferential(np.zeros(1)).upper[0] == pytest.approx(
            2.0 * (0.4 + 0.6 * np.exp(-3.0 * total)), rel=1e-13
        )
        work += float(made.value(slip)[0])
        state, total = memory.advance(law, state, step, slip, slip), total + size
        assert state["slip"][0] == pytest.approx(total, rel=1e-14)
    assert work == pytest.approx(2.0 * (0.4 * total + 0.2 * (1.0 - np.exp(-3.0 * total))), rel=1e-12)


def test_states_cannot_be_changed_and_rejected_steps_leave_no_trace() -> None:
    law, memory = ContactLaw(Layered([0.1], [3.0], base=2.0)), MemoryChain((Secant(), ViscousFoundation(2.0)))
    r = np.zeros((2, 1))
    state = memory.start(law, r)
    step = LocalStep(0.1, 10.0, r)
    memory.advance(law, state, step, r + 0.3, r + 1.0)
    assert all((values == 0.0).all() for values in state.values())
    with pytest.raises(ValueError, match="read-only"):
        state["0.opening"][0] = 1.0


def test_the_energy_of_a_chain_of_memories_asks_each_law_once() -> None:
    law, memory = ContactLaw(GLUES["softening"]), MemoryChain((Secant(),) * 20)
    r = np.linspace(-0.2, 0.1, 7)[:, None]
    state = memory.advance(law, memory.start(law, r), LocalStep(1.0, 1.0, 0.0 * r), r, 0.0 * r)
    asked = 0

    def energy(place: Array) -> Array:
        nonlocal asked
        asked += 1
        return law.stored_energy(place)

    alone = Secant()
    own = alone.advance(law, alone.start(law, r), LocalStep(1.0, 1.0, 0.0 * r), r, 0.0 * r)
    np.testing.assert_allclose(memory.stored(law, state, r, energy), alone.stored(law, own, r), rtol=1e-14)
    assert asked == 1
