"""What a frame of a film shows: a plane body with its mesh, or the surface of one in 3D; one scale for all frames."""

from __future__ import annotations

import math
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.spatial import KDTree

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.files.boundary import polylines
from hemivar.files.film import Film, FilmFrame
from hemivar.mesh import Mesh
from hemivar.mesh.boundary_rule import BoundaryRule, boundary_rule
from hemivar.report.deformed import round_number
from hemivar.report.drawn_body import (
    DrawnFoundation,
    DrawnPlane,
    DrawnSurface,
    FoundationLine,
    force_arrows,
    mark_states,
)
from hemivar.report.picture import new_figure
from hemivar.report.style import BLUE, DASHES, GREY, RED, in_rows, state_mark, with_unit
from hemivar.solvers.contact_states import KINDS

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from matplotlib.quiver import Quiver
    from matplotlib.text import Text

__all__ = ["FilmColour", "FilmPicture", "PlanePicture", "SolidPicture"]

#: How far a body may go, in its own sizes; beyond, its picture is a point.
_FARTHEST = 1e9
#: How far a foundation goes on beyond what touches it.
_BEYOND = 0.03
#: Cosine of the angle by which a boundary that goes on may turn.
_GOES_ON = 0.9
#: Part of the vertices that the scale of colours holds in every frame: the rest are corners.
_BRIGHT = 0.98


class FilmColour(StrEnum):
    """What colours the body in a film."""

    NONE = "none"
    """Nothing."""
    DISPLACEMENT = "displacement"
    """The size of the displacement."""
    SPEED = "speed"
    """The size of the velocity: waves are seen."""


