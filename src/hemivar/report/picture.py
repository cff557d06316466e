"""Figures that a notebook shows by themselves, and how they are printed: a width, one size of letters, no notes."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

from hemivar.basics.arguments import quoted
from hemivar.basics.first_use import IMPORTS, Lock
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.backend_bases import RendererBase
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend as Box

__all__ = [
    "BELOW",
    "NOTE",
    "STYLE",
    "Legend",
    "Print",
    "current",
    "drawing",
    "new_figure",
    "new_figures",
    "paper",
    "png",
]

#: Dots per inch in a notebook.
_DPI = 110
#: Letters of a line of text that are drawn, and lines of a text.
_LONGEST, _MOST_LINES = 200, 50
#: Figures of the drawing that is under way.
_MADE: ContextVar[list[Figure] | None] = ContextVar("made", default=None)
#: Millimetres in an inch, and in the units that a width may have.
_INCH = 25.4
_UNITS = {"mm": 1.0, "cm": 10.0, "in": _INCH, "pt": _INCH / 72.27}
#: Widths and sizes of letters that make sense, in millimetres and points.
_WIDTHS, _FONTS = (20.0, 500.0), (4.0, 24.0)
#: Room for ticks and a name between axes and a legend below them, in letters.
BELOW = 4.4
#: Marks texts that are notes, which print leaves out.
NOTE = "note"

STYLE: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 10.0,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "mathtext.fontset": "dejavusans",
    "hatch.linewidth": 0.5,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    # whatever a matplotlibrc says: nothing here may need LaTeX or run out of memory
    "text.usetex": False,
    "text.parse_math": True,
    "figure.dpi": 100.0,
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
}


def new_figure(size: tuple[float, float], *, layout: Literal["constrained", "tight"] | None = None) -> Figure:
    """A figure of this size in inches: matplotlib's own, which knows how to be shown in a notebook.

    pyplot does not know of it: nothing must be closed, and no magic is needed. In print it has the width of the paper.
    """
    printed = current()
    figure = _kind()(figsize=size if printed is None else printed.size(size), layout=layout)
    if (made := _MADE.get()) is not None:
        made.append(figure)
    return figure


@contextmanager
def new_figures() -> Iterator[list[Figure]]:
    """Context that gives the figures made in it."""
    made: list[Figure] = []
    token = _MADE.set(made)
    try:
        yield made
    finally:
        _MADE.reset(token)


@cache
def _kind() -> type[Figure]:
    with IMPORTS:
        from matplotlib.figure import Figure
        from matplotlib.text import Text

    class Picture(Figure):
        """A figure as a notebook shows it, whose texts are no longer than it can show."""

        def draw(self, renderer: RendererBase) -> None:
            _shorten(self)
            super().draw(renderer)

        def savefig(self, fname: object, **options: object) -> None:
            """Write it with the legends beside its axes, unless ``bbox_inches`` is given."""
            super().savefig(fname, **({"bbox_inches": "tight"} | options))  # type: ignore[arg-type]

        def _repr_png_(self) -> bytes:
            return png(self, _DPI)

    def _shorten(figure: Figure) -> None:
        """Cut long lines of texts, such as a title of a million letters, the picture of which fits into no memory."""
        for text in figure.findobj(Text):
            assert isinstance(text, Text)
            lines = text.get_text().split("\n")
            if len(lines) > _MOST_LINES or max(map(len, lines)) > _LONGEST:
                shown = (one if len(one) <= _LONGEST else f"{one[:_LONGEST]}..." for one in lines[:_MOST_LINES])
                text.set_text("\n".join(shown))

    Picture.__qualname__ = "Picture"
    return Picture


def __getattr__(name: str) -> object:
    """``Picture``, by which figures are pickled and copied; matplotlib is loaded for it."""
    if name == "Picture":
        return _kind()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class Legend(StrEnum):
    """Where legends of printed figures stand."""

    OUTSIDE = "outside"
    INSIDE = "inside"
    NONE = "none"


@dataclass(frozen=True)
class Print:
    """How figures are printed; see :func:`paper`."""

    width: float  # in inches
    font: float  # in points
    legend: Legend
    annotations: bool

    @property
    def settings(self) -> dict[str, object]:
        """Settings of matplotlib: all letters have one size, ticks and legends a little less."""
        small = 0.9 * self.font
        sizes: dict[str, object] = {"font.size": self.font, "axes.labelsize": self.font, "axes.titlesize": self.font}
        sizes |= dict.fromkeys(("xtick.labelsize", "ytick.labelsize", "legend.fontsize"), small)
        return {
            **sizes,
            "lines.linewidth": 1.0,
            "axes.linewidth": 0.5,
            "font.family": "serif",
            "mathtext.fontset": "stix",
        }

    def size(self, size: tuple[float, float]) -> tuple[float, float]:
        """The size of a figure in inches: this width, in proportion as far as letters leave room for it."""
        return self.width, size[1] * max(self.width / size[0], 0.7)

    def finish(self, figure: Figure) -> None:
        """Move or remove legends and notes, and correct the width by what is drawn."""
        from matplotlib.text import Text

        legends = [(legend, ax) for ax in figure.axes if (legend := ax.get_legend()) is not None]
        for legend, ax in [*legends, *((legend, None) for legend in figure.legends)]:
            if self.legend is Legend.NONE:
                legend.remove()
            elif self.legend is Legend.INSIDE and ax is not None:
                self._move(legend, ax)
        for text in figure.findobj(Text):
            assert isinstance(text, Text)
            text.set_fontsize(min(text.get_fontsize(), self.font))
            if not self.annotations and text.get_gid() == NOTE:
                text.remove()
        if not self.annotations:
            for ax in figure.axes:
                ax.set_title("")
        self._fit(figure)

    @staticmethod
    def _move(legend: Box, ax: Axes) -> None:
        """Put a legend into its axes; below a body, which fills them, if no scale of colours stands there."""
        if ax.get_aspect() == "auto":
            legend.set_bbox_to_anchor((0.0, 0.0, 1.0, 1.0), transform=ax.transAxes)
            legend.set_loc("best")
        elif len(ax.get_figure(root=True).axes) == 1:  # type: ignore[union-attr]
            legend.set_bbox_to_anchor((0.0, 0.0), transform=ax.transAxes)
            legend.set_loc("upper left")
            legend.borderaxespad = BELOW

    def _fit(self, figure: Figure) -> None:
        """Scale the figure until what is drawn, which is what is saved, has the width."""
        for _ in range(4):
            figure.draw_without_rendering()
            drawn = figure.get_tightbbox().width + 0.1
            if abs(drawn - self.width) < 2e-3 * self.width:
                return
            wide, high = figure.get_size_inches()
            figure.set_size_inches(min(max(wide + self.width - drawn, 0.5 * wide), 2.0 * wide), high)


_CURRENT: ContextVar[Print | None] = ContextVar("print", default=None)


def current() -> Print | None:
    """How figures are printed here; None on a screen."""
    return _CURRENT.get()


#: The settings of matplotlib belong to the process: one thread draws at a time.
_drawing = Lock()


@contextmanager
def drawing() -> Iterator[None]:
    """Context in which figures are drawn and saved; other threads wait."""
    with IMPORTS:
        import matplotlib.figure

    printed = current()
    with _drawing, matplotlib.rc_context(STYLE if printed is None else STYLE | printed.settings):
        with new_figures() as made:
            yield
        if printed is not None:
            for figure in made:
                printed.finish(figure)


def png(fig: Figure, dpi: int = 200) -> bytes:
    """The bytes of a figure as PNG, cropped to what is drawn."""
    with IMPORTS:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

    stream = io.BytesIO()
    with drawing():
        FigureCanvasAgg(fig).print_figure(stream, format="png", dpi=dpi, bbox_inches="tight", pad_inches=0.05)
    return stream.getvalue()


@contextmanager
def paper(
    width: str | float = "84mm",
    *,
    font: float = 8.0,
    legend: Legend | str = Legend.OUTSIDE,
    annotations: bool = False,
) -> Iterator[None]:
    """Context in which every figure is made for print.

    >>> import hemivar as hv
    >>> solution = hv.solve(hv.gallery.survey("5.1", 4))
    >>> with hv.report.paper("84mm", legend="inside"):
    ...     figure = solution.plot()  # figure.savefig("figure.pdf") has the width

    Parameters
    ----------
    width : str or float
        Of the whole figure, as saved by :func:`hemivar.report.save`: ``"84mm"``, ``"3.3in"``, ``"240pt"``; a number
        counts millimetres. It is met to about a percent.
    font : float
        Size of letters in points.
    legend : Legend or str
        ``"outside"``, ``"inside"`` or ``"none"``.
    annotations : bool
        Whether titles and the notes beside and below figures are kept.

    Yields
    ------
    None

    Raises
    ------
    ProblemError
        A width or a size of letters that makes no sense, or another place for legends.
    """
    inches = _width(width) / _INCH
    if not _FONTS[0] <= font <= _FONTS[1]:
        raise ProblemError(f"font = {font:g}; give a size from {_FONTS[0]:g} to {_FONTS[1]:g} points")
    try:
        legends = Legend(legend)
    except ValueError as error:
        raise ProblemError(f"legend = {quoted(legend)}; choose 'outside', 'inside' or 'none'") from error
    token = _CURRENT.set(Print(inches, font, legends, annotations))
    try:
        yield
    finally:
        _CURRENT.reset(token)


def _width(width: str | float) -> float:
    """A width in millimetres."""
    text, unit = str(width).strip(), 1.0
    for name, factor in _UNITS.items():
        if text.endswith(name):
            text, unit = text[: -len(name)], factor
    try:
        value = float(text) * unit
    except ValueError as error:
        raise ProblemError(f"width = {quoted(width)}; give a number with mm, cm, in or pt, such as '84mm'") from error
    if not (math.isfinite(value) and _WIDTHS[0] <= value <= _WIDTHS[1]):
        raise ProblemError(f"width = {quoted(width)}; give a width from {_WIDTHS[0]:g} to {_WIDTHS[1]:g} mm")
    return value
