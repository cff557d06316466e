"""Bodies with heat against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, History, Scheme, march
from hemivar.mechanics.thermal import Heat, HeatContact
from tests import bodies
from tests.samples import slow

FINE = hv.Controls(rtol=1e-12)


def block(cells: int = 2, **more: object) -> hv.ContactProblem:
    """A unit square between rollers, clamped on top: its strain is uniform."""
    given = {
        "mesh": hv.rectangle((1.0, 1.0), cells), "material": hv.Material.lame(3.0, 2.0),
        "supports": {"left": hv.Roller(), "right": hv.Roller(), "top": hv.Roller()}, **more,
    }  # fmt: skip
    return hv.ContactProblem(**given)  # type: ignore[arg-type]


def closed(history: History) -> None:
    """Both books are closed, the body's without what the scheme takes hidden in the gap."""
    book = history.state.heat.book  # type: ignore[union-attr]
    size = sum(
        abs(value) for value in (book.content, book.start, book.source, book.supports, book.contact, book.friction)
    )
    assert abs(book.gap) < 1e-9 * size + 1e-13
    ledger = history.ledger
    scale = max(abs(value) for value in ledger.values())
    assert abs(ledger["gap"]) < 1e-8 * scale + 1e-13


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_heated_bar_that_cannot_expand(plane: str) -> None:
    """Held on all sides its stress is -beta th: in plane strain (3 lam + 2 mu) a, in plane stress E a/(1 - nu)."""
    lam, mu, a, warm = 3.0, 2.0, 1e-3, 50.0
    problem = block(material=hv.Material.lame(lam, mu, plane), contact={"bottom": hv.Contact(hv.Signorini())})
    heat = Heat(1.0, 1.0, expansion=a, temperature=warm)
    history = march(Evolution(problem, heat=heat), 1.0, step=0.5)
    young, nu = mu * (3.0 * lam + 2.0 * mu) / (lam + mu), lam / (2.0 * (lam + mu))
    beta = (3.0 * lam + 2.0 * mu) * a if plane == "strain" else young * a / (1.0 - nu)
    assert np.abs(history.frames[-1].displacement).max() < 1e-14
    assert history["normal_force"][-1] == pytest.approx(beta * warm, rel=1e-12)


def test_a_free_bar_expands() -> None:
    """In space by a th in every direction, without stress; quadratic elements alike in the plane."""
    a, warm = 2e-3, 10.0
    supports = {"left": hv.Roller(), "front": hv.Roller(), "bottom": hv.Roller()}
    body = bodies.cube(cells=2, size=(1.0, 2.0, 1.0), material=hv.Material.young(5.0, 0.3), supports=supports)
    history = march(Evolution(body, heat=Heat(1.0, 1.0, expansion=a, temperature=warm, stress_free=4.0)), 1.0, step=1.0)
    np.testing.assert_allclose(history.frames[-1].displacement, a * 6.0 * body.mesh.points, atol=1e-12)
    plane = bodies.strip(
        cells=2,
        size=(1.0, 2.0),
        material=hv.Material.young(5.0, 0.3),
        supports={"left": hv.Roller(), "bottom": hv.Roller()},
        order=2,
    )
    history = march(Evolution(plane, heat=Heat(1.0, 1.0, expansion=a, temperature=warm)), 1.0, step=1.0)
    nodes = plane.mesh.nodes(2)
    np.testing.assert_allclose(history.frames[-1].displacement, 1.3 * a * warm * nodes, atol=1e-12)


