"""Prisms above facets: their constants, and where they have room."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
import scipy.optimize

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds.facet_constants import _FRUSTA, _PRISMS, facet_constants, softest
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.prisms import (
    KINDS,
    RATIOS,
    SQUARES,
    TRIANGLES,
    Solids,
    prism_squares,
    prisms,
    room,
    tolerance,
)
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mesh import Mesh, box

from .prism_constants import known, narrowed, prism, prism_constant, solid, triangle

LAME = hv.Material.lame(4.0, 4.0)


def random_compliance(rng: np.random.Generator) -> Array:
    root = rng.normal(size=(6, 6))
    return np.asarray(root @ root.T + 0.3 * np.eye(6))


def attained(mesh: Mesh, compliance: Array) -> float:
    """The largest ``|v - Pi_1 v|_F^2 / |v|_a^2`` of quadratic fields on a mesh of a prism, from below."""
    K = stiffness_matrix(mesh, hv.Material.tensor(np.linalg.inv(compliance)), 2).toarray()
    values, vectors = la.eigh(K)
    strained = vectors[:, 6:] / np.sqrt(values[6:])
    facets = mesh.boundaries["loaded"]
    point, weights = quadrature_rule(2, 4)
    nodes, areas = mesh.facet_nodes(facets, 2), mesh.facet_normals(facets)[1]
    rows = np.zeros((len(nodes), len(weights), len(mesh.nodes(2))))
    for row, here in zip(rows, nodes, strict=True):
        row[:, here] = shape_values(2, point)
    flat = (np.sqrt(areas[:, None] * weights / weights.sum())[:, :, None] * rows).reshape(-1, rows.shape[2])
    x = np.column_stack([np.ones(len(mesh.nodes(2))), mesh.nodes(2)])
    linear = la.orth(flat @ x)
    flat = flat - linear @ (linear.T @ flat)
    return float(np.linalg.norm(np.kron(flat, np.eye(3)) @ strained, 2) ** 2)


@pytest.mark.parametrize("kind", range(len(KINDS)))
def test_the_table_is_above_what_quadratic_fields_attain(kind: int) -> None:
    for number in range(len(TRIANGLES)):
        for ratio, square in zip(RATIOS, SQUARES[kind][number], strict=True):
            compliance = np.linalg.inv(hv.Material.young(1.0, ratio).stiffness_tensor(np.zeros((1, 3)))[0])
            value = attained(solid(kind, number, 1), compliance)
            assert value < square < 12.0 * value


ENTRIES = [(h, n, r) for h in range(len(KINDS)) for n in range(len(TRIANGLES)) for r in range(len(RATIOS))]


@pytest.mark.parametrize(
    ("kind", "number", "ratio"),
    [pytest.param(*entry, marks=() if k == 13 else pytest.mark.slow) for k, entry in enumerate(ENTRIES) if k % 12 == 1],
)
def test_the_table_is_proved(kind: int, number: int, ratio: int) -> None:
    """``python -m tests.bounds.prism_constants`` proves all of it."""
    proved = known(kind, number, ratio)
    assert proved <= SQUARES[kind][number][ratio] <= proved + 2e-4


@pytest.mark.parametrize("units", [1e-3, 1.0, 1e3])
def test_known_prisms_have_their_constants(units: float) -> None:
    """Or better ones, by others; the regular one its own. Turned, mirrored, corners in any order; in any units."""
    rng = np.random.default_rng(3)
    for kind, (_, height) in enumerate(KINDS):
        for number in range(len(TRIANGLES)):
            compliance = np.linalg.inv(hv.Material.young(2.0, RATIOS[1]).stiffness_tensor(np.zeros((1, 3)))[0])
            turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            corners = units * triangle(number)[rng.permutation(3)] @ turn.T + rng.normal(size=3)
            up = units * height * turn[:, 2]
            found = prism_squares(np.array([kind]), corners[None], up[None], compliance[None])
            expected = units * SQUARES[kind][number][1] / 2.0
            assert found <= expected * (1.0 + 1e-6)
            assert number > 0 or found == pytest.approx([expected], rel=1e-6)


def test_other_prisms_are_above_what_quadratic_fields_attain() -> None:
    """Of any triangle and material, upright and leaning; and not far above what is proved of them alone."""
    rng = np.random.default_rng(5)
    far = []
    for k in range(40):
        base = np.column_stack([rng.normal(size=(3, 2)), np.zeros(3)])
        base /= np.sqrt(np.linalg.norm(np.cross(base[1] - base[0], base[2] - base[0])))
        kind = int(rng.integers(len(KINDS)))
        top, height = KINDS[kind]
        up = height * np.array([0.0, 0.0, 1.0] if k % 2 else [*rng.uniform(-0.7, 0.7, 2), 1.0])
        young = hv.Material.young(1.0, float(rng.uniform(-0.3, 0.49))).stiffness_tensor(np.zeros((1, 3)))[0]
        compliance = np.linalg.inv(young) if k % 3 else random_compliance(rng)
        found = prism_squares(np.array([kind]), base[None], up[None], compliance[None])[0]
        upright = narrowed(prism(base, np.array([0.0, 0.0, height])).refined(), top)
        lean = np.eye(3)
        lean[:, 2] = up / height
        assert attained(upright.moved(lean), compliance) < found
        if k % 2 and k % 3 and top == 1.0:
            far.append(found / prism_constant(base, up, compliance, 1))
    assert np.median(far) < 1.0  # proved with coarser parts


def test_prisms_differ_if_they_are_turned_round() -> None:
    """Of a material without symmetry: the worse of both counts for both."""
    rng = np.random.default_rng(0)
    base, up = np.array([[0.0, 0.0, 0.0], [1.0, 0.2, 0.0], [0.3, 0.9, 0.0]]), np.array([0.0, 0.0, 0.8])
    compliance = random_compliance(rng)
    found = [prism_constant(corners, up, compliance, 2) for corners in (base, -base)]
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    values = [attained(prism(corners, up).refined(), compliance) for corners in (base, -base)]
    assert abs(values[0] - values[1]) > 0.02 * values[0]
    assert max(values) < found[0]


def test_a_prism_stands_on_its_triangle() -> None:
    base = np.array([[0.1, 0.0, 0.0], [1.0, 0.2, 0.0], [0.3, 0.9, 0.0]])
    up = np.array([0.1, 0.0, 0.8])
    mesh = prism(base, up).refined(2)
    area = 0.5 * abs(np.linalg.det((base[1:] - base[0])[:, :2]))
    assert mesh.volumes.sum() == pytest.approx(0.8 * area)
    assert mesh.facet_normals(mesh.boundaries["loaded"])[1].sum() == pytest.approx(area)
    assert not mesh.points[mesh.boundaries["loaded"]][:, :, 2].any()
    for corner in (*base, *(base + up)):
        assert np.linalg.norm(mesh.points - corner, axis=1).min() < 1e-12


@pytest.mark.parametrize("units", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("thickness", "number"), [(1.0, 0), (0.5, 0), (0.4, 1), (0.2, 2), (0.1, -1)])
def test_prisms_are_as_high_as_the_body_has_room_for(thickness: float, number: int, units: float) -> None:
    """Above the halves of a square of side one, in terms of the root of twice their area, which is one."""
    mesh = box((1.0, 1.0, thickness), 1).scaled(units)
    table = facet_table(mesh)
    facets = table.numbers(mesh.boundaries["bottom"])
    found = room(table, facets, np.flatnonzero(~table.interior), (0, 1, 2))
    assert found.tolist() == [number] * 2


def test_a_frustum_has_room_where_a_prism_has_none() -> None:
    """Beside a wall that leans inwards."""
    lean = np.eye(3)
    lean[0, 2] = 0.2
    mesh = box((1.0, 1.0, 1.0), 1).moved(lean)
    table = facet_table(mesh)
    facets, walls = table.numbers(mesh.boundaries["bottom"]), np.flatnonzero(~table.interior)
    assert sorted(room(table, facets, walls, _PRISMS[:3]).tolist())[0] == -1
    assert (room(table, facets, walls, _PRISMS) >= 0).all()
    assert sorted(room(table, facets, walls, _PRISMS).tolist())[-1] == 3
    assert room(table, facets, walls, _FRUSTA).tolist() == [3, 3]


@pytest.mark.parametrize(("names", "together"), [(("bottom", "top"), 1), (("bottom", "left"), 3)])
def test_prisms_that_overlap_are_added(names: tuple[str, str], together: int) -> None:
    """From both ends of a cube they meet in the middle; in a corner they overlap."""
    mesh = box((1.0, 1.0, 1.0), 1)
    table = facet_table(mesh)
    compliance = np.linalg.inv(LAME.stiffness_tensor(np.zeros((1, 3))))
    facets = np.concatenate([table.numbers(mesh.boundaries[name]) for name in names])
    found = facet_constants(table, compliance, facets)
    assert found.together.sum(axis=1).max() == together
    assert found.total() == pytest.approx((found.together.toarray() @ found.squares).max())
    alone = facet_constants(table, compliance, facets[:2])
    assert found.total(np.array([1.0, 1.0, 0.0, 0.0])) == pytest.approx(alone.total())


def test_cells_take_the_place_of_prisms() -> None:
    """Where facets meet at a sharp edge; two facets of one cell are added."""
    slope = np.eye(3)
    slope[0, 2] = 3.0
    mesh = box((1.0, 1.0, 1.0), 1).moved(slope)
    table = facet_table(mesh)
    compliance = np.linalg.inv(LAME.stiffness_tensor(np.zeros((1, 3))))
    facets = table.numbers(mesh.boundaries["bottom"])
    assert (room(table, facets, np.flatnonzero(~table.interior), _PRISMS) < 0).any()
    assert np.isfinite(facet_constants(table, compliance, facets).squares).all()
    every = np.flatnonzero(~table.interior)
    found = facet_constants(table, compliance, every)
    owner = table.owners[every, 0]
    cells = room(table, every, every, _PRISMS) < 0
    same = owner[:, None] == owner
    together = found.together.toarray() > 0
    assert (together == same)[np.ix_(cells, cells)].all()
    assert (together == together.T).all()
    assert together[np.ix_(cells, ~cells)].any()


def test_prisms_stay_in_one_material_or_take_the_softest() -> None:
    """A thin layer of other stiffness at the contact boundary leaves no room: what is softer than both counts."""
    rng = np.random.default_rng(2)
    compliances = np.array([random_compliance(rng) for _ in range(5)])
    soft = softest(compliances)
    assert (np.linalg.eigvalsh(soft - compliances) > -1e-9 * np.linalg.norm(soft)).all()
    assert softest(compliances[:1]) == pytest.approx(compliances[0], rel=1e-9)
    hard = np.linalg.inv(LAME.stiffness_tensor(np.zeros((1, 3)))[0])
    for thickness, own in ((0.5, True), (0.02, False)):
        mesh = box((1.0, 1.0, 1.0), (1, 1, 2))
        points = mesh.points.copy()
        points[points[:, 2] == 0.5, 2] = thickness
        mesh = Mesh.oriented(points, mesh.cells)
        facets = mesh.boundary_facets[(mesh.points[mesh.boundary_facets][:, :, 2] == 0.0).all(axis=1)]
        table = facet_table(mesh)
        high = mesh.points[mesh.cells].mean(axis=1)[:, 2] > thickness
        factor = np.where(high, 3.0, 1.0)
        found = facet_constants(table, factor[:, None, None] * hard, table.numbers(facets)).squares
        alone = facet_constants(table, (1.0 if own else 3.0) * hard[None], table.numbers(facets)).squares
        assert found == pytest.approx(alone, rel=1e-6)


def test_facets_that_meet_at_angles_have_frusta_of_their_own() -> None:
    """On a bowl nothing overlaps, and constants are not much above those of the plane."""
    flat = box((1.0, 1.0, 1.0), 3)
    compliance = np.linalg.inv(LAME.stiffness_tensor(np.zeros((1, 3))))
    bowl = flat.points.copy()
    bowl[:, 2] += 0.4 * (1.0 - bowl[:, 2]) * np.sum((bowl[:, :2] - 0.5) ** 2, axis=1)
    found = []
    for points in (flat.points, bowl):
        table = facet_table(Mesh.trusted(points, flat.cells, flat.boundaries, {}))
        found.append(facet_constants(table, compliance, table.numbers(flat.boundaries["bottom"])))
    plane, curved = found
    assert curved.together.nnz == len(curved.squares)
    assert plane.total() < curved.total() < 2.5 * plane.total()


# ---- which solids meet ---------------------------------------------------------------------------------------------


def sides(corners: Array) -> list[tuple[Array, Array]]:
    """Outward normals of a prism (6, 3), and a point of each side."""
    middle = corners.mean(axis=0)
    found = []
    for a, b, c in [corners[:3], corners[3:], *(corners[[i, j, i + 3]] for i, j in ((0, 1), (1, 2), (2, 0)))]:
        out = np.cross(b - a, c - a)
        out *= -np.sign(out @ (middle - a)) / np.linalg.norm(out)
        found.append((out, a))
    return found


def depth(one: Array, other: Array) -> float:
    """How deep a point of a set (p, 3) can lie in a prism (6, 3), by a linear programme; below zero if outside.

    For another prism the least of the depths in both.
    """
    rows, right = [], []
    for out, at in sides(one):
        rows.append([*(other @ out), 1.0])
        right.append(out @ at)
    if len(other) == 6:
        for out, at in sides(other):
            rows.append([*(other @ out), 1.0])
            right.append(out @ at)
    found = scipy.optimize.linprog(
        [0.0] * len(other) + [-1.0],
        rows,
        right,
        [[1.0] * len(other) + [0.0]],
        [1.0],
        [(0.0, None)] * len(other) + [(None, None)],
    )
    assert found.status == 0
    return float(-found.fun)


@pytest.mark.parametrize("units", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("far", [0.0, 1e4])
def test_which_triangles_and_prisms_reach_into_prisms(units: float, far: float) -> None:
    """Random ones against a linear programme, in any units, wherever the body lies; some lean."""
    rng, place = np.random.default_rng(8), [far, 0.0, 0.0]
    base = rng.normal(size=(40, 3, 3))
    normals = np.cross(base[:, 1] - base[:, 0], base[:, 2] - base[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    up = -rng.uniform(0.3, 1.0, 40)[:, None] * normals
    up[::2] += 0.2 * rng.normal(size=(20, 3))
    triangles = base + 0.7 * rng.normal(size=(40, 1, 3)) + 0.3 * rng.normal(size=(40, 3, 3))
    # a neighbour, that shares an edge with the prism or reaches over it by a hair
    inward = np.cross(up, base[:, 1] - base[:, 0])
    inward *= np.sign(np.einsum("ki,ki->k", inward, base[:, 2] - base[:, 0]))[:, None]
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    outside = base[:, :2].mean(axis=1) - inward
    beside = np.stack([0.9 * base[:, 0] + 0.1 * base[:, 1], 0.9 * base[:, 1] + 0.1 * base[:, 0], outside], axis=1)
    beside[:, :2] += 0.1 * up[:, None]

    def placed(corners: Array) -> Array:
        return np.asarray(units * (corners + place))

    near = tolerance(placed(triangles).reshape(-1, 3))
    counts = []
    for others, expected in (
        (triangles, [depth(np.concatenate([b, b + u]), t) > 0.0 for b, u, t in zip(base, up, triangles, strict=True)]),
        (beside, [False] * 40),
        (beside + 1e-11 * inward[:, None], [False] * 40),
        (beside + 1e-6 * inward[:, None], [True] * 40),
    ):
        solids, flat = prisms(placed(base), units * up), Solids.simplices(placed(others))
        first, second = solids.meeting(flat, near)
        assert [bool(np.any((first == k) & (second == k))) for k in range(40)] == expected
        counts.append(sum(expected))
    assert 10 < counts[0] < 35
    moved = placed(triangles)
    first, second = prisms(placed(base), units * up).meeting(prisms(moved, units * up[::-1]), near)
    expected = [
        depth(np.concatenate([b, b + u]), np.concatenate([t, t + w])) > 0.0
        for b, u, t, w in zip(base, up, triangles, up[::-1], strict=True)
    ]
    assert [bool(np.any((first == k) & (second == k))) for k in range(40)] == expected
    assert 10 < sum(expected) < 39


def test_neighbours_in_a_plane_do_not_meet_but_themselves() -> None:
    mesh = box((1.0, 1.0, 1.0), 3)
    corners = mesh.points[mesh.boundaries["bottom"]]
    up = np.tile([0.0, 0.0, 0.2], (len(corners), 1))
    first, second = prisms(corners, up).meeting(prisms(corners, up), 1e-9)
    assert (first == second).all()
    assert len(first) == len(corners)
    cells = Solids.simplices(mesh.points[mesh.cells])
    first, second = cells.meeting(cells, 1e-9)
    assert (first == second).all()
    assert len(first) == mesh.number_of_cells
