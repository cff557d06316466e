"""Constants of simplices: above what polynomials attain, and those that the library has written down."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from hemivar.basics.types import Array
from hemivar.certify.facet_cover import facet_cover
from hemivar.certify.local_constants import local_constants
from hemivar.certify.simplex_constants import simplex_constants
from hemivar.fem.assembly import quadrature_rule, stiffness_matrix
from hemivar.fem.elements import shape_values
from hemivar.fem.facet_table import facet_table
from hemivar.mechanics.material import Material
from hemivar.mesh import Mesh

UNIT = Material.lame(0.0, 0.5)
REGULAR = {
    2: np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]]),
    3: np.array([[0, 0, 0], [1, 0, 0], [0.5, np.sqrt(0.75), 0], [0.5, np.sqrt(1 / 12), np.sqrt(2 / 3)]]),
}


def attained(corners: Array) -> float:
    """sup |v - P v| / |eps(v)| over quadratic elements on a mesh of the triangle."""
    mesh = Mesh.oriented(corners, [[0, 1, 2]]).refined(2)
    K = stiffness_matrix(mesh, UNIT, 2).toarray()
    values, vectors = la.eigh(K)
    strained = vectors[:, 3:] / np.sqrt(values[3:])
    point, weights = quadrature_rule(2, 4)
    rows = np.zeros((mesh.number_of_cells, len(weights), len(mesh.nodes(2))))
    for row, nodes in zip(rows, mesh.cell_nodes(2), strict=True):
        row[:, nodes] = shape_values(2, point)
    flat = (np.sqrt(mesh.volumes[:, None] * weights)[:, :, None] * rows).reshape(-1, rows.shape[2])
    linear = np.linalg.qr(flat @ np.column_stack([np.ones(len(mesh.nodes(2))), mesh.nodes(2)]))[0]
    flat = flat - linear @ (linear.T @ flat)
    return float(np.linalg.norm(np.kron(flat, np.eye(2)) @ strained, 2))


def test_a_triangle_bounds_what_quadratic_fields_attain() -> None:
    compliance = np.linalg.inv(UNIT.stiffness_tensor(np.zeros((1, 2)))[0])
    for corners in (REGULAR[2], np.array([[0.0, 0.0], [1.0, 0.0], [0.3, 0.6]])):
        value, bound = attained(corners), simplex_constants(corners, compliance)[0]
        assert value < bound < 1.5 * value


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_written_constants_are_the_proved_ones(dim: int) -> None:
    compliance = np.linalg.inv(UNIT.stiffness_tensor(np.zeros((1, dim)))[0])
    cell, facet = simplex_constants(REGULAR[dim], compliance)
    table = facet_table(Mesh.oriented(REGULAR[dim], [list(range(dim + 1))]))
    written = local_constants(table, UNIT.stiffness_tensor(np.zeros((1, dim))))
    assert cell <= written.cell[0] <= 1.002 * cell
    assert facet <= written.facet.min() <= written.facet.max() <= 1.002 * facet


def test_constants_scale_with_length_and_modulus() -> None:
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.2, 0.7]])
    stiffness = Material.lame(4.0, 3.0).stiffness_tensor(np.zeros((1, 2)))[0]
    cell, facet = simplex_constants(corners, np.linalg.inv(stiffness))
    there = simplex_constants(1e3 * corners, np.linalg.inv(1e-6 * stiffness))
    assert there == pytest.approx((1e6 * cell, 1e3 * np.sqrt(1e3) * facet), rel=1e-6)
    written = local_constants(facet_table(Mesh.oriented(corners, [[0, 1, 2]])), stiffness[None])
    assert cell <= written.cell[0]
    assert facet <= written.facet.max()


def test_facets_that_lie_over_others_are_found() -> None:
    """Cut at random: wherever inner points are common, and in the plane nowhere else."""
    rng = np.random.default_rng(3)
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    for matrix in (np.eye(2), turn, 1e-3 * turn):
        mine, others = (np.unique(np.round(rng.uniform(0.0, 1.0, 9), 2)) for _ in range(2))
        common = np.minimum(mine[1:, None], others[1:]) - np.maximum(mine[:-1, None], others[:-1])
        sides = [
            np.stack([np.column_stack([x[:-1], 0.0 * x[1:]]), np.column_stack([x[1:], 0.0 * x[1:]])], axis=1) @ matrix.T
            for x in (mine, others)
        ]
        assert np.array_equal(facet_cover(*sides), common > 1e-9)
