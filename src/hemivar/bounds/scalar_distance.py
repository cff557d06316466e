"""How far a field of one component is from every solution of the continuous problem, in the energy norm.

Of a membrane, antiplane shear or heat, with ``|v|_a^2 = int A grad v . grad v + k v^2``. Let q be a flux with normal
components that are continuous, and let zeta in dj(r(u)) hold at each point of the contact boundary and areas, as a
force against u. For e the difference to a solution, and alpha the weak convexity constants of the laws,

    |e|_a^2 <= int (q - A grad u) . grad e + int s e + sum over facets of int d e + int alpha e^2 + G,

where s is what ``f - k u - zeta + div q`` is in cells, and d what is left of given fluxes, or of zeta, on facets (put
``q . nu + (A grad u - q) . nu`` for the flux, and Fenchel's inequality for j). Here s and d have no mean on their cell
and facet, so they work by their oscillation alone, with no constant of the body:

    |int s e| <= |s|_T h/pi |grad e|_T,        |int_F d e| <= |d|_F kappa_F |grad e|_T,
    kappa_F^2 = |F|/|T| (h^2/pi^2 + 2 h^2/(d pi)),

the first by Poincare's inequality on convex domains (Payne and Weinberger; Bebendorf), the second as ``int_F w^2 =
|F|/(d |T|) int_T div(w^2 (x - a))``, a the vertex opposite to F and w = e less its mean on T. With ``int alpha v^2 <=
c a(v, v)`` every solution lies within ``eta/(1 - c)``, eta^2 the sum of the squares of what cells have. Where zeta
leaves dj(r(u)), the gap of Fenchel's inequality for ``j + alpha/2 r^2`` is paid, its integral G, and the bound is

    [eta + sqrt(eta^2 + 4 (1 - c) G)] / (2 (1 - c)).

*The flux* is the best one that is of the lowest degree of Raviart and Thomas: ``A grad v - s_T (x - x_T)/d``, where v
solves the problem in the elements of Crouzeix and Raviart, whose values are means on facets, with the mean s_T of
``f - k u - zeta`` on cells (L. D. Marini, SIAM J. Numer. Anal. 22 (1985)).

*The constant c.* For I v with the means of v on facets ``a(v) = a_h(I v) + a_h(v - I v)``, and ``w = v - I v`` has

    |w|_T <= C_T |grad w|_T,  C_T^2 = h^2/pi^2 + m_T/d^2,      |w|_F^2 <= |F|/|T| (C_T^2 + 2 h C_T/d) |grad w|_T^2,

with m_T the mean of ``|x - x_T|^2``. So c is at most the largest eigenvalue of ``int alpha v^2`` against ``a_h`` in
these elements, and the largest of the squared constants of w beside it, alpha included.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.facet_table import FacetTable, facet_table, facet_vertices
from hemivar.bounds.hypotheses import body_shape, check_supports, law_doubts
from hemivar.bounds.roundings import CONSTANT, KINK
from hemivar.bounds.stated_distance import DistanceToExact
from hemivar.errors import ProblemError
from hemivar.fem.constitutive import constitutive_law
from hemivar.fem.discretize import refuse_evolution
from hemivar.fem.quadrature import quadrature_rule
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import snapped
from hemivar.linear.definite import FEW
from hemivar.linear.factorisation import Factorisation, factorise
from hemivar.mechanics.conditions import DataField, ScalarData, VectorData
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import ContactProblem

__all__ = ["scalar_distance", "scalar_trace_bound"]

#: Cells from which a mesh serves for the constants of a body.
_FINE = 2_000


# ---- elements whose unknowns are means on facets --------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Means:
    """The elements of Crouzeix and Raviart on a mesh."""

    table: FacetTable
    coefficient: Array  # A (M, d, d)
    held: BoolArray  # (F,): facets where supports hold the field

    @classmethod
    def of(cls, problem: ContactProblem) -> _Means:
        """On the mesh of a problem."""
        if not problem.material.linear:
            raise ProblemError(
                "the flux of this material is not linear, and bounds of scalar problems need a linear one; leave the "
                "bound out"
            )
        table = facet_table(problem.mesh)
        matrices, _ = constitutive_law(problem).on(problem.mesh, 2)
        if np.abs(matrices - matrices[:, :1]).max() > CONSTANT * np.abs(matrices).max():
            raise ProblemError(
                "the material varies inside cells; bounds of scalar problems need it constant on each: give it by "
                "region"
            )
        held = np.zeros(len(table.facets), dtype=bool)
        for name in problem.supports:
            held[table.numbers(problem.mesh.boundaries[name])] = True
        coefficient = np.broadcast_to(matrices[:, 0], (len(table.cells), *matrices.shape[2:]))
        means = cls(table, coefficient, held)
        means._refuse_loose()
        return means

    def _refuse_loose(self) -> None:
        parts = self.table.mesh.parts
        if len(np.unique(parts.cell[self.table.owners[self.held, 0]])) < parts.count:
            raise ProblemError("a part of the body has no support, and contact alone gives no bound; add a support")

    @property
    def free(self) -> IntArray:
        """Facets (n,) that are unknowns."""
        return np.flatnonzero(~self.held)

    @cached_property
    def least(self) -> Array:
        """The least eigenvalue of A on each cell, (M,)."""
        return np.asarray(np.linalg.eigvalsh(self.coefficient)[:, 0])

    @cached_property
    def diameter(self) -> Array:
        """h of each cell, (M,)."""
        x = self.table.mesh.points[self.table.cells]
        return np.asarray(np.linalg.norm(x[:, :, None] - x[:, None], axis=3).max(axis=(1, 2)))

    @cached_property
    def spread(self) -> Array:
        """Means (M, d, d) of ``(x - x_T)(x - x_T)'`` over the cells."""
        x = self.table.mesh.points[self.table.cells]
        x, count = x - x.mean(axis=1, keepdims=True), x.shape[1]
        return np.asarray(np.einsum("mai,maj->mij", x, x) / (count * (count + 1)))

    @cached_property
    def slopes(self) -> Array:
        """Gradients (M, d + 1, d) of the functions of the facets of a cell."""
        return -self.table.dim * self.table.gradients

    def assembled(self, blocks: Array) -> sp.csr_array:
        """The matrix (F, F) of those of cells, (M, d + 1, d + 1)."""
        nodes, count = self.table.cell_facets, len(self.table.facets)
        rows, columns = np.repeat(nodes, nodes.shape[1], axis=1), np.tile(nodes, nodes.shape[1])
        entries = (blocks.ravel(), (rows.ravel(), columns.ravel()))
        return sp.csr_array(sp.coo_array(entries, shape=(count, count)))

    @cached_property
    def stiffness(self) -> sp.csr_array:
        """K, (F, F)."""
        bent = np.einsum("mij,maj->mai", self.coefficient, self.slopes)
        return self.assembled(self.table.volumes[:, None, None] * np.einsum("mai,mbi->mab", bent, self.slopes))

    @cached_property
    def factor(self) -> Factorisation:
        """K at the free facets."""
        return factorise(sp.csr_array(self.stiffness[self.free][:, self.free]), np.zeros(0, dtype=np.int64))

    def solved(self, load: Array, values: Array) -> Array:
        """The means (F,) under a load (F,), those at held facets given by values (F,)."""
        x = np.where(self.held, values, 0.0)
        x[self.free] = self.factor.solve_interior((load - self.stiffness @ x)[self.free])
        return x

    def kappa(self, facets: IntArray) -> Array:
        """kappa_F (k,), over the root of the least eigenvalue of A, of facets of the boundary."""
        cell, dim = self.table.owners[facets, 0], self.table.dim
        h = self.diameter[cell]
        square = h**2 * (1.0 / math.pi**2 + 2.0 / (dim * math.pi))
        return np.asarray(np.sqrt(self.table.measures[facets] / self.table.volumes[cell] * square / self.least[cell]))

    def largest(self, on_facets: Array, on_cells: Array) -> float:
        """Upper bound of ``sup int alpha v^2 / a(v, v)`` for alpha (F,) on facets of the boundary and (M,) on cells."""
        scale = max(float(on_facets.max(initial=0.0)), float(on_cells.max(initial=0.0)))
        if not 0.0 < scale < np.inf:
            return scale
        table, dim = self.table, self.table.dim
        corners = np.ones((dim + 1, dim + 1)) - dim * np.eye(dim + 1)  # values of the functions at the vertices
        every = (np.ones((dim + 1, dim + 1)) + np.eye(dim + 1)) / ((dim + 1) * (dim + 2))
        blocks = (on_cells / scale * table.volumes)[:, None, None] * (corners.T @ every @ corners)
        weight = np.where(table.interior, 0.0, on_facets / scale)[table.cell_facets]
        on_facet = (np.ones((dim, dim)) + np.eye(dim)) / (dim * (dim + 1))
        parts = np.stack([corners[own].T @ on_facet @ corners[own] for own in facet_vertices(dim)])
        measures = table.measures[table.cell_facets]
        blocks += np.einsum("mf,fab->mab", weight * measures, parts)
        c = np.sqrt((self.diameter / math.pi) ** 2 + np.trace(self.spread, axis1=1, axis2=2) / dim**2)
        near = on_cells / scale * c**2
        near += (weight * measures).sum(axis=1) / table.volumes * (c**2 + 2.0 * self.diameter * c / dim)
        mass = sp.csr_array(self.assembled(blocks)[self.free][:, self.free])
        return scale * (self._top(mass) + float((near / self.least).max()))

    def _top(self, mass: sp.csr_array) -> float:
        """The largest eigenvalue of a mass against K, raised by its residual."""
        K, n = sp.csr_array(self.stiffness[self.free][:, self.free]), mass.shape[0]
        if n <= FEW:
            return float(la.eigh(mass.toarray(), K.toarray(), eigvals_only=True)[-1])

        def solve(x: Array) -> Array:
            return self.factor.solve_interior(np.asarray(x, dtype=float).ravel())

        inverse = spla.LinearOperator((n, n), matvec=solve, dtype=float)
        start = np.random.default_rng(0).normal(size=n)
        values, vectors = spla.eigsh(mass, 1, M=K, Minv=inverse, which="LA", v0=start, tol=1e-8)
        x, value = vectors[:, 0], float(values[0])
        rest = mass @ x - value * (K @ x)
        return value + math.sqrt(max(float(rest @ solve(rest)), 0.0) / float(x @ (K @ x)))


