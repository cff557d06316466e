"""A bound of the distance to the exact solution that needs no constant of the body, for convex laws.

Let J be convex and a only positive semidefinite, as of a body held by contact only. With an admissible stress
s whose own contact tractions are those of a multiplier zeta (``-s nu`` is its projection on polynomials of each facet),

    |u - u_h|_a^2 <= eta |u - u_h|_a + G,        |u - u_h|_a <= (eta + sqrt(eta^2 + 4 G)) / 2,

eta the misfit, and ``G = int j(r_h) + j*(zeta) - zeta . r_h``: no term is left that a trace constant would have to
bound.  The seminorm does not see rigid motions.  Proofs are in docs/theory/bounds.md.

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

from hemivar.basics.arrays import ROUNDED, SOLVED
from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.bounds.admissible_stress import AdmissibleStress, admissible_stress
from hemivar.bounds.bare_body import bare_body
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.conjugate_sweeps import Sweeps
from hemivar.bounds.contact_traces import ContactTraces
from hemivar.bounds.fenchel import FenchelGap, fenchel_gap, near_multiplier
from hemivar.bounds.loose_motions import loose_motions
from hemivar.bounds.oscillation import local_constants
from hemivar.bounds.touching_bodies import contact_moments
from hemivar.bounds.varying_gaps import gap_ranges
from hemivar.bounds.vertex_moments import shared_on_contact
from hemivar.discrete.free_motion import describe
from hemivar.errors import MethodError
from hemivar.fem.discretize import discretize
from hemivar.laws.vector_law import is_convex, splits
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import LevelMatrix, Levels
from hemivar.linear.threads import one_thread
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers.multigrid import TIGHTEST
from hemivar.systems.body_on_levels import levels_of
from hemivar.systems.workspace import Workspace

__all__ = ["BalancedStress", "BareStiffness", "balanced_stress", "not_convex", "unknown_gaps"]

#: Weights b that are tried, over the stiffness of the body per length.
_WEIGHTS = (1e-4, 1e-2, 1.0, 30.0)
#: Part of balanced forces that a solve leaves which ranks or measures what is small, and most cycles of one.
_ROUGH, _CYCLES = 0.1, 1000


@dataclass(frozen=True, eq=False)
class BalancedStress:
    """An admissible stress whose contact tractions a convex law allows."""

    stress: AdmissibleStress
    gap: Array  # (k,), of the contact facets
    #: What each cell adds to its eta: what the polynomials of its facets miss of zeta.
    missed: Array  # (M,)
    #: ``|R|`` in the dual of the discrete energy norm, R the forces of nodes that are left; rounding.
    algebraic: float
    #: The rigid motions that are not seen, and those by which solutions may differ, in words; empty where none is.
    unseen: str
    loose: str


def not_convex(problem: ContactProblem) -> str:
    """Why the bound is not one for a statement; empty for a linear body on convex laws that split, without a state."""
    laws = [contact.law for contact in problem.contact.values()]
    if any(law.state_dependent for law in laws):
        return "its friction depends on the solution"
    if not all(is_convex(law) for law in laws):
        return "its law is not known to be convex"
    if not all(splits(law) for law in laws):
        return "its law couples opening and slip"
    return "" if problem.material.linear else "its material is not linear"


def balanced_stress(data: BodyData, traces: ContactTraces, sweeps: Sweeps) -> BalancedStress | None:
    """Of a displacement in the domain of the law; None where no tractions that the law allows balance the loads."""
    body, joined = BareStiffness(data), bool(data.table.cut.any())
    loads = _gathered(data, data.loads) + data.at_nodes(data.table.outer, data.outer_loads)
    shared = shared_on_contact(data, contact_moments(data) if joined else None)
    lack = loads - _gathered(data, data.forces)
    rough, fine = (_Multipliers(at, body, loads, lack, at.interpolated(shared)) for at in (traces.rough, traces))
    best = _best(rough, fine)
    if best is None:
        return None
    gap, force = best
    w, paid, missed = body.solve(force), gap.normal_gap + gap.tangential_gap, _missed(traces, gap.multiplier)
    moved = data.moved(data.displacement + w)
    pressures = traces.on_facets(-traces.moments(gap.multiplier))
    left = loads + data.at_nodes(np.arange(len(pressures)), pressures) - _gathered(moved, moved.forces)
    own = admissible_stress(moved.under(pressures)) if joined else admissible_stress(moved, pressures)
    stress = replace(own, data=data)
    if sweeps.kinds:
        stress = sweeps.lower(sweeps.sweeper(stress))
    algebraic = float(np.sqrt(max(float(np.sum(body.solve(left, _ROUGH) * left)), 0.0)))
    every = np.eye(len(fine.works))
    unseen, loose = map(body.in_words, (every, loose_motions(rough.traces, rough.moves, rough.works, rough.size)))
    return BalancedStress(stress, paid, missed, algebraic, unseen, loose)


def _best(rough: _Multipliers, fine: _Multipliers) -> tuple[FenchelGap, Array] | None:
    """The multiplier of the weight that is best at few points, and the forces (nodes, d) that it leaves to a w."""
    tried = []
    for weight in _WEIGHTS:
        b = weight * rough.body.per_length
        pair = rough.nearest(b, np.zeros(rough.moves.shape[-1]))
        if pair is not None:
            tried.append((rough.cost(pair[0]), b, pair[1]))
    for _, b, q in sorted(tried, key=lambda one: one[0]):
        pair = fine.nearest(b, q)
        if pair is not None:
            return pair[0], fine.unbalanced(pair[0])
    return None


def unknown_gaps(traces: ContactTraces) -> Array:
    """By how much penetrations at the points may differ from what they are taken for, (k,)."""
    unknown = np.zeros(len(traces.facets))
    for part in gap_ranges(traces.data):
        at = np.isin(traces.facets, part.facets)
        unknown[at] = np.where(np.isfinite(part.unknown), part.unknown, 0.0)
    return 2.0 * unknown


@dataclass(frozen=True, eq=False)
class _Multipliers:
    """Multipliers at points of the contact facets that balance loads."""

    traces: ContactTraces
    body: BareStiffness
    loads: Array  # (nodes, d)
    lack: Array  # (nodes, d): of them what the stress of the displacement does not balance
    target: Array  # (k, q, d)

    @cached_property
    def moves(self) -> Array:
        """The rigid motions in local components, (k, q, d, n)."""
        traces = self.traces
        at_nodes = traces.data.jump(self.body.motions, traces.facets)
        return np.asarray(np.einsum("fqa,fqci,fain->fqcn", traces.shapes, traces.frames, at_nodes, optimize=True))

    @cached_property
    def works(self) -> Array:
        """What the loads work on the motions, (n,)."""
        return np.asarray(np.einsum("nim,ni->m", self.body.motions, self.loads))

    @cached_property
    def size(self) -> float:
        """What works of forces on motions are compared with; a body between others has no loads."""
        forces = np.abs(self.loads).sum() + np.einsum("fq,fqc->", self.traces.weights, np.abs(self.target))
        return float(np.abs(self.body.motions).max(initial=0.0) * forces)

    def _off(self, zeta: Array) -> Array:
        """What multipliers (k, q, d) work on the motions more than the loads do, (n,)."""
        works = np.einsum("fq,fqc,fqcn->n", self.traces.weights, zeta, self.moves, optimize=True)
        return np.asarray(works - self.works)

    def nearest(self, weight: float, q: Array) -> tuple[FenchelGap, Array] | None:
        """The one that is nearest to the target by a weight, and its q, from some q (n,); None where none was found."""
        traces, count = self.traces, len(q)

        def at(q: Array) -> tuple[Array, Array, Array]:
            wish = self.target + weight * (self.moves @ q)
            zeta = near_multiplier(traces, wish, weight)[1]
            return wish, zeta, self._off(zeta)

        wish, zeta, off = at(q)
        for _ in range(60):
            if float(np.abs(off).max(initial=0.0)) <= ROUNDED * self.size:
                break
            change = -la.lstsq(weight * self._slope(wish, zeta, weight).reshape(count, count), off, cond=1e-12)[0]
            for _ in range(12):
                near = at(q + change)
                if np.linalg.norm(near[2]) < np.linalg.norm(off):
                    break
                change = 0.5 * change
            else:
                break
            q, (wish, zeta, off) = q + change, near
        if float(np.abs(off).max(initial=0.0)) > 1e3 * ROUNDED * self.size:
            return None
        return fenchel_gap(traces, wish, weight, unknown_gaps(traces)), q

    def _slope(self, wish: Array, zeta: Array, weight: float) -> Array:
        """How multipliers (k, q, d) follow what is wished for along the motions, by their works on these, (n, n)."""
        step = 1e-7 * max(weight * float(np.abs(self.traces.local).max()), float(np.abs(self.target).max()))
        steps = step * np.eye(wish.shape[-1])
        follows = [near_multiplier(self.traces, wish + change, weight)[1] - zeta for change in steps]
        follow = np.stack(follows, axis=-1) / step
        weights, moves = self.traces.weights, self.moves
        slope = np.einsum("fq,fqcn,fqce,fqem->nm", weights, moves, follow, moves, optimize=True)
        return np.asarray(0.5 * (slope + slope.T))

    def unbalanced(self, gap: FenchelGap) -> Array:
        """Forces of nodes (nodes, d) that a multiplier and the stress of the displacement do not balance."""
        traces = self.traces
        return np.asarray(self.lack - traces.data.at_nodes(traces.facets, traces.moments(gap.multiplier)))

    def cost(self, gap: FenchelGap) -> float:
        """About what the square of the bound grows by."""
        force, missed = self.unbalanced(gap), _missed(self.traces, gap.multiplier)
        work = float(np.sum(self.body.solve(force, _ROUGH) * force))
        return work + 2.0 * float((gap.normal_gap + gap.tangential_gap).sum()) + float(missed @ missed)


def _missed(traces: ContactTraces, zeta: Array) -> Array:
    """``kappa_F |zeta - P zeta|_F`` at the cells (M,), P the projection on polynomials of each facet."""
    data, table = traces.data, traces.data.table
    projected = traces.forces(data.facet_loads + traces.on_facets(-traces.moments(zeta)))
    square, whole = (sum(traces.square(part)) for part in (zeta - projected, zeta))
    size = np.sqrt(np.where(square <= ROUNDED**2 * whole, 0.0, square))
    missed = np.zeros(len(table.cells))
    for side in (0, 1):
        seen = np.flatnonzero(table.owners[traces.facets, side] >= 0)
        cell = table.owners[traces.facets[seen], side]
        compliance = data.compliance if len(data.compliance) == 1 else data.compliance[cell]
        constants = local_constants(table, np.asarray(np.linalg.inv(compliance)), cell)
        local = table.cell_facets[cell] == traces.facets[seen, None]
        np.add.at(missed, cell, constants.facet[local] * size[seen])
    return missed


def _gathered(data: BodyData, cells: Array) -> Array:
    """Nodal sums (nodes, d) of what cells have at their nodes, (M, l, d)."""
    nodes, count = data.cell_nodes.ravel(), len(data.displacement)
    return np.stack(
        [np.bincount(nodes, weights=one.ravel(), minlength=count) for one in np.moveaxis(cells, 2, 0)], axis=1
    )


class BareStiffness:
    """A body without loads: its motions without deformation, and what balanced forces do to it."""

    def __init__(self, data: BodyData) -> None:
        problem = data.problem
        bare = replace(bare_body(problem, coarsest=False), contact={}, order=problem.order)
        self._discrete = discretize(bare, check_coercivity=False)
        assert self._discrete.field is not None
        self._field = self._discrete.field
        kernel = self._field.free_motions
        self._groups = kernel.groups
        self._shape = data.displacement.shape
        self.motions = kernel.motions.toarray().reshape(*self._shape, kernel.count)
        size = float(data.table.volumes.sum()) ** (1.0 / data.table.dim)
        self.per_length = float(np.einsum("mqvv->mq", data.tensors).mean()) / data.tensors.shape[-1] / size

    @cached_property
    def _levels(self) -> Levels:
        return levels_of(self._discrete, Workspace()).levels

    @cached_property
    def _kernel(self) -> Array:
        """An orthonormal basis (n, q) of the unknowns of the motions."""
        free = np.asarray((self._field.lift @ self._field.free_motions.motions).toarray())
        return np.asarray(np.linalg.qr(free)[0])

    def solve(self, forces: Array, tolerance: float = TIGHTEST) -> Array:
        """The displacement (nodes, d) of balanced forces (nodes, d); any rigid motion may be added to it.

        By conjugate gradients with the multigrid cycle, on what is orthogonal to the motions.

        ``tolerance`` is the part of the forces that may be left.
        """
        right = self._deforming(np.asarray(self._field.basis.T @ forces.ravel()))
        levels, top = self._levels, len(self._levels.sizes) - 1
        A, diagonal, cycle = LevelMatrix(levels, top), levels.diagonal(top), levels.preconditioner(top)
        size = float(np.linalg.norm(right))

        def deforming(rest: Array) -> Array:
            check_time()
            return self._deforming(cycle(rest))

        with one_thread():
            solution = conjugate_gradients(
                A, diagonal, right, deforming, tolerance * size, _CYCLES, flexible=cycle.flexible
            ).solution
        left = float(np.linalg.norm(self._deforming(right - self._discrete.stiffness @ solution)))
        if not left <= max(SOLVED, 2.0 * tolerance) * size:
            raise MethodError(
                f"{_CYCLES} cycles of multigrid on the body without its contact leave {left / size:.2g} of the "
                "forces; state the body with cells of better shape"
            )
        return np.asarray(self._field.basis @ solution).reshape(self._shape)

    def _deforming(self, unknowns: Array) -> Array:
        """What of unknowns (n,) is orthogonal to the motions."""
        return np.asarray(unknowns - self._kernel @ (self._kernel.T @ unknowns))

    def in_words(self, coefficients: Array) -> str:
        """Motions by their coefficients (n, m); of each the part of the body that moves most is named."""
        words = []
        for one in coefficients.T:
            moved = np.concatenate([group.coefficients @ one[group.columns] for group in self._groups])
            words.append(describe(moved[int(np.argmax(np.linalg.norm(moved, axis=1)))])[1:-1])
        return ", ".join(words)
