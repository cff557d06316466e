"""Static condensation: the discrete problem reduced to the local displacements of its contact points."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from hemivar.basics.arrays import SOLVED, real_array
from hemivar.basics.first_use import cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.free_motion import free_growth
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.recession import RecessionFunction, growth_along
from hemivar.discrete.residual import LoadScale, Residual, load_scale, residuals
from hemivar.discrete.rigid_part import RigidPart
from hemivar.errors import ProblemError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import at_normal_kink
from hemivar.linear.factor_memory import check_memory, shortage
from hemivar.systems.contact_system import OfProblem
from hemivar.systems.dense_newton import DenseNewton
from hemivar.systems.elimination import Recovery, SchurComplement
from hemivar.systems.newton_equation import NewtonEquation

__all__ = ["CondensedProblem", "condense"]

#: Gaps this many times larger than the displacements are far.
_FAR = 1e4
#: Part of a gap by which local displacements may differ by rounding.
_SAME = 4.0 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class CondensedProblem(OfProblem, PickleMixin):
    """Energy of the contact unknowns alone: ``1/2 r'A r - g'r + sum_j w_j j(r_j) + constant``.

    ``r (m, d)`` are the local displacements (penetration and slip).  All other unknowns have been eliminated, so
    that minimising this energy is minimising E(u).  Its points are these, or displacements ``r + origin`` of the
    contact points (:attr:`displaced`), which have more digits where gaps are far larger than they.

    Attributes
    ----------
    problem : DiscreteProblem
        Where it comes from.
    matrix : array (m d, m d)
        A, symmetric; rows and columns of components that a support fixes are zero.
    load : array (m d,)
        g.
    active : bool array (m, d)
        Components that are free to move.
    fixed : array (m, d)
        Values of the components that are not.
    constant : float
        Energy that does not depend on r.
    rest_energy : float
        Elastic energy of the body under its load when r = 0 (strictly: when all contact unknowns are held at zero).
    seconds : float
        Time the condensation took.
    origin : array (m, d) or None
        What is taken off a point to make local displacements; None where points are these.
    """

    problem: DiscreteProblem
    matrix: Array
    load: Array
    active: BoolArray
    fixed: Array
    constant: float
    rest_energy: float
    seconds: float
    _recovery: Recovery
    origin: Array | None = None

    def __reduce__(self) -> tuple[Callable[[DiscreteProblem], CondensedProblem], tuple[DiscreteProblem]]:
        return condense, (self.problem,)  # factors cannot travel: they are made again on arrival

    def __deepcopy__(self, memo: dict[int, object]) -> CondensedProblem:
        return condense(copy.deepcopy(self.problem, memo))

    # ---- views -----------------------------------------------------------------------------------------

    @property
    def shape(self) -> tuple[int, int]:
        """Contact points m and components d."""
        return self.active.shape[0], self.active.shape[1]

    @cached_property
    def free(self) -> IntArray:
        """Indices of the free components in a flattened ``r``."""
        return np.flatnonzero(self.active.ravel())

    @property
    def body(self) -> SchurComplement:
        """What the condensation has made of stiffness and trace alone."""
        return self._recovery.body

    @property
    def diagonal(self) -> Array:
        """Stiffness of every component when all others are held, one number for the tangential ones, (m, d)."""
        return self.body.diagonal

    @property
    def lambda_max(self) -> float:
        """Largest eigenvalue of the matrix scaled by its diagonal."""
        return self.body.lambda_max

    def couple(self, step: Array) -> Array:
        """Elastic force ``A step`` (m, d) that a step (m, d) of the local displacements takes away."""
        return np.asarray(self.matrix @ step.ravel()).reshape(step.shape)

    @property
    def blocks(self) -> Array:
        """Stiffness between the components of each point, (m, d, d)."""
        m, d = self.shape
        return np.asarray(self.matrix.reshape(m, d, m, d)[np.arange(m), :, np.arange(m), :])

    @cached_property
    def compliance(self) -> Array:
        """Displacement for a unit pressure at a point when all other contact points are held, (m, 2)."""
        d = self.shape[1]
        return np.asarray(self.weights[:, None] / self.diagonal[:, [0, min(1, d - 1)]])

    @cached_property
    def rigid_modes(self) -> Array:
        """Directions of the free components in which the body moves without deforming, (k, free.size).

        Those of mesh and supports; of a stiffness without a mesh, its eigenvectors with eigenvalue zero up to rounding.
        """
        known = self.body.free_unknowns
        if known is not None:
            return np.asarray((self.problem.contact.trace[self.free] @ known).T)
        A = self.matrix[np.ix_(self.free, self.free)]
        if self.free.size == 0:
            return np.zeros((0, 0))
        scale = 1.0 / np.sqrt(self.diagonal.ravel()[self.free])
        scaled = scale[:, None] * A * scale
        try:
            factor, _ = la.cho_factor(scaled)
            if np.diagonal(factor).min() > 1e-6:
                return np.zeros((0, self.free.size))
        except la.LinAlgError:
            pass
        values, vectors = la.eigh(scaled)
        return np.asarray((scale[:, None] * vectors[:, values < 1e-11]).T)

    def free_growth(self) -> list[RecessionFunction]:
        """Growth of the energy along the motions that deform nothing, by groups of parts that move by themselves."""
        if self.body.free_unknowns is not None and not self.body.free_unknowns.shape[1]:
            return []
        if self.body.free_unknowns is not None:
            return free_growth(self.problem, self.problem.model.free_motions)
        modes = self.rigid_modes
        if not len(modes):
            return []
        local = np.zeros((*self.shape, len(modes)))
        local.reshape(-1, len(modes))[self.free] = modes.T
        moved = np.stack([self._recovery.linear(r) for r in local.transpose(2, 0, 1)], axis=1)
        load = self.problem.load
        size = float(np.abs(load) @ np.abs(moved).max(axis=1))
        return [growth_along(self.law, local, self.weights, moved.T @ load, size, SOLVED)]

    @cached_property
    def length_scale(self) -> float:
        """A typical displacement, for methods that work on scaled unknowns."""
        size = max(float(np.abs(self.fixed).max(initial=0.0)), float(np.abs(self.problem.gap).max(initial=0.0)))
        if self.free.size:
            A = self.matrix[np.ix_(self.free, self.free)]
            sprung = A + 1e-3 * np.diag(self.diagonal.ravel()[self.free])
            moved: Array = np.asarray(la.solve(sprung, self.load[self.free], assume_a="pos"))
            size = max(size, float(np.abs(moved).max()))
        return size if size > 0.0 else 1.0

    @cached_property
    def pressure_scale(self) -> float:
        """A typical multiplier."""
        scale = float(np.linalg.norm(self.load) / np.linalg.norm(self.weights)) if self.weights.size else 0.0
        return scale if scale > 0.0 else 1.0

    @property
    def displaced(self) -> CondensedProblem:
        """The same, its points being displacements of the contact points: their digits do not depend on gaps."""
        if self.origin is not None:
            return self
        recovery, origin = self._recovery, self._recovery.offset.reshape(self.shape)
        return replace(
            self,
            load=self.body.gathered(recovery.reduced.force),
            constant=_own_constant(self.problem, recovery, self.rest_energy),
            origin=origin,
            _recovery=replace(recovery, offset=np.zeros_like(recovery.offset)),
        )

    def local(self, x: Array) -> Array:
        """Local displacements (m, d) of a point."""
        return x if self.origin is None else x - self.origin

    def of_unknowns(self, unknowns: Array) -> Array:
        """The point of the unknowns (n,)."""
        if self.origin is None:
            return self.problem.local(unknowns)
        return np.where(self.active, self.problem.contact.trace_of(unknowns), self.fixed)

    # ---- energy and balance -----------------------------------------------------------------------------

    def energy_norm(self, r: Array) -> float:
        """``sqrt(u'K u)`` of the displacement with local displacements ``r``."""
        square = float(r.ravel() @ (self.matrix @ r.ravel())) + 2.0 * self.rest_energy
        return float(np.sqrt(max(square, 0.0)))

    def stretch(self, change: Array) -> float:
        """Energy norm of a difference of two local displacements, the rest of the body following."""
        flat = change.ravel()
        return float(np.sqrt(max(float(flat @ (self.matrix @ flat)), 0.0)))

    def start(self, guess: Array | None = None) -> Array:
        """An admissible starting point ``(m, d)`` near ``guess``, or near zero displacement."""
        if guess is None:
            guess = -self.problem.offset.reshape(self.shape) if self.origin is None else np.zeros(self.shape)
        x = np.where(self.active, real_array(guess, "the starting point", finite=False), self.fixed)
        return self.moved(x, np.where(self.active, self.law.admissible(self.local(x)), self.fixed))

    def out_of_balance(self, r: Array) -> Array:
        """Elastic force ``g - A r`` on the contact points, (m, d); it must equal ``W lambda``."""
        return (self.load - self.matrix @ self._strained(r)[0]).reshape(self.shape)

    def _strained(self, r: Array) -> tuple[Array, Array]:
        """A point (m d,) without its rigid part, and the sizes of what is left; see :class:`RigidPart`."""
        rigid, flat = self.body.rigid_part, r.ravel()
        if not rigid.count:
            return flat, np.abs(flat)
        return rigid.without(flat, self.problem.kept_apart(self.local(r)), self._recovery.offset)

    def moved(self, x: Array, r: Array) -> Array:
        """The point with these local displacements; what differs by rounding alone stays, but for what is at a kink."""
        if self.origin is None:
            return r
        same = np.abs(r - self.local(x)) <= _SAME * np.abs(self.origin)
        same[:, 0] &= ~at_normal_kink(self.law, r)
        same[:, 1:] &= r[:, 1:] != 0.0
        return np.where(same, x, r + self.origin)

    def multiply(self, change: Array) -> Array:
        """Elastic force (m, d) that a change (m, d) of a point takes away."""
        return self.couple(change)

    def multiply_contact(self, change: Array) -> Array:
        """The same: contact points are all there is."""
        return self.couple(change)

    def refreshed(self, x: Array, force: Array) -> Array:
        """The force out of balance, computed again: it is cheap here, and loses no digits over many steps."""
        return self.out_of_balance(x)

    def newton_equation(self, known: NewtonEquation | None = None) -> DenseNewton:
        """Newton's equation, for one solve."""
        return DenseNewton(self)

    def at_contact(self, force: Array) -> Array:
        """A force (m, d), which acts on contact points."""
        return force

    def less_contact(self, force: Array, contact: Array) -> Array:
        """What is left of a force (m, d) where contact points take up theirs, (m d,)."""
        return np.where(self.active, force - contact, 0.0).ravel()

    def rounding_sizes(self, r: Array) -> Array:
        """Sizes of what is added up in :meth:`out_of_balance`, (m d,)."""
        return np.asarray(self.body.sizes @ np.abs(r.ravel()) + np.abs(self.load))

    def answer_sizes(self, r: Array) -> Array:  # type: ignore[override]
        return np.asarray(self.body.sizes @ self._strained(r)[1] + np.abs(self.load))

    def magnitude(self, r: Array) -> float:
        """Largest displacement or gap of the contact points."""
        return float(max(np.abs(r).max(initial=0.0), np.abs(self.problem.offset).max(initial=0.0)))

    @property
    def material_compliance(self) -> Array:
        """Displacement for a unit pressure at a point when all other unknowns are held, (m, 2)."""
        return self.body.compliance

    @cached_property
    def load_scale(self) -> LoadScale:
        """What residuals are held against."""
        problem, (law, offset, rest) = self.problem, self.body.last_rest[0]
        same = law is problem.law and offset is problem.offset
        scale = load_scale(problem, self.body.compliance, rest if same else None)
        if not same:
            self.body.last_rest[0] = problem.law, problem.offset, scale.rest
        return scale

    # ---- the same body otherwise ---------------------------------------------------------------------------

    def for_problem(self, problem: DiscreteProblem) -> CondensedProblem:
        """The condensation of the same body under another load, gap or law, without a new factorisation.

        Parameters
        ----------
        problem : DiscreteProblem
            With the same stiffness, trace and weights.
        """
        old = self.problem
        if (problem.unknowns, problem.contact.count) != (old.unknowns, old.contact.count):
            raise ProblemError("the other problem is of another size; condense it separately")
        began = time.perf_counter()
        if problem is old:
            return self
        if problem.model is old.model and problem.load is old.load and problem.offset is old.offset:
            return replace(self, problem=problem, seconds=0.0)
        other = _under(self.body, problem, began)
        return other if self.origin is None else other.displaced

    def resisted(self, springs: Array, rest: Array) -> CondensedProblem:
        """The same with springs (m d, m d) between its contact points, which do nothing at a place (m, d): for points
        alone, energies and the way back being those of the body without them."""
        matrix = self.matrix + springs
        body = replace(self.body, matrix=matrix, rigid_part=RigidPart.none(len(matrix)))
        recovery = replace(self._recovery, body=body)
        return replace(self, matrix=matrix, load=self.load + springs @ rest.ravel(), _recovery=recovery)

    def with_law(self, law: VectorLaw) -> CondensedProblem:
        """The same body on another foundation."""
        return self.for_problem(self.problem.with_(law=law))

    # ---- the way back --------------------------------------------------------------------------------------

    def unknowns(self, r: Array) -> Array:
        """All unknowns u (n,) in equilibrium with the point ``r (m, d)``."""
        return self._recovery(r)

    def follow(self, change: Array) -> Array:
        """Change of all unknowns (n,) that goes with a change (m, d) of the local displacements alone."""
        return self._recovery.linear(change)

    def spread_force(self, force: Array, reaction: Callable[[DiscreteProblem, Array], Array]) -> tuple[Array, Array]:
        """A small force (n,) taken up by the unknowns that no contact point sees: their change (n,), and what is left.

        ``reaction`` gives the contact forces (m, d) of a force (n,).
        """
        inner = self.body.factor.solve_interior(force)
        return inner, reaction(self.problem, force - self.problem.stiffness @ inner)

    def recover(self, r: Array, *multipliers: Array) -> tuple[Array, list[Residual]]:
        """All unknowns u (n,) from a point, with the residual of the full problem for each multiplier.

        It costs one sparse solve, and another where the elimination leaves more than the iteration has, and more than
        rounding explains, for the first multiplier.
        """
        u, lam = self._recovery(r), multipliers[0]
        residuals = self._residuals(u, multipliers)
        if not residuals[0].total <= max(self.residual(r, lam).total, residuals[0].rounding):
            refined = u + self.body.factor.solve_interior(self._out_of_balance(u, lam))
            better = self._residuals(refined, multipliers)
            if better[0].total < residuals[0].total:
                u, residuals = refined, better
        sharper = self._sharpened(u, self.local(r), lam)
        if sharper is not None and sharper[1].total < residuals[0].total:
            return sharper[0], self._residuals(sharper[0], multipliers)
        return u, residuals

    def _residuals(self, u: Array, multipliers: Sequence[Array]) -> list[Residual]:
        return residuals(self.problem, u, multipliers, self.body.compliance, self.load_scale)

    def _out_of_balance(self, u: Array, lam: Array) -> Array:
        """Force (n,) that is left on the unknowns."""
        return self.problem.out_of_balance(u) - self.problem.contact_force(lam)

    def _sharpened(self, u: Array, r: Array, lam: Array) -> tuple[Array, Residual] | None:
        """Equilibrium of the contact points that are far from the foundation, where r is the gap and u is lost in it.

        With its residual for the multiplier of the law, which must not depend on r there.  None where no gap is that
        large, or where the points are not held.
        """
        offset = self.problem.offset.reshape(self.shape)
        moved = float(np.abs(r + offset)[self.active].max(initial=0.0))
        if moved == 0.0:
            return None
        balanced = self._without_contact(u, r, lam, self.active & (np.abs(offset) > _FAR * moved))
        return None if balanced is None else (balanced[0], self._residuals(balanced[0], [balanced[1]])[0])

    def at_a_distance(self) -> tuple[Array, Array, Residual] | None:
        """The answer where the body stays so far from its foundation that u is lost in the rounding of ``B u - g``.

        No contact point comes to another piece of its law then, so that the answer is that of linear equations in u.

        Returns
        -------
        (u, multiplier, residual) or None
            Displacement (n,) and multiplier (m, d); None where a point is not free to move in the law's own direction.
        """
        offset = self.problem.offset.reshape(self.shape)
        x = self.start()
        balanced = self._without_contact(
            self._recovery(x), self.local(x), self.multiplier(x), self.active & (offset != 0.0)
        )
        if balanced is None:
            return None
        u, lam, at_kink = balanced
        taken = np.asarray(self.body.spread.T @ self._out_of_balance(u, lam)[self.body.kept]).reshape(self.shape)
        lam = np.where(at_kink, lam + taken / self.weights[:, None], lam)
        return u, lam, self._residuals(u, [lam])[0]

    def _without_contact(self, u: Array, r: Array, lam: Array, far: BoolArray) -> tuple[Array, Array, BoolArray] | None:
        """``u`` with balance in all components on which the law does not depend, if ``far`` ones are among them.

        With the multiplier of the law, and the active components (m, d) that are held at a kink.
        """
        if not far.any():
            return None
        law = self.law_at(r, lam)
        lam = np.where(self.active, law.nearest_multiplier(r, lam), lam)
        smooth = law.linearise(r)
        flat = smooth.smooth[:, [0] + [1] * (self.shape[1] - 1)]
        at_kink = self.active & ~flat
        flat &= np.abs(smooth.hessian).sum(axis=2) == 0.0
        free = np.flatnonzero((self.active & flat).ravel())
        if not far.ravel()[free].any():
            return None
        rest, body = self._out_of_balance(u, lam), self.body
        inner = body.factor.solve_interior(rest)
        reduced = (rest - self.problem.stiffness @ inner)[body.kept]
        try:
            factor = la.cho_factor(self.matrix[np.ix_(free, free)])
        except la.LinAlgError:
            return None
        change = np.zeros(self.active.size)
        change[free] = la.cho_solve(factor, np.asarray(body.spread.T @ reduced)[free])
        return u + inner + self._recovery.linear(change), lam, at_kink


def condense(problem: ProblemLike, many: bool = False) -> CondensedProblem:
    """Eliminate every unknown that no contact law acts on (the survey's Schur complement, section 5.2).

    Costs one sparse factorisation.  Where the trace selects single unknowns (nodal quadrature) the contact unknowns
    are kept as they are; otherwise (midpoints, arrays of the user's) they are changed for the local displacements
    by an orthogonal factorisation of the trace, and what is left over is eliminated as well.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
    many : bool
        The same body will be asked for under many loads: the factors are split in two for a fourth of their price,
        and every load and its way back cost half of a sparse solve each.

    Returns
    -------
    CondensedProblem

    Raises
    ------
    ProblemError
        The interior is singular (part of the body can move freely), the stiffness has a negative eigenvalue, or contact
        rows depend on one another.
    MethodError
        The memory that is free does not suffice.
    """
    problem = as_discrete(problem, "condense")
    began = time.perf_counter()
    contact = problem.contact_points * problem.contact.components
    check_memory(problem.unknowns, problem.contact.components, contact, many)
    try:
        return _under(SchurComplement.of(problem, many), problem, began)
    except MemoryError:
        raise shortage(problem.unknowns, problem.contact.trace.nnz) from None


def _under(body: SchurComplement, problem: DiscreteProblem, began: float) -> CondensedProblem:
    """The condensation of a body under the load and the gap of a problem."""
    recovery, rest_energy = body.under(problem)
    constant = _own_constant(problem, recovery, rest_energy)
    force = body.gathered(recovery.reduced.force)
    # From contact unknowns y = r + offset to r.
    offset = recovery.offset
    bent, fixed = body.matrix @ offset, body.nothing
    if not body.everywhere:
        fixed = np.where(body.active, 0.0, -problem.offset.reshape(body.active.shape))
    constant += 0.5 * float(offset @ bent) - float(force @ offset)
    return CondensedProblem(
        problem,
        body.matrix,
        force - bent,
        body.active,
        fixed,
        constant,
        rest_energy,
        time.perf_counter() - began,
        recovery,
    )


def _own_constant(problem: DiscreteProblem, recovery: Recovery, rest_energy: float) -> float:
    """Energy that does not depend on the displacements of the contact points."""
    return problem.constant - rest_energy - 0.5 * float(recovery.shift @ recovery.reduced.force)
