"""The solution of a condensed problem near a state that all but solves it: a few of Newton's equations and no search.

In an evolution one problem follows another that hardly differs.  With ``p = r + c lam`` the law says ``r = prox_c(p)``,
which sorts the contact points onto the pieces of their laws and onto kinks; Newton's equation on these pieces gives the
next pair.  If pieces do not change any more the pair solves the problem, and its residual, that of the full problem,
proves it.  Where there is one solution it is the one that any other method finds.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import blas, lapack

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.residual import LoadScale, Residual
from hemivar.laws import ContactLaw
from hemivar.laws.separate import OnGraph, RadialLaw, SeparateLaw
from hemivar.solvers.controls import Controls
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import Status
from hemivar.systems.condensed import CondensedProblem

__all__ = ["OutOfBalance", "Pieces", "nearby_solution"]

#: Newton's equations that are solved before a search is thought better.
_ROUNDS = 6
#: Components up to which memory for matrices is kept.
_SMALL = 600
#: Part of the tolerance by which the multiplier may miss the law before the other unknowns are looked for.
_PART = 0.5


@dataclass(frozen=True, eq=False)
class OutOfBalance:
    """What the body leaves of its load, the foundation apart.

    Attributes
    ----------
    force : array (n,)
        ``f - K u``; it belongs to who is given it, and may be changed.
    size : float
        Norm of the sizes of what was added up in it, or more: rounding is a part of it.
    """

    force: Array
    size: float


@dataclass(frozen=True, eq=False)
class _Vectors:
    """What :class:`SeparateLaw` answers, of a law that has many knots."""

    law: ContactLaw
    pair: Array  # stiffness that sorts, (m, 2)
    stiffness: Array  # the same, (m, d)
    compliance: Array  # (m, 2)

    def onto(self, p: Array, r: Array) -> OnGraph:
        place = self.law.place_on_piece(self.pair, p, r)
        line = self.law.linearise(place)
        held = ~np.repeat(line.smooth, [1, r.shape[1] - 1], axis=1)
        lam = np.where(held, p - self.stiffness * place, line.gradient)
        return OnGraph(place, held, lam, line.hessian, moved=True)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        return self.law.graph_distance(r, lam, self.compliance)[:, None]


#: A law as Newton's equations ask for it.
_Graphs = SeparateLaw | RadialLaw | _Vectors


@dataclass(eq=False)
class Pieces:
    """What is kept of Newton's equations: the tables of the law, and the factor of the equation that was solved last.

    The factor serves as long as the contact points keep their pieces.  Nothing in it changes an answer.  It belongs to
    one march: its memory is used again.
    """

    _law: _Graphs | None = field(default=None, repr=False)
    _known: tuple[bytes, Array | None] = field(default=(b"", None), repr=False)
    _room: Array | None = field(default=None, repr=False)

    def graphs(self, system: CondensedProblem) -> _Graphs:
        """The graphs of the law."""
        found, law, body = self._law, system.law, system.body
        if found is None or found.law is not law:
            d, pair = system.shape[1], body.pointwise
            made = RadialLaw.of(law, pair) if d == 3 else SeparateLaw.of(law, pair, d)
            found = self._law = _Vectors(law, pair, body.per_area, body.compliance) if made is None else made
        return found

    def solve(self, system: CondensedProblem, index: IntArray, curvature: Array, right: Array) -> Array | None:
        """``H^-1 right`` (k,) on the components ``index``, with second derivatives of the laws (m, d) or (m, d, d).

        None where H is not positive definite.
        """
        key = index.tobytes() + curvature.tobytes()
        known, factor = self._known
        if known != key:
            self._known = b"", None  # its memory is used again
            H = self._part(system.matrix, index)
            if curvature.ndim == 3:
                self._add(H, system, index, curvature)
            else:
                H.ravel()[:: index.size + 1] += (system.weights[:, None] * curvature).ravel()[index]
            factor, failed = lapack.dpotrf(H.T, lower=1, clean=0, overwrite_a=1)  # H is symmetric: no copy is made
            if failed:
                return None
            self._known = key, factor
        half = blas.dtrsv(factor, right, lower=1)  # half of what a solve for many takes
        return np.asarray(blas.dtrsv(factor, half, lower=1, trans=1, overwrite_x=1))

    def _part(self, matrix: Array, index: IntArray) -> Array:
        """Rows and columns of a matrix, in memory that is used again: new memory costs more than the numbers."""
        k, n = index.size, len(matrix)
        if n > _SMALL:
            return matrix.take(index, axis=0).take(index, axis=1)
        if self._room is None or self._room.shape != (2, n * n):
            self._room = np.empty((2, n * n))
        rows, part = self._room[0, : k * n].reshape(k, n), self._room[1, : k * k].reshape(k, k)
        matrix.take(index, axis=0, out=rows, mode="clip")
        return rows.take(index, axis=1, out=part, mode="clip")

    @staticmethod
    def _add(H: Array, system: CondensedProblem, index: IntArray, curvature: Array) -> None:
        """Add second derivatives (m, d, d) of the laws, those of the components ``index``."""
        m, d = system.shape
        point, component = np.divmod(index, d)
        position = np.full((m, d), -1)
        position[point, component] = np.arange(index.size)
        partner = position[point]  # (k, d)
        row, column = np.nonzero(partner >= 0)
        here = point[row]
        H[row, partner[row, column]] += system.weights[here] * curvature[here, component[row], column]


def nearby_solution(
    system: CondensedProblem,
    r: Array,
    lam: Array,
    controls: Controls,
    pieces: Pieces,
    out_of_balance: Callable[[Array], OutOfBalance] | None = None,
) -> Solution | None:
    """The solution that Newton's equations lead to from a pair, or None where they do not settle at once.

    Parameters
    ----------
    system : CondensedProblem
        Its law depends on no state.
    r, lam : arrays (m, d)
        Local displacements and multiplier of a state nearby.
    controls : Controls
    pieces : Pieces
        Of the same body.
    out_of_balance : callable, optional
        What unknowns (n,) leave of the load, if the caller needs the forces of the body anyway.  Where that is more
        than the tolerance, or rounding might be, the stiffness is asked.
    """
    began = time.perf_counter()
    body, active, weights = system.body, system.active, system.weights[:, None]
    graphs, stiffness, whole = pieces.graphs(system), body.per_area, body.everywhere
    if not whole:
        r = np.where(active, r, system.fixed)
    p = stiffness * r + lam
    if not math.isfinite(float(p.sum())):
        return None
    on, load = graphs.onto(p, r), system.problem.linear.load_size
    for number in range(1, _ROUNDS + 1):
        r = on.place if whole else np.where(active, on.place, system.fixed)
        free = ~on.held if whole else active & ~on.held
        index = np.flatnonzero(free)
        balance = system.out_of_balance(r)
        if index.size:
            right = (balance - weights * on.multiplier).ravel()[index]
            step = pieces.solve(system, index, on.curvature, right)
            if step is None:
                return None
            change = np.zeros(r.shape)
            change.ravel()[index] = step
            r = r + change
            balance = balance - system.couple(change)
        lam = balance / weights
        if not whole:
            reaction = system.law.nearest_multiplier(r, np.zeros(r.shape))
            lam = np.where(active, lam, reaction)
        on = graphs.onto(stiffness * r + lam, r)
        of_law = on.multiplier if whole else np.where(active, on.multiplier, lam)
        off = of_law - lam
        if on.moved:
            off = np.abs(off) + stiffness * np.abs((on.place if whole else np.where(active, on.place, r)) - r)
        missed = norm(weights * off)
        if not math.isfinite(missed):
            return None
        if missed > _PART * (controls.atol + controls.rtol * load):
            force = norm(weights * of_law)
            if missed > _PART * (controls.atol + controls.rtol * max(load, force)):
                continue
            scale = _load_scale(system, graphs, load, force).of(force)
            if missed > _PART * (controls.atol + controls.rtol * scale):
                continue
        iterated = time.perf_counter()
        unknowns = system.unknowns(r)
        place = system.problem.contact.local(unknowns)
        residual = _residual(system, unknowns, place, of_law, graphs, load, controls, out_of_balance)
        if residual.below(controls.atol, controls.rtol):
            solution = Solution(
                problem=system.problem,
                unknowns=unknowns,
                multiplier=of_law,
                status=Status.CONVERGED,
                residual=residual,
                method=NonsmoothNewton.name,
                steps=number,
                evaluations=number,
                timings={
                    "condense": system.seconds,
                    "iterate": iterated - began,
                    "recover": time.perf_counter() - iterated,
                },
            )
            vars(solution)["local"] = place  # what the property would find
            return solution
    return None


def _load_scale(system: CondensedProblem, graphs: _Graphs, load: float, contact_force: float) -> LoadScale:
    """What residuals are held against: :attr:`CondensedProblem.load_scale`, read from tables.

    What the foundation does at rest is not looked for where the load is larger than the force that it exerts.
    """
    if contact_force <= load:
        return LoadScale(load, math.inf)
    if isinstance(graphs, _Vectors):
        return system.load_scale
    offset, ends, shape = system.problem.contact.offset, graphs.domain, system.shape
    inside = np.minimum(np.maximum(-offset, ends[0].reshape(shape)), ends[1].reshape(shape))
    lam = graphs.least_multiplier(inside)
    lam[:, 0] -= (offset + inside)[:, 0] / system.body.compliance[:, 0]
    rest = norm(system.problem.contact.pressed(system.weights[:, None] * lam))
    return LoadScale(load, rest if math.isfinite(rest) else math.inf)


def _residual(
    system: CondensedProblem,
    u: Array,
    r: Array,
    lam: Array,
    graphs: _Graphs,
    load: float,
    controls: Controls,
    known: Callable[[Array], OutOfBalance] | None,
) -> Residual:
    """The residual of the full problem."""
    problem, body = system.problem, system.body
    contact = problem.contact
    force = contact.pressed(system.weights[:, None] * lam)
    size = norm(force)
    inclusion = norm(system.weights[:, None] * graphs.graph_distance(r, lam, body.resilience))
    scale = _load_scale(system, graphs, load, size)

    def of(rest: OutOfBalance) -> Residual:
        balance = rest.force
        balance[contact.seen] -= force
        return Residual.of(norm(balance), inclusion, scale, size, rest.size)

    if known is not None:
        found = of(known(u))
        tolerance = controls.atol + controls.rtol * found.scale
        if found.noise <= tolerance and found.total <= tolerance:
            return found
    return of(OutOfBalance(problem.linear.load - body.entries @ u, problem.linear.moved(u)))
