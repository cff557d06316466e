"""Figures of the tutorials: each is drawn by the code before it, and the files are what that code draws now."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
FIGURES = runpy.run_path(str(ROOT / "docs" / "tutorial_figures.py"))
IMAGES = ROOT / "docs" / "images"


def test_every_image_of_a_tutorial_is_drawn_by_its_code_and_described() -> None:
    told = set()
    for page in FIGURES["PAGES"]:
        text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
        images = re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", text)
        assert [f"images/{name}" for name in FIGURES["names"](page)] == [path for _, path in images]
        assert len(images) >= 3
        assert all(len(words.split()) > 5 for words, _ in images)
        told |= set(FIGURES["names"](page))
    drawn = (path for kind in ("tutorial", "figure") for path in IMAGES.glob(f"{kind}-*.png"))
    assert told == {path.name for path in drawn}


def looks_alike(drawn: Path, kept: Path) -> bool:
    """Whether two pictures are the same but for a letter that another version of the plotter moves."""
    from PIL import Image

    now, then = (np.asarray(Image.open(one).convert("L").resize((96, 72)), dtype=float) for one in (drawn, kept))
    assert now.std() > 5.0
    return bool(np.abs(now - then).mean() < 1.5)  # another number of an axis, or a node, moves more


#: Figures with the seconds of a machine in them.
TIMED = ("figure-adaptive.png",)


@pytest.mark.slow
@pytest.mark.parametrize("page", FIGURES["PAGES"])
def test_the_files_are_what_the_code_draws(page: str, tmp_path: Path) -> None:
    FIGURES["draw"](page, tmp_path)
    for name in FIGURES["names"](page):
        drawn = looks_alike(tmp_path / name, IMAGES / name)
        assert name in TIMED or drawn, f"{name}: python docs/tutorial_figures.py"


def test_an_image_without_a_figure_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "page.md").write_text("```python\na = 1\n```\n\n![words](images/tutorial-page-a.png)\n")
    monkeypatch.setitem(FIGURES["draw"].__globals__, "DOCS", tmp_path)
    with pytest.raises(LookupError, match=r"page\.md: the code before tutorial-page-a\.png draws no figure"):
        FIGURES["draw"]("page", tmp_path)
