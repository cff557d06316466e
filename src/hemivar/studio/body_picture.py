"""A body and its solution as arrays that a page draws: the shape once, the fields for every solution."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem import nodal_average, von_mises
from hemivar.files.boundary import contact_boundaries
from hemivar.solvers.boundary_result import friction_of
from hemivar.solvers.contact_states import KINDS, ContactStates
from hemivar.studio.binary_message import Message

__all__ = ["BodyShape", "fields_of"]

#: Facets in space up to which their edges are drawn.
_EDGES = 20_000


@dataclass(frozen=True, eq=False)
class BodyShape:
    """What stays while loads and laws change: the mesh, its outline and the contact points."""

    kind: str  # "plane", "space", or "scalar" for a scalar problem on a plane mesh, whose unknown is drawn as a height
    vertex: IntArray  # (n,): vertices of the mesh that are drawn: all in the plane, those of the surface in space
    points: Array  # (n, 3): where they are at rest
    triangles: IntArray  # (k, 3)
    lines: IntArray  # (l, 2): the outline in the plane, the edges of the surface in space
    places: Array  # (m, 3)
    normals: Array  # (m, 3)
    boundaries: list[dict[str, object]]
    weights: Array  # (m,): length or area of each contact point

    @classmethod
    def of(cls, problem: DiscreteProblem) -> BodyShape:
        """The shape of a problem with a mesh."""
        if problem.field is None:
            raise ProblemError(
                "this problem was made of arrays and has no mesh to show; give one, of_arrays(..., mesh=...)"
            )
        mesh, contact = problem.field.mesh, problem.contact
        scalar = problem.origin is not None and problem.origin.kind is not None
        if mesh.dim == 2:
            vertex, triangles, lines = np.arange(mesh.number_of_nodes), mesh.cells, mesh.boundary_facets
        else:
            vertex, row = np.unique(mesh.boundary_facets, return_inverse=True)
            triangles = row.reshape(mesh.boundary_facets.shape)
            pairs = triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
            lines = np.unique(np.sort(pairs, axis=1), axis=0) if len(triangles) <= _EDGES else np.zeros((0, 2), int)
        places = np.zeros((contact.count, mesh.dim)) if contact.points is None else contact.points
        normals = np.zeros_like(places) if contact.frames is None else contact.frames[:, 0, : mesh.dim]
        kind = "space" if mesh.dim == 3 else "scalar" if scalar else "plane"
        return cls(
            kind, vertex, _in_space(mesh.points[vertex]), triangles, lines, _in_space(places), _in_space(normals),
            _boundaries(problem), contact.weights,
        )  # fmt: skip

    @cached_property
    def key(self) -> str:
        """The same for the same shape."""
        digest = hashlib.sha256(self.kind.encode())
        for array in (self.points, self.triangles, self.places, self.normals):
            digest.update(np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()[:16]

    def message(self, generation: int) -> Message:
        """For the page."""
        size = float(np.linalg.norm(np.ptp(self.points, axis=0)))
        states = [kind.label for kind in KINDS]
        head = {
            "type": "shape", "generation": generation, "key": self.key, "kind": self.kind, "size": size,
            "boundaries": self.boundaries, "states": states,
        }  # fmt: skip
        arrays = {
            "points": self.points, "triangles": self.triangles, "lines": self.lines, "places": self.places,
            "normals": self.normals, "weights": self.weights,
        }  # fmt: skip
        return Message(head, arrays)


def fields_of(
    shape: BodyShape,
    problem: DiscreteProblem,
    displacement: Array,
    local: Array,
    multiplier: Array,
    states: ContactStates,
) -> Mapping[str, AnyArray]:
    """The arrays of one equilibrium.

    ``displacement (n, 3)`` of the vertices that are drawn, ``stress (n,)`` by von Mises where there is a material,
    ``penetration (n,)`` at vertices of the contact boundary and nan elsewhere, ``moved (m, 3)`` of the contact points,
    ``local (m, c)``, ``pressure`` and ``friction (m,)``, the latter the size of the vector in space, ``state (m,)``.

    Shapes: ``displacement`` (nodes, d), ``local`` (m, c), ``multiplier`` (m, c).
    """
    field, contact = problem.field, problem.contact
    assert field is not None
    moved_all = displacement.reshape(field.number_of_nodes, -1)
    vertices = moved_all[shape.vertex]
    arrays: dict[str, AnyArray] = {"displacement": _in_space(vertices, height=shape.kind == "scalar")}
    if problem.origin is not None and not problem.origin.kind:
        stress = nodal_average(field.mesh, von_mises(problem.origin, displacement))
        arrays["stress"] = stress[shape.vertex]
    penetration = np.full(field.mesh.number_of_nodes, np.nan)
    at = np.flatnonzero((contact.node >= 0) & (contact.node < len(penetration)))
    penetration[contact.node[at]] = local[at, 0]
    for boundary in contact_boundaries(problem) if (contact.node < 0).any() else ():
        if boundary.facets is not None:
            corners = boundary.corners[boundary.facets]
            penetration[corners] = np.fmax(penetration[corners], local[boundary.index, :1])
    friction = friction_of(multiplier)
    signed = friction[:, 0] if friction.shape[1] == 1 else np.linalg.norm(friction, axis=1)
    arrays |= {
        "penetration": penetration[shape.vertex],
        "moved": _in_space(contact.moved(moved_all), height=shape.kind == "scalar"),
        "local": local,
        "pressure": multiplier[:, 0],
        "friction": signed,
        "state": states.numbers,
    }
    return arrays


def _boundaries(problem: DiscreteProblem) -> list[dict[str, object]]:
    """Each contact boundary, and each area of contact, with the places of its points along it."""
    contact = problem.contact
    if contact.points is None or not contact.count or (contact.boundary < 0).any():
        return []
    lines = {boundary.name: boundary for boundary in contact_boundaries(problem)}
    listed: list[dict[str, object]] = []
    for name in contact.names:
        index = contact.on(name)
        if not index.size:
            continue
        if name in lines and contact.points.shape[1] == 2:
            along, axis = lines[name].position(contact.points)
        else:
            own = contact.points[index]
            widest = int(np.argmax(np.ptp(own, axis=0)))
            along, axis = own[:, widest], "xyz"[widest]
        entry = {"name": name, "index": index.tolist(), "along": along.tolist(), "axis": axis}
        listed.append({**entry, "pair": name in contact.pairs})
    return listed


def _in_space(vectors: Array, height: bool = False) -> Array:
    """Vectors (n, d) with three components; one component is a height if asked for."""
    space = np.zeros((len(vectors), 3))
    if height:
        space[:, 2] = vectors[:, 0]
    else:
        space[:, : vectors.shape[1]] = vectors
    return space
