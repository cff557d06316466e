"""Membranes, antiplane shear and heat in time against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, History, Scheme, march
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mesh import Mesh

ROUND = ("left", "right", "top", "bottom")


def mode(x: Array) -> Array:
    return np.asarray(np.sin(np.pi * x[:, 0]) * np.sin(np.pi * x[:, 1]))


def error(history: History, factor: float) -> float:
    """Largest error at the end of what is a multiple of the mode."""
    nodes = history.discrete.field.nodes
    return float(np.abs(history.frames[-1].displacement[:, 0] - factor * mode(nodes)).max())


@pytest.mark.parametrize(
    ("scheme", "order"),
    [(hv.evolution.ImplicitEuler(), 1), (hv.evolution.Midpoint(), 2), (hv.evolution.SDIRK2(), 2)],
    ids=lambda s: str(s),
)
def test_heat_of_a_mode_decays(scheme: Scheme, order: int) -> None:
    """``c u' = k lap u``: exp(-2 pi^2 k t / c); quadratic elements, whose error is far below that of the steps."""
    supports = dict.fromkeys(ROUND, 0.0)
    heat = hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), 12), 0.5, supports=supports, kind=ScalarKind.HEAT, capacity=2.0, order=2
    )
    evolution = Evolution(heat, displacement=mode)
    exact = math.exp(-0.5 * math.pi**2 * 0.2)
    errors = [error(march(evolution, 0.2, scheme=scheme, step=0.2 / n), exact) for n in (2, 4, 8)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (rates > order - 0.15).all()
    assert errors[-1] < (2.5e-2 if order == 1 else 2e-3)


@pytest.mark.parametrize(
    "scheme",
    [hv.evolution.Midpoint(), hv.evolution.Newmark(), hv.evolution.GeneralizedAlpha(0.8)],
    ids=lambda s: s.name,
)
def test_a_membrane_rings(scheme: Scheme) -> None:
    """``rho u'' = T lap u``: cos(pi sqrt(2 T/rho) t), of order 2 in the step."""
    membrane = hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), 12), 3.0, supports=dict.fromkeys(ROUND, 0.0), density=1.5, order=2
    )
    evolution = Evolution(membrane, inertia=True, displacement=mode)
    exact = math.cos(2.0 * math.pi * 0.35)
    errors = [error(march(evolution, 0.35, scheme=scheme, step=0.35 / n), exact) for n in (8, 16, 32)]
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (np.abs(rates - 2.0) < 0.15).all()


def test_a_viscous_membrane_rings_down() -> None:
    """A mode with ``rho s^2 + 2 pi^2 (eta s + T) = 0``: both roots are complex, and u is their damped cosine."""
    tension, eta, rho, until = 1.0, 0.1, 1.0, 0.5
    membrane = hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), 12), tension, supports=dict.fromkeys(ROUND, 0.0), density=rho, viscosity=eta, order=2
    )
    roots = np.roots([rho, 2.0 * math.pi**2 * eta, 2.0 * math.pi**2 * tension]).astype(complex)
    weights = np.linalg.solve(np.array([[1.0, 1.0], roots]), [1.0, 0.0])
    exact = float((weights @ np.exp(roots * until)).real)
    evolution = Evolution(membrane, inertia=True, displacement=mode)
    found = [march(evolution, until, scheme=hv.evolution.Midpoint(), step=until / n) for n in (20, 40)]
    errors = [error(history, exact) for history in found]
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert abs(found[0].ledger["gap"]) < 1e-12 * found[0].ledger["elastic"] + 1e-14


def string_strip(cells: int, **more: object) -> dict[str, object]:
    """A string as a strip of one row of cells."""
    mesh = hv.rectangle((1.0, 1.0 / cells), (cells, 1))
    return {"mesh": mesh, "coefficient": 1.0, "density": 1.0, **more}


@pytest.mark.parametrize("cells", [64])
def test_a_string_hits_a_stop(cells: int) -> None:
    """D5 across the plane: ``u(0, t) = (1 - t)/2``, then 0 with the force 1/2 for 1 < t < 2, and off again."""
    stop = hv.ScalarContact(hv.Signorini(), 0.0, side="below")  # type: ignore[arg-type]
    string = hv.ScalarProblem(**string_strip(cells, contact={"left": stop}, supports={"right": 0.0}))  # type: ignore[arg-type]
    evolution = Evolution(
        string,
        inertia=True,
        displacement=lambda x: 0.5 * (1.0 - x[:, 0]),
        mass="redistributed",  # type: ignore[arg-type]
    )
    history = march(
        evolution,
        2.9,
        scheme=hv.evolution.Newmark(),
        step=0.5 / cells,
        save=hv.evolution.Save(probes={"end": (0.0, 0.0)}),
    )
    times, end, force = history.times, history["end.u"], history["normal_force"] * cells
    first = times < 0.95
    assert np.abs(end - 0.5 * (1.0 - times))[first].max() < 0.01
    assert np.abs(force[first]).max() == 0.0
    touching = (times > 1.05) & (times < 1.95)
    assert np.abs(end[touching]).max() < 1e-12
    assert force[touching].mean() == pytest.approx(0.5, rel=0.01)
    off = times > 2.05
    assert np.abs(end - 0.5 * (times - 2.0))[off].max() < 0.01
    assert abs(history.ledger["gap"]) < 1e-11
    assert abs(history.ledger["numerical"]) < 2e-3 * history.ledger["elastic"] + 2e-3


