"""The default method on small bodies: truncated nonsmooth Newton on the body condensed onto its contact points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from hemivar.solvers.truncated_newton import TruncatedNewton
from hemivar.systems.contact_moves import Search

__all__ = ["NonsmoothNewton", "Search"]


@dataclass(frozen=True)
class NonsmoothNewton(TruncatedNewton):
    """Truncated nonsmooth Newton on the contact unknowns (after Graeser, Sack and Sander 2009).

    The steps of :class:`TruncatedNewton` on the condensed body, Newton's equation by Cholesky's factor.  Where its
    matrix is indefinite, eigenvalues count by their sizes.

    For a convex energy the iteration converges from any start.  For any other law (softening, or a derivative that
    jumps down) it goes on from a stationary point as long as a single component, all others being held, has a lower
    global minimum, or a direction of negative curvature leads down; so it ends at a point that is minimal component by
    component, with an energy that never rises.

    Parameters
    ----------
    sweeps : int
        Diagonal minimisations before each Newton step.
    search : Search
        Whether components cross barriers of their own energy (GLOBAL), or only walk downhill (DOWNHILL).
    """

    name: ClassVar[str] = "newton"
    displaces: ClassVar[bool] = True
