"""Bonds with plastic slip: closed forms of a material point, the law of a step, marches, energy, files, refusals."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import stepper
from hemivar.laws import (
    Compliance,
    ContactLaw,
    LocalStep,
    MemoryChain,
    PiecewiseQuadratic,
    PlasticBond,
    Signorini,
    Tresca,
    Wear,
)
from hemivar.laws.coupled.shifted import ShiftedLaw
from hemivar.laws.memory.contact_memory import MemoryState, kept
from hemivar.laws.testing import check_vector_law
from tests.samples import slow

#: mm, N, MPa; the hardening is rounded in the reference.
BOND = PlasticBond(stiffness=2000.0, shear_stiffness=1000.0, energy=0.969, yield_traction=30.0, hardening=692.0)
SLIP_AT_BREAK, PLASTIC_AT_BREAK = 0.064286770, 0.020264048


RIGID = ContactLaw(Signorini()).at(None)


def begun(bond: PlasticBond, before: Array, m: int = 1) -> tuple[MemoryState, LocalStep]:
    return bond.start(RIGID, before), LocalStep(0.1, 10.0, before)


def law_at(bond: PlasticBond, state: MemoryState, r: Array) -> ShiftedLaw:
    """The law of a step in which the bonds of a state hold as they do without a slip."""
    return bond.law(RIGID, state, LocalStep(0.1, 10.0, 0.0 * r))


def advanced(bond: PlasticBond, state: MemoryState, before: Array, after: Array) -> MemoryState:
    return bond.advance(RIGID, state, LocalStep(0.1, 10.0, before), after, 0.0 * after)


def broken(bond: PlasticBond, way: tuple[float, float], sizes: Array) -> tuple[Array, MemoryState, float, float]:
    """Where a material point breaks on a straight way; its state, the work done and the energy lost until then."""
    last, work, force = np.zeros((1, 2)), 0.0, np.zeros(2)
    state, lost = bond.start(RIGID, last), 0.0
    for size in sizes.tolist():
        r, step = np.array([way]) * size, LocalStep(0.1, 10.0, last)
        now = law_at(bond, state, r).nearest_multiplier(r, np.zeros((1, 2)))[0]
        new = advanced(bond, state, last, r)
        work += float((0.5 * (now + force) * (r - last)[0]).sum())
        lost += float(bond.dissipated(RIGID, state, new, step, r, 0.0 * r)[0])
        if not new["bond"][0]:
            return r[0], new, work, lost
        state, last, force = new, r, now
    raise AssertionError("it did not break")


def test_the_hardening_is_that_of_the_energy_in_shear() -> None:
    bond = PlasticBond.of_energies(2000.0, 1000.0, 0.969, 1.774 * 0.969, 30.0)
    assert bond.hardening == pytest.approx(692.0, abs=0.01)
    assert bond.shear_energy == pytest.approx(1.774 * 0.969, rel=1e-12)
    assert BOND.shear_strength == pytest.approx(np.sqrt(2.0 * 1000.0 * 0.969), rel=1e-14)
    told = BOND.describe()
    assert "plastic slip 0.020264048" in told
    assert "slip 0.06428677" in told


def test_shear_breaks_where_the_closed_form_says() -> None:
    """At the traction sqrt(2 k_t a0) the plastic slip is (t_c - sigma_y)/kappa; work to there is that in shear."""
    fine = SLIP_AT_BREAK + 1e-8 * np.arange(-5, 6)
    place, state, work, lost = broken(BOND, (0.0, 1.0), np.concatenate([[0.01, 0.03, 0.045, 0.06], fine]))
    assert place[1] == pytest.approx(SLIP_AT_BREAK, abs=2e-8)
    assert state["plastic_slip"][0, 0] == pytest.approx(PLASTIC_AT_BREAK, abs=2e-8)
    assert work == pytest.approx(BOND.shear_energy, rel=2e-6)
    assert lost == pytest.approx(0.969 + 30.0 * PLASTIC_AT_BREAK, rel=2e-6)


def test_opening_breaks_at_its_own_energy() -> None:
    exact = np.sqrt(2.0 * 0.969 / 2000.0)
    place, state, work, lost = broken(BOND, (-1.0, 0.0), np.array([0.01, 0.02, exact - 1e-9, exact + 1e-9]))
    assert -place[0] == pytest.approx(exact, abs=2e-9)
    assert not state["plastic_slip"].any()
    assert work == pytest.approx(0.969, rel=1e-6)
    assert lost == pytest.approx(0.969, rel=1e-12)


def test_mixed_modes_cost_between_both() -> None:
    sizes = np.linspace(0.0, 0.07, 301)[1:]
    costs = [broken(BOND, (-np.cos(a), np.sin(a)), sizes)[2] for a in np.linspace(0.0, 0.5 * np.pi, 4)]
    assert all(0.968 <= cost <= BOND.shear_energy * 1.02 for cost in costs)
    assert (np.diff(costs) >= -0.02).all()
    assert costs[-1] > costs[0] + 0.7


def test_a_break_is_found_on_the_way_of_a_step() -> None:
    """One step far beyond the break leaves the plastic slip, and loses the energy, of the closed form."""
    start, far = np.zeros((1, 2)), np.array([[0.0, 0.5]])
    state = BOND.start(RIGID, start)
    new = advanced(BOND, state, start, far)
    assert new["plastic_slip"][0, 0] == pytest.approx(PLASTIC_AT_BREAK, abs=1e-9)
    step = LocalStep(0.1, 10.0, start)
    gone = BOND.dissipated(RIGID, state, new, step, far, 0.0 * far) + BOND.stored(RIGID, new, far)
    assert gone[0] == pytest.approx(BOND.shear_energy, rel=1e-9)


def test_what_yields_backwards_is_kinematic_hardening() -> None:
    """After the plastic slip p the traction of the next yield backwards is kappa p - sigma_y."""
    places = [np.array([[0.0, slip]]) for slip in (0.0, 0.05, 0.0, -0.03)]
    states = [BOND.start(RIGID, places[0])]
    for before, after in itertools.pairwise(places):
        states.append(advanced(BOND, states[-1], before, after))
    forward = (1000.0 * 0.05 - 30.0) / (1000.0 + 692.0)
    assert states[1]["plastic_slip"][0, 0] == pytest.approx(forward, rel=1e-12)
    elastic = -1000.0 * forward
    assert elastic > 692.0 * forward - 30.0  # it does not yet yield backwards
    assert states[2]["plastic_slip"][0, 0] == pytest.approx(forward, rel=1e-12)
    back = states[3]["plastic_slip"][0, 0]
    assert back == pytest.approx(forward + (1000.0 * (-0.03 - forward) - 692.0 * forward + 30.0) / 1692.0, rel=1e-12)


@pytest.mark.parametrize(("bonded", "components"), [(True, 2), (False, 3), slow(True, 3), slow(False, 2)])
def test_the_law_of_a_step_passes_the_kit(bonded: bool, components: int) -> None:
    state = kept(bond=np.array([float(bonded)]), plastic_slip=np.full((1, components - 1), 0.01))
    step = LocalStep(0.1, 10.0, np.zeros((1, components)))
    for normal in (Signorini(), Compliance(5e3)):
        check_vector_law(BOND.law(ContactLaw(normal).at(None), state, step), reach=0.1, components=components)


def test_the_law_of_a_step_has_the_plastic_slip_minimised() -> None:
    """Against a minimisation over the plastic slip by scipy, in space."""
    random = np.random.default_rng(3)
    plastic = random.uniform(-0.02, 0.02, (8, 2))
    state, r = kept(bond=np.ones(8), plastic_slip=plastic), random.uniform(-0.08, 0.08, (8, 3))
    r[:, 0] = -np.abs(r[:, 0])
    value, new = law_at(BOND, state, r).value(r), BOND._plastic(state, r)
    at_rest = []
    for i in range(8):

        def energy(pi: Array, s: Array, i: int = i) -> float:
            hardening = 0.5 * 692.0 * float(pi @ pi)
            return 500.0 * float((s - pi) @ (s - pi)) + hardening + 30.0 * float(np.linalg.norm(pi - plastic[i]))

        def least(s: Array, i: int = i) -> tuple[float, Array]:
            runs = [
                minimize(energy, start, args=(s,), method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13})
                for start in (plastic[i], plastic[i] + 0.3 * (s - plastic[i]), s)
            ]
            best = min(runs, key=lambda run: run.fun)
            return float(best.fun), best.x

        with_slip, place = least(r[i, 1:])
        at_rest.append(with_slip - least(np.zeros(2))[0] + 1000.0 * r[i, 0] ** 2)
        assert new[i] == pytest.approx(place, abs=1e-6)
    assert value == pytest.approx(np.array(at_rest), abs=1e-7)


# ---- bodies --------------------------------------------------------------------------------------------------


def of_bonds(**scaled: float) -> PlasticBond:
    return replace(BOND, **{what: factor * getattr(BOND, what) for what, factor in scaled.items()})


def bonded_block(way: tuple[float, float], unit: float = 1.0, **contact: Any) -> hv.ContactProblem:
    """A stiff block on bonds, its top moved along a way; lengths in units of ``unit`` mm."""

    def moved(x: Array, t: float) -> Array:
        return np.tile(np.array(way) * t / unit, (len(x), 1))

    bond = of_bonds(stiffness=unit**3, shear_stiffness=unit**3, energy=unit, yield_traction=unit**2, hardening=unit**3)
    return hv.ContactProblem(
        hv.rectangle((1.0 / unit, 0.5 / unit), (8, 4)), hv.Material.young(1e9 * unit**2, 0.3),
        {"bottom": hv.Contact(hv.Signorini(), **{"memory": (bond,), **contact})}, {"top": hv.Prescribed(moved)},
    )  # fmt: skip


def peeled(way: tuple[float, float], far: float, **material: float) -> hv.ContactProblem:
    """A soft cantilever on bonds, pulled at its top by a traction that grows to ``far`` along a way."""

    def pull(x: Array, t: float) -> Array:
        return np.tile(np.array(way) * t * far, (len(x), 1))

    return hv.ContactProblem(
        hv.rectangle((2.0, 0.5), (16, 4)), hv.Material.young(3000.0, 0.3, **material),
        {"bottom": hv.Contact(hv.Signorini(), memory=(BOND,))}, {"left": hv.Clamped()}, tractions={"top": pull},
    )  # fmt: skip


def state(history: hv.evolution.History) -> tuple[Array, Array]:
    """Bonds and plastic slip at the end."""
    known = history.state.memory["bottom"]
    return known["0.bond"], known["0.plastic_slip"]


@pytest.mark.parametrize("method", [None, slow(hv.solvers.NonsmoothMultigrid())])
@pytest.mark.parametrize("unit", [slow(1.0), 1e3])
def test_a_stiff_block_is_one_material_point(method: hv.solvers.Solver | None, unit: float) -> None:
    """Sheared, and then opened: when it breaks, its plastic slip, and what it costs."""
    sheared = hv.Evolution(bonded_block((1.0, 0.0), unit))
    before = hv.march(sheared, 0.064, step=0.002, method=method)
    assert before.ended == "finished"
    assert state(before)[0].all()
    assert state(before)[1] == pytest.approx((1000.0 * 0.064 - 30.0) / 1692.0 / unit, rel=1e-5)
    assert float(before["contact"][-1]) + float(before["memory"][-1]) < BOND.shear_energy
    after = hv.march(sheared, 0.066, step=0.002, method=method)
    assert not state(after)[0].any()
    left = np.abs(after.state.multiplier[:, 1]).max()  # in the step in which they break: rounding of the stiff block
    assert left <= 1e-15 * 1e9 * unit**2
    assert state(after)[1] == pytest.approx(PLASTIC_AT_BREAK / unit, rel=1e-5)
    assert after["memory"][-1] == pytest.approx(0.969 + 30.0 * PLASTIC_AT_BREAK, rel=1e-5)
    assert after["memory"][-1] + after["contact"][-1] == pytest.approx(BOND.shear_energy, rel=1e-5)
    opened = hv.march(hv.Evolution(bonded_block((0.0, 1.0), unit)), 0.033, step=0.001, method=method)
    assert opened["memory"][-1] == pytest.approx(0.969, rel=1e-12)
    whole = [row.time for row in opened.steps if row.values["memory"] == 0.0]
    assert whole[-1] == pytest.approx(0.031, abs=1e-12)  # sqrt(2 a0/k) = .03113


@pytest.mark.parametrize(("way", "far"), [((0.4, 1.0), 90.0), slow((1.0, 0.2), 160.0)])
def test_a_soft_cantilever_peels_and_makes_no_energy(way: tuple[float, float], far: float) -> None:
    """While all bonds hold the loss of the scheme falls with the step; when they break, no energy is made."""
    lost = []
    for count in (20, 40):
        history = hv.march(hv.Evolution(peeled(way, far)), 1.0, step=1.0 / count)
        assert history.ended == "finished"
        assert state(history)[0].min() == 0.0
        assert np.abs(history["gap"]).max() <= 1e-7 * history["work"][-1]
        assert (history["numerical"] >= -1e-3 * history["work"][-1]).all()
        whole = history["memory"] < 0.25 * 0.969  # before the first point breaks, of a measure of 1/8
        last = int(np.flatnonzero(whole)[-1])
        lost.append(float(history["numerical"][last] / history["work"][last]))
    assert lost[1] <= 0.7 * lost[0]


@pytest.mark.parametrize("scheme", [hv.evolution.ImplicitEuler(), slow(hv.evolution.GeneralizedAlpha(0.8))])
def test_a_body_with_mass_and_viscosity_peels_in_adaptive_steps(scheme: Any) -> None:
    problem = peeled((1.0, 0.6), 80.0, density=1e-3, viscosity=(2.0, 1.0))
    evolution = hv.Evolution(problem, inertia=True)
    step = hv.evolution.AdaptiveStep(rtol=2e-2, first_step=0.05)
    event = hv.evolution.BondBroken(then="record")
    history = hv.march(evolution, 1.0, step=step, scheme=scheme, events=[event])
    assert history.ended == "finished"
    assert history.events[0][1] == "bond broken"
    assert state(history)[0].min() == 0.0
    assert np.abs(history["gap"]).max() <= 1e-6 * history["work"][-1]


def test_a_step_has_rounds_for_every_bond(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the last step a front runs along the whole body, a few bonds in each round."""
    monkeypatch.setattr(stepper, "_ROUNDS", 2)
    history = hv.march(hv.Evolution(peeled((0.4, 1.0), 90.0)), 1.0, step=0.05)
    assert history.ended == "finished"
    assert state(history)[0].min() == 0.0


