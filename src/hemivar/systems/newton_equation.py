"""Newton's equation on the components of a point that are off the kinks of their laws, as a method asks for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray
from hemivar.laws.separate import GraphPosition
from hemivar.laws.vector_law import Linearisation, Near
from hemivar.systems.contact_moves import ContactBody, smooth_components

__all__ = ["Accuracy", "Correction", "GraphPoint", "LinearisedPoint", "NewtonEquation"]


@dataclass(frozen=True, eq=False)
class LinearisedPoint:
    """A point with the derivatives of the laws there.

    Attributes
    ----------
    x : array (m, d) or (n,)
        The point of the system.
    force : array of the shape of x
        Load minus elastic force at x.
    r : array (m, d)
        Its local displacements.
    near : Near
        The law on the pieces on which r lies.
    line : Linearisation
        Derivatives of the laws at r.
    moving : bool array (m, d)
        Components that are free and off the kinks.
    """

    x: Array
    force: Array
    r: Array
    line: Linearisation
    moving: BoolArray
    _body: ContactBody

    @staticmethod
    def of(body: ContactBody, x: Array, r: Array, force: Array) -> LinearisedPoint:
        """The point ``x`` with local displacements ``r``, where the body leaves ``force`` of its load."""
        line = body.law.linearise(r)
        return LinearisedPoint(x, force, r, line, smooth_components(line, body.active), body)

    @cached_property
    def near(self) -> Near:
        """The law on the pieces on which r lies."""
        return self._body.law.near(self.r)


@dataclass(frozen=True, eq=False)
class Accuracy:
    """How accurately an iterative method solves Newton's equation; a direct one does not ask.

    Attributes
    ----------
    tolerance : float
        Of the residual, relative to the load.
    absolute : float
        Beside it, in units of force.
    iterations : int
        Most iterations.
    due : callable or None
        If given, the iteration may end as soon as the residual is below that of the contact conditions, and ends where
        this is not zero.
    share : float
        Part of the forces by which the contact conditions fail that may be left then.
    """

    tolerance: float
    absolute: float
    iterations: int
    due: Callable[[], float] | None = None
    share: float = 1.0


@dataclass(frozen=True, eq=False)
class Correction:
    """A solution of Newton's equation.

    Attributes
    ----------
    step : array of the shape of a point
        The correction; zero in components at kinks.
    bent : array of the shape of a point
        Elastic force that it takes away.
    cycles : int
        Iterations that it took, 1 for a direct method, 0 where nothing moves.
    convex : bool
        False where the matrix is indefinite and the step a direction of descent instead.
    negative : array or None
        A direction along which the matrix has no positive curvature, where an iterative method met one.
    """

    step: Array
    bent: Array
    cycles: int
    convex: bool = True
    negative: Array | None = None


@dataclass(frozen=True, eq=False)
class GraphPoint:
    """A point whose contact points lie on the graphs of their laws, which may follow from the state.

    Attributes
    ----------
    x : array (m, d) or (n,)
        The point of the system.
    force : array of the shape of x
        Load minus elastic force at x.
    on : GraphPosition
        The law there.
    free : bool array (m, d)
        Components that move.
    """

    x: Array
    force: Array
    on: GraphPosition
    free: BoolArray


class NewtonEquation(Protocol):
    """Newton's equation of one system; it belongs to one solve."""

    def generalised(self, at: GraphPoint, accuracy: Accuracy) -> tuple[Array, int] | None:
        """The change of a point by the generalised derivative of the laws, which need not be symmetric, and the cycles;
        None where it is singular."""
        ...

    def solve(self, at: LinearisedPoint, accuracy: Accuracy) -> Correction:
        """The correction of a point."""
        ...

    def negative_curvature(self, at: LinearisedPoint) -> Array | None:
        """The direction of most negative curvature; None where there is none, or where it would cost too much."""
        ...

    def release(self) -> None:
        """Give its memory back."""
        ...
