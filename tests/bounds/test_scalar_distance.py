"""The distance to the exact solution of one component: never below the true error, by closed forms and fine meshes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.linalg as la
from scipy.optimize import brentq

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.bounds.scalar_distance import _Means, _shares, scalar_distance, scalar_trace_bound
from hemivar.bounds.stated_distance import DistanceToExact
from hemivar.fem import gradient
from hemivar.fem.quadrature import quadrature_rule
from hemivar.formula import Formula
from hemivar.laws import Superpotential
from hemivar.laws.friction.friction_law import Friction
from hemivar.mechanics import ScalarContact
from hemivar.mechanics.foundation import Side
from hemivar.mechanics.material_words import ScalarKind
from hemivar.mesh import Mesh
from hemivar.solvers import Solution
from hemivar.workflows.study import study
from tests.samples import sampled


def energy(problem: hv.ContactProblem, u: Array) -> float:
    """``|u|_a`` of nodal values (nodes,)."""
    slope, flux = gradient(problem, u[:, None])
    between = u[problem.mesh.cells] @ quadrature_rule(2, 4)[0].T
    bedding = float(problem.bedding) * (between**2 @ quadrature_rule(2, 4)[1])  # type: ignore[arg-type]
    return math.sqrt(float(problem.mesh.volumes @ ((slope * flux).sum(axis=1) + bedding)))


def interpolated(coarse: Mesh, fine: Mesh, u: Array) -> Array:
    """Values at the nodes of a mesh that was refined from another one."""
    chain = [fine]
    while chain[-1].points is not coarse.points:
        assert chain[-1].parent is not None
        chain.append(chain[-1].parent.mesh)
    values = u
    for mesh in chain[-2::-1]:
        assert mesh.parent is not None
        below = mesh.parent.mesh
        tree = {tuple(np.round(x, 9)): k for k, x in enumerate(mesh.points.tolist())}
        out = np.full(len(mesh.points), np.nan)
        for ends, value in (
            (below.points, values),
            (below.points[below.edges].mean(axis=1), values[below.edges].mean(axis=1)),
        ):
            at = [tree[tuple(np.round(x, 9))] for x in ends.tolist()]
            out[at] = value
        assert np.isfinite(out).all()
        values = out
    return values


CONVEX: list[Any] = [
    lambda r, s: hv.Signorini(),
    lambda r, s: hv.Compliance(float(r.uniform(0.5, 20.0)) * s),
    lambda r, s: hv.Tresca(float(r.uniform(0.05, 0.6)) * s),
    lambda r, s: hv.laws.FinitePenetration(float(r.uniform(0.5, 5.0)) * s, float(r.uniform(0.05, 0.3))),
]
SOFT: list[Any] = [
    lambda r, s: hv.laws.Softening(2.0 * s, float(r.uniform(0.02, 0.1)), float(r.uniform(0.05, 0.3)) * s),
    lambda r, s: hv.laws.SlipWeakening(float(r.uniform(0.1, 0.4)) * s, kinetic=0.6, rate=float(r.uniform(0.2, 1.0))),
]


def drawn(seed: int, laws: list[Any]) -> hv.ContactProblem:
    """A problem with a jittered mesh, two anisotropic materials, loads, and contact below, over a region, or both."""
    rng = np.random.default_rng(seed)
    n = (int(rng.integers(4, 8)), int(rng.integers(3, 6)))
    plain = hv.rectangle((float(rng.uniform(0.7, 2.0)), 1.0), n, pattern=("right", "left", "cross")[seed % 3])
    x = plain.points.copy()
    inner = np.setdiff1d(np.arange(len(x)), plain.boundary_facets)
    x[inner] += rng.uniform(-0.12, 0.12, (len(inner), 2)) / max(n)
    middle = x[plain.cells].mean(axis=1)
    upper = middle[:, 1] > 0.55
    low = (x[plain.cells][..., 1] < 1e-9).any(axis=1)
    regions = {"upper": np.flatnonzero(upper), "lower": np.flatnonzero(~upper)}
    regions["patch"] = np.flatnonzero(~low & (middle[:, 0] > 0.2))
    mesh = Mesh(x, plain.cells, plain.boundaries, {name: regions[name] for name in ("upper", "lower", "patch")})

    def tensor() -> Array:
        root = rng.uniform(-0.5, 0.5, (2, 2)) + np.eye(2)
        return np.asarray(root @ root.T)

    def contact(law: Superpotential | Friction) -> hv.mechanics.Contact:
        side = Side.BELOW if rng.random() < 0.5 else Side.ABOVE
        sign = 1.0 if side is Side.ABOVE else -1.0
        level = sign * float(rng.uniform(0.0, 0.15)) if not isinstance(law, Friction) else float(rng.uniform(-0.1, 0.1))
        return ScalarContact(law, level, side)

    where = ("bottom", "patch", "both")[seed % 3]
    chosen = {
        name: contact(laws[int(rng.integers(len(laws)))](rng, 1.0))
        for name in ("bottom", "patch")
        if where in (name, "both")
    }
    supports = {"left": 0.0}
    if rng.random() < 0.4:
        supports["right"] = 0.0
    return hv.ContactProblem(
        mesh, hv.Material.gradient({"upper": tensor(), "lower": tensor()}, ScalarKind.MEMBRANE), chosen, supports,
        body_force=float(rng.uniform(-3.0, 3.0)), tractions={"top": float(rng.uniform(-1.0, 1.0))},
        bedding=float(rng.uniform(0.0, 5.0)) if rng.random() < 0.4 else 0.0,
    )  # fmt: skip


def against_fine(problem: hv.ContactProblem, times: int = 3) -> tuple[DistanceToExact, float]:
    """The bound, and the distance to the solution on a mesh that is refined so often: just below the error."""
    solution = hv.solve(problem).raise_for_status()
    found = scalar_distance(problem, solution.displacement)
    fine = problem.on(problem.mesh.refined(times))
    reference = hv.solve(fine).raise_for_status().displacement[:, 0]
    return found, energy(fine, reference - interpolated(problem.mesh, fine.mesh, solution.displacement[:, 0]))


@pytest.mark.parametrize("seed", sampled(range(36), 3))
def test_convex_laws_on_random_bodies(seed: int) -> None:
    found, error = against_fine(drawn(seed, CONVEX))
    assert found.guaranteed
    assert found.unique
    assert found.constant == 0.0
    assert error <= found.bound <= 3.0 * error


@pytest.mark.parametrize("seed", sampled(range(100, 112), 3))
def test_laws_that_soften_on_random_bodies(seed: int) -> None:
    found, error = against_fine(drawn(seed, SOFT))
    assert found.constant > 0.0
    assert found.bound < np.inf
    assert error <= found.bound <= 2.6 * error / (1.0 - found.constant)


def strip(
    contact: dict[str, Any], length: float = 1.0, work: float = 1.0, n: int = 6, **changes: Any
) -> hv.ContactProblem:
    """A strip, 2 by 1, held on the left: its field varies along it. ``length`` and ``work`` are units of both."""
    mesh = hv.rectangle((2.0 / length, 1.0 / length), (2 * n, n), pattern="cross")
    made = hv.ContactProblem(
        mesh,
        hv.Material.gradient(3.0 / work, ScalarKind.ANTIPLANE),
        contact,
        {"left": 0.0},
        body_force=1.5 * length / work,
    )
    return replace(made, **changes)


def error_along(solution: Solution, slope: Any) -> float:
    """``|u - u_h|_a`` for an exact gradient that has the first component alone."""
    problem = solution.problem.origin
    assert problem is not None
    found, _ = gradient(problem, solution.displacement)
    total, mesh = 0.0, problem.mesh
    for point, weight in zip(*quadrature_rule(mesh.dim, 4), strict=True):
        off = found.copy()
        off[:, 0] -= slope((point @ mesh.points[mesh.cells])[:, 0])
        total += weight * float(mesh.volumes @ (off**2).sum(axis=1))
    return math.sqrt(float(problem.material.stiffness_tensor(mesh.points[:1])[0, 0, 0]) * total)


@pytest.mark.parametrize(
    ("law", "force"),
    [
        (hv.Compliance(2.0), lambda r: 2.0 * max(r, 0.0)),
        (hv.Tresca(0.7), lambda r: 0.7 * np.sign(r)),
        (hv.laws.Softening(0.8, 0.3, 0.2), lambda r: 0.8 * r if r < 0.3 else max(0.24 - 0.2 * (r - 0.3), 0.0)),
    ],
)
@pytest.mark.parametrize("n", [2, 6, 12])
def test_contact_at_the_end_of_a_strip(law: Any, force: Any, n: int) -> None:
    """A u'' = -f, u(0) = 0 and A u'(L) = -lambda(u(L) - level): the slope is a - f x / A."""
    level = 0.0 if isinstance(law, Friction) else 0.2
    solution = hv.solve(strip({"right": ScalarContact(law, level)}, n=n)).raise_for_status()
    a = brentq(lambda a: 3.0 * a - 3.0 + force(2.0 * a - 1.0 - level), 0.0, 3.0, xtol=1e-15)
    error = error_along(solution, lambda x: a - 0.5 * x)
    found = solution.certify(exact=True).exact
    assert found is not None
    assert found.guaranteed
    assert error * (1.0 - 1e-9) <= found.bound <= 1.8 * error / (1.0 - found.constant)
    assert (found.constant > 0.0) is isinstance(law, hv.laws.Softening)


