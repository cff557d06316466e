"""Lower bounds of the trace constants: below what conforming elements find, and close to it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.certify.facet_constants import facet_constants
from hemivar.certify.lower_bounds import LowerBounds, lower_bounds
from hemivar.errors import ProblemError
from hemivar.fem.facet_table import facet_table
from hemivar.mesh import Mesh, box, rectangle

LAME = hv.Material.lame(4.0, 4.0)
FREE = hv.Contact(hv.NoContact())


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
    return float(1.0 / la.eigh(M, discrete.linear.stiffness.toarray(), eigvals_only=True)[-1])


@pytest.fixture(scope="module")
def square() -> LowerBounds:
    return lower_bounds(held(rectangle((1.0, 1.0), (4, 4))))


def test_the_unit_square(square: LowerBounds) -> None:
    """Its limit is 2.928, known to four digits from fine meshes; the bound is within one per cent below."""
    assert 2.928 * 0.99 < square.both.lower < 2.928
    assert square.both.upper > 2.928
    for bound in (square.both, square.normal, square.tangential):
        assert bound.simple <= bound.lower <= bound.upper
        assert bound.lower > 0.97 * bound.upper
    # the norm of the whole is the sum of those of the parts
    assert square.both.lower <= min(square.normal.upper, square.tangential.upper)
    parts = 1.0 / square.normal.lower + 1.0 / square.tangential.lower
    assert 1.0 / square.both.upper <= parts


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


def test_in_space() -> None:
    """Valid, not sharp: a cell in space alone holds its facet badly."""
    found = lower_bounds(held(box((1.0, 1.0, 1.0), (2, 2, 2))), 200)
    for bound in (found.both, found.normal, found.tangential):
        assert 0.1 * bound.upper < bound.lower < bound.upper


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
    K = hv.discretize(problem, check_coercivity=False).linear.stiffness.toarray()
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
        (held(rectangle((1.0, 1.0), (2, 2)), supports={}), "held by its supports"),
        (held(rectangle((1.0, 1.0), (101, 101))), "begin with a coarser mesh and refine it"),
    ],
)
def test_what_has_no_bound_is_refused(problem: hv.ContactProblem, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        lower_bounds(problem)
