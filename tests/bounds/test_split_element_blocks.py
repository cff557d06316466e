"""Element matrices: stresses in equilibrium, and quadratic displacements, against what they are made of elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.bounds.facet_constants import equilibrated_blocks
from hemivar.bounds.facet_table import facet_table, facet_vertices
from hemivar.bounds.lower_bounds import quadratic_blocks
from hemivar.bounds.split_element import pulled_back
from hemivar.fem.assembly import stiffness_matrix
from hemivar.mechanics import Material
from tests.bounds.bodies import anisotropic, plane_mesh, space_mesh


@pytest.mark.parametrize("dim", [2, 3])
def test_only_rigid_motions_cost_nothing_and_linear_fields_what_they_should(dim: int) -> None:
    mesh = plane_mesh(2) if dim == 2 else space_mesh(2)
    table, material = facet_table(mesh), anisotropic(dim)
    stiffness = material.stiffness_tensor(mesh.points[:1])
    pulled = pulled_back(np.linalg.inv(stiffness), table.jacobian, table.sizes)
    blocks = equilibrated_blocks(pulled, table.jacobian)
    loaded = equilibrated_blocks(pulled, table.jacobian, loaded=True)
    corners = mesh.points[table.cells]
    on_facets = corners[:, facet_vertices(dim)].reshape(len(corners), -1, dim)
    rng = np.random.default_rng(0)
    gradient = rng.normal(size=(dim, dim))
    field = (on_facets @ gradient.T).reshape(len(corners), -1)
    strain = 0.5 * (gradient + gradient.T)
    pairs = ((0, 0), (1, 1), (0, 1)) if dim == 2 else ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
    flat = np.array([strain[i, j] * (1.0 if i == j else 2.0) for i, j in pairs])
    energy = table.volumes * float(flat @ stiffness[0] @ flat)
    assert np.einsum("mi,mij,mj->m", field, blocks, field) == pytest.approx(energy)
    whole = np.hstack([field, (corners @ gradient.T).reshape(len(corners), -1)])
    assert np.einsum("mi,mij,mj->m", whole, loaded, whole) == pytest.approx(energy)
    for matrices in (blocks, loaded):
        values = np.linalg.eigvalsh(matrices)
        kernel = dim * (dim + 1) // 2
        assert np.abs(values[:, :kernel]).max() < 1e-10 * values.max()
        assert (values[:, kernel] > 1e-5 * values[:, -1]).all()
    n = blocks.shape[1]
    inner = np.linalg.solve(loaded[:, n:, n:], loaded[:, n:, :n])
    assert loaded[:, :n, :n] - loaded[:, :n, n:] @ inner == pytest.approx(blocks, rel=1e-8, abs=1e-8 * blocks.max())


@pytest.mark.parametrize("dim", [2, 3])
def test_quadratic_blocks_sum_up_to_the_stiffness(dim: int) -> None:
    mesh = plane_mesh(2) if dim == 2 else space_mesh(2)
    for material in (anisotropic(dim), Material.lame(4.0, 3.0)):
        blocks = quadratic_blocks(mesh, material.stiffness_tensor(mesh.points[:1]))
        place = (mesh.cell_nodes(2)[:, :, None] * dim + np.arange(dim)).reshape(len(blocks), -1)
        rows, columns = np.broadcast_arrays(place[:, :, None], place[:, None, :])
        size = len(mesh.nodes(2)) * dim
        found = sp.coo_array((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).toarray()
        expected = stiffness_matrix(mesh, material, 2).toarray()
        assert np.abs(found - expected).max() < 1e-12 * math.factorial(dim) * np.abs(expected).max()
