"""The bodies that tests press, pull and throw: a mesh, a contact law, and only what differs from the usual."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, Superpotential, VectorLaw
from hemivar.mechanics import Branch, Clamped, Contact, ContactProblem, Fixed, Material, Quadrature, Roller
from hemivar.mechanics.conditions import ScalarData, Support, Traction, VectorData
from hemivar.mechanics.moduli import Moduli, Number, Viscosity
from hemivar.mesh import Mesh, box, rectangle

#: A contact law of the bottom, a whole contact of the bottom, contacts by their boundaries, or none.
Touching = Superpotential | Contact | Mapping[str, Contact] | None
Pattern = Literal["cross", "right", "left"]

FIXED = Fixed(y=0.0)


class Loaded(TypedDict, total=False):
    """What acts on a body and how it is computed, under the names of `ContactProblem`."""

    body_force: VectorData | float
    tractions: Mapping[str, Traction]
    title: str
    order: int
    quadrature: Quadrature
    bedding: ScalarData


class Made(Loaded, total=False):
    """What it is made of, as well, under the names of `Material.lame`; or a material of another kind."""

    density: Number | None
    branches: Sequence[Branch]
    material: Material | None


class Stated(Made, total=False):
    """All that a body may state besides its mesh and contact."""

    lame: tuple[Number, Number]
    viscosity: Moduli | Viscosity | None
    supports: Mapping[str, Support]


def body(
    mesh: Mesh,
    contact: Touching = None,
    *,
    lame: tuple[Number, Number] = (4.0, 4.0),
    density: Number | None = None,
    viscosity: Moduli | Viscosity | None = None,
    branches: Sequence[Branch] = (),
    material: Material | None = None,
    supports: Mapping[str, Support] | None = None,
    **loaded: Unpack[Loaded],
) -> ContactProblem:
    """A body of any mesh, clamped on the left where no other supports are given."""
    if isinstance(contact, Superpotential):
        contact = Contact(contact)
    if isinstance(contact, Contact):
        contact = {"bottom": contact}
    if material is None:
        material = Material.lame(*lame, density=density, viscosity=viscosity, branches=branches)
    if supports is None:
        supports = {"left": Clamped()}
    return ContactProblem(mesh, material, contact or {}, supports, **loaded)


def square(
    contact: Touching = None,
    cells: int | tuple[int, int] = 4,
    pattern: Pattern = "right",
    side: float = 1.0,
    **stated: Unpack[Stated],
) -> ContactProblem:
    """A square clamped on the left."""
    return body(rectangle((side, side), cells, pattern), contact, **stated)


def strip(
    contact: Touching = None,
    cells: int | tuple[int, int] = (4, 2),
    pattern: Pattern = "right",
    size: tuple[float, float] = (2.0, 1.0),
    **stated: Unpack[Stated],
) -> ContactProblem:
    """A rectangle clamped on the left."""
    return body(rectangle(size, cells, pattern), contact, **stated)


def cube(
    contact: Touching = None,
    cells: int | tuple[int, int, int] = 2,
    size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    **stated: Unpack[Stated],
) -> ContactProblem:
    """A box in space, clamped on the left."""
    return body(box(size, cells), contact, **stated)


def column(
    contact: Touching = None,
    stiffness: float | None = None,
    cells: int | tuple[int, int] = 1,
    *,
    pattern: Pattern = "right",
    size: tuple[float, float] = (1.0, 1.0),
    top: Support | None = FIXED,
    viscous: float | None = None,
    lame: tuple[Number, Number] = (4.0, 4.0),
    viscosity: Moduli | Viscosity | None = None,
    **made: Unpack[Made],
) -> ContactProblem:
    """A block between smooth walls, held at its top: where it is as high as wide, a spring of the given stiffness.

    And a dashpot of the given viscosity beside it; or any material, by Lame's constants.
    """
    if stiffness is not None:
        lame = (0.0, 0.5 * stiffness)
    if viscous is not None:
        viscosity = (0.0, 0.5 * viscous)
    supports: dict[str, Support] = {"left": Roller(), "right": Roller()}
    if top is not None:
        supports["top"] = top
    return body(rectangle(size, cells, pattern), contact, lame=lame, viscosity=viscosity, supports=supports, **made)


def glued_plate(
    contact: VectorLaw | Mapping[str, Contact], load: tuple[float, float] = (12.0, 20.0), cells: int = 4
) -> ContactProblem:
    """A stiff plate of 1 by 1/2, clamped on the left and pulled at its top off what its bottom stands on."""
    if isinstance(contact, VectorLaw):
        contact = {"bottom": Contact(contact)}
    made = Material.young(3000.0, 0.3)
    return strip(contact, (2 * cells, cells), size=(1.0, 0.5), material=made, tractions={"top": load})


#: Hencky's material of tests: its bulk and shear moduli, the part of shear that is left, and its size of strain.
BULK, SHEAR, LEFT, SIZE = 20.0 / 3.0, 4.0, 0.25, 0.05


def hencky(left: float = LEFT, scale: float = 1.0, plane: str = "strain") -> Material:
    """That material; with ``left`` 1 it is linear, and ``scale`` changes the unit of stress."""
    return Material.hencky(scale * BULK, scale * SHEAR, left, SIZE, plane)


def points_on_springs(
    stiffness: ArrayLike, load: ArrayLike, law: ContactLaw | VectorLaw, components: int = 1, gap: float = 0.0
) -> DiscreteProblem:
    """Contact points whose displacements are all unknowns; a matrix (n, n), or the stiffness of each spring."""
    force = np.asarray(load, dtype=float)
    stiffness, count = np.asarray(stiffness, dtype=float), force.size // components
    matrix = stiffness if stiffness.ndim else stiffness * np.eye(force.size)
    weights, gaps = np.ones(count), np.full(count, gap)
    return DiscreteProblem.of_arrays(matrix, force, np.eye(force.size), weights, gaps, law.at(None))


def opened_point(springs: float, load: ArrayLike, law: VectorLaw) -> DiscreteProblem:
    """A point on two equal springs, opened and sheared by a load (2,)."""
    return points_on_springs(springs, np.asarray(load, dtype=float) * [-1.0, 1.0], law, 2)