def test_steady_conduction_through_a_contact() -> None:
    """k (T - th)/L = h (th - th_R) with the conductance of the pressure, which follows from the temperature itself."""
    k, top, outside, a, per = 2.0, 30.0, 5.0, 1e-3, 4.0
    lam, mu = 3.0, 2.0
    problem = block(contact={"bottom": hv.Contact(hv.Signorini())}, order=2)  # for a strain that is linear
    heat = Heat(
        k, 1.0, expansion=a, supports={"top": top}, temperature=lambda x: top * x[:, 1],
        contact={"bottom": HeatContact(HeatContact.touching(0.5, per), temperature=outside)},
    )  # fmt: skip
    history = march(Evolution(problem, heat=heat), 400.0, step=20.0, controls=FINE)
    found = history.frames[-1].temperature
    assert found is not None
    foot = found[problem.mesh.nodes(2)[:, 1] == 0.0]
    # The block cannot expand: p = beta times its mean temperature, linear over the height.
    beta = (3.0 * lam + 2.0 * mu) * a
    low, high = outside, top
    for _ in range(200):
        th = 0.5 * (low + high)
        p = beta * 0.5 * (th + top)
        low, high = (th, high) if k * (top - th) > (0.5 + per * p) * (th - outside) else (low, th)
    np.testing.assert_allclose(foot, th, rtol=1e-8)
    assert history["normal_force"][-1] == pytest.approx(beta * 0.5 * (th + top), rel=1e-8)
    closed(history)


TABLES = HeatContact.touching(
    pressures=[0.0, 0.1, 0.4], conductances=[0.2, 1.0, 1.6], temperatures=[0.0, 40.0], factors=[1.0, 0.2]
)


@pytest.mark.parametrize(
    "conductance",
    [TABLES, lambda r, p, warm: np.interp(p, TABLES.pressures, TABLES.conductances) * (1.0 - 0.02 * warm)],
    ids=["tables", "function"],
)
@pytest.mark.parametrize("order", [1, slow(2)])
def test_steady_conduction_by_tables_of_pressure_and_temperature(conductance: Any, order: int) -> None:
    """The same with h from tables at the pressure and at the mean of both temperatures."""
    k, top, outside, a = 2.0, 30.0, 5.0, 1e-3
    lam, mu = 3.0, 2.0
    problem = block(contact={"bottom": hv.Contact(hv.Signorini())}, order=2)
    heat = Heat(
        k, 1.0, expansion=a, supports={"top": top}, temperature=lambda x: top * x[:, 1],
        contact={"bottom": HeatContact(conductance, temperature=outside)},
    )  # fmt: skip
    scheme = hv.evolution.ImplicitEuler() if order == 1 else hv.evolution.Midpoint()
    until, step = (400.0, 20.0) if order == 1 else (3.0, 0.02)
    history = march(Evolution(problem, heat=heat), until, step=step, scheme=scheme, controls=FINE)
    found = history.frames[-1].temperature
    assert found is not None
    foot = found[problem.mesh.nodes(2)[:, 1] == 0.0]
    beta = (3.0 * lam + 2.0 * mu) * a
    low, high = outside, top
    for _ in range(200):
        th = 0.5 * (low + high)
        p, warm = beta * 0.5 * (th + top), 0.5 * (th + outside)
        h = float(np.interp(p, [0.0, 0.1, 0.4], [0.2, 1.0, 1.6]) * (1.0 - 0.02 * warm))
        low, high = (th, high) if k * (top - th) > h * (th - outside) else (low, th)
    assert 0.1 < p < 0.4
    np.testing.assert_allclose(foot, th, rtol=1e-8 if order == 1 else 1e-6)
    closed(history)


@pytest.mark.parametrize(
    ("tables", "match"),
    [
        ({"pressures": [0.0, 1.0], "conductances": [1.0]}, "2 and 1 numbers"),
        ({"temperatures": [1.0, 1.0], "factors": [1.0, 2.0]}, "increase"),
        ({"pressures": [0.0], "conductances": [-1.0]}, "not negative"),
        ({"closed": 1.0, "pressures": [0.0], "conductances": [1.0]}, "give one"),
    ],
)
def test_tables_of_a_conductance_are_looked_at(tables: dict[str, Any], match: str) -> None:
    with pytest.raises(ProblemError, match=match):
        HeatContact.touching(**tables)


