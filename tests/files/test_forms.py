"""Bodies by bases and forms of scikit-fem: against the library's own elements, and mixed bodies in closed form."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import skfem
from scipy.spatial import cKDTree

import hemivar as hv
from tests.fem.test_forms import RUBBED, grid, pressed_form


@pytest.mark.parametrize(
    ("mesh", "element", "cells"),
    [
        (skfem.MeshTri, skfem.ElementTriP1, 18),
        (skfem.MeshTri, skfem.ElementTriP2, 18),
        (skfem.MeshQuad, skfem.ElementQuad1, 18),
        (skfem.MeshQuad, skfem.ElementQuad2, 72),
        (skfem.MeshTet, skfem.ElementTetP1, 162),
        (skfem.MeshTet, skfem.ElementTetP2, 162),
        (skfem.MeshHex, skfem.ElementHex1, 162),
        (skfem.MeshHex, skfem.ElementHex2, 1296),
    ],
    ids=lambda part: getattr(part, "__name__", ""),
)
def test_a_file_holds_the_field_at_the_nodes_of_the_basis(mesh: Any, element: Any, cells: int, tmp_path: Path) -> None:
    basis = skfem.Basis(grid(mesh, 3), skfem.ElementVector(element()))
    body = pressed_form(basis)
    problem = body.problem({"bottom": RUBBED}, at=1 if element is skfem.ElementTetP2 else "nodes")
    found = hv.solve(problem)
    written = meshio.read(found.to_vtu(tmp_path / "body.vtu"))
    assert sum(len(block.data) for block in written.cells) == cells
    whole, dim = body.full(problem, found.unknowns), basis.mesh.p.shape[0]
    off, node = cKDTree(written.points[:, :dim]).query(basis.doflocs.T)
    assert off.max() < 1e-14
    components = np.empty(basis.N, dtype=int)  # the unknowns of a place follow one another
    components[np.asarray(basis.element_dofs)] = (np.arange(len(basis.element_dofs)) % dim)[:, None]
    np.testing.assert_allclose(written.point_data["displacement"][node, components], whole, atol=1e-15)
    field = problem.field
    assert field is not None
    assert field.mesh.volumes.sum() == pytest.approx(1.0)
    sides = field.mesh.facet_normals(field.mesh.boundary_facets)[1]
    assert sides.sum() == pytest.approx(2.0 * dim)  # nothing is open between cells
    assert field.mesh.facet_normals(field.mesh.boundaries["bottom"])[1].sum() == pytest.approx(1.0)
    touching = written.point_data["boundary"] >= 0
    if element is not skfem.ElementTetP2:
        np.testing.assert_allclose(written.points[touching, dim - 1], 0.0, atol=1e-14)
        assert touching.sum() == len(problem.contact.weights)
