"""The meshes of an adaptive solve, from coarse to fine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.basics.arguments import expecting
from hemivar.basics.rounding import rounded_up
from hemivar.basics.types import Array
from hemivar.bounds import AdaptiveSolution
from hemivar.bounds.adaptive import AdaptiveLevel
from hemivar.bounds.exact_certificate import statement_of
from hemivar.certificates import Certificate
from hemivar.files.boundary import polylines
from hemivar.mesh.mesh import Mesh
from hemivar.report.certificate_line import FOOT, certificate_line, title_of, write_foot
from hemivar.report.drawn_body import mesh_lines
from hemivar.report.picture import new_figure
from hemivar.report.style import BESIDE, MANY_CELLS, drawing, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

__all__ = ["plot_meshes"]

#: Meshes that are drawn.
_MOST = 2 * BESIDE


@expecting(adaptive=AdaptiveSolution, title=str, unit=str, certificate=Certificate)
def plot_meshes(
    adaptive: AdaptiveSolution, *, title: str | None = None, unit: str = "", certificate: Certificate | None = None
) -> Figure:
    """The meshes from coarse to fine, each with its unknowns and the bound or the estimate of its error.

    Up to six are drawn.  Cells of the plane are coloured by what they add to the square of the bound, over the sum of
    the mesh; where there are more than two meshes the last picture enlarges the smallest cells of the last one.

    Parameters
    ----------
    adaptive : AdaptiveSolution
    title : str, optional
        The name of the goal by default, if there is one.
    unit : str
        Unit of length for the labels.
    certificate : Certificate, optional
        What is known about the last solution, for the line below; without it the line has residual and distance.
    """

    points = adaptive.levels[-1].problem.field.mesh.points  # type: ignore[union-attr]
    solid = points.shape[1] == 3
    enlarged = not solid and len(adaptive.levels) > 2
    count = min(len(adaptive.levels), _MOST - enlarged)
    chosen = np.unique(np.round(np.linspace(0, len(adaptive.levels) - 1, count)).astype(int))
    levels = [adaptive.levels[number] for number in chosen]
    title = title_of(adaptive.solution, title or (None if adaptive.goal is None else adaptive.goal.goal.name))
    from matplotlib.cm import ScalarMappable

    columns = min(len(levels) + enlarged, BESIDE)
    rows = -(-(len(levels) + enlarged) // columns)
    extent = np.ptp(points, axis=0)
    shape = 0.95 if solid else float(np.clip(extent[1] / extent[0], 0.3, 1.6))
    width = 6.3 / columns if columns > 1 else 3.4
    with drawing():
        height = rows * (0.85 * width * shape + 0.72) + FOOT + (0.3 if title else 0.0) + (0.0 if solid else 0.5)
        fig = new_figure((width * columns, height), layout=None if solid else "constrained")
        panels: list[Any] = [
            fig.add_subplot(rows, columns, position + 1, projection="3d" if solid else None)
            for position in range(len(levels) + enlarged)
        ]
        shades = None if solid else _shades(levels)
        for position, (ax, level) in enumerate(zip(panels, [*levels, levels[-1]], strict=False)):
            mesh = level.problem.field.mesh  # type: ignore[union-attr]
            zoom = position == len(levels)
            if shades is None:
                _solid(ax, mesh)
            else:
                _plane(ax, mesh, _shares(level), shades)
            ax.set_title(_zoom(ax, mesh) if zoom else f"{level.unknowns} unknowns\n{_known(level)}", fontsize=8.0)
            ax.tick_params(labelsize=7.0)
            if not solid:
                ax.set_aspect("equal")
                ax.spines[:].set_visible(zoom)
                bottom = position + columns >= len(panels)
                left = position % columns == 0
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
        write_foot(fig, certificate_line(adaptive.solution, certificate, statement_of(adaptive.distance)))
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
