"""Figures that a notebook shows by themselves, whether or not it has been told how (``%matplotlib inline``)."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Literal

from hemivar.basics.first_use import IMPORTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["new_figure"]

#: Dots per inch in a notebook.
_DPI = 110


def new_figure(size: tuple[float, float], *, layout: Literal["constrained", "tight"] | None = None) -> Figure:
    """A figure of this size in inches: matplotlib's own, which knows how to be shown in a notebook.

    pyplot does not know of it: nothing must be closed, and no magic is needed.
    """
    return _kind()(figsize=size, layout=layout)


@cache
def _kind() -> type[Figure]:
    with IMPORTS:
        from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure as a notebook shows it."""

        def _repr_png_(self) -> bytes:
            with IMPORTS:
                from hemivar.report.saving import png

            return png(self, _DPI)

    Picture.__qualname__ = "Picture"
    return Picture


def __getattr__(name: str) -> object:
    """``Picture``, by which figures are pickled and copied; matplotlib is loaded for it."""
    if name == "Picture":
        return _kind()
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
