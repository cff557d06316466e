"""Termination status: how a solve ended, and what to do about it."""

from __future__ import annotations

from enum import Enum

__all__ = ["STOPPED", "Status", "check_interrupt"]


class Status(Enum):
    """How a solve ended; ``remedy`` says what to try, the value is the name in files and tables.

    >>> import hemivar as hv
    >>> status = hv.solve(hv.gallery.survey("5.1", 8), max_steps=1, method="direct-lbfgs").status
    >>> status, status.value
    (<Status.MAX_STEPS: 'max_steps'>, 'max_steps')
    >>> status.remedy
    'the step limit was reached; raise Controls.max_steps or start from a nearby solution'

    * ``CONVERGED``: the residual is below the tolerance.
    * ``INACCURATE``: the method's own rule stopped it above the tolerance; tighten its options, or take newton.
    * ``MAX_STEPS``, ``MAX_TIME``: a limit was reached; raise it.
    * ``STALLED``, ``CYCLING``, ``NONFINITE``: the method failed; take another one.
    * ``NOT_CONTRACTING``: a friction bound reacts too strongly to the solution; take a smaller relaxation.
    * ``UNBOUNDED``: the energy has no lower bound; lower the load, or add a support.
    * ``NOT_CARRIED``: no equilibrium was found from the unloaded state; apply a part of the load.
    * ``AT_LIMIT``: the load is at the limit of friction; lower it, or add a support.
    * ``INTERRUPTED``, ``OUT_OF_MEMORY``: the best iterate so far is returned.
    """

    CONVERGED = "converged"
    INACCURATE = "inaccurate"
    MAX_STEPS = "max_steps"
    MAX_TIME = "max_time"
    STALLED = "stalled"
    CYCLING = "cycling"
    NONFINITE = "nonfinite"
    NOT_CONTRACTING = "not_contracting"
    UNBOUNDED = "unbounded"
    NOT_CARRIED = "not_carried"
    AT_LIMIT = "at_limit"
    INTERRUPTED = "interrupted"
    OUT_OF_MEMORY = "out_of_memory"

    @property
    def remedy(self) -> str:
        """What happened in words, and what to try."""
        return _REMEDIES[self]


#: Ends that come from outside of the method: going on with the next load, mesh or start makes no sense.
STOPPED = (Status.MAX_TIME, Status.INTERRUPTED, Status.OUT_OF_MEMORY)

_REMEDIES = {
    Status.CONVERGED: "the residual is below the tolerance, or the error is certified to be",
    Status.INACCURATE: "the method ended by its own stopping rule with a residual above the tolerance; "
    "tighten its options, or use NonsmoothNewton",
    Status.MAX_STEPS: "the step limit was reached; raise Controls.max_steps or start from a nearby solution",
    Status.MAX_TIME: "the time limit was reached; raise Controls.max_time",
    Status.STALLED: "no step lowers the energy or the residual any further; use another method (see `hemivar "
    "methods`) or raise Controls.rtol",
    Status.CYCLING: "the active sets cycle; use NonsmoothNewton, whose energy never rises",
    Status.NONFINITE: "the iterate is no longer finite; start from another point or use NonsmoothNewton",
    Status.NOT_CONTRACTING: "the outer fixed point does not contract: the bound reacts too strongly to the solution; "
    "take FixedPoint(relaxation=0.5) or smaller",
    Status.UNBOUNDED: "the energy has no lower bound; the law does not carry the load: lower the load, or add a "
    "support",
    Status.NOT_CARRIED: "no equilibrium was found from the unloaded state; the load may exceed what the foundation "
    "can carry: apply a part of it, as `hemivar solve --load-factor` does",
    Status.AT_LIMIT: "the load is at the limit of friction, as nearly as the residual tells: a part may slide to "
    "anywhere; lower the load, or add a support",
    Status.INTERRUPTED: "the solve was interrupted; the best iterate so far is returned",
    Status.OUT_OF_MEMORY: "memory ran out during a step; the best iterate so far is returned. Use the method "
    "multigrid, which needs no dense matrix, or fewer cells",
}


def check_interrupt(status: Status) -> None:
    """Raise KeyboardInterrupt if a solve that is a part of other work was interrupted: the work ends there as well."""
    if status is Status.INTERRUPTED:
        raise KeyboardInterrupt
