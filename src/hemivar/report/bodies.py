"""Figures of bodies, in the plane and in space: as stated at rest, and deformed, at print size."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from hemivar.basics.arguments import expecting, one_of, positive, quoted
from hemivar.basics.types import Array, IntArray
from hemivar.certificates import Certificate
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.mechanics import ContactProblem
from hemivar.mesh.boundary_rule import boundary_rule
from hemivar.mesh.mesh import Mesh
from hemivar.report.certificate_line import FOOT, certificate_line, title_of, write_below, write_foot
from hemivar.report.deformed import BodyColour, DeformedBody
from hemivar.report.drawn_body import PLAIN, DrawnPlane, DrawnSurface, mark_states
from hemivar.report.picture import new_figure
from hemivar.report.plane_body import Arrows, PlaneBody
from hemivar.report.scalar_map import plot_scalar
from hemivar.report.style import (
    BLUE,
    DASHES,
    GREEN,
    GREY,
    RED,
    axes,
    body_axes,
    drawing,
    in_rows,
    legend_beside,
    state_mark,
)
from hemivar.solvers import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["painted", "plot_problem", "plot_solution", "sharp_edges", "viewing_direction"]


@expecting(
    solution=Solution, ax=axes, title=str, note=str, unit=str, stress_unit=str, legend=bool, certificate=Certificate,
    largest_force=positive,
)  # fmt: skip
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
    field = solution.problem.field
    if field is not None and field.components == 1:
        if colour is not None:
            raise ProblemError(
                f"colour = {quoted(str(colour))}: a scalar problem is coloured by its unknown; leave it out"
            )
        with drawing():
            return plot_scalar(solution, ax, title, note, unit, stress_unit, line if legend else "", legend)
    body = DeformedBody.of(solution, scale)
    arrows = one_of(arrows, "arrows", Arrows)
    coloured = body.colour(colour)
    with drawing():
        if body.mesh.dim == 3:
            return _solid(body, coloured, title, (unit, stress_unit), line)
        fig, ax = body_axes(ax, body.mesh.points, title, unit, foot=FOOT if legend else 0.0)
        lowest, below = PlaneBody(body, (unit, stress_unit), largest_force).draw(ax, arrows, coloured, note, legend)
        if legend:
            write_below(lowest, line, below)
    return fig


def sharp_edges(mesh: Mesh, degrees: float = 30.0) -> IntArray:
    """Edges of the surface at which its normal turns by more than an angle, (k, 2) vertices."""
    facets = mesh.boundary_facets
    normals = boundary_rule(mesh, None).normals
    pairs = np.sort(np.vstack([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [0, 2]]]), axis=1)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    facet = np.tile(np.arange(len(facets)), 3)[order]
    cosine = np.einsum("kd,kd->k", normals[facet[::2]], normals[facet[1::2]])
    return np.asarray(pairs[order[::2]][cosine < math.cos(math.radians(degrees))])


def _solid(body: DeformedBody, colour: BodyColour, title: str | None, units: tuple[str, str], line: str) -> Figure:
    """The surface of the deformed body, coloured; edges at rest; contact points by state; a line below.

    ``units`` are those of length and stress.
    """
    from mpl_toolkits.mplot3d.art3d import Line3DCollection

    problem, mesh, moved = body.problem, body.mesh, body.vertices
    fig = new_figure((6.3, 5.0))
    extent = (np.minimum(moved, mesh.points).min(axis=0), np.maximum(moved, mesh.points).max(axis=0))
    drawn = DrawnSurface(fig, (0.02, 0.06, 0.74, 0.82), mesh.boundary_facets, extent, units[0])
    plain, ax = colour is BodyColour.NONE, drawn.ax
    drawn.move(moved, None if plain else body.values(colour))
    if not plain:
        fig.colorbar(drawn.surface, cax=fig.add_axes((0.84, 0.22, 0.022, 0.5))).set_label(colour.label(*units))
    edges = mesh.points[sharp_edges(mesh)]
    ax.add_collection3d(Line3DCollection(list(edges), colors=GREY, linewidths=0.7, linestyles=[DASHES], zorder=1))
    if problem.contact_points:
        elevation, azimuth = _view(problem)
        ax.view_init(elevation, azimuth)
        for kind, here, _ in body.states():
            if here.any():
                mark_states(ax, kind, body.contact_places[here], problem.contact_points)
    _legend_of_solid(fig, body)
    write_foot(fig, line)
    if title:
        fig.suptitle(title, fontsize=10, y=0.98)
    return fig


def _legend_of_solid(fig: Figure, body: DeformedBody) -> None:
    """The legend below a body in space: its lines, and the states that there are."""
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color="black", lw=0.9, label=body.label),
        Line2D([], [], color=GREY, lw=0.7, ls=DASHES, label="edges at rest"),
    ]
    for kind, here, label in body.states() if body.problem.contact_points else ():
        if here.any():
            handles.append(state_mark(kind, label))
    fig.legend(
        handles=handles, loc="lower center", bbox_to_anchor=(0.5, 0.03), ncols=in_rows(len(handles)), columnspacing=1.4,
        handlelength=1.8,
    )  # fmt: skip


def viewing_direction(problem: DiscreteProblem) -> Array:
    """Unit vector from the body to a viewer who sees the contact boundary, (3,)."""
    elevation, azimuth = _view(problem) if problem.contact_points else (30.0, -60.0)
    e, a = math.radians(elevation), math.radians(azimuth)
    return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def _view(problem: DiscreteProblem) -> tuple[float, float]:
    """Elevation and azimuth, in degrees, from which the contact boundary can be seen; of two bodies, both of them."""
    contact = problem.contact
    if contact.pairs:
        return 28.0, -60.0
    assert contact.frames is not None
    x, y, z = contact.weights @ contact.frames[:, 0] / contact.weights.sum()
    azimuth = math.degrees(math.atan2(y, x)) + 30.0 if math.hypot(x, y) > 0.5 else -60.0
    return (-28.0 if z < -0.5 else 28.0), azimuth


def plot_problem(problem: ContactProblem, *, unit: str = "", legend: bool = True) -> Figure:
    """The body at rest, with the boundaries that have a condition: supports, loads and contact in colour.

    Parameters
    ----------
    problem : ContactProblem
    unit : str
        Unit of length for the labels.
    legend : bool
        Name the boundaries and their conditions to the right.
    """
    from matplotlib.lines import Line2D

    touching = [name for at, contact in problem.contact.items() for name in (at, contact.against) if name]
    roles = {
        "support": (BLUE, 5.0, [name for name in problem.supports if name in problem.mesh.boundaries]),
        "load": (GREEN, 3.4, problem.tractions),
        "contact": (RED, 1.8, [name for name in touching if name in problem.mesh.boundaries]),
    }  # fmt: skip
    with drawing():
        draw = _plane_at_rest if problem.mesh.dim == 2 else _solid_at_rest
        marks = [(name, colour, width) for colour, width, named in roles.values() for name in named]
        fig, ax = draw(problem, marks, unit)
        handles = [
            Line2D([], [], color=colour, lw=width, label=f"{role}: {name}")
            for role, (colour, width, named) in roles.items()
            for name in named
        ]
        if legend and handles:
            legend_beside(ax, handles=handles)
    return fig


def _plane_at_rest(problem: ContactProblem, marks: list[tuple[str, str, float]], unit: str) -> tuple[Figure, Axes]:
    """The cells, and the boundaries as lines; of two conditions the narrower line lies above."""
    from matplotlib.collections import LineCollection

    mesh = problem.mesh
    fig, ax = body_axes(None, mesh.points, None, unit)
    drawn = DrawnPlane(ax, mesh, fig.get_figwidth() / 2.0)
    drawn.move(mesh.points)
    drawn.fit()
    for name, colour, thickness in marks:
        lines = list(mesh.points[mesh.boundaries[name]])
        ax.add_collection(LineCollection(lines, colors=colour, linewidths=thickness, capstyle="round", zorder=4))
    return fig, ax


def _solid_at_rest(problem: ContactProblem, marks: list[tuple[str, str, float]], unit: str) -> tuple[Figure, Axes]:
    """The surface seen from obliquely below, facets coloured by their last condition, the others transparent."""
    mesh = problem.mesh
    fig = new_figure((6.3, 5.0))
    facets, colours = painted(problem, marks)
    extent = mesh.points.min(axis=0), mesh.points.max(axis=0)
    drawn = DrawnSurface(fig, (0.02, 0.06, 0.62, 0.86), facets, extent, unit)
    drawn.move(mesh.points)
    drawn.surface.set_facecolor(colours)
    drawn.ax.view_init(-28.0, -60.0)
    return fig, drawn.ax


def painted(problem: ContactProblem, marks: list[tuple[str, str, float]]) -> tuple[IntArray, list[str]]:
    """Facets of the surface (k, 3), and the colour of each: that of the last boundary that holds it, or a plain one."""
    mesh = problem.mesh
    parts = [(f"{PLAIN}50", mesh.boundary_facets)]
    parts += [(f"{colour}c0", mesh.boundaries[name]) for name, colour, _ in marks]
    facets = np.concatenate([part for _, part in parts])[::-1]
    colours = np.repeat([colour for colour, _ in parts], [len(part) for _, part in parts])[::-1]
    _, last = np.unique(np.sort(facets, axis=1), axis=0, return_index=True)
    return facets[last], colours[last].tolist()
