"""Bodies without mass begin in equilibrium, and go on in equilibrium where a load jumps."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, History, Save, Scheme, march
from hemivar.mechanics.statement import Contact
from tests import bodies

#: kappa of the block; with the glue 24 it opens by f / 36.
_KAPPA = 12.0
_SCHEMES = [hv.evolution.ImplicitEuler(), hv.evolution.Midpoint(), hv.evolution.SDIRK2()]


def loaded_at_its_foot(load: Any, contact: Contact, **more: Any) -> hv.ContactProblem:
    """A block under a load at its foot, of stiffness 12 along its axis."""
    lame = more.pop("lame", (4.0, 4.0))
    return bodies.column(
        contact,
        cells=(1, 2),
        top=hv.Clamped(),
        material=more.pop("material", None) or hv.Material.lame(*lame, **more),
        tractions={"bottom": load},
    )


def glued(load: Any = (0.0, 1.9), **more: Any) -> hv.ContactProblem:
    """Glue of stiffness 24 and strength 2 that does not heal."""
    return loaded_at_its_foot(load, hv.Contact(hv.Adhesive(24, 2, 6, 72), memory=(hv.laws.Secant(),)), **more)


def march_to_one(problem: hv.ContactProblem, scheme: Scheme, step: Any = 0.01, **options: Any) -> History:
    """The march to t = 1, or as long as asked for."""
    until = options.pop("until", 1.0)
    stated = Evolution(problem, **options.pop("evolution", {}))
    return march(stated, until, scheme=scheme, step=step, save=Save(probes={"foot": (0.5, 0.0)}), **options)


@pytest.mark.parametrize("scheme", _SCHEMES, ids=lambda scheme: scheme.name)
def test_a_load_that_is_on_from_the_start_breaks_no_glue_that_holds_it(scheme: Scheme) -> None:
    found = march_to_one(glued(), scheme, step=0.1)
    np.testing.assert_allclose(found["foot.u_y"], 1.9 / (_KAPPA + 24.0), rtol=1e-8)
    assert found.messages == ()
    # The balance begins with the energy that is stored then, and nothing is done to the body any more.
    stored = 0.5 * 1.9**2 / 36.0
    np.testing.assert_allclose(found["elastic"] + found["contact"], stored, rtol=1e-8)
    for name in ("work", "memory", "numerical", "gap"):
        np.testing.assert_allclose(found[name], 0.0, atol=1e-9 * stored, err_msg=name)


@pytest.mark.parametrize("scheme", _SCHEMES, ids=lambda scheme: scheme.name)
def test_glue_that_is_torn_by_the_load_at_the_start_is_torn_at_the_start(scheme: Scheme) -> None:
    # The glue 24 s up to the strength 2 at s = 1/12, then it falls by 6 to a third of it. Under f = 4 it is torn.
    def force(s: float) -> float:
        law = hv.Adhesive(24, 2, 6, 72)
        return float(-law.subdifferential(np.array([-s])).lower[0])

    found = march_to_one(glued((0.0, 3.2)), scheme, step=0.1)
    s = float(found["foot.u_y"][0])
    assert s > 1.0 / 12.0
    assert _KAPPA * s + force(s) == pytest.approx(3.2, rel=1e-7)
    np.testing.assert_allclose(found["foot.u_y"], s, rtol=1e-8)


@pytest.mark.parametrize("scheme", _SCHEMES, ids=lambda scheme: scheme.name)
def test_branches_have_taken_the_strain_of_the_start(scheme: Scheme) -> None:
    # Springs 6 and 6 in parallel at once, 6 at last, T = 0.5, on a spring 2: s goes from f/14 to f/8.
    body = hv.Material.lame(0.0, 3.0, branches=[hv.materials.Branch(lame=(0.0, 3.0), time=0.5)])
    found = march_to_one(
        loaded_at_its_foot((0.0, -1.0), hv.Contact(hv.Compliance(2.0)), material=body), scheme, step=0.05
    )
    slow = 0.5 * 14.0 / 8.0
    exact = 1.0 / 8.0 + (1.0 / 14.0 - 1.0 / 8.0) * np.exp(-found.times / slow)
    off = np.abs(-found["foot.u_y"] - exact) / exact
    assert off[0] < 1e-7
    assert off.max() < (1e-2 if scheme.order == 1 else 1e-3)


def test_a_stated_displacement_out_of_equilibrium_is_reported() -> None:
    far = {"displacement": (0.0, 0.0)}
    found = march_to_one(glued(), hv.evolution.Midpoint(), evolution=far)
    assert found["foot.u_y"][0] == pytest.approx(1.9 / 36.0)
    assert any("not in equilibrium" in message for message in found.messages)
    here = {"displacement": lambda x: np.column_stack([0.0 * x[:, 0], (1.0 - x[:, 1]) * 1.9 / 36.0])}
    assert march_to_one(glued(), hv.evolution.Midpoint(), evolution=here).messages == ()


def test_viscosity_everywhere_keeps_the_stated_displacement() -> None:
    found = march_to_one(glued(viscosity=(0.4, 0.4)), hv.evolution.ImplicitEuler(), step=0.01)
    assert found["foot.u_y"][0] == 0.0
    assert found["foot.u_y"][1] == pytest.approx(1.9 / (36.0 + 1.2 / 0.01), rel=1e-8)


def test_viscosity_in_a_part_keeps_the_displacement_of_this_part() -> None:
    # The upper half is viscous and does not yield at once: the lower one, of stiffness 24, and the glue carry the load.
    mesh = hv.rectangle((1.0, 1.0), (1, 2))
    high = mesh.points[mesh.cells].mean(axis=1)[:, 1] > 0.5
    mesh = dataclasses.replace(
        mesh, parent=None, regions={"upper": np.flatnonzero(high), "lower": np.flatnonzero(~high)}
    )
    body = hv.Material.by_region(
        {"upper": hv.Material.lame(4, 4, viscosity=(0.4, 0.4)), "lower": hv.Material.lame(4, 4)}
    )
    problem = hv.ContactProblem(
        mesh=mesh,
        material=body,
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Clamped()},
        tractions={"bottom": (0.0, 1.9)},
        contact={"bottom": hv.Contact(hv.Adhesive(24, 2, 6, 72), memory=(hv.laws.Secant(),))},
    )
    found = march_to_one(problem, hv.evolution.Midpoint(), step=0.01)
    assert found["foot.u_y"][0] == pytest.approx(1.9 / 48.0, rel=1e-6)
    # Of the middle v and the foot w: 2.4 v' + 24 v = 24 (w - v) and 24 (w - v) + 24 w = 1.9.
    rate = 48.0 - 24.0**2 / 48.0
    late = 1.9 / 36.0 + (1.9 / 48.0 - 1.9 / 36.0) * np.exp(-found.times * (rate / 2.4))
    np.testing.assert_allclose(found["foot.u_y"], late, rtol=2e-4)


@pytest.mark.parametrize("scheme", _SCHEMES, ids=lambda scheme: scheme.name)
def test_a_load_that_jumps_at_a_stop_breaks_no_glue_that_holds_it(scheme: Scheme) -> None:
    def load(x: Array, t: float) -> Array:
        return np.column_stack([0.0 * x[:, 0], np.full(len(x), 0.5 if t < 0.5 else 1.9)])

    found = march_to_one(glued(load), scheme, step=0.05, stops=(0.5,))
    after = found.times > 0.5 + 1e-9
    np.testing.assert_allclose(found["foot.u_y"][~after], 0.5 / 36.0, rtol=1e-8)
    np.testing.assert_allclose(found["foot.u_y"][after], 1.9 / 36.0, rtol=1e-8)
    # The load that jumps does the work of one that grows quickly, and nothing is lost.
    assert found["work"][-1] == pytest.approx(0.5 * (0.5 + 1.9) * 1.4 / 36.0, rel=1e-7)
    assert abs(found["numerical"][-1]) < 1e-9
    assert abs(found["gap"][-1]) < 1e-9


def test_a_load_that_sets_in_just_after_the_start_breaks_no_glue_that_holds_it() -> None:
    def load(x: Array, t: float) -> Array:
        return np.column_stack([0.0 * x[:, 0], np.full(len(x), 1.9 if t > 0.0 else 0.0)])

    found = march_to_one(glued(load), hv.evolution.Midpoint())
    assert found["foot.u_y"][0] == 0.0
    np.testing.assert_allclose(found["foot.u_y"][1:], 1.9 / 36.0, rtol=1e-8)
    assert found["work"][-1] == pytest.approx(0.5 * 1.9**2 / 36.0, rel=1e-7)


def test_a_start_whose_equilibrium_is_not_found_ends_the_march_there() -> None:
    strip = bodies.strip(hv.Contact(hv.Signorini(), hv.Coulomb(0.3)), (16, 8), body_force=(0.3, -1.0))
    found = march(Evolution(strip), 1.0, step=0.1, scheme=hv.evolution.Midpoint(), controls=hv.Controls(max_steps=1))
    assert found.ended == "max_steps"
    assert found.times.tolist() == [0.0]
    assert "the equilibrium at t = 0" in found.messages[-1]


@pytest.mark.parametrize("ramp", [False, True], ids=["sudden", "ramp"])
@pytest.mark.parametrize("step", [0.04, 0.25], ids=["short", "long"])
def test_steps_that_swing_about_an_equilibrium_are_reported(ramp: bool, step: float) -> None:
    # 36 s + 1.8 s' = f: with the middle of a step the factor of the rest is (1 - 10 step)/(1 + 10 step).
    def load(x: Array, t: float) -> Array:
        return np.column_stack([0.0 * x[:, 0], np.full(len(x), -min(t, 1.0) if ramp else -1.0)])

    problem = loaded_at_its_foot(load, hv.Contact(hv.Compliance(24.0)), viscosity=(0.6, 0.6))
    found = march_to_one(problem, hv.evolution.Midpoint(), step)
    swings = step > 0.1 and not ramp
    assert (len(found.messages) == 1) == swings
    if swings:
        ratio = (1.0 - 10.0 * step) / (1.0 + 10.0 * step)
        np.testing.assert_allclose(-36.0 * found["foot.u_y"], 1.0 - ratio ** np.arange(len(found.times)), rtol=1e-8)
        assert "steps below 0.1," in found.messages[0]
