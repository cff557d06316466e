"""Evolutions of one degree of freedom and of uniform bodies against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, Scheme, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.formula import Formula
from hemivar.laws.memory import LocalStep
from tests import bodies
from tests.samples import slow


@pytest.mark.parametrize("scheme", [slow(hv.evolution.ImplicitEuler()), hv.evolution.SDIRK2()], ids=lambda s: s.name)
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
    problem = bodies.square(
        cells=1,
        pattern="cross",
        lame=(0.0, 1.0),
        branches=[hv.materials.Branch(lame=(0.0, 0.5), time=period)],
        supports={"bottom": hv.Clamped(), "top": hv.Prescribed(lambda x, t: 0.1 * t * np.array([[0.0, 1.0]]) + 0 * x)},
    )
    lost = march(Evolution(problem), 1.0, step=0.1)["branch_loss"][-1]
    assert lost == pytest.approx(0.01 * period**2 * exact, rel=1e-6)
    memory, law = hv.laws.PenetrationMemory(1.0, period), hv.laws.ContactLaw(hv.laws.NoContact())
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
        (state,) = history.state.memory.values()
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
    history = march(known.evolution, known.until, step=5e-4, scheme=hv.evolution.Midpoint())
    up = float(np.abs(history.state.body.velocity).max())
    assert up == pytest.approx(known.exact(known.until), rel=2e-3)
    touching = history["normal_force"] > 0.0
    assert touching.sum() * 5e-4 == pytest.approx(duration, abs=2e-3)


def test_a_damper_that_stiffens_with_time() -> None:
    """At the end of each step the pressure is ``c(t) max(r', 0)`` with the c of that time."""
    problem = bodies.square(
        hv.Contact(hv.laws.NoContact(), damping=hv.Compliance(Formula("3 + 40*t"))),
        2,
        lame=(40.0, 40.0),
        density=1.0,
        supports={},
        body_force=lambda x, t: np.array([0.0, -np.cos(6.0 * t)]) + 0.0 * x,
    )
    history = march(Evolution(problem, inertia=True), 0.5, step=0.05, save=hv.evolution.Save(every=0.05))
    frames = [frame for frame in history.frames if frame.multiplier.any()]
    assert len(frames) > 3
    for frame in frames:
        expected = (3.0 + 40.0 * frame.time) * np.maximum(frame.rate[:, 0], 0.0)
        np.testing.assert_allclose(frame.multiplier[:, 0], expected, rtol=1e-7, atol=1e-9)
    assert history["damping"][-1] > 0.0
    assert np.abs(history["gap"]).max() < 1e-9 * history["damping"][-1]


@pytest.mark.slow
def test_a_manufactured_motion() -> None:
    """``u = sin(t) (2xy + xy^2, -x^2 (1 + y))/20``: order one in the step with implicit Euler, two with alpha."""
    lam, mu, lam_v, mu_v, rho = 2.0, 1.0, 0.5, 0.3, 1.5

    def shape(x: Array) -> Array:
        return np.stack([2 * x[:, 0] * x[:, 1] + x[:, 0] * x[:, 1] ** 2, -(x[:, 0] ** 2) * (1 + x[:, 1])], axis=1) / 20

    def force(x: Array, t: float) -> Array:
        elastic = np.stack([x[:, 0], -(1 + x[:, 1])], axis=1) / 10
        return rho * -np.sin(t) * shape(x) + (lam * np.sin(t) + lam_v * np.cos(t)) * elastic

    problem = bodies.strip(
        cells=(8, 4),
        lame=(lam, mu),
        density=rho,
        viscosity=(lam_v, mu_v),
        supports={
            name: hv.Prescribed(lambda x, t: np.sin(t) * shape(x)) for name in ("left", "right", "top", "bottom")
        },
        body_force=force,
        order=2,
    )
    evolution = Evolution(problem, inertia=True, velocity=shape)
    for scheme, order in ((hv.evolution.ImplicitEuler(), 1), (hv.evolution.GeneralizedAlpha(0.8), 2)):
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


@pytest.mark.parametrize(
    "scheme", [hv.evolution.Newmark(), hv.evolution.GeneralizedAlpha(0.8), hv.evolution.GeneralizedAlpha(0.0)], ids=repr
)
@pytest.mark.parametrize("what", ["damping", "damping in contact", "friction"])
def test_the_first_acceleration_knows_damping_and_friction(scheme: Scheme, what: str) -> None:
    """A stiff block hits a damped spring, or is braked on one side by ``.5``: without it, errors are of order one."""
    mesh, stiff = hv.rectangle((1.0, 1.0), 1), hv.Material.lame(0.0, 5e5, density=1.0)
    sides = {"left": hv.Roller(), "right": hv.Roller()}
    rubs, damper = what == "friction", hv.Compliance(4.0)
    damped = hv.Contact(hv.Compliance(100.0), damping=damper)
    if what == "damping in contact":
        damped = hv.Contact(hv.Compliance(100.0), memory=(hv.laws.DampedContact(damper),))
    contact = {"right": hv.Contact(hv.laws.NoContact(), hv.Tresca(0.5))} if rubs else {"bottom": damped}
    known = 0.5 * 0.1 - 0.5 * 0.1**2 / 2.0 if rubs else _damped(0.1)
    problem = hv.ContactProblem(
        mesh, stiff, contact=contact, supports={"left": hv.Roller(), "top": hv.Fixed(x=0.0)} if rubs else sides
    )
    evolution = Evolution(problem, inertia=True, velocity=(0.0, -0.5))
    history = march(evolution, 0.1, step=0.1 / 20, scheme=scheme, save=hv.evolution.Save(probes={"middle": (0.5, 0.5)}))
    assert -history["middle.u_y"][-1] == pytest.approx(known, abs=6e-6 if rubs else 2e-5)


HOLDS = {
    "friction on springs": hv.Contact(hv.Compliance(4000.0), hv.Tresca(30.0)),
    "friction by pressure": hv.Contact(hv.Compliance(4000.0), hv.Coulomb(0.5)),
    "friction by a rigid obstacle": hv.Contact(hv.Signorini(), hv.Coulomb(0.5)),
    "glued": hv.Contact(hv.laws.Bilateral(), hv.Tresca(30.0)),
}


@pytest.mark.parametrize("name", HOLDS)
@pytest.mark.parametrize(
    "scheme",
    [hv.evolution.Newmark(), hv.evolution.GeneralizedAlpha(0.8), hv.evolution.Midpoint()],
    ids=lambda s: s.name,
)
def test_a_body_in_equilibrium_stays_there(scheme: Scheme, name: str) -> None:
    """Statics under load and friction is where dynamics begins: without what holds it, Newmark rings for ever."""
    problem = bodies.strip(HOLDS[name], (4, 2), lame=(400.0, 400.0), density=1.0, tractions={"top": (3.0, -20.0)})
    still = hv.solve(problem, controls=hv.Controls(rtol=1e-13))
    place = np.asarray(still.displacement)
    history = march(Evolution(problem, inertia=True, displacement=place), 0.1, step=0.02, scheme=scheme)
    assert np.abs(still.multiplier[:, 1]).max() > 1.0  # friction holds it
    assert history["friction_force"][1:] == pytest.approx(np.full(5, history["friction_force"][1]), rel=1e-8)
    assert history["kinetic"].max() < 1e-18
    np.testing.assert_allclose(history.frames[-1].displacement, place, atol=1e-8 * np.abs(place).max())


def test_a_foundation_that_falls_away_pulls_what_is_glued_to_it_from_the_start() -> None:
    """By ``.5 a t^2`` from rest: Newmark's pull is of second order from the first step on, against DOP853."""
    a, end = 3.0, 0.2
    problem = bodies.column(
        hv.Contact(hv.laws.Bilateral(), gap=lambda x, t: np.full(len(x), 0.5 * a * t**2)), 100.0, top=None, density=1.0
    )
    evolution = Evolution(problem, inertia=True)
    discrete = discretize_evolution(evolution)
    assert discrete.mass is not None
    K, M = discrete.stiffness.inner.toarray(), discrete.mass.inner.toarray()
    held = np.unique(discrete.problem.contact.trace.indices)
    free = np.setdiff1d(np.arange(4), held)

    def pushed(t: float, u: Array) -> Array:
        load = M[:, held].sum(axis=1) * a + K[:, held].sum(axis=1) * 0.5 * a * t**2 + K[:, free] @ u
        return np.asarray(np.linalg.solve(M[np.ix_(free, free)], -load[free]))

    def pull(t: float, u: Array) -> float:
        return float(-(M[held].sum(axis=0) @ whole(a, pushed(t, u)) + K[held].sum(axis=0) @ whole(0.5 * a * t**2, u)))

    def whole(there: float, u: Array) -> Array:
        out = np.full(4, there)
        out[free] = u
        return out

    known = solve_ivp(
        lambda t, y: np.concatenate([y[2:], pushed(t, y[:2])]), (0.0, end), np.zeros(4), method="DOP853",
        rtol=1e-10, atol=1e-12, dense_output=True,
    ).sol  # fmt: skip
    errors = []
    for count in (10, 20, 40):
        history = march(evolution, end, step=end / count, scheme=hv.evolution.Newmark())
        exact = [pull(t, known(t)[:2]) for t in history["time"][1:]]
        errors.append(float(np.abs(history["normal_force"][1:] - exact).max()))
    assert errors[-1] < 0.02
    assert min(np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])) > 1.8


