"""What facetwise linear loads do not see of a trace: ``kappa_F^2 = sup |v - Pi_1 v|_F^2 / |v|_{a,R}^2``.

R is a part of the body at the facet F, those of different facets disjoint, or else their constants are added.  No
formula is needed: cut R into parts of which those at F are similar to it, N along each edge.  For a load g on F without
linear part, split in its facetwise linear part on the cut facets and the rest, the former is answered by stresses in
equilibrium and the latter seen by the small parts alone, whose constant is ``kappa^2 / N``; hence

    kappa^2 <= mu_N / (1 - 1 / N),

``mu_N`` the largest complementary energy of R, free, under the facetwise linear loads on F of norm one that are
orthogonal to linear functions.  In the plane R is the cell at F.  In space it is the prism above F where that lies in
the body, which is cut into prisms above F and above F turned round: the worse of both counts for both.  Elsewhere it is
the cell at F, whose parts are of finitely many shapes, and the worst counts.

For displacements U, linear on each facet, and V, linear on the cell, the work of a stress of the split element is
``sum m . (U - V) + int s : eps(V)``.  The stiffness ``A H^-1 A'``, H the complementary energy in the degrees of freedom
of the element and A this work, is that of a body whose stresses answer forces on facets, the moments of tractions, and
on cells, linear ones, exactly: the least complementary energy of a load is half its work.  With no force on cells V is
eliminated beforehand.  It is singular on rigid motions alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.continuous.facet_table import FacetTable, facet_table, facet_vertices
from hemivar.certificates.continuous.split_element import pulled_back, split_element, voigt
from hemivar.fem.directed_matrix import directed_matrix
from hemivar.mesh.build import box
from hemivar.mesh.mesh import Mesh

__all__ = ["FacetConstants", "equilibrated_blocks", "facet_constants"]

#: How often a cell in the plane, a cell in space and a prism are cut in halves.
_HALVINGS = {2: 2, 3: 1}
_PRISM_HALVINGS = 2
#: Digits to which two shapes are one.
_DIGITS = 9
#: Part of a compliance by which it may differ from an isotropic one and count as such.
_ISOTROPIC = 1e-12
#: Heights of prisms that are tried, in terms of the root of twice the area of the facet.
_HEIGHTS = (1.0, 0.7, 0.5, 0.25)
#: Part of a size by which two bodies may overlap and count as disjoint.
_TOUCHING = 1e-9


def equilibrated_blocks(compliance: Array, jacobian: Array, *, loaded: bool = False) -> Array:
    """Stiffness matrices of cells.

    ``compliance`` is (M, v, v); ``jacobian`` is (M, d, d); returns (M, k, k). In ``U[i, a]``, vertex a of facet i, and
    if loaded ``V[a]`` at the vertices of the cell; all components of each one after another, ``k = d d (d + 1)``, and
    ``d (d + 1)`` more.
    """
    dim = jacobian.shape[-1]
    rows, columns = split_element(dim).upper
    basis, energies = _loaded(dim) if loaded else _balanced(dim)
    n = energies.shape[-1]
    H = (compliance[:, rows, columns] @ energies.reshape(len(energies), -1)).reshape(len(compliance), n, n)
    blocks = basis @ np.linalg.solve(H, np.broadcast_to(basis.T, (len(H), *basis.T.shape)))
    blocks = blocks.reshape(len(H), -1, dim, basis.shape[0] // dim, dim)  # displacements are pulled back by B'
    blocks = np.einsum("majbl,mij->maibl", blocks, jacobian, optimize=True)
    blocks = np.einsum("majbl,mkl->majbk", blocks, jacobian, optimize=True).reshape(len(H), *2 * basis.shape[:1])
    return np.asarray(0.5 * (blocks + blocks.transpose(0, 2, 1)))


@cache
def _balanced(dim: int) -> tuple[Array, Array]:
    """A basis of the moments in balance, and the energies in it."""
    element = split_element(dim)
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    x = corners[facet_vertices(dim)] - corners.mean(axis=0)
    conditions = []
    for i in range(dim):
        push = np.zeros((dim + 1, dim, dim))
        push[:, :, i] = 1.0
        conditions.append(push.ravel())
        for j in range(i):
            turn = np.zeros((dim + 1, dim, dim))
            turn[:, :, j], turn[:, :, i] = x[:, :, i], -x[:, :, j]
            conditions.append(turn.ravel())
    basis = la.null_space(np.array(conditions))
    return basis, basis.T @ element.energies @ basis


@cache
def _loaded(dim: int) -> tuple[Array, Array]:
    """The work A of all degrees of freedom, and the energies in them."""
    element = split_element(dim)
    number = element.values.shape[-1]
    products = np.einsum("bapk,ac,bcql->pqkl", element.values, element.mass, element.values)
    p, q = element.upper
    energies = np.where((p == q)[:, None, None], 1.0, 2.0) * 0.5 * (products[p, q] + products[p, q].transpose(0, 2, 1))
    moments = element.moments
    work: Array = np.zeros((moments + dim * (dim + 1), number))
    work[:moments, :moments] = np.eye(moments)
    gradients = np.vstack([-np.ones(dim), np.eye(dim)])
    shear = np.where(np.arange(number - moments) < dim, 1.0, 2.0)
    for a in range(dim + 1):
        for c in range(dim):
            row = moments + a * dim + c
            for i, members in enumerate(facet_vertices(dim)):
                for place in np.flatnonzero(members == a):
                    work[row, (i * dim + int(place)) * dim + c] -= 1.0
            work[row, moments:] = shear * voigt(np.outer(np.eye(dim)[c], gradients[a]))
    return work, energies


@dataclass(frozen=True, eq=False)
class FacetConstants:
    """Constants of facets."""

    #: ``kappa_F^2``.
    squares: Array  # (k,)
    #: Facets with the same number have a region in common.
    regions: IntArray  # (k,)

    def total(self, weights: Array | float = 1.0) -> float:
        """The largest sum over a region of ``weight kappa_F^2``, weights (k,)."""
        return float(np.bincount(self.regions, weights * self.squares).max(initial=0.0))


def facet_constants(table: FacetTable, compliance: Array, facets: IntArray) -> FacetConstants:
    """Constants of some facets of the boundary.

    ``compliance`` is (M or 1, v, v); ``facets`` is (k,).
    """
    dim = table.dim
    owner = table.owners[facets, 0]
    if dim == 3 and len(compliance) == 1 and (found := _above(table, compliance[0], facets)) is not None:
        return FacetConstants(found, np.arange(len(facets)))
    local = np.argmax(table.cell_facets[owner] == facets[:, None], axis=1)
    # the vertex opposite to the facet first, lengths in units of the cell
    order = np.array([[i, *(a for a in range(dim + 1) if a != i)] for i in range(dim + 1)])[local]
    corners = table.mesh.points[np.take_along_axis(table.cells[owner], order, axis=1)]
    size = table.volumes[owner] ** (1.0 / dim)
    shape = (corners - corners[:, :1]) / size[:, None, None]
    matrices = np.broadcast_to(compliance, (len(table.cells), *compliance.shape[1:]))[owner]
    softness = np.abs(matrices).max(axis=(1, 2))
    key = np.hstack([shape.reshape(len(owner), -1), (matrices / softness[:, None, None]).reshape(len(owner), -1)])
    _, first, number = np.unique(np.round(key, _DIGITS), axis=0, return_index=True, return_inverse=True)
    unit = matrices[first] / softness[first, None, None]
    if dim == 2:
        found = _of_triangles(shape[first], unit)
    else:
        found = np.array([_of_tetrahedron(s, m) for s, m in zip(shape[first], unit, strict=True)])
    return FacetConstants(found[number.ravel()] * size * softness, owner)


# ---- cells ---------------------------------------------------------------------------------------------------------


@cache
def _cut_simplex(dim: int, times: int) -> tuple[FacetTable, IntArray, Array]:
    """A simplex cut up: its facets, those on the one opposite to the first vertex, barycentric coordinates of nodes."""
    one = Mesh.oriented(np.vstack([np.zeros(dim), np.eye(dim)]), [list(range(dim + 1))])
    here = (np.sort(one.boundary_facets, axis=1) == np.arange(1, dim + 1)).all(axis=1)
    mesh = one.with_boundaries({"loaded": one.boundary_facets[here]}).refined(times)
    table = facet_table(mesh)
    barycentric = np.column_stack([1.0 - mesh.points.sum(axis=1), mesh.points])
    return table, table.numbers(mesh.boundaries["loaded"]), barycentric


def _of_triangles(corners: Array, compliance: Array) -> Array:
    """``kappa^2`` (s,) for the sides opposite to the first corners of triangles (s, 3, 2), all at once."""
    times = _HALVINGS[2]
    table, loaded, barycentric = _cut_simplex(2, times)
    count, cells = len(corners), len(table.cells)
    points = barycentric @ corners
    at = points[:, table.cells]
    jacobian = (at[:, :, 1:] - at[:, :, :1]).swapaxes(-1, -2).reshape(-1, 2, 2)
    pulled = pulled_back(np.repeat(compliance, cells, axis=0), jacobian, np.abs(np.linalg.det(jacobian)))
    blocks = equilibrated_blocks(pulled, jacobian).reshape(count, cells, 12, 12)
    n = 4 * len(table.facets)
    place = (table.cell_facets[:, :, None] * 4 + np.arange(4)).reshape(cells, 12)
    K: Array = np.zeros((count, n * n))
    flat = (place[:, :, None] * n + place[:, None, :]).ravel()
    for shape, block in zip(K, blocks, strict=True):
        shape += np.bincount(flat, block.ravel(), minlength=n * n)
    K = K.reshape(count, n, n)
    on = (loaded[:, None] * 4 + np.arange(4)).ravel()
    rest = np.setdiff1d(np.arange(n), on)
    coupling = K[:, rest[:, None], on]
    condensed = K[:, on[:, None], on] - coupling.transpose(0, 2, 1) @ np.linalg.solve(
        K[:, rest[:, None], rest], coupling
    )
    sides = points[:, table.facets[loaded]]
    length = np.linalg.norm(sides[:, :, 1] - sides[:, :, 0], axis=-1)
    change = np.einsum(
        "sf,ab,ij,fg->sfaigbj", length**-0.5, np.linalg.inv(mass_root(2)), np.eye(2), np.eye(len(loaded))
    )
    change = change.reshape(count, len(on), len(on))
    condensed = change.transpose(0, 2, 1) @ condensed @ change
    linear = barycentric[table.facets[loaded]][:, :, 1:]
    functions = np.einsum("sf,ca,fak,ij->sfcikj", length**0.5, mass_root(2), linear, np.eye(2)).reshape(
        count, len(on), -1
    )
    found = np.empty(count)
    for shape, (K_on, L) in enumerate(zip(condensed, functions, strict=True)):
        free = la.null_space(L.T, rcond=1e-10)
        inverse = la.pinvh(0.5 * (K_on + K_on.T), rtol=1e-11)
        found[shape] = la.eigvalsh(free.T @ inverse @ free)[-1]
    return found / (1.0 - 0.5**times)


def mass_root(count: int) -> Array:
    """The symmetric root of the mass matrix of linear functions on a simplex of measure one with so many corners."""
    unit, ones = np.eye(count), np.full((count, count), 1.0 / count)
    return np.asarray(ones / np.sqrt(count) + (unit - ones) / np.sqrt(count * (count + 1)))


def _of_tetrahedron(corners: Array, compliance: Array) -> float:
    """``kappa^2`` of the facet opposite to the first corner, of a cell of volume one by which lengths are measured."""
    parts, waiting, known, worst = 2 ** _HALVINGS[3], [corners], set[bytes](), 0.0
    while waiting:
        shape = waiting.pop()
        if (name := _shape_key(shape)) in known:
            continue
        known.add(name)
        one = _one_cell(shape)
        worst = max(worst, _without_linear_part(one.refined(_HALVINGS[3]), compliance))
        waiting += _children(one.refined())
    return float(worst / (1.0 - 1.0 / parts))


def _one_cell(corners: Array) -> Mesh:
    """A mesh of one cell, its facet opposite to the first corner called loaded."""
    one = Mesh.oriented(corners, [list(range(len(corners)))])
    here = (np.sort(one.boundary_facets, axis=1) == np.arange(1, len(corners))).all(axis=1)
    return one.with_boundaries({"loaded": one.boundary_facets[here]})


def _children(mesh: Mesh) -> list[Array]:
    """Shapes of the cells at the loaded facet, of volume one."""
    found = []
    for facet in mesh.boundaries["loaded"]:
        cell = mesh.cells[np.isin(mesh.cells, facet).sum(axis=1) == mesh.dim][0]
        corners = mesh.points[[*np.setdiff1d(cell, facet), *facet]]
        volume = abs(np.linalg.det(corners[1:] - corners[0])) / math.factorial(mesh.dim)
        found.append((corners - corners[0]) / volume ** (1.0 / mesh.dim))
    return found


def _shape_key(corners: Array) -> bytes:
    """The same for shapes that a translation or a reflection at a point makes one."""
    edges = np.round(corners[1:] - corners[0], _DIGITS) + 0.0
    ways = (tuple(sorted(map(tuple, (sign * edges + 0.0).tolist()))) for sign in (1.0, -1.0))
    return repr(min(ways)).encode()


def _without_linear_part(mesh: Mesh, compliance: Array) -> float:
    """The largest energy of a free body in space under facetwise linear loads that no linear function there sees."""
    dim, table = mesh.dim, facet_table(mesh)
    loaded = table.numbers(mesh.boundaries["loaded"])
    blocks = equilibrated_blocks(pulled_back(compliance[None], table.jacobian, table.sizes), table.jacobian)
    nodes = (table.cell_facets[:, :, None] * dim + np.arange(dim)).reshape(len(blocks), -1)
    # What is held determines the rigid motion and takes up no force, as loads are in balance.
    held = np.zeros((len(table.facets) * dim, dim, dim))
    ends = mesh.points[table.facets[0]]
    frame = np.linalg.svd(ends[1:] - ends[0])[2]
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    held[0], held[1] = np.eye(dim), np.eye(dim) - np.outer(along, along)
    held[2] = np.outer(frame[-1], frame[-1])
    system = directed_matrix(blocks, nodes, held)
    root = np.sqrt(table.measures[loaded])
    at = loaded[:, None] * dim + np.arange(dim)
    weights = np.einsum("f,ab,ij->faibj", root, mass_root(dim), np.eye(dim)).reshape(len(loaded), -1, dim, dim)
    R = system.rows(at, weights)
    points = mesh.points[table.facets[loaded]]
    scale = float(np.abs(points - points.mean(axis=(0, 1))).max())
    functions = np.concatenate([np.ones((*points.shape[:2], 1)), (points - points.mean(axis=(0, 1))) / scale], axis=2)
    L = np.einsum("f,ca,fak,ij->fcikj", root, mass_root(dim), functions, np.eye(dim)).reshape(R.shape[0], -1)
    free = la.null_space(L.T, rcond=1e-10)
    return float(la.eigvalsh(free.T @ system.answers(R) @ free)[-1])


# ---- prisms --------------------------------------------------------------------------------------------------------


def _above(table: FacetTable, compliance: Array, facets: IntArray) -> Array | None:
    """``kappa^2`` (k,) of the prisms above facets, or above those of the last even mesh that they are parts of.

    What is linear on a facet is linear on its parts, so that these see no more together than the facet does.
    """
    own = _prismatic(table, compliance, facets)
    mesh = table.mesh
    while mesh.parent is not None and (np.bincount(mesh.parent.cells) < 8).any():
        mesh = mesh.parent.mesh
    if mesh is table.mesh:
        return own
    coarse = facet_table(mesh)
    outer = np.flatnonzero(~coarse.interior)
    middles = table.mesh.points[table.facets[facets]].mean(axis=1)
    whole = outer[_containing(mesh.points[coarse.facets[outer]], coarse.normals[outer], middles, table.normals[facets])]
    chosen, number = np.unique(whole, return_inverse=True)
    before = _prismatic(coarse, compliance, chosen)
    if own is None or before is None:
        return own if before is None else before[number]
    worst = np.zeros(len(chosen))
    np.maximum.at(worst, number, own)
    return np.where(worst <= before, worst, before)[number]


def _containing(triangles: Array, normals: Array, points: Array, outward: Array) -> IntArray:
    """The triangle (m, 3, 3) of outer normal (m, 3) on which each point (k, 3) of outer normal (k, 3) lies.

    Where two bodies touch the triangle of the same body has the same normal.
    """
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    dual = np.linalg.pinv(np.stack([first, second], axis=2))
    offset = points[:, None] - triangles[:, 0]
    inside = np.einsum("mij,kmj->kmi", dual, offset)
    least = np.minimum(inside.min(axis=2), 1.0 - inside.sum(axis=2))
    away = np.abs(np.einsum("mi,kmi->km", normals, offset)) / np.linalg.norm(first, axis=1)
    turned = 1.0 - outward @ normals.T
    return np.asarray(np.argmax(np.minimum(least, 0.0) - away - turned, axis=1), dtype=np.int64)


def _prismatic(table: FacetTable, compliance: Array, facets: IntArray) -> Array | None:
    """``kappa^2`` (k,) of the prisms above facets, None if they are not disjoint parts of the body."""
    heights = _heights(table, facets)
    if heights is None:
        return None
    corners = table.mesh.points[table.facets[facets]]
    return _of_prisms(corners, -heights[:, None] * table.normals[facets], compliance)


def _of_prisms(corners: Array, inward: Array, compliance: Array) -> Array:
    """``kappa^2`` of the triangles (k, 3, 3) for the prisms between them and their shifts (k, 3)."""
    size = np.linalg.norm(inward, axis=1)
    softness = float(np.abs(compliance).max())
    unit = compliance / softness
    ratio = _poisson_ratio(unit)
    shapes = _prism_shapes(corners, inward / size[:, None], size) if ratio is None else _triangles(corners, size)
    _, first, number = np.unique(shapes, axis=0, return_index=True, return_inverse=True)
    if ratio is None:
        found = [_of_prism(corners[k] / size[k], inward[k] / size[k], unit) for k in first]
    else:
        found = [_of_isotropic_prism(tuple(lengths), ratio) for lengths in shapes[first].tolist()]
    return np.asarray(np.array(found)[number.ravel()] * size * softness / (1.0 - 0.5**_PRISM_HALVINGS))


def _triangles(corners: Array, size: Array) -> Array:
    """Lengths of the edges (k, 3) of triangles, ascending."""
    edges = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
    return np.round(np.sort(np.linalg.norm(edges, axis=2), axis=1) / size[:, None], _DIGITS)


def _prism_shapes(corners: Array, inward: Array, size: Array) -> Array:
    """Numbers (k, 9) of prisms that are the same for two that translations, or turning the triangle, make one."""
    edges = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]  # opposite to each corner
    order = np.argsort(np.round(np.linalg.norm(edges, axis=2) / size[:, None], _DIGITS), axis=1, kind="stable")
    ordered = np.take_along_axis(corners, order[:, :, None], axis=1)
    plane = ((ordered[:, 1:] - ordered[:, :1]) / size[:, None, None]).reshape(len(corners), 6)
    plane = np.round(plane, _DIGITS)
    leading = plane[np.arange(len(plane)), np.argmax(plane != 0.0, axis=1)]
    plane = plane * np.sign(leading)[:, None]  # turned round it has the same constant
    return np.hstack([plane, np.round(inward, _DIGITS)])


def _poisson_ratio(compliance: Array) -> float | None:
    """Of an isotropic compliance (6, 6) in space, None of another."""
    normal, cross = compliance[0, 0], compliance[0, 1]
    same = np.zeros((6, 6))
    same[:3, :3] = cross
    same[np.diag_indices(6)] = np.repeat([normal, 2.0 * (normal - cross)], 3)
    return float(-cross / normal) if np.abs(compliance - same).max() <= _ISOTROPIC * normal else None


def _of_prism(base: Array, up: Array, compliance: Array) -> float:
    """The worse of the prism and the one above the triangle turned round, as both have the same parts."""
    return max(_without_linear_part(_prism(corners, up), compliance) for corners in (base, -base))


@lru_cache(maxsize=1 << 10)
def _of_isotropic_prism(lengths: tuple[float, float, float], ratio: float) -> float:
    """Of a prism of height one above a triangle of such sides, of an isotropic material that is the softest there is.

    The triangle turned round has its prism, as seen in a mirror.
    """
    a, b, c = lengths
    along = (a * a + c * c - b * b) / (2.0 * c)
    base = np.array([[0.0, 0.0, 0.0], [c, 0.0, 0.0], [along, math.sqrt(max(a * a - along * along, 0.0)), 0.0]])
    return _without_linear_part(_prism(base, np.array([0.0, 0.0, 1.0])), _isotropic(ratio))


def _isotropic(ratio: float) -> Array:
    """The compliance (6, 6) whose largest entry is one."""
    unit = np.zeros((6, 6))
    unit[:3, :3] = -ratio
    unit[np.diag_indices(6)] = np.repeat([1.0, 2.0 * (1.0 + ratio)], 3)
    return unit / np.abs(unit).max()


def _prism(base: Array, up: Array) -> Mesh:
    """A prism above a triangle (3, 3), cut into tetrahedra, the triangle called loaded."""
    cube = box((1.0, 1.0, 1.0), 1)
    at = cube.points[cube.cells]
    half = cube.cells[(at[:, :, 1] <= at[:, :, 0]).all(axis=1)]
    used, cells = np.unique(half, return_inverse=True)
    x = cube.points[used]
    across = x[:, :1] * (base[1] - base[0]) + x[:, 1:2] * (base[2] - base[1])
    mesh = Mesh.oriented(base[0] + across + x[:, 2:] * up, cells.reshape(-1, 4))
    floor = (x[mesh.boundary_facets][:, :, 2] == 0.0).all(axis=1)
    return mesh.with_boundaries({"loaded": mesh.boundary_facets[floor]}).refined(_PRISM_HALVINGS)


def _heights(table: FacetTable, facets: IntArray) -> Array | None:
    """Heights (k,) of prisms above the facets that lie in the body and are disjoint; None if there are none."""
    mesh = table.mesh
    corners, normals = mesh.points[table.facets[facets]], table.normals[facets]
    size = np.sqrt(2.0 * table.measures[facets])
    outer = mesh.points[table.facets[~table.interior]]
    for part in _HEIGHTS:
        heights = part * size
        prisms = np.concatenate([corners, corners - (heights[:, None] * normals)[:, None]], axis=1)
        if not (_meets(prisms, normals, outer).any() or _overlap(prisms, normals)):
            return np.asarray(heights)
    return None


def _boxes_meet(one: Array, other: Array, tolerance: float) -> tuple[IntArray, IntArray]:
    """Pairs of point sets (k, ., 3) and (m, ., 3) whose boxes have inner points in common."""
    low, high = one.min(axis=1) + tolerance, one.max(axis=1) - tolerance
    apart: BoolArray = np.zeros((len(one), len(other)), dtype=bool)
    for axis in range(3):
        apart |= high[:, axis, None] <= other[:, :, axis].min(axis=1)
        apart |= low[:, axis, None] >= other[:, :, axis].max(axis=1)
    first, second = np.nonzero(~apart)
    return first, second


def _meets(prisms: Array, normals: Array, triangles: Array) -> BoolArray:
    """Which pairs of prisms (k, 6, 3) and triangles (m, 3, 3) have inner points of the prism in common."""
    tolerance = _TOUCHING * float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    first, second = _boxes_meet(prisms, triangles, tolerance)
    prism, triangle, normal = prisms[first], triangles[second], normals[first]
    sides = prism[:, [1, 2, 0]] - prism[:, :3]
    edges = triangle[:, [1, 2, 0]] - triangle
    ribs = np.concatenate([sides, normal[:, None]], axis=1)
    axes = np.concatenate(
        [
            normal[:, None],
            np.cross(sides, normal[:, None]),
            np.cross(edges[:, :1], edges[:, 1:2]),
            np.cross(ribs[:, :, None], edges[:, None]).reshape(len(first), 12, 3),
        ],
        axis=1,
    )
    length = np.linalg.norm(axes, axis=2, keepdims=True)
    axes = axes / np.where(length > 0.0, length, 1.0)
    mine, other = np.einsum("pvi,pai->pav", prism, axes), np.einsum("pvi,pai->pav", triangle, axes)
    apart = mine.max(axis=2) <= other.min(axis=2) + tolerance
    apart |= mine.min(axis=2) >= other.max(axis=2) - tolerance
    return np.asarray(~(apart & (axes != 0.0).any(axis=2)).any(axis=1))


def _overlap(prisms: Array, normals: Array) -> bool:
    """Whether prisms above facets of different planes may overlap: by their boxes."""
    tolerance = _TOUCHING * float(np.ptp(prisms.reshape(-1, 3), axis=0).max())
    first, second = _boxes_meet(prisms, prisms, tolerance)
    ahead = first < second
    first, second = first[ahead], second[ahead]
    level = np.einsum("pi,pi->p", normals[first], prisms[first, 0] - prisms[second, 0])
    same = (np.einsum("pi,pi->p", normals[first], normals[second]) > 1.0 - 1e-12) & (np.abs(level) <= tolerance)
    return bool((~same).any())
