"""Figures of what is stated: the body at rest with its supports, loads and contact boundaries."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import IntArray
from hemivar.mechanics import ContactProblem
from hemivar.report.drawn_body import PLAIN, DrawnPlane, DrawnSurface
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREEN, RED, body_axes, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["painted", "plot_problem"]


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

    roles = {
        "support": (BLUE, 5.0, problem.supports), "load": (GREEN, 3.4, problem.tractions),
        "contact": (RED, 1.8, problem.contact),
    }  # fmt: skip
    with drawing():
        draw = _plane if problem.mesh.dim == 2 else _solid
        marks = [(name, colour, width) for colour, width, named in roles.values() for name in named]
        fig, ax = draw(problem, marks, unit)
        handles = [
            Line2D([], [], color=colour, lw=width, label=f"{role}: {name}")
            for role, (colour, width, named) in roles.items()
            for name in named
        ]
        if legend and handles:
            ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0)
    return fig


def _plane(problem: ContactProblem, marks: list[tuple[str, str, float]], unit: str) -> tuple[Figure, Axes]:
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


def _solid(problem: ContactProblem, marks: list[tuple[str, str, float]], unit: str) -> tuple[Figure, Axes]:
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
