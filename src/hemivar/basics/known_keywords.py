"""Unknown keywords answered by the sentence that an unknown key of a file gets."""

from __future__ import annotations

import functools
import inspect
import re
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from hemivar.basics.arguments import suggest
from hemivar.errors import ProblemError

__all__ = ["UnknownKeywordError", "known_fields", "known_keywords", "showing_options"]

Given = ParamSpec("Given")
Result = TypeVar("Result")
Class = TypeVar("Class", bound=type)


class UnknownKeywordError(ProblemError, TypeError):
    """A function or a class has no argument of that name."""


def known_keywords(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """The function, which refuses an argument that it does not have and names the nearest one."""
    known = tuple(name for name in inspect.signature(function).parameters if name != "self")
    shown = function.__qualname__.removesuffix(".__init__")

    @functools.wraps(function)
    def checked(*args: Given.args, **kwargs: Given.kwargs) -> Result:
        for name in kwargs:
            if name not in known:
                raise UnknownKeywordError(f"{shown} has no argument '{name}'{suggest(name, known, 'arguments')}")
        return function(*args, **kwargs)

    return checked


def showing_options(kind: type) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """Decorator: ``help`` shows the fields of a dataclass, and what it says of them, in the place of ``**options``,
    which are passed on to it."""

    def shown(function: Callable[Given, Result]) -> Callable[Given, Result]:
        own = inspect.signature(function)
        taken = [one for one in own.parameters.values() if one.kind is not one.VAR_KEYWORD]
        options = [
            one.replace(kind=one.KEYWORD_ONLY)
            for one in inspect.signature(kind).parameters.values()
            if one.name not in own.parameters
        ]
        function.__signature__ = own.replace(parameters=[*taken, *options])  # type: ignore[attr-defined]
        said = "".join(_said(kind).get(one.name, "") for one in options)
        function.__doc__ = inspect.getdoc(function) and f"{inspect.getdoc(function)}\n".replace("**options\n", said)
        return function

    return shown


def _said(kind: type) -> dict[str, str]:
    """What a dataclass says under Parameters, by the names of its fields."""
    section = re.search(r"\nParameters\n-+\n((?:.+\n)+)", f"{inspect.getdoc(kind)}\n")
    entries = re.findall(r"^\w.*\n(?: .*\n)*", section[1] if section else "", re.MULTILINE)
    return {entry.partition(" :")[0]: entry for entry in entries}


def known_fields(kind: Class) -> Class:
    """The dataclass, which refuses arguments that it does not have, as :func:`known_keywords` does."""
    kind.__init__ = known_keywords(kind.__init__)  # type: ignore[misc]
    return kind
