"""Figures that a notebook shows by themselves, whether or not it has been told how (``%matplotlib inline``)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import TYPE_CHECKING, Literal

from hemivar.basics.first_use import IMPORTS
from hemivar.report.paper import current

if TYPE_CHECKING:
    from matplotlib.backend_bases import RendererBase
    from matplotlib.figure import Figure

__all__ = ["new_figure", "new_figures"]

#: Dots per inch in a notebook.
_DPI = 110
#: Letters of a line of text that are drawn, and lines of a text.
_LONGEST = 200
_MOST_LINES = 50
#: Figures of the drawing that is under way.
_MADE: ContextVar[list[Figure] | None] = ContextVar("made", default=None)


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

        def _repr_png_(self) -> bytes:
            with IMPORTS:
                from hemivar.report.saving import png

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
