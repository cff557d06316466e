"""Contact points of a body of bilinear forms: traces at quadrature points or nodes, and what of them is free."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
import skfem

from hemivar.basics.arguments import UNFIT, shortened
from hemivar.basics.arrays import COUNTS, SAME, real_array
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.errors import ProblemError
from hemivar.fem.contact_points import BoundaryContact, adapted, frames_of
from hemivar.fem.form_field import ScikitFem
from hemivar.fem.supports import SHARP, in_words, unit
from hemivar.laws import ContactLaw
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.instants import error_context

__all__ = ["Touching", "TraceOf", "TraceRows", "nearness", "rows_on", "share_nodes"]


#: Newton-Cotes rules at the nodes of order 1 and 2: places in the reference cell of scikit-fem, and weights.
_NODES = {
    ("line", 1): ([[0.0], [1.0]], [1 / 2, 1 / 2]),
    ("line", 2): ([[0.0], [1.0], [0.5]], [1 / 6, 1 / 6, 4 / 6]),
    ("tri", 1): ([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [1 / 6, 1 / 6, 1 / 6]),
    ("quad", 1): ([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [1 / 4, 1 / 4, 1 / 4, 1 / 4]),
    ("quad", 2): (
        [[x, y] for y in (0.0, 0.5, 1.0) for x in (0.0, 0.5, 1.0)],
        [p * q for q in (1 / 6, 4 / 6, 1 / 6) for p in (1 / 6, 4 / 6, 1 / 6)],
    ),
    ("tet", 1): ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [1 / 24] * 4),
}
#: Words of scikit-fem's reference cells.
_SHAPES = {"RefLine": "line", "RefTri": "tri", "RefQuad": "quad", "RefTet": "tet", "RefHex": "hex"}
#: The middle of each reference cell, and its measure.
_MIDDLE = {
    "line": ([[0.5]], [1.0]),
    "tri": ([[1 / 3, 1 / 3]], [1 / 2]),
    "quad": ([[0.5, 0.5]], [1.0]),
    "tet": ([[0.25, 0.25, 0.25]], [1 / 6]),
    "hex": ([[0.5, 0.5, 0.5]], [1.0]),
}
#: Sizes of the combinations of basis functions of which a trace must be the combination of traces.
_COMBINED = (0.0, 1.0, -1e3)

#: What touches a foundation: of the fields of a basis function, one after the other, those that are displaced.
TraceOf = Callable[..., object]


def nearness(mesh: ScikitFem) -> float:
    """The distance below which two places are one."""
    return SAME * float(np.ptp(mesh.p, axis=1).max())


def rows_on(basis: ScikitFem, name: str, facets: IntArray | None, trace: TraceOf | None, at: str | int) -> TraceRows:
    """What touches at the points of a rule on facets, or on the cells of a region where there are none."""
    mesh, order = basis.mesh, _order_of(basis.elem)
    if facets is None:
        where: dict[str, object] = {"elements": mesh.subdomains[name]}
        shape, kind, middle = _shape(mesh.refdom, name), skfem.CellBasis, basis.elem.interior_dofs
    else:
        where, middle = {"facets": facets}, basis.elem.facet_dofs
        shape, kind = _shape(mesh.brefdom, name), skfem.FacetBasis
    serendipity = shape == "quad" and order == 2 and not middle
    if at == "nodes" and (serendipity or (shape, order) not in _NODES):
        raise ProblemError(
            f"contact['{name}']: elements of order {order} have no positive weights at the nodes of a {shape}; "
            "write at=1, for one point on each"
        )
    if isinstance(at, int) and at > 1:
        where["intorder"] = at
    else:
        places, weights = _NODES[shape, order] if at == "nodes" else _MIDDLE[shape]
        where["quadrature"] = np.array(places).T, np.array(weights)
    rows = _rows(kind(mesh, basis.elem, mapping=basis.mapping, **where), trace, name)
    if not (rows.weights > 0.0).all():
        raise ProblemError(f"contact['{name}']: the rule of degree {at} has negative weights; take another degree")
    return rows.merged(nearness(mesh)) if at == "nodes" else rows


@dataclass(frozen=True, eq=False)
class TraceRows:
    """What touches at m places, component by component, before the normals are chosen."""

    rows: sp.csr_array  # (m * c, N)
    weights: Array  # (m,)
    points: Array  # (m, d)
    normals: Array | None  # (m, d), not of length 1 where some were averaged
    area: bool
    #: Where another contact has the same node at a sharp corner, so that neither rubs.
    sharp: BoolArray  # (m,)

    @property
    def components(self) -> int:
        return int(self.rows.shape[0]) // len(self.weights)

    def take(self, chosen: BoolArray) -> TraceRows:
        """Some of the points."""
        normals = None if self.normals is None else self.normals[chosen]
        rows = sp.csr_array(self.rows[np.repeat(chosen, self.components)])
        return TraceRows(rows, self.weights[chosen], self.points[chosen], normals, self.area, self.sharp[chosen])

    def merged(self, near: float) -> TraceRows:
        """Places that coincide are one; weights are added, rows and normals are means by their weights."""
        with IMPORTS:
            from scipy.spatial import cKDTree

        together = cKDTree(self.points).query_pairs(near, output_type="ndarray")
        m = len(self.weights)
        graph = sp.csr_array((np.ones(len(together)), (together[:, 0], together[:, 1])), shape=(m, m))
        _, group = sp.csgraph.connected_components(graph, directed=False)
        _, first = np.unique(group, return_index=True)
        weights: Array = np.bincount(group, self.weights).astype(float)
        share = self.weights / weights[group]
        count, size = len(first), self.rows.shape[0] // len(self.weights)
        mean = sp.csr_array((share, (group, np.arange(len(group)))), shape=(count, len(group)))
        rows = sp.csr_array(sp.kron(mean, sp.eye_array(size)) @ self.rows)
        rows.data[np.abs(rows.data) < 1e-12 * np.abs(rows.data).max(initial=0.0)] = 0.0
        rows.eliminate_zeros()
        normals = None if self.normals is None else mean @ self.normals
        return TraceRows(rows, weights, self.points[first], normals, self.area, self.sharp[first])

    def touching(self, name: str, contact: Contact, free: IntArray, number: tuple[int, tuple[str, ...]]) -> Touching:
        """The contact points of a contact that is the ``number[0]``th of the names ``number[1]``."""
        m, dim, size = len(self.weights), self.points.shape[1], self.components
        frames, rows, blocked = None, self.rows, np.zeros((m, size), dtype=bool)
        if size == 1:
            if contact.friction.acts:
                raise ProblemError(
                    f"contact['{name}'] has friction, and one component touches; state its law as the normal one"
                )
            rows = sp.csr_array((-1.0 if contact.side is Side.BELOW else 1.0) * rows)
        elif self.area or self.normals is None or size != dim:
            raise ProblemError(
                f"contact['{name}']: {size} components touch over an area, or are not displacements; give trace=, "
                f"which "
                "returns one component"
            )
        else:
            frames, blocked = adapted(frames_of(self._outward(name)), *self._directions(free))
            blocked[self.sharp, 1:] = True
            rows = sp.csr_array(_blocks(frames) @ rows)
        boundary, names = np.full(m, number[0]), number[1]
        return Touching(ContactPoints(rows, self.weights, self.points, frames, boundary=boundary, names=names), blocked)

    def _outward(self, name: str) -> Array:
        """Unit normals (m, d)."""
        assert self.normals is not None
        size = np.linalg.norm(self.normals, axis=1)
        if size.min() <= 1e-8:
            point = in_words(self.points[int(np.argmin(size))])
            raise ProblemError(
                f"contact['{name}'] folds back on itself at x = {point}, so it has no normal there; split it into two "
                "boundaries"
            )
        return unit(self.normals)

    def _directions(self, free: IntArray) -> tuple[Array, IntArray]:
        """Directions (m, c, c) in which no free unknown moves a point, the first ones of each, and their number."""
        moved = [sp.csr_array(self.rows[k :: self.components][:, free]) for k in range(self.components)]
        gram = np.array([[np.asarray(one.multiply(other).sum(axis=1)).ravel() for other in moved] for one in moved])
        sizes, vectors = np.linalg.eigh(gram.transpose(2, 0, 1))
        fixed = sizes <= COUNTS**2 * sizes.max()
        directions = vectors.transpose(0, 2, 1) * fixed[:, :, None]
        return np.where(directions[:, :, :1] + 0.6 * directions[:, :, 1:2] < 0.0, -directions, directions), fixed.sum(
            axis=1
        )


@dataclass(frozen=True, eq=False)
class Touching:
    """The contact points of one boundary or region, whose trace is that of all unknowns of the basis."""

    points: ContactPoints
    blocked: BoolArray  # (m, c)

    def at(self, name: str, contact: Contact) -> BoundaryContact:
        """With gap and law of the contact at one time."""
        points, where = self.points, np.asarray(self.points.points)
        gap = DataField(contact.gap, f"gap of contact '{name}'").at(where)
        still = np.zeros((points.count, points.components - 1 if points.frames is None else points.components))
        with error_context(f"contact '{name}'", contact.normal, contact.friction):
            law = contact.law if points.frames is not None else ContactLaw(contact.normal)  # type: ignore[arg-type]
            return BoundaryContact(points, gap, still, law.at(where), self.blocked)


def share_nodes(rows: dict[str, TraceRows], near: float) -> None:
    """Where two contacts have a node, the first has it if they meet smoothly; at a sharp corner neither rubs."""
    with IMPORTS:
        from scipy.spatial import cKDTree

    names = list(rows)
    for later, other in enumerate(names):
        for name in names[:later]:
            first, second = rows[name], rows[other]
            if first.area is not second.area:
                continue
            distance, node = cKDTree(first.points).query(second.points)
            theirs = np.flatnonzero(distance <= near)
            mine, alike = node[theirs], np.ones(theirs.size, dtype=bool)
            normals, sharp, also = first.normals, first.sharp.copy(), second.sharp.copy()
            weights = first.weights.copy()
            if first.components > 1 and normals is not None and second.normals is not None:
                one, two = unit(normals[mine]), unit(second.normals[theirs])
                alike = np.einsum("kd,kd->k", one, two) > SHARP
                summed = one * weights[mine, None] + two * second.weights[theirs, None]
                normals = normals.copy()
                normals[mine[alike]] = summed[alike]
            sharp[mine[~alike]], also[theirs[~alike]] = True, True
            weights[mine[alike]] += second.weights[theirs[alike]]
            left = np.ones(also.size, dtype=bool)
            left[theirs[alike]] = False
            if not left.any():
                raise ProblemError(f"every node of contact '{other}' belongs to '{name}'; join the two")
            rows[name] = replace(first, weights=weights, normals=normals, sharp=sharp)
            rows[other] = replace(second, sharp=also).take(left)


def _blocks(frames: Array) -> sp.csr_array:
    """The block diagonal matrix of (m, d, d)."""
    m, d, _ = frames.shape
    columns = np.broadcast_to(np.arange(m * d).reshape(m, 1, d), frames.shape)
    return sp.csr_array((frames.ravel(), columns.ravel(), np.arange(0, m * d * d + 1, d)), shape=(m * d, m * d))


def _first_field(first: ScikitFem, *others: ScikitFem) -> ScikitFem:
    return first


def _rows(local: ScikitFem, trace: TraceOf | None, name: str) -> TraceRows:
    """The trace of every basis function at the points of a rule on cells or facets."""
    touching: TraceOf = _first_field if trace is None else trace
    points = np.asarray(local.global_coordinates())
    dim, cells, places = points.shape
    table = np.stack([_traced(touching, function, name, (cells, places)) for function in local.basis])
    if trace is not None:
        _refuse_not_linear(local.basis, touching, table, name)
    functions, size = table.shape[:2]  # (functions, c, cells, places)
    row = np.arange(cells * places * size).reshape(cells, places, size)
    at = np.broadcast_to(row[None], (functions, cells, places, size))
    columns = np.broadcast_to(np.asarray(local.element_dofs)[:, :, None, None], at.shape)
    entries = table.transpose(0, 2, 3, 1)
    matrix = sp.csr_array(
        sp.coo_array((entries.ravel(), (at.ravel(), columns.ravel())), shape=(row.size, int(local.N)))
    )
    matrix.eliminate_zeros()
    normals = getattr(local, "normals", None)
    outward = None if normals is None else np.asarray(normals).reshape(dim, -1).T
    weights = np.asarray(local.dx).ravel()
    still, area = np.zeros(weights.size, dtype=bool), outward is None
    return TraceRows(matrix, weights, points.reshape(dim, -1).T, outward, area, still)


def _traced(
    trace: TraceOf, fields: Sequence[ScikitFem], name: str, shape: tuple[int, ...], finite: bool = True
) -> Array:
    """The trace of fields at the points, (c, cells, places)."""
    what = f"contact['{name}']: trace"
    try:
        with np.errstate(all="ignore"):
            traced = trace(*fields)
    except UNFIT as error:
        raise ProblemError(
            f"{what} cannot be evaluated ({shortened(error)}); give a function of the fields of the element"
        ) from error
    value = real_array(traced, what, finite=finite)
    if value.shape[-2:] != shape or value.ndim > 3:
        raise ProblemError(f"{what} returns arrays of shape {value.shape}; give shape ([c,] {shape[0]}, {shape[1]})")
    return value if value.ndim == 3 else value[None]


def _refuse_not_linear(basis: Sequence[Sequence[ScikitFem]], trace: TraceOf, table: Array, name: str) -> None:
    """A trace of a combination of basis functions is that of their traces."""
    share = 1.0 + 0.5 * np.cos(np.arange(len(basis)))
    rounding = SAME * np.einsum("f,fcep->cep", share, np.abs(table)).max(axis=(1, 2), keepdims=True)
    for size in _COMBINED:
        fields = [_combination(parts, size * share) for parts in zip(*basis, strict=True)]
        combined = _traced(trace, fields, name, table.shape[2:], False)
        with np.errstate(invalid="ignore"):
            error = np.abs(combined - np.einsum("f,fcep->cep", size * share, table))
        if not (error <= max(abs(size), 1.0) * rounding).all():
            raise ProblemError(
                f"contact['{name}']: trace is not linear in the fields; give components or derivatives of them times "
                "numbers, and what is added to them as the gap"
            )


def _combination(parts: Sequence[ScikitFem], share: Array) -> ScikitFem:
    """The combination of one field of basis functions, with its derivatives."""
    several = zip(*(part.astuple for part in parts), strict=True)
    return skfem.DiscreteField(*(None if one[0] is None else np.tensordot(share, np.stack(one), 1) for one in several))


def _order_of(elem: ScikitFem) -> int:
    """1 where values stand at vertices alone, 2 where also at edges."""
    names = list(elem.dofnames)
    inner = names[elem.nodal_dofs : elem.nodal_dofs + elem.facet_dofs + elem.edge_dofs]
    return 2 if any(not part.startswith("u_n") for part in inner) else 1


def _shape(reference: ScikitFem, name: str) -> str:
    """The word of a reference cell of scikit-fem."""
    if (shape := _SHAPES.get(reference.__name__)) is None:
        raise ProblemError(
            f"contact['{name}']: contact on cells or facets like {reference.__name__} of scikit-fem is not known; take "
            "triangles, quadrilaterals, tetrahedra or hexahedra"
        )
    return shape
