"""What the code of the lessons prints: ``python docs/lesson_outputs.py [PAGE ...]`` writes it below every block.

Below a block that prints stands ``It prints:`` and a block of text, below one that takes time how long it takes.  The
tests run the blocks and compare what they print (``same``).
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

DOCS = Path(__file__).resolve().parent
MESH = DOCS.parent / "examples" / "meshes" / "bracket.msh"
LESSONS = ("tutorial-engineer", "tutorial-failure", "tutorial-mathematician", "tutorial-teacher")
#: A block of code, the line that says what it prints or how long it takes, and what it prints.
BLOCK = re.compile(
    r"^```python\n(?P<code>.*?)^```\n"
    r"(?P<output>(?:\n(?P<line>It (?:prints|takes)[^\n]*)\n(?:\n```text\n(?P<printed>.*?)^```\n)?)?)",
    re.M | re.S,
)
_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d*)?(?:e[-+]?\d+)?(?![\w])")


def run(text: str, page: str) -> Iterator[tuple[re.Match[str], str, float]]:
    """Run the blocks of a page one after the other, in the current folder.

    Parameters
    ----------
    text : str
        Of the page.
    page : str
        Its name, for messages.

    Yields
    ------
    block : match of BLOCK
    printed : str
        What it printed.
    seconds : float
        The processor time that it took.
    """
    space: dict[str, Any] = {"__name__": "__main__"}
    for block in BLOCK.finditer(text):
        code = compile(block["code"], page, "exec")
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            begin = time.process_time()
            exec(code, space)
            seconds = time.process_time() - begin
        yield block, printed.getvalue(), seconds


def same(shown: str, printed: str) -> bool:
    """Whether a page shows what a block printed: the same words, numbers to a hundredth, seconds whatever they are.

    Numbers below 1e-8, such as residuals, are rounding: any of them will do.

    Parameters
    ----------
    shown, printed : str
    """
    words = [" ".join(_NUMBER.sub("#", text).split()) for text in (shown, printed)]
    if words[0] != words[1]:
        return False
    pairs = zip(_NUMBER.finditer(shown), _NUMBER.finditer(printed), strict=True)
    return all(
        math.isclose(float(a[0]), float(b[0]), rel_tol=1e-2, abs_tol=1e-8) or re.match(r" s\b", shown[a.end() :])
        for a, b in pairs
    )


def with_outputs(text: str, page: str) -> str:
    """The page with what its blocks print now, and how long they take.

    Parameters
    ----------
    text, page : str
        As for :func:`run`.
    """
    found = []
    end = 0
    for block, printed, seconds in run(text, page):
        found += [text[end : block.start()], f"```python\n{block['code']}```\n", _output(printed, seconds)]
        end = block.end()
    return "".join([*found, text[end:]])


def _output(printed: str, seconds: float) -> str:
    about = f"about {seconds:.0f} s" if seconds >= 0.75 else ""
    if not printed:
        return f"\nIt takes {about}.\n" if about else ""
    shown = "".join(f"{line.rstrip()}\n" for line in printed.rstrip().splitlines())
    return f"\nIt prints{', after ' + about if about else ''}:\n\n```text\n{shown}```\n"


if __name__ == "__main__":
    os.environ["MPLBACKEND"] = "Agg"
    for name in sys.argv[1:] or LESSONS:
        path = DOCS / f"{name}.md"
        with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
            shutil.copy(MESH, place)
            text = with_outputs(path.read_text(encoding="utf-8"), path.name)
        path.write_text(text, encoding="utf-8")
