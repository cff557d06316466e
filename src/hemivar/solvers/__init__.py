"""Methods, the loop they share, and what they return."""

from hemivar.solvers.base import Solver
from hemivar.solvers.contact_states import NormalState, TangentialState
from hemivar.solvers.controls import Controls, Progress
from hemivar.solvers.fixed_point import FixedPoint
from hemivar.solvers.load_stepping import LoadStepping
from hemivar.solvers.methods import METHODS
from hemivar.solvers.multigrid import NonsmoothMultigrid
from hemivar.solvers.nested import solve_nested, transfer_solution
from hemivar.solvers.newton import NonsmoothNewton, Search
from hemivar.solvers.proximal_newton import ProximalNewton
from hemivar.solvers.semismooth import SemismoothNewton
from hemivar.solvers.solution import Solution
from hemivar.solvers.solve import solve
from hemivar.solvers.status import Status

__all__ = [
    "METHODS",
    "Controls",
    "FixedPoint",
    "LoadStepping",
    "NonsmoothMultigrid",
    "NonsmoothNewton",
    "NormalState",
    "Progress",
    "ProximalNewton",
    "Search",
    "SemismoothNewton",
    "Solution",
    "Solver",
    "Status",
    "TangentialState",
    "solve",
    "solve_nested",
    "transfer_solution",
]
