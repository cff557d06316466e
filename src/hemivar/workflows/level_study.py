"""A convergence study: a problem that a function makes for each level, what is measured on it, errors and orders."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arguments import answer, described, expect, whole_number
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.forms import FormProblem
from hemivar.solvers import Controls, Solution, Solver, solve
from hemivar.solvers.status import check_interrupt

__all__ = ["LevelStudy", "study_levels"]

#: Levels that no machine has room for.
_MOST_LEVELS = 25

Made = DiscreteProblem | FormProblem
#: What is measured of a solution, beside what was made for its level.
Measure = Callable[[Solution, Made], Mapping[str, float]]


@dataclass(frozen=True, eq=False)
class LevelStudy(PickleMixin):
    """What :func:`study_levels` found.

    Attributes
    ----------
    solutions : tuple of Solution
        One for each level, from coarse to fine.
    values : mapping of name to array (levels,)
        What was measured.
    known : mapping of name to float
        Exact values, as far as they are known; zero of what is an error already.
    """

    solutions: tuple[Solution, ...]
    values: Mapping[str, Array]
    known: Mapping[str, float]

    def errors(self, name: str) -> Array:
        """Distances (levels,) from the known value, or from that of the finest level, where there is nan then.

        Raises
        ------
        ProblemError
            Nothing of that name was measured.
        """
        if name not in self.values:
            raise ProblemError(f"'{name}' was not measured; there are {', '.join(self.values)}")
        values = self.values[name]
        if name in self.known:
            return np.abs(values - self.known[name])
        return np.append(np.abs(values[:-1] - values[-1]), np.nan)

    def steps(self, name: str) -> Array:
        """Observed orders from each level to the next, ``log2(e_k-1 / e_k)``; nan for the first."""
        errors = self.errors(name)
        with np.errstate(divide="ignore", invalid="ignore"):
            orders = np.log2(errors[:-1] / errors[1:])
        return np.concatenate([[np.nan], np.where(np.isfinite(orders), orders, np.nan)])

    def __repr__(self) -> str:
        lines = [f"LevelStudy({len(self.solutions)} levels)"]
        for name in self.values:
            lines.append(f"  {name}: value, error, order")
            rows = zip(self.solutions, self.values[name], self.errors(name), self.steps(name), strict=True)
            for solution, value, error, order in rows:
                shown = ["" if math.isnan(number) else f"{number:.3g}" for number in (error, order)]
                lines.append(f"    {solution.problem.unknowns:9d} unknowns  {value:.8g}  {'  '.join(shown)}".rstrip())
        return "\n".join(lines)


def study_levels(
    make: Callable[[int], Made],
    refine: int = 4,
    *,
    measure: Measure,
    known: Mapping[str, float] | None = None,
    method: Solver | str | None = None,
    controls: Controls | None = None,
) -> LevelStudy:
    """Solve the problem of every level, and measure it; each level halves the cells of the one before.

    Parameters
    ----------
    make : callable
        The problem of a level 0, 1, ..., ``refine``: a :class:`hemivar.DiscreteProblem`, of arrays or forms, or a
        :class:`hemivar.fem.FormProblem`.
    refine : int
    measure : callable
        Of a solution and of what ``make`` returned for it: numbers by name.
    known : mapping of name to float, optional
        Exact values; by default those of the finest level.
    method, controls
        As in :func:`hemivar.solve`.

    Returns
    -------
    LevelStudy

    Raises
    ------
    ProblemError, MethodError
        What is made is no problem, a solve ends without a solution, or levels are measured in different ways.
    """
    for name, function in (("make", make), ("measure", measure)):
        if not callable(function):
            raise ProblemError(f"{name} is {described(function)}; give a function")
    expect({} if known is None else known, Mapping, "known", "give numbers by name")
    levels = whole_number(refine, "refine", 1) + 1
    if levels > _MOST_LEVELS:
        raise ProblemError(f"refine is {refine}, and each level halves the cells; give at most {_MOST_LEVELS - 1}")
    rows: list[Mapping[str, float]] = []
    solutions: list[Solution] = []
    given = dict(known or {})
    for level in range(levels):
        remedy = "return a DiscreteProblem or a FormProblem"
        answered = answer(make, (level,), "study_levels: make", "let it take the number of a level")
        made: Made = expect(answered, DiscreteProblem | FormProblem, f"the problem of level {level}", remedy)
        discrete = made.discrete if isinstance(made, FormProblem) else made
        solution = solve(discrete, method, controls=controls)
        check_interrupt(solution.status)
        solutions.append(solution.raise_for_status())
        takes = "let it take a solution and what make returned"
        rows.append(_measured(answer(measure, (solutions[-1], made), "study_levels: measure", takes), level))
        if rows[0].keys() != rows[-1].keys():
            raise ProblemError(f"level {level} measures {', '.join(rows[-1])}, and level 0 {', '.join(rows[0])}")
    if unknown := sorted(given.keys() - rows[0].keys()):
        raise ProblemError(f"known names '{unknown[0]}', which is not measured; there are {', '.join(rows[0])}")
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return LevelStudy(tuple(solutions), values, given)


def _measured(measures: object, level: int) -> Mapping[str, float]:
    if not isinstance(measures, Mapping) or not measures:
        raise ProblemError(f"measure returns {described(measures)} at level {level}; return numbers by name")
    return {str(name): float(value) for name, value in measures.items()}
