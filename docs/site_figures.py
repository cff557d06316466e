"""Figures of the gallery: those of pyplot, and a figure that is the last value of a cell."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst, matplotlib_scraper

#: The last one that was drawn: the value of a cell stays until the next cell has one.
_DRAWN: list[Figure] = []


def _scrape(block: tuple[Any, ...], block_vars: dict[str, Any], gallery_conf: dict[str, Any], **kwargs: Any) -> str:
    found = matplotlib_scraper(block, block_vars, gallery_conf, **kwargs)
    last = block_vars["example_globals"].get("___")
    if not isinstance(last, Figure) or any(last is drawn for drawn in _DRAWN):
        return str(found)
    _DRAWN[:] = [last]
    path = next(block_vars["image_path_iterator"])
    last.savefig(path, dpi=150, bbox_inches="tight")
    return str(found) + figure_rst([path], gallery_conf["src_dir"])


def _get_sg_image_scraper() -> Callable[..., str]:
    return _scrape
