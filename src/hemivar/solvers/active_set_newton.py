"""The first rounds of a step in time: a primal-dual active set method, without a search.

In an evolution one problem follows another that hardly differs.  With ``p = r + c lam`` the law says ``r = prox_c(p)``,
which sorts the contact points onto the pieces of their laws and onto kinks: the active sets.  Newton's equation on
these gives the next pair (Hintermueller, Ito and Kunisch 2003).  If the sets do not change any more the pair solves
the problem, and its residual, that of the full problem, proves it.  Where there is one solution it is the one that
any other method finds.  Where the sets do not settle in a few rounds, the method of the march takes over.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import lapack

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.residual import LoadScale, Residual
from hemivar.laws import ContactLaw, separable
from hemivar.laws.separate import GraphPosition, RadialLaw, SeparateLaw
from hemivar.laws.state_dependent import DependentLaw
from hemivar.solvers.controls import Controls
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import Status
from hemivar.systems.compiled_rounds import CompiledRounds, compiled_rounds
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.dense_newton import DenseFactor, newton_matrix

__all__ = ["FEW_ROUNDS", "SEMISMOOTH", "ForceResidual", "NewtonCache", "active_set_newton", "small_and_convex"]

#: The method where the bound of the law depends on the state.
SEMISMOOTH = "semismooth-newton"
#: Newton's equations that are solved before a search is thought better.
_ROUNDS = 6
#: The same of a body that nothing is known of yet, and components of contact points up to which it is tried.
FEW_ROUNDS, _SMALL = 12, 600
#: Part of the tolerance by which the multiplier may miss the law before the other unknowns are looked for.
_PART = 0.5


@dataclass(frozen=True, eq=False)
class ForceResidual:
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
class _GeneralGraph:
    """What :class:`SeparateLaw` answers, of a law that has many knots."""

    law: ContactLaw
    pair: Array  # stiffness that sorts, (m, 2)
    stiffness: Array  # the same, (m, d)
    compliance: Array  # (m, 2)

    def onto(self, p: Array, r: Array) -> GraphPosition:
        place = self.law.place_on_piece(self.pair, p, r)
        line = self.law.linearise(place)
        held = ~np.repeat(line.smooth, [1, r.shape[1] - 1], axis=1)
        lam = np.where(held, p - self.stiffness * place, line.gradient)
        return GraphPosition(place, held, lam, line.hessian, moved=True)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        return self.law.graph_distance(r, lam, self.compliance)[:, None]


#: A law as Newton's equations ask for it.
_Graphs = SeparateLaw | RadialLaw | DependentLaw | _GeneralGraph


@dataclass(eq=False)
class NewtonCache:
    """What is kept of Newton's equations: the tables of the law, and the factor of the equation that was solved last.

    The factor serves as long as the contact points keep their pieces.  Nothing in it changes an answer.  It belongs to
    one march: its memory is used again.
    """

    _law: _Graphs | None = field(default=None, repr=False)
    factor: DenseFactor = field(default_factory=DenseFactor, repr=False)
    _known: tuple[_Graphs, Array, CompiledRounds | None] | None = field(default=None, repr=False)

    def graphs(self, system: CondensedProblem) -> _Graphs | None:
        """The graphs of the law; None where Newton's equations have none of it."""
        found, body = self._law, system.body
        if found is None or found.law is not system.law:
            law = system.law
            if not isinstance(law, ContactLaw):
                return None
            d, pair = system.shape[1], body.pointwise
            made: _Graphs | None
            if law.state_dependent:
                made = DependentLaw.of(law, pair, d)
            else:
                made = RadialLaw.of(law, pair) if d == 3 else SeparateLaw.of(law, pair, d)
                made = _GeneralGraph(law, pair, body.per_area, body.compliance) if made is None else made
            found = self._law = made
        return found

    def compiled(self, system: CondensedProblem, graphs: _Graphs) -> CompiledRounds | None:
        """What makes the rounds in one call, where it can."""
        known = self._known
        if known is None or known[0] is not graphs or known[1] is not system.matrix:
            body, found = system.body, None
            if body.everywhere:
                found = compiled_rounds(graphs, system.matrix, system.weights, body.resilience)
            known = self._known = graphs, system.matrix, found
        return known[2]


