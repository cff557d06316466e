"""Figures of adaptive solves: error against unknowns, and the meshes from coarse to fine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.adapt import AdaptiveLevel, AdaptiveSolution
from hemivar.basics.rounding import rounded_up
from hemivar.basics.types import Array, BoolArray
from hemivar.certificates import Certificate
from hemivar.certificates.continuous.exact_certificate import statement_of
from hemivar.errors import ProblemError
from hemivar.files.boundary import polylines
from hemivar.mesh.mesh import Mesh
from hemivar.report.certificate_line import FOOT, certificate_line, title_of, write_below, write_foot
from hemivar.report.drawn_body import mesh_lines
from hemivar.report.picture import new_figure
from hemivar.report.style import (
    BLUE,
    DASHES,
    GREEN,
    GREY,
    MANY_CELLS,
    ORANGE,
    PURPLE,
    RED,
    SERIES,
    SKY,
    drawing,
    with_unit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

__all__ = ["plot_adaptive", "plot_meshes"]

#: Part of the bound from which a part of it is drawn.
_LEAST = 0.02
#: Factor on either side that is shown where there are no errors to be drawn.
_DECADE = 10.0
#: Meshes that are drawn, and how many of them stand side by side.
_MOST, _BESIDE = 6, 3


def plot_adaptive(
    found: AdaptiveSolution,
    *,
    beside: Mapping[str, AdaptiveSolution] | None = None,
    title: str | None = None,
    certificate: Certificate | None = None,
) -> Figure:
    """Relative error against the number of unknowns, on logarithmic scales.

    Filled marks are guaranteed bounds, open ones estimates; broken lines are the parts that the bound is made of.  With
    a goal half its interval and the spread of its estimate, over its value, are drawn, too.

    With other solves ``beside`` it, such as one on uniform meshes (``solve_adaptive(problem, share=1.0)``), their
    bounds are compared over the unknowns and over the time that they took.

    Parameters
    ----------
    found : AdaptiveSolution
    beside : mapping of name to AdaptiveSolution, optional
        Other solves of the same problem.
    title : str, optional
    certificate : Certificate, optional
        What is known about the last solution, for the line below; without it the line has residual and distance.

    Raises
    ------
    ProblemError
        No mesh has a distance.
    """
    if beside:
        return _compared(found, beside, title, certificate)
    levels = [level for level in found.levels if math.isfinite(level.distance.relative) or level.goal is not None]
    if not levels:
        raise ProblemError("no mesh of this adaptive solve has a distance to draw; see the reasons of its distance")
    unknowns = np.array([level.unknowns for level in levels], dtype=float)
    with drawing():
        high = 3.9 + FOOT
        fig = new_figure((6.3, high))
        ax = fig.add_axes((0.11, (0.507 + FOOT) / high, 0.53, 3.042 / high))
        _bounds(ax, unknowns, levels)
        goal = levels[-1].goal
        if goal is not None:
            name = goal.goal.name
            sure = np.array([level.goal.relative for level in levels if level.goal is not None])
            about = np.array([level.goal.estimated for level in levels if level.goal is not None])
            proved = np.array([level.guaranteed for level in levels])
            _curve(ax, unknowns, sure, proved, RED, "s", f"{name}:\nhalf the interval over the value")
            _curve(
                ax, unknowns, about, np.zeros(len(levels), dtype=bool), GREEN, "D", f"{name}:\nestimate, dual weights"
            )
        ax.axhline(found.rtol, color="black", lw=0.8, ls=(0, (1, 2)), label=f"asked for: {_percent(found.rtol)}")
        ax.set(xscale="log", yscale="log", xlabel="unknowns", ylabel="relative error")
        if not any(np.isfinite(line.get_ydata()).any() for line in ax.lines[:-1]):  # errors of zero, as without loads
            ax.set_xlim(unknowns[0] / _DECADE, unknowns[-1] * _DECADE)
            ax.set_ylim(found.rtol / _DECADE, found.rtol * _DECADE)
        _slope(ax, unknowns, levels, 1.0 if goal is not None else 0.5)
        _scales(ax, unknowns)
        ax.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, labelspacing=0.8)
        write_below(ax, certificate_line(found.solution, certificate, statement_of(found.distance)))
        if heading := title_of(found.solution, title):
            ax.set_title(heading)
    return fig


def _scales(ax: Axes, across: Array) -> None:
    """Ticks of logarithmic scales, errors in per cent."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _percent(value)))
    few = across.max() < 100.0 * across.min()
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.6g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.yaxis.set_minor_formatter(NullFormatter())
    ax.grid(True, which="major", color="#e2e2e2", lw=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _compared(
    found: AdaptiveSolution,
    beside: Mapping[str, AdaptiveSolution],
    title: str | None,
    certificate: Certificate | None,
) -> Figure:
    """Bounds of several solves over their unknowns and over their time."""
    solves = {"adaptive": found, **beside}
    with drawing():
        fig = new_figure((6.3, 3.1), layout="constrained")
        left, right = fig.subplots(1, 2, sharey=True)
        seen: list[Array] = []
        for number, (name, one) in enumerate(solves.items()):
            levels = [level for level in one.levels if math.isfinite(level.relative)]
            proved = np.array([level.guaranteed for level in levels], dtype=bool)
            bound = np.array([level.relative for level in levels])
            seconds = np.array([level.seconds for level in levels])
            unknowns = np.array([level.unknowns for level in levels], dtype=float)
            if not levels:
                raise ProblemError(f"no mesh of '{name}' has a distance to draw; see the reasons of its distance")
            for ax, across in ((left, unknowns), (right, seconds)):
                _curve(ax, across, bound, proved, SERIES[number % len(SERIES)], "osD^vX"[number % 6], name)
            seen += [unknowns, seconds]
        for ax, places, label in ((left, seen[::2], "unknowns"), (right, seen[1::2], "time (s)")):
            ax.axhline(found.rtol, color="black", lw=0.8, ls=(0, (1, 2)), label=f"asked for: {_percent(found.rtol)}")
            ax.set(xscale="log", yscale="log", xlabel=label)
            _scales(ax, np.concatenate(places))
        sure = all(level.guaranteed for one in solves.values() for level in one.levels)
        left.set_ylabel("relative error, guaranteed bound" if sure else "relative error, bound or estimate")
        left.legend(loc="best")
        if heading := title_of(found.solution, title):
            fig.suptitle(heading, fontsize=10.0)
        write_foot(fig, certificate_line(found.solution, certificate, statement_of(found.distance)))
    return fig


def _bounds(ax: Axes, unknowns: Array, levels: list[AdaptiveLevel]) -> None:
    """The bound of the distance and its parts."""
    size = np.array([level.distance.energy_norm for level in levels])
    proved = np.array([level.distance.guaranteed for level in levels])
    bound = np.array([level.distance.relative for level in levels])
    label = "distance to the exact solution:\n" + ("guaranteed bound" if proved.any() else "estimate")
    _curve(ax, unknowns, bound, proved, BLUE, "o", label)
    parts = (("misfit", "constitutive residual", SKY), ("contact", "contact", ORANGE), ("oscillation", "loads", PURPLE))
    for name, called, colour in parts:
        part = np.array([getattr(level.distance.parts, name) for level in levels])
        share = np.divide(part, size, out=np.full(len(part), np.nan), where=size > 0.0)
        share[~(share > _LEAST * bound)] = np.nan
        if np.isfinite(share).any():
            ax.plot(unknowns, share, color=colour, ls=DASHES, lw=1.1, marker=".", ms=3.0, label=f"  part: {called}")


def _curve(ax: Axes, x: Array, y: Array, proved: BoolArray, colour: str, mark: str, label: str) -> None:
    label += "\n(zero)" if (y == 0.0).all() else ""
    y = np.where(np.isfinite(y) & (y > 0.0), y, np.nan)
    face = colour if proved.any() else "white"
    ax.plot(x, y, color=colour, marker=mark, ms=4.6, mew=0.9, markerfacecolor=face, label=label)
    if proved.any() and not proved.all():
        ax.plot(x[~proved], y[~proved], color=colour, ls="", marker=mark, ms=4.6, mew=0.9, markerfacecolor="white")


def _slope(ax: Axes, unknowns: Array, levels: list[AdaptiveLevel], power: float) -> None:
    """A line of the best order that linear elements have, below the last curve: 1/d of the distance, 2/d of a goal."""
    dim = levels[-1].problem.field.mesh.dim  # type: ignore[union-attr]
    order = 2.0 * power / dim
    values = [level.distance.relative if level.goal is None else level.goal.estimated for level in levels]
    if len(levels) < 3 or not (math.isfinite(values[-1]) and values[-1] > 0.0):
        return
    first = max(unknowns[0], unknowns[-1] / 30.0)
    x = np.array([first, unknowns[-1]])
    y = 0.55 * values[-1] * (x / x[-1]) ** -order
    text = {1.0: "1", 0.5: "1/2", 2.0 / 3.0: "2/3", 1.0 / 3.0: "1/3"}.get(order, f"{order:g}")
    ax.plot(x, y, color=GREY, lw=0.8, label=f"order {text} in the unknowns")


def _percent(ratio: float) -> str:
    return f"{100.0 * ratio:.6g} %"


def plot_meshes(
    found: AdaptiveSolution, *, title: str | None = None, unit: str = "", certificate: Certificate | None = None
) -> Figure:
    """The meshes from coarse to fine, each with its unknowns and the bound or the estimate of its error.

    Up to six are drawn.  Cells of the plane are coloured by what they add to the square of the bound, over the sum of
    the mesh; where there are more than two meshes the last picture enlarges the smallest cells of the last one.

    Parameters
    ----------
    found : AdaptiveSolution
    title : str, optional
        The name of the goal by default, if there is one.
    unit : str
        Unit of length for the labels.
    certificate : Certificate, optional
        What is known about the last solution, for the line below; without it the line has residual and distance.
    """

    points = found.levels[-1].problem.field.mesh.points  # type: ignore[union-attr]
    solid = points.shape[1] == 3
    enlarged = not solid and len(found.levels) > 2
    count = min(len(found.levels), _MOST - enlarged)
    chosen = np.unique(np.round(np.linspace(0, len(found.levels) - 1, count)).astype(int))
    levels = [found.levels[number] for number in chosen]
    title = title_of(found.solution, title or (None if found.goal is None else found.goal.goal.name))
    from matplotlib.cm import ScalarMappable

    columns = min(len(levels) + enlarged, _BESIDE)
    rows = -(-(len(levels) + enlarged) // columns)
    extent = np.ptp(points, axis=0)
    shape = 0.95 if solid else float(np.clip(extent[1] / extent[0], 0.3, 1.6))
    width = 6.3 / columns if columns > 1 else 3.4
    with drawing():
        height = rows * (0.85 * width * shape + 0.72) + FOOT + (0.3 if title else 0.0) + (0.0 if solid else 0.5)
        fig = new_figure((width * columns, height), layout=None if solid else "constrained")
        panels: list[Any] = [
            fig.add_subplot(rows, columns, place + 1, projection="3d" if solid else None)
            for place in range(len(levels) + enlarged)
        ]
        shades = None if solid else _shades(levels)
        for place, (ax, level) in enumerate(zip(panels, [*levels, levels[-1]], strict=False)):
            mesh = level.problem.field.mesh  # type: ignore[union-attr]
            zoom = place == len(levels)
            if shades is None:
                _solid(ax, mesh)
            else:
                _plane(ax, mesh, _shares(level), shades)
            ax.set_title(_zoom(ax, mesh) if zoom else f"{level.unknowns} unknowns\n{_known(level)}", fontsize=8.0)
            ax.tick_params(labelsize=7.0)
            if not solid:
                ax.set_aspect("equal")
                ax.spines[:].set_visible(zoom)
                bottom = place + columns >= len(panels)
                left = place % columns == 0
                ax.set(xlabel=with_unit("x", unit) if bottom else "", ylabel=with_unit("y", unit) if left else "")
        if shades is not None:
            bar = fig.colorbar(
                ScalarMappable(*shades), ax=panels, location="bottom", shrink=0.6, aspect=45, pad=0.02, extend="min"
            )
            bar.set_label("part of a cell in the square of the bound", fontsize=8.0)
            bar.ax.tick_params(labelsize=7.0)
        if title:
            fig.suptitle(title, fontsize=10.0)
        if solid:
            foot = FOOT / fig.get_figheight()
            fig.tight_layout(pad=0.6, w_pad=1.0, h_pad=1.0, rect=(0.0, foot, 1.0, 1.0))
        write_foot(fig, certificate_line(found.solution, certificate, statement_of(found.distance)))
    return fig


def _known(level: AdaptiveLevel) -> str:
    """What is known of the error on a mesh."""
    goal = level.goal
    if goal is not None and math.isfinite(goal.estimated):
        return f"goal within about {rounded_up(100.0 * goal.estimated, 2)} %"
    if not math.isfinite(level.distance.relative):
        return "no bound of the error"
    size = f"{rounded_up(100.0 * level.distance.relative, 2)} %"
    return f"bound {size}" if level.distance.guaranteed else f"estimate {size}"


def _shares(level: AdaptiveLevel) -> Array:
    """What cells add to the square of the bound over its sum, (M,); nan where nothing is known."""
    whole = float(level.indicator.sum())
    return level.indicator / whole if whole > 0.0 else np.full(len(level.indicator), np.nan)


def _shades(levels: Sequence[AdaptiveLevel]) -> tuple[Normalize, str]:
    """One logarithmic scale of colours for all meshes: from an even part of the finest to the largest of all."""
    from matplotlib.colors import LogNorm

    shares = [share[np.isfinite(share)] for share in map(_shares, levels)]
    most = max((float(share.max(initial=0.0)) for share in shares), default=0.0) or 1.0
    least = min(0.1 / max(len(share), 1) for share in shares)
    return LogNorm(min(least, 0.1 * most), most), "cividis"


def _zoom(ax: Axes, mesh: Mesh) -> str:
    """Show the smallest cells, a few of them; returns how much larger than the mesh they are."""
    corners = mesh.points[mesh.cells]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    smallest = int(np.argmin(areas))
    extent = np.ptp(mesh.points, axis=0)
    half = min(6.0 * math.sqrt(float(areas[smallest])), 0.25 * float(extent.max()))
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    middle = np.clip(corners[smallest].mean(axis=0), low + 0.9 * half, np.maximum(low + 0.9 * half, high - 0.9 * half))
    ax.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
    ax.locator_params(nbins=4)
    return f"the last mesh,\n{0.5 * float(extent.max()) / half:.2g} times larger"


def _plane(ax: Axes, mesh: Mesh, shares: Array, shades: tuple[Normalize, str]) -> None:
    from matplotlib.tri import Triangulation

    norm, colours = shades
    grid = Triangulation(mesh.points[:, 0], mesh.points[:, 1], mesh.cells)
    ax.tripcolor(grid, facecolors=shares, norm=norm, cmap=colours, alpha=0.85, lw=0.0, rasterized=True)
    for line in polylines(mesh.boundary_facets):
        ax.plot(*mesh.points[line].T, color="black", lw=0.7)
    edges = mesh_lines(mesh.points, mesh.edges, mesh.number_of_cells, 2.0, "white", 0.6)
    edges.set_rasterized(mesh.number_of_cells > MANY_CELLS)
    ax.add_patch(edges)


def _solid(ax: Axes3D, mesh: Mesh) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    facets = mesh.boundary_facets
    thickness = float(np.clip(8.0 / math.sqrt(len(facets)), 0.05, 0.4))
    surface = Poly3DCollection(
        list(mesh.points[facets]), facecolors="#d9e6f2", edgecolors="#4a4a4a", linewidths=thickness
    )
    surface.set_rasterized(len(facets) > MANY_CELLS)
    ax.add_collection3d(surface)
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low)
    ax.view_init(-28.0, -60.0)
    ax.set_axis_off()
