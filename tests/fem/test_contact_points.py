"""Contact points where two boundaries meet, and where supports act on them as well."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.laws import Signorini, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material
from hemivar.mesh import Mesh

ROUGH = Contact(Signorini(), Tresca(0.5))


def wedge(rise: float) -> Mesh:
    """Three triangles on a lower side that is level on the left and rises by ``rise`` on the right."""
    points = np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, rise], [1.0, 3.0], [-1.0, 3.0]])
    cells = np.array([[0, 1, 4], [1, 3, 4], [1, 2, 3]])
    return Mesh.oriented(points, cells, {"first": [[0, 1]], "second": [[1, 2]], "top": [[3, 4]]})


def corner(rise: float, names: tuple[str, str], supports: dict[str, object]) -> tuple[DiscreteProblem, np.ndarray]:
    """The problem with contact on both halves, stated in this order, and its contact points at the middle."""
    contact = dict.fromkeys(names, ROUGH)
    statement = ContactProblem(wedge(rise), Material.lame(1.0, 1.0), contact, {"top": Clamped(), **supports})  # type: ignore[dict-item]
    problem = discretize(statement)
    return problem, np.flatnonzero(problem.contact.node == 1)


def rows(problem: DiscreteProblem, point: int) -> np.ndarray:
    """Normal and tangential row of the trace at a point, dense (2, n)."""
    return np.asarray(problem.contact.trace[2 * point : 2 * point + 2].toarray())


@pytest.mark.parametrize("names", [("first", "second"), ("second", "first")])
def test_a_sharp_corner_is_a_point_of_both_without_friction(names: tuple[str, str]) -> None:
    problem, here = corner(1.5, names, {})
    assert [problem.contact.names[b] for b in problem.contact.boundary[here]] == list(names)
    for point in here:
        normal, tangential = rows(problem, point)
        assert np.abs(normal).max() > 0.5
        assert not tangential.any()
        assert problem.contact.without_friction[point]
    both = np.array([rows(problem, point)[0] for point in here])
    assert np.linalg.matrix_rank(both) == 2
    others = np.setdiff1d(np.arange(problem.contact.count), here)
    assert not problem.contact.without_friction[others].any()
    assert all(rows(problem, point)[1].any() for point in others)


@pytest.mark.parametrize("names", [("first", "second"), ("second", "first")])
def test_a_smooth_corner_on_a_support_is_blocked_by_its_own_normal(names: tuple[str, str]) -> None:
    """x is fixed on one half: along its own normal nothing is lost, but the averaged normal at the joint is oblique."""
    problem, here = corner(0.2, names, {"first": Fixed(x=0.1)})
    (point,) = here
    assert problem.contact.names[problem.contact.boundary[point]] == names[0]
    n = np.array([0.2, -1.0]) + np.array([0.0, -1.0])  # normals times lengths
    assert problem.contact.frames is not None
    np.testing.assert_allclose(problem.contact.frames[point, 0], n / np.linalg.norm(n), atol=1e-14)
    normal, tangential = rows(problem, point)
    assert np.abs(normal).max() == pytest.approx(abs(n[1]) / np.linalg.norm(n), rel=1e-12)
    assert not tangential.any()
    assert problem.contact.without_friction[point]
    assert problem.offset[point, 1] == 0.0


def test_a_smooth_corner_without_support_slips() -> None:
    problem, here = corner(0.2, ("first", "second"), {})
    (point,) = here
    assert np.linalg.matrix_rank(rows(problem, point)) == 2
    assert not problem.contact.without_friction.any()
    assert problem.contact.weights[point] == pytest.approx(0.5 + 0.5 * np.hypot(1.0, 0.2))
