"""How far a step is off: an estimate of its local error, by which adaptive steps are chosen.

The distance from the prediction by the derivatives at the beginning, halved: of implicit Euler ``tau^2 u''/2``, of
schemes of order two ``tau^3 u'''/12`` (Milne's device), or up to six times that where the acceleration that is known
lags behind, as it does without mass.  It is measured twice, and the larger part counts:

* in the energy norm, against the largest energy norm so far: deformations and velocities;
* at the contact points, root mean square, against the largest displacement since the start: a body that slides or
  falls as a whole stores no energy by where it is.

Both are parts of a whole, so that units do not matter.  Where a load or a support has a kink, velocities may
jump, which no step is short enough for and none needs to be: there displacements alone are measured for two steps,
after which velocities are predicted anew.

The tolerance bounds the larger part of one step.  Errors of steps add up, and the sum of each part over the steps that
stand, which the table has, is about what the end is off by where nothing forgets errors and nothing amplifies them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.evolution.stepper import StepResult, TimeStepper

__all__ = ["StepError", "step_error"]


@dataclass(frozen=True)
class StepError:
    """An estimate of the local error of a step, and what it is held against."""

    #: In the energy norm, and that of the moment.
    energy: float
    size: float
    #: At the contact points, and the largest displacement since the start.
    slid: float
    way: float

    def relative(self, size: float, way: float) -> tuple[float, float]:
        """Both parts, in the energy norm and at the contact points, of the largest sizes so far."""
        return self.energy / size if size > 0.0 else 0.0, self.slid / way if way > 0.0 else 0.0


def step_error(advance: TimeStepper, taken: StepResult, origin: Array, after_kink: bool = False) -> StepError:
    """The local error of a step.

    ``origin`` is (n + k,).
    """
    discrete, step = advance.discrete, taken.step
    before, after = taken.before, taken.moment
    body, local = before.body, before.local
    guess, guess_local = body.displacement + step * body.velocity, local.displacement + step * local.velocity
    if advance.scheme.order > 1:
        guess = guess + 0.5 * step**2 * body.acceleration
        guess_local = guess_local + 0.5 * step**2 * local.acceleration
    square = 2.0 * discrete.stiffness.energy(0.5 * (after.body.displacement - guess))
    if discrete.mass is not None and not after_kink:
        fast = 0.5 * (after.body.velocity - body.velocity - step * body.acceleration)
        square += 2.0 * discrete.mass.energy(fast)
    weights = discrete.problem.contact.weights
    off = 0.5 * (after.local.displacement - guess_local)
    square, slid, whole = discrete.vectors.total(
        square, float(weights @ (off**2).sum(axis=1)), float(weights.sum())
    ).tolist()
    (way,) = discrete.vectors.largest(float(np.abs(after.body.displacement - origin).max(initial=0.0))).tolist()
    size = after.ledger.elastic + after.ledger.kinetic
    return StepError(
        math.sqrt(max(square, 0.0)),
        math.sqrt(2.0 * max(size, 0.0)),
        math.sqrt(slid / whole) if whole > 0.0 else 0.0,
        way,
    )
