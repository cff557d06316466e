"""What facetwise linear loads do not see of a trace: ``kappa_F^2 = sup |v - Pi_1 v|_F^2 / |v|_{a,R}^2``.

R is a part of the body at the facet F; the constants of parts that overlap are added.  No formula is needed: cut R
into parts of which those at F are similar to it, N along each edge.  For a load g on F without linear part, split in
its facetwise linear part on the cut facets and the rest, the former is answered by stresses in equilibrium and the
latter seen by the small parts alone, whose constant is ``kappa^2 / N``; hence

    kappa^2 <= mu_N / (1 - 1 / N),

``mu_N`` the largest complementary energy of R, free, under the facetwise linear loads on F of norm one that are
orthogonal to linear functions.  In the plane R is the cell at F.  In space it is a prism or a frustum above F where one
lies in the body, and in one material (:mod:`hemivar.bounds.prisms`).  Elsewhere it is the cell at F,
whose parts are of finitely many shapes, and the worst counts.

For displacements U, linear on each facet, and V, linear on the cell, the work of a stress of the split element is
``sum m . (U - V) + int s : eps(V)``.  The stiffness ``A H^-1 A'``, H the complementary energy in the degrees of freedom
of the element and A this work, is that of a body whose stresses answer forces on facets, the moments of tractions, and
on cells, linear ones, exactly: the least complementary energy of a load is half its work.  With no force on cells V is
eliminated beforehand.  It is singular on rigid motions alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.arrays import DIGITS
from hemivar.basics.types import Array, IntArray
from hemivar.bounds.facet_table import FacetTable, facet_table, facet_vertices
from hemivar.bounds.prisms import KINDS, Solids, prism_squares, prisms, room, tolerance
from hemivar.bounds.roundings import CONSTANT
from hemivar.bounds.split_element import pulled_back, split_element, voigt
from hemivar.fem.directed_matrix import directed_matrix
from hemivar.mesh.mesh import Mesh

__all__ = ["FacetConstants", "equilibrated_blocks", "facet_constants"]

#: How often a cell in the plane and a cell in space are cut in halves.
_HALVINGS = {2: 2, 3: 1}
#: Kinds that are tried, one after another, where facets lie in a plane: all of them.
_PRISMS = tuple(range(len(KINDS)))
#: And where they meet at angles: those that grow narrower, and the flattest.
_FRUSTA = (3, 4, 2)


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
                for corner in np.flatnonzero(members == a):
                    work[row, (i * dim + int(corner)) * dim + c] -= 1.0
            work[row, moments:] = shear * voigt(np.outer(np.eye(dim)[c], gradients[a]))
    return work, energies


@dataclass(frozen=True, eq=False)
class FacetConstants:
    """Constants of facets."""

    #: ``kappa_F^2``.
    squares: Array  # (k,)
    #: One where the regions of two facets have inner points in common, on the diagonal too.
    together: sp.csr_array  # (k, k)

    def total(self, weights: Array | float = 1.0) -> float:
        """The largest sum of ``weight kappa_F^2`` over what the region of a facet overlaps, weights (k,)."""
        weighted = weights * self.squares
        return float((self.together @ weighted)[weighted > 0.0].max(initial=0.0))


def facet_constants(table: FacetTable, compliance: Array, facets: IntArray) -> FacetConstants:
    """Constants of some facets of the boundary.

    ``compliance`` is (M or 1, v, v); ``facets`` is (k,).
    """
    if table.dim == 2:
        every = np.arange(len(facets))
        return FacetConstants(_of_cells(table, compliance, facets), _pairs(table, facets, every))
    constants = _in_space(table, compliance, facets, _PRISMS)
    if constants.together.nnz == len(facets):
        return constants
    return min(constants, _in_space(table, compliance, facets, _FRUSTA), key=FacetConstants.total)


def _in_space(table: FacetTable, compliance: Array, facets: IntArray, kinds: tuple[int, ...]) -> FacetConstants:
    """With prisms or frusta of the first kind that has room, and with cells where none has."""
    corners, owner = table.mesh.points[table.facets[facets]], table.owners[facets, 0]
    outer, between = np.flatnonzero(~table.interior), _between(table, compliance)
    kind = room(table, facets, np.concatenate([outer, between]), kinds)
    own = np.broadcast_to(compliance, (len(table.cells), *compliance.shape[1:]))[owner]
    if len(between) and (kind < 0).any():
        none = np.flatnonzero(kind < 0)
        own = own.copy()
        own[none], kind[none] = softest(compliance), room(table, facets[none], outer, kinds)
    top, height = np.array(KINDS)[kind].T
    up = -(height * np.sqrt(2.0 * table.measures[facets]))[:, None] * table.normals_of(facets)
    on, off = np.flatnonzero(kind >= 0), np.flatnonzero(kind < 0)
    squares = np.empty(len(facets))
    squares[on] = prism_squares(kind[on], corners[on], up[on], own[on])
    if len(off):
        squares[off] = _of_cells(table, compliance, facets[off])
    near, standing = tolerance(table.mesh.points), prisms(corners[on], up[on], top[on])
    both = standing.meeting(standing, near)
    mixed = standing.meeting(Solids.simplices(table.mesh.points[table.cells[owner[off]]]), near)
    rows = np.concatenate([on[both[0]], on[mixed[0]], off[mixed[1]]])
    columns = np.concatenate([on[both[1]], off[mixed[1]], on[mixed[0]]])
    prismatic = sp.coo_array((np.ones(len(rows)), (rows, columns)), shape=2 * (len(facets),))
    return FacetConstants(squares, sp.csr_array(prismatic + _pairs(table, facets, off)))


def _between(table: FacetTable, compliance: Array) -> IntArray:
    """Facets with another material on either side."""
    inner = np.flatnonzero(table.interior)
    one, other = np.broadcast_to(compliance, (len(table.cells), *compliance.shape[1:]))[table.owners[inner].T]
    return np.asarray(inner[(one != other).any(axis=(1, 2))])


def softest(compliance: Array) -> Array:
    """A compliance (v, v) that is not below any of these (M, v, v)."""
    some = np.unique(compliance, axis=0)
    most = some[np.argmax(np.trace(some, axis1=1, axis2=2))]
    root = np.linalg.cholesky(most)
    relative = np.linalg.solve(root, np.linalg.solve(root, some).transpose(0, 2, 1))
    return np.asarray((1.0 + CONSTANT) * max(1.0, float(np.linalg.eigvalsh(relative).max())) * most)


def _pairs(table: FacetTable, facets: IntArray, some: IntArray) -> sp.csr_array:
    """Which of some of the facets, by their places, belong to one cell."""
    owner = np.unique(table.owners[facets[some], 0], return_inverse=True)[1]
    shape = (len(facets), len(facets))
    of_cell = sp.csr_array(sp.coo_array((np.ones(len(some)), (some, owner)), shape=shape))
    return sp.csr_array(of_cell @ of_cell.T)


def _of_cells(table: FacetTable, compliance: Array, facets: IntArray) -> Array:
    """``kappa^2`` (k,) of the cells at facets."""
    dim, owner = table.dim, table.owners[facets, 0]
    local = np.argmax(table.cell_facets[owner] == facets[:, None], axis=1)
    # the vertex opposite to the facet first, lengths in units of the cell
    order = np.array([[i, *(a for a in range(dim + 1) if a != i)] for i in range(dim + 1)])[local]
    corners = table.mesh.points[np.take_along_axis(table.cells[owner], order, axis=1)]
    size = table.volumes[owner] ** (1.0 / dim)
    shape = (corners - corners[:, :1]) / size[:, None, None]
    matrices = np.broadcast_to(compliance, (len(table.cells), *compliance.shape[1:]))[owner]
    softness = np.abs(matrices).max(axis=(1, 2))
    key = np.hstack([shape.reshape(len(owner), -1), (matrices / softness[:, None, None]).reshape(len(owner), -1)])
    _, first, number = np.unique(np.round(key, DIGITS), axis=0, return_index=True, return_inverse=True)
    unit = matrices[first] / softness[first, None, None]
    if dim == 2:
        squares = _of_triangles(shape[first], unit)
    else:
        squares = np.array([_of_tetrahedron(s, m) for s, m in zip(shape[first], unit, strict=True)])
    return np.asarray(squares[number.ravel()] * size * softness)


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
    dofs = (table.cell_facets[:, :, None] * 4 + np.arange(4)).reshape(cells, 12)
    K: Array = np.zeros((count, n * n))
    flat = (dofs[:, :, None] * n + dofs[:, None, :]).ravel()
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
    squares = np.empty(count)
    for shape, (K_on, L) in enumerate(zip(condensed, functions, strict=True)):
        free = la.null_space(L.T, rcond=1e-10)
        inverse = la.pinvh(0.5 * (K_on + K_on.T), rtol=1e-11)
        squares[shape] = la.eigvalsh(free.T @ inverse @ free)[-1]
    return squares / (1.0 - 0.5**times)


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
    shapes = []
    for facet in mesh.boundaries["loaded"]:
        cell = mesh.cells[np.isin(mesh.cells, facet).sum(axis=1) == mesh.dim][0]
        corners = mesh.points[[*np.setdiff1d(cell, facet), *facet]]
        volume = abs(np.linalg.det(corners[1:] - corners[0])) / math.factorial(mesh.dim)
        shapes.append((corners - corners[0]) / volume ** (1.0 / mesh.dim))
    return shapes


def _shape_key(corners: Array) -> bytes:
    """The same for shapes that a translation or a reflection at a point makes one."""
    edges = np.round(corners[1:] - corners[0], DIGITS) + 0.0
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
