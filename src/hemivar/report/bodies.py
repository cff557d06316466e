"""Figures of deformed bodies, at print size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from hemivar.certificates import Certificate
from hemivar.errors import ProblemError
from hemivar.mechanics.scalar import ScalarProblem
from hemivar.report.body_colour import BodyColour
from hemivar.report.certificate_line import FOOT, certificate_line, title_of, write_below
from hemivar.report.deformed import DeformedBody
from hemivar.report.plane_body import Arrows, PlaneBody
from hemivar.report.scalar_map import plot_scalar
from hemivar.report.solid_body import draw_solid
from hemivar.report.style import body_axes, drawing
from hemivar.solvers import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["plot_solution"]


def plot_solution(
    solution: Solution,
    *,
    ax: Axes | None = None,
    scale: float | Literal["auto"] = 1.0,
    arrows: Arrows | Literal["force", "components", "none"] = Arrows.FORCE,
    title: str | None = None,
    note: str = "",
    unit: str = "",
    stress_unit: str = "",
    legend: bool = True,
    colour: BodyColour | Literal["stress", "displacement", "none"] | None = None,
    certificate: Certificate | None = None,
    largest_force: float | None = None,
) -> Figure:
    """The deformed body on its foundation, with contact states and contact forces.

    The deformed mesh (from 5000 cells on: the outline and the von Mises stress of the cells), the outline of the
    body at rest (dashed), the foundation (hatched) and the contact nodes by state. Arrows show the force of the
    foundation on the body, per area: where it pushes they end at the contact node, where it pulls they begin there.
    A 3D body is drawn by its surface, coloured by the von Mises stress, without forces.
    Of a scalar problem the unknown is drawn in colours over the mesh, hatched where an area is in contact.
    A line below the picture tells residual, uniqueness, margin and distance.

    Parameters
    ----------
    solution : Solution
        Of a problem with a mesh.
    ax : matplotlib Axes, optional
        Draw here rather than on a new figure.
    scale : float or "auto"
        Factor of the displacement; gaps are drawn with the same factor, so that contact looks closed.  ``"auto"``
        makes small displacements visible, unless the gap varies.
    arrows : Arrows
        ``"force"`` (default), ``"components"`` (pressure and friction apart) or ``"none"``.
    title : str, optional
        Title above the figure.
    note : str
        Data of the problem in words, added to the legend; the constants of the laws are there anyway.
    unit, stress_unit : str
        Units of length and stress for the labels.
    legend : bool
        Write the legend, the data and the scale of the arrows to the right of the axes, and the line below them.
    colour : BodyColour, optional
        What colours the body: ``"stress"`` (von Mises), ``"displacement"`` (its size) or ``"none"``; by itself the
        stress in space and from 5000 cells on.
    certificate : Certificate, optional
        What is known about the solution, for the line below; without it the line has the residual only.
    largest_force : float, optional
        Force per area of the longest arrow; the largest of the solution by default. One number for several pictures
        makes their arrows comparable.

    Raises
    ------
    ProblemError
        The problem was made of arrays and has no mesh; ``scale`` is not a positive number; there are no such arrows or
        colours; or a scalar problem, which has colours of its own, is given some.
    """
    line, title = certificate_line(solution, certificate), title_of(solution, title)
    if isinstance(solution.problem.origin, ScalarProblem):
        if colour is not None:
            raise ProblemError(f"colour = {str(colour)!r}: a scalar problem is coloured by its unknown; leave it out")
        with drawing():
            return plot_scalar(solution, ax, title, note, unit, stress_unit, line if legend else "", legend)
    body = DeformedBody.of(solution, scale)
    try:
        arrows = Arrows(arrows)
    except ValueError as error:
        raise ProblemError(f"arrows = {arrows!r}; choose one of {', '.join(Arrows)}") from error
    coloured = body.colour(colour)
    with drawing():
        if body.mesh.dim == 3:
            return draw_solid(body, coloured, title, (unit, stress_unit), line)
        fig, ax = body_axes(ax, body.mesh.points, title, unit, foot=FOOT if legend else 0.0)
        lowest, below = PlaneBody(body, (unit, stress_unit), largest_force).draw(ax, arrows, coloured, note, legend)
        if legend:
            write_below(lowest, line, below)
    return fig
