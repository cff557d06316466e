"""Bonds with plastic slip: closed forms of a material point, the law of a step, blocks, energy, refusals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import bonded_steps
from hemivar.laws import BondState, Compliance, PlasticBond, Secant, Tresca
from hemivar.laws.vector_testing import check_vector_law
from tests.samples import slow

#: mm, N, MPa; the hardening is rounded in the reference.
BOND = PlasticBond(stiffness=2000.0, shear_stiffness=1000.0, energy=0.969, yield_traction=30.0, hardening=692.0)
SLIP_AT_BREAK, PLASTIC_AT_BREAK = 0.064286770, 0.020264048


def broken(bond: PlasticBond, way: tuple[float, float], sizes: Array) -> tuple[Array, BondState, float, float]:
    """Where a material point breaks on a straight way; its state, the work done and the energy lost until then."""
    state, work, lost, last, force = bond.start(), 0.0, 0.0, np.zeros((1, 2)), np.zeros(2)
    for size in sizes.tolist():
        r = np.array([way]) * size
        now = bond.step_law(state).near(r).nearest_multiplier(np.zeros((1, 2)))[0]
        new = bond.advance(state, r)
        work += float((0.5 * (now + force) * (r - last)[0]).sum())
        lost += float(bond.dissipated(state, new)[0])
        if not new.bonded[0]:
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
    assert state.plastic[0, 0] == pytest.approx(PLASTIC_AT_BREAK, abs=2e-8)
    assert work == pytest.approx(BOND.shear_energy, rel=2e-6)
    assert lost == pytest.approx(0.969 + 30.0 * PLASTIC_AT_BREAK, rel=2e-6)


def test_opening_breaks_at_its_own_energy() -> None:
    exact = np.sqrt(2.0 * 0.969 / 2000.0)
    place, state, work, lost = broken(BOND, (-1.0, 0.0), np.array([0.01, 0.02, exact - 1e-9, exact + 1e-9]))
    assert -place[0] == pytest.approx(exact, abs=2e-9)
    assert not state.plastic.any()
    assert work == pytest.approx(0.969, rel=1e-6)
    assert lost == pytest.approx(0.969, rel=1e-12)


def test_mixed_modes_cost_between_both() -> None:
    sizes = np.linspace(0.0, 0.07, 301)[1:]
    costs = [broken(BOND, (-np.cos(a), np.sin(a)), sizes)[2] for a in np.linspace(0.0, 0.5 * np.pi, 4)]
    assert all(0.968 <= cost <= BOND.shear_energy * 1.02 for cost in costs)
    assert (np.diff(costs) >= -0.02).all()
    assert costs[-1] > costs[0] + 0.7


def test_what_yields_backwards_is_kinematic_hardening() -> None:
    """After the plastic slip p the traction of the next yield backwards is kappa p - sigma_y."""
    state = BOND.start()
    for slip in (0.05, 0.0):
        state = BOND.advance(state, np.array([[0.0, slip]]))
    forward = (1000.0 * 0.05 - 30.0) / (1000.0 + 692.0)
    assert BOND.advance(BOND.start(), np.array([[0.0, 0.05]])).plastic[0, 0] == pytest.approx(forward, rel=1e-12)
    elastic = -1000.0 * forward
    assert elastic > 692.0 * forward - 30.0  # it does not yet yield backwards
    assert state.plastic[0, 0] == pytest.approx(forward, rel=1e-12)
    back = BOND.advance(state, np.array([[0.0, -0.03]])).plastic[0, 0]
    assert back == pytest.approx(forward + (1000.0 * (-0.03 - forward) - 692.0 * forward + 30.0) / 1692.0, rel=1e-12)


@pytest.mark.parametrize(("bonded", "components"), [(True, 2), (False, 3), slow(True, 3), slow(False, 2)])
def test_the_law_of_a_step_passes_the_kit(bonded: bool, components: int) -> None:
    state = BondState(np.array([bonded]), np.full((1, components - 1), 0.01))
    for bond in (BOND, PlasticBond(2000.0, 1000.0, 0.969, 30.0, 692.0, Compliance(5e3))):
        check_vector_law(bond.step_law(state), reach=0.1, components=components)


def test_the_law_of_a_step_has_the_plastic_slip_minimised() -> None:
    """Against a minimisation over the plastic slip by scipy, in space."""
    random = np.random.default_rng(3)
    plastic = random.uniform(-0.02, 0.02, (8, 2))
    state, r = BondState(np.ones(8, dtype=bool), plastic), random.uniform(-0.08, 0.08, (8, 3))
    r[:, 0] = -np.abs(r[:, 0])
    value, new = BOND.step_law(state).value(r), BOND.advance(state, r)
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
        assert new.plastic[i] == pytest.approx(place, abs=1e-6)
    assert value == pytest.approx(np.array(at_rest), abs=1e-7)


# ---- bodies --------------------------------------------------------------------------------------------------


def pulled(way: tuple[float, float], young: float = 1e9) -> hv.ContactProblem:
    """A block on bonds, its top moved along a way."""

    def moved(x: Array, t: float) -> Array:
        return np.tile(np.array(way) * t, (len(x), 1))

    return hv.ContactProblem(
        hv.rectangle((1.0, 0.5), (8, 4)), hv.Material.young(young, 0.3), {"bottom": hv.Contact(hv.Signorini())},
        {"top": hv.Prescribed(moved)},
    )  # fmt: skip


@pytest.mark.parametrize("method", [None, hv.solvers.NonsmoothMultigrid()])
def test_a_stiff_block_is_one_material_point(method: hv.solvers.Solver | None) -> None:
    times = np.linspace(0.002, 0.066, 33)
    steps = list(bonded_steps(pulled((1.0, 0.0)), {"bottom": BOND}, times, method))
    assert all(step.solution.status.name == "CONVERGED" for step in steps)
    whole = [step for step in steps if step.states["bottom"].bonded.all()]
    assert whole[-1].time == pytest.approx(0.064, abs=1e-9)
    assert not steps[-1].states["bottom"].bonded.any()
    expected = (1000.0 * 0.064 - 30.0) / 1692.0
    assert whole[-1].states["bottom"].plastic[:, 0] == pytest.approx(expected, rel=1e-3)
    assert steps[-1].dissipated == pytest.approx(0.969 + 30.0 * (1000.0 * 0.066 - 30.0) / 1692.0, rel=1e-3)
    opened = list(bonded_steps(pulled((0.0, 1.0)), {"bottom": BOND}, np.linspace(0.002, 0.04, 20), method))
    first = next(step for step in opened if not step.states["bottom"].bonded.all())
    assert first.time == pytest.approx(0.032, abs=1e-9)
    assert opened[-1].dissipated == pytest.approx(0.969, rel=1e-6)


@pytest.mark.parametrize(("way", "far"), [((0.4, 1.0), 90.0), slow((1.0, 0.2), 160.0)])
def test_the_work_is_what_is_stored_and_lost_but_for_jumps(way: tuple[float, float], far: float) -> None:
    """A soft cantilever peels bond by bond: no energy is made, and while all hold the balance closes with the step."""

    def pull(x: Array, t: float) -> Array:
        return np.tile(np.array(way) * t, (len(x), 1))

    problem = hv.ContactProblem(
        hv.rectangle((2.0, 0.5), (16, 4)), hv.Material.young(3000.0, 0.3), {"bottom": hv.Contact(hv.Signorini())},
        {"left": hv.Clamped()}, tractions={"top": pull},
    )  # fmt: skip
    gaps: list[float] = []
    for count in (20, 40):
        work, last, gap, peeled = 0.0, None, 0.0, False
        for step in bonded_steps(problem, {"bottom": BOND}, np.linspace(0.0, far, count + 1)[1:]):
            discrete, u = step.solution.problem, step.solution.unknowns
            load, before = discrete.load, (0.0 * u, 0.0 * discrete.load) if last is None else last
            work += float(0.5 * (load + before[1]) @ (u - before[0]))
            last = (u, load)
            gap = work - float(discrete.bulk.value(u)) - step.stored - step.dissipated
            assert gap >= -1e-3 * work
            peeled |= not step.states["bottom"].bonded.all()
            if not peeled:
                whole = gap / work
        assert peeled
        gaps.append(abs(whole))
    assert gaps[1] <= 0.7 * gaps[0] + 1e-12


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PlasticBond(0.0, 1.0, 1.0, 1.0, 1.0), "stiffness of the plastic bond is 0"),
        (lambda: PlasticBond(1.0, 1.0, -1.0, 1.0, 1.0), "energy of the plastic bond is -1"),
        (lambda: PlasticBond(1.0, 1.0, 1.0, "much", 1.0), "yield_traction of the plastic bond"),  # type: ignore[arg-type]
        (lambda: PlasticBond(1.0, 1.0, 1.0, 1.0, np.inf), "hardening of the plastic bond"),
        (lambda: PlasticBond(1.0, 1.0, 1.0, 1.0, 1.0, 3.0), "the compression of the plastic bond"),  # type: ignore[arg-type]
        (lambda: PlasticBond.of_energies(1e3, 1e3, 0.969, 1.7, 50.0), "not reached before the break at 44.0"),
        (lambda: PlasticBond.of_energies(1e3, 1e3, 0.969, 0.9, 30.0), "must exceed the energy of opening"),
        (lambda: bonded_steps(pulled((1.0, 0.0)), {}, [1.0]), "bonds are empty"),
        (lambda: bonded_steps(pulled((1.0, 0.0)), {"top": BOND}, [1.0]), "there is no contact on this boundary"),
        (lambda: bonded_steps(pulled((1.0, 0.0)), {"bottom": 3.0}, [1.0]), "give a PlasticBond"),  # type: ignore[dict-item]
        (lambda: bonded_steps(pulled((1.0, 0.0)), {"bottom": BOND}, [1.0, 0.5]), "increasing"),
        (lambda: bonded_steps(pulled((1.0, 0.0)), {"bottom": BOND}, []), "at least one"),
        (lambda: bonded_steps("block", {"bottom": BOND}, [1.0]), "problem is 'block'"),  # type: ignore[arg-type]
        (
            lambda: bonded_steps(beside(hv.Contact(hv.Signorini(), Tresca(1.0))), {"bottom": BOND}, [1.0]),
            "has friction, damping or memory beside its bond",
        ),
        (
            lambda: bonded_steps(beside(hv.Contact(hv.Signorini(), memory=(Secant(),))), {"bottom": BOND}, [1.0]),
            "has friction, damping or memory beside its bond",
        ),
        (lambda: BOND.step_law(BondState(np.ones(2, dtype=bool), np.zeros((2, 1)))).at(np.zeros((3, 2))), "2 contact"),
    ],
)  # fmt: skip
def test_bad_input_is_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words):
        make()


def beside(contact: hv.Contact) -> hv.ContactProblem:
    plain = pulled((1.0, 0.0))
    return hv.ContactProblem(plain.mesh, plain.material, {"bottom": contact}, plain.supports)