# ---- what acts at points ----------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Rule:
    """A rule on simplices of dimension p."""

    barycentric: Array  # (q, p + 1)
    weights: Array  # (q,), of sum 1

    @classmethod
    def of(cls, p: int) -> _Rule:
        """Exact for the squares of linear functions."""
        return cls(*quadrature_rule(p, 4 if p == 2 else 5))

    def places(self, corners: Array) -> Array:
        """Points (n, q, d) in simplices with these corners (n, p + 1, d)."""
        return np.asarray(self.barycentric @ corners)

    def mean(self, values: Array) -> Array:
        """Means (n,) of values (n, q or 1)."""
        return np.asarray((self.weights * values).sum(axis=1))

    def off(self, values: Array) -> Array:
        """Roots (n,) of the means of the squares of what values (n, q or 1) have beside their mean."""
        return np.asarray(np.sqrt(self.mean((values - self.mean(values)[:, None]) ** 2)))


@dataclass(frozen=True, eq=False)
class _Acting:
    """What a contact does to k facets or cells."""

    mean: Array  # (k,): of zeta
    off: Array  # (k,): of what it has beside that, as of :meth:`_Rule.off`
    gap: Array  # (k,): means of the gap of Fenchel's inequality
    alpha: Array  # (k,)
    doubts: tuple[str, ...]
    conditions: tuple[str, ...]