@pytest.mark.parametrize("n", [4, 8, 16])
def test_friction_over_an_area(n: int) -> None:
    """It slides over the length P / g from the end that is pulled by P: A u'' = g there, and u = 0 elsewhere."""
    g, P = 1.0, 1.3
    problem = strip({"area": ScalarContact(hv.Tresca(g))}, n=n, body_force=0.0, tractions={"right": P})
    solution = hv.solve(problem).raise_for_status()
    error = error_along(solution, lambda x: g / 3.0 * np.maximum(x - (2.0 - P / g), 0.0))
    found = scalar_distance(problem, solution.displacement)
    assert found.guaranteed
    assert error <= found.bound <= 2.5 * error


def test_a_field_that_misses_a_support_is_moved_there_and_the_move_counts() -> None:
    """The exact field rises evenly, by a little more than none, and has the energy of that."""
    miss, coefficient, mesh = 9e-9, 3.0, hv.rectangle((1.0, 1.0), 2)
    membrane = hv.Material.gradient(coefficient, ScalarKind.MEMBRANE)
    problem = hv.ContactProblem(mesh, membrane, {}, {"left": 1.0, "right": 1.0 + miss})
    found = scalar_distance(problem, np.ones((9, 1)))
    assert found.guaranteed, found.reasons
    least = miss * math.sqrt(coefficient)
    assert least <= found.bound <= 4.0 * least
    assert found.correction >= least