class FilmPicture:
    """What both kinds of films share: scale, extent and colours of all frames that are shown, and the clock."""

    fig: Figure
    ax: Any
    label: Text
    drawn: DrawnPlane | DrawnSurface
    arrows: Quiver | None = None
    _canvas: Any = None

    def __init__(
        self, film: Film, shown: list[int], scale: float | Literal["auto"], units: tuple[str, str], colour: FilmColour
    ) -> None:
        self.film, self.units, self.colour = film, units, colour
        with np.errstate(over="ignore", invalid="ignore"):
            self._measure(film, shown, scale)
        self.mesh = Mesh(film.points, film.cells)
        digits = max(0, 2 - math.floor(math.log10(max(float(np.ptp(film.times)), 1e-300))))
        self._digits = min(digits, 12)

    def _measure(self, film: Film, shown: list[int], scale: float | Literal["auto"]) -> None:
        """The scales that all frames share."""
        self.size = float(np.linalg.norm(np.ptp(film.points, axis=0)))
        self.places = film.frame(shown[0]).places
        body = _Range(film.points.shape)
        self.travel, self.push = _Range(self.places.shape), _Range(self.places.shape)
        self.gaps = _Range(len(self.places))
        moved, peak, self.strongest, self.brightest = 0.0, 0.0, 0.0, 0.0
        met: list[IntArray] = []
        for frame in map(film.frame, sorted(set(shown))):
            u = frame.displacement[: len(film.points)]
            body.add(u)
            self.travel.add(frame.moved)
            self.push.add(frame.force)
            self.gaps.add(frame.gap)
            met.append(np.unique(frame.states.numbers))
            moved = max(moved, _longest(u))
            self.strongest = max(self.strongest, _longest(frame.force))
            here = self.coloured(frame)
            self.brightest = max(self.brightest, float(np.quantile(here, _BRIGHT)))
            peak = max(peak, float(here.max()))
        self.clipped = peak > self.brightest
        self.kinds = tuple(KINDS[number] for number in np.unique(np.concatenate(met)).tolist())
        wanted = 0.1 * float(np.ptp(film.points, axis=0).max())
        if scale == "auto":
            self.factor = round_number(wanted / moved) if 0.0 < moved < wanted else 1.0
        else:
            self.factor = float(scale)
        ranges = (body, self.travel, self.gaps)
        reach = max(float(np.abs([part.low, part.high]).max(initial=0.0)) for part in ranges) * self.factor
        if not (reach < _FARTHEST * self.size < math.inf and self.strongest < math.inf and self.brightest < math.inf):
            raise ProblemError(
                f"the film cannot be drawn: the body has size {self.size:.3g}, and its displacement or gap reaches "
                f"{reach:.3g}; take a smaller scale, or check displacement, gap and force"
            )
        self.low = np.minimum(film.points, film.points + self.factor * body.low).min(axis=0)
        self.high = np.maximum(film.points, film.points + self.factor * body.high).max(axis=0)

    def coloured(self, frame: FilmFrame) -> Array:
        """What colours the vertices, (N,)."""
        values = frame.velocity if self.colour is FilmColour.SPEED else frame.displacement
        return np.asarray(np.linalg.norm(values[: len(self.film.points)], axis=1))

    def time(self, frame: FilmFrame) -> str:
        """The time label."""
        text = f"t = {frame.time:.{self._digits}f} {self.units[1]}".rstrip()
        return text if self.factor == 1.0 else f"{text}     displacement times {self.factor:g}"

    def _clock(self, left: float, bottom: float, width: float) -> None:
        """A line that fills with the time, at this place of the figure."""
        with IMPORTS:
            from matplotlib.lines import Line2D

        self._from, self._width, self._now = left, width, Line2D([left, left], [bottom, bottom], color=BLUE, lw=2.5)
        for line in (Line2D([left, left + width], [bottom, bottom], color="#d0d0d0", lw=2.5), self._now):
            line.set_solid_capstyle("butt")
            self.fig.add_artist(line)

    def _show_time(self, frame: FilmFrame) -> None:
        """Write the time, and fill the line."""
        self.label.set_text(self.time(frame))
        begin, end = float(self.film.times[0]), float(self.film.times[-1])
        part = (frame.time - begin) / (end - begin) if end > begin else 1.0
        self._now.set_xdata([self._from, self._from + part * self._width])

    def _bar(self, mappable: ScalarMappable, frame: tuple[float, float, float, float]) -> None:
        """The scale of the colours, that of all frames."""
        mappable.set_clim(0.0, self.brightest or 1.0)
        length, time = self.units
        unit = length
        if self.colour is FilmColour.SPEED:
            unit = f"{length}/{time}" if length and time else ""
        bar = self.fig.colorbar(
            mappable, cax=self.fig.add_axes(frame), extend="max" if self.clipped else "neither", extendfrac=0.04
        )
        bar.set_label(with_unit(self.colour.value, unit))

    def show(self, frame: FilmFrame) -> None:
        """Draw a frame."""
        moved = self.film.points + self.factor * frame.displacement[: len(self.film.points)]
        self.drawn.move(moved, None if self.colour is FilmColour.NONE else self.coloured(frame))
        places = frame.places + self.factor * frame.moved
        for kind, mark in self.marks.items():
            at = places[frame.states.numbers == KINDS.index(kind)].T
            if len(at) == 3:
                mark.set_data_3d(*at)  # type: ignore[attr-defined]
            else:
                mark.set_data(*at)
        self._show_time(frame)

    def image(self, frame: FilmFrame) -> Array:
        """A frame as red, green and blue, (rows, columns, 3); what rests in all of them is drawn once."""
        self.show(frame)
        if self._canvas is None:
            with IMPORTS:
                from matplotlib.backends.backend_agg import FigureCanvasAgg

            self._canvas = FigureCanvasAgg(self.fig)
            for artist in self.moving:
                artist.set_animated(True)
            self._canvas.draw()
            self._rest = self._canvas.copy_from_bbox(self.fig.bbox)
        self._canvas.restore_region(self._rest)
        for artist in sorted(self.moving, key=lambda artist: artist.get_zorder()):
            if artist is self.drawn.artists[0] and isinstance(self.drawn, DrawnSurface):
                self.drawn.surface.do_3d_projection()
            self.fig.draw_artist(artist)
        return np.array(self._canvas.buffer_rgba())[:, :, :3]

    @property
    def moving(self) -> list[Artist]:
        """What differs from frame to frame."""
        arrows = [] if self.arrows is None else [self.arrows]
        return [*self.drawn.artists, *self.marks.values(), *arrows, self.label, self._now]

    def _mark(self) -> None:
        """Marks of the states, without a place."""
        none = np.zeros((0, self.film.points.shape[1]))
        self.marks = {kind: mark_states(self.ax, kind, none, len(self.places)) for kind in self.kinds}


class _Range:
    """The least and the greatest of arrays, entry by entry; begins with zeros."""

    def __init__(self, shape: int | tuple[int, ...]) -> None:
        self.low, self.high = np.zeros(shape), np.zeros(shape)

    def add(self, values: Array) -> None:
        """Let it hold these too."""
        self.low, self.high = np.minimum(self.low, values), np.maximum(self.high, values)


def _longest(vectors: Array) -> float:
    return float(np.linalg.norm(vectors, axis=1).max(initial=0.0))


