"""Forces stand beside displacements of their own time, or with the time that is theirs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import (
    BDF2,
    SDIRK2,
    Evolution,
    GeneralizedAlpha,
    History,
    ImplicitEuler,
    Midpoint,
    MoreauJean,
    Newmark,
    Scheme,
    march,
)
from hemivar.evolution.history import Frame
from hemivar.laws.memory import PenetrationMemory

MASSLESS = (ImplicitEuler(), Midpoint(), Midpoint(conserving=True), BDF2(), SDIRK2())
WITHIN = (Midpoint(), GeneralizedAlpha(0.6), MoreauJean())
STIFF, SPRING = 12.0, 24.0


def pressed_in_time(contact: hv.Contact, density: float | None = None) -> Evolution:
    """A block that deforms along its height only, as a spring of 12, pressed onto its foundation by 3.6 t."""

    def pull(x: Array, t: float) -> Array:
        return np.tile([0.0, -3.6 * t], (len(x), 1))

    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), (1, 2)),
        material=hv.Material.lame(4.0, 4.0, density=density),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Clamped()},
        tractions={"bottom": pull},
        contact={"bottom": contact},
    )
    return Evolution(problem, inertia=density is not None)


def forces(found: History) -> tuple[Array, Array]:
    """Resultants of the pressure in the table and in the frames."""
    weights = found.discrete.problem.contact.weights
    return found["normal_force"], np.array([weights @ frame.multiplier[:, 0] for frame in found.frames])


@pytest.mark.parametrize("scheme", MASSLESS, ids=repr)
def test_a_spring_presses_as_deep_as_it_is_pressed(scheme: Scheme) -> None:
    found = march(pressed_in_time(hv.Contact(hv.Compliance(SPRING))), until=0.4, step=0.1, scheme=scheme)
    for one in forces(found):
        np.testing.assert_allclose(one, 2.4 * found.times, rtol=1e-9)
    np.testing.assert_array_equal(found["force_time"], found.times)


def test_a_damper_tells_the_force_of_the_end() -> None:
    """(12 + 24) r + 6 r' = 3.6 t."""
    rest, lag = 3.6 / 36.0, 6.0 / 36.0

    def worst(steps: int) -> float:
        contact = hv.Contact(hv.Compliance(SPRING), damping=hv.Compliance(6.0))
        found = march(pressed_in_time(contact), until=1.0, step=1.0 / steps, scheme=Midpoint())
        t = found.times
        place = rest * (t - lag * (1.0 - np.exp(-t / lag)))
        rate = rest * (1.0 - np.exp(-t / lag))
        np.testing.assert_array_equal(found["force_time"], t)
        return float(np.abs(found["normal_force"] - SPRING * place - 6.0 * rate)[-1])

    assert worst(40) < 1e-3
    assert worst(20) / worst(40) > 3.5


def test_forces_are_those_of_displacements_and_rates_with_mass() -> None:
    contact = hv.Contact(hv.Compliance(SPRING), damping=hv.Compliance(6.0))
    found = march(pressed_in_time(contact, 0.5), until=1.0, step=0.05, scheme=GeneralizedAlpha(0.6))
    for frame in found.frames[1:]:
        np.testing.assert_allclose(frame.multiplier[:, 0], _pressure(frame))


def _pressure(frame: Frame) -> Array:
    return SPRING * np.maximum(frame.local[:, 0], 0.0) + 6.0 * np.maximum(frame.rate[:, 0], 0.0)


@pytest.mark.parametrize("dim", [2, 3])
def test_glue_in_shear_holds_what_pulls_at_the_end(dim: int) -> None:
    """A bar on glue that is pulled along, and pressed down, by 20 t."""

    def along(x: Array, t: float) -> Array:
        return np.tile(20.0 * t * np.eye(dim)[0], (len(x), 1))

    def down(x: Array, t: float) -> Array:
        return np.tile(-20.0 * t * np.eye(dim)[-1], (len(x), 1))

    mesh = hv.rectangle((4.0, 1.0), (4, 1)) if dim == 2 else hv.box((4.0, 1.0, 1.0), (2, 1, 1))
    glue = hv.laws.SlipTable(10.0, [0.0, 0.01, 0.035], [0.0, 1.0, 0.0], of="slip")
    tractions = {"left": along, "top": down}
    contact = {"bottom": hv.Contact(hv.Compliance(1000.0), glue)}
    problem = hv.ContactProblem(mesh, hv.Material.young(7e4, 0.3), contact, tractions=tractions)
    found = march(Evolution(problem), until=1.0, step=0.25, scheme=Midpoint())
    np.testing.assert_array_equal(found["force_time"], found.times)
    np.testing.assert_allclose(np.abs(found["friction_force"]), 20.0 * found.times, atol=1e-6)
    held = found.discrete.problem.contact.weights @ found.frames[-1].multiplier[:, 1:]
    assert np.linalg.norm(held) == pytest.approx(20.0, rel=1e-6)