def _shares(law: VectorLaw, r: Array) -> tuple[Array, Array]:
    """Where a linear function lies between its least and its largest value, and how much of a simplex has it there.

    Values (k, p + 1, c) rise from corner to corner. Points (k, q) run from 0 to 1 between the kinks of the law. On a
    triangle the measure of what is near t rises linearly up to the corner in the middle, and falls linearly from there.
    """
    first, last = r[:, 0], r[:, -1]
    kinks = law.kinks_along(first, last, np.zeros(first.shape))
    cuts = [np.zeros((len(r), 1)), np.where((kinks > 0.0) & (kinks < 1.0), kinks, 0.0), np.ones((len(r), 1))]
    whole = (last - first).sum(axis=1)
    middle = (r[:, 1] - first).sum(axis=1) / np.where(whole > 0.0, whole, 1.0)
    if r.shape[1] == 3:
        cuts.append(middle[:, None])
    cut = np.sort(np.concatenate(cuts, axis=1), axis=1)
    at, weight = quadrature_rule(1, 5)
    length = np.diff(cut, axis=1)[:, :, None]
    t, share = (part.reshape(len(r), -1) for part in (cut[:, :-1, None] + length * at[:, 1], length * weight))
    if r.shape[1] == 3:
        m = middle[:, None]
        rising, falling = t / np.where(m > 0.0, m, 1.0), (1.0 - t) / np.where(m < 1.0, 1.0 - m, 1.0)
        share = share * 2.0 * np.where(t <= m, rising, falling)
    return t, share


