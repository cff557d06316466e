"""A mesh for the user's own arrays: the node component of each unknown, and the node of each contact point."""

from __future__ import annotations

from typing import TypedDict

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import COUNTS, SAME, real_array, unmasked
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.space import Field
from hemivar.errors import ProblemError
from hemivar.mesh.boundary_rule import BoundaryRule, boundary_rule
from hemivar.mesh.mesh import Mesh

__all__ = ["Location", "located", "numbered_field"]


class Location(TypedDict, total=False):
    """Where contact points are, as arguments of :class:`hemivar.discrete.ContactPoints`."""

    points: Array | None
    frames: Array | None
    node: IntArray
    boundary: IntArray
    names: tuple[str, ...]


def numbered_field(mesh: Mesh, numbering: ArrayLike | None, prescribed: ArrayLike | None, unknowns: int) -> Field:
    """The displacement that n unknowns describe on a mesh.

    Shapes: ``numbering`` (N, d), ``prescribed`` (N, d).
    """
    expect(mesh, Mesh, "mesh", "hemivar.Mesh(points, cells, boundaries), rectangle, box and read_mesh make one")
    if numbering is None:
        raise ProblemError("numbering is missing; give the unknown of each node and component, (N, d), -1 where fixed")
    given_numbers = unmasked(numbering, "numbering")
    try:
        numbers = np.asarray(given_numbers)
    except ValueError as error:
        raise ProblemError(f"numbering is not an array ({error}); give integers, shape (N, d)") from None
    orders = {(len(mesh.nodes(order)), mesh.dim): order for order in (2, 1)}
    if numbers.shape not in orders or numbers.dtype.kind not in "iu":
        shapes = " or ".join(str(shape) for shape in sorted(orders))
        raise ProblemError(
            f"numbering has shape {numbers.shape} and type {numbers.dtype}; it must hold integers, shape {shapes}"
        )
    flat = numbers.ravel().astype(np.int64)
    free = np.flatnonzero(flat >= 0)
    if flat.min(initial=0) < -1 or flat.max(initial=-1) >= unknowns:
        worst = flat.min() if flat.min() < -1 else flat.max()
        raise ProblemError(f"numbering holds {worst}; use 0 to {unknowns - 1}, and -1 where the displacement is fixed")
    count = np.bincount(flat[free], minlength=unknowns)
    if (count != 1).any():
        which = int(np.flatnonzero(count != 1)[0])
        times = "at no node" if count[which] == 0 else f"at {count[which]} places"
        raise ProblemError(f"numbering: unknown {which} occurs {times}; give every unknown one node and component")
    values = np.zeros(flat.size)
    if prescribed is not None:
        given = real_array(prescribed, "prescribed", 2)
        if given.shape != numbers.shape:
            raise ProblemError(f"prescribed has shape {given.shape}; it must be that of the numbering, {numbers.shape}")
        values = np.where(flat < 0, given.ravel(), 0.0)
    basis = sp.csr_array((np.ones(free.size), (free, flat[free])), shape=(flat.size, unknowns))
    return Field(mesh, orders[numbers.shape], basis, values, mesh.dim, rigid=False)


def located(field: Field, trace: sp.csr_array, points: Array | None, frames: Array | None, m: int) -> Location:
    """Where m contact points of d components lie on the mesh, as arguments of :class:`ContactPoints`.

    A contact point is the node whose components its rows of the trace see, or that lies at its place if a support fixes
    all of them. Its boundary is that of the mesh which has most of the contact points. Without ``frames`` the rows are
    the unit vectors of the local components; what supports fix of them follows from the normal of the mesh.
    """
    mesh, dim = field.mesh, field.mesh.dim
    if m == 0 or trace.shape[0] != m * dim:
        return {"points": points, "frames": frames}
    node, rows = _nodes(field, trace, points, m)
    if (node < 0).any():  # integration points: drawn without states and arrows
        return {"points": points, "frames": frames}
    places = field.nodes[node] if points is None else points
    names, boundary = _boundaries(field, node)
    if frames is None:
        frames = _frames(field, rows, node, [boundary_rule(mesh, name, field.order) for name in names])
    return {"points": places, "frames": frames, "node": node, "boundary": boundary, "names": names}


