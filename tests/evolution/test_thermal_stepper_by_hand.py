"""Heat and motion of one degree of freedom each, step by step by hand."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Evolution, ImplicitEuler, Midpoint, Save, Scheme, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.formula import Formula
from hemivar.mechanics.thermal import ContactConductance, Heat, HeatContact
from tests import bodies

KAPPA, VISCOUS, BETA, SOURCE, START = 3.0, 0.6, 2.0, 0.7, 0.2


@pytest.mark.parametrize("coupling", [0.0, 1.5])
@pytest.mark.parametrize(("scheme", "at"), [(ImplicitEuler(), 1.0), (Midpoint(), 0.5)], ids=["euler", "midpoint"])
def test_a_block_that_is_warmed_from_within(scheme: Scheme, at: float, coupling: float) -> None:
    """``3 e + 0.6 e' = 2 (th - 0.2)``, ``th' = 0.7 - 2 T0 e'``: at the place of the step where the scheme asks."""
    problem = bodies.column(hv.laws.NoContact(), KAPPA, viscous=VISCOUS)
    heat = Heat(
        1.0, 1.0, thermal_stress=BETA, source=SOURCE, coupling=coupling, temperature=START, stress_free=START,
        rtol=1e-13,
    )  # fmt: skip
    tau, count = 0.25, 4
    history = march(
        Evolution(problem, heat=heat), tau * count, step=tau, scheme=scheme, save=Save(probes={"p": (0.5, 0.0)})
    )
    e, th, thermal, viscous = [0.0], [START], [0.0], [0.0]
    for _ in range(count):
        # (kappa at + c/tau) d - beta at g = beta (th - start) - kappa e;   T0 beta d + g = tau q
        left = np.array([[KAPPA * at + VISCOUS / tau, -BETA * at], [coupling * BETA, 1.0]])
        d, g = np.linalg.solve(left, [BETA * (th[-1] - START) - KAPPA * e[-1], tau * SOURCE])
        thermal.append(thermal[-1] + BETA * (th[-1] + at * g - START) * d)
        viscous.append(viscous[-1] + VISCOUS * d**2 / tau)
        e.append(e[-1] + d)
        th.append(th[-1] + g)
    close = {"rel": 1e-9, "abs": 1e-12}
    assert -history["p.u_y"] == pytest.approx(np.array(e), **close)  # type: ignore[arg-type]
    assert history["temperature.least"] == pytest.approx(np.array(th), **close)  # type: ignore[arg-type]
    assert history["temperature.greatest"] == pytest.approx(np.array(th), **close)  # type: ignore[arg-type]
    assert history["thermal"] == pytest.approx(np.array(thermal), **close)  # type: ignore[arg-type]
    assert history["viscous"] == pytest.approx(np.array(viscous), **close)  # type: ignore[arg-type]
    assert history["heat.source"] == pytest.approx(SOURCE * history.times, **close)  # type: ignore[arg-type]
    assert history["heat.deformation"] == pytest.approx(-coupling * BETA * np.array(e), **close)  # type: ignore[arg-type]
    assert history["heat.content"] == pytest.approx(np.array(th), **close)  # type: ignore[arg-type]
    assert history["work"] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(history["heat.gap"]).max() < 1e-11
    assert np.abs(history["gap"]).max() < 1e-11
    assert (history["rounds"][1:] >= (2.0 if coupling else 1.0)).all()


