"""Newton's equation of a condensed body, by dense factors that serve while the active set stays."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import scipy.linalg as la
from scipy.linalg import blas, lapack

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.systems.newton_equation import Accuracy, Correction, LinearisedPoint

__all__ = ["DenseBody", "DenseFactor", "DenseNewton", "descent_direction", "newton_matrix"]

#: Components up to which memory for matrices is kept.
_SMALL = 600


class DenseBody(Protocol):
    """What a dense equation is of: a :class:`hemivar.systems.condensed.CondensedProblem`."""

    @property
    def matrix(self) -> Array:
        """The stiffness (m d, m d)."""

    @property
    def weights(self) -> Array:
        """Weights of the contact points (m,)."""

    @property
    def active(self) -> BoolArray:
        """Components (m, d) that are free to move."""

    def couple(self, step: Array, /) -> Array:
        """The stiffness times a step (m, d)."""


@dataclass(eq=False)
class DenseFactor:
    """The factor of the last Newton matrix: of Cholesky, or of LU where the derivative is not symmetric.

    It serves as long as the components that move and the second derivatives of the laws stay.  Nothing in it changes an
    answer.  It belongs to one body and one thread: its memory is used again.
    """

    _known: tuple[bytes, tuple[Array, Array | None] | None] = field(default=(b"", None), repr=False)
    _room: Array | None = field(default=None, repr=False)

    def solve(
        self, body: DenseBody, index: IntArray, curvature: Array, right: Array, pushed: Array | None = None
    ) -> Array | None:
        """``H^-1 right`` (k,) on the components ``index``, with second derivatives of the laws (m, d) or (m, d, d).

        None where H is not positive definite.  With ``pushed (m, d)`` of :class:`LinearisedPoint` the matrix is not
        symmetric; then None where it is singular.
        """
        key = index.tobytes() + curvature.tobytes() + (b"" if pushed is None else pushed.tobytes())
        known, factors = self._known
        if known != key:
            self._known = b"", None  # its memory is used again
            H = self._part(body.matrix, index)
            _add_laws(H, body, index, curvature)
            if pushed is None:
                factor, failed = lapack.dpotrf(H.T, lower=1, clean=0, overwrite_a=1)  # symmetric: no copy is made
                factors = factor, None
            else:
                _push(H, body, index, pushed.ravel()[index])
                factor, pivots, failed = lapack.dgetrf(H.T, overwrite_a=1)
                factors = factor, pivots
            if failed:
                return None
            self._known = key, factors
        assert factors is not None
        factor, pivots = factors
        if pivots is not None:
            return np.asarray(lapack.dgetrs(factor, pivots, right, trans=1)[0])
        half = blas.dtrsv(factor, right, lower=1)  # half of what a solve for many takes
        return np.asarray(blas.dtrsv(factor, half, lower=1, trans=1, overwrite_x=1))

    def step(self, body: DenseBody, at: LinearisedPoint) -> Array | None:
        """The change (m, d) of a point that solves Newton's equation there; None where it has no solution."""
        index, pushed = np.flatnonzero(at.moving), at.pushed
        change = np.zeros(at.moving.shape)
        if not index.size:
            return change
        right = at.force - body.weights[:, None] * at.multiplier
        if pushed is not None:
            right -= pushed * right[:, :1]
        step = self.solve(body, index, at.curvature, right.ravel()[index], pushed)
        if step is None:
            return None
        change.ravel()[index] = step
        return change

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


@dataclass(frozen=True, eq=False)
class DenseNewton:
    """Newton's equation of a condensed body: Cholesky's factor, or eigenvectors where the matrix is indefinite."""

    body: DenseBody
    factor: DenseFactor = field(default_factory=DenseFactor)

    def solve(self, at: LinearisedPoint, accuracy: Accuracy) -> Correction:
        """The correction; where the matrix is indefinite, a direction of descent of the same length scale."""
        if not at.moving.any():
            return Correction(np.zeros(at.moving.shape), np.zeros(at.moving.shape), 0)
        step = self.factor.step(self.body, at)
        if step is not None:
            return Correction(step, self.body.couple(step), 1)
        if at.pushed is not None:
            return Correction(np.full(at.moving.shape, np.nan), at.force, 1)
        index, step = np.flatnonzero(at.moving), np.zeros(at.moving.shape)
        right = (at.force - self.body.weights[:, None] * at.multiplier).ravel()[index]
        step.ravel()[index] = descent_direction(newton_matrix(self.body, index, at.curvature), right)
        return Correction(step, self.body.couple(step), 1, convex=False)

    def negative_curvature(self, at: LinearisedPoint) -> Array | None:
        """The eigenvector of the lowest eigenvalue, if that is negative."""
        index = np.flatnonzero(at.moving.ravel())
        if not index.size:
            return None
        H = newton_matrix(self.body, index, at.curvature)
        if self.factor.solve(self.body, index, at.curvature, np.zeros(index.size)) is not None:
            return None
        values, vectors = la.eigh(H, subset_by_index=[0, 0], check_finite=False)
        if values[0] >= -1e-12 * float(np.abs(H).max()):
            return None
        direction = np.zeros(at.r.shape)
        direction.ravel()[index] = vectors[:, 0]
        return direction

    def release(self) -> None:
        """Nothing is borrowed."""


def newton_matrix(body: DenseBody, index: IntArray, hessian: Array) -> Array:
    """Hessian (k, k) of the energy on the components ``index``, those of the laws being given, (m, d) or (m, d, d)."""
    H = np.asarray(body.matrix[np.ix_(index, index)])
    _add_laws(H, body, index, hessian)
    return H


def descent_direction(H: Array, g: Array) -> Array:
    """``|H|^-1 g``: eigenvalues count by their sizes, so that steps along negative curvature are as long as others."""
    values, vectors = la.eigh(H, check_finite=False)
    floor = 1e-10 * float(np.abs(values).max(initial=1.0))
    return np.asarray(vectors @ ((vectors.T @ g) / np.maximum(np.abs(values), floor)))


def _add_laws(H: Array, body: DenseBody, index: IntArray, curvature: Array) -> None:
    """Add second derivatives (m, d) or (m, d, d) of the laws to a matrix (k, k) of the components ``index``."""
    if curvature.ndim == 2:
        H.ravel()[:: index.size + 1] += (body.weights[:, None] * curvature).ravel()[index]
        return
    m, d = body.active.shape
    point, component = np.divmod(index, d)
    position = np.full((m, d), -1)
    position[point, component] = np.arange(index.size)
    partner = position[point]  # (k, d)
    row, column = np.nonzero(partner >= 0)
    here = point[row]
    H[row, partner[row, column]] += body.weights[here] * curvature[here, component[row], column]


def _push(H: Array, body: DenseBody, index: IntArray, pushed: Array) -> None:
    """Take off what bounds owe to the forces along held normals: multiples (k,) of the rows of these normals."""
    rows = np.flatnonzero(pushed)
    if rows.size:
        d = body.active.shape[1]
        normal = index[rows] // d * d
        H[rows] -= pushed[rows, None] * body.matrix[np.ix_(normal, index)]
