"""Bounds for convex laws that need no constant of the body: bodies held by contact only, above all."""

from __future__ import annotations

import re
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.deadline import OutOfTime
from hemivar.basics.types import Array
from hemivar.bounds import convex_distance
from hemivar.bounds.body_data import body_data
from hemivar.bounds.contact_traces import ContactTraces, contact_traces
from hemivar.bounds.convex_distance import BareStiffness, unknown_gaps
from hemivar.bounds.exact_distance import exact_distance
from hemivar.bounds.fenchel import fenchel_gap
from hemivar.bounds.stated_distance import DistanceToExact
from hemivar.bounds.trace_bounds import TraceBounds
from hemivar.certificates import certify
from hemivar.errors import MethodError
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.transfer import interpolate
from hemivar.formula import Formula
from hemivar.laws import Signorini
from hemivar.mechanics.conditions import ScalarData, Support
from tests.bounds.everyday import everyday
from tests.samples import sampled

#: What stands for a body that is constrained by contact only, and for one whose constants are not known.
UNKNOWN = TraceBounds(0.0, 0.0, 0.0, 0.0, False, "not known")


def seminorm(mesh: hv.Mesh, problem: hv.ContactProblem, order: int, v: Array) -> float:
    return float(np.sqrt(max(v.ravel() @ (stiffness_matrix(mesh, problem.material, order) @ v.ravel()), 0.0)))


def error(problem: hv.ContactProblem, displacement: Array, times: int = 2) -> float:
    """The seminorm of the distance to the solution on a nested mesh, in the plane with quadratic elements."""
    order = 2 if problem.mesh.dim == 2 else 1
    mesh = problem.mesh.refined(times)
    finer = hv.solve(replace(problem, mesh=mesh, order=order)).raise_for_status()
    coarse = hv.discretize(problem, check_coercivity=False)
    assert coarse.field is not None
    assert finer.problem.field is not None
    moved = interpolate(coarse.field, displacement, finer.problem.field)
    return seminorm(mesh, problem, order, finer.displacement - moved)


def bounded(problem: hv.ContactProblem) -> tuple[hv.Solution, DistanceToExact]:
    solution = hv.solve(problem).raise_for_status()
    found = certify(solution, exact=True, trace_constant=False).exact
    assert found is not None
    return solution, found


@pytest.mark.parametrize("seed", sampled(range(34)))
def test_everyday_problems_have_bounds_above_their_errors(seed: int) -> None:
    kind, problem = everyday(seed)
    solution, found = bounded(problem)
    assert found.guaranteed, found.reasons
    assert found.constant == 0.0
    assert found.unseen
    assert found.loose == ("translation (1, 0)" if kind == "steep" else "")  # friction alone resists that one
    assert found.unique == (kind != "steep")
    assert certify(solution, exact=False).unique
    off = error(problem, solution.displacement)
    assert off * (1.0 - 1e-9) <= found.bound <= 8.0 * off


def wide_block(
    contact: hv.Contact, *, n: int = 6, length: float = 1.0, stiff: float = 1e3, side: float = 0.0, **more: object
) -> hv.ContactProblem:
    """Pressed down by a thousandth of its stiffness; held to the side where no force pushes it there."""
    mesh = hv.rectangle((2.0 * length, length), (2 * n, n))
    supports = {} if side else {"left": hv.Roller()}
    load = {"top": (side * stiff, -1e-3 * stiff)}
    stated = hv.ContactProblem(mesh, hv.Material.young(stiff, 0.3), {"bottom": contact}, supports, tractions=load)
    return replace(stated, **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("law", [Signorini(), hv.Compliance(50.0)])
def test_a_solution_that_is_exact_has_a_bound_of_rounding(law: hv.laws.Superpotential) -> None:
    """A block that slides along its support under an even pressure has the same stress everywhere."""
    _, found = bounded(wide_block(hv.Contact(law)))
    assert found.guaranteed
    assert found.relative < 1e-6


@pytest.mark.parametrize("seed", range(3))
def test_displacements_that_solve_nothing_are_bounded_too(seed: int) -> None:
    problem = wide_block(hv.Contact(hv.Compliance(500.0), hv.Tresca(0.3)), side=2e-4)
    u = hv.solve(problem).displacement
    wave = np.random.default_rng(seed).normal(size=(2, 2))
    u = u + 3e-4 * np.sin(problem.mesh.points @ wave)
    found = exact_distance(problem, u, UNKNOWN)
    assert found.guaranteed
    off = error(problem, u)
    assert off <= found.distance <= 8.0 * off


def test_units_do_not_matter() -> None:
    ratios = []
    for length, stiff in ((1.0, 1e3), (1e3, 1e-3), (1e-3, 1e9)):
        k = 0.5 * stiff / length
        gap = Formula(f"0.0005 * (x - {length})^2 / {length}")
        contact = hv.Contact(hv.Compliance(k), hv.Tresca(3e-4 * stiff), gap=gap)
        ratios.append(bounded(wide_block(contact, length=length, stiff=stiff, side=1e-4))[1].relative)
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-5)


