"""What a workspace spares certificates, searches and paths, and that it changes none of their answers."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

import hemivar as hv
from hemivar.bounds import body_data as cells_of_bounds
from hemivar.bounds import cell_kinds, sweeps
from hemivar.bounds.exact_certificate import distance_to_exact
from hemivar.kernels import kernels
from hemivar.mesh.mesh import Mesh
from hemivar.systems import Workspace
from tests.certificates.test_workspace import STATEMENT


@pytest.mark.parametrize("order", [1, 2])
def test_bounds_share_what_belongs_to_mesh_and_material(order: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    def watch(owner: object, name: str) -> None:
        original = getattr(owner, name)

        def counting(*arguments: object, **options: object) -> object:
            calls.append(name)
            return original(*arguments, **options)

        monkeypatch.setattr(owner, name, counting)

    watch(cells_of_bounds, "facet_table")
    watch(cell_kinds, "congruent_cells")
    watch(sweeps.PatchSmoother, "_grouped")
    stated = replace(STATEMENT, order=order)
    mesh, kept = stated.mesh, Workspace()
    named = Mesh(mesh.points, mesh.cells, {**mesh.boundaries, "more": mesh.boundaries["top"]}, dict(mesh.regions))
    whole = {"facet_table", "congruent_cells", "_grouped"}
    for changed, made in (
        (stated, whole),
        (replace(stated, body_force=(0.1, -0.2)), set()),
        (replace(stated, contact={"bottom": hv.Contact(hv.Compliance(3.0))}), set()),
        (replace(stated, mesh=named, tractions={"more": (0.0, -0.1)}), set()),
        (replace(stated, supports={**stated.supports, "right": hv.Clamped()}), {"_grouped"}),
        (replace(stated, material=hv.Material.lame(3.0, 2.0)), {"congruent_cells", "_grouped"}),
        (replace(stated, mesh=mesh.refined()), whole),
    ):
        problem = hv.discretize(changed)
        solution = hv.solve(problem)
        calls.clear()
        found = distance_to_exact(problem, solution.unknowns, workspace=kept)
        if kernels() is not None:
            assert set(calls) & whole == made
        alone = distance_to_exact(problem, solution.unknowns)
        assert math.isfinite(found.bound)
        assert found.bound == alone.bound
