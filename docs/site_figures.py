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


#: From the first solution to data of one's own; what is not named here comes last.
_ORDER = (
    "first_solution",
    "weighted_block",
    "units",
    "law_in_space",
    "own_laws",
    "all_methods",
    "cube_friction",
    "curved_contact",
    "hertz_obstacle",
    "patch_test",
    "membrane_obstacle",
    "antiplane_friction",
    "convexity_and_margin",
    "three_solutions",
    "weakening_friction",
    "delamination",
    "mixed_mode",
    "broken_foundation",
    "bounce",
    "stick_slip",
    "relaxation",
    "wear",
    "delayed_failure",
    "bar_impact",
    "thermoviscoelastic",
    "warm_start",
    "exact_distance",
    "adaptive_mesh",
    "trace_constants",
    "bar_from_arrays",
    "own_matrix_from_fem",
)


class ReadingOrder:
    """Key to sort the gallery by."""

    def __init__(self, src_dir: str) -> None:
        self.src_dir = src_dir

    def __call__(self, filename: str) -> tuple[int, str]:
        stem = filename.removesuffix(".py")
        return (_ORDER.index(stem) if stem in _ORDER else len(_ORDER)), stem

    def __repr__(self) -> str:
        return "ReadingOrder"


def _get_sg_image_scraper() -> Callable[..., str]:
    return _scrape
