"""What is known of gaps between the points where they are seen.

Gaps made of formulas are near to polynomials of degree 2 on small parts of facets, with a proved bound of the
difference (:mod:`hemivar.formula.expansion`).  On a part the penetration is nearest to one of degree 2, then, and this
lies below its control values: those at the corners, and ``2 q_m - (q_a + q_b) / 2`` at the middles of the edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.bounds.body_data import BodyData
from hemivar.fem.elements import shape_values
from hemivar.formula import Formula
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.instants import Instant
from hemivar.mechanics.obstacles import Plane
from hemivar.mesh.keys import EDGES

__all__ = ["GapRange", "gap_ranges", "unknown_gap"]

#: Parts into which each side of a facet is cut.
_PARTS = {2: 8, 3: 4}


@dataclass(frozen=True, eq=False)
class GapRange:
    """Contact facets of one boundary."""

    facets: IntArray  # (k,)
    #: By how much the gap may differ from a polynomial of degree 2 on its parts; inf where nothing is known.
    unknown: Array  # (k,)
    #: By how much the penetration may be above and below the domain of the law; negative inside of it.
    above: Array  # (k,)
    below: Array  # (k,)


def unknown_gap(data: BodyData, name: str, contact: Contact, formulas: bool) -> str:
    """Why the gap of a contact boundary is not known between the points; empty for a number and a plane.

    Also for a formula that intervals bound, where ``formulas`` serve.
    """
    if formulas and contact.obstacle is None and isinstance(_given(contact), Formula):
        gap_range = _range(data, name, contact, data.table.numbers(data.problem.mesh.boundaries[name]))
        if np.isfinite(gap_range.unknown).all():
            return ""
        facet = gap_range.facets[np.argmax(gap_range.unknown)]
        x = ", ".join(f"{part:.4g}" for part in data.table.mesh.points[data.table.facets[facet]].mean(axis=0))
        return f"the formula of the gap of contact '{name}' has no bound by intervals near x = ({x})"
    if isinstance(contact.obstacle, Plane) or (contact.obstacle is None and _is_number(contact)):
        return ""
    return f"the gap of contact '{name}' varies, and is evaluated by a quadrature rule"


def _given(contact: Contact) -> object:
    return contact.gap.value if isinstance(contact.gap, Instant) else contact.gap


def _is_number(contact: Contact) -> bool:
    return not callable(_given(contact))


def gap_ranges(data: BodyData) -> list[GapRange]:
    """Of each contact boundary without an obstacle; normals are those of the facets."""
    ranges = []
    for number, (name, contact) in enumerate(data.problem.contact.items()):
        if contact.obstacle is None:
            ranges.append(_range(data, name, contact, np.flatnonzero(data.contact == number)))
    return ranges


def _range(data: BodyData, name: str, contact: Contact, facets: IntArray) -> GapRange:
    table, dim = data.table, data.table.dim
    # where both are linear on a facet, its corners tell all
    parts = np.eye(dim)[None] if data.order == 1 and _is_number(contact) else _parts(dim)
    count, pieces = len(facets), len(parts)
    pairs = np.array(EDGES[dim - 1] if dim > 2 else ((0, 1),))
    corners = np.einsum("pab,fbi->fpai", parts, table.mesh.points[table.facets[facets]]).reshape(-1, dim, dim)
    seen = np.vstack([np.eye(dim), 0.5 * (np.eye(dim)[pairs[:, 0]] + np.eye(dim)[pairs[:, 1]])])
    shapes = shape_values(data.order, seen @ parts)
    moved = np.einsum("pqa,fai,fi->fpq", shapes, data.jump(data.displacement, facets), table.normals_of(facets))
    gap, off = _gap(name, contact, corners, seen)
    r = moved - gap.reshape(count, pieces, -1)
    ends, middles = r[..., :dim], r[..., dim:]
    control = np.concatenate([ends, 2.0 * middles - 0.5 * (ends[..., pairs[:, 0]] + ends[..., pairs[:, 1]])], axis=2)
    off = off.reshape(count, pieces)
    middle = table.mesh.points[table.facets[facets]].mean(axis=1)
    domain = contact.law.at(middle).penetrations
    sure = np.where(np.isfinite(off), off, 0.0)
    above = (control.max(axis=2) + sure).max(axis=1) - domain.upper
    below = domain.lower - (control.min(axis=2) - sure).min(axis=1)
    return GapRange(facets, off.max(axis=1), above, below)


def _gap(name: str, contact: Contact, corners: Array, seen: Array) -> tuple[Array, Array]:
    """Polynomials near to a gap, at points (q, d) of parts (k, d, d), and how far from it they may be, (k,)."""
    given, time = _given(contact), contact.gap.time if isinstance(contact.gap, Instant) else None
    expansion = given.expansion(corners, time) if isinstance(given, Formula) else None
    if expansion is not None and np.isfinite(expansion.off).all():
        return expansion.at(seen), expansion.off
    places = np.einsum("qa,kai->kqi", seen, corners)
    values = (
        DataField(contact.gap, f"gap of contact '{name}'")
        .at(places.reshape(-1, corners.shape[2]))
        .reshape(places.shape[:2])
    )
    if expansion is not None:
        return np.where(np.isfinite(expansion.off)[:, None], expansion.at(seen), values), expansion.off
    return values, np.full(len(corners), np.inf if callable(contact.gap) else 0.0)


def _parts(dim: int) -> Array:
    """Barycentric coordinates (p, d, d) of the corners of the parts of a facet."""
    n = _PARTS[dim]
    if dim == 2:
        at = np.arange(n + 1) / n
        ends = np.stack([at[:-1], at[1:]], axis=1)
        return np.stack([1.0 - ends, ends], axis=2)
    corners = []
    for i in range(n):
        for j in range(n - i):
            corners.append([[i, j], [i + 1, j], [i, j + 1]])
            if i + j < n - 1:
                corners.append([[i + 1, j + 1], [i, j + 1], [i + 1, j]])
    two = np.array(corners, dtype=float) / n
    return np.concatenate([1.0 - two.sum(axis=2, keepdims=True), two], axis=2)
