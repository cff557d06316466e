"""The examples of docstrings: what they print is what they say, and each name of ``hemivar`` has one."""

from __future__ import annotations

import ast
import doctest
from collections.abc import Iterator
from pathlib import Path

import pytest

import hemivar as hv
from tests.sources import PACKAGE


def with_examples(path: Path) -> Iterator[tuple[str, str]]:
    """Name and docstring of whatever shows an example in a file."""
    text = path.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)) if ">>> " in text else ():
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and ">>> " in (ast.get_docstring(node) or ""):
            yield node.name, ast.get_docstring(node) or ""


SHOWN = {f"{path.stem}.{name}": text for path in sorted(PACKAGE.rglob("*.py")) for name, text in with_examples(path)}


@pytest.mark.parametrize("name", SHOWN)
def test_an_example_prints_what_it_says(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """By the text of the docstring: the finder of doctest passes over functions that are wrapped."""
    example = doctest.DocTestParser().get_doctest(SHOWN[name], {}, name, None, None)
    runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
    assert runner.run(example).failed == 0, capsys.readouterr().out


@pytest.mark.parametrize("name", sorted(set(hv.__all__) - {"__version__"}))
def test_every_name_of_hemivar_shows_a_use(name: str) -> None:
    assert ">>> " in (getattr(hv, name).__doc__ or "")