def test_a_field_need_not_be_a_solution() -> None:
    """Any field with the prescribed values is bounded; one that misses them is refused."""
    problem = strip({"right": ScalarContact(hv.Compliance(2.0), 0.2)})
    u = hv.solve(problem).raise_for_status().displacement
    bent = u + 0.1 * np.sin(3.0 * problem.mesh.points[:, :1]) * problem.mesh.points[:, 1:]
    apart = energy(problem, (bent - u)[:, 0])
    here, there = scalar_distance(problem, u), scalar_distance(problem, bent)
    assert apart - here.bound <= there.bound <= 1.5 * (apart + here.bound)
    with pytest.raises(hv.errors.ProblemError, match="differs from the prescribed one"):
        scalar_distance(problem, u + 1.0)


@pytest.mark.parametrize("law", [hv.laws.Softening(0.8, 0.3, 0.2), hv.Signorini()])
def test_units_do_not_matter(law: Any) -> None:
    """m and Pa against mm and MPa: an antiplane shear."""
    s, w = 1e-3, 1e6
    plain = strip({"right": ScalarContact(law, 0.2)})
    if isinstance(law, hv.laws.Softening):
        law = hv.laws.Softening(0.8 * s / w, 0.3 / s, 0.2 * s / w)
    other = strip({"right": ScalarContact(law, 0.2 / s)}, s, w)
    first, second = (scalar_distance(one, hv.solve(one).raise_for_status().displacement) for one in (plain, other))
    assert second.relative == pytest.approx(first.relative, rel=1e-9)
    assert second.constant == pytest.approx(first.constant, rel=1e-6, abs=1e-12)


