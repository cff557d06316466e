"""Drawings of plane bodies on their foundations."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from hemivar.basics.types import Array, IntArray
from hemivar.fem.area_average import over_area
from hemivar.files.boundary import ContactBoundary, contact_boundaries, polylines
from hemivar.mesh.boundary_rule import BoundaryRule
from hemivar.report.deformed import BodyColour, DeformedBody, round_number
from hemivar.report.drawn_body import (
    GROUND,
    DrawnFoundation,
    DrawnPlane,
    Filled,
    FoundationLine,
    force_arrows,
    mark_states,
)
from hemivar.report.law_figures import law_captions
from hemivar.report.picture import NOTE
from hemivar.report.style import DASHES, GREEN, GREY, MANY_CELLS, RED, figure_of, legend_beside, state_mark

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.quiver import Quiver

__all__ = ["Arrows", "PlaneBody"]

#: Points below axes that the names of their scales take.
_BELOW = 36.0


class Arrows(StrEnum):
    """What the arrows at the contact nodes show."""

    FORCE = "force"
    """The force of the foundation on the body, per area."""
    COMPONENTS = "components"
    """Pressure and friction apart."""
    NONE = "none"
    """No arrows."""


class PlaneBody:
    """Everything that is drawn of one plane solution, and what the legend says of it."""

    def __init__(self, body: DeformedBody, units: tuple[str, str], largest: float | None = None) -> None:
        self.body, self.mesh, self.problem = body, body.mesh, body.problem
        self.units, self.largest = units, largest
        self.boundaries = contact_boundaries(body.problem)
        self.outline = polylines(body.mesh.boundary_facets)
        self.size = float(np.linalg.norm(np.ptp(body.mesh.points, axis=0)))
        self.handles: list[Artist] = []
        self.keys: list[tuple[Quiver, str, float, float]] = []

    def draw(self, ax: Axes, arrows: Arrows, colour: BodyColour, note: str, legend: bool) -> tuple[Axes, float]:
        """The body deformed and at rest, the foundations, states and forces, and the legend to the right of them.

        Returns the lowest axes, those of the scale of colours if there is one, and how many points below them all is
        empty.
        """
        from matplotlib.lines import Line2D

        lowest = self._body(ax, colour)
        for line in self.outline:
            ax.plot(*self.mesh.points[line].T, color=GREY, lw=0.8, ls=DASHES, zorder=2.5)
        self.handles.append(Line2D([], [], color=GREY, lw=0.8, ls=DASHES, label="body at rest"))
        if self.boundaries or over_area(self.problem).any():
            longest = self._forces(ax, arrows) if arrows is not Arrows.NONE else 0.0
            self._foundations(ax, longest)
            self._states(ax)
        if not legend:
            return lowest, _BELOW
        bottom = self._enlarged(ax, arrows, self._legend(ax, note))
        fig = figure_of(ax)
        drop = (lowest.get_window_extent().transformed(fig.transFigure.inverted()).y0 - bottom) * fig.get_figheight()
        return lowest, max(72.0 * drop, _BELOW)

    def _body(self, ax: Axes, colour: BodyColour) -> Axes:
        """The body, cells coloured by their stress or vertices by their displacement; returns the lowest axes."""
        from matplotlib.lines import Line2D

        self.handles.append(Line2D([], [], color="black", lw=0.9, label=self.body.label))
        inches = 0.9 * ax.get_window_extent().width / figure_of(ax).dpi
        values = None if colour is BodyColour.NONE else self.body.values(colour)
        filled: Filled = "plainly" if values is None else "cells" if colour is BodyColour.STRESS else "vertices"
        drawn = DrawnPlane(ax, self.mesh, inches, filled)
        drawn.move(self.body.vertices, values)
        drawn.fit()
        if values is None:
            return ax
        most = float(values.max())
        if filled == "cells" and len(values) > MANY_CELLS:  # a corner may hold what makes all else dark
            most = float(np.quantile(values, 0.999))
        drawn.fill.set_clim(float(values.min()), most)
        extend = "max" if most < values.max() else "neither"
        bar = ax.figure.colorbar(drawn.fill, ax=ax, location="bottom", shrink=0.7, pad=0.16, aspect=35, extend=extend)
        bar.set_label(colour.label(*self.units))
        return bar.ax

    def _foundation_lines(self, boundary: ContactBoundary) -> Iterator[FoundationLine]:
        corners = boundary.corners
        used, _, summed = BoundaryRule.of(self.mesh, corners).summed_normals()
        normal = summed / np.linalg.norm(summed, axis=1)[:, None]
        contact = self.problem.contact
        assert contact.points is not None
        nearest = boundary.index[KDTree(contact.points[boundary.index]).query(self.mesh.points[used])[1]]
        if boundary.nodes is not None and contact.frames is not None:
            normal = contact.frames[nearest, 0]  # that of an obstacle may differ from the body's
        for line in boundary.lines:
            at = np.searchsorted(used, line)
            yield FoundationLine(self.mesh.points[line], normal[at], nearest[at], *[0.02 * self.size] * 2)

    def _foundations(self, ax: Axes, reach: float) -> None:
        """The foundations, hatched along their surfaces, deeper than what penetrates and than arrows reach."""
        for boundary in self.on_foundations:
            deepest = self.body.factor * float(self.body.solution.penetration[boundary.index].max(initial=0.0))
            lines = list(self._foundation_lines(boundary))
            DrawnFoundation(ax, lines, self.size, max(deepest, 0.0) + reach).move(self.problem.gap, self.body.factor)

    @property
    def on_foundations(self) -> list[ContactBoundary]:
        """The contact boundaries that touch no other body."""
        return [boundary for boundary in self.boundaries if boundary.touched is None]

    def _apart(self, distance: float) -> IntArray:
        """Contact points that stand at least so far from each other, in parts of the body, evenly along a boundary.

        Counted from the middle of the part that bears, so that what is symmetric stays so.
        """
        points, kept = self.problem.contact.points, []
        assert points is not None
        bears = np.linalg.norm(self.body.solution.multiplier, axis=1)
        for boundary in self.boundaries:
            index = boundary.index
            order = np.argsort(boundary.position(points)[0], kind="stable")
            index, where = index[order], boundary.position(points)[0][order]
            bearing = np.flatnonzero(bears[index] > 1e-9 * bears.max(initial=0.0))
            middle = int(bearing[len(bearing) // 2]) if len(bearing) else len(index) // 2
            kept.append(index[_spread(where, middle, distance * self.size)])
        over = np.flatnonzero(over_area(self.problem))
        squares = np.floor(points[over] / (distance * self.size))
        kept.append(over[np.unique(squares, axis=0, return_index=True)[1]])
        return np.sort(np.concatenate(kept))

    def _states(self, ax: Axes) -> None:
        places, shown = self.body.contact_places, self._apart(0.018)
        for kind, here, label in self.body.states():
            if here.any():  # one mark at least of each state that there is
                at = shown[here[shown]] if here[shown].any() else np.flatnonzero(here)[:1]
                mark_states(ax, kind, places[at], len(places))
            self.handles.append(state_mark(kind, label))

    def _forces(self, ax: Axes, arrows: Arrows) -> float:
        """Forces on the body, drawn in the foundation: arrows that push end where they act, others begin there.

        Returns the length of the longest arrow.
        """
        solution = self.body.solution
        along = solution.friction_vectors
        across = solution.tractions - along
        places = self.body.contact_places
        shown = self._apart(0.022)
        where = "the body" if self.boundaries == self.on_foundations else "the side with marks"
        sets = (
            [(f"force per area on {where}", across + along, RED)]
            if arrows is Arrows.FORCE
            else [("pressure", across, RED), (f"friction on {where}", along, GREEN)]
        )
        largest = max(float(np.linalg.norm(vectors, axis=1).max()) for _, vectors, _ in sets)
        if largest == 0.0:
            return 0.0
        largest = self.largest or largest
        reference = round_number(largest)
        length = 0.16 * self.size
        for row, (name, vectors, colour) in enumerate(sets):
            pulls = (solution.pressure <= 0.0) | (np.einsum("md,md->m", across, vectors) <= 0.0)
            quiver, ends = force_arrows(
                ax, places[shown], vectors[shown], pulls[shown], largest / length, self.size, colour, 5.0 + 0.1 * row
            )
            quiver.set_in_layout(False)
            label = f"{name}: {reference:g} {self.units[1]}".rstrip()
            self.keys.append((quiver, label, reference, reference * length / largest))
            ax.update_datalim(ends)
        ax.autoscale_view()
        return length

    def _enlarged(self, ax: Axes, arrows: Arrows, bottom: float) -> float:
        """The part that bears, larger below the legend where it is too small to be seen; returns where all ends."""
        if not self.boundaries:
            return bottom
        bears = np.linalg.norm(self.body.solution.multiplier, axis=1)
        places = self.body.contact_places[bears > 1e-9 * bears.max(initial=0.0)]
        if len(places) < 5 or (extent := float(np.ptp(places, axis=0).max())) > 0.06 * self.size:
            return bottom
        fig = figure_of(ax)
        (width, height), (wide, tall) = fig.get_size_inches(), (1.7, 1.3)
        left = ax.get_window_extent().transformed(fig.transFigure.inverted()).x1 + 0.5 / width
        bottom -= (0.35 + tall) / height
        inset = fig.add_axes((left, bottom, wide / width, tall / height))
        part = copy.copy(self)
        part.size, part.handles, part.keys = 2.0 * extent, [], []
        for line in self.outline:
            inset.plot(*self.body.vertices[line].T, color="black", lw=0.9, zorder=3)
        longest = part._forces(inset, arrows) if arrows is not Arrows.NONE else 0.0
        part._foundations(inset, longest)
        part._states(inset)
        for artist in inset.lines:
            artist.set_clip_on(True)
        middle, half = 0.5 * (places.min(axis=0) + places.max(axis=0)), 0.75 * extent
        low = middle[1] - half * tall / wide - 0.5 * longest
        inset.set(xlim=(middle[0] - half, middle[0] + half), ylim=(low, low + 2.0 * half * tall / wide))
        inset.locator_params(nbins=3)
        inset.tick_params(labelsize=6.5)
        inset.set_title("the part that bears", fontsize=7.0, pad=3.0)
        return float(bottom - 0.3 / height)

    def _legend(self, ax: Axes, note: str) -> float:
        """The legend to the right; returns where it ends, in fractions of the figure."""
        from matplotlib.patches import Patch

        if self.on_foundations:
            self.handles.append(
                Patch(facecolor=GROUND, edgecolor="#8a8a8a", hatch="//////", linewidth=0.0, label="foundation")
            )
        lines = [line for line in (note, *law_captions(self.problem)) if line]
        fig = figure_of(ax)
        box = legend_beside(ax, handles=self.handles, handlelength=1.6)
        fig.draw_without_rendering()
        # Places in fractions of the figure survive the cropping of saved files; heights are meant in inches.
        fraction = fig.transFigure.inverted()
        width, height = fig.get_size_inches()
        frame = ax.get_window_extent().transformed(fraction)
        written = box.get_window_extent().transformed(fraction)
        left, bottom = written.x0 + 0.06 / width, written.y0 - 0.05 / height
        text = fig.text(left, bottom, "\n".join(lines), va="top", fontsize=8, linespacing=1.45, gid=NOTE)
        bottom = text.get_window_extent().transformed(fraction).y0 - 0.2 / height
        per_length = frame.width / float(np.ptp(ax.get_xlim()))
        for quiver, name, reference, length in self.keys:
            tip = left + length * per_length
            key = ax.quiverkey(quiver, tip, bottom, reference, "", labelpos="E", coordinates="figure")
            key.set_in_layout(False)
            fig.text(tip + 0.08 / width, bottom, name, va="center", fontsize=8)
            bottom -= 0.2 / height
        return float(bottom)


def _spread(where: Array, first: int, distance: float) -> IntArray:
    """Which of these increasing places (k,) stand ``distance`` apart, counted from one of them to both sides."""
    chosen = [first]
    for direction in (1, -1):
        last = first
        while True:
            ahead = where[last] + direction * distance * (1.0 - 1e-9)
            last = int(np.searchsorted(where, ahead, "left" if direction > 0 else "right")) - (direction < 0)
            if not 0 <= last < len(where):
                break
            chosen.append(last)
    return np.sort(np.array(chosen))
