"""The terms of the ledger against integrals of the motion itself, which know nothing of how steps are booked."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import SDIRK2, Evolution, History, ImplicitEuler, Midpoint, Newmark, Save, Scheme, march
from tests import bodies

SPRING, DASHPOT, RUBBED = 20.0, 3.0, 0.02


def growing_motion(x: Array, t: float) -> Array:
    return np.stack([0.2 * t**2 * (1.0 + x[:, 0]), -0.05 * t**2 + 0.0 * x[:, 0]], axis=1)


def growing_push(x: Array, t: float) -> Array:
    return np.stack([0.5 * t + 0.0 * x[:, 0], -0.3 * t**2 + 0.0 * x[:, 0]], axis=1)


def everything(inertia: bool) -> Evolution:
    """A body with viscosity and two branches, held at a top that moves, on springs and dashpots, rubbed."""
    dashpot = hv.laws.PiecewiseQuadratic([0.0], [DASHPOT, DASHPOT], [0.0])
    springs = hv.laws.PiecewiseQuadratic([0.0], [SPRING, SPRING], [0.0])
    problem = bodies.square(
        hv.Contact(springs, hv.Tresca(RUBBED), damping=dashpot),
        2,
        density=1.0 if inertia else None,
        viscosity=(0.4, 0.4),
        branches=[hv.materials.Branch(lame=(2.0, 2.0), time=0.3), hv.materials.Branch(lame=(0.5, 1.0), time=0.1)],
        supports={"top": hv.Prescribed(growing_motion)},
        body_force=growing_push,
    )
    return Evolution(problem, inertia=inertia)


def measured(history: History, at: float) -> dict[str, float]:
    """Energies at the end, and what was done and lost up to it, of the frames alone: by the way from one to the next.

    Loads are taken at one place of every step, ``at``.
    """
    discrete, frames = history.discrete, history.frames
    assert len(frames) == len(history.times)
    assert discrete.viscosity is not None
    assert sorted(period for period, _ in discrete.branches) == [0.1, 0.3]
    weights = discrete.problem.contact.weights[:, None]
    places = [discrete.restrict(one.displacement, discrete.data_at(one.time).prescribed) for one in frames]
    hidden = [np.zeros_like(places[0]) for _ in discrete.branches]
    found = dict.fromkeys(("viscous", "branch_loss", "damping", "friction", "work", "euler"), 0.0)
    for before, after, x, y in zip(frames, frames[1:], places, places[1:], strict=False):
        tau = after.time - before.time
        way, slid = y - x, after.local - before.local
        for k, (period, branch) in enumerate(discrete.branches):
            old, parts = hidden[k], []
            for span in (0.5 * tau, tau):
                keep = np.exp(-span / period)
                parts.append(keep * old + (1.0 - keep) * period / tau * way)
            middle, h = parts
            hidden[k] = h
            energies = branch.energy(old) + 4.0 * branch.energy(middle) + branch.energy(h)
            loss = 2.0 * tau / period * energies / 6.0  # Simpson's rule
            found["branch_loss"] += loss
            found["euler"] += float(way @ branch.times(h)) - branch.energy(h) + branch.energy(old) - loss
        found["viscous"] += 2.0 * discrete.viscosity.energy(way) / tau
        found["damping"] += DASHPOT * float((weights * slid**2)[:, 0].sum()) / tau
        found["friction"] += float((weights * after.multiplier * slid)[:, 1:].sum())
        found["work"] += float(discrete.data_at(before.time + at * tau).load @ way)
        faster = after.velocity - before.velocity
        faster = discrete.restrict(faster, faster.ravel()[discrete.moved])
        found["euler"] += discrete.stiffness.energy(way) + 0.5 * SPRING * float((weights * slid**2)[:, 0].sum())
        if discrete.mass is not None:
            found["euler"] += discrete.mass.energy(faster)
    last = frames[-1]
    speed = discrete.restrict(last.velocity, last.velocity.ravel()[discrete.moved])
    return found | {
        "elastic": discrete.stiffness.energy(places[-1]),
        "kinetic": 0.0 if discrete.mass is None else discrete.mass.energy(speed),
        "branches": sum(branch.energy(h) for h, (_, branch) in zip(hidden, discrete.branches, strict=True)),
        "contact": 0.5 * SPRING * float(weights[:, 0] @ last.local[:, 0] ** 2),
    }


@pytest.mark.parametrize(
    ("scheme", "inertia", "at", "close"),
    [
        (ImplicitEuler(), True, 1.0, 1e-10),
        (ImplicitEuler(), False, 1.0, 1e-10),
        (Midpoint(), True, 0.5, 1e-10),
        (Midpoint(), False, 0.5, 1e-10),
        (Newmark(0.3, 0.5), True, 0.5, 0.12),
        (hv.evolution.GeneralizedAlpha(0.4), True, 0.5, 0.06),
        (SDIRK2(), False, 0.5, 5e-3),
    ],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_every_term_is_what_it_is_called(scheme: Scheme, inertia: bool, at: float, close: float) -> None:
    step = 0.08
    history = march(everything(inertia), 0.8, step=step, scheme=scheme, save=Save(step))
    ledger, found = history.ledger, measured(history, at)
    euler = found.pop("euler")
    for name, value in found.items():
        exact = name in ("elastic", "kinetic", "branches", "contact", "friction")
        limit = 1e-10 if exact else 1e-3 if name == "branch_loss" else close
        assert ledger[name] == pytest.approx(value, rel=limit, abs=1e-14), name
        assert value > 1e-4 or (name == "kinetic" and not inertia), name
    if isinstance(scheme, ImplicitEuler):
        assert ledger["numerical"] == pytest.approx(euler, rel=1e-2)
    else:  # forces at one end of the step: with half of it a half; in its middle: a quarter
        left = 0.35 if scheme.name == "midpoint" else 0.6
        finer = march(everything(inertia), 0.8, step=0.5 * step, scheme=scheme)
        assert abs(finer.ledger["numerical"]) < left * abs(ledger["numerical"]) < 0.25 * ledger["work"]
    assert abs(ledger["gap"]) < 1e-12
    assert ledger["memory"] == ledger["jumps"] == 0.0
    put_in = ledger["work"] + ledger["moved"]
    kept = sum(ledger[name] for name in ("elastic", "kinetic", "branches", "contact"))
    gone = sum(ledger[name] for name in ("viscous", "branch_loss", "damping", "friction", "numerical"))
    assert put_in == pytest.approx(kept + gone, rel=1e-12)


LINEAR = hv.laws.PiecewiseQuadratic([0.0], [SPRING, SPRING], [0.0])
GLUE = hv.Softening(SPRING, 0.02, 5.0)


def on_the_ground(contact: hv.Contact, load: float = 0.0, **more: object) -> Evolution:
    """A unit square between rollers, modulus 3, viscosity 0.6, pushed down at its bottom by ``load t``."""
    problem = bodies.column(
        contact,
        3.0,
        viscous=0.6,
        density=1.0 if more else None,
        tractions={"bottom": lambda x, t: np.array([0.0, -load * t])},
    )
    return Evolution(problem, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("memory", "stored", "force"),
    [
        (hv.laws.Bonding(50.0, 0.05, 0.2), 0.5 * 50.0 * 0.05**2, -50.0 * 0.05),
        (hv.laws.Secant(), 0.5 * 5.0 * 0.05**2, -0.25),
    ],
    ids=["bond", "secant"],
)
def test_a_foundation_that_is_stretched_at_the_start_stores_energy_and_pulls(
    memory: hv.laws.Memory, stored: float, force: float
) -> None:
    """A bond at an opening of 0.05; glue whose tension has fallen to 0.25 there, and unloads along the secant."""
    glue = hv.laws.PiecewiseQuadratic([-0.1, -0.02, 0.0], [0.0, -5.0, 20.0, 0.0], [0.0, 0.0, 0.0])
    contact = hv.Contact(
        glue if isinstance(memory, hv.laws.Secant) else hv.Compliance(SPRING), gap=0.05, memory=(memory,)
    )
    evolution = on_the_ground(contact)
    history = march(evolution, 1e-5, step=1e-5)
    assert history["contact"][0] == pytest.approx(stored, rel=1e-9)
    assert history["normal_force"][0] == pytest.approx(force, rel=1e-6)
    assert history["contact"][1] == pytest.approx(stored, rel=1e-2)
    assert abs(history.ledger["numerical"]) < 1e-3 * stored


def test_a_foundation_that_creeps_beside_a_damper_feels_its_own_pressure_only() -> None:
    """``3 r + 0.6 r' + 20 (r - w) + 2 r' = t`` with ``5 w' = 20 (r - w)``: two linear equations."""
    contact = hv.Contact(
        LINEAR, damping=hv.laws.PiecewiseQuadratic([0.0], [2.0, 2.0], [0.0]), memory=(hv.laws.ViscousFoundation(5.0),)
    )
    A = np.array([[-23.0 / 2.6, 20.0 / 2.6], [4.0, -4.0]])
    rest = np.linalg.solve(A, [-1.0 / 2.6, 0.0])  # y' = A y + (1/2.6, 0) t has y = rest t + slope
    slope = np.linalg.solve(A, rest)
    values, modes = np.linalg.eig(A)
    exact = (modes * np.exp(values)) @ np.linalg.solve(modes, -slope) + slope + rest
    errors, lost = [], []
    for count in (20, 40):
        history = march(on_the_ground(contact, 1.0), 1.0, step=1.0 / count)
        found = [history["penetration"][-1], history.state.memory["bottom"]["0.depth"][0]]
        errors.append(np.abs(found - exact).max())
        lost.append(history.ledger["numerical"] / history.ledger["work"])
    assert errors[0] < 0.04 * exact[0]
    assert 1.8 < errors[0] / errors[1] < 2.2
    assert 0.0 < lost[1] < 0.55 * lost[0] < 0.02


