"""Stopping criteria: tolerances, limits of steps and time, and whom to tell."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from hemivar.basics.arguments import described, expect, number, whole_number
from hemivar.basics.deadline import Budget, OutOfTime
from hemivar.basics.known_keywords import known_fields
from hemivar.errors import ProblemError

__all__ = ["NESTED", "Budget", "Controls", "OutOfTime", "Progress"]

#: Largest relative tolerance.
_COARSEST = 0.1


@dataclass(frozen=True)
class Progress:
    """One line of the history of a solve.

    Attributes
    ----------
    step : int
        Number of the step, 0 for the initial guess.
    energy : float
        E(u), in units of work.
    residual : float
        Relative residual.
    changed : int
        Contact points whose state (open, contact, bonded; free, stick, slip) changed in this step.
    seconds : float
        Since the start of the iteration.
    """

    step: int
    energy: float
    residual: float
    changed: int
    seconds: float


@known_fields
@dataclass(frozen=True)
class Controls:
    """Stopping rules, the same for every method.

    Parameters
    ----------
    rtol : float
        Relative tolerance: converged when the residual is at most ``atol + rtol`` times the load; at most 0.1.
    atol : float
        Absolute tolerance, in units of force.
    max_steps : int, optional
        Limit of steps; each method has its own default.
    max_time : float
        Limit of the iteration in seconds.
    callback : function, optional
        Called with a :class:`Progress` after every step; return True to stop.

    Examples
    --------
    >>> import hemivar as hv
    >>> controls = hv.Controls(rtol=1e-10, max_time=60.0)
    >>> hv.solve(hv.gallery.survey("5.1", 4), controls=controls).residual.relative <= 1e-10
    True
    """

    rtol: float = 1e-9
    atol: float = 0.0
    max_steps: int | None = None
    max_time: float = math.inf
    callback: Callable[[Progress], bool | None] | None = None

    @classmethod
    def of(
        cls,
        controls: Controls | None,
        *,
        rtol: float | None = None,
        max_steps: int | None = None,
        max_time: float | None = None,
    ) -> Controls:
        """The controls, with those limits that are given by themselves in their place.

        Raises
        ------
        ProblemError
            ``controls`` is none, or a limit is out of its range.
        """
        if controls is not None:
            expect(controls, Controls, "controls", "pass Controls(rtol=..., max_steps=...)")
        known = cls() if controls is None else controls
        return replace(
            known,
            rtol=known.rtol if rtol is None else rtol,
            max_steps=known.max_steps if max_steps is None else max_steps,
            max_time=known.max_time if max_time is None else max_time,
        )

    def within(self, atol: float) -> Controls:
        """The same with an absolute tolerance of at least ``atol``, in units of force.

        Raises
        ------
        ProblemError
            It is not finite.
        """
        return replace(self, atol=max(atol, self.atol))  # nan stays, and is refused

    def __post_init__(self) -> None:
        for name in ("rtol", "atol", "max_time"):
            if not number(getattr(self, name), f"Controls.{name}", "it must be a number >= 0") >= 0.0:
                raise ProblemError(f"Controls.{name} is {getattr(self, name)}; it must be a number >= 0")
        if self.rtol > _COARSEST:
            raise ProblemError(
                f"Controls.rtol is {self.rtol:g}; it must be at most {_COARSEST:g}, because a larger residual "
                f"shows nothing"
            )
        if not math.isfinite(self.atol):
            raise ProblemError("Controls.atol is infinite; give a force that is negligible")
        if self.max_steps is not None:
            whole_number(self.max_steps, "Controls.max_steps", 1)
        if self.callback is not None and not callable(self.callback):
            raise ProblemError(
                f"Controls.callback is {described(self.callback)}; give a function that is called with each Progress"
            )


#: How far coarser meshes are solved, where the first guess comes from.
NESTED = Controls(rtol=1e-3, max_steps=15)
