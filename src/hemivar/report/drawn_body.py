"""The drawn body: artists of every picture of a body, placed once in a still and again in each frame of a film."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import numpy as np

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.files.boundary import polylines
from hemivar.mesh.mesh import Mesh
from hemivar.report.mesh_lines import mesh_lines, mesh_path
from hemivar.report.style import MANY_CELLS, MANY_FACETS, MARKERS, with_unit
from hemivar.solvers.contact_states import Kind

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import PathPatch
    from matplotlib.quiver import Quiver
    from mpl_toolkits.mplot3d import Axes3D

__all__ = ["PLAIN", "DrawnPlane", "DrawnSurface", "force_arrows", "mark_size", "mark_states"]

#: A body without colours.
PLAIN = "#d9e6f2"
#: Room between an arrow and the mark of its contact point, relative to the body.
_BESIDE_MARK = 0.012
#: Of arrows, in inches.
_THICK = 0.0115


class DrawnPlane:
    """A plane body: what fills it, the lines of its mesh where they are few, and its outline.

    Parameters
    ----------
    ax : Axes
    mesh : Mesh
        At rest.
    inches : float
        Width of the drawn body, about.
    filled : {"plainly", "by cells", "not"}
        By cells: with the colours of :meth:`move`.
    ink : (str, float)
        Colour of the lines, and how much paler they are.
    """

    def __init__(
        self, ax: Axes, mesh: Mesh, inches: float, filled: str = "plainly", ink: tuple[str, float] = ("#8f8f8f", 1.0)
    ) -> None:
        with IMPORTS:
            from matplotlib.collections import LineCollection, PolyCollection

        self.mesh, self.filled = mesh, filled
        self.outline = polylines(mesh.boundary_facets)
        if filled == "by cells":
            self.fill = PolyCollection(list(mesh.points[mesh.cells]), cmap="cividis", linewidths=0.0, zorder=1.5)
            self.fill.set_antialiased(False)
            self.fill.set_array(np.zeros(len(mesh.cells)))
        else:
            self.fill = PolyCollection([], facecolors=PLAIN, alpha=0.45, linewidths=0.0, zorder=1.5)
        self.border = LineCollection([], colors="black", linewidths=0.9, zorder=3)
        self.lines: PathPatch | None = None
        if mesh.number_of_cells <= MANY_CELLS:
            self.lines = mesh_lines(mesh.points, mesh.edges, mesh.number_of_cells, inches, *ink)
            ax.add_patch(self.lines)
        for collection in (self.border,) if filled == "not" else (self.fill, self.border):
            ax.add_collection(collection, autolim=False)
        self.ax = ax

    def move(self, vertices: Array, values: Array | None = None) -> None:
        """Draw it with its vertices (N, 2) there, coloured by values (N,)."""
        around = [vertices[line] for line in self.outline]
        if self.filled == "plainly":
            self.fill.set_verts(around)
        elif self.filled == "by cells":
            self.fill.set_verts(list(vertices[self.mesh.cells]))
        if values is not None:
            self.fill.set_array(values[self.mesh.cells].mean(axis=1))
        if self.lines is not None:
            self.lines.set_path(mesh_path(vertices, self.mesh.edges))
        self.border.set_segments(around)

    def fit(self) -> None:
        """Let the axes hold it."""
        self.ax.update_datalim(np.concatenate(self.border.get_segments()))
        self.ax.autoscale_view()


class DrawnSurface:
    """The surface of a body in space, on axes of its own.

    Parameters
    ----------
    fig : Figure
    place : (float, float, float, float)
        Of the axes.
    facets : int array (k, 3)
    extent : (array (3,), array (3,))
        Lowest and highest coordinates that the axes hold.
    unit : str
        Of length.
    zoom : float
    short : float
        Axes shorter than this part of the longest have no scale.
    """

    def __init__(
        self,
        fig: Figure,
        place: tuple[float, float, float, float],
        facets: IntArray,
        extent: tuple[Array, Array],
        unit: str,
        zoom: float = 1.02,
        short: float = 0.0,
    ) -> None:
        with IMPORTS:
            from matplotlib.ticker import MaxNLocator
            from mpl_toolkits.mplot3d.art3d import Poly3DCollection

        self.facets = facets
        self.ax = cast("Axes3D", fig.add_axes(place, projection="3d", computed_zorder=False))
        fine = len(facets) > MANY_FACETS
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
    beside = _BESIDE_MARK * size * np.divide(drawn, sizes, out=np.zeros_like(drawn), where=sizes > 0.0)
    tails = places + np.where(pulls[:, None], beside, -drawn - beside)
    quiver = ax.quiver(
        *tails.T, *force.T, angles="xy", scale_units="xy", scale=scale, color=colour, units="inches", width=_THICK,
        headwidth=3.6, headlength=4.6, headaxislength=4.2, minlength=0.5, zorder=zorder,
    )  # fmt: skip
    return quiver, np.vstack([tails, tails + drawn])
