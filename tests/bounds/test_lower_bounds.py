"""Lower bounds of the trace constants: below what conforming elements find, and close to it."""

from __future__ import annotations

import math
import sys

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds.facet_constants import (
    _children,
    _one_cell,
    _shape_key,
    _without_linear_part,
    facet_constants,
    mass_root,
)
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.lower_bounds import LowerBounds, TraceFlexibility, _answers, _lehmann, lower_bounds
from hemivar.bounds.trace_bounds import body_bound
from hemivar.errors import ProblemError
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mesh import Mesh, box, rectangle
from tests.samples import slow

LAME = hv.Material.lame(4.0, 4.0)
FREE = hv.Contact(hv.laws.NoContact())


def held(mesh: Mesh, material: hv.Material = LAME, **changes: object) -> hv.ContactProblem:
    given = {
        "mesh": mesh,
        "material": material,
        "supports": {"left": hv.Clamped()},
        "contact": {"bottom": FREE},
        **changes,
    }
    return hv.ContactProblem(**given)  # type: ignore[arg-type]


def conforming(problem: hv.ContactProblem) -> float:
    """The least eigenvalue with quadratic elements, which is above Lambda: dense, by itself."""
    from dataclasses import replace

    discrete = hv.discretize(replace(problem, order=2), check_coercivity=False)
    field = discrete.field
    assert field is not None
    mesh = problem.mesh
    facets = mesh.facet_nodes(mesh.boundaries["bottom"], 2)
    lengths = mesh.facet_normals(mesh.boundaries["bottom"])[1]
    local = np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]) / 30.0
    blocks = lengths[:, None, None] * local
    row, column = np.broadcast_arrays(facets[:, :, None], facets[:, None, :])
    count = len(mesh.nodes(2))
    mass = sp.coo_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=(count, count))
    full = sp.kron(sp.csr_array(mass), sp.eye_array(2))
    M = (field.basis.T @ full @ field.basis).toarray()
    return float(1.0 / la.eigh(M, discrete.stiffness.toarray(), eigvals_only=True)[-1])


@pytest.fixture(scope="module")
def square() -> LowerBounds:
    return lower_bounds(held(rectangle((1.0, 1.0), (4, 4))))


#: Limits of the discrete constants of docs/theory/certificates.md, a third of the last step beyond n = 128.
LIMITS = {1.0: (2.9285, 4.1443, 5.2192), 2.0: (0.42888, 0.51576, 1.56918)}


@pytest.mark.parametrize("length", [1.0, 2.0])
def test_the_bodies_of_the_table(length: float) -> None:
    """Within one per cent below what conforming elements tend to, and the range holds it."""
    found = lower_bounds(held(rectangle((length, 1.0), (int(4 * length), 4))))
    for bound, limit in zip((found.both, found.normal, found.tangential), LIMITS[length], strict=True):
        assert 0.99 * limit < bound.lower < limit * 1.0002
        assert limit * 0.9998 < bound.upper < 1.01 * limit
        assert bound.simple <= bound.lower
    # the norm of the whole is the sum of those of the parts
    assert found.both.lower <= min(found.normal.upper, found.tangential.upper)
    assert 1.0 / found.both.upper <= 1.0 / found.normal.lower + 1.0 / found.tangential.lower


def between_rollers(dim: int) -> hv.ContactProblem:
    """Between rollers, clamped on top: pressed evenly it answers by ``(lam + 2 mu) / height``, and otherwise harder."""
    mesh = rectangle((0.5, 1.0), (2, 4)) if dim == 2 else box((0.5, 0.5, 1.0), (4, 4, 4))
    sides = ("left", "right") if dim == 2 else ("left", "right", "front", "back")
    supports = {**dict.fromkeys(sides, hv.Roller()), "top": hv.Clamped()}
    return held(mesh, hv.Material.lame(0.0, 1.0), supports=supports)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_strip_between_rollers(dim: int) -> None:
    """Closed form: Lambda = 2; its mode is linear, so that in the plane nothing but rounding is lost."""
    found = lower_bounds(between_rollers(dim), 200)
    for bound in (found.both, found.normal):
        assert bound.lower > (2.0 * (1.0 - 1e-4) if dim == 2 else 0.5)
        assert bound.lower <= 2.0 * (1.0 + 1e-9)
        assert bound.upper >= 2.0 * (1.0 - 1e-9)
    assert found.tangential.upper > 2.0