def _nodes(field: Field, trace: sp.csr_array, points: Array | None, m: int) -> tuple[IntArray, Array]:
    """The node of each contact point, -1 where there is none, and its local components (m, d, d) as the trace says."""
    dim = field.mesh.dim
    seen = sp.csr_array(trace @ field.lift).tocoo()
    real = np.abs(seen.data) > SAME
    point, column, data = seen.row[real], seen.col[real], seen.data[real]
    low, high = np.full(m, field.number_of_nodes), np.full(m, -1)
    np.minimum.at(low, point // dim, column // dim)
    np.maximum.at(high, point // dim, column // dim)
    node = np.where(low == high, high, -1)
    unseen = np.flatnonzero(high < 0)
    if unseen.size and points is not None:
        apart = np.linalg.norm(field.nodes[None] - points[unseen, None], axis=2)
        nearest = apart.argmin(axis=1)
        size = float(np.ptp(field.nodes, axis=0).max())
        node[unseen] = np.where(apart.min(axis=1) <= SAME * size, nearest, -1)
    rows = np.zeros((m, dim, dim))
    rows[point // dim, point % dim, column % dim] = data
    return node, rows


def _boundaries(field: Field, node: IntArray) -> tuple[tuple[str, ...], IntArray]:
    """The names of the boundaries that contact points lie on, and the place of each point's in them."""
    mesh = field.mesh
    on = {name: np.isin(node, boundary_rule(mesh, name, field.order).nodes) for name in mesh.boundaries}
    boundary = np.full(len(node), -1)
    names: list[str] = []
    for name in sorted(on, key=lambda name: -np.count_nonzero(on[name])):
        here = on[name] & (boundary < 0)
        if here.any():
            boundary[here] = len(names)
            names.append(name)
    if (boundary < 0).any():
        first = int(np.flatnonzero(boundary < 0)[0])
        raise ProblemError(
            f"contact point {first} lies at node {node[first]}, on none of the named boundaries of the mesh "
            f"({', '.join(mesh.boundaries) or 'there are none'}); name one, mesh.with_boundaries({{'bottom': ...}})"
        )
    return tuple(names), boundary


def _frames(field: Field, rows: Array, node: IntArray, rules: list[BoundaryRule]) -> Array:
    """Unit vectors of the local components, (m, d, d), normal first: rows of the trace, completed where they vanish."""
    dim = field.mesh.dim
    size = np.linalg.norm(rows, axis=2)
    missing = size < SAME
    if (np.abs(size[~missing] - 1.0) > COUNTS).any() or not _orthogonal(rows):
        raise ProblemError(
            "the rows of the trace are not orthogonal unit vectors at the nodes of the contact points; give frames, "
            "(m, d, d), normal first"
        )
    turned, outward = rows.copy(), _normals(field, node, rules)
    for component in range(dim):
        here = np.flatnonzero(missing[:, component])
        wanted = np.broadcast_to(np.eye(dim), (here.size, dim, dim))
        if component == 0:
            wanted = np.concatenate([outward[here, None], wanted], axis=1)
        known = turned[here]
        rest = wanted - np.einsum("kwi,kji,kjl->kwl", wanted, known, known)
        long = np.linalg.norm(rest, axis=2)
        best = long.argmax(axis=1) if component else np.where(long[:, 0] > 0.1, 0, long.argmax(axis=1))
        chosen = np.arange(here.size), best
        turned[here, component] = rest[chosen] / long[chosen][:, None]
    return turned


def _orthogonal(rows: Array) -> bool:
    """Whether different rows of each point are orthogonal."""
    product = np.einsum("kij,klj->kil", rows, rows)
    return bool(np.abs(product - product * np.eye(rows.shape[1])).max(initial=0.0) <= COUNTS)


def _normals(field: Field, node: IntArray, rules: list[BoundaryRule]) -> Array:
    """Outward normals (m, d) at nodes, the mean of those of the facets around them."""
    total = np.zeros((field.number_of_nodes, field.mesh.dim))
    for rule in rules:
        nodes, _, summed = rule.summed_normals()
        total[nodes] += summed
    normals = total[node]
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None])
