"""Figures as files, and as bytes for pages."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from hemivar.basics.arguments import quoted
from hemivar.basics.disk import make_folder, path_of, shown, whole_file
from hemivar.basics.first_use import IMPORTS
from hemivar.errors import ProblemError
from hemivar.report.picture import drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["save", "svg"]


def save(fig: Figure, path: str | Path, *, dpi: int = 200) -> Path:
    """Write a figure as PNG, SVG or PDF, by the suffix of ``path``; returns the path.

    Parameters
    ----------
    fig : matplotlib Figure
    path : str or Path
    dpi : int
        Dots per inch, 10 to 2400.

    Returns
    -------
    Path

    Raises
    ------
    ProblemError
        Another suffix, or a resolution out of range.
    FileError
        The file or its folder cannot be made.
    """
    path = path_of(path)
    suffix = path.suffix.lower()
    if suffix not in (".png", ".svg", ".pdf"):
        raise ProblemError(f"'{shown(path)}': figures are written as .png, .svg or .pdf, not {quoted(path.suffix)}")
    if not 10 <= dpi <= 2400:
        raise ProblemError(f"dpi = {dpi}; give a resolution from 10 to 2400 dots per inch")
    make_folder(path.parent)
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(suffix[1:])
    with drawing(), whole_file(path) as name:
        fig.savefig(name, dpi=dpi, metadata=metadata, bbox_inches="tight", pad_inches=0.05)
    return path


def svg(fig: Figure) -> bytes:
    """The bytes of a figure as SVG, cropped to what is drawn, its letters as outlines: the same wherever it is read."""
    with IMPORTS:
        import matplotlib
        from matplotlib.backends.backend_svg import FigureCanvasSVG

    stream = io.BytesIO()
    with drawing(), matplotlib.rc_context({"svg.fonttype": "path", "svg.hashsalt": "hemivar"}):
        FigureCanvasSVG(fig).print_figure(
            stream, format="svg", metadata={"Date": None}, bbox_inches="tight", pad_inches=0.05
        )
    return stream.getvalue()