def test_springs_that_end_store_what_is_left_of_them_on_a_foundation_that_creeps() -> None:
    """Pressed to the end of its springs, 0.02, the foundation creeps away: what they store stays ``5 0.02^2/2``."""
    contact = hv.Contact(hv.laws.FinitePenetration(5.0, 0.02), memory=(hv.laws.ViscousFoundation(2.0),))
    history = march(on_the_ground(contact, 4.0), 1.0, step=0.05)
    assert history["penetration"][-1] > 0.1
    assert history["contact"][-1] == pytest.approx(0.5 * 5.0 * 0.02**2)


@pytest.mark.parametrize("scheme", [Midpoint(), hv.evolution.GeneralizedAlpha(1.0)], ids=lambda scheme: scheme.name)
def test_a_damper_of_no_size_loses_nothing(scheme: Scheme) -> None:
    nothing = hv.laws.DampedContact(hv.laws.PiecewiseQuadratic([0.0], [0.0, 0.0], [0.0]))
    contact = hv.Contact(hv.Compliance(SPRING), memory=(nothing,))
    history = march(on_the_ground(contact, 1.0, inertia=True, velocity=(0.0, -0.1)), 1.0, step=0.05, scheme=scheme)
    assert history.ledger["work"] > 1e-3
    assert abs(history["memory"]).max() < 1e-9 * history.ledger["work"]