def test_conduction_needs_contact() -> None:
    """A gap lets nothing through; where the body has grown over it heat flows."""
    problem = block(contact={"bottom": hv.Contact(hv.Compliance(50.0), gap=5.2e-4)})
    touching = {"bottom": HeatContact(HeatContact.touching(1.0), temperature=0.0)}
    heat = Heat(5.0, 2.0, thermal_stress=0.01, source=1.0, contact=touching)
    history = march(Evolution(problem, heat=heat), 2.0, step=0.1)
    pressed, gone = history["normal_force"], -history["heat.contact"]
    touched = int(np.argmax(pressed > 0.0))
    assert 1 < touched < len(pressed) - 2
    assert gone[touched - 1] == 0.0
    assert (np.diff(gone[touched - 1 :]) > 0.0).all()
    # Before contact all heat stays: the temperature is uniform, source times time over the capacity.
    assert history["temperature.greatest"][touched - 1] == pytest.approx(0.5 * history.times[touched - 1], rel=1e-9)
    assert history["temperature.least"][touched - 1] == pytest.approx(0.5 * history.times[touched - 1], rel=1e-9)
    closed(history)


@pytest.mark.parametrize(
    "scheme",
    [hv.evolution.ImplicitEuler(), slow(hv.evolution.Midpoint()), slow(hv.evolution.GeneralizedAlpha(0.8))],
    ids=lambda s: s.name,
)
def test_a_sliding_block_heats_itself(scheme: Scheme) -> None:
    """Dragged at V under N with friction mu it makes mu N V t of heat, of which its share warms it."""
    mu, weight, speed, share, until = 0.3, 2.0, 0.5, 0.4, 1.0
    steep = 1e4
    problem = bodies.strip(
        hv.Contact(hv.Compliance(1e4), hv.Tresca(mu * weight)),
        (4, 2),
        size=(1.0, 0.5),
        lame=(steep, steep),
        density=0.01,
        supports={"left": hv.Fixed(x=lambda x, t: np.full(len(x), speed * t))},
        tractions={"top": (0.0, -weight)},
    )
    heat = Heat(1.0, 3.0, contact={"bottom": HeatContact(share=share)})
    still = (0.0, 0.0) if isinstance(scheme, hv.evolution.ImplicitEuler) else (speed, 0.0)
    evolution = Evolution(problem, inertia=True, velocity=still, heat=heat)
    history = march(evolution, until, step=0.02, scheme=scheme)
    made = history.ledger["friction"]
    assert made == pytest.approx(mu * weight * speed * until, rel=2e-2)
    book = history.state.heat.book  # type: ignore[union-attr]
    assert book.friction == pytest.approx(share * made, rel=1e-10)
    assert book.content == pytest.approx(share * made, rel=1e-9)
    closed(history)


def coupled(cells: int, scheme: Scheme, steps: int, coupling: float) -> tuple[float, float, History]:
    """A block whose temperature and height change together, insulated, on a Kelvin-Voigt body under a load.

    ``c th' + T0 beta s' = 0`` and ``kappa s + eta s' - beta th = -f`` (s the strain): one rate,
    ``eta s' + (kappa + T0 beta^2/c) s = beta th0 - f``.
    """
    kappa, eta, c, beta, warm, force = 7.0, 2.0, 1.5, 3.0, 0.2, 1.0
    problem = block(
        cells, material=hv.Material.lame(3.0, 2.0, viscosity=(0.0, 0.5 * eta)), tractions={"bottom": (0.0, force)}
    )
    heat = Heat(1.0, c, thermal_stress=beta, coupling=coupling, temperature=warm)
    history = march(Evolution(problem, heat=heat), 0.5, step=0.5 / steps, scheme=scheme, controls=FINE)
    whole = kappa + coupling * beta**2 / c
    strain = (beta * warm - force) / whole * -math.expm1(-whole * 0.5 / eta)
    th = warm - coupling * beta / c * strain
    frame = history.frames[-1]
    foot = frame.displacement[problem.mesh.points[:, 1] == 0.0, 1]
    assert frame.temperature is not None
    return float(np.abs(-foot - strain).max()), float(np.abs(frame.temperature - th).max()), history


@pytest.mark.parametrize(
    ("scheme", "order"), [slow(hv.evolution.ImplicitEuler(), 1), (hv.evolution.Midpoint(), 2)], ids=lambda s: str(s)
)
def test_coupled_decay(scheme: Scheme, order: int) -> None:
    found = [coupled(1, scheme, steps, 0.8)[:2] for steps in (10, 20, 40)]
    errors = np.array(found)
    rates = np.log2(errors[:-1] / errors[1:])
    assert (np.abs(rates - order) < 0.15).all()
    assert errors[-1].max() < (5e-3 if order == 1 else 5e-5)
    _, _, history = coupled(1, scheme, 10, 0.8)
    closed(history)
    assert history.ledger["thermal"] != 0.0


