"""Marches whose loads begin at zero: of bodies that contact alone holds, and as smoothly as they like."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import NoFriction, Superpotential
from tests.samples import slow

from .random_marches import random_march


def under_pressure(
    law: Superpotential, size: Callable[[float], float], dim: int = 2, unit: float = 1.0
) -> hv.ContactProblem:
    """A block that its foundation holds upwards only, under a pressure that depends on time."""
    sides = (2.0, 1.0) if dim == 2 else (1.0, 1.0, 1.0)
    mesh = hv.rectangle((sides[0] * unit, unit), (8, 4)) if dim == 2 else hv.box((unit,) * 3, (2, 2, 2))
    supports = {"left": hv.Fixed(x=0.0)} | ({} if dim == 2 else {"front": hv.Fixed(y=0.0)})

    def load(points: Array, t: float) -> Array:
        return np.tile([*[0.0] * (dim - 1), -size(t)], (len(points), 1))

    contact = {"bottom": hv.Contact(law)}
    return hv.ContactProblem(mesh, hv.Material.young(1e3, 0.3), contact, supports, tractions={"top": load})


def linear_in_time(t: float) -> float:
    return t


def up_and_down(t: float) -> float:
    return 1.0 - abs(1.0 - t % 2.0)


@pytest.mark.parametrize("law", [hv.Signorini(), hv.Compliance(1e4), hv.Softening(1e4, 0.1, 1e3)], ids=lambda x: x.name)
@pytest.mark.parametrize(("dim", "unit"), [(2, 1.0), slow(2, 1e-3), (3, 1.0)])
@pytest.mark.parametrize("size", [slow(linear_in_time), up_and_down])
def test_a_load_grows_from_zero(law: Superpotential, dim: int, unit: float, size: Callable[[float], float]) -> None:
    """Every moment is the equilibrium of its load: the foundation bears it, as statics says."""
    problem = under_pressure(law, size, dim, unit)
    history = hv.march(hv.Evolution(problem, inertia=False), until=1.9, step=0.1)
    assert history.finished
    assert any("this equilibrium is one of many" in message for message in history.messages)
    area = 2.0 * unit if dim == 2 else unit**2
    weights = history.discrete.problem.contact.weights
    for frame in history.frames:
        force = float(weights @ frame.multiplier[:, 0])
        assert force == pytest.approx(size(frame.time) * area, rel=1e-8, abs=1e-9 * area)
    still = hv.solve(problem.at_time(1.9))
    assert np.abs(history.frames[-1].displacement - still.displacement).max() <= 1e-8 * np.abs(still.displacement).max()


def hanging(power: float, friction: hv.laws.Friction) -> hv.ContactProblem:
    """A viscous block under a ceiling, 0.05 above its foundation, whose weight grows from zero."""
    material = hv.Material.lame(400.0, 400.0, viscosity=(0.2, 0.2))
    contact = {"bottom": hv.Contact(hv.Compliance(400.0), friction, gap=0.05)}

    def load(points: Array, t: float) -> Array:
        return np.tile([0.0, -(t**power)], (len(points), 1))

    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    return hv.ContactProblem(mesh, material, contact, {"top": hv.Clamped()}, body_force=load)


@pytest.mark.parametrize("friction", [NoFriction(), hv.Coulomb(0.3)], ids=["smooth", "coulomb"])
@pytest.mark.parametrize("step", [0.001, 0.02])
def test_a_load_begins_smoothly_over_a_gap(friction: hv.laws.Friction, step: float) -> None:
    """Nothing touches, so that friction changes nothing: the march is that of a body without a foundation."""
    runs = []
    for one in (friction, None):
        problem = hanging(6.0, friction)
        if one is None:
            problem = hv.ContactProblem(
                problem.mesh, problem.material, {}, problem.supports, body_force=problem.body_force
            )
        runs.append(hv.march(hv.Evolution(problem, inertia=False), until=10 * step, step=step))
        assert runs[-1].finished
        assert len(runs[-1].steps) == 11  # no step was halved
    with_contact, without = (run.frames[-1].displacement for run in runs)
    assert np.abs(with_contact - without).max() <= 1e-7 * np.abs(without).max()


def test_one_boundary_touches_and_another_is_far_away() -> None:
    """Rounding of a gap of 0.05 at one side has no part in contact at the other, however small its load is."""
    found = {}
    for size in (1.0, 1e-16):
        mesh = hv.rectangle((2.0, 1.0), (8, 4))
        contact = {
            "bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3)),
            "right": hv.Contact(hv.Signorini(), hv.Coulomb(0.3), gap=1e3 if size == 1.0 else 0.05),
        }

        def load(points: Array, size: float = size) -> Array:
            return size * np.column_stack([0.2 + 0.0 * points[:, 0], -np.cos(points[:, 0])])

        supports = {"left": hv.Clamped()}
        problem = hv.ContactProblem(mesh, hv.Material.young(1e3, 0.3), contact, supports, tractions={"top": load})
        found[size] = hv.solve(problem)
        assert found[size].status is hv.Status.CONVERGED
    one, other = found.values()
    assert np.abs(other.unknowns / 1e-16 - one.unknowns).max() <= 1e-7 * np.abs(one.unknowns).max()
    assert one.multiplier[:, 0].max() > 0.0


def pressed_and_pushed(friction: hv.laws.Friction, dim: int, normal: Superpotential) -> hv.ContactProblem:
    """A block held at its left side, pressed and pushed from the start on."""
    mesh = hv.rectangle((2.0, 1.0), (6, 3)) if dim == 2 else hv.box((1.0, 1.0, 1.0), (2, 2, 2))
    load = [1.5, *[0.0] * (dim - 2), -1.0]
    contact = {"bottom": hv.Contact(normal, friction)}
    return hv.ContactProblem(
        mesh, hv.Material.lame(400.0, 400.0), contact, {"left": hv.Clamped()}, tractions={"top": tuple(load)}
    )


WEAKENING = {
    "exponential": lambda bound: hv.laws.SlipWeakening(bound, 1.2, 0.5, 100.0, of="rate"),
    "table": lambda bound: hv.laws.SlipTable(bound, [0.0, 1.0, 10.0], [1.2, 0.9, 0.5], of="rate"),
}


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("normal", [hv.Signorini(), hv.Compliance(1e3)], ids=lambda law: law.name)
@pytest.mark.parametrize("bound", [0.2, hv.laws.CoulombBound(0.2)], ids=["tresca", "coulomb"])
@pytest.mark.parametrize("weakens", WEAKENING)
def test_friction_that_weakens_with_the_rate_begins_at_rest(
    weakens: str, bound: object, normal: Superpotential, dim: int
) -> None:
    """The start is the equilibrium under friction of a constant strength, that at rest."""
    law = WEAKENING[weakens](bound)
    history = hv.march(hv.Evolution(pressed_and_pushed(law, dim, normal), inertia=False), until=0.2, step=0.1)
    assert history.finished
    size = 1.2 * bound if isinstance(bound, float) else hv.laws.CoulombBound(0.24)
    steady = hv.solve(pressed_and_pushed(hv.Tresca(size), dim, normal))
    start = history.frames[0]
    far = np.abs(steady.displacement).max()
    assert np.abs(start.displacement - steady.displacement).max() <= 1e-8 * far
    assert np.abs(steady.slip).max() > 1e-6 * far  # somewhere it has slipped
    for frame in history.frames[1:]:  # what acts is constant, and rest stays rest
        assert np.abs(frame.displacement - start.displacement).max() <= 1e-7 * far


def test_a_body_that_must_slip_at_once_has_no_state_of_rest() -> None:
    def load(points: Array, t: float) -> Array:
        return np.tile([0.1 if t < 0.5 else 5.0, -1.0], (len(points), 1))

    mesh, law = hv.rectangle((2.0, 1.0), (4, 2)), hv.laws.SlipWeakening(0.5, 1.0, 0.5, 1.0, of="rate")
    contact = {"bottom": hv.Contact(hv.Compliance(1e3), law)}
    problem = hv.ContactProblem(mesh, hv.Material.lame(400.0, 400.0), contact, {}, tractions={"top": load})
    history = hv.march(hv.Evolution(problem, inertia=False), until=1.0, step=0.1, stops=[0.5])
    assert not history.finished
    assert history.times[-1] == 0.5
    assert "may not carry the initial load at rest" in history.messages[-1]


def _goes_on(seed: int) -> None:
    march = random_march(seed)
    history = march.run()
    assert history.finished, f"{march.words}: {history.ended}, {history.messages}"
    assert history.residual < 1e-8, march.words
    assert len(history.steps) == 11, f"{march.words}: steps were halved"


@pytest.mark.parametrize("seed", range(1000, 1020))
def test_random_marches_go_to_their_end(seed: int) -> None:
    _goes_on(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2000, 2200))
def test_many_random_marches_go_to_their_end(seed: int) -> None:
    _goes_on(seed)