@pytest.mark.parametrize("angle", [0.0, 0.5, 2.0])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("side", ["bottom", "top"])
def test_redistributed_mass_is_the_whole_mass(side: str, dim: int, angle: float) -> None:
    """Whichever way the normal of the contact boundary looks: both move the same."""
    square = hv.rectangle((1.0, 1.0), 2) if dim == 2 else hv.box((1.0, 1.0, 1.0), 2)
    about = (0.0, 0.0, angle) if dim == 2 else (0.3 * angle, 0.5 * angle, 0.8 * angle)
    turn = Rotation.from_rotvec(about).as_matrix()[:dim, :dim]
    problem = hv.ContactProblem(
        replace(square, parent=None, points=square.points @ turn.T),
        hv.Material.lame(0.0, 5.0, density=1.0),
        contact={side: hv.Contact(hv.Signorini(), gap=1.0)},
    )
    discrete = discretize_evolution(Evolution(problem, inertia=True, mass="redistributed"))
    assert discrete.mass is not None
    for way in (*np.eye(dim), np.ones(dim) / np.sqrt(dim)):
        there = discrete.restrict(np.tile(way, (len(discrete.field.nodes), 1)), np.zeros(0))
        assert discrete.mass.energy(there) == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_the_law_of_impact_asks_for_mass_at_contact_points(restitution: float) -> None:
    """A block that fell on a rigid obstacle sank into it by a third of its height, however short the steps were."""
    problem = bodies.square(hv.Contact(hv.Signorini(), gap=0.1), 1, lame=(0.0, 5.0), density=1.0, supports={})
    evolution = Evolution(problem, inertia=True, velocity=(0.0, -1.0), mass="redistributed")
    with pytest.raises(ProblemError, match="take mass = 'consistent', or the scheme newmark"):
        march(evolution, 0.1, step=0.01, scheme=hv.evolution.MoreauJean(restitution))
    assert march(
        replace(evolution, mass="consistent"), 0.1, step=0.01, scheme=hv.evolution.MoreauJean(restitution)
    ).finished


