"""Flat maps of the contact boundaries of three-dimensional bodies."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.files.boundary import ContactBoundary, contact_boundaries
from hemivar.report.certificate_line import write_foot
from hemivar.report.picture import new_figure
from hemivar.report.style import GREY, MANY_FACETS, STATE_COLOURS, with_unit
from hemivar.solvers import Solution, TangentialState

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["contact_maps"]

_MOST_ARROWS = 14


def contact_maps(solution: Solution, title: str | None, unit: str, stress_unit: str, line: str) -> Figure:
    """Pressure, friction, penetration and states of each contact boundary, projected along its mean normal.

    Where only a small part of a boundary touches, that part is shown, with as much again around it.
    """

    boundaries = contact_boundaries(solution.problem)
    fig = new_figure((6.3, 5.6 * len(boundaries)), layout="constrained")
    subfigures = fig.subfigures(len(boundaries), 1, squeeze=False)[:, 0]
    for part, boundary in zip(subfigures, boundaries, strict=True):
        panels = part.subplots(2, 2)
        name = boundary.name + _maps(solution, boundary, panels, unit, stress_unit)
        heading = [text for text in (title if part is subfigures[0] else "", name) if text]
        part.suptitle(": ".join(heading), fontsize=10)
    write_foot(fig, line)
    return fig


def _maps(
    solution: Solution, boundary: ContactBoundary, panels: NDArray[np.object_], unit: str, stress_unit: str
) -> str:
    """Draw the four panels; returns a remark if they show a part of the boundary only."""
    assert solution.problem.contact.points is not None
    axes, labels = _projection(solution.problem, boundary)
    corners = boundary.corners
    flat = boundary.mesh.points @ axes.T
    outline = _outline(corners)
    window = _window(solution, boundary, solution.problem.contact.points[boundary.index] @ axes.T)
    if window is not None:
        corners = corners[((flat[corners] >= window[0]) & (flat[corners] <= window[1])).all(axis=2).any(axis=1)]
    quantities = [
        (panels[0, 0], solution.pressure, with_unit("pressure", stress_unit)),
        (panels[0, 1], np.linalg.norm(solution.friction, axis=1), with_unit("friction, magnitude", stress_unit)),
        (panels[1, 0], *_depth(solution, unit)),
    ]
    place = np.searchsorted(boundary.used_nodes, corners)
    for panel, values, name in quantities:
        at_corners = boundary.at_nodes(values, np.nan)[place]
        known = np.isfinite(at_corners)
        seen = known.any(axis=1)
        mean = np.where(known, at_corners, 0.0)[seen].sum(axis=1) / known[seen].sum(axis=1)
        shown = np.where(known[seen], at_corners[seen], mean[:, None])  # clamped corners are as their facets
        apart = flat[corners[seen]].reshape(-1, 2)
        colours = panel.tripcolor(
            *apart.T, np.arange(len(apart)).reshape(-1, 3), shown.ravel(), shading="gouraud", cmap="cividis",
            rasterized=len(corners) > MANY_FACETS,
        )  # fmt: skip
        if not shown.any():  # around 0 a scale would show negative values of a magnitude, and differences of nothing
            colours.set_clim(0.0, 1.0)
        bar = panel.figure.colorbar(colours, ax=panel, shrink=0.85)
        bar.set_label(name)
        if not shown.any():
            bar.set_ticks([0.0], labels=["0 everywhere"], rotation=90, va="bottom")
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
    touching = places[solution.states.closed[index] | (solution.pressure[index] != 0.0)]
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
    assert problem.contact.points is not None
    places = problem.contact.points[boundary.index] @ axes.T
    states = solution.states.take(boundary.index)
    seen = np.ones(len(places), dtype=bool) if window is None else ((places > window[0]) & (places < window[1])).all(1)
    size = float(np.clip(0.5 * 150.0 / math.sqrt(np.count_nonzero(seen)), 0.7, 7.0))
    extent = float(np.ptp(places if window is None else window, axis=0).max())
    handles = []
    for kind, here in states.present.items():
        colour, label = STATE_COLOURS[kind], f"{kind.label} ({np.count_nonzero(here)})"
        panel.plot(*places[here].T, "s", color=colour, mec=GREY, mew=0.3, ms=size, zorder=1)
        handles.append(Line2D([], [], marker="s", ls="", color=colour, mec=GREY, mew=0.3, ms=5.0, label=label))
    slip = solution.slip_vectors[boundary.index] @ axes.T
    length = np.linalg.norm(slip, axis=1)
    sliding = _thinned(places, np.flatnonzero(states.tangential == TangentialState.SLIP), extent)
    if len(sliding) and (largest := float(length[sliding].max())) > 0.0:
        panel.quiver(
            *places[sliding].T, *slip[sliding].T, angles="xy", scale_units="xy", scale=largest / (0.14 * extent),
            width=0.006, headwidth=3.6, headlength=4.6, headaxislength=4.2, color="black", zorder=4,
        )  # fmt: skip
        label = f"slip up to {largest:.3g} {unit}".rstrip()
        handles.append(Line2D([], [], color="black", marker=r"$\rightarrow$", ms=9, ls="", mew=0.1, label=label))
    # one column: two are wider than the panel, and push the scale of the panel above it aside
    panel.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.24), handlelength=1.0)


def _thinned(places: Array, chosen: IntArray, extent: float) -> IntArray:
    """At most one of the chosen places in each square of a grid over a width of ``extent``."""
    if len(chosen) <= _MOST_ARROWS**2:
        return chosen
    low = places[chosen].min(axis=0)
    square = np.floor((places[chosen] - low) / extent * _MOST_ARROWS).astype(np.int64)
    _, first = np.unique(square[:, 0] * (_MOST_ARROWS + 2) + square[:, 1], return_index=True)
    return np.asarray(chosen[first])


def _depth(solution: Solution, unit: str) -> tuple[Array, str]:
    """Penetration with its label, or the opening of glue."""
    if solution.debonding:
        return 0.0 - solution.penetration, with_unit("opening", unit)
    return solution.penetration, with_unit("penetration", unit)


def _projection(problem: DiscreteProblem, boundary: ContactBoundary) -> tuple[Array, tuple[str, str]]:
    """Two unit vectors (2, 3) that span the plane across the mean normal, and their names."""
    assert problem.contact.frames is not None
    weights = problem.contact.weights[boundary.index]
    mean = weights @ problem.contact.frames[boundary.index, 0]
    if np.linalg.norm(mean) < 1e-6 * weights.sum():
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
    return np.vstack([one, other]), (_direction(one), _direction(other))


def _direction(axis: Array) -> str:
    """A direction in space as the label of an axis: ``along (0.71, 0, -0.71)``."""
    return f"along ({', '.join(f'{0.0 if abs(part) < 5e-3 else part:.2g}' for part in axis)})"


def _outline(corners: IntArray) -> IntArray:
    """Edges of a surface that belong to one of its facets only, (k, 2)."""
    pairs = np.sort(np.vstack([corners[:, [0, 1]], corners[:, [1, 2]], corners[:, [0, 2]]]), axis=1)
    distinct, counts = np.unique(pairs, axis=0, return_counts=True)
    return np.asarray(distinct[counts == 1])
