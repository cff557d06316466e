"""Drawings of three-dimensional bodies and of their contact surfaces."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem import nodal_average, von_mises
from hemivar.files.boundary import ContactBoundary, contact_boundaries, global_vectors
from hemivar.mesh.mesh import Mesh
from hemivar.report._style import GREY, MARKERS, STATE_COLOURS, with_unit
from hemivar.solvers import ContactState, Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["contact_maps", "draw_solid", "moved_points", "sharp_edges", "shown_on_surface", "viewing_direction"]

_MANY_FACETS = 4000
_MOST_ARROWS = 14


def shown_on_surface(solution: Solution) -> tuple[Array, str]:
    """Values at the vertices (N,) that colour the surface, and their name: von Mises stress or else displacement."""
    field = solution.problem.field
    assert field is not None
    if solution.problem.origin is not None:
        return nodal_average(field.mesh, von_mises(solution.problem.origin, solution.displacement)), "von Mises stress"
    return np.linalg.norm(solution.displacement[: field.mesh.number_of_nodes], axis=1), "displacement"


def sharp_edges(mesh: Mesh, degrees: float = 30.0) -> IntArray:
    """Edges of the surface at which its normal turns by more than an angle, (k, 2) vertices."""
    facets = mesh.boundary_facets
    normals, _ = mesh.facet_normals(facets)
    pairs = np.sort(np.vstack([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [0, 2]]]), axis=1)
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    facet = np.tile(np.arange(len(facets)), 3)[order]
    cosine = np.einsum("kd,kd->k", normals[facet[::2]], normals[facet[1::2]])
    return np.asarray(pairs[order[::2]][cosine < math.cos(math.radians(degrees))])


def draw_solid(
    solution: Solution, moved: Array, factor: float, title: str | None, unit: str, stress_unit: str
) -> Figure:
    """The surface of the deformed body (vertices ``moved``), coloured; edges at rest; contact points by state."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    problem = solution.problem
    assert problem.field is not None
    mesh = problem.field.mesh
    facets = mesh.boundary_facets
    fig = Figure(figsize=(6.3, 5.0))
    ax: Any = fig.add_axes((0.02, 0.06, 0.74, 0.82), projection="3d", computed_zorder=False)
    fine = len(facets) > _MANY_FACETS
    surface = Poly3DCollection(list(moved[facets]), linewidths=0.15, edgecolors="#00000060", zorder=2)
    surface.set_rasterized(fine)
    values, name = shown_on_surface(solution)
    shown = values[facets].mean(axis=1)
    surface.set_array(shown)
    surface.set_cmap("cividis")
    bar = fig.colorbar(surface, cax=fig.add_axes((0.84, 0.22, 0.022, 0.5)))
    bar.set_label(with_unit(name, unit if name == "displacement" else stress_unit))
    ax.add_collection3d(surface)
    if fine:  # possible once the surface has axes
        surface.set_edgecolor("face")
    dashes = (0, (4, 3))
    edges = mesh.points[sharp_edges(mesh)]
    ax.add_collection3d(Line3DCollection(list(edges), colors=GREY, linewidths=0.7, linestyles=[dashes], zorder=1))
    magnified = "" if factor == 1.0 else f", displacement times {factor:g}"
    handles = [
        Line2D([], [], color="black", lw=0.9, label=f"deformed body{magnified}"),
        Line2D([], [], color=GREY, lw=0.7, ls=dashes, label="edges at rest"),
    ]
    if problem.contact_points:
        elevation, azimuth = _view(problem)
        ax.view_init(elevation, azimuth)
        places, size = moved_points(solution, factor, moved), _mark_size(problem.contact_points)
        for kind, marker in MARKERS.items():
            here = solution.state == kind
            if here.any():
                ax.plot(*places[here].T, ls="", ms=size, mew=0.1 * size, zorder=10, **marker)
                label = f"{kind.label} ({np.count_nonzero(here)})"
                handles.append(Line2D([], [], ls="", ms=4.4, mew=0.7, label=label, **marker))
    fig.legend(handles=handles, loc="lower center", ncols=len(handles), columnspacing=1.4, handlelength=1.8)
    low, high = np.minimum(moved, mesh.points).min(axis=0), np.maximum(moved, mesh.points).max(axis=0)
    extent = np.maximum(high - low, 1e-6 * float((high - low).max()))
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(extent, zoom=1.02)
    for axis, label in zip((ax.xaxis, ax.yaxis, ax.zaxis), "xyz", strict=True):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
        axis.set_major_locator(_few_ticks(float(extent["xyz".index(label)] / extent.max())))
        axis.set_label_text(with_unit(label, unit))
    ax.grid(False)
    if title:
        fig.suptitle(title, fontsize=10, y=0.98)
    return fig


