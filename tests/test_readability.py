"""Pages are written in short sentences: at most 20 words on the average, counted without code, tables and formulas.

Neither they nor docstrings of what packages export use words that only this project used.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.sources import PACKAGE

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    [
        *(ROOT / "docs").glob("*.md"),
        *(ROOT / "docs" / "theory").glob("*.md"),
        *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "paper/paper.md")),
    ]
)
MOST = 20.0

_LEFT_OUT = (
    re.compile(r"```.*?```", re.DOTALL),  # code, directives
    re.compile(r"\$\$.*?\$\$", re.DOTALL),  # formulas
    re.compile(r"^\s*\|.*$", re.MULTILINE),  # tables
    re.compile(r"^#.*$", re.MULTILINE),  # headings
    re.compile(r"^(?: {4}|\t).*$", re.MULTILINE),  # indented code
    re.compile(r"^\([\w-]+\)=$|^---$|^:::.*$|<[^>]*>", re.MULTILINE),  # targets and markup
    re.compile(r"!\[[^\]]*\]\([^)]*\)"),  # pictures
)


def sentences(text: str) -> list[list[str]]:
    """Words of each sentence of the prose of a page."""
    for pattern in _LEFT_OUT:
        text = pattern.sub("\n\n", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)  # links
    text = re.sub(r"`[^`\n]*`|\$[^$\n]*\$", "x", text)  # what is set as code or formula is one word
    found = []
    for block in re.split(r"\n\s*\n|^\s*(?:[-*]|\d+\.)\s", text, flags=re.MULTILINE):
        for sentence in re.split(r"(?<=[.!?:])[\"')*]*\s+(?=[A-Z0-9x\"'(*])", " ".join(block.split())):
            words = re.findall(r"[A-Za-z0-9][\w'/.,-]*", sentence)
            if len(words) > 2:
                found.append(words)
    return found


def mean_length(text: str) -> float:
    """Words in a sentence, on the average."""
    found = sentences(text)
    return sum(map(len, found)) / len(found) if found else 0.0


def test_sentences_are_short() -> None:
    means = {page: mean_length(page.read_text(encoding="utf-8")) for page in PAGES}
    told = [f"{page.relative_to(ROOT)}: {mean:.1f} words in a sentence" for page, mean in means.items() if mean > MOST]
    assert not told, "\n".join([f"at most {MOST:.0f} on the average:", *told])


def test_the_count_knows_what_a_sentence_is() -> None:
    text = (
        "# A heading\n\nOne two three. Four five six seven?\n\n```python\nx = 1\n```\n\n| a | table of many words |\n"
    )
    assert [len(words) for words in sentences(text)] == [3, 4]
    assert mean_length("A line of [a link](far/away.md) and `some code`, $x = 1$ too.\n") == 9.0


#: Words that say nothing to a reader from outside; messages have more of them (``tests/test_messages.py``).
HOME_MADE = re.compile(r"\b(anew|told|at hand|booked|put in|beside it|all the same)\b")


def docstrings(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Names and docstrings of what a module exports, members without ``_`` included."""
    exported = {
        name.value
        for node in tree.body
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"
        for name in getattr(node.value, "elts", ())
        if isinstance(name, ast.Constant)
    }

    def inside(node: ast.AST, outer: bool) -> Iterator[tuple[str, str]]:
        for one in ast.iter_child_nodes(node):
            if not isinstance(one, ast.FunctionDef | ast.ClassDef):
                continue
            if one.name in exported if outer else one.name[0] != "_":
                yield one.name, ast.get_docstring(one) or ""
                yield from inside(one, False)

    return inside(tree, True)


def test_pages_and_docstrings_use_words_of_the_field() -> None:
    pages = ((str(page.relative_to(ROOT)), page.read_text(encoding="utf-8")) for page in PAGES)
    files = ((path.relative_to(PACKAGE), ast.parse(path.read_text(encoding="utf-8"))) for path in PACKAGE.rglob("*.py"))
    modules = ((f"{path}: {name}", text) for path, tree in files for name, text in docstrings(tree))
    found = [f"{place}: {word}" for place, text in (*pages, *modules) for word in HOME_MADE.findall(text)]
    assert found == []


def test_a_home_made_word_is_found_in_a_docstring() -> None:
    code = '__all__ = ["f"]\n\ndef f():\n    """It is computed anew."""\n\ndef g():\n    """Anew."""\n'
    (found,) = docstrings(ast.parse(code))
    assert HOME_MADE.findall(found[1]) == ["anew"]
