"""Meshes of several parts, and curves and surfaces inside a body that are opened."""

from __future__ import annotations

import pickle
from collections import defaultdict
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar import Mesh
from hemivar.errors import ProblemError
from hemivar.mesh.write import msh_text


def checked(mesh: Mesh) -> Mesh:
    """The mesh by its constructor, which checks all that it holds."""
    return Mesh(mesh.points, mesh.cells, mesh.boundaries, mesh.regions, mesh.parent, None, mesh.interfaces)


def between(mesh: Mesh, height: float, axis: int = 1) -> Mesh:
    """With regions steel above a height and rubber below."""
    middle = mesh.points[mesh.cells].mean(axis=1)[:, axis]
    return mesh.named(
        mesh.boundaries, {"steel": np.flatnonzero(middle > height), "rubber": np.flatnonzero(middle < height)}
    )


# ---- assembled -----------------------------------------------------------------------------------------------------


def two_parts() -> Mesh:
    upper = between(hv.rectangle((1.0, 1.0), (8, 8), origin=(0.0, 1.0)), 1.5)
    return Mesh.assembled({"upper": upper, "lower": hv.rectangle((2.0, 1.0), 4).refined()})


def test_names_of_parts_come_before_their_own() -> None:
    mesh = checked(two_parts())
    assert list(mesh.boundaries)[:2] == ["upper:left", "upper:right"]
    assert list(mesh.regions) == ["upper", "upper:steel", "upper:rubber", "lower"]
    assert mesh.volumes[mesh.regions["upper:steel"]].sum() == pytest.approx(0.5)
    assert mesh.volumes[mesh.regions["lower"]].sum() == pytest.approx(2.0)
    bottom = mesh.points[mesh.boundaries["upper:bottom"]]
    assert (bottom[..., 1] == 1.0).all()
    assert mesh.parts.count == 2
    assert [mesh.parts.name(mesh, part) for part in (0, 1)] == ["upper", "lower"]


def test_parts_with_steps_of_their_own_keep_all_of_them() -> None:
    """The upper part can be made coarser twice and the lower one three times; each step is a refinement."""
    mesh: Mesh = two_parts()
    sizes = []
    while mesh.parent is not None:
        checked(mesh)
        mesh = mesh.parent.mesh
        sizes.append([int(np.count_nonzero(mesh.parts.cell == part)) for part in (0, 1)])
    assert sizes[0] == [32, 32]
    refined = checked(two_parts().refined().refined_where([0, 3]))
    assert set(refined.boundaries) == set(two_parts().boundaries)


def test_an_assembled_mesh_is_a_part_of_another() -> None:
    mesh = Mesh.assembled({"tower": two_parts(), "base": hv.rectangle((3.0, 1.0), 2, origin=(0.0, -1.0))})
    assert "tower:upper:bottom" in mesh.boundaries
    assert checked(mesh).parts.count == 3


