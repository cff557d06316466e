"""What is refused when it is stated: numbers beyond the range, obstacles inside the body, dependent midpoints."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.laws import Bilateral, Compliance, Signorini, Superpotential
from hemivar.mechanics import (
    Clamped,
    Contact,
    ContactProblem,
    Cylinder,
    Fixed,
    Material,
    Normals,
    Plane,
    Prescribed,
    Pressure,
    Quadrature,
    Roller,
    SignedDistance,
    Sphere,
)
from hemivar.mechanics.conditions import Support
from hemivar.mechanics.obstacles import Obstacle
from hemivar.mesh import Mesh, box, rectangle
from tests import bodies


def stated(mesh: Mesh | None = None, contact: Contact | None = None, **changes: Any) -> ContactProblem:
    values = {
        "material": Material.lame(4.0, 4.0),
        "contact": {"bottom": Contact(Signorini()) if contact is None else contact},
        "supports": {"top": Clamped()},
    }
    return ContactProblem(rectangle(cells=4) if mesh is None else mesh, **(values | changes))


@pytest.mark.parametrize(
    "make",
    [
        lambda z: Material.lame(4.0 + z, 4.0),
        lambda z: Material.young(1.0, z),
        lambda z: Material.tensor(np.eye(3) + z),
        lambda z: Material.tensor(np.eye(3), out_of_plane=(0.0, z, 0.0)),
        lambda z: Fixed(x=z),
        lambda z: Prescribed((0.0, z)),
        lambda z: Pressure(z),
        lambda z: Contact(Signorini(), gap=z),
        lambda z: Plane((0.0, z), (0.0, 1.0)),
        lambda z: Plane((0.0, 0.0), (0.0, z)),
        lambda z: Sphere((0.0, z), 1.0),
        lambda z: Sphere((0.0, -2.0), z),
        lambda z: Cylinder((0.0, 0.0, z), (0.0, 0.0, 1.0), 1.0),
        lambda z: stated(body_force=(0.0, z)),
        lambda z: stated(tractions={"top": (0.0, z)}),
        lambda z: discretize(stated(body_force=lambda x: np.full(x.shape, z))),
        lambda z: discretize(stated(material=Material.lame(lambda x: np.full(len(x), z), 4.0))),
        lambda z: discretize(stated(material=Material.tensor(lambda x: np.eye(3) + z))),
        lambda z: discretize(stated(contact=Contact(Signorini(), gap=lambda x: np.full(len(x), z)))),
        lambda z: discretize(stated(supports={"top": Prescribed(lambda x: np.full(x.shape, z))})),
        lambda z: discretize(stated(contact=Contact(Signorini(), obstacle=SignedDistance(lambda x: x[:, 1] + z)))),
    ],
)
@pytest.mark.parametrize("number", [0.25 + 1j, 0.25 + 0j, np.complex128(0.25), float("nan"), float("inf")])
def test_complex_and_infinite_numbers_are_refused(make: Callable[[complex], object], number: complex) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ProblemError) as caught:
            make(number)
    assert "\n" not in str(caught.value)


# ---- obstacles inside the body -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mesh", "obstacle", "words"),
    [
        (rectangle(cells=4), Sphere((0.4, 0.3), 0.1), r"centre \(0\.4, 0\.3\) of the obstacle lies inside the body"),
        (rectangle(cells=4), Sphere((0.4, 0.3), 1e-3), "lies inside the body"),
        (rectangle(cells=4), Sphere((0.5, 0.5), 0.5), "lies inside the body|wrong side"),
        (rectangle(cells=4).rotated(1.0), Sphere((0.0, 0.5), 0.1), "lies inside the body"),
        (rectangle(cells=4), Sphere((0.5, -3.0), 10.0), "wrong side|whole body lies inside"),
        (rectangle(cells=4), Plane((0.0, 5.0), (0.0, 1.0)), "the whole body lies inside the obstacle"),
        (rectangle(cells=4), SignedDistance(lambda x: np.hypot(x[:, 0] - 0.5, x[:, 1] - 0.5) - 0.3), "inside the body"),
        (box(cells=3), Sphere((0.3, 0.4, 0.6), 0.2), "lies inside the body"),
        (box(cells=4), Cylinder((0.0, 0.5, 0.5), (1.0, 0.0, 0.0), 0.3), "inside the body"),
    ],
)
def test_obstacles_inside_the_body_are_refused(mesh: Mesh, obstacle: Obstacle, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        discretize(stated(mesh, Contact(Compliance(1.0), obstacle=obstacle)))


@pytest.mark.parametrize(
    ("mesh", "obstacle"),
    [
        (rectangle(cells=4), Sphere((0.5, -2.0), 2.0)),
        (rectangle(cells=4), Sphere((0.5, -2.0), 2.2)),  # pushed in by a fifth of the height
        (rectangle(cells=16), Sphere((0.5, -0.01), 0.3)),  # nearly half of it
        (rectangle(cells=4), Sphere((0.5, 0.5), 3.0, inside=True)),
        (rectangle(cells=4), Plane((0.0, 0.4), (0.0, 1.0))),
        (rectangle(cells=4), SignedDistance(lambda x: x[:, 1] - 0.1)),
        (box(cells=3), Sphere((0.5, 0.5, -2.0), 2.1)),
        (box(cells=3), Cylinder((0.5, 0.5, -2.0), (1.0, 0.0, 0.0), 2.1)),
    ],
)
def test_obstacles_that_overlap_the_boundary_are_not(mesh: Mesh, obstacle: Obstacle) -> None:
    discretize(stated(mesh, Contact(Compliance(1.0), obstacle=obstacle)))


def test_a_centre_on_the_boundary_is_not_inside() -> None:
    obstacle = Sphere((0.5 * np.cos(0.5), 0.5 * np.sin(0.5)), 0.3)
    discretize(
        stated(rectangle(cells=5).rotated(0.5), Contact(Compliance(1.0), obstacle=obstacle, normals=Normals.BODY))
    )


def test_an_obstacle_in_a_hole_or_a_notch_is_outside() -> None:
    """A ring around a circle, whose centre is in no cell."""
    grid = rectangle((2.0 * np.pi, 1.0), (24, 2))
    turn, out = grid.points[:, 0], 0.5 + 0.5 * grid.points[:, 1]
    places = np.column_stack([out * np.cos(-turn), out * np.sin(-turn)])
    first = np.arange(len(places))
    last = np.isclose(turn, 2.0 * np.pi)
    first[last] = np.flatnonzero(np.isclose(turn, 0.0))
    used = np.unique(first)
    mesh = Mesh.oriented(places[used], np.searchsorted(used, first[grid.cells]))
    mesh = mesh.with_boundaries(
        {"bottom": lambda x: np.hypot(x[:, 0], x[:, 1]) < 0.75, "top": lambda x: np.hypot(x[:, 0], x[:, 1]) > 0.75}
    )
    discretize(stated(mesh, Contact(Compliance(1.0), obstacle=Sphere((0.05, 0.0), 0.4))))


# ---- midpoints ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", [Signorini(), Bilateral()])
@pytest.mark.parametrize("support", [Clamped(), Roller()])
def test_midpoints_between_held_ends_are_refused_when_discretised(law: Superpotential, support: Support) -> None:
    """Eight facets, seven free nodes."""
    supports = {"left": support, "right": support, "top": Roller()}
    problem = stated(rectangle(cells=8), Contact(law), supports=supports, quadrature=Quadrature.MIDPOINT)
    with pytest.raises(ProblemError, match=r"contact 'bottom': midpoint quadrature has more pressures.*'nodal'"):
        discretize(problem)
    assert discretize(stated(rectangle(cells=8), Contact(law), supports=supports)).contact_points
    discretize(stated(rectangle(cells=8), Contact(law), supports={"left": support, "top": Clamped()},
                      quadrature=Quadrature.MIDPOINT))  # fmt: skip


def test_midpoints_of_a_closed_boundary_are_refused() -> None:
    """All sides, an even number of facets: pressures that alternate do no work on a bulk motion of the boundary."""
    sides = {name: Contact(Compliance(1.0)) for name in ("left", "right", "bottom", "top")}
    for cells in (4, 32):
        problem = bodies.square(sides, cells, supports={}, quadrature=Quadrature.MIDPOINT)
        mesh = problem.mesh
        joined = mesh.with_boundaries({"all": mesh.boundary_facets})
        whole = ContactProblem(
            joined, Material.lame(4.0, 4.0), {"all": Contact(Compliance(1.0))}, quadrature=Quadrature.MIDPOINT
        )
        for one in (problem, whole):
            with pytest.raises(ProblemError, match="midpoint quadrature has more pressures"):
                discretize(one, check_coercivity=False)


@pytest.mark.parametrize("cells", [1, 3, 64, 1000])
def test_midpoints_of_open_boundaries_pass(cells: int) -> None:
    mesh = rectangle((1.0, 1.0), (cells, 2))
    for supports in ({"top": Clamped()}, {"left": Clamped()}):
        discretize(stated(mesh, supports=supports, quadrature=Quadrature.MIDPOINT))


@pytest.mark.parametrize("order", [0, 3, 2.0, True, np.True_, "2", np.nan])
def test_an_order_is_refused_by_meshes_and_statements_alike(order: Any) -> None:
    mesh = rectangle((1.0, 1.0), 1)
    with pytest.raises(ProblemError) as of_mesh:
        mesh.nodes(order)
    with pytest.raises(ProblemError) as of_statement:
        stated(mesh, order=order)
    assert str(of_mesh.value) == str(of_statement.value)
    assert str(of_mesh.value).endswith("give 1 or 2")


def test_orders_of_any_type_of_whole_numbers() -> None:
    mesh = rectangle((1.0, 1.0), 1)
    assert all(
        len(mesh.nodes(kind(2))) == stated(mesh, order=kind(2)).mesh.nodes(2).shape[0] for kind in (int, np.int32)
    )
