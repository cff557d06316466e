"""Semismooth Newton on the graphs of the laws, and its first rounds: primal-dual active sets, without a line search.

With the multiplier ``lam = W^-1 (g - A r)`` in equilibrium with r and ``p = a r + lam``, a pair solves the problem
where it is the one of the graphs of the laws at which p is what it is.  That is ``F(r) = lam(p) - lam = 0`` with the
pair ``r(p), lam(p)`` of :meth:`hemivar.laws.VectorLaw.on_graph`, which is ``a (r - r(p))``.  So it is for every law:
one that splits, one that couples, and one whose bound or mode depends on the state, so that the generalised derivative
is not symmetric.

In an evolution one problem follows another that hardly differs.  p sorts the contact points onto the pieces of their
laws and onto kinks: the active sets.  Newton's equation on these gives the next pair (Hintermueller, Ito and Kunisch
2003).  If the sets do not change any more the pair solves the problem, and its residual, that of the full problem,
proves it.  Where there is one solution it is the one that any other method finds.  Where the sets do not settle in a
few rounds, the method of the march takes over.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from scipy.linalg import lapack

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array
from hemivar.discrete.residual import LoadScale, Residual, balanced
from hemivar.errors import ProblemError
from hemivar.laws import VectorLaw
from hemivar.laws.contact_chart import ContactChart
from hemivar.laws.vector_law import Chart, OnGraph, is_curve, softens, spread
from hemivar.solvers.controls import Controls
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import Status
from hemivar.systems.compiled_rounds import CompiledRounds, compiled_rounds
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.contact_system import ContactSystem
from hemivar.systems.dense_newton import DenseFactor, DenseNewton, newton_matrix
from hemivar.systems.newton_equation import Accuracy, LinearisedPoint, NewtonEquation, smooth_components

__all__ = [
    "FEW_ROUNDS",
    "ROUNDS",
    "SEMISMOOTH",
    "ForceResidual",
    "GraphEquation",
    "GraphPoint",
    "KnownRounds",
    "NewtonCache",
    "active_set_newton",
    "small_and_convex",
    "stands",
]

#: The method where the bound of the law depends on the state.
SEMISMOOTH = "semismooth-newton"
#: Newton's equations that are solved before a search is thought better.
ROUNDS = 6
#: The same of a body that nothing is known of yet, and components of contact points up to which it is tried.
FEW_ROUNDS, _SMALL = 12, 600
#: Part of the tolerance by which the multiplier may miss the law before the other unknowns are looked for.
_PART = 0.5
#: Dense factors need no tolerance.
_DIRECT = Accuracy(0.0, 0.0, 1)


@dataclass(frozen=True, eq=False)
class ForceResidual:
    """What the body leaves of its load, the foundation apart."""

    force: Array  # (n,): ``f - K u``; it belongs to who is given it, and may be changed
    size: float  # norm of the sizes of what was added up in it, or more: rounding is a part of it


@dataclass(frozen=True, eq=False)
class GraphPoint:
    """A point, what is in equilibrium with its contact points, and the pairs of the laws at the same p."""

    x: Array  # of the shape of a point
    r: Array  # (m, d): its local displacements
    lam: Array  # (m, d): the multipliers in equilibrium with it
    on: OnGraph  # the pairs of the laws
    force: Array | None = None  # of the shape of a point: load minus elastic force there, where it is known


@dataclass(frozen=True, eq=False)
class GraphEquation:
    """``F(x) = 0``."""

    system: ContactSystem
    chart: Chart  # of its law
    stiffness: Array  # (m, d): that of the chart
    equation: NewtonEquation

    @classmethod
    def of(cls, system: ContactSystem, alphas: tuple[Array, Array] | None = None) -> Self | None:
        """The equation of a problem; None where its law is no curve beside the body, or has no derivatives.

        The zeros of F are the same whatever the stiffness: that of the body, or for a law of the whole state more.
        So it is for any law whose weak convexity, ``alphas``, the caller knows.
        """
        law, pair, d = system.law, 1.0 / system.compliance, system.active.shape[1]
        above = law.curve_above if law.depends_on_whole_state else alphas
        if above is not None:
            least = [np.broadcast_to(alpha, len(pair)) for alpha in above]
            pair = np.maximum(pair, 1.5 * np.stack(least, axis=1))
        chart = law.chart(pair, d) if is_curve(law, pair, d) else None
        if system.vectors.largest(float(chart is None))[0] or chart is None:
            return None
        return cls(system, chart, spread(pair, d), system.newton_equation())

    def begin(self, r: Array, lam: Array) -> GraphPoint | None:
        """A pair that need not be in equilibrium; None where a number is not finite."""
        p = self.stiffness * r + lam
        return GraphPoint(r, r, lam, self.chart.at(p, r)) if math.isfinite(float(p.sum())) else None

    def at(self, x: Array, force: Array | None = None) -> GraphPoint | None:
        """A point in equilibrium, ``force`` being what is out of balance there; None where the bound has no value."""
        system = self.system
        r, force = system.local(x), system.out_of_balance(x) if force is None else force
        try:
            lam = system.multiplier(x, force)
            on = self.chart.at(self.stiffness * r + lam, r)
        except ProblemError:
            return None
        return GraphPoint(x, r, lam, on, force)

    def missed(self, point: GraphPoint) -> Array:
        """F at a point in equilibrium, (m, d), as forces."""
        system, off = self.system, point.on.multiplier - point.lam
        return np.asarray(system.weights[:, None] * (off if system.active.all() else np.where(system.active, off, 0.0)))

    def step(self, point: GraphPoint, accuracy: Accuracy) -> tuple[Array, Array, int] | None:
        """Where Newton's equation leads, linearised at the pairs of the laws; None where nowhere.

        The point, what is out of balance there, and the cycles.
        """
        system, r = self.system, point.on.r
        if not system.active.all():
            r = np.where(system.active, r, system.fixed)
        first = system.moved(point.x, r)
        if point.force is None:
            force = system.out_of_balance(first)
        else:
            force = point.force - system.multiply_contact(first - point.x)
        at = LinearisedPoint.on_graph(system, first, force, point.on, self.stiffness)
        correction = self.equation.solve(at, accuracy)
        if not correction.convex or correction.negative is not None or not math.isfinite(float(correction.step.sum())):
            return None
        return first + correction.step, force - correction.bent, correction.cycles


@dataclass(eq=False)
class NewtonCache:
    """What is kept of Newton's equations: the chart of the law, and the factor of the equation that was solved last.

    The factor serves as long as the contact points keep their pieces.  Nothing in it changes an answer.  It belongs to
    one march: its memory is used again.
    """

    factor: DenseFactor = field(default_factory=DenseFactor, repr=False)
    _chart: tuple[VectorLaw, Chart | None] | None = field(default=None, repr=False)
    _known: tuple[Chart, Array, CompiledRounds | None] | None = field(default=None, repr=False)

    def equation(self, system: CondensedProblem) -> GraphEquation | None:
        """Newton's equation; None where the law has no chart."""
        law, body, known = system.law, system.body, self._chart
        if known is None or known[0] is not law:
            known = self._chart = law, law.chart(body.pointwise, system.shape[1])
        chart = known[1]
        return None if chart is None else GraphEquation(system, chart, body.per_area, DenseNewton(system, self.factor))

    def compiled(self, system: CondensedProblem, chart: Chart) -> CompiledRounds | None:
        """What makes the rounds in one call, where it can."""
        known = self._known
        if known is None or known[0] is not chart or known[1] is not system.matrix:
            body, rounds = system.body, None
            tables = chart.in_one if isinstance(chart, ContactChart) else None
            if body.everywhere and system.shape[1] < 3 and tables is not None:
                rounds = compiled_rounds(tables[0], system.matrix, system.weights, body.resilience, tables[1])
            known = self._known = chart, system.matrix, rounds
        return known[2]


