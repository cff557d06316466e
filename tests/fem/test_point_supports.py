"""Supports of points and of sets of nodes, and the support that holds a body and nothing more."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError, SupportError
from hemivar.fem import LoadLine
from hemivar.fem.hierarchy import coarser
from hemivar.fem.supports import stated_supports
from hemivar.mechanics import minimal_support
from hemivar.mesh import Mesh
from hemivar.solvers import NonsmoothMultigrid

STEEL = hv.Material.young(10.0, 0.3)


def balanced(x: Array) -> Array:
    """A stretch along the first axis, sheared in balance."""
    return np.column_stack([x[:, 0] - 1.0, *([np.zeros(len(x))] * (x.shape[1] - 1))])


def free_body(dim: int, order: int = 1) -> hv.ContactProblem:
    """Stretched by opposite forces, with a strain of its own that varies: it stands in no stress-free shape."""
    mesh = hv.rectangle((2.0, 1.0), (4, 2)) if dim == 2 else hv.box((2.0, 1.0, 1.0), (3, 2, 2))
    pull = (1.0, *(0.0,) * (dim - 1))
    loads = {"left": tuple(-one for one in pull), "right": pull}
    return hv.ContactProblem(mesh, STEEL, tractions=loads, order=order, initial_strain="0.01*x^2 + 0.02*y^2")


def turned_supports(supports: dict[str, hv.Fixed], mesh: Mesh, dim: int) -> dict[str, hv.Fixed]:
    """Another minimal support: at the images of its points under the reflection of the box."""
    centre = mesh.points.min(axis=0) + mesh.points.max(axis=0)
    return {name: replace(one, at=centre - np.array(one.at)) for name, one in supports.items()}


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1)])
def test_the_stress_of_a_free_body_does_not_depend_on_how_it_is_held(dim: int, order: int) -> None:
    body = free_body(dim, order)
    supports = minimal_support(body.mesh)
    assert sum(len([c for c in (one.x, one.y, one.z) if c is not None]) for one in supports.values()) == 3 * (dim - 1)
    one, other = (hv.solve(replace(body, supports=s)) for s in (supports, turned_supports(supports, body.mesh, dim)))
    size = np.abs(one.stress()).max()
    assert one.stress() == pytest.approx(other.stress(), abs=1e-9 * size)
    assert np.abs(one.displacement - other.displacement).max() > 0.01
    for reaction in [*one.reactions.values(), *other.reactions.values()]:
        assert reaction == pytest.approx(np.zeros(dim), abs=1e-11)


def test_a_free_strain_makes_no_stress() -> None:
    """A linear field of strain fulfils the compatibility of the plane."""
    body = replace(free_body(2), tractions={}, initial_strain="0.01*x + 0.02*y", order=2)
    solution = hv.solve(replace(body, supports=minimal_support(body.mesh)))
    assert np.abs(solution.stress()).max() < 1e-12
    assert np.abs(solution.displacement).max() > 0.01


def test_reactions_of_a_minimal_support_are_what_misses_in_the_balance() -> None:
    """A cantilever held at three components: forces and moment follow from statics alone."""
    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    solution = hv.solve(hv.ContactProblem(mesh, STEEL, {}, minimal_support(mesh), tractions={"right": (0.0, -1.0)}))
    # held at (0, 0) in x and y and at (2, 1) in y; the force 1 acts at x = 2
    assert solution.reactions["minimal 1"] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert solution.reactions["minimal 2"] == pytest.approx([0.0, 1.0], rel=1e-12)


def test_a_body_of_revolution_is_held_along_its_axis() -> None:
    mesh, steel = hv.rectangle((1.0, 1.0), 3, origin=(1.0, 0.0)), hv.Material.young(10.0, 0.3, plane="axisymmetric")
    supports = minimal_support(mesh, axisymmetric=True)
    loads = {"top": (0.0, -1.0), "bottom": (0.0, 1.0)}
    solution = hv.solve(hv.ContactProblem(mesh, steel, {}, supports, tractions=loads))
    assert solution.displacement[:, 1] == pytest.approx(-0.1 * mesh.points[:, 1], abs=1e-12)
    assert solution.reactions["minimal 1"] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_levels_of_multigrid_hold_the_same_points() -> None:
    mesh = hv.box(cells=1).refined(2)
    supports = minimal_support(mesh)
    assert supports == minimal_support(hv.box(cells=1))
    loads = {"left": (-1.0, 0.0, 0.0), "right": (1.0, 0.0, 0.0)}
    problem = hv.ContactProblem(mesh, STEEL, {}, supports, tractions=loads)
    solution = hv.solve(problem, method=NonsmoothMultigrid())
    assert solution.stress()[:, 0, 0] == pytest.approx(1.0, abs=1e-7)


def test_points_that_are_no_nodes_of_coarser_levels_do_not_matter() -> None:
    """The two points lie at one node of the coarsest mesh, and are displaced differently."""
    mesh = hv.rectangle((2.0, 1.0), (2, 1)).refined(3)
    supports = {
        "base": hv.Clamped(at=(0.0, 0.0)),
        "one": hv.Fixed(y=0.01, at=(1.125, 1.0)),
        "other": hv.Fixed(y=0.02, at=(0.875, 1.0)),
        "right": hv.Fixed(x=0.0),
    }
    problem = hv.ContactProblem(mesh, STEEL, {"bottom": hv.Contact(hv.Signorini())}, supports, body_force=(0.0, -0.1))
    level, counts = hv.discretize(problem), list[int]()
    while (step := coarser(level)) is not None:
        level = step.problem
        counts.append(int((stated_supports(level.origin).count > 0).sum()))  # type: ignore[arg-type]
    assert counts == [5 + 1 + 1, 3 + 1 + 1, 2 + 1 + 1]  # of the right side, the corner, and one for the two points


def test_the_force_of_a_point_is_the_one_that_is_applied() -> None:
    """Two pins under a beam, and its load at a third of the way."""
    pins = {"left pin": hv.Clamped(at=(0.0, 0.0)), "right pin": hv.Fixed(y=0.0, at=(2.0, 0.0))}
    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    solution = hv.solve(hv.ContactProblem(mesh, STEEL, {}, pins, tractions={"top": (0.0, "-x")}))
    assert solution.reactions["left pin"] == pytest.approx([0.0, 2.0 / 3.0], rel=1e-12, abs=1e-12)
    assert solution.reactions["right pin"] == pytest.approx([0.0, 4.0 / 3.0], rel=1e-12)


def test_the_distance_of_a_point_from_its_node_is_said() -> None:
    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    near = {"pin": hv.Clamped(at=(0.01, 0.0)), "slide": hv.Fixed(y=0.0, at=(2.0, 0.0))}
    problem = hv.ContactProblem(mesh, STEEL, {}, near)
    (said,) = hv.discretize(problem).warnings
    assert "'pin': the nearest node of x = (0.01, 0) is 0.01 away" in said
    on = replace(problem, supports={**near, "pin": hv.Clamped(at=(0.0, 0.0))})
    assert not hv.discretize(on).warnings
    middle = replace(problem, supports={**near, "pin": hv.Clamped(at=(0.25, 0.0))}, order=2)
    assert not hv.discretize(middle).warnings  # a node of second order


def test_both_sides_of_an_opened_interface_are_held() -> None:
    whole = hv.rectangle((1.0, 1.0), 2)
    cut = np.flatnonzero(whole.points[:, 1] == 0.5)
    cut = cut[np.argsort(whole.points[cut, 0])]
    mesh = whole.with_interfaces({"cut": np.column_stack([cut[:-1], cut[1:]])}).opened("cut")
    supports = {"pin": hv.Clamped(at=(0.0, 0.5)), "slide": hv.Fixed(y=0.0, at=(1.0, 0.5))}
    solution = hv.solve(hv.ContactProblem(mesh, STEEL, {}, supports, tractions={"top": (0.0, 1.0)}))
    assert solution.reactions["pin"] + solution.reactions["slide"] == pytest.approx([0.0, -1.0], abs=1e-12)


def test_prescribed_points_move_in_time_and_on_paths() -> None:
    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    pins = {"pin": hv.Clamped(at=(0.0, 0.0)), "slide": hv.Fixed(y="0.01*t", at=(2.0, 0.0))}
    history = hv.march(hv.Evolution(hv.ContactProblem(mesh, STEEL, {}, pins)), until=1.0, step=0.5)
    turned = 0.005 * np.column_stack([-mesh.points[:, 1], mesh.points[:, 0]])
    assert history.frames[-1].displacement == pytest.approx(turned, abs=1e-10)
    still = hv.ContactProblem(mesh, STEEL, {}, {**pins, "slide": hv.Fixed(y=0.01, at=(2.0, 0.0))})
    assert hv.solve(LoadLine.of(still).at(0.5)).displacement == pytest.approx(0.5 * turned, abs=1e-12)


MSH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
0 1 "pin"
1 2 "right"
2 3 "body"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 1 1 0
4 0 1 0
$EndNodes
$Elements
4
1 15 2 1 1 1
2 1 2 2 1 2 3
3 2 2 3 1 1 2 3
4 2 2 3 1 1 3 4
$EndElements
"""