@pytest.mark.parametrize("support", ["top", "left", "slides"])
def test_redistributed_mass_goes_to_moved_supports_as_well(support: str) -> None:
    """Beside them, and where they end at contact points: kinetic energy was negative where contact nodes had none."""
    wave = np.array([0.1, 0.05])
    if support == "slides":
        supports: dict[str, object] = {"left": hv.Fixed(x=lambda x, t: t + 0.0 * x[:, 0])}
    else:
        supports = {support: hv.Prescribed(lambda x, t: t * wave + 0.0 * x)}
    contact, cells = hv.Contact(hv.Signorini(), gap=1.0), 1 if support == "top" else 2
    problem = bodies.square(contact, cells, lame=(0.0, 5.0), density=1.0, supports=supports)  # type: ignore[arg-type]
    discrete = discretize_evolution(Evolution(problem, inertia=True, mass="redistributed"))
    mass, nodes = discrete.mass, len(discrete.field.nodes)
    assert mass is not None
    for way in np.eye(2):
        there = np.tile(way, nodes)
        moving = discrete.restrict(there.reshape(-1, 2), there[discrete.moved])
        assert mass.energy(moving) == pytest.approx(0.5, rel=1e-12)
    whole = np.block(
        [[mass.inner.toarray(), mass.coupling.toarray()], [mass.coupling.toarray().T, mass.held.toarray()]]
    )
    assert np.linalg.eigvalsh(whole)[0] > -1e-12