@pytest.mark.parametrize("dim", [2, 3])
def test_the_body_of_a_strip(dim: int) -> None:
    """Closed form: 2 (pi / 2)^2 for motions along it; the bound is rough, and below."""
    assert (0.3 if dim == 2 else 0.02) * 0.5 * np.pi**2 < body_bound(between_rollers(dim)) < 0.5 * np.pi**2


def test_weights(square: LowerBounds) -> None:
    """Constant ones give the constants; others are above what quadratic elements attain, and near it."""
    corners = rectangle((1.0, 1.0), (8, 8))
    facets = corners.points[corners.boundaries["bottom"]]
    middle = facets[:, :, 0].mean(axis=1)
    ones, none = np.ones(8), np.zeros(8)
    assert square.weighted(facets, 3.0 * ones, 3.0 * ones)[0] == pytest.approx(3.0 / square.both.lower)
    assert square.weighted(facets, ones, none)[0] == pytest.approx(1.0 / square.normal.lower)
    assert square.weighted(facets, none, none)[0] == 0.0
    for normal, tangential in ((middle > 0.5, middle < 0.5), (middle < 0.25, 2.0 * (middle < 0.75)), (middle, middle)):
        value = weighted_value(facets, normal * ones, tangential * ones)
        found = square.weighted(facets, normal * ones, tangential * ones)[0]
        assert value < found < 1.2 * value
    aligned = middle > 0.5
    assert square.weighted(facets, ones * aligned, none)[0] < 1.01 * weighted_value(facets, ones * aligned, none)


def weighted_value(facets: Array, normal: Array, tangential: Array) -> float:
    """c with quadratic elements, facet by facet."""
    mesh = rectangle((1.0, 1.0), (8, 8))
    discrete = hv.discretize(held(mesh, order=2), check_coercivity=False)
    field = discrete.field
    assert field is not None
    nodes = mesh.facet_nodes(mesh.boundaries["bottom"], 2)
    local = np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]) / 30.0 / 8.0
    M = np.zeros((len(mesh.nodes(2)), 2, len(mesh.nodes(2)), 2))
    for facet, across, along in zip(nodes, tangential, normal, strict=True):
        for component, weight in enumerate((across, along)):
            M[np.ix_(facet, [component], facet, [component])] += (weight * local)[:, None, :, None]
    full = M.reshape(field.basis.shape[0], -1)
    return float(la.eigvalsh(field.basis.T @ full @ field.basis, discrete.stiffness.toarray())[-1])


def test_a_workspace_keeps_them_for_refined_meshes_and_other_laws() -> None:
    kept = hv.systems.Workspace()
    first = held(rectangle((1.0, 1.0), (4, 4)))
    found = lower_bounds(first, workspace=kept)
    finer = held(first.mesh.refined_where([0, 5]), contact={"bottom": hv.Contact(hv.Compliance(5.0))})
    assert lower_bounds(finer, workspace=kept) is found
    anew = held(rectangle((1.0, 1.0), (4, 4)), hv.Material.lame(4.0, 4.0), body_force=(1.0, 0.0))
    assert lower_bounds(anew, workspace=kept) is found
    for other in (
        held(first.mesh, hv.Material.lame(4.0, 5.0)),
        held(first.mesh, supports={"right": hv.Clamped()}),
        held(first.mesh, contact={"top": FREE}),
        held(rectangle((1.0, 2.0), (4, 4))),
    ):
        assert lower_bounds(other, workspace=kept) is not found
    kept.forget()
    assert lower_bounds(first, workspace=kept) is not found


def test_mesh_and_loads_of_the_problem_do_not_matter(square: LowerBounds) -> None:
    other = held(
        rectangle((1.0, 1.0), (16, 16)), body_force=(3.0, -7.0), contact={"bottom": hv.Contact(hv.Compliance(5.0))}
    )
    assert lower_bounds(other).both.lower == pytest.approx(square.both.lower, rel=0.02)


