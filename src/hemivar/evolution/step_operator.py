"""The effective operator of steps of one length: matrix, coefficients, laws, factors of Newton's equation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.last_used import Recent
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution.discrete import KEPT, DiscreteEvolution, StepMatrices
from hemivar.evolution.schemes.scheme import RateFormula, Scheme, StageRule
from hemivar.evolution.step_laws import StageLaws
from hemivar.solvers.newton_on_graph import NewtonCache

__all__ = ["StepOperator", "StepOperators", "body_factors", "branch_gain", "decay", "step_operator"]


def decay(time: float, span: float) -> float:
    """Part of what a branch remembered that is left after a span of time."""
    return float(np.exp(-span / time))


def branch_gain(time: float, span: float, rate: float) -> float:
    """What a branch takes up over a span in which the displacement changes at ``rate`` times a difference."""
    return float(-np.expm1(-span / time)) * time * rate


def body_factors(discrete: DiscreteEvolution, rule: StageRule, step: float) -> tuple[float, ...]:
    """What viscosity, mass and every branch are multiplied with in the stiffness of a stage."""
    gains = (branch_gain(time, rule.at * step, rule.reach / step) for time, _ in discrete.branches)
    return rule.rate.difference, rule.acceleration.difference, *gains


@dataclass(frozen=True, eq=False)
class StepOperator:
    """What a stage takes from the scheme and the lengths of its step and the one before alone."""

    rule: StageRule
    #: Length of the whole step.
    step: float
    #: The body with the matrix of the stage, without load.
    base: DiscreteProblem
    #: What is left at the stage of what each branch remembered.
    decays: tuple[float, ...]
    #: What each branch takes up of the difference ``u* - u_n``.
    gains: tuple[float, ...]
    #: Where the body would be without acceleration, from where it is.
    predictor: RateFormula
    #: The velocity there.
    predictor_rate: RateFormula
    laws: StageLaws
    #: The last factor of Newton's equation.
    newton: NewtonCache = field(default_factory=NewtonCache, repr=False)
    #: Constants c of laws by their weak convexity.
    constants: Recent[tuple[bytes, ...], float] = field(default_factory=lambda: Recent(KEPT), repr=False)


def step_operator(discrete: DiscreteEvolution, bodies: StepMatrices, rule: StageRule, step: float) -> StepOperator:
    """What the stages of all steps of one length share."""
    factors = body_factors(discrete, rule, step)
    _, inert, *gains = factors
    decays = tuple(decay(time, rule.at * step) for time, _ in discrete.branches)
    predictor, a, b = RateFormula(0.0), rule.rate, rule.acceleration
    if discrete.mass is not None:
        predictor = RateFormula(
            0.0, -b.velocity / inert, -b.acceleration / inert, -b.mean_velocity / inert, -b.mean_acceleration / inert
        )
    velocity = a.difference * predictor.velocity + a.velocity
    rate = RateFormula(
        0.0,
        1.0 if abs(velocity - 1.0) <= ROUNDED else velocity,
        a.difference * predictor.acceleration + a.acceleration,
        a.difference * predictor.mean_velocity + a.mean_velocity,
        a.difference * predictor.mean_acceleration + a.mean_acceleration,
    )
    return StepOperator(rule, step, bodies.body(*factors), decays, tuple(gains), predictor, rate, StageLaws(discrete))


@dataclass(frozen=True, eq=False)
class StepOperators:
    """The operators of the steps of a scheme, those of the last lengths."""

    discrete: DiscreteEvolution
    bodies: StepMatrices
    scheme: Scheme
    _made: Recent[tuple[float, float | None], tuple[StepOperator, ...]] = field(
        default_factory=lambda: Recent(KEPT), repr=False
    )

    def rules(self, step: float, last: float | None) -> tuple[StageRule, ...]:
        """The stages of a step of a length after one of length ``last``."""
        scheme = self.scheme
        return (scheme.massless_rules if self.discrete.mass is None else scheme.rules)(step, last)

    def of(self, step: float, last: float | None) -> tuple[StepOperator, ...]:
        """Those of the stages of such a step."""
        last = last if self.scheme.multistep else None

        def make() -> tuple[StepOperator, ...]:
            rules = self.rules(step, last)
            return tuple(step_operator(self.discrete, self.bodies, rule, step) for rule in rules)

        return self._made.once((step, last), make)
