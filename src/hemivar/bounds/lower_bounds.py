"""Guaranteed lower bounds of ``Lambda = inf a(v, v) / |v|^2`` over the contact boundary, no constant unknown.

With ``a(v, v) = int C eps(v) : eps(v)`` over the displacements that vanish where supports hold them, and the norm of
L2 over the contact boundary of v, or of its normal or its tangential part alone.  Normals are those of the contact: of
the facets, or of a plane obstacle.  Where they vary on a facet (a curved obstacle), the norm of the whole v serves for
the parts too: theirs are not above it.  The trace constant of the continuous
problem is ``Lambda^(-1/2)``: values computed with conforming elements approach it from the wrong side.

They are found on a mesh of their own, which begins with the coarsest mesh that the one of the problem was refined from,
and is refined along the contact boundary and where supports end. Bounds hold up to rounding: eigenvalues are not
enclosed by interval arithmetic.

There ``c = sup int D v . v / a(v, v)`` is bounded from both sides; D weighs the normal and the tangential part of v, in
the directions of the contact, constant on each facet.  Let ``w(g)`` solve ``a(w(g), v) = <g, v>``.

*From above, roughly.*  Of ``D^1/2 f`` the facetwise linear part is answered by stresses in equilibrium, whose least
complementary energy has the values ``mu_1 >= mu_2 >= ...``; the rest is seen by the oscillation over facets alone:

    c_k <= mu_k + kappa^2,      kappa^2 = max over disjoint regions of D_F kappa_F^2

(:mod:`hemivar.bounds.facet_constants`; the scheme of arXiv 2401.04519 with stresses of the split
element).

*Sharply.*  Quadratic displacements ``v_1 .. v_k`` near to the first modes, and the method of Lehmann, Maehly and
Goerisch with a lower bound ``q <= 1 / c_{k+1}``:  ``A0 = a(v_i, v_j)``, ``A1 = <D v_i, v_j>``, and A2 at least
``a(w(D v_i), w(D v_j))``.  The traces are quadratic and the stresses t answer their linear parts ``P v``.  Of the rest
``v_o = v - P v`` only products of small numbers remain: with M the diagonal of Ritz values,

    A2 = |t|^2 + <D v_o, v_o> M + M <D v_o, v_o> + kappa^2 |D v_o|^2
         + kappa (theta |D v_o|^2 + |t - C eps(v) M|^2 / theta)

for any theta > 0, as ``<D v_o, w(D P v)> = <D v_o, v_o> M + <D v_o, (1 - P)(w(D P v) - v M)>`` and
``|w(D P v) - v M|_a <= |t - C eps(v) M|``.  Error of stresses and of displacements enters squared.

*Of a jump.*  Where two bodies touch the norm is that of ``v_1 - v_2``.  Loads g on it act on both, ``w(g)`` is made of
what each part b of the mesh does under the loads on its own sides, and with c_b for these alone

    |w(g)|_a^2 = sum of |w_b|_a^2 <= sum of c_b |g_b|^2 <= max of (c_slave + c_master) |g|^2    over the contacts.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.arguments import whole_number
from hemivar.basics.arrays import NULL, ROUNDED
from hemivar.basics.types import Array, IntArray
from hemivar.bounds.bare_body import (
    PART,
    bare_body,
    cell_tensors,
    contact_normals,
    facet_cover,
    has_constant_normals,
    held_facets,
    part_of_body,
    softened,
    too_many_cells,
)
from hemivar.bounds.coarsening import LOSS, shapes
from hemivar.bounds.facet_constants import equilibrated_blocks, facet_constants, mass_root
from hemivar.bounds.facet_table import FacetTable, facet_table
from hemivar.bounds.split_element import pulled_back
from hemivar.errors import ProblemError
from hemivar.fem.directed_matrix import directed_matrix
from hemivar.fem.elements import barycentric_gradients, shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mechanics.kinematics import voigt_index
from hemivar.mechanics.statement import ContactProblem, expect_body, refuse_areas
from hemivar.mesh.mesh import Mesh
from hemivar.systems.workspace import Workspace

__all__ = ["ATTAINED", "LowerBound", "LowerBounds", "TraceFlexibility", "TraceRange", "lower_bounds"]

#: Part to which eigenvalues of modes are asked for, and by which constants may contradict what displacements attain.
ATTAINED = 1e-6
#: Modes of the method of Lehmann, at most.
_MODES = {2: 6, 3: 24}
#: Loads on the contact boundary up to which all of them are answered at once, and all eigenvalues are found.
_DENSE, _DIRECT = 2500, 600
#: Part of a trace that is rounding where supports hold it.
_HELD = 1e-11


@dataclass(frozen=True)
class _Search:
    """How a mesh for the constants of a body is looked for; shapes of cells are 1 for regular ones."""

    #: Cells of the mesh that is made, at most about so many.
    cells: int
    #: Contact facets from which on they are not refined.
    facets: int
    #: Cells beyond which the systems would be too large.
    most: int
    #: Cells of a mesh that is tried before its parts.
    first: int
    #: Shape of the worst cell from which on fewer cells are not sought.
    good: float
    #: Part of the value of displacements from which on a bound is not improved.
    sharp: float
    #: The same for the mesh itself where it has up to a thousand cells; of more it must be far worse.
    enough: float
    #: Shape of the worst cell below which few cells do not serve, and that which cells keep then.
    bad: float = 0.0
    better: float = 0.4
    #: How often fewer cells are sought by chance, from the own mesh of a body of so many cells.
    seeds: int = 5
    again: int = 2_000
    #: Part of the cells up to which a mesh has fewer: one of nearly as many is no better.
    fewer: float = 0.9


#: By dimension.
_SEARCH = {
    2: _Search(800, 1 << 20, 20_000, 800, 0.0, 0.95, 0.95),
    3: _Search(600, 24, 2_500, 48, 0.6, 0.8, 0.6, bad=0.25),
}


@dataclass(frozen=True)
class TraceRange:
    """Bounds of ``c``: area per stiffness where D has no dimension."""

    #: A value that a displacement attains.
    lower: float
    #: No displacement has more, up to rounding.
    upper: float
    #: The upper bound without the method of Lehmann.
    simple: float
    #: Upper bound of the second eigenvalue.
    second: float


class TraceFlexibility:
    """How the contact boundary of a body answers forces on it: by stresses in equilibrium, and by displacements.

    facets (k, d): Contact facets by their nodes.
    """

    def __init__(self, problem: ContactProblem) -> None:
        mesh = problem.mesh
        dim = mesh.dim
        table = facet_table(mesh)
        tensors, groups = cell_tensors(problem)
        stiffness = tensors if len(tensors) == 1 else tensors[groups]
        compliance: Array = np.asarray(np.linalg.inv(stiffness), dtype=float)
        held = held_facets(problem, table)
        loaded = np.unique(np.concatenate([table.numbers(mesh.boundaries[name]) for name in problem.contact]))
        self._dim, self._count = dim, len(loaded)
        self._constants = facet_constants(table, compliance, loaded)
        self.facets = table.facets[loaded]
        root = np.sqrt(table.measures[loaded])
        axes = np.linalg.svd(contact_normals(problem, table, loaded)[:, None, :])[2]  # the normal, tangents

        blocks = equilibrated_blocks(pulled_back(compliance, table.jacobian, table.sizes), table.jacobian)
        nodes = (table.cell_facets[:, :, None] * dim + np.arange(dim)).reshape(len(blocks), -1)
        system = directed_matrix(blocks, nodes, np.repeat(held, dim, axis=0))
        weights = np.einsum("f,ab,fpi->fapbi", root, mass_root(dim), axes).reshape(len(loaded), -1, dim, dim)
        self._forces = system.rows(loaded[:, None] * dim + np.arange(dim), weights)
        self._answers = system.answers(self._forces) if self._forces.shape[0] <= _DENSE else None
        self._stressed = None if self._answers is not None else system.factor()

        at_nodes: Array = np.zeros((mesh.number_of_nodes + len(mesh.edges), dim, dim))
        some = np.flatnonzero(held.any(axis=(1, 2)))
        np.add.at(at_nodes, mesh.facet_nodes(table.facets[some], 2), held[some][:, None])
        bulk = directed_matrix(quadratic_blocks(mesh, stiffness), mesh.cell_nodes(2), at_nodes)
        self._displaced = bulk.factor()
        places = mesh.facet_nodes(self.facets, 2)

        def trace(functions: Array) -> sp.csr_array:
            rows = np.einsum("f,aq,fpi->fapqi", root, functions, axes)
            return bulk.rows(places, rows.reshape(len(loaded), -1, places.shape[1], dim))

        linear, rest = _quadratic_traces(dim)
        self._linear, self._rest = trace(linear), trace(rest)
        self._beyond = len(rest)
        sizes = np.sqrt(np.asarray((self._linear**2).sum(axis=1))).reshape(len(loaded), -1, dim).max(axis=1)
        # Where supports hold a component there is none of it to weigh.
        self._moves = sizes > _HELD * root[:, None]

    def flexibility(self, loads: Array) -> Array:
        """Half the gradient of the least complementary energy at loads (n, k)."""
        if self._answers is not None:
            return np.asarray(self._answers @ loads)
        assert self._stressed is not None
        return np.asarray(self._forces @ self._stressed.solve(np.ascontiguousarray(self._forces.T @ loads)))

    def bound(self, normal: Array | float, tangential: Array | float) -> TraceRange:
        """Bounds of c for weights of the normal and of the tangential part, >= 0 on each of :attr:`facets`."""
        dim, count = self._dim, self._count
        D: Array = np.empty((count, dim))
        D[:, 0] = normal
        D[:, 1:] = np.broadcast_to(tangential, count)[:, None]
        D = np.where(self._moves, D, 0.0)
        scale = float(D.max(initial=0.0))
        if not 0.0 < scale < np.inf:
            return TraceRange(scale, scale, scale, scale)
        D = D / scale
        weight = np.repeat(D[:, None], dim, axis=1).ravel()
        wanted = min(_MODES[dim] + 1, int(np.count_nonzero(weight)))
        mu, loads = self._modes(np.sqrt(weight), wanted)
        above = mu + self._constants.total(D.max(axis=1))
        forces = self._linear.T @ (np.sqrt(weight)[:, None] * loads[:, : max(wanted - 1, 1)])
        u = self._displaced.solve(np.ascontiguousarray(forces))
        linear, rest = self._linear @ u, self._rest @ u
        beyond = np.repeat(D[:, None], self._beyond, axis=1).ravel()
        A0 = u.T @ forces
        sizes, axes = la.eigh(0.5 * (A0 + A0.T))
        some = sizes > NULL * sizes[-1]  # loads may be more than what displacements of the mesh tell apart
        axes = axes[:, some] / np.sqrt(sizes[some])
        values, change = la.eigh(axes.T @ (_weighted(linear, weight) + _weighted(rest, beyond)) @ axes)
        values, change = values[::-1], (axes @ change)[:, ::-1]
        linear, rest = linear @ change, rest @ change
        P, R, R2 = _weighted(linear, weight), _weighted(rest, beyond), _weighted(rest, beyond**2)
        A0, A1 = np.eye(len(values)), np.diag(values)
        pushed = weight[:, None] * linear
        T = pushed.T @ self.flexibility(pushed)
        T = 0.5 * (T + T.T)
        kappa = float(np.sqrt(self._constants.total(D.max(axis=1) > 0.0)))
        sharp = []
        for k in range(1, min(len(above), len(values) + 1)):
            A2 = _answers(T[:k, :k], P[:k, :k], R[:k, :k], R2[:k, :k], values[:k], kappa)
            sharp.append(_lehmann(A0[:k, :k], A1[:k, :k], A2, 1.0 / above[k]))
        upper = max(min([float(above[0]), *(pair[0] for pair in sharp)]), float(values[0]))
        second = min([float(above[min(1, len(above) - 1)]), *(pair[1] for pair in sharp)])
        lower, simple = float(values[0]), float(above[0])
        return TraceRange(scale * lower, scale * upper, scale * simple, scale * second)

    def _modes(self, root: Array, count: int) -> tuple[Array, Array]:
        """Largest values of the flexibility under weighted loads, not below the exact ones, and their loads."""
        if self._answers is not None and len(root) <= _DIRECT:
            n = len(root)
            pairs = la.eigh(root[:, None] * self._answers * root, subset_by_index=[n - count, n - 1])
            return np.asarray(pairs[0][::-1]), np.asarray(pairs[1][:, ::-1])

        def times(x: Array) -> Array:
            return root * self.flexibility(root * x.ravel())

        operator = spla.LinearOperator((len(root), len(root)), matvec=times, dtype=float)
        start = np.random.default_rng(0).normal(size=len(root))
        values, vectors = spla.eigsh(operator, count, which="LA", v0=start, tol=ATTAINED)
        off = max(float(np.linalg.norm(times(v) - value * v)) for value, v in zip(values, vectors.T, strict=True))
        return np.asarray(values[::-1] + off), np.asarray(vectors[:, ::-1])


@dataclass(frozen=True, eq=False)
class JumpSides:
    """Which parts of a mesh have which sides of contacts."""

    #: The part of each contact facet of a flexibility.
    part: IntArray  # (k,)
    #: Of each contact the parts that have its one side or its two sides.
    contacts: tuple[tuple[IntArray, ...], ...]

    @property
    def jumps(self) -> bool:
        """Whether any contact is one of two sides."""
        return any(len(sides) > 1 for sides in self.contacts)

    def bound(self, flexibility: TraceFlexibility, normal: Array | float, tangential: Array | float) -> TraceRange:
        """Bounds of c for weights as those of :meth:`TraceFlexibility.bound`, the same on both sides of a contact."""
        if not self.jumps:
            return flexibility.bound(normal, tangential)
        ranges = [
            flexibility.bound(*(np.where(self.part == part, weight, 0.0) for weight in (normal, tangential)))
            for part in range(int(self.part.max()) + 1)
        ]

        def total(values: list[float]) -> float:
            return float(max(sum(max(values[b] for b in side) for side in sides) for sides in self.contacts))

        upper, simple = total([one.upper for one in ranges]), total([one.simple for one in ranges])
        both = any(len(sides) > 1 and np.isin(sides[0], sides[1]).any() for sides in self.contacts)
        return TraceRange(0.0 if both else max(one.lower for one in ranges), upper, simple, upper)


def quadratic_blocks(mesh: Mesh, stiffness: Array) -> Array:
    """Stiffness matrices (M, k, k) of cells with quadratic displacements, all components of each node in turn."""
    gradients, index = barycentric_gradients(mesh), voigt_index(mesh.dim)
    tensor = stiffness[:, index[:, :, None, None], index]
    total: Array | float = 0.0
    for point, weight in zip(*quadrature_rule(mesh.dim, 2), strict=True):
        slope = shape_derivatives(2, point) @ gradients
        total = total + weight * np.einsum("mak,mikjl,mbl->maibj", slope, tensor, slope, optimize=True)
    size = len(shape_values(2, point)) * mesh.dim
    return np.asarray(mesh.volumes[:, None, None] * np.reshape(total, (-1, size, size)))


def _weighted(vectors: Array, weight: Array) -> Array:
    return np.asarray(vectors.T @ (weight[:, None] * vectors))


def _answers(T: Array, P: Array, R: Array, R2: Array, values: Array, kappa: float) -> Array:
    """A2 of some modes, with the theta that suits them: not below ``a(w(D v_i), w(D v_j))``.

    T are the products ``t_i . t_j`` of the stresses, ``values`` the diagonal of M, and P, R and R2 the products of
    ``D P v`` with ``P v``, of ``D v_o`` with ``v_o`` and of ``D v_o`` with ``D v_o``.
    """
    off = T - P * values - (P * values).T + np.diag(values**2)
    stress, trace = (max(float(np.trace(part)), 0.0) for part in (off, R2))
    top = float(values[0])  # where both are rounding, neither may be divided by the other
    theta = np.sqrt((stress + ROUNDED * top**2) / (trace + ROUNDED * top))
    return np.asarray(T + R * values + (R * values).T + kappa**2 * R2 + kappa * (theta * R2 + off / theta))


def _lehmann(A0: Array, A1: Array, A2: Array, q: float) -> tuple[float, float]:
    """Upper bounds of ``c_1`` and ``c_2``, inf if it fails; ``q`` is a lower bound of ``1 / c_{k + 1}``."""
    none = np.inf, np.inf
    left, right = A0 - q * A1, A0 - 2.0 * q * A1 + q * q * A2
    scale = np.diagonal(right)
    if not (np.isfinite(right).all() and (scale > 0.0).all()):
        return none
    by = np.sqrt(np.outer(scale, scale))
    try:
        tau = la.eigh(left / by, right / by, eigvals_only=True)
    except la.LinAlgError:
        return none
    if not tau[-1] < 0.0:
        return none
    above = [float(value) for value in (1.0 - 1.0 / tau[::-1][:2]) / q]
    return above[0], above[1] if len(above) > 1 else np.inf


@cache
def _quadratic_traces(dim: int) -> tuple[Array, Array]:
    """Coordinates of quadratic functions on a facet of measure one: of their linear part, and of the rest."""
    point, weights = quadrature_rule(dim - 1, 4)
    values = shape_values(2, point)
    mass = np.einsum("q,qa,qb->ab", weights, values, values)
    linear = np.linalg.inv(mass_root(dim)) @ np.einsum("q,qa,qb->ab", weights, point, values)
    rest, axes = la.eigh(mass - linear.T @ linear)
    beyond = values.shape[1] - dim
    return linear, (axes[:, -beyond:] * np.sqrt(rest[-beyond:])).T


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

    def or_better(self, other: LowerBound) -> LowerBound:
        """The best of both."""
        upper = min(self.upper, other.upper)
        return LowerBound(max(self.lower, other.lower), upper, max(self.simple, other.simple))


#: The names of the sides of each contact.
Sides = tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class MeshFlexibility:
    """The contact boundary of a body on one mesh."""

    mesh: Mesh
    flexibility: TraceFlexibility
    sides: JumpSides  # where two bodies touch, the trace is the jump

    def weighted(self, corners: Array, normal: Array, tangential: Array) -> TraceRange:
        """Bounds for weights (k,) on facets (k, d, d): each facet of the mesh takes the largest that lies over it."""
        over = facet_cover(self.mesh.points[self.flexibility.facets], corners)
        weights = [np.where(over, alpha, 0.0).max(axis=1, initial=0.0) for alpha in (normal, tangential)]
        return self.sides.bound(self.flexibility, *weights)


@dataclass(frozen=True)
class LowerBounds:
    """Bounds for the whole trace, its normal and its tangential part.

    Attributes
    ----------
    both, normal, tangential : LowerBound
    cells : int
        Of the mesh that they were computed on.
    flexible : tuple of MeshFlexibility
        The contact boundary of the body, for weights that vary on it: each serves, and the best counts.
    whole : bool
        Whether contact normals vary on facets, so that only the whole trace is known and weights count by the larger
        of both.
    sharpness : float
        The least of the bounds over the values of displacements of the same mesh.
    """

    both: LowerBound
    normal: LowerBound
    tangential: LowerBound
    cells: int
    flexible: tuple[MeshFlexibility, ...] = field(default=(), repr=False, compare=False)
    whole: bool = False
    sharpness: float = 1.0

    def or_better(self, other: LowerBounds) -> LowerBounds:
        """The best of both, which are bounds for one body."""
        both, normal, tangential = self.both.or_better(other.both), self.normal, self.tangential
        normal, tangential = normal.or_better(other.normal), tangential.or_better(other.tangential)
        cells, flexible = max(self.cells, other.cells), self.flexible + other.flexible
        sharpness = max(self.sharpness, other.sharpness)
        return LowerBounds(both, normal, tangential, cells, flexible, self.whole, sharpness)

    def weighted(self, corners: Array, normal: Array, tangential: Array) -> tuple[float, float]:
        """Upper bounds of the first two eigenvalues of ``int alpha |v|^2`` against ``a(v, v)``, weights by facets.

        The first is that of the supremum of the quotient.

        Each facet of the mesh here takes the largest weight of those that lie over it, or near to it in space.

        Parameters
        ----------
        corners : array, shape (k, d, d)
            Of the facets, which cover the contact boundary where the weights do not vanish.
        normal, tangential : arrays, shape (k,)
            Weights of the normal and of the tangential part, >= 0.
        """
        if self.whole:
            normal = tangential = np.maximum(normal, tangential)
        ranges = []
        for one in self.flexible:
            with suppress(la.LinAlgError, RuntimeError):  # what is known without weights counts all the same
                ranges.append(one.weighted(corners, normal, tangential))
        return min((one.upper for one in ranges), default=np.inf), min((one.second for one in ranges), default=np.inf)


def lower_bounds(problem: ContactProblem, cells: int | None = None, workspace: Workspace | None = None) -> LowerBounds:
    """Lower bounds of ``Lambda`` for a problem; its laws and loads do not matter.

    Parameters
    ----------
    problem : ContactProblem
    cells : int, optional
        At most about so many cells are used, 800 in the plane and 600 in space by default.
    workspace : Workspace, optional
        Keeps them for all problems of the body: they belong to its coarsest mesh, its material and where it is held and
        touches, not to refined meshes, laws and loads.

    Returns
    -------
    LowerBounds

    Raises
    ------
    ProblemError
        The problem has no contact boundary, supports do not hold the body without it, its material varies within
        cells, or its coarsest mesh has too many.
    """
    expect_body(problem, "the problem of a lower bound", "give the ContactProblem that states the body")
    refuse_areas(problem, "a bound of a trace constant")
    if cells is not None:
        whole_number(cells, "cells", 1)
    if not problem.contact:
        raise ProblemError("the problem has no contact boundary, and so no trace constant; state Contact(...)")
    bare = bare_body(problem)
    table = facet_table(bare.mesh)
    held = held_facets(bare, table)
    if not _is_held(table, held):
        raise ProblemError(
            "the supports do not constrain the body: rigid motions move the contact boundary without energy and no "
            "trace constant exists; add a support"
        )
    pairs = tuple(problem.pair(name) for name, contact in problem.contact.items() if contact.against)
    sides = (*pairs, *((name,) for name in bare.contact if not any(name in pair for pair in pairs)))
    pieces = int(table.mesh.parts.cell.max()) + 1 if any(len(side) > 1 for side in sides) else 1
    most = pieces * _SEARCH[bare.mesh.dim].cells if cells is None else cells
    if workspace is None:
        return _sharpest(bare, most, sides)
    touching = np.sort(np.concatenate([table.numbers(bare.mesh.boundaries[name]) for name in bare.contact]))
    tensors, groups = cell_tensors(bare)
    kind = np.array([most, not has_constant_normals(bare)])
    normals = contact_normals(bare, table, touching)
    apart = [table.numbers(bare.mesh.boundaries[name]) for side in sides for name in side]
    sizes = np.array([len(side) for side in sides] + [len(one) for one in apart])
    body = (bare.mesh.points, bare.mesh.cells, tensors, groups, held, touching, normals, kind)
    parts = (*body, sizes, np.concatenate(apart))
    return workspace.once("lower bounds of trace constants", parts, lambda: _sharpest(bare, most, sides, workspace))


def _sharpest(bare: ContactProblem, cells: int, names: Sides, kept: Workspace | None = None) -> LowerBounds:
    """The best of the mesh itself and of parts of the body, one after another until one is sharp enough."""
    search, own = _SEARCH[bare.mesh.dim], bare.mesh.number_of_cells
    best = _on(bare, cells, names) if own <= search.first else None
    if best is not None and best.sharpness >= search.sharp:
        return best
    for part, whole in _parts_of(bare, kept):
        if part.mesh.number_of_cells <= search.most:
            best = _bettered(best, partial(_on, part, cells, names, whole))
            if best.sharpness >= search.sharp:
                return best
    enough = search.enough if bare.mesh.dim == 2 or own <= 1_000 else 0.4 * search.enough
    if search.first < own <= search.most and (best is None or best.sharpness < enough):
        best = _bettered(best, partial(_on, bare, cells, names))
    if best is None:
        raise ProblemError(too_many_cells(own, part.mesh.number_of_cells, search.most))
    return best


def _bettered(best: LowerBounds | None, make: Callable[[], LowerBounds]) -> LowerBounds:
    """The best of what is in hand and of others, which need not come about."""
    if best is None:
        return make()
    with suppress(la.LinAlgError, RuntimeError, MemoryError):
        return best.or_better(make())
    return best


def _parts_of(bare: ContactProblem, kept: Workspace | None = None) -> Iterator[tuple[ContactProblem, bool]]:
    """Parts of a body, and whether they are all of it: of as few cells as possible, and of some.

    In space curved boundaries leave bad cells to those; a part of more and better ones takes their place.
    """
    dim, search = bare.mesh.dim, _SEARCH[bare.mesh.dim]
    some, whole = part_of_body(bare, PART[dim], LOSS, kept=kept)
    (few, same), *others = _of_few(bare, some)
    if _least_shape(few) < search.bad:
        better, all_of_it = part_of_body(bare, 0, LOSS, least=search.better)
        if 1.5 * better.mesh.number_of_cells > bare.mesh.number_of_cells <= search.most:
            return  # the mesh itself is as good
        if better.mesh.number_of_cells <= search.most:
            yield better, all_of_it
            return
    if few.mesh.number_of_cells > search.most:
        yield part_of_body(softened(bare), 0, LOSS)[0], False
    for part, all_of_some in [(few, same), *others]:
        yield part, whole and all_of_some
    if few.mesh.number_of_cells < search.fewer * some.mesh.number_of_cells:
        yield some, whole


def _least_shape(body: ContactProblem) -> float:
    return float(shapes(body.mesh.points, body.mesh.cells)[1].min())


def _of_few(bare: ContactProblem, some: ContactProblem) -> list[tuple[ContactProblem, bool]]:
    """The best two parts of as few cells as possible, those whose worst cells are best; whether they are all of some.

    Where few are left in some already, others are made of the body itself if it has not too many.
    """
    search, cells = _SEARCH[some.mesh.dim], some.mesh.number_of_cells
    again = bare if cells < PART[some.mesh.dim] // 2 and bare.mesh.number_of_cells <= search.again else some
    parts: dict[float, tuple[ContactProblem, bool]] = {}
    for seed in range(search.seeds):
        part = part_of_body(again if seed else some, 0, LOSS, seed)
        parts.setdefault(round(_least_shape(part[0]), 6), part)
        if max(parts) >= search.good or part[0].mesh.number_of_cells == again.mesh.number_of_cells:
            break
    return [parts[shape] for shape in sorted(parts, reverse=True)[:2]]


def _on(body: ContactProblem, cells: int, names: Sides, whole: bool = True) -> LowerBounds:
    """The bounds on a mesh that is refined for them; those of a part of the body have no value from above."""
    own = _graded(body, cells)
    flexibility, sides = TraceFlexibility(own), _jump_sides(own, names)
    both, normal, tangential = (
        _inverse(sides.bound(flexibility, *weights)) for weights in ((1.0, 1.0), (1.0, 0.0), (0.0, 1.0))
    )
    varying = not has_constant_normals(own)
    if varying:
        normal = tangential = replace(both, upper=math.inf)
    sharpness = min(1.0 if one.upper == math.inf else one.lower / one.upper for one in (both, normal, tangential))
    if not whole:
        both, normal, tangential = (replace(one, upper=math.inf) for one in (both, normal, tangential))
    flexible = (MeshFlexibility(own.mesh, flexibility, sides),)
    return LowerBounds(both, normal, tangential, own.mesh.number_of_cells, flexible, varying, sharpness)


def _jump_sides(problem: ContactProblem, names: Sides) -> JumpSides:
    """Of contacts by the names of their sides, on the facets of a :class:`TraceFlexibility`."""
    table, mesh = facet_table(problem.mesh), problem.mesh
    part = table.mesh.parts.cell
    loaded = np.unique(np.concatenate([table.numbers(mesh.boundaries[name]) for name in problem.contact]))

    def of(facets: IntArray) -> IntArray:
        return np.asarray(part[table.owners[facets, 0]])

    every = tuple(tuple(np.unique(of(table.numbers(mesh.boundaries[name]))) for name in side) for side in names)
    return JumpSides(of(loaded), every)


def _inverse(flexibility: TraceRange) -> LowerBound:
    if flexibility.upper == 0.0:
        return LowerBound(math.inf, math.inf, math.inf)  # supports hold this part everywhere
    estimate = 1.0 / flexibility.lower if flexibility.lower > 0.0 else math.inf
    return LowerBound(1.0 / flexibility.upper, estimate, 1.0 / flexibility.simple)


def _is_held(table: FacetTable, held: Array) -> bool:
    """Whether supports resist every rigid motion of every connected part."""
    mesh, dim = table.mesh, table.dim
    label = table.mesh.parts.cell
    parts = int(label.max()) + 1
    x = (mesh.points - mesh.points.mean(axis=0)) / float(np.ptp(mesh.points, axis=0).max())
    spins = []
    for i in range(dim):
        for j in range(i):
            spin = np.zeros((dim, dim))
            spin[i, j], spin[j, i] = 1.0, -1.0
            spins.append(spin)
    some = np.flatnonzero(held.any(axis=(1, 2)))
    at = x[table.facets[some]]
    moved = np.broadcast_to(np.eye(dim), (*at.shape[:2], dim, dim))
    turned = np.stack([at @ spin.T for spin in spins], axis=-1)
    motions = np.einsum("fij,fajr->fair", held[some], np.concatenate([moved, turned], axis=-1))
    grams: Array = np.zeros((parts, motions.shape[-1], motions.shape[-1]))
    measures = table.measures[some] / table.measures.max()
    np.add.at(grams, label[table.owners[some, 0]], np.einsum("f,fair,fais->frs", measures, motions, motions))
    values = np.linalg.eigvalsh(grams)
    return bool((values[:, 0] > 1e-10 * np.maximum(values[:, -1], np.finfo(float).tiny)).all())


def _graded(problem: ContactProblem, cells: int) -> ContactProblem:
    """Refined everywhere, then where it touches; in the plane where supports end, too.

    In the plane it is refined everywhere up to half the cells.  In space it is refined where it touches up to half as
    many cells more, as long as few facets do: cells that are halved grow worse, and so does what facets do not see.
    """
    mesh, dim = problem.mesh, problem.mesh.dim
    cells = max(cells, mesh.number_of_cells + cells // 2)
    while (finer := mesh.refined()).number_of_cells <= cells // (2 if dim == 2 else 1):
        mesh = finer
    for where in ("touching", "ends", "ends", "ends") if dim == 2 else ("touching", "touching"):
        touching = np.concatenate([mesh.boundaries[name] for name in problem.contact])
        if where == "touching" and len(touching) >= _SEARCH[dim].facets:
            continue
        marked = np.zeros(mesh.number_of_nodes, dtype=bool)
        marked[touching if where == "touching" else _ends(problem, mesh)] = True
        finer = mesh.refined_where(marked[mesh.cells].sum(axis=1) >= (1 if dim == 2 else dim))
        if finer.number_of_cells <= (cells if dim == 2 else cells + cells // 2):
            mesh = finer
    return replace(problem, mesh=mesh)


def _ends(problem: ContactProblem, mesh: Mesh) -> IntArray:
    """Nodes where a support ends."""
    facets = np.concatenate([mesh.boundaries[name] for name in problem.held_boundaries])
    supported = np.unique(np.sort(facets, axis=1), axis=0)
    outer = np.concatenate([np.sort(mesh.boundary_facets, axis=1), supported])
    every, counts = np.unique(outer, axis=0, return_counts=True)
    return np.intersect1d(supported, every[counts == 1])