#: A bottom that is round, and one that comes down to the plane between the nodes alone.
ROUND = "0.002 * (x - 1)^2"
BUMP = "0.0004 - 0.002 * exp(-((x - 0.917) / 0.02)^2)"


@pytest.mark.parametrize("law", [Signorini(), hv.Compliance(2e3)])
@pytest.mark.parametrize("gap", [ROUND, BUMP])
def test_gaps_that_are_formulas_are_known_between_the_points(law: hv.laws.Superpotential, gap: str) -> None:
    formula = Formula(gap)
    problem = wide_block(hv.Contact(law, gap=formula))
    solution, found = bounded(problem)
    assert found.guaranteed, found.reasons
    assert found.bound >= error(problem, solution.displacement, times=3)
    function: ScalarData = lambda x: formula(x)  # noqa: E731
    _, seen = bounded(wide_block(hv.Contact(law, gap=function)))
    assert not seen.guaranteed
    assert "the gap of contact 'bottom' varies" in seen.why


#: Ways to write ``((x - 0.56) / 0.001)^2``; the last one is near to it, and intervals do not see that it is above -1.
NEEDLES = ("(x - 0.56)^2/1e-6", "(x - 0.56)*(x - 0.56)/1e-6", "(x - 0.56)*(x - 0.5599)/1e-6")


@pytest.mark.parametrize("square", NEEDLES)
def test_a_needle_between_the_points_is_bounded_or_told(square: str) -> None:
    """A solution of its own, with quadratic elements 32 times finer, is 0.01925 away."""
    contact = {"bottom": hv.Contact(Signorini(), gap=Formula(f"0.02 - 0.02/(1 + {square})"))}
    held: dict[str, Support] = {"top": hv.Clamped(), "left": hv.Roller(), "right": hv.Roller()}
    material, mesh = hv.Material.young(10.0, 0.3), hv.rectangle((1.0, 1.0), (4, 4))
    problem = hv.ContactProblem(mesh, material, contact, held, body_force=(0.0, -0.3))
    found = hv.solve(problem).certify(exact=True).exact
    assert found is not None
    known = square != NEEDLES[2]
    assert found.guaranteed == known
    assert found.unique == known
    assert found.bound >= 0.01925 or not known
    if not known:
        assert "the formula of the gap of contact 'bottom' has no bound by intervals near x = (0.625, 0)" in found.why
        adapted = hv.bounds.solve_adaptive(problem, rtol=0.5, max_unknowns=200)
        assert not adapted.reached
        assert adapted.ended == "estimated"


def test_what_cannot_be_moved_out_of_a_gap_has_an_estimate() -> None:
    """Between a corner that is held and the next node the gap is negative."""
    mesh = hv.rectangle((2.0, 1.0), (12, 6))
    contact = {"bottom": hv.Contact(Signorini(), gap=Formula("0.01 * x * (x - 1 / 6)"))}
    held: dict[str, Support] = {"left": hv.Fixed(x=0.0, y=0.0)}
    stated = hv.ContactProblem(mesh, hv.Material.young(1e3, 0.3), contact, held, tractions={"top": (0.0, -1.0)})
    found = exact_distance(stated, np.zeros(mesh.points.shape), UNKNOWN)
    assert not found.guaranteed
    assert any("leaves the domain of the law" in reason for reason in found.reasons)