def test_known_problems_have_estimates() -> None:
    """Values that are functions make estimates, which hold too."""
    for known in (gallery.membrane_obstacle(16), gallery.antiplane_friction(16)):
        solution = hv.solve(known.problem).raise_for_status()
        mesh, (found, _) = known.problem.mesh, gradient(known.problem, solution.displacement)
        square = 0.0
        for point, weight in zip(*quadrature_rule(2, 6), strict=True):
            exact = known.gradient(point @ mesh.points[mesh.cells])
            square += weight * float(mesh.volumes @ ((found - exact) ** 2).sum(axis=1))
        error = math.sqrt(float(known.problem.material.stiffness_tensor(mesh.points[:1])[0, 0, 0]) * square)
        said = solution.certify(exact=True).exact
        assert said is not None
        assert not said.guaranteed
        assert "prescribed values are functions, which the mesh interpolates" in said.reasons
        assert error <= said.bound <= 2.0 * error


def test_heat_in_space() -> None:
    """A bar that is warm at one end and gives off heat at the other: u = 1 + a x - f x^2/6 and 3 u'(2) = -2 u(2)."""
    mesh = hv.box((2.0, 1.0, 1.0), (4, 2, 2))
    for f in (0.0, 1.0):
        problem = hv.ContactProblem(
            mesh, hv.Material.gradient(3.0, ScalarKind.HEAT), {"right": ScalarContact(hv.Compliance(2.0))},
            {"left": 1.0}, body_force=f,
        )  # fmt: skip
        solution = hv.solve(problem).raise_for_status()
        a = (2.0 * f - 2.0 * (1.0 - 2.0 * f / 3.0)) / 7.0
        error = error_along(solution, lambda x, a=a, f=f: a - f * x / 3.0)
        found = scalar_distance(problem, solution.displacement)
        assert found.guaranteed
        assert error <= found.bound + 1e-12
        assert found.bound <= 2.0 * error + 1e-7


def test_trace_constants() -> None:
    """Of a square that is held on the left: sup |v| / |grad v| is 1 on the right, and 2 / pi over it."""
    mesh = hv.rectangle((1.0, 1.0), 4)
    for name, exact in (("right", 1.0), ("area", 2.0 / math.pi)):
        problem = hv.ContactProblem(
            mesh, hv.Material.gradient(5.0, ScalarKind.MEMBRANE), {name: ScalarContact(hv.Signorini())}, {"left": 0.0}
        )
        assert exact <= scalar_trace_bound(problem) <= 1.05 * exact
    soft = strip({"right": ScalarContact(hv.laws.Softening(0.8, 0.3, 0.2), 0.2)})
    said = hv.solve(soft).certify().smallness
    assert said.trace_bound is not None
    assert said.trace_constant is not None
    assert said.trace_constant * (1.0 - 1e-7) <= math.sqrt(2.0) <= said.trace_bound <= 1.05 * math.sqrt(2.0)
    assert said.survey_condition


