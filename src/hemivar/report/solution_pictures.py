"""Several solutions of one problem side by side, each with its kind and its energy."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Literal

from hemivar.branches import SolutionSet
from hemivar.errors import ProblemError
from hemivar.report.bodies import plot_solution
from hemivar.report.body_colour import BodyColour
from hemivar.report.certificate_line import write_foot
from hemivar.report.contact_curves import plot_contact
from hemivar.report.deformed import DeformedBody
from hemivar.report.picture import new_figure
from hemivar.report.saving import png
from hemivar.report.style import drawing
from hemivar.solvers import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["MOST_PICTURES", "common_scale", "plot_solutions"]

#: Solutions that are drawn, those of least energy, and how many stand side by side.
MOST_PICTURES = 12
_BESIDE = 3


def plot_solutions(
    found: SolutionSet,
    *,
    title: str | None = None,
    unit: str = "",
    stress_unit: str = "",
    colour: BodyColour | Literal["stress", "displacement", "none"] | None = None,
) -> Figure:
    """The solutions side by side by their energy, up to twelve, with one scale of the displacement for all.

    Parameters
    ----------
    found : SolutionSet
    title : str, optional
    unit, stress_unit : str
        Units of length and stress for the labels.
    colour : BodyColour, optional
        What colours the bodies, as in :func:`plot_solution`.

    Raises
    ------
    ProblemError
        No solution was found, or there are no such colours.
    """

    if not len(found):
        raise ProblemError("no solution was found that could be drawn; search from more starts")
    shown, scale = found[:MOST_PICTURES], common_scale(found)
    columns = min(len(shown), _BESIDE)
    rows = -(-len(shown) // columns)
    with drawing():
        fig = new_figure((max(2.6 * columns, 3.4), 2.7 * rows + 0.4), layout="constrained")
        panels = fig.subplots(rows, columns, squeeze=False).ravel()
        for number, (panel, solution) in enumerate(zip(panels, shown, strict=False), start=1):
            _draw(panel, solution, scale, unit, stress_unit, colour)
            kind = "" if solution.kind is None else f", {solution.kind}"
            panel.set_title(f"{number}{kind}\nenergy {solution.energy:.6g}", fontsize=8.0)
        for panel in panels[len(shown) :]:
            panel.set_axis_off()
        if title:
            fig.suptitle(title, fontsize=10.0)
        many = f"{len(found)} solutions" if len(found) > 1 else "one solution"
        worst = max(solution.residual.relative for solution in found)
        least = "" if len(shown) == len(found) else f", {len(shown)} of least energy shown"
        others = "no others exist" if found.exhaustive else "there may be others"
        write_foot(fig, f"{many}{least}; {others}; residuals at most {worst:.1e}")
    return fig


def common_scale(found: SolutionSet) -> float:
    """A factor of the displacement for the pictures of all solutions: that of the one that moves farthest."""
    bodies = [solution for solution in found if solution.problem.field is not None]
    return min((DeformedBody.of(solution, "auto").factor for solution in bodies), default=1.0)


def _draw(
    panel: Axes, solution: Solution, scale: float, unit: str, stress_unit: str, colour: BodyColour | str | None
) -> None:
    """One solution: in the plane on these axes, otherwise as a picture of its own figure."""
    field = solution.problem.field
    if field is not None and field.mesh.dim == 2:
        plot_solution(solution, ax=panel, scale=scale, legend=False, unit=unit, stress_unit=stress_unit, colour=colour)  # type: ignore[arg-type]
        panel.tick_params(labelsize=7.0)
        return
    from matplotlib.image import imread

    if field is None:
        own = plot_contact(solution, unit=unit, stress_unit=stress_unit)
    else:
        own = plot_solution(solution, scale=scale, unit=unit, stress_unit=stress_unit, colour=colour)  # type: ignore[arg-type]
    panel.imshow(imread(io.BytesIO(png(own)), format="png"))
    panel.set_axis_off()


def plot_body_or_points(
    solution: Solution, *, scale: float | Literal["auto"], title: str | None, unit: str, stress_unit: str
) -> Figure:
    """The deformed body; the contact points of a problem without a mesh."""
    if solution.problem.field is None:
        return plot_contact(solution, title=title, unit=unit, stress_unit=stress_unit)
    return plot_solution(solution, scale=scale, title=title, unit=unit, stress_unit=stress_unit)
