"""Methods, the loop they share, and what they return."""

from hemivar.solvers.base import Solver
from hemivar.solvers.boundary_result import BoundaryResult
from hemivar.solvers.contact_states import ContactStates, NormalState, TangentialState
from hemivar.solvers.controls import Controls, Progress
from hemivar.solvers.fixed_point import FixedPoint
from hemivar.solvers.load_stepping import LoadStepping
from hemivar.solvers.methods import METHODS, as_method, method_named
from hemivar.solvers.multigrid import NonsmoothMultigrid
from hemivar.solvers.nested import solve_nested, transfer_solution
from hemivar.solvers.newton import NonsmoothNewton, Search
from hemivar.solvers.proximal_newton import ProximalNewton
from hemivar.solvers.semismooth import SemismoothNewton
from hemivar.solvers.solution import Solution
from hemivar.solvers.solve import method_for, solve, solving, suited
from hemivar.solvers.status import Status
from hemivar.solvers.survey.active_set import ExactInner, InnerSolver, NewtonKrylov, PrimalDualActiveSet
from hemivar.solvers.survey.augmented_lagrangian import AugmentedLagrangian, AugmentedLagrangianNewton, RootFinder
from hemivar.solvers.survey.bundle import ProximalBundle
from hemivar.solvers.survey.lbfgs import LBFGS
from hemivar.solvers.survey.powell import Powell

__all__ = [
    "LBFGS",
    "METHODS",
    "AugmentedLagrangian",
    "AugmentedLagrangianNewton",
    "BoundaryResult",
    "ContactStates",
    "Controls",
    "ExactInner",
    "FixedPoint",
    "InnerSolver",
    "LoadStepping",
    "NewtonKrylov",
    "NonsmoothMultigrid",
    "NonsmoothNewton",
    "NormalState",
    "Powell",
    "PrimalDualActiveSet",
    "Progress",
    "ProximalBundle",
    "ProximalNewton",
    "RootFinder",
    "Search",
    "SemismoothNewton",
    "Solution",
    "Solver",
    "Status",
    "TangentialState",
    "as_method",
    "method_for",
    "method_named",
    "solve",
    "solve_nested",
    "solving",
    "suited",
    "transfer_solution",
]
