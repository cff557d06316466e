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
from hemivar.evolution.stage import Stage
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.solvers import Solution

__all__ = ["StepError", "crosses_energy_barrier", "step_error"]

#: Parts of the way of a step in which the energy is looked at.
_PARTS = 32
#: Rounding of energies, as a part of them, and of penetrations at the end of a law, as a part of those.
_ROUNDED, _AT_END = 1e-13, 1e-9


def crosses_energy_barrier(stepper: TimeStepper, taken: StepResult) -> bool:
    """Whether a body without viscosity and mass left its equilibrium at once in a step.

    While an equilibrium is stable and the body follows it, the energy of the step is convex along the way; between two
    equilibria that are no neighbours there is a part of the way on which it is not.
    """
    if stepper.stages.resists:
        return False
    stages = zip(taken.stages, taken.solutions, strict=True)
    return any(
        stepper.stages.convexity_defect(stage) >= 0.0 and _bends(_energies(stepper, stage, solution))
        for stage, solution in stages
    )


def _energies(stepper: TimeStepper, stage: Stage, solution: Solution) -> Array:
    """Energy of a stage on the straight way to its solution, but for a part that is linear in the way."""
    discrete, contact = stepper.discrete, stage.problem.contact
    way = np.zeros(stage.place.size)
    way[: solution.unknowns.size] = solution.unknowns
    parts, pressed = np.linspace(0.0, 1.0, _PARTS + 1), np.zeros(_PARTS + 1)
    body = 0.0
    if discrete.linear:
        body = discrete.stiffness.energy(way)
        body += sum(
            gain * part.energy(way) for gain, (_, part) in zip(stage.operator.gains, discrete.branches, strict=True)
        )
    else:
        pressed += [stage.problem.bulk.value(part * solution.unknowns) for part in parts]
    if contact.count:
        law = stage.problem.law.frozen(solution.local, solution.multiplier)
        start, ends = -stage.problem.offset, law.penetrations
        rounding = _AT_END * max(float(np.abs(start).max()), float(np.abs(solution.local).max()))
        for i, part in enumerate(parts):
            r = start + part * (solution.local - start)
            inside = np.clip(r[:, 0], ends.lower, ends.upper)
            r[:, 0] = np.where(np.abs(inside - r[:, 0]) <= rounding, inside, r[:, 0])
            pressed[i] += contact.weights @ law.value(r)
    bent, *summed = discrete.vectors.total(body, *pressed).tolist()
    return np.asarray(bent * parts**2 + np.array(summed))


def _bends(energies: Array) -> bool:
    """Whether values on an even grid bend downwards somewhere, beyond rounding; infinite ones are left out."""
    energies = energies[np.isfinite(energies)]
    bends = np.diff(energies, 2)
    return bool((bends < -_ROUNDED * np.abs(energies).max(initial=0.0)).any())


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


def step_error(stepper: TimeStepper, taken: StepResult, origin: Array, after_kink: bool = False) -> StepError:
    """The local error of a step.

    ``origin`` is (n + k,).
    """
    discrete, step = stepper.discrete, taken.step
    before, after = taken.before, taken.moment
    body, local = before.body, before.local
    guess, guess_local = body.displacement + step * body.velocity, local.displacement + step * local.velocity
    if stepper.scheme.order > 1:
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