def test_a_stress_in_equilibrium_pays_for_tractions_that_the_law_does_not_want() -> None:
    """An even pressure balances the load, and the gap is not even: nothing but G sees how far that is off."""
    problem = wide_block(hv.Contact(hv.Compliance(2e4), gap=Formula("0.0004 * (x - 1)^2")))
    strain = hv.solve(wide_block(hv.Contact(hv.Compliance(2e4)))).displacement
    found = exact_distance(problem, strain, UNKNOWN)
    assert found.guaranteed
    assert found.distance >= error(problem, strain)
    assert found.parts.misfit < error(problem, strain)


def test_what_brings_a_displacement_out_of_a_rigid_foundation_counts() -> None:
    problem = wide_block(hv.Contact(Signorini(), hv.Tresca(0.3)), side=2e-4)
    u = hv.solve(problem).displacement.copy()
    u[np.flatnonzero(problem.mesh.points[:, 1] < 1e-9)[3:6], 1] -= 5e-3
    found = exact_distance(problem, u, UNKNOWN)
    assert found.guaranteed
    assert found.parts.correction > 0.0
    assert found.distance >= error(problem, u)
    assert found.distance - found.parts.correction < error(problem, u)


def traces_at(problem: hv.ContactProblem, u: Array) -> ContactTraces:
    traces = contact_traces(body_data(problem, u))
    assert traces is not None
    return traces


def test_gaps_that_are_off_are_paid_at_their_worst() -> None:
    """Of a compliance k the gap of Fenchel is ``(zeta - k r)^2 / 2 k``, here for a gap that may be off by 1e-3."""
    k, wide = 300.0, 1e-3
    problem = wide_block(hv.Contact(hv.Compliance(k)))
    traces = traces_at(problem, np.full(problem.mesh.points.shape, -4e-3))
    forces = np.zeros(traces.local.shape)
    forces[..., 0] = 2.0
    found = fenchel_gap(traces, forces, 1.0, np.full(len(traces.facets), wide))
    zeta = found.multiplier[0, 0, 0]
    worst = max((zeta - k * (4e-3 + sign * wide)) ** 2 / (2.0 * k) for sign in (-1.0, 1.0))
    np.testing.assert_allclose(found.normal_gap, worst * traces.weights.sum(axis=1), rtol=1e-12)


def test_what_is_unknown_of_a_gap_is_above_what_polynomials_miss() -> None:
    """Of a cubic on parts of length h: ``h^3 / (36 sqrt 3)`` from its best parabola by far, at least a fourth of it."""
    problem = wide_block(hv.Contact(hv.Compliance(300.0), gap=Formula("0.5 * x^3")))
    traces = traces_at(problem, np.zeros(problem.mesh.points.shape))
    length = 1.0 / 6.0 / 8.0
    assert (unknown_gaps(traces) >= 0.5 * length**3 / 32.0).all()
    even = traces_at(wide_block(hv.Contact(hv.Compliance(300.0), gap=Formula("0.5 * x^2"))), traces.data.displacement)
    assert (unknown_gaps(even) < 1e-12).all()


def test_what_facets_cannot_represent_of_the_multiplier_is_oscillation() -> None:
    problem = wide_block(hv.Contact(Signorini(), gap=Formula(ROUND)))
    found = exact_distance(problem, hv.solve(problem).displacement, UNKNOWN)
    parts = found.parts
    assert parts.oscillation > 1e-6 * parts.misfit
    whole = parts.misfit + parts.oscillation + parts.algebraic
    expected = 0.5 * (whole + np.sqrt(whole**2 + 4.0 * parts.gap)) + parts.correction
    assert found.distance == pytest.approx(expected, rel=1e-12)
    assert found.cells.sum() == pytest.approx((parts.misfit + parts.oscillation) ** 2, rel=1e-9)


def test_what_supports_hold_needs_no_constants_of_its_body_either() -> None:
    """A mesh in space with more tetrahedra than constants are computed on."""
    mesh = hv.box((1.0, 1.0, 1.0), 8)
    stated = hv.ContactProblem(
        mesh,
        hv.Material.young(1e3, 0.3),
        {"bottom": hv.Contact(Signorini(), hv.Tresca(0.5), gap=Formula("0.002 * ((x - 0.5)^2 + (y - 0.5)^2)"))},
        {"top": hv.Prescribed((0.0, 0.0, -0.002))},
    )
    assert mesh.number_of_cells > 2500
    solution, found = bounded(stated)
    assert found.guaranteed, found.reasons
    assert found.unique
    assert not found.unseen
    finer = error(stated, solution.displacement, times=1)
    assert finer <= found.bound <= 8.0 * finer


