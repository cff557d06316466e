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
    AdaptiveEnd.REACHED: "the error is guaranteed to be at most what was asked for, up to rounding and the rules of "
    "integration",
    AdaptiveEnd.ESTIMATED: "the error is estimated to be at most what was asked for, and not guaranteed to be",
    AdaptiveEnd.MAX_UNKNOWNS: "the limit of unknowns was reached; raise max_unknowns or take a larger rtol",
    AdaptiveEnd.MAX_TIME: "the next mesh would not be ready in time; raise max_time or take a larger rtol",
    AdaptiveEnd.MAX_MEMORY: "the memory does not suffice for the next mesh; take a larger rtol",
    AdaptiveEnd.NO_BOUND: "no distance to the exact solution is known, so that no mesh is better than another by it; "
    "refine everywhere, see the reasons of the distance",
    AdaptiveEnd.ALGEBRAIC: "the error of the algebraic solves exceeds the tolerance, and finer meshes do not change "
    "that; take a larger tolerance, or a smaller rtol of the solves. A body that moves without strain has no relative "
    "error",
    AdaptiveEnd.NOT_CONVERGED: "the solve on the last mesh did not converge",
    AdaptiveEnd.STOPPED: "it was stopped on request after this mesh",
    AdaptiveEnd.INTERRUPTED: "it was interrupted; the meshes that were finished are kept",
}