def test_bounds_are_in_modulus_per_length(square: LowerBounds) -> None:
    there = lower_bounds(held(rectangle((1e3, 1e3), (4, 4)), hv.Material.lame(4e-6, 4e-6)))
    for name in ("both", "normal", "tangential"):
        for value in ("lower", "upper", "simple"):
            mine, other = getattr(getattr(square, name), value), getattr(getattr(there, name), value)
            assert other == pytest.approx(mine * 1e-9, rel=1e-6)


def test_turned_bodies_have_the_same_bounds(square: LowerBounds) -> None:
    turned = lower_bounds(held(rectangle((1.0, 1.0), (4, 4)).rotated(0.7)))
    assert turned.both.lower == pytest.approx(square.both.lower, rel=1e-6)
    assert turned.normal.lower == pytest.approx(square.normal.lower, rel=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_bounds_are_below_conforming_values(seed: int) -> None:
    """Random sizes, materials, anisotropic ones and layers too, and supports."""
    rng = np.random.default_rng(seed)
    mesh = rectangle((float(rng.uniform(0.5, 2.0)), 1.0), (4, 4), "right" if seed % 2 else "cross")
    root = rng.normal(size=(3, 3))
    material = [
        hv.Material.lame(float(rng.uniform(0.0, 50.0)), float(rng.uniform(1.0, 5.0))),
        hv.Material.tensor(root @ root.T + 0.5 * np.eye(3)),
        hv.Material.young(float(rng.uniform(1.0, 9.0)), 0.3),
    ][seed % 3]
    supports: dict[str, object] = {"left": hv.Clamped()}
    if seed % 2:
        supports = {"left": hv.Roller(), "top": hv.Fixed(y=0.0)}
    problem = held(mesh, material, supports=supports)
    found = lower_bounds(problem, 1200)
    value = conforming(held(rectangle((mesh.points[:, 0].max(), 1.0), (8, 8)), material, supports=supports))
    assert 0.5 * value < found.both.lower < value


@pytest.mark.slow
def test_in_space() -> None:
    """Prisms above the facets: a hundredth of what a cell alone would leave."""
    found = lower_bounds(held(box((1.0, 1.0, 1.0), (2, 2, 2))), 400)
    for bound in (found.both, found.normal, found.tangential):
        assert 0.88 * bound.upper < bound.lower < bound.upper


def conforming_in_space(problem: hv.ContactProblem) -> float:
    """The same in space, on the mesh once refined; clamped where supports are."""
    mesh = problem.mesh.refined()
    K = sp.csc_array(stiffness_matrix(mesh, problem.material, 2))
    count = len(mesh.nodes(2))
    point, weights = quadrature_rule(2, 4)
    values = shape_values(2, point)
    facets = np.concatenate([mesh.boundaries[name] for name in problem.contact])
    nodes, areas = mesh.facet_nodes(facets, 2), mesh.facet_normals(facets)[1]
    local = np.einsum("q,qa,qb->ab", weights / weights.sum(), values, values)
    row, column = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
    mass = sp.coo_array((np.ravel(areas[:, None, None] * local), (row.ravel(), column.ravel())), shape=(count, count))
    full = sp.csr_array(sp.kron(sp.csr_array(mass), sp.eye_array(3)))
    fixed = np.unique(np.concatenate([mesh.facet_nodes(mesh.boundaries[name], 2).ravel() for name in problem.supports]))
    free = np.setdiff1d(np.arange(3 * count), (3 * fixed[:, None] + np.arange(3)).ravel())
    moved = np.intersect1d(free, np.flatnonzero(np.diff(full.indptr)))
    root = la.cholesky(full[moved][:, moved].toarray(), lower=True)
    loads = np.zeros((len(free), len(moved)))
    loads[np.searchsorted(free, moved)] = root
    answers = spla.splu(sp.csc_array(K[free][:, free])).solve(loads)
    return float(1.0 / la.eigvalsh(root.T @ answers[np.searchsorted(free, moved)])[-1])


def _space_bodies(name: str) -> hv.ContactProblem:
    rng = np.random.default_rng(11)
    cube, material = box((1.0, 1.0, 1.0), 2), hv.Material.young(10.0, 0.3)
    bottom = {"bottom": FREE}
    if name == "layers":
        low = cube.points[cube.cells].mean(axis=1)[:, 2] < 0.5
        parts = {"low": np.flatnonzero(low), "high": np.flatnonzero(~low)}
        cube = Mesh.trusted(cube.points, cube.cells, cube.boundaries, parts)
        both = {"low": hv.Material.young(1.0, 0.3), "high": hv.Material.young(20.0, 0.1)}
        return held(cube, hv.Material.by_region(both), contact=bottom)
    points = cube.points.copy()
    if name == "bowl":
        points[:, 2] += 0.5 * (1.0 - points[:, 2]) * np.sum((points[:, :2] - 0.5) ** 2, axis=1)
    elif name == "wedge":
        points[:, 0] += 1.5 * points[:, 2]
    elif name == "plate":
        points[:, 2] *= 0.1
    elif name == "corner":
        bottom["right"] = FREE
    elif name == "any material":
        root = rng.normal(size=(6, 6))
        material = hv.Material.tensor(root @ root.T + np.eye(6))
    elif name == "graded":
        points = points**2.5
    elif name == "incompressible":
        material = hv.Material.young(10.0, 0.49)
    return held(Mesh.trusted(points, cube.cells, cube.boundaries, {}), material, contact=bottom)


@pytest.mark.parametrize(
    ("name", "part"),
    [
        ("layers", 0.4),
        ("bowl", 0.3),
        ("wedge", 0.05),
        slow("plate", 0.3),
        slow("corner", 0.4),
        ("any material", 0.4),
        ("graded", 0.6),
        ("incompressible", 0.6),
    ],
)
def test_bounds_in_space_are_below_conforming_values(name: str, part: float) -> None:
    problem = _space_bodies(name)
    value, found = conforming_in_space(problem), lower_bounds(problem)
    assert found.both.lower <= found.both.upper
    assert part * value < found.both.lower < value


def test_where_no_prism_fits_cells_count() -> None:
    """A wedge whose edge is at the contact boundary: nothing lies above the facets there."""
    cube = box((1.0, 1.0, 1.0), (2, 2, 2))
    slope = np.eye(3)
    slope[0, 2] = 1.5
    found = lower_bounds(held(cube.moved(slope)), 50)
    assert 0.0 < found.both.lower < found.both.upper


@pytest.mark.slow
def test_a_thin_plate_has_no_room_for_the_prism_of_a_thick_one() -> None:
    """Facets of one shape: what is bounded by a cube above is worse where nothing lies above but a thin layer."""
    compliance = np.linalg.inv(LAME.stiffness_tensor(np.zeros((1, 3))))
    found = []
    for thickness in (1.0, 0.1):
        mesh = box((1.0, 1.0, thickness), 1)
        table = facet_table(mesh)
        found.append(facet_constants(table, compliance, table.numbers(mesh.boundaries["bottom"])).squares)
    thick, thin = found
    assert (thin > 1.5 * thick).all()


def test_prisms_bound_what_quadratic_fields_attain() -> None:
    """On the cube above, with more to hold it than the prism."""
    mesh = box((1.0, 1.0, 1.0), 1)
    table = facet_table(mesh)
    loaded = table.numbers(mesh.boundaries["bottom"])
    compliance = np.linalg.inv(LAME.stiffness_tensor(mesh.points[:1]))
    squares = facet_constants(table, compliance, loaded).squares
    fine = mesh.refined(1)
    K = stiffness_matrix(fine, LAME, 2).toarray()
    values, vectors = la.eigh(K)
    strained = vectors[:, 6:] / np.sqrt(values[6:])
    parts = fine.boundaries["bottom"]
    point, weights = quadrature_rule(2, 4)
    for facet, square in zip(loaded, squares, strict=True):
        corners = mesh.points[table.facets[facet]]
        inverse = np.linalg.inv(np.vstack([corners[:, :2].T, np.ones(3)]))
        inside = (inverse @ np.vstack([fine.points[parts].mean(axis=1)[:, :2].T, np.ones(len(parts))]) > 0.0).all(
            axis=0
        )
        nodes = fine.facet_nodes(parts[inside], 2)
        rows = np.zeros((len(nodes), len(weights), len(fine.nodes(2))))
        for row, facet_nodes in zip(rows, nodes, strict=True):
            row[:, facet_nodes] = shape_values(2, point)
        areas = fine.facet_normals(parts[inside])[1]
        root = np.sqrt(areas[:, None] * weights)[:, :, None]
        flat = (root * rows).reshape(-1, rows.shape[2])
        x = np.concatenate([np.ones((len(fine.nodes(2)), 1)), fine.nodes(2)[:, :2]], axis=1)
        linear = np.linalg.qr(flat @ x)[0]
        flat = flat - linear @ (linear.T @ flat)
        seen = np.kron(flat, np.eye(3)) @ strained
        value = float(np.linalg.norm(seen, 2) ** 2)
        assert value < square < 16.0 * value


def test_the_oscillation_on_a_facet_is_bounded_from_above() -> None:
    """Against the largest value over quadratic elements on a fine mesh of the cell, which is from below."""
    rng = np.random.default_rng(5)
    for _ in range(3):
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]) + rng.uniform(-0.2, 0.2, (3, 2))
        corners -= corners[0]
        corners /= np.sqrt(0.5 * abs(np.linalg.det(corners[1:])))
        root = rng.normal(size=(3, 3))
        matrix = root @ root.T + 0.3 * np.eye(3)
        table = facet_table(Mesh.oriented(corners, [[0, 1, 2]]))
        facet = table.numbers(np.array([[1, 2]]))
        bound = facet_constants(table, np.linalg.inv(matrix)[None], facet).squares[0]
        value = _from_below(corners, matrix)
        assert value < bound < 2.0 * value


