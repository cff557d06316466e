"""All solutions of one problem side by side."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import whole_number
from hemivar.branches import SolutionSet
from hemivar.errors import ProblemError
from hemivar.mechanics.scalar import ScalarProblem
from hemivar.report.bodies import plot_solution
from hemivar.report.deformed import DeformedBody
from hemivar.report.picture import new_figure
from hemivar.report.style import SERIES, drawing
from hemivar.solvers import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_solutions"]

#: How many bodies stand side by side, and how wide each is, in inches.
_BESIDE, _WIDTH = 3, 2.3


def plot_solutions(found: SolutionSet, *, title: str | None = None, most: int = 9) -> Figure:
    """The solutions from the lowest energy on, each with its kind and energy.

    Plane bodies are drawn deformed, side by side and by the same factor; of other problems the displacement into the
    foundation is drawn over the number of the contact point, a curve for each solution.

    Parameters
    ----------
    found : SolutionSet
    title : str, optional
        The number of solutions and whether there may be others, by default.
    most : int
        How many are drawn.

    Raises
    ------
    ProblemError
        There is no solution, or the problem has no contact points.
    """
    if not found.solutions:
        raise ProblemError(f"there is no solution to draw: {found.searched}")
    count = f"{len(found)} solution{'s' if len(found) != 1 else ''}"
    said = f"{count}, {'no others' if found.exhaustive else 'perhaps more'}"
    shown = found.solutions[: whole_number(most, "most", 1)]
    said += f"; the {len(shown)} of least energy" if len(found) > len(shown) else ""
    field, stated = shown[0].problem.field, shown[0].problem.origin
    with drawing():
        flat = field is not None and field.mesh.dim == 2 and not isinstance(stated, ScalarProblem)
        return _bodies(shown, title or said) if flat else _curves(shown, title or said)


def _caption(solution: Solution) -> str:
    kind = solution.kind.value if solution.kind is not None else solution.status.value
    return f"{kind}\nenergy {solution.energy:.4g}"


def _bodies(solutions: tuple[Solution, ...], title: str) -> Figure:
    field = solutions[0].problem.field
    assert field is not None
    width, height = np.ptp(field.mesh.points, axis=0)
    columns = min(len(solutions), _BESIDE)
    rows = math.ceil(len(solutions) / columns)
    shape = float(np.clip(height / width + 0.25, 0.35, 1.6))
    fig = new_figure((max(_WIDTH * columns, 3.2) + 0.4, rows * (_WIDTH * shape + 0.75) + 0.4), layout="constrained")
    panels = fig.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for panel in panels.ravel()[len(solutions) :]:
        panel.set_visible(False)
    factor = min(DeformedBody.of(solution, "auto").factor for solution in solutions)
    for panel, solution in zip(panels.ravel(), solutions, strict=False):
        plot_solution(solution, ax=panel, scale=factor, legend=False)
        panel.set_title(_caption(solution), fontsize=8.0)
        panel.set(xlabel="", ylabel="")
    fig.suptitle(title if factor == 1.0 else f"{title}; displacements times {factor:g}", fontsize=10)
    return fig


def _curves(solutions: tuple[Solution, ...], title: str) -> Figure:
    from matplotlib.ticker import MaxNLocator

    count = solutions[0].problem.contact_points
    if not count:
        raise ProblemError("the problem has no contact points to draw; its one solution has solution.plot()")
    fig = new_figure((6.3, 3.6), layout="constrained")
    ax = fig.subplots()
    ax.axhline(0.0, color="#b0b0b0", lw=0.6, zorder=0)
    for number, solution in enumerate(solutions):
        ax.plot(
            np.arange(count), solution.local[:, 0], color=SERIES[number % len(SERIES)],
            ls="-" if number < len(SERIES) else "--", marker="o" if count <= 50 else "", ms=3.5,
            label=_caption(solution),
        )  # fmt: skip
    ax.set_xlim(-0.5, count - 0.5)
    ax.xaxis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))
    ax.set(xlabel="contact point", ylabel="penetration" if solutions[0].problem.contact.components else "displacement")
    ax.spines[["top", "right"]].set_visible(False)
    fig.legend(loc="outside right upper")
    fig.suptitle(title, fontsize=10)
    return fig