def test_a_foundation_that_softens_too_much_has_no_bound() -> None:
    for law, words in (
        (hv.laws.Softening(8.0, 0.3, 4.0), "softens too much for the body"),
        (hv.laws.Capped(1.0, 5.0), "drops discontinuously"),
    ):
        solution = hv.solve(strip({"right": ScalarContact(law, 0.2)}))
        found = solution.certify(exact=True).exact
        assert found is not None
        assert not found.known
        assert words in found.why


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"order": 2}, "linear elements"),
        ({"supports": {}}, "a part of the body has no support"),
        ({"material": hv.Material.gradient(lambda x: 1.0 + x[:, 0], ScalarKind.ANTIPLANE)}, "varies inside cells"),
    ],
)
def test_what_has_no_bound(changes: dict[str, Any], words: str) -> None:
    problem = strip({"right": ScalarContact(hv.Compliance(2.0))}, **changes)
    with pytest.raises(hv.errors.ProblemError, match=words):
        scalar_distance(problem, np.zeros((len(problem.mesh.nodes(problem.order)), 1)))


def test_a_study_bounds_errors() -> None:
    problem = strip({"right": ScalarContact(hv.Compliance(2.0), 0.2)}, n=2)
    found = study(problem, exact=True, refine=2)
    first, second, third = (level.bound for level in found.levels)
    assert first is not None
    assert second is not None
    assert third is not None
    assert first > 1.8 * second > 1.8**2 * third


# ---- the parts of the bound -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_the_flux_is_the_best_of_its_degree(seed: int) -> None:
    """The misfit is the least that a saddle-point solve finds over all fluxes of Raviart and Thomas in balance."""
    problem = replace(drawn(seed, CONVEX), contact={}, bedding=0.0)
    u = hv.solve(problem).raise_for_status().displacement
    means = _Means.of(problem)
    table, A = means.table, means.coefficient
    corners, volumes = problem.mesh.points[table.cells], table.volumes
    facets, cells, own = len(table.facets), len(volumes), table.cell_facets
    energies, slopes, balance = np.zeros((facets, facets)), np.zeros(facets), np.zeros((cells, facets))
    rows = np.arange(cells)[:, None]
    for point, weight in zip(*quadrature_rule(2, 2), strict=True):
        field = table.signs[:, :, None] * (point @ corners)[:, None] - table.signs[:, :, None] * corners
        field /= 2.0 * volumes[:, None, None]  # a flux of one through each facet
        weighed = np.einsum("mij,maj->mai", np.linalg.inv(A), field) * (weight * volumes)[:, None, None]
        np.add.at(energies, (own[:, :, None], own[:, None]), np.einsum("mai,mbi->mab", field, weighed))
        np.add.at(slopes, own, np.einsum("mai,mi->ma", field, gradient(problem, u)[0]) * (weight * volumes)[:, None])
    balance[rows, own] = table.signs
    given = np.zeros(facets)
    top = table.numbers(problem.mesh.boundaries["top"])
    given[top] = float(problem.tractions["top"]) * table.measures[top]  # type: ignore[arg-type]
    fixed = ~table.interior & ~means.held
    loose, n = np.flatnonzero(~fixed), int((~fixed).sum())
    system = np.block(
        [[energies[np.ix_(loose, loose)], balance[:, loose].T], [balance[:, loose], np.zeros((cells, cells))]]
    )
    right = np.append((slopes - energies @ given)[loose], -float(problem.body_force) * volumes - balance @ given)  # type: ignore[arg-type]
    given[loose] = np.linalg.lstsq(system, right, rcond=None)[0][:n]
    least = given @ energies @ given - 2.0 * slopes @ given + energy(problem, u[:, 0]) ** 2
    assert scalar_distance(problem, u).misfit == pytest.approx(math.sqrt(least), rel=1e-7)


