"""Guaranteed lower bounds of ``Lambda = inf a(v, v) / |v|^2`` over the contact boundary, no constant unknown.

With ``a(v, v) = int C eps(v) : eps(v)`` over the displacements that vanish where supports hold them, and the norm of
L2 over the contact boundary of v, or of its normal or its tangential part alone.  The trace constant of the continuous
problem is ``Lambda^(-1/2)``: values computed with conforming elements approach it from the wrong side.

From ``1 / Lambda = sup |w(g)|_a^2 / |g|^2``, ``a(w(g), v) = <g, v>``: split g in its facetwise linear part g_h and the
rest. The complementary energy of any stress in equilibrium with g_h is at least ``|w(g_h)|_a^2``, so that its least
value over the stresses of the split element gives ``mu_h``; the rest is seen by the oscillation of v over facets only:

    1 / Lambda_k <= mu_{h,k} + kappa^2,      kappa^2 = max over F of sup |v - Pi_1 v|_F^2 / |v|_{a,T}^2,

T the cell at F, or the sum over the facets of a cell that has several. (Scheme of arXiv 2401.04519 with other
stresses.) Such a bound of the (k + 1)-st value sharpens the first ones by the method of Lehmann, Maehly and Goerisch.

``kappa`` needs no formula: cut T into parts similar to it, N along each edge, and apply the same splitting on it. The
parts at F have ``kappa^2 / N``, and ``kappa^2 <= mu_N / (1 - 1 / N)`` with ``mu_N`` over the facetwise linear loads on
F without linear part.  In space the parts are of finitely many shapes, and the largest ``mu_N`` of these counts.

Bounds hold up to rounding: eigenvalues are not enclosed by interval arithmetic, but raised by their residuals.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.adapt.body_data import BodyData, body_data
from hemivar.basics.arguments import expect, whole_number
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.fem.facet_table import facet_vertices
from hemivar.fem.split_element import split_element
from hemivar.laws import NoContact
from hemivar.linear.definite import free_unknowns
from hemivar.mechanics.conditions import Clamped, Prescribed
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import Contact, ContactProblem
from hemivar.mesh.mesh import Mesh

__all__ = ["LowerBound", "LowerBounds", "lower_bounds"]

#: Cells of the mesh that is made for it, by dimension.
_CELLS = {2: 2500, 3: 700}
#: Cells of the coarsest mesh of a body beyond which the systems would be too large.
_MOST = {2: 20_000, 3: 2_500}
#: Parts of an edge of a cell, a power of two, for kappa.
_PARTS = {2: 4, 3: 2}
#: Values below the one that bounds them from above in the method of Lehmann.
_VECTORS = 3
#: Part of a displacement that is rounding where supports hold it.
_HELD = 1e-11
#: Digits to which two shapes are one.
_DIGITS = 9


@dataclass(frozen=True)
class LowerBound:
    """Lower bound of ``Lambda`` for one part of the displacement, modulus per length.

    Attributes
    ----------
    lower : float
        Guaranteed up to rounding.
    upper : float
        Value of a conforming approximation: Lambda lies between both. All are inf where supports hold this part.
    simple : float
        The bound without the method of Lehmann.
    """

    lower: float
    upper: float
    simple: float


@dataclass(frozen=True)
class LowerBounds:
    """Bounds for the whole trace, its normal and its tangential part.

    Attributes
    ----------
    both, normal, tangential : LowerBound
    cells : int
        Of the mesh that they were computed on.
    """

    both: LowerBound
    normal: LowerBound
    tangential: LowerBound
    cells: int


def lower_bounds(problem: ContactProblem, cells: int | None = None) -> LowerBounds:
    """Lower bounds of ``Lambda`` for a problem; its laws and loads do not matter.

    Parameters
    ----------
    problem : ContactProblem
    cells : int, optional
        At most about so many cells are used, 2500 in the plane and 700 in space by default.

    Raises
    ------
    ProblemError
        The problem has no contact boundary, supports do not hold the body without it, its material varies within
        cells, or its coarsest mesh has too many.
    """
    expect(problem, ContactProblem, "the problem of a lower bound", "give the ContactProblem that states the body")
    if cells is not None:
        whole_number(cells, "cells", 1)
    if not problem.contact:
        raise ProblemError("the problem has no contact boundary, and so no trace constant; state Contact(...)")
    bare = _bare(problem, problem.mesh)
    while bare.mesh.parent is not None:
        bare = replace(bare, mesh=bare.mesh.parent.mesh)
    if bare.mesh.number_of_cells > _MOST[bare.mesh.dim]:
        raise ProblemError(
            f"the coarsest mesh of the body has {bare.mesh.number_of_cells} cells; lower bounds of trace constants are "
            f"computed on up to {_MOST[bare.mesh.dim]}: begin with a coarser mesh and refine it"
        )
    own = _graded(bare, _CELLS[bare.mesh.dim] if cells is None else cells)
    data = body_data(own, np.zeros(own.mesh.points.shape))
    if data.varies:
        raise ProblemError("the material varies inside cells; bounds of the trace constant need it constant on each")
    free = free_unknowns(discretize(own, check_coercivity=False))
    if free is None or free.shape[1]:
        raise ProblemError(
            "the body is not held by its supports, so that rigid motions move the contact boundary without energy and "
            "no trace constant exists; add a support"
        )
    loaded = np.flatnonzero(data.contact >= 0)
    kappa, mixed = _oscillation(data, loaded), _Equilibrated(data, loaded)
    both, normal, tangential = (
        _bound(own, data, loaded, mixed, kappa, part) for part in ("both", "normal", "tangential")
    )
    return LowerBounds(both, normal, tangential, own.mesh.number_of_cells)


def _bare(problem: ContactProblem, mesh: Mesh) -> ContactProblem:
    """The body alone: supports at rest, no loads, contact boundaries without a law."""
    supports = {
        name: Clamped() if isinstance(support, Prescribed) else support for name, support in problem.supports.items()
    }
    return replace(
        problem,
        mesh=mesh,
        supports=supports,
        contact={name: Contact(NoContact()) for name in problem.contact},
        tractions={},
        body_force=(0.0,) * mesh.dim,
        order=1,
    )


def _graded(problem: ContactProblem, cells: int) -> ContactProblem:
    """Refined everywhere up to a quarter of the cells, then where it touches, and most at the ends of the contact."""
    mesh = problem.mesh
    while (finer := mesh.refined()).number_of_cells <= cells // 4:
        mesh = finer
    touching = np.zeros(0, dtype=np.int64)
    for turn in itertools.count():
        touching = np.unique(np.concatenate([mesh.boundaries[name] for name in problem.contact]))
        outer = [facets for name, facets in mesh.boundaries.items() if name not in problem.contact]
        ends = np.intersect1d(touching, np.unique(np.concatenate(outer))) if outer else touching[:0]
        marked = np.zeros(mesh.number_of_nodes, dtype=bool)
        marked[ends if turn % 3 and ends.size else touching] = True
        finer = mesh.refined_where(marked[mesh.cells].any(axis=1))
        if finer.number_of_cells > cells:
            return replace(problem, mesh=mesh)
        mesh = finer
    raise AssertionError


# ---- stresses in equilibrium ---------------------------------------------------------------------------------------


class _Equilibrated:
    """The saddle point system of all moments that are free, and of the balance of every cell."""

    def __init__(self, data: BodyData, loaded: IntArray, free: bool = False) -> None:
        table = data.table
        dim, element = table.dim, split_element(table.dim)
        width = dim * dim
        H = element.matrix(data.reference_compliance)
        k = dim + 1
        # moments of a cell on the reference simplex from those of the facets: outward, and pulled back
        pull: Array = np.zeros((len(H), k, dim, dim, k, dim, dim))
        for f in range(k):
            for a in range(dim):
                pull[:, f, a, :, f, a, :] = table.signs[:, f, None, None] * table.inverse
        pull = pull.reshape(len(H), k * width, k * width)
        H = pull.transpose(0, 2, 1) @ H @ pull
        x = table.mesh.points[table.cells] - table.mesh.points[table.cells].mean(axis=1, keepdims=True)
        members = facet_vertices(dim)
        rows = dim + (1 if dim == 2 else 3)
        C: Array = np.zeros((len(H), rows, k, dim, dim))
        spin = [(0, 1)] if dim == 2 else [(1, 2), (2, 0), (0, 1)]
        size = table.volumes ** (1.0 / dim)
        for f in range(k):
            for a in range(dim):
                sign = table.signs[:, f]
                for c in range(dim):
                    C[:, c, f, a, c] = sign
                for row, (i, j) in enumerate(spin):
                    C[:, dim + row, f, a, j] = sign * x[:, members[f, a], i] / size
                    C[:, dim + row, f, a, i] = -sign * x[:, members[f, a], j] / size
        C = C.reshape(len(H), rows, k * width)
        place = (table.cell_facets[:, :, None] * width + np.arange(width)).reshape(len(H), -1)
        total = len(table.facets) * width
        energy = _assembled(H, place, place, (total, total))
        balance = _assembled(C, np.arange(len(H) * rows).reshape(len(H), rows), place, (len(H) * rows, total))
        basis = _free_moments(data, loaded)
        self._loads = (loaded[:, None] * width + np.arange(width)).ravel()
        self._scale = float(np.abs(energy.diagonal()).max())
        inner = basis.T @ energy @ basis / self._scale
        held = balance @ basis
        system = sp.block_array([[inner, held.T], [held, None]], format="csc")
        # A free body: loads in balance are answered, whatever its rigid motions.
        dense = la.pinv(system.toarray()) if free else None
        self._solve = spla.splu(system).solve if dense is None else dense.__matmul__
        self._energy, self._balance, self._basis = energy, balance, basis
        self._shape = (len(loaded), dim, dim)

    def answer(self, moments: Array) -> Array:
        """Half the gradient of the least energy (k, d, d) in the moments of the loads (k, d, d)."""
        given = np.zeros(self._energy.shape[0])
        given[self._loads] = moments.ravel()
        pushed = self._energy @ given
        right = np.concatenate([-(self._basis.T @ pushed) / self._scale, -(self._balance @ given)])
        found = self._solve(right)
        n = self._basis.shape[1]
        every = pushed + self._energy @ (self._basis @ found[:n]) + self._scale * (self._balance.T @ found[n:])
        return np.asarray(every[self._loads].reshape(self._shape))


def _assembled(blocks: Array, rows: IntArray, columns: IntArray, shape: tuple[int, int]) -> sp.csr_array:
    row = np.broadcast_to(rows[:, :, None], blocks.shape)
    column = np.broadcast_to(columns[:, None, :], blocks.shape)
    return sp.csr_array(sp.coo_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=shape))


def _free_moments(data: BodyData, loaded: IntArray) -> sp.csr_array:
    """Columns: an orthonormal basis of the moments that nothing prescribes."""
    dim = data.table.dim
    unknown = data.unknown.copy()
    unknown[loaded] = 0.0
    values, axes = np.linalg.eigh(unknown)
    facet, direction = np.nonzero(values > 0.5)
    vectors = axes[facet, :, direction]  # (n, d)
    count = len(facet) * dim
    rows = (facet[:, None, None] * dim * dim + np.arange(dim)[:, None] * dim + np.arange(dim)).ravel()
    columns = np.repeat(np.arange(count), dim)
    entries = np.repeat(vectors[:, None], dim, axis=1).ravel()
    return sp.csr_array((entries, (rows, columns)), shape=(len(unknown) * dim * dim, count))


# ---- the two sides -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Loads:
    """Facetwise linear loads along some directions, by coordinates in which their norm in L2 is Euclid's.

    Attributes
    ----------
    directions : array, shape (k, p, d)
        Orthonormal, of each loaded facet.
    roots : array, shape (k, d, d)
        Symmetric roots of the mass matrices of linear functions on the facets.
    """

    directions: Array
    roots: Array

    @classmethod
    def of(cls, data: BodyData, loaded: IntArray, part: str) -> _Loads:
        dim, normals = data.table.dim, data.table.normals[loaded]
        _, _, axes = np.linalg.svd(normals[:, None, :])
        chosen = {"both": slice(0, dim), "normal": slice(0, 1), "tangential": slice(1, dim)}[part]
        unit, ones = np.eye(dim), np.full((dim, dim), 1.0 / dim)
        # |F| / (d (d + 1)) (1 + I): its values are |F| / d for constants, |F| / (d (d + 1)) otherwise
        root = ones / np.sqrt(dim) + (unit - ones) / np.sqrt(dim * (dim + 1))
        return cls(axes[:, chosen], np.sqrt(data.table.measures[loaded])[:, None, None] * root)

    @property
    def size(self) -> int:
        return len(self.roots) * int(self.directions.shape[1]) * int(self.roots.shape[1])

    def moments(self, coordinates: Array) -> Array:
        """Moments (k, d, d) of coordinates (k d p,)."""
        c = coordinates.reshape(len(self.roots), self.roots.shape[1], -1)
        return np.asarray(np.einsum("kab,kbp,kpi->kai", self.roots, c, self.directions, optimize=True))

    def coordinates(self, values: Array) -> Array:
        """Of linear functions with values (k, d, d) at the vertices, or of what moments are multiplied with."""
        found: Array = np.einsum("kab,kbi,kpi->kap", self.roots, values, self.directions, optimize=True)
        return found.ravel()


def _top(size: int, times: Callable[[Array], Array], count: int) -> tuple[Array, Array]:
    """Largest values and vectors of a symmetric, positive operator, and by how much each may be too small."""
    if size <= 4 * count + 20:
        matrix = np.column_stack([times(unit) for unit in np.eye(size)])
        values, vectors = la.eigh(0.5 * (matrix + matrix.T))
        values, vectors = values[::-1][:count], vectors[:, ::-1][:, :count]
    else:
        start = np.random.default_rng(0).normal(size=size)
        operator = spla.LinearOperator((size, size), matvec=times, dtype=float)
        values, vectors = spla.eigsh(operator, count, which="LA", v0=start, tol=1e-8)
        values, vectors = values[::-1], vectors[:, ::-1]
    off = [np.linalg.norm(times(v) - value * v) for value, v in zip(values, vectors.T, strict=True)]
    return np.asarray(values + np.max(off)), vectors


def _bound(
    problem: ContactProblem, data: BodyData, loaded: IntArray, mixed: _Equilibrated, kappa: float, part: str
) -> LowerBound:
    loads = _Loads.of(data, loaded, part)

    def stressed(c: Array) -> Array:
        return loads.coordinates(mixed.answer(loads.moments(c)))

    count = min(_VECTORS + 1, loads.size)
    mu, _ = _top(loads.size, stressed, count)
    inverse = mu + kappa
    simple = 1.0 / inverse[0]

    body = discretize(problem, check_coercivity=False)
    assert body.field is not None
    table, dim = data.table, data.table.dim
    nodes = table.facets[loaded].ravel()
    factor = spla.splu(sp.csc_array(body.linear.stiffness))
    basis = body.field.basis

    def trace(u: Array) -> Array:
        values = np.asarray(basis @ u).reshape(-1, dim)[nodes].reshape(len(loaded), dim, dim)
        return loads.coordinates(values)

    def pushed(c: Array) -> Array:
        force = np.zeros((table.mesh.number_of_nodes, dim))
        np.add.at(force, nodes, loads.moments(c).reshape(-1, dim))
        return np.asarray(factor.solve(basis.T @ force.ravel()))

    u = pushed(np.random.default_rng(0).normal(size=loads.size))
    if np.abs(trace(u)).max() <= _HELD * np.abs(u).max() * table.measures[loaded].max() ** 0.5:
        return LowerBound(math.inf, math.inf, math.inf)  # supports hold this part everywhere: v has none
    _, vectors = _top(loads.size, lambda c: trace(pushed(c)), count - 1)
    u = np.column_stack([pushed(v) for v in vectors.T])
    g = np.column_stack([trace(column) for column in u.T])
    A0, A1 = u.T @ (body.linear.stiffness @ u), g.T @ g
    A2 = g.T @ np.column_stack([stressed(column) for column in g.T])
    upper = float(la.eigh(A0, A1, eigvals_only=True)[0])
    q = 1.0 / inverse[-1]
    left, right = A0 - q * A1, A0 - 2.0 * q * A1 + q * q * A2
    lower = simple
    scale = np.sqrt(np.diagonal(right))
    if np.isfinite(scale).all() and (scale > 0.0).all():
        tau = la.eigh(left / np.outer(scale, scale), right / np.outer(scale, scale), eigvals_only=True)
        if (tau < 0.0).all():
            lower = max(simple, float(q - q / (1.0 - tau[-1])))
    return LowerBound(float(min(lower, upper)), upper, float(simple))


# ---- what facetwise linear loads do not see ------------------------------------------------------------------------


def _oscillation(data: BodyData, loaded: IntArray) -> float:
    """``kappa^2``, the largest of the contact facets, those of one cell added."""
    table, dim = data.table, data.table.dim
    owner = table.owners[loaded, 0]
    local = np.argmax(table.cell_facets[owner] == loaded[:, None], axis=1)
    # the vertex opposite to the facet first, lengths in units of the cell
    order = np.array([[i, *(a for a in range(dim + 1) if a != i)] for i in range(dim + 1)])[local]
    corners = table.mesh.points[np.take_along_axis(table.cells[owner], order, axis=1)]
    size = table.volumes[owner] ** (1.0 / dim)
    shape = ((corners - corners[:, :1]) / size[:, None, None]).reshape(len(owner), -1)
    matrices = np.broadcast_to(data.tensors[:, 0], (table.mesh.number_of_cells, *data.tensors.shape[2:]))[owner]
    modulus = matrices.reshape(len(owner), -1).max(axis=1)
    key = np.hstack([shape, (matrices / modulus[:, None, None]).reshape(len(owner), -1)])
    _, first, number = np.unique(np.round(key, _DIGITS), axis=0, return_index=True, return_inverse=True)
    each = np.array([_of_shape(shape[k].reshape(dim + 1, dim), matrices[k] / modulus[k]) for k in first])[
        number.ravel()
    ]
    return float(np.bincount(owner, each * size / modulus).max())


def _of_shape(corners: Array, matrix: Array) -> float:
    """``kappa^2`` of the facet opposite to the first corner, of a cell of volume one by which lengths are measured."""
    dim = corners.shape[1]
    parts, waiting, known, worst = _PARTS[dim], [corners], set[bytes](), 0.0
    while waiting:
        shape = waiting.pop()
        if (name := _shape_key(shape)) in known:
            continue
        known.add(name)
        mesh = _one_cell(shape)
        for _ in range(parts.bit_length() - 1):
            mesh = mesh.refined()
        worst = max(worst, _without_linear_part(mesh, matrix))
        if dim == 3:
            waiting += _children(_one_cell(shape).refined())
    return worst / (1.0 - 1.0 / parts)


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


def _without_linear_part(mesh: Mesh, matrix: Array) -> float:
    """The largest energy of a free body under facetwise linear loads that no linear function on the facet sees."""
    problem = ContactProblem(
        mesh=mesh, material=Material.tensor(matrix), supports={}, contact={"loaded": Contact(NoContact())}
    )
    data = body_data(problem, np.zeros(mesh.points.shape))
    loaded = np.flatnonzero(data.contact >= 0)
    mixed, loads = _Equilibrated(data, loaded, free=True), _Loads.of(data, loaded, "both")
    dim = mesh.dim
    # linear fields on the facet, by coordinates; what is orthogonal to them is a load without linear part
    points = mesh.points[data.table.facets[loaded]]
    linear = [
        loads.coordinates(function[:, :, None] * unit)
        for function in (np.ones(points.shape[:2]), *np.moveaxis(points, 2, 0))
        for unit in np.eye(dim)
    ]
    rest = la.null_space(np.array(linear), rcond=1e-10)
    answers = np.column_stack([loads.coordinates(mixed.answer(loads.moments(column))) for column in rest.T])
    energy = rest.T @ answers
    return float(la.eigvalsh(0.5 * (energy + energy.T))[-1])
