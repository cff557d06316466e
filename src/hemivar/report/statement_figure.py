"""Figures of what is stated: the body at rest with its supports, loads and contact boundaries."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np

from hemivar.basics.types import IntArray
from hemivar.files.boundary import polylines
from hemivar.mechanics import Statement
from hemivar.report.mesh_lines import mesh_lines
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, GREEN, MANY_CELLS, RED, body_axes, drawing, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

__all__ = ["painted", "plot_problem"]

_PLAIN = "#d9e6f2"


def plot_problem(problem: Statement, *, unit: str = "", legend: bool = True) -> Figure:
    """The body at rest, with the boundaries that have a condition: supports, loads and contact in colour.

    Parameters
    ----------
    problem : ContactProblem or ScalarProblem
    unit : str
        Unit of length for the labels.
    legend : bool
        Name the boundaries and their conditions to the right.
    """
    from matplotlib.lines import Line2D

    roles = {
        "support": (BLUE, 5.0, problem.supports), "load": (GREEN, 3.4, problem.boundary_loads),
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


def _plane(problem: Statement, marks: list[tuple[str, str, float]], unit: str) -> tuple[Figure, Axes]:
    """The cells, and the boundaries as lines; of two conditions the narrower line lies above."""
    from matplotlib.collections import LineCollection

    mesh = problem.mesh
    fig, ax = body_axes(None, mesh.points, None, unit)
    for line in polylines(mesh.boundary_facets):
        ax.fill(*mesh.points[line].T, color=_PLAIN, alpha=0.45, lw=0.0)
        ax.plot(*mesh.points[line].T, color="black", lw=0.9)
    if mesh.number_of_cells <= MANY_CELLS:
        ax.add_patch(mesh_lines(mesh.points, mesh.edges, mesh.number_of_cells, fig.get_figwidth() / 2.0))
    for name, colour, thickness in marks:
        lines = list(mesh.points[mesh.boundaries[name]])
        ax.add_collection(LineCollection(lines, colors=colour, linewidths=thickness, capstyle="round", zorder=4))
    return fig, ax


def _solid(problem: Statement, marks: list[tuple[str, str, float]], unit: str) -> tuple[Figure, Axes]:
    """The surface seen from obliquely below, facets coloured by their last condition, the others transparent."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    mesh = problem.mesh
    fig = new_figure((6.3, 5.0))
    ax = cast("Axes3D", fig.add_axes((0.02, 0.06, 0.62, 0.86), projection="3d"))
    facets, colours = painted(problem, marks)
    ax.add_collection3d(
        Poly3DCollection(list(mesh.points[facets]), facecolors=colours, edgecolors="#00000040", linewidths=0.15)
    )
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set(xlabel=with_unit("x", unit), ylabel=with_unit("y", unit), zlabel=with_unit("z", unit))
    ax.set_box_aspect(high - low, zoom=1.02)
    ax.view_init(-28.0, -60.0)
    return fig, ax


def painted(problem: Statement, marks: list[tuple[str, str, float]]) -> tuple[IntArray, list[str]]:
    """Facets of the surface (k, 3), and the colour of each: that of the last boundary that holds it, or a plain one."""
    mesh = problem.mesh
    parts = [(f"{_PLAIN}50", mesh.boundary_facets)]
    parts += [(f"{colour}c0", mesh.boundaries[name]) for name, colour, _ in marks]
    facets = np.concatenate([part for _, part in parts])[::-1]
    colours = np.repeat([colour for colour, _ in parts], [len(part) for _, part in parts])[::-1]
    _, last = np.unique(np.sort(facets, axis=1), axis=0, return_index=True)
    return facets[last], colours[last].tolist()