@pytest.mark.parametrize(
    ("coupling", "conductivity", "rounds"),
    [(1.0, 1e-2, 10), (9.0, 1e-2, 21), (300.0, 1e-2, 100), (1.0, 10.0, 7), (9.0, 10.0, 8), (300.0, 10.0, 20)],
)
def test_a_coupling_that_pushes_back_hard_is_solved_at_once_as_well(
    coupling: float, conductivity: float, rounds: int
) -> None:
    """Up to 100 times as hard as heat alone resists: against one system for both, without a shorter step."""
    problem = bodies.square(
        hv.laws.NoContact(),
        12,
        lame=(1.0, 1.0),
        viscosity=(0.05, 0.05),
        supports={"top": hv.Clamped()},
        tractions={"right": (0.1, -0.2)},
    )
    heat = Heat(conductivity, 1.0, thermal_stress=1.0, coupling=coupling, source=0.1)
    tau, count = 0.1, 3
    evolution = Evolution(problem, heat=heat)
    history = march(evolution, tau * count, step=tau)
    discrete = discretize_evolution(evolution)
    warm = discrete.heat
    assert warm is not None
    assert discrete.viscosity is not None
    conduction = warm.conduction
    assert conduction.viscosity is not None
    n, m = discrete.unknowns, conduction.unknowns
    held = np.zeros(discrete.data_at(0.0).prescribed.size)
    spread = conduction.field.basis.toarray()  # nodes, m
    beta = np.column_stack([warm.load(column)[:n] for column in spread.T])  # n, m
    gives = np.column_stack([spread.T @ warm.deformed(np.concatenate([unit, held])) for unit in np.eye(n)])  # m, n
    K, C = discrete.stiffness.inner.toarray(), discrete.viscosity.inner.toarray()
    L, S = conduction.stiffness.inner.toarray(), conduction.viscosity.inner.toarray()
    force, source = discrete.data_at(0.0).load[:n], conduction.data_at(0.0).load[:m]
    whole = np.block([[K + C / tau, -beta], [-gives / tau, S / tau + L]])
    u, th = np.zeros(n), np.zeros(m)
    for _ in range(count):
        found = np.linalg.solve(whole, np.concatenate([force + C @ u / tau, source + S @ th / tau - gives @ u / tau]))
        u, th = found[:n], found[n:]
    state = history.state
    assert state.heat is not None
    assert history["step"][1:] == pytest.approx(tau)
    assert history["rounds"].max() <= rounds  # as docs/thermal.md says
    assert np.abs(state.body.displacement[:n] - u).max() < 1e-7 * np.abs(u).max()
    assert np.abs(state.heat.state.body.displacement[:m] - th).max() < 1e-7 * np.abs(th).max()


def test_temperatures_of_supports_and_what_they_give() -> None:
    """A rod between temperatures that rise: what it stores comes from its supports."""
    problem = bodies.strip(hv.laws.NoContact(), (4, 1), size=(1.0, 0.5), lame=(1.0, 1.0))
    rise = 0.5
    heat = Heat(
        2.0, 1e-9, temperature=lambda x: x[:, 0],
        supports={"left": 0.0, "right": lambda x, t: np.full(len(x), 1.0 + rise * t)},
    )  # fmt: skip
    history = march(Evolution(problem, heat=heat), 1.0, step=0.25)
    # The flow through a section is 2 (1 + t/2) 0.5; what one support gives the other takes: their sum is stored.
    assert history["temperature.least"] == pytest.approx(0.0, abs=1e-12)
    assert history["temperature.greatest"] == pytest.approx(1.0 + rise * history.times, rel=1e-12)
    assert history["heat.content"] == pytest.approx(1e-9 * 0.25 * (1.0 + rise * history.times), rel=1e-6)
    assert history["heat.supports"] == pytest.approx(
        history["heat.content"] - history["heat.content"][0], rel=1e-4, abs=1e-14
    )


def test_where_a_support_holds_the_body_heat_flows_as_beside_it() -> None:
    """The node at a clamped edge is no contact point: its conductance is that of the next node, not of the last one."""
    problem = bodies.square(hv.Compliance(2.0), 2, lame=(0.0, 0.5))
    heat = Heat(1.0, 1.0, contact={"bottom": HeatContact(ContactConductance(5.0), temperature=1.0)})
    discrete = discretize_evolution(Evolution(problem, heat=heat))
    assert discrete.heat is not None
    exchange = discrete.heat.conduction.problem
    x = exchange.contact.points
    assert x is not None
    own = discrete.problem.contact.points
    assert own is not None
    for pressed in (own[:, 0] == 0.5, own[:, 0] == 1.0):
        law = discrete.heat.law(exchange.law, 0.3 * pressed, 0.3 * pressed, np.zeros(len(x)))
        flow = law.normal.derivative(np.full(exchange.contact_points, 0.5))
        near = np.maximum(x[:, 0], 0.5)
        np.testing.assert_allclose(flow, np.where(np.isin(near, own[pressed, 0]), 5.0 * 0.5, 0.0))


