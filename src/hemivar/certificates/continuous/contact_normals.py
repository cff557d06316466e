"""The normals along which a contact law measures the penetration, on the facets of the contact boundary."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.certificates.continuous.facet_table import FacetTable
from hemivar.mechanics.obstacles import Normals, Plane
from hemivar.mechanics.statement import Contact, ContactProblem

__all__ = ["contact_normals", "has_constant_normals"]


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