def test_an_assembled_mesh_goes_to_another_process() -> None:
    mesh = two_parts()
    there = pickle.loads(pickle.dumps(mesh))
    np.testing.assert_array_equal(there.cells, mesh.cells)
    assert there.recipe == mesh.recipe


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({}, "give a dict of meshes by names"),
        ([hv.rectangle()], "give a dict of meshes by names"),
        ({"a:b": hv.rectangle()}, "give a name without a colon"),
        ({"": hv.rectangle()}, "give a name without a colon"),
        ({"a": 3.0}, "part 'a' is a float; give a Mesh"),
        ({"a": hv.rectangle(), "b": hv.box(cells=1)}, "part 'a' is plane and part 'b' is not"),
    ],
)
def test_what_is_no_set_of_meshes_is_refused(parts: object, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        Mesh.assembled(parts)  # type: ignore[arg-type]


def test_facets_of_two_parts_may_lie_at_one_place() -> None:
    one, other = hv.rectangle((1.0, 1.0), 2), hv.rectangle((1.0, 1.0), 2, origin=(1.0, 0.0))
    points, cells = np.vstack([one.points, other.points]), np.vstack([one.cells, other.cells + len(one.points)])
    assert Mesh(points, cells, {"left": one.boundaries["left"]}).parts.count == 2


def test_a_part_that_nothing_holds_is_called_by_its_name() -> None:
    problem = hv.ContactProblem(
        two_parts(), hv.Material.young(10.0, 0.3), {}, {"lower:bottom": hv.Clamped()}, body_force=(0.1, 0.0)
    )
    with pytest.raises(hv.HemivarError, match="part 'upper' of the body"):
        hv.solve(problem)


# ---- opened --------------------------------------------------------------------------------------------------------


def by_brute_force(mesh: Mesh, facets: np.ndarray) -> int:
    """Nodes that opening adds: sets of cells at a node that are joined through closed facets at it, less one each."""
    closed = {frozenset(facet) for facet in mesh.inner_facets.tolist()} - {frozenset(f) for f in facets.tolist()}
    at: dict[int, list[int]] = defaultdict(list)
    for cell, nodes in enumerate(mesh.cells.tolist()):
        for node in nodes:
            at[node].append(cell)
    more = 0
    for node in set(facets.ravel().tolist()):
        sets = [{cell} for cell in at[node]]
        for one, other in combinations(at[node], 2):
            shared = frozenset(mesh.cells[one].tolist()) & frozenset(mesh.cells[other].tolist())
            if node in shared and shared in closed:
                first, second = (next(found for found in sets if cell in found) for cell in (one, other))
                if first is not second:
                    sets.remove(second)
                    first |= second
        more += len(sets) - 1
    return more


def on_curves(x: np.ndarray) -> dict[str, np.ndarray]:
    up, across = np.abs(x[:, 0] - 1.0) < 1e-9, np.abs(x[:, 1] - 0.5) < 1e-9
    box = np.maximum(np.abs(x[:, 0] - 1.0), np.abs(x[:, 1] - 0.5))
    return {
        "through": up,
        "crack": across & (np.abs(x[:, 0] - 1.0) < 0.5),
        "edge crack": across & (x[:, 0] < 1.0),
        "cross": up | across,
        "T": up & (x[:, 1] < 0.5) | across & (x[:, 0] > 0.5),
        "closed": np.abs(box - 0.25) < 1e-9,
        "two": np.abs(np.abs(x[:, 0] - 1.0) - 0.5) < 1e-9,
        "touching": (np.abs(box - 0.25) < 1e-9) | up & (x[:, 1] > 0.75),
    }


PLANE = hv.rectangle((2.0, 1.0), (16, 8))
SIDES = {
    "through": 2, "crack": 2, "edge crack": 2, "cross": 4, "T": 3, "closed": 2, "two": 2,
}  # fmt: skip


@pytest.mark.parametrize("name", SIDES)
@pytest.mark.parametrize("pattern", ["right", "cross"])
def test_nodes_and_sides_of_opened_curves(name: str, pattern: str) -> None:
    mesh = hv.rectangle((2.0, 1.0), (16, 8), pattern)  # type: ignore[arg-type]
    mesh = mesh.with_interfaces({"glue": lambda x: on_curves(x)[name]})
    found = checked(mesh.opened("glue"))
    facets = mesh.interfaces["glue"]
    assert found.number_of_nodes - mesh.number_of_nodes == by_brute_force(mesh, facets)
    sides = [side for side in found.boundaries if side.startswith("glue:")]
    assert sides == [f"glue:{k + 1}" for k in range(SIDES[name])]
    assert sum(len(found.boundaries[side]) for side in sides) == 2 * len(facets)
    assert "glue" not in found.interfaces
    assert len(found.boundary_facets) == len(mesh.boundary_facets) + 2 * len(facets)
    np.testing.assert_allclose(found.volumes, mesh.volumes)


@pytest.mark.parametrize("name", ["through", "crack", "closed", "two"])
def test_each_side_is_one_side(name: str) -> None:
    """Side 2 lies where side 1 lies, with normals that are opposite; side 1 has the cell with the smallest number."""
    mesh = PLANE.with_interfaces({"glue": lambda x: on_curves(x)[name]})
    found = mesh.opened("glue")
    one, two = found.boundaries["glue:1"], found.boundaries["glue:2"]
    middle = [found.points[side].mean(axis=1) for side in (one, two)]
    order = [np.lexsort(np.round(points, 9).T) for points in middle]
    np.testing.assert_allclose(middle[0][order[0]], middle[1][order[1]])
    normals = [found.facet_normals(side)[0][way] for side, way in zip((one, two), order, strict=True)]
    np.testing.assert_allclose(normals[0], -normals[1])
    least = [min(k for k, cell in enumerate(found.cells.tolist()) if set(f) <= set(cell)) for f in one[:1].tolist()]
    assert least


@pytest.mark.parametrize("mesh", [PLANE, hv.box((2.0, 1.0, 1.0), (4, 4, 4))], ids=["plane", "space"])
def test_sides_between_regions_have_their_names(mesh: Mesh) -> None:
    two = between(mesh, 0.5)
    found = checked(two.opened("glue", between=("steel", "rubber")))
    assert [name for name in found.boundaries if ":" in name] == ["glue:rubber", "glue:steel"]
    below = found.facet_normals(found.boundaries["glue:rubber"])[0]
    np.testing.assert_allclose(below[:, 1], 1.0)
    assert found.parts.count == 2
    assert {found.parts.name(found, part) for part in (0, 1)} == {"steel", "rubber"}


def test_a_crack_in_space_is_closed_at_its_front() -> None:
    mesh = hv.box((1.0, 1.0, 1.0), 8).with_interfaces(
        {"penny": lambda x: (np.abs(x[:, 2] - 0.5) < 1e-9) & (np.hypot(x[:, 0] - 0.5, x[:, 1] - 0.5) < 0.3)}
    )
    found = checked(mesh.opened("penny"))
    assert found.parts.count == 1
    assert found.number_of_nodes - mesh.number_of_nodes == by_brute_force(mesh, mesh.interfaces["penny"]) > 0
    measure = [found.facet_normals(found.boundaries[f"penny:{k}"])[1].sum() for k in (1, 2)]
    assert measure[0] == pytest.approx(measure[1])


@pytest.mark.parametrize("name", ["through", "crack", "T", "closed"])
def test_coarser_meshes_open_as_well(name: str) -> None:
    mesh = hv.rectangle((2.0, 1.0), (8, 4)).refined().with_interfaces({"glue": lambda x: on_curves(x)[name]})
    found = checked(mesh.opened("glue"))
    assert found.parent is not None
    coarse = checked(found.parent.mesh)
    assert set(coarse.boundaries) == set(found.boundaries)
    ahead = coarse.refined()
    assert ahead.number_of_nodes == found.number_of_nodes
    same = [np.unique(np.round(one.points, 9), axis=0, return_counts=True)[1] for one in (ahead, found)]
    np.testing.assert_array_equal(*same)
    side = found.boundaries["glue:1"]
    linear = found.parent.interpolation @ coarse.points[:, :1]
    np.testing.assert_allclose(linear[side.ravel(), 0], found.points[side.ravel(), 0], atol=1e-12)
    jump = np.zeros(coarse.number_of_nodes)
    jump[coarse.boundaries["glue:1"]] = 1.0
    jump[coarse.boundaries["glue:2"]] -= 1.0
    finer = found.parent.interpolation @ jump
    assert finer[found.boundaries["glue:1"]].min() >= 0.0
    assert finer[found.boundaries["glue:2"]].max() <= 0.0


def test_other_interfaces_and_boundaries_stay() -> None:
    mesh = PLANE.with_interfaces({name: lambda x, name=name: on_curves(x)[name] for name in ("through", "edge crack")})
    found = checked(mesh.opened("through"))
    assert set(found.interfaces) == {"edge crack"}
    both = checked(found.opened("edge crack"))
    assert both.parts.count == 3
    assert len(both.boundaries["bottom"]) == 16
    finer = both.refined_where(np.arange(10))
    assert len(checked(finer).boundaries["through:1"]) >= len(both.boundaries["through:1"])


def pieces(names: str) -> Mesh:
    """Region A above the middle, and below it B, one piece at the left side and one cell of it in the middle."""
    x = PIECES.points[PIECES.cells].mean(axis=1)
    below = (x[:, 0] < 0.26) | (x[:, 0] > 0.5) & (x[:, 0] < 0.75)
    regions = {"A": (x[:, 1] > 0.5) & (x[:, 0] < 1.0), "B": (x[:, 1] < 0.5) & below}
    return PIECES.named(PIECES.boundaries, {name: np.flatnonzero(regions[name]) for name in names})


PIECES = hv.rectangle((2.0, 1.0), (8, 4))


def test_a_facet_that_stays_closed_is_told() -> None:
    """Of a square inside of a body, cut in triangles, those at two corners have all nodes at the ends."""
    mesh = hv.box((1.0, 1.0, 1.0), 4).with_interfaces(
        {"square": lambda x: (np.abs(x[:, 2] - 0.5) < 1e-9) & (np.abs(x[:, :2] - 0.5) < 0.25).all(axis=1)}
    )
    facets = mesh.interfaces["square"]
    rim = np.abs(np.abs(mesh.points[facets][..., :2] - 0.5).max(axis=2) - 0.25) < 1e-9
    found = checked(mesh.opened("square"))
    closed = int(np.count_nonzero(rim.all(axis=1)))
    assert len(found.boundaries["square:1"]) == len(facets) - closed
    assert (
        mesh.opened("square")
        .notes[-1]
        .startswith(f"interface 'square': {closed} of its {len(facets)} facets stay closed, the first at (")
    )
    assert closed > 0
    assert not PLANE.with_interfaces({"a": lambda x: on_curves(x)["crack"]}).opened("a").notes


@pytest.mark.parametrize("name", ["through", "crack", "T", "closed"])
def test_other_boundaries_leave_the_sides_of_an_opening(name: str) -> None:
    opened = PLANE.with_interfaces({"glue": lambda x: on_curves(x)[name]}).opened("glue")
    found = checked(opened.with_boundaries({"roof": lambda x: x[:, 1] > 0.99}))
    sides = [f"glue:{k + 1}" for k in range(SIDES[name])]
    assert list(found.boundaries) == [*sides, "roof"]
    for side in sides:
        np.testing.assert_array_equal(found.boundaries[side], opened.boundaries[side])
    again = checked(opened.scaled(3.0).rotated(0.3).with_boundaries({"glue:1": opened.boundaries["glue:1"]}))
    assert list(again.boundaries) == sides


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda mesh: mesh.opened("glu"), "the mesh has no interface 'glu'; did you mean 'glue'"),
        (lambda mesh: mesh.opened("top"), "'top' is a boundary, which is open already"),
        (lambda mesh: mesh.opened("x", between=("steel", "steel")), "give the names of two regions"),
        (lambda mesh: mesh.opened("x", between=("steel", "wood")), "the mesh has no region 'wood'"),
        (lambda mesh: mesh.opened("glue", between=("steel", "rubber")), "has an interface 'glue' already"),
        (lambda mesh: mesh.with_interfaces({"glue": mesh.boundaries["top"]}), "does not lie between two cells"),
        (lambda mesh: mesh.with_interfaces({"top": mesh.interfaces["glue"]}), "names a boundary and an interface"),
        (lambda mesh: mesh.with_boundaries({"glue": mesh.boundaries["top"]}), "names a boundary and an interface"),
        (lambda mesh: mesh.with_interfaces({"glue": []}), "interface 'glue' holds no facets"),
        (lambda mesh: mesh.with_interfaces({"glue": [[0, 1, 2]]}), "must list 2 nodes per facet"),
        (lambda mesh: mesh.with_interfaces({"glue": lambda x: x[:, 0]}), "must return a bool mask"),
        (lambda mesh: mesh.with_interfaces({"one": mesh.interfaces["glue"][3:4]}).opened("one"), "so nothing opens"),
        (lambda mesh: mesh.opened("glue").named({"top": mesh.boundaries["top"]}, {}), "the body is cut"),
        (lambda mesh: pieces("AB").opened("g", between=("A", "B")), "its piece at \\(0.625, 0.5\\) has no node away"),
        (lambda mesh: mesh.with_interfaces({"a": lambda x: on_curves(x)["touching"]}).opened("a"), "both sides of"),
    ],
)
def test_what_does_not_open_is_refused(change: object, message: str) -> None:
    mesh = between(PLANE, 0.5).with_interfaces({"glue": lambda x: on_curves(x)["crack"]})
    with pytest.raises(ProblemError, match=message):
        change(mesh)  # type: ignore[operator]


# ---- files ---------------------------------------------------------------------------------------------------------


def test_a_mesh_file_keeps_what_lies_inside(tmp_path: Path) -> None:
    mesh = between(PLANE, 0.5).with_interfaces({"glue": lambda x: on_curves(x)["through"]})
    path = tmp_path / "mesh.msh"
    path.write_text(msh_text(mesh))
    again = hv.read_mesh(path)
    assert list(again.interfaces) == ["glue"]
    assert len(again.interfaces["glue"]) == 8
    assert set(again.boundaries) == set(mesh.boundaries)
    opened = again.opened("glue")
    path.write_text(msh_text(opened))
    assert set(hv.read_mesh(path).boundaries) == set(opened.boundaries)