def test_what_does_not_settle_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stepper, "_ROUNDS", -14)  # less than one round for each of the bonds
    history = hv.march(hv.Evolution(peeled((0.4, 1.0), 90.0)), 1.0, step=0.05)
    assert history.ended == "not_contracting"
    assert any("do not converge" in one for one in history.messages)


def test_bonds_stand_beside_other_boundaries_and_in_space() -> None:
    """A block in space, bonded below and pressed against a wall with friction, sheared along two axes."""

    def moved(x: Array, t: float) -> Array:
        return np.tile(t * np.array([0.6, 0.8, 0.0]), (len(x), 1))

    problem = hv.ContactProblem(
        hv.box((1.0, 1.0, 0.5), (2, 2, 1)), hv.Material.young(1e9, 0.3),
        {
            "bottom": hv.Contact(hv.Signorini(), memory=(BOND,)),
            "front": hv.Contact(Compliance(10.0), Tresca(0.1), gap=1.0),
        },
        {"top": hv.Prescribed(moved)},
    )  # fmt: skip
    history = hv.march(hv.Evolution(problem), 0.066, step=0.006)
    assert history.ended == "finished"
    apart = history.discrete.problem.contact.points[history.discrete.problem.contact.on("bottom")][:, 1] > 0.0
    bond, plastic = (known[apart] for known in state(history))
    assert not bond.any()
    assert np.linalg.norm(plastic, axis=1) == pytest.approx(np.full(len(plastic), PLASTIC_AT_BREAK), rel=1e-4)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PlasticBond(0.0, 1.0, 1.0, 1.0, 1.0), "stiffness of memory 'plastic-bond' is 0"),
        (lambda: PlasticBond(1.0, 1.0, -1.0, 1.0, 1.0), "energy of memory 'plastic-bond' is -1"),
        (lambda: PlasticBond(1.0, 1.0, 1.0, "much", 1.0), "yield_traction of memory"),  # type: ignore[arg-type]
        (lambda: PlasticBond(1.0, 1.0, 1.0, 1.0, np.inf), "hardening of memory"),
        (lambda: PlasticBond.of_energies(1e3, 1e3, 0.969, 1.7, 50.0), "not reached before the break at 44.0"),
        (lambda: PlasticBond.of_energies(1e3, 1e3, 0.969, 0.9, 30.0), "must exceed the energy of opening"),
        (lambda: MemoryChain((BOND, Wear(0.1))), "put it last"),
        (lambda: marched_bond(friction=Tresca(1.0)), "leave the friction out"),
        (lambda: marched_bond(damping=PiecewiseQuadratic([0.0], [1.0, 1.0], [0.0])), "damping of the normal rate"),
        (lambda: hv.solve(bonded_block((1.0, 0.0)).at_time(0.0)), "which means something in time only"),
    ],
)  # fmt: skip
def test_bad_input_is_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words):
        make()


def marched_bond(**contact: Any) -> hv.evolution.History:
    return hv.march(hv.Evolution(bonded_block((1.0, 0.0), **contact)), 0.01, step=0.01)
