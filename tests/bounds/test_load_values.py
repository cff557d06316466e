"""Loads that vary: formulas are bounded on cells and facets, what the assembly misses is part of the bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import load_values as load_values_module
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.goal_values import goal_value
from hemivar.bounds.goals import goal_named
from hemivar.bounds.load_values import LoadValues, load_values
from hemivar.bounds.oscillation import linear_square, local_constants, oscillation
from hemivar.bounds.trace_bounds import TraceBounds, discrete_trace_bounds
from hemivar.fem.elements import shape_values
from hemivar.formula import Formula, FormulaArray
from hemivar.mechanics.conditions import Traction, VectorData
from tests import bodies

MISSED = "-10*max(0, 1 - abs(x - 0.56)/0.03)"


def vector(*entries: str) -> FormulaArray:
    return FormulaArray(tuple(Formula(entry) for entry in entries), (len(entries),))


def loaded_square(
    cells: int, body: VectorData = (0.0, 0.0), top: Traction | None = None, order: int = 1, lame: float = 4.0
) -> hv.ContactProblem:
    contact = hv.Compliance(3.0)
    return bodies.square(
        contact, cells, lame=(lame, lame), body_force=body, tractions={} if top is None else {"top": top}, order=order
    )


def proved(problem: hv.ContactProblem) -> TraceBounds:
    """Constants that are near to those of the body, said to be proved."""
    return replace(discrete_trace_bounds(hv.discretize(problem)), guaranteed=True)


CONSTANTS = proved(loaded_square(16))


def bounded(problem: hv.ContactProblem, constants: TraceBounds = CONSTANTS) -> ExactDistance:
    return exact_distance(problem, hv.solve(problem).displacement, constants)


def error_on_finer(problem: hv.ContactProblem, fine: int) -> float:
    """Energy norm of the distance to the solution with quadratic elements on a finer mesh."""
    best = hv.solve(replace(problem, mesh=problem.mesh.refined(fine), order=2))
    coarse = hv.solve(problem)
    before, after = coarse.problem.field, best.problem.field
    assert before is not None
    assert after is not None
    from hemivar.fem.transfer import interpolate

    off = after.restrict(best.displacement - interpolate(before, coarse.displacement, after))
    return float(np.sqrt(off @ (best.problem.stiffness @ off)))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("part", ["top", "body"])
def test_a_load_that_no_point_of_the_rule_sees_is_part_of_the_bound(order: int, part: str) -> None:
    if part == "top":
        problem = loaded_square(4, top=vector("0", MISSED), order=order)
    else:
        problem = loaded_square(
            4, body=vector("0", "-300*max(0, 1 - (abs(x - 0.501) + abs(y - 0.502))/0.02)"), order=order
        )
    assert not hv.solve(problem).displacement.any()
    found = bounded(problem)
    assert found.guaranteed, found.reasons
    assert found.distance >= error_on_finer(problem, 3) > 0.0
    assert found.parts.oscillation > 0.5 * found.distance
    assert found.relative == np.inf


@pytest.mark.parametrize("order", [1, 2])
def test_what_all_points_of_the_rule_miss_is_part_of_the_bound(order: int) -> None:
    """A load of mean 0.6 that vanishes at the Gauss points of every facet; most of the bound is what is missed.

    Without contact the error is the energy norm of u, at least ``L(v) / |v|_a`` for every v that is held.
    """
    n = 24
    at = np.cos(2.0 * np.pi * (0.5 - 0.5 * np.sqrt(0.6)))
    wave = f"cos({2 * n}*pi*x)"
    problem = replace(
        loaded_square(n, top=vector("0", f"-(1 + {wave})*({wave} - {float(at)!r})^2"), order=order), contact={}
    )
    found = bounded(problem)
    assert np.abs(hv.solve(problem).displacement).max() < 1e-12
    x = (np.arange(n * 400) + 0.5) / (n * 400)
    y = np.cos(2.0 * np.pi * n * x)
    mean = float(np.mean((1.0 + y) * (y - at) ** 2))
    pushed = replace(problem, tractions={"top": (0.0, -mean)})
    v = hv.solve(pushed)
    size = float(np.sqrt(v.unknowns @ (v.problem.stiffness @ v.unknowns)))
    top = problem.mesh.nodes(order)[:, 1] > 1.0 - 1e-9
    along = np.argsort(problem.mesh.nodes(order)[top, 0])
    values = np.interp(x, problem.mesh.nodes(order)[top, 0][along], v.displacement[top, 1][along])
    least = float(np.mean(-(1.0 + y) * (y - at) ** 2 * values)) / size
    assert found.guaranteed
    assert least < found.distance
    assert found.distance < 1.5 * least  # as a load of any shape it would count for more


def test_what_is_unknown_of_a_load_is_part_of_the_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Enclosed coarsely, the bound grows by all that may be hidden: that of a finer enclosure is below it."""
    problem = loaded_square(4, body=vector("0", "-sin(30*x)*y"), top=vector("0", "-exp(-((x - 0.4)/0.1)^2)"))
    fine = bounded(problem)
    monkeypatch.setattr(load_values_module, "_MOST", 0)
    coarse = bounded(problem)
    assert fine.guaranteed
    assert coarse.guaranteed
    body, top = fine.stress.data.varying.body, coarse.stress.data.varying.body
    assert body is not None
    assert top is not None
    # the moments of both differ by no more than what is unknown of them
    count = problem.mesh.number_of_cells
    apart = np.abs(body.moments(count, 1) - top.moments(count, 1)).max(axis=2)
    assert (apart <= body.unknown(count) + top.unknown(count)).all()
    assert coarse.distance > fine.distance
    # size of the linear functions with such moments, and of what is unknown on cells
    table = coarse.stress.data.table
    square = linear_square(coarse.stress.data, body.moments(count, 1) - top.moments(count, 1))
    assert (np.sqrt(square) <= top.linear(table.volumes) + body.linear(table.volumes)).all()
    lost = np.sqrt(coarse.missed.sum()) * np.sqrt(CONSTANTS.body)
    assert lost >= np.linalg.norm(top.linear(table.volumes))


