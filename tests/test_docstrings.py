"""Docstrings of public names by the rules of numpydoc, and what they leave out.

Held of every public function: a summary; each parameter, under its name, in order, with its type; what it returns or
yields; sections in their order; the errors that it raises itself, or what they are kinds of.  Of every public class:
a summary; each field of a dataclass under Parameters or Attributes, its own or those of a class it derives from.  Of
every public method: a docstring, its own or that of the class it overrides, and no parameter that it does not have;
what a sentence says of its parameters needs no section.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import runpy
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path
from types import FunctionType
from typing import Any

import pytest

from hemivar import errors
from hemivar.errors import FileError, ProblemError

pytest.importorskip("numpydoc")
from numpydoc.docscrape import NumpyDocString
from numpydoc.validate import validate

ROOMS = runpy.run_path(str(Path(__file__).parents[1] / "docs" / "api.py"))["ROOMS"]
#: Rules of numpydoc: form and order of sections, docstring, parameters, what is returned or yielded.
HELD = {"GL03", "GL05", "GL06", "GL07", "GL08", "GL10", "SS01", "PR01", "PR02", "PR03", "PR05", "PR10", "RT01", "YD01"}
HELD |= {"RT04", "RT05"}
#: Figures say what they are by their names; their functions return one.
FIGURES = re.compile(r"hemivar\.report\.plot_\w+")


def public() -> dict[str, Any]:
    """Every public class and function once, under one of its names."""
    found: dict[int, tuple[str, Any]] = {}
    for room in ROOMS:
        module = importlib.import_module(f"hemivar.{room}")
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.isclass(value) or inspect.isfunction(value):
                found.setdefault(id(value), (f"{module.__name__}.{name}", value))
    return dict(found.values())


PUBLIC = public()
FUNCTIONS = sorted(name for name, value in PUBLIC.items() if inspect.isfunction(value))
CLASSES = sorted(name for name, value in PUBLIC.items() if inspect.isclass(value))


def yields(function: Callable[..., Any]) -> bool:
    """Whether it is at work step by step."""
    told = str(inspect.signature(function).return_annotation).strip("'")
    return inspect.isgeneratorfunction(function) or told.startswith(("Work[", "Generator["))


def broken(name: str, value: Callable[..., Any]) -> list[str]:
    """Rules of numpydoc that a function does not keep."""
    found = {code: text for code, text in validate(name)["errors"] if code in HELD}
    if yields(value) or FIGURES.fullmatch(name):
        found.pop("RT01", None)  # a docstring has Yields or Returns
    return [f"{code}: {text}" for code, text in found.items()]


def raised(function: FunctionType) -> set[str]:
    """Errors of hemivar that stand behind ``raise`` in a function itself."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = (node.exc.func for node in ast.walk(tree) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call))
    names = {call.id for call in calls if isinstance(call, ast.Name)}
    return {name for name in names if name.endswith("Error") and name in vars(errors)}


def sections_and_names(value: Any) -> tuple[NumpyDocString, set[str]]:
    """A docstring in its sections, and the names under Parameters and Attributes."""
    text = NumpyDocString(inspect.getdoc(value) or "")
    rows = (*text["Parameters"], *text["Attributes"])
    return text, {name.strip().lstrip("*") for row in rows for name in row.name.split(",")}


def methods(kind: type) -> Iterator[tuple[str, Any]]:
    """Public methods and properties that a class defines."""
    for name, value in vars(kind).items():
        if not name.startswith("_") and isinstance(
            value, FunctionType | classmethod | staticmethod | property | cached_property
        ):
            yield name, value


def test_there_is_much_to_look_at() -> None:
    assert len(FUNCTIONS) > 120
    assert len(CLASSES) > 180


def unsaid(function: FunctionType) -> set[str]:
    """Errors that a function raises and does not list, nor what they are kinds of."""
    text, _ = sections_and_names(function)
    said = set(re.findall(r"\w+", " ".join(f"{row.name} {row.type}" for row in text["Raises"])))
    kinds = {error: {base.__name__ for base in vars(errors)[error].__mro__} for error in raised(function)}
    return {error for error, names in kinds.items() if not names & said}


def lacking(kind: type) -> Iterator[str]:
    """What the docstrings of a class and of its methods leave out, or say of parameters that are not there."""
    if not inspect.getdoc(kind):
        yield "no docstring"
    names = set().union(
        *(sections_and_names(base)[1] for base in kind.__mro__ if base.__module__.startswith(("hemivar", __name__)))
    )
    if is_dataclass(kind) and not issubclass(kind, Enum):
        own = {one.name for one in fields(kind) if one.init and not one.name.startswith("_")}
        yield from sorted(own - names)
    for method, value in methods(kind):
        whole = getattr(kind, method)
        if not (inspect.getdoc(whole) or inspect.getdoc(value)):
            yield f"{method} has no docstring"
        elif inspect.isfunction(whole) or inspect.ismethod(whole):
            text = NumpyDocString(inspect.getdoc(whole) or "")
            takes = set(inspect.signature(whole).parameters)
            said = {one.strip().lstrip("*") for row in text["Parameters"] for one in row.name.split(",")}
            yield from (f"{method} has no parameter {one}" for one in sorted(said - takes))


def test_a_function_says_what_it_takes_and_returns() -> None:
    assert {name: found for name in FUNCTIONS if (found := broken(name, PUBLIC[name]))} == {}


def test_a_function_says_what_it_raises() -> None:
    assert {name: found for name in FUNCTIONS if (found := unsaid(PUBLIC[name]))} == {}


def test_a_class_says_what_it_holds_and_can_do() -> None:
    assert {name: found for name in CLASSES if (found := list(lacking(PUBLIC[name])))} == {}


def taking(one: int, two: int) -> int:
    """Add.

    Parameters
    ----------
    one : int
    """
    if two < 0:
        raise ValueError
    return one + two


@dataclass(frozen=True)
class Sample:
    """What is held.

    Parameters
    ----------
    one : int
    """

    one: int
    two: int

    def undescribed(self) -> None: ...

    def moved(self, by: int) -> int:
        """Move.

        Parameters
        ----------
        by, far : int
        """
        return self.one + by


def refusing() -> None:
    """Refuse.

    Raises
    ------
    FileError
    """
    if ROOMS:
        raise FileError("no")
    raise ProblemError("no")


def test_what_is_left_out_is_found() -> None:
    found = broken(f"{__name__}.taking", taking)
    assert any("PR01" in one and "two" in one for one in found)
    assert any("RT01" in one for one in found)
    assert unsaid(refusing) == {"ProblemError"}
    assert list(lacking(Sample)) == ["two", "undescribed has no docstring", "moved has no parameter far"]
