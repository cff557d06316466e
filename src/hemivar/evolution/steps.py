"""Step-size control: fixed, or by a local error estimate on a ladder of powers of two."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

from hemivar.basics.arguments import number
from hemivar.basics.stated import Form, stated
from hemivar.errors import ProblemError

__all__ = ["AdaptiveStep", "FixedStep", "StepSizeController", "StepSizeState"]

#: Steps are this many halvings below the first one at most, unless a least step is given.
_HALVINGS = 20
#: A sum of errors of steps is worth a message if it is more than this part of the whole, and as many tolerances.
_MUCH, _SEVERAL = 0.05, 10.0
#: Smaller parts of the whole are rounding, which no step is short enough for.
_ROUNDING = 1e-14


@dataclass(frozen=True)
class StepSizeState:
    """What a control of steps remembers."""

    #: Length of the next step.
    step: float
    #: Doublings above the first step.
    rung: int = 0
    #: Good steps to wait before the step may grow again.
    waiting: int = 0


class StepSizeController(ABC):
    """How long steps are: a frozen dataclass of options; all it remembers is a :class:`StepSizeState`."""

    #: Whether the error of every step is estimated.
    estimates: bool = False

    @abstractmethod
    def first(self, span: float) -> StepSizeState:
        """The first step of an evolution that lasts ``span``."""

    @abstractmethod
    def after(self, step_size: StepSizeState, error: float | None, order: int) -> tuple[bool, StepSizeState]:
        """Whether a step of a relative ``error`` stands, and the next one."""

    @abstractmethod
    def smaller(self, step_size: StepSizeState) -> StepSizeState | None:
        """What to try after a step that failed; None if there is nothing smaller."""

    def missed(self, error: float | None) -> bool:
        """Whether a step of a relative ``error`` that stands is not as exact as was asked for."""
        return False

    def adds_up(self, summed: float) -> bool:
        """Whether relative errors of steps have a sum that is much more than was asked for a step."""
        return False

    def knows(self, step_size: StepSizeState) -> bool:
        """Whether a pace that was read from a file may be one of this control."""
        counted = all(isinstance(one, int) and not isinstance(one, bool) for one in (step_size.rung, step_size.waiting))
        return counted and 0.0 < step_size.step < math.inf and step_size.waiting >= 0


@dataclass(frozen=True)
class FixedStep(StepSizeController):
    """Steps of one length; one that fails is divided, a few times at most.

    Parameters
    ----------
    step : float
    halvings : int
        How often a step may be halved where its problem cannot be solved.
    """

    step: float
    halvings: int = 6

    def __post_init__(self) -> None:
        if not 0.0 < number(self.step, "the step", "give a time > 0") < math.inf:
            raise ProblemError(f"the step is {self.step:g}; it must be positive and finite")

    def first(self, span: float) -> StepSizeState:
        if self.step > span * (1.0 + 1e-9):
            raise ProblemError(f"the step is {self.step:g}, longer than the whole evolution, {span:g}; take a smaller")
        return StepSizeState(self.step)

    def after(self, step_size: StepSizeState, error: float | None, order: int) -> tuple[bool, StepSizeState]:
        if step_size.rung == 0:
            return True, step_size
        if step_size.waiting > 1:
            return True, StepSizeState(step_size.step, step_size.rung, step_size.waiting - 1)
        rung = step_size.rung + 1
        return True, StepSizeState(self.step * 2.0**rung, rung, 1 if rung == 0 else 2)

    def smaller(self, step_size: StepSizeState) -> StepSizeState | None:
        if step_size.rung <= -self.halvings:
            return None
        return StepSizeState(self.step * 2.0 ** (step_size.rung - 1), step_size.rung - 1, 2)

    def knows(self, step_size: StepSizeState) -> bool:
        known = super().knows(step_size) and -self.halvings <= step_size.rung <= 0
        return known and math.isclose(step_size.step, self.step * 2.0**step_size.rung, rel_tol=1e-9)


@dataclass(frozen=True)
class AdaptiveStep(StepSizeController):
    """Steps whose estimated error stays below a tolerance, each the first one times a power of two.

    Matrices of a step length that comes again are not factorised again.

    Parameters
    ----------
    rtol : float
        Error of one step, not of their sum, relative to the largest energy norm so far, that of steps which were tried
        and rejected too: of a body that sets out from rest they are the only measure.  At least 1e-14: less is
        rounding.
    first_step : float, optional
        A thousandth of the evolution by default.
    least, most : float, optional
        Limits; by default no step is shorter than a millionth of the first one.

    Examples
    --------
    >>> import hemivar as hv
    >>> step = hv.evolution.AdaptiveStep(rtol=1e-3, first_step=0.1)
    """

    rtol: float = field(default=1e-3, metadata=stated(Form.NUMBER, above=0.0, below=1.0))
    first_step: float | None = field(default=None, metadata=stated(Form.NUMBER, key="first", above=0.0))
    least: float | None = field(default=None, metadata=stated(Form.NUMBER, key="min", above=0.0))
    most: float | None = field(default=None, metadata=stated(Form.NUMBER, key="max", above=0.0))

    estimates = True

    def __post_init__(self) -> None:
        if not 0.0 < number(self.rtol, "rtol of AdaptiveStep") < 1.0:
            raise ProblemError(f"AdaptiveStep(rtol={self.rtol:g}): rtol must lie between 0 and 1")
        if self.rtol < _ROUNDING:
            raise ProblemError(
                f"AdaptiveStep(rtol={self.rtol:g}): rounding alone is more, so that no step is short enough; take at "
                f"least {_ROUNDING:g}"
            )
        for name in ("first_step", "least", "most"):
            value = getattr(self, name)
            if value is not None and not 0.0 < number(value, f"{name} of AdaptiveStep") < math.inf:
                raise ProblemError(f"AdaptiveStep({name}={value:g}): it must be positive and finite")
        if self.least is not None and self.most is not None and self.least > self.most:
            raise ProblemError(f"AdaptiveStep: least = {self.least:g} is larger than most = {self.most:g}")

    def first(self, span: float) -> StepSizeState:
        step = self.first_step if self.first_step is not None else 1e-3 * span
        return StepSizeState(min(max(step, self.least or step), self.most or math.inf, span))

    def after(self, step_size: StepSizeState, error: float | None, order: int) -> tuple[bool, StepSizeState]:
        assert error is not None
        error /= self.rtol
        if error > 1.0:
            rungs = max(1, math.ceil(math.log2(error) / (order + 1) + 0.1))
            smaller = self._down(step_size, rungs)
            return (True, step_size) if smaller is None else (False, smaller)
        grown = 2.0 * step_size.step
        fits = self.most is None or grown <= self.most * (1.0 + 1e-9)
        if fits and error < 0.8 * 2.0 ** -(order + 1):
            if step_size.waiting:
                return True, StepSizeState(step_size.step, step_size.rung, step_size.waiting - 1)
            return True, StepSizeState(grown, step_size.rung + 1, 1)
        return True, StepSizeState(step_size.step, step_size.rung, min(step_size.waiting, 1))

    def smaller(self, step_size: StepSizeState) -> StepSizeState | None:
        return self._down(step_size, 1)

    def missed(self, error: float | None) -> bool:
        return error is not None and error > self.rtol

    def adds_up(self, summed: float) -> bool:
        return summed > max(_MUCH, _SEVERAL * self.rtol)

    def knows(self, step_size: StepSizeState) -> bool:
        return super().knows(step_size) and step_size.rung >= -_HALVINGS

    def _down(self, step_size: StepSizeState, rungs: int) -> StepSizeState | None:
        for down in range(rungs, 0, -1):
            step = step_size.step * 0.5**down
            if (self.least is None or step >= self.least * (1.0 - 1e-9)) and step_size.rung - down >= -_HALVINGS:
                return StepSizeState(step, step_size.rung - down, 2)
        return None