def _few_ticks(share: float) -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(max(1, round(5 * share)))


def _mark_size(count: int) -> float:
    """Size of a mark in points, so that marks on a surface leave it visible."""
    return float(np.clip(30.0 / math.sqrt(count), 0.8, 3.6))


def viewing_direction(problem: DiscreteProblem) -> Array:
    """Unit vector from the body to a viewer who sees the contact boundary, (3,)."""
    elevation, azimuth = _view(problem) if problem.contact_points else (30.0, -60.0)
    e, a = math.radians(elevation), math.radians(azimuth)
    return np.array([math.cos(e) * math.cos(a), math.cos(e) * math.sin(a), math.sin(e)])


def _view(problem: DiscreteProblem) -> tuple[float, float]:
    """Elevation and azimuth, in degrees, from which the contact boundary can be seen."""
    assert problem.frames is not None
    x, y, z = problem.weights @ problem.frames[:, 0] / problem.weights.sum()
    azimuth = math.degrees(math.atan2(y, x)) + 30.0 if math.hypot(x, y) > 0.5 else -60.0
    return (-28.0 if z < -0.5 else 28.0), azimuth


def moved_points(solution: Solution, factor: float, moved: Array) -> Array:
    """Deformed places of the contact points, (m, 3)."""
    assert solution.problem.points is not None
    places = solution.problem.points.copy()
    for boundary in contact_boundaries(solution.problem):
        if boundary.nodes is not None:
            places[boundary.index] += factor * solution.displacement[boundary.nodes]
        else:
            assert boundary.facets is not None
            places[boundary.index] = moved[boundary.corners[boundary.facets]].mean(axis=1)
    return places


# ---- the contact surface, flat ----------------------------------------------------------------------------------


def contact_maps(solution: Solution, title: str | None, unit: str, stress_unit: str) -> Figure:
    """Pressure, friction, penetration and states of each contact boundary, projected along its mean normal.

    Where only a small part of a boundary touches, that part is shown, with as much again around it.
    """
    from matplotlib.figure import Figure

    boundaries = contact_boundaries(solution.problem)
    fig = Figure(figsize=(6.3, 5.6 * len(boundaries)), layout="constrained")
    subfigures = fig.subfigures(len(boundaries), 1, squeeze=False)[:, 0]
    for part, boundary in zip(subfigures, boundaries, strict=True):
        panels = part.subplots(2, 2)
        name = boundary.name + _maps(solution, boundary, panels, unit, stress_unit)
        heading = [text for text in (title if part is subfigures[0] else "", name) if text]
        part.suptitle(": ".join(heading), fontsize=10)
    return fig


def _maps(solution: Solution, boundary: ContactBoundary, panels: Any, unit: str, stress_unit: str) -> str:
    """Draw the four panels; returns a remark if they show a part of the boundary only."""
    assert solution.problem.points is not None
    axes, labels = _projection(solution.problem, boundary)
    corners = boundary.corners
    flat = boundary.mesh.points @ axes.T
    outline = _outline(corners)
    window = _window(solution, boundary, solution.problem.points[boundary.index] @ axes.T)
    if window is not None:
        corners = corners[((flat[corners] >= window[0]) & (flat[corners] <= window[1])).all(axis=2).any(axis=1)]
    quantities = [
        (panels[0, 0], solution.pressure, with_unit("pressure", stress_unit)),
        (panels[0, 1], np.linalg.norm(solution.friction, axis=1), with_unit("friction, magnitude", stress_unit)),
        (panels[1, 0], solution.penetration, with_unit("penetration", unit)),
    ]
    place = np.searchsorted(boundary.used_nodes, corners)
    for panel, values, name in quantities:
        at_corners = boundary.at_nodes(values, np.nan)[place]
        known = np.isfinite(at_corners)
        seen = known.any(axis=1)
        shown = np.where(known, at_corners, 0.0)[seen].sum(axis=1) / known[seen].sum(axis=1)
        colours = panel.tripcolor(
            *flat.T, corners[seen], facecolors=shown, cmap="cividis", antialiased=False,
            rasterized=len(corners) > _MANY_FACETS,
        )  # fmt: skip
        panel.figure.colorbar(colours, ax=panel, shrink=0.85).set_label(name)
    _state_map(solution, boundary, panels[1, 1], axes, unit, window)
    for panel in panels.ravel():
        for edge in outline:
            panel.plot(*flat[edge].T, color="black", lw=0.6, zorder=3)
        panel.set_aspect("equal")
        panel.set_xlabel(with_unit(labels[0], unit))
        panel.set_ylabel(with_unit(labels[1], unit))
        panel.spines[["top", "right"]].set_visible(False)
        if window is not None:
            panel.set(xlim=window[:, 0], ylim=window[:, 1])
    return "" if window is None else ", part that touches"