@pytest.mark.parametrize("scheme", WITHIN, ids=repr)
def test_a_rigid_obstacle_tells_when_it_pressed(scheme: Scheme) -> None:
    evolution = pressed_in_time(hv.Contact(hv.Signorini()), None if isinstance(scheme, Midpoint) else 1e-6)
    found = march(evolution, until=0.4, step=0.1, scheme=scheme)
    (rule,) = scheme.rules(0.1)
    np.testing.assert_allclose(found["force_time"][1:], found.times[1:] - (1.0 - rule.at) * 0.1)
    assert [frame.force_time for frame in found.frames] == found["force_time"].tolist()
    np.testing.assert_allclose(found["normal_force"], 3.6 * found["force_time"], atol=1e-9)


@pytest.mark.parametrize(
    "contact",
    [
        hv.Contact(hv.Compliance(SPRING), hv.Coulomb(0.3)),
        hv.Contact(hv.Compliance(SPRING), hv.Tresca(0.3)),
        hv.Contact(hv.Compliance(SPRING), memory=(PenetrationMemory(-4.0, 0.5),)),
    ],
)
def test_what_no_displacement_tells_has_the_time_of_the_middle(contact: hv.Contact) -> None:
    found = march(pressed_in_time(contact), until=0.2, step=0.1, scheme=Midpoint())
    np.testing.assert_allclose(found["force_time"], [0.0, 0.05, 0.15])


def growing(density: float | None) -> Evolution:
    """The block on springs under ``t^2``, which is ``0.1 t^2`` deep without mass."""
    evolution = pressed_in_time(hv.Contact(hv.Compliance(SPRING)), density)
    tractions = {"bottom": lambda x, t: np.tile([0.0, -3.6 * t**2], (len(x), 1))}
    return replace(evolution, problem=replace(evolution.problem, tractions=tractions))


@pytest.mark.parametrize(
    ("scheme", "order"),
    [(ImplicitEuler(), 1), (BDF2(), 1), (Midpoint(), 2), (SDIRK2(), 2)],
    ids=lambda one: getattr(one, "name", str(one)),
)
def test_the_order_of_the_energy_table_is_that_of_the_page(scheme: Scheme, order: int) -> None:
    """Work is the integral of 3.6 t^2 over 0.1 t^2: 0.18 at the end; displacements are exact with all of them."""

    def off(steps: int) -> float:
        found = march(growing(None), until=1.0, step=1.0 / steps, scheme=scheme)
        np.testing.assert_allclose(found["penetration"][-1], 0.1, rtol=1e-3 if order == 2 else 1e-9)
        return abs(float(found["work"][-1]) / 0.18 - 1.0)

    if order == 2:
        assert off(100) < 1e-4
    else:
        assert off(100) > 1e-2
        assert off(50) / off(100) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("scheme", [Newmark(), GeneralizedAlpha(0.8)], ids=lambda scheme: scheme.name)
def test_numerical_loss_of_schemes_with_mass_is_of_first_order_where_the_motion_is_of_second(scheme: Scheme) -> None:
    def books(steps: int) -> tuple[float, float]:
        found = march(growing(0.5), until=1.0, step=1.0 / steps, scheme=scheme)
        return float(found["numerical"][-1] / found["work"][-1]), float(found["penetration"][-1])

    (first, place), (second, near), (_, exact) = (books(steps) for steps in (50, 100, 400))
    assert first / second == pytest.approx(2.0, abs=0.2)
    assert abs(near / exact - 1.0) < 0.2 * second
    assert abs(place - exact) > 3.0 * abs(near - exact)