def small_and_convex(system: CondensedProblem) -> bool:
    """Whether a few rounds on a body of the plane cost a fifth of the steps of another method."""
    law = system.law
    if law.state_dependent or not law.splits or system.shape[1] > 2 or not 0 < system.free.size <= _SMALL:
        return False
    return not any(alpha.any() for alpha in law.weak_convexity)


def active_set_newton(
    system: CondensedProblem,
    r: Array,
    lam: Array,
    controls: Controls,
    cache: NewtonCache,
    out_of_balance: Callable[[Array], ForceResidual] | None = None,
    rounds: int = _ROUNDS,
) -> Solution | None:
    """The solution that Newton's equations lead to from a pair, or None where they do not settle at once.

    Parameters
    ----------
    system : CondensedProblem
    r, lam : arrays (m, d)
        Local displacements and multiplier of a state nearby.
    controls : Controls
    cache : NewtonCache
        Of the same body.
    out_of_balance : callable, optional
        What unknowns (n,) leave of the load, if the caller needs the forces of the body anyway.  Where that is more
        than the tolerance, or rounding might be, the stiffness is asked.
    rounds : int
        Newton's equations that are solved at most.
    """
    began = time.perf_counter()
    graphs = cache.graphs(system)
    if graphs is None:
        return None
    start = _Start(system, graphs, r, lam, controls, rounds)
    compiled = cache.compiled(system, graphs)
    pairs = _pairs(start, cache.factor) if compiled is None else _compiled_pairs(start, compiled)
    for number, r, of_law, free in pairs:
        if not _stands(system, r, of_law, free):
            return None
        iterated = time.perf_counter()
        unknowns = system.unknowns(r)
        place = system.problem.contact.trace_of(unknowns) - system.problem.offset
        residual = _residual(system, unknowns, place, of_law, start, compiled, out_of_balance)
        if residual.below(controls.atol, controls.rtol):
            solution = Solution(
                problem=system.problem,
                unknowns=unknowns,
                multiplier=of_law,
                status=Status.CONVERGED,
                residual=residual,
                method=SEMISMOOTH if system.law.state_dependent else NonsmoothNewton.name,
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


#: A round and what it found: local displacements and multiplier of the law (m, d), components that moved.
_Pair = tuple[int, Array, Array, BoolArray | None]


@dataclass(frozen=True, eq=False)
class _Start:
    """Where the rounds begin, and when they have settled."""

    system: CondensedProblem
    graphs: _Graphs
    r: Array
    lam: Array
    controls: Controls
    rounds: int

    @property
    def load(self) -> float:
        """Size of the load."""
        return self.system.problem.loading.load_size

    def close(self, missed: float, force: float) -> bool:
        """Whether multipliers of body and law are as near as is asked, those of the law being a force of this size."""
        controls = self.controls
        allowed = _PART * (controls.atol + controls.rtol * self.load)
        if missed > allowed:
            scale = _load_scale(self.system, self.graphs, self.load, force).of(force)
            allowed = _PART * (controls.atol + controls.rtol * scale)
        return missed <= allowed


def _compiled_pairs(start: _Start, compiled: CompiledRounds) -> Iterator[_Pair]:
    """What :func:`_pairs` finds, by the compiled kernels."""
    r, lam, number = start.r, start.lam, 0
    atol, rtol = _PART * start.controls.atol, _PART * start.controls.rtol
    while number < start.rounds:
        found = compiled.run(start.system.load, r, lam, start.rounds - number, atol, rtol, start.load)
        if found is None or not found.settled:
            return
        r, lam, number = found.r, found.lam, number + found.count
        if start.close(found.missed, found.force):
            yield number, r, found.of_law, None


def _pairs(start: _Start, factor: DenseFactor) -> Iterator[_Pair]:
    """The pairs at which rounds have settled: whoever asks for another was not content with the last."""
    system, graphs, controls = start.system, start.graphs, start.controls
    body, active, weights = system.body, system.active, system.weights[:, None]
    stiffness, whole, load = body.per_area, body.everywhere, start.load
    r = start.r if whole else np.where(active, start.r, system.fixed)
    p = stiffness * r + start.lam
    if not math.isfinite(float(p.sum())):
        return
    on = graphs.onto(p, r)
    for number in range(1, start.rounds + 1):
        r = on.place if whole else np.where(active, on.place, system.fixed)
        free = ~on.held if whole else active & ~on.held
        balance = system.out_of_balance(r)
        change = factor.direction(system, on, free, balance)
        if change is None:
            return
        r = r + change
        balance = balance - system.couple(change)
        lam = balance / weights
        if not whole:
            reaction = system.law_at(r, lam).nearest_multiplier(r, np.zeros(r.shape))
            lam = np.where(active, lam, reaction)
        on = graphs.onto(stiffness * r + lam, r)
        of_law = on.multiplier if whole else np.where(active, on.multiplier, lam)
        off = of_law - lam
        if on.moved:
            off = np.abs(off) + stiffness * np.abs((on.place if whole else np.where(active, on.place, r)) - r)
        missed, force = norm(weights * off), norm(weights * of_law)
        if not math.isfinite(missed):
            return
        most = _PART * (controls.atol + controls.rtol * max(load, force))
        if missed <= most and start.close(missed, force):
            yield number, r, of_law, free


def _stands(system: CondensedProblem, r: Array, lam: Array, free: BoolArray | None) -> bool:
    """Whether friction that weakens, under a bound that depends on the state, leaves a pair stable, the bound frozen:
    whether there is one solution is not known before."""
    if not system.law.state_dependent:
        return True
    law = separable(system.law, "a bound that depends on the state")
    if law.friction.profile.convex:
        return True
    assert free is not None  # the compiled kernels take no such laws
    index = np.flatnonzero(free)
    H = newton_matrix(system, index, law.frozen(r, lam).linearise(r).hessian)
    return not index.size or not lapack.dpotrf(H, lower=1)[1]


def _load_scale(system: CondensedProblem, graphs: _Graphs, load: float, contact_force: float) -> LoadScale:
    """What residuals are held against: :attr:`CondensedProblem.load_scale`, read from tables.

    What the foundation does at rest is not looked for where the load is larger than the force that it exerts.
    """
    if contact_force <= load:
        return LoadScale(load, math.inf)
    if isinstance(graphs, _GeneralGraph):
        return system.load_scale
    offset, ends, shape = system.problem.offset, graphs.domain, system.shape
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
    start: _Start,
    compiled: CompiledRounds | None,
    known: Callable[[Array], ForceResidual] | None,
) -> Residual:
    """The residual of the full problem."""
    problem, body, controls = system.problem, system.body, start.controls
    contact, weights = problem.contact, system.weights[:, None]
    force = contact.pressed(weights * lam)
    size = norm(force)
    if compiled is None:
        inclusion = norm(weights * start.graphs.graph_distance(r, lam, body.resilience))
    else:
        inclusion = compiled.distance(r, lam)
    scale = _load_scale(system, start.graphs, start.load, size)

    def of(rest: ForceResidual) -> Residual:
        balance = rest.force
        balance[contact.seen] -= force
        return Residual.of(norm(balance), inclusion, scale, size, rest.size)

    if known is not None:
        found = of(known(u))
        tolerance = controls.atol + controls.rtol * found.scale
        if found.noise <= tolerance and found.total <= tolerance:
            return found
    return of(ForceResidual(problem.load - body.entries @ u, problem.linear.rounding_scale(u, problem.load)))