def _acting(contact: Contact, name: str, u: Array, wanted: Array, corners: Array, weight: Array) -> _Acting:
    """The elements of dj nearest to a force ``wanted`` (k,) for u (k, p + 1), linear on simplices (k, p + 1, d).

    Where ``weight`` (k,) is positive, and that is cheaper, zeta leaves dj at the price of a gap.
    """
    column, sign = int(contact.rubs), 1.0 if contact.side is Side.ABOVE else -1.0
    level = DataField(contact.gap, f"level of contact '{name}'").at(corners.reshape(-1, corners.shape[2]))
    r = np.zeros((*u.shape, column + 1))
    r[..., column] = np.sort(sign * (u - level.reshape(u.shape)), axis=1)
    stated = contact.law.at(corners.mean(axis=1))
    size = max(float(np.abs(u).max(initial=0.0)), float(np.abs(level).max(initial=0.0)))

    def of(count: int) -> VectorLaw:
        return stated.take(np.repeat(np.arange(len(u)), count))

    flat = snapped(of(u.shape[1]), r.reshape(-1, column + 1), KINK * size)
    inside = of(u.shape[1]).admissible(flat)
    beyond = float(np.abs(inside - flat).max(initial=0.0))
    r = inside.reshape(r.shape)
    t, share = _shares(stated, r)
    at = (r[:, :1] + t[:, :, None] * (r[:, -1:] - r[:, :1])).reshape(-1, column + 1)
    target = np.zeros(at.shape)
    target[:, column] = sign * np.repeat(wanted, t.shape[1])
    zeta = sign * of(t.shape[1]).nearest_multiplier(at, target)[:, column].reshape(t.shape)
    mean = (share * zeta).sum(axis=1)
    off = np.sqrt((share * (zeta - mean[:, None]) ** 2).sum(axis=1))
    alpha = np.broadcast_to(stated.weak_convexity[column], len(u))
    gap = np.zeros(len(u))
    some = np.flatnonzero((weight > 0.0) & np.isfinite(alpha))
    known = stated.proof("alpha")
    if some.size and known.reach[column] == np.inf:
        law, s, rest = stated.take(some), share[some], at.reshape(*t.shape, -1)[some]
        paid = _paid(law, column, rest, s, sign * wanted[some], alpha[some], weight[some])
        cheaper = paid[2] < (mean[some] - wanted[some]) ** 2 / weight[some]
        mean[some] = np.where(cheaper, sign * paid[0], mean[some])
        off[some], gap[some] = np.where(cheaper, paid[1], off[some]), np.where(cheaper, paid[2], 0.0)
    doubts, conditions = [], []
    if beyond > KINK * size:
        doubts.append(
            f"the field leaves the domain of the law of '{name}' by {beyond:.3g}, which the bound does not include"
        )
    reach, what = known.reach[column], "slip" if column else "penetration"
    if alpha.any() and reach == 0.0:
        doubts.append(f"a constant of the law is {known.doubt}")
    elif alpha.any() and reach < np.inf:
        conditions.append(f"{what}s of the exact solution are within the reach {reach:g} of the law")
        largest = float(np.abs(r).max(initial=0.0))
        if not largest <= reach:
            doubts.append(f"the {what} {largest:.4g} may lie outside of the reach {reach:g} of its law")
    if callable(contact.gap):
        doubts.append(f"the level of contact '{name}' varies, and is taken linear on cells and facets")
    return _Acting(mean, off, gap, alpha, tuple(doubts), tuple(conditions))


