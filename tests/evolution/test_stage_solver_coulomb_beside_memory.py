"""Coulomb's law beside what points remember and dampers: every step obeys it, and its margins are told."""

from __future__ import annotations

from functools import cache
from typing import TypedDict

import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Evolution, History, ImplicitEuler, Midpoint, Newmark, Save, Scheme, march
from hemivar.laws import Superpotential
from hemivar.laws.memory import Memory
from tests import bodies
from tests.samples import sampled

MU = 0.3


class Beside(TypedDict, total=False):
    """What stands beside the laws of a contact."""

    memory: tuple[Memory, ...]
    damping: Superpotential


CASES: dict[str, Beside] = {
    "wear": {"memory": (hv.laws.Wear(0.1),)},
    "sum of the slip": {"memory": (hv.laws.SlipSum(),)},
    "memory of the penetration": {"memory": (hv.laws.PenetrationMemory(2.0, 0.3),)},
    "creep": {"memory": (hv.laws.ViscousFoundation(10.0),)},
    "damped contact": {"memory": (hv.laws.DampedContact(hv.Compliance(0.4)),)},
    "damping": {"damping": hv.Compliance(0.4)},
    "wear, memory and damping": {
        "memory": (hv.laws.Wear(0.1), hv.laws.PenetrationMemory(2.0, 0.3)),
        "damping": hv.Compliance(0.4),
    },
}


def clamped_above(
    normal: Superpotential, friction: hv.laws.Friction, beside: Beside, inertia: bool = False
) -> Evolution:
    """A square on its foundation, clamped at its top, pushed down and along."""
    problem = bodies.square(
        hv.Contact(normal, friction, **beside),
        2,
        density=1.0 if inertia else None,
        viscosity=(0.3, 0.3),
        supports={"top": hv.Clamped()},
        body_force=(0.5, -1.0),
    )
    return Evolution(problem, inertia=inertia)


@pytest.mark.parametrize(
    ("normal", "name"),
    [(hv.Compliance(20.0), name) for name in CASES]
    + [(hv.Softening(20.0, 0.02, 10.0), name) for name in CASES if name != "damped contact"]  # refused there, and
    + [(hv.Signorini(), name) for name in CASES if name != "damped contact"],  # here, with a sentence
)
def test_every_step_obeys_coulombs_law(normal: Superpotential, name: str) -> None:
    history = march(clamped_above(normal, hv.Coulomb(MU), CASES[name]), 0.3, step=0.05, save=Save(0.05))
    assert history.ended == "finished"
    slid = 0
    for before, after in zip(history.frames, history.frames[1:], strict=False):
        way, bound = (after.local - before.local)[:, 1], MU * after.multiplier[:, 0]
        friction = after.multiplier[:, 1]
        assert (np.abs(friction) <= bound + 1e-8).all()
        moves = np.abs(way) > 1e-8
        np.testing.assert_allclose(friction[moves], (np.sign(way) * bound)[moves], atol=1e-8)
        slid += int(np.count_nonzero(moves & (bound > 1e-3)))
    assert slid > 0  # so that the law was put to use
    assert "a friction bound that depends on the pressure" in history.uniqueness
    assert np.isneginf(history["margin"][1:]).all()


def pressed_springs(name: str, inertia: bool) -> Evolution:
    return clamped_above(hv.Compliance(20.0), hv.Coulomb(MU), CASES[name], inertia)


@cache
def finely_marched(name: str, inertia: bool) -> History:
    """By Euler's method, the same for several schemes."""
    return march(pressed_springs(name, inertia), 0.4, step=0.005)


@pytest.mark.parametrize("scheme", [ImplicitEuler(), Newmark(), Midpoint()], ids=lambda scheme: scheme.name)
@pytest.mark.parametrize("name", sampled(CASES, ["wear", "creep", "damping"]))
def test_other_schemes_take_it(scheme: Scheme, name: str) -> None:
    """And they find what Euler's method finds, as near as their steps are long."""
    inertia = isinstance(scheme, Newmark)
    found = march(pressed_springs(name, inertia), 0.4, step=0.02, scheme=scheme)
    other = finely_marched(name, inertia)
    assert found.ended == other.ended == "finished"
    one, two = found.frames[-1].displacement, other.frames[-1].displacement
    assert np.abs(one - two).max() <= 0.05 * np.abs(two).max()


def test_a_lost_margin_of_a_bound_that_depends_on_the_penetration_is_told() -> None:
    bound = hv.laws.PenetrationBound("min(8*s, 0.8)")
    history = march(clamped_above(hv.Softening(20.0, 0.02, 10.0), hv.Tresca(bound), {}), 0.2, step=0.05)
    assert (history["margin"][1:] <= 0.0).any()
    assert "may have several solutions" in history.uniqueness
