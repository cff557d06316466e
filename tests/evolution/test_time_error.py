"""The guaranteed bound of the error in time, against runs with steps forty times shorter, and where it is known."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, History, Save, march
from tests import bodies
from tests.samples import sampled, slow

FINER = 40


def wave(t: float) -> float:
    return float(np.sin(9.0 * t))


def pulse(t: float) -> float:
    return float(0.25 < t < 0.35)


def rate_problem(seed: int) -> tuple[Evolution, float, int]:
    """Laws of the rate: friction that weakens or not, damping; what it is, how long, and in how many steps."""
    rng = np.random.default_rng([seed, 1])
    mu_v, lam_v = 0.05 + rng.random(2)
    bound = 0.02 + 0.2 * rng.random()
    friction = (
        hv.Tresca(bound),
        hv.laws.Logarithmic(min(bound, 0.2 * mu_v), of="rate"),
        hv.SlipWeakening(min(bound, 0.3 * mu_v), 0.5 + rng.random(), of="rate"),
        hv.Tresca(lambda x: bound * (1.0 + x[:, 0])),
    )[seed % 4]
    free = seed % 3 == 0
    contact = hv.Contact(
        hv.laws.NoContact() if free else hv.laws.Bilateral(),
        friction,
        damping=hv.Compliance(1.0 + rng.random()) if free else None,
    )
    return random_strip(rng, contact, lam_v, mu_v, moving=seed % 2 == 1), 0.2 + rng.random(), int(rng.integers(3, 7))


def place_problem(seed: int) -> tuple[Evolution, float, int]:
    """Laws of the displacement: rigid, compliant, of the survey, softening."""
    rng = np.random.default_rng([seed, 2])
    mu_v, lam_v = 0.05 + rng.random(2)
    normal = (
        hv.Compliance(40.0 * rng.random()),
        hv.Signorini(),
        hv.laws.ThresholdCompliance(0.1 * rng.random(), 3.0 * rng.random()),
        hv.Softening(2.0, 0.03, 0.3 + 0.5 * rng.random()),
    )[seed % 4]
    contact = hv.Contact(normal, gap=0.02 * rng.random())
    return (
        random_strip(rng, contact, lam_v, mu_v, moving=seed % 2 == 1),
        0.2 + 2.0 * rng.random(),
        int(rng.integers(3, 7)),
    )


def random_strip(rng: np.random.Generator, contact: hv.Contact, lam_v: float, mu_v: float, moving: bool) -> Evolution:
    lam, mu = 1.0 + 5.0 * rng.random(2)
    across, down = 0.5 * rng.standard_normal(), -0.2 - rng.random()
    pulled = float(rng.standard_normal())
    stiffer = float(rng.random())

    def steady(x: Array) -> Array:
        return np.broadcast_to([across, down], x.shape)

    def growing(x: Array, t: float) -> Array:  # straight in time, as the theorem asks
        return np.stack([across + pulled * t * x[:, 1], down * (1.0 - t) + 0.0 * x[:, 0]], axis=1)

    def modulus(x: Array) -> Array:
        return mu * (1.0 + stiffer * x[:, 0])

    pattern: Any = ("cross", "right", "left")[int(rng.integers(3))]
    cells = (int(rng.integers(2, 6)), int(rng.integers(1, 4)))
    problem = bodies.strip(
        contact,
        cells,
        pattern,
        size=(1.0 + rng.random(), 0.6 + rng.random()),
        lame=(lam, modulus if rng.random() < 0.5 else mu),
        viscosity=(lam_v, mu_v),
        body_force=growing if moving else steady,
        order=2 if rng.random() < 0.2 else 1,
    )
    return Evolution(problem)


def distances(coarse: History, fine: History) -> Array:
    """How far two runs are apart, in the norm of the bound, at each step of the first."""
    operator = getattr(coarse.discrete, coarse.time_error.norm)
    rest = np.zeros(len(coarse.discrete.moved))
    found = []
    for one, other in zip(coarse.frames, fine.frames, strict=True):
        assert one.time == pytest.approx(other.time)
        found.append(operator.energy(coarse.discrete.restrict(one.displacement - other.displacement, rest)))
    return np.asarray(np.sqrt(2.0 * np.array(found)))


def compared(evolution: Evolution, until: float, steps: int) -> tuple[History, Array, Array]:
    """A run, its bound and the distance from a run with short steps, at each of its steps."""
    step = until / steps
    coarse = march(evolution, until, step=step, save=Save(step))
    fine = march(evolution, until, step=step / FINER, save=Save(step))
    return coarse, coarse["time_error"], distances(coarse, fine)


SAMPLES = tuple(itertools.product(("stiffness", "viscosity"), range(16)))


@pytest.mark.parametrize(("norm", "seed"), sampled(SAMPLES, [("stiffness", 1), ("viscosity", 2), ("viscosity", 5)]))
def test_the_bound_holds_at_every_step(norm: str, seed: int) -> None:
    evolution, until, steps = (rate_problem if norm == "stiffness" else place_problem)(seed)
    coarse, bound, error = compared(evolution, until, steps)
    assert coarse.time_error.norm == norm, coarse.time_error.why
    assert coarse.time_error.guaranteed
    assert coarse.time_error.bound == bound[-1]
    assert error.max() > 0.0
    assert (error <= bound * (1.0 + 1e-6)).all(), (error, bound)


def damped_spring(contact: hv.Contact, load: object) -> Evolution:
    """A unit square between rollers, modulus 3, viscosity 0.6, held at its top: one degree of freedom."""
    pull: Any = {"bottom": (0.0, load)}
    return Evolution(bodies.column(contact, 3.0, viscous=0.6, tractions=pull))


@pytest.mark.parametrize(
    ("norm", "bent"),
    [("stiffness", pulse), ("viscosity", wave), slow("stiffness", wave), slow("viscosity", pulse)],
    ids=lambda value: value if isinstance(value, str) else value.__name__,
)
def test_loads_that_bend_within_a_step_make_an_estimate(norm: str, bent: Callable[[float], float]) -> None:
    """A pulse between two ends of steps left a bound of zero beside a body that moved."""

    def load(x: Array, t: float) -> Array:
        return np.stack([0.0 * x[:, 0], -bent(t) + 0.0 * x[:, 0]], axis=1)

    law = (
        hv.Contact(hv.Compliance(2.0))
        if norm == "viscosity"
        else hv.Contact(hv.laws.NoContact(), damping=hv.Compliance(1.0))
    )
    problem = bodies.square(law, 1, lame=(0.0, 1.5), viscosity=(0.0, 0.3), body_force=load)
    coarse, bound, error = compared(Evolution(problem), 1.0, 5)
    assert coarse.time_error.norm == norm, coarse.time_error.why
    assert not coarse.time_error.guaranteed
    assert "an estimate" in coarse.time_error.words
    assert error.max() > 0.0
    assert (error <= bound).all(), (error, bound)


@pytest.mark.parametrize("norm", ["stiffness", "viscosity"])
def test_the_effectivity_of_one_degree_of_freedom(norm: str) -> None:
    """``u' + a u = a``, a = 5: the error is ``tau a^2 t e^{-a t}/2``, largest at t = 1/a, times the size of the body.

    The bound of laws of the rate grows to ``tau a / sqrt(12)`` times the same size: e/sqrt(3) = 1.569 of the largest
    error.  That of laws of the displacement forgets: at t = 1/a it is nearer, and it falls with the error.
    """
    damped = {"damping": hv.Compliance(0.0)} if norm == "stiffness" else {}
    evolution = damped_spring(hv.Contact(hv.laws.NoContact(), **damped), -1.0)  # type: ignore[arg-type]
    count = 100
    history = march(evolution, 3.0, step=3.0 / count)
    assert history.time_error.norm == norm, history.time_error.why
    size = math.sqrt(
        2.0 * getattr(history.discrete, norm).energy(history.state.body.displacement)
    )  # of the body at rest
    exact = np.exp(-5.0 * history.times)
    error = size * np.abs((1.0 + 5.0 * 3.0 / count) ** -np.arange(count + 1) - exact)
    bound = history["time_error"]
    assert (bound >= error).all()
    overall = bound.max() / error.max()
    if norm == "stiffness":
        assert overall == pytest.approx(math.e / math.sqrt(3.0), rel=0.1)
    else:
        assert 1.0 <= overall < math.e / math.sqrt(3.0)
        assert bound[-1] < 1e-3 * bound.max()  # it has forgotten


def test_bodies_that_stick_keep_their_error() -> None:
    """Why laws of the rate forget nothing: two bodies that differ, and stick, are both at rest for ever."""
    problem = bodies.square(
        hv.Contact(hv.laws.Bilateral(), hv.Tresca(0.5)), 2, viscosity=(0.4, 0.4), supports={"top": hv.Clamped()}
    )
    left = Evolution(problem, displacement=lambda x: np.stack([0.05 * (1.0 - x[:, 1]), 0.0 * x[:, 0]], axis=1))
    history = march(left, 50.0, step=5.0, save=Save(5.0))
    assert history.frames[-1].local[:, 1] == pytest.approx(history.frames[0].local[:, 1], abs=1e-12)
    assert np.abs(history.frames[-1].local[:, 1]).max() > 0.01


def test_no_bound_without_viscosity_somewhere() -> None:
    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    regions = {"a": np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 0] < 1.0)}
    regions["b"] = np.setdiff1d(np.arange(mesh.number_of_cells), regions["a"])
    mesh = hv.Mesh(mesh.points, mesh.cells, dict(mesh.boundaries), regions)
    parts = {"a": hv.Material.lame(4, 4, viscosity=(0.4, 0.4)), "b": hv.Material.lame(4, 4)}
    cases: tuple[tuple[hv.Contact, Any, bool], ...] = (
        (hv.Contact(hv.laws.Bilateral(), hv.Tresca(0.1)), (0.0, -0.2), False),
        (hv.Contact(hv.Compliance(3.0)), (0.0, -0.2), True),
        (hv.Contact(hv.Compliance(3.0)), lambda x, t: np.array([0.0, -t]), False),
    )
    for contact, load, bounded in cases:
        problem = bodies.body(mesh, contact, material=hv.Material.by_region(parts), body_force=load)
        error = march(Evolution(problem), 0.2, step=0.1).time_error
        assert math.isfinite(error.bound) == bounded
        assert bounded or "does not resist every motion" in error.why


def test_no_bound_of_forces_on_a_body_that_viscosity_does_not_hold() -> None:
    """A bedding holds it; where loads move, forces are measured against the viscosity, which it does not."""
    for load, bounded in (((0.0, -0.2), True), (lambda x, t: np.array([0.0, -t]), False)):
        problem = hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 3),
            material=hv.Material.lame(4, 4, viscosity=(0.4, 0.4)),
            bedding=3.0,
            body_force=load,  # type: ignore[arg-type]
            contact={"bottom": hv.Contact(hv.Compliance(3.0))},
        )
        assert math.isfinite(march(Evolution(problem), 0.2, step=0.1).time_error.bound) == bounded


def test_the_bound_of_a_membrane() -> None:
    """Fields of one component have it too, without a rate at which errors fade."""
    problem = hv.ScalarProblem(
        mesh=hv.rectangle((1.0, 1.0), 3),
        coefficient=2.0,
        viscosity=0.5,
        supports={"left": 0.0, "right": 0.0},
        contact={"bottom": hv.ScalarContact(hv.Compliance(5.0))},
        source=lambda x, t: 1.0 - t + 0.0 * x[:, 0],
    )
    coarse, bound, error = compared(Evolution(problem), 1.0, 4)
    assert coarse.time_error.norm == "viscosity", coarse.time_error.why
    assert (error <= bound * (1.0 + 1e-6)).all()
    assert bound.max() < 30.0 * error.max()


def test_the_bound_is_the_one_that_is_written() -> None:
    """The recursion for laws of the displacement, by quadrature: one degree of freedom, K = 3, C = 0.6, a spring 2."""
    evolution = damped_spring(hv.Contact(hv.Compliance(2.0)), -1.0)
    problem = evolution.problem
    moving = hv.ContactProblem(
        mesh=problem.mesh,
        material=problem.material,
        supports=problem.supports,
        tractions={"bottom": lambda x, t: np.array([0.0, -1.0 - 4.0 * t])},
        contact=problem.contact,
    )
    tau, count = 0.1, 6
    history = march(Evolution(moving), tau * count, step=tau)
    r = -history["penetration"]  # the lower side goes down by -r
    p = 1.0 + 4.0 * history.times
    y, bounds = 0.0, [0.0]
    for n in range(1, count + 1):
        u, v, rate = r[n - 1], r[n], (r[n] - r[n - 1]) / tau

        def energy(w: float, load: float = p[n]) -> float:
            return 1.5 * w**2 + min(w, 0.0) ** 2 + load * w

        q = 3.0 * tau**2 * rate**2
        D = energy(u) - energy(v) - tau * 0.6 * rate**2
        beta = 0.0 if y == 0.0 else max(0.0, 1.0 - math.sqrt(q / (12.0 * 5.0)) / y)
        rho = 5.0 * beta
        ell, weights = np.polynomial.legendre.leggauss(20)
        ell, weights = 0.5 * (ell + 1.0), 0.5 * weights
        source = weights @ (np.exp(-2.0 * rho * tau * ell) * (ell * (2.0 * D - q) + ell**2 * q / (2.0 * (1.0 - beta))))
        moved = weights @ (np.exp(-rho * tau * ell) * ell) * tau * 4.0 * tau / math.sqrt(0.6)
        y = math.sqrt(math.exp(-2.0 * rho * tau) * y**2 + tau * source) + moved
        bounds.append(y)
    assert history["time_error"] == pytest.approx(bounds, rel=1e-9)


def test_the_bound_of_rates_is_the_one_that_is_written() -> None:
    """``sum tau^3/6 |K dU - df|^2/C`` on one degree of freedom with friction that does not soften."""
    moving = bodies.square(
        hv.Contact(hv.laws.Bilateral(), hv.Tresca(0.2)),
        1,
        lame=(0.0, 3.0),
        viscosity=(0.0, 0.6),
        supports={"left": hv.Fixed(y=0.0), "right": hv.Fixed(y=0.0), "top": hv.Fixed(x=0.0, y=0.0)},
        tractions={"bottom": lambda x, t: np.array([1.0 + 2.0 * t, 0.0])},
    )
    tau, count = 0.1, 5
    history = march(Evolution(moving), tau * count, step=tau, save=Save(probes={"p": (0.5, 0.0)}))
    rate = np.diff(history["p.u_x"]) / tau
    assert (rate > 0.0).all()
    squares = np.concatenate([[0.0], np.cumsum(tau**3 / 6.0 * (3.0 * rate - 2.0) ** 2 / 0.6)])
    assert history["time_error"] == pytest.approx(np.sqrt(squares), rel=1e-9)
