"""Contact of one component: along boundaries, and over areas."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.errors import ProblemError
from hemivar.fem.contact_points import BoundaryContact, shares
from hemivar.fem.supports import Supports, in_words
from hemivar.laws import ContactLaw, Friction, NoContact
from hemivar.mechanics.conditions import LARGEST, evaluate_scalar
from hemivar.mechanics.instants import error_context
from hemivar.mechanics.scalar import ScalarContact, ScalarProblem, Side

__all__ = ["scalar_contacts"]


def scalar_contacts(problem: ScalarProblem, supports: Supports) -> list[BoundaryContact]:
    """The contact points of each boundary and area: nodes, with the lumped weights of boundary or area.

    A law of the penetration has one local component. If any law is friction, contact points have two: friction acts on
    the second one, laws of the penetration on the first, and the other one is not there.
    """
    nodes = supports.nodes
    places = _places(problem, len(nodes))
    _refuse_shared(problem, places, nodes, supports.count == 0)
    components = 2 if any(place.contact.rubs for place in places) else 1
    names = tuple(place.name for place in places)
    found = []
    for number, place in enumerate(places):
        contact, at, count = place.contact, nodes[place.nodes], len(place.nodes)
        where = f"level of contact '{place.name}'"
        level = evaluate_scalar(contact.level, at, where)
        if not (np.abs(level) < LARGEST).all():
            raise ProblemError(
                f"{where}: {level[np.argmax(np.abs(level))]:g} is beyond the range of numbers; take another unit"
            )
        sign, stated = 1.0 if contact.side is Side.ABOVE else -1.0, contact.law
        with error_context(f"contact '{place.name}'", stated):
            law = (ContactLaw(NoContact(), stated) if isinstance(stated, Friction) else ContactLaw(stated)).at(at)
        column = int(contact.rubs)
        rows = np.arange(count) * components + column
        trace = sp.csr_array((np.full(count, sign), (rows, place.nodes)), shape=(count * components, len(nodes)))
        boundary = np.full(count, number)
        points = ContactPoints(trace, place.weights, at, node=place.nodes, boundary=boundary, names=names)
        offset = np.zeros((count, components))
        offset[:, column] = sign * level
        found.append(
            BoundaryContact(points, offset[:, 0], offset[:, 1:], law, np.zeros((count, components), dtype=bool))
        )
    return found


@dataclass(frozen=True, eq=False)
class _Place:
    """The nodes of one contact, with their weights."""

    name: str
    contact: ScalarContact
    nodes: IntArray
    weights: Array


def _places(problem: ScalarProblem, count: int) -> list[_Place]:
    """Boundaries, then areas; a node of two boundaries, or of two areas, belongs to the first of them entirely."""
    mesh, order = problem.mesh, problem.order
    found: list[_Place] = []

    def add(name: str, contact: ScalarContact, members: IntArray, parts: Array, rivals: slice) -> None:
        summed = np.bincount(members.ravel(), weights=parts.ravel(), minlength=count)
        for k in range(rivals.start, len(found)):
            own = found[k].nodes
            found[k] = replace(found[k], weights=found[k].weights + summed[own])
            summed[own] = 0.0
        nodes = np.flatnonzero(summed)
        if not len(nodes):
            raise ProblemError(f"every node of contact '{name}' belongs to another one; join the two")
        found.append(_Place(name, contact, nodes, np.asarray(summed[nodes], dtype=float)))

    for name, contact in problem.contact.items():
        facets = mesh.boundaries[name]
        share, measures = shares(order, mesh.dim), mesh.facet_normals(facets)[1]
        add(name, contact, mesh.facet_nodes(facets, order), np.outer(measures, share), slice(0, None))
    boundaries, share = len(found), np.full(mesh.dim + 1, 1.0 / (mesh.dim + 1))
    whole = isinstance(problem.area, ScalarContact)
    for name, contact in problem.areas.items():
        cells = slice(None) if whole else mesh.regions[name]
        add(name, contact, mesh.cells[cells], np.outer(mesh.volumes[cells], share), slice(boundaries, None))
    return found


def _refuse_shared(problem: ScalarProblem, places: list[_Place], nodes: Array, free: BoolArray) -> None:
    """Refuse contact over an area at free nodes of a contact boundary: two laws would act on one unknown."""
    number = len(problem.contact)
    for first in places[:number]:
        for second in places[number:]:
            shared = np.intersect1d(first.nodes, second.nodes)
            shared = shared[free[shared]]
            if len(shared):
                raise ProblemError(
                    f"contacts '{first.name}' (boundary) and '{second.name}' (area) share {len(shared)} nodes, the "
                    f"first at x = {in_words(nodes[shared[0]])}; restrict the area to a region without the cells at "
                    f"'{first.name}'"
                )
