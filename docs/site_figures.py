"""Figures of the gallery: those of pyplot, and a figure that is the last value of a cell."""

from __future__ import annotations

import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.quiver import QuiverKey
from matplotlib.text import Annotation
from PIL import Image, ImageOps
from sphinx_gallery.scrapers import figure_rst, matplotlib_scraper

#: The last one that was drawn: the value of a cell stays until the next cell has one.
_DRAWN: list[Figure] = []


def _scrape(block: tuple[Any, ...], block_vars: dict[str, Any], gallery_conf: dict[str, Any], **kwargs: Any) -> str:
    figures = [plt.figure(number) for number in plt.get_fignums()]
    found = str(matplotlib_scraper(block, block_vars, gallery_conf, **kwargs))
    last = block_vars["example_globals"].get("___")
    if isinstance(last, Figure) and not any(last is drawn for drawn in _DRAWN):
        _DRAWN[:] = [last]
        figures.append(last)
        path = next(block_vars["image_path_iterator"])
        last.savefig(path, dpi=150, bbox_inches="tight")
        found += figure_rst([path], gallery_conf["src_dir"])
    folder = Path(gallery_conf["src_dir"], "gallery", "images")
    for name, figure in zip(dict.fromkeys(re.findall(r"sphx_glr_\w+\.png", found)), figures, strict=True):
        save_card(figure, folder / name.replace("sphx_glr_", "card_"))
    return found


def save_card(figure: Figure, path: Path) -> None:
    """A figure as a square picture of its largest axes, without scales, titles and legends; it is spoilt by this."""
    figure.canvas.draw()
    panels = [one for one in figure.axes if one.get_label() != "<colorbar>"]
    axes = max(panels, key=lambda one: one.get_position().width * one.get_position().height)
    for part in (*figure.texts, *figure.legends, *figure.axes, axes.get_legend()):
        if part is not None:
            part.set_visible(part is axes)
    for key in axes.findobj(QuiverKey):
        key.remove()  # it is drawn whether visible or not
    for text in (axes.title, *axes.texts):
        text.set_visible(isinstance(text, Annotation) and not text.get_text())  # an arrow
    figure.suptitle("")
    figure.set_layout_engine("none")
    body = axes.get_aspect() != "auto"
    axes.set_axis_off() if body else axes.tick_params(which="both", labelbottom=False, labelleft=False, length=0.0)
    axes.set(xlabel="", ylabel="")
    if not body:
        figure.set_size_inches(4.0, 4.0)
        axes.set_position((0.04, 0.04, 0.92, 0.92))
    drawn = BytesIO()
    figure.savefig(drawn, format="png", dpi=200.0, facecolor="white")
    picture = Image.open(drawn).convert("RGB")
    seen = picture.crop(ImageOps.invert(picture).getbbox())
    square = ImageOps.pad(seen, (460, 460), color="white")
    ImageOps.expand(square, 10, "white").quantize(128).save(path)


#: The gallery: its sections, from the first solution to data of one's own; what is not named here comes last.
SECTIONS = {
    "First steps": (
        "first_solution", "weighted_block", "units", "law_in_space", "all_methods", "warm_start", "retaining_wall",
    ),
    "Laws": ("own_laws", "weakening_friction", "delamination", "mixed_mode", "broken_foundation"),
    "Several solutions": ("convexity_and_margin", "three_solutions", "trace_constants"),
    "Bodies that touch": ("two_cylinders", "two_spheres", "press_fit", "three_blocks", "wheel_on_rail"),
    "Bodies of revolution": ("indenters", "sticky_sphere"),
    "In 3D, and one unknown": ("cube_friction", "membrane_obstacle", "antiplane_friction"),
    "Time": (
        "bounce", "stick_slip", "relaxation", "wear", "delayed_failure", "bar_impact", "thermoviscoelastic",
    ),
    "Exactness": ("exact_distance", "adaptive_mesh"),
    "Verification": ("patch_test", "hertz_obstacle", "curved_contact", "double_cantilever"),
    "Your own elements": (
        "rubber_bearing", "slip_flow", "piezoelectric_sensor", "sinking_plate", "glued_bracket",
    ),
    "Matrices of other codes": ("bar_from_arrays", "own_matrix_from_fem"),
}  # fmt: skip
_ORDER = tuple(name for names in SECTIONS.values() for name in names)
#: Which figure of an example its card shows, where it is not the first.
_SHOWN = {
    "adaptive_mesh": 2, "broken_foundation": 2, "delayed_failure": 2, "exact_distance": 2, "first_solution": 2,
    "hertz_obstacle": 2, "three_blocks": 2,
}  # fmt: skip
_CARD = re.compile(r'^\.\. raw:: html\n\n    <div class="sphx-glr-thumbcontainer".*?^    </div>\n', re.M | re.S)
_OPEN = '.. raw:: html\n\n    <div class="sphx-glr-thumbnails">\n\n'
_CLOSE = ".. raw:: html\n\n    </div>\n\n"


def card_of(example: str) -> str:
    """The file in the images of the gallery that is the card of an example."""
    return f"card_{example}_{_SHOWN.get(example, 1):03d}.png"


def into_sections(index: Path) -> None:
    """Put the cards of the gallery, which stand one after the other, under headings.

    Parameters
    ----------
    index : Path
        Written by sphinx-gallery.
    """
    text = index.read_text(encoding="utf-8")
    head, foot = f"{_OPEN}.. thumbnail-parent-div-open\n", f".. thumbnail-parent-div-close\n\n{_CLOSE}"
    if head not in text:
        return  # it has its sections
    before, rest = text.split(head, 1)
    middle, after = rest.split(foot, 1)
    cards = {re.findall(r":doc:`/gallery/(\w+)`", card)[0]: card for card in _CARD.findall(middle)}
    for name, card in cards.items():
        figure = f"images/{card_of(name)}"
        if (index.parent / figure).exists():
            cards[name] = card.replace(f"images/thumb/sphx_glr_{name}_thumb.png", figure)
    sections = {**SECTIONS, "Others": tuple(name for name in cards if name not in _ORDER)}
    body = ""
    for title, names in sections.items():
        if there := [cards[name] for name in names if name in cards]:
            body += f"{title}\n{'-' * len(title)}\n\n{_OPEN}" + "\n".join(there) + f"\n{_CLOSE}"
    index.write_text(before + body + after, encoding="utf-8")


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
