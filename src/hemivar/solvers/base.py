"""The contract of a method: the states, steps and ends that it supplies to the shared iteration."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.recession import RecessionFunction
from hemivar.discrete.residual import Residual
from hemivar.solvers.controls import Budget
from hemivar.solvers.status import Status
from hemivar.systems.contact_system import PointSystem
from hemivar.systems.workspace import Workspace

__all__ = ["Solver", "SolverSystem", "State"]


class SolverSystem(PointSystem, Protocol):
    """A system of a problem that is in one place."""

    @property
    def problem(self) -> DiscreteProblem:
        """The problem."""

    def free_growth(self) -> list[RecessionFunction]:
        """Growth of the energy along the motions that deform nothing, by groups of parts that move by themselves."""

    def for_problem(self, problem: DiscreteProblem) -> Self:
        """The same body under another load, gap or law."""


@dataclass(frozen=True, eq=False)
class State:
    """Where a method is."""

    r: Array  # (m, d) or (n,): the point: local displacements, or all unknowns, as the system has it
    lam: Array  # (m, d): multiplier
    evaluations: int = 0  # evaluations so far
    # set by a method that ends by its own rule; CONVERGED here means "by my own rule", and the residual decides
    ended: Status | None = None
    # energy at ``r`` where the method knows it more accurately than a fresh evaluation would
    energy: float | None = None
    residual: Residual | None = None  # residual of the pair where the method has found it
    error_bound: float | None = None  # certified bound of the energy-norm distance to the solution
    memory: Any = None  # whatever the method keeps between steps
    contraction: float | None = None  # measured contraction factor of a fixed-point iteration
    fallbacks: int = 0  # how often the method had to take another way
    # (float, float): part of the load up to which equilibria were found while it grew, and the next at which none was
    carried: tuple[float, float] | None = None


class Solver(ABC):
    """A method: a frozen dataclass of options.  Everything it remembers while it works lives in :class:`State`."""

    #: Name used by the command and in tables.
    name: ClassVar[str]
    #: Limit of steps unless the controls set one.
    default_steps: ClassVar[int] = 100
    #: Steps without progress in the residual after which it counts as stalled.
    patience: ClassVar[int] = 12
    #: Whether its energy never rises, so that of two iterates the one with less energy is the better one.
    descends: ClassVar[bool] = False

    #: Whether points of a condensed body may be displacements, see :attr:`CondensedProblem.displaced`.
    displaces: ClassVar[bool] = False

    @property
    def condenses(self) -> bool:
        """Whether it works on the body condensed onto its contact boundary."""
        return True

    def for_tolerance(self, rtol: float) -> Solver:
        """The method, with what it solves inside as accurate as a relative tolerance of the whole asks for."""
        return self

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> Any:
        """The system the method works on; what is expensive about it comes from the workspace."""
        return workspace.condensed(problem)

    def first_guess(self, system: Any, budget: Budget) -> tuple[Array, Status | None]:
        """Where to start if the user names no point; and a status where the search for it was stopped."""
        return system.start(), None

    @property
    def handles_state(self) -> bool:
        """Whether it treats laws whose bounds depend on the solution."""
        return False

    @property
    def handles_nonlinear(self) -> bool:
        """Whether it treats bodies that are not linear."""
        return False

    def local_descent(self) -> Solver:
        """The method for a body that its foundation holds at rest only: it should not cross a barrier of the energy,
        for far beyond them the energy falls without end."""
        return self

    def refuse(self, problem: DiscreteProblem) -> str | None:
        """Why this method cannot treat the problem, in words, or None.  Asked before any work is done."""
        return None

    @abstractmethod
    def begin(self, system: Any, start: State, budget: Budget) -> State:
        """The first state, from a starting point that lies in the domain of the laws and a guess of its multiplier."""

    @abstractmethod
    def step(self, system: Any, state: State, budget: Budget) -> State:
        """One step.  Long ones call ``budget.check()`` now and then."""

    def settle(self, system: Any, state: State, budget: Budget) -> State | None:
        """A state with less energy to go on from, asked once the residual is small; None if ``state`` is final."""
        return None

    def release(self, state: State) -> None:  # noqa: B027 - most keep nothing that another solve could use
        """Give back what a state remembers, once nothing goes on from it."""