@pytest.mark.parametrize("conductivity", [1.0, 1e8])
@pytest.mark.parametrize("scheme", [ImplicitEuler(), Midpoint(), hv.evolution.SDIRK2()], ids=lambda scheme: scheme.name)
def test_a_body_of_one_temperature_waits_for_what_cools_it(scheme: Scheme, conductivity: float) -> None:
    """Nothing flows before the surroundings are colder: nothing is there that a residual could be held against."""
    problem = hv.ScalarProblem(
        hv.rectangle((1.3, 0.7), 3),
        conductivity,
        kind="heat",
        capacity=2.0,
        contact={"bottom": hv.ScalarContact(hv.Compliance(5.0), level=Formula("400 - 150*t"))},
    )
    history = march(Evolution(problem, displacement=293.15), 1.0, step=0.05, scheme=scheme)
    assert history.finished
    warm = history.times < 106.85 / 150.0 - 0.05
    assert not history["normal_force"][warm].any()
    assert np.abs(history.at(0.65).displacement - 293.15).max() == 0.0
    if conductivity > 1.0:  # 1.82 th' = -6.5 (th - level): the mean follows the surroundings
        late, rate = 1.0 - 106.85 / 150.0, 5.0 / (0.7 * 2.0)
        known = 250.0 + 150.0 / rate * -np.expm1(-rate * late)
        assert history.frames[-1].displacement.mean() == pytest.approx(known, abs=2.0)


@pytest.mark.parametrize(
    ("scheme", "on"),
    [
        (Midpoint(), "penetration"),
        (hv.evolution.Newmark(), "pressure"),
        pytest.param(hv.evolution.GeneralizedAlpha(0.5), "pressure", marks=pytest.mark.slow),
    ],
    ids=["midpoint", "newmark", "alpha"],
)
def test_conductances_are_those_of_the_stage_of_heat(scheme: Scheme, on: str) -> None:
    """A block is pressed on ground that it conducts to as it is pressed: of second order in the step."""
    problem = bodies.column(
        hv.Compliance(5.0),
        6.0,
        top=hv.Clamped(),
        viscous=0.6,
        density=1.0,
        tractions={"bottom": lambda x, t: np.full(x.shape, (0.0, -3.0 * np.sin(2.0 * t) ** 2))},
    )
    law = {"penetration": lambda r, p: 5.0 * np.maximum(r, 0.0), "pressure": lambda r, p: np.maximum(p, 0.0)}[on]
    heat = Heat(1.0, 2.0, temperature=1.0, contact={"bottom": HeatContact(law)})
    evolution = Evolution(problem, heat=heat, inertia=scheme.needs_mass)
    found = [march(evolution, 1.0, step=1.0 / n, scheme=scheme)["temperature.least"][-1] for n in (8, 16, 32)]
    assert 3.0 < (found[0] - found[1]) / (found[1] - found[2]) < 6.0


@pytest.mark.parametrize(
    "scheme", [Midpoint(), hv.evolution.Newmark(), hv.evolution.GeneralizedAlpha(0.5)], ids=lambda scheme: scheme.name
)
def test_a_pressure_that_grows_evenly_is_known_between_the_steps_from_the_first_on(scheme: Scheme) -> None:
    """A block falls on ground too soft to stop it, p = 1e-6 t: 2 th' = -t th by the midpoint rule, step by step."""
    problem = bodies.column(hv.Compliance(1e-6), 6.0, top=None, density=1.0)
    heat = Heat(1e6, 2.0, temperature=1.0, contact={"bottom": HeatContact(lambda r, p: 1e6 * np.maximum(p, 0.0))})
    tau, count = 0.25, 4
    evolution = Evolution(problem, heat=heat, inertia=True, velocity=(0.0, -1.0))
    history = march(evolution, tau * count, step=tau, scheme=scheme)
    known = [1.0]
    for n in range(count):
        h = (n + 0.5) * tau
        known.append(known[-1] * (2.0 / tau - 0.5 * h) / (2.0 / tau + 0.5 * h))
    assert history["temperature.least"] == pytest.approx(known, rel=1e-5)  # type: ignore[arg-type]