def test_a_string_meets_a_spring() -> None:
    """Moving at v0, z = sqrt(T rho): ``z r' + k r = z v0`` until its far end is heard, so r = (z v0/k)(1 - e^-kt/z)."""
    tension, rho, spring, speed, cells = 4.0, 1.0, 3.0, 0.5, 64
    z = math.sqrt(tension * rho)
    until = 0.9  # the wave is back after 2 L / c = 1
    end = hv.ScalarContact(hv.Compliance(spring), 0.0, side="below")  # type: ignore[arg-type]
    errors = []
    for n in (cells, 2 * cells):
        given = string_strip(n, coefficient=tension, density=rho, contact={"left": end})
        string = hv.ScalarProblem(**given)  # type: ignore[arg-type]
        evolution = Evolution(string, inertia=True, velocity=-speed)
        history = march(evolution, until, scheme=hv.evolution.Newmark(), step=0.5 / n)
        r = history["penetration"]
        exact = z * speed / spring * (1.0 - np.exp(-spring * history.times / z))
        errors.append(float(np.abs(r - exact).max()))
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] > 1.9


def layer(**more: object) -> hv.ContactProblem:
    """A layer of height 1, held on top, that a plate rubs at its bottom; nothing depends on x."""
    given = {"mesh": hv.rectangle((1.0, 1.0), (1, 4)), "coefficient": 2.0, "supports": {"top": 0.0}, **more}
    return hv.ScalarProblem(**given, kind=ScalarKind.ANTIPLANE)  # type: ignore[arg-type]


def test_antiplane_friction_in_the_slip_rate() -> None:
    """Kelvin and Voigt's layer on a plate of speed V: it sticks until ``mu V t + eta V = g``, then creeps to g/mu."""
    mu, eta, speed, bound = 2.0, 0.5, 0.4, 0.6
    plate = hv.ScalarContact(hv.Tresca(bound), lambda x, t: np.full(len(x), speed * t))
    problem = layer(coefficient=mu, viscosity=eta, contact={"bottom": plate})
    slips = (bound - eta * speed) / (mu * speed)
    errors = []
    for n in (40, 80):
        probes = {"foot": (0.5, 0.0)}
        history = march(Evolution(problem), 2.0 * slips, step=slips / n, save=hv.evolution.Save(probes=probes))
        times, foot, friction = history.times, history["foot.u"], history["friction_force"]
        sticks = (times > 0.0) & (times < slips * (1.0 - 1e-9))
        np.testing.assert_allclose(foot[sticks], speed * times[sticks], rtol=1e-9)
        np.testing.assert_allclose(np.abs(friction[sticks]), mu * speed * times[sticks] + eta * speed, rtol=1e-8)
        later = times > slips * (1.0 + 1e-9)
        np.testing.assert_allclose(np.abs(friction[later]), bound, rtol=1e-9)
        end = bound / mu - (bound / mu - speed * slips) * np.exp(-mu * (times - slips) / eta)
        errors.append(float(np.abs(foot - end)[later].max()))
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.1)
    ledger = history.ledger
    slid = speed * times[-1] - foot[-1]
    assert ledger["friction"] == pytest.approx(bound * slid, rel=1e-9)
    assert abs(ledger["gap"]) < 1e-12


def test_antiplane_block_comes_to_rest() -> None:
    """Its mean speed falls by g/(rho H) in time exactly, as long as its foot slides."""
    rho, bound, speed = 3.0, 0.6, 0.5
    problem = layer(supports={}, coefficient=1e4, density=rho, contact={"bottom": hv.ScalarContact(hv.Tresca(bound))})
    history = march(Evolution(problem, inertia=True, velocity=speed), 1.5, step=0.05)
    assert history["friction_force"][1:] == pytest.approx(-bound)
    mass = np.asarray(history.discrete.mass.inner.sum(axis=0)).ravel()  # type: ignore[union-attr]
    mean = np.array([mass @ frame.velocity[:, 0] for frame in history.frames]) / rho
    np.testing.assert_allclose(mean, speed - bound / rho * history.times, rtol=1e-9)