def _window(solution: Solution, boundary: ContactBoundary, places: Array) -> Array | None:
    """Corners (2, 2) of a square about the points that touch, or None if they take more than half of the width."""
    index = boundary.index
    touching = places[(solution.state[index] != ContactState.OPEN) | (solution.pressure[index] != 0.0)]
    if len(touching) < 2:
        return None
    low, high = touching.min(axis=0), touching.max(axis=0)
    half = float((high - low).max())
    if half > 0.5 * float(np.ptp(places, axis=0).max()):
        return None
    middle = 0.5 * (low + high)
    return np.array([middle - half, middle + half])


def _state_map(
    solution: Solution, boundary: ContactBoundary, panel: Axes, axes: Array, unit: str, window: Array | None
) -> None:
    """States of the contact points, and the slip as arrows."""
    from matplotlib.lines import Line2D

    problem = solution.problem
    assert problem.points is not None
    places = problem.points[boundary.index] @ axes.T
    state = solution.state[boundary.index]
    seen = np.ones(len(places), dtype=bool) if window is None else ((places > window[0]) & (places < window[1])).all(1)
    size = float(np.clip(0.5 * 150.0 / math.sqrt(np.count_nonzero(seen)), 0.7, 7.0))
    extent = float(np.ptp(places if window is None else window, axis=0).max())
    handles = []
    for kind, colour in STATE_COLOURS.items():
        here = state == kind
        style: dict[str, Any] = {"marker": "s", "ls": "", "color": colour, "mec": GREY, "mew": 0.3}
        if here.any():
            panel.plot(*places[here].T, ms=size, zorder=1, **style)
        label = f"{kind.label} ({np.count_nonzero(here)})"
        handles.append(Line2D([], [], ms=5.0, label=label, **style))
    slip = global_vectors(problem, solution.local, normal=False)[boundary.index] @ axes.T
    length = np.linalg.norm(slip, axis=1)
    sliding = _thinned(places, np.flatnonzero(state == ContactState.SLIP), extent)
    if len(sliding) and (largest := float(length[sliding].max())) > 0.0:
        panel.quiver(
            *places[sliding].T, *slip[sliding].T, angles="xy", scale_units="xy", scale=largest / (0.14 * extent),
            width=0.006, headwidth=3.6, headlength=4.6, headaxislength=4.2, color="black", zorder=4,
        )  # fmt: skip
        label = f"slip up to {largest:.3g} {unit}".rstrip()
        handles.append(Line2D([], [], color="black", marker=r"$\rightarrow$", ms=9, ls="", mew=0.1, label=label))
    panel.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.24), ncols=2, handlelength=1.0, columnspacing=1.0
    )


def _thinned(places: Array, chosen: IntArray, extent: float) -> IntArray:
    """At most one of the chosen places in each square of a grid over a width of ``extent``."""
    if len(chosen) <= _MOST_ARROWS**2:
        return chosen
    low = places[chosen].min(axis=0)
    square = np.floor((places[chosen] - low) / extent * _MOST_ARROWS).astype(np.int64)
    _, first = np.unique(square[:, 0] * (_MOST_ARROWS + 2) + square[:, 1], return_index=True)
    return np.asarray(chosen[first])


def _projection(problem: DiscreteProblem, boundary: ContactBoundary) -> tuple[Array, tuple[str, str]]:
    """Two unit vectors (2, 3) that span the plane across the mean normal, and their names."""
    assert problem.frames is not None
    mean = problem.weights[boundary.index] @ problem.frames[boundary.index, 0]
    if np.linalg.norm(mean) < 1e-6 * problem.weights[boundary.index].sum():
        mean = np.array([0.0, 0.0, 1.0])  # a closed surface has no mean normal
    normal = np.abs(mean / np.linalg.norm(mean))
    main = int(np.argmax(normal))
    first, second = (axis for axis in range(3) if axis != main)
    if normal[main] > 1.0 - 1e-9:
        return np.eye(3)[[first, second]], ("xyz"[first], "xyz"[second])
    unit = mean / np.linalg.norm(mean)
    one = np.eye(3)[first] - unit[first] * unit
    one /= np.linalg.norm(one)
    other = np.cross(unit, one) * (1.0 if unit[main] > 0 else -1.0)
    return np.vstack([one, other]), ("first direction in the plane", "second direction")


def _outline(corners: IntArray) -> IntArray:
    """Edges of a surface that belong to one of its facets only, (k, 2)."""
    pairs = np.sort(np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [0, 2]]]), axis=1)
    distinct, counts = np.unique(pairs, axis=0, return_counts=True)
    return np.asarray(distinct[counts == 1])
