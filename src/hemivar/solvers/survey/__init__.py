"""The survey's own methods: direct optimisation, augmented Lagrangian, primal-dual active set."""

from hemivar.solvers.survey.active_set import ExactInner, InnerSolver, NewtonKrylov, PrimalDualActiveSet
from hemivar.solvers.survey.augmented_lagrangian import AugmentedLagrangian, AugmentedLagrangianNewton, RootFinder
from hemivar.solvers.survey.bundle import ProximalBundle
from hemivar.solvers.survey.lbfgs import LBFGS
from hemivar.solvers.survey.powell import Powell

__all__ = [
    "LBFGS",
    "AugmentedLagrangian",
    "AugmentedLagrangianNewton",
    "ExactInner",
    "InnerSolver",
    "NewtonKrylov",
    "Powell",
    "PrimalDualActiveSet",
    "ProximalBundle",
    "RootFinder",
]
