"""Heat in bodies: what is refused, files, restarts, what stands in tables and frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import FileError
from hemivar.evolution import Evolution, march
from hemivar.fem.thermal_stress import cell_thermal_stress, stress_per_degree, thermal_matrix
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mechanics.thermal import ContactConductance, Heat, HeatContact
from tests import bodies

MESH = hv.rectangle((1.0, 1.0), 2)


def body(**more: Any) -> hv.ContactProblem:
    given = {
        "mesh": MESH, "material": hv.Material.lame(4.0, 4.0, viscosity=(0.4, 0.4), density=1.0),
        "supports": {"left": hv.Clamped()},
        "contact": {"bottom": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.1))},
        "tractions": {"top": (0.3, -0.5)},
    }  # fmt: skip
    return hv.ContactProblem(**given | more)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: HeatContact(conductance=-1.0), "conductance = -1; it must be a finite number that is not negative"),
        (lambda: HeatContact(conductance=np.nan), "conductance"),
        (lambda: HeatContact(conductance="2*p"), "the conductance is the text '2\\*p'|the conductance is"),
        (lambda: HeatContact(share=1.2), "share = 1.2; give the part of the heat of friction that the body takes"),
        (lambda: HeatContact(temperature=np.inf), "temperature of a foundation"),
        (lambda: HeatContact(1.0, exchange=hv.Compliance(1.0)), "conductance and exchange are both given"),
        (lambda: HeatContact(exchange=2.0), "give a law of the difference of temperatures"),  # type: ignore[arg-type]
        (lambda: HeatContact(exchange=hv.FormulaLaw("-r^4")), "without a lower bound"),
        (lambda: HeatContact.touching(-1.0), "closed = -1 of a conductance"),
        (lambda: HeatContact.touching(1.0, 1.0, 0.0), "exponent = 0 of a conductance"),
        (lambda: Heat(1.0, 1.0, expansion=1.0, thermal_stress=1.0), "expansion and thermal_stress are both given"),
        (lambda: Heat(1.0, 1.0, coupling=-1.0), "coupling = -1 of Heat; give a finite number >= 0"),
        (lambda: Heat(1.0, 1.0, stress_free=np.inf), "stress_free = inf of Heat"),
        (lambda: Heat(1.0, 1.0, rtol=0.0), "rtol = 0 of Heat; it must lie between 0 and 1"),
        (lambda: Heat(1.0, 1.0, contact={"bottom": 2.0}), "give HeatContact\\(conductance"),  # type: ignore[dict-item]
        (lambda: Heat(1.0, 1.0, contact=HeatContact()), "give a HeatContact for each boundary"),  # type: ignore[arg-type]
    ],
)
def test_what_heat_refuses(make: Any, words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        make()


@pytest.mark.parametrize(
    ("heat", "words"),
    [
        (Heat(-1.0, 1.0), "the conductivity is -1; it must be positive"),
        (Heat(1.0, 0.0), "capacity = 0 of Heat; it must be positive"),
        (Heat(1.0, -1.0), "capacity = -1"),
        (Heat(1.0, 1.0, expansion=-1.0), "expansion = -1; it must not be negative"),
        (Heat(1.0, 1.0, expansion={"steel": 1.0}), "expansion names region 'steel'"),
        (Heat(1.0, lambda x, t: t), "capacity depends on time"),
        (Heat(1.0, 1.0, supports={"lft": 0.0}), "did you mean 'left'"),
        (Heat(1.0, 1.0, contact={"botom": HeatContact()}), "contact of Heat names boundary 'botom'"),
        (Heat(1.0, 1.0, contact={"top": HeatContact(share=0.5)}), "share of the heat of friction, but the body has no"),
        (
            Heat(1.0, 1.0, contact={"top": HeatContact(HeatContact.touching(1.0))}),
            "a conductance that depends on contact, but the body has no contact there",
        ),
        (Heat(1.0, 1.0, contact={"bottom": HeatContact(1.0)}, supports={"bottom": 0.0}), "a prescribed temperature"),
        (Heat(1.0, 1.0, temperature=[1.0, 2.0]), "initial displacement has shape|initial temperature has shape"),
        ("warm", "the heat of an evolution"),
    ],
)  # fmt: skip
def test_what_bodies_with_heat_refuse(heat: Any, words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        Evolution(body(), heat=heat)


def two_blocks(**more: Any) -> hv.ContactProblem:
    upper = hv.rectangle((1.0, 1.0), (3, 2), origin=(0.0, 1.0))
    given = {
        "mesh": hv.Mesh.assembled({"upper": upper, "lower": MESH}),
        "contact": {"upper:bottom": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.1), against="lower:top")},
        "supports": {"lower:bottom": hv.Clamped(), "upper:top": hv.Clamped()}, "tractions": {},
    }  # fmt: skip
    return body(**given | more)


def test_a_joint_without_exchange_insulates() -> None:
    heat = Heat(1.0, 1.0, expansion=0.01, supports={"upper:top": 1.0})
    problem = two_blocks()
    warm = march(Evolution(problem, heat=heat), 2.0, step=0.1).frames[-1].temperature
    assert warm is not None
    upper = problem.mesh.points[:, 1] >= 1.0 + 0.1
    assert (warm[upper] > 0.5).all()
    assert np.abs(warm[problem.mesh.points[:, 1] < 1.0 - 0.1]).max() < 1e-12


@pytest.mark.parametrize(
    ("contact", "words"),
    [
        ({"lower:top": HeatContact(1.0)}, "is the boundary that 'upper:bottom' touches; state the heat of the two as"),
        ({"upper:bottom": HeatContact(1.0, temperature=3.0)}, "'upper:bottom' touches 'lower:top', whose temperature"),
        ({"upper:bottom": HeatContact(1.0, temperature=lambda x, t: t)}, "temperature of a foundation"),
        ({"upper:botom": HeatContact(1.0)}, "did you mean 'upper:bottom'"),
        ({"upper:left": HeatContact(share=0.5)}, "a share of the heat of friction, but the body has no contact"),
    ],
)
def test_what_heat_of_two_bodies_refuses(contact: Any, words: str) -> None:
    with pytest.raises(hv.errors.ProblemError, match=words):
        Evolution(two_blocks(), heat=Heat(1.0, 1.0, contact=contact))


def test_temperatures_prescribed_along_both_sides_of_a_joint_are_refused() -> None:
    upper = hv.rectangle((1.0, 1.0), (1, 2), origin=(0.0, 1.0))
    narrow = two_blocks(mesh=hv.Mesh.assembled({"upper": upper, "lower": hv.rectangle((1.0, 1.0), (1, 2))}))
    walls = {f"{part}:{side}": 1.0 for part in ("upper", "lower") for side in ("left", "right")}
    heat = Heat(1.0, 1.0, supports=walls, contact={"upper:bottom": HeatContact(1.0)})
    with pytest.raises(hv.errors.ProblemError, match="supports prescribe the values along facets of 'lower:top'"):
        march(Evolution(narrow, heat=heat), 1.0, step=0.5)


def test_what_goes_with_heat() -> None:
    scalar = hv.ScalarProblem(MESH, 1.0, kind=ScalarKind.HEAT, capacity=1.0)
    with pytest.raises(hv.errors.ProblemError, match="heat= goes with a body"):
        Evolution(scalar, heat=Heat(1.0, 1.0))
    with pytest.raises(hv.errors.ProblemError, match="contact at midpoints"):
        Evolution(body(quadrature=hv.mechanics.Quadrature.MIDPOINT), heat=Heat(1.0, 1.0))
    with pytest.raises(hv.errors.ProblemError, match="has several stages"):
        march(Evolution(body(), heat=Heat(1.0, 1.0)), 1.0, step=0.5, scheme=hv.evolution.SDIRK2())
    falling = {"bottom": HeatContact(lambda r, p: -np.ones_like(r))}
    with pytest.raises(hv.errors.ProblemError, match="the conductance is -1 at some point"):
        march(Evolution(body(), heat=Heat(1.0, 1.0, contact=falling)), 1.0, step=0.5)
    short = {"bottom": HeatContact(lambda r, p: np.ones(2))}
    with pytest.raises(hv.errors.ProblemError, match=r"the conductance has shape \(2,\) at 3 points|has shape \(2,\)"):
        march(Evolution(body(), heat=Heat(1.0, 1.0, contact=short)), 1.0, step=0.5)


RICH = Heat(
    2.0, lambda x: 1.0 + x[:, 0], expansion=0.05, coupling=2.0, stress_free=0.1, temperature=lambda x: 0.5 * x[:, 1],
    supports={"right": lambda x, t: np.full(len(x), 0.1 * t)}, fluxes={"top": 0.2}, source=0.3,
    contact={"bottom": HeatContact(HeatContact.touching(0.5, 2.0), lambda x, t: np.full(len(x), t), share=0.5)},
)  # fmt: skip


def test_a_march_goes_on_from_its_checkpoint(tmp_path: Path) -> None:
    evolution = Evolution(body(), inertia=True, heat=RICH)
    options: dict[str, Any] = {"step": 0.05, "scheme": hv.evolution.GeneralizedAlpha(0.7)}
    whole = march(evolution, 0.5, **options)
    assert whole.finished
    file = tmp_path / "run.ckpt"
    march(evolution, 0.5, checkpoint=file, max_time=0.0, **options)
    again = march(evolution, 0.5, checkpoint=file, resume=True, **options)
    assert whole.table.tobytes() == again.table.tobytes()
    for one, other in zip(whole.frames, again.frames, strict=True):
        assert np.array_equal(one.temperature, other.temperature)  # type: ignore[arg-type]
    other = Evolution(body(), inertia=True, heat=Heat(2.0, 1.0))
    with pytest.raises(FileError, match="another evolution"):
        march(other, 0.5, checkpoint=file, resume=True, **options)


def test_a_step_is_a_function_of_the_state() -> None:
    """A step that is forgotten leaves nothing behind."""
    from hemivar.evolution.discrete import discretize_evolution
    from hemivar.evolution.initial import initial_state
    from hemivar.evolution.thermal_stepper import stepper_of

    discrete = discretize_evolution(Evolution(body(), heat=RICH))
    advance = stepper_of(discrete, hv.evolution.ImplicitEuler(), None, hv.Controls())
    first = initial_state(advance)
    one = advance.take(first, 0.1).state
    two = advance.take(one, 0.1).state
    advance.take(two, 0.3)
    again = advance.take(one, 0.1).state
    assert np.array_equal(two.body.displacement, again.body.displacement)
    assert two.heat is not None
    assert again.heat is not None
    assert np.array_equal(two.heat.state.body.displacement, again.heat.state.body.displacement)
    assert two.ledger == again.ledger
    assert two.heat.book == again.heat.book


def test_books_of_a_body_with_everything() -> None:
    for scheme, inertia in (
        (hv.evolution.ImplicitEuler(), False),
        (hv.evolution.Midpoint(), True),
        (hv.evolution.GeneralizedAlpha(0.5), True),
    ):
        history = march(Evolution(body(), inertia=inertia, heat=RICH), 1.0, step=0.05, scheme=scheme)
        assert history.finished
        assert history.state.heat is not None
        book = history.state.heat.book
        assert abs(book.gap) < 1e-10
        assert book.friction == pytest.approx(0.5 * history.ledger["friction"], rel=1e-8)
        assert min(abs(value) for name, value in book.record().items() if name != "heat.gap") > 1e-6
        assert abs(history.ledger["gap"]) < 1e-9
        assert history.ledger["thermal"] != 0.0
        assert history["heat.content"][-1] == book.content
        assert (history["rounds"][1:] <= 12).all()


def test_other_units_give_the_same() -> None:
    """Lengths in mm, temperatures in tenths of a degree, seconds: the same steps."""
    mm, degree = 1e3, 10.0
    contact = hv.Contact(hv.Compliance(20.0 / mm), hv.Tresca(0.1))
    large = body(mesh=hv.rectangle((mm, mm), 2), contact={"bottom": contact}, supports={"left": hv.Clamped()})
    heat = Heat(2.0 * mm / degree * mm, 1.0 / degree, expansion=0.05 / degree, temperature=0.5 * degree, source=0.3)
    there = Heat(2.0, 1.0, expansion=0.05, temperature=0.5, source=0.3)
    # with the energy per volume the same unit: conductivity carries two lengths
    small = march(Evolution(body(), heat=there), 0.5, step=0.1)
    big = march(Evolution(large, heat=heat), 0.5, step=0.1)
    np.testing.assert_allclose(big.frames[-1].temperature, degree * small.frames[-1].temperature, rtol=1e-9)  # type: ignore[arg-type, operator]
    np.testing.assert_allclose(big.frames[-1].displacement, mm * small.frames[-1].displacement, rtol=1e-7, atol=1e-7)


def test_degrees_may_be_counted_from_anywhere() -> None:
    """Rounds end by what temperatures do to the body: from 300 degrees on a small warming was known to 1e-4 only."""

    def warmed(start: float, rtol: float = 1e-9) -> np.ndarray[Any, Any]:
        heat = Heat(1.0, 2.0, expansion=1e-3, coupling=300.0, stress_free=start, temperature=start, rtol=rtol)
        pressed = hv.Fixed(y=lambda x, t: np.full(len(x), -1e-4 * np.sin(5.0 * t)))
        problem = body(
            material=hv.Material.lame(100.0, 100.0, density=1.0, viscosity=(1.0, 1.0)),
            contact={"bottom": hv.Contact(hv.Compliance(1000.0))},
            supports={"left": hv.Roller(), "top": pressed},
        )
        history = march(Evolution(problem, inertia=True, heat=heat), 0.5, step=0.1, scheme=hv.evolution.Midpoint())
        assert history.finished
        assert history.frames[-1].temperature is not None
        return history.frames[-1].temperature - start

    known = warmed(0.0, 1e-12)
    for start in (0.0, 300.0):
        np.testing.assert_allclose(warmed(start), known, rtol=0.0, atol=1e-8 * np.abs(known).max())


def test_thermal_stress_of_materials() -> None:
    """By the matrices that isotropic materials have, and by regions."""
    lam, mu, points = 3.0, 2.0, np.array([[0.3, 0.4]])
    mesh = hv.rectangle((1.0, 1.0), 2)
    C = np.array([[lam + 2 * mu, lam, 0.0], [lam, lam + 2 * mu, 0.0], [0.0, 0.0, mu]])
    heat = Heat(1.0, 1.0, expansion=0.1)
    for out, beta in ((None, (2 * lam + 2 * mu) * 0.1), ((lam, lam, 0.0), (3 * lam + 2 * mu) * 0.1)):
        stated = body(mesh=mesh, material=hv.Material.tensor(C, out))
        np.testing.assert_allclose(stress_per_degree(stated, heat, points, {})[0], beta * np.eye(2), rtol=1e-13)
    low = np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 1] < 0.5)
    halves = hv.Mesh(mesh.points, mesh.cells, mesh.boundaries, {"low": low, "high": np.setdiff1d(np.arange(8), low)})
    stated = body(mesh=halves, material=hv.Material.lame(lam, mu))
    regional = Heat(1.0, 1.0, thermal_stress={"low": 1.0, "high": 4.0}, stress_free=1.0)
    found = cell_thermal_stress(stated, regional, np.full(9, 3.0))
    np.testing.assert_allclose(found[low], np.broadcast_to(2.0 * np.eye(2), (4, 2, 2)))
    # int beta th tr eps(v) of th = x, v = (x, y): 2 beta int x
    matrix = thermal_matrix(stated, Heat(1.0, 1.0, thermal_stress=5.0))
    assert mesh.points.ravel() @ (matrix @ mesh.points[:, 0]) == pytest.approx(5.0, rel=1e-13)
    # of quadratic elements int beta th div v with th = x y, v = (x^2, 0): 2 beta int x^2 y
    crooked = mesh.points + np.where(np.abs(mesh.points - 0.5).max(axis=1) < 0.4, 1.0, 0.0)[:, None] * [0.13, 0.07]
    crooked_mesh = hv.Mesh(crooked, mesh.cells, mesh.boundaries)
    quadratic, nodes = body(mesh=crooked_mesh, order=2), crooked_mesh.nodes(2)
    matrix = thermal_matrix(quadratic, Heat(1.0, 1.0, thermal_stress=5.0))
    v = np.column_stack([nodes[:, 0] ** 2, np.zeros(len(nodes))])
    assert v.ravel() @ (matrix @ nodes.prod(axis=1)) == pytest.approx(5.0 / 3.0, rel=1e-13)


def test_a_conductance_that_is_a_function_conducts_at_held_nodes() -> None:
    """The same number, given as one and as a function, along a boundary whose end is clamped."""
    found = []
    for conductance in (0.7, lambda r, p: np.full(r.shape, 0.7)):
        contact = {"bottom": HeatContact(conductance, temperature=1.0)}
        history = march(Evolution(body(), heat=Heat(0.1, 1.0, contact=contact)), 0.5, step=0.1)
        found.append(history.frames[-1].temperature)
    one, other = (np.asarray(temperature) for temperature in found)
    assert one[0] > 0.3
    assert other == pytest.approx(one, rel=1e-8)


def chattering(conductance: object) -> Evolution:
    """What touches cools, shrinks and opens; what is open warms, grows and touches."""
    problem = bodies.column(hv.Contact(hv.Compliance(1e4), gap=0.002), 100.0, top=hv.Clamped())
    foot = HeatContact(conductance, temperature=-2.0)  # type: ignore[arg-type]
    return Evolution(problem, heat=Heat(1.0, 1.0, expansion=0.01, supports={"top": 1.0}, contact={"bottom": foot}))


@pytest.mark.slow
def test_why_rounds_do_not_meet_is_told() -> None:
    """Where the conductance jumps no temperature fits."""
    history = march(chattering(HeatContact.touching(1e3)), 1.0, step=0.5)
    assert history.ended == "not_contracting"
    assert "motion and heat have not converged after 200 iterations; use shorter steps" in history.messages[-1]
    assert "closed > 0" in history.messages[-1]


def test_a_conductance_that_rises_steeply_asks_for_no_shorter_steps() -> None:
    history = march(chattering(HeatContact.touching(0.0, 1e3)), 2.0, step=0.5)
    assert history.finished
    assert history["step"][1:] == pytest.approx(0.5)
    assert abs(history["heat.gap"]).max() < 1e-9


def test_heat_goes_through_quadratic_tetrahedra_that_do_not_match() -> None:
    """Two rods in series with the resistance of a joint under a uniform pressure: the profile is linear in each."""
    upper = hv.box((1.0, 1.0, 1.0), (2, 3, 1), origin=(0.0, 0.0, 1.0))
    mesh = hv.Mesh.assembled({"u": upper, "l": hv.box((1.0, 1.0, 1.0), (3, 2, 1))})
    held = {"l:bottom": hv.Roller()} | {f"{part}:{side}": hv.Roller() for part in "ul" for side in ("left", "front")}
    problem = hv.ContactProblem(
        mesh, hv.Material.young(10.0, 0.3), {"u:bottom": hv.Contact(hv.Compliance(100.0), against="l:top")}, held,
        tractions={"u:top": hv.Pressure(0.5)}, order=2,
    )  # fmt: skip
    joint = HeatContact(ContactConductance(1.0, per_pressure=4.0))
    heat = Heat(2.0, 1.0, expansion=1e-9, contact={"u:bottom": joint}, supports={"u:top": 1.0, "l:bottom": 0.0})
    warm = march(Evolution(problem, heat=heat), 2e4, step=1e4).frames[-1].temperature
    assert warm is not None
    z = mesh.nodes(2)[:, 2]
    flow = 1.0 / (1.0 / 2.0 + 1.0 / (1.0 + 4.0 * 0.5) + 1.0 / 2.0)
    above = np.isin(np.arange(len(z)), mesh.cell_nodes(2)[mesh.regions["u"]])
    np.testing.assert_allclose(warm, np.where(above, 1.0 - flow * (2.0 - z) / 2.0, flow * z / 2.0), atol=1e-6)
