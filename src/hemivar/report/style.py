"""Colours, marks and sizes that all figures share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.report.picture import STYLE, Legend, current, drawing, new_figure
from hemivar.solvers.contact_states import KINDS, Kind, NormalState, TangentialState

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend as LegendBox
    from matplotlib.lines import Line2D

__all__ = [
    "BESIDE",
    "BLUE",
    "DASHES",
    "GREEN",
    "GREY",
    "LINES",
    "MANY_CELLS",
    "MARKERS",
    "ORANGE",
    "PURPLE",
    "RED",
    "SERIES",
    "SKY",
    "STATE_COLOURS",
    "STYLE",
    "axes_on",
    "body_axes",
    "drawing",
    "figure_of",
    "in_rows",
    "legend_beside",
    "state_mark",
    "with_unit",
]

# Okabe and Ito's colours, told apart by all readers.
BLUE, ORANGE, GREEN, RED, SKY, PURPLE = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#56B4E9", "#CC79A7"
GREY = "#5f5f5f"
#: Of curves, one after the other.
SERIES = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)

#: Of curves in one colour.
LINES: tuple[Any, ...] = ("-", (0, (6, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))
#: What is at rest.
DASHES = (0, (4, 3))
#: Up to so many cells, or facets of a surface, each is drawn; more are rasterised, without lines between them.
MANY_CELLS = 5000
#: Pictures of a body side by side in one figure: with more, letters would no longer fit between them.
BESIDE = 3

#: Colours of both states of a point, for free, stick and slip: flat maps tell all of them apart.
_COLOURS = {
    NormalState.OPEN: ("white",),
    NormalState.CONTACT: (SKY, BLUE, ORANGE),
    NormalState.BONDED: (PURPLE, "#7b3294", RED),
    NormalState.SOFTENING: ("#F0E442", GREEN, "#8c6d00"),
    NormalState.DEBONDED: ("#b0b0b0",),
}
STATE_COLOURS: Mapping[Kind, str] = {kind: _COLOURS[kind.normal][kind.tangential] for kind in KINDS}
#: The shape is that of the normal state; points in contact that slip have one of their own.
_SHAPES = {
    NormalState.OPEN: "o",
    NormalState.CONTACT: "s",
    NormalState.BONDED: "D",
    NormalState.SOFTENING: "v",
    NormalState.DEBONDED: "X",
}
_SLIPPING, _STICKING = (Kind(NormalState.CONTACT, state) for state in (TangentialState.SLIP, TangentialState.STICK))
MARKERS: Mapping[Kind, dict[str, Any]] = {
    kind: {
        "marker": "^" if kind == _SLIPPING else _SHAPES[kind.normal],
        "markerfacecolor": colour,
        "markeredgecolor": BLUE if kind == _STICKING else "black",
    }
    for kind, colour in STATE_COLOURS.items()
}


def state_mark(kind: Kind, label: str) -> Line2D:
    """What a legend shows of the states of a point."""
    with IMPORTS:
        from matplotlib.lines import Line2D

    return Line2D([], [], ls="", ms=4.4, mew=0.7, label=label, **MARKERS[kind])


def in_rows(count: int) -> int:
    """Columns of a legend below a picture: few rows, of four entries at most, in print of two."""
    most = 4 if current() is None else 2
    return -(-count // max(-(-count // most), 1))


def legend_beside(ax: Axes, **options: Any) -> LegendBox:
    """A legend to the right of axes."""
    return ax.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, **options)


def axes(value: object, name: str) -> None:
    """Refuse what is not matplotlib's axes, for :func:`expecting`."""
    if not hasattr(value, "get_figure"):
        raise ProblemError(f"{name} is {described(value)}; give axes of matplotlib, Figure().add_subplot()")


def with_unit(name: str, unit: str) -> str:
    """``name (unit)``, or the name alone."""
    return f"{name} ({unit})" if unit else name


def axes_on(ax: Axes | None, size: tuple[float, float], foot: float = 0.0) -> tuple[Figure, Axes]:
    """The axes given and their figure, or new ones on a figure of this size in inches, with room on the right.

    Below them the figure is higher by ``foot`` inches.
    """

    if ax is not None:
        return figure_of(ax), ax
    width, height = size
    whole = height + foot
    fig = new_figure((width, whole))
    printed = current()
    beside = 0.56 if printed is None or printed.legend is Legend.OUTSIDE else 0.86
    return fig, fig.add_axes((0.09, (0.12 * height + foot) / whole, beside, 0.8 * height / whole))


def body_axes(
    ax: Axes | None, points: Array, title: str | None, unit: str, *, head: float = 0.9, foot: float = 0.0
) -> tuple[Figure, Axes]:
    """Axes for a plane body with these vertices (N, 2), named and of its proportions, ``foot`` as in axes_on."""
    width, height = np.ptp(points, axis=0)
    fig, ax = axes_on(ax, (6.3, head + float(np.clip(3.5 * (height / width + 0.25), 2.3, 5.0))), foot)
    ax.set_aspect("equal")
    ax.set(xlabel=with_unit("x", unit), ylabel=with_unit("y", unit))
    ax.spines[["top", "right"]].set_visible(False)
    if title:
        ax.set_title(title)
    return fig, ax


def figure_of(ax: Axes) -> Figure:
    """The figure that axes stand on."""
    fig = ax.get_figure(root=True)
    if fig is None:
        raise ProblemError("the axes given belong to no figure; make them by Figure().add_subplot()")
    return fig