def _paid(
    law: VectorLaw, column: int, at: Array, share: Array, wanted: Array, alpha: Array, weight: Array
) -> tuple[Array, Array, Array]:
    """A zeta with ``zeta + alpha r`` constant on simplices: its means, what it has beside them, and means of its gap.

    That constant is one of ``j + alpha/2 r^2`` at the p where ``j(p) + (alpha + weight)/2 (p - r)^2 - wanted p`` is
    least, r the mean of the displacements (k, q, c).
    """
    count, c = at.shape[1:]
    r = at[..., column]
    middle = (share * r).sum(axis=1)
    both, target = np.zeros((len(at), 2)), np.zeros((len(at), c))
    both[:, column] = alpha + weight
    both[:, 1 - column] = 1.0
    target[:, column] = wanted + (alpha + weight) * middle
    p = law.admissible(law.local_argmin(both, target))
    y = wanted + alpha * middle + weight * (middle - p[:, column])
    above = law.take(np.repeat(np.arange(len(at)), count)).value(at.reshape(-1, c)).reshape(r.shape)
    a, low = alpha[:, None], p[:, column, None]
    gap = above - law.value(p)[:, None] + (0.5 * a * (r + low) - y[:, None]) * (r - low)
    off = alpha * np.sqrt((share * (r - middle[:, None]) ** 2).sum(axis=1))
    return y - alpha * middle, off, np.asarray((share * np.maximum(gap, 0.0)).sum(axis=1))


# ---- the distance -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Sums:
    """What is gathered over facets and cells."""

    load: Array  # (F,): means of fluxes into facets, times their measures
    beside: Array  # (M,): what oscillates in a cell and on its facets, added to its eta
    at_contact: Array  # (M,): the part of contact in that
    alpha_facets: Array  # (F,)
    alpha_cells: Array  # (M,)
    gaps: list[float]
    reasons: list[str]
    conditions: list[str]


