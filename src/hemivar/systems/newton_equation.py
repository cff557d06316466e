"""Newton's equation on the active set, the components off the kinks of their laws, as a method asks for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.laws.vector_law import Linearisation, OnGraph, VectorLaw

__all__ = ["Accuracy", "Correction", "LinearisedPoint", "NewtonEquation", "UnderLaw", "smooth_components"]

#: Part of ``a`` below which a compliance, or a second derivative, is rounding; and what is none beside others.
_NONE, _SINGULAR = 4.0 * float(np.finfo(float).eps), 1e-13


class UnderLaw(Protocol):
    """What is linearised: a :class:`hemivar.systems.contact_system.ContactSystem`."""

    @property
    def law(self) -> VectorLaw:
        """The contact law."""

    @property
    def active(self) -> BoolArray:
        """Components (m, d) that are free to move."""


@dataclass(frozen=True, eq=False)
class LinearisedPoint:
    """A point with the derivatives of the laws there."""

    x: Array  # (m, d) or (n,): the point of the system
    force: Array  # of the shape of x: load minus elastic force at x
    r: Array  # (m, d): its local displacements
    multiplier: Array  # (m, d): derivative of the laws at r
    curvature: Array  # (m, d) or (m, d, d): second derivatives, at the components that move
    moving: BoolArray  # (m, d): components that are free and off the kinks
    body: UnderLaw
    # what a force along the normal adds to the multiplier of each tangential component of its point, (m, d), where the
    # normal component is held and a bound follows its force; None where the derivative is symmetric
    pushed: Array | None = None

    @staticmethod
    def of(body: UnderLaw, x: Array, r: Array, force: Array) -> LinearisedPoint:
        """The point ``x`` with local displacements ``r``, where the body leaves ``force`` of its load."""
        line = body.law.linearise(r)
        return LinearisedPoint(x, force, r, line.gradient, line.hessian, smooth_components(line, body.active), body)

    @staticmethod
    def on_graph(body: UnderLaw, x: Array, force: Array, on: OnGraph, stiffness: Array) -> LinearisedPoint:
        """The point whose contact points are on the graphs of their laws, ``stiffness (m, d)`` being that of the chart.

        A component whose place p does not change is held there.  Between the others ``dlam = (D^-1 - a) dr``.
        """
        at_kink, curvature, pushed = _slopes(on.jacobian, stiffness)
        moving = body.active & ~at_kink
        if not body.law.state_dependent:
            return LinearisedPoint(x, force, on.r, on.multiplier, curvature, moving, body)
        pushed = np.where(moving & body.active[:, :1], pushed, 0.0)
        return LinearisedPoint(x, force, on.r, on.multiplier, curvature, moving, body, pushed)

    def clamp(self, end: Array) -> Array:
        """``end (m, d)``, cut back to the pieces of the laws on which r lies; what does not move stays where it is."""
        return np.where(self.moving, self.body.law.clamp(self.r, end), self.r)

    @property
    def blocks(self) -> Array:
        """The second derivatives as a matrix (m, d, d) for each point."""
        return self.curvature if self.curvature.ndim == 3 else self.curvature[:, :, None] * np.eye(self.r.shape[1])


def smooth_components(line: Linearisation, active: BoolArray) -> BoolArray:
    """Components (m, d) on which the law is smooth where it has been linearised, and that are free to move."""
    smooth = np.repeat(line.smooth, [1, active.shape[1] - 1], axis=1)
    return np.asarray(active & smooth)


def _slopes(jacobian: Array, stiffness: Array) -> tuple[BoolArray, Array, Array]:
    """Which components are held, second derivatives, and what forces along held normals push; see
    :class:`LinearisedPoint`."""
    m, d = stiffness.shape
    pushed = np.zeros((m, d))
    if d > 2 or (d == 2 and jacobian[:, 0, 1].any()):
        at_kink, inverse = _inverse(jacobian, stiffness)
        pushed -= np.einsum("mij,mj->mi", inverse, np.where(at_kink[:, :1], jacobian[:, :, 0], 0.0))
        return at_kink, _less(inverse, np.where(at_kink, 0.0, stiffness)[:, :, None] * np.eye(d)), pushed
    diagonal = jacobian.reshape(m, d * d)[:, :: d + 1]
    at_kink = np.abs(diagonal) * stiffness <= _NONE
    inverse = 1.0 / np.where(at_kink, np.inf, diagonal)
    curvature = _less(inverse, np.where(at_kink, 0.0, stiffness))
    if d == 1 or not (follows := jacobian[:, 1, 0]).any():
        return at_kink, curvature, pushed
    column = -inverse[:, 1] * follows
    pushed[:, 1] = np.where(at_kink[:, 0], column, 0.0)
    blocks = np.zeros((m, 4))
    blocks[:, ::3], blocks[:, 2] = curvature, column * inverse[:, 0]
    return at_kink, blocks.reshape(m, 2, 2), pushed


def _less(inverse: Array, a: Array) -> Array:
    """The difference, rounding left out."""
    difference = inverse - a
    difference[np.abs(difference) <= _NONE * a] = 0.0
    return difference


def _inverse(blocks: Array, stiffness: Array) -> tuple[BoolArray, Array]:
    """Which components (m, d) do not move with p, and the inverses (m, d, d) of derivatives between the others.

    Where one is singular it is that of a matrix nearby: a point that is held along an oblique direction is very stiff
    there.
    """
    at_kink = (np.abs(blocks) * stiffness[:, None, :]).max(axis=2) <= _NONE
    free, unit = ~at_kink[:, :, None] & ~at_kink[:, None, :], np.eye(at_kink.shape[1])
    blocks = np.where(free, blocks, unit)
    scale = 1.0 / np.sqrt(np.abs(np.einsum("mii->mi", blocks)))
    scales = scale[:, :, None] * scale[:, None, :]
    scaled = blocks * scales
    scaled += np.where(np.abs(np.linalg.det(scaled)) <= _SINGULAR, _SINGULAR, 0.0)[:, None, None] * unit
    return at_kink, np.where(free, np.linalg.inv(scaled) * scales, 0.0)


@dataclass(frozen=True, eq=False)
class Accuracy:
    """How accurately an iterative method solves Newton's equation; a direct one does not ask."""

    tolerance: float  # of the residual, relative to the load
    absolute: float  # beside it, in units of force
    iterations: int  # most iterations
    # if given, the iteration may end as soon as the residual is below that of the contact conditions, and ends where
    # this is not zero
    due: Callable[[], float] | None = None
    share: float = 1.0  # part of the forces by which the contact conditions fail that may be left then


@dataclass(frozen=True, eq=False)
class Correction:
    """A solution of Newton's equation."""

    step: Array  # of the shape of a point: the correction; zero in components at kinks
    bent: Array  # of the shape of a point: elastic force that it takes away
    cycles: int  # iterations that it took, 1 for a direct method, 0 where nothing moves
    convex: bool = True  # False where the matrix is indefinite and the step a direction of descent instead
    # A direction along which the matrix has no positive curvature, where an iterative method met one
    negative: Array | None = None


class NewtonEquation(Protocol):
    """Newton's equation of one system; it belongs to one solve."""

    def solve(self, at: LinearisedPoint, accuracy: Accuracy) -> Correction:
        """The correction of a point; not finite where a derivative that is not symmetric is singular."""

    def negative_curvature(self, at: LinearisedPoint) -> Array | None:
        """The direction of most negative curvature; None where there is none, or where it would cost too much."""

    def release(self) -> None:
        """Give its memory back."""