def test_friction_weakens_with_the_slip_rate() -> None:
    """A velocity-weakening plate, quasistatic with viscosity: the slip rate solves ``eta (V - s) + mu u = h(s)``."""
    mu, eta, speed = 2.0, 3.0, 0.4
    plate = hv.ScalarContact(hv.SlipWeakening(0.6, rate=1.0, of="rate"), lambda x, t: np.full(len(x), speed * t))
    problem = layer(coefficient=mu, viscosity=eta, contact={"bottom": plate})
    history = march(Evolution(problem), 1.5, step=0.02)
    foot = history.frames[-1]
    rate, friction = abs(float(foot.rate[0, 1])), abs(float(foot.multiplier[0, 1]))
    assert rate > 0.1
    assert friction == pytest.approx(0.6 * (0.7 + 0.3 * math.exp(-rate)), rel=1e-9)
    balance = mu * np.abs(foot.displacement).max() + eta * (speed - rate)
    assert balance == pytest.approx(friction, rel=1e-8)


def test_a_thermostat_cools_past_its_peak() -> None:
    """A uniform temperature, ``c u' = q - lam(u)``: the law rises to u = d and then falls, and u runs away."""
    c, q, rise, peak, fall = 2.0, 1.0, 3.0, 0.3, 1.5
    law = hv.laws.PiecewiseQuadratic([0.0, peak], [0.0, rise, -fall], [0.0, 0.0])
    stated = hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), 2), 1.0, area=hv.ScalarContact(law), source=q, kind=ScalarKind.HEAT, capacity=c
    )
    # u = (q/rise)(1 - e^(-rise t/c)) up to the peak; then w = u - d grows: c w' = q - rise d + fall w.
    reached = -c / rise * math.log(1.0 - rise * peak / q)
    until = reached + 0.5
    exact = peak + (q - rise * peak) / fall * (math.exp(fall * 0.5 / c) - 1.0)
    errors = []
    for n in (50, 100):
        history = march(Evolution(stated), until, step=until / n)
        u = history.frames[-1].displacement[:, 0]
        assert np.ptp(u) < 1e-12
        errors.append(abs(u[0] - exact))
    assert errors[1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.2)
    assert history.margin > 0.0
    # Without capacity each step would be the static problem, whose law softens against nothing.
    assert 0.99 * c / fall < history["largest_step"][-1] <= c / fall


def test_heat_is_counted_by_regions() -> None:
    """An insulated body takes up all heat of its source, wherever its capacity is."""
    mesh = hv.rectangle((1.0, 1.0), 4)
    low = np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 1] < 0.5)
    halves = Mesh(mesh.points, mesh.cells, mesh.boundaries, {"low": low, "high": np.setdiff1d(np.arange(32), low)})
    stated = hv.ScalarProblem(
        halves, {"low": 1.0, "high": 5.0}, source=lambda x, t: 2.0 * t + 0.0 * x[:, 0], kind=ScalarKind.HEAT,
        capacity={"low": 1.0, "high": 3.0},
    )  # fmt: skip
    history = march(Evolution(stated), 2.0, step=0.05, scheme=hv.evolution.Midpoint())
    heat = np.asarray(history.discrete.viscosity.inner.sum(axis=0)).ravel()  # type: ignore[union-attr]
    assert heat.sum() == pytest.approx(2.0)
    assert heat @ history.frames[-1].displacement[:, 0] == pytest.approx(4.0, rel=1e-12)


def test_levels_take_part_in_steps() -> None:
    """By multigrid over coarser meshes, on which viscosity, capacity and density count too, as by factorisation."""
    stop = hv.ScalarContact(hv.Compliance(50.0), -0.02, side="below")  # type: ignore[arg-type]
    for more, inertia in (
        ({"density": 2.0, "viscosity": lambda x: 0.1 + x[:, 0]}, True),
        ({"kind": "heat", "capacity": lambda x: 1.0 + x[:, 1]}, False),
    ):
        stated = hv.ScalarProblem(
            hv.rectangle((1.0, 1.0), 16), 1.0, area=stop, supports={"left": lambda x, t: -0.1 * t * x[:, 1]},
            source=lambda x, t: -np.sin(4.0 * t) * x[:, 0], **more,  # type: ignore[arg-type]
        )  # fmt: skip
        evolution = Evolution(stated, inertia=inertia)
        one, other = (
            march(evolution, 0.5, step=0.05, method=solver, controls=hv.Controls(rtol=1e-11))
            for solver in (hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid())
        )
        assert one.finished
        assert other.finished
        assert (other["solver_steps"][1:] < 25).all()
        np.testing.assert_allclose(one.frames[-1].displacement, other.frames[-1].displacement, atol=1e-9)
