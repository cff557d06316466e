"""Figures of the tutorials: ``python docs/tutorial_figures.py [PAGE ...]`` draws them anew from the code of the pages.

An image ``![...](images/tutorial-*.png)`` (or ``figure-*.png``) of a page shows what its code so far has put into
``figure``.  The site draws them when it is built; the files in docs/images are for readers of the pages as they are.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
MESH = DOCS.parent / "examples" / "meshes" / "bracket.msh"
PAGES = (
    "tutorial-teacher",
    "tutorial-mathematician",
    "tutorial-engineer",
    "tutorial-failure",
    "glue",
    "bodies",
    "nonlinear",
    "own-elements",
    "figures",
)
_PART = re.compile(
    r"^```python\n(?P<code>.*?)^```$|^!\[[^\]]*\]\(images/(?P<name>(?:tutorial|figure)-[\w-]+\.png)\)$", re.M | re.S
)


def names(page: str) -> list[str]:
    """The figures of a page.

    Parameters
    ----------
    page : str
        Its name without ``.md``.
    """
    return [found["name"] for found in _PART.finditer(_text(page)) if found["name"]]


def draw(page: str, folder: Path) -> None:
    """Run the code of a page and write its figures.

    Parameters
    ----------
    page : str
        Its name without ``.md``.
    folder : Path
        Where they go; made if it is not there.

    Raises
    ------
    LookupError
        An image has no new ``figure`` before it.
    """
    import matplotlib as mpl

    mpl.use("Agg")
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    space: dict[str, Any] = {"__name__": "__main__"}
    with contextlib.ExitStack() as stack:
        stack.enter_context(mpl.rc_context({"axes.formatter.limits": (-3, 4)}))
        place = stack.enter_context(tempfile.TemporaryDirectory())
        shutil.copy(MESH, place)  # as the page tells its reader to
        stack.enter_context(contextlib.chdir(place))
        stack.enter_context(contextlib.redirect_stdout(None))
        for found in _PART.finditer(_text(page)):
            if found["name"] is None:
                exec(compile(found["code"], f"{page}.md", "exec"), space)
                continue
            figure = space.pop("figure", None)
            if figure is None:
                raise LookupError(f"{page}.md: the code before {found['name']} draws no figure")
            figure.savefig(folder / found["name"], dpi=110, bbox_inches="tight", metadata={"Software": None})


def _text(page: str) -> str:
    return (DOCS / f"{page}.md").read_text(encoding="utf-8")


if __name__ == "__main__":
    for one in sys.argv[1:] or PAGES:
        draw(one, DOCS / "images")
