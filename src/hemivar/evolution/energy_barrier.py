"""Whether a body jumped in a step: whether its energy has a ridge on the way."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.evolution.stage import Stage
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.solvers import Solution

__all__ = ["crosses_energy_barrier"]

#: Parts of the way of a step in which the energy is looked at.
_PARTS = 32
#: Rounding of energies, as a part of them, and of penetrations at the end of a law, as a part of those.
_ROUNDED, _AT_END = 1e-13, 1e-9


def crosses_energy_barrier(advance: TimeStepper, taken: StepResult) -> bool:
    """Whether a body without viscosity and mass left its equilibrium at once in a step.

    While an equilibrium is stable and the body follows it, the energy of the step is convex along the way; between two
    equilibria that are no neighbours there is a part of the way on which it is not.
    """
    if advance.stages.resists:
        return False
    stages = zip(taken.stages, taken.solutions, strict=True)
    return any(
        advance.stages.convexity_defect(stage) >= 0.0 and _bends(_energies(advance, stage, solution))
        for stage, solution in stages
    )


def _energies(advance: TimeStepper, stage: Stage, solution: Solution) -> Array:
    """Energy of a stage on the straight way to its solution, but for a part that is linear in the way."""
    discrete, contact = advance.discrete, stage.problem.contact
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
