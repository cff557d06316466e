"""A body without loads and laws, on the coarsest mesh that is known of it: what constants of the body depend on.

A body that is not linear is replaced by the linear one of ``C_low``, in whose energy norm its errors are bounded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.coarsening import coarsened
from hemivar.bounds.facet_table import FacetTable, facet_table
from hemivar.bounds.roundings import CONSTANT
from hemivar.errors import ProblemError
from hemivar.fem.constitutive import constitutive_law
from hemivar.fem.supports import DEPENDENT
from hemivar.laws import NoContact
from hemivar.mechanics.composed_material import lower_elasticity
from hemivar.mechanics.conditions import Clamped, Fixed, Prescribed, Roller, ScalarData, Support
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.material import Material
from hemivar.mechanics.obstacles import Normals, Plane
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.refine import COVERED
from hemivar.systems.workspace import Workspace

__all__ = [
    "PART",
    "bare_body",
    "cell_tensors",
    "contact_normals",
    "contact_sides",
    "facet_cover",
    "has_constant_normals",
    "held_facets",
    "part_of_body",
    "softened",
    "too_many_cells",
]

T = TypeVar("T")
#: Cells of the part that is made of a body, by dimension.
PART = {2: 40, 3: 56}
#: Digits to which two materials are one.
_DIGITS = 13


def bare_body(problem: ContactProblem, *, coarsest: bool = True) -> ContactProblem:
    """Supports at rest, no loads, contact boundaries without a law; the directions of contact stay.

    On the coarsest mesh boundaries that are alike then have one name, the first of theirs, but for sides where bodies
    touch.
    """
    if problem.kinematics.ring:
        raise ProblemError("lower bounds of trace constants are available for plane and 3D bodies only; leave them out")
    mesh = problem.mesh
    while coarsest and mesh.parent is not None:
        mesh = mesh.parent.mesh
    supports = {name: _at_rest(support) for name, support in problem.held_boundaries.items()}
    contact = {
        side: Contact(NoContact(), obstacle=contact.obstacle, normals=contact.normals)
        for name, contact in problem.contact.items()
        for side in contact_sides(problem, name)
    }
    bare = replace(
        problem,
        mesh=mesh,
        material=lower_elasticity(problem.material),
        supports=supports,
        contact=contact,
        ties={},
        tractions={},
        body_force=(0.0,) * mesh.dim,
        order=1,
    )
    apart = [side for name in problem.contact if problem.contact[name].against for side in problem.pair(name)]
    return _joined(bare, apart) if coarsest else bare


def _joined(bare: ContactProblem, apart: list[str]) -> ContactProblem:
    """Boundaries that are alike under one name, but for contacts that are to stay apart."""
    alike = {name: name if name in apart else _directions(contact) for name, contact in bare.contact.items()}
    contact, touching = _merged(bare.mesh, bare.contact, alike)
    supports, holding = _merged(bare.mesh, bare.supports, bare.supports)
    boundaries = touching | {f"{name}, held": facets for name, facets in holding.items()}
    mesh = Mesh.trusted(bare.mesh.points, bare.mesh.cells, boundaries, bare.mesh.regions)
    return replace(
        bare, mesh=mesh, contact=contact, supports={f"{name}, held": support for name, support in supports.items()}
    )


def _merged(
    mesh: Mesh, stated: Mapping[str, T], alike: Mapping[str, object]
) -> tuple[dict[str, T], dict[str, IntArray]]:
    """Boundaries of one kind under the first of their names, and their facets: cuts between them do not matter."""
    kinds: list[object] = []
    members: list[list[str]] = []
    for name in stated:
        if alike[name] not in kinds:
            kinds.append(alike[name])
            members.append([])
        members[kinds.index(alike[name])].append(name)
    facets = {names[0]: np.concatenate([mesh.boundaries[name] for name in names]) for names in members}
    return {name: stated[name] for name in facets}, {name: _once(some) for name, some in facets.items()}


def _once(facets: IntArray) -> IntArray:
    """Facets without those that are there twice."""
    first = np.unique(np.sort(facets, axis=1), axis=0, return_index=True)[1]
    return np.asarray(facets[np.sort(first)])


def _directions(contact: Contact) -> object:
    """The same for contacts whose normals are found alike."""
    if isinstance(contact.obstacle, Plane) and _is_plane(contact):
        return np.asarray(contact.obstacle.normal).tolist()
    return contact.normals is not Normals.OBSTACLE


def _at_rest(support: Support | ScalarData) -> Support | ScalarData:
    if isinstance(support, Prescribed):
        return Clamped()
    if isinstance(support, Fixed):
        x, y, z = (None if value is None else 0.0 for value in (support.x, support.y, support.z))
        return Fixed(x, y, z)
    return support


def contact_sides(problem: ContactProblem, name: str) -> tuple[str, ...]:
    """The boundaries of a contact: one on a foundation, two of bodies that touch."""
    return problem.pair(name) if problem.contact[name].against else (name,)


def part_of_body(
    bare: ContactProblem, target: int, loss: float, seed: int = 0, least: float = 0.0, kept: Workspace | None = None
) -> tuple[ContactProblem, bool]:
    """About so many cells of good shape that make a part of a body, and whether it is all of it.

    The part has the contact boundary and the supports of the body, so that its trace constants are not above those of
    the body.  ``loss``, ``seed`` and ``least`` are those of
    :func:`hemivar.bounds.coarsening.coarsened`; a workspace keeps its cells.
    """
    mesh, table = bare.mesh, facet_table(bare.mesh)
    names = [*bare.contact, *bare.supports]
    on = np.zeros((1 + len(table.facets), len(names)), dtype=bool)  # the first row is on none of them
    for number, name in enumerate(names):
        on[1 + table.numbers(mesh.boundaries[name]), number] = True
    kinds, labels = np.unique(on, axis=0, return_inverse=True)
    labels = labels.ravel()[1:]
    tensors, groups = cell_tensors(bare)
    numbers = np.array([target, loss, seed, least])
    left = Workspace.given(kept).once(
        "part of a body",
        (mesh.points, mesh.cells, labels, groups, numbers),
        lambda: coarsened(mesh, labels, groups, target, loss, seed, least),
    )
    used, cells = np.unique(left.cells, return_inverse=True)
    facets = np.searchsorted(used, left.facets)
    outer = left.labels >= 0  # the others lie between materials
    named = {name: facets[outer & kinds[left.labels, number]] for number, name in enumerate(names)}
    regions = {f"{number}": np.flatnonzero(left.groups == number) for number in range(len(tensors))}
    coarse = Mesh.trusted(mesh.points[used], cells.reshape(left.cells.shape), named, regions)
    if len(tensors) == 1:
        material = Material.tensor(tensors[0])
    else:
        material = Material.by_region({name: Material.tensor(tensors[int(name)]) for name in regions})
    return replace(bare, mesh=coarse, material=material), left.loss == 0.0


def softened(bare: ContactProblem) -> ContactProblem:
    """The same body of one material, whose tensor is not above those of the body: neither are its constants."""
    tensors, _ = cell_tensors(bare)
    softest = tensors[np.argmin(np.trace(tensors, axis1=1, axis2=2))]
    root = np.linalg.cholesky(softest)
    relative = np.linalg.solve(root, np.linalg.solve(root, tensors).transpose(0, 2, 1))
    least = min(1.0, float(np.linalg.eigvalsh(relative).min()))
    return replace(bare, material=Material.tensor((1.0 - CONSTANT) * least * softest))


def too_many_cells(cells: int, left: int, most: int) -> str:
    """Why there are no constants of a body, in words."""
    return (
        f"the coarsest mesh of the body has {cells} cells, and {left} are needed to keep its contact "
        f"boundary, supports and materials and the shape where it is curved; lower bounds of trace constants are "
        f"computed on up to {most}: begin with a coarser mesh and refine it"
    )


def cell_tensors(bare: ContactProblem) -> tuple[Array, IntArray]:
    """The different matrices (k, v, v) of the material, and the number of that of each cell."""
    matrices, _ = constitutive_law(bare).on(bare.mesh, 2)
    if np.abs(matrices - matrices[:, :1]).max() > CONSTANT * np.abs(matrices).max():
        raise ProblemError("the material varies inside cells; bounds of constants of a body need it constant on each")
    if len(matrices) == 1:
        return matrices[:, 0], np.zeros(bare.mesh.number_of_cells, dtype=np.int64)
    flat = matrices[:, 0].reshape(len(matrices), -1)
    _, first, number = np.unique(
        np.round(flat / np.abs(flat).max(), _DIGITS), axis=0, return_index=True, return_inverse=True
    )
    return matrices[first, 0], number.ravel()


def held_facets(problem: ContactProblem, table: FacetTable, facets: IntArray | None = None) -> Array:
    """Orthogonal projections (F, d, d) on the directions that supports hold, zero on all other facets; or of some."""
    mesh = problem.mesh
    dim = mesh.dim
    chosen = np.arange(len(table.facets)) if facets is None else facets
    held = np.zeros((len(chosen), dim, dim))
    for name, support in problem.supports.items():
        number = table.numbers(mesh.boundaries[name])
        row = np.searchsorted(chosen, number)
        if isinstance(support, Roller):
            directions = [table.normals_of(number)]
        else:
            axes = (support.x, support.y, support.z)[:dim] if isinstance(support, Fixed) else (0.0,) * dim
            directions = [
                np.broadcast_to(np.eye(dim)[c], (len(number), dim)) for c in range(dim) if axes[c] is not None
            ]
        for direction in directions:
            rest = direction - np.einsum("kij,kj->ki", held[row], direction)
            size = np.linalg.norm(rest, axis=1)
            new = size > DEPENDENT
            unit = rest[new] / size[new, None]
            held[row[new]] += unit[:, :, None] * unit[:, None, :]
    return held


def has_constant_normals(problem: ContactProblem) -> bool:
    """Whether the contact normal is constant on every facet: it is that of the facet, or of a plane obstacle."""
    return all(_is_plane(one) or one.normals is not Normals.OBSTACLE for one in problem.contact.values())


def contact_normals(problem: ContactProblem, table: FacetTable, facets: IntArray) -> Array:
    """Contact normals (k, d) on contact facets (k,); where they vary on a facet, the normal of the facet."""
    normals = table.normals_of(facets)
    for name, contact in problem.contact.items():
        if contact.obstacle is not None and _is_plane(contact):
            here = np.isin(facets, table.numbers(problem.mesh.boundaries[name]))
            normals[here] = -contact.obstacle.normals(np.zeros((1, table.dim)))
    return normals


def _is_plane(contact: Contact) -> bool:
    return isinstance(contact.obstacle, Plane) and contact.normals is Normals.OBSTACLE


def facet_cover(mine: Array, others: Array) -> BoolArray:
    """Whether facets may have inner points in common, shape (k, m): never False where they have.

    They are found by their boxes, so that in space some are found that are only near.

    ``mine`` is (k, d, d); ``others`` is (m, d, d).
    """
    low, high = mine.min(axis=1), mine.max(axis=1)
    below, above = others.min(axis=1), others.max(axis=1)
    flat = SAME * float(np.ptp(mine.reshape(-1, mine.shape[2]), axis=0).max(initial=0.0))
    covered = np.ones((len(mine), len(others)), dtype=bool)
    for axis in range(mine.shape[2]):
        least = np.minimum(high[:, None, axis] - low[:, None, axis], above[:, axis] - below[:, axis])
        common = np.minimum(high[:, None, axis], above[:, axis]) - np.maximum(low[:, None, axis], below[:, axis])
        covered &= common >= COVERED * least - flat
    return covered
