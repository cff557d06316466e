"""Marches of slender bodies on stiff glue: what a step costs, and where it ends."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, barrier, march, stage_solver, walk
from hemivar.laws import BenzeggaghKenane, BilinearCohesion, MixedMode, ModeDependentGlue
from tests.samples import slow

#: A data sheet's layer between arms of aluminium: MPa/mm, MPa, N/mm.
STIFF, STRENGTH, ENERGY = 2e4, 10.0, 0.25
FIRST, LAST = STRENGTH / STIFF, 2.0 * ENERGY / STRENGTH
SHUT = hv.Compliance(STIFF)
ADHESIVE = hv.Adhesive(STIFF, STRENGTH, STRENGTH / (LAST - FIRST), STIFF)
LAWS = {
    "adhesive": hv.Contact(ADHESIVE),
    "with friction": hv.Contact(ADHESIVE, hv.Tresca(1.0)),
    "without memory": hv.Contact(ADHESIVE, memory=()),
    "mixed mode": hv.Contact(MixedMode(BilinearCohesion(STRENGTH, ENERGY, STIFF), 1.0, SHUT)),
    "two energies": hv.Contact(
        ModeDependentGlue(STRENGTH, 12.0, STIFF, BenzeggaghKenane(ENERGY, 2.0 * ENERGY, 2.0), 0.5 * STIFF, SHUT)
    ),
}


def arm(contact: hv.Contact, cells: int = 20, **more: object) -> hv.ContactProblem:
    """Half of a double cantilever, 50 mm of crack and 40 mm of glue."""
    mesh = hv.rectangle((90.0, 3.0), (cells, 2)).with_boundaries(
        {
            "end": lambda x: x[:, 0] < 1e-9,
            "far": lambda x: x[:, 0] > 90.0 - 1e-9,
            "glue": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 50.0),
        }
    )
    material = hv.Material.young(70e3, 0.3, plane="stress")
    return hv.ContactProblem(mesh=mesh, order=2, material=material, contact={"glue": contact}, **more)  # type: ignore[arg-type]


def arm_moved(contact: hv.Contact, rate: float) -> Evolution:
    """Its end is moved away."""
    end = hv.Fixed(y=lambda x, t: np.full(len(x), rate * t))
    return Evolution(arm(contact, supports={"end": end, "far": "roller"}))


def arm_under_load(contact: hv.Contact, most: float) -> Evolution:
    """A dead load grows there."""
    return Evolution(
        arm(contact, supports={"far": "roller"}, tractions={"end": lambda x, t: np.tile([0.0, most * t], (len(x), 1))})
    )


@pytest.fixture
def solves(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How often each stage asked for an equilibrium, whether it was one or not."""
    counts: list[int] = []

    def counted(owner: object, name: str) -> None:
        ask = getattr(owner, name)

        def asked(*given: object, **more: object) -> object:
            counts[-1] += 1
            return ask(*given, **more)

        monkeypatch.setattr(owner, name, asked)

    for owner, name in ((stage_solver, "active_set_newton"), (stage_solver, "solve"), (walk.Walk, "_step")):
        counted(owner, name)
    whole = stage_solver.StageSolver.solution

    def stage(*given: object) -> object:
        counts.append(0)
        return whole(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(stage_solver.StageSolver, "solution", stage)
    return counts


@pytest.mark.parametrize("name", LAWS)
def test_steps_of_stiff_glue_cost_a_few_static_solves(name: str, solves: list[int]) -> None:
    """Elastic steps and steps in which the front softens; with a margin of -1e4."""
    history = march(arm_moved(LAWS[name], 0.5), 1.0, step=0.25)
    assert history.finished
    assert history.margin < -1e3
    assert not history["jumped"].any()
    assert max(solves) <= 5
    opened = -history.frames[-1].local[:, 0].min()
    assert FIRST < opened < LAST


@pytest.mark.parametrize("name", ["adhesive", "mixed mode"])
def test_a_jump_of_stiff_glue_costs_tens_of_static_solves(name: str, solves: list[int]) -> None:
    """Under a dead load the front runs through at once, along 18 points."""
    history = march(arm_under_load(LAWS[name], 4.0), 1.0, step=0.25)
    assert history.finished
    assert history["jumped"].sum() == 1
    assert max(solves) <= 51
    assert -history.frames[-1].local[0, 0] > 10.0 * LAST


def halves(contact: hv.Contact, **more: object) -> hv.ContactProblem:
    """A double cantilever that is one body: open up to 49.5 mm, glued beyond, clamped at the far end."""
    mesh = hv.rectangle((90.0, 6.0), (20, 4), origin=(0.0, -3.0))
    x, y = mesh.points[mesh.cells].mean(axis=1).T
    parts = {"top": (y > 0.0) & (x > 49.0), "low": (y < 0.0) & (x > 49.0)}
    arms = {"top arm": (y > 0.0) & (x < 49.0), "low arm": (y < 0.0) & (x < 49.0)}
    mesh = mesh.named({}, {name: np.flatnonzero(chosen) for name, chosen in (parts | arms).items()})
    mesh = mesh.marked({"up": "x < 1e-9 and y > -1e-9", "down": "x < 1e-9 and y < 1e-9", "far": "x > 90 - 1e-9"})
    mesh = mesh.opened("crack", between=("top arm", "low arm")).opened("glue", between=("top", "low"))
    supports = {"far": "clamped", **more.pop("supports", {})}  # type: ignore[dict-item]
    joint = {"glue:top": replace(contact, against="glue:low")}
    material = hv.Material.young(70e3, 0.3, plane="stress")
    return hv.ContactProblem(mesh, material, joint, supports, order=2, **more)  # type: ignore[arg-type]


def forced(contact: hv.Contact, up: float, down: float) -> Evolution:
    """Dead loads grow on its two ends."""

    def growing(load: float) -> object:
        return lambda x, t: np.tile([0.0, load * t], (len(x), 1))

    return Evolution(halves(contact, tractions={"up": growing(up), "down": growing(-down)}))


@pytest.mark.parametrize("name", [*LAWS, "coulomb"])
def test_steps_of_an_opened_joint_cost_a_few_static_solves(name: str, solves: list[int]) -> None:
    """Both ends are moved apart; with memory, friction, both or neither."""
    contact = LAWS.get(name, hv.Contact(ADHESIVE, hv.Coulomb(0.3)))

    def moving(rate: float) -> hv.Fixed:
        return hv.Fixed(y=lambda x, t: np.full(len(x), rate * t))

    history = march(Evolution(halves(contact, supports={"up": moving(0.5), "down": moving(-0.5)})), 1.0, step=0.25)
    assert history.finished
    assert history.margin < -1e2
    assert not history["jumped"].any()
    assert max(solves) <= 5
    assert FIRST < -history.frames[-1].local[:, 0].min() < LAST


@pytest.mark.parametrize("name", [slow("adhesive"), "with friction", slow("mixed mode"), slow("two energies")])
def test_a_jump_of_an_opened_joint_costs_tens_of_static_solves(name: str, solves: list[int]) -> None:
    history = march(forced(LAWS[name], 4.0, 4.0), 1.0, step=0.25)
    assert history.finished
    assert history["jumped"].sum() == 1
    assert max(solves) <= 50


@pytest.mark.parametrize(("down", "friction"), [(4.0, 0.3), *(slow(d, f) for d in (3.2, 2.0) for f in (0.1, 0.3, 0.6))])
def test_coulombs_friction_beside_glue_jumps_as_glue_does(down: float, friction: float, solves: list[int]) -> None:
    """Where the ends are pulled alike nothing slips, and friction does nothing; else it keeps to its bound.

    Each try of the walk counts; one costs less than a static solve.
    """
    contact = hv.Contact(ADHESIVE, hv.Coulomb(friction))
    history = march(forced(contact, 4.0, down), 1.0, step=0.25)
    assert history.finished
    assert history["jumped"].sum() == 1
    assert max(solves) <= 60
    end = history.frames[-1]
    assert (np.abs(end.multiplier[:, 1]) <= friction * np.maximum(end.multiplier[:, 0], 0.0) + 1e-8).all()
    if down == 4.0:
        free = march(forced(LAWS["adhesive"], 4.0, 4.0), 1.0, step=0.25).frames[-1]
        np.testing.assert_allclose(end.local[:, 0], free.local[:, 0], atol=1e-6)


def test_a_cycle_of_a_lap_joint_costs_a_hundred_static_solves(solves: list[int]) -> None:
    """Damaged glue unloads along its secants: without load nothing is left of the displacement, and with it the joint
    is where it was."""
    glue = ModeDependentGlue(35.0, 25.0, 21008.0, BenzeggaghKenane(0.5, 1.2, 2.0), 4596.0, hv.Compliance(21008.0))
    upper = hv.rectangle((100.0, 1.6), (100, 1)).marked({"overlap": "y < 1e-6 and x > 87.4"})
    lower = hv.rectangle((100.0, 1.6), (100, 1), origin=(87.5, -1.6)).marked({"overlap": "y > -1e-6 and x < 100.1"})
    problem = hv.ContactProblem(
        hv.Mesh.assembled({"upper": upper, "lower": lower}),
        hv.Material.young(70e3, 0.33),
        {"upper:overlap": hv.Contact(glue, against="lower:overlap")},
        {"upper:left": "clamped", "lower:right": hv.Fixed(y=0.0)},
        tractions={"lower:right": lambda x, t: np.tile([100.0 * (1.0 - abs((t % 2.0) - 1.0)), 0.0], (len(x), 1))},
        order=2,
    )
    history = march(Evolution(problem), 3.0, step=0.125)
    assert history.finished
    assert history["memory"][-1] > 0.1
    assert sum(solves) <= 100
    loaded, free, again = (history.frames[k] for k in (8, 16, 24))
    np.testing.assert_allclose(free.displacement, 0.0, atol=1e-8)
    np.testing.assert_allclose(again.local, loaded.local, atol=1e-8)


@pytest.mark.parametrize("seed", [0, 2, slow(1), slow(3), slow(4)])
def test_where_the_walk_ends_the_state_is_that_of_short_steps(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Random strips on glue, moved until it has let go: by steps that grow, and by those of a viscosity."""
    rng = np.random.default_rng(seed)
    stiff = float(10.0 ** rng.uniform(0.5, 1.5))
    strength, last = 0.02 * stiff, float(rng.uniform(0.05, 0.1))
    law = hv.Adhesive(stiff, strength, strength / (last - 0.02), stiff)
    if seed % 2:
        law = MixedMode(BilinearCohesion(strength, 0.5 * strength * last, stiff), 1.0, hv.Compliance(stiff))
    held = {"left": hv.Fixed(y=lambda x, t: np.full(len(x), 0.6 * t)), "right": "roller"}
    mesh = hv.rectangle((float(rng.uniform(1.0, 3.0)), 0.5), (int(rng.integers(3, 7)), 2))
    contact = {"bottom": hv.Contact(law, memory=())}
    evolution = Evolution(hv.ContactProblem(mesh, hv.Material.lame(10.0, 10.0), contact, held))
    found = march(evolution, 1.0, step=0.1)
    for name in ("_walked", "_without_barrier"):
        monkeypatch.setattr(stage_solver.StageSolver, name, lambda *given: None)
    crept = march(evolution, 1.0, step=0.1)
    assert found.finished
    assert crept.finished
    assert found.margin < -0.5
    both = np.intersect1d(found.times, crept.times)  # the others take a shorter step where they do not settle
    assert both.size > 9
    for time in both:
        one, other = (history.frames[int(np.argmax(history.times == time))] for history in (found, crept))
        np.testing.assert_allclose(one.local, other.local, atol=1e-8)


def test_a_body_that_hangs_on_glue_alone_ends_broken() -> None:
    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    pull = {"top": lambda x, t: np.tile([0.0, t], (len(x), 1))}
    contact = {"bottom": hv.Contact(hv.Adhesive(20.0, 0.5, 5.0, 20.0))}
    problem = hv.ContactProblem(mesh, hv.Material.lame(40.0, 40.0), contact, {"left": "roller"}, tractions=pull)
    history = march(Evolution(problem), 1.0, step=0.1)
    assert history.ended == "broken"
    assert history.state.time == pytest.approx(0.5, abs=0.11)  # the strength of the glue
    assert any("broken at t = " in message for message in history.messages)


@pytest.mark.parametrize(("far", "bends"), [(0.019, False), (0.021, True)])
def test_a_way_bends_downwards_between_two_even_places(far: float, bends: bool) -> None:
    """Glue that softens on a thousandth of the way only, steeper than the body beside it is stiff."""
    law = hv.Contact(hv.Adhesive(100.0, 2.0, 2.0 / 1e-5, 100.0)).law.at(None)
    start, end = np.zeros((1, 2)), np.array([[-far, 0.0]])
    for times in (1.0, 3.0):
        body = np.full(barrier.PARTS, 1e3 * far**2)
        found = barrier.bends_downwards(law, np.array([times]), start, end, times * body)
        assert found is bends


def test_ways_bend_as_the_laws_of_all_points_do_together() -> None:
    """One point softens where another one hardens; against second differences of the energy on a fine grid."""
    law = hv.Contact(hv.Adhesive(10.0, 1.0, 4.0, 10.0)).law.at(None)
    start, end, weights = np.zeros((2, 2)), np.array([[-0.2, 0.0], [-0.05, 0.01]]), np.array([1.0, 2.0])
    for stiff in (0.05, 0.1, 0.2):
        body = np.full(barrier.PARTS, stiff)
        along = np.linspace(0.0, 1.0, 20_001)
        energy = np.array([weights @ law.value(start + t * (end - start)) for t in along]) + 0.5 * stiff * along**2
        least = float(np.diff(energy, 2).min()) / (along[1] - along[0]) ** 2
        found: Array = barrier.second_derivatives(law, weights, start, end, body)[0]
        assert found.min() == pytest.approx(least, rel=1e-3, abs=1e-6)
        assert barrier.bends_downwards(law, weights, start, end, body) == (least < 0.0)


@pytest.mark.parametrize("steps", [2, 4, pytest.param(20, marks=pytest.mark.slow)])
def test_a_gap_that_opens_is_a_support_that_moves_away(steps: int) -> None:
    """The glue opens by the same, and no step is a jump."""
    sides, opened = {"left": hv.Fixed(x=0.0), "right": hv.Fixed(x=0.0)}, []
    for gap, top in (
        (lambda x, t: np.full(len(x), 0.082 * t), hv.Clamped()),
        (0.0, hv.Prescribed(lambda x, t: np.column_stack([0.0 * x[:, 0], 0.082 * t + 0.0 * x[:, 0]]))),
    ):
        contact = {"bottom": hv.Contact(hv.Adhesive(20.0, 0.4, 0.4 / 0.06, 20.0), gap=gap)}
        problem = hv.ContactProblem(
            hv.rectangle((1.0, 0.5), (2, 4)), hv.Material.lame(1.0, 1.0), contact, {"top": top, **sides}
        )
        history = march(Evolution(problem), 1.0, step=1.0 / steps)
        assert history.finished
        assert not history["jumped"].any()
        opened.append(history.frames[-1].local[:, 0])
    np.testing.assert_allclose(*opened, rtol=1e-6)


def test_a_step_that_softens_keeps_to_its_time() -> None:
    evolution = arm_under_load(LAWS["adhesive"], 2.0)
    assert march(evolution, 1.0, step=0.5, controls=hv.Controls(max_time=1e-9)).ended == "max_time"


def test_a_walk_keeps_to_the_time_that_a_step_may_take(monkeypatch: pytest.MonkeyPatch) -> None:
    """The clock of a step's limit goes on by one second whenever it is looked at: a jump of 40 takes longer than 3."""
    ticks = iter(range(100000))
    monkeypatch.setattr(walk, "Budget", lambda limit: SimpleNamespace(due=lambda: float(next(ticks) > limit)))
    limited = march(arm_under_load(LAWS["adhesive"], 4.0), 1.0, step=0.25, controls=hv.Controls(max_time=3.0))
    assert limited.ended == "max_time"
    assert limited.times[-1] >= 0.25
    assert next(ticks) < 10
