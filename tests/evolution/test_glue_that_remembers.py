"""Glue in time: unloading to the origin, breaks and jumps, the mode of onset, and marches by hand."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import AdaptiveStep, Checkpoint, History, Save
from hemivar.laws import LocalStep, Secant, VectorLaw, law_of_step
from hemivar.laws.coupled import (
    BenzeggaghKenane,
    BilinearCohesion,
    MixedMode,
    ModeDependentGlue,
    PowerCriterion,
)
from hemivar.laws.testing import check_vector_law
from hemivar.laws.vector_law import frozen_at
from tests import bodies
from tests.evolution.glue_by_hand import Glue, few_points, marched_by_hand
from tests.samples import sampled, slow

TIGHT = hv.Controls(rtol=1e-12)
SHUT = hv.Compliance(72.0)


def bilinear(alpha: float) -> BilinearCohesion:
    """Stiffness 24, strength 2.4 at the opening 0.1, then falling by alpha."""
    return BilinearCohesion(2.4, 0.5 * 2.4**2 * (1.0 / 24.0 + 1.0 / alpha), 24.0)


def same_in_all_modes() -> ModeDependentGlue:
    return ModeDependentGlue(2.4, 3.6, 24.0, BenzeggaghKenane(0.6, 0.6, 2.0), compression=SHUT)


LAWS: dict[str, hv.Superpotential | VectorLaw] = {
    "scalar": hv.Adhesive(24.0, 2.4, 6.0, 72.0),
    "mixed-mode": MixedMode(bilinear(6.0), 1.5, SHUT),
    "mode-dependent": same_in_all_modes(),
}


def pulled_along(law: hv.Superpotential | VectorLaw, path: list[float], step: float = 0.125, **more: object) -> History:
    """A column as stiff as a spring of 12 on glue, its far end moved by each of a path in a time of 1."""

    def move(x: Array, t: float) -> Array:
        return np.tile([0.0, np.interp(t, np.arange(len(path)), path)], (len(x), 1))

    contact = {name: more.pop(name) for name in ("memory",) if name in more}
    column = bodies.column(hv.Contact(law, **contact), top=hv.Prescribed(move))  # type: ignore[arg-type]
    options = {"step": step, "save": Save(every=1.0), "controls": TIGHT} | more
    return hv.march(hv.Evolution(column), len(path) - 1.0, **options)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_point_on_a_spring_unloads_to_the_origin_and_does_not_heal(law: hv.Superpotential | VectorLaw) -> None:
    """12 (d - w) = t(w): at d = 0.4 the opening 0.3, the traction 1.2 and the secant 4; half of both at d = 0.2."""
    history = pulled_along(law, [0.0, 0.4, 0.2, 0.4, 0.55, -0.1])
    assert history.finished
    opened = [-frame.local[0, 0] for frame in history.frames]
    traction = [-frame.multiplier[0, 0] for frame in history.frames]
    np.testing.assert_allclose(opened, [0.0, 0.3, 0.15, 0.3, 0.55, -0.1 / 7.0], atol=1e-10)
    np.testing.assert_allclose(traction, [0.0, 1.2, 0.6, 1.2, 0.0, -72.0 * 0.1 / 7.0], atol=1e-9)
    damaged = history.frames[1].memory
    np.testing.assert_allclose(damaged["0.opening"], 0.3, rtol=1e-10)
    np.testing.assert_allclose(1.0 - damaged["0.stiffness"] / 24.0, 5.0 / 6.0, rtol=1e-10)
    np.testing.assert_allclose(history["memory"][-1], 0.6, rtol=1e-10)
    half = [row for row in history.steps if row.time in (1.0, 2.0, 3.0)]
    for row in half:  # of G = 0.6 the half, less the triangle beneath the secant: 0.42 - 0.5 1.2 0.3 ...
        taken = 0.12 + 0.5 * (2.4 + 1.2) * 0.2 - 0.5 * 1.2 * 0.3
        assert row.values["memory"] == pytest.approx(taken, rel=1e-9)
        assert taken == pytest.approx(0.3, rel=1e-12)


def test_a_step_from_rest_under_no_load_stays_where_steep_glue_would_let_it_jump() -> None:
    history = pulled_along(MixedMode(bilinear(36.0), 1.0, SHUT), [0.0, 0.0])
    assert history.finished
    assert not history.frames[-1].local.any()


@pytest.mark.parametrize("degrees", [0.0, slow(30.0), 60.0, 90.0])
@pytest.mark.parametrize("two", [False, True], ids=["one energy", "two energies"])
def test_at_a_fixed_mode_the_point_is_one_of_rho(degrees: float, two: bool) -> None:
    """With springs kappa and kappa ratio^2 along normal and slip the balance is that of the point in rho."""
    glue = Glue(24.0, 2.4, 0.6, 1.25, 72.0, 1.1 if two else 0.0)
    still = few_points(glue, 1, [(0.0, 0.0)] * 2, 20.0, "cross").at_time(0.0)
    probe = hv.discretize(still, check_coercivity=False)
    B, weight = probe.contact.trace.toarray(), probe.contact.weights[0]
    condensed = np.linalg.inv(B @ np.linalg.solve(probe.stiffness.toarray(), B.T)) / weight
    assert abs(condensed[0, 1]) < 1e-12 * condensed[0, 0]
    normal, slip = np.diag(condensed)
    glue = Glue(24.0, 2.4, 0.6, float(np.sqrt(slip / normal)), 72.0, 1.1 if two else 0.0)
    turn = np.radians(degrees)
    mode = np.sin(turn) ** 2 if two else 0.0
    first, last = glue.curve(mode)
    alpha = 24.0 * first / (last - first)
    assert alpha < normal

    far = 0.5 * (first + last)
    most = far + alpha * (last - far) / normal  # normal (most - rho) = alpha (last - rho) at rho = far
    heading = np.array([np.sin(turn) / glue.ratio, np.cos(turn)])
    path = [most * part * heading for part in (0.0, 1.0, 0.5, 1.0, 1.1 * last / most)]
    problem = few_points(glue, 1, path, 20.0, "cross")  # type: ignore[arg-type]
    history = hv.march(hv.Evolution(problem), 4.0, step=0.125, save=Save(every=1.0), controls=TIGHT)
    rho = [glue.rho(frame.local[0]) for frame in history.frames]
    secant = alpha * (last - far) / far
    np.testing.assert_allclose(rho, [0.0, far, 0.5 * far, far, 1.1 * last], atol=2e-9)
    assert secant == pytest.approx(history.frames[2].memory["0.stiffness"][0], rel=1e-7)
    kept = 1.0 - secant / 24.0  # closing heals nothing
    np.testing.assert_allclose(history.damage[:, 0], [0.0, kept, kept, kept, 1.0], atol=1e-7)
    assert history["memory"][-1] == pytest.approx(
        weight * 0.5 * 24.0 * first * last, rel=1e-9
    )  # the energy of the mode
    if two:
        assert history.frames[-1].memory["0.mode"][0] == pytest.approx(mode, abs=1e-9)


@pytest.mark.parametrize("seed", sampled(range(300), 100))
def test_random_marches_are_those_by_hand(seed: int) -> None:
    """One to three points, of one fracture energy and of two; there is one solution in each step."""
    random = np.random.default_rng(seed)
    count, two = 1 + seed % 3, bool(random.integers(2))
    glue = Glue(
        24.0, 2.4, 0.6, random.uniform(0.7, 1.5), 72.0, random.uniform(0.6, 1.5) if two else 0.0,
        random.uniform(1.0, 3.0),
    )  # fmt: skip
    path = np.vstack([[0.0, 0.0], random.uniform([-0.5, -0.1], [0.5, 0.6], (4, 2))])
    problem = few_points(
        glue, count, path.tolist(), random.uniform(100.0, 200.0) if two else random.uniform(10.0, 40.0)
    )
    history = hv.march(hv.Evolution(problem), 4.0, step=0.25, controls=TIGHT)
    assert history.finished
    assert np.nanmin(history["margin"]) > 0.0
    times = [row.time for row in history.steps]
    assert len(history.frames) == len(times)
    for frame, (local, reached) in zip(history.frames, marched_by_hand(glue, problem, times), strict=True):
        np.testing.assert_allclose(frame.local, local, atol=1e-9)
        np.testing.assert_allclose(frame.memory["0.opening"], reached, atol=1e-9)
    done = max(abs(row.values["moved"]) for row in history.steps)
    assert max(abs(row.values["gap"]) for row in history.steps) < 1e-10 * done
    assert (np.diff(history["memory"]) >= -1e-12).all()


#: Glue of two fracture energies by both criteria.
CRITERIA = {
    "bk": ModeDependentGlue(2.4, 2.0, 24.0, BenzeggaghKenane(0.6, 0.9, 2.0), compression=SHUT),
    "power": ModeDependentGlue(2.4, 4.0, 24.0, PowerCriterion(0.6, 1.5, 1.3), 30.0, compression=SHUT),
}


@pytest.mark.parametrize("name", CRITERIA)
@pytest.mark.parametrize("seed", sampled(range(10), 5))
def test_every_way_to_the_break_takes_the_energy_of_the_mode_of_onset(name: str, seed: int) -> None:
    """A random walk, ended far away: what is lost is G(mode of onset), and so is the work, for nothing is stored."""
    law, memory, random = CRITERIA[name].at(None), Secant(), np.random.default_rng(seed)
    components = 2 + seed % 2
    corners = np.vstack([np.zeros(components), random.normal(scale=0.25, size=(8, components))])
    corners[-2:] = [[-2.0] + [0.5] * (components - 1), [-2.0] + [-1.0] * (components - 1)]
    parts = np.linspace(0.0, 1.0, 60, endpoint=False)[:, None]
    way = np.vstack([one + parts * (other - one) for one, other in itertools.pairwise(corners)])
    state, place = memory.start(law, way[:1]), way[:1]
    lam, lost, work, mode = np.zeros((1, components)), 0.0, 0.0, -1.0
    for r in way[1:, None]:
        step = LocalStep(1.0, 1.0, place)
        one = law_of_step(law, memory, state, step)
        after = memory.advance(law, state, step, r, lam)
        lost += float(memory.dissipated(law, state, after, step, r, lam)[0])
        now = frozen_at(one, r).nearest_multiplier(r, np.zeros_like(r))
        work += float((0.5 * (lam + now) * (r - place)).sum())
        if mode >= 0.0:
            assert after["mode"][0] == mode  # kept for ever
        state, place, lam, mode = after, r, now, float(after["mode"][0])
    energy = float(law.criterion.energy(np.array([mode]))[0][0])
    assert 0.6 <= energy <= law.criterion.values()[1][0]
    assert lost == pytest.approx(energy, rel=1e-12)
    assert work == pytest.approx(energy, rel=2e-2)


def test_a_tiny_onset_in_opening_fixes_mode_one() -> None:
    """Opened by a hair beyond the strength, then sheared to the break: G_I, and not G_II."""
    law, memory = CRITERIA["bk"].at(None), Secant()
    start = memory.start(law, np.array([[-0.1 - 1e-6, 0.0]]))
    end = memory.advance(law, start, LocalStep(1.0, 1.0, np.zeros((1, 2))), np.array([[-0.1, 3.0]]), np.zeros((1, 2)))
    assert start["mode"][0] == 0.0
    assert law.spent_by(end)[0] == pytest.approx(0.6, rel=1e-12)


@pytest.mark.parametrize("components", [2, 3])
def test_laws_of_damaged_glue_pass_the_kit(components: int) -> None:
    for opening in (0.05, 0.1, 0.3, 0.5):
        one = MixedMode(bilinear(6.0), 1.5, SHUT).at(None).unloading({"opening": np.array([opening])})
        check_vector_law(one, reach=0.7, components=components)


def test_the_law_of_a_step_keeps_the_mode_of_some_points_and_turns_with_that_of_others() -> None:
    law = CRITERIA["bk"].at(None)
    known = {"opening": np.array([0.3, 0.05]), "mode": np.array([0.25, -1.0])}
    one, r = law.unloading(known), np.array([[-0.1, 0.2], [-0.05, 0.3]])
    np.testing.assert_allclose(one.mode(r), [0.25, law.mode(r)[1]], rtol=1e-15)
    kept = law.at_mode(0.25).unloading({"opening": np.array([0.3])})
    np.testing.assert_allclose(one.traction(r)[:1], kept.nearest_multiplier(r[:1], 0.0 * r[:1]), rtol=1e-12)
    np.testing.assert_allclose(one.traction(r)[1:], law.traction(r[1:]), rtol=1e-12)
    assert one.lipschitz[0] == 0.0 < one.lipschitz[1]
    a = np.full((2, 2), 200.0)
    pair = one.on_graph(a * r + one.traction(r), a)
    np.testing.assert_allclose(pair.r, r, atol=1e-12)


def _lifted(law: VectorLaw, until: float, **more: object) -> History:
    """A block on glue whose top is moved off and along it."""

    def move(x: Array, t: float) -> Array:
        return np.tile([0.3 * np.sin(t), 0.35 * np.sin(2.0 * t)], (len(x), 1))

    memory = {key: more.pop(key) for key in ("memory",) if key in more}
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 0.5), 3),
        hv.Material.young(30.0, 0.3, **more.pop("material", {})),  # type: ignore[arg-type]
        {"bottom": hv.Contact(law, **memory)},  # type: ignore[arg-type]
        {"top": hv.Prescribed(move)},
    )
    inertia = bool(more.pop("inertia", False))
    return hv.march(hv.Evolution(problem, inertia=inertia), until, **{"step": 0.1, **more})


@pytest.mark.parametrize("name", ["mixed-mode", "mode-dependent"])
def test_a_march_is_taken_up_bit_by_bit(name: str, tmp_path: Path) -> None:
    law = LAWS["mixed-mode"] if name == "mixed-mode" else CRITERIA["bk"]
    assert isinstance(law, VectorLaw)
    kept = Checkpoint(tmp_path / "march.ckpt", 0.0)
    straight = _lifted(law, 1.25, step=0.125)
    assert straight.state.ledger.memory > 0.0
    _lifted(law, 0.625, step=0.125, checkpoint=kept)
    resumed = _lifted(law, 1.25, step=0.125, checkpoint=kept, resume=True)
    np.testing.assert_array_equal(resumed.frames[-1].displacement, straight.frames[-1].displacement)
    for key, values in straight.state.memory["bottom"].items():
        np.testing.assert_array_equal(resumed.state.memory["bottom"][key], values)
    assert resumed.state.ledger == straight.state.ledger


@pytest.mark.parametrize("scheme", ["implicit-euler", "newmark", "generalized-alpha", "midpoint"])
def test_bodies_with_mass_on_glue_that_remembers_keep_the_balance(scheme: str) -> None:
    history = _lifted(
        MixedMode(bilinear(6.0), 1.5, SHUT), 0.8, inertia=True, material={"density": 0.5}, scheme=scheme,
        controls=TIGHT, step=0.05,
    )  # fmt: skip
    assert history.finished
    ledger = history.state.ledger
    assert ledger.memory > 0.0
    assert abs(ledger.gap) < 1e-10 * abs(ledger.moved)


def test_viscous_bodies_on_glue_march_by_sdirk() -> None:
    coarse, fine = (
        _lifted(MixedMode(bilinear(6.0), 1.5, SHUT), 0.8, material={"viscosity": (3.0, 3.0)}, scheme="sdirk2", step=h)
        for h in (0.1, 0.05)
    )
    size = np.abs(fine.frames[-1].displacement).max()
    assert coarse.finished
    assert np.abs(coarse.frames[-1].displacement - fine.frames[-1].displacement).max() < 2e-2 * size


def test_steps_adapt() -> None:
    adaptive = _lifted(MixedMode(bilinear(6.0), 1.5, SHUT), 1.0, step=AdaptiveStep(rtol=1e-3))
    fine = _lifted(MixedMode(bilinear(6.0), 1.5, SHUT), 1.0, step=0.025)
    assert adaptive.finished
    size = np.abs(fine.frames[-1].displacement).max()
    np.testing.assert_allclose(adaptive.frames[-1].displacement, fine.frames[-1].displacement, atol=1e-2 * size)


@pytest.mark.parametrize("name", LAWS)
def test_elastic_glue_says_that_it_heals(name: str) -> None:
    law = LAWS[name]
    if name == "mode-dependent":
        with pytest.raises(hv.HemivarError, match="no potential in time without its memory, the mode of onset"):
            pulled_along(law, [0.0, 0.4], memory=())
        return
    history = pulled_along(law, [0.0, 0.4, 0.0], memory=())
    assert any(message.startswith("the glue heals on contact 'bottom' from t = 1 on") for message in history.messages)
    np.testing.assert_allclose(history.frames[-1].local, 0.0, atol=1e-9)
    assert history.state.ledger.memory == 0.0
    loaded = pulled_along(law, [0.0, 0.4], memory=())
    remembering = pulled_along(law, [0.0, 0.4, 0.0])
    assert not any("heals" in message for message in (*loaded.messages, *remembering.messages))


def test_damage_is_the_end_that_statics_has_where_nothing_closes() -> None:
    """In a march in which rho falls at no point; with what unloads it is another one."""
    law = MixedMode(bilinear(6.0), 1.5, SHUT)

    def block(t: float | None) -> hv.ContactProblem:
        def move(x: Array, t: float) -> Array:
            return np.tile([0.25 * t, 0.2 * t], (len(x), 1))

        top = move if t is None else move(np.zeros((1, 2)), t)[0]
        return hv.ContactProblem(
            hv.rectangle((1.0, 0.5), 3), hv.Material.young(30.0, 0.3), {"bottom": hv.Contact(law)},
            {"top": hv.Prescribed(top)},
        )  # fmt: skip

    history = hv.march(hv.Evolution(block(None)), 1.0, step=0.1, controls=TIGHT)
    rho = np.array([law.at(None).effective(frame.local) for frame in history.frames])
    assert (np.diff(rho, axis=0) >= 0.0).all()
    assert history.state.ledger.memory > 0.0
    static = hv.solve(block(1.0), controls=TIGHT).raise_for_status()
    np.testing.assert_allclose(history.frames[-1].local, static.local, atol=1e-9)
