"""What a mesh is the refinement of: a field of it like any other, checked, kept where it holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.mesh import Mesh, box, rectangle
from hemivar.mesh.refine import Refinement

from .meshes import cube

Make = Callable[[], Mesh]
REFINED: dict[str, Make] = {
    "right": lambda: rectangle((2.0, 1.0), (8, 4), "right", origin=(3.0, -1.0)),
    "left": lambda: rectangle((2.0, 1.0), (8, 4), "left"),
    "cross": lambda: rectangle((2.0, 1.0), (8, 4), "cross").rotated(0.4),
    "box": lambda: box((1.0, 2.0, 3.0), (4, 8, 4), origin=(0.1, 0.2, 0.3)),
    "refined": lambda: cube(2).refined(2).moved(np.diag([1.0, 2.0, 0.5]), (1.0, 0.0, -1.0)),
    "part": lambda: replace(rectangle(cells=3), regions={"soft": np.array([2, 4, 5])}).refined(),
    "renamed": lambda: rectangle(cells=8).with_boundaries({"low": lambda x: x[:, 1] < 0.3}),
}


def parent_of(mesh: Mesh) -> Refinement:
    assert mesh.parent is not None
    return mesh.parent


@pytest.mark.parametrize("name", REFINED)
def test_parents_of_nodes_and_cells_pass_the_checks(name: str) -> None:
    mesh = REFINED[name]()
    parent = parent_of(mesh)
    checked = Mesh(mesh.points, mesh.cells, mesh.boundaries, mesh.regions, parent)
    assert set(parent_of(checked).mesh.boundaries) == set(mesh.boundaries)
    assert set(parent_of(checked).mesh.regions) == set(mesh.regions)
    children = np.bincount(parent.cells, minlength=parent.mesh.number_of_cells)
    assert (children == 2**mesh.dim).all()
    middle = mesh.points[mesh.cells].mean(axis=1)
    coarse = parent.mesh
    inverse = np.linalg.inv(coarse.points[coarse.cells][:, 1:] - coarse.points[coarse.cells][:, :1])
    inside = np.einsum("md,mdk->mk", middle - coarse.points[coarse.cells[parent.cells, 0]], inverse[parent.cells])
    assert inside.min() > 0.0
    assert inside.sum(axis=1).max() < 1.0


@pytest.mark.parametrize("name", REFINED)
def test_replace_keeps_the_parent_and_hands_names_down(name: str) -> None:
    mesh = REFINED[name]()
    again = replace(mesh)
    np.testing.assert_array_equal(parent_of(again).ends, parent_of(mesh).ends)
    facets = mesh.boundary_facets
    renamed = replace(mesh, boundaries={"all": facets})
    coarse = parent_of(renamed).mesh
    assert list(coarse.boundaries) == ["all"]
    assert len(coarse.boundaries["all"]) == len(coarse.boundary_facets)
    if coarse.parent is not None:
        assert list(coarse.parent.mesh.boundaries) == ["all"]
    cell = np.flatnonzero(parent_of(mesh).cells == 1)
    assert parent_of(replace(mesh, regions={"one": cell})).mesh.regions["one"].tolist() == [1]


def test_replace_refuses_a_parent_that_no_longer_holds() -> None:
    mesh = rectangle(cells=4)
    points = mesh.points.copy()
    points[6] += 0.01
    with pytest.raises(ProblemError, match=r"node 6 is not the midpoint of nodes 0 and 4 of the parent.*0\.01 off"):
        replace(mesh, points=points)
    assert replace(mesh, points=points, parent=None).parent is None
    with pytest.raises(ProblemError, match="cut through its facets or cells"):
        replace(mesh, regions={"soft": np.array([0])})
    with pytest.raises(ProblemError, match=r"parent makes 25 nodes and 32 cells in 2 dimensions.*49 and 72 in 2"):
        replace(rectangle(cells=6), parent=mesh.parent)
    with pytest.raises(ProblemError, match=r"parent is a Mesh; give the Refinement"):
        replace(mesh, parent=parent_of(mesh).mesh)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda p: replace(p, cells=np.roll(p.cells, 1)), "cell 0 is not part of cell 7 of the parent mesh"),
        (lambda p: replace(p, ends=p.ends[:, :1]), r"shapes \(25, 1\) and \(32,\)"),
        (lambda p: replace(p, ends=p.ends + 5), r"Refinement\.ends refers to number 13; valid numbers are 0 to 8"),
        (lambda p: replace(p, cells=p.cells - 1), r"Refinement\.cells refers to number -1"),
        (lambda p: replace(p, mesh=p.mesh.scaled(2.0)), "is not the midpoint of nodes"),
    ],
)
def test_parents_that_do_not_lead_to_the_mesh(change: Callable[[Refinement], Refinement], words: str) -> None:
    mesh = rectangle(cells=4)
    with pytest.raises(ProblemError, match=words):
        replace(mesh, parent=change(parent_of(mesh)))


def test_cells_that_do_not_fill_their_parent_are_refused() -> None:
    mesh = rectangle(cells=2)
    first = parent_of(mesh).cells == 0
    nodes, cells = np.unique(mesh.cells[first][:3], return_inverse=True)
    parent = Refinement(parent_of(mesh).mesh, parent_of(mesh).ends[nodes], parent_of(mesh).cells[first][:3])
    with pytest.raises(ProblemError, match="its cells do not fill cell 0 of the parent mesh"):
        Mesh(mesh.points[nodes], cells.reshape(-1, 3), parent=parent)


def test_a_mesh_refined_in_part_knows_its_parent() -> None:
    """One triangle of two is cut at the midpoint of its lower side."""
    coarse = rectangle(cells=1)
    points = np.vstack([coarse.points, [0.5, 0.0]])
    a, b, c = coarse.cells[0].tolist()
    ends = np.array([[0, 0], [1, 1], [2, 2], [3, 3], [a, b]])
    cells = np.array([coarse.cells[1], [a, 4, c], [4, b, c]])
    fine = Mesh(points, cells, {"bottom": [[a, 4], [4, b]]}, parent=Refinement(coarse, ends, np.array([1, 0, 0])))  # type: ignore[dict-item]
    assert parent_of(fine).mesh.boundaries["bottom"].tolist() == [[0, 1]]
    np.testing.assert_allclose(parent_of(fine).interpolation @ coarse.points, points)
    assert fine.parts.cell.tolist() == [0, 0, 0]


def test_boundaries_that_end_within_facets_of_the_coarser_mesh_have_none() -> None:
    """Contact up to the middle of a facet of the coarser mesh, a clamp from there on: no coarser problem to state."""
    halves = {
        "left half": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] < 0.5),
        "right half": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > 0.5),
    }
    mesh = rectangle(cells=30).with_boundaries(halves)
    assert mesh.parent is None
    assert parent_of(rectangle(cells=32).with_boundaries(halves)).mesh.boundaries["left half"].shape == (8, 2)
    surface = box(cells=4).with_boundaries({"part": lambda x: (x[:, 2] < 1e-9) & (x[:, 0] + x[:, 1] < 0.9)})
    assert surface.parent is None
    statement = hv.ContactProblem(
        mesh,
        hv.Material.lame(1.0, 1.0),
        {"left half": hv.Contact(hv.Signorini())},
        {"right half": hv.Clamped()},
        body_force=(0.0, -1.0),
    )
    assert hv.solve(hv.discretize(statement), hv.solvers.NonsmoothMultigrid()).status is hv.Status.CONVERGED
