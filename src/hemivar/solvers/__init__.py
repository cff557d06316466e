"""Methods, the loop they share, and what they return."""

from collections.abc import Mapping
from types import MappingProxyType

from hemivar.solvers.active_set import ExactInner, InnerSolver, NewtonKrylov, PrimalDualActiveSet
from hemivar.solvers.augmented_lagrangian import AugmentedLagrangian, AugmentedLagrangianNewton, RootFinder
from hemivar.solvers.base import Solver
from hemivar.solvers.bundle import ProximalBundle
from hemivar.solvers.condensed import CondensedProblem, condense
from hemivar.solvers.controls import Controls, Progress
from hemivar.solvers.direct import DirectOptimization, Optimizer, Powell
from hemivar.solvers.fixed_point import FixedPoint
from hemivar.solvers.lbfgs import LBFGS
from hemivar.solvers.load_line import LoadLine
from hemivar.solvers.load_stepping import LoadStepping
from hemivar.solvers.multigrid import NonsmoothMultigrid
from hemivar.solvers.nested import solve_nested, transfer_solution
from hemivar.solvers.newton import NonsmoothNewton, Search
from hemivar.solvers.solution import ContactState, Solution
from hemivar.solvers.solve import solve, suited
from hemivar.solvers.status import Status

_ALL = (
    NonsmoothNewton(),
    NonsmoothMultigrid(),
    DirectOptimization(Powell()),
    DirectOptimization(LBFGS()),
    DirectOptimization(ProximalBundle()),
    AugmentedLagrangian(),
    AugmentedLagrangianNewton(),
    PrimalDualActiveSet(ExactInner()),
    PrimalDualActiveSet(NewtonKrylov()),
)

#: Every method with its standard options, by the name that the command and the tables use.
METHODS: Mapping[str, Solver] = MappingProxyType({method.name: method for method in _ALL})

__all__ = [
    "LBFGS",
    "METHODS",
    "AugmentedLagrangian",
    "AugmentedLagrangianNewton",
    "CondensedProblem",
    "ContactState",
    "Controls",
    "DirectOptimization",
    "ExactInner",
    "FixedPoint",
    "InnerSolver",
    "LoadLine",
    "LoadStepping",
    "NewtonKrylov",
    "NonsmoothMultigrid",
    "NonsmoothNewton",
    "Optimizer",
    "Powell",
    "PrimalDualActiveSet",
    "Progress",
    "ProximalBundle",
    "RootFinder",
    "Search",
    "Solution",
    "Solver",
    "Status",
    "condense",
    "solve",
    "solve_nested",
    "suited",
    "transfer_solution",
]
