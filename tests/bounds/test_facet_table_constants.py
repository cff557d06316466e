"""Constants of cells by closed formulas, against those that are computed for each shape."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.oscillation import local_constants
from hemivar.mesh import Mesh

from .simplex_constants import simplex_constants


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_constants_of_cells_grow_with_the_length_and_of_facets_with_its_root(size: float) -> None:
    """They bound what is proved for a triangle of any size and shape, and by how much they do depends on no size."""
    stiffness = hv.Material.lame(4.0, 3.0).stiffness_tensor(np.zeros((1, 2)))[0]
    for corners in (np.array([[0.0, 0.0], [1.0, 0.0], [0.2, 0.7]]), np.array([[0.0, 0.0], [2.0, 0.1], [0.5, 0.6]])):
        cell, facet = simplex_constants(corners, np.linalg.inv(stiffness))
        one, other = (
            local_constants(facet_table(Mesh.oriented(scale * corners, [[0, 1, 2]])), stiffness[None])
            for scale in (1.0, size)
        )
        np.testing.assert_allclose(other.cell, size * one.cell, rtol=1e-9)
        np.testing.assert_allclose(other.facet, np.sqrt(size) * one.facet, rtol=1e-9)
        assert size * cell <= other.cell[0]
        assert np.sqrt(size) * facet <= other.facet.max()
