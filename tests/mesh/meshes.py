"""Meshes that several tests use."""

from __future__ import annotations

import numpy as np
import skfem

from hemivar.mesh import Mesh


def cube(cells: int = 2) -> Mesh:
    """The unit cube cut into tetrahedra."""
    grid = np.linspace(0.0, 1.0, cells + 1)
    raw = skfem.MeshTet.init_tensor(grid, grid, grid)
    mesh = Mesh.oriented(raw.p.T, raw.t.T.astype(int))
    return mesh.with_boundaries(
        {
            "bottom": lambda x: x[:, 2] < 1e-12,
            "top": lambda x: x[:, 2] > 1 - 1e-12,
            "left": lambda x: x[:, 0] < 1e-12,
            "front": lambda x: x[:, 1] < 1e-12,
        }
    )


def distorted(mesh: Mesh) -> Mesh:
    """The mesh with its inner nodes shifted at random."""
    inner = np.ones(mesh.number_of_nodes, dtype=bool)
    inner[mesh.boundary_facets.ravel()] = False
    rng = np.random.default_rng(3)
    shift = 0.1 * mesh.size * rng.uniform(-1, 1, mesh.points.shape) * inner[:, None]
    return Mesh(mesh.points + shift, mesh.cells, dict(mesh.boundaries), dict(mesh.regions))
