"""What a boundary is for integrals and means: made once, and right on any facets."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array, IntArray
from hemivar.mesh.boundary_rule import BoundaryRule, boundary_rule

MATERIAL = hv.Material.young(100.0, 0.3)
MESHES = {"plane": hv.rectangle((2.0, 1.0), (4, 3)), "space": hv.box((2.0, 1.0, 1.0), (2, 2, 1))}


@pytest.mark.parametrize("name", MESHES)
def test_the_whole_boundary_closes_and_has_its_area(name: str) -> None:
    rule = boundary_rule(MESHES[name], None)
    assert rule.weights.sum() == pytest.approx({"plane": 6.0, "space": 10.0}[name], rel=1e-14)
    assert np.abs(rule.weights @ rule.normals).max() < 1e-14


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", MESHES)
def test_summed_normals_of_a_side_are_its_direction_times_what_is_around(name: str, order: int) -> None:
    rule = boundary_rule(MESHES[name], "bottom", order)
    assert rule.order == order
    nodes, number, summed = rule.summed_normals()
    np.testing.assert_array_equal(nodes[number], rule.nodes.ravel())
    around = [rule.weights[(rule.nodes == node).any(axis=1)].sum() for node in nodes]
    np.testing.assert_allclose(summed, np.outer(around, rule.normals[0]), atol=1e-14)
    halved = rule.summed_normals(np.full(rule.nodes.shape, 0.5))[2]
    np.testing.assert_allclose(halved, 0.5 * summed, atol=1e-14)
    first = rule.take(np.array([0]))
    np.testing.assert_array_equal(np.sort(rule.nodes[0]), first.summed_normals()[0])
    np.testing.assert_allclose(first.widths ** (MESHES[name].dim - 1), rule.weights[:1], rtol=1e-14)


def test_a_solve_asks_each_mesh_once_for_the_normals_of_a_boundary(monkeypatch: pytest.MonkeyPatch) -> None:
    """Supports, loads, contact with an obstacle, and two bodies with curved sides."""
    asked: Counter[tuple[int, bytes]] = Counter()
    normals, meshes = hv.Mesh.facet_normals, []

    def counted(mesh: hv.Mesh, facets: IntArray) -> tuple[Array, Array]:
        meshes.append(mesh)  # so that no other one takes its place in memory
        asked[id(mesh), facets.tobytes()] += 1
        return normals(mesh, facets)

    monkeypatch.setattr(hv.Mesh, "facet_normals", counted)
    upper = hv.rectangle((1.0, 1.0), (4, 4), origin=(0.0, 1.0))
    mesh = hv.Mesh.assembled({"u": upper, "l": hv.rectangle((1.0, 1.0), (3, 3))})
    ground = hv.Plane(normal=(0.0, 1.0), point=(0.0, 0.0))
    contact = {
        "u:bottom": hv.Contact(hv.Signorini(), hv.Tresca(0.1), against="l:top"),
        "l:bottom": hv.Contact(hv.Compliance(50.0), obstacle=ground),
    }
    problem = hv.ContactProblem(
        mesh, MATERIAL, contact, {"l:left": "roller", "u:left": "roller"}, tractions={"u:top": hv.Pressure(1.0)}
    )
    solution = hv.solve(problem)
    assert solution.reactions
    assert set(asked.values()) == {1}


def test_facets_of_no_name_have_a_rule_of_their_own() -> None:
    mesh = MESHES["plane"]
    rule = BoundaryRule.of(mesh, mesh.boundaries["left"][:2], 2)
    np.testing.assert_allclose(rule.normals, [[-1.0, 0.0]] * 2, atol=1e-15)
    assert rule.nodes.shape == (2, 3)
