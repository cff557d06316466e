"""Heat that crosses from body to body: bars in series, gaps that close as bars grow, blocks that rub."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array, BoolArray
from hemivar.bounds.scalar_distance import scalar_distance
from hemivar.evolution import Evolution, History, march
from hemivar.mechanics.thermal import Heat, HeatContact

#: The bar ``a`` lies on the left of the bar ``b``; cells along and across, which do not match.
LONG, GAP = (1.0, 2.0), 0.25
CELLS = (3, 2), (4, 3)


def bars(gap: float = GAP, order: int = 1, size: float = 1.0, **more: Any) -> hv.ContactProblem:
    """Two bars that do not grow sideways, clamped at their far ends; lengths times a size."""
    mesh = hv.Mesh.assembled(
        {
            "a": hv.rectangle((LONG[0] * size, 0.5 * size), CELLS[0]),
            "b": hv.rectangle((LONG[1] * size, 0.5 * size), CELLS[1], origin=((LONG[0] + gap) * size, 0.0)),
        }
    )
    sides = {f"{bar}:{side}": hv.Fixed(y=0.0) for bar in "ab" for side in ("top", "bottom")}
    joint = hv.Contact(hv.Signorini(), against="b:left")
    given = {
        "mesh": mesh, "material": hv.Material.by_region({"a": hv.Material.lame(4.0, 3.0), "b": hv.Material.lame(2, 6)}),
        "contact": {"a:right": joint}, "supports": {"a:left": hv.Clamped(), "b:right": hv.Clamped(), **sides},
        "order": order,
    }  # fmt: skip
    return hv.ContactProblem(**given | more)


def contents(problem: hv.ContactProblem, history: History, capacity: dict[str, float]) -> Array:
    """Heat in each part at each moment: mean temperatures of linear cells, times capacity and area."""
    mesh, found = problem.mesh, []
    for frame in history.frames:
        assert frame.temperature is not None
        cells = frame.temperature[mesh.cells].mean(axis=1) * mesh.volumes
        found.append([capacity[name] * cells[mesh.regions[name]].sum() for name in capacity])
    return np.array(found)


def steady(mesh: hv.Mesh, source: Any) -> hv.ContactProblem:
    """Heat at rest in two bars whose far ends are held at 1 and 0 degrees, with a source and a warm air above."""
    held = {"a:left": 1.0, "b:right": 0.0}
    outside = {"a:right": HeatContact(0.7), "b:top": HeatContact(0.2, temperature=3.0)}
    heat = Heat({"a": 2.0, "b": 3.0}, 1.0, supports=held, source=source, contact=outside)
    return heat.conduction(bars(mesh=mesh))


def at(problem: hv.ContactProblem, x: float) -> BoolArray:
    return np.asarray(np.isclose(problem.mesh.nodes(problem.order)[:, 0], x))


@pytest.mark.parametrize("slave", ["a:right", "b:left"])
@pytest.mark.parametrize("exchange", [False, True])
def test_two_bars_in_series(slave: str, exchange: bool) -> None:
    """Resistances of bars and joint add up; a law that is no line acts on the difference from the side that names it.

    The far ends are held at 10 and 4 degrees.
    """
    k, hot, cold = {"a": 2.0, "b": 3.0}, 10.0, 4.0
    resistance = LONG[0] / k["a"] + LONG[1] / k["b"]
    if exchange:  # q = 0.7 (th_a - th_b) where a is the warmer one, and 5 times as much where it is not
        law = hv.laws.PiecewiseQuadratic(np.zeros(1), np.array([3.5, 0.7]), np.zeros(1))
        one = HeatContact(exchange=law)
    else:
        one = HeatContact(0.7)
    contact = {"a:right": hv.Contact(hv.Signorini(), against="b:left", slave=slave)}
    for first, last, h in ((hot, cold, 0.7), (cold, hot, 3.5 if exchange else 0.7)):
        heat = Heat(k, {"a": 1.0, "b": 0.5}, supports={"a:left": first, "b:right": last}, contact={"a:right": one})
        problem = bars(contact=contact)
        history = march(Evolution(problem, heat=heat), 1e4, step=1e3)
        q = (first - last) / (resistance + 1.0 / h)
        found = history.frames[-1].temperature
        assert found is not None
        np.testing.assert_allclose(found[at(problem, LONG[0])], first - q * LONG[0] / k["a"], rtol=1e-12)
        np.testing.assert_allclose(found[at(problem, LONG[0] + GAP)], last + q * LONG[1] / k["b"], rtol=1e-12)
        book = history.state.heat.book  # type: ignore[union-attr]
        assert book.contact == 0.0
        assert abs(book.gap) < 1e-12 * 1e4 * abs(q)


@pytest.mark.parametrize("size", [1.0, 1e3])
def test_a_gap_that_closes_as_the_hot_bar_grows(size: float) -> None:
    """Flow and pressure of two bars that touch, with a conductance ``per p``, from one quadratic equation.

    ``q = per p (T - q R)`` and ``p sum L/M = sum L beta/M (mean temperature) - gap``.  In two units of length.
    """
    k, M, beta, per, hot, gap = {"a": 2.0, "b": 1.5}, (10.0, 14.0), 0.2, 5.0, 10.0, 0.1
    heat = Heat(
        {name: value * size**2 for name, value in k.items()}, {"a": 1.0, "b": 2.0}, thermal_stress=beta,
        supports={"a:left": hot, "b:right": 0.0},
        contact={"a:right": HeatContact(HeatContact.touching(0.0, per * size))},
    )  # fmt: skip
    problem = bars(gap, order=2, size=size)  # strains are linear
    history = march(Evolution(problem, heat=heat), 400.0, step=20.0)
    resistance, soft = sum(L / c for L, c in zip(LONG, k.values(), strict=True)), sum(np.divide(LONG, M))

    def pressed(q: float) -> float:
        means = hot - 0.5 * q * LONG[0] / k["a"], 0.5 * q * LONG[1] / k["b"]
        return float((sum(L * beta / m * t for L, m, t in zip(LONG, M, means, strict=True)) - gap) / soft)

    low, high = 0.0, hot / resistance
    for _ in range(200):
        q = 0.5 * (low + high)
        low, high = (q, high) if per * pressed(q) * (hot - q * resistance) > q else (low, q)
    found = history.frames[-1].temperature
    assert found is not None
    np.testing.assert_allclose(found[at(problem, LONG[0] * size)], hot - q * LONG[0] / k["a"], rtol=1e-8)
    np.testing.assert_allclose(found[at(problem, (LONG[0] + gap) * size)], q * LONG[1] / k["b"], rtol=1e-8)
    assert history["normal_force"][-1] == pytest.approx(0.5 * size * pressed(q), rel=1e-8)
    if size > 1.0:
        return
    history = march(Evolution(problem, heat=heat), 0.4, step=0.02)
    still_open = history["normal_force"] == 0.0
    assert 2 < still_open.sum() < len(still_open) - 2
    assert (np.diff(still_open.astype(int)) <= 0).all()
    cold = problem.mesh.nodes(2)[:, 0] > LONG[0] + 0.5 * gap
    warmth = np.array([np.abs(frame.temperature[cold]).max() for frame in history.frames])  # type: ignore[index]
    assert warmth[still_open].max() < 1e-13
    assert warmth[-1] > 0.1


@pytest.mark.parametrize("conductance", [2.0, HeatContact.touching(1.0, 3.0)])
def test_what_leaves_the_one_enters_the_other(conductance: Any) -> None:
    """A hot bar pressed against a cold one, with nothing else around: heat moves and none is lost."""
    capacity = {"a": 1.0, "b": 3.0}
    start = lambda x: np.where(x[:, 0] < LONG[0] + 0.5 * GAP, 5.0 + x[:, 1], 0.0)  # noqa: E731
    heat = Heat(1.0, capacity, temperature=start, contact={"a:right": HeatContact(conductance)})
    problem = bars(contact={"a:right": hv.Contact(hv.Compliance(5.0), gap=-GAP - 0.1, against="b:left")})
    history = march(Evolution(problem, heat=heat), 2.0, step=0.2)
    found = contents(problem, history, capacity)
    assert found[-1, 1] > 0.3
    assert np.abs(np.diff(found.sum(axis=1))).max() < 1e-13 * found[0, 0]
    np.testing.assert_allclose(history["heat.content"], found.sum(axis=1), rtol=1e-13)
    assert np.abs(history["heat.contact"]).max() < 1e-13
    assert np.abs(history["heat.gap"]).max() < 1e-13 * found[0, 0]


@pytest.mark.parametrize("slave", ["upper:bottom", "lower:top"])
@pytest.mark.parametrize("share", [None, 0.0, 0.3, 1.0])
def test_heat_of_friction_goes_into_both(slave: str, share: float | None) -> None:
    """The side that states the contact takes its share of what the ledger books, the other one the rest."""
    mesh = hv.Mesh.assembled(
        {
            "upper": hv.rectangle((1.0, 0.5), (4, 2), origin=(0.3, 0.5)),
            "lower": hv.rectangle((2.0, 0.5), (5, 2)),
        }
    )
    rub = hv.Contact(hv.Compliance(1000.0), hv.Tresca(0.6), against="lower:top", slave=slave)
    problem = hv.ContactProblem(
        mesh, hv.Material.lame(100.0, 100.0, viscosity=(1.0, 1.0)), {"upper:bottom": rub},
        {"upper:left": hv.Fixed(x=lambda x, t: 0.5 * t + 0.0 * x[:, 0]), "lower:bottom": hv.Clamped()},
        tractions={"upper:top": (0.0, -2.0)},
    )  # fmt: skip
    given = {"upper:bottom": HeatContact(share=share)}
    capacity = {"upper": 2.0, "lower": 5.0}
    history = march(Evolution(problem, heat=Heat(1.0, capacity, contact=given)), 0.6, step=0.2)
    rubbed, found = history.ledger["friction"], contents(problem, history, capacity)[-1]
    assert rubbed > 0.05
    part = 0.5 if share is None else share
    np.testing.assert_allclose(found, [part * rubbed, (1.0 - part) * rubbed], atol=1e-13)
    book = history.state.heat.book  # type: ignore[union-attr]
    assert book.friction == pytest.approx(rubbed, rel=1e-12)
    assert abs(book.gap) < 1e-12


@pytest.mark.parametrize("turn", [0.0, 30.0])
def test_series_in_space_between_meshes_that_do_not_match(turn: float) -> None:
    """A cube on a wider one that is 30 degrees turned about x: the flow through the covered part is that of a bar.

    The lower cube conducts so well that it has one temperature.
    """
    upper, lower = hv.box((1.0, 1.0, 1.0), (3, 3, 2), origin=(0.5, 0.5, 1.0)), hv.box((2.0, 2.0, 1.0), 2)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    turned = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    mesh = hv.Mesh.assembled({"upper": upper.moved(turned), "lower": lower.moved(turned)})
    problem = hv.ContactProblem(
        mesh, hv.Material.lame(4.0, 3.0), {"upper:bottom": hv.Contact(hv.Signorini(), against="lower:top")},
        {"upper:top": hv.Clamped(), "lower:bottom": hv.Clamped()},
    )  # fmt: skip
    k, h, hot, cold = 2.0, 0.7, 10.0, 4.0
    heat = Heat(
        {"upper": k, "lower": 1e9}, 1.0, supports={"upper:top": hot, "lower:bottom": cold},
        contact={"upper:bottom": HeatContact(h)},
    )  # fmt: skip
    history = march(Evolution(problem, heat=heat), 1e4, step=1e3)
    found = history.frames[-1].temperature
    assert found is not None
    q = (hot - cold) / (1.0 / k + 1.0 / h)
    foot = found[np.unique(mesh.boundaries["upper:bottom"])]
    np.testing.assert_allclose(foot, hot - q / k, rtol=1e-7)


def test_heat_at_held_nodes_crosses_as_any_other() -> None:
    """One end of a joint is held at its temperature: what crosses there is counted as heat of the support."""
    capacity = {"a": 1.0, "b": 3.0}
    heat = Heat(1.0, capacity, supports={"a:right": 6.0}, contact={"a:right": HeatContact(2.0)})
    with pytest.raises(hv.errors.ProblemError, match="a:right"):
        march(Evolution(bars(), heat=heat), 1.0, step=0.5)
    for side, slave in (("b:left", "a:right"), ("b:left", "b:left")):
        contact = {"a:right": hv.Contact(hv.Signorini(), against="b:left", slave=slave)}
        heat = Heat(1.0, capacity, supports={side: 6.0}, contact={"a:right": HeatContact(2.0)})
        problem = bars(contact=contact)
        history = march(Evolution(problem, heat=heat), 1.0, step=0.25)
        found = contents(problem, history, capacity)
        # a wall of 6 degrees with a conductance of 2 warms the other bar
        wall = Heat(1.0, capacity, supports={side: 6.0}, contact={"a:right": HeatContact(2.0, temperature=6.0)})
        alone = {"a:right": hv.Contact(hv.Signorini(), gap=GAP)}
        other = contents(problem, march(Evolution(bars(contact=alone), heat=wall), 1.0, step=0.25), capacity)
        np.testing.assert_allclose(found[:, 0], other[:, 0], rtol=1e-12)
        book = history.state.heat.book  # type: ignore[union-attr]
        assert book.supports == pytest.approx(found[-1].sum() - found[0].sum(), rel=1e-12)
        assert book.contact == 0.0


def test_many_held_nodes_along_an_edge_that_face_one_facet() -> None:
    """They see the same two nodes of the other body: none of them is a contact point, and no heat is lost."""
    mesh = hv.Mesh.assembled(
        {"upper": hv.box((1.0, 1.0, 1.0), (3, 3, 2), origin=(0.0, 0.0, 1.0)), "lower": hv.box((1.0, 1.0, 1.0), 1)}
    )
    problem = hv.ContactProblem(
        mesh, hv.Material.lame(4.0, 3.0), {"upper:bottom": hv.Contact(hv.Signorini(), against="lower:top")},
        {"upper:top": hv.Clamped(), "lower:bottom": hv.Clamped()},
    )  # fmt: skip
    given = {"upper:bottom": HeatContact(2.0)}
    history = march(Evolution(problem, heat=Heat(1.0, 1.0, supports={"upper:left": 5.0}, contact=given)), 0.4, step=0.2)
    found = contents(problem, history, {"upper": 1.0, "lower": 1.0})
    assert found[-1, 1] > 0.1
    supplied = history["heat.supports"]
    np.testing.assert_allclose(supplied, found.sum(axis=1) - found[0].sum(), atol=1e-12)


def test_multigrid_takes_heat_through_a_joint() -> None:
    """The steps of heat on refined meshes are those of factors."""
    problem = steady(bars().mesh.refined().refined(), lambda x: x[:, 1])
    one, two = (hv.solve(problem, solver) for solver in (None, hv.solvers.NonsmoothMultigrid()))
    assert two.status is hv.Status.CONVERGED
    np.testing.assert_allclose(one.displacement, two.displacement, rtol=1e-8)


def test_warm_air_beside_a_joint_reaches_its_corner() -> None:
    """Nodes of both belong to the air, and those beside them carry the joint; one cell across has none beside.

    Heat that the supports take falls into place with the mesh size.
    """

    def taken(cells: int) -> float:
        parts = {
            "a": hv.rectangle((1.0, 0.5), (2 * cells, cells)),
            "b": hv.rectangle((2.0, 0.5), (2 * cells, max(2 * cells // 3, 1)), origin=(1.25, 0.0)),
        }
        problem = steady(hv.Mesh.assembled(parts), 0.0)
        solution = hv.solve(problem)
        assert solution.status is hv.Status.CONVERGED
        return float(sum(solution.reactions[name][0] for name in ("a:left", "b:right")))

    found = [taken(cells) for cells in (1, 2, 4, 8, 16)]
    off = np.abs(np.array(found[:-1]) - found[-1])
    assert (off[1:] < 0.6 * off[:-1]).all()


@pytest.mark.slow
def test_the_error_falls_with_the_square_of_the_mesh_size() -> None:
    """Heat sources that vary along a joint of meshes that do not match, against a mesh that is finer."""

    def content(levels: int) -> float:
        mesh = bars().mesh
        for _ in range(levels):
            mesh = mesh.refined()
        at_cells = hv.solve(steady(mesh, lambda x: np.sin(7.0 * x[:, 1]))).displacement[:, 0][mesh.cells].mean(axis=1)
        return float((at_cells * mesh.volumes)[mesh.regions["b"]].sum())

    found = np.array([content(level) for level in range(5)])
    rates = np.log2(np.abs(np.diff(found))[:-1] / np.abs(np.diff(found))[1:])
    assert rates[-1] > 1.8


def test_no_distance_is_claimed_and_scalar_problems_have_no_bodies_that_touch() -> None:
    problem = steady(bars().mesh, 0.0)
    with pytest.raises(hv.errors.ProblemError, match="heat that crosses from body to body has no bound"):
        scalar_distance(problem, hv.solve(problem).displacement)
    claimed = hv.solve(problem).certify(exact=True).exact
    assert claimed is not None
    assert claimed.bound == np.inf
    joint = {"a:right": hv.Contact(hv.Compliance(0.7), against="b:left")}
    with pytest.raises(hv.errors.ProblemError, match="against 'b:left': a scalar problem has no bodies that touch"):
        hv.ScalarProblem(problem.mesh, 1.0, joint, supports={"a:left": 1.0}, kind="heat")