class KnownRounds:
    """What solves of one body on one foundation keep of their rounds, each :class:`NewtonCache` lent to one thread."""

    def __init__(self) -> None:
        self._free: list[NewtonCache] = []

    @contextmanager
    def lent(self) -> Iterator[NewtonCache]:
        """One that nobody else has."""
        try:
            cache = self._free.pop()
        except IndexError:
            cache = NewtonCache()
        yield cache
        self._free.append(cache)


def small_and_convex(system: CondensedProblem) -> bool:
    """Whether a few rounds cost a fifth of the steps of another method, and find the one solution."""
    if not 0 < system.free.size <= _SMALL:
        return False
    return not softens(system.law)


def active_set_newton(
    system: CondensedProblem,
    r: Array,
    lam: Array,
    controls: Controls,
    cache: NewtonCache,
    out_of_balance: Callable[[Array], ForceResidual] | None = None,
    rounds: int = ROUNDS,
) -> Solution | None:
    """The solution that Newton's equations lead to from a pair, or None where they do not settle at once.

    ``r, lam (m, d)``: local displacements and multiplier of a state nearby; ``cache``: of the same body;
    ``out_of_balance``: what unknowns (n,) leave of the load, if the caller needs the forces of the body anyway.  Where
    that is more than the tolerance, or rounding might be, the stiffness is asked; ``rounds``: Newton's equations that
    are solved at most.
    """
    began = time.perf_counter()
    equation = cache.equation(system)
    if equation is None:
        return None
    start = _Start(equation, r, lam, controls, rounds)
    compiled = cache.compiled(system, equation.chart)
    pairs = _pairs(start) if compiled is None else _compiled_pairs(start, compiled)
    for number, r, of_law in pairs:
        if system.law.state_dependent and not stands(system, r, of_law):  # else it was known to have one solution
            return None
        iterated = time.perf_counter()
        unknowns = system.unknowns(r)
        local = system.problem.contact.trace_of(unknowns) - system.problem.offset
        residual = _residual(system, unknowns, local, of_law, start, compiled, out_of_balance)
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
            vars(solution)["local"] = local  # what the property would find
            return solution
    return None