@pytest.mark.parametrize("seed", [1, 3, 5, 20, 22, 26])
def test_the_bound_is_made_of_its_parts(seed: int) -> None:
    """``(1 - c) B^2 = eta B + G``, where eta is at least the misfit, and at most the sum of all parts."""
    problem = drawn(seed, SOFT if seed % 2 else CONVEX)
    found = scalar_distance(problem, hv.solve(problem).raise_for_status().displacement)
    assert found.gap > 0.0 or seed % 2
    B = found.bound
    whole = found.misfit + found.contact + found.oscillation
    least, most = (part * B + found.gap for part in (found.misfit, whole))
    assert least * (1.0 - 1e-9) <= (1.0 - found.constant) * B**2 <= most * (1.0 + 1e-9)


@pytest.mark.parametrize("p", [1, 2])
def test_linear_functions_by_their_values(p: int) -> None:
    """Means over simplices of a law at a linear function: against many points."""
    rng = np.random.default_rng(p)
    law = hv.laws.ContactLaw(hv.laws.Softening(2.0, 0.3, 0.7)).at(np.zeros((6, 2)))
    r = np.sort(rng.uniform(-0.5, 1.0, (6, p + 1, 1)), axis=1)
    r[0], r[1, 1:] = 0.4, r[1, -1:]
    t, share = _shares(law, r)
    at = r[:, :1, 0] + t * (r[:, -1:, 0] - r[:, :1, 0])
    np.testing.assert_allclose(share.sum(axis=1), 1.0)
    np.testing.assert_allclose((share * at).sum(axis=1), r[..., 0].mean(axis=1))
    fine = 400
    if p == 1:
        x = (np.arange(fine) + 0.5) / fine
        points = np.column_stack([1.0 - x, x])
    else:
        i, j = np.meshgrid(np.arange(fine), np.arange(fine), indexing="ij")
        up, down = i + j < fine, i + j < fine - 1
        parts = [np.column_stack([i[up], j[up]]) + 1.0 / 3.0, np.column_stack([i[down], j[down]]) + 2.0 / 3.0]
        x = np.concatenate(parts) / fine
        points = np.column_stack([1.0 - x.sum(axis=1), x])

    def pressure(values: Array) -> Array:
        return hv.laws.Softening(2.0, 0.3, 0.7).derivative(values)

    wanted = pressure((r[..., 0] @ points.T).ravel()).reshape(6, -1).mean(axis=1)
    np.testing.assert_allclose((share * pressure(at.ravel()).reshape(at.shape)).sum(axis=1), wanted, atol=2e-4)


def polynomials(points: Array) -> tuple[Array, Array]:
    """Values (q, 14) and gradients (q, 14, 2) of the monomials of degree 1 to 4."""
    powers = [(i, n - i) for n in range(1, 5) for i in range(n + 1)]
    x, y = points.T
    values = np.stack([x**i * y**j for i, j in powers], axis=1)
    across = np.stack([i * x ** max(i - 1, 0) * y**j for i, j in powers], axis=1)
    up = np.stack([j * x**i * y ** max(j - 1, 0) for i, j in powers], axis=1)
    return values, np.stack([across, up], axis=2)


