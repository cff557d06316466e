"""Evolutions of one degree of freedom and of uniform bodies against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, Scheme, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.laws.memory import LocalStep


@pytest.mark.parametrize("scheme", [hv.ImplicitEuler(), hv.SDIRK2()], ids=lambda s: s.name)
def test_relaxation(scheme: Scheme) -> None:
    """Standard solid on a spring: the branch is integrated exactly, the error is that of a straight line in a step."""
    known = gallery.relaxing_block()
    assert known.exact(1.0) == pytest.approx(0.156833711943, abs=1e-12)
    errors = []
    for count in (20, 40, 80):
        history = march(known.evolution, 1.0, step=1.0 / count, stops=known.stops, scheme=scheme)
        errors.append(abs(history["normal_force"][-1] - known.exact(1.0)))
        assert abs(history.ledger["gap"]) < 1e-14
    assert errors[0] < 1e-4
    assert min(np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])) > 1.8  # exact for straight lines


@pytest.mark.parametrize("ratio", [1e-14, 1e-9, 1e-3, 0.3, 5.0, 1e9])
def test_what_long_memory_loses_is_no_rounding(ratio: float) -> None:
    """``int h'h / T`` of a branch, and of a foundation that remembers, pulled evenly: ``T^2 (x - e - e^2/2)``."""
    period, e = 1.0 / ratio, -np.expm1(-ratio)
    exact = ratio - e - e**2 / 2.0 if ratio > 0.1 else sum(e**k / k for k in range(3, 20))
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 1, "cross"),
        hv.Material.lame(0.0, 1.0, branches=[hv.Branch(lame=(0.0, 0.5), time=period)]),
        supports={"bottom": hv.Clamped(), "top": hv.Prescribed(lambda x, t: 0.1 * t * np.array([[0.0, 1.0]]) + 0 * x)},
    )
    lost = march(Evolution(problem), 1.0, step=0.1)["branch_loss"][-1]
    assert lost == pytest.approx(0.01 * period**2 * exact, rel=1e-6)
    memory, law = hv.PenetrationMemory(1.0, period), hv.ContactLaw(hv.NoContact())
    r = np.array([[0.1]])
    state = memory.start(law, 0.0 * r)
    step = LocalStep(1.0, 1.0, 0.0 * r)
    gained = -memory.dissipated(law, state, memory.advance(law, state, step, r, r), step, r, r)
    assert gained == pytest.approx(0.01 * period**3 * exact, rel=1e-9)


def test_memory_of_penetration() -> None:
    """``kappa (r0 - r) = k r + int b e^{-(t-s)/T} r ds``."""
    known = gallery.penetration_memory_block()
    assert known.exact(0.5) == pytest.approx(0.026573963357, abs=1e-12)
    errors = []
    for count in (10, 20, 40):
        history = march(known.evolution, 0.5, step=0.5 / count, stops=known.stops)
        errors.append(abs(history["penetration"][-1] - known.exact(0.5)))
    assert errors[-1] < 1e-4
    assert np.log2(errors[1] / errors[2]) > 0.9


def test_a_bond_fades_at_a_fixed_opening() -> None:
    """beta of a bond that is held open by 0.1."""
    known = gallery.bonded_block()
    assert known.exact(1.0) == pytest.approx(0.173876498762, abs=1e-12)
    errors = []
    for count in (20, 40):
        history = march(known.evolution, 1.0, step=1.0 / count, stops=known.stops)
        (state,) = history.moment.memory.values()
        bond = next(values for name, values in state.items() if "bond" in name)
        errors.append(float(np.abs(bond - known.exact(1.0)).max()))
    assert errors[1] < 1e-2  # of order one in the step
    assert 1.7 < errors[0] / errors[1] < 2.3


@pytest.mark.slow
def test_a_damper_that_cannot_pull() -> None:
    """Restitution .571740027585 and contact .279535444073 of m = 1, k = 100, c = 4."""
    duration, restitution = gallery.bounce(100.0, 4.0)
    assert (duration, restitution) == pytest.approx((0.279535444073, 0.571740027585), abs=1e-12)
    known = gallery.bouncing_block()
    history = march(known.evolution, known.until, step=5e-4, scheme=hv.Midpoint())
    up = float(np.abs(history.moment.body.velocity).max())
    assert up == pytest.approx(known.exact(known.until), rel=2e-3)
    touching = history["normal_force"] > 0.0
    assert touching.sum() * 5e-4 == pytest.approx(duration, abs=2e-3)


