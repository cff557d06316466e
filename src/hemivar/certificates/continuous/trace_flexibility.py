"""Two-sided bounds of ``c = sup int D v . v / a(v, v)`` over the contact boundary, D a weight of each facet.

``a(v, v) = int C eps(v) : eps(v)``, over the displacements that vanish where supports hold them; D weighs the normal
and the tangential part of v, in the directions of the contact, constant on each facet of one mesh.  Let ``w(g)`` solve
``a(w(g), v) = <g, v>``.

*From above, roughly.*  Of ``D^1/2 f`` the facetwise linear part is answered by stresses in equilibrium, whose least
complementary energy has the values ``mu_1 >= mu_2 >= ...``; the rest is seen by the oscillation over facets alone:

    c_k <= mu_k + kappa^2,      kappa^2 = max over disjoint regions of D_F kappa_F^2

(:mod:`hemivar.certificates.continuous.facet_constants`; the scheme of arXiv 2401.04519 with stresses of the split
element).

*Sharply.*  Quadratic displacements ``v_1 .. v_k`` near to the first modes, and the method of Lehmann, Maehly and
Goerisch with a lower bound ``q <= 1 / c_{k+1}``:  ``A0 = a(v_i, v_j)``, ``A1 = <D v_i, v_j>``, and A2 at least
``a(w(D v_i), w(D v_j))``.  The traces are quadratic and the stresses t answer their linear parts ``P v``.  Of the rest
``v_o = v - P v`` only products of small numbers remain: with M the diagonal of Ritz values,

    A2 = |t|^2 + <D v_o, v_o> M + M <D v_o, v_o> + kappa^2 |D v_o|^2
         + kappa (theta |D v_o|^2 + |t - C eps(v) M|^2 / theta)

for any theta > 0, as ``<D v_o, w(D P v)> = <D v_o, v_o> M + <D v_o, (1 - P)(w(D P v) - v M)>`` and
``|w(D P v) - v M|_a <= |t - C eps(v) M|``.  Error of stresses and of displacements enters squared.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array
from hemivar.certificates.continuous.contact_normals import contact_normals
from hemivar.certificates.continuous.equilibrated_blocks import equilibrated_blocks
from hemivar.certificates.continuous.facet_constants import facet_constants, mass_root
from hemivar.certificates.continuous.facet_table import facet_table
from hemivar.certificates.continuous.held_facets import held_facets
from hemivar.certificates.continuous.quadratic_blocks import quadratic_blocks
from hemivar.certificates.continuous.split_element import pulled_back
from hemivar.errors import ProblemError
from hemivar.fem.constitutive import constitutive_law
from hemivar.fem.directed_matrix import directed_matrix
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mechanics.statement import ContactProblem

__all__ = ["TraceFlexibility", "TraceRange"]

#: Modes of the method of Lehmann, at most.
_MODES = {2: 6, 3: 24}
#: Loads on the contact boundary up to which all of them are answered at once.
_DENSE = 600
#: Part of the largest energy below which displacements are not told apart.
_DEPENDENT = 1e-10
#: Part of a trace that is rounding where supports hold it.
_HELD = 1e-11
#: Squares that are rounding, in units of the largest value.
_ROUNDING = 1e-12
#: Part of a modulus by which it may vary within a cell and count as constant.
_CONSTANT = 1e-13


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
        matrices, _ = constitutive_law(problem).on(mesh, 2)
        if np.abs(matrices - matrices[:, :1]).max() > _CONSTANT * np.abs(matrices).max():
            raise ProblemError(
                "the material varies inside cells; bounds of the trace constant need it constant on each"
            )
        stiffness = matrices[:, 0]
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
        self._forces = sp.csc_array(system.rows(loaded[:, None] * dim + np.arange(dim), weights).T)
        self._stressed = system.factor()
        self._answers: Array | None = None
        if self._forces.shape[1] <= _DENSE:
            found = self._forces.T @ self._stressed.solve(self._forces.toarray())
            self._answers = 0.5 * (found + found.T)

        corner = mesh.points[mesh.cells]
        jacobian = (corner[:, 1:] - corner[:, :1]).swapaxes(1, 2)
        at_nodes: Array = np.zeros((mesh.number_of_nodes + len(mesh.edges), dim, dim))
        some = np.flatnonzero(held.any(axis=(1, 2)))
        np.add.at(at_nodes, mesh.facet_nodes(table.facets[some], 2), held[some][:, None])
        bulk = directed_matrix(quadratic_blocks(stiffness, jacobian), mesh.cell_nodes(2), at_nodes)
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
        return np.asarray(self._forces.T @ self._stressed.solve(np.ascontiguousarray(self._forces @ loads)))

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
        some = sizes > _DEPENDENT * sizes[-1]  # loads may be more than what displacements of the mesh tell apart
        axes = axes[:, some] / np.sqrt(sizes[some])
        values, change = la.eigh(axes.T @ (_weighted(linear, weight) + _weighted(rest, beyond)) @ axes)
        values, change = values[::-1], (axes @ change)[:, ::-1]
        linear, rest = linear @ change, rest @ change
        P, R, R2 = _weighted(linear, weight), _weighted(rest, beyond), _weighted(rest, beyond**2)
        A0, A1 = np.eye(len(values)), np.diag(values)
        pushed = weight[:, None] * linear
        T = pushed.T @ self.flexibility(pushed)
        T = 0.5 * (T + T.T)
        kappa = float(np.sqrt(self._constants.total()))
        sharp = []
        for k in range(1, min(len(above), len(values) + 1)):
            A2 = _answers(T[:k, :k], P[:k, :k], R[:k, :k], R2[:k, :k], values[:k], kappa)
            sharp.append(_lehmann(A0[:k, :k], A1[:k, :k], A2, 1.0 / above[k]))
        upper = max(min([float(above[0]), *(found[0] for found in sharp)]), float(values[0]))
        second = min([float(above[min(1, len(above) - 1)]), *(found[1] for found in sharp)])
        lower, simple = float(values[0]), float(above[0])
        return TraceRange(scale * lower, scale * upper, scale * simple, scale * second)

    def _modes(self, root: Array, count: int) -> tuple[Array, Array]:
        """Largest values of the flexibility under weighted loads, not below the exact ones, and their loads."""
        if self._answers is not None:
            n = len(root)
            found = la.eigh(root[:, None] * self._answers * root, subset_by_index=[n - count, n - 1])
            return np.asarray(found[0][::-1]), np.asarray(found[1][:, ::-1])

        def times(x: Array) -> Array:
            return root * self.flexibility(root * x.ravel())

        operator = spla.LinearOperator((len(root), len(root)), matvec=times, dtype=float)
        start = np.random.default_rng(0).normal(size=len(root))
        values, vectors = spla.eigsh(operator, count, which="LA", v0=start, tol=1e-6)
        off = max(float(np.linalg.norm(times(v) - value * v)) for value, v in zip(values, vectors.T, strict=True))
        return np.asarray(values[::-1] + off), np.asarray(vectors[:, ::-1])


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
    theta = np.sqrt((stress + _ROUNDING * top**2) / (trace + _ROUNDING * top))
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
