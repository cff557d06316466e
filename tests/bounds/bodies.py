"""Small bodies of every kind, held, loaded and made of what there is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from hemivar.basics.types import Array
from hemivar.gallery.survey_problems import survey, survey_cube
from hemivar.laws import Compliance, ThresholdCompliance, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material, Prescribed, Pressure, Roller
from hemivar.mesh import box, rectangle
from hemivar.mesh.mesh import Mesh
from tests import bodies

FOUNDATION = Contact(ThresholdCompliance(0.3, 2.0), Tresca(0.2))


def shaken(mesh: Mesh, seed: int = 1, by: float = 0.15) -> Mesh:
    """The mesh with its inner nodes moved a little, so that no two cells are alike."""
    outer = np.unique(mesh.boundary_facets)
    inner = np.setdiff1d(np.arange(mesh.number_of_nodes), outer)
    points = mesh.points.copy()
    lengths = np.linalg.norm(points[mesh.edges[:, 1]] - points[mesh.edges[:, 0]], axis=1)
    points[inner] += by * lengths.min() * np.random.default_rng(seed).uniform(-1.0, 1.0, (len(inner), mesh.dim))
    return Mesh(points, mesh.cells, dict(mesh.boundaries), dict(mesh.regions))


def plane_mesh(n: int = 4) -> Mesh:
    return shaken(rectangle((1.0, 1.0), n, pattern="cross"))


def space_mesh(n: int = 3) -> Mesh:
    return shaken(box((1.0, 1.0, 1.0), n))


def anisotropic(dim: int) -> Material:
    """A stiffness matrix with all its entries."""
    root = np.random.default_rng(8).normal(size=(3, 3) if dim == 2 else (6, 6))
    return Material.tensor(4.0 * np.eye(len(root)) + root @ root.T)


def turned_square() -> ContactProblem:
    """A square turned by 0.4, on rollers that are oblique therefore, with a pressure on top."""
    return bodies.body(
        plane_mesh().rotated(0.4),
        FOUNDATION,
        supports={"left": Roller(), "right": Roller()},
        body_force=(0.2, -0.3),
        tractions={"top": Pressure(0.7)},
    )


def turned_in_space() -> ContactProblem:
    axis = np.array([0.3, -0.5, 0.8])
    axis /= np.linalg.norm(axis)
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    matrix = np.eye(3) + np.sin(0.7) * cross + (1.0 - np.cos(0.7)) * cross @ cross
    return ContactProblem(
        mesh=space_mesh(2).moved(matrix),
        material=anisotropic(3),
        contact={"bottom": FOUNDATION},
        supports={"left": Roller(), "back": Roller(), "right": Roller()},
        tractions={"top": (0.1, 0.2, -0.5)},
        body_force=(0.2, -0.3, 0.1),
    )


def layered() -> ContactProblem:
    """Two materials of very different stiffness, one of them anisotropic; a prescribed displacement, a traction."""
    mesh = plane_mesh(6)
    below = np.flatnonzero(mesh.points[mesh.cells].mean(axis=1)[:, 1] < 0.5)
    above = np.setdiff1d(np.arange(len(mesh.cells)), below)
    mesh = mesh.named(dict(mesh.boundaries), {"below": below, "above": above})
    return ContactProblem(
        mesh=mesh,
        material=Material.by_region({"below": Material.lame(400.0, 300.0), "above": anisotropic(2)}),
        contact={"bottom": FOUNDATION},
        supports={"left": Prescribed((0.02, -0.01)), "right": Fixed(x=0.0)},
        tractions={"top": (0.3, -0.4)},
        body_force=(0.2, -0.3),
    )


def graded_loads() -> ContactProblem:
    """A modulus that varies within cells; loads that vary; contact where a support holds one component."""

    def modulus(x: Array) -> Array:
        return 4.0 + 3.0 * x[:, 0]

    def force(x: Array) -> Array:
        return np.column_stack([np.sin(3.0 * x[:, 0]), -np.exp(x[:, 1])])

    def traction(x: Array) -> Array:
        return np.column_stack([0.2 * x[:, 0], -(x[:, 0] ** 2)])

    return bodies.body(
        plane_mesh(),
        Compliance(3.0),
        lame=(modulus, 4.0),
        supports={"left": Clamped(), "bottom": Fixed(x=0.0)},
        body_force=force,
        tractions={"top": traction},
    )


def pulled_cube() -> ContactProblem:
    return bodies.body(
        space_mesh(2),
        FOUNDATION,
        supports={"left": Fixed(x=0.0), "back": Fixed(y=0.0)},
        body_force=(0.0, 0.1, -0.3),
        tractions={"right": (0.4, 0.1, 0.0), "top": Pressure(lambda x: 0.3 + 0.1 * x[:, 0])},
    )


def blocks_in_space() -> ContactProblem:
    """Three layers of blocks, of which two in the middle touch along an edge: around it are no ring and no row."""
    mesh = box((2.0, 2.0, 3.0), (2, 2, 3))
    i, j, k = np.floor(mesh.points[mesh.cells].mean(axis=1)).astype(int).T
    used, cells = np.unique(mesh.cells[(k != 1) | (i == j)], return_inverse=True)
    mesh = Mesh.oriented(mesh.points[used], cells.reshape(-1, 4))
    height = mesh.points[mesh.boundary_facets][:, :, 2]
    ends = {name: mesh.boundary_facets[(height == z).all(axis=1)] for name, z in (("bottom", 0.0), ("top", 3.0))}
    return bodies.body(
        mesh.named(ends, {}), FOUNDATION, supports={"top": Fixed(x=0.0, y=0.0)}, body_force=(0.1, 0.2, -0.3)
    )


def without_contact() -> ContactProblem:
    return bodies.strip(
        cells=(4, 2), pattern="left", material=Material.young(200.0, 0.3), tractions={"right": (0.0, -1.0)}
    )


BODIES: dict[str, Callable[[], ContactProblem]] = {
    "survey": lambda: survey("5.1", 4),
    "survey, right": lambda: survey("figure1", 5, pattern="right"),
    "turned": turned_square,
    "layered": layered,
    "graded": graded_loads,
    "without contact": without_contact,
    "cube": lambda: survey_cube("5.1", 2),
    "turned in space": turned_in_space,
    "pulled cube": pulled_cube,
    "blocks in space": blocks_in_space,
}
#: Those in the plane with quadratic elements.
QUADRATIC: dict[str, Callable[[], ContactProblem]] = {
    f"{name}, quadratic": lambda make=make: replace(make(), order=2)  # type: ignore[misc]
    for name, make in BODIES.items()
    if "cube" not in name and "space" not in name
}
BODIES |= QUADRATIC
#: Those with loads that are not constant: their stresses balance against linear fields.
VARYING = ("graded", "graded, quadratic", "pulled cube")
