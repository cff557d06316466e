"""The drawn body: artists of every picture of a body, placed once in a still and again in each frame of a film."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import numpy as np

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.files.boundary import polylines
from hemivar.mesh.mesh import Mesh
from hemivar.report.style import MANY_CELLS, MARKERS, figure_of, with_unit
from hemivar.solvers.contact_states import Kind

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path
    from matplotlib.quiver import Quiver
    from mpl_toolkits.mplot3d import Axes3D

__all__ = [
    "GROUND",
    "PLAIN",
    "DrawnFoundation",
    "DrawnPlane",
    "DrawnSurface",
    "Filled",
    "FoundationLine",
    "flat_axes",
    "flat_map",
    "force_arrows",
    "mark_size",
    "mark_states",
    "mesh_lines",
]

Filled = Literal["plainly", "cells", "vertices"]
#: A body without colours.
PLAIN = "#d9e6f2"
#: A foundation.
GROUND = "#f0f0f0"


class DrawnPlane:
    """A plane body, ``inches`` wide: its colours, the lines of its mesh where they are few, and its outline.

    Filled plainly, or with a value for each of its cells or vertices, which :meth:`move` takes.
    """

    def __init__(self, ax: Axes, mesh: Mesh, inches: float, filled: Filled = "plainly") -> None:
        with IMPORTS:
            from matplotlib.collections import LineCollection, PolyCollection, TriMesh
            from matplotlib.tri import Triangulation

        self.ax, self.mesh, self.filled = ax, mesh, filled
        self.outline = polylines(mesh.boundary_facets)
        self.fill: Collection
        if filled == "vertices":
            self.grid = Triangulation(mesh.points[:, 0], mesh.points[:, 1], mesh.cells)
            self.fill = TriMesh(self.grid, cmap="cividis", zorder=1.5)
        elif filled == "cells":
            self.fill = PolyCollection([], cmap="cividis", linewidths=0.0, zorder=1.5, antialiased=False)
        else:
            self.fill = PolyCollection([], facecolors=PLAIN, alpha=0.45, linewidths=0.0, zorder=1.5)
        self.fill.set_rasterized(filled != "plainly")
        self.border = LineCollection([], colors="black", linewidths=0.9, zorder=3)
        self.lines: PathPatch | None = None
        if mesh.number_of_cells <= MANY_CELLS:
            ink = ("#8f8f8f", 1.0) if filled == "plainly" else ("black", 0.3)
            self.lines = mesh_lines(mesh.points, mesh.edges, mesh.number_of_cells, inches, *ink)
            ax.add_patch(self.lines)
        for collection in (self.fill, self.border):
            ax.add_collection(collection, autolim=False)

    def move(self, vertices: Array, values: Array | None = None) -> None:
        """Draw it with its vertices (N, 2) there, coloured by values of its cells or vertices."""
        around = [vertices[line] for line in self.outline]
        if self.filled == "vertices":
            self.grid.x, self.grid.y = vertices.T
        else:
            self.fill.set_verts(around if self.filled == "plainly" else vertices[self.mesh.cells])  # type: ignore[attr-defined]
        if values is not None:
            self.fill.set_array(values)
        if self.lines is not None:
            self.lines.set_path(_mesh_path(vertices, self.mesh.edges))
        self.border.set_segments(around)

    def fit(self) -> None:
        """Let the axes hold it."""
        self.ax.update_datalim(np.concatenate(self.border.get_segments()))
        self.ax.autoscale_view()

    @property
    def artists(self) -> list[Artist]:
        """What moves."""
        return [self.fill, self.border, *([] if self.lines is None else [self.lines])]


class FoundationLine(NamedTuple):
    """A piece of the boundary of a plane body at rest beside which a foundation is drawn."""

    points: Array  # (k, 2), in order
    normals: Array  # (k, 2), outward
    nearest: IntArray  # (k,), the contact points whose gaps it has
    before: float  # how far the foundation goes on beyond its ends
    after: float


class DrawnFoundation:
    """The foundations of a plane body of some size, hatched along their surfaces, down to a depth and some more."""

    def __init__(self, ax: Axes, lines: Sequence[FoundationLine], size: float, depth: float) -> None:
        from matplotlib.patches import Polygon

        self.lines, self.depths = lines, (depth + 0.03 * size, 0.022 * size)
        styles = (
            {"facecolor": GROUND},
            {"facecolor": "none", "edgecolor": "#8a8a8a", "hatch": "//////"},
        )
        self.grounds = [
            [Polygon([(0.0, 0.0)], closed=True, zorder=0.5, linewidth=0.0, **style) for style in styles] for _ in lines
        ]
        self.surfaces = [ax.plot([], [], color="#3a3a3a", lw=1.0, zorder=1)[0] for _ in lines]
        self.ax = ax

    def move(self, gap: Array, factor: float) -> None:
        """Draw them so many times the gaps (m,) of the contact points away from the body at rest."""
        for line, grounds, drawn in zip(self.lines, self.grounds, self.surfaces, strict=True):
            surface = line.points + factor * gap[line.nearest, None] * line.normals
            if (line.points[0] != line.points[-1]).any():
                ends = surface[[0, -1]] + [
                    line.before * _unit(surface[0] - surface[1]), line.after * _unit(surface[-1] - surface[-2])
                ]  # fmt: skip
                surface[0], surface[-1] = ends
            for ground, depth in zip(grounds, self.depths, strict=True):
                ground.set_xy(np.vstack([surface, (surface + depth * line.normals)[::-1]]))
                if ground.axes is None:
                    self.ax.add_patch(ground)
            drawn.set_data(*surface.T)

    @property
    def artists(self) -> list[Artist]:
        """What moves."""
        return [*(one for pair in self.grounds for one in pair), *self.surfaces]


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def flat_map(panel: Axes, points: Array, cells: IntArray, values: Array, name: str, **bar: Any) -> None:
    """Values at points (k, 2) of a plane in colours that go over smoothly, and their scale."""
    from matplotlib.tri import Triangulation

    grid = Triangulation(points[:, 0], points[:, 1], cells)
    colours = panel.tripcolor(grid, values, shading="gouraud", cmap="cividis", rasterized=len(cells) > MANY_CELLS)
    nothing = not values.any()
    if nothing:  # around 0 a scale would show negative values of a magnitude, and differences of nothing
        colours.set_clim(0.0, 1.0)
    scale = figure_of(panel).colorbar(colours, ax=panel, **bar)
    scale.set_label(name)
    if nothing:
        upright: dict[str, Any] = {"rotation": 90, "va": "bottom"} if scale.orientation == "vertical" else {}
        scale.set_ticks([0.0], labels=["0 everywhere"], **upright)


def flat_axes(panel: Axes, outline: Iterable[Array], across: str, up: str) -> None:
    """Equal axes with these names, and lines (j, 2) around what is drawn."""
    for line in outline:
        panel.plot(*line.T, color="black", lw=0.8, zorder=3)
    panel.set_aspect("equal")
    panel.set(xlabel=across, ylabel=up)


class DrawnSurface:
    """The surface of a body in space, on axes of its own that hold an extent; those shorter than a part of the longest
    have no scale."""

    def __init__(
        self,
        fig: Figure,
        frame: tuple[float, float, float, float],
        facets: IntArray,  # (k, 3)
        extent: tuple[Array, Array],  # lowest and highest coordinates, (3,)
        unit: str,
        zoom: float = 1.02,
        short: float = 0.0,
    ) -> None:
        with IMPORTS:
            from matplotlib.ticker import MaxNLocator
            from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        self.facets = facets
        self.ax = cast("Axes3D", fig.add_axes(frame, projection="3d", computed_zorder=False))
        fine = len(facets) > MANY_CELLS
        self.surface = Poly3DCollection(
            [np.zeros((3, 3))], linewidths=0.15, edgecolors="#00000060", zorder=2, cmap="cividis"
        )
        self.surface.set_clip_on(False)  # the square in which matplotlib sees a scene is smaller than the picture
        self.surface.set_rasterized(fine)
        self.surface.set_facecolor(PLAIN)
        self.ax.add_collection3d(self.surface, autolim=False)
        if fine:  # possible once the surface has axes
            self.surface.set_edgecolor("face")
        low, high = extent
        wide = np.maximum(high - low, 1e-6 * float((high - low).max()))
        for name, least, width in zip("xyz", low, wide, strict=True):
            getattr(self.ax, f"set_{name}lim")(least, least + width)
            axis, share = getattr(self.ax, f"{name}axis"), float(width / wide.max())
            axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
            if share < short:
                axis.set_ticks([])
                continue
            axis.set_major_locator(MaxNLocator(max(1, round(5 * share))))
            axis.set_label_text(with_unit(name, unit))
            if short:
                axis.labelpad = 15.0 * share
        self.ax.set_box_aspect(wide, zoom=zoom)
        self.ax.grid(False)

    def move(self, vertices: Array, values: Array | None = None) -> None:
        """Draw it with the vertices (N, 3) there, coloured by values (N,)."""
        self.surface.set_verts(list(vertices[self.facets]))
        if values is not None:
            self.surface.set_array(values[self.facets].mean(axis=1))

    @property
    def artists(self) -> list[Artist]:
        """What moves."""
        return [self.surface]


def mark_size(count: int, dim: int = 3) -> float:
    """Size of a mark in points, so that marks on a body leave it visible."""
    return float(np.clip(30.0 / math.sqrt(max(count, 1)), *((1.4, 4.4) if dim == 2 else (0.8, 3.6))))


def mark_states(ax: Axes, kind: Kind, places: Array, count: int) -> Line2D:
    """Marks at contact points (k, d) in one pair of states; all pairs have ``count``."""
    dim = places.shape[1]
    size = mark_size(count, dim)
    edge, above = (0.6, 6.0) if dim == 2 else (0.1 * size, 10.0)
    return ax.plot(*places.T, ls="", ms=size, mew=edge, zorder=above, clip_on=False, **MARKERS[kind])[0]


def force_arrows(
    ax: Axes, places: Array, force: Array, pulls: Array, scale: float, size: float, colour: str, zorder: float = 5.0
) -> tuple[Quiver, Array]:
    """Arrows of forces (k, 2) on a body of some size, and both ends of each, (2 k, 2).

    They are drawn in the foundation: those that push end at their places, those that pull (k,) begin there.
    """
    drawn = force / scale
    sizes = np.linalg.norm(drawn, axis=1, keepdims=True)
    beside = 0.012 * size * np.divide(drawn, sizes, out=np.zeros_like(drawn), where=sizes > 0.0)
    tails = places + np.where(pulls[:, None], beside, -drawn - beside)
    quiver = ax.quiver(
        *tails.T, *force.T, angles="xy", scale_units="xy", scale=scale, color=colour, units="inches", width=0.0115,
        headwidth=3.6, headlength=4.6, headaxislength=4.2, minlength=0.5, zorder=zorder,
    )  # fmt: skip
    return quiver, np.vstack([tails, tails + drawn])


def mesh_lines(
    points: Array, edges: IntArray, cells: int, inches: float, colour: str = "#8f8f8f", pale: float = 1.0
) -> PathPatch:
    """The edges (k, 2) between vertices (N, 2) as one path: thinner and paler the denser they stand, so that print and
    screen show a mesh and no pattern; below ``pale = 1`` paler still, over colours."""
    from matplotlib.patches import PathPatch

    apart = 72.0 * inches / math.sqrt(0.5 * max(cells, 1))
    return PathPatch(
        _mesh_path(points, edges), fill=False, edgecolor=colour, zorder=2,
        linewidth=float(np.clip(0.06 * apart, 0.1, 0.6)), alpha=pale * float(np.clip(apart / 9.0, 0.3, 1.0)),
    )  # fmt: skip


def _mesh_path(points: Array, edges: IntArray) -> Path:
    from matplotlib.path import Path

    codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=np.uint8), len(edges))
    return Path(points[edges].reshape(-1, 2), codes)
