"""What a method supplies to the shared loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from hemivar._typing import Array
from hemivar.mechanics.discrete import DiscreteProblem
from hemivar.mechanics.residual import Residual
from hemivar.solvers.condensed import CondensedProblem
from hemivar.solvers.controls import Budget
from hemivar.solvers.status import Status

__all__ = ["Solver", "State", "System"]


class System(Protocol):
    """The unknowns a method works on: condensed onto the contact boundary, or all of them."""

    problem: DiscreteProblem

    def start(self, guess: Array | None = None) -> Array:
        """An admissible starting point ``(m, d)``."""
        ...

    def energy(self, r: Array) -> float:
        """E of the displacement with local displacements ``r``."""
        ...

    def multiplier(self, r: Array) -> Array:
        """Multiplier in equilibrium with ``r``."""
        ...

    def residual(self, r: Array, lam: Array) -> Residual:
        """The residual of the pair."""
        ...


@dataclass(frozen=True, eq=False)
class State:
    """Where a method is.

    Attributes
    ----------
    r, lam : arrays (m, d)
        Local displacement and multiplier.
    evaluations : int
        Evaluations so far.
    ended : Status or None
        Set by a method that ends by its own rule; CONVERGED here means "by my own rule", and the residual decides.
    energy : float or None
        Energy at ``r`` where the method knows it more accurately than a fresh evaluation would.
    error_bound : float or None
        Certified bound of the energy-norm distance to the solution.
    memory : object
        Whatever the method keeps between steps.
    contraction : float or None
        Measured contraction factor of a fixed-point iteration.
    """

    r: Array
    lam: Array
    evaluations: int = 0
    ended: Status | None = None
    energy: float | None = None
    error_bound: float | None = None
    memory: Any = None
    contraction: float | None = None


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

    @property
    def handles_state(self) -> bool:
        """Whether it treats laws whose bounds depend on the solution."""
        return False

    def refuse(self, problem: DiscreteProblem) -> str | None:
        """Why this method cannot treat the problem, in words, or None.  Asked before any work is done."""
        return None

    @abstractmethod
    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        """The first state, from a starting point that lies in the domain of the laws and a guess of its multiplier."""

    @abstractmethod
    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        """One step.  Long ones call ``budget.check()`` now and then."""

    def settle(self, system: CondensedProblem, state: State, budget: Budget) -> State | None:
        """A state with less energy to go on from, asked once the residual is small; None if ``state`` is final."""
        return None