def test_supports_name_sets_of_nodes_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "body.msh").write_text(MSH)
    mesh = hv.read_mesh(tmp_path / "body.msh")
    assert {name: nodes.tolist() for name, nodes in mesh.node_sets.items()} == {"pin": [0]}
    supports = {"pin": hv.Clamped(), "right": hv.Fixed(x=0.0)}
    named = hv.ContactProblem(mesh.refined(), STEEL, {}, supports, body_force=(1.0, -1.0))
    by_point = replace(named, supports={"here": hv.Clamped(at=(0.0, 0.0)), "right": hv.Fixed(x=0.0)})
    one, other = hv.solve(named), hv.solve(by_point)
    assert np.array_equal(one.displacement, other.displacement)
    assert np.array_equal(one.reactions["pin"], other.reactions["here"])


def test_sets_of_nodes_follow_refinement_and_assembly() -> None:
    edge = np.array([0, 1])
    mesh = hv.box(cells=1)
    mesh = mesh.made_by(None, replace(mesh.reading, node_sets={"edge": edge}))
    fine = mesh.refined()
    middle = 0.5 * (mesh.points[0] + mesh.points[1])
    on = fine.points[fine.node_sets["edge"]]
    assert len(on) == 3
    assert (on == middle).all(axis=1).any()
    both = Mesh.assembled({"a": hv.box(cells=1), "b": mesh})
    assert np.array_equal(both.points[both.node_sets["b:edge"]], mesh.points[edge])
    problem = hv.ContactProblem(mesh, STEEL, {}, {"edge": hv.Clamped()}, order=2)
    with pytest.raises(SupportError, match="rotation"):
        hv.discretize(replace(problem, body_force=(1.0, 0.5, 0.2)))
    assert hv.discretize(problem, check_coercivity=False).unknowns == 3 * (len(mesh.nodes(2)) - 3)


@pytest.mark.parametrize(
    ("supports", "says"),
    [
        ({"pin": hv.Clamped(at=(0.0, 0.0, 0.0))}, "points of 3 coordinates, the mesh has 2"),
        ({"left": hv.Clamped(at=(0.0, 0.0))}, "'left' is a boundary; give the points another name"),
        ({"pin": hv.Clamped()}, "names boundary 'pin'"),
        ({"one": hv.Clamped(at=(0.0, 0.0)), "left": hv.Fixed(x=0.1)}, "prescribe different displacements at node 0"),
    ],
)
def test_bad_points_are_refused(supports: dict[str, object], says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        hv.discretize(hv.ContactProblem(hv.rectangle((1.0, 1.0), 2), STEEL, {}, supports))  # type: ignore[arg-type]


def test_a_point_of_no_numbers_is_refused() -> None:
    with pytest.raises(ProblemError, match="give a point"):
        hv.Clamped(at=3.0)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="give minimal_support the mesh of the part"):
        minimal_support(Mesh.assembled({"a": hv.box(cells=1), "b": hv.box(cells=1)}))