def test_a_damping_that_changes_with_time_is_that_of_the_time() -> None:
    """``3 r + (0.6 + 1 + 100 t) r' = 3``: ``r = 1 - (1 + 100 t/1.6)^(-3/100)``."""
    errors = []
    for count in (20, 40):
        contact = hv.Contact(hv.laws.NoContact(), damping=hv.Compliance(lambda x, t: 1.0 + 100.0 * t + 0.0 * x[:, 0]))
        problem = on_the_ground(contact).body
        pushed = hv.ContactProblem(
            problem.mesh, problem.material, problem.contact, problem.supports, tractions={"bottom": (0.0, -3.0)}
        )
        history = march(Evolution(pushed), 1.0, step=1.0 / count)
        assert "laws change" in history.time_error.why
        errors.append(abs(history["penetration"][-1] - 1.0 + (1.0 + 100.0 / 1.6) ** -0.03))
    assert errors[1] < 0.65 * errors[0] < 0.02


def test_what_points_remember_does_not_change_with_time() -> None:
    for memory in (
        hv.laws.Wear(lambda x, t: t + 0.0 * x[:, 0]),
        hv.laws.DampedContact(hv.Compliance(lambda x, t: t + x[:, 0])),
    ):
        with pytest.raises(hv.errors.ProblemError, match="depends on time, which it cannot"):
            hv.Contact(hv.Compliance(SPRING), memory=(memory,))
