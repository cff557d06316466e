"""Glue whose damaged share rubs where it is pressed: ``memory=(Secant(friction=mu),)``."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import Adhesive, BilinearCohesion, Compliance, MixedMode, Secant, VectorLaw
from tests.samples import slow

MU, SPRING, DEEP = 0.5, 100.0, 0.01  # friction, springs in penetration, and how deep they are pressed
PRESSURE = SPRING * DEEP
GLUE = MixedMode(BilinearCohesion(stiffness=24.0, strength=2.4, energy=0.6), 1.0, Compliance(SPRING))
#: Slips between which the block goes to and fro, in a time 1 each: 0.5 is the break.
TURNS = (0.0, 0.3, 0.1, 0.6, 0.5, 0.65)
TIGHT = hv.Controls(rtol=1e-12)


def slip(t: float) -> float:
    return float(np.interp(t, range(len(TURNS)), TURNS))


def led_block(
    law: Any, memory: tuple[Any, ...] | None, way: Callable[[float], list[float]], unit: float = 1.0, dim: int = 2,
    young: float = 1e8,
) -> hv.ContactProblem:  # fmt: skip
    """A block whose top goes along a way (d,); lengths in units of ``unit``."""

    def moved(x: Array, t: float) -> Array:
        return np.tile(np.array(way(t)) / unit, (len(x), 1))

    mesh = hv.rectangle((1.0 / unit, 0.5 / unit), (2, 1)) if dim == 2 else hv.box(np.ones(3) / unit, 1)
    contact = {"bottom": hv.Contact(law, memory=memory)}
    return hv.ContactProblem(
        mesh, hv.Material.young(young * unit**2, 0.3), contact, {"top": hv.Prescribed(moved)}
    )  # fmt: skip


def to_and_fro(t: float) -> list[float]:
    return [slip(t), -DEEP * min(1.0, 10.0 * t)]


def march_of_a_point(step: float, until: float = 5.0) -> tuple[Array, float, float]:
    """Shear tractions of one point, and what glue and friction lose, with D of the beginning of each step."""
    times = step * np.arange(round(until / step) + 1)
    far, damage, rubbed, found = 0.0, 0.0, 0.0, []
    for before, now in itertools.pairwise(times.tolist()):
        bound = MU * damage * SPRING * DEEP * min(1.0, 10.0 * now)
        way = slip(now) - slip(before)
        rubbed += bound * abs(way)
        far = max(far, slip(now))
        traction = 24.0 * far if far <= 0.1 else max(2.4 - 6.0 * (far - 0.1), 0.0)
        found.append(traction / far * slip(now) + bound * np.sign(way))
        damage = 1.0 - traction / far / 24.0
    return np.array(found), (0.6 if far >= 0.5 else np.nan), rubbed


def shears(history: hv.evolution.History) -> Array:
    return np.array([frame.multiplier[1, 1] for frame in history.frames])[1:]


@pytest.mark.parametrize("unit", [1.0, slow(1e3)])
def test_a_point_pressed_and_sheared_to_and_fro(unit: float) -> None:
    """Through the softening and beyond the break, where Coulomb's friction is left; the balance of energy closes."""
    glue = MixedMode(
        BilinearCohesion(stiffness=24.0 * unit**3, strength=2.4 * unit**2, energy=0.6 * unit), 1.0,
        Compliance(SPRING * unit**3),
    )  # fmt: skip
    problem = led_block(glue, (Secant(friction=MU),), to_and_fro, unit)
    save = hv.evolution.Save(every=0.05)
    history = hv.march(hv.Evolution(problem), 5.0, step=0.05, save=save, controls=TIGHT)
    assert history.ended == "finished"
    traction, energy, rubbed = march_of_a_point(0.05)
    np.testing.assert_allclose(shears(history) / unit**2, traction, atol=5e-6)
    assert shears(history)[-1] / unit**2 == pytest.approx(MU * PRESSURE, rel=1e-5)
    assert history["memory"][-1] == pytest.approx(energy + rubbed, rel=1e-5)
    assert np.abs(history["gap"]).max() <= 1e-8 * np.abs(history["moved"]).max()  # rounding of the stiff block


def test_the_damage_of_the_beginning_of_a_step_costs_one_order() -> None:
    """Against damage of the end: what friction takes while glue softens differs by half as much in half the step."""
    fine = march_of_a_point(1e-4, 1.0)[2]
    off = [abs(march_of_a_point(step, 1.0)[2] - fine) for step in (0.02, 0.01)]
    assert off[1] == pytest.approx(0.5 * off[0], rel=0.05)