#: A round and what it found: local displacements and multiplier of the law (m, d).
_Pair = tuple[int, Array, Array]


@dataclass(frozen=True, eq=False)
class _Start:
    """Where the rounds begin, and when they have settled."""

    equation: GraphEquation
    r: Array
    lam: Array
    controls: Controls
    rounds: int

    @property
    def system(self) -> CondensedProblem:
        system = self.equation.system
        assert isinstance(system, CondensedProblem)
        return system

    @property
    def load(self) -> float:
        """Size of the load."""
        return self.system.problem.loading.load_size

    def close(self, missed: float, force: float) -> bool:
        """Whether multipliers of body and law are as near as is asked, those of the law being a force of this size."""
        controls = self.controls
        allowed = _PART * (controls.atol + controls.rtol * self.load)
        if missed > allowed:
            scale = _load_scale(self.system, self.equation.chart, self.load, force).of(force)
            allowed = _PART * (controls.atol + controls.rtol * scale)
        return missed <= allowed


def _compiled_pairs(start: _Start, compiled: CompiledRounds) -> Iterator[_Pair]:
    """What :func:`_pairs` finds, by the compiled kernels."""
    r, lam, number = start.r, start.lam, 0
    atol, rtol = _PART * start.controls.atol, _PART * start.controls.rtol
    while number < start.rounds:
        rounds = compiled.run(start.system.load, r, lam, start.rounds - number, atol, rtol, start.load)
        if rounds is None or not rounds.settled:
            return
        r, lam, number = rounds.r, rounds.lam, number + rounds.count
        if start.close(rounds.missed, rounds.force):
            yield number, r, rounds.of_law


def _pairs(start: _Start) -> Iterator[_Pair]:
    """The pairs at which rounds have settled: whoever asks for another was not content with the last."""
    equation, system = start.equation, start.system
    whole = system.body.everywhere
    r = start.r if whole else np.where(system.active, start.r, system.fixed)
    point = equation.begin(r, start.lam)
    for number in range(1, start.rounds + 1):
        step = None if point is None else equation.step(point, _DIRECT)
        point = None if step is None else equation.at(*step[:2])
        if point is None:
            return
        missed, of_law = norm(equation.missed(point)), point.on.multiplier
        if not whole:
            of_law = np.where(system.active, of_law, point.lam)
        if not math.isfinite(missed):
            return
        if start.close(missed, norm(system.weights[:, None] * of_law)):
            yield number, point.x, of_law


def stands(system: CondensedProblem, r: Array, lam: Array) -> bool:
    """Whether a law that softens leaves a pair stable, a state that it depends on being frozen."""
    law = system.law
    if not softens(law):
        return True
    line = law.frozen(r, lam).linearise(r)
    index = np.flatnonzero(smooth_components(line, system.active))
    H = newton_matrix(system, index, line.hessian)
    return not index.size or not lapack.dpotrf(H, lower=1)[1]


def _load_scale(system: CondensedProblem, chart: Chart, load: float, contact_force: float) -> LoadScale:
    """What residuals are held against: :attr:`CondensedProblem.load_scale`, by the chart of the law.

    What the foundation does at rest is not looked for where the load is larger than the force that it exerts.
    """
    if contact_force <= load:
        return LoadScale(load, math.inf)
    if "load_scale" in vars(system):
        return system.load_scale
    offset, ends = system.problem.offset, chart.law.penetrations
    inside = -offset
    inside[:, 0] = np.minimum(np.maximum(inside[:, 0], ends.lower), ends.upper)
    lam = chart.least_multiplier(inside)
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
        inclusion = norm(weights * start.equation.chart.graph_distance(r, lam, body.resilience))
    else:
        inclusion = compiled.distance(r, lam)
    scale = _load_scale(system, start.equation.chart, start.load, size)

    def of(rest: ForceResidual) -> Residual:
        balance = rest.force
        balance[contact.seen] -= force
        return Residual.of(norm(balance), inclusion, scale, size, rest.size)

    if known is not None:
        residual = of(known(u))
        tolerance = controls.atol + controls.rtol * residual.scale
        if residual.noise <= tolerance and residual.total <= tolerance:
            return residual
    return of(ForceResidual(*balanced(problem, u, body.entries)))
