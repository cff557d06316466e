"""Arc-length parametrisation of contact laws: the graph of each scalar component is a continuous curve.

The Clarke subdifferential of a scalar law is a connected curve in the plane of displacement r and multiplier lambda:
along its smooth pieces r moves, at its kinks lambda moves, upwards where the derivative jumps up and downwards where it
jumps down.  With a parameter theta along the curve, ``r = r(theta)`` and ``lambda = lambda(theta)``, the inclusion
``lambda in dj(r)`` disappears and stationarity is a square system of continuous equations,

    F(theta, t) = A r(theta) + W lambda(theta) - g(t) = 0,

piecewise affine for piecewise quadratic laws.  Enumeration, deflation and path following all work on it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import MethodError
from hemivar.laws import ContactLaw, Superpotential, separable
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.curves import ROUNDING, Curves, negative_eigenvalues
from hemivar.systems.segments import Segments, graph_segments, joined_rows

__all__ = ["Chain", "chain_of", "segments_at_most"]

_Kind = TypeVar("_Kind", bound="Chain")

#: Relative rounding of a zero of F where the Jacobian is nearly singular, at most.
_SAME = 1e-8


@dataclass(frozen=True, eq=False)
class Chain(Segments, Curves):
    """The curves of all free components, cut into segments: pieces of the law, and its kinks.

    Arrays have one row for each free component (n) and one column for each segment (S), padded.
    """

    system: CondensedProblem
    point: IntArray  # (n,)
    column: IntArray  # (n,): the local component

    @cached_property
    def matrix(self) -> Array:
        """A on the free components."""
        free = self.system.free
        return np.ascontiguousarray(self.system.matrix[np.ix_(free, free)])

    @cached_property
    def weights(self) -> Array:
        """Weight of each component."""
        return np.asarray(self.system.weights[self.point])

    @cached_property
    def tau(self) -> Array:
        """Compliance that turns a multiplier into a length, (n,)."""
        return self.lengths(self.system, self.point, self.column)

    @staticmethod
    def graph_law(system: CondensedProblem) -> ContactLaw:
        """The law whose graph the curves are."""
        return separable(system.law, "a load path")

    @staticmethod
    def lengths(system: CondensedProblem, point: IntArray, column: IntArray) -> Array:
        """tau, see there."""
        return np.asarray(system.compliance[point, np.minimum(column, 1)])

    @cached_property
    def force(self) -> Array:
        """g on the free components."""
        return np.asarray(self.system.load[self.system.free])

    @cached_property
    def length(self) -> float:
        """A typical displacement: of the load, of the laws' finite ends."""
        finite = np.concatenate([self.start[np.isfinite(self.start)], self.end[np.isfinite(self.end)]])
        return max(self.system.length_scale, float(np.abs(finite).max(initial=0.0)) * 1e-3)

    def evaluate(self, theta: Array, segment: IntArray) -> tuple[Array, Array, Array, Array]:
        """r, lambda, dr/dtheta and dlambda/dtheta of the given segments, continued beyond their ends.

        Here, in :meth:`balance` and in :meth:`out_of_balance` places are ``(n,)``, or several at once, ``(k, n)``.
        """
        kink = self.pick(self.kink, segment)
        step = theta - self.pick(self.origin, segment)
        value = self.pick(self.value, segment)
        r = np.where(kink, self.pick(self.knot, segment), value + step)
        affine = self.pick(self.affine, segment)
        base, slopes = self.affine_pieces
        slope, curvature = self.pick(base, segment) + self.pick(slopes, segment) * step, self.pick(slopes, segment)
        if not (affine | kink).all():
            curved = ~(affine | kink)
            exact, exact_curvature = self._law(self.pick(self.piece, segment), r)
            slope, curvature = np.where(curved, exact, slope), np.where(curved, exact_curvature, curvature)
        rate = self.pick(self.direction, segment) / self.tau
        lam = np.where(kink, value + rate * step, slope)
        return r, lam, np.where(kink, 0.0, 1.0), np.where(kink, rate, curvature)

    @cached_property
    def affine_pieces(self) -> tuple[Array, Array]:
        """lambda at the origin of each affine piece, and its slope, (n, S)."""
        base, slope = np.zeros(self.kink.shape), np.zeros(self.kink.shape)
        for s in range(self.kink.shape[1]):
            segment = np.minimum(np.full(self.size, s), self.count - 1)
            base[:, s], slope[:, s] = self._law(self.pick(self.piece, segment), self.pick(self.value, segment))
        return np.where(self.affine & ~self.kink, base, 0.0), np.where(self.affine & ~self.kink, slope, 0.0)

    def _law(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        (m, d), count = self.system.shape, r.size // max(self.size, 1)
        pieces, values = np.zeros((count, m, d), dtype=np.int64), np.zeros((count, m, d))
        pieces[:, self.point, self.column] = piece
        values[:, self.point, self.column] = r
        slope, curvature = np.zeros((count, m, d)), np.zeros((count, m, d))
        for c, law in enumerate(self._scalar_laws(count)):
            with np.errstate(all="ignore"):
                line = law.piece_line(pieces[..., c].ravel(), values[..., c].ravel())
            slope[..., c], curvature[..., c] = (value.reshape(count, m) for value in line)
        point, column = self.point, self.column
        return slope[:, point, column].reshape(r.shape), curvature[:, point, column].reshape(r.shape)

    @cached_property
    def _copied_laws(self) -> dict[int, tuple[Superpotential, ...]]:
        return {1: self.graph_law(self.system).scalar_laws(self.system.shape[1])}

    def _scalar_laws(self, count: int) -> tuple[Superpotential, ...]:
        """The scalar laws of so many copies of the contact points, one after the other."""
        if count not in self._copied_laws:
            self._copied_laws[count] = tuple(law.take(self.copied(count)) for law in self._scalar_laws(1))
        return self._copied_laws[count]

    def copied(self, count: int) -> IntArray:
        """The numbers of all contact points, so many times."""
        return np.tile(np.arange(self.system.shape[0]), count)

    def balance(self, theta: Array, segment: IntArray, force: Array) -> tuple[Array, Array]:
        """F and dF/dtheta on the given segments."""
        r, lam, dr, dlam = self.evaluate(theta, segment)
        jacobian = self.matrix * dr[..., None, :]
        jacobian[..., self._rows, self._rows] += self.weights * dlam
        return r @ self.matrix.T + self.weights * lam - force, jacobian

    def out_of_balance(self, theta: Array, segment: IntArray, force: Array) -> Array:
        """F on the given segments."""
        r, lam, _, _ = self.evaluate(theta, segment)
        return np.asarray(r @ self.matrix.T + self.weights * self.factors(r, lam) * lam - force)

    def local(self, theta: Array, segment: IntArray) -> tuple[Array, Array]:
        """Local displacement and multiplier (m, d) of all components; held ones as in the condensed problem."""
        r = self.system.fixed.copy()
        values, lam_values, _, _ = self.evaluate(theta, segment)
        r[self.point, self.column] = values
        lam = self.system.multiplier(r)
        lam[self.point, self.column] = self.factors(values, lam_values) * lam_values
        return r, lam

    def factors(self, r: Array, lam: Array) -> Array:
        """What the curve's lambda is to be multiplied with to give pressure or friction, all (n,)."""
        return np.ones(self.size)

    def balanced(self, theta: Array, segment: IntArray) -> tuple[Array, Array]:
        """Like :meth:`local` for a zero of F: at kinks the multiplier of equilibrium, free of the law's rounding."""
        r, lam = self.local(theta, segment)
        point, column = self.point, self.column
        values, lam_values, dr, _ = self.evaluate(theta, segment)
        from_balance = (self.force - self.matrix @ values) / self.weights
        factor = self.factors(values, lam_values)
        ends = np.stack([self.pick(self.low, segment), self.pick(self.high, segment)])
        ends = np.where(np.isfinite(ends), factor * np.where(np.isfinite(ends), ends, 0.0), ends)
        fixed = (dr == 0.0) & (from_balance >= ends.min(axis=0)) & (from_balance <= ends.max(axis=0))
        lam[point, column] = np.where(fixed, from_balance, lam[point, column])
        return r, lam

    def error(self, theta: Array, segment: IntArray) -> Array:
        """An estimate of the rounding error of r (m, d) at a zero of F."""
        r, _, dr, _ = self.evaluate(theta, segment)
        _, J = self.balance(theta, segment, self.force)
        doubt = self.forces(theta, segment, self.force)
        try:
            spread = np.abs(np.linalg.inv(J)) @ doubt
        except np.linalg.LinAlgError:
            spread = np.full(self.size, np.inf)
        with np.errstate(invalid="ignore"):
            moved = np.where(dr == 0.0, 0.0, np.minimum(ROUNDING * spread, _SAME * self.length))
        out = np.zeros(self.system.shape)
        out[self.point, self.column] = moved + ROUNDING * np.abs(r)
        return out

    def forces(self, theta: Array, segment: IntArray, force: Array) -> Array:
        """Sum of the sizes of all forces on each component, (n,): F is their difference."""
        r, lam, _, _ = self.evaluate(theta, segment)
        lam = self.factors(r, lam) * lam
        return np.asarray(np.abs(force) + np.abs(self.matrix) @ np.abs(r) + self.weights * np.abs(lam))

    def at(self, r: Array, lam: Array, segment: IntArray) -> Array:
        """theta of points ``(r, lam)`` of the given segments, (n,) each."""
        kink = self.pick(self.kink, segment)
        value, origin = self.pick(self.value, segment), self.pick(self.origin, segment)
        rate = self.pick(self.direction, segment) / self.tau
        return np.asarray(origin + np.where(kink, (lam - value) / rate, r - value))

    def between(self, segment: IntArray) -> IntArray:
        return segment

    def nearest(self, r: Array, lam: Array) -> tuple[Array, IntArray]:
        """theta and segment of the point of each curve nearest to ``(r, lam)``, both (m, d)."""
        r, lam = r[self.point, self.column], lam[self.point, self.column]
        best = np.full(self.size, np.inf)
        theta, segment = np.zeros(self.size), np.zeros(self.size, dtype=np.int64)
        for s in range(self.kink.shape[1]):
            choice = np.minimum(np.full(self.size, s), self.count - 1)
            at = np.clip(self.at(r, lam, choice), self.pick(self.start, choice), self.pick(self.end, choice))
            trial, trial_lam, _, _ = self.evaluate(at, choice)
            distance = np.abs(trial - r) + self.tau * np.abs(trial_lam - lam)
            closer = distance < best
            best = np.where(closer, distance, best)
            theta, segment = np.where(closer, at, theta), np.where(closer, choice, segment)
        return theta, segment

    def reduced_hessian(self, theta: Array, segment: IntArray) -> Array:
        """Second derivative of the energy in the components that are on a piece."""
        moving = ~self.pick(self.kink, segment)
        _, _, _, curvature = self.evaluate(theta, segment)
        H = self.matrix[np.ix_(moving, moving)].copy()
        H[np.diag_indices(len(H))] += (self.weights * curvature)[moving]
        return H

    def falls(self, segment: IntArray) -> BoolArray:
        """Which components are at a downward jump, (n,)."""
        return np.asarray(self.pick(self.kink, segment) & (self.pick(self.direction, segment) < 0.0))

    def stable(self, theta: Array, segment: IntArray) -> bool:
        """Whether the point is a local minimiser of the energy (to second order)."""
        return self.negative(theta, segment) == 0

    def negative(self, theta: Array, segment: IntArray) -> int:
        """Number of directions in which the energy falls (to second order), one for each component that jumps down."""
        return negative_eigenvalues(self.reduced_hessian(theta, segment)) + int(self.falls(segment).sum())

    def falls_beside(self, theta: Array, segment: IntArray) -> Array:
        """By how much the law of each component falls, over the stiffness of the body with all others held, (n,)."""
        kink = self.pick(self.kink, segment)
        fall = np.where(kink, 0.0, -self.evaluate(theta, segment)[3])
        least, stiffness = np.where(self.falls(segment), np.inf, fall), np.diagonal(self.matrix)
        without = np.where(least > 0.0, np.inf, 0.0)  # a body that nothing else holds has no stiffness
        return np.divide(least, stiffness, out=without, where=stiffness > 0.0)

    def load_of(self, system: CondensedProblem) -> Array:
        """g of the body under some load, (n,)."""
        return np.asarray(system.load[system.free])


def chain_of(system: CondensedProblem, kind: type[_Kind] = Chain) -> _Kind:  # type: ignore[assignment]
    """The curves of all free components of a condensed problem, of one kind or another.

    Raises MethodError: the slip of a point is a vector, as in space with friction.
    """
    m, d = system.shape
    if d > 2:
        raise MethodError(
            "the graph of the law is a curve only in one and two dimensions; this problem has three: take "
            "hemivar.solve or hemivar.find_solutions"
        )
    point, column = np.divmod(system.free, d)
    tau = kind.lengths(system, point, column)
    laws = kind.graph_law(system).scalar_laws(d)
    rows = [np.flatnonzero(column == c) for c in range(len(laws))]
    segments = joined_rows([graph_segments(law, m, point[i], tau[i]) for law, i in zip(laws, rows, strict=True)], rows)
    return kind(**vars(segments), system=system, point=point, column=column)


def segments_at_most(system: CondensedProblem) -> int:
    """Number of segments that :func:`chain_of` will lay out, at most."""
    counts = [2 * law.knots.shape[-1] + 1 for law in Chain.graph_law(system).scalar_laws(system.shape[1])]
    return int(np.bincount(system.free % system.shape[1], minlength=len(counts)) @ counts)
