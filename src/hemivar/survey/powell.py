"""Direct optimization (survey, section 4.1): Powell's method on the energy of the condensed problem."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import check_numbers
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget, OutOfTime
from hemivar.solvers.status import Status
from hemivar.systems.condensed import CondensedProblem

__all__ = ["Powell"]


@dataclass(frozen=True)
class Powell(Solver):
    """Powell's conjugate direction method of SciPy, as in the survey; one step is one whole minimisation.

    It stops when the relative change of the energy in an iteration is below ``ftol``; with the survey's tolerances the
    end point is short of the minimiser by about half a per cent.

    Parameters
    ----------
    ftol, xtol : float
        Relative tolerances of energy and unknowns (scaled by a typical displacement).
    restarts : int
        How many times the minimisation is repeated from its end point.
    """

    ftol: float = 1e-4
    xtol: float = 1e-4
    restarts: int = 0
    name: ClassVar[str] = "direct-powell"
    descends: ClassVar[bool] = True
    default_steps: ClassVar[int] = 50

    def __post_init__(self) -> None:
        check_numbers(self)
        if not (self.ftol > 0.0 and self.xtol > 0.0):
            raise ProblemError(f"Powell's tolerances are {self.ftol}, {self.xtol}; they must be positive")

    def refuse(self, problem: DiscreteProblem) -> str | None:
        domain = problem.law.penetrations
        if problem.contact_points and (np.isfinite(domain.lower).any() or np.isfinite(domain.upper).any()):
            return (
                f"law '{problem.law.name}' is +inf outside its domain, and line searches along single unknowns "
                "need a finite energy; use newton, bundle, direct-lbfgs or active-set"
            )
        return None

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        return replace(start, evaluations=1, energy=system.energy(start.r))

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        free = system.free
        length = system.length_scale
        unit = max(
            abs(system.energy(system.start()) - (state.energy or 0.0)),
            length * float(np.abs(system.load).sum()),
        )
        unit = unit if unit > 0.0 else 1.0
        matrix = np.ascontiguousarray(system.matrix[np.ix_(free, free)]) * (length**2 / unit)
        outside = system.matrix[free] @ system.fixed.ravel()
        force = (system.load[free] - outside) * (length / unit)
        weights = system.weights / unit
        count = 0
        best: tuple[float, Array] = (np.inf, state.r)

        def local(x: Array) -> Array:
            r = system.fixed.copy()
            r.ravel()[free] = length * x
            return r

        def energy(x: Array) -> float:
            nonlocal count, best
            count += 1
            if count % 100 == 0:
                budget.check()
            r = local(x)
            value = float(0.5 * x @ (matrix @ x) - force @ x + weights @ system.law.value(r))
            if value < best[0]:
                best = (value, r)
            return value

        with IMPORTS:
            from scipy.optimize import minimize

        ended: Status | None = None
        try:
            minimize(
                energy,
                state.r.ravel()[free] / length,
                method="Powell",
                options={"ftol": self.ftol, "xtol": self.xtol, "maxfev": 10**9, "maxiter": 10**6},
            )
        except OutOfTime:
            ended = Status.MAX_TIME
        except KeyboardInterrupt:  # its one step is the whole minimisation, and the best point of it is kept
            ended = Status.INTERRUPTED
        runs = (state.memory or 0) + 1
        if ended is None and runs > self.restarts:
            ended = Status.CONVERGED
        r = best[1]
        return State(r, system.multiplier(r), state.evaluations + count, ended, system.energy(r), memory=runs)
