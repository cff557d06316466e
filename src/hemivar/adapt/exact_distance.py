"""How far a computed displacement is from every solution of the continuous problem, in the energy norm.

With an admissible stress s (:mod:`hemivar.adapt.admissible_stress`), its force ``xi = -s nu`` on the contact boundary,
a zeta that the law allows at the computed displacement, and ``|v|_a^2 = int C eps(v) : eps(v)``:

    eta = |s - C eps(u)|_{C^-1},    |<xi - zeta, v>| <= rho |v|_a,    c >= sup int alpha |v|^2 / a(v, v),

every solution lies within ``(eta + rho) / (1 - c)`` if zeta is in dj(r(u)) everywhere; c then needs the one-sided
constant at u alone. For weakly convex laws zeta may leave dj at the price of the gap G of Fenchel's inequality:

    [eta + rho + sqrt((eta + rho)^2 + 4 (1 - c) G)] / (2 (1 - c)).

Proofs are in docs/bounds.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.adapt.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.adapt.body_data import BodyData, body_data
from hemivar.adapt.contact_traces import ContactTraces, contact_traces
from hemivar.adapt.fenchel import FenchelGap, fenchel_gap
from hemivar.adapt.hypotheses import unmet_hypotheses
from hemivar.adapt.low_mode import confined_error, low_mode
from hemivar.adapt.one_sided import one_sided_constants
from hemivar.adapt.oscillation import Oscillation, oscillation
from hemivar.adapt.patches import PatchKind
from hemivar.adapt.sweeps import ContactPrice, Sweeper
from hemivar.adapt.trace_bounds import TraceBounds
from hemivar.adapt.vertex_moments import shared_forces
from hemivar.basics.arguments import expect
from hemivar.basics.types import Array, IntArray
from hemivar.mechanics.obstacles import Plane
from hemivar.mechanics.statement import ContactProblem

__all__ = ["SWEEPS", "DistanceParts", "ExactDistance", "exact_distance"]

#: Part of eta from which what nodes lack for equilibrium is more than rounding.
_LARGE = 1e-6
#: Softening c from which the softest mode is looked at by itself.
_SOFT = 0.15
#: Sweeps by default, in the plane and in space.
SWEEPS: dict[int, tuple[PatchKind, ...]] = {
    2: (PatchKind.VERTEX,),
    3: (PatchKind.EDGE,),
}


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
        What the loads add to eta that no linear field on a cell or facet sees.
    algebraic : float
        What the displacement lacks for equilibrium in the discrete space: rounding, or an unfinished solve.
    """

    misfit: float
    contact: float
    gap: float
    oscillation: float
    algebraic: float


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
    facets : int array, shape (k, d)
        Contact facets by their nodes.
    facet_contact, facet_gap : arrays, shape (k,)
        ``|xi - zeta|^2`` and G of each of them.
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
    facets: IntArray
    facet_contact: Array
    facet_gap: Array

    @property
    def relative(self) -> float:
        """The distance over ``|u_h|_a``."""
        return self.distance / self.energy_norm if self.energy_norm > 0.0 else np.inf


def exact_distance(
    problem: ContactProblem,
    displacement: Array,
    constants: TraceBounds,
    *,
    sweeps: tuple[PatchKind, ...] | None = None,
) -> ExactDistance:
    """Bound the distance of a displacement to every solution of the continuous problem.

    Parameters
    ----------
    problem : ContactProblem
        With linear elements.
    displacement : array, shape (N, d)
        That of a solution of the discrete problem, or any other that fulfils the supports.
    constants : TraceBounds
        Of the body.
    sweeps : tuple of PatchKind, optional
        By which the stress is improved; :data:`SWEEPS` by default.

    Raises
    ------
    ProblemError
        As :func:`hemivar.adapt.body_data.body_data`, :func:`hemivar.adapt.vertex_moments.equilibrated` and
        :func:`hemivar.adapt.hypotheses.unmet_hypotheses`.
    """
    unmet = unmet_hypotheses(problem, displacement)
    expect(constants, TraceBounds, "constants", "give those of guaranteed_trace_bounds(hemivar.discretize(problem))")
    for kind in () if sweeps is None else expect(sweeps, tuple, "sweeps", "give a tuple such as (PatchKind.VERTEX,)"):
        expect(kind, PatchKind, "a sweep", f"choose among {', '.join(str(one) for one in PatchKind)}")
    data = body_data(problem, displacement)
    traces = contact_traces(data)
    stress = improved_stress(data, traces, constants, SWEEPS[problem.mesh.dim] if sweeps is None else sweeps)
    return _bound(stress, traces, constants, unmet)


def improved_stress(
    data: BodyData, traces: ContactTraces | None, constants: TraceBounds, sweeps: tuple[PatchKind, ...]
) -> AdmissibleStress:
    """An admissible stress, its contact tractions near to what the law allows, after sweeps over patches."""
    pressures = None
    if traces is not None:
        pressures = -traces.moments(traces.allowed(traces.interpolated(shared_forces(data))))
    stress = admissible_stress(data, pressures)
    if not sweeps:
        return stress
    sweeper = Sweeper(stress)
    for kind in sweeps:
        sweeper.sweep(kind, None if traces is None else _price(sweeper, traces, constants))
    return sweeper.stress


