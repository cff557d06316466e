"""Drawings of three-dimensional bodies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.mesh.mesh import Mesh
from hemivar.report.body_colour import BodyColour
from hemivar.report.certificate_line import write_foot
from hemivar.report.deformed import DeformedBody
from hemivar.report.drawn_body import DrawnSurface, mark_states
from hemivar.report.picture import new_figure
from hemivar.report.style import DASHES, GREY, in_rows, state_mark

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_solid", "legend_of_solid", "sharp_edges", "viewing_direction"]


def sharp_edges(mesh: Mesh, degrees: float = 30.0) -> IntArray:
    """Edges of the surface at which its normal turns by more than an angle, (k, 2) vertices."""
    facets = mesh.boundary_facets
    normals, _ = mesh.facet_normals(facets)
    pairs = np.sort(np.vstack([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [0, 2]]]), axis=1)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    facet = np.tile(np.arange(len(facets)), 3)[order]
    cosine = np.einsum("kd,kd->k", normals[facet[::2]], normals[facet[1::2]])
    return np.asarray(pairs[order[::2]][cosine < math.cos(math.radians(degrees))])


def draw_solid(body: DeformedBody, colour: BodyColour, title: str | None, units: tuple[str, str], line: str) -> Figure:
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
    legend_of_solid(fig, body)
    write_foot(fig, line)
    if title:
        fig.suptitle(title, fontsize=10, y=0.98)
    return fig


def legend_of_solid(fig: Figure, body: DeformedBody) -> None:
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
    """Elevation and azimuth, in degrees, from which the contact boundary can be seen."""
    contact = problem.contact
    assert contact.frames is not None
    x, y, z = contact.weights @ contact.frames[:, 0] / contact.weights.sum()
    azimuth = math.degrees(math.atan2(y, x)) + 30.0 if math.hypot(x, y) > 0.5 else -60.0
    return (-28.0 if z < -0.5 else 28.0), azimuth
