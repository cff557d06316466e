"""Constants of simplices: above what polynomials attain, and those that the library has written down."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from hemivar.basics.types import Array
from hemivar.bounds.bare_body import facet_cover
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.oscillation import local_constants
from hemivar.bounds.split_element import facet_mass, pairs_of, pulled_back, split_element, voigt_map
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mechanics.material import Material
from hemivar.mesh import Mesh

from .simplex_constants import simplex_constants

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


def shifted(corners: Array) -> tuple[float, float]:
    """sup of the work of ``d - b`` over ``|d|_F |eps(v)|``, and of ``|b| / |d|_F``, for quadratic fields v on a mesh.

    d is linear on the facet that is opposite to the last vertex, b linear on the simplex with the same moments.
    """
    dim = corners.shape[1]
    mesh = Mesh.oriented(corners, [list(range(dim + 1))]).refined(1)
    K = stiffness_matrix(mesh, UNIT, 2).toarray()
    values, vectors = la.eigh(K)
    rigid = dim * (dim + 1) // 2
    strained = vectors[:, rigid:] / np.sqrt(values[rigid:])
    inverse = np.linalg.inv((corners[1:] - corners[:1]).T)

    def linear(x: Array) -> Array:
        rest = (x - corners[0]) @ inverse.T
        return np.column_stack([1.0 - rest.sum(axis=1), rest])

    def moments(simplices: Array, nodes: Array, measures: Array, degree: int) -> tuple[Array, Array]:
        """Of linear functions against the functions of all nodes, and against each other."""
        point, weights = quadrature_rule(simplices.shape[1] - 1, degree)
        mixed, own = np.zeros((dim + 1, len(mesh.nodes(2)))), np.zeros((dim + 1, dim + 1))
        for simplex, node, measure in zip(simplices, nodes, measures, strict=True):
            at = linear(point @ mesh.points[simplex])
            mixed[:, node] += measure * (at * weights[:, None]).T @ shape_values(2, point)
            own += measure * (at * weights[:, None]).T @ at
        return mixed, own

    bottom = mesh.boundary_facets[np.abs(linear(mesh.points)[mesh.boundary_facets][:, :, -1]).max(axis=1) < 1e-9]
    on_facet, face = moments(bottom, mesh.facet_nodes(bottom, 2), mesh.facet_normals(bottom)[1], 4)
    in_cell, mass = moments(mesh.cells, mesh.cell_nodes(2), mesh.volumes, 4)
    b = np.linalg.solve(mass, face[:, :-1])  # for each linear function of the facet
    off = np.kron(on_facet[:-1] - b.T @ in_cell, np.eye(dim)) @ strained
    energy = off @ off.T
    size = np.kron(face[:-1, :-1], np.eye(dim))
    work = la.eigvalsh(0.5 * (energy + energy.T), size)[-1]
    return float(np.sqrt(work)), float(np.sqrt(la.eigvalsh(b.T @ mass @ b, face[:-1, :-1])[-1]))


def answered(corners: Array, cell: float) -> float:
    """An upper bound of the same on the last facet by stresses of the split element, and kappa_T of what they leave."""
    dim = corners.shape[1]
    n, table, element = dim + 1, facet_table(Mesh.oriented(corners, [list(range(dim + 1))])), split_element(dim)
    compliance = np.linalg.inv(UNIT.stiffness_tensor(np.zeros((1, dim))))
    back = pulled_back(compliance, table.jacobian, table.sizes)[0]
    face = table.measures[table.cell_facets[0, -1]] * facet_mass(dim, 1)
    mass = table.volumes[0] * (np.ones((n, n)) + np.eye(n)) / (n * (n + 1))
    root = np.linalg.inv(np.linalg.cholesky(face)).T  # loads of size one
    degrees, loads = [], []
    for column in root.T:
        for direction in np.eye(dim):
            load = np.zeros((n, dim))
            load[:-1] = np.outer(face @ column, direction)
            moments = np.zeros((n, dim, dim))
            moments[-1] = load[:-1]
            degrees.append(
                element.loading @ (np.concatenate([moments.reshape(-1, dim), -load]) @ table.inverse[0].T).ravel()
            )
            loads.append(np.linalg.solve(mass, load))
    stress = element.at_nodes(np.array(degrees))
    energy = np.einsum("mbap,ac,nbcp->mn", np.einsum("pq,mbaq->mbap", back, stress), element.mass, stress)
    stress = np.einsum("pq,mbaq->mbap", voigt_map(table.jacobian)[0] / table.sizes[0], stress)
    divergence = np.zeros((len(stress), n, dim))
    for piece in range(n):
        own = corners.copy()
        own[piece] = corners.mean(axis=0)
        inverse = np.linalg.inv((own[1:] - own[:1]).T)
        gradients = np.concatenate([-inverse.sum(axis=0, keepdims=True), inverse])
        for component, (i, j) in enumerate(pairs_of(dim)):
            slope = stress[:, piece, :, component] @ gradients
            divergence[:, piece, i] += slope[:, j]
            if i != j:
                divergence[:, piece, j] += slope[:, i]
    b = np.array(loads)
    over = (1.0 - np.eye(n) + 1.0 / n) / n**2 * table.volumes[0]  # integrals of the vertices' functions over pieces
    cross = np.einsum("mpi,pa,nai->mn", divergence, over, b)
    left = table.volumes[0] / n * np.einsum("mpi,npi->mn", divergence, divergence) - cross - cross.T
    left += np.einsum("mai,ab,nbi->mn", b, mass, b)
    assert np.abs(np.einsum("mpi,pa->mai", divergence, over) - np.einsum("ab,mbi->mai", mass, b)).max() < 1e-9
    return float(np.sqrt(la.eigvalsh(energy)[-1]) + cell * np.sqrt(max(la.eigvalsh(left)[-1], 0.0)))


@pytest.mark.parametrize("dim", [2, 3])
def test_loads_of_a_facet_are_shifted_to_its_cell(dim: int) -> None:
    """Written constants are the proved ones, and above what quadratic fields attain; also on another simplex."""
    stiffness = UNIT.stiffness_tensor(np.zeros((1, dim)))
    written = local_constants(facet_table(Mesh.oriented(REGULAR[dim], [list(range(dim + 1))])), stiffness)
    proved = answered(REGULAR[dim], written.cell[0])
    assert proved <= written.shift.min() <= written.shift.max() <= 1.002 * proved
    assert shifted(REGULAR[dim])[0] > 0.1 * proved
    rng = np.random.default_rng(dim)
    for corners in (REGULAR[dim], REGULAR[dim] @ rng.normal(size=(dim, dim))):
        if np.linalg.det(corners[1:] - corners[:1]) < 0.0:
            corners = corners * [-1.0, *(1.0,) * (dim - 1)]
        own = local_constants(facet_table(Mesh.oriented(corners, [list(range(dim + 1))])), stiffness)
        work, spread = shifted(corners)
        assert work < own.shift[0, -1]
        assert spread == pytest.approx(own.spread[0, -1])


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