def test_broken_glue_obeys_coulombs_law() -> None:
    """A soft block, sheared off and dragged to and fro: as a contact that was never glued. The balance closes."""
    found = []
    for law, memory in ((GLUE, (Secant(friction=MU),)), (Compliance(SPRING), None)):
        problem = led_block(law, memory, to_and_fro, young=200.0)
        if memory is None:
            contact = {"bottom": hv.Contact(law, hv.Coulomb(MU))}
            problem = hv.ContactProblem(problem.mesh, problem.material, contact, problem.supports)
        save = hv.evolution.Save(every=0.1)
        history = hv.march(hv.Evolution(problem), 4.5, step=0.1, save=save, controls=TIGHT)
        assert history.ended == "finished"
        assert np.abs(history["gap"]).max() <= 1e-10 * np.abs(history["moved"]).max()
        found.append(np.array([frame.multiplier for frame in history.frames if frame.time > 3.55]))
    np.testing.assert_allclose(found[0], found[1], atol=1e-8)


def test_in_space_friction_points_against_the_slip_and_glue_back_to_the_start() -> None:
    def way(t: float) -> list[float]:
        return [0.3 * min(t, 1.0), 0.05 * max(t - 1.0, 0.0), -DEEP * min(1.0, 10.0 * t)]

    history = hv.march(hv.Evolution(led_block(GLUE, (Secant(friction=MU),), way, dim=3)), 1.5, step=0.05)
    assert history.ended == "finished"
    force = history.discrete.problem.contact.global_vectors(history.state.multiplier)
    far = np.hypot(0.3, 0.025)
    secant = (2.4 - 6.0 * (far - 0.1)) / far
    damage = 1.0 - (2.4 - 6.0 * (np.hypot(0.3, 0.0225) - 0.1)) / np.hypot(0.3, 0.0225) / 24.0
    for one in force:
        assert one[:2] == pytest.approx([0.3 * secant, 0.025 * secant + MU * damage * PRESSURE], rel=1e-4)


def test_glue_that_only_opens_rubs_by_its_damage() -> None:
    """Opened to 0.3, D = 5/6, then pressed and dragged."""

    def way(t: float) -> list[float]:
        return [max(t - 2.0, 0.0), 0.3 * min(t, 1.0) - 0.31 * min(max(t - 1.0, 0.0), 1.0)]

    glue = Adhesive(24.0, 2.4, energy=0.6, compression=SPRING)
    history = hv.march(hv.Evolution(led_block(glue, (Secant(friction=MU),), way)), 3.0, step=0.05)
    assert history.ended == "finished"
    lam = history.state.multiplier
    assert lam[:, 1] == pytest.approx(5.0 / 6.0 * MU * lam[:, 0], rel=1e-5)
    assert history["friction"][-1] == pytest.approx(5.0 / 6.0 * MU * PRESSURE, rel=1e-3)


def mode_dependent() -> VectorLaw:
    return hv.laws.ModeDependentGlue(2.4, 3.0, 24.0, hv.laws.BenzeggaghKenane(0.6, 1.0, 2.0))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: hv.solve(led_block(GLUE, (Secant(friction=MU),), to_and_fro).at_time(0.0)), "something in time only"),
        (lambda: begun(mode_dependent()), "friction on the damaged share of"),
        (lambda: begun(Compliance(1.0)), "has no damage on which friction could act"),
        (lambda: begun(Adhesive(24.0, 2.4), hv.Tresca(1.0)), "leave one of the two out"),
        (lambda: begun(GLUE, friction=-0.1), "friction of memory 'secant' is -0.1"),
        (lambda: hv.Contact(GLUE, hv.Coulomb(0.5)).law, r"Secant\(friction="),
    ],
)  # fmt: skip
def test_bad_input_is_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words):
        make()


def begun(law: Any, beside: hv.laws.Friction | None = None, friction: float = MU) -> hv.evolution.History:
    problem = led_block(law, (Secant(friction=friction),), to_and_fro)
    if beside is not None:
        contact = {"bottom": hv.Contact(law, beside, memory=(Secant(friction=friction),))}
        problem = hv.ContactProblem(problem.mesh, problem.material, contact, problem.supports)
    return hv.march(hv.Evolution(problem), 0.1, step=0.1)