def rest_of(texts: tuple[str, str], corners: Array, measure: float, moments: Array) -> float:
    """``|f - q|`` on a simplex, q the polynomial with these moments (l, d), by a rule of many points.

    q is linear on a triangle, and on an edge quadratic where there are three moments.
    """
    s, weight = np.polynomial.legendre.leggauss(200)
    s, weight = 0.5 * (s + 1.0), 0.5 * weight
    if len(corners) == 2:
        at = np.stack([1.0 - s, s], axis=1)
    else:
        a, b = (one.ravel() for one in np.meshgrid(s, s, indexing="ij"))
        at = np.stack([1.0 - a - (1.0 - a) * b, a, (1.0 - a) * b], axis=1)
        weight = (2.0 * np.outer(weight * (1.0 - s), weight)).ravel()
    shapes = at if len(moments) == at.shape[1] else shape_values(2, at)
    values = np.stack([Formula(text)(at @ corners) for text in texts], axis=1)
    q = shapes @ np.linalg.solve(measure * shapes.T @ (weight[:, None] * shapes), moments)
    return float(np.sqrt(measure * weight @ ((values - q) ** 2).sum(axis=1)))


@pytest.mark.parametrize("most", [0, 1 << 15])
def test_the_oscillation_is_above_what_linear_fields_do_not_see(most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of loads that are enclosed coarsely and finely, on cells and on facets; near to it where they are known."""
    monkeypatch.setattr(load_values_module, "_MOST", most)
    for texts in (("x*y", "-exp(-((x - 0.4)/0.1)^2 - ((y - 0.55)/0.1)^2)"), ("0", "x*x - y*y")):
        problem = loaded_square(3, body=vector(*texts), order=2)
        stress = bounded(problem).stress
        table, body = stress.data.table, stress.data.varying.body
        assert body is not None
        found, constants = oscillation(stress, 1.0), local_constants(table, stress.data.tensors[:, 0])
        moments = body.moments(len(table.cells), 1)
        for cell, corners in enumerate(table.mesh.points[table.cells]):
            least = constants.cell[cell] * rest_of(texts, corners, table.volumes[cell], moments[cell])
            assert least <= found.cells[cell] * (1.0 + 1e-9)
            assert most == 0 or found.cells[cell] <= 1.1 * least + 0.02 * found.cells.max()
        linear = body.linear(table.volumes)
        assert (np.sqrt(found.missed) >= linear).all()
    text = "-exp(-((x - 0.4)/0.05)^2)"
    stress = bounded(loaded_square(3, top=vector("0", text), order=2)).stress
    table, (facets, top) = stress.data.table, stress.data.varying.tractions["top"]
    found, constants = oscillation(stress, 1.0), local_constants(table, stress.data.tensors[:, 0])
    moments, unknown = top.moments(len(facets), 2), top.linear(table.measures[facets])
    for i, facet in enumerate(facets):
        cell = table.owners[facet, 0]
        local = int(np.argmax(table.cell_facets[cell] == facet))
        rest = rest_of(("0*x", text), table.mesh.points[table.facets[facet]], table.measures[facet], moments[i])
        least = constants.facet[cell, local] * rest + constants.shift[cell, local] * unknown[i]
        assert least <= found.cells[cell] * (1.0 + 1e-9)
        assert most == 0 or found.cells[cell] <= 1.05 * least + 0.02 * found.cells.max()
        assert np.sqrt(found.missed[cell]) >= constants.spread[cell, local] * unknown[i]


def test_an_adaptive_solve_finds_it() -> None:
    found = hv.bounds.solve_adaptive(loaded_square(4, top=vector("0", MISSED)), rtol=0.3)
    assert found.reached
    first = found.levels[0]
    assert first.solution.displacement.max() == 0.0
    # cells are marked by what is missed in them, too
    assert (first.indicator >= first.distance.cells + first.distance.missed).all()
    assert first.distance.missed.sum() > first.distance.cells.sum() / 2.0
    # the force of the load, 10 * 0.03, is what foundation and support take up
    support = found.solution.reactions["left"]
    foundation = found.solution.on("bottom").force
    assert abs(support[1] + foundation[1] - 0.3) < 0.02


def test_pressures_are_bounded_as_tractions_are() -> None:
    one = bounded(loaded_square(4, top=vector("0", MISSED)))
    other = bounded(loaded_square(4, top=hv.Pressure(Formula(MISSED.removeprefix("-")))))
    assert other.guaranteed
    assert other.distance == pytest.approx(one.distance, rel=1e-9)


def test_a_formula_at_a_time_is_bounded() -> None:
    moving = loaded_square(4, top=vector("0", "-t*max(0, 1 - abs(x - 0.56)/0.03)")).at_time(10.0)
    found = bounded(moving)
    assert found.guaranteed
    assert found.distance == pytest.approx(bounded(loaded_square(4, top=vector("0", MISSED))).distance, rel=1e-9)


def test_a_function_of_python_makes_an_estimate() -> None:
    def push(x: Array) -> Array:
        return np.column_stack([0.0 * x[:, 0], -np.sin(x[:, 0])])

    for problem in (
        loaded_square(4, body=push),
        loaded_square(4, top=push),
        loaded_square(4, top=hv.Pressure(lambda x: x[:, 0])),
    ):
        found = bounded(problem)
        assert not found.guaranteed
        assert "is a function of Python, which is evaluated at points only" in found.reasons[0]
    adapted = hv.bounds.solve_adaptive(loaded_square(4, top=push), rtol=0.3)
    assert adapted.ended == "estimated"
    assert not adapted.reached


def test_a_formula_without_a_bound_makes_an_estimate() -> None:
    found = bounded(loaded_square(4, top=vector("0", "log(x)")))
    assert not found.guaranteed
    assert np.isfinite(found.distance)
    assert found.reasons == ("tractions['top'] has no known bound near some points, and is evaluated at points only",)


@pytest.mark.parametrize("order", [1, 2])
def test_smooth_formulas_lose_little(order: int) -> None:
    """Against the same load as a function, of which what lies between points is not known."""
    texts = ("3*sin(3*x)*cos(y)", "-2*exp(-y)*x"), ("0.1*y", "-sin(pi*x)")

    def body(x: Array) -> Array:
        return np.column_stack([3.0 * np.sin(3.0 * x[:, 0]) * np.cos(x[:, 1]), -2.0 * np.exp(-x[:, 1]) * x[:, 0]])

    def top(x: Array) -> Array:
        return np.column_stack([0.1 * x[:, 1], -np.sin(np.pi * x[:, 0])])

    found = bounded(loaded_square(8, vector(*texts[0]), vector(*texts[1]), order))
    sampled = bounded(loaded_square(8, body, top, order))
    assert found.guaranteed
    assert sampled.distance < found.distance < (1.01 if order == 1 else 1.02) * sampled.distance


def test_linear_loads_lose_nothing() -> None:
    found = bounded(loaded_square(6, vector("x", "-1 - y"), vector("0", "x - 1")))
    sampled = bounded(loaded_square(6, lambda x: np.column_stack([x[:, 0], -1.0 - x[:, 1]]),
                            lambda x: np.column_stack([0.0 * x[:, 0], x[:, 0] - 1.0])))  # fmt: skip
    assert found.guaranteed
    assert found.distance == pytest.approx(sampled.distance, rel=1e-10)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e6])
def test_bounds_do_not_depend_on_units(unit: float) -> None:
    """Lengths in other units, moduli in others."""
    plain = loaded_square(4, body=vector("0", "-4*y*sin(7*x)"), top=vector("0", MISSED))
    scaled = replace(
        plain,
        mesh=hv.rectangle((unit, unit), (4, 4)),
        body_force=vector("0", f"-4*y/{unit!r}*sin(7*x/{unit!r})/{unit!r}"),
        tractions={"top": vector("0", f"-10*max(0, 1 - abs(x/{unit!r} - 0.56)/0.03)")},
        contact={"bottom": hv.Contact(hv.Compliance(3.0 / unit))},
    )
    one, other = bounded(plain, proved(plain)), bounded(scaled, proved(scaled))
    assert other.distance == pytest.approx(unit * one.distance, rel=1e-4)


def test_a_goal_counts_the_stated_load() -> None:
    """The body weighs -0.3 and is held at its side alone: the support's force is known."""
    problem = replace(loaded_square(4, top=vector("0", MISSED)), contact={"bottom": hv.Contact(hv.Compliance(1e-9))})
    found = hv.bounds.solve_adaptive(problem, goal="support.left.force.y", rtol=0.5, max_unknowns=50)
    goal = found.levels[0].goal
    assert goal is not None
    assert goal.guaranteed, goal.reasons
    assert goal.lower[0] <= 0.3 <= goal.upper[0]


def test_an_interval_of_a_force_holds_what_is_unknown_of_the_load(monkeypatch: pytest.MonkeyPatch) -> None:
    """Were the displacement exact, the force of the support would be known but for the load."""
    problem = loaded_square(4, top=vector("0", "-sin(30*x)"))
    monkeypatch.setattr(load_values_module, "_MOST", 0)
    solution = hv.solve(problem)
    exact = replace(exact_distance(problem, solution.displacement, CONSTANTS), distance=0.0)
    found = goal_value(goal_named(problem, "support.left.force.y"), solution, exact, CONSTANTS)
    values = exact.stress.data.varying.tractions["top"][1]
    # the field of this goal is one at the support, so that the load of the first facet counts
    assert found.upper[0] - found.lower[0] >= 0.5 * values.unknown(4)[0].sum() > 0.0


# ---- values on parts ------------------------------------------------------------------------------------------------

FORMULAS = [
    "sin(3*x)*cos(y)", "exp(-((x-0.5)^2 + (y-0.3)^2)/0.01)", "max(0, 1 - abs(x - 0.56)/0.03)", "sqrt(x)", "x^y",
    "abs(x - 0.3)*y", "min(x, y, 0.4) + max(x^3, y)", "tanh(5*x) - tan(y)", "log(1 + x)*sqrt(1 + y^2)", "1/(0.1 + x^2)",
    "(x + 1)^1.5", "(y + 0.1)^-2", "-x^2", "2^x", "cos(2*pi*x)^3", "x*x - y", "3",
]  # fmt: skip


@pytest.mark.parametrize("text", FORMULAS)
@pytest.mark.parametrize("corners", [2, 3])
def test_expansions_enclose_formulas(text: str, corners: int) -> None:
    """At random points of random simplices of several sizes."""
    rng = np.random.default_rng(FORMULAS.index(text))
    formula = Formula(text)
    weights = np.vstack([rng.dirichlet(np.ones(corners), 60), np.eye(corners)])
    for size in (0.4, 0.03, 1e-4):
        places = np.clip(rng.uniform(0, 1, (60, 1, 2)) + size * rng.uniform(-1, 1, (60, corners, 2)), 0.0, 1.0)
        found = formula.expansion(places)
        points = np.einsum("qa,kad->kqd", weights, places)
        off = np.abs(formula(points.reshape(-1, 2)).reshape(60, -1) - found.at(weights)).max(axis=1)
        assert (off <= found.off * (1.0 + 1e-9)).all()
        if size < 1e-3 and "abs" not in text and "m" not in text:
            assert np.median(found.off) < 1e-8


def test_a_smooth_formula_is_enclosed_to_third_order() -> None:
    formula = Formula("exp(-x*y)*sin(2*x + y)")
    base = np.array([[0.3, 0.2], [1.3, 0.1], [0.5, 1.2]])
    sizes = 0.1 * 0.5 ** np.arange(5)
    offs = [formula.expansion(base[None] * size + 0.4).off[0] for size in sizes]
    rates = np.log2(np.array(offs[:-1]) / np.array(offs[1:]))
    assert (np.abs(rates - 3.0) < 0.2).all()


def cells_of(mesh: hv.Mesh) -> Array:
    return mesh.points[facet_table(mesh).cells]


def values_on(mesh: hv.Mesh, text: str) -> LoadValues:
    return load_values(FormulaArray((Formula(text), 0.0), (2,)), cells_of(mesh), mesh.volumes, "a load")


@pytest.mark.parametrize(
    "text", ["exp(-((x-0.5)^2 + (y-0.3)^2)/0.01)", "max(0, 1 - abs(x - y - 0.01)/0.03)", "sqrt(x)"]
)
def test_moments_are_within_what_is_unknown(text: str) -> None:
    """Against adaptive quadrature of another code."""
    mesh = hv.rectangle((1.0, 1.0), (2, 2))
    found, formula = values_on(mesh, text), Formula(text)
    moments, unknown = found.moments(mesh.number_of_cells, 1), found.unknown(mesh.number_of_cells)
    for cell in (0, 3, 5):
        corners = cells_of(mesh)[cell]
        edges = (corners[1:] - corners[0]).T
        size = abs(np.linalg.det(edges))
        inner: list[float] = []
        s, weight = np.polynomial.legendre.leggauss(400)
        s, weight = 0.5 * (s + 1.0), 0.5 * weight
        a, b = np.meshgrid(s, s, indexing="ij")
        places = corners[0] + np.stack([a.ravel(), ((1.0 - a) * b).ravel()], axis=1) @ edges.T
        value = formula(places).reshape(a.shape)
        shapes = (1.0 - a - (1.0 - a) * b, a, (1.0 - a) * b)
        for shape in shapes:
            inner.append(float(size * np.einsum("i,j,ij->", weight * (1.0 - s), weight, value * shape)))
        assert (np.abs(moments[cell, :, 0] - inner) <= unknown[cell] + 2e-6 * size).all()


@pytest.mark.parametrize("p", [1, 2, 3])
def test_linear_loads_of_unknown_size_are_bounded(p: int) -> None:
    """The projection of a load of one sign on linear functions, where it is large near a corner alone."""
    rng = np.random.default_rng(p)
    mass = (np.ones((p + 1, p + 1)) + np.eye(p + 1)) / ((p + 1) * (p + 2))
    for size in (0.02, 0.3, 1.0):
        corners = np.eye(p + 1)[None] * size + (1.0 - size) * rng.dirichlet(0.2 * np.ones(p + 1), (5, 1, 1))[:, 0]
        none, off = np.zeros(5, dtype=int), rng.uniform(0.0, 3.0, 5)
        values = LoadValues(np.arange(5), none, corners, np.full(5, 2.0 * size**p), np.zeros((5, 1, 2)), off, "")
        moments = (off * 2.0 * size**p)[:, None] * corners.mean(axis=1)
        projected = np.sqrt(np.einsum("na,ab,nb->n", moments, np.linalg.inv(2.0 * mass), moments))
        assert (projected <= values.linear(np.full(5, 2.0)) * (1.0 + 1e-12)).all()


def test_parts_fill_their_cells() -> None:
    mesh = hv.rectangle((2.0, 1.0), (3, 2))
    found = values_on(mesh, "exp(-((x-0.5)^2 + (y-0.3)^2)/0.001)")
    assert len(found.owner) > 10 * mesh.number_of_cells
    assert np.bincount(found.owner, found.measures) == pytest.approx(mesh.volumes)
    # no part reaches over the pieces that the centroid cuts a cell into
    least = found.corners.argmin(axis=2)
    own = np.take_along_axis(found.corners, found.piece[:, None, None], axis=2)[:, :, 0]
    assert (own <= found.corners.min(axis=2) + 1e-12).all()
    assert least.shape == own.shape


def test_what_is_unknown_becomes_small() -> None:
    mesh = hv.rectangle((1.0, 1.0), (4, 4))
    for text, most in (("sin(3*x)*cos(y)", 1e-3), (MISSED, 1e-2), ("x*y^2", 1e-3), ("1 - 2*x + y", 1e-12)):
        found = values_on(mesh, text)
        weights = found.measures[:, None] * found.rule[1]
        size = np.sqrt(np.einsum("kq,kqd->", weights, found.values**2))
        assert np.linalg.norm(found.linear(mesh.volumes)) < most * size


def test_integrals_of_a_peak() -> None:
    """10 * 0.03 * 1, by Fubini; scipy agrees."""
    exact = scipy.integrate.quad(
        lambda x: 10.0 * max(0.0, 1.0 - abs(x - 0.56) / 0.03), 0.5, 0.6, points=[0.53, 0.56, 0.59]
    )[0]
    found = values_on(hv.rectangle((1.0, 1.0), (4, 4)), MISSED)
    total = -np.einsum("kq,kq->", found.measures[:, None] * found.rule[1], found.values[:, :, 0])
    assert exact == pytest.approx(0.3)
    assert total == pytest.approx(exact, rel=2e-3)
    assert abs(total - exact) <= (found.off * found.measures).sum()