def test_quadratic_elements_are_sharper() -> None:
    contact = hv.Contact(hv.Compliance(300.0), hv.Tresca(0.3))
    bounds = []
    for order in (1, 2):
        problem = wide_block(contact, side=2e-4, order=order)
        solution, found = bounded(problem)
        assert found.guaranteed, found.reasons
        assert found.bound >= error(problem, solution.displacement)
        bounds.append(found.bound)
    assert bounds[1] < 0.6 * bounds[0]


def test_the_words_name_the_motions_that_are_not_seen() -> None:
    _, found = bounded(wide_block(hv.Contact(Signorini(), hv.Tresca(1.0)), side=1e-4))
    assert found.unseen == "translation (1, 0), translation (0, 1), rotation"
    assert any("but for rigid motions, which the energy does not see" in line for line in found.lines())
    assert any("differ at most by: translation (1, 0)" in line for line in found.lines())
    assert found.record()["unseen"] == found.unseen
    _, alone = bounded(wide_block(hv.Contact(Signorini())))
    assert any("exactly one solution: contact leaves no rigid motion" in line for line in alone.lines())


@pytest.mark.parametrize(
    ("contact", "words"),
    [
        (
            hv.Contact(hv.Softening(1e3, 1e-3, 10.0)),
            "only contact constrains the body, and its law is not known to be",
        ),
        (hv.Contact(hv.Compliance(1e3), hv.Coulomb(0.3)), "friction .* depends|depends on the pressure"),
    ],
)
def test_laws_that_are_not_convex_have_no_bound_and_the_words_say_why(contact: hv.Contact, words: str) -> None:
    problem = wide_block(contact)
    found = exact_distance(problem, hv.solve(problem).displacement, UNKNOWN)
    assert not np.isfinite(found.distance)
    assert re.search(words, "; ".join(found.reasons)), found.reasons


def test_loads_that_contact_cannot_balance_leave_no_bound() -> None:
    """Without friction a body that is pushed along the plane is in no equilibrium."""
    problem = wide_block(hv.Contact(hv.Compliance(500.0)), side=2e-4)
    found = exact_distance(problem, np.full(problem.mesh.points.shape, -1e-3), UNKNOWN)
    assert not np.isfinite(found.distance)
    assert any("no tractions that the law allows balance the loads" in reason for reason in found.reasons)


def graded_mesh(mesh: hv.Mesh) -> hv.Mesh:
    """Cells up to 800 times as long as wide."""
    size = mesh.points.max(axis=0)
    return hv.Mesh(size * (mesh.points / size) ** 3, mesh.cells, dict(mesh.boundaries))


def loose_bodies() -> dict[str, hv.ContactProblem]:
    """Held by contact alone: on meshes that were refined, and on some without a coarser one."""
    stuck = {"bottom": hv.Contact(hv.Compliance(50.0), hv.Tresca(0.3))}
    material = hv.Material.young(1e3, 0.3)
    coarse, plain = hv.rectangle((2.0, 1.0), (4, 2)), hv.rectangle((2.0, 1.0), (24, 12))
    high = plain.points[plain.cells].mean(axis=1)[:, 1] > 0.5
    halves = plain.named(plain.boundaries, {"upper": np.flatnonzero(high), "lower": np.flatnonzero(~high)})
    touching = stuck | {"joint:upper": hv.Contact(hv.Compliance(50.0), hv.Tresca(0.3), against="joint:lower")}
    return {
        "refined": hv.ContactProblem(coarse.refined(3), material, stuck),
        "quadratic": hv.ContactProblem(coarse.refined(2), material, stuck, order=2),
        "graded": hv.ContactProblem(graded_mesh(hv.rectangle((2.0, 1.0), (28, 14))), material, stuck),
        "space": hv.ContactProblem(hv.box((1.0, 1.0, 1.0), 3).refined(1), material, stuck),
        "touching": hv.ContactProblem(halves.opened("joint", ("upper", "lower")), material, touching),
    }