def _price(sweeper: Sweeper, traces: ContactTraces, constants: TraceBounds) -> ContactPrice | None:
    """The price ``max(1, eta / rho) / Lambda``: with it a sum of squares falls where ``eta + rho`` does."""
    if not 0.0 < constants.both < np.inf:
        return None
    stress = sweeper.stress
    forces = traces.forces(stress.tractions.moments)
    allowed = traces.allowed(forces)
    rho = np.sqrt(sum(part.sum() for part in traces.square(forces - allowed)) / constants.both)
    eta = np.sqrt(stress.misfit.sum())
    ratio = min(max(1.0, eta / rho), 1e6) if rho > 0.0 else 1e6
    return ContactPrice(traces.moments(allowed), float(ratio / constants.both))


def _bound(
    stress: AdmissibleStress, traces: ContactTraces | None, constants: TraceBounds, unmet: list[str]
) -> ExactDistance:
    data = stress.data
    table = data.table
    reasons = [] if constants.guaranteed else [f"the constants of the body are {constants.source}"]
    reasons += unmet + _inexact(data)
    rest = oscillation(stress)
    eta, eta_all = float(np.sqrt(stress.misfit.sum())), float(np.sqrt(_cells(stress, rest).sum()))
    algebraic = _algebraic(stress, constants)
    if algebraic > _LARGE * eta:
        reasons.append("the displacement is no solution of the discrete problem; what it lacks counts by its constants")
    base = eta_all + algebraic

    count = 0 if traces is None else len(traces.facets)
    nodes = table.facets[np.zeros(0, dtype=np.int64) if traces is None else traces.facets]
    found = _Choice(base, 0.0, 0.0, 2, np.zeros(count), np.zeros(count))
    if traces is not None:
        if traces.beyond > 0.0:
            reasons.append(
                f"the displacement leaves the domain of the law by {traces.beyond:.3g}, which is not accounted for"
            )
        found = _contact(stress, traces, constants, base, nodes, reasons)
    if not found.value < np.inf:
        reasons.append(
            "there is no bound: the foundation softens too much for the body (c >= 1), or nothing but contact holds it"
        )
    volume = np.einsum("m,mij,mij->", table.volumes, data.stress, data.strain)
    parts = DistanceParts(eta, found.contact, float(found.facet_gap.sum()), eta_all - eta, algebraic)
    return ExactDistance(
        found.value, float(np.sqrt(max(volume, 0.0))), parts, found.constant, found.theorem,
        not reasons, tuple(reasons), stress, _cells(stress, rest), nodes, found.facet_contact, found.facet_gap,
    )  # fmt: skip


def _inexact(data: BodyData) -> list[str]:
    """What of the statement the mesh and its rules of integration do not represent exactly."""
    problem = data.problem
    found: list[str] = []
    if data.varies:
        found.append("the material varies within cells, where it is seen by a rule of integration")
    held = [getattr(support, part, None) for support in problem.supports.values() for part in ("value", "x", "y", "z")]
    if any(callable(value) for value in held):
        found.append("prescribed displacements are functions, which the mesh interpolates")
    for name, contact in problem.contact.items():
        if callable(contact.gap) or not isinstance(contact.obstacle, Plane | None):
            found.append(f"the gap of contact '{name}' varies, and is seen by a rule of integration")
    return found


@dataclass(frozen=True, eq=False)
class _Choice:
    """The bound of one choice of zeta: value, c, rho, theorem, and what each facet adds."""

    value: float
    constant: float
    contact: float
    theorem: int
    facet_contact: Array
    facet_gap: Array


def _cells(stress: AdmissibleStress, rest: Oscillation) -> Array:
    return (np.sqrt(np.maximum(stress.misfit, 0.0)) + rest.cells) ** 2


def _algebraic(stress: AdmissibleStress, constants: TraceBounds) -> float:
    """``|g| / sqrt(Lambda)`` over the body, g the linear field on each cell with the moments of the defect."""
    table, defect = stress.data.table, stress.tractions.defect
    if not defect.any():
        return 0.0
    corners = table.dim + 1
    scale = corners * (corners + 1) / table.volumes
    square = np.einsum("m,mac,mac->", scale, defect, defect)
    square -= np.einsum("m,mc,mc->", scale / (corners + 1), defect.sum(axis=1), defect.sum(axis=1))
    return float(np.sqrt(max(square, 0.0) / constants.body)) if constants.body > 0.0 else np.inf


