"""A body without loads and laws, on the coarsest mesh that is known of it: what constants of the body depend on.

A body that is not linear is replaced by the linear one of ``C_low``, in whose energy norm its errors are bounded.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.continuous.facet_table import FacetTable
from hemivar.errors import ProblemError
from hemivar.fem.supports import DEPENDENT
from hemivar.laws import NoContact
from hemivar.mechanics.composed_material import lower_elasticity
from hemivar.mechanics.conditions import Clamped, Fixed, Prescribed, Roller
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.obstacles import Normals, Plane
from hemivar.mechanics.statement import ContactProblem

__all__ = ["bare_body", "contact_normals", "contact_sides", "facet_cover", "has_constant_normals", "held_facets"]

#: Part of a facet by which another one must lie over it.
_OVER = 1e-6
#: Part of the boundary within which a facet is flat.
_FLAT = 1e-9
#: Cells of the coarsest mesh of a body beyond which the systems would be too large.
_MOST = {2: 20_000, 3: 2_500}


def bare_body(problem: ContactProblem, *, coarsest: bool = True) -> ContactProblem:
    """Supports at rest, no loads, contact boundaries without a law; the directions of contact stay."""
    if problem.material.axisymmetric:
        raise ProblemError("lower bounds of trace constants are available for plane and 3D bodies only; leave them out")
    mesh = problem.mesh
    while coarsest and mesh.parent is not None:
        mesh = mesh.parent.mesh
    if coarsest and mesh.number_of_cells > _MOST[mesh.dim]:
        raise ProblemError(
            f"the coarsest mesh of the body has {mesh.number_of_cells} cells; lower bounds of trace constants are "
            f"computed on up to {_MOST[mesh.dim]}: begin with a coarser mesh and refine it"
        )
    supports = {
        name: Clamped() if isinstance(support, Prescribed) else support for name, support in problem.supports.items()
    }
    return replace(
        problem,
        mesh=mesh,
        material=lower_elasticity(problem.material),
        supports=supports,
        contact={
            side: Contact(NoContact(), obstacle=contact.obstacle, normals=contact.normals)
            for name, contact in problem.contact.items()
            for side in contact_sides(problem, name)
        },
        tractions={},
        body_force=(0.0,) * mesh.dim,
        order=1,
    )


def contact_sides(problem: ContactProblem, name: str) -> tuple[str, ...]:
    """The boundaries of a contact: one on a foundation, two of bodies that touch."""
    return problem.pair(name) if problem.contact[name].against else (name,)


def held_facets(problem: ContactProblem, table: FacetTable) -> Array:
    """Orthogonal projections (F, d, d) on the directions that supports hold; zero on all other facets."""
    mesh = problem.mesh
    dim = mesh.dim
    held = np.zeros((len(table.facets), dim, dim))
    for name, support in problem.supports.items():
        number = table.numbers(mesh.boundaries[name])
        if isinstance(support, Roller):
            directions = [table.normals[number]]
        else:
            axes = (support.x, support.y, support.z)[:dim] if isinstance(support, Fixed) else (0.0,) * dim
            directions = [
                np.broadcast_to(np.eye(dim)[c], (len(number), dim)) for c in range(dim) if axes[c] is not None
            ]
        for direction in directions:
            rest = direction - np.einsum("kij,kj->ki", held[number], direction)
            size = np.linalg.norm(rest, axis=1)
            new = size > DEPENDENT
            unit = rest[new] / size[new, None]
            held[number[new]] += unit[:, :, None] * unit[:, None, :]
    return held


def has_constant_normals(problem: ContactProblem) -> bool:
    """Whether the contact normal is constant on every facet: it is that of the facet, or of a plane obstacle."""
    return all(_is_plane(one) or one.normals is Normals.BODY for one in problem.contact.values())


def contact_normals(problem: ContactProblem, table: FacetTable, facets: IntArray) -> Array:
    """Contact normals (k, d) on contact facets (k,); where they vary on a facet, the normal of the facet."""
    normals = table.normals[facets].copy()
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
    flat = _FLAT * float(np.ptp(mine.reshape(-1, mine.shape[2]), axis=0).max(initial=0.0))
    found = np.ones((len(mine), len(others)), dtype=bool)
    for axis in range(mine.shape[2]):
        least = np.minimum(high[:, None, axis] - low[:, None, axis], above[:, axis] - below[:, axis])
        common = np.minimum(high[:, None, axis], above[:, axis]) - np.maximum(low[:, None, axis], below[:, axis])
        found &= common >= _OVER * least - flat
    return found