class _Distance:
    """The bound of one field, and what it was moved by to where supports hold it."""

    def __init__(self, problem: ContactProblem, values: Array, correction: float = 0.0) -> None:
        self.correction = correction
        self.problem, self.u = problem, np.asarray(values, dtype=float).ravel()
        self.means = _Means.of(problem)
        self.table = self.means.table
        self.corners = problem.mesh.points[self.table.cells]
        self.at_cells = self.u[self.table.cells]
        self.slope = np.einsum("mai,ma->mi", self.table.gradients, self.at_cells)
        self.doubts = [*law_doubts(problem), *self._varying()]

    def _begin(self) -> None:
        facets, cells = len(self.table.facets), len(self.table.cells)
        self.sums = _Sums(
            np.zeros(facets), np.zeros(cells), np.zeros(cells), np.zeros(facets), np.zeros(cells), [],
            [*self.doubts], [],
        )  # fmt: skip

    def _varying(self) -> list[str]:
        """What of the statement is seen by rules of integration, or interpolated."""
        problem, seen = self.problem, "is a function, which is evaluated by a quadrature rule"
        named: dict[str, object] = {"source": problem.body_force, "bedding": problem.bedding}
        named |= {f"flux on '{name}'": value for name, value in problem.tractions.items()}
        varying = [f"the {what} {seen}" for what, value in named.items() if callable(value)]
        if any(callable(value) for value in problem.supports.values()):
            varying.append("prescribed values are functions, which the mesh interpolates")
        if not problem.material.uniform:
            varying.append(f"the {problem.material.scalar.constant} {seen}")  # type: ignore[union-attr]
        return varying

    @cached_property
    def cell_rule(self) -> _Rule:
        """A rule on the cells."""
        return _Rule.of(self.table.dim)

    def _at(self, value: VectorData | ScalarData, what: str) -> Array:
        """Values (M, q or 1) at the points of the rule of the cells."""
        field, dim = DataField(value, what), self.table.dim
        if not callable(value):
            return np.full((len(self.corners), 1), field.at(self.corners[0, :1])[0])
        places = self.cell_rule.places(self.corners)
        return field.at(places.reshape(-1, dim)).reshape(places.shape[:2])

    @cached_property
    def _density(self) -> Array:
        """``f - k u`` at the points of the cells, (M, q)."""
        source, bedding = self._at(self.problem.body_force, "source"), self._at(self.problem.bedding, "bedding")
        return source - bedding * (self.at_cells @ self.cell_rule.barycentric.T)

    def _fluxes(self) -> None:
        """Fluxes that are given."""
        rule, dim = _Rule.of(self.table.dim - 1), self.table.dim
        for name, value in self.problem.tractions.items():
            facets = self._facets(name)
            places = rule.places(self.problem.mesh.points[self.table.facets[facets]])
            given = DataField(value, f"fluxes['{name}']").at(places.reshape(-1, dim)).reshape(places.shape[:2])
            self._add(facets, rule.mean(given), rule.off(given))

    def _facets(self, name: str) -> IntArray:
        return np.unique(self.table.numbers(self.problem.mesh.boundaries[name]))

    def _add(self, facets: IntArray, mean: Array, off: Array) -> Array:
        """Fluxes into facets: their means (k,), and what they oscillate about them; returns what that adds, (M,)."""
        measures, part = self.table.measures[facets], np.zeros(len(self.table.cells))
        np.add.at(self.sums.load, facets, measures * mean)
        np.add.at(part, self.table.owners[facets, 0], self.means.kappa(facets) * off * np.sqrt(measures))
        np.add(self.sums.beside, part, out=self.sums.beside)
        return part

    def _places(self, name: str) -> tuple[IntArray, Array]:
        """The nodes (k, p + 1) of the facets or cells of a contact, and their measures (k,)."""
        if name in self.problem.areas:
            cells = self.problem.areas[name]
            return self.table.cells[cells], self.table.volumes[cells]
        facets = self._facets(name)
        return self.table.facets[facets], self.table.measures[facets]

    def _nodal_forces(self) -> Array:
        """Forces of the laws per length or area, against u, that keep nodes in equilibrium; nan at others, (nodes,)."""
        table, rule = self.table, self.cell_rule
        flux = np.einsum("mij,mj->mi", self.means.coefficient, self.slope)
        forces = rule.weights * self._density @ rule.barycentric - np.einsum("mai,mi->ma", table.gradients, flux)
        forces *= table.volumes[:, None]
        out = np.bincount(table.cells.ravel(), forces.ravel(), len(self.u))
        np.add.at(out, table.facets, (self.sums.load / table.dim)[:, None])
        weight = np.zeros(len(out))
        for name in self.problem.contact:
            members, sizes = self._places(name)
            np.add.at(weight, members, (sizes / members.shape[1])[:, None])
        weight[table.facets[self.means.held]] = 0.0
        return np.where(weight > 0.0, out / np.where(weight > 0.0, weight, 1.0), np.nan)

    def _contacts(self, paying: bool) -> tuple[Array, Array]:
        """Means (M,) of the forces of areas against u, and what they have beside them as of :meth:`_Rule.off`.

        ``paying`` ones may leave dj. What that saves is about ``(mean - wanted)^2 / weight`` of the misfit.
        """
        nodal, (mean, off) = self._nodal_forces(), np.zeros((2, len(self.corners)))
        for name, contact in self.problem.contact.items():
            members, sizes = self._places(name)
            cell = self.problem.areas[name] if name in self.problem.areas else self.table.owners[self._facets(name), 0]
            power = 2 if name in self.problem.areas else 1
            weight = self.means.least[cell] / self.means.diameter[cell] ** power * float(paying)
            at = self.problem.mesh.points[members]
            acting = _acting(contact, name, self.u[members], _known(nodal[members]), at, weight)
            self.sums.gaps.append(float(sizes @ acting.gap))
            self.sums.reasons.extend(acting.doubts)
            self.sums.conditions.extend(acting.conditions)
            if name in self.problem.areas:
                cells = self.problem.areas[name]
                mean[cells], off[cells] = mean[cells] + acting.mean, off[cells] + acting.off
                self.sums.alpha_cells[cells] += acting.alpha
            else:
                facets = self._facets(name)
                self.sums.alpha_facets[facets] = acting.alpha
                part = self._add(facets, -acting.mean, acting.off)
                np.add(self.sums.at_contact, part, out=self.sums.at_contact)
        return mean, off

    def better(self) -> DistanceToExact:
        """The bound, or an estimate: the better of two."""
        first, second = self._with(paying=False), self._with(paying=True)
        return second if second.bound < first.bound else first

    def _with(self, paying: bool) -> DistanceToExact:
        self._begin()
        table, means, sums, rule = self.table, self.means, self.sums, self.cell_rule
        self._fluxes()
        force, force_off = self._contacts(paying)
        mean, off = rule.mean(self._density) - force, rule.off(self._density)
        inside = means.diameter / math.pi * np.sqrt(table.volumes / means.least)
        for part, beside in ((sums.at_contact, force_off), (sums.beside, off + force_off)):
            part += inside * beside
        load = sums.load.copy()
        np.add.at(load, table.cell_facets, (mean * table.volumes / (table.dim + 1))[:, None])
        x = means.solved(load, self.u[table.facets].mean(axis=1))
        apart = np.einsum("mai,ma->mi", means.slopes, x[table.cell_facets]) - self.slope
        bent = np.einsum("mij,mij->m", np.linalg.inv(means.coefficient), means.spread) * (mean / table.dim) ** 2
        eta = table.volumes * (np.einsum("mi,mij,mj->m", apart, means.coefficient, apart) + bent)
        whole = float(np.linalg.norm(np.sqrt(eta) + sums.beside))
        c = means.largest(sums.alpha_facets, sums.alpha_cells)
        misfit, contact = float(np.sqrt(eta.sum())), float(np.linalg.norm(sums.at_contact))
        return self._stated(whole, misfit, contact, c)

    def _stated(self, whole: float, misfit: float, contact: float, c: float) -> DistanceToExact:
        G, bound = sum(self.sums.gaps), math.inf
        if c < 1.0:
            bound = (whole + math.sqrt(whole**2 + 4.0 * (1.0 - c) * G)) / (2.0 * (1.0 - c)) + self.correction
        reasons = list(self.sums.reasons)
        if not math.isfinite(bound):
            falls = "the law drops discontinuously, so c is infinite"
            soft = f"the foundation softens too much for the body: c is known to be at most {c:.3g} only"
            reasons.append(f"there is no bound: {falls if math.isinf(c) else soft}")
        conditions = () if reasons else tuple(self.sums.conditions)
        size = self.size
        relative = bound / size if size > 0.0 else 0.0 if bound == 0.0 else math.inf
        proved = not reasons and not conditions
        return DistanceToExact(
            bound=bound, relative=relative, guaranteed=proved, reasons=(*reasons, *conditions), misfit=misfit,
            contact=contact, oscillation=max(whole - misfit - contact, 0.0), algebraic=0.0, gap=G, constant=c,
            geometry=body_shape(self.problem.mesh), conditions=conditions, unique=proved,
            correction=self.correction,
        )  # fmt: skip

    @property
    def size(self) -> float:
        """``|u|_a``."""
        between = self.at_cells @ self.cell_rule.barycentric.T
        bedded = self.cell_rule.mean(self._at(self.problem.bedding, "bedding") * between**2)
        energy = np.einsum("mi,mij,mj->m", self.slope, self.means.coefficient, self.slope) + bedded
        return float(np.sqrt(self.table.volumes @ energy))