def _from_below(corners: Array, matrix: Array) -> float:
    one = Mesh.oriented(corners, [[0, 1, 2]])
    loaded = one.boundary_facets[(np.sort(one.boundary_facets, axis=1) == [1, 2]).all(axis=1)]
    mesh = one.with_boundaries({"bottom": loaded}).refined(3)
    problem = held(mesh, hv.Material.tensor(matrix), supports={}, order=2)
    K = hv.discretize(problem, check_coercivity=False).stiffness.toarray()
    facets = mesh.facet_nodes(mesh.boundaries["bottom"], 2)
    length = mesh.facet_normals(mesh.boundaries["bottom"])[1]
    local = np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]) / 30.0
    count = len(mesh.nodes(2))
    M = np.zeros((count, count))
    for nodes, size in zip(facets, length, strict=True):
        M[np.ix_(nodes, nodes)] += size * local
    place = (mesh.nodes(2) - corners[1]) @ (corners[2] - corners[1])
    linear = np.column_stack([np.ones(count), place])
    inner = linear.T @ M @ linear
    M = M - M @ linear @ np.linalg.solve(inner, linear.T @ M)
    full = np.kron(M, np.eye(2))
    values, vectors = la.eigh(K)
    strained = vectors[:, 3:] / np.sqrt(values[3:])
    return float(la.eigvalsh(strained.T @ full @ strained)[-1])