def _contact(
    stress: AdmissibleStress,
    traces: ContactTraces,
    constants: TraceBounds,
    base: float,
    nodes: IntArray,
    reasons: list[str],
) -> _Choice:
    """The better of both theorems."""
    law = traces.law
    corners = stress.data.table.mesh.points[nodes]
    forces = traces.forces(stress.tractions.moments)
    allowed = traces.allowed(forces)
    normal, tangential = traces.square(forces - allowed)
    coupling = _coupling(traces, constants)
    if coupling == np.inf:
        reasons.append("the friction bound depends on the pressure, or jumps with the penetration: there is no bound")
    if law.normal.alpha_sampled or law.friction.profile.alpha_sampled:
        reasons.append("a constant of the law is known from samples only")
    if coupling > 0.0 and law.lipschitz_sampled:
        reasons.append("how the friction bound depends on the penetration is known from samples only")

    near = one_sided_constants(traces, allowed)
    near_normal, near_tangential = (part.max(axis=1) for part in near)
    c = constants.softening(corners, near_normal, near_tangential) + coupling
    rho = constants.distance(normal, tangential)
    value = _value(base + rho, 0.0, c)
    if constants.weighted is not None and _SOFT < c < np.inf and stress.data.problem.order == 1:
        first, second = constants.weighted(corners, near_normal, near_tangential)
        if second < first and first + coupling < 1.0:
            theta, seen = low_mode(stress.data, traces, allowed, near_normal, near_tangential)
            value = min(value, confined_error(base + rho, seen, theta, first, second, coupling))
    best = _Choice(value, c, rho, 2, normal + tangential, np.zeros(len(normal)))

    shape = traces.weights.shape
    alpha_normal = np.broadcast_to(law.normal.weak_convexity, shape[0] * shape[1]).reshape(shape)
    alpha_tangential = np.broadcast_to(law.tangential.weak_convexity, shape[0] * shape[1]).reshape(shape)
    if np.isfinite(alpha_normal).all() and np.isfinite(alpha_tangential).all():
        c = constants.softening(corners, alpha_normal.max(axis=1), alpha_tangential.max(axis=1)) + coupling
        gap = fenchel_gap(traces, forces)
        other = _with_gap(gap, normal, tangential, constants, base, c)
        if other.value < best.value:
            best = other
    falls = int((np.isinf(near_normal) | np.isinf(near_tangential)).sum())
    if falls and not best.value < np.inf:
        reasons.append(
            f"the displacement passes a downward jump of the law on {falls} contact facets, where no constant of the "
            "law is finite"
        )
    return best


def _value(sum_: float, gap: float, c: float) -> float:
    """The bound for ``eta + rho``, G and c."""
    if not c < 1.0:
        return np.inf
    return float((sum_ + np.sqrt(sum_**2 + 4.0 * (1.0 - c) * gap)) / (2.0 * (1.0 - c)))


def _with_gap(
    gap: FenchelGap, normal: Array, tangential: Array, constants: TraceBounds, base: float, c: float
) -> _Choice:
    """Facet by facet, and for both parts apart: the law's multiplier, or the clipped force at the price of its gap.

    Those with the least gap for what they gain are chosen first; how many, that makes the bound smallest.
    """
    count = len(normal)
    before = np.concatenate([normal, tangential])
    after, price = np.concatenate([gap.normal, gap.tangential]), np.concatenate([gap.normal_gap, gap.tangential_gap])
    gain = before - after
    order = np.argsort(np.where(gain > 0.0, price / np.where(gain > 0.0, gain, 1.0), np.inf), kind="stable")
    order = order[(gain[order] > 0.0) & np.isfinite(price[order])]
    along = normal.sum() - np.concatenate([[0.0], np.cumsum(np.where(order < count, gain[order], 0.0))])
    across = tangential.sum() - np.concatenate([[0.0], np.cumsum(np.where(order >= count, gain[order], 0.0))])
    paid = np.concatenate([[0.0], np.cumsum(price[order])])
    along, across = np.maximum(along, 0.0), np.maximum(across, 0.0)
    values = [_value(base + constants.distance(a, b), float(g), c) for a, b, g in zip(along, across, paid, strict=True)]
    chosen = int(np.argmin(values))
    taken = np.zeros(2 * count, dtype=bool)
    taken[order[:chosen]] = True
    left, cost = np.where(taken, after, before), np.where(taken, price, 0.0)
    rho = constants.distance(left[:count], left[count:])
    return _Choice(
        _value(base + rho, float(cost.sum()), c), c, rho, 1, left[:count] + left[count:], cost[:count] + cost[count:]
    )


def _coupling(traces: ContactTraces, constants: TraceBounds) -> float:
    """What a friction bound that depends on the penetration adds to c: ``L G / sqrt(L_nu L_tau)``."""
    names = traces.data.problem.contact
    worst = 0.0
    for contact in names.values():
        law = contact.law
        if not law.state_dependent:
            continue
        resolved = law.at(traces.data.problem.mesh.points[traces.data.table.facets[traces.facets]].mean(axis=1))
        steepest, growing = resolved.friction.profile.growth
        rate = np.where(growing > 0.0, np.inf, steepest)
        product = np.where(resolved.lipschitz > 0.0, resolved.lipschitz * np.maximum(rate, 0.0), 0.0)
        worst = max(worst, float(product.max(initial=0.0)))
    if worst == 0.0:
        return 0.0
    both = constants.normal * constants.tangential
    return float(worst / np.sqrt(both)) if both > 0.0 else np.inf