def _known(values: Array) -> Array:
    """Means (k,) of values (k, l) that are known, 0 where none is."""
    known = np.isfinite(values)
    return np.asarray(np.where(known, values, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1))


def scalar_distance(problem: ContactProblem, values: Array) -> DistanceToExact:
    """Bound the distance of a field to every solution of the continuous problem.

    Shapes: ``values`` (nodes, 1).
    """
    began = time.perf_counter()
    refuse_evolution(problem)
    if problem.order != 1:
        raise ProblemError("bounds of scalar problems are for linear elements; take order = 1")
    if any(contact.against for contact in problem.contact.values()):
        raise ProblemError("heat that crosses from body to body has no bound of the distance; leave the bound out")
    if problem.areas and problem.mesh.dim == 3:
        raise ProblemError("contact over a region in 3D has no bound of the distance; leave the bound out")
    fixed = check_supports(problem, values)
    correction = 0.0 if fixed is values else _Distance(problem, fixed - values).size
    distance = _Distance(problem, fixed, correction).better()
    object.__setattr__(distance, "seconds", time.perf_counter() - began)
    return distance


def scalar_trace_bound(problem: ContactProblem) -> float:
    """Upper bound of ``sup |v| / |grad v|``, v on contact boundaries and areas, over fields that supports hold."""
    assert problem.kind is not None
    mesh = problem.mesh
    while mesh.number_of_cells < _FINE:
        mesh = mesh.refined()
    plain = Material.gradient(1.0, problem.kind)
    there = problem.on(mesh)
    means = _Means.of(ContactProblem(mesh, plain, supports=dict.fromkeys(problem.supports, 0.0)))
    on_facets, on_cells = np.zeros(len(means.table.facets)), np.zeros(mesh.number_of_cells)
    for name in there.contact:
        if name in there.areas:
            on_cells[there.areas[name]] = 1.0
        else:
            on_facets[means.table.numbers(mesh.boundaries[name])] = 1.0
    return math.sqrt(means.largest(on_facets, on_cells))
