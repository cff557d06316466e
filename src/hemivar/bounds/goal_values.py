"""Quantities of interest of a solution, with what is known of those of the exact one.

*First order, guaranteed.* With ``Q(u) = a(u, w) - L(w) + <q, omega>`` (:mod:`hemivar.bounds.functionals`) and every
solution within B of u_h in the energy norm, ``|a(u - u_h, w)| <= B |w|_a``; the rest is bounded by the growth of the
law, ``|q| <= c0 + c1 |r|``, on the few facets where omega is not zero. For a mean displacement ``B |z|_a``, and
``|z|_a^2 <= |z_h|_a^2 + |t - C eps(z_h)|^2`` with any stress t in equilibrium with the unit traction.

*Second order, an estimate.* With A the second derivative of the law at u_h, and points that stick held, let z solve
``a(z, v) + <A z, v> = a(w, v)``. Then ``Q(u) - Q(u_h)`` is the residual R of u_h at z up to terms of higher order, and
with equilibrated stresses s of u_h and t of z - w

    Q(u_h) + R(z_h) + 1/2 int (s - C eps(u_h)) : C^-1 (t - C eps(z_h - w))

is off by ``1/2 eta eta_z + rho eta_z``, or by the sum of the products of every cell where that is less, and by as much
again as ``<zeta, omega>`` near the ends of contact boundaries, where solutions are singular. For a linear problem the
first is the bound of the hypercircle. Otherwise it holds only as long as no contact point of the exact solution is on
another piece of its law, which an energy norm cannot show: it is called an estimate always.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect
from hemivar.basics.display import brief
from hemivar.basics.rounding import rounded_down, rounded_up
from hemivar.basics.types import Array, IntArray
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.body_data import BodyData, VaryingLoads
from hemivar.bounds.conjugate_sweeps import Sweeps
from hemivar.bounds.contact_traces import ContactTraces, contact_traces
from hemivar.bounds.exact_distance import ExactDistance
from hemivar.bounds.fenchel import exact_gap
from hemivar.bounds.functionals import Functional, functionals, linear_forces, nodal_forces, strained, work
from hemivar.bounds.goals import Goal
from hemivar.bounds.touching_bodies import on_facets, refuse_touching
from hemivar.bounds.trace_bounds import TraceBounds
from hemivar.bounds.vertex_moments import shared_on_contact
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.linear.factorisation import Factorisation, factorise
from hemivar.solvers import Solution

__all__ = ["GoalValue", "goal_value"]

#: Stiffness that holds a contact point, over the largest of the body.
_STIFF = 1e6
_NONE = np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class GoalValue:
    """A quantity of interest, (k,) for its k components.

    Attributes
    ----------
    goal : Goal
    computed : array, shape (k,)
        Of the discrete solution.
    lower, upper : arrays, shape (k,)
        Ends of an interval that holds the value of every exact solution; infinite where none is known.
    guaranteed : bool
        Whether it does, up to rounding and the rules of integration; else the interval is an estimate, too.
    reasons : tuple of str
        Why it is not guaranteed.
    corrected : array, shape (k,)
        The value by the dual-weighted residual: an estimate.
    spread : array, shape (k,)
        By how much that may be off: an estimate.
    indicator : array, shape (M,)
        What each cell adds to the error of the goal, an estimate; in units of the goal.
    """

    goal: Goal
    computed: Array
    lower: Array
    upper: Array
    guaranteed: bool
    reasons: tuple[str, ...]
    corrected: Array
    spread: Array
    indicator: Array

    __repr__ = brief

    @property
    def relative(self) -> float:
        """Half the length of the interval, over the size of the value; a vector counts as a whole."""
        return _over(0.5 * (self.upper - self.lower), self.computed)

    @property
    def estimated(self) -> float:
        """The spread of the corrected value, over its size."""
        return _over(self.spread, self.corrected)

    def lines(self) -> list[str]:
        """In lines of text: each component with its interval, and its estimate."""
        lines = []
        for axis, label in enumerate(self.goal.labels):
            name = self.goal.name if len(self.goal.axes) == 1 else f"{self.goal.name}.{label}"
            kind = "guaranteed" if self.guaranteed else "an estimate, not a bound"
            low, high = self.lower[axis], self.upper[axis]
            if math.isfinite(high - low):
                where = f"between {rounded_down(low, 6)} and {rounded_up(high, 6)} ({kind})"
            else:
                where = "within no known bounds"
            off = f"{self.corrected[axis]:.6g} +- {rounded_up(self.spread[axis], 2)}"
            lines.append(f"{name} = {self.computed[axis]:.6g}; that of the exact solution is {where}")
            lines.append(f"by dual weights about {off}: an estimate")
        return lines

    def record(self) -> dict[str, object]:
        """Plain numbers and strings for JSON; numbers that are not finite become null."""

        def listed(values: Array) -> list[float | None]:
            return [value if math.isfinite(value) else None for value in values.tolist()]

        names = ("computed", "lower", "upper", "corrected", "spread")
        return {
            "goal": self.goal.name,
            "components": list(self.goal.labels),
            **{name: listed(getattr(self, name)) for name in names},
            "guaranteed": self.guaranteed,
            "reasons": list(self.reasons),
        }


def _over(part: Array, whole: Array) -> float:
    size = float(np.linalg.norm(whole))
    norm = float(np.linalg.norm(part)) if np.isfinite(part).all() else math.inf
    return norm / size if size > 0.0 else (0.0 if norm == 0.0 else math.inf)


def goal_value(goal: Goal, solution: Solution, distance: ExactDistance, constants: TraceBounds) -> GoalValue:
    """A goal of a solution whose distance to the exact one is known.

    Parameters
    ----------
    goal : Goal
        From :func:`hemivar.bounds.goal_named`.
    solution : Solution
    distance : ExactDistance
        Of the solution, by :func:`hemivar.bounds.exact_distance`.
    constants : TraceBounds
        Of the body, as they were taken for the distance.

    Returns
    -------
    GoalValue

    Raises
    ------
    ProblemError
        Elements are not linear, or bodies touch one another whose facets do not coincide, or without a bound.
    """
    expect(goal, Goal, "the goal", "give what goal_named(...) returns")
    expect(solution, Solution, "the solution", "give what solve(...) returns")
    expect(distance, ExactDistance, "the distance", "give what exact_distance(...) returns")
    expect(constants, TraceBounds, "the constants", "give the TraceBounds of the body")
    discrete, data = solution.problem, distance.stress.data
    if data.problem.order != 1:
        raise ProblemError("quantities of interest are bounded for linear elements only; use order = 1")
    if discrete.origin is not None:
        refuse_touching(discrete.origin, "" if data.problem.contact else distance.why)
    parts = functionals(goal, data, discrete)
    traces = contact_traces(data)
    reasons = [] if distance.guaranteed else list(distance.reasons)
    dual = _Dual(solution, distance, traces, constants)
    plain = None
    ends, corrected, spread, computed = [], [], [], []
    indicator = np.zeros(len(distance.cells))
    for part in parts:
        if part.force:
            centre = work(data, part.field)
            strain, stress = strained(data, part.field)
            size = math.sqrt(max(float(np.einsum("m,mij,mij->", data.table.volumes, stress, strain)), 0.0))
        elif distance.unseen:
            centre, size = _mean(part, data), math.inf
            reasons.append(f"it changes under rigid motions that only contact restrains: {distance.unseen}")
        else:
            plain = factorise(discrete.stiffness, _NONE) if plain is None else plain
            centre, size = _mean_and_norm(part, data, discrete, plain)
        rest, why = _rest(part, traces, distance.distance, constants)
        rest += float(data.varying.unknown @ np.linalg.norm(part.field, axis=1))
        reasons += [why] if why else []
        reasons += [part.why] if part.why else []
        half = math.inf if part.why else distance.distance * size + rest
        ends.append((centre - half, centre + half))
        value, off, cells = dual.estimate(part, centre)
        computed.append(centre)
        corrected.append(value)
        spread.append(off)
        indicator += cells
    lower, upper = np.array(ends).T
    doubts = tuple(dict.fromkeys(reasons))
    return GoalValue(
        goal, np.array(computed), lower, upper, not doubts and bool(np.isfinite(lower).all()), doubts,
        np.array(corrected), np.array(spread), indicator,
    )  # fmt: skip


# ---- first order ---------------------------------------------------------------------------------------------------


def _mean(part: Functional, data: BodyData) -> float:
    return float(np.einsum("fai,fai->", part.tractions, data.displacement[data.table.facets]))


def _mean_and_norm(
    part: Functional, data: BodyData, discrete: DiscreteProblem, factor: Factorisation
) -> tuple[float, float]:
    """The mean displacement, and an upper bound of the energy norm of the answer to its traction."""
    assert discrete.field is not None
    basis = discrete.field.basis
    y = factor.solve_interior(np.asarray(basis.T @ linear_forces(data, part.tractions).ravel()))
    z = np.asarray(basis @ y).reshape(data.displacement.shape)
    free = np.full(data.contact.shape, -1)
    stress = _swept(_answering(data, z, part.tractions, free), None)
    energy = float(np.einsum("fai,fai->", part.tractions, z[data.table.facets]))
    return _mean(part, data), math.sqrt(max(energy, 0.0) + float(stress.misfit.sum()))


def _rest(part: Functional, traces: ContactTraces | None, distance: float, constants: TraceBounds) -> tuple[float, str]:
    """Bound of ``|<q, omega>|`` by the growth of the law, and why it is no proof."""
    if traces is None or not part.rest.any():
        return 0.0, ""
    omega = np.abs(np.einsum("fqa,fai,fqci->fqc", traces.barycentric, part.rest[traces.facets], traces.frames))
    along, across = omega[..., 0], np.sqrt(np.einsum("fqc,fqc->fq", omega[..., 1:], omega[..., 1:]))
    shape, law = traces.weights.shape, traces.law
    slip = np.sqrt(np.einsum("fqc,fqc->fq", traces.local[..., 1:], traces.local[..., 1:]))
    total, rates, why = 0.0, [], ""
    grows = zip(law.growth, (along, across), (np.abs(traces.local[..., 0]), slip), strict=True)
    for constants_of_part, weight, size in grows:
        c0, c1 = (np.broadcast_to(np.nan_to_num(c, nan=np.inf, posinf=np.inf), shape[0] * shape[1]).reshape(shape)
                  for c in constants_of_part)  # fmt: skip
        on = weight > 0.0
        if on.any() and not law.proof("growth").sure:
            why = "how the law grows is known from samples only"
        grown = np.where(size > 0.0, c1, 0.0) * size
        total += float(traces.integral((np.where(on, c0, 0.0) + np.where(on, grown, 0.0)) * weight).sum())
        rates.append(np.where(on, c1, 0.0) * weight)
    if across.any():
        coupled = np.where(across > 0.0, traces.coupling(), 0.0)
        rates[0] = rates[0] + coupled * across  # both grow with the same part of the error
    moved = math.sqrt(float(traces.integral(rates[0] ** 2 + rates[1] ** 2).sum()))
    if moved > 0.0:
        total += moved * distance / math.sqrt(constants.both) if constants.both > 0.0 else math.inf
    if not math.isfinite(total):
        return math.inf, "the contact boundary ends at a support or a tip, and the law does not bound the force there"
    return total, why


# ---- stresses of fields that answer ---------------------------------------------------------------------------------


def _answering(data: BodyData, field: Array, tractions: Array, contact: IntArray) -> BodyData:
    """The data of a field without loads but tractions, on contact facets that are given."""
    moved = data.moved(field)
    loads, varying = np.zeros(data.loads.shape), VaryingLoads.none(data.varying.missed)
    return replace(moved, loads=loads, outer_loads=tractions[data.table.outer], varying=varying, contact=contact)


def _swept(data: BodyData, traces: ContactTraces | None) -> AdmissibleStress:
    """The stress of data, improved; with traces the forces on contact facets are those of the nodes, interpolated."""
    pressures = None
    if traces is not None:
        own = replace(traces, data=data)
        pressures = own.on_facets(-own.moments(own.interpolated(shared_on_contact(data))))
    sweeps = Sweeps.usual(data.table.dim)
    return sweeps.lower(sweeps.sweeper(admissible_stress(data, pressures)))


# ---- second order --------------------------------------------------------------------------------------------------


class _Dual:
    """The problem linearised at a solution, for residuals weighted by its answers."""

    def __init__(
        self, solution: Solution, distance: ExactDistance, traces: ContactTraces | None, constants: TraceBounds
    ) -> None:
        self._discrete, self._traces, self._stress = solution.problem, traces, distance.stress
        self._eta = np.sqrt(np.maximum(distance.cells, 0.0))
        self._zeta = self._rho = np.zeros(0)
        self._size, self._both = 0.0, constants.both
        if traces is not None:
            forces = traces.forces(distance.stress.tractions.moments)
            self._zeta = exact_gap(traces, forces).multiplier
            squares = traces.square(forces - self._zeta)
            self._rho = squares[0] + squares[1]
            self._size = constants.distance(*squares)
        K = solution.problem.stiffness
        bend = _bend(solution)
        B = solution.problem.contact.trace
        self._bend = None if bend is None else sp.csr_array(bend @ B)
        self._factor = factorise(K if self._bend is None else sp.csr_array(K + B.T @ self._bend), _NONE)

    def estimate(self, part: Functional, centre: float) -> tuple[float, float, Array]:
        """The corrected value, by how much it may be off, and what each cell adds."""
        data, discrete, traces = self._stress.data, self._discrete, self._traces
        assert discrete.field is not None
        basis = discrete.field.basis
        push = nodal_forces(data, strained(data, part.field)[1]) + linear_forces(data, part.tractions)
        y = self._factor.solve_interior(np.asarray(basis.T @ push.ravel()))
        z = np.asarray(basis @ y).reshape(data.displacement.shape)
        value, ends = centre - work(data, z), np.zeros(0)
        if traces is not None:
            value -= float(self._work(traces, data.jump(z, traces.facets)).sum())
            ends = self._work(traces, part.rest[traces.facets])
            value += float(ends.sum())
        answer = self._answer(_answering(data, z - part.field, part.tractions, data.contact), y)
        cross = _product(self._stress, answer)
        eta_z = np.sqrt(np.maximum(answer.misfit, 0.0))
        size = float(np.linalg.norm(eta_z))
        whole = (0.5 * float(np.linalg.norm(self._eta)) + self._size) * size + float(np.abs(ends).sum())
        cells = self._eta * eta_z
        if traces is not None and 0.0 < self._both < math.inf:
            owner = data.table.owners[traces.facets, 0]
            np.add.at(cells, owner, np.sqrt(self._rho / self._both) * eta_z[owner] + np.abs(ends))
        return value + 0.5 * cross, min(whole, float(cells.sum())), cells

    def _answer(self, data: BodyData, y: Array) -> AdmissibleStress:
        """A stress that balances the data; where bodies touch under what the law answers to unknowns y (n,)."""
        if not data.table.cut.any():
            return _swept(data, self._traces)
        assert self._bend is not None
        contact = self._discrete.contact
        forces = np.asarray(self._bend @ y).reshape(contact.shape)
        return _swept(data.under(on_facets(data, data.problem, contact, forces)), None)

    def _work(self, traces: ContactTraces, nodal: Array) -> Array:
        """``int zeta . v``, (k,), of values (k, d, d) at the nodes of the facets."""
        local = np.einsum("fqa,fai,fqci->fqc", traces.barycentric, nodal, traces.frames, optimize=True)
        return traces.integral(np.einsum("fqc,fqc->fq", self._zeta, local))


def _product(one: AdmissibleStress, other: AdmissibleStress) -> float:
    """``int (s - C eps(u)) : C^-1 (t - C eps(z))`` of two admissible stresses."""
    element, compliance = one.element, one.data.reference_compliance
    plus = element.energy(element.at_nodes(one.difference + other.difference), compliance)
    minus = element.energy(element.at_nodes(one.difference - other.difference), compliance)
    return float(0.25 * (plus - minus).sum())


def _bend(solution: Solution) -> sp.csr_array | None:
    """Weighted second derivatives of the law at the contact points of a solution, stiff where a point is held."""
    problem = solution.problem
    m, d = problem.contact_points, problem.contact.components
    if not m:
        return None
    r, lam = problem.local(solution.unknowns), solution.multiplier
    law = problem.law.frozen(r, lam)
    K = problem.stiffness
    stiff = _STIFF * float(K.diagonal().max())
    tau = np.broadcast_to(problem.contact.weights[:, None] / float(K.diagonal().max()), (m, 2))
    line = law.linearise(law.fitted(r, lam, tau))
    hessian = problem.contact.weights[:, None, None] * line.hessian
    for part, axes in ((0, range(1)), (1, range(1, d))):
        for axis in axes:
            hessian[~line.smooth[:, part], axis, axis] = stiff
    rows = (np.arange(m)[:, None, None] * d + np.arange(d)[:, None]) + np.zeros((1, 1, d), dtype=np.int64)
    columns = rows.transpose(0, 2, 1)
    return sp.csr_array((hessian.ravel(), (rows.ravel(), columns.ravel())), shape=(m * d, m * d))
