"""A bound of the distance to the exact solution that needs no constant of the body, for convex laws.

Let J be convex and a only positive semidefinite, as of a body held by contact only. With an admissible stress
s whose own contact tractions are those of a multiplier zeta (``-s nu`` is its projection on polynomials of each facet),

    |u - u_h|_a^2 <= eta |u - u_h|_a + G,        |u - u_h|_a <= (eta + sqrt(eta^2 + 4 G)) / 2,

eta the misfit, and ``G = int j(r_h) + j*(zeta) - zeta . r_h``: no term is left that a trace constant would have to
bound.  The seminorm does not see rigid motions.  Proofs are in docs/bounds-theory.md.

Such tractions balance the loads on rigid motions.  Let t be the interpolated multiplier, rho_q a rigid motion and

    zeta = t + b (r_h + rho_q - p),      p = argmin j(p) + b/2 |p|^2 - (t + b (r_h + rho_q)) . p,

which is in the domain of j*. Its work on rigid motions is the gradient, by q, of a convex function, so that a few steps
of Newton find the q for which it is that of the loads.  Forces of nodes that zeta does not balance are those of a
displacement w of the mesh: of ``u_h + w`` tractions are made vertex by vertex.  As w is in the discrete space,
``eta^2`` grows by ``|w|_a^2``; b is chosen for the least sum of that, of ``2 G`` and of what zeta is no polynomial.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.certificates.continuous.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.certificates.continuous.bare_body import bare_body
from hemivar.certificates.continuous.body_data import BodyData
from hemivar.certificates.continuous.conjugate_sweeps import Sweeps
from hemivar.certificates.continuous.contact_traces import ContactTraces
from hemivar.certificates.continuous.fenchel import FenchelGap, fenchel_gap
from hemivar.certificates.continuous.oscillation import local_constants
from hemivar.certificates.continuous.sweeps import PatchSmoother
from hemivar.certificates.continuous.touching_bodies import contact_moments
from hemivar.certificates.continuous.varying_gaps import gap_ranges
from hemivar.certificates.continuous.vertex_moments import unsettled
from hemivar.coercivity.free_motion import describe
from hemivar.fem.discretize import discretize
from hemivar.linear.factorisation import Factorisation, factorise
from hemivar.mechanics.statement import ContactProblem

__all__ = ["BalancedStress", "BareStiffness", "balanced_stress", "not_convex", "unknown_gaps"]

#: Weights b that are tried, over the stiffness of the body per length.
_WEIGHTS = (1e-4, 1e-2, 1.0, 30.0)
#: Steps of Newton, and what may be left of the loads.
_STEPS, _BALANCED = 60, 1e-12
#: Steps by which derivatives are taken, over the largest displacement or gap.
_STEP = 1e-7
#: What of a multiplier is rounding.
_ROUNDING = 1e-13


@dataclass(frozen=True, eq=False)
class BalancedStress:
    """An admissible stress whose contact tractions a convex law allows."""

    stress: AdmissibleStress
    gap: Array  # (k,), of the contact facets
    #: What each cell adds to its eta: what the polynomials of its facets miss of zeta.
    missed: Array  # (M,)
    #: ``|R|`` in the dual of the discrete energy norm, R the forces of nodes that are left; rounding.
    algebraic: float
    #: The rigid motions that are not seen, in words; empty where there is none.
    unseen: str


def not_convex(problem: ContactProblem) -> str:
    """Why the bound is not one for a statement; empty for a linear body on convex laws that split, without a state."""
    laws = [contact.law for contact in problem.contact.values()]
    if any(law.state_dependent for law in laws):
        return "its friction depends on the solution"
    if not all(law.convex and min(law.alpha_reach) == np.inf for law in laws):
        return "its law is not known to be convex"
    if not all(law.splits for law in laws):
        return "its law couples opening and slip"
    return "" if problem.material.linear else "its material is not linear"


def balanced_stress(data: BodyData, traces: ContactTraces, sweeps: Sweeps) -> BalancedStress | None:
    """Of a displacement in the domain of the law; None where no tractions that the law allows balance the loads."""
    body = BareStiffness(data)
    loads = _gathered(data, data.loads) + data.at_nodes(np.arange(len(data.facet_loads)), data.facet_loads)
    joined = bool(data.table.cut.any())
    target = traces.interpolated(unsettled(data.under(contact_moments(data)) if joined else data).moments)
    wide = unknown_gaps(traces)
    best: tuple[float, FenchelGap, Array, Array, Array] | None = None
    for weight in _WEIGHTS:
        b = weight * body.per_length
        gap = _balanced(traces, body, target, b, loads, wide)
        if gap is None:
            continue
        force = loads - data.at_nodes(traces.facets, traces.moments(gap.multiplier)) - _gathered(data, data.forces)
        w, paid, missed = body.solve(force), gap.normal_gap + gap.tangential_gap, _missed(traces, gap.multiplier)
        cost = float(np.sum(w * force)) + 2.0 * float(paid.sum()) + float(missed @ missed)
        if best is None or cost < best[0]:
            best = cost, gap, w, paid, missed
    if best is None:
        return None
    _, gap, w, paid, missed = best
    moved = data.moved(data.displacement + w)
    pressures = traces.on_facets(-traces.moments(gap.multiplier))
    left = loads + data.at_nodes(np.arange(len(pressures)), pressures) - _gathered(moved, moved.forces)
    own = admissible_stress(moved.under(pressures)) if joined else admissible_stress(moved, pressures)
    stress = replace(own, data=data)
    if sweeps.kinds:
        stress = sweeps.lower(PatchSmoother(stress))
    algebraic = float(np.sqrt(max(float(np.sum(body.solve(left) * left)), 0.0)))
    return BalancedStress(stress, paid, missed, algebraic, body.motions_in_words)


def unknown_gaps(traces: ContactTraces) -> Array:
    """By how much penetrations at the points may differ from what they are taken for, (k,)."""
    found = np.zeros(len(traces.facets))
    for part in gap_ranges(traces.data):
        at = np.isin(traces.facets, part.facets)
        found[at] = np.where(np.isfinite(part.unknown), part.unknown, 0.0)
    return 2.0 * found


def _balanced(
    traces: ContactTraces, body: BareStiffness, target: Array, weight: float, loads: Array, wide: Array
) -> FenchelGap | None:
    """The multiplier that is nearest to a target (k, q, d) by a weight and balances loads (nodes, d)."""
    data = traces.data
    at_nodes = data.jump(body.motions, traces.facets)
    moves = np.einsum("fqa,fqci,fain->fqcn", traces.shapes, traces.frames, at_nodes, optimize=True)
    wanted = np.einsum("nim,ni->m", body.motions, loads)
    forces = np.abs(loads).sum() + np.einsum(
        "fq,fqc->", traces.weights, np.abs(target)
    )  # a body between others has none
    size = float(np.abs(body.motions).max(initial=0.0) * forces)
    count = moves.shape[-1]
    step = _STEP * max(float(np.abs(traces.local).max()), float(np.abs(target).max()) / weight)

    def at(q: Array) -> tuple[FenchelGap, Array]:
        gap = fenchel_gap(traces, target + weight * (moves @ q), weight, wide)
        work = np.einsum("fq,fqc,fqcn->n", traces.weights, gap.multiplier, moves, optimize=True)
        return gap, np.asarray(work - wanted)

    q = np.zeros(count)
    gap, off = at(q)
    for _ in range(_STEPS):
        if float(np.abs(off).max(initial=0.0)) <= _BALANCED * size:
            return gap
        slope = np.stack([(at(q + step * e)[1] - at(q - step * e)[1]) / (2.0 * step) for e in np.eye(count)], axis=1)
        change = -la.lstsq(0.5 * (slope + slope.T), off, cond=1e-12)[0]
        for _ in range(12):
            near, rest = at(q + change)
            if np.linalg.norm(rest) < np.linalg.norm(off):
                break
            change = 0.5 * change
        else:
            break
        q, gap, off = q + change, near, rest
    return gap if float(np.abs(off).max(initial=0.0)) <= 1e3 * _BALANCED * size else None


def _missed(traces: ContactTraces, zeta: Array) -> Array:
    """``kappa_F |zeta - P zeta|_F`` at the cells (M,), P the projection on polynomials of each facet."""
    data, table = traces.data, traces.data.table
    constants = local_constants(table, np.asarray(np.linalg.inv(data.compliance)))
    projected = traces.forces(data.facet_loads + traces.on_facets(-traces.moments(zeta)))
    square, whole = (sum(traces.square(part)) for part in (zeta - projected, zeta))
    square = np.where(square <= _ROUNDING**2 * whole, 0.0, square)
    found = np.zeros(len(table.cells))
    for side in (0, 1):
        seen = np.flatnonzero(table.owners[traces.facets, side] >= 0)
        cell = table.owners[traces.facets[seen], side]
        local = np.argmax(table.cell_facets[cell] == traces.facets[seen, None], axis=1)
        np.add.at(found, cell, constants.facet[cell, local] * np.sqrt(square[seen]))
    return found


def _gathered(data: BodyData, cells: Array) -> Array:
    """Nodal sums (nodes, d) of what cells have at their nodes, (M, l, d)."""
    found = np.zeros(data.displacement.shape)
    np.add.at(found, data.cell_nodes, cells)
    return found


class BareStiffness:
    """A body without loads: its motions without deformation, and what balanced forces do to it."""

    def __init__(self, data: BodyData) -> None:
        problem = data.problem
        bare = replace(bare_body(problem, coarsest=False), contact={}, order=problem.order)
        self._discrete = discretize(bare, check_coercivity=False)
        assert self._discrete.field is not None
        self._field = self._discrete.field
        found = self._field.free_motions
        self._groups = found.groups
        self._shape = data.displacement.shape
        self.motions = found.motions.toarray().reshape(*self._shape, found.count)
        size = float(data.table.volumes.sum()) ** (1.0 / data.table.dim)
        self.per_length = float(np.einsum("mqvv->mq", data.tensors).mean()) / data.tensors.shape[-1] / size

    @cached_property
    def _factor(self) -> Factorisation:
        """The stiffness apart from unknowns that hold all motions: balanced forces ask for nothing there."""
        free = np.asarray((self._field.lift @ self._field.free_motions.motions).toarray())
        pinned = np.zeros(0, dtype=np.int64)
        if free.shape[1]:
            pinned = np.sort(la.qr(free.T, mode="r", pivoting=True)[1][: free.shape[1]]).astype(np.int64)
        return factorise(self._discrete.stiffness, pinned)

    def solve(self, forces: Array) -> Array:
        """The displacement (nodes, d) of balanced forces (nodes, d); any rigid motion may be added to it."""
        right = np.asarray(self._field.basis.T @ forces.ravel())
        out = self._factor.solve_interior(right)
        out = out + self._factor.solve_interior(right - self._discrete.stiffness @ out)
        return np.asarray(self._field.basis @ out).reshape(self._shape)

    @property
    def motions_in_words(self) -> str:
        """All of them."""
        words = []
        for group in self._groups:
            for number in range(group.coefficients.shape[2]):
                moved = group.coefficients[:, :, number]
                words.append(describe(moved[int(np.argmax(np.linalg.norm(moved, axis=1)))])[1:-1])
        return ", ".join(words)