@pytest.mark.parametrize(
    ("problem", "message"),
    [
        (held(rectangle((1.0, 1.0), (2, 2)), contact={}), "no contact boundary"),
        (
            held(rectangle((1.0, 1.0), (2, 2)), hv.Material.young(lambda x: 1.0 + x[:, 0], 0.3)),
            "varies inside cells",
        ),
        (held(rectangle((1.0, 1.0), (2, 2)), supports={}), "the supports do not constrain the body"),
    ],
)
def test_what_has_no_bound_is_refused(problem: hv.ContactProblem, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        lower_bounds(problem)


def test_a_part_that_supports_hold_has_no_constant() -> None:
    """A foundation under a body whose supports hold the normal component there: v_nu = 0, Lambda_nu = inf."""
    mesh = rectangle((1.0, 1.0), (4, 4))
    free = lower_bounds(held(mesh), 400)
    found = lower_bounds(held(mesh, supports={"left": hv.Clamped(), "bottom": hv.Fixed(y=0.0)}), 400)
    assert found.normal.lower == math.inf
    assert found.both.upper == pytest.approx(found.tangential.upper)  # v is its tangential part
    for part in ("both", "tangential"):
        assert getattr(free, part).lower <= getattr(found, part).lower <= getattr(found, part).upper


@pytest.mark.parametrize("count", [2, 3, 4])
def test_the_root_of_a_mass_matrix(count: int) -> None:
    """By hand: the mean of two barycentric coordinates is ``(1 + delta) / (n (n + 1))``."""
    root = mass_root(count)
    np.testing.assert_allclose(root @ root, (1.0 + np.eye(count)) / (count * (count + 1)), rtol=1e-12)
    np.testing.assert_array_equal(root, root.T)
    assert np.linalg.eigvalsh(root)[0] > 0.0


@pytest.mark.parametrize("units", [1e-8, 1.0])
@pytest.mark.parametrize("seed", range(6))
def test_products_of_answers_are_bounded_from_above(seed: int, units: float) -> None:
    """A body of 9 unknowns, ``a(v, v) = |v|^2``, four rows of linear traces and three beyond, of any weights.

    The stresses are those of least energy and something more; A2 is at least what the displacements have, and theta
    makes its trace least: ``theta x + y / theta >= 2 sqrt(x y)``.
    """
    rng = np.random.default_rng(seed)
    trace = np.sqrt(units) * rng.normal(size=(7, 9)) * np.repeat([1.0, 0.3], [4, 3])[:, None]
    weight = rng.uniform(0.2, 1.0, 7)
    C = trace.T @ (weight[:, None] * trace)
    near = np.linalg.qr(np.linalg.eigh(C)[1][:, :-4:-1] + 0.1 * rng.normal(size=(9, 3)))[0]
    values, mix = np.linalg.eigh(near.T @ C @ near)
    values, v = values[::-1], near @ mix[:, ::-1]
    linear, rest = trace[:4], trace[4:]
    kappa = float(np.linalg.norm(rest, 2))
    P, R, R2 = (
        part.T @ (by[:, None] * part)
        for part, by in ((linear @ v, weight[:4]), (rest @ v, weight[4:]), (rest @ v, weight[4:] ** 2))
    )
    least = linear.T @ (weight[:4, None] * linear @ v)
    more = 0.1 * units * rng.normal(size=(2, 3))
    T = least.T @ least + more.T @ more
    A2 = _answers(T, P, R, R2, values, kappa)
    exact = (C @ v).T @ (C @ v)
    assert np.linalg.eigvalsh(A2 - exact)[0] > -1e-12 * units**2
    M = np.diag(values)
    misfit = np.trace(T - P @ M - M @ P + M @ M)
    sharp = np.trace(T + R @ M + M @ R + kappa**2 * R2) + 2.0 * kappa * np.sqrt(np.trace(R2) * misfit)
    assert np.trace(A2) == pytest.approx(sharp, rel=1e-9, abs=0.0)
    none = np.zeros((3, 3))
    np.testing.assert_allclose(_answers(M @ M, M, none, none, values, kappa), M @ M, atol=1e-12 * units**2)


def test_the_method_of_lehmann_by_hand() -> None:
    """Exact for exact modes, above the values for others, and silent where the bound of the next one is too high."""
    modes = np.eye(2), np.diag([5.0, 3.0]), np.diag([25.0, 9.0])
    assert _lehmann(*modes, 0.5) == pytest.approx((5.0, 3.0))
    assert _lehmann(*(part[:1, :1] for part in modes), 0.5) == (pytest.approx(5.0), math.inf)
    assert _lehmann(*modes, 0.3) == (math.inf, math.inf)  # 3 is below 1 / 0.3
    assert _lehmann(np.eye(2), np.diag([5.0, 4.0]), np.diag([25.0, 16.0]), 0.25) == (math.inf, math.inf)  # 4 is 1 / q
    # values 5, 3 and 2, and a first mode with a part of the third
    mixed = np.array([[0.8, 0.0], [0.0, 1.0], [0.6, 0.0]])
    given = [mixed.T @ np.diag(np.array([5.0, 3.0, 2.0]) ** power) @ mixed for power in (0, 1, 2)]
    first, second = _lehmann(*given, 1.0 / 2.0)
    assert (first, second) == pytest.approx((5.0, 3.0))  # 1 / q is the third value itself: nothing is lost
    first, second = _lehmann(*given, 1.0 / 2.5)
    assert first > 5.0
    assert second == pytest.approx(3.0)


def test_cells_below_a_facet_have_finitely_many_shapes() -> None:
    """Each of volume one, the facet opposite to its first corner; halved again and again they repeat."""
    corners = np.array([[0.3, 0.2, 0.9], [0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.8, 0.1]])
    corners /= (abs(np.linalg.det(corners[1:] - corners[0])) / 6.0) ** (1.0 / 3.0)
    known, shapes = {_shape_key(corners)}, [corners]
    for _ in range(4):
        shapes = [child for shape in shapes for child in _children(_one_cell(shape).refined())]
        assert [abs(np.linalg.det(shape[1:] - shape[0])) / 6.0 for shape in shapes] == pytest.approx(
            [1.0] * len(shapes)
        )
        shapes = list({_shape_key(shape): shape for shape in shapes}.values())
        known |= {_shape_key(shape) for shape in shapes}
    assert len(known) <= 12


def test_shapes_are_told_apart_but_for_translations_reflections_and_numbers() -> None:
    rng = np.random.default_rng(2)
    corners = rng.normal(size=(4, 3))
    key = _shape_key(corners)
    for same in (corners + np.array([3.0, -1.0, 2.0]), -corners, corners[[0, 2, 3, 1]], -corners[[0, 3, 2, 1]] + 1.0):
        assert _shape_key(same) == key
    for other in (2.0 * corners, corners[[1, 0, 2, 3]], corners * [1.0, 1.0, -1.0], corners + 1e-6 * np.eye(4, 3)):
        assert _shape_key(other) != key


def test_modes_that_lanczos_steps_leave_unfinished_are_not_below_the_exact_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """One pair is exact and two are not: each value is raised by the worst residual."""
    body = TraceFlexibility(held(rectangle((1.0, 1.0), (4, 4))))
    ones = np.ones(len(body.facets) * 4)
    exact, loads = body._modes(ones, 3)
    np.testing.assert_allclose(body.flexibility(loads), loads * exact, atol=1e-12 * exact[0])
    monkeypatch.setattr(sys.modules[TraceFlexibility.__module__], "_DENSE", 0)
    other = TraceFlexibility(held(rectangle((1.0, 1.0), (4, 4))))
    np.testing.assert_allclose(other.flexibility(loads), loads * exact, atol=1e-12 * exact[0])
    assert other._modes(ones, 3)[0] == pytest.approx(exact, rel=1e-5)

    def unfinished(operator: spla.LinearOperator, count: int, **_: object) -> tuple[Array, Array]:
        vectors = loads[:, ::-1].copy()
        vectors[:, 1:] += 0.05 * np.random.default_rng(1).normal(size=(len(ones), 2))
        vectors[:, 1:] /= np.linalg.norm(vectors[:, 1:], axis=0)
        return np.array([v @ operator.matvec(v) for v in vectors.T]), vectors

    monkeypatch.setattr(spla, "eigsh", unfinished)
    found = other._modes(ones, 3)[0]
    assert (found >= exact).all()
    assert (found <= exact + 0.5 * exact[0]).all()


def test_a_free_body_in_balance_does_not_feel_where_it_is_held() -> None:
    """The facet that its rigid motions are told by is another one wherever its nodes are numbered otherwise."""
    rng = np.random.default_rng(6)
    root = rng.normal(size=(6, 6))
    compliance = root @ root.T + 0.1 * np.eye(6)
    mesh = _one_cell(np.array([[0.1, 0.2, 0.9], [0.0, 0.0, 0.0], [1.0, 0.1, 0.0], [0.2, 0.8, 0.1]])).refined()
    found = []
    for _ in range(6):
        place = rng.permutation(len(mesh.points))
        points = np.empty_like(mesh.points)
        points[place] = mesh.points
        other = Mesh.oriented(points, place[mesh.cells][rng.permutation(len(mesh.cells))])
        found.append(
            _without_linear_part(other.with_boundaries({"loaded": place[mesh.boundaries["loaded"]]}), compliance)
        )
    assert found == pytest.approx([_without_linear_part(mesh, compliance)] * 6, rel=1e-9)
