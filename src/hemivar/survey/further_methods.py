"""The methods that the survey compares, with their standard options."""

from __future__ import annotations

from hemivar.solvers.base import Solver
from hemivar.survey.active_set import ExactInner, NewtonKrylov, PrimalDualActiveSet
from hemivar.survey.augmented_lagrangian import AugmentedLagrangian, AugmentedLagrangianNewton
from hemivar.survey.bundle import ProximalBundle
from hemivar.survey.lbfgs import LBFGS
from hemivar.survey.powell import Powell

__all__ = ["further_methods"]


def further_methods() -> tuple[Solver, ...]:
    """One of each, in the order of the tables."""
    return (
        Powell(),
        LBFGS(),
        ProximalBundle(),
        AugmentedLagrangian(),
        AugmentedLagrangianNewton(),
        PrimalDualActiveSet(ExactInner()),
        PrimalDualActiveSet(NewtonKrylov()),
    )
