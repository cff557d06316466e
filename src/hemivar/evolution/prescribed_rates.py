"""Rates with which supports and gaps set out, told by where they soon are, and kinks of their paths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.evolution.state import Kinematics
from hemivar.evolution.stepper import TimeStepper

__all__ = ["Kinked", "prescribed_rates", "velocity_discontinuity"]

#: Part of the next step over which paths are looked at.
_NEAR = 1e-2
#: A difference quotient that grows by more than this while its span is halved is that of a jump, which has no rate.
_JUMPS = 1.2
#: Part of what an acceleration makes of a rate in a span that is no jump of it.
_BENDS = 0.05
#: Part of a rate by which it differs at both sides of a time at which a path has a kink.
_KINK = 1e-3
#: Rounding of difference quotients, in units of that of places over their span.
_ROUNDED = 64.0 * float(np.finfo(float).eps)

#: Motions of prescribed displacements (k,) and of offsets of the contact points (m, c).
Moving = tuple[Kinematics, Kinematics]
#: Which of them go on, at another speed or not; the others jump.
Kinked = tuple[BoolArray, BoolArray]


def prescribed_rates(advance: TimeStepper, time: float, step: float | None) -> Moving:
    """Motion of the prescribed displacements (k,) and of the offsets of the contact points (m, c) from a time on.

    Rates are none where a path jumps, and of a body without mass, which needs none.
    """
    if step is None or not _moves(advance):
        now = advance.data.at(time)
        return _still(now.prescribed), _still(now.offset)
    prescribed, offset = (path.rates()[0] for path in _paths(advance, time, _NEAR * step))
    return prescribed, offset


def velocity_discontinuity(advance: TimeStepper, time: float, step: float) -> tuple[Moving, Kinked] | None:
    """Motion of supports and gaps after a time at which the speed of one jumps, and which of them have a rate at both
    sides; None if none jumps.
    """
    if not _moves(advance):
        return None
    span, jumps = _NEAR * step, False
    motions: list[Kinematics] = []
    smooth: list[BoolArray] = []
    for ahead, behind in zip(_paths(advance, time, span), _paths(advance, time, -span), strict=True):
        (after, goes_on), (before, came) = ahead.rates(), behind.rates()
        both = goes_on & came
        fast = np.maximum(np.abs(after.velocity), np.abs(before.velocity))
        bend = np.maximum(np.abs(after.acceleration), np.abs(before.acceleration))
        least = _KINK * fast + _BENDS * span * bend + _ROUNDED * ahead.farthest / span
        jumps |= bool((both & (np.abs(after.velocity - before.velocity) > least)).any())
        motions.append(after)
        smooth.append(both)
    if not advance.discrete.vectors.largest(float(jumps))[0]:
        return None
    return (motions[0], motions[1]), (smooth[0], smooth[1])


def _moves(advance: TimeStepper) -> bool:
    """Whether rates of supports and gaps matter, and there are some."""
    discrete = advance.discrete
    return discrete.mass is not None and bool(discrete.evolution.problem.time_dependent & {"supports", "gap"})


@dataclass(frozen=True, eq=False)
class _Path:
    """Where something is now, and where after half a span, one and two of them, which may be negative."""

    place: Array
    soon: tuple[Array, ...]
    span: float

    @property
    def farthest(self) -> float:
        """The largest of all these places."""
        return max(float(np.abs(place).max(initial=0.0)) for place in (self.place, *self.soon))

    def rates(self) -> tuple[Kinematics, BoolArray]:
        """Its motion now, and where it has one: a place that jumps has no rate."""
        half, one, two = (there - self.place for there in self.soon)
        velocity = (4.0 * one - two) / (2.0 * self.span)
        acceleration = (8.0 * (one - 2.0 * half) - (two - 2.0 * one)) / self.span**2
        # A path may set out at rest, so that its rate is nothing but rounding.
        bends = _BENDS * abs(self.span) * np.abs(acceleration)
        smooth = np.abs((4.0 * half - one) / self.span) <= _JUMPS * np.abs(velocity) + bends
        return Kinematics(self.place, np.where(smooth, velocity, 0.0), np.where(smooth, acceleration, 0.0)), smooth


def _paths(advance: TimeStepper, time: float, span: float) -> tuple[_Path, _Path]:
    """Those of prescribed displacements and of offsets."""
    now = advance.data.at(time)
    soon = [advance.data.at(time + part * span) for part in (0.5, 1.0, 2.0)]
    return (
        _Path(now.prescribed, tuple(acting.prescribed for acting in soon), span),
        _Path(now.offset, tuple(acting.offset for acting in soon), span),
    )


def _still(place: Array) -> Kinematics:
    return Kinematics(place, np.zeros_like(place), np.zeros_like(place))