class PlanePicture(FilmPicture):
    """A plane body: mesh, outline at rest, contact points by state, forces, the foundation."""

    drawn: DrawnPlane

    def __init__(
        self, film: Film, shown: list[int], scale: float | Literal["auto"], units: tuple[str, str], colour: FilmColour
    ) -> None:
        super().__init__(film, shown, scale, units, colour)
        with IMPORTS:
            from matplotlib.lines import Line2D

        places = self.places
        self.length = 0.16 * self.size if self.strongest > 0.0 else 0.0
        lines = self._foundation_lines()
        low, high = self._extent()
        width, height = high - low
        bar = 0.0 if colour is FilmColour.NONE else 0.12
        self.wide = 6.3
        frame = self.wide * (0.85 - bar)
        entries = len(self.kinds) + (self.strongest > 0.0)
        foot = 0.18 * (max(entries - 1, 0) // 4)  # of further rows of the legend
        tall = float(np.clip(frame * height / width + 1.4, 2.4, 6.3))
        tall = round((tall + foot) * 50.0) / 50.0
        self.fig = new_figure((self.wide, tall))
        self.ax: Axes = self.fig.add_axes((0.12, (1.05 + foot) / tall, 0.85 - bar, 1.0 - (1.4 + foot) / tall))
        ax = self.ax
        self.drawn = DrawnPlane(ax, self.mesh, frame, "vertices" if bar else "plainly")
        for line in self.drawn.outline:
            ax.plot(*film.points[line].T, color=GREY, lw=0.8, ls=DASHES, zorder=1.4)
        if bar:
            self._bar(self.drawn.fill, (0.87, (1.05 + foot) / tall, 0.022, 1.0 - (1.4 + foot) / tall))
        self._mark()
        self.foundation = DrawnFoundation(ax, lines, self.size, self.length)
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ax.set_aspect("equal")
        ax.locator_params(axis="y", nbins=max(2, min(6, round(3.0 * (tall - 1.4)))))
        ax.set_xlabel(with_unit("x", units[0]))
        ax.set_ylabel(with_unit("y", units[0]))
        self.label = self.fig.text(0.12, (0.42 + foot) / tall, "", fontsize=9, family="monospace")
        self._clock(0.12, (0.33 + foot) / tall, 0.85 - bar)
        if len(places):
            handles = [state_mark(kind, kind.label) for kind in self.kinds]
            if self.strongest > 0.0:
                longest = f"force per area, at most {self.strongest:.3g}"
                handles.append(Line2D([], [], color=RED, lw=1.2, label=longest))
            self.fig.legend(
                handles=handles, loc="lower right", bbox_to_anchor=(0.98, 0.0), ncols=in_rows(len(handles)),
                handlelength=1.2, columnspacing=1.0,
            )  # fmt: skip

    def _foundation_lines(self) -> list[FoundationLine]:
        """The parts of the boundary whose vertices or middles are contact points, with the normals there.

        An edge whose other end is fixed belongs to them if the boundary does not turn there. Where they are straight
        their foundation goes on as far as the body does.
        """
        self.normal = np.zeros_like(self.places)  # none where another body is touched
        numbers = np.arange(len(self.places)) if self.film.paired is None else np.flatnonzero(~self.film.paired)
        if not numbers.size:
            return []
        places = self.places[numbers]
        points, facets, tree = self.film.points, self.mesh.boundary_facets, KDTree(places)
        near = 1e-6 * self.size
        at_ends = tree.query(points[facets])[0] < near
        chosen = at_ends.all(axis=1) | (tree.query(points[facets].mean(axis=1))[0] < near)
        normals = boundary_rule(self.mesh, None).normals
        around = np.zeros_like(points)
        np.add.at(around, facets[chosen].ravel(), np.repeat(normals[chosen], 2, axis=0))
        ahead = np.einsum("fd,fkd->fk", normals, around[facets]) >= _GOES_ON * np.linalg.norm(around[facets], axis=2)
        facets = facets[chosen | (at_ends & ahead).any(axis=1)]
        rule = BoundaryRule.of(self.mesh, facets)
        used, _, summed = rule.summed_normals()
        normal = summed / np.linalg.norm(summed, axis=1)[:, None]
        known = KDTree(np.concatenate([points[used], points[facets].mean(axis=1)]))
        self.normal[numbers] = np.concatenate([normal, rule.normals])[known.query(places)[1]]
        depth, tangent = points[used] @ normal[0], np.array([-normal[0, 1], normal[0, 0]])
        straight = np.abs(normal - normal[0]).max() < 1e-9 and np.ptp(depth) < 1e-9 * self.size
        shifts = (self.travel.low[numbers], self.travel.high[numbers])
        ends = np.array([(places + self.factor * shift) @ tangent for shift in shifts])
        beyond, lines = _BEYOND * self.size, []
        for line in polylines(facets):
            at = np.searchsorted(used, line)
            first, last = points[line[[0, -1]]] @ tangent
            before, after = (first - ends.min(), ends.max() - last) if straight else (0.0, 0.0)
            lines.append(
                FoundationLine(
                    points[line], normal[at], numbers[tree.query(points[line])[1]], max(before, 0.0) + beyond,
                    max(after, 0.0) + beyond,
                )
            )  # fmt: skip
        return lines

    def _extent(self) -> tuple[Array, Array]:
        """What all frames show: body, foundation and arrows."""
        pad = 0.04 * self.size
        low, high = self.low - pad, self.high + pad
        if not len(self.places):
            return low, high
        for gap in (self.gaps.low, self.gaps.high):
            surface = self.places + self.factor * gap[:, None] * self.normal
            for side in (surface, surface + (_BEYOND * self.size + self.length) * self.normal):
                low, high = np.minimum(low, side.min(axis=0)), np.maximum(high, side.max(axis=0))
        if self.strongest > 0.0:
            longest = self.length / self.strongest
            for force in (self.push.low, self.push.high, -self.push.low, -self.push.high):
                across = np.einsum("pd,pd->p", force, self.normal)
                reach = longest * (force + (np.abs(across) - across)[:, None] * self.normal)  # into the foundation
                for shift in (self.travel.low, self.travel.high):
                    ends = self.places + self.factor * shift + reach
                    low = np.minimum(low, ends.min(axis=0) - 0.5 * pad)
                    high = np.maximum(high, ends.max(axis=0) + 0.5 * pad)
        return low, high

    def show(self, frame: FilmFrame) -> None:
        """Draw a frame."""
        super().show(frame)
        self.foundation.move(frame.gap, self.factor)
        if self.arrows is not None:
            self.arrows.remove()
        if self.length and len(self.places):
            places, step = frame.places + self.factor * frame.moved, max(1, len(self.places) // 70)
            pulls = np.einsum("pd,pd->p", frame.force, self.normal) > 0.0
            scale = self.strongest / self.length
            self.arrows, _ = force_arrows(
                self.ax, places[::step], frame.force[::step], pulls[::step], scale, self.size, RED
            )

    @property
    def moving(self) -> list[Artist]:
        """What differs from frame to frame."""
        return [*super().moving, *self.foundation.artists]


class SolidPicture(FilmPicture):
    """The surface of a body in 3D, coloured."""

    drawn: DrawnSurface

    def __init__(
        self, film: Film, shown: list[int], scale: float | Literal["auto"], units: tuple[str, str], colour: FilmColour
    ) -> None:
        super().__init__(film, shown, scale, units, colour)
        extent = np.maximum(self.high - self.low, 1e-6 * float((self.high - self.low).max()))
        slender = float(extent[2] / extent[:2].max())
        tall = 3.0 if slender < 0.4 else 5.0
        self.fig = new_figure((6.3, tall))
        room = 0.94 - 0.3 / tall  # below a title
        facets, ends = self.mesh.boundary_facets, (self.low, self.low + extent)
        zoom = 1.5 if slender < 0.4 else 1.2
        self.drawn = DrawnSurface(self.fig, (0.02, 0.06, 0.8, room), facets, ends, units[0], zoom, 0.3)
        self.ax = self.drawn.ax
        if colour is not FilmColour.NONE:
            self._bar(self.drawn.surface, (0.85, 0.24, 0.022, 0.56))
        self._mark()
        places = self.places
        if len(places):
            self.ax.view_init(*self._view(places))
            self.fig.legend(
                handles=[state_mark(kind, kind.label) for kind in self.kinds], loc="lower right",
                ncols=in_rows(len(self.kinds)), handlelength=1.2,
            )  # fmt: skip
        self.label = self.fig.text(0.03, 0.14 / tall, "", fontsize=9, family="monospace")
        self._clock(0.03, 0.06 / tall, 0.4)

    def _view(self, places: Array) -> tuple[float, float]:
        """Elevation and azimuth from which the contact points are seen."""
        middle = 0.5 * (self.film.points.min(axis=0) + self.film.points.max(axis=0))
        toward = (places.mean(axis=0) - middle) / np.ptp(self.film.points, axis=0)
        if int(np.argmax(np.abs(toward))) == 2:
            return (-20.0 if toward[2] < 0.0 else 28.0), -60.0
        side = math.degrees(math.atan2(toward[1], toward[0]))
        return 24.0, side + 50.0 if side > 0.0 else side - 50.0