def balanced(problem: hv.ContactProblem) -> tuple[BareStiffness, Array, Array]:
    """A body, its stiffness, and forces (nodes, d) that are balanced."""
    K = stiffness_matrix(problem.mesh, problem.material, problem.order).toarray()
    shape = len(problem.mesh.nodes(problem.order)), problem.mesh.dim
    body = BareStiffness(body_data(problem, np.zeros(shape)))
    return body, K, (K @ np.random.default_rng(3).normal(size=len(K))).reshape(shape)


@pytest.mark.parametrize("name", list(loose_bodies()))
def test_balanced_forces_are_solved_with_to_rounding(name: str) -> None:
    """Against the least squares solution of dense linear algebra."""
    body, K, force = balanced(loose_bodies()[name])
    w = body.solve(force)
    assert np.linalg.norm(K @ w.ravel() - force.ravel()) <= 1e-12 * np.linalg.norm(force)
    best = np.linalg.lstsq(K, force.ravel(), rcond=1e-13)[0]
    assert np.sum(w * force) == pytest.approx(best @ force.ravel(), rel=1e-9)


def test_too_few_cycles_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    body, _, force = balanced(loose_bodies()["refined"])
    monkeypatch.setattr(convex_distance, "_CYCLES", 2)
    with pytest.raises(MethodError, match=r"2 cycles of multigrid .* of the forces; state the body with cells of"):
        body.solve(force)


def poor_by_constants() -> tuple[hv.ContactProblem, Array, TraceBounds]:
    """Held, and pressed onto springs so stiff that the contact part by constants is most of the bound."""
    contact = hv.Contact(hv.Compliance(1e5), hv.Tresca(0.3))
    problem = wide_block(contact, supports={"top": hv.Prescribed((1e-3, -1e-3))}, tractions={})
    return problem, hv.solve(problem).displacement, TraceBounds(1e-2, 1e-2, 1e-2, 1.0, True, "for this test")


@pytest.mark.parametrize("error", [MethodError, MemoryError, OutOfTime, np.linalg.LinAlgError, ZeroDivisionError])
def test_a_bound_in_hand_outlives_an_attempt_that_fails(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, u, constants = poor_by_constants()
    better = exact_distance(problem, u, constants)

    def fails(*_: object) -> None:
        raise error

    monkeypatch.setattr(import_module(exact_distance.__module__), "_without_constants", fails)
    found = exact_distance(problem, u, constants)
    assert found.guaranteed, found.reasons
    assert better.guaranteed, better.reasons
    assert better.distance < found.distance < np.inf


def test_a_bound_is_not_given_for_an_estimate(monkeypatch: pytest.MonkeyPatch) -> None:
    problem, u, constants = poor_by_constants()
    better = exact_distance(problem, u, constants)
    for worse in (replace(better, guaranteed=False, reasons=("doubts",)), replace(better, distance=np.nan)):
        module = import_module(exact_distance.__module__)
        monkeypatch.setattr(module, "_without_constants", lambda *_, one=worse: one)
        found = exact_distance(problem, u, constants)
        assert found.guaranteed
        assert better.distance < found.distance < np.inf


@pytest.mark.parametrize("dim", [2, 3])
def test_bodies_held_by_contact_ask_for_no_factorisation(dim: int, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = hv.rectangle((2.0, 1.0), (4, 2)).refined(3) if dim == 2 else hv.box((1.0, 1.0, 1.0), 2).refined(2)
    contact = {"bottom": hv.Contact(hv.Compliance(500.0), hv.Tresca(0.3))}
    load = {"top": (0.1,) + (0.0,) * (dim - 2) + (-1.0,)}
    problem = hv.ContactProblem(mesh, hv.Material.young(1e3, 0.3), contact, {}, tractions=load)
    u = hv.solve(problem).raise_for_status().displacement

    def refused(*_: object, **__: object) -> None:
        raise AssertionError("a factorisation")

    monkeypatch.setattr("scipy.sparse.linalg.splu", refused)
    found = exact_distance(problem, u, UNKNOWN)
    assert found.guaranteed
    assert found.parts.algebraic < 1e-9 * found.distance
