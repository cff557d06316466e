"""How far a computed displacement is from every solution of the continuous problem, in the energy norm.

With an admissible stress s (:mod:`hemivar.bounds.admissible_stress`), its force ``xi = -s nu`` on the
contact boundary, a zeta that the law allows at the computed displacement, and ``|v|_a^2 = int C eps(v) : eps(v)``:

    eta = |s - C eps(u)|_{C^-1},    |<xi - zeta, v>| <= rho |v|_a,    c >= sup int alpha |v|^2 / a(v, v),

every solution lies within ``(eta + rho) / (1 - c)`` if zeta is in dj(r(u)) everywhere; c then needs the one-sided
constant at u alone. For weakly convex laws zeta may leave dj at the price of the gap G of Fenchel's inequality:

    [eta + rho + sqrt((eta + rho)^2 + 4 (1 - c) G)] / (2 (1 - c)).

For a material with a stored energy W the same holds in the norm of its lower tensor C_low, with
``eta^2 = 2 int W(eps(u)) + W*(s) - s : eps(u)`` (:mod:`hemivar.bounds.bulk_gap`).

Each part, normal and tangential, of each facet may do either; c and G then take of each what belongs to its choice.
On flat cells a displacement w on better ones is bounded, and ``|u - u_h|_a <= |u - w|_a + |w - u_h|_a``: meshes are
nested, so that the second is known.  It, or what bubbles of edges show of the error, tells what the bound is over that.

Proofs are in docs/theory/bounds.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import ROUNDED
from hemivar.basics.deadline import OutOfTime
from hemivar.basics.display import brief
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.bare_body import has_constant_normals
from hemivar.bounds.body_data import BodyData, body_data, exact_loads
from hemivar.bounds.conjugate_sweeps import Sweeps, unresolved
from hemivar.bounds.contact_traces import (
    ContactTraces,
    admissible_displacement,
    beyond_domain,
    contact_traces,
)
from hemivar.bounds.convex_distance import BareStiffness, balanced_stress, not_convex
from hemivar.bounds.fenchel import FenchelGap, exact_gap, fenchel_gap, following, one_sided_constants
from hemivar.bounds.flat_cells import are_flat, bettered
from hemivar.bounds.hypotheses import (
    check_supports,
    fixed_gaps,
    inexact_data,
    stated_conditions,
    unmet_hypotheses,
)
from hemivar.bounds.joined_sides import joined_sides, touch
from hemivar.bounds.low_mode import SoftModes, confined_error
from hemivar.bounds.lower_bounds import ATTAINED
from hemivar.bounds.oscillation import Oscillation, linear_square, oscillation
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.sweeps import ContactPenalty, PatchSmoother
from hemivar.bounds.touching_bodies import contact_moments, shared_anew, touching_bodies
from hemivar.bounds.trace_bounds import TraceBounds
from hemivar.bounds.vertex_moments import shared_on_contact
from hemivar.errors import MethodError, ProblemError
from hemivar.fem.transfer import interpolate
from hemivar.laws import VectorLaw
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers import solve
from hemivar.systems.workspace import Workspace

__all__ = ["DistanceParts", "ExactDistance", "exact_distance"]

#: Why the distance of bodies that touch is no bound.
_APART = (
    "the facets of bodies that touch do not coincide: the contact tractions of the mesh load each part, and the "
    "law between contact points is not included"
)
#: Softening c from which the softest mode is looked at by itself.
_SOFT = 0.15
#: Weights of the gap, over Lambda, among which the best is looked for, as powers of ten: the second comes first.
_POWERS = (-5.0, -2.0, 1.0)
#: Largest price of contact tractions, over 1 / Lambda.
_DEAREST = 30.0
#: Least part of that price where the multiplier follows the force.
_LEAST = 0.05
#: What the discrete problem misses of loads, over the misfit, from which it is answered by a displacement.
_MISSED = 0.1
#: What may become of an attempt.
_IN_VAIN = (MethodError, ProblemError, OutOfTime, MemoryError, np.linalg.LinAlgError, ArithmeticError, RuntimeError)
#: How many times the error a bound on flat cells may be, and the meshes that are tried otherwise.
_ENOUGH, _MESHES = 8.0, 12


@dataclass(frozen=True)
class DistanceParts:
    """What a bound is made of, in the energy norm (square roots of work) but for the gap, which is work.

    Attributes
    ----------
    misfit : float
        eta, without the oscillation.
    contact : float
        rho.
    gap : float
        G.
    oscillation : float
        What the loads add to eta that no linear field on a cell or facet sees, and what the discrete problem, which
        integrates them by a rule, misses of them.
    algebraic : float
        What the displacement lacks for equilibrium in the discrete space: rounding, or an unfinished solve.
    correction : float
        ``|w|_a`` of the w that brings a trace back into the domain of a rigid law between nodes, and nodes where
        supports hold them; the other parts are those of ``u_h + w``.
    """

    misfit: float
    contact: float
    gap: float
    oscillation: float
    algebraic: float
    correction: float = 0.0


@dataclass(frozen=True, eq=False)
class ExactDistance:
    """A bound of the distance to every solution of the continuous problem, or an estimate of it.

    Attributes
    ----------
    distance : float
        Of ``|u - u_h|_a``; inf where there is none.
    energy_norm : float
        ``|u_h|_a``, the prescribed displacements included.
    parts : DistanceParts
    constant : float
        c.
    theorem : int
        2 if the multiplier is one of the law everywhere, 1 if the gap takes part.
    guaranteed : bool
        Whether it is a bound, up to rounding and the rules of integration; an estimate otherwise.
    reasons : tuple of str
        Why it is an estimate, or why there is none; one sentence each.
    stress : AdmissibleStress
    cells : array, shape (M,)
        ``eta_T^2``, the oscillation included.
    missed : array, shape (M,)
        Squares of what the discrete problem misses of the loads, as loads of any shape.
    facets : int array, shape (k, d)
        Contact facets by their nodes.
    facet_contact, facet_gap : arrays, shape (k,)
        ``|xi - zeta|^2`` and G of each of them.
    conditions : tuple of str
        Those under which it is a bound, and all that stands between, one sentence each; empty if it is one, or if there
        are other reasons.
    unique : bool
        Whether the continuous problem is shown to have exactly one solution: c is below one, too, with the weak
        convexity constants of the normal and of the tangential law everywhere, and the distance is guaranteed; or laws
        are convex, and solutions differ by no rigid motion.
    unseen : str
        The rigid motions that supports leave to a body, in words: the seminorm does not see them.
    loose : str
        Those by which the solutions of a convex problem may differ.
    above : float
        How many times the error the bound may be, about, where cells are flat; 0 where they are not.
    """

    distance: float
    energy_norm: float
    parts: DistanceParts
    constant: float
    theorem: int
    guaranteed: bool
    reasons: tuple[str, ...]
    stress: AdmissibleStress
    cells: Array
    missed: Array
    facets: IntArray
    facet_contact: Array
    facet_gap: Array
    conditions: tuple[str, ...] = ()
    unique: bool = False
    unseen: str = ""
    loose: str = ""
    above: float = 0.0

    __repr__ = brief

    def added(self, constants: TraceBounds) -> Array:
        """What each cell adds, its contact facets included, (M,)."""
        shares, table = self.cells + self.missed, self.stress.data.table
        if len(self.facets):
            owner = table.owners[table.numbers(self.facets), 0]
            known = 0.0 < constants.both < np.inf
            np.add.at(shares, owner, self.facet_gap + (self.facet_contact / constants.both if known else 0.0))
        return shares

    @property
    def relative(self) -> float:
        """The distance over ``|u_h|_a``; 0 where both are."""
        return self.over_norm(self.distance)

    @property
    def why(self) -> str:
        """The reasons in one line."""
        return "; ".join(self.reasons)

    def over_norm(self, size: float) -> float:
        """A size in the energy norm over ``|u_h|_a``; 0 where both are, inf where the latter alone is."""
        if self.energy_norm > 0.0:
            return size / self.energy_norm
        return 0.0 if size == 0.0 else np.inf


def exact_distance(
    problem: ContactProblem,
    displacement: Array,
    constants: TraceBounds,
    *,
    sweeps: tuple[PatchKind, ...] | None = None,
    workspace: Workspace | None = None,
) -> ExactDistance:
    """Bound the distance of a displacement to every solution of the continuous problem.

    Parameters
    ----------
    problem : ContactProblem
        With linear elements, or quadratic ones in the plane.
    displacement : array, shape (nodes, d)
        That of a solution of the discrete problem, or any other that fulfils the supports.
    constants : TraceBounds
        Of the body.
    sweeps : tuple of PatchKind, optional
        By which the stress is improved. By default one over vertices, in space over edges, with quadratic elements two;
        where they leave much of the misfit more, by conjugate gradients.
    workspace : Workspace, optional
        Keeps what belongs to mesh and material: facets, and the order of the patches.

    Returns
    -------
    ExactDistance

    Raises
    ------
    ProblemError
        As :func:`hemivar.bounds.body_data.body_data`,
        :func:`hemivar.bounds.vertex_moments.equilibrated` and
        :func:`hemivar.bounds.hypotheses.unmet_hypotheses`.
    """
    unmet = unmet_hypotheses(problem, displacement)
    expect(constants, TraceBounds, "constants", "give those of guaranteed_trace_bounds(hemivar.discretize(problem))")
    for kind in () if sweeps is None else expect(sweeps, tuple, "sweeps", "give a tuple such as (PatchKind.VERTEX,)"):
        expect(kind, PatchKind, "a sweep", f"choose among {', '.join(str(one) for one in PatchKind)}")
    chosen = Sweeps.usual(problem.mesh.dim, problem.order) if sweeps is None else Sweeps(sweeps)
    if touch(problem) and joined_sides(problem) is None:
        distance = _of_touching_bodies(problem, displacement, chosen, [*unmet, _APART])
    else:
        distance = _of_body(problem, displacement, constants, chosen, unmet, workspace)
        if touch(problem) and not distance.distance < np.inf:
            why = [reason.removeprefix("there is no bound: ") for reason in distance.reasons]
            distance = _of_touching_bodies(problem, displacement, chosen, why)
    return distance if sweeps is not None else _by_better_cells(problem, displacement, constants, chosen, distance)


def _by_better_cells(
    problem: ContactProblem, displacement: Array, constants: TraceBounds, sweeps: Sweeps, distance: ExactDistance
) -> ExactDistance:
    """The least bound by way of displacements on better cells, where those of the mesh are flat; else that in hand.

    What it says of cells and facets stays that of the mesh of the displacement.
    """
    data = distance.stress.data
    flat, wanted = are_flat(data.table)
    if not distance.distance < np.inf or not flat:
        return distance
    seen = unresolved(data) if data.order == 1 else 0.0
    best, finer, added = distance, distance, distance.added(constants)
    for _ in range(_MESHES if wanted and not touch(problem) else 0):  # cut alike on both sides they would stay one
        if best.distance <= _ENOUGH * seen:
            break
        try:
            other = _on_better_cells(problem, displacement, constants, sweeps, finer, added)
        except _IN_VAIN:
            break
        if other is None:
            break
        finer, apart = other
        added, seen = finer.added(constants), max(seen, apart)
        if finer.guaranteed >= best.guaranteed and finer.distance + apart < best.distance:
            best = _by_way_of(distance, finer, apart)
    return replace(best, above=best.distance / seen if seen > 0.0 else 0.0)


def _on_better_cells(
    problem: ContactProblem,
    displacement: Array,
    constants: TraceBounds,
    sweeps: Sweeps,
    distance: ExactDistance,
    added: Array,
) -> tuple[ExactDistance, float] | None:
    """The bound of the solution on better cells, and how far that is from a displacement; None without such cells."""
    mesh = bettered(distance.stress.data.table, added)
    if mesh is None:
        return None
    other = replace(problem, mesh=mesh)
    solution = solve(other)
    field, w = solution.problem.field, solution.displacement
    assert field is not None
    finer = _of_body(other, w, constants, sweeps, unmet_hypotheses(other, w), None)
    change = w - interpolate(problem.mesh, displacement, field)
    return finer, float(np.sqrt(finer.stress.data.moved(change).energy))


def _by_way_of(distance: ExactDistance, finer: ExactDistance, apart: float) -> ExactDistance:
    """A bound by another displacement so far away; what belongs to cells and facets stays."""
    own = ("energy_norm", "stress", "cells", "missed", "facets", "facet_contact", "facet_gap")
    parts = replace(finer.parts, correction=finer.parts.correction + apart)
    kept = {name: getattr(distance, name) for name in own}
    return replace(finer, distance=finer.distance + apart, parts=parts, **kept)


def _of_body(
    problem: ContactProblem,
    displacement: Array,
    constants: TraceBounds,
    sweeps: Sweeps,
    unmet: list[str],
    workspace: Workspace | None,
) -> ExactDistance:
    """The bound for bodies on foundations, and for those that touch along facets that coincide."""
    data = body_data(problem, displacement, workspace)
    inside = admissible_displacement(data.at(check_supports(problem, data.displacement)))
    moved = data.at(inside)
    traces = contact_traces(moved)
    known = constants.guaranteed and constants.both > 0.0 and fixed_gaps(problem)

    def by_constants() -> ExactDistance:
        bound = _bound(improved_stress(data, traces, constants, sweeps, moved), data, traces, constants, unmet)
        if not bound.missed.sum() > (_MISSED * bound.parts.misfit) ** 2:
            return bound
        better = _bettered(bound, lambda: _with_exact_loads(data, moved, traces, constants, sweeps, unmet))
        return replace(better, missed=bound.missed)  # cells are marked by what is missed in them all the same

    bound = by_constants() if known else None
    # a contact part of half the misfit is worth a look at a convex law without constants of the body
    poor = bound is None or bound.parts.contact > 0.5 * bound.parts.misfit
    if traces is None or not poor or not_convex(problem):
        return by_constants() if bound is None else bound
    if bound is None:
        return _without_constants(data, traces, constants, sweeps, unmet) or by_constants()
    return _bettered(bound, lambda: _without_constants(data, traces, constants, sweeps, unmet))


def _bettered(bound: ExactDistance, attempt: Callable[[], ExactDistance | None]) -> ExactDistance:
    """The better of what is in hand and of an attempt, whatever becomes of this: a bound before an estimate."""
    try:
        other = attempt()
    except _IN_VAIN:
        return bound

    def rank(one: ExactDistance) -> tuple[bool, bool, bool, float]:
        return not one.distance < np.inf, not (one.guaranteed or one.conditions), not one.guaranteed, one.distance

    return bound if other is None or rank(bound) <= rank(other) else other


def _without_constants(
    data: BodyData, traces: ContactTraces, constants: TraceBounds, sweeps: Sweeps, unmet: list[str]
) -> ExactDistance | None:
    """The bound for convex laws, without a constant of the body; None where contact does not balance the loads."""
    inside = exact_loads(traces.data)
    balanced = balanced_stress(inside, replace(traces, data=inside), sweeps)
    if balanced is None:
        return None
    stress, table = balanced.stress, data.table
    outside, conditions = stated_conditions(inside, traces)
    reasons = unmet + inexact_data(data, formulas=True) + outside
    if (beyond := beyond_domain(traces)) > 0.0:
        reasons.append(_left_domain(beyond))
    rest = oscillation(stress, constants.body)
    cells = _cells(stress.misfit, replace(rest, cells=rest.cells + balanced.missed))
    eta, whole, missed = (float(np.sqrt(part.sum())) for part in (stress.misfit, cells, rest.missed))
    gap, correction = float(balanced.gap.sum()), _correction(inside, data)
    value = _value(whole + missed + balanced.algebraic, gap, 0.0)
    if not value < np.inf:
        reasons.append("there is no bound: loads that are not known exactly move a body constrained by contact only")
    parts = DistanceParts(eta, 0.0, gap, max(whole - eta, 0.0) + missed, balanced.algebraic, correction)
    proved = not (reasons or conditions)
    return ExactDistance(
        value + correction, float(np.sqrt(data.energy)), parts, 0.0, 1, proved, (*reasons, *conditions), stress, cells,
        rest.missed, table.facets[traces.facets], np.zeros(len(traces.facets)), balanced.gap,
        tuple(conditions) if not reasons else (), proved and not balanced.loose, balanced.unseen, balanced.loose,
    )  # fmt: skip


def _with_exact_loads(
    data: BodyData,
    moved: BodyData,
    traces: ContactTraces | None,
    constants: TraceBounds,
    sweeps: Sweeps,
    unmet: list[str],
) -> ExactDistance:
    """The bound by a stress that balances ``u_h + w``, where w answers the loads that the discrete problem misses.

    Nodes are in equilibrium there with the loads that were stated, and in contact nothing changes. The misfit grows by
    what w does; else such loads would count as any loads of their size do.
    """
    w = BareStiffness(data).solve(data.varying.missed)
    exact = exact_loads(data)
    seen = None if traces is None else replace(traces, data=exact_loads(traces.data))
    stress = improved_stress(exact.moved(data.displacement + w), seen, constants, sweeps, exact_loads(moved))
    return _bound(stress, data, seen, constants, unmet)


def _correction(inside: BodyData, data: BodyData) -> float:
    """``|w|_a`` of the w that brings a displacement into the domain of the law, and where supports hold it."""
    if inside.displacement is data.displacement:
        return 0.0
    change = inside.displacement - data.displacement
    return float(np.sqrt(max(np.sum((inside.forces - data.forces) * change[data.cell_nodes]), 0.0)))


def _left_domain(beyond: float) -> str:
    return f"the displacement leaves the domain of the law by {beyond:.3g}, which the bound does not include"


def _of_touching_bodies(
    problem: ContactProblem, displacement: Array, sweeps: Sweeps, unmet: list[str]
) -> ExactDistance:
    """An estimate: each part under its own contact tractions, and the c of the mesh."""
    data, c = touching_bodies(problem, displacement)
    constants = TraceBounds(np.inf, np.inf, np.inf, np.inf, True, "")
    distance = _bound(improved_stress(data, None, constants, sweeps), data, None, constants, unmet)
    if c < 1.0:
        return replace(distance, distance=distance.distance / (1.0 - c), constant=c)
    reason = f"there is no estimate: the foundation softens too much for the bodies (c = {c:.3g} on this mesh)"
    return replace(distance, distance=np.inf, constant=c, reasons=(*distance.reasons, reason))


def improved_stress(
    data: BodyData,
    traces: ContactTraces | None,
    constants: TraceBounds,
    sweeps: Sweeps,
    wanted: BodyData | None = None,
) -> AdmissibleStress:
    """An admissible stress, its contact tractions near to what the law allows, after sweeps over patches.

    It balances the forces of ``data`` and comes near to the stress of the displacement of the traces; without traces to
    that of ``wanted``.
    """
    stress = _first_stress(data, traces, constants)
    if traces is None and wanted is not None:
        stress = replace(stress, data=wanted)
    if not sweeps.kinds:
        return stress
    sweeper = sweeps.sweeper(stress)
    del stress  # what has been computed of it is large, and of no use any more
    if traces is not None and data.order == 2:
        for _ in range(2):  # over the patches at the contact boundary alone, before all of them
            sweeper.sweep(PatchKind.VERTEX, _price(sweeper, traces, constants), only_contact=True)
    return sweeps.lower(sweeper, None if traces is None else lambda: _price(sweeper, traces, constants))


def _first_stress(data: BodyData, traces: ContactTraces | None, constants: TraceBounds) -> AdmissibleStress:
    """Before any sweep."""
    joined = bool(data.table.cut.any())
    own = contact_moments(data) if joined else None
    if traces is None:
        return admissible_stress(data) if own is None else replace(admissible_stress(data.under(own)), data=data)
    shared = shared_on_contact(data, own)
    pressures = traces.on_facets(-traces.moments(_first_multiplier(data, traces, constants, shared)))
    if own is not None:
        return replace(admissible_stress(data.under(shared_anew(data, own, pressures))), data=traces.data)
    return replace(admissible_stress(data, pressures), data=traces.data)


def _first_multiplier(data: BodyData, traces: ContactTraces, constants: TraceBounds, shared: Array) -> Array:
    """Near to the interpolated multiplier: in dj(r), or where quadratic traces overshoot in the domain of j*."""
    between = traces.interpolated(shared)
    if data.order == 1 or not _weakly_convex(traces) or not 0.0 < constants.both < np.inf:
        return exact_gap(traces, between).multiplier
    return fenchel_gap(traces, between, 10.0 ** _POWERS[1] * constants.both).multiplier


def _weakly_convex(traces: ContactTraces) -> bool:
    return all(bool(np.isfinite(alpha).all()) for alpha in traces.law.weak_convexity)


def _price(sweeper: PatchSmoother, traces: ContactTraces, constants: TraceBounds) -> ContactPenalty | None:
    """The price ``max(1, eta / rho) / Lambda``: with it a sum of squares falls where ``eta + rho`` does."""
    if not 0.0 < constants.both < np.inf:
        return None
    traces = traces.rough
    forces = _without_rounding(traces.forces(sweeper.moments), sweeper)
    eta = float(np.sqrt(sweeper.misfit))
    best = _chosen(traces, sweeper.moments, replace(constants, weighted=None), eta)

    def multiplier(forces: Array) -> Array:
        return _multiplier(traces, forces, best.weight, best.paying)

    wanted = multiplier(forces)
    mass = traces.mass(np.maximum(1.0 - following(forces, multiplier), _LEAST))
    rho = np.sqrt(sum(part.sum() for part in traces.square(forces - wanted)) / constants.both)
    ratio = min(max(1.0, eta / rho), _DEAREST) if rho > 0.0 else _DEAREST
    price = float(ratio / constants.both)
    return ContactPenalty(traces.facets, traces.moments(wanted), price, mass, sweeper.moments[traces.facets])


def _without_rounding(forces: Array, sweeper: PatchSmoother) -> Array:
    """Forces without those that are rounding: on which side of zero they are would decide which multipliers follow."""
    measures, moments = sweeper.data.table.measures, sweeper.moments
    sizes = np.maximum(moments.max(axis=(1, 2)), -moments.min(axis=(1, 2)))
    largest = (sizes / measures).max(initial=0.0)
    return np.where(np.abs(forces) <= ROUNDED * largest, 0.0, forces)


def _multiplier(
    traces: ContactTraces, forces: Array, weight: float | None, paying: tuple[BoolArray, BoolArray]
) -> Array:
    """zeta (k, q, d) for forces (k, q, d), as :class:`_Choice` describes it."""
    if weight is None:
        return exact_gap(traces, forces).multiplier
    gap = fenchel_gap(traces, forces, weight)
    if paying[0].all() and paying[1].all():
        return gap.multiplier
    return gap.only(paying, traces, forces, exact_gap(traces, forces).multiplier).multiplier


def _best_gap(
    traces: ContactTraces,
    moments: Array,
    forces: Array,
    exact: Array,
    paying: tuple[BoolArray, BoolArray],
    constants: TraceBounds,
    base: float,
    c: float,
    fine: bool,
) -> tuple[float, FenchelGap]:
    """The least bound over the weights of the gap, and the gap of the best one; a ``fine`` one is worth more looks."""

    def of(power: float, at: ContactTraces, forces: Array, exact: Array) -> tuple[float, FenchelGap]:
        gap = fenchel_gap(at, forces, 10.0**power * constants.both).only(paying, at, forces, exact)
        rho = constants.distance(*at.with_unseen(gap.normal, gap.tangential))
        return _value(base + rho, float(gap.normal_gap.sum() + gap.tangential_gap.sum()), c), gap

    rough = traces.rough
    seen = (traces, forces, exact)
    if rough is not traces:
        there = rough.forces(moments)
        seen = (rough, there, exact_gap(rough, there).multiplier)
    lowest, start, highest = _POWERS
    tried = {start: of(start, *seen)}
    best = start
    for step in (1.0, 0.5, 0.25) if fine else (1.0,):
        moved = True
        while moved:  # on to the next one as long as it is better
            beside = (power for power in (best - step, best + step) if lowest <= power <= highest)
            tried |= {power: of(power, *seen) for power in beside if power not in tried}
            now = min(tried, key=lambda power: tried[power][0])
            moved, best = now != best and step == 1.0, now
    return tried[best] if rough is traces else of(best, traces, forces, exact)


def _bound(
    stress: AdmissibleStress,
    data: BodyData,
    traces: ContactTraces | None,
    constants: TraceBounds,
    unmet: list[str],
) -> ExactDistance:
    table = data.table
    correction = _correction(stress.data, data)
    unknown = constants.both > 0.0 and not constants.guaranteed
    reasons = [f"the constants of the body are {constants.source}"] if unknown else []
    reasons += unmet + inexact_data(data)
    outside, conditions = stated_conditions(stress.data, traces)
    reasons += outside
    conditions += constants.conditions if traces is not None else ()
    rest = oscillation(stress, constants.body)
    eta, direct = float(np.sqrt(stress.misfit.sum())), float(np.sqrt(_cells(stress.square, rest).sum()))
    # Fenchel's inequality holds for the whole body and not on each cell, so that the oscillation comes beside it
    eta_all = direct if data.stored is None else min(direct, eta + float(np.linalg.norm(rest.cells)))
    missed = float(np.sqrt(rest.missed.sum()))
    algebraic = _algebraic(stress, constants)
    base = eta_all + missed + algebraic

    count = 0 if traces is None else len(traces.facets)
    nodes = table.facets[np.zeros(0, dtype=np.int64) if traces is None else traces.facets]
    none = np.zeros(count, dtype=bool)
    choice = _Choice(
        base, 0.0, 0.0, 2, np.zeros(count), np.zeros(count), (np.zeros(count), np.zeros(count)), (none, none)
    )
    wrong = ""
    if traces is not None:
        if traces.beyond > 0.0:
            reasons.append(_left_domain(traces.beyond))
        reasons += _doubts(traces, constants)
        modes = SoftModes(traces)
        choice = _chosen(traces, stress.tractions.moments, constants, base, modes, direct - eta_all)
        if constants.guaranteed and any(part.any() for part in choice.alpha) and choice.value < np.inf:
            wrong = _contradiction(choice, modes)
            choice = replace(choice, value=np.inf) if wrong else choice
        if choice.falls and not choice.value < np.inf:
            reasons.append(
                f"the displacement passes a downward jump of the law on {choice.falls} contact facets, where no "
                "constant of the law is finite"
            )
    if wrong:
        reasons.append(wrong)
    elif not choice.value < np.inf and (traces is None or _coupling(traces, constants) < np.inf):
        reasons.append(f"there is no bound: {_cause(choice, constants, traces)}")
    parts = DistanceParts(
        eta, choice.contact, float(choice.facet_gap.sum()), max(eta_all - eta, 0.0) + missed, algebraic, correction
    )
    return ExactDistance(
        choice.value + correction, float(np.sqrt(data.energy)), parts, choice.constant, choice.theorem,
        not (reasons or conditions), (*reasons, *conditions), stress, _cells(stress.misfit, rest), rest.missed, nodes,
        choice.facet_contact, choice.facet_gap, tuple(conditions) if not reasons else (),
        not (reasons or conditions) and (traces is None or _whole_constant(traces, constants) < 1.0),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Choice:
    """The bound of one choice of zeta: value, c, rho, theorem, what facets add, alpha on them, the weight of the gap.

    ``paying`` are the normal and the tangential parts (k,) whose zeta leaves dj(r) at the price of a gap.

    ``falls`` counts the facets on which the displacement passes a downward jump of the law.
    """

    value: float
    constant: float
    contact: float
    theorem: int
    facet_contact: Array
    facet_gap: Array
    alpha: tuple[Array, Array]
    paying: tuple[BoolArray, BoolArray]
    weight: float | None = None
    falls: int = 0


def _cells(misfit: Array, rest: Oscillation) -> Array:
    misfit = np.maximum(misfit, 0.0)
    return np.where(rest.cells > 0.0, (np.sqrt(misfit) + rest.cells) ** 2, misfit)  # not even rounding without any


def _algebraic(stress: AdmissibleStress, constants: TraceBounds) -> float:
    """``|g| / sqrt(Lambda)`` over the body, g the linear field on each cell with the moments of the defect."""
    defect = stress.tractions.defect - stress.tractions.missed
    if not defect.any():
        return 0.0
    square = float(linear_square(stress.data, defect).sum())
    return float(np.sqrt(square / constants.body)) if constants.body > 0.0 else np.inf


def _doubts(traces: ContactTraces, constants: TraceBounds) -> list[str]:
    """What of the law is not known."""
    law, coupling, doubts = traces.law, _coupling(traces, constants), []
    if coupling == np.inf and not np.isinf(traces.coupling()).any():
        doubts.append("only contact constrains the body, and its law depends on the solution: there is no bound")
    elif coupling == np.inf:
        doubts.append(
            "the tractions of the law jump with the mode: there is no bound"
            if traces.stated.depends_on_whole_state
            else "the friction bound depends on the pressure, or jumps with the penetration: there is no bound"
        )
    known = law.proof("alpha")
    if min(known.reach) == 0.0:
        doubts.append(f"a constant of the law is {known.doubt}")
    if not traces.stated.proof("lipschitz").sure:
        doubts.append(f"how {_what_depends(traces.stated)} is known from samples only")
    elif traces.rule is not None and traces.stated.state_dependent and coupling < np.inf:
        doubts.append(f"how {_what_depends(traces.stated)} is evaluated at quadrature points only")
    return doubts


def _what_depends(law: VectorLaw) -> str:
    """What depends on the state, in words."""
    if law.depends_on_whole_state:
        return "the tractions of the law depend on the mode"
    return "the friction bound depends on the penetration"


def _chosen(
    traces: ContactTraces,
    moments: Array,
    constants: TraceBounds,
    base: float,
    modes: SoftModes | None = None,
    apart: float = 0.0,
) -> _Choice:
    """The best of both theorems and of their mixtures; without modes a quick look.

    What is split into the softest mode and the rest is a linear functional, whose norm takes ``apart`` beside ``base``.
    """
    table, coupling = traces.data.table, _coupling(traces, constants)
    corners = table.mesh.points[table.facets[traces.facets]]
    forces = traces.forces(moments)
    nearest = exact_gap(traces, forces)
    exact = nearest.multiplier
    near = tuple(part.max(axis=1) for part in one_sided_constants(traces, exact))
    convex = _convexity(traces)

    def constant(paying: tuple[BoolArray, BoolArray]) -> tuple[float, tuple[Array, Array]]:
        alpha = _softening(traces, *(np.where(*part) for part in zip(paying, convex, near, strict=True)))
        return constants.softening(corners, *alpha) + coupling, alpha

    def confined(alpha: tuple[Array, Array], c: float, total: float, zeta: Array, gap: float) -> float:
        if modes is None or constants.weighted is None or traces.data.problem.order > 1 or not _SOFT < c < np.inf:
            return np.inf
        first, second = constants.weighted(corners, *alpha)
        if not (second < first and first + coupling < 1.0):
            return np.inf
        mode = modes.softest(*alpha)
        return confined_error(total + apart, modes.seen(mode, zeta), mode.theta, first, second, coupling, gap)

    none = np.zeros(len(traces.facets), dtype=bool)
    rho = constants.distance(*traces.with_unseen(nearest.normal, nearest.tangential))
    paid = nearest.normal_gap + nearest.tangential_gap
    c, alpha = constant((none, none))
    gap_of_all = float(paid.sum())
    value = min(_value(base + rho, gap_of_all, c), confined(alpha, c, base + rho, exact, gap_of_all))
    theorem = 2 if traces.rule is None else 1
    best = _Choice(value, c, rho, theorem, nearest.normal + nearest.tangential, paid, alpha, (none, none))

    # A part pays where that costs no c, or wherever it can.
    finite = tuple(np.isfinite(part) for part in convex)
    free = tuple(part & (whole <= one) for part, whole, one in zip(finite, convex, near, strict=True))
    choices = [free] if all(map(np.array_equal, free, finite)) else [free, finite]
    for paying in choices if 0.0 < constants.both < np.inf else ():
        c, alpha = constant(paying)
        if not c < 1.0 or not (paying[0].any() or paying[1].any()):
            continue
        value, gap = _best_gap(traces, moments, forces, exact, paying, constants, base, c, modes is not None)
        rho = constants.distance(*traces.with_unseen(gap.normal, gap.tangential))
        paid = gap.normal_gap + gap.tangential_gap
        value = min(value, confined(alpha, c, base + rho, gap.multiplier, float(paid.sum())))
        if value < best.value:
            best = _Choice(value, c, rho, 1, gap.normal + gap.tangential, paid, alpha, paying, gap.weight)
    return replace(best, falls=int((np.isinf(near[0]) | np.isinf(near[1])).sum()))


def _convexity(traces: ContactTraces) -> tuple[Array, Array]:
    """The largest weak convexity constants of the normal and of the tangential law on the contact facets, (k,) each."""
    parts = (np.broadcast_to(part, traces.weights.size) for part in traces.law.weak_convexity)
    normal, tangential = (part.reshape(traces.weights.shape).max(axis=1) for part in parts)
    return normal, tangential


def _whole_constant(traces: ContactTraces, constants: TraceBounds) -> float:
    """c for any two displacements, whatever the multiplier at one of them."""
    corners = traces.data.table.mesh.points[traces.data.table.facets[traces.facets]]
    return constants.softening(corners, *_softening(traces, *_convexity(traces))) + _coupling(traces, constants)


def _contradiction(choice: _Choice, modes: SoftModes) -> str:
    """Why c is too small, where a displacement of the mesh shows a larger one; empty where none does.

    Linear elements are among the displacements of the body, and the integrals are exact, so a right c is not below.
    """
    shown = modes.softest(*choice.alpha).theta
    if not shown > choice.constant * (1.0 + ATTAINED):
        return ""
    return (
        f"there is no bound: the constants of the body make c = {choice.constant:.3g}, and a displacement of the mesh "
        f"shows {shown:.3g}; so they are wrong: please report it"
    )


def _cause(choice: _Choice, constants: TraceBounds, traces: ContactTraces | None) -> str:
    """Why no value of the bound is finite: the law, or the constants of the body."""
    if traces is None or not constants.both > 0.0:
        why = "" if traces is None else not_convex(traces.data.problem)
        return f"only contact constrains the body, and {why or 'no tractions that the law allows balance the loads'}"
    if not all(np.isfinite(part).all() for part in choice.alpha):
        return "the law drops discontinuously, so c is infinite"
    coupling = _coupling(traces, constants)
    if coupling >= 1.0:
        return f"how {_what_depends(traces.stated)} adds {coupling:.3g} to c, which must stay below 1"
    softens = any(part.any() for part in choice.alpha)
    shown = coupling + (SoftModes(traces).softest(*choice.alpha).theta if softens else 0.0)
    if not shown < 1.0:
        return f"the foundation softens too much for the body: c >= {shown:.3g} by a displacement of the mesh"
    return (
        f"the constants of the body are poor. They give c = {choice.constant:.3g}, where displacements of the mesh "
        f"show no more than {shown:.3g}; state the body on a finer mesh, or one with cells of better shape"
    )


def _softening(traces: ContactTraces, normal: Array, tangential: Array) -> tuple[Array, Array]:
    """Constants (k,) of the normal and of the tangential law; the larger for both where contact normals vary."""
    if has_constant_normals(traces.data.problem):
        return normal, tangential
    larger = np.maximum(normal, tangential)
    return larger, larger


def _value(sum_: float, gap: float, c: float) -> float:
    """The bound for ``eta + rho``, G and c."""
    if not c < 1.0:
        return np.inf
    return float((sum_ + np.sqrt(sum_**2 + 4.0 * (1.0 - c) * gap)) / (2.0 * (1.0 - c)))


def _coupling(traces: ContactTraces, constants: TraceBounds) -> float:
    """What a friction bound that depends on the penetration adds to c: a bound of ``L G int |v_nu| |v_tau| / a(v, v)``.

    That is ``L G / sqrt(L_nu L_tau)``, or ``L G / (2 Lambda)`` where that is less; ``m_L / Lambda`` where all tractions
    depend on the state, with their Lipschitz constant m_L.
    """
    worst = float(traces.coupling().max(initial=0.0))
    if worst == 0.0:
        return 0.0
    apart = np.sqrt(constants.normal) * np.sqrt(constants.tangential)
    least = constants.both if traces.stated.depends_on_whole_state else max(float(apart), 2.0 * constants.both)
    return worst / least if least > 0.0 else np.inf
