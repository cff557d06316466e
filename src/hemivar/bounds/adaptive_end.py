"""How an adaptive solve ended, and what to do about it."""

from __future__ import annotations

from enum import StrEnum

from hemivar.solvers import Status

__all__ = ["AdaptiveEnd"]


class AdaptiveEnd(StrEnum):
    """End of an adaptive solve; the value is its name in files and tables."""

    REACHED = "reached"
    ESTIMATED = "estimated"
    MAX_UNKNOWNS = "max_unknowns"
    MAX_TIME = "max_time"
    MAX_MEMORY = "max_memory"
    NO_BOUND = "no bound"
    ALGEBRAIC = "algebraic"
    NOT_CONVERGED = "not converged"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"

    @classmethod
    def of(cls, status: Status) -> AdaptiveEnd:
        """The end by a solve that did not converge."""
        known = {Status.INTERRUPTED: cls.INTERRUPTED, Status.OUT_OF_MEMORY: cls.MAX_MEMORY}
        return known.get(status, cls.NOT_CONVERGED)

    @property
    def remedy(self) -> str:
        """What happened in words, and what to try."""
        return _REMEDIES[self]


_REMEDIES = {
    AdaptiveEnd.REACHED: "the error is guaranteed to be within the tolerance, up to rounding and quadrature",
    AdaptiveEnd.ESTIMATED: "the estimated error is within the tolerance; it is not guaranteed",
    AdaptiveEnd.MAX_UNKNOWNS: "the limit of unknowns was reached; raise max_unknowns or use a larger rtol",
    AdaptiveEnd.MAX_TIME: "the next mesh would exceed the time limit; raise max_time or use a larger rtol",
    AdaptiveEnd.MAX_MEMORY: "there is not enough memory for the next mesh; use a larger rtol",
    AdaptiveEnd.NO_BOUND: "no bound of the distance to the exact solution is known, so the mesh cannot be adapted "
    "to it; see its reasons, or refine everywhere",
    AdaptiveEnd.ALGEBRAIC: "the error of the algebraic solves exceeds the tolerance, which finer meshes do not "
    "change; use a larger tolerance, or a smaller rtol of the solves. A body that moves without strain has no "
    "relative error",
    AdaptiveEnd.NOT_CONVERGED: "the solve on the last mesh did not converge",
    AdaptiveEnd.STOPPED: "it was stopped on request after this mesh",
    AdaptiveEnd.INTERRUPTED: "it was interrupted; finished meshes are kept",
}