@pytest.mark.slow
def test_a_coupling_that_would_not_contract() -> None:
    """T0 beta^2 / (c kappa) = 26: rounds that only repeat each other would run away, weighted ones meet."""
    off, warmer, history = coupled(1, hv.evolution.ImplicitEuler(), 400, 30.0)
    assert history.finished
    assert history["rounds"][1:].max() <= 12
    assert off < 2e-3
    assert warmer < 5e-2
    closed(history)


@pytest.mark.slow
def test_no_agreement_is_told() -> None:
    """A conductance that is another one whenever it is asked: the step is given up, and nothing is accepted."""
    random = np.random.default_rng(3)
    contact = {"bottom": HeatContact(lambda r, p: random.uniform(0.0, 5.0, r.shape), temperature=1.0)}
    problem = block(1, contact={"bottom": hv.Contact(hv.Compliance(1.0))})
    heat = Heat(1.0, 1.0, thermal_stress=1.0, temperature=3.0, contact=contact)
    history = march(Evolution(problem, heat=heat), 1.0, step=0.5)
    assert not history.finished
    assert history.ended == "not_contracting"
    assert len(history.steps) == 1


def test_an_exchange_that_is_not_monotone() -> None:
    """``c th' = q/H - lam(th)/H`` over a rising and a falling law: the temperature runs away past the peak."""
    rise, peak, fall, q, c = 3.0, 0.3, 1.5, 1.0, 2.0
    law = hv.laws.PiecewiseQuadratic([0.0, peak], [0.0, rise, -fall], [0.0, 0.0])
    body = block(1, contact={"bottom": hv.Contact(hv.Compliance(1.0))})
    heat = Heat(1e6, c, source=q, contact={"bottom": HeatContact(exchange=law)})
    reached = -c / rise * math.log(1.0 - rise * peak / q)
    exact = peak + (q - rise * peak) / fall * (math.exp(fall * 0.5 / c) - 1.0)
    errors = []
    for n in (50, 100):
        history = march(Evolution(body, heat=heat), reached + 0.5, step=(reached + 0.5) / n)
        errors.append(abs(history["temperature.greatest"][-1] - exact))
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)
    closed(history)


def test_orders_in_space_and_time() -> None:
    """A manufactured pair, the strain following the temperature: errors fall like h^2 + tau^2."""
    kappa, beta, k, c = 7.0, 0.5, 1.0, 1.0
    # th = e^-t cos(pi y / 2): c th' - k th'' = (k pi^2/4 - c) th.  kappa v'' = beta th', v(1) = 0, free foot:
    # kappa v' = beta th at the foot and hence everywhere: v = -(beta/kappa) int_y^1 th.
    heat = Heat(
        k, c, thermal_stress=beta, supports={"top": 0.0}, temperature=lambda x: np.cos(0.5 * np.pi * x[:, 1]),
        source=lambda x, t: (k * np.pi**2 / 4.0 - c) * np.exp(-t) * np.cos(0.5 * np.pi * x[:, 1]),
    )  # fmt: skip
    errors = []

    def rises(y: Array, t: float) -> Array:
        return -beta / kappa * math.exp(-t) * (2.0 / np.pi) * (1.0 - np.sin(0.5 * np.pi * y))

    for n in (6, 12, 24):
        problem = block(n)
        start = {"displacement": lambda x: np.column_stack([0.0 * x[:, 0], rises(x[:, 1], 0.0)])}
        history = march(Evolution(problem, heat=heat, **start), 0.5, step=0.5 / n, scheme=hv.evolution.Midpoint())  # type: ignore[arg-type]
        y, frame = problem.mesh.points[:, 1], history.frames[-1]
        decay = math.exp(-0.5)
        v = rises(y, 0.5)
        assert frame.temperature is not None
        off = frame.temperature - decay * np.cos(0.5 * np.pi * y), frame.displacement[:, 1] - v
        errors.append([math.sqrt(float(np.mean(one**2))) for one in off])
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (rates[-1] > 1.8).all()
    assert max(errors[-1]) < 2e-3