@pytest.mark.slow
def test_a_manufactured_motion() -> None:
    """``u = sin(t) (2xy + xy^2, -x^2 (1 + y))/20``: order one in the step with implicit Euler, two with alpha."""
    lam, mu, lam_v, mu_v, rho = 2.0, 1.0, 0.5, 0.3, 1.5

    def shape(x: Array) -> Array:
        return np.stack([2 * x[:, 0] * x[:, 1] + x[:, 0] * x[:, 1] ** 2, -(x[:, 0] ** 2) * (1 + x[:, 1])], axis=1) / 20

    def force(x: Array, t: float) -> Array:
        elastic = np.stack([x[:, 0], -(1 + x[:, 1])], axis=1) / 10
        return rho * -np.sin(t) * shape(x) + (lam * np.sin(t) + lam_v * np.cos(t)) * elastic

    problem = hv.ContactProblem(
        mesh=hv.rectangle((2.0, 1.0), (8, 4)),
        material=hv.Material.lame(lam, mu, density=rho, viscosity=(lam_v, mu_v)),
        supports={
            name: hv.Prescribed(lambda x, t: np.sin(t) * shape(x)) for name in ("left", "right", "top", "bottom")
        },
        body_force=force,
        order=2,
    )
    evolution = Evolution(problem, inertia=True, velocity=shape)
    for scheme, order in ((hv.ImplicitEuler(), 1), (hv.GeneralizedAlpha(0.8), 2)):
        ends = [
            march(evolution, 1.0, step=1.0 / count, scheme=scheme).frames[-1].displacement for count in (5, 10, 160)
        ]
        errors = [float(np.abs(end - ends[-1]).max()) for end in ends[:-1]]
        assert np.log2(errors[0] / errors[1]) > order - 0.15, (scheme.name, errors)
        nodes = hv.discretize(problem.at_time(0.0)).field.nodes  # type: ignore[union-attr]
        off = float(np.abs(ends[-1] - np.sin(1.0) * shape(nodes)).max())
        assert off < 1.5 * 1e-4  # of the mesh, and of the smallest step


def _damped(time: float) -> float:
    """Where a mass of 1 comes to on a spring of 100 and a damper of 4, from 0 at the velocity .5."""
    swing = np.sqrt(100.0 - 4.0)
    return float(0.5 / swing * np.exp(-2.0 * time) * np.sin(swing * time))


@pytest.mark.parametrize("scheme", [hv.Newmark(), hv.GeneralizedAlpha(0.8), hv.GeneralizedAlpha(0.0)], ids=repr)
@pytest.mark.parametrize("rubs", [False, True])
def test_the_first_acceleration_knows_damping_and_friction(scheme: Scheme, rubs: bool) -> None:
    """A stiff block hits a damped spring, or is braked on one side by ``.5``: without it, errors are of order one."""
    mesh, stiff = hv.rectangle((1.0, 1.0), 1), hv.Material.lame(0.0, 5e5, density=1.0)
    sides = {"left": hv.Roller(), "right": hv.Roller()}
    damped = hv.Contact(hv.Compliance(100.0), damping=hv.Compliance(4.0))
    contact = {"right": hv.Contact(hv.NoContact(), hv.Tresca(0.5))} if rubs else {"bottom": damped}
    known = 0.5 * 0.1 - 0.5 * 0.1**2 / 2.0 if rubs else _damped(0.1)
    problem = hv.ContactProblem(
        mesh, stiff, contact=contact, supports={"left": hv.Roller(), "top": hv.Fixed(x=0.0)} if rubs else sides
    )
    evolution = Evolution(problem, inertia=True, velocity=(0.0, -0.5))
    history = march(evolution, 0.1, step=0.1 / 20, scheme=scheme, save=hv.Save(probes={"middle": (0.5, 0.5)}))
    assert -history["middle.u_y"][-1] == pytest.approx(known, abs=6e-6 if rubs else 2e-5)


@pytest.mark.parametrize("angle", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("side", ["bottom", "top"])
def test_redistributed_mass_is_the_whole_mass(side: str, dim: int, angle: float) -> None:
    """Whichever way the normal of the contact boundary looks: both move the same."""
    square = hv.rectangle((1.0, 1.0), 2) if dim == 2 else hv.box((1.0, 1.0, 1.0), 2)
    turn = np.eye(dim)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    problem = hv.ContactProblem(
        replace(square, parent=None, points=square.points @ turn.T),
        hv.Material.lame(0.0, 5.0, density=1.0),
        contact={side: hv.Contact(hv.Signorini(), gap=1.0)},
    )
    discrete = discretize_evolution(Evolution(problem, inertia=True, mass="redistributed"))
    assert discrete.mass is not None
    for way in np.eye(dim):
        there = discrete.restrict(np.tile(way, (len(discrete.field.nodes), 1)), np.zeros(0))
        assert discrete.mass.energy(there) == pytest.approx(0.5, rel=1e-12)


def test_restitution_asks_for_mass_at_contact_points() -> None:
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 1),
        hv.Material.lame(0.0, 5.0, density=1.0),
        contact={"bottom": hv.Contact(hv.Signorini(), gap=0.1)},
    )
    evolution = Evolution(problem, inertia=True, velocity=(0.0, -1.0), mass="redistributed")
    with pytest.raises(ProblemError, match="take mass = 'consistent' or restitution = 0"):
        march(evolution, 0.1, step=0.01, scheme=hv.MoreauJean(0.5))
    assert march(evolution, 0.1, step=0.01, scheme=hv.MoreauJean()).finished
