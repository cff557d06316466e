"""What a step is worth: its uniqueness margin, its local error, and whether the body jumped in it.

Adaptive steps are chosen by an estimate of that error. It is the distance from the prediction by the derivatives at the
beginning, halved: of implicit Euler ``tau^2 u''/2``, of schemes of order two ``tau^3 u'''/12`` (Milne's device), or up
to six times that where the acceleration that is known lags behind, as it does without mass. It is measured twice, and
the larger part counts:

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
from collections import OrderedDict
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array
from hemivar.certificates.linear_bodies import UNKNOWN, below, lower_bound_by
from hemivar.certificates.smallness import margin_at
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.evolution.barrier import path_bends_downwards
from hemivar.evolution.discrete import KEPT
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.stage import Stage
from hemivar.evolution.state import TimeState
from hemivar.evolution.step_end import energies
from hemivar.evolution.step_laws import BoundaryLaw
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.laws.vector_law import alpha_is_one, softens, weak_convexity_at
from hemivar.solvers import Solution
from hemivar.systems.elimination import SchurComplement

__all__ = ["Margins", "StepError", "step_error", "with_jump_loss"]

#: Unknowns up to which the largest step is looked for, and how near it is found.
_SMALL = 20_000
#: Steps that are looked at in each factor of two, and powers of two that are; that of a step that stands for all longer
#: ones, in which neither mass nor viscosity resists any more.
_PARTS, _WIDEST, _FARTHEST = 70, 24, 96
#: Bytes of condensed bodies of such steps that are kept, a few of them in any case.
_BYTES = 1 << 25


def _crosses_energy_barrier(stepper: TimeStepper, taken: StepResult) -> bool:
    """Whether a body without viscosity and mass left its equilibrium at once in a step."""
    stages = stepper.stages
    return not stages.resists and any(
        stages.convexity_defect(stage) >= 0.0 and path_bends_downwards(stage.problem, solution, stage.start)
        for stage, solution in zip(taken.stages, taken.solutions, strict=True)
    )


def with_jump_loss(stepper: TimeStepper, taken: StepResult, rule: SelectionRule) -> tuple[StepResult, bool]:
    """Whether the body jumped; with what it lost, beside what a law that changed took from what was stored."""
    known = taken.jumps or taken.state.control is not None or rule.follows
    if known or not _crosses_energy_barrier(stepper, taken):
        return taken, bool(taken.jumps)
    before, ledger = taken.before, taken.state.ledger
    weakened = before.ledger.contact - energies(stepper.discrete, before, taken.stages[-1].law)["contact"]
    lost = max(ledger.numerical - before.ledger.numerical - weakened, 0.0)
    ledger = replace(ledger, numerical=ledger.numerical - lost, jumps=ledger.jumps + lost)
    return replace(taken, state=replace(taken.state, ledger=ledger)), True


@dataclass(frozen=True)
class StepError:
    """An estimate of the local error of a step, and what it is held against."""

    #: In the energy norm, and that of the state.
    energy: float
    size: float
    #: At the contact points, and the largest displacement since the start.
    slid: float
    displacement: float

    def relative(self, size: float, displacement: float) -> tuple[float, float]:
        """Both parts, in the energy norm and at the contact points, of the largest sizes so far."""
        return self.energy / size if size > 0.0 else 0.0, self.slid / displacement if displacement > 0.0 else 0.0


def step_error(stepper: TimeStepper, taken: StepResult, origin: Array, after_kink: bool = False) -> StepError:
    """The local error of a step.

    ``origin`` is (n + k,).
    """
    discrete, step = stepper.discrete, taken.step
    before, after = taken.before, taken.state
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
    farthest = float(np.abs(after.body.displacement - origin).max(initial=0.0))
    (farthest,) = discrete.vectors.largest(farthest).tolist()
    size = after.ledger.elastic + after.ledger.kinetic
    return StepError(
        math.sqrt(max(square, 0.0)),
        math.sqrt(2.0 * max(size, 0.0)),
        math.sqrt(slid / whole) if whole > 0.0 else 0.0,
        farthest,
    )


class Margins:
    """Margins of steps; those of laws with the same constants on the same body are computed once.

    Where a law depends on the state, the margin is that of the current solution.
    """

    def __init__(self, stepper: TimeStepper) -> None:
        self.stepper = stepper
        self._largest: tuple[bytes, float] = b"", math.nan
        self._last: tuple[object, float, float] = None, math.nan, math.nan
        self._known: tuple[object, object, float] = None, None, math.nan
        self._matrices: OrderedDict[tuple[float, ...], Array | None] = OrderedDict()
        self._beside = None if stepper.beside is None else Margins(stepper.beside)

    def margin(self, taken: StepResult) -> float:
        """Least margin of the stages of a step, and of heat."""
        own = min(self._of(stage, solution) for stage, solution in zip(taken.stages, taken.solutions, strict=True))
        return own if taken.heat is None or self._beside is None else min(own, self._beside.margin(taken.heat))

    def _of(self, stage: Stage, solution: Solution) -> float:
        problem = stage.problem
        if not problem.contact_points:
            return 1.0
        if problem.law.state_dependent:
            return self._at(stage, solution)
        return 1.0 - self.stepper.stages.constant(stage, problem.law)

    def _at(self, stage: Stage, solution: Solution) -> float:
        """That of a law that depends on the state; where friction does not weaken it is the same in all states."""
        problem, body = stage.problem, stage.operator.base.model
        law = problem.law
        if self._known[0] is body and self._known[1] is law and alpha_is_one(law):
            return self._known[2]
        margin = margin_at(problem, solution.unknowns, solution.multiplier, self.stepper.stages.workspace)
        self._known = body, law, margin
        return margin

    def largest_step(self, taken: StepResult) -> float:
        """Largest step with a positive margin, of motion and heat, to a percent; inf if any, nan where it is not looked
        for.

        It is looked for among longer steps where this one has a positive margin, else among shorter ones; 0 if none of
        these has.
        """
        own = self._largest_step(taken)
        if taken.heat is None or self._beside is None:
            return own
        return float(np.minimum(own, self._beside.largest_step(taken.heat)))  # nan if one of them is

    def _largest_step(self, taken: StepResult) -> float:
        problem = taken.stages[0].problem
        if problem.law is self._last[0] and taken.step == self._last[1]:
            return self._last[2]
        length = self._largest_of(taken, problem)
        if not problem.law.state_dependent:
            self._last = problem.law, taken.step, length
        return length

    def _largest_of(self, taken: StepResult, problem: DiscreteProblem) -> float:
        alphas = [np.asarray(alpha) for alpha in weak_convexity_at(problem.law, -problem.offset)]
        blocks = taken.stages[0].law.blocks
        if not any(alpha.any() for alpha in alphas) and not any(_may_soften(block) for block in blocks):
            return math.inf
        if problem.unknowns > _SMALL or problem.law.state_dependent or lower_bound_by(problem) == UNKNOWN:
            return math.nan
        changes = "law" in self.stepper.discrete.evolution.problem.time_dependent  # and is another in longer steps
        data = np.array([taken.step, taken.before.time if changes else 0.0])
        # Damping stiffens a law from where a point is on: by less in a longer step, from another place in the next one.
        varies = any(block.damping is not None or not block.memory.of_state for block in blocks)
        damped = [taken.before.local.displacement[:, 0]] if varies else []
        key = b"".join(alpha.tobytes() for alpha in (data, *alphas, *damped))
        if key != self._largest[0]:
            self._largest = key, self._sought(taken)
        return self._largest[1]

    def _sought(self, taken: StepResult) -> float:
        """The largest of the steps ``taken.step * 2^(k / 70)`` with a positive margin, which falls with the step.

        Looked for from the last answer outwards; what is found does not depend on that one.
        """
        step, last = taken.step, self._largest[1]
        near = round(_PARTS * math.log2(last / step)) if 0.0 < last < math.inf else 0
        stride = 1 if near else 3 * _PARTS

        def positive(k: int) -> bool:
            return self._positive(taken.before, math.ldexp(step * 2.0 ** (k % _PARTS / _PARTS), k // _PARTS))

        good = bad = near
        if positive(near):
            while positive(bad := good + stride):
                good, stride = bad, min(2 * stride, 3 * _PARTS)
                if good > _WIDEST * _PARTS:
                    if positive(bad := _FARTHEST * _PARTS):
                        return math.inf
                    break
        else:
            while not positive(good := bad - stride):
                bad, stride = good, min(2 * stride, 3 * _PARTS)
                if bad < -_WIDEST * _PARTS:
                    return 0.0
        while bad - good > 1:
            middle = (good + bad) // 2
            good, bad = (middle, bad) if positive(middle) else (good, middle)
        return math.ldexp(step * 2.0 ** (good % _PARTS / _PARTS), good // _PARTS)

    def _positive(self, before: TimeState, step: float) -> bool:
        """Whether a step of this length has a positive margin: whether the body condensed onto its contact points,
        less what the laws may soften, is positive definite."""
        contact = self.stepper.discrete.problem.contact
        try:
            tried = self.stepper.stage_laws(before, step)
        except ProblemError:  # what depends on time makes no sense any more at the end of so long a step
            return False
        for factors, law in tried:
            matrix = self._condensed(factors)
            alphas = law.weak_convexity
            if matrix is None or not all(np.isfinite(alpha).all() for alpha in alphas):
                return False
            softened = np.empty((contact.count, contact.components))
            softened[:, 0], softened[:, 1:] = alphas[0], alphas[1][:, None]
            softened *= contact.weights[:, None]
            there = np.diagonal(matrix) != 0.0  # a support holds the others
            less = matrix[np.ix_(there, there)] - np.diag(softened.ravel()[there])
            try:
                la.cholesky(less, overwrite_a=True, check_finite=False)
            except la.LinAlgError:
                return False
        return True

    def _condensed(self, factors: tuple[float, ...]) -> Array | None:
        """Stiffness (m d, m d) between the contact points of a body, of the one below if it is not linear; None where
        it is not held."""
        if factors not in self._matrices:
            try:
                stiffness = SchurComplement.of(below(self.stepper.stages.bodies.body(*factors, keep=False))).matrix
            except ProblemError:
                stiffness = None
            self._matrices[factors] = stiffness
            size = 1 if stiffness is None else stiffness.nbytes
            while len(self._matrices) > max(KEPT, _BYTES // max(size, 1)):
                self._matrices.popitem(last=False)
        self._matrices.move_to_end(factors)
        return self._matrices[factors]


def _may_soften(block: BoundaryLaw) -> bool:
    """Whether a law may soften in a step of some length, though it does not in this one."""
    return softens(block.given) or (block.damping is not None and bool(np.any(block.damping.weak_convexity)))