@pytest.mark.parametrize("seed", range(8))
def test_constants_of_cells(seed: int) -> None:
    """No polynomial of degree 4 works more against oscillating loads, and none has more beside its means on facets."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(0.0, 1.0, (3, 2)) * [1.0, (1.0, 0.2)[seed % 2]]
    mesh = Mesh.oriented(corners, np.array([[0, 1, 2]]), {"one": [[0, 1]], "other": [[1, 2]]})
    problem = hv.ContactProblem(mesh, hv.Material.gradient(2.5, ScalarKind.MEMBRANE), supports={"one": 0.0})
    means = _Means.of(problem)
    corner, weight = mesh.points[means.table.cells[0]], quadrature_rule(2, 8)[1] * mesh.volumes[0]
    values, slope = polynomials(quadrature_rule(2, 8)[0] @ corner)
    stiff = 2.5 * np.einsum("q,qai,qbi->ab", weight, slope, slope)

    def most(mass: Array, within: Array | None = None) -> float:
        basis = np.eye(len(mass)) if within is None else la.null_space(within)
        return float(la.eigh(basis.T @ mass @ basis, basis.T @ stiff @ basis, eigvals_only=True)[-1])

    mean = weight @ values / weight.sum()
    inside = np.einsum("q,qa,qb->ab", weight, values - mean, values - mean)
    assert most(inside) <= means.diameter[0] ** 2 / math.pi**2 / means.least[0]
    on_facets, at_facets = [], []
    for facet in means.table.cell_facets[0]:
        point, share = quadrature_rule(1, 9)
        there = polynomials(point @ mesh.points[means.table.facets[facet]])[0]
        on_facets.append((there, share * means.table.measures[facet]))
        at_facets.append(share @ there)
        off = there - mean
        assert most(np.einsum("q,qa,qb->ab", on_facets[-1][1], off, off)) <= means.kappa(np.array([facet]))[0] ** 2
    # against a constant too: fields without means on the facets
    with_one = [np.column_stack([np.ones(len(part)), part]) for part, _ in on_facets]
    c = math.sqrt((means.diameter[0] / math.pi) ** 2 + np.trace(means.spread[0]) / 4.0)
    stiff = la.block_diag(np.zeros((1, 1)), stiff)
    zero = np.stack([np.append(1.0, part) for part in at_facets])
    whole = np.column_stack([np.ones(len(values)), values])
    assert most(np.einsum("q,qa,qb->ab", weight, whole, whole), zero) <= c**2 / 2.5
    for (_, share), part, facet in zip(on_facets, with_one, means.table.cell_facets[0], strict=True):
        square = means.table.measures[facet] / mesh.volumes[0] * (c**2 + means.diameter[0] * c) / 2.5
        assert most(np.einsum("q,qa,qb->ab", share, part, part), zero) <= square


def test_loads_that_elements_do_not_see() -> None:
    """A flux without mean on facets, and a source without mean on cells: errors of loads alone are in the bound."""
    mesh = hv.rectangle((1.0, 1.0), 1)
    plain = hv.ContactProblem(mesh, hv.Material.gradient(1.0, ScalarKind.MEMBRANE), {}, {"left": 0.0})
    for problem in (
        replace(plain, tractions={"right": Formula("y - 1/2")}),
        replace(plain, body_force=Formula("abs(x - y) - 1/3")),
    ):
        u = np.zeros((problem.mesh.number_of_nodes, 1))
        found = scalar_distance(problem, u)
        fine = problem.on(problem.mesh.refined(4))
        error = energy(fine, hv.solve(fine).raise_for_status().displacement[:, 0])
        assert found.misfit < 0.01 * error
        assert found.bound >= error
        assert not found.guaranteed


def test_the_constant_holds_on_two_cells() -> None:
    """Of 0.3 by 1, held but on the right: v = sin(pi x / 0.6) sin(pi y). Elements alone have 0.83 of it."""
    mesh = hv.rectangle((0.3, 1.0), 1)
    supports = dict.fromkeys(("left", "top", "bottom"), 0.0)
    means = _Means.of(hv.ContactProblem(mesh, hv.Material.gradient(1.0, ScalarKind.MEMBRANE), {}, supports))
    exact = 1.0 / (math.pi**2 + (math.pi / 0.6) ** 2)
    assert means.largest(np.zeros(len(means.table.facets)), np.ones(2)) >= exact
    right = np.zeros(len(means.table.facets))
    right[means.table.numbers(mesh.boundaries["right"])] = 1.0
    assert means.largest(right, np.zeros(2)) >= math.tanh(0.3 * math.pi) / math.pi
